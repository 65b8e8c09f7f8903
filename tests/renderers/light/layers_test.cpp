// Layers one over the other, each with its own eye, background, lights and fog; what is picked is what is seen.
#include <algorithm>
#include <random>

#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/world_queries.h>

#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

std::string box(const char* color, const char* position, double half = 1) {
    return fmt::format("Transform {{ translation {} children [ {} ] }}", position, square(half, unlit(color)));
}
/// A green square in the scene's middle and a red one in a layer's, nearer to nothing.
std::string layers(const std::string& more, const std::string& order = "0 1", const std::string& set = "") {
    return box("0 1 0", "0 0 5", 9) + "LayerSet { order [ " + order + " ] " + set + " layers [ Layer { " + more +
           " } ] }";
}

TEST(Layers, LieOneOverTheOtherInTheirOrder) {
    // The layer's square is farther from its eye than the scene's from its own, and only 2 m wide.
    const std::string hud = "children [ " + box("1 0 0", "0 0 0") + " ]";
    LightScene s(layers(hud));
    const Picture p = s.picture();
    EXPECT_EQ(Vec3f(p.at(16, 16)), Vec3f(1, 0, 0));
    EXPECT_EQ(Vec3f(p.at(2, 16)), Vec3f(0, 1, 0)) << "beside it the scene shows";
    EXPECT_EQ(LightScene(layers(hud, "1 0")).center(), Vec3f(0, 1, 0));
    EXPECT_EQ(LightScene(layers(hud, "0")).center(), Vec3f(0, 1, 0));
    EXPECT_EQ(LightScene(layers(hud, "1")).center(), Vec3f(1, 0, 0));
    EXPECT_EQ(LightScene(layers("visible FALSE " + hud)).center(), Vec3f(0, 1, 0));
}

TEST(Layers, HaveTheirOwnViewpoints) {
    // The scene's eye looks away from everything; the layer's straight at its square.
    const std::string body = "Viewpoint { position 0 0 10 orientation 0 1 0 3 } " +
                             layers("children [ Viewpoint { position 30 0 4 } " + box("1 0 0", "30 0 0") + " ]");
    LightScene s(body);
    const Picture p = s.picture();
    EXPECT_EQ(Vec3f(p.at(16, 16)), Vec3f(1, 0, 0));
    EXPECT_EQ(p.at(1, 16), Vec4f(0, 0, 0, 1)) << "the scene's own background";
    // The middle 60 % of the square's 2 m show at 4 m: 2 atan(1 / 4) of 45 degrees.
    int red = 0;
    for (int x = 0; x < 33; ++x) red += p.at(x, 16).r > .5f;
    EXPECT_NEAR(red, 33 * .25 / std::tan(.7854 / 2), 1.01);
}

TEST(Layers, LightsBackgroundsAndFogStayInTheirs) {
    const std::string lit = square(1, matte("1 1 1"));
    // A light in the scene does not light the layer, one in the layer does.
    EXPECT_EQ(LightScene("DirectionalLight { global TRUE } " +
                         layers("children [ NavigationInfo { headlight FALSE } " + lit + " ]"))
                  .center(),
              Vec3f(0));
    EXPECT_EQ(LightScene(layers("children [ NavigationInfo { headlight FALSE } DirectionalLight { global TRUE } " +
                                lit + " ]"))
                  .center(),
              Vec3f(1));
    EXPECT_EQ(LightScene(layers("children [ " + lit + " ]", "0 1")).center(), Vec3f(1)) << "its own headlight";
    const std::string blue = "children [ Background { skyColor 0 0 1 transparency .5 } ]";
    LightScene half(layers(blue));
    half.options.settings.colorSpace = ColorSpace::display;
    expectColor(half.center(), {0, .5, .5}, 1e-6);
    LightScene fog("Fog { color 1 1 0 visibilityRange 6 } " + layers("children [ " + box("1 0 0", "0 0 0") + " ]"));
    EXPECT_EQ(fog.center(), Vec3f(1, 0, 0));
}

TEST(Layers, ViewportsBoundThem) {
    const std::string hud =
        "viewport Viewport { clipBoundary [ .5 1 .5 1 ] } children [ Background { skyColor 0 0 1 } " +
        box("1 0 0", "0 0 0", .5) + " ]";
    LightScene s(layers(hud), 64, 64);
    const Picture p = s.picture();
    const auto at = [&](int x, int y) { return Vec3f(p.at(x, y)); };
    EXPECT_EQ(at(31, 16), Vec3f(0, 1, 0));
    EXPECT_EQ(at(32, 31), Vec3f(0, 0, 1));
    EXPECT_EQ(at(32, 32), Vec3f(0, 1, 0));
    EXPECT_EQ(at(48, 16), Vec3f(1, 0, 0)) << "the viewport's middle";
    // Wide viewports show as high a part as square ones.
    LightScene wide(
        layers("viewport Viewport { clipBoundary [ 0 1 0 .5 ] } children [ " + box("1 0 0", "0 0 0") + " ]"), 64, 64);
    const Picture w = wide.picture();
    int high = 0, across = 0;
    for (int i = 0; i < 64; ++i) high += w.at(32, i).r > .5f, across += w.at(i, 48).r > .5f;
    EXPECT_EQ(high, across);
    EXPECT_NEAR(high, 32 * .1 / std::tan(.7854 / 2), 1.01);
}

TEST(Layers, TheActiveOneHasThePicturesViewpoint) {
    LightScene s(
        layers("children [ Viewpoint { position 0 0 3 } " + box("1 0 0", "0 0 0") + " ]", "0 1", "activeLayer 1"));
    (void)s.picture();
    EXPECT_EQ(s.light->camera().layer, 1);
    EXPECT_EQ(s.light->camera().position, Vec3d(0, 0, 3));
}

TEST(Layers, FollowTheScene) {
    LightScene s(box("0 1 0", "0 0 5", 9) +
                 "DEF S LayerSet { order [ 0 1 ] layers [ DEF L Layer { viewport DEF V Viewport { } children [ " +
                 box("1 0 0", "0 0 0") + " ] } ] }");
    EXPECT_EQ(s.center(), Vec3f(1, 0, 0));
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewport::clipBoundary, Array<float>{0, .25f, 0, 1}));
    s.scene.newFrame(1);
    EXPECT_EQ(s.center(), Vec3f(0, 1, 0));
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewport::clipBoundary, Array<float>{0, 1, 0, 1}));
    ASSERT_TRUE(s.scene.set(s.node("S"), x3d::LayerSet::order, Array<std::int32_t>{0}));
    s.scene.newFrame(2);
    EXPECT_EQ(s.center(), Vec3f(0, 1, 0));
}

TEST(Layers, PathsDrawThemToo) {
    LightScene s(layers("children [ " + box("1 0 0", "0 0 0") + " ]"));
    s.options.settings.integrator = Integrator::path;
    const Picture p = s.picture();
    expectColor(Vec3f(p.at(16, 16)), {1, 0, 0}, 1e-6);
    expectColor(Vec3f(p.at(2, 16)), {0, 1, 0}, 1e-6);
}

// The text of a head-up display is what a click in the picture meets, whatever lies behind it.
TEST(Layers, WhatIsSeenIsPicked) {
    LightScene s(box("0 1 0", "0 0 5", 9) +
                     "LayerSet { order [ 0 1 ] layers Layer { children [ OrthoViewpoint { fieldOfView [ -4 -4 4 4 ] } "
                     "Transform { translation -3 3 0 children DEF TEXT Shape "
                     "{ geometry Text { string \"HHH\" fontStyle FontStyle { family \"SANS\" } } } } ] } }",
                 160, 160);
    const Picture p = s.picture();
    const Picker picker(s.world->rays(), s.world->flattener());
    const auto camera = s.light->tracer().camera(s.world->rays(), 1);
    ASSERT_TRUE(camera);
    const auto views = s.light->tracer().layers(s.world->rays(), *camera, 160, 160);
    ASSERT_EQ(views.size(), 2u);
    int text = 0, behind = 0;
    for (int y = 0; y < 160; y += 2)
        for (int x = 0; x < 160; x += 2) {
            const auto pick = LightTracer::pick(picker, views, x + .5, y + .5);
            ASSERT_TRUE(pick && *pick);
            const bool isText = pick->shape == s.node("TEXT");
            EXPECT_EQ(Vec3f(p.at(x, y)), isText ? Vec3f(1) : Vec3f(0, 1, 0)) << x << " " << y;
            (isText ? text : behind)++;
        }
    EXPECT_GT(text, 20);
    EXPECT_GT(behind, 4000);
    const auto outside = LightTracer::pick(picker, views, -5, 3);
    EXPECT_TRUE(outside && !*outside);
}

/// A square of five metres that is turned and, in a mesh of as many triangles as there are parts, cut another way.
std::string turnedSquare(const std::string& round, int parts, const char* color) {
    std::string points, faces;
    for (int i = 0; i <= parts; ++i)
        for (int k = 0; k <= parts; ++k)
            points += fmt::format("{} {} 0 ", -2.5 + 5. * i / parts, -2.5 + 5. * k / parts);
    for (int i = 0; i < parts; ++i)
        for (int k = 0; k < parts; ++k) {
            const int at = i * (parts + 1) + k;
            faces +=
                fmt::format("{} {} {} -1 {} {} {} -1 ", at, at + parts + 1, at + parts + 2, at, at + parts + 2, at + 1);
        }
    return fmt::format(
        "Transform {{ rotation {} children Shape {{ appearance Appearance {{ {} }} geometry "
        "IndexedFaceSet {{ solid FALSE coordIndex [ {} ] coord Coordinate {{ point [ {} ] }} }} }} }} ",
        round, unlit(color), faces, points);
}

/// Pixels that are not of a color, of those before the square's middle.
int others(const Picture& p, const Vec3f& color) {
    int count = 0;
    for (int y = 27; y < 37; ++y)
        for (int x = 27; x < 37; ++x) count += Vec3f(p.at(x, y)) != color;
    return count;
}

const char* const kRotations[] = {"0 0 1 0", "1 0 0 .3", "0 1 0 1.1", ".6 .8 0 .7", "-.6 .8 0 1.1"};

TEST(Layers, HideNothingOfEachOtherWhereTheyCoincide) {
    // 35.4.2: each layer is drawn for itself, and then over those before it.
    for (const char* round : kRotations)
        for (const int parts : {1, 3, 7}) {
            const std::string scene = turnedSquare(round, 2, "0 1 0"),
                              layer = "children [ " + turnedSquare(round, parts, "1 0 0") + " ]";
            const auto drawn = [&](const char* order) {
                return LightScene(scene + "LayerSet { order [ " + order + " ] layers [ Layer { " + layer + " } ] }", 64,
                                  64)
                    .picture();
            };
            EXPECT_EQ(others(drawn("0 1"), {1, 0, 0}), 0) << round << ", " << parts;
            EXPECT_EQ(others(drawn("1 0"), {0, 1, 0}), 0) << round << ", " << parts;
        }
}

TEST(Layers, CastNoShadowsAndTakeNoneWhereTheyCoincide) {
    const std::string lamp = "NavigationInfo { headlight FALSE } DirectionalLight { direction 0 0 -1 shadows TRUE }";
    const auto lit = [&](const char* round, int parts) {
        std::string square = turnedSquare(round, parts, "1 1 1");
        square.replace(square.find("UnlitMaterial { emissiveColor"), 29, "Material { diffuseColor");
        return square;
    };
    for (const char* round : kRotations) {
        LightScene alone(lamp + lit(round, 2), 64, 64);
        LightScene both(
            lamp + lit(round, 2) + "LayerSet { order [ 1 0 ] layers [ Layer { children [ " + lit(round, 5) + " ] } ] }",
            64, 64);
        const Picture a = alone.picture(), b = both.picture();
        for (int y = 27; y < 37; ++y)
            for (int x = 27; x < 37; ++x) expectColor(Vec3f(b.at(x, y)), Vec3f(a.at(x, y)), 1e-5);
    }
}

TEST(Layers, WhatAClipPlaneCutsHidesNothingThatCoincides) {
    // 11.4.1: of the red square all is cut away, and so it is not there.
    for (const char* round : kRotations) {
        const std::string body = turnedSquare(round, 2, "0 1 0") +
                                 "Transform { translation 0 0 16 children [ ClipPlane { "
                                 "plane 0 0 1 0 } Transform { translation 0 0 -16 children " +
                                 turnedSquare(round, 5, "1 0 0") + " } ] }";
        EXPECT_EQ(others(LightScene(body, 64, 64).picture(), {0, 1, 0}), 0) << round;
    }
}

/// Rays of a parallel eye may start within lines and points that are left out, however many.
TEST(Layers, PointsAndLinesOfOthersHideNothingBeforeAParallelEye) {
    std::string points, more;
    for (int i = 0; i < 300; ++i) points += " 0 0 10", more += fmt::format(" 0 0 {}", 10 + 1e-5 * i);
    const std::string big =
        "Appearance { pointProperties PointProperties { pointSizeMinValue 40 pointSizeMaxValue 40 } "
        "lineProperties LineProperties { linewidthScaleFactor 40 } material UnlitMaterial { } }";
    const auto shape = [&](const std::string& geometry) {
        return "Shape { appearance " + big + " geometry " + geometry + " }";
    };
    for (const std::string& hidden : {shape("PointSet { coord Coordinate { point [" + points + " ] } }"),
                                      shape("PointSet { coord Coordinate { point [" + more + " ] } }"),
                                      shape("LineSet { vertexCount 2 coord Coordinate { point [ 0 0 9 0 0 11 ] } }")}) {
        const std::string seen = "OrthoViewpoint { position 0 0 10 } " + square(.5, unlit("1 0 0"));
        EXPECT_EQ(
            LightScene(hidden + " LayerSet { order [ 0 1 ] layers [ Layer { children [ " + seen + " ] } ] }").center(),
            Vec3f(1, 0, 0));
        // And where a plane cuts them away: nothing of them is at z = 8 or less.
        const std::string cut =
            "Transform { translation 0 0 8 children [ ClipPlane { plane 0 0 -1 0 } "
            "Transform { translation 0 0 -8 children " +
            hidden + " } ] }";
        EXPECT_EQ(LightScene(seen + cut).center(), Vec3f(1, 0, 0));
        // Shapes that are left out hide none of the others.
        const std::string kept = "Transform { translation 0 0 -5 children " +
                                 shape("PointSet { coord Coordinate { point [ 0 0 7 ] } }") + " }";
        EXPECT_EQ(LightScene(seen + kept + cut).center(), Vec3f(1));
    }
}

TEST(Layers, ArePickedWhereTheyCoincide) {
    for (const char* round : kRotations) {
        LightScene s(turnedSquare(round, 2, "0 1 0") + "LayerSet { order [ 0 1 ] layers [ Layer { children [ " +
                         turnedSquare(round, 5, "1 0 0") + " ] } ] }",
                     64, 64);
        (void)s.picture();
        const Picker picker(s.world->rays(), s.world->flattener());
        for (const std::uint16_t layer : {0, 1})
            for (int i = 0; i < 500; ++i) {
                const Vec3d from(-.6 + .0024 * i, .5 - .0021 * i, 10);
                const auto pick = picker.ray(from, {0, 0, -1}, layer, 100, PixelLens());
                ASSERT_TRUE(pick && *pick) << round << " " << i;
                EXPECT_EQ(s.world->rays().instance(pick->instance.slot).info.layer, layer);
            }
    }
}

/// Triangles, some of them clear, and lines, all in one place, under a lamp whose shadows fall on them.
std::string thicket(unsigned seed) {
    std::mt19937 random(seed);
    const auto next = [&](double maximum) { return std::uniform_real_distribution<>(-maximum, maximum)(random); };
    std::string all = "NavigationInfo { headlight FALSE } DirectionalLight { direction -.3 -.5 -1 shadows TRUE } ";
    for (int i = 0; i < 40; ++i) {
        const Vec3d at(next(3), next(3), next(2));
        std::string points;
        for (int k = 0; k < 3; ++k) points += fmt::format("{} {} {}, ", at.x + next(1), at.y + next(1), at.z + next(1));
        all += fmt::format(
            "Shape {{ appearance Appearance {{ material Material {{ diffuseColor {} {} {} transparency {} }} }} "
            "geometry {} {{ {} coord Coordinate {{ point [ {} ] }} }} }} ",
            std::abs(next(1)), std::abs(next(1)), std::abs(next(1)), i % 3 == 0 ? .5 : 0,
            i % 8 == 7 ? "LineSet" : "IndexedTriangleSet", i % 8 == 7 ? "vertexCount 3" : "solid FALSE index [ 0 1 2 ]",
            points);
    }
    return all;
}

TEST(Layers, AreEachAsIfTheOthersWereNotThere) {
    for (const unsigned seed : {1u, 2u, 3u}) {
        const std::string own = thicket(seed), other = thicket(seed + 100);
        const auto drawn = [&](const std::string& scene, const std::string& layer) {
            LightScene s(scene + " LayerSet { order [ 0 1 ] layers [ Layer { children [ " + layer + " ] } ] }", 64, 64);
            s.options.settings.colorSpace = ColorSpace::display;
            return s.picture();
        };
        // Shown before black and before white: the colour that a layer adds, and the share that it leaves of things
        // behind it.
        const std::string eye = "NavigationInfo { headlight FALSE } Viewpoint { } ";
        const Picture black = drawn(eye, other), white = drawn(eye + "Background { skyColor 1 1 1 } ", other),
                      behind = drawn(own + "Viewpoint { } ", ""), both = drawn(own + "Viewpoint { } ", other);
        int wrong = 0, covered = 0, clear = 0;
        for (std::size_t i = 0; i < both.pixels.size(); ++i) {
            const Vec3f on(black.pixels[i]), left = Vec3f(white.pixels[i]) - on;
            covered += left.r < .01f, clear += left.r > .99f;
            const Vec3f off = glm::abs(Vec3f(both.pixels[i]) - (on + left * Vec3f(behind.pixels[i])));
            wrong += std::max({off.r, off.g, off.b}) > 1e-4f;
        }
        EXPECT_LE(wrong, 2) << "but for roundings at edges, seed " << seed;
        EXPECT_GT(covered, 400);
        EXPECT_GT(clear, 400);
    }
}

TEST(Layers, InWhichNothingIsCostNoRays) {
    const std::string scene = "Viewpoint { } " + thicket(5);
    LightScene alone(scene), layered(scene +
                                     "LayerSet { order [ 0 1 2 3 ] layers [ Layer { children DEF Eye Viewpoint { } } "
                                     "DEF Late Layer { } LayoutLayer { } ] }");
    const Picture expected = alone.picture(), seen = layered.picture();
    EXPECT_EQ(seen.pixels, expected.pixels);
    EXPECT_EQ(layered.stats.primaryRays, alone.stats.primaryRays);
    EXPECT_EQ(layered.stats.shadowRays, alone.stats.shadowRays);
    // A node added to one of them is drawn until it is removed.
    const NodeId late = layered.node("Late"), background = layered.scene.createNode(x3d::Background::type);
    ASSERT_TRUE(layered.scene.set(background, x3d::Background::skyColor, Array<Color>{{0, 0, 1}}));
    ASSERT_TRUE(layered.scene.set(late, x3d::Layer::children, Array<NodeId>{background}));
    layered.scene.newFrame(1);
    EXPECT_EQ(layered.center(), Vec3f(0, 0, 1));
    ASSERT_TRUE(layered.scene.set(late, x3d::Layer::children, Array<NodeId>{}));
    layered.scene.newFrame(2);
    EXPECT_EQ(layered.picture().pixels, expected.pixels);
    EXPECT_EQ(layered.stats.primaryRays, alone.stats.primaryRays);
}

TEST(Layers, AViewpointThatViewsAllViewsAllOfItsLayer) {
    // 35.4.2, 23.3.1: a head-up display is no part of what is looked at.
    const auto eye = [](const std::string& display) {
        LightScene s(
            "LayerSet { activeLayer 1 order [ 1 2 ] layers [ Layer { children [ Viewpoint { viewAll TRUE } Shape { "
            "geometry Box { } } ] } Layer { children [ OrthoViewpoint { } " +
            display + " ] } ] }");
        s.picture();
        return s.light->camera().position;
    };
    const Vec3d alone = eye("");
    EXPECT_EQ(eye("Transform { translation 300 200 0 children Shape { geometry Box { size 50 50 50 } } }"), alone);
    EXPECT_NEAR(alone.x, 0, 1e-6);
    EXPECT_NEAR(alone.y, 0, 1e-6);
    EXPECT_LT(alone.z, 10);
}

// 23.4.1, 23.4.3, 35.4.3: each layer has a viewpoint of its own, which is the viewer of what is in it.
TEST(Layers, BillboardsAndLevelsAreForTheirOwnEyes) {
    const std::string items =
        "Billboard { axisOfRotation 0 1 0 children Transform { translation -.5 0 0 children " +
        square(.25, unlit("1 0 0")) +
        " } } LOD { range 20 children [ Transform { translation 0 .5 .5 children Transform { rotation 0 1 0 1.5707963 "
        "children " +
        square(.25, unlit("0 1 0")) + " } } Group { } ] } ";
    // The layer's eye is on the x axis, 10 m away; that of the scene on the z axis, 50 m away.
    const std::string eye = "OrthoViewpoint { position 10 0 0 orientation 0 1 0 1.5707963 fieldOfView [ -1 -1 1 1 ] } ";
    LightScene s(
        "Viewpoint { position 0 0 50 } LayerSet { order [ 0 1 ] layers DEF L Layer { children [ NavigationInfo "
        "{ headlight FALSE } " +
            eye + items + "] } }",
        40, 40);
    LightScene alone(eye + items, 40, 40);
    for (int i = 0; i < 2; ++i) {
        const Picture p = s.picture(), expected = alone.picture();
        double red = 0, green = 0;
        for (int y = 0; y < 40; ++y)
            for (int x = 0; x < 40; ++x) {
                EXPECT_EQ(Vec3f(p.at(x, y)), Vec3f(expected.at(x, y))) << x << " " << y;
                red += p.at(x, y).r, green += p.at(x, y).g;
            }
        EXPECT_NEAR(red, 100, 1);
        EXPECT_NEAR(green, 100, 1);
        s.scene.newFrame(1), alone.scene.newFrame(1);
    }
}

// 35.2: what a layer shows is clicked where it is seen, though nothing in it has its size from the picture.
TEST(Layers, APointerMeetsWhatAPlainLayerShows) {
    LightScene s(
        "DEF BACK Transform { children [ " + box("0 1 0", "0 0 5", 9) +
            " ] } DEF SET LayerSet { order [ 0 1 ] layers [ DEF L Layer { children [ DEF HUD Transform { children [ " +
            box("1 0 0", "2 2 0") + " ] } ] } ] }",
        40, 40);
    const Picture p = s.picture();
    WorldQueries queries(*s.world);
    int layer = 0;
    for (int y = 0; y < 40; ++y)
        for (int x = 0; x < 40; ++x) {
            const auto seen = queries.throughPicture((x + .5) / 40, (y + .5) / 40, std::nullopt);
            ASSERT_TRUE(seen && seen->hit) << x << ' ' << y;
            const bool isLayers = std::ranges::find(seen->hit->path, s.node("HUD")) != seen->hit->path.end();
            EXPECT_EQ(isLayers, p.at(x, y).r > p.at(x, y).g) << x << ' ' << y;
            layer += isLayers;
        }
    EXPECT_GT(layer, 10);
    // Without layers there is nothing to look for.
    ASSERT_TRUE(s.scene.setField(s.node("SET"), x3d::LayerSet::layers.index, Array<NodeId>{}));
    s.scene.newFrame(1);
    EXPECT_FALSE(queries.throughPicture(.5, .5, std::nullopt));
}

}  // namespace
}  // namespace rtsg
