// Text: strings to lines, lines to their places by FontStyle, glyphs to triangles.
#include "tessellate_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/text_measure.h>

#include "text/fonts.h"

namespace rtsg {

namespace detail {

namespace {

using Justify = TextParams::Justify;

/// Fields of a file may ask for any number of glyphs; more triangles than this are left out, with a warning.
constexpr std::size_t kMaxTriangles = std::size_t{1} << 25;
constexpr float kPoint = 96.0f / 72;      // pixels, of ScreenFontStyle: 96 pixels to the inch, as in CSS
constexpr float kToleranceOfChord = .4f;  // of TessellationOptions' chord error, which is of a radius of half an em

struct Piece {
    const GlyphMesh* glyph;
    Vec2f at;  // ems
};

/// The start of a line, or of all lines, along an axis on which they fill [low, high]. `upwards` is the direction in
/// which they run.
float beginOf(Justify justify, float low, float high, bool upwards) {
    switch (justify) {
        case Justify::middle:
            return -.5f * (low + high);
        case Justify::end:
            return upwards ? -high : -low;
        default:
            return upwards ? -low : -high;
    }
}

/// The rectangle that glyphs fill.
struct Ink {
    Vec2f low{kNothing}, high{-kNothing};
    bool empty() const { return low.x > high.x; }

    static constexpr float kNothing = std::numeric_limits<float>::max();
};

Ink inkOf(const Fonts& fonts, const std::vector<PlacedGlyph>& glyphs) {
    Ink ink;
    for (const PlacedGlyph& g : glyphs) {
        const GlyphBox box = fonts.box(g.face, g.glyph);
        if (box.empty) continue;
        ink.low = glm::min(ink.low, Vec2f(g.x + box.left, g.y + box.bottom));
        ink.high = glm::max(ink.high, Vec2f(g.x + box.right, g.y + box.top));
    }
    return ink;
}

/// The same of several lines, along one axis.
struct Extent {
    float low = Ink::kNothing, high = -Ink::kNothing;
    void add(float from, float to) { low = std::min(low, from), high = std::max(high, to); }
    bool empty() const { return low > high; }
    float middle() const { return .5f * (low + high); }
};

/// The characters, each as a line of its own, with the marks and joiners that belong to them.
std::vector<std::string> cells(const std::string& text) {
    std::vector<std::string> result;
    for (std::size_t i = 0; i < text.size();) {
        std::size_t end = i + 1;
        while (end < text.size() && (static_cast<unsigned char>(text[end]) & 0xC0u) == 0x80u) ++end;
        const std::string one = text.substr(i, end - i);
        const bool mark = one >= "\xCC\x80" && one < "\xCD\xB0";  // U+0300 to U+036F
        if (mark && !result.empty())
            result.back() += one;
        else
            result.push_back(one);
        i = end;
    }
    return result;
}

}  // namespace

/// A line, or a column.
struct TextMaker::Line {
    std::vector<PlacedGlyph> glyphs;
    float extent = 0;  // along the line
    float stretch = 1;
    Ink ink;                // before the line is stretched and placed
    Vec2f at{0};            // of its start
    Vec2f low{0}, high{0};  // of the line's own box: from its descent to its ascent, or one em wide
};

const GlyphMesh& TextMaker::glyph(const Fonts& fonts, const PlacedGlyph& placed, float tolerance) {
    const auto [found, isNew] = glyphs_[tolerance].try_emplace(std::uint64_t{placed.face} << 32 | placed.glyph);
    if (isNew) {
        ++kept_;
        std::vector<GlyphContour> contours;
        fonts.outline(placed.face, placed.glyph, contours);
        found->second = cutGlyph(contours, tolerance);
    }
    return found->second;
}

/// The face of the font that a FontLibrary brought; FontRequest::kNone if none can be used.
std::uint32_t TextMaker::loadedFace(const Fonts& fonts, const TextParams& p, Mesh& mesh) {
    if (p.font.empty()) return FontRequest::kNone;
    for (const auto& [font, face] : faces_)
        if (font.sameStorage(p.font)) return face;
    const auto size = static_cast<std::uint32_t>(p.font[0]);
    const std::size_t there = (p.font.size() - 1) * sizeof(std::int32_t);
    std::uint32_t face = FontRequest::kNone;
    std::string why = "it is not whole";
    if (size <= there) why = fonts.load({reinterpret_cast<const char*>(p.font.data() + 1), size}, face);
    if (!why.empty()) {
        warn(mesh, fmt::format("the font of {} is not used: {}", p.fontName, why));
        return FontRequest::kNone;
    }
    if (faces_.size() == kMaxFonts) faces_.erase(faces_.begin());
    faces_.emplace_back(p.font, face);
    return face;
}

/// MIDDLE puts the middle of the visible text on an axis: of each line along the lines, of all of them across. The
/// other places are those of the font, so that lines stay where they are when their characters change.
void TextMaker::layOutLines(std::vector<Line>& lines, const FontChoice& font, const TextParams& p) {
    const float down = p.topToBottom ? -p.spacing : p.spacing;
    const float last = down * static_cast<float>(lines.size() - 1);
    Extent all;
    for (std::size_t i = 0; i < lines.size(); ++i)
        if (!lines[i].ink.empty())
            all.add(lines[i].ink.low.y + down * static_cast<float>(i),
                    lines[i].ink.high.y + down * static_cast<float>(i));
    float first = 0;  // the first line's baseline
    if (p.minor == Justify::middle && !all.empty())
        first = -all.middle();
    else if (p.minor != Justify::first)
        first =
            beginOf(p.minor, std::min(last, 0.0f) - font.descent, std::max(last, 0.0f) + font.ascent, !p.topToBottom);
    for (std::size_t i = 0; i < lines.size(); ++i) {
        Line& line = lines[i];
        const float along = line.extent * line.stretch;
        line.at.x = beginOf(p.major, 0, along, p.leftToRight);
        if (p.major == Justify::middle && !line.ink.empty())
            line.at.x = -.5f * line.stretch * (line.ink.low.x + line.ink.high.x);
        line.at.y = first + down * static_cast<float>(i);
        line.low = line.at - Vec2f(0, font.descent), line.high = line.at + Vec2f(along, font.ascent);
    }
}

/// By the visible shapes alone, because fonts made for lines have no metrics for columns.
void TextMaker::layOutColumns(std::vector<Line>& lines, const TextParams& p) {
    const bool up = !p.topToBottom;
    const float right = p.leftToRight ? p.spacing : -p.spacing;
    Extent all;
    for (std::size_t i = 0; i < lines.size(); ++i)
        if (!lines[i].ink.empty())
            all.add(lines[i].ink.low.x + right * static_cast<float>(i),
                    lines[i].ink.high.x + right * static_cast<float>(i));
    if (all.empty()) all.add(0, 1);
    const float first = beginOf(p.minor, all.low, all.high, p.leftToRight);
    for (std::size_t i = 0; i < lines.size(); ++i) {
        Line& line = lines[i];
        const float along = line.extent * line.stretch;
        Extent ink;
        if (line.ink.empty())
            ink.add(up ? 0 : -along, up ? along : 0);
        else
            ink.add(line.stretch * line.ink.low.y, line.stretch * line.ink.high.y);
        line.at = Vec2f(first + right * static_cast<float>(i), beginOf(p.major, ink.low, ink.high, up));
        line.low = line.at - Vec2f(0, up ? 0 : along), line.high = line.at + Vec2f(1, up ? along : 0);
    }
}

std::vector<TextMaker::Line> TextMaker::layOut(const Fonts& fonts, const TextParams& p, Mesh& mesh) {
    FontChoice font;
    const std::uint32_t loaded = loadedFace(fonts, p, mesh);
    if (const std::string error = fonts.choose({p.family, p.bold, p.italic, loaded, p.fontAt}, font); !error.empty()) {
        warn(mesh, error + ": it is not drawn");
        return {};
    }
    if (!font.said.empty()) warn(mesh, font.said);
    std::vector<Line> lines(p.strings.size());
    std::uint32_t missing = 0;
    float longest = 0;
    const bool needsInk = !p.horizontal || p.major == Justify::middle || p.minor == Justify::middle;
    ShapedLine shaped;
    for (std::size_t i = 0; i < lines.size(); ++i) {
        Line& line = lines[i];
        if (p.horizontal) {
            fonts.shape(font.face, p.strings[i], p.language, p.leftToRight, shaped);
            line.glyphs = std::move(shaped.glyphs);
            line.extent = shaped.width;
            missing += shaped.missing;
        } else {
            // A cell of one em for each character, which stands in its middle.
            const float baseline = font.descent / std::max(font.ascent + font.descent, 1e-3f);
            for (const std::string& cell : cells(p.strings[i])) {
                fonts.shape(font.face, cell, p.language, true, shaped);
                const float y = p.topToBottom ? -line.extent - 1 + baseline : line.extent + baseline;
                for (PlacedGlyph g : shaped.glyphs) {
                    g.x += .5f * (1 - shaped.width), g.y += y;
                    line.glyphs.push_back(g);
                }
                line.extent += 1;
                missing += shaped.missing;
            }
        }
        if (needsInk) line.ink = inkOf(fonts, line.glyphs);
        const float wanted = i < p.length.size() ? p.length[i] / p.size : 0;
        if (wanted > 0 && line.extent > 0) line.stretch = wanted / line.extent;
        longest = std::max(longest, line.extent * line.stretch);
    }
    if (p.maxExtent > 0 && longest * p.size > p.maxExtent)
        for (Line& line : lines) line.stretch *= p.maxExtent / (longest * p.size);
    if (missing > 0) warn(mesh, fmt::format("no installed font has {} of its characters", missing));

    if (p.horizontal)
        layOutLines(lines, font, p);
    else
        layOutColumns(lines, p);
    for (Line& line : lines)
        for (PlacedGlyph& g : line.glyphs) {
            g.x = g.x * (p.horizontal ? line.stretch : 1) + line.at.x;
            g.y = g.y * (p.horizontal ? 1 : line.stretch) + line.at.y;
        }
    return lines;
}

namespace {

bool hasUsableSizes(const TextParams& p) {
    return p.size > 0 && usable(p.size) && p.spacing >= 0 && usable(p.spacing);
}

}  // namespace

Array<float> TextMaker::measure(const TextParams& p) {
    const auto loaded = fonts();
    if (!loaded || p.strings.empty() || !hasUsableSizes(p)) return {};
    Mesh ignored;  // the renderer of the shape reports its faults
    const std::vector<Line> lines = layOut(**loaded, p, ignored);
    if (lines.empty()) return {};
    Vec2f low = lines[0].low, high = lines[0].high;
    for (const Line& line : lines) low = glm::min(low, line.low), high = glm::max(high, line.high);
    Array<float> sizes;
    const auto add = [&](float ems) { sizes.push_back(ems * p.size + 0.0f); };  // 0, not -0
    add(high.x - low.x), add(high.y - low.y);
    add(low.x), add(high.y), add(0);
    for (const Line& line : lines) add(line.high.x - line.low.x), add(line.high.y - line.low.y);
    return std::ranges::all_of(sizes, [](float size) { return usable(size); }) ? sizes : Array<float>();
}

Mesh TextMaker::make(const TextParams& p, const TessellationOptions& options) {
    Mesh mesh;
    mesh.solid = p.solid, mesh.inPixels = p.inPixels;
    if (p.strings.empty()) return mesh;
    if (!hasUsableSizes(p)) {
        warn(mesh, fmt::format("size {} must be above 0 and spacing {} not below: it is not drawn", p.size, p.spacing));
        return mesh;
    }
    const auto loaded = fonts();
    if (!loaded) {
        warn(mesh, loaded.error().text);
        return mesh;
    }
    const Fonts& from = **loaded;
    if (kept_ > kMaxGlyphs) glyphs_.clear(), kept_ = 0;
    const std::vector<Line> lines = layOut(from, p, mesh);

    std::size_t points = 0, corners = 0;
    const float tolerance = kToleranceOfChord * std::clamp(options.chordError, 1e-5f, .25f);
    std::vector<const GlyphMesh*> shapes;
    for (const Line& line : lines)
        for (const PlacedGlyph& g : line.glyphs) {
            const GlyphMesh& shape = glyph(from, g, tolerance);
            points += shape.points.size(), corners += shape.triangles.size();
            shapes.push_back(&shape);
        }
    if (corners / 3 > kMaxTriangles) {
        warn(mesh, fmt::format("its {} triangles are more than {}: it is not drawn", corners / 3, kMaxTriangles));
        return mesh;
    }
    mesh.curveSize = kToleranceOfChord * p.size;
    mesh.positions = Array<Vec3f>::ofSize(points);
    mesh.triangles = Array<std::int32_t>::ofSize(corners);
    mesh.triangleCount = static_cast<std::uint32_t>(corners / 3);
    Vec3f* position = mesh.positions.mutableData();
    std::int32_t* corner = mesh.triangles.mutableData();
    std::int32_t first = 0;
    std::size_t next = 0;
    for (const Line& line : lines) {
        const Vec2f stretch = p.size * (p.horizontal ? Vec2f(line.stretch, 1) : Vec2f(1, line.stretch));
        for (const PlacedGlyph& g : line.glyphs) {
            const GlyphMesh& shape = *shapes[next++];
            const Vec2f at = p.size * Vec2f(g.x, g.y);
            for (const Vec2f& point : shape.points) {
                *position = Vec3f(at + stretch * point, 0);
                mesh.bounds.extend(*position++);
            }
            for (const std::int32_t c : shape.triangles) *corner++ = first + c;
            first += static_cast<std::int32_t>(shape.points.size());
        }
    }
    if (!mesh.bounds.empty() && !(usable(mesh.bounds.min) && usable(mesh.bounds.max))) {
        Mesh none;
        none.inPixels = p.inPixels;
        none.diagnostics = std::move(mesh.diagnostics);
        warn(none, "its size is out of range: it is not drawn");
        return none;
    }
    TexCoords texCoords;
    texCoords.sFromPosition = {1 / p.size, 0, 0, 0}, texCoords.tFromPosition = {0, 1 / p.size, 0, 0};
    mesh.texCoords.push_back(texCoords);
    return mesh;
}

namespace {

Justify justifyOf(Mesh& problems, const Array<String>& words, std::size_t which, Justify otherwise) {
    if (which >= words.size()) return otherwise;
    const std::string_view word = words[which].view();
    if (word == "BEGIN" || word.empty()) return Justify::begin;
    if (word == "FIRST") return Justify::first;
    if (word == "MIDDLE") return Justify::middle;
    if (word == "END") return Justify::end;
    warn(problems, fmt::format("justify \"{}\" is none of BEGIN, FIRST, MIDDLE, END: taken as BEGIN", word));
    return Justify::begin;
}

/// The font that a FontLibrary has for one of the families.
void readLibrary(const Scene& scene, const Node& library, TextParams& p) {
    using L = x3d::FontLibrary;
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c; };
    for (std::size_t i = 0; i < p.family.size() && p.font.empty(); ++i)
        for (const String& family : library.get(L::family))
            if (std::ranges::equal(p.family[i], family.view(), {}, lower, lower))
                p.font = library.get(L::_font), p.fontAt = static_cast<std::uint32_t>(i);
    const std::string_view name = scene.name(library.id());
    p.fontName = name.empty() ? "a FontLibrary" : fmt::format("FontLibrary {}", name);
}

template <class T>
void readStyle(const Scene& scene, const Node& style, TextParams& p, Mesh& problems) {
    p.family.clear();
    for (const String& family : style.get(T::family)) p.family.emplace_back(family.view());
    if (const Node* library = scene.find(style.get(T::_library))) readLibrary(scene, *library, p);
    p.horizontal = style.get(T::horizontal);
    p.leftToRight = style.get(T::leftToRight);
    p.topToBottom = style.get(T::topToBottom);
    p.spacing = style.get(T::spacing);
    p.language = std::string(style.get(T::language).view());
    p.major = justifyOf(problems, style.get(T::justify), 0, Justify::begin);
    p.minor = justifyOf(problems, style.get(T::justify), 1, Justify::first);
    const std::string_view word = style.get(T::style).view();
    p.bold = word == "BOLD" || word == "BOLDITALIC";
    p.italic = word == "ITALIC" || word == "BOLDITALIC";
    if (!p.bold && !p.italic && word != "PLAIN" && !word.empty())
        warn(problems, fmt::format("style \"{}\" is none of PLAIN, BOLD, ITALIC, BOLDITALIC: taken as PLAIN", word));
}

}  // namespace

TextParams readText(const Scene& scene, const Node& text, Mesh& problems) {
    TextParams p;
    for (const String& line : text.get(x3d::Text::string)) p.strings.emplace_back(line.view());
    for (const float length : text.get(x3d::Text::length)) p.length.push_back(length);
    p.maxExtent = text.get(x3d::Text::maxExtent);
    p.solid = text.get(x3d::Text::solid);
    const Node* style = scene.effectiveNode(text.get(x3d::Text::fontStyle));
    if (!style) return p;
    if (style->is(x3d::FontStyle::type)) {
        readStyle<x3d::FontStyle>(scene, *style, p, problems);
        p.size = style->get(x3d::FontStyle::size);
    } else if (style->is(x3d::ScreenFontStyle::type)) {
        readStyle<x3d::ScreenFontStyle>(scene, *style, p, problems);
        p.size = style->get(x3d::ScreenFontStyle::pointSize) * kPoint;
        p.inPixels = true;
    } else {
        warn(problems, fmt::format("fontStyle: {} is not supported here: the default is used", style->type().name));
    }
    return p;
}

}  // namespace detail

Array<float> measureText(const Scene& scene, const Node& text) {
    Mesh ignored;
    return detail::TextMaker().measure(detail::readText(scene, text, ignored));
}

Mesh tessellate(const TextParams& params, const TessellationOptions& options) {
    return detail::TextMaker().make(params, options);
}

}  // namespace rtsg
