// Volumes in pictures, against closed forms: emission and absorption, transfer functions, surfaces in front, within and
// behind, mirrors and shadows; the same after edits as if built anew.
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picking.h>

#include "light_scene.h"
#include "volume_scene.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

using namespace test;

Vec3f seenVolume(const std::string& body, Integrator integrator = Integrator::whitted,
                 ColorSpace space = ColorSpace::automatic) {
    LightScene s(body);
    s.options.settings.integrator = integrator;
    s.options.settings.colorSpace = space;
    return s.center();
}

TEST(Volume, OfOneOpacityLeavesItsPower) {
    for (const int value : {5, 51, 128, 250})
        for (const int n : {1, 3, 16}) {
            const double v = value / 255., left = std::pow(1 - v, n);
            // A march ends early if less than this is left.
            const double tolerance = left < 1 / 4096. ? 1 / 4096. : 1e-5;
            const Vec3d expected(v * (1 - left));
            const std::string body = volume(evenVoxels(value, 2, 3, n));
            expectColor(seenVolume(body), expected, tolerance);
            // The same on a smaller scale, and in a flatter box: a voxel is a voxel.
            expectColor(seenVolume("Transform { scale .1 .1 .1 children " + body + " }"), expected, tolerance);
            expectColor(seenVolume(volume(evenVoxels(value, 2, 3, n), "", "2 2 .01")), expected, tolerance);
            expectColor(seenVolume(body + behind(3, "0 1 0")), expected + Vec3d(0, left, 0), tolerance);
        }
    expectColor(seenVolume(volume(evenVoxels(255, 2, 2, 2))), Vec3d(1), 0);
    expectColor(seenVolume(volume(evenVoxels(0, 2, 2, 2)) + behind(3, "0 1 0")), {0, 1, 0}, 0);
    // On the slant the way is longer.
    const double v = 20 / 255., distance = 8 * std::sqrt(2.);
    expectColor(seenVolume("Transform { rotation 0 1 0 .78539816 children " + volume(evenVoxels(20, 8, 8, 8)) + " }"),
                Vec3d(v * (1 - std::pow(1 - v, distance))), 1e-5);
}

// Between voxels opacities are a + k s: the logarithm of what is left is the integral of ln(1 - a - k s).
TEST(Volume, RampsAreIntegrated) {
    const int n = 24;
    const auto value = [](int z) { return z * z / 4; };
    const std::string body = volume(voxels(2, 2, n, [&](int, int, int z) { return value(z); }));
    const auto primitive = [](double x) { return (1 - x) - (1 - x) * std::log1p(-x); };
    double depth = 0;
    for (int z = 0; z + 1 < n; ++z) {
        const double a = value(z) / 255., b = value(z + 1) / 255.;
        depth += a == b ? std::log1p(-a) : (primitive(b) - primitive(a)) / (b - a);
    }
    depth += .5 * (std::log1p(-value(0) / 255.) + std::log1p(-value(n - 1) / 255.));
    const Vec3f black = seenVolume(body + behind(3, "0 0 0")), white = seenVolume(body + behind(3, "1 1 1"));
    EXPECT_NEAR(white.r - black.r, std::exp(depth), .003 * std::exp(depth));
}

TEST(Volume, TransferFunctionsMapValues) {
    // Two texels, red of opacity 51 and green of 153: their middles are at 1/4 and 3/4.
    const std::string map = opacityMap("2 1 4 0xFF000033 0x00FF0099");
    const auto expected = [](double fraction) {
        const double a = .2 + .4 * fraction, cover = 1 - std::pow(1 - a, 4);
        return Vec3d(1 - fraction, fraction, 0) * cover;
    };
    for (const int value : {0, 40, 64, 100, 127, 180, 255}) {
        const double fraction = std::clamp(value / 255. * 2 - .5, 0., 1.);
        expectColor(seenVolume(volume(evenVoxels(value, 2, 2, 4), map)), expected(fraction), 1e-4);
    }
    // Two components look up both ways; three a block.
    const std::string plane = opacityMap("1 2 1 0x11 0x22");
    EXPECT_NEAR(seenVolume(volume("PixelTexture3D { image [ 2 1 1 1 0x0000 ] }", plane)).r, 17 / 255., 1e-4);
    EXPECT_NEAR(seenVolume(volume("PixelTexture3D { image [ 2 1 1 1 0x00FF ] }", plane)).r, 34 / 255., 1e-4);
    const std::string block =
        "OpacityMapVolumeStyle { transferFunction PixelTexture3D { image [ 3 1 1 2 0x102030 0x405060 ] } }";
    expectColor(seenVolume(volume("PixelTexture3D { image [ 3 1 1 1 0x0000FF ] }", block)),
                Vec3d(0x40, 0x50, 0x60) / 255., 1e-4);
}

TEST(Volume, ColoursAreTheirOwn) {
    const double a = 102 / 255., cover = 1 - std::pow(1 - a, 3);
    const Vec3d color = Vec3d(0x33, 0x99, 0xCC) / 255.;
    expectColor(seenVolume(volume("PixelTexture3D { image [ 4 1 1 3 0x3399CC66 0x3399CC66 0x3399CC66 ] }")),
                color * cover, 1e-4);
    expectColor(seenVolume(volume("PixelTexture3D { image [ 2 1 1 3 0x8066 0x8066 0x8066 ] }")),
                Vec3d(128 / 255. * cover), 1e-4);
    const double mean = (0x33 + 0x99 + 0xCC) / 765.;
    expectColor(seenVolume(volume("PixelTexture3D { image [ 3 1 1 1 0x3399CC ] }")), color * mean, 1e-4);
    const std::string layers =
        "ComposedTexture3D { texture [ PixelTexture { image 1 1 1 0x33 } PixelTexture { image 1 1 1 0x33 } ] }";
    expectColor(seenVolume(volume(layers)), Vec3d(.2 * (1 - .8 * .8)), 1e-4);
}

// The first layer is at the lowest z, the first row at the lowest y, the first voxel at the lowest x.
TEST(Volume, LiesAsTheClauseSays) {
    const auto at = [](const char* image) {
        LightScene s("OrthoViewpoint { fieldOfView [ -1 -1 1 1 ] } " +
                         volume(fmt::format("PixelTexture3D {{ image [ {} ] }}", image)),
                     8, 8);
        return s.picture();
    };
    const Picture x = at("1 2 1 1 0 255");
    EXPECT_LT(x.at(0, 4).r, .01);
    EXPECT_GT(x.at(7, 4).r, .99);
    const Picture y = at("1 1 2 1 0 255");
    EXPECT_LT(y.at(4, 7).r, .01) << "below";
    EXPECT_GT(y.at(4, 0).r, .99);
    // Seen from +z the last layer comes first.
    const Picture z = at("3 1 1 2 0xFF0000 0xFFFFFF");
    EXPECT_GT(z.at(4, 4).g, .3);
}

TEST(Volume, SurfacesStandInFrontWithinAndBehind) {
    const double v = 60 / 255., whole = std::pow(1 - v, 8), half = std::pow(1 - v, 4);
    const std::string body = volume(evenVoxels(60, 2, 2, 8));
    expectColor(seenVolume(body + behind(-3, "1 0 0")), {1, 0, 0}, 0);
    expectColor(seenVolume(body + behind(0, "1 0 0")), Vec3d(v * (1 - half)) + Vec3d(half, 0, 0), 1e-4);
    expectColor(seenVolume(body + behind(3, "1 0 0")), Vec3d(v * (1 - whole)) + Vec3d(whole, 0, 0), 1e-4);
    // On a side of the box, which is no surface.
    expectColor(seenVolume(body + behind(1, "1 0 0")), Vec3d(v * (1 - whole)) + Vec3d(whole, 0, 0), 1e-4);
    expectColor(seenVolume(body + behind(-1, "1 0 0")), {1, 0, 0}, 1e-4);
    expectColor(seenVolume("Viewpoint { position 0 0 0 } " + body), Vec3d(v * (1 - half)), 1e-4);
    expectColor(seenVolume("Viewpoint { position 0 0 -2 } " + body), Vec3d(0), 0);
    // Half clear within: what is seen through it goes on.
    const std::string pane = square(9, "material UnlitMaterial { emissiveColor 1 0 0 transparency .5 }");
    expectColor(seenVolume(body + pane), Vec3d(v * (1 - half) * (1 + .5 * half)) + Vec3d(.5 * half, 0, 0), 1e-4);
}

TEST(Volume, TwoInOnePlaceShareIt) {
    const double a = 40 / 255., b = 90 / 255., left = std::pow((1 - a) * (1 - b), 4);
    const double da = -std::log1p(-a), db = -std::log1p(-b);
    const double color = (da * a + db * b) / (da + db);
    expectColor(seenVolume(volume(evenVoxels(40, 2, 2, 4)) + volume(evenVoxels(90, 2, 2, 4))),
                Vec3d(color * (1 - left)), 1e-4);
    // One within a part of the other: before, both, after.
    const std::string inner = volume(evenVoxels(90, 1, 1, 2), "", "1 1 1");
    const double outside = std::pow(1 - a, 1), both = std::pow(1 - a, 2) * std::pow(1 - b, 2);
    const double mixed = (da * 2 * a + db * 2 * b) / (2 * da + 2 * db);
    const double seen = a * (1 - outside) + outside * (mixed * (1 - both) + both * a * (1 - outside));
    expectColor(seenVolume(volume(evenVoxels(40, 2, 2, 4)) + inner), Vec3d(seen), 1e-4);
}

TEST(Volume, PathsSeeTheSame) {
    const std::string body = volume(evenVoxels(60, 2, 2, 8)) + behind(0, "1 .5 0");
    const Vec3f direct = seenVolume(body, Integrator::whitted, ColorSpace::linear);
    const double v = 60 / 255., half = std::pow(1 - v, 4), light = linearFromSrgb(float(v));
    expectColor(direct, Vec3d(light * (1 - half)) + half * Vec3d(1, linearFromSrgb(.5f), 0), 1e-4);
    expectColor(seenVolume(body, Integrator::path), Vec3d(direct), 1e-5);
}

TEST(Volume, IsSeenInMirrors) {
    const double v = 60 / 255., left = std::pow(1 - v, 8);
    const std::string body =
        "Transform { translation 0 0 -5 children " + square(9, mirror("1")) + " } " + volume(evenVoxels(60, 2, 2, 8));
    expectColor(seenVolume(body), Vec3d(v * (1 - left * left)), 1e-4);
    // Paths end by chance where little is left.
    LightScene paths(body, 9, 9);
    paths.options.settings.integrator = Integrator::path, paths.options.settings.samplesPerPixel = 2048;
    const double light = linearFromSrgb(float(v)), once = light * (1 - left);
    EXPECT_NEAR(paths.center().r, once * (1 + left), .3 * once * left);
}

TEST(Volume, ThrowsShadows) {
    const double v = 60 / 255., left = std::pow(1 - v, 8);
    // Grey with alpha, and black: bounces from the square find nothing.
    std::string black = "PixelTexture3D { image [ 2 2 2 8";
    for (int i = 0; i < 32; ++i) black += " 60";
    const auto lit = [&](const char* light) {
        return std::string("Viewpoint { position 0 0 -1.5 } ") + light + " Transform { translation 0 0 -3 children " +
               square(9, matte("1 1 1")) + " } " + volume(black + " ] }");
    };
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const char* light : {"DirectionalLight { shadows TRUE }", "PointLight { location 0 0 5 shadows TRUE }"})
            expectColor(seenVolume(lit(light), integrator, ColorSpace::linear), Vec3d(left), 1e-4);
    expectColor(seenVolume(lit("DirectionalLight { shadows TRUE shadowIntensity .5 }"), Integrator::whitted,
                           ColorSpace::linear),
                Vec3d(1 - .5 * (1 - left)), 1e-4);
    // Out of a light's scope it takes nothing.
    const auto scoped = [&](const std::string& within, const std::string& beyond) {
        return "Viewpoint { position 0 0 -1.5 } Group { children [ DirectionalLight { shadows TRUE } Transform { "
               "translation 0 0 -3 children " +
               square(9, matte("1 1 1")) + " } " + within + " ] } " + beyond;
    };
    const std::string veil = volume(black + " ] }");
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        expectColor(seenVolume(scoped(veil, ""), integrator, ColorSpace::linear), Vec3d(left), 1e-4);
        expectColor(seenVolume(scoped("", veil), integrator, ColorSpace::linear), Vec3d(1), 1e-4);
    }
}

// Law 2: the same picture as from a scene that was always so.
TEST(Volume, FollowsEditsAsIfBuiltAnew) {
    LightScene s(
        "DEF T Transform { children DEF V VolumeData { voxels DEF X " + evenVoxels(40, 2, 2, 4) +
        " renderStyle DEF O OpacityMapVolumeStyle { } } } Transform { translation .5 0 0 children DEF W Switch { "
        "whichChoice 0 children USE V } }");
    using V = x3d::VolumeData;
    Array<std::int32_t> words{1, 1, 1, 2, 90, 200};
    const NodeId map = s.scene.createNode(x3d::PixelTexture::type);
    ASSERT_TRUE(s.scene.set(map, x3d::PixelTexture::image, Image{Array<std::int32_t>{1, 1, 4, 0x20304010}}));
    const std::function<Result<>()> edits[] = {
        [&] { return s.scene.set(s.node("X"), x3d::PixelTexture3D::image, words); },
        [&] { return s.scene.set(s.node("V"), V::dimensions, Vec3f(3, .5f, 1)); },
        [&] { return s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(0, .2f, 3)); },
        [&] { return s.scene.set(s.node("O"), x3d::OpacityMapVolumeStyle::transferFunction, map); },
        [&] { return s.scene.set(s.node("O"), x3d::OpacityMapVolumeStyle::enabled, false); },
        [&] { return s.scene.set(s.node("O"), x3d::OpacityMapVolumeStyle::enabled, true); },
        [&] { return s.scene.set(s.node("W"), x3d::Switch::whichChoice, -1); },
        [&] { return s.scene.set(s.node("V"), V::visible, false); },
        [&] { return s.scene.set(s.node("V"), V::visible, true); },
        [&] { return s.scene.set(s.node("V"), V::renderStyle, NodeId()); },
        [&] { return s.scene.set(s.node("V"), V::voxels, NodeId()); },
    };
    Picture last = s.picture();
    std::size_t step = 0, different = 0;
    for (const auto& edit : edits) {
        ASSERT_TRUE(edit());
        s.scene.newFrame(double(++step));
        const Picture now = s.picture();
        Scene copy;
        copy.setBehavioursEnabled(false);
        ASSERT_TRUE(copy.apply(std::make_shared<const ChangeSet>(s.scene.snapshot())));
        SharedWorld world(copy);
        LightRenderer light(world);
        const auto anew = light.picture(s.options);
        ASSERT_TRUE(anew);
        EXPECT_EQ(now.pixels, anew->pixels) << step;
        different += now.pixels != last.pixels;
        last = now;
    }
    EXPECT_EQ(different, 11u);
    EXPECT_EQ(Vec3f(last.at(16, 16)), Vec3f(0));
}

// The content of the box is not in the rays' tree.
TEST(Volume, EditsOfVoxelsMakeNoGeometry) {
    struct Watcher final : InstanceSubscriber {
        std::size_t geometries = 0, appearances = 0;
        Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
            geometries += delta.geometries.size(), appearances += delta.appearanceChanged.size();
            return {};
        }
    } watcher;
    LightScene s("DEF M Transform { children DEF V VolumeData { voxels DEF X " + evenVoxels(40, 2, 2, 4) +
                 " } } DEF T Transform { }");
    s.world->add(watcher);
    s.scene.newFrame(1);
    const auto [geometries, appearances] = std::pair(watcher.geometries, watcher.appearances);
    ASSERT_TRUE(s.scene.set(s.node("X"), x3d::PixelTexture3D::image, Array<std::int32_t>{1, 1, 1, 1, 9}));
    s.scene.newFrame(2);
    EXPECT_EQ(watcher.geometries, geometries);
    EXPECT_EQ(watcher.appearances, appearances + 1);
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(1)));
    s.scene.newFrame(3);
    EXPECT_EQ(watcher.appearances, appearances + 1) << "an edit elsewhere";
    const auto read = s.light->tracer().counts().materialsRead;
    ASSERT_TRUE(s.scene.set(s.node("M"), x3d::Transform::translation, Vec3f(1)));
    s.scene.newFrame(3.5);
    EXPECT_EQ(s.light->tracer().counts().materialsRead, read) << "it moves as it is";
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::VolumeData::dimensions, Vec3f(2)));
    s.scene.newFrame(4);
    EXPECT_EQ(watcher.geometries, geometries + 1);
}

TEST(Volume, IsPickedByItsBoxAndNotHeard) {
    LightScene s("Transform { translation 0 0 1 children DEF V VolumeData { dimensions 1 2 3 voxels " +
                 evenVoxels(0, 1, 1, 1) + " } }");
    const Picker picker(s.world->rays(), s.world->flattener());
    const auto hit = picker.ray({.2, .1, 5}, {0, 0, -1}), within = picker.ray({0, 0, 1}, {0, 1, 0}),
               beside = picker.ray({.6, .1, 5}, {0, 0, -1});
    ASSERT_TRUE(hit && *hit && within && *within && beside);
    EXPECT_NEAR(hit->distance, 2.5, 1e-6);
    EXPECT_EQ(hit->path.back(), s.node("V"));
    EXPECT_NEAR(within->distance, 1, 1e-6);
    EXPECT_FALSE(*beside);
    EXPECT_EQ(hit->normal, Vec3d(0, 0, 1));
    const auto both = picker.crossings({.2, .1, 5}, {0, 0, -1}, 10);
    ASSERT_TRUE(both && both->size() == 2);
    EXPECT_NEAR(both->back().distance, 5.5, 1e-6);
    const auto near = picker.closest({0, 0, 4}, 2);
    ASSERT_TRUE(near && *near);
    EXPECT_NEAR(near->distance, 1.5, 1e-6);
    EXPECT_FALSE(s.world->rays().intersect({Vec3f(.2f, .1f, 5), 0, Vec3f(0, 0, -1)}));
    EXPECT_EQ(s.world->rays().bounds().size(), Vec3f(1, 2, 3));
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::VolumeData::visible, false));
    s.scene.newFrame(1);
    EXPECT_FALSE(*picker.ray({.2, .1, 5}, {0, 0, -1}));
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::VolumeData::visible, true));
    s.scene.newFrame(2);
    EXPECT_TRUE(*picker.ray({.2, .1, 5}, {0, 0, -1}));
    for (const RayInstance& instance : s.world->rays().instances()) {
        EXPECT_FALSE(instance.info.heard);
        EXPECT_TRUE(instance.info.volume);
    }
    FullTraversalRenderer full;
    ASSERT_TRUE(full.attachToScene(s.scene));
    ASSERT_TRUE(full.renderFrame());
    EXPECT_EQ(full.world().stats().instances, s.world->rays().stats().instances);
    EXPECT_EQ(full.world().stats().uniqueTriangles, 12u);
}

TEST(Volume, LayersAndClipPlanesLeaveOutWhatTheyDo) {
    const double v = 60 / 255., half = std::pow(1 - v, 4);
    const std::string body = volume(evenVoxels(60, 2, 2, 8));
    expectColor(seenVolume("Group { children [ ClipPlane { plane 0 0 1 0 } " + body + " ] }"), Vec3d(v * (1 - half)),
                1e-4);
    expectColor(seenVolume("LayerSet { activeLayer 1 order [ 1 ] layers [ Layer { children [ Viewpoint { } "
                           "NavigationInfo { headlight FALSE } ] } Layer { children " +
                           body + " } ] }"),
                Vec3d(0), 0);
}

std::string complaintsOf(const std::string& body) {
    LightScene s(body);
    s.center();
    std::string all;
    const Diagnostics ofLight = s.light->diagnostics(), ofWorld = s.world->diagnostics();
    for (const Diagnostics* each : {&ofLight, &ofWorld})
        for (const Diagnostic& d : each->all()) all += d.text + "\n";
    return all;
}

TEST(Volume, WhatCannotBeIsNamed) {
    EXPECT_EQ(complaintsOf("DEF V VolumeData { }"), "VolumeData V has no voxels: it is not drawn\n");
    EXPECT_EQ(
        complaintsOf("DEF V VolumeData { voxels PixelTexture3D { image [ 1 2 2 2 7 ] } }"),
        "PixelTexture3D shows no picture: image starts with components (1 to 4), width, height and depth, and has "
        "as many pixels: 1 2 2 2 and 1 pixels\n");
    EXPECT_EQ(complaintsOf("VolumeData { voxels PixelTexture3D { } }"), "") << "one that is still to come";
    EXPECT_EQ(
        complaintsOf("VolumeData { voxels ComposedTexture3D { texture [ PixelTexture { image 1 1 1 9 } PixelTexture "
                     "{ image 2 1 1 9 9 } ] } }"),
        "ComposedTexture3D shows no picture: the layers of a three-dimensional texture are not all there, or not all "
        "of one size\n");
    LightScene flat("DEF V VolumeData { voxels " + evenVoxels(9, 1, 1, 1) + " }");
    for (const Vec3f& size : {Vec3f(0, 1, 1), Vec3f(1, -1, 1), Vec3f(1, 1, NAN), Vec3f(INFINITY, 1, 1), Vec3f(1e30f)}) {
        (void)flat.scene.set(flat.node("V"), x3d::VolumeData::dimensions, size);
        flat.scene.newFrame(1);
        flat.center();
    }
    EXPECT_EQ(complaintsOf(volume(evenVoxels(9, 1, 1, 1))), "");
}

}  // namespace
}  // namespace rtsg
