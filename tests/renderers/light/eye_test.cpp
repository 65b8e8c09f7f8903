// Lenses, panoramas and two eyes: which rays pixels are made of, in closed form.
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include <rtsg/renderers/picking.h>

#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

const PictureLayer& layer(const Picture& p, const std::string& channel) {
    for (const PictureLayer& l : p.layers)
        if (l.channels[0] == channel) return l;
    throw std::runtime_error("no layer " + channel);
}
Vec3d position(const Picture& p, int x, int y) {
    const float* v = &layer(p, "P.X").values[3 * static_cast<std::size_t>(y * p.width + x)];
    return {v[0], v[1], v[2]};
}

// An eye too far away for any ray to start there, or at no number at all, is told of, once.
TEST(Eye, OneThatIsNowhereIsNamed) {
    const auto said = [](const char* position) {
        LightScene s(std::string("DEF V Viewpoint { position ") + position + " } Shape { geometry Box { } }", 8, 8);
        s.picture();
        s.picture();
        EXPECT_LE(s.light->diagnostics().all().size(), 1u);
        return s.light->diagnostics().all().empty() ? std::string() : s.light->diagnostics().all()[0].text;
    };
    EXPECT_EQ(said("0 0 10"), "");
    EXPECT_EQ(said("0 0 1e8"), "");
    EXPECT_NE(said("0 0 1e10").find("more than 1e+09 m from the scene: nothing of it is seen"), std::string::npos);
    EXPECT_NE(said("0 1e20 0").find("seen from 0 0 10"), std::string::npos);
}

// 23.3.1: what stands below the same transform as the viewpoint is seen as if the transform were not there, however it
// scales, shears or mirrors; by both kinds of eyes, with its depths as the transform has made them.
TEST(Eye, ViewpointsBelowUnevenScalesSeeTheirOwnSpace) {
    const std::string items =
        "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 0 0 } } geometry Box { size 2 1 1 } "
        "} "
        "Transform { translation 1.2 .9 -2 children Shape { appearance Appearance { material UnlitMaterial { "
        "emissiveColor 0 1 0 } } geometry Sphere { } } }";
    for (const std::string eye : {"Viewpoint { position .4 1 5 orientation 1 0 0 -.2 } ",
                                  "OrthoViewpoint { position .4 1 5 fieldOfView [-2 -2 2 2] } "})
        for (const std::string transform :
             {"translation 7 3 -2 scale .25 4 2", "rotation .6 0 .8 .8 scale 3 1 .2 scaleOrientation 0 .6 .8 .6",
              "scale -1 1 1"}) {
            LightScene plain(eye + items, 48, 36),
                below("Transform { " + transform + " children [ " + eye + items + " ] }", 48, 36);
            const Picture a = plain.picture(), b = below.picture();
            int other = 0, seen = 0;
            for (std::size_t i = 0; i < a.pixels.size(); ++i) {
                other += a.pixels[i] != b.pixels[i];
                seen += a.pixels[i].r + a.pixels[i].g > 0;
            }
            EXPECT_GT(seen, 100) << eye << transform;
            // An edge of the box may run through pixels' middles, where rounding decides: 33 by Embree's narrowest
            // kernels.
            EXPECT_LE(other, 48) << eye << transform << ": more than rays that graze an edge";
        }
}

// 17.2.2 does not say in which space its angles are; they are those of the eye's, as in browsers: what stands below the
// same transform as viewpoint and lights is lit as if the transform were not there.
TEST(Eye, ViewpointsBelowUnevenScalesSeeThingsLitAsInTheirOwnSpace) {
    const std::string items =
        "Shape { appearance Appearance { material Material { diffuseColor .6 .3 .2 specularColor .4 .4 .4 shininess .1 "
        "} } geometry Sphere { } } "
        "Transform { translation 1.5 .5 -1 rotation .6 .8 0 .7 children Shape { appearance Appearance { material "
        "PhysicalMaterial { baseColor .2 .7 .4 metallic .3 roughness .4 } } geometry Box { size 1 1 1 } } } ";
    const std::string eye = "Viewpoint { position .4 1 5 orientation 1 0 0 -.2 } ";
    for (const std::string lights :
         {"NavigationInfo { headlight TRUE } ",
          "NavigationInfo { headlight FALSE } DirectionalLight { direction 1 -2 -1 ambientIntensity .3 } ",
          "NavigationInfo { headlight FALSE } PointLight { location -2 3 4 radius 1000 global TRUE shadows TRUE } "})
        for (const std::string transform :
             {"translation 7 3 -2 scale .25 4 2", "rotation .6 0 .8 .8 scale 3 1 .2 scaleOrientation 0 .6 .8 .6",
              "scale .234 234 12.23"}) {
            SCOPED_TRACE(lights + transform);
            LightScene plain(eye + lights + items, 48, 36),
                below("Transform { " + transform + " children [ " + eye + lights + items + " ] }", 48, 36);
            const Picture a = plain.picture(), b = below.picture();
            int other = 0, lit = 0;
            for (std::size_t i = 0; i < a.pixels.size(); ++i) {
                const Vec3f apart = glm::abs(Vec3f(a.pixels[i] - b.pixels[i]));
                other += std::max({apart.r, apart.g, apart.b}) > .005f;
                lit += a.pixels[i].r + a.pixels[i].g > .05f;
            }
            EXPECT_GT(lit, 100);
            EXPECT_LE(other, 20) << "more than rays that graze an edge";
        }
}

// In numbers: a plane that leans by 60 degrees reflects half of the headlight, whatever squashes both.
TEST(Eye, APlaneBelowAnUnevenScaleReflectsByItsOwnAngle) {
    for (const char* scale : {"1 1 1", "1 20 1", "5 .1 1"}) {
        LightScene s(
            fmt::format("NavigationInfo {{ }} Transform {{ scale {} children [ Viewpoint {{ }} Transform {{ "
                        "rotation 1 0 0 1.0471975512 children {} }} ] }}",
                        scale, square(3, matte(".8 .4 .2"))));
        expectColor(s.center(), {.4, .2, .1}, 1e-4);
    }
}

// 23.3.1: planes across the view, not balls around the eye; and what lies behind clear surfaces has the same end.
TEST(Eye, NothingIsSeenBeforeTheNearPlaneOrBehindTheFarOne) {
    const std::string red = "material UnlitMaterial { emissiveColor 1 0 0 }", blue = unlit("0 0 1");
    const auto wall = [](double z, const std::string& look) {
        return fmt::format("Transform {{ translation 0 0 {} children {} }}", z, square(50, look));
    };
    const std::string clear =
        "material UnlitMaterial { emissiveColor 1 1 1 transparency 1 } texture PixelTexture { image 1 1 4 0 }";
    const std::string walls = wall(6, red) + wall(0, blue);  // 4 and 10 m before the eye
    for (const std::string eye :
         {"Viewpoint { fieldOfView 1.5 ", "OrthoViewpoint { position 0 0 10 fieldOfView [-2 -2 2 2] "})
        for (const bool path : {false, true}) {
            const auto seen = [&](const std::string& limits, const std::string& scene, const Vec3f& color) {
                LightScene s(eye + limits + " }" + scene);
                if (path) s.options.settings.integrator = Integrator::path;
                const Picture p = s.picture();
                const Picker picker(s.world->rays(), s.world->flattener());
                const auto camera = s.light->tracer().camera(s.world->rays(), 1);
                ASSERT_TRUE(camera);
                const auto views = s.light->tracer().layers(s.world->rays(), *camera, 33, 33);
                for (const auto& [x, y] : {std::pair(0, 0), std::pair(16, 16), std::pair(32, 5)}) {
                    EXPECT_EQ(Vec3f(p.at(x, y)), color)
                        << eye << limits << " at " << x << ", " << y << (path ? ": path" : "");
                    const auto pick = LightTracer::pick(picker, views, x + .5, y + .5);
                    ASSERT_TRUE(pick);
                    EXPECT_EQ(static_cast<bool>(*pick), color != Vec3f(0)) << limits;
                    EXPECT_TRUE(!*pick || std::abs(pick->point.z - (color.r > 0 ? 6 : 0)) < 1e-6) << pick->point.z;
                }
            };
            seen("", walls, {1, 0, 0});
            seen("nearDistance 3.99", walls, {1, 0, 0});
            seen("nearDistance 4.01", walls, {0, 0, 1});
            seen("nearDistance 10.01", walls, {0, 0, 0});
            seen("farDistance 10.01", wall(0, blue), {0, 0, 1});
            seen("farDistance 9.99", wall(0, blue), {0, 0, 0});
            if (!path) {
                LightScene s(eye + "farDistance 9.99 }" + wall(6, clear) + wall(0, blue));
                EXPECT_EQ(s.center(), Vec3f(0)) << "behind a clear surface, too";
            }
        }
}

// Inside a ball, a pixel shows what lies at its longitude and latitude, forward in the middle.
TEST(Eye, APanoramaShowsAllDirections) {
    LightScene s(
        "Viewpoint { position 1 2 3 orientation 0 1 0 .5 } Transform { translation 1 2 3 children Shape { "
        "appearance Appearance { material Material { } } geometry Sphere { radius 5 solid FALSE } } }",
        40, 20);
    s.options.panorama = true;
    s.options.settings.layers = kPosition | kDepth;
    const Picture p = s.picture();
    ASSERT_EQ(p.width, 40);
    const Vec3d forward(-std::sin(.5), 0, -std::cos(.5)), right(std::cos(.5), 0, -std::sin(.5)), up(0, 1, 0);
    for (int y = 0; y < 20; ++y)
        for (int x = 0; x < 40; ++x) {
            const double longitude = ((x + .5) / 40 - .5) * 2 * kPi, latitude = (.5 - (y + .5) / 20) * kPi;
            const Vec3d d = std::cos(latitude) * (std::cos(longitude) * forward + std::sin(longitude) * right) +
                            std::sin(latitude) * up;
            const Vec3d seen = position(p, x, y) - Vec3d(1, 2, 3);
            EXPECT_NEAR(glm::length(glm::normalize(seen) - d), 0, 1e-5) << x << " " << y;
            EXPECT_NEAR(layer(p, "Z").values[static_cast<std::size_t>(y * 40 + x)], glm::length(seen), 1e-4)
                << "from the eye";
        }
}

/// A white wall that begins at x = 0, `distance` metres before the eye.
std::string halfWall(double distance) {
    return fmt::format("Transform {{ translation 20 0 {} children {} }}", 10 - distance, square(20, unlit("1 1 1")));
}

// A ray from lx on the lens to u in the plane of focus f is at u d / f + lx (1 - d / f) at distance d. So with d = 2 f
// a pixel shows as much of a wall from x = 0 on as there is of the lens where lx < 2 u: a segment of its disk.
TEST(Eye, ALensBlursWhatIsOutOfItsFocus) {
    constexpr int kSide = 33;
    constexpr double kFocus = 5, kRadius = 0.8;
    LightScene s("Viewpoint { fieldOfView .7854 }" + halfWall(2 * kFocus), kSide, kSide);
    s.options.settings.samplesPerPixel = 1024;
    s.options.lensRadius = kRadius, s.options.focus = kFocus;
    const Picture p = s.picture();
    const double half = kFocus * std::tan(.7854 / 2);
    int between = 0;
    for (int x = 0; x < kSide; ++x) {
        double expected = 0;  // over the pixel's width
        for (int i = 0; i < 100; ++i) {
            const double t = std::clamp(2 * half * (2 * (x + (i + .5) / 100) / kSide - 1) / kRadius, -1.0, 1.0);
            expected += (.5 + (t * std::sqrt(1 - t * t) + std::asin(t)) / kPi) / 100;
        }
        EXPECT_NEAR(p.at(x, 16).r, expected, 0.012) << x;
        between += expected > .05 && expected < .95;
    }
    EXPECT_GE(between, 4);
}

TEST(Eye, WhatIsInFocusIsSharpAndASingleSampleIsAPinholes) {
    LightScene s(halfWall(4), 32, 32);
    s.options.lensRadius = 1, s.options.focus = 4;
    s.options.settings.samplesPerPixel = 16;
    const Picture sharp = s.picture();
    for (int x = 0; x < 32; ++x) EXPECT_NEAR(sharp.at(x, 16).r, x < 16 ? 0 : 1, 1e-4) << x;
    s.options.settings.samplesPerPixel = 1;
    s.options.focus = 2;
    const Picture one = s.picture();
    s.options.lensRadius = 0;
    EXPECT_EQ(one.pixels, s.picture().pixels);
}

// Both eyes' rays of one pixel meet at the distance that is asked for, in the same place that one eye would see there.
TEST(Eye, TwoEyesMeetAtTheirDistance) {
    const Camera middle = Camera::perspective(identityTransform(), {1, 2, 3}, {0, 1, 0, 0.3f}, 0.8, 1.5);
    for (const double distance : {2.0, std::numeric_limits<double>::infinity()}) {
        const Camera left = middle.beside(-.1, distance), right = middle.beside(.1, distance);
        EXPECT_NEAR(glm::length(right.position - left.position - .2 * middle.right), 0, 1e-12);
        for (const double x : {0.0, 0.4, 1.0}) {
            const auto a = left.ray(x, .3), b = right.ray(x, .3), m = middle.ray(x, .3);
            if (std::isinf(distance)) {
                EXPECT_NEAR(glm::length(a.direction - b.direction), 0, 1e-12);
                continue;
            }
            const auto at = [&](const Camera::WorldRay& r) {
                return r.origin + r.direction * (distance / glm::dot(r.direction, middle.forward));
            };
            EXPECT_NEAR(glm::length(at(a) - at(m)), 0, 1e-12);
            EXPECT_NEAR(glm::length(at(b) - at(m)), 0, 1e-12);
        }
    }
}

TEST(Eye, StereoIsBothEyesPictures) {
    const std::string items =
        "Shape { appearance Appearance { material Material { } } geometry Box { } } PointLight { }";
    for (const Stereo stereo : {Stereo::beside, Stereo::above}) {
        LightScene s(items, 24, 18);
        s.options.stereo = stereo, s.options.eyeDistance = .5, s.options.focus = 9;
        s.options.settings.layers = kDepth | kNode;
        const Picture both = s.picture();
        const bool beside = stereo == Stereo::beside;
        ASSERT_EQ(both.width, beside ? 48 : 24);
        ASSERT_EQ(both.height, beside ? 18 : 36);
        const RenderStats counts = s.stats;
        EXPECT_EQ(counts.primaryRays, 2u * 24 * 18);
        EXPECT_EQ(counts.samples, 1);
        for (int eye = 0; eye < 2; ++eye) {
            const auto alone = s.light->tracer().render(s.world->rays(), s.light->camera().beside(eye ? .25 : -.25, 9),
                                                        s.options.settings);
            ASSERT_TRUE(alone);
            for (int y = 0; y < 18; ++y)
                for (int x = 0; x < 24; ++x) {
                    const int toX = x + (beside && eye ? 24 : 0), toY = y + (!beside && eye ? 18 : 0);
                    EXPECT_EQ(both.at(toX, toY), alone->at(x, y));
                    EXPECT_EQ(layer(both, "Z").values[static_cast<std::size_t>(toY * both.width + toX)],
                              layer(*alone, "Z").values[static_cast<std::size_t>(y * 24 + x)]);
                }
        }
    }
}

TEST(Eye, WhatNoEyeHasIsAnError) {
    LightScene parallel("OrthoViewpoint { } # Viewpoint\nShape { geometry Box { } }", 8, 8);
    parallel.options.lensRadius = .1;
    EXPECT_FALSE(parallel.light->picture(parallel.options));
    parallel.options.lensRadius = 0, parallel.options.stereo = Stereo::beside;
    EXPECT_FALSE(parallel.light->picture(parallel.options));
    LightScene s("Shape { geometry Box { } }", 8, 8);
    s.options.lensRadius = -1;
    EXPECT_FALSE(s.light->picture(s.options));
    s.options.lensRadius = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(s.light->picture(s.options));
    s.options.lensRadius = 0, s.options.panorama = true, s.options.stereo = Stereo::above;
    EXPECT_FALSE(s.light->picture(s.options));
}

}  // namespace
}  // namespace rtsg
