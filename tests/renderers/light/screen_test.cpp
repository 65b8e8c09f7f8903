// ScreenGroups and text in points: sizes in pixels against closed forms; what follows edits equals what is built anew.
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/tessellate.h>

#include <algorithm>
#include <array>
#include <random>

#include "light_scene.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

using namespace test;

/// The pixels that are redder than green: width, height, and number.
struct Extent {
    int width = 0, height = 0, pixels = 0;
};
Extent extentOf(const Picture& p) {
    int left = p.width, right = -1, top = p.height, bottom = -1, pixels = 0;
    for (int y = 0; y < p.height; ++y)
        for (int x = 0; x < p.width; ++x)
            if (p.at(x, y).r > p.at(x, y).g) {
                ++pixels;
                left = std::min(left, x), right = std::max(right, x);
                top = std::min(top, y), bottom = std::max(bottom, y);
            }
    return {right - left + 1, bottom - top + 1, pixels};
}
const std::string kGreen = "Background { skyColor 0 1 0 } ";
/// A shape of this width and height in units.
std::string units(double width, double height) {
    return fmt::format("Transform {{ scale {} {} 1 children [ {} ] }}", width, height, square(.5, unlit("1 0 0")));
}
std::string screen(const std::string& transform, const std::string& children) {
    return "Transform { " + transform + " children ScreenGroup { children [ " + children + " ] } }";
}
constexpr int kScreenSizes[][2] = {{64, 48}, {48, 64}, {97, 31}, {90, 90}};

TEST(ScreenGroup, HasItsSizeInPixelsWhereverItIs) {
    // Its middle off all pixels' middles; 20 by 12 of them, whatever the eye, the distance and the scale around.
    const char* eyes[] = {"Viewpoint { position 0 0 10 fieldOfView .6 } ",
                          "Viewpoint { position 0 0 40 fieldOfView 1.4 } ",
                          "OrthoViewpoint { position 0 0 7 fieldOfView [ -3 -3 3 3 ] } "};
    const char* positions[] = {"", "translation 0 0 -25", "scale 3 .2 7", "translation .3 .2 1 scale 20 20 20"};
    for (const auto& [width, height] : kScreenSizes)
        for (const char* eye : eyes)
            for (const char* position : positions) {
                const Extent e =
                    extentOf(LightScene(kGreen + eye + screen(position, units(20.3, 12.4)), width, height).picture());
                EXPECT_NEAR(e.width, 20, 1) << width << "x" << height << eye << position;
                EXPECT_NEAR(e.height, 12, 1) << width << "x" << height << eye << position;
                EXPECT_EQ(e.pixels, e.width * e.height);
            }
}

// Exactly, from its matrix: a pixel is 2 tan(angle / 2) / height of the depth, along the view and not to the eye.
TEST(ScreenGroup, OneUnitIsOnePixelAtItsDepth) {
    const double fieldOfView = .7;
    for (const auto& [width, height] : kScreenSizes) {
        LightScene s(kGreen +
                         "Viewpoint { position 1 2 10 fieldOfView .7 } Transform { translation 4 3 -6 scale 2 3 5 "
                         "rotation 0 0 1 .5 children ScreenGroup { children DEF S " +
                         square(.5, unlit("1 0 0")) + " } }",
                     width, height);
        (void)s.picture();
        const double pixel = 2 * std::tan(double(float(fieldOfView)) / 2) / std::min(width, height) * 16;
        for (const Instance& instance : s.world->flattener().instances())
            if (instance.id) {
                for (int axis = 0; axis < 3; ++axis)
                    EXPECT_NEAR(glm::length(instance.worldFromLocal[axis]), pixel, 1e-7 * pixel);
                EXPECT_NEAR(std::atan2(instance.worldFromLocal[0].y, instance.worldFromLocal[0].x), .5, 1e-7);
                EXPECT_FALSE(instance.heard);
            }
    }
}

TEST(ScreenGroup, IsPixelsInLayersOfTheirOwnEyes) {
    for (const auto& [width, height] : kScreenSizes)
        for (const std::string layer :
             {"Layer { children [ Viewpoint { position 0 0 3 } ", "LayoutLayer { children [ ",
              "LayoutLayer { layout Layout { size [ .7 .9 ] scaleMode [ \"FRACTION\" \"PIXEL\" ] } children [ ",
              "Layer { viewport Viewport { clipBoundary [ .1 .9 .2 1 ] } children [ "}) {
            const Extent e =
                extentOf(LightScene(kGreen + "Viewpoint { position 0 0 99 } LayerSet { order [ 0 1 ] layers " + layer +
                                        screen("translation 0 0 -2", units(20.3, 12.4)) + " ] } }",
                                    width, height)
                             .picture());
            EXPECT_NEAR(e.width, 20, 1) << width << "x" << height << layer;
            EXPECT_NEAR(e.height, 12, 1) << width << "x" << height << layer;
        }
}

TEST(ScreenGroup, FollowsTheEyeAndItsPlace) {
    LightScene s(kGreen +
                     "DEF V Viewpoint { position 0 0 10 } DEF T Transform { translation .01 .01 0 children [ DEF G "
                     "ScreenGroup { children [ " +
                     units(20.3, 12.4) + " ] } ] } Transform { translation 0 3 -50 children USE G }",
                 90, 90);
    EXPECT_NEAR(extentOf(s.picture()).width, 20, 1);
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewpoint::position, Vec3f(0, 0, 25)));
    s.scene.newFrame(1);
    EXPECT_NEAR(extentOf(s.picture()).width, 20, 1);
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewpoint::fieldOfView, .2f));  // the eye stays where it is
    s.scene.newFrame(2);
    EXPECT_NEAR(extentOf(s.picture()).width, 20, 1);
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(.01f, .01f, 11)));
    s.scene.newFrame(3);
    EXPECT_NEAR(extentOf(s.picture()).width, 20, 1);
    s.options.settings.width = s.options.settings.height = 60;
    EXPECT_NEAR(extentOf(s.picture()).width, 20, 1);
}

/// Square pixels that a text of this size covers.
double ink(double pixels) {
    TextParams p;
    p.strings = {"Ho"};
    p.size = static_cast<float>(pixels);
    return surfaceArea(tessellate(p));
}
/// Square pixels of red.
double coverage(const Picture& p) {
    double sum = 0;
    for (const Vec4f& pixel : p.pixels) sum += pixel.r;
    return sum;
}
std::string text(const std::string& style, const std::string& name = "TEXT") {
    return "Shape { appearance Appearance { " + unlit("1 0 0") + " } geometry DEF " + name +
           " Text { string \"Ho\" fontStyle " + style + " } } ";
}

// 96 pixels to the inch, 72 points to the inch: 18 points are 24 pixels.
TEST(ScreenFontStyle, IsInPoints) {
    const std::string eye = "Viewpoint { position 0 0 10 } ", points = text("ScreenFontStyle { pointSize 18 }");
    const std::string bodies[] = {
        eye + "Transform { translation -1 -1 0 children " + points + " }",
        eye + "Transform { translation -9 -9 -90 scale 2 2 2 children " + points + " }",
        eye + screen("translation -1 -1 0", points),
        "OrthoViewpoint { } Transform { translation -.5 0 0 children " + points + " }",
        eye + "LayerSet { order [ 0 1 ] layers LayoutLayer { layout Layout { scaleMode \"PIXEL\" } children [ " +
            points + " ] } }",
        eye +
            "LayerSet { order [ 0 1 ] layers LayoutLayer { layout Layout { align \"LEFT\" size [ .9 1 ] } children [ " +
            points + " ] } }"};
    for (const std::string& body : bodies) {
        LightScene s(kGreen + body, 120, 90);
        s.options.settings.samplesPerPixel = 16;
        const double sum = coverage(s.picture());
        EXPECT_NEAR(sum, ink(24), .03 * ink(24)) << body;
    }
}

/// How a point lies to a triangle: -1 outside, 1 inside, 0 too near to an edge to tell.
int sideOfTriangle(const Vec2d& p, const std::array<Vec2d, 3>& t, double margin) {
    double minimum = 1e9;
    const auto across = [](const Vec2d& a, const Vec2d& b) { return a.x * b.y - a.y * b.x; };
    const double angle = across(t[1] - t[0], t[2] - t[0]) < 0 ? -1 : 1;
    for (std::size_t i = 0; i < 3; ++i) {
        const Vec2d edge = t[(i + 1) % 3] - t[i];
        if (const double length = glm::length(edge); length > 0)
            minimum = std::min(minimum, angle * across(edge, p - t[i]) / length);
    }
    return minimum > margin ? 1 : minimum < -margin ? -1 : 0;
}

// Each pixel is what its middle meets of the letters' triangles where their place and size in pixels put them, at whole
// and at fractional positions.
TEST(ScreenFontStyle, LettersCoverThePixelsWhoseMiddlesTheyCover) {
    TextParams text;
    text.strings = {"Hxlg"}, text.size = 20, text.family = {"SANS"};
    const Mesh letters = tessellate(text);
    ASSERT_GT(letters.triangleCount, 0u);
    for (const char* eye : {"OrthoViewpoint { position 0 0 10 fieldOfView [ -40 -30 40 30 ] } ",
                            "Viewpoint { position 0 0 10 fieldOfView 1.2870022176 } "})  // 2 atan .75
        for (const Vec2d& at : {Vec2d(0, 0), Vec2d(-7, 3), Vec2d(2.25, -4.5), Vec2d(-11.4, 5.8)})
            for (const bool isGroup : {true, false}) {
                SCOPED_TRACE(fmt::format("{}{} {} {}", eye, at.x, at.y, isGroup));
                const bool parallel = eye[0] == 'O';
                const double pixel = parallel ? 1 : 10 * .75 / 30;
                const std::string shape = fmt::format(
                    "Shape {{ appearance Appearance {{ {} }} geometry Text {{ string \"Hxlg\" fontStyle {} }} "
                    "}}",
                    unlit("1 0 0"),
                    isGroup ? "FontStyle { size 20 family \"SANS\" }"
                            : "ScreenFontStyle { pointSize 15 family \"SANS\" }");
                LightScene s(kGreen + eye +
                                 fmt::format("Transform {{ translation {} {} 0 children {} }}", at.x * pixel,
                                             at.y * pixel, isGroup ? "ScreenGroup { children " + shape + " }" : shape),
                             80, 60);
                s.options.settings.samplesPerPixel = 1;
                const Picture p = s.picture();
                int covered = 0;
                for (int y = 0; y < 60; ++y)
                    for (int x = 0; x < 80; ++x) {
                        const Vec2d middle(x + .5 - 40 - at.x, 30 - y - .5 - at.y);
                        int side = -1;
                        for (std::uint32_t t = 0; t < letters.triangleCount; ++t)
                            side =
                                std::max(side, sideOfTriangle(middle,
                                                              {Vec2d(letters.vertex(t, 0)), Vec2d(letters.vertex(t, 1)),
                                                               Vec2d(letters.vertex(t, 2))},
                                                              2e-3));
                        if (side == 0) continue;
                        covered += side > 0;
                        EXPECT_EQ(p.at(x, y).r > .5f, side > 0) << x << " " << y;
                    }
                EXPECT_GT(covered, 150);
            }
}

TEST(ScreenFontStyle, ComesAndGoesWithItsNode) {
    LightScene s(kGreen + "Viewpoint { position 0 0 10 } Transform { translation -2 -1 0 children " +
                     text("DEF STYLE ScreenFontStyle { pointSize 18 }") + " }",
                 120, 90);
    s.options.settings.samplesPerPixel = 4;
    const auto covered = [&] { return coverage(s.picture()); };
    EXPECT_NEAR(covered(), ink(24), .05 * ink(24));
    ASSERT_TRUE(s.scene.set(s.node("STYLE"), x3d::ScreenFontStyle::pointSize, 27.0f));
    s.scene.newFrame(1);
    EXPECT_NEAR(covered(), ink(36), .05 * ink(36));
    const NodeId metres = s.scene.createNode(x3d::FontStyle::type);
    ASSERT_TRUE(s.scene.set(s.node("TEXT"), x3d::Text::fontStyle, metres));
    s.scene.newFrame(2);
    const double pixel = 20 * std::tan(.7854 / 2) / 90;
    EXPECT_NEAR(covered(), ink(1 / pixel), .1 * ink(1 / pixel)) << "1 m high";
    ASSERT_TRUE(s.scene.set(s.node("TEXT"), x3d::Text::fontStyle, s.node("STYLE")));
    s.scene.newFrame(3);
    EXPECT_NEAR(covered(), ink(36), .05 * ink(36));
}

int timesReported(const LightScene& s, const std::string& text) {
    const Diagnostics all = s.world->diagnostics();
    return static_cast<int>(std::ranges::count(all.all(), text, &Diagnostic::text));
}

// ---- what is wrong is named, once --------------------------------------------------------------------------------

TEST(Layout, BadValuesHaveStatedOutcomes) {
    struct Case {
        const char *layout, *reported;
        double width;  // of the rectangle, as a share
    };
    const Case cases[] = {
        {"size [ ]", "size has no values: it is taken as the default", 1},
        {"size [ .5 .5 .5 ]", "size has 3 values: the first 2 count", .5},
        {"offset [ 0 0 0 0 ]", "offset has 4 values: the first 2 count", 1},
        {"size [ 0 1 ]", "size 0 is not above 0: nothing in the rectangle is drawn", 0},
        {"size [ 1 -2 ]", "size -2 is not above 0: nothing in the rectangle is drawn", 0},
        {"align [ ]", "align has no values: it is taken as the default", 1},
        {"sizeUnits [ \"PIXEL\" \"PIXEL\" \"PIXEL\" ] size [ 16 16 ]", "sizeUnits has 3 values: the first 2 count", .5},
        {"scaleMode [ ]", "scaleMode has no values: it is taken as the default", 1},
    };
    for (const Case& one : cases) {
        LightScene s(kGreen + "LayerSet { order [ 0 1 ] layers LayoutLayer { layout DEF L Layout { " + one.layout +
                         " } children [ " + square(.5, unlit("1 0 0")) + " ] } }",
                     32, 32);
        EXPECT_EQ(extentOf(s.picture()).pixels, std::lround(32 * 32 * one.width * one.width)) << one.layout;
        s.scene.newFrame(1);
        (void)s.picture();
        EXPECT_EQ(timesReported(s, std::string("Layout L: ") + one.reported), 1) << one.layout;
    }
}

TEST(Layout, BadValuesThatComeLaterAreNamedToo) {
    LightScene s(
        kGreen + "LayerSet { order [ 0 1 ] layers LayoutLayer { layout DEF L Layout { size [ .5 .5 ] } children [ " +
            square(.5, unlit("1 0 0")) + " ] } }",
        32, 32);
    const auto reported = [&](const std::string& text) { return timesReported(s, "Layout L: " + text); };
    EXPECT_EQ(extentOf(s.picture()).pixels, 256);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    using L = x3d::Layout;
    ASSERT_TRUE(s.scene.set(s.node("L"), L::offset, Array<float>{nan, 0}));
    ASSERT_TRUE(s.scene.set(s.node("L"), L::sizeUnits, Array<String>{String("CUBIT")}));
    ASSERT_TRUE(s.scene.set(s.node("L"), L::align, Array<String>{String("TOP"), String("LEFT")}));
    for (int frame = 1; frame < 4; ++frame) {
        s.scene.newFrame(frame);
        EXPECT_EQ(extentOf(s.picture()).pixels, 256) << "as if they had not been set";
    }
    EXPECT_EQ(reported("offset nan is no finite number: taken as 0"), 1);
    EXPECT_EQ(reported("sizeUnits \"CUBIT\" is none of WORLD, FRACTION, PIXEL: taken as WORLD"), 1);
    EXPECT_EQ(reported("align \"TOP\" is none of CENTER, LEFT, RIGHT: taken as CENTER"), 1);
    EXPECT_EQ(reported("align \"LEFT\" is none of CENTER, BOTTOM, TOP: taken as CENTER"), 1);
    ASSERT_TRUE(s.scene.set(s.node("L"), L::size, Array<float>{nan, 1}));
    s.scene.newFrame(9);
    EXPECT_EQ(extentOf(s.picture()).width, 32);
    EXPECT_EQ(reported("size nan is no finite number: taken as 1"), 1);
    EXPECT_EQ(s.world->diagnostics().all().size(), 5u);
}

TEST(Layout, AGroupOutsideOfLayoutLayersOnlyGroups) {
    LightScene s(kGreen +
                     "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } DEF G LayoutGroup { layout Layout { size [ .1 .1 ] "
                     "scaleMode \"PIXEL\" } children [ " +
                     square(1, unlit("1 0 0")) + " ] }",
                 32, 32);
    EXPECT_EQ(extentOf(s.picture()).pixels, 256);
    s.scene.newFrame(1);
    (void)s.picture();
    ASSERT_EQ(s.world->diagnostics().all().size(), 1u);
    EXPECT_EQ(timesReported(s, "LayoutGroup G is in no LayoutLayer: its layout is not used"), 1);
    LightScene clipped("LayoutGroup { viewport Viewport { } }");
    (void)clipped.picture();
    EXPECT_EQ(timesReported(clipped, "LayoutGroup is in no LayoutLayer: its viewport is not used"), 1);
}

// ---- whatever happens, in whatever order ---------------------------------------------------------------------------

std::string nestedLayout(int layout, const std::string& children) {
    return fmt::format(
        "DEF G{0} LayoutGroup {{ layout DEF L{0} Layout {{ size [ .5 .5 ] }} children DEF T{0} Transform {{ children [ "
        "{1} ] }} }}",
        layout, children);
}

void expectAsAnew(LightScene& s, const std::vector<LayerSight>& sights) {
    Flattener anew;
    anew.setViewer(Vec3d(0, 0, 10), sights);
    anew.apply(s.scene, s.scene.snapshot());
    FullTraversalRenderer full;
    full.setSights(sights);
    ASSERT_TRUE(full.attachToScene(s.scene));
    const auto find = [](const auto& list, const Instance& one) {
        const Instance* found = nullptr;
        for (const Instance& other : list)
            if (other.id && other.shape == one.shape) found = &other;
        return found;
    };
    std::size_t compared = 0;
    for (const Instance& now : s.world->flattener().instances()) {
        if (!now.id) continue;
        ++compared;
        const Instance* fresh = find(anew.instances(), now);
        const Instance* visited = find(full.delta().added, now);
        ASSERT_TRUE(fresh && visited);
        EXPECT_EQ(now.worldFromLocal, fresh->worldFromLocal);
        EXPECT_EQ(now.worldFromLocal, s.world->rays().instance(now.id.slot).info.worldFromLocal);
        EXPECT_EQ(now.heard, fresh->heard);
        for (int c = 0; c < 4; ++c)
            EXPECT_LE(glm::length(now.worldFromLocal[c] - visited->worldFromLocal[c]),
                      1e-12 * (1 + glm::length(now.worldFromLocal[c])));
    }
    EXPECT_EQ(compared, full.delta().added.size());
}

TEST(Layout, FollowsEditsAndPicturesAsIfBuiltAnew) {
    const std::string leaf = "DEF S Shape { geometry Box { } } " + text("DEF STYLE ScreenFontStyle { }") +
                             "ScreenGroup { children Shape { geometry Sphere { } } }";
    LightScene s(
        "LayerSet { order [ 0 1 2 ] layers [ DEF G0 LayoutLayer { layout DEF L0 Layout { } children DEF T0 Transform { "
        "children [ " +
        nestedLayout(1, nestedLayout(2, leaf)) + " ] } } Layer { children [ Transform { translation 0 0 -4 children " +
        text("ScreenFontStyle { }", "OTHER") + " } ] } ] }");
    std::mt19937 random(20261121);
    const auto pick = [&](auto... choices) {
        const std::array all{choices...};
        return all[random() % all.size()];
    };
    const auto number = [&] { return static_cast<float>(random() % 1000 + 1) / 500; };
    std::vector<LayerSight> sights;
    for (int frame = 1; frame < 400; ++frame) {
        for (unsigned edits = 1 + random() % 3; edits > 0; --edits) {
            const std::string n = std::to_string(random() % 3);
            const NodeId layout = s.node(("L" + n).c_str()), transform = s.node(("T" + n).c_str());
            using L = x3d::Layout;
            using W = Array<String>;
            const auto set = [&](NodeId node, auto field, auto value) { ASSERT_TRUE(s.scene.set(node, field, value)); };
            const auto unit = [&] { return String(pick("WORLD", "FRACTION", "PIXEL")); };
            const auto mode = [&] { return String(pick("NONE", "FRACTION", "STRETCH", "PIXEL")); };
            switch (random() % 9) {
                case 0:
                    set(layout, L::size, Array<float>{number(), number()});
                    break;
                case 1:
                    set(layout, L::offset, Array<float>{number(), number()});
                    break;
                case 2:
                    set(layout, L::sizeUnits, W{unit(), unit()});
                    break;
                case 3:
                    set(layout, L::scaleMode, W{mode(), mode()});
                    break;
                case 4:
                    set(layout, L::align, W{String(pick("LEFT", "RIGHT")), String(pick("TOP", "BOTTOM", "CENTER"))});
                    break;
                case 5:
                    set(transform, x3d::Transform::translation, Vec3f(number(), number(), number()));
                    break;
                case 6:
                    if (n != "0")
                        set(s.node(("G" + n).c_str()), x3d::LayoutGroup::layout, pick(NodeId{}, layout, s.node("L0")));
                    break;
                case 7:  // out and in again
                    if (n != "0") {
                        const auto up = s.node(n == "1" ? "T0" : "T1"), group = s.node(("G" + n).c_str());
                        ASSERT_TRUE(s.scene.removeChild(up, x3d::Transform::children.index, 0));
                        if (random() % 2) s.scene.seal();
                        ASSERT_TRUE(s.scene.insertChild(up, x3d::Transform::children, group));
                    }
                    break;
                default:
                    set(s.node("STYLE"), x3d::ScreenFontStyle::pointSize, 12 * number());
                    break;
            }
        }
        if (random() % 3 == 0) {
            sights.clear();
            for (std::uint16_t layer = 0; layer < 3; ++layer)
                if (random() % 4)
                    sights.push_back({.layer = layer,
                                      .width = static_cast<int>(random() % 500 + 1),
                                      .height = static_cast<int>(random() % 500 + 1),
                                      .eye = Vec3d(number(), number(), 10),
                                      .kind = pick(LayerSight::Kind::perspective, LayerSight::Kind::parallel),
                                      .edges = {-1, 1, -number(), number()}});
            if (random() % 2) s.scene.seal();  // else edits and eye come together
        }
        ASSERT_TRUE(s.world->setViewer(Vec3d(0, 0, 10), sights));
        SCOPED_TRACE(frame);
        expectAsAnew(s, sights);
        if (testing::Test::HasFailure()) return;
    }
}

}  // namespace
}  // namespace rtsg
