// Layouts: rectangles in pictures of several sizes against their closed forms, and that all who ask agree.
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/world_queries.h>

#include "light_scene.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

using namespace test;

/// Pixels whose middles lie in a rectangle; x from the left, y from the bottom.
struct PixelBox {
    double left = 0, right = 0, bottom = 0, top = 0;
    friend bool operator==(const PixelBox&, const PixelBox&) = default;
    friend std::ostream& operator<<(std::ostream& out, const PixelBox& b) {
        return out << b.left << ".." << b.right << " by " << b.bottom << ".." << b.top;
    }
};
/// The part of a rectangle in pixels that is in the picture.
PixelBox pixelsIn(PixelBox b, int width, int height) {
    const auto edge = [](double x, int maximum) { return std::clamp(std::ceil(x - .5), 0.0, double(maximum)); };
    return {edge(b.left, width), edge(b.right, width), edge(b.bottom, height), edge(b.top, height)};
}
/// The box of the pixels that are redder than green; it must be full.
PixelBox redPixels(const Picture& p) {
    PixelBox b{double(p.width), 0, double(p.height), 0};
    int pixels = 0;
    for (int y = 0; y < p.height; ++y)
        for (int x = 0; x < p.width; ++x) {
            const Vec4f c = p.at(x, y);
            if (!(c.r > c.g)) continue;
            ++pixels;
            b.left = std::min(b.left, double(x)), b.right = std::max(b.right, x + 1.0);
            b.bottom = std::min(b.bottom, double(p.height - 1 - y)), b.top = std::max(b.top, double(p.height - y));
        }
    if (pixels == 0) return {};
    EXPECT_EQ(pixels, (b.right - b.left) * (b.top - b.bottom)) << "holes";
    return b;
}

constexpr int kPictureSizes[][2] = {{64, 48}, {48, 64}, {97, 31}, {52, 52}};

std::string hud(const std::string& layout, const std::string& children, const std::string& more = "") {
    return "Background { skyColor 0 1 0 } DEF SET LayerSet { order [ 0 1 ] layers [ DEF HUD LayoutLayer { " + more +
           (layout.empty() ? "" : " layout DEF L Layout { " + layout + " }") + " children [ " + children + " ] } ] }";
}
const std::string kUnit = square(.5, unlit("1 0 0"));  // one unit wide and high

/// One axis of a rectangle: where it begins and ends in the one around it, which has `length` pixels.
std::pair<double, double> spanOf(int align, double size, double offset, double length) {
    const double free = length - size, begin = (align < 0 ? 0 : align > 0 ? free : free / 2) + offset;
    return {begin, begin + size};
}

TEST(Layout, PutsRectanglesWhereItsFieldsSay) {
    const char* across[] = {"LEFT", "CENTER", "RIGHT"};
    const char* upwards[] = {"BOTTOM", "CENTER", "TOP"};
    const char* units[] = {"FRACTION", "PIXEL"};
    for (const auto& [width, height] : kPictureSizes) {
        LightScene s(hud("", kUnit), width, height);
        const NodeId layout = s.scene.createNode(x3d::Layout::type);
        ASSERT_TRUE(s.scene.set(s.node("HUD"), x3d::LayoutLayer::layout, layout));
        for (int ax = -1; ax <= 1; ++ax)
            for (int ay = -1; ay <= 1; ++ay)
                for (int unit = 0; unit < 4; ++unit) {
                    const bool sizePixels = unit & 1, offsetPixels = unit & 2;
                    const float sx = sizePixels ? 17.5f : .31f, sy = sizePixels ? 9.3f : .43f;
                    const float ox = offsetPixels ? 3.3f : -.07f, oy = offsetPixels ? -2.3f : .11f;
                    using L = x3d::Layout;
                    const auto set = [&](auto field, auto value) { ASSERT_TRUE(s.scene.set(layout, field, value)); };
                    set(L::align, Array<String>{String(across[ax + 1]), String(upwards[ay + 1])});
                    set(L::size, Array<float>{sx, sy});
                    set(L::offset, Array<float>{ox, oy});
                    set(L::sizeUnits, Array<String>{String(units[sizePixels]), String(units[sizePixels])});
                    set(L::offsetUnits, Array<String>{String(units[offsetPixels])});  // one is both
                    s.scene.newFrame(1 + unit);
                    const double w = width, h = height;
                    const auto [left, right] = spanOf(ax, sizePixels ? sx : sx * w, offsetPixels ? ox : ox * w, w);
                    const auto [bottom, top] = spanOf(ay, sizePixels ? sy : sy * h, offsetPixels ? oy : oy * h, h);
                    ASSERT_EQ(redPixels(s.picture()), pixelsIn({left, right, bottom, top}, width, height))
                        << width << "x" << height << " align " << ax << " " << ay << " units " << unit;
                }
        EXPECT_TRUE(s.world->diagnostics().all().empty());
    }
}

// For a LayoutLayer WORLD and NONE are FRACTION: a Layout without fields is the whole of its viewport.
TEST(Layout, DefaultsFillTheViewport) {
    for (const auto& [width, height] : kPictureSizes) {
        EXPECT_EQ(redPixels(LightScene(hud("size [ 1 1 ]", kUnit), width, height).picture()),
                  pixelsIn({0, double(width), 0, double(height)}, width, height));
        const std::string part = "viewport Viewport { clipBoundary [ .25 .75 .5 1 ] }";
        const double l = std::round(.25 * width), r = std::round(.75 * width), b = std::round(.5 * height);
        EXPECT_EQ(redPixels(LightScene(hud("size [ 1 1 ]", kUnit, part), width, height).picture()),
                  pixelsIn({l, r, b, double(height)}, width, height));
        // Without a Layout units are those of a default OrthoViewpoint: the smaller side is 2.
        const double unit = std::min(width, height) / 2.0;
        EXPECT_EQ(redPixels(LightScene(hud("", kUnit), width, height).picture()),
                  pixelsIn({(width - unit) / 2, (width + unit) / 2, (height - unit) / 2, (height + unit) / 2}, width,
                           height));
    }
}

TEST(Layout, ScalesWhatIsInTheRectangle) {
    struct Case {
        const char* modes;
        // How many pixels a unit has across and upwards, in a rectangle of so many.
        std::pair<double, double> (*unit)(double w, double h);
    };
    const Case cases[] = {
        {"\"NONE\"", [](double w, double h) { return std::pair(w, h); }},
        {"\"FRACTION\" \"FRACTION\"", [](double w, double h) { return std::pair(w, h); }},
        {"\"PIXEL\"", [](double, double) { return std::pair(1.0, 1.0); }},
        {"\"FRACTION\" \"PIXEL\"", [](double w, double) { return std::pair(w, 1.0); }},
        {"\"PIXEL\" \"FRACTION\"", [](double, double h) { return std::pair(1.0, h); }},
        {"\"STRETCH\" \"FRACTION\"", [](double, double h) { return std::pair(h, h); }},
        {"\"FRACTION\" \"STRETCH\"", [](double w, double) { return std::pair(w, w); }},
        {"\"STRETCH\" \"PIXEL\"", [](double, double) { return std::pair(1.0, 1.0); }},
        {"\"PIXEL\" \"STRETCH\"", [](double, double) { return std::pair(1.0, 1.0); }},
        {"\"STRETCH\"", [](double w, double h) { return std::pair(std::max(w, h), std::max(w, h)); }},
    };
    for (const auto& [width, height] : kPictureSizes)
        for (const Case& one : cases) {
            const double w = .6 * width, h = .44 * height;
            const auto [ux, uy] = one.unit(w, h);
            // Ten pixels wide or four tenths of a unit, whichever the unit is.
            const float across = ux == 1 ? 10.3f : .41f, up = uy == 1 ? 7.1f : .37f;
            const std::string body = fmt::format("Transform {{ scale {} {} 1 children [ {} ] }}", across, up, kUnit);
            const std::string layout =
                std::string("align [ \"CENTER\" \"TOP\" ] size [ .6 .44 ] scaleMode [ ") + one.modes + " ]";
            const double cx = width / 2.0, cy = height - h / 2, hx = across * ux / 2, hy = up * uy / 2;
            EXPECT_EQ(redPixels(LightScene(hud(layout, body), width, height).picture()),
                      pixelsIn({cx - hx, cx + hx, cy - hy, cy + hy}, width, height))
                << one.modes << " in " << width << "x" << height;
        }
}

// In depth as in the smaller of both directions, so that what is scaled evenly keeps its shape.
TEST(Layout, ScalesDepthWithTheSmallerSide) {
    const double pixel = 2. / 48;
    const auto columns = [](const std::string& layout, const std::string& children) {
        LightScene s(hud(layout, children), 64, 48);
        (void)s.picture();
        Vec3d lengths(0);
        for (const Instance& instance : s.world->flattener().instances())
            if (instance.id)
                for (int axis = 0; axis < 3; ++axis) lengths[axis] = glm::length(instance.worldFromLocal[axis]);
        return lengths;
    };
    const auto expectNear = [](const Vec3d& found, const Vec3d& expected) {
        EXPECT_LT(glm::length(found - expected), 1e-12) << found.x << " " << found.y << " " << found.z;
    };
    const std::string inner = "LayoutGroup { layout Layout { scaleMode \"PIXEL\" } children [ " + kUnit + " ] }";
    expectNear(columns("scaleMode \"PIXEL\"", kUnit), Vec3d(pixel));
    expectNear(columns("scaleMode \"FRACTION\"", kUnit), Vec3d(64 * pixel, 48 * pixel, 48 * pixel));
    expectNear(columns("scaleMode [ \"PIXEL\" \"FRACTION\" ]", kUnit), Vec3d(pixel, 48 * pixel, pixel));
    expectNear(columns("scaleMode [ \"PIXEL\" \"FRACTION\" ]", inner), Vec3d(pixel));
}

TEST(Layout, GroupsLieInTheRectangleAroundThem) {
    const auto group = [](const std::string& layout, const std::string& children) {
        return "LayoutGroup { layout Layout { " + layout + " } children [ " + children + " ] }";
    };
    for (const auto& [width, height] : kPictureSizes) {
        const double w = width, h = height, ow = .8 * w, oh = .7 * h;  // the outer rectangle, at the left and the top
        const std::string outer = "align [ \"LEFT\" \"TOP\" ] size [ .8 .7 ] ";
        const auto check = [&](const std::string& mode, const std::string& inner, double iw, double ih) {
            // The inner one at the right and the bottom, 2 pixels in and 3 up.
            const std::string at = "align [ \"RIGHT\" \"BOTTOM\" ] offset [ -2 3 ] offsetUnits \"PIXEL\" ";
            EXPECT_EQ(redPixels(LightScene(hud(outer + mode, group(at + inner, kUnit)), width, height).picture()),
                      pixelsIn({ow - 2 - iw, ow - 2, h - oh + 3, h - oh + 3 + ih}, width, height))
                << mode << " / " << inner << " in " << width << "x" << height;
        };
        const std::string fill = " scaleMode \"FRACTION\"";
        for (const std::string mode :
             {"", "scaleMode \"PIXEL\"", "scaleMode \"STRETCH\"", "scaleMode [ \"PIXEL\" \"FRACTION\" ]"}) {
            check(mode, "size [ .3 .4 ] sizeUnits \"FRACTION\"" + fill, .3 * ow, .4 * oh);
            check(mode, "size [ 11.2 7.05 ] sizeUnits \"PIXEL\"" + fill, 11.2, 7.05);
        }
        // WORLD is in units of what is around: pixels, or the rectangle itself.
        check("scaleMode \"PIXEL\"", "size [ 11.2 7.05 ]" + fill, 11.2, 7.05);
        check("", "size [ .3 .4 ]" + fill, .3 * ow, .4 * oh);
        // NONE: the units go on.
        check("scaleMode \"PIXEL\"", "size [ 1 1 ]", 1, 1);
        // Even units in uneven ones.
        const double side = .4 * oh;
        const std::string even = "size [ .3 .4 ] sizeUnits \"FRACTION\" scaleMode [ \"STRETCH\" \"FRACTION\" ]";
        EXPECT_EQ(redPixels(LightScene(hud(outer, group(even, kUnit)), width, height).picture()),
                  pixelsIn({ow / 2 - side / 2, ow / 2 + side / 2, h - oh / 2 - side / 2, h - oh / 2 + side / 2}, width,
                           height));
        // Three deep, with a group that has none between.
        const std::string deep =
            group("align \"CENTER\" size [ .48 .48 ] sizeUnits \"FRACTION\"" + fill,
                  "LayoutGroup { children [ " + group("align [ \"LEFT\" \"BOTTOM\" ] size [ .45 .55 ]" + fill, kUnit) +
                      " ] }");
        EXPECT_EQ(redPixels(LightScene(hud("", deep), width, height).picture()),
                  pixelsIn({.26 * w, .476 * w, .26 * h, .524 * h}, width, height));
    }
}

// 36.4.2: a LayoutGroup's viewport cuts what is in it at shares of its rectangle; those around it cut too.
TEST(Layout, GroupsAreCutByTheirViewports) {
    const std::string large = square(3, unlit("1 0 0"));
    for (const auto& [width, height] : kPictureSizes) {
        const double w = width, h = height;
        const auto cut = [&](double l, double r, double b, double t) {
            return pixelsIn({l * w, r * w, b * h, t * h}, width, height);
        };
        LightScene s(
            hud("",
                "DEF G LayoutGroup { viewport DEF V Viewport { clipBoundary [ .2 .75 .1 .6 ] } layout DEF LG "
                "Layout { align [ \"LEFT\" \"TOP\" ] size [ .83 .67 ] sizeUnits \"FRACTION\" scaleMode \"FRACTION\" } "
                "children [ "
                "DEF INNER LayoutGroup { children [ Transform { translation .1 0 0 rotation 0 0 1 .1 children " +
                    large + " } ] } ] }"),
            width, height);
        double time = 0;
        const auto seen = [&] {
            s.scene.newFrame(++time);
            return redPixels(s.picture());
        };
        EXPECT_EQ(seen(), cut(.2 * .83, .75 * .83, .33 + .1 * .67, .33 + .6 * .67));
        ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewport::clipBoundary, Array<float>{0, .41f, .13f, 1}));
        EXPECT_EQ(seen(), cut(0, .41 * .83, .33 + .13 * .67, 1));
        ASSERT_TRUE(s.scene.set(s.node("LG"), x3d::Layout::size, Array<float>{.53f, .57f}));
        EXPECT_EQ(seen(), cut(0, .41 * .53, .43 + .13 * .57, 1));
        // Another one within: of the same rectangle, as it has no layout.
        const NodeId within = s.scene.createNode(x3d::Viewport::type);
        ASSERT_TRUE(s.scene.set(within, x3d::Viewport::clipBoundary, Array<float>{.23f, 1, 0, .77f}));
        ASSERT_TRUE(s.scene.set(s.node("INNER"), x3d::LayoutGroup::viewport, within));
        EXPECT_EQ(seen(), cut(.23 * .53, .41 * .53, .43 + .13 * .57, .43 + .77 * .57));
        ASSERT_TRUE(s.scene.set(s.node("G"), x3d::LayoutGroup::viewport, NodeId()));
        EXPECT_EQ(seen(), cut(.23 * .53, .53, .43, .43 + .77 * .57));
        ASSERT_TRUE(s.scene.set(s.node("INNER"), x3d::LayoutGroup::viewport, NodeId()));
        EXPECT_EQ(seen(), cut(0, 1, 0, 1));
        ASSERT_TRUE(s.scene.set(s.node("G"), x3d::LayoutGroup::viewport, within));
        EXPECT_EQ(seen(), cut(.23 * .53, .53, .43, .43 + .77 * .57));
        EXPECT_TRUE(s.world->diagnostics().all().empty());
    }
}

// A Viewport that is no group's viewport groups and cuts what it groups, also where the same one cuts elsewhere.
TEST(Layout, ViewportsAmongChildrenGroupAndCut) {
    LightScene s(hud("", "DEF V Viewport { clipBoundary [ 0 .5 0 1 ] children " + kUnit +
                             " } LayoutGroup { viewport USE V "
                             "children Transform { translation 0 -.75 0 children " +
                             kUnit + " } }"),
                 64, 64);
    // A unit is half of the picture: of both squares, in the middle and below, the left half is there.
    int upper = 0, lower = 0;
    const Picture p = s.picture();
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x)
            if (p.at(x, y).r > p.at(x, y).g) ++(y < 48 ? upper : lower);
    EXPECT_EQ(upper, 16 * 32);
    EXPECT_EQ(lower, 16 * 16);
}

// Pictures, picks in them and the traversal that shares no state with the rest have things at the same places.
void expectAllAgree(LightScene& s, const char* shape) {
    const int width = s.options.settings.width, height = s.options.settings.height;
    const Picture p = s.picture();
    const auto& tracer = s.light->tracer();
    const auto views = tracer.layers(s.world->rays(), s.light->camera(), width, height);
    const Picker picker(s.world->rays(), s.world->flattener());
    int on = 0;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const auto pick = LightTracer::pick(picker, views, x + .5, y + .5);
            ASSERT_TRUE(pick);
            const bool isShape = *pick && pick->shape == s.node(shape);
            ASSERT_EQ(isShape, p.at(x, y).r > p.at(x, y).g) << x << " " << y;
            on += isShape;
        }
    EXPECT_GT(on, 20);
    FullTraversalRenderer full;
    full.setSights(LightTracer::sights(views, width, height));
    ASSERT_TRUE(full.attachToScene(s.scene));
    std::size_t compared = 0;
    for (const Instance& instance : s.world->flattener().instances()) {
        if (!instance.id) continue;
        bool found = false;
        for (const Instance& other : full.delta().added)
            if (other.shape == instance.shape && other.layer == instance.layer) {
                found = true;
                for (int c = 0; c < 4; ++c)
                    EXPECT_LT(glm::length(other.worldFromLocal[c] - instance.worldFromLocal[c]), 1e-12);
            }
        EXPECT_TRUE(found);
        ++compared;
    }
    EXPECT_EQ(compared, full.delta().added.size());
}

std::string named(std::string shape) {
    return "DEF RED " + shape;
}

TEST(Layout, PicturesPicksAndFullTraversalAgree) {
    for (const auto& [width, height] : kPictureSizes) {
        LightScene s(
            hud("align \"LEFT\" size [ .7 .9 ] scaleMode \"PIXEL\"",
                "LayoutGroup { layout Layout { align [ \"RIGHT\" \"TOP\" ] size [ 21 13 ] scaleMode \"FRACTION\" } "
                "children [ " +
                    named(kUnit) + " ] }"),
            width, height);
        expectAllAgree(s, "RED");
        LightScene screen(
            "Viewpoint { position 1 0 4 } Background { skyColor 0 1 0 } Transform { translation 1 .1 -3 "
            "scale 1 2 1 children ScreenGroup { children Transform { scale 9.4 13.2 1 children [ " +
                named(kUnit) + " ] } } }",
            width, height);
        expectAllAgree(screen, "RED");
    }
}

TEST(Layout, EachOfSeveralPicturesIsRight) {
    LightScene s(hud("align [ \"RIGHT\" \"TOP\" ] size [ 12.2 8.3 ] sizeUnits \"PIXEL\"", kUnit));
    LightRenderer::Options options;
    LightRenderer second(*s.world, options);
    for (int round = 0; round < 2; ++round)
        for (const auto& [width, height] : kPictureSizes) {
            s.options.settings.width = width, s.options.settings.height = height;
            const PixelBox expected =
                pixelsIn({width - 12.2, double(width), height - 8.3, double(height)}, width, height);
            EXPECT_EQ(redPixels(s.picture()), expected);
            const auto other = second.picture(s.options);
            ASSERT_TRUE(other);
            EXPECT_EQ(redPixels(*other), expected);
        }
}

TEST(Layout, StatesAreForThePictureTheyWereMadeFor) {
    LightScene s(hud("align [ \"RIGHT\" \"TOP\" ] size [ 12.2 8.3 ] sizeUnits \"PIXEL\"", kUnit));
    const auto renderer = [&](int width, int height) {
        LightRenderer::Options options;
        options.image.settings.width = width, options.image.settings.height = height;
        return std::make_unique<LightRenderer>(*s.world, options);
    };
    const auto wide = renderer(64, 32), high = renderer(30, 70);
    const auto first = wide->prepare(), second = high->prepare();
    ASSERT_TRUE(first && second);
    ASSERT_TRUE(wide->renderFrame(**first));
    ASSERT_TRUE(high->renderFrame(**second));
    EXPECT_EQ(redPixels(wide->frame()), pixelsIn({64 - 12.2, 64, 32 - 8.3, 32}, 64, 32));
    EXPECT_EQ(redPixels(high->frame()), pixelsIn({30 - 12.2, 30, 70 - 8.3, 70}, 30, 70));
    // Never a wrong one: a state for another size is refused, and the next is for this one.
    const auto refused = wide->renderFrame(**second);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text.find("another size"), std::string::npos);
    const auto next = s.world->present();
    ASSERT_TRUE(next);
    ASSERT_TRUE(wide->renderFrame(**next)) << "as it was asked for";
    EXPECT_EQ(redPixels(wide->frame()), pixelsIn({64 - 12.2, 64, 32 - 8.3, 32}, 64, 32));
}

// ---- pointers
// --------------------------------------------------------------------------------------------------------

struct Pointed : LightScene {
    using LightScene::LightScene;
    std::unique_ptr<WorldQueries> queries;
    double time = 1;
    /// At a place in the last picture, in pixels from the left and the top.
    void point(double x, double y, bool down) {
        if (!queries) {
            (void)picture();
            queries = std::make_unique<WorldQueries>(*world);
            scene.setSpaceQueries(queries.get());
        }
        PointerInput input;
        input.kind = PointerInput::Kind::picture;
        input.x = x / options.settings.width, input.y = y / options.settings.height;
        input.aspect = double(options.settings.width) / options.settings.height;
        input.buttons = down ? PointerInput::kPrimary : 0;
        ASSERT_TRUE(sendPointer(scene, input));
        scene.newFrame(time++);
    }
};

// A pointer is over the uppermost thing in the picture; points are in the sensor's coordinates.
TEST(Layout, PointersMeetWhatThePictureShows) {
    for (const auto& [width, height] : kPictureSizes) {
        Pointed s(
            "DEF FAR TouchSensor { } " + square(9, unlit("0 1 0")) +
                hud("scaleMode \"PIXEL\"",
                    "LayoutGroup { layout Layout { align [ \"RIGHT\" \"TOP\" ] size [ 20 10 ] scaleMode \"NONE\" } "
                    "children [ DEF NEAR TouchSensor { } Transform { scale 20 10 1 children [ " +
                        kUnit + " ] } ] }"),
            width, height);
        const auto over = [&](const char* sensor) {
            return s.scene.node(s.node(sensor)).get(x3d::TouchSensor::isOver);
        };
        s.point(width - 4.5, 3.25, false);
        EXPECT_TRUE(over("NEAR"));
        EXPECT_FALSE(over("FAR"));
        const Vec3f point = s.scene.node(s.node("NEAR")).get(x3d::TouchSensor::hitPoint_changed);
        EXPECT_NEAR(point.x, 10 - 4.5, 1e-4);
        EXPECT_NEAR(point.y, 5 - 3.25, 1e-4);
        s.point(width - 21.5, 3.25, false);
        EXPECT_FALSE(over("NEAR"));
        EXPECT_TRUE(over("FAR")) << "beside it";
    }
}

TEST(Layout, DragsAreInTheUnitsOfTheLayout) {
    Pointed s(square(9, unlit("0 1 0")) +
                  hud("scaleMode \"PIXEL\"",
                      "LayoutGroup { layout Layout { align \"LEFT\" size [ 20 10 ] scaleMode \"NONE\" } children [ "
                      "DEF DRAG PlaneSensor { } Transform { scale 20 10 1 children [ " +
                          kUnit + " ] } ] }"),
              64, 48);
    const auto moved = [&] { return s.scene.node(s.node("DRAG")).get(x3d::PlaneSensor::translation_changed); };
    s.point(7, 24, false);
    s.point(7, 24, true);
    s.point(12, 23, true);
    EXPECT_NEAR(moved().x, 5, 1e-4);
    EXPECT_NEAR(moved().y, 1, 1e-4);
    s.point(60, 2, true);  // over the scene behind, through another eye: it goes on in its own layer
    EXPECT_NEAR(moved().x, 53, 1e-4);
    EXPECT_NEAR(moved().y, 22, 1e-4);
}

// The point that a pointer is over is in the coordinates of what the picture shows: those that turn to its eye.
TEST(Layout, BillboardsTurnTheCoordinatesOfTheirSensors) {
    Pointed s(
        "Viewpoint { position 10 0 0 orientation 0 1 0 1.5707963 } Billboard { children [ DEF T TouchSensor { } " +
            square(2, unlit("1 0 0")) + " ] }",
        40, 40);
    s.point(22, 17, false);
    const Vec3f point = s.scene.node(s.node("T")).get(x3d::TouchSensor::hitPoint_changed);
    const double pixel = 2 * std::tan(.7854 / 2) / 40 * 10;
    EXPECT_NEAR(point.x, 2 * pixel, 1e-4);
    EXPECT_NEAR(point.y, 3 * pixel, 1e-4);
    EXPECT_NEAR(point.z, 0, 1e-4);
}

// A reader of states gets states for its picture from the first on, whatever other pictures are made meanwhile.
TEST(Layout, ReadersGetStatesForTheirPictures) {
    LightScene s(
        hud("align [ \"RIGHT\" \"TOP\" ] size [ 12.2 8.3 ] sizeUnits \"PIXEL\"", kUnit, "viewport DEF V Viewport { }"));
    s.light.reset();
    const auto renderer = [&](int width, int height) {
        LightRenderer::Options options;
        options.image.settings.width = width, options.image.settings.height = height;
        return std::make_unique<LightRenderer>(*s.world, options);
    };
    const auto newest = [&] {
        (void)s.world->latest(std::chrono::nanoseconds(0));
        s.scene.newFrame(s.scene.now() + 1);
        EXPECT_TRUE(s.world->update());
        return s.world->latest(std::chrono::nanoseconds(0)).value_or(nullptr);
    };
    const auto expectRight = [&](LightRenderer& light, int width, int height, double right = 1) {
        const double end = right * width;
        EXPECT_EQ(redPixels(light.frame()), pixelsIn({end - 12.2, end, height - 8.3, double(height)}, width, height));
    };
    const auto wide = renderer(64, 32);
    const auto state = newest();
    ASSERT_TRUE(state && wide->renderFrame(*state));
    expectRight(*wide, 64, 32);
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewport::clipBoundary, Array<float>{0, .5f, 0, 1}));
    const auto half = newest();
    ASSERT_TRUE(half && wide->renderFrame(*half));
    expectRight(*wide, 64, 32, .5);
    ImageOptions other;
    other.settings.width = 20, other.settings.height = 50;
    ASSERT_TRUE(wide->picture(other));
    const auto after = newest();
    ASSERT_TRUE(after && wide->renderFrame(*after));
    expectRight(*wide, 64, 32, .5);

    // Two of them take turns.
    const auto high = renderer(30, 70);
    int wides = 0, highs = 0;
    for (int round = 0; round < 10; ++round) {
        const auto next = newest();
        ASSERT_TRUE(next);
        if (wide->renderFrame(*next)) ++wides, expectRight(*wide, 64, 32, .5);
        if (high->renderFrame(*next)) ++highs, expectRight(*high, 30, 70, .5);
    }
    EXPECT_GE(wides, 4);
    EXPECT_GE(highs, 4);
}

TEST(Layout, ViewpointsAndNavigationChangeNothing) {
    const std::string layout = "size [ .5 .5 ]";
    const PixelBox expected = redPixels(LightScene(hud(layout, kUnit), 64, 48).picture());
    EXPECT_EQ(expected, pixelsIn({16, 48, 12, 36}, 64, 48));
    EXPECT_EQ(
        redPixels(LightScene(
                      hud(layout,
                          "Viewpoint { position 3 2 1 } NavigationInfo { visibilityLimit 1 headlight FALSE } " + kUnit),
                      64, 48)
                      .picture()),
        expected);
    EXPECT_EQ(
        redPixels(
            LightScene("Viewpoint { position 30 20 10 orientation 1 0 0 1 } " + hud(layout, kUnit), 64, 48).picture()),
        expected);
}

TEST(Layout, IsSilentAndHasAStatedSizeWithoutAPicture) {
    LightScene s(hud("align \"LEFT\" size [ 128 72 ] sizeUnits \"PIXEL\"", named(kUnit)) +
                 " Transform { translation 5 0 0 children ScreenGroup { children DEF FAR " + kUnit + " } }");
    for (const Instance& instance : s.world->flattener().instances()) {
        if (!instance.id) continue;
        EXPECT_FALSE(instance.heard);
        const double tenth = 2.0 / 10;  // of the 720 pixels, which are 2 m
        if (instance.shape == s.node("RED")) {
            EXPECT_NEAR(instance.worldFromLocal[0].x, tenth * 16 / 9, 1e-12);
            EXPECT_NEAR(instance.worldFromLocal[1].y, tenth, 1e-12);
            EXPECT_NEAR(instance.worldFromLocal[3].x, -16. / 9 + tenth * 8 / 9, 1e-12);
        } else {
            EXPECT_NEAR(instance.worldFromLocal[0].x, .0254 / 96, 1e-15);
            EXPECT_EQ(instance.worldFromLocal[3], Vec3d(5, 0, 0));
        }
    }
}

}  // namespace
}  // namespace rtsg
