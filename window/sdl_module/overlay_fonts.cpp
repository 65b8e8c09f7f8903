// Finds fonts for letters, and turns right-to-left runs round.
#include "overlay_fonts.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <utility>

#ifdef RTSG_HAS_FONTCONFIG
#include <fontconfig/fontconfig.h>
#endif

namespace rtsg {

namespace {

constexpr ImWchar kFirst[] = {0x20,   0x24F,  0x370,  0x3FF,  0x400,  0x52F,  0x591,  0x5F4, 0x2010,
                              0x2027, 0x2030, 0x205E, 0x2190, 0x21FF, 0x2200, 0x22FF, 0};
constexpr std::size_t kMaxLetters = 4000, kMaxFonts = 8;  // of the fonts that are added

bool isInFirst(char32_t letter) {
    for (std::size_t i = 0; kFirst[i] != 0; i += 2)
        if (letter >= kFirst[i] && letter <= kFirst[i + 1]) return true;
    return false;
}

/// The next letter; bytes that are none count as U+FFFD.
char32_t next(std::string_view text, std::size_t& at) {
    const auto lead = static_cast<unsigned char>(text[at++]);
    if (lead < 0x80) return lead;
    const std::size_t more = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : lead >= 0xC0 ? 1 : 0;
    char32_t code = lead & (0x3FU >> more);
    for (std::size_t i = 0; i < more; ++i) {
        if (at >= text.size() || (static_cast<unsigned char>(text[at]) & 0xC0U) != 0x80) return 0xFFFD;
        code = code << 6 | (static_cast<unsigned char>(text[at++]) & 0x3FU);
    }
    return more == 0 ? 0xFFFD : code;
}

bool isRightToLeft(char32_t c) {
    return (c >= 0x590 && c <= 0x8FF) || (c >= 0xFB1D && c <= 0xFDFF) || (c >= 0xFE70 && c <= 0xFEFC);
}
/// It stands over or under the letter before it.
bool isMark(char32_t c) {
    return (c >= 0x300 && c <= 0x36F) || (c >= 0x591 && c <= 0x5BD) || (c >= 0x5BF && c <= 0x5C7) ||
           (c >= 0x64B && c <= 0x65F);
}
bool isDigit(char32_t c) {
    return (c >= '0' && c <= '9') || (c >= 0x660 && c <= 0x669);
}
bool isNeutral(char32_t c) {
    return c < 0x80 && !(c >= 'a' && c <= 'z') && !(c >= 'A' && c <= 'Z') && !isDigit(c);
}

/// A letter with its marks.
struct Cluster {
    char32_t letter = 0;
    std::string bytes;
};

std::string mirrored(const Cluster& one) {
    constexpr std::string_view kPairs = "()[]{}<>";
    const std::size_t at = one.bytes.size() == 1 ? kPairs.find(one.bytes[0]) : std::string_view::npos;
    return at == std::string_view::npos ? one.bytes : std::string(1, kPairs[at ^ 1U]);
}

}  // namespace

void OverlayFonts::need(std::string_view text) {
    for (std::size_t at = 0; at < text.size();) {
        const char32_t letter = next(text, at);
        if (letter >= 0x20 && !isInFirst(letter) && needed_.size() < kMaxLetters) needed_.insert(letter);
    }
}

bool OverlayFonts::make(ImFontAtlas& atlas) {
    std::set<char32_t> missing;
    std::ranges::set_difference(needed_, tried_, std::inserter(missing, missing.end()));
    if (isBuilt_ && missing.empty()) return false;
    tried_ = needed_;
    isBuilt_ = true;
    atlas.Clear();
    ranges_.clear();
    ImFontConfig config;
    config.OversampleH = config.OversampleV = 1;  // texels are drawn as they are
    config.PixelSnapH = true;
    bool isThere = false;
    for (const char* file :
         {"/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf", "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
          "/usr/share/fonts/TTF/DejaVuSans.ttf"}) {
        std::error_code error;
        isThere = isThere || (std::filesystem::exists(file, error) &&
                              atlas.AddFontFromFileTTF(file, size_, &config, kFirst) != nullptr);
    }
    if (!isThere) atlas.AddFontDefault();  // which has Latin letters only
    addFallbacks(atlas, needed_);
    return true;
}

#ifdef RTSG_HAS_FONTCONFIG
void OverlayFonts::addFallbacks(ImFontAtlas& atlas, const std::set<char32_t>& missing) {
    if (missing.empty()) return;
    std::set<char32_t> left;
    for (const char32_t letter : missing)
        if (letter <= IM_UNICODE_CODEPOINT_MAX) left.insert(letter);
    FcCharSet* const wanted = FcCharSetCreate();
    for (const char32_t letter : left) FcCharSetAddChar(wanted, letter);
    FcPattern* const pattern = FcPatternCreate();
    FcPatternAddCharSet(pattern, FC_CHARSET, wanted);
    FcPatternAddBool(pattern, FC_SCALABLE, FcTrue);
    FcConfigSubstitute(nullptr, pattern, FcMatchPattern);
    FcDefaultSubstitute(pattern);
    FcResult result = FcResultMatch;
    FcFontSet* const fonts = FcFontSort(nullptr, pattern, FcTrue, nullptr, &result);
    std::size_t added = 0;
    for (int i = 0; fonts && i < fonts->nfont && !left.empty() && added < kMaxFonts; ++i) {
        FcCharSet* has = nullptr;
        FcChar8* file = nullptr;
        int index = 0;
        if (FcPatternGetCharSet(fonts->fonts[i], FC_CHARSET, 0, &has) != FcResultMatch ||
            FcPatternGetString(fonts->fonts[i], FC_FILE, 0, &file) != FcResultMatch)
            continue;
        (void)FcPatternGetInteger(fonts->fonts[i], FC_INDEX, 0, &index);
        std::vector<ImWchar> range;
        for (const char32_t letter : std::exchange(left, {}))
            if (FcCharSetHasChar(has, letter))
                range.push_back(static_cast<ImWchar>(letter)), range.push_back(static_cast<ImWchar>(letter));
            else
                left.insert(letter);
        if (range.empty()) continue;
        range.push_back(0);
        ranges_.push_back(std::move(range));
        ImFontConfig config;
        config.MergeMode = true;
        config.OversampleH = config.OversampleV = 1;
        config.PixelSnapH = true;
        config.FontNo = index & 0xFFFF;
        if (atlas.AddFontFromFileTTF(reinterpret_cast<const char*>(file), size_, &config, ranges_.back().data()))
            ++added;
    }
    if (fonts) FcFontSetDestroy(fonts);
    FcPatternDestroy(pattern);
    FcCharSetDestroy(wanted);
}
#else
void OverlayFonts::addFallbacks(ImFontAtlas&, const std::set<char32_t>&) {}
#endif

std::string visual(const std::string& text) {
    std::vector<Cluster> all;
    bool isPlain = true;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t from = at;
        const char32_t letter = next(text, at);
        isPlain = isPlain && !isRightToLeft(letter);
        if (isMark(letter) && !all.empty())
            all.back().bytes += text.substr(from, at - from);
        else
            all.push_back({letter, text.substr(from, at - from)});
    }
    if (isPlain) return text;
    std::string line;
    for (std::size_t i = 0; i < all.size();) {
        if (!isRightToLeft(all[i].letter)) {
            line += all[i++].bytes;
            continue;
        }
        // Up to the last right-to-left letter before a Latin one; numbers within keep their order.
        std::size_t end = i + 1;
        for (std::size_t k = i + 1; k < all.size(); ++k) {
            if (isRightToLeft(all[k].letter)) end = k + 1;
            if (!isRightToLeft(all[k].letter) && !isNeutral(all[k].letter) && !isDigit(all[k].letter)) break;
        }
        for (std::size_t k = end; k > i;) {
            std::size_t first = k - 1;
            if (isDigit(all[first].letter))
                while (first > i && isDigit(all[first - 1].letter)) --first;
            for (std::size_t d = first; d < k; ++d) line += mirrored(all[d]);
            k = first;
        }
        i = end;
    }
    return line;
}

}  // namespace rtsg
