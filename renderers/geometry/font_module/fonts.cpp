// The module librtsg_fonts.so: fonts by fontconfig, outlines by FreeType, shaping by HarfBuzz if it was there at build
// time. It does not link this project's libraries, and throws nothing.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <unordered_map>

#include <dlfcn.h>
#include <fontconfig/fontconfig.h>
#include <ft2build.h>
#include FT_BBOX_H
#include FT_FREETYPE_H
#include FT_OUTLINE_H
#include FT_TRUETYPE_TABLES_H
#ifdef RTSG_HARFBUZZ
#include <hb-ot.h>
#include <hb.h>
#endif

#include "text/fonts.h"

namespace rtsg {
namespace {

constexpr char32_t kReplacement = 0xFFFD;
constexpr float kSlant = .2f;  // of upright faces that stand for italic ones

struct Character {
    char32_t code;
    std::size_t begin, end;  // bytes
};

std::vector<Character> decode(const std::string& text) {
    std::vector<Character> result;
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    for (std::size_t i = 0; i < text.size();) {
        const unsigned char first = byte(i);
        const std::size_t length = first < 0x80       ? 1
                                   : first >> 5 == 6  ? 2
                                   : first >> 4 == 14 ? 3
                                   : first >> 3 == 30 ? 4
                                                      : 0;
        char32_t code = length == 1 ? first : first & (0x7Fu >> length);
        bool good = length > 0 && i + length <= text.size();
        for (std::size_t k = 1; good && k < length; ++k) {
            good = byte(i + k) >> 6 == 2;
            code = code << 6 | (byte(i + k) & 0x3Fu);
        }
        constexpr char32_t minimum[] = {0, 0, 0x80, 0x800, 0x10000};
        good = good && code >= minimum[length] && code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF);
        const std::size_t end = i + (good ? length : 1);
        result.push_back({good ? code : kReplacement, i, end});
        i = end;
    }
    return result;
}

struct FreePattern {
    void operator()(FcPattern* p) const { FcPatternDestroy(p); }
};
using Pattern = std::unique_ptr<FcPattern, FreePattern>;

const FcChar8* fc(const char* text) {
    return reinterpret_cast<const FcChar8*>(text);
}

/// The font that fontconfig finds nearest; `needed` is a character that it should have, or 0.
Pattern match(const std::string& family, bool bold, bool italic, char32_t needed) {
    const Pattern wanted(FcPatternCreate());
    if (!family.empty()) FcPatternAddString(wanted.get(), FC_FAMILY, fc(family.c_str()));
    FcPatternAddInteger(wanted.get(), FC_WEIGHT, bold ? FC_WEIGHT_BOLD : FC_WEIGHT_REGULAR);
    FcPatternAddInteger(wanted.get(), FC_SLANT, italic ? FC_SLANT_ITALIC : FC_SLANT_ROMAN);
    FcPatternAddBool(wanted.get(), FC_SCALABLE, FcTrue);
    FcPatternAddBool(wanted.get(), FC_OUTLINE, FcTrue);
    FcPatternAddBool(wanted.get(), FC_VARIABLE, FcFalse);
    if (needed) {
        FcCharSet* set = FcCharSetCreate();
        FcCharSetAddChar(set, needed);
        FcPatternAddCharSet(wanted.get(), FC_CHARSET, set);
        FcCharSetDestroy(set);
    }
    FcConfigSubstitute(nullptr, wanted.get(), FcMatchPattern);
    FcDefaultSubstitute(wanted.get());
    FcResult result = FcResultMatch;
    return Pattern(FcFontMatch(nullptr, wanted.get(), &result));
}

bool isOfFamily(FcPattern* pattern, const std::string& family) {
    FcChar8* name = nullptr;
    for (int i = 0; FcPatternGetString(pattern, FC_FAMILY, i, &name) == FcResultMatch; ++i)
        if (FcStrCmpIgnoreCase(name, fc(family.c_str())) == 0) return true;
    return false;
}

std::string familyOf(FcPattern* pattern) {
    FcChar8* name = nullptr;
    if (FcPatternGetString(pattern, FC_FAMILY, 0, &name) != FcResultMatch) return "another font";
    return reinterpret_cast<const char*>(name);
}

/// The three names that every browser knows, and the font files for them if these are installed, so that pictures are
/// the same everywhere.
constexpr std::array<std::array<const char*, 3>, 3> kGeneric{{{"SERIF", "DejaVu Serif", "serif"},
                                                              {"SANS", "DejaVu Sans", "sans-serif"},
                                                              {"TYPEWRITER", "DejaVu Sans Mono", "monospace"}}};

class Face {
  public:
    /// `file` stays where it is until the process ends.
    Face(FT_Library library, const std::string& file) {
        const auto* bytes = reinterpret_cast<const FT_Byte*>(file.data());
        if (FT_New_Memory_Face(library, bytes, static_cast<FT_Long>(file.size()), 0, &face_) != 0) return;
        if (!isUsable()) return;
#ifdef RTSG_HARFBUZZ
        // Through FreeType, which has unpacked compressed fonts (WOFF).
        setShaper(hb_face_create_for_tables(table, face_, nullptr));
#endif
    }
    Face(FT_Library library, FcPattern* pattern, bool italic) {
        FcChar8* file = nullptr;
        int index = 0;
        if (FcPatternGetString(pattern, FC_FILE, 0, &file) != FcResultMatch) return;
        FcPatternGetInteger(pattern, FC_INDEX, 0, &index);
        if (FT_New_Face(library, reinterpret_cast<const char*>(file), index, &face_) != 0) return;
        if (!isUsable()) return;
        // The pattern calls an upright face oblique where fontconfig gives it a matrix that makes it so.
        slant_ = italic && !(face_->style_flags & FT_STYLE_FLAG_ITALIC) ? kSlant : 0.0f;
#ifdef RTSG_HARFBUZZ
        hb_blob_t* blob = hb_blob_create_from_file(reinterpret_cast<const char*>(file));
        setShaper(hb_face_create(blob, static_cast<unsigned>(index) & 0xFFFFu));
        hb_blob_destroy(blob);
#endif
    }
    Face(const Face&) = delete;
    Face& operator=(const Face&) = delete;

    FT_Face get() const { return face_; }
    float em() const { return em_; }
    float slant() const { return slant_; }
    std::uint32_t glyphOf(char32_t code) const { return FT_Get_Char_Index(face_, code); }
    /// The outline of a glyph in units of the font, upright; null if it has none. Valid until the next call.
    FT_Outline* outlineOf(std::uint32_t glyph) const {
        if (FT_Load_Glyph(face_, glyph, FT_LOAD_NO_SCALE | FT_LOAD_NO_HINTING | FT_LOAD_NO_BITMAP) != 0) return nullptr;
        return face_->glyph->format == FT_GLYPH_FORMAT_OUTLINE ? &face_->glyph->outline : nullptr;
    }
    const GlyphBox& boxOf(std::uint32_t glyph) {
        const auto [found, isNew] = boxes_.try_emplace(glyph);
        FT_Outline* const outline = isNew ? outlineOf(glyph) : nullptr;
        if (!outline || outline->n_points == 0) return found->second;
        const FT_Matrix slanted{0x10000, static_cast<FT_Fixed>(std::lround(slant_ * 65536.0f)), 0, 0x10000};
        if (slant_ != 0) FT_Outline_Transform(outline, &slanted);
        FT_BBox box{};
        if (FT_Outline_Get_BBox(outline, &box) != 0) return found->second;
        const auto ems = [&](FT_Pos units) { return static_cast<float>(units) * em_; };
        found->second = {ems(box.xMin), ems(box.yMin), ems(box.xMax), ems(box.yMax), false};
        return found->second;
    }
#ifdef RTSG_HARFBUZZ
    hb_font_t* shaper() const { return shaper_; }
#endif

  private:
    /// Takes its size; lets go of a face that has no outlines.
    bool isUsable() {
        if (FT_IS_SCALABLE(face_) && face_->units_per_EM != 0) {
            em_ = 1.0f / static_cast<float>(face_->units_per_EM);
            return true;
        }
        FT_Done_Face(face_);
        face_ = nullptr;
        return false;
    }
#ifdef RTSG_HARFBUZZ
    void setShaper(hb_face_t* face) {
        shaper_ = hb_font_create(face);
        hb_font_set_scale(shaper_, face_->units_per_EM, face_->units_per_EM);
        hb_face_destroy(face);
    }
    static hb_blob_t* table(hb_face_t*, hb_tag_t tag, void* self) {
        auto* const face = static_cast<FT_Face>(self);
        FT_ULong length = 0;
        if (FT_Load_Sfnt_Table(face, tag, 0, nullptr, &length) != 0 || length == 0) return nullptr;
        auto* const bytes = static_cast<FT_Byte*>(std::malloc(length));
        if (!bytes) return nullptr;
        if (FT_Load_Sfnt_Table(face, tag, 0, bytes, &length) == 0)
            return hb_blob_create(reinterpret_cast<const char*>(bytes), static_cast<unsigned>(length),
                                  HB_MEMORY_MODE_WRITABLE, bytes, std::free);
        std::free(bytes);
        return nullptr;
    }
#endif
    FT_Face face_ = nullptr;  // until the process ends, as all here
    float em_ = 1, slant_ = 0;
    std::unordered_map<std::uint32_t, GlyphBox> boxes_;
#ifdef RTSG_HARFBUZZ
    hb_font_t* shaper_ = nullptr;
#endif
};

/// Collects the outline of a glyph.
struct Pen {
    std::vector<GlyphContour>* out;
    float em, slant;

    void add(const FT_Vector* point) const {
        const float x = static_cast<float>(point->x) * em, y = static_cast<float>(point->y) * em;
        out->back().points.push_back(x + slant * y);
        out->back().points.push_back(y);
    }
    static const Pen& of(void* self) { return *static_cast<const Pen*>(self); }
    static int moveTo(const FT_Vector* to, void* self) {
        of(self).out->emplace_back();
        of(self).add(to);
        return 0;
    }
    static int lineTo(const FT_Vector* to, void* self) {
        of(self).add(to);
        of(self).out->back().segments.push_back(1);
        return 0;
    }
    static int conicTo(const FT_Vector* by, const FT_Vector* to, void* self) {
        of(self).add(by), of(self).add(to);
        of(self).out->back().segments.push_back(2);
        return 0;
    }
    static int cubicTo(const FT_Vector* a, const FT_Vector* b, const FT_Vector* to, void* self) {
        of(self).add(a), of(self).add(b), of(self).add(to);
        of(self).out->back().segments.push_back(3);
        return 0;
    }
};

/// Characters of one face that run one way.
struct Run {
    std::uint32_t face;
    std::size_t begin, end;  // bytes
    std::size_t firstCharacter, characters;
    bool toTheRight;
};

/// Fonts in the folder `fonts` beside the module, as archives and wheels have it, are there besides the system's. Where
/// fontconfig is not installed, the file fonts.conf of that folder stands for its own.
void takeOwnFonts() {
    Dl_info about{};
    if (!::dladdr(reinterpret_cast<void*>(&takeOwnFonts), &about) || !about.dli_fname) return;
    std::error_code error;
    const auto folder = std::filesystem::canonical(about.dli_fname, error).parent_path() / "fonts";
    if (error || !std::filesystem::is_directory(folder, error)) return;
    FcChar8* const system = FcConfigGetFilename(nullptr, nullptr);
    const bool configured = system && std::filesystem::exists(reinterpret_cast<const char*>(system), error);
    FcStrFree(system);
    if (configured) {
        FcConfigAppFontAddDir(nullptr, fc(folder.c_str()));
        return;
    }
    FcConfig* const config = FcConfigCreate();
    if (FcConfigParseAndLoad(config, fc((folder / "fonts.conf").c_str()), FcTrue) && FcConfigBuildFonts(config))
        FcConfigSetCurrent(config);
    FcConfigDestroy(config);  // what is current is held
}

class SystemFonts : public Fonts {
  public:
    std::string load(std::string_view file, std::uint32_t& face) const override {
        const std::lock_guard lock(mutex_);
        if (const auto found = loaded_.find(file); found != loaded_.end()) {
            face = found->second;
            return {};
        }
        if (loaded_.size() >= kMaxLoaded || file.size() > kMaxBytes - loadedBytes_)
            return "it is one font more than are kept";
        if (!library_ && FT_Init_FreeType(&library_) != 0) return "FreeType does not start";
        const auto at = loaded_.emplace(std::string(file), kNone).first;
        auto created = std::make_unique<Face>(library_, at->first);
        if (!created->get()) {
            loaded_.erase(at);
            return "FreeType cannot read it, or it has no outlines";
        }
        loadedBytes_ += file.size();
        faces_.push_back(std::move(created));
        face = at->second = static_cast<std::uint32_t>(faces_.size() - 1);
        return {};
    }

    std::string choose(const FontRequest& request, FontChoice& out) const override {
        const std::lock_guard lock(mutex_);
        const auto key = std::tuple(request.families, request.bold, request.italic, request.loaded, request.loadedAt);
        if (const auto found = choices_.find(key); found != choices_.end()) {
            out = found->second;
            return {};
        }
        std::string error = find(request, out);
        if (error.empty()) choices_.emplace(key, out);
        return error;
    }

    void shape(std::uint32_t face, const std::string& text, const std::string& language, bool leftToRight,
               ShapedLine& out) const override {
        const std::lock_guard lock(mutex_);
        out = {};
        const std::vector<Character> characters = decode(text);
        std::vector<Run> runs = cut(face, characters, leftToRight, out.missing);
        if (!leftToRight) std::reverse(runs.begin(), runs.end());
        for (const Run& run : runs) shapeRun(run, text, characters, language, out);
    }

    void outline(std::uint32_t face, std::uint32_t glyph, std::vector<GlyphContour>& out) const override {
        const std::lock_guard lock(mutex_);
        out.clear();
        const Face& from = *faces_[face];
        FT_Outline* const outline = from.outlineOf(glyph);
        if (!outline) return;
        Pen pen{&out, from.em(), from.slant()};
        const FT_Outline_Funcs functions{Pen::moveTo, Pen::lineTo, Pen::conicTo, Pen::cubicTo, 0, 0};
        FT_Outline_Decompose(outline, &functions, &pen);
    }
    GlyphBox box(std::uint32_t face, std::uint32_t glyph) const override {
        const std::lock_guard lock(mutex_);
        return faces_[face]->boxOf(glyph);
    }

    bool shapes() const override {
#ifdef RTSG_HARFBUZZ
        return true;
#else
        return false;
#endif
    }

  private:
    static constexpr std::uint32_t kNone = FontRequest::kNone;

    /// The number of the face in this pattern's file; kNone if it cannot be used.
    std::uint32_t open(FcPattern* pattern, bool italic) const {
        if (!library_ && FT_Init_FreeType(&library_) != 0) return kNone;
        FcChar8* file = nullptr;
        int index = 0;
        if (FcPatternGetString(pattern, FC_FILE, 0, &file) != FcResultMatch) return kNone;
        FcPatternGetInteger(pattern, FC_INDEX, 0, &index);
        const auto key = std::tuple(std::string(reinterpret_cast<const char*>(file)), index, italic);
        const auto [found, isNew] = numbers_.try_emplace(key, kNone);
        if (!isNew) return found->second;
        auto face = std::make_unique<Face>(library_, pattern, italic);
        if (!face->get()) return kNone;
        faces_.push_back(std::move(face));
        return found->second = static_cast<std::uint32_t>(faces_.size() - 1);
    }

    void measure(std::uint32_t face, FontChoice& out) const {
        const FT_Face ft = faces_[face]->get();
        const float em = faces_[face]->em();
        out.face = face;
        out.ascent = static_cast<float>(ft->ascender) * em, out.descent = -static_cast<float>(ft->descender) * em;
    }

    std::string find(const FontRequest& request, FontChoice& out) const {
        std::string missing;
        const auto take = [&](FcPattern* pattern) {
            const std::uint32_t face = pattern ? open(pattern, request.italic) : kNone;
            if (face == kNone) return false;
            measure(face, out);
            int weight = FC_WEIGHT_REGULAR;
            FcPatternGetInteger(pattern, FC_WEIGHT, 0, &weight);
            if (!missing.empty())
                out.said = "font family " + missing + " is not installed: " + familyOf(pattern) + " is used";
            if (request.bold && weight < FC_WEIGHT_DEMIBOLD)
                out.said += (out.said.empty() ? "" : "; ") + familyOf(pattern) + " has no bold";
            return true;
        };
        for (std::size_t i = 0; i < request.families.size(); ++i) {
            const std::string& family = request.families[i];
            if (request.loaded != kNone && request.loadedAt == i) {
                measure(request.loaded, out);
                if (!missing.empty())
                    out.said.assign("font family ")
                        .append(missing)
                        .append(" is not installed: \"")
                        .append(family)
                        .append("\" is used");
                return {};
            }
            for (const auto& [name, ours, alias] : kGeneric) {
                if (family != name) continue;
                const Pattern exact = match(ours, request.bold, request.italic, 0);
                if (exact && isOfFamily(exact.get(), ours) && take(exact.get())) return {};
                if (const Pattern any = match(alias, request.bold, request.italic, 0); take(any.get())) return {};
            }
            const Pattern pattern = match(family, request.bold, request.italic, 0);
            if (pattern && isOfFamily(pattern.get(), family) && take(pattern.get())) return {};
            if (missing.empty()) missing = '"' + family + '"';
        }
        for (const char* family : {kGeneric[0][1], kGeneric[0][2], ""})
            if (const Pattern pattern = match(family, request.bold, request.italic, 0);
                pattern && (isOfFamily(pattern.get(), family) || family != kGeneric[0][1]) && take(pattern.get()))
                return {};
        return "no font is installed (fonts-dejavu-core has some)";
    }

    /// A face that has the character; kNone if none has.
    std::uint32_t faceWith(char32_t code, std::uint32_t like) const {
        const auto [found, isNew] = substitutes_.try_emplace({like, code}, kNone);
        if (!isNew) return found->second;
        const FT_Long style = faces_[like]->get()->style_flags;
        const bool italic = (style & FT_STYLE_FLAG_ITALIC) || faces_[like]->slant() > 0;
        const Pattern pattern = match({}, style & FT_STYLE_FLAG_BOLD, italic, code);
        const std::uint32_t face = pattern ? open(pattern.get(), italic) : kNone;
        if (face != kNone && faces_[face]->glyphOf(code) != 0) found->second = face;
        return found->second;
    }

    std::vector<Run> cut(std::uint32_t face, const std::vector<Character>& characters, bool leftToRight,
                         std::uint32_t& missing) const {
        std::vector<Run> runs;
        for (std::size_t i = 0; i < characters.size(); ++i) {
            const Character& c = characters[i];
            std::uint32_t own = face;
            bool toTheRight = leftToRight, joins = false;
#ifdef RTSG_HARFBUZZ
            // Blanks, points and marks belong to the characters before them.
            const hb_script_t script = hb_unicode_script(hb_unicode_funcs_get_default(), c.code);
            joins = script == HB_SCRIPT_COMMON || script == HB_SCRIPT_INHERITED;
            const bool digit = c.code >= U'0' && c.code <= U'9';
            if (!joins && hb_script_get_horizontal_direction(script) == HB_DIRECTION_RTL) toTheRight = false;
            if (digit && !runs.empty() && !runs.back().toTheRight && leftToRight) joins = false;
#endif
            if (faces_[face]->glyphOf(c.code) == 0) {
                const bool here = joins && !runs.empty() && faces_[runs.back().face]->glyphOf(c.code) != 0;
                own = here ? runs.back().face : faceWith(c.code, face);
                if (own == kNone) own = face, ++missing;
            } else if (joins && !runs.empty() && faces_[runs.back().face]->glyphOf(c.code) != 0) {
                own = runs.back().face;
            }
            if (joins && !runs.empty()) toTheRight = runs.back().toTheRight;
            // Blanks between runs of two directions belong to the one that runs as the line does.
            if (!joins && !runs.empty() && runs.back().toTheRight != toTheRight && toTheRight == leftToRight) {
                Run& last = runs.back();
                std::size_t blanks = 0;
                while (blanks + 1 < last.characters && characters[i - 1 - blanks].code == U' ') ++blanks;
                if (blanks > 0) {
                    last.characters -= blanks;
                    last.end = characters[i - blanks].begin;
                    runs.push_back({own, last.end, c.begin, i - blanks, blanks, toTheRight});
                }
            }
            if (!runs.empty() && runs.back().face == own && runs.back().toTheRight == toTheRight) {
                runs.back().end = c.end;
                ++runs.back().characters;
            } else {
                runs.push_back({own, c.begin, c.end, i, 1, toTheRight});
            }
        }
        return runs;
    }

#ifdef RTSG_HARFBUZZ
    void shapeRun(const Run& run, const std::string& text, const std::vector<Character>&, const std::string& language,
                  ShapedLine& out) const {
        const Face& face = *faces_[run.face];
        if (!buffer_) buffer_ = hb_buffer_create();
        hb_buffer_clear_contents(buffer_);
        hb_buffer_add_utf8(buffer_, text.data(), static_cast<int>(text.size()), static_cast<unsigned>(run.begin),
                           static_cast<int>(run.end - run.begin));
        hb_buffer_set_direction(buffer_, run.toTheRight ? HB_DIRECTION_LTR : HB_DIRECTION_RTL);
        if (!language.empty()) hb_buffer_set_language(buffer_, hb_language_from_string(language.c_str(), -1));
        hb_buffer_guess_segment_properties(buffer_);
        hb_shape(face.shaper(), buffer_, nullptr, 0);
        unsigned count = 0;
        const hb_glyph_info_t* glyphs = hb_buffer_get_glyph_infos(buffer_, &count);
        const hb_glyph_position_t* positions = hb_buffer_get_glyph_positions(buffer_, &count);
        for (unsigned i = 0; i < count; ++i) {
            out.glyphs.push_back({run.face, glyphs[i].codepoint,
                                  out.width + static_cast<float>(positions[i].x_offset) * face.em(),
                                  static_cast<float>(positions[i].y_offset) * face.em()});
            out.width += static_cast<float>(positions[i].x_advance) * face.em();
        }
    }
    mutable hb_buffer_t* buffer_ = nullptr;
#else
    void shapeRun(const Run& run, const std::string&, const std::vector<Character>& characters, const std::string&,
                  ShapedLine& out) const {
        const Face& face = *faces_[run.face];
        std::uint32_t before = 0;
        for (std::size_t k = 0; k < run.characters; ++k) {
            const std::size_t i = run.firstCharacter + (run.toTheRight ? k : run.characters - 1 - k);
            const std::uint32_t glyph = face.glyphOf(characters[i].code);
            FT_Vector kern{0, 0};
            if (before && FT_HAS_KERNING(face.get()))
                FT_Get_Kerning(face.get(), before, glyph, FT_KERNING_UNSCALED, &kern);
            out.width += static_cast<float>(kern.x) * face.em();
            out.glyphs.push_back({run.face, glyph, out.width, 0});
            if (FT_Load_Glyph(face.get(), glyph, FT_LOAD_NO_SCALE | FT_LOAD_NO_BITMAP) == 0)
                out.width += static_cast<float>(face.get()->glyph->metrics.horiAdvance) * face.em();
            before = glyph;
        }
    }
#endif

    mutable std::mutex mutex_;
    mutable FT_Library library_ = nullptr;
    mutable std::vector<std::unique_ptr<Face>> faces_;
    mutable std::map<std::tuple<std::string, int, bool>, std::uint32_t> numbers_;
    mutable std::map<std::tuple<std::vector<std::string>, bool, bool, std::uint32_t, std::uint32_t>, FontChoice>
        choices_;
    mutable std::map<std::string, std::uint32_t, std::less<>>
        loaded_;  // by the file's bytes, which FreeType reads here
    mutable std::size_t loadedBytes_ = 0;
    mutable std::map<std::pair<std::uint32_t, char32_t>, std::uint32_t> substitutes_;
};

}  // namespace
}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) const rtsg::Fonts* RTSG_FONTS_SYMBOL() {
    // For as long as the process lives: whoever draws text keeps no hold of it.
    static const auto* const fonts = [] {
        rtsg::takeOwnFonts();
        return new rtsg::SystemFonts;
    }();
    return fonts;
}
