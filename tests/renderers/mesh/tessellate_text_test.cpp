// Text: areas against the exact integrals of the outlines, places against DejaVu Sans Mono, whose letters all advance
// by 1233 of 2048 units.
#include <algorithm>
#include <limits>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/text_measure.h>

#include "mesh_check.h"
#include "shapes/tessellate_text.h"
#include "support/written_font.h"
#include "text/fonts.h"

namespace rtsg {
namespace {

using Justify = TextParams::Justify;
constexpr double kAdvance = 1233.0 / 2048;

TextParams mono(std::vector<std::string> strings) {
    TextParams p;
    p.strings = std::move(strings);
    p.family = {"TYPEWRITER"};
    return p;
}
Mesh textMesh(const TextParams& p) {
    Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    for (const Diagnostic& d : mesh.diagnostics.all()) ADD_FAILURE() << d.format();
    return mesh;
}
FontChoice chosen(const char* family, bool bold = false) {
    FontChoice choice;
    EXPECT_EQ((*fonts())->choose({{family}, bold, false}, choice), "");
    return choice;
}

/// By Green's theorem: the sum of half the integral of x dy - y dx along each curve.
double exactArea(const std::string& text, const char* family) {
    const Fonts& from = **fonts();
    ShapedLine line;
    from.shape(chosen(family).face, text, "", true, line);
    double sum = 0;
    for (const PlacedGlyph& g : line.glyphs) {
        std::vector<GlyphContour> contours;
        from.outline(g.face, g.glyph, contours);
        for (const GlyphContour& c : contours) {
            const auto at = [&](std::size_t i) { return Vec2d(c.points[2 * i], c.points[2 * i + 1]); };
            const auto cross = [](Vec2d a, Vec2d b) { return a.x * b.y - a.y * b.x; };
            std::size_t i = 0;
            for (const std::uint8_t degree : c.segments) {
                if (degree == 1) sum += cross(at(i), at(i + 1)) / 2;
                if (degree == 2)
                    sum += (cross(at(i), at(i + 1)) + cross(at(i + 1), at(i + 2))) / 3 + cross(at(i), at(i + 2)) / 6;
                EXPECT_LT(degree, 3) << "TrueType has quadratic curves";
                i += degree;
            }
            sum += cross(at(i), at(0)) / 2;
        }
    }
    return std::abs(sum);
}

TEST(TessellateText, AreaIsThatOfTheOutlines) {
    for (const char* family : {"SERIF", "SANS", "TYPEWRITER"})
        for (const char* text : {"l", "o", "8", "%", "The quick brown fox"}) {
            TextParams p;
            p.strings = {text};
            p.family = {family};
            const double exact = exactArea(text, family);
            ASSERT_GT(exact, .01);
            EXPECT_NEAR(surfaceArea(textMesh(p)), exact, .006 * exact) << family << ' ' << text;
            p.size = 3;
            EXPECT_NEAR(surfaceArea(textMesh(p)), 9 * exact, 9 * .006 * exact)
                << "area grows with the square of the size";
        }
}

TEST(TessellateText, FinerOptionsComeNearerToTheCurves) {
    TextParams p;
    p.strings = {"oooo"};
    const double exact = exactArea("oooo", "SERIF");
    TessellationOptions coarse, fine;
    coarse.chordError = .02f, fine.chordError = .0001f;
    const double far = std::abs(surfaceArea(tessellate(p, coarse)) - exact);
    const double near = std::abs(surfaceArea(tessellate(p, fine)) - exact);
    EXPECT_LT(near, 2e-4 * exact);
    EXPECT_LT(10 * near, far);
}

TEST(TessellateText, TurnsItsFrontToPlusZ) {
    const Mesh mesh = textMesh(mono({"Aog&"}));
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const Vec3f a = mesh.vertex(t, 0);
        EXPECT_GE(glm::cross(mesh.vertex(t, 1) - a, mesh.vertex(t, 2) - a).z, 0);
    }
    EXPECT_FALSE(mesh.solid);
}

TEST(TessellateText, LettersFollowEachOther) {
    const Mesh one = textMesh(mono({"l"})), four = textMesh(mono({"llll"}));
    EXPECT_NEAR(four.bounds.min.x, one.bounds.min.x, 1e-6);
    EXPECT_NEAR(four.bounds.max.x, one.bounds.max.x + 3 * kAdvance, 1e-5);
    TextParams big = mono({"llll"});
    big.size = 2.5f;
    EXPECT_NEAR(textMesh(big).bounds.max.x, 2.5 * four.bounds.max.x, 1e-5);
}

TEST(TessellateText, LinesFollowEachOther) {
    const Mesh one = textMesh(mono({"x"}));
    TextParams p = mono({"x", "", "x"});
    p.spacing = 1.5f, p.size = 2;
    const Mesh down = textMesh(p);
    EXPECT_NEAR(down.bounds.max.y, 2 * one.bounds.max.y, 1e-6) << "FIRST: the first baseline stays";
    EXPECT_NEAR(down.bounds.min.y, 2 * one.bounds.min.y - 2 * 1.5 * 2, 1e-5);
    p.topToBottom = false;
    const Mesh up = textMesh(p);
    EXPECT_NEAR(up.bounds.min.y, 2 * one.bounds.min.y, 1e-6);
    EXPECT_NEAR(up.bounds.max.y, 2 * one.bounds.max.y + 2 * 1.5 * 2, 1e-5);
}

TEST(TessellateText, MajorJustification) {
    const Mesh begin = textMesh(mono({"ll"}));
    const auto shift = [&](Justify major, bool leftToRight) {
        TextParams p = mono({"ll"});
        p.major = major, p.leftToRight = leftToRight;
        return double{textMesh(p).bounds.min.x} - begin.bounds.min.x;
    };
    EXPECT_NEAR(shift(Justify::first, true), 0, 1e-6);
    EXPECT_NEAR(shift(Justify::middle, true), -begin.bounds.center().x, 2e-3) << "by what is seen";
    EXPECT_NEAR(shift(Justify::end, true), -2 * kAdvance, 1e-6);
    EXPECT_NEAR(shift(Justify::begin, false), -2 * kAdvance, 1e-6);
    EXPECT_NEAR(shift(Justify::end, false), 0, 1e-6);
}

// Each line by itself along the lines, all together across them.
TEST(TessellateText, MinorJustification) {
    const FontChoice font = chosen("TYPEWRITER");
    const double ascent = font.ascent, descent = font.descent;
    const auto shift = [&](Justify minor, bool down) {
        TextParams p = mono({"x", "x", "x"});
        p.spacing = 2, p.topToBottom = down;
        const double first = textMesh(p).bounds.min.y;
        p.minor = minor;
        return textMesh(p).bounds.min.y - first;
    };
    EXPECT_NEAR(shift(Justify::begin, true), -ascent, 1e-5);
    EXPECT_NEAR(shift(Justify::end, true), 4 + descent, 1e-5);
    const double height = textMesh(mono({"x"})).bounds.max.y;  // an x stands on its baseline
    EXPECT_NEAR(shift(Justify::middle, true), (4 - height) / 2, 1e-3);
    EXPECT_NEAR(shift(Justify::begin, false), descent, 1e-5);
    EXPECT_NEAR(shift(Justify::end, false), -4 - ascent, 1e-5);
    EXPECT_NEAR(shift(Justify::middle, false), (-4 - height) / 2, 1e-3);
}

/// "A" and "AA" of a font whose one letter is a box, from (left, bottom) to (right, top), and advances by .777.
struct Boxes {
    static constexpr double left = -.05, bottom = -.12, right = .433, top = .611, advance = .777;

    static Bounds of(Array<String> strings, const std::string& style) {
        test::WrittenFont font;
        font.left = -50, font.bottom = -120, font.right = 433, font.top = 611, font.advance = 777;
        Scene scene;
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene,
                             "#X3D V4.1 utf8\nShape { geometry DEF T Text { fontStyle FontStyle { family \"Boxes\" " +
                                 style + " } } } DEF L FontLibrary { family \"Boxes\" url \"" +
                                 test::fontUrl(font.bytes()) + "\" }",
                             diagnostics));
        EXPECT_TRUE(scene.set(scene.findName("T"), x3d::Text::string, std::move(strings)));
        const auto mesh = tessellate(scene, scene.findName("T"));
        return mesh ? (*mesh)->bounds : Bounds();
    }
    static void expectBox(const Bounds& found, Vec2d low, Vec2d high, const char* what) {
        EXPECT_NEAR(found.min.x, low.x, 1e-6) << what;
        EXPECT_NEAR(found.min.y, low.y, 1e-6) << what;
        EXPECT_NEAR(found.max.x, high.x, 1e-6) << what;
        EXPECT_NEAR(found.max.y, high.y, 1e-6) << what;
    }
};

TEST(TessellateText, MiddleIsThatOfWhatIsSeen) {
    using B = Boxes;
    const double wide = B::advance + B::right - B::left, high = 1 + B::top - B::bottom;
    B::expectBox(B::of({"AA", "A"}, "justify [ \"MIDDLE\" \"MIDDLE\" ]"), {-wide / 2, -high / 2}, {wide / 2, high / 2},
                 "two lines");
    B::expectBox(B::of({"", "AA", " "}, "size 3 justify [ \"MIDDLE\" \"MIDDLE\" ]"), {-1.5 * wide, -1.5 * (high - 1)},
                 {1.5 * wide, 1.5 * (high - 1)}, "blank lines are not seen");
    B::expectBox(B::of({"A", "A"}, "topToBottom FALSE justify [ \"BEGIN\" \"MIDDLE\" ]"), {B::left, -high / 2},
                 {B::right, high / 2}, "upwards; the begin is the font's");
    B::expectBox(B::of({"A"}, "leftToRight FALSE justify [ \"END\" \"FIRST\" ]"), {B::left, B::bottom},
                 {B::right, B::top}, "the end is the font's");
}

TEST(TessellateText, ColumnsArePlacedByWhatIsSeen) {
    using B = Boxes;
    const double wide = B::right - B::left, high = B::top - B::bottom;
    const auto of = [](Array<String> strings, const std::string& style) {
        return B::of(std::move(strings), "horizontal FALSE spacing 2 " + style);
    };
    B::expectBox(of({"AAA", "A"}, ""), {0, -2 - high}, {2 + wide, 0}, "from the left and down");
    B::expectBox(of({"AAA", "A"}, "leftToRight FALSE topToBottom FALSE"), {-2 - wide, 0}, {0, 2 + high},
                 "from the right and up");
    B::expectBox(of({"AAA"}, "justify [ \"MIDDLE\" \"MIDDLE\" ]"), {-wide / 2, -1 - high / 2}, {wide / 2, 1 + high / 2},
                 "the middle");
    B::expectBox(of({"AAA", "A"}, "justify [ \"END\" \"END\" ]"), {-2 - wide, 0}, {0, 2 + high}, "the end");
    B::expectBox(of({" ", "A", ""}, "size 2 justify [ \"END\" \"MIDDLE\" ]"), {-wide, 0}, {wide, 2 * high},
                 "blank columns are not seen");
}

// The box of a glyph, which is computed on its curves, against the points of its finely cut outline.
TEST(TessellateText, BoxesOfGlyphsHoldTheirOutlines) {
    const Fonts& from = **fonts();
    for (const bool italic : {false, true}) {  // no italic face of this family: upright ones are slanted
        FontChoice choice;
        ASSERT_EQ(from.choose({{"DejaVu Math TeX Gyre"}, false, italic}, choice), "");
        ShapedLine line;
        from.shape(choice.face, "og&S8", "", true, line);
        for (const PlacedGlyph& g : line.glyphs) {
            std::vector<GlyphContour> contours;
            from.outline(g.face, g.glyph, contours);
            Vec2f low(9), high(-9);
            for (const Vec2f& point : detail::cutGlyph(contours, 1e-5f).points)
                low = glm::min(low, point), high = glm::max(high, point);
            const GlyphBox box = from.box(g.face, g.glyph);
            EXPECT_FALSE(box.empty);
            EXPECT_NEAR(box.left, low.x, 1.5e-3);
            EXPECT_NEAR(box.bottom, low.y, 1.5e-3);
            EXPECT_NEAR(box.right, high.x, 1.5e-3);
            EXPECT_NEAR(box.top, high.y, 1.5e-3);
        }
    }
    const FontChoice sans = chosen("SANS");
    ShapedLine blank;
    from.shape(sans.face, " ", "", true, blank);
    ASSERT_EQ(blank.glyphs.size(), 1u);
    EXPECT_TRUE(from.box(blank.glyphs[0].face, blank.glyphs[0].glyph).empty);
}

TEST(TessellateText, VerticalCellsAreOneEm) {
    TextParams p = mono({"o.o"});
    p.horizontal = false;
    const Bounds one = textMesh(mono({"o"})).bounds;
    const double high = one.max.y - one.min.y;
    EXPECT_NEAR(textMesh(p).bounds.min.y, -2 - high, 2e-3);
    EXPECT_NEAR(textMesh(p).bounds.max.y, 0, 1e-3);
    p.topToBottom = false;
    EXPECT_NEAR(textMesh(p).bounds.max.y, 2 + high, 2e-3);
}

TEST(TessellateText, LengthAndMaxExtentScaleAlongTheLine) {
    TextParams p = mono({"llll", "llll"});
    const Mesh plain = textMesh(p);
    p.length = {static_cast<float>(8 * kAdvance)};
    Mesh mesh = textMesh(p);
    EXPECT_NEAR(mesh.bounds.max.x, 2 * plain.bounds.max.x, 1e-5);
    EXPECT_NEAR(mesh.bounds.max.y, plain.bounds.max.y, 1e-6) << "across it they stay";
    EXPECT_NEAR(surfaceArea(mesh), 1.5 * surfaceArea(plain), 1e-4) << "the second line has no length of its own";
    p.maxExtent = static_cast<float>(4 * kAdvance);
    mesh = textMesh(p);
    EXPECT_NEAR(mesh.bounds.max.x, plain.bounds.max.x, 1e-5);
    EXPECT_NEAR(surfaceArea(mesh), .75 * surfaceArea(plain), 1e-4) << "all lines alike";
    p.maxExtent = 100;
    EXPECT_NEAR(textMesh(p).bounds.max.x, 2 * plain.bounds.max.x, 1e-5) << "and none is stretched";
    TextParams vertical = mono({"llll"});
    vertical.horizontal = false;
    const Bounds before = textMesh(vertical).bounds;
    vertical.length = {8};
    EXPECT_NEAR(textMesh(vertical).bounds.min.y, 2 * before.min.y, 1e-5);
    EXPECT_NEAR(textMesh(vertical).bounds.min.x, before.min.x, 1e-6);
}

TEST(TessellateText, StylesAreOtherFaces) {
    TextParams p = mono({"lm"});
    const double plain = surfaceArea(textMesh(p));
    const Bounds upright = textMesh(p).bounds;
    p.bold = true;
    EXPECT_GT(surfaceArea(textMesh(p)), 1.2 * plain);
    p.bold = false, p.italic = true;
    EXPECT_GT(textMesh(p).bounds.max.x, upright.max.x);
}

// A family of upright faces alone (of fonts-dejavu-extra).
TEST(TessellateText, UprightFacesSlantWhereThereIsNoItalicOne) {
    TextParams p;
    p.strings = {"HHH"};
    p.family = {"DejaVu Math TeX Gyre"};
    const Mesh upright = textMesh(p);
    p.italic = true;
    const Mesh slanted = textMesh(p);
    constexpr float kSlant = .2f;
    EXPECT_NEAR(slanted.bounds.max.x, upright.bounds.max.x + kSlant * upright.bounds.max.y, 1e-5);
    EXPECT_NEAR(slanted.bounds.min.x, upright.bounds.min.x, 1e-5);
    EXPECT_NEAR(slanted.bounds.max.y, upright.bounds.max.y, 1e-6);
    EXPECT_NEAR(surfaceArea(slanted), surfaceArea(upright), 1e-5);
}

// Each family and style is the face of DejaVu that its name says, none of the condensed ones: the advance and the box
// of an H, in the units of the files, to the two by which the italic ones are shifted against their boxes.
TEST(TessellateText, FamiliesAndStylesAreTheirOwnFaces) {
    struct Face {
        const char* family;
        bool bold, italic;
        int advance, left, right;
    };
    for (const Face& face : {Face{"SERIF", false, false, 1786, 113, 1673},
                             {"SERIF", true, false, 1935, 96, 1843},
                             {"SERIF", false, true, 1786, -33, 1819},
                             {"SERIF", true, true, 1935, -50, 1989},
                             {"SANS", false, false, 1540, 201, 1339},
                             {"SANS", true, false, 1714, 188, 1526},
                             {"SANS", false, true, 1540, 55, 1485},
                             {"SANS", true, true, 1714, 43, 1671},
                             {"TYPEWRITER", true, false, 1233, 137, 1096},
                             {"TYPEWRITER", false, true, 1233, -8, 1241}}) {
        SCOPED_TRACE(face.family + std::string(face.bold ? " bold" : "") + (face.italic ? " italic" : ""));
        TextParams p;
        p.strings = {"HHH"};
        p.family = {face.family};
        p.bold = face.bold, p.italic = face.italic;
        const Bounds bounds = textMesh(p).bounds;
        EXPECT_NEAR(bounds.min.x, face.left / 2048.0, .0015);
        EXPECT_NEAR(bounds.max.x, (2 * face.advance + face.right) / 2048.0, .0015);
        EXPECT_NEAR(bounds.min.y, 0, 1e-6);
        EXPECT_NEAR(bounds.max.y, 1493 / 2048.0, 1e-6);
    }
}

TEST(TessellateText, LettersOfRightToLeftScriptsRunToTheLeft) {
    if (!(*fonts())->shapes()) GTEST_SKIP() << "built without HarfBuzz";
    const Fonts& from = **fonts();
    const std::uint32_t face = chosen("SANS").face;
    const auto glyphsOf = [&](const char* text, bool leftToRight) {
        ShapedLine line;
        from.shape(face, text, "", leftToRight, line);
        std::vector<std::uint32_t> glyphs;
        for (const PlacedGlyph& g : line.glyphs) glyphs.push_back(g.glyph);
        return glyphs;
    };
    const auto reversed = [](std::vector<std::uint32_t> glyphs) {
        std::reverse(glyphs.begin(), glyphs.end());
        return glyphs;
    };
    const auto ltr = glyphsOf("abc", true);
    ASSERT_EQ(ltr.size(), 3u);
    EXPECT_EQ(glyphsOf("abc", false), reversed(ltr));
    // Alef and bet: the first letter comes last.
    EXPECT_EQ(glyphsOf("\xD7\x90\xD7\x91", true).back(), glyphsOf("\xD7\x90", true).front());
    // Lam and alef join to one glyph.
    EXPECT_EQ(glyphsOf("\xD9\x84\xD8\xA7", true).size(), 1u);
    // A number in Hebrew keeps its order.
    const auto mixed = glyphsOf(
        "\xD7\x90"
        "12",
        true);
    ASSERT_EQ(mixed.size(), 3u);
    EXPECT_EQ(std::vector(mixed.begin() + 1, mixed.end()), glyphsOf("12", true));
}

TEST(TessellateText, WhatCannotBeIsSaid) {
    TextParams p = mono({"x"});
    p.family = {"No Such Family"};
    Mesh mesh = tessellate(p);
    EXPECT_GT(mesh.triangleCount, 0u);
    ASSERT_EQ(mesh.diagnostics.warnings(), 1u);
    EXPECT_NE(mesh.diagnostics.all()[0].text.find("\"No Such Family\" is not installed"), std::string::npos);
    p.family = {"No Such Family", "TYPEWRITER"};
    EXPECT_EQ(textMesh(mono({"x"})).bounds.max, tessellate(p).bounds.max);
    p = mono({"\xF3\xB0\x80\x80"});  // a character for private use
    EXPECT_EQ(tessellate(p).diagnostics.warnings(), 1u);
    for (const float size : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN(), 1e30f}) {
        p = mono({"x"});
        p.size = size;
        mesh = tessellate(p);
        EXPECT_TRUE(mesh.empty());
        EXPECT_EQ(mesh.diagnostics.warnings(), 1u) << size;
    }
    p = mono({"x\x80y\xC3"});  // not UTF-8
    EXPECT_GT(tessellate(p).triangleCount, 0u);
    EXPECT_TRUE(textMesh(mono({})).empty());
    EXPECT_TRUE(textMesh(mono({"", " "})).empty());
}

TEST(TessellateText, ReadsTheNodesOfAScene) {
    Scene scene;
    const NodeId text = scene.createNode(x3d::Text::type), style = scene.createNode(x3d::FontStyle::type);
    ASSERT_TRUE(scene.set(text, x3d::Text::string, Array<String>{"ll"}));
    ASSERT_TRUE(scene.set(text, x3d::Text::fontStyle, style));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::family, Array<String>{"TYPEWRITER"}));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::justify, Array<String>{"END", "BEGIN"}));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::style, String("BOLD")));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::size, 2.0f));
    TextParams p = mono({"ll"});
    p.major = Justify::end, p.minor = Justify::begin, p.bold = true, p.size = 2;
    const Mesh expected = textMesh(p);
    const auto mesh = tessellate(scene, text);
    ASSERT_TRUE(mesh);
    EXPECT_EQ((*mesh)->bounds.min, expected.bounds.min);
    EXPECT_EQ((*mesh)->bounds.max, expected.bounds.max);
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::justify, Array<String>{"LEFT"}));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::style, String("HEAVY")));
    EXPECT_EQ((*tessellate(scene, text))->diagnostics.warnings(), 2u);
}

// 15.4.2: lineBounds, origin (the upper left corner) and textBounds.
TEST(TessellateText, MeasuresItsLines) {
    Scene scene;
    const NodeId text = scene.createNode(x3d::Text::type), style = scene.createNode(x3d::FontStyle::type);
    ASSERT_TRUE(scene.set(text, x3d::Text::string, Array<String>{"lll", "l"}));
    ASSERT_TRUE(scene.set(text, x3d::Text::fontStyle, style));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::family, Array<String>{"TYPEWRITER"}));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::size, 2.0f));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::spacing, 1.5f));
    const FontChoice font = chosen("TYPEWRITER");
    const double height = 2 * (double(font.ascent) + double(font.descent));
    const auto expectSizes = [&](std::initializer_list<double> expected) {
        const Array<float> sizes = measureText(scene, scene.node(text));
        ASSERT_EQ(sizes.size(), expected.size());
        std::size_t i = 0;
        for (const double number : expected) EXPECT_NEAR(double(sizes[i++]), number, 1e-5) << i;
    };
    expectSizes({6 * kAdvance, height + 3, 0, 2 * font.ascent, 0, 6 * kAdvance, height, 2 * kAdvance, height});
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::justify, Array<String>{"END", "END"}));
    expectSizes({6 * kAdvance, height + 3, -6 * kAdvance, height + 3, 0, 6 * kAdvance, height, 2 * kAdvance, height});
    ASSERT_TRUE(scene.set(text, x3d::Text::length, Array<float>{0.0f, 5.0f}));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::justify, Array<String>{"MIDDLE", "FIRST"}));
    // The second line's one letter, stretched to 5, stands with its own middle on the axis.
    const double middle = 5 / kAdvance * textMesh(mono({"l"})).bounds.center().x;
    expectSizes({5, height + 3, -middle, 2 * font.ascent, 0, 6 * kAdvance, height, 5, height});
    // Columns of cells of an em.
    ASSERT_TRUE(scene.set(text, x3d::Text::length, Array<float>{}));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::horizontal, false));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::justify, Array<String>{"BEGIN"}));
    // Their ink begins at the axes, in the middle of the first cell and below its top.
    const Bounds l = textMesh(mono({"l"})).bounds;
    const double left = .5 * (1 - kAdvance) + l.min.x;
    const double top = -1 + double(font.descent) / (double(font.ascent) + double(font.descent)) + l.max.y;
    expectSizes({5, 6, -2 * left, -2 * top, 0, 2, 6, 2, 2});
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::size, 0.0f));
    EXPECT_TRUE(measureText(scene, scene.node(text)).empty());
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::size, 1.0f));
    ASSERT_TRUE(scene.set(text, x3d::Text::string, Array<String>{}));
    EXPECT_TRUE(measureText(scene, scene.node(text)).empty());
}

// 15.4.2: the texture's size is the font's.
TEST(TessellateText, TexturesHaveTheSizeOfTheFont) {
    TextParams p = mono({"M"});
    p.size = 4;
    const Mesh mesh = textMesh(p);
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const Vec4f st = mesh.texCoord(t, 0, 0);
        EXPECT_NEAR(st.x, mesh.vertex(t, 0).x / 4, 1e-6);
        EXPECT_NEAR(st.y, mesh.vertex(t, 0).y / 4, 1e-6);
    }
}

// A FontLibrary's font: outlines, advances and lines are those of the file, to its last unit.
TEST(TessellateText, FontsOfLibrariesHaveTheirOwnNumbers) {
    const auto scene = [](Scene& to, const std::string& library, const std::string& style) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(to,
                             "#X3D V4.1 utf8\nShape { geometry DEF T Text { string [ \"AA\" \"A\" ] fontStyle " +
                                 style + " } } " + library,
                             diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    };
    test::WrittenFont font;
    font.left = -50, font.bottom = -120, font.right = 433, font.top = 611, font.advance = 777;
    const std::string library =
        "DEF L FontLibrary { family [ \"Other\" \"Boxes\" ] url \"" + test::fontUrl(font.bytes()) + "\" }";
    Scene s;
    scene(s, library, "FontStyle { family \"Boxes\" size 2 }");
    const auto mesh = tessellate(s, s.findName("T"));
    ASSERT_TRUE(mesh);
    EXPECT_EQ((*mesh)->diagnostics.all().size(), 0u);
    EXPECT_EQ((*mesh)->triangleCount, 6u);
    EXPECT_NEAR((*mesh)->bounds.min.x, 2 * -.05, 1e-6);
    EXPECT_NEAR((*mesh)->bounds.max.x, 2 * (.777 + .433), 1e-6);
    EXPECT_NEAR((*mesh)->bounds.max.y, 2 * .611, 1e-6);
    EXPECT_NEAR((*mesh)->bounds.min.y, 2 * (-1 - .12), 1e-6) << "a line of spacing 1 below";
    EXPECT_NEAR(surfaceArea(**mesh), 3 * 4 * .483 * .731, 1e-5);
    const Array<float> sizes = measureText(s, s.node(s.findName("T")));
    ASSERT_EQ(sizes.size(), 9u);
    EXPECT_NEAR(sizes[5], 2 * 2 * .777, 1e-6) << "the first line's width";
    EXPECT_NEAR(sizes[6], 2 * 1.2, 1e-6) << "from its descent to its ascent";

    // Bold and slanted or not, and after a family that nobody has, which is named.
    Scene other;
    scene(other, library, "FontStyle { family [ \"Nobody Has This\" \"BOXES\" ] style \"BOLDITALIC\" size 2 }");
    const auto same = tessellate(other, other.findName("T"));
    ASSERT_TRUE(same);
    EXPECT_EQ((*same)->bounds.max, (*mesh)->bounds.max);
    ASSERT_EQ((*same)->diagnostics.all().size(), 1u);
    EXPECT_NE((*same)->diagnostics.all()[0].text.find("\"Nobody Has This\" is not installed: \"BOXES\" is used"),
              std::string::npos);
}

// The directory is whole, and what it leads to is not: told, and the next family is taken.
TEST(TessellateText, FontsThatFreeTypeRefusesAreNamed) {
    std::string bytes = test::WrittenFont().bytes();
    const std::size_t head = bytes.find("\x5F\x0F\x3C\xF5");
    ASSERT_NE(head, std::string::npos);
    bytes.replace(head - 12, 4, std::string(4, '\xEE'));  // its version
    bytes.replace(head + 6, 2, std::string(2, '\0'));     // units per em
    Scene s;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(s,
                         "#X3D V4.1 utf8\nShape { geometry DEF T Text { string \"A\" fontStyle FontStyle { family [ "
                         "\"Boxes\" \"SANS\" ] } } } DEF L FontLibrary { family \"Boxes\" url \"" +
                             test::fontUrl(bytes) + "\" }",
                         diagnostics));
    const auto mesh = tessellate(s, s.findName("T"));
    ASSERT_TRUE(mesh);
    EXPECT_GT((*mesh)->triangleCount, 2u) << "of SANS";
    std::string said;
    for (const Diagnostic& d : (*mesh)->diagnostics.all()) said += d.text;
    EXPECT_NE(said.find("the font of FontLibrary L is not used: FreeType"), std::string::npos) << said;
}

}  // namespace
}  // namespace rtsg
