// Through the whole path: X3D text to pixels, against closed forms and independent double-precision code.
#include <rtsg/renderers/light_tracer.h>

#include <atomic>
#include <cmath>
#include <numbers>
#include <random>

#include <fmt/format.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

TEST(LightTracer, UnlitColorsArriveUnchanged) {
    LightScene s(square(100, unlit("0.25 0.5 0.75")), 20, 12);
    const Picture p = s.picture();
    for (const Vec4f& pixel : p.pixels) ASSERT_EQ(pixel, Vec4f(0.25f, 0.5f, 0.75f, 1));
}

TEST(LightTracer, ShapeWithoutAppearanceIsUnlitWhite) {
    LightScene s("Shape { geometry Sphere { radius 2 } }");
    EXPECT_EQ(s.center(), Vec3f(1));
    const Picture p = s.picture();
    EXPECT_EQ(p.at(0, 0), Vec4f(0, 0, 0, 1)) << "and the background is black";
}

TEST(LightTracer, LambertFollowsTheCosine) {
    for (const double degrees : {0.0, 30.0, 60.0, 85.0}) {
        const double a = degrees * kPi / 180;
        LightScene s(fmt::format("DirectionalLight {{ direction 0 {} {} intensity 0.8 color 1 0.5 0.25 }}",
                                 -std::sin(a), -std::cos(a)) +
                     square(100, matte("0.5 0.6 0.7")));
        expectColor(s.center(), Vec3d(0.8 * 0.5, 0.4 * 0.6, 0.2 * 0.7) * std::cos(a), 1e-6);
    }
}

TEST(LightTracer, LightFromBehindDoesNotReachTheFront) {
    LightScene s("DirectionalLight { direction 0 0 1 }" + square(100, "material Material { specularColor 1 1 1 }"));
    EXPECT_EQ(s.center(), Vec3f(0));
}

// A light ten degrees below the horizon, seen from above: half way between light and eye lies above the surface, so
// only n . l > 0 keeps a highlight of exponent 0 (which is 1 wherever there is one) off it.
TEST(LightTracer, NoHighlightFromBelowTheHorizon) {
    const auto seen = [](double degrees, const char* material, Integrator integrator) {
        const double a = degrees * kPi / 180;
        LightScene s(fmt::format("DirectionalLight {{ direction {} 0 {} }}", -std::sin(a), -std::cos(a)) +
                     square(100, fmt::format("material {}", material)));
        s.options.settings.shadows = Shadows::none;
        s.options.settings.integrator = integrator;
        return s.center().r;
    };
    const char* materials[] = {"Material { diffuseColor 0 0 0 specularColor 1 1 1 shininess 0 }",
                               "PhysicalMaterial { metallic 1 roughness 1 }"};
    for (const char* material : materials)
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            EXPECT_EQ(seen(100, material, integrator), 0) << material;
            EXPECT_GT(seen(80, material, integrator), 0.01) << material;
        }
}

// Authored normals lean towards a light that is behind a sheet of paper: its light must not come through to the front,
// nor round the edge of the error bound. Without shadows 17.2.2 knows the normals alone.
TEST(LightTracer, LightBehindASheetIsBlockedByTheSheetItself) {
    for (const char* light : {"DirectionalLight { direction -0.9 0 0.2 }", "PointLight { location 9 0 -2 }",
                              "SpotLight { location 9 0 -2 direction -0.9 0 0.2 }"})
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            LightScene s(light + square(1, matte("1 1 1"),
                                        "solid FALSE normal Normal { vector [0.8 0 0.6, 0.8 0 0.6, "
                                        "0.8 0 0.6, 0.8 0 0.6] }"));
            s.options.settings.integrator = integrator;
            s.options.settings.shadows = Shadows::none;
            EXPECT_GT(s.center().r, 0.5) << light;
            s.options.settings.shadows = Shadows::all;
            EXPECT_EQ(s.center().r, 0) << light;
        }
}

// Every term of 17.2.2 at once, at every pixel, against the equations written out in double.
TEST(LightTracer, LightingEquationsAtEveryPixel) {
    LightScene s(
        "Viewpoint { fieldOfView 0.9 position 0 0 10 }"
        "PointLight { location 1 2 1.5 attenuation 0.5 0.2 0.1 color 1 0.8 0.6 intensity 0.9 ambientIntensity 0.3 "
        "radius 6 }"
        "SpotLight { location -2 -1 2 direction 0.3 0.2 -1 beamWidth 0.3 cutOffAngle 0.8 color 0.2 0.4 1 intensity 0.7 "
        "}"
        "DirectionalLight { direction -1 0 -2 intensity 0.4 ambientIntensity 0.5 }" +
            square(100,
                   "material Material { diffuseColor 0.8 0.5 0.3 specularColor 0.5 0.6 0.7 shininess 0.15 "
                   "ambientIntensity 0.25 "
                   "emissiveColor 0.01 0.02 0.03 }"),
        47, 31);
    const Picture p = s.picture();
    const Vec3d diffuse(0.8f, 0.5f, 0.3f), specular(0.5f, 0.6f, 0.7f), emissive(0.01f, 0.02f, 0.03f), n(0, 0, 1),
        eye(0, 0, 10);
    double worst = 0;
    int inRadius = 0, inCone = 0;
    for (int y = 0; y < 31; ++y)
        for (int x = 0; x < 47; ++x) {
            const Vec3d d = pixelDirection(x, y, 47, 31, 0.9f), point = eye - d * (10 / d.z);
            Vec3d sum = emissive;
            const auto add = [&](Vec3d toLight, double factor, Vec3d color, double intensity, double ambient) {
                toLight = glm::normalize(toLight);
                const Vec3d half = glm::normalize(toLight - d);
                const double cosine = std::max(glm::dot(n, toLight), 0.0);
                const double shine = cosine > 0 ? std::pow(std::max(glm::dot(n, half), 0.0), 0.15f * 128) : 0;
                sum += factor * color * (ambient * diffuse * 0.25 + intensity * (diffuse * cosine + specular * shine));
            };
            {
                const Vec3d to = Vec3d(1, 2, 1.5) - point;
                const double r = glm::length(to);
                if (r <= 6)
                    add(to, 1 / std::max(0.5 + 0.2f * r + 0.1f * r * r, 1.0), Vec3d(1, 0.8f, 0.6f), 0.9f, 0.3f),
                        ++inRadius;
            }
            {
                const Vec3d to = Vec3d(-2, -1, 2) - point, axis = glm::normalize(Vec3d(0.3f, 0.2f, -1));
                const double angle = std::acos(glm::dot(-glm::normalize(to), axis));
                const double spot = angle >= 0.8 ? 0 : angle <= 0.3 ? 1 : (angle - 0.8) / (0.3 - 0.8);
                add(to, spot, Vec3d(0.2f, 0.4f, 1), 0.7f, 0);
                inCone += spot > 0 && spot < 1;
            }
            add(Vec3d(1, 0, 2), 1, Vec3d(1), 0.4f, 0.5f);
            for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(p.at(x, y)[c] - sum[c]));
        }
    EXPECT_LT(worst, 2e-5);
    EXPECT_GT(inRadius, 100);
    EXPECT_GT(inCone, 50);
}

// Attenuation and radius count in the light's own frame.
TEST(LightTracer, AttenuationScalesWithTheLightsFrame) {
    LightScene s("Transform { scale 2 2 2 children PointLight { location 0 0 1 attenuation 0 0 1 radius 1.5 } }" +
                 square(100, matte("1 1 1")));
    expectColor(s.center(), Vec3d(1), 1e-6);  // 2 m away, but 1 of the light's own units
    LightScene far(
        "Transform { scale 0.5 0.5 0.5 children PointLight { location 0 0 4 attenuation 0 0 1 radius 3.9 } }" +
        square(100, matte("1 1 1")));
    expectColor(far.center(), Vec3d(0), 0);
    LightScene near(
        "Transform { scale 0.5 0.5 0.5 children PointLight { location 0 0 4 attenuation 0 0 1 radius 4.1 } }" +
        square(100, matte("1 1 1")));
    expectColor(near.center(), Vec3d(1 / 16.0), 1e-6);
}

TEST(LightTracer, FollowsTheNavigationInfoThatAViewpointBrings) {
    const std::string shape = "Shape { appearance Appearance { material Material { } } geometry Box { } }";
    // 23.3.1: it is bound with its viewpoint; the one of the document is for viewpoints that bring none.
    LightScene s(
        "NavigationInfo { headlight TRUE } DEF A Viewpoint { navigationInfo DEF N NavigationInfo { headlight "
        "FALSE visibilityLimit 100 } } DEF B Viewpoint { } " +
        shape);
    EXPECT_EQ(s.center(), Vec3f(0));
    ASSERT_TRUE(s.scene.sendEvent(s.node("B"), x3d::Viewpoint::set_bind.index, Value(true)));
    s.scene.newFrame(1);
    EXPECT_GT(s.center().r, 0.5f);
    ASSERT_TRUE(s.scene.sendEvent(s.node("A"), x3d::Viewpoint::set_bind.index, Value(true)));
    s.scene.newFrame(2);
    EXPECT_EQ(s.center(), Vec3f(0));
    ASSERT_TRUE(s.scene.set(s.node("N"), x3d::NavigationInfo::headlight, true));
    s.scene.newFrame(3);
    EXPECT_GT(s.center().r, 0.5f);
    ASSERT_TRUE(s.scene.set(s.node("N"), x3d::NavigationInfo::visibilityLimit, 5.0f));
    s.scene.newFrame(4);
    EXPECT_EQ(s.center(), Vec3f(0)) << "the box is 9 m away";
    ASSERT_TRUE(s.scene.set(s.node("A"), x3d::Viewpoint::navigationInfo, NodeId{}));
    s.scene.newFrame(5);
    EXPECT_GT(s.center().r, 0.5f);
}

TEST(LightTracer, HeadlightShinesUnlessSwitchedOff) {
    const std::string shape = square(100, matte("0.3 0.6 0.9"));
    LightScene on("NavigationInfo { }" + shape);
    expectColor(on.center(), Vec3d(0.3, 0.6, 0.9), 1e-6);
    LightScene off("NavigationInfo { headlight FALSE }" + shape);
    expectColor(off.center(), Vec3d(0), 0);
    LightScene turned("NavigationInfo { } Viewpoint { position 10 0 10 orientation 0 1 0 0.785398163 }" + shape);
    expectColor(turned.center(), Vec3d(0.3, 0.6, 0.9) * std::sqrt(0.5), 1e-5);
}

TEST(LightTracer, LocalLightsReachTheirSiblingsOnly) {
    // The left square is a sibling of the light, the right one is not.
    LightScene s("Group { children [ DirectionalLight { } Transform { translation -3 0 0 children " +
                     square(1, matte("1 1 1")) + "} ] } Transform { translation 3 0 0 children " +
                     square(1, matte("1 1 1")) + "}",
                 64, 64);
    const Picture p = s.picture();
    const auto column = [](double x) { return static_cast<int>((x / 10 / std::tan(0.7854 / 2) + 1) * 32); };
    EXPECT_EQ(Vec3f(p.at(column(-3), 32)), Vec3f(1));
    EXPECT_EQ(Vec3f(p.at(column(3), 32)), Vec3f(0));
}

// ---- transforms --------------------------------------------------------------------------------------------------

TEST(LightTracer, MirroredInstancesKeepTheirOutside) {
    for (const char* scale : {"1 1 1", "-1 1 1", "1 -1 1", "-1 -1 1", "-2 3 0.5"}) {
        LightScene s(fmt::format("DirectionalLight {{ direction 0 0 -1 }} Transform {{ scale {} children ", scale) +
                     square(5, matte("1 1 1"), "solid TRUE") + "}");
        EXPECT_NEAR(s.center().r, 1, 1e-6) << scale;
        LightScene ball(
            fmt::format(
                "DirectionalLight {{ direction -1 0 0 global TRUE }} Transform {{ scale {} children Shape {{ "
                "appearance Appearance {{ material Material {{ diffuseColor 1 1 1 }} }} geometry Sphere {{ }} }} }}",
                scale),
            65, 65);
        const Picture p = ball.picture();
        EXPECT_GT(p.at(34, 32).r, 0.02f) << "right of the centre faces the light, scale " << scale;
        EXPECT_LT(p.at(30, 32).r, 1e-6f) << scale;
    }
}

// The normal of a stretched sphere goes by the inverse transpose.
TEST(LightTracer, StretchedSphereHasEllipsoidNormals) {
    LightScene s(
        "OrthoViewpoint { fieldOfView [-3 -3 3 3] } DirectionalLight { direction 0 -1 -1 } Transform { scale 3 1 0.5 "
        "children Shape { appearance Appearance { material Material { diffuseColor 1 1 1 } } geometry Sphere { } } }",
        61, 61);
    s.options.settings.shadows = Shadows::none;  // facets near the terminator shadow themselves
    const Picture p = s.picture();
    int checked = 0;
    for (int y = 0; y < 61; ++y)
        for (int x = 0; x < 61; ++x) {
            const double px = -3 + 6 * (x + 0.5) / 61, py = 3 - 6 * (y + 0.5) / 61, q = px * px / 9 + py * py;
            if (q > 0.8) continue;
            const double pz = 0.5 * std::sqrt(1 - q);
            const Vec3d n = glm::normalize(Vec3d(px / 9, py, pz / 0.25));
            EXPECT_NEAR(p.at(x, y).r, std::max(glm::dot(n, glm::normalize(Vec3d(0, 1, 1))), 0.0), 0.02)
                << x << ' ' << y;
            ++checked;
        }
    EXPECT_GT(checked, 500);
}

TEST(LightTracer, SingularTransformsAreSurvived) {
    for (const char* scale : {"1 0 1", "0 0 0", "1e-20 1e-20 1e-20", "1e20 1 1", "1 1 0"}) {
        LightScene s(
            fmt::format("PointLight {{ location 0 3 3 }} Transform {{ scale {} children [ Viewpoint {{ position 0 0 10 "
                        "}} PointLight {{ }} Shape {{ appearance Appearance {{ material Material {{ }} }} geometry "
                        "Sphere {{ radius 2 }} }} ] }}",
                        scale));
        const Picture p = s.picture();
        for (const Vec4f& pixel : p.pixels)
            ASSERT_TRUE(std::isfinite(pixel.r) && std::isfinite(pixel.g) && std::isfinite(pixel.b)) << scale;
    }
}

// ---- surroundings ------------------------------------------------------------------------------------------------

TEST(LightTracer, BackgroundGradientByAngle) {
    LightScene s(
        "Viewpoint { fieldOfView 1.4 orientation 1 0 0 0.4 } Background { skyColor [1 0 0, 0 1 0, 0 0 1] skyAngle [0.8 "
        "1.7] groundColor [0.1 0.1 0.1, 0.5 0.5 0] groundAngle [1.3] }",
        31, 31);
    const Picture p = s.picture();
    for (int y = 0; y < 31; ++y) {
        const Vec3d d = pixelDirection(15, y, 31, 31, 1.4);
        const Vec3d turned(d.x, d.y * std::cos(0.4) - d.z * std::sin(0.4), d.y * std::sin(0.4) + d.z * std::cos(0.4));
        const double zenith = std::acos(turned.y), nadir = kPi - zenith;
        Vec3d expected = zenith <= 0.8   ? glm::mix(Vec3d(1, 0, 0), Vec3d(0, 1, 0), zenith / 0.8)
                         : zenith <= 1.7 ? glm::mix(Vec3d(0, 1, 0), Vec3d(0, 0, 1), (zenith - 0.8) / 0.9)
                                         : Vec3d(0, 0, 1);
        if (nadir <= 1.3) expected = glm::mix(Vec3d(0.1), Vec3d(0.5, 0.5, 0), nadir / 1.3);
        expectColor(Vec3f(p.at(15, y)), expected, 1e-4);
    }
}

TEST(LightTracer, FogCoversByDistance) {
    LightScene s("Fog { color 0.5 0.6 0.7 visibilityRange 40 } Background { skyColor 1 0 0 }" +
                 square(1, unlit("0 0 1")));
    expectColor(s.center(), Vec3d(0, 0, 1) * 0.75 + Vec3d(0.5, 0.6, 0.7) * 0.25, 1e-5);
    EXPECT_EQ(Vec3f(s.picture().at(0, 0)), Vec3f(1, 0, 0)) << "the background is not fogged";
}

// A ball of a micrometre ten kilometres away cannot be told from a point in single precision: it is left out, and
// named. At home the same ball fills the picture as trigonometry says.
TEST(LightTracer, WhatIsTooSmallForItsPlaceIsNamed) {
    const auto look = [](double x) {
        return fmt::format(
            "Viewpoint {{ position {0} 0 3e-6 fieldOfView 0.9 }} Transform {{ translation {0} 0 0 children "
            "Shape {{ geometry Sphere {{ radius 1e-6 }} }} }}",
            x);
    };
    LightScene far(look(10000) + "Shape { geometry Box { size 1 1 1 } }");
    EXPECT_EQ(far.center(), Vec3f(0));
    const auto all = far.world->diagnostics().all();
    ASSERT_EQ(all.size(), 1u);
    EXPECT_NE(all[0].text.find("too small for its distance"), std::string::npos) << all[0].text;
    LightScene near(look(0), 101, 101);
    int white = 0;
    for (const Vec4f& pixel : near.picture().pixels) white += pixel.r > 0.5f;
    // The tangent cone of a ball at three radii: its rim is at tan = 1 / sqrt(8).
    const double radius = 50.5 / std::sqrt(8) / std::tan(0.45);
    EXPECT_NEAR(white, kPi * radius * radius, 0.03 * kPi * radius * radius);
    EXPECT_TRUE(near.world->diagnostics().all().empty());
}

// ---- viewpoints --------------------------------------------------------------------------------------------------

TEST(LightTracer, ViewpointsByNameAndByOrder) {
    LightScene s(
        "NavigationInfo { transitionType \"TELEPORT\" } "
        "DEF A Viewpoint { position 0 0 10 description \"front\" } DEF B Viewpoint { position 10 0 0 orientation 0 1 0 "
        "1.5707963 description \"side\" }"
        "Shape { appearance Appearance { material Material { } } geometry Box { } }");
    const auto eye = [&](const char* name) {
        const auto camera = s.light->tracer().camera(s.world->rays(), 1, name);
        return camera ? camera->position : Vec3d(NAN);
    };
    EXPECT_EQ(eye(""), Vec3d(0, 0, 10));
    EXPECT_EQ(eye("B"), Vec3d(10, 0, 0));
    EXPECT_EQ(eye("side"), Vec3d(10, 0, 0));
    const auto wrong = s.light->tracer().camera(s.world->rays(), 1, "nobody");
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().text.find("\"A\", \"B\""), std::string::npos) << wrong.error().text;
    ASSERT_TRUE(s.scene.sendEvent(s.node("B"), x3d::Viewpoint::set_bind.index, Value(true)));
    s.scene.newFrame(1);
    EXPECT_EQ(eye(""), Vec3d(10, 0, 0)) << "bound";
    ASSERT_TRUE(moveViewer(s.scene, {{1, 2, 3}, {1, 0, 0, 0}}, false));
    s.scene.newFrame(2);
    const auto moved = s.light->tracer().camera(s.world->rays(), 1, "");
    ASSERT_TRUE(moved);
    EXPECT_LT(glm::length(moved->position - Vec3d(1, 2, 3)), 1e-5) << "where the user has gone";
    EXPECT_LT(glm::length(moved->forward - Vec3d(0, 0, -1)), 1e-5);
    EXPECT_EQ(eye("A"), Vec3d(0, 0, 10));
}

TEST(LightTracer, ViewpointFollowsItsTransform) {
    LightScene s("DEF T Transform { children Viewpoint { position 0 0 10 } }");
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(1, 2, 3)));
    s.scene.newFrame(1);
    EXPECT_EQ(s.light->tracer().camera(s.world->rays(), 1)->position, Vec3d(1, 2, 13));
}

TEST(LightTracer, WithoutAViewpointEverythingIsInThePicture) {
    LightScene s("# frame\nTransform { translation 100 50 -30 children Shape { geometry Box { size 3 1 2 } } }", 64,
                 32);
    const Picture p = s.picture();
    int white = 0;
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 64; ++x) {
            white += p.at(x, y).r > 0;
            const bool border = x == 0 || y == 0 || x == 63 || y == 31;
            EXPECT_FALSE(border && p.at(x, y).r > 0);
        }
    EXPECT_GT(white, 300);
}

// ---- sampling and threads ----------------------------------------------------------------------------------------

TEST(LightTracer, ManySamplesGiveTheCoveredShareOfAPixel) {
    // The edge at x = 0.3 of a pixel one metre wide.
    LightScene s("OrthoViewpoint { fieldOfView [-0.5 -0.5 0.5 0.5] } Transform { translation 4.8 0 0 children " +
                     square(5, unlit("1 1 1")) + "}",
                 1, 1);
    s.options.settings.samplesPerPixel = 256;
    EXPECT_NEAR(s.picture().at(0, 0).r, 0.7, 0.006) << "256 stratified columns";
    s.options.settings.seed = 5;
    EXPECT_NEAR(s.picture().at(0, 0).r, 0.7, 0.006);
}

TEST(LightTracer, PictureDoesNotDependOnTheThreads) {
    LightScene s("PointLight { location 3 5 8 } Shape { appearance Appearance { " + glass(1.5) +
                     " } geometry Sphere { } } Transform { translation 0 0 -4 children " +
                     square(4, matte("0.5 0.7 0.2")) + "}",
                 77, 53);
    s.options.settings.samplesPerPixel = 4;
    s.options.settings.threads = 1;
    const Picture one = s.picture();
    for (const unsigned threads : {2u, 0u}) {
        s.options.settings.threads = threads;
        EXPECT_EQ(s.picture().pixels, one.pixels) << threads;
    }
}

/// RenderSettings::progress: with the share done, never from two threads at once; false cancels.
TEST(LightTracer, ProgressIsToldAndMayCancel) {
    LightScene s("Shape { geometry Sphere { } }", 640, 480);
    std::atomic<int> within{0}, calls{0};
    std::atomic<bool> together{false};
    double maximum = 0;
    s.options.settings.progress = [&](double done) {
        if (++within > 1) together = true;
        EXPECT_GT(done, 0);
        EXPECT_LE(done, 1);
        maximum = std::max(maximum, done);
        ++calls;
        --within;
        return true;
    };
    const Picture whole = s.picture();
    EXPECT_FALSE(s.stats.cancelled);
    EXPECT_FALSE(together);
    EXPECT_GT(calls, 10);
    EXPECT_GT(maximum, .5);
    s.options.settings.progress = [&](double) { return false; };
    const Picture some = s.picture();
    EXPECT_TRUE(s.stats.cancelled);
    EXPECT_LT(s.stats.primaryRays, 640U * 480U);
    EXPECT_NE(some.pixels, whole.pixels);
    s.options.settings.progress = {};
    EXPECT_EQ(s.picture().pixels, whole.pixels);
}

TEST(LightTracer, ImpossibleSettingsAreErrors) {
    LightScene s("Shape { geometry Box { } }");
    const Camera camera;
    for (auto change :
         {+[](RenderSettings& r) { r.width = 0; }, +[](RenderSettings& r) { r.height = -5; },
          +[](RenderSettings& r) { r.width = 1 << 20; }, +[](RenderSettings& r) { r.samplesPerPixel = 0; },
          +[](RenderSettings& r) { r.error = -.1f; }, +[](RenderSettings& r) { r.error = std::nanf(""); }}) {
        RenderSettings settings;
        change(settings);
        EXPECT_FALSE(s.light->tracer().render(s.world->rays(), camera, settings));
    }
    ImageOptions options;
    options.settings.integrator = Integrator::raster;
    EXPECT_FALSE(s.light->picture(options));
}

// A pane that nobody sees lies in the plane of what a pointer is to find: it hides nothing, and pointers meet it.
TEST(LightTracer, WhatIsWhollyTransparentHidesNothingInItsPlane) {
    const char* const pane =
        "Shape { appearance Appearance { material DEF PANE Material { transparency 1 } } geometry "
        "Rectangle2D { size 4 4 } } ";
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const bool first : {false, true}) {
            const std::string red = square(1, unlit("1 0 0"));
            LightScene s("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } " + (first ? pane + red : red + pane), 100, 100);
            s.options.settings.integrator = integrator;
            const auto seen = [&](int channel) {
                double sum = 0;
                for (const Vec4f& pixel : s.picture().pixels) sum += pixel[channel];
                return sum / 1e4;
            };
            EXPECT_NEAR(seen(0), .25, .002);
            EXPECT_EQ(seen(1), 0);
            Ray ray;
            ray.origin = {1.5f, 1.5f, 10};
            EXPECT_NEAR(s.world->rays().intersect(ray).t, 10, 1e-6);
            ASSERT_TRUE(s.scene.set(s.node("PANE"), x3d::Material::transparency, .5f));
            ASSERT_TRUE(s.scene.set(s.node("PANE"), x3d::Material::emissiveColor, Color{0, 1, 0}));
            s.scene.newFrame(1);
            EXPECT_GT(seen(1), .3) << "it can be seen now";
            ASSERT_TRUE(s.scene.set(s.node("PANE"), x3d::Material::transparency, 1.0f));
            s.scene.newFrame(2);
            EXPECT_NEAR(seen(0), .25, .002);
            EXPECT_EQ(seen(1), 0);
        }
}

// Two lamps light a white surface twice: what is written is cut at white, and so is what is mixed with something else.
TEST(LightTracer, WhatIsMixedWithSomethingElseIsNoBrighterThanWhite) {
    const std::string lamps = "DirectionalLight { direction 0 0 -1 } DirectionalLight { direction 0 0 -1 } ";
    const auto pane = [](const char* material, double z) {
        return fmt::format("Transform {{ translation 0 0 {} children {} }} ", z, square(2, material));
    };
    const auto white = [](double transparency) {
        return fmt::format("material Material {{ diffuseColor 1 1 1 ambientIntensity 0 transparency {} }}",
                           transparency);
    };
    const char* const dark = "material UnlitMaterial { emissiveColor 0 0 0 transparency .75 }";
    const auto seen = [&](const std::string& body, ColorSpace space = ColorSpace::automatic) {
        LightScene s(lamps + body);
        s.options.settings.colorSpace = space;
        return s.center();
    };
    const std::string whole = pane(white(0).c_str(), 0), half = pane(white(.5).c_str(), 0);
    expectColor(seen(whole), {2, 2, 2}, 1e-5);
    expectColor(seen(half), {.5, .5, .5}, 1e-5);
    expectColor(seen(half, ColorSpace::display), {.5, .5, .5}, 1e-5);
    expectColor(seen(half, ColorSpace::linear), {1, 1, 1}, 1e-5);
    expectColor(seen(whole + pane(dark, 1)), {.75, .75, .75}, 1e-5);
    expectColor(seen(whole + pane(dark, 1), ColorSpace::linear), {1.125, 1.125, 1.125},
                1e-5);  // the lamps shine through
    // A mirror shows a half of what it mirrors, however bright.
    const std::string aside = "Transform { rotation 0 1 0 .785398163 children " + square(2, mirror(".5")) +
                              " } Transform { translation 5 0 0 rotation 0 1 0 -1.570796327 children " +
                              square(2, white(0)) + " } DirectionalLight { direction 1 -1 0 intensity 2.8284271 } ";
    expectColor(seen(aside), {1, 1, 1}, 1e-4);
}

}  // namespace
}  // namespace rtsg
