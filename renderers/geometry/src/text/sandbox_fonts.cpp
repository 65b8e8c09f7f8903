// Gives fonts to workers of the sandbox, and checks what comes out.
#include "sandbox_fonts.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <unordered_map>

#include <rtsg/core/sandbox.h>

namespace rtsg {

namespace {

enum class FontAction : std::uint32_t { measure, shape, outline, box };

/// The language and the text follow, for `shape`.
struct FontJob {
    FontAction action = FontAction::measure;
    std::uint32_t glyph = 0, leftToRight = 0, languageSize = 0;
};
struct FontMetrics {
    float ascent = 0, descent = 0;
};
/// The glyphs follow, then the bytes of each character that there is no glyph for, as pairs of where it begins and
/// ends.
struct LineHead {
    std::uint32_t glyphs = 0, missing = 0;
    float width = 0;
};
struct CharacterBytes {
    std::uint32_t begin = 0, end = 0;
};

// ---- in the worker ---------------------------------------------------------------------------------------------

Result<> prepareFonts() {
    const auto fonts = fontsHere();
    return fonts ? Result<>() : std::unexpected(fonts.error());
}

void appendNumbers(std::string& out, const auto& numbers) {
    out += sandboxText(numbers);
}
void answerWith(SandboxJob& job, const std::string& bytes) {
    std::memcpy(job.room(bytes.size()).data(), bytes.data(), bytes.size());
    job.answer({});
}

/// Where the character that begins here ends.
std::size_t endOfCharacter(std::string_view text, std::size_t at) {
    do {
        ++at;
    } while (at < text.size() && (static_cast<unsigned char>(text[at]) & 0xC0u) == 0x80u);
    return at;
}

void shapeIn(SandboxJob& job, const Fonts& fonts, std::uint32_t face, const FontJob& wanted, std::string_view rest) {
    const std::string language(rest.substr(0, wanted.languageSize)), text(rest.substr(language.size()));
    ShapedLine line, one;
    fonts.shape(face, text, language, wanted.leftToRight != 0, line);
    std::vector<CharacterBytes> missing;
    for (std::size_t at = 0; line.missing > 0 && at < text.size();) {
        const std::size_t end = endOfCharacter(text, at);
        fonts.shape(face, text.substr(at, end - at), language, true, one);
        if (one.missing > 0) missing.push_back({static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(end)});
        at = end;
    }
    std::string all = sandboxText(LineHead{static_cast<std::uint32_t>(line.glyphs.size()),
                                           static_cast<std::uint32_t>(missing.size()), line.width});
    for (const PlacedGlyph& glyph : line.glyphs) appendNumbers(all, glyph);
    for (const CharacterBytes& bytes : missing) appendNumbers(all, bytes);
    answerWith(job, all);
}

void outlineIn(SandboxJob& job, const Fonts& fonts, std::uint32_t face, std::uint32_t glyph) {
    std::vector<GlyphContour> contours;
    fonts.outline(face, glyph, contours);
    std::string all;
    for (const GlyphContour& contour : contours) {
        appendNumbers(all, static_cast<std::uint32_t>(contour.segments.size()));
        appendNumbers(all, static_cast<std::uint32_t>(contour.points.size()));
        all.append(reinterpret_cast<const char*>(contour.segments.data()), contour.segments.size());
        all.append(reinterpret_cast<const char*>(contour.points.data()), contour.points.size() * sizeof(float));
    }
    answerWith(job, all);
}

void serveFonts(SandboxJob& job) {
    FontJob wanted;
    std::string_view rest = job.head();
    takeSandboxNumbers(rest, wanted);
    const Fonts& fonts = **fontsHere();
    std::uint32_t face = 0;
    const std::string_view file(reinterpret_cast<const char*>(job.bytes().data()), job.bytes().size());
    if (const std::string why = fonts.load(file, face); !why.empty()) throw std::runtime_error(why);
    if (wanted.action == FontAction::shape) return shapeIn(job, fonts, face, wanted, rest);
    if (wanted.action == FontAction::outline) return outlineIn(job, fonts, face, wanted.glyph);
    if (wanted.action == FontAction::box) return answerWith(job, sandboxText(fonts.box(face, wanted.glyph)));
    FontRequest request{.families = {"a"}};
    request.loaded = face;
    FontChoice choice;
    fonts.choose(request, choice);
    answerWith(job, sandboxText(FontMetrics{choice.ascent, choice.descent}));
}

constexpr SandboxTask kFontTask{"fonts", prepareFonts, serveFonts};

// ---- in the process that draws text ------------------------------------------------------------------------------

constexpr const char* kBrokenFont = "the library that reads it is broken";
constexpr float kLargestGlyph = 1e6f;  // ems

bool isLength(float value) {
    return std::abs(value) <= kLargestGlyph;
}

/// The bytes of an answer; nothing but why there is none.
bool askWorker(std::string_view file, const FontJob& job, std::string_view rest, std::string& bytes, std::string& why) {
    const auto result = runSandboxed(kFontTask, sandboxText(job, rest),
                                     {reinterpret_cast<const std::uint8_t*>(file.data()), file.size()});
    if (!result) return why = result.error().text, false;
    bytes.resize(result->size());
    if (!result->read({reinterpret_cast<std::uint8_t*>(bytes.data()), bytes.size()})) return why = kBrokenFont, false;
    return true;
}

class SandboxedFonts final : public Fonts {
  public:
    std::string load(std::string_view file, std::uint32_t& face) const override {
        const std::scoped_lock lock(mutex_);
        const auto known = std::ranges::find(own_, file, [](const auto& one) { return std::string_view(one->file); });
        if (known != own_.end()) return face = kOwn + static_cast<std::uint32_t>(known - own_.begin()), "";
        if (own_.size() >= kMaxLoaded || file.size() > kMaxBytes - bytes_) return "it is one font more than are kept";
        std::string bytes, why;
        auto font = std::make_shared<Own>();
        if (!askWorker(file, {}, {}, bytes, why)) return why;
        std::string_view rest = bytes;
        if (!takeSandboxNumbers(rest, font->metrics) || !isLength(font->metrics.ascent) ||
            !isLength(font->metrics.descent))
            return kBrokenFont;
        font->file = file;
        bytes_ += file.size();
        face = kOwn + static_cast<std::uint32_t>(own_.size());
        own_.push_back(std::move(font));
        return {};
    }

    std::string choose(const FontRequest& request, FontChoice& out) const override {
        const auto here = fontsHere();
        if (!here) return here.error().text;
        if (request.loaded == FontRequest::kNone || request.loadedAt >= request.families.size())
            return (*here)->choose({request.families, request.bold, request.italic}, out);
        // A family before it that is installed comes first.
        for (std::size_t i = 0; i < request.loadedAt; ++i) {
            FontRequest before{{request.families[i]}, request.bold, request.italic};
            if (!(*here)->choose(before, out).empty() || out.said.starts_with("font family ")) continue;
            before.families.assign(request.families.begin(),
                                   request.families.begin() + static_cast<std::ptrdiff_t>(i) + 1);
            return (*here)->choose(before, out);
        }
        const std::shared_ptr<const Own> font = own(request.loaded);
        out = {request.loaded, font->metrics.ascent, font->metrics.descent, {}};
        if (request.loadedAt > 0)
            out.said = "font family \"" + request.families[0] + "\" is not installed: \"" +
                       request.families[request.loadedAt] + "\" is used";
        return {};
    }

    void shape(std::uint32_t face, const std::string& text, const std::string& language, bool leftToRight,
               ShapedLine& out) const override {
        out = {};
        const auto here = fontsHere();
        if (face < kOwn) return here ? (*here)->shape(face, text, language, leftToRight, out) : void();
        std::vector<CharacterBytes> missing;
        if (!shapeOwn(face, text, language, leftToRight, out, missing) || missing.empty()) return;
        FontChoice other;
        if (!here || !(*here)->choose({{"SANS"}}, other).empty()) {
            out.missing = static_cast<std::uint32_t>(missing.size());
            return;
        }
        shapeMixed(face, other.face, missing, text, language, leftToRight, out);
    }

    void outline(std::uint32_t face, std::uint32_t glyph, std::vector<GlyphContour>& out) const override {
        out.clear();
        const auto here = fontsHere();
        if (face < kOwn) return here ? (*here)->outline(face, glyph, out) : void();
        std::string bytes, why;
        if (!askWorker(own(face)->file, {FontAction::outline, glyph, 0, 0}, {}, bytes, why)) return;
        std::string_view rest = bytes;
        std::uint32_t segments = 0, numbers = 0;
        while (takeSandboxNumbers(rest, segments) && takeSandboxNumbers(rest, numbers)) {
            GlyphContour contour;
            if (segments > rest.size() || numbers > (rest.size() - segments) / sizeof(float)) break;
            contour.segments.assign(rest.begin(), rest.begin() + segments);
            rest.remove_prefix(segments);
            contour.points.resize(numbers);
            std::memcpy(contour.points.data(), rest.data(), numbers * sizeof(float));
            rest.remove_prefix(numbers * sizeof(float));
            std::size_t points = 1;
            for (const std::uint8_t count : contour.segments) points += count;
            const bool isSane = numbers == 2 * points && std::ranges::all_of(contour.points, isLength) &&
                                std::ranges::all_of(contour.segments, [](int n) { return n >= 1 && n <= 3; });
            if (!isSane) return out.clear();
            out.push_back(std::move(contour));
        }
    }

    GlyphBox box(std::uint32_t face, std::uint32_t glyph) const override {
        const auto here = fontsHere();
        if (face < kOwn) return here ? (*here)->box(face, glyph) : GlyphBox();
        const std::uint64_t key = std::uint64_t{face} << 32 | glyph;
        {
            const std::scoped_lock lock(mutex_);
            if (const auto found = boxes_.find(key); found != boxes_.end()) return found->second;
        }
        std::string bytes, why;
        GlyphBox box;
        // A bool of another process may be neither true nor false.
        struct Box {
            float left, bottom, right, top;
            std::uint32_t empty;
        } read{};
        static_assert(sizeof(Box) == sizeof(GlyphBox));
        std::string_view rest;
        if (askWorker(own(face)->file, {FontAction::box, glyph, 0, 0}, {}, bytes, why) &&
            takeSandboxNumbers(rest = bytes, read) && isLength(read.left) && isLength(read.bottom) &&
            isLength(read.right) && isLength(read.top))
            box = {read.left, read.bottom, read.right, read.top, (read.empty & 0xFF) != 0};
        const std::scoped_lock lock(mutex_);
        constexpr std::size_t kMaxBoxes = 1 << 16;
        if (boxes_.size() >= kMaxBoxes) boxes_.clear();
        return boxes_[key] = box;
    }

    bool shapes() const override {
        const auto here = fontsHere();
        return here && (*here)->shapes();
    }

  private:
    static constexpr std::uint32_t kOwn = 1u << 30;  // the first face of a stranger
    struct Own {
        std::string file;
        FontMetrics metrics;
    };

    std::shared_ptr<const Own> own(std::uint32_t face) const {
        const std::scoped_lock lock(mutex_);
        return own_[face - kOwn];
    }

    /// The line by the stranger's font alone. False: it is empty, since the worker did not do it.
    bool shapeOwn(std::uint32_t face, const std::string& text, const std::string& language, bool leftToRight,
                  ShapedLine& out, std::vector<CharacterBytes>& missing) const {
        std::string bytes, why;
        LineHead head;
        const FontJob job{FontAction::shape, 0, leftToRight ? 1U : 0U, static_cast<std::uint32_t>(language.size())};
        if (!askWorker(own(face)->file, job, language + text, bytes, why)) return false;
        std::string_view rest = bytes;
        if (!takeSandboxNumbers(rest, head) || !isLength(head.width)) return false;
        PlacedGlyph glyph;
        for (std::uint32_t i = 0; i < head.glyphs && takeSandboxNumbers(rest, glyph); ++i) {
            if (!isLength(glyph.x) || !isLength(glyph.y)) return out = {}, false;
            out.glyphs.push_back({face, glyph.glyph, glyph.x, glyph.y});
        }
        out.width = head.width;
        CharacterBytes one;
        std::uint32_t before = 0;
        for (std::uint32_t i = 0; i < head.missing && takeSandboxNumbers(rest, one); ++i) {
            if (one.begin < before || one.end <= one.begin || one.end > text.size()) return out = {}, false;
            before = one.end;
            missing.push_back(one);
        }
        return true;
    }

    /// Pieces of the line that the font has, and pieces that it lacks, one after the other.
    void shapeMixed(std::uint32_t face, std::uint32_t other, const std::vector<CharacterBytes>& missing,
                    const std::string& text, const std::string& language, bool leftToRight, ShapedLine& out) const {
        std::vector<std::pair<std::uint32_t, std::string>> pieces;
        std::size_t at = 0;
        const auto add = [&](std::uint32_t with, std::size_t end) {
            if (end <= at) return;
            if (pieces.empty() || pieces.back().first != with) pieces.emplace_back(with, "");
            pieces.back().second += text.substr(at, end - at);
            at = end;
        };
        for (const CharacterBytes& one : missing) add(face, one.begin), add(other, one.end);
        add(face, text.size());
        if (!leftToRight) std::ranges::reverse(pieces);
        out = {};
        for (const auto& [with, piece] : pieces) {
            ShapedLine part;
            std::vector<CharacterBytes> none;
            if (with == face)
                (void)shapeOwn(face, piece, language, leftToRight, part, none);
            else
                shape(other, piece, language, leftToRight, part);
            for (PlacedGlyph glyph : part.glyphs) {
                glyph.x += out.width;
                out.glyphs.push_back(glyph);
            }
            out.width += part.width;
            out.missing += part.missing;
        }
    }

    mutable std::mutex mutex_;
    mutable std::vector<std::shared_ptr<const Own>> own_;  // by their numbers
    mutable std::size_t bytes_ = 0;
    mutable std::unordered_map<std::uint64_t, GlyphBox> boxes_;
};

}  // namespace

const Fonts& sandboxedFonts() {
    // For as long as the process lives: whoever draws text keeps no hold of it.
    static const auto* const fonts = new SandboxedFonts;
    return *fonts;
}

}  // namespace rtsg
