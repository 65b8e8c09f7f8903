// Layers one over the other, each with its own eye, background, lights and fog; what is picked is what is seen.
#include <rtsg/renderers/picking.h>

#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

std::string box(const char* color, const char* place, double half = 1) {
    return fmt::format("Transform {{ translation {} children [ {} ] }}", place, square(half, unlit(color)));
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
    // Of the square's 2 m at 4 m the middle 60 % show: 2 atan(1 / 4) of 45 degrees.
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

}  // namespace
}  // namespace rtsg
