// Motion blur: how much of a pixel's time what moves is seen there, in closed form; and what a shutter costs who rests.
#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

constexpr int kShutterSide = 33;
/// Half of what the default Viewpoint shows of the plane z = 0.
const double kShutterHalf = 10 * std::tan(.7854 / 2);

/// Where the middle of a column, and `more` pixels beside it, is in the plane z = 0.
double columnAt(int x, double more = 0) {
    return kShutterHalf * (2 * (x + .5 + more) / kShutterSide - 1);
}
double rowAt(int y) {
    return -columnAt(y);
}

struct ShutterScene : LightScene {
    explicit ShutterScene(const std::string& body, float fraction = 1, int samples = 256)
        : LightScene(body, kShutterSide, kShutterSide) {
        options.settings.shutter = fraction;
        options.settings.samplesPerPixel = samples;
    }
    void move(const char* name, const Vec3f& to) {
        ASSERT_TRUE(scene.set(node(name), x3d::Transform::translation, to));
    }
    void rotate(const char* name, const Rotation& to) {
        ASSERT_TRUE(scene.set(node(name), x3d::Transform::rotation, to));
    }
};

/// The share of a time in which a thing of this half width, whose middle goes evenly from `from` to `to`, is over x;
/// over a pixel's width.
double fractionOfTime(int x, double half, double from, double to) {
    constexpr int kParts = 200;
    double sum = 0;
    for (int i = 0; i < kParts; ++i) {
        const double at = columnAt(x, (i + .5) / kParts - .5);
        const double enters = (at - half - from) / (to - from), leaves = (at + half - from) / (to - from);
        sum += std::max(0.0, std::min(std::max(enters, leaves), 1.0) - std::max(std::min(enters, leaves), 0.0));
    }
    return sum / kParts;
}

// A square goes from -2 to 1.5 while the shutter is open in the last part of its way. Each pixel shows it in proportion
// to the time that it covers the pixel.
TEST(Shutter, WhatMovesEvenlyIsSeenAsLongAsItIsThere) {
    for (const float fraction : {1.0f, .5f, .1f}) {
        SCOPED_TRACE(fraction);
        ShutterScene s("DEF T Transform { translation -2 0 0 children " + square(1, unlit("1 1 1")) + "}", fraction,
                       1024);
        const Picture first = s.picture();
        for (int x = 0; x < kShutterSide; ++x)
            if (std::abs(std::abs(columnAt(x) + 2) - 1) > .3) {
                EXPECT_NEAR(first.at(x, 16).r, std::abs(columnAt(x) + 2) < 1, 1e-4) << "nothing has moved yet";
            }
        s.move("T", {1.5f, 0, 0});
        const Picture p = s.picture();
        for (int x = 0; x < kShutterSide; ++x)
            EXPECT_NEAR(p.at(x, 16).r, fractionOfTime(x, 1, 1.5 - 3.5 * fraction, 1.5), .012) << x;
        EXPECT_NEAR(p.at(16, 16).a, 1, 1e-5);
        // Where it has stayed since, it is sharp.
        const Picture after = s.picture();
        for (int x = 0; x < kShutterSide; ++x)
            if (std::abs(std::abs(columnAt(x) - 1.5) - 1) > .2) {
                EXPECT_NEAR(after.at(x, 16).r, std::abs(columnAt(x) - 1.5) < 1, 1e-4) << x;
            }
    }
}

// A rod of half length 3 that turns by 120 degrees about its middle: between the ends of its way each place at distance
// r sees it for as long as it takes to turn by its width there, and beyond its ends nothing is ever seen. A matrix
// whose numbers change evenly would halve it on the way.
TEST(Shutter, WhatTurnsKeepsItsLength) {
    ShutterScene s("DEF T Transform { children Shape { appearance Appearance { " + unlit("1 1 1") +
                       " } geometry Box { size 6 .8 .01 } } }",
                   1, 1024);
    s.picture();
    const double turned = 2 * kPi / 3;
    s.rotate("T", {0, 0, 1, static_cast<float>(turned)});
    const Picture p = s.picture();
    int inside = 0, outside = 0;
    for (int y = 0; y < kShutterSide; ++y)
        for (int x = 0; x < kShutterSide; ++x) {
            const double r = std::hypot(columnAt(x), rowAt(y));
            double angle = std::atan2(rowAt(y), columnAt(x));
            if (angle < 0) angle += kPi;  // the other half is there as well
            const double width = r > .45 ? std::asin(.4 / r) : kPi;
            const std::string where = fmt::format("{} {}", x, y);
            if (r > 3.3) {
                EXPECT_EQ(p.at(x, y).r, 0) << where;
                ++outside;
            } else if (r > 1 && r < 2.75 && angle > width + .25 && angle < turned - width - .25) {
                EXPECT_NEAR(p.at(x, y).r, 2 * width / turned, .03) << where;
                ++inside;
            } else if (r > 1 && r < 2.75 && angle > turned + width + .25 && angle < kPi - width - .25) {
                EXPECT_EQ(p.at(x, y).r, 0) << where << ": not its way";
            }
        }
    EXPECT_GT(inside, 50);
    EXPECT_GT(outside, 200);
}

// Shapes below a turning Transform go round with it, not straight across: their distance from the axis stays the same.
// Two shapes below one that turns by a route are one body; one alone is not. Both go the same way.
TEST(Shutter, WhatHangsBelowGoesRound) {
    const std::string hand = "Transform { translation 2.5 0 0 children " + square(.35, unlit("1 1 1")) + "}";
    for (const bool body : {false, true}) {
        SCOPED_TRACE(body);
        ShutterScene s(
            "DEF T Transform { center 0 -1 0 children [" + hand +
                (body ? "Transform { translation -2.5 0 0 children " + square(.35, unlit("1 1 1")) + "}" : "") +
                "] } DEF C TimeSensor { } DEF I OrientationInterpolator { key [ 0 1 ] keyValue [ 0 0 1 0, 0 0 1 1 ] }" +
                "ROUTE C.fraction_changed TO I.set_fraction ROUTE I.value_changed TO T.rotation",
            1, 512);
        s.picture();
        const double turned = 2.0;
        s.rotate("T", {0, 0, 1, static_cast<float>(turned)});
        const Picture p = s.picture();
        EXPECT_EQ(s.world->rays().stats().bodies, body ? 1u : 0u);
        const double radius = std::hypot(2.5, 1), start = std::atan2(1, 2.5);
        const auto shown = [&](double r, double angle) {
            const double x = r * std::cos(angle), y = -1 + r * std::sin(angle);
            const auto pixel = [&](double v) {
                return static_cast<int>(std::floor((v / kShutterHalf + 1) / 2 * kShutterSide));
            };
            return p.at(pixel(x), kShutterSide - 1 - pixel(y)).r;
        };
        for (const double t : {.25, .5, .75}) {
            EXPECT_GT(shown(radius, start + t * turned), .1) << t;
            EXPECT_EQ(shown(radius * std::cos(turned / 2), start + t * turned), 0) << t << ": the short cut";
        }
    }
}

// The eye moves by 2 m past a wall at 10 m that begins at x = 0: its edge goes as far the other way. A turning eye sees
// the edge at the tangent of an angle that changes evenly.
TEST(Shutter, TheEyeMoves) {
    const std::string wall =
        "DEF V Viewpoint { } Transform { translation 20 0 0 children " + square(20, unlit("1 1 1")) + "}";
    for (const double lens : {0.0, .1}) {  // with one, whose focus is on the wall
        ShutterScene s(wall, 1, 1024);
        s.options.lensRadius = lens, s.options.focus = 10;
        s.picture();
        ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewpoint::position, Vec3f(2, 0, 10)));
        const Picture p = s.picture();
        for (int x = 0; x < kShutterSide; ++x) {
            double expected = 0;
            for (int i = 0; i < 100; ++i)
                expected += std::clamp((columnAt(x, (i + .5) / 100 - .5) + 2) / 2, 0.0, 1.0) / 100;
            EXPECT_NEAR(p.at(x, 16).r, expected, .012) << x << " " << lens;
        }
    }
    ShutterScene turning(wall, 1, 1024);
    turning.picture();
    constexpr double kRotation = .3;  // to the left: the edge goes to the right
    ASSERT_TRUE(turning.scene.set(turning.node("V"), x3d::Viewpoint::orientation, Rotation{0, 1, 0, kRotation}));
    const Picture q = turning.picture();
    for (int x = 0; x < kShutterSide; ++x) {
        double expected = 0;
        for (int i = 0; i < 100; ++i)
            expected += std::clamp(std::atan(columnAt(x, (i + .5) / 100 - .5) / 10) / kRotation, 0.0, 1.0) / 100;
        EXPECT_NEAR(q.at(x, 16).r, expected, .012) << x;
    }
}

// A cut to another viewpoint is no motion.
TEST(Shutter, ACutIsSharp) {
    ShutterScene s(
        "NavigationInfo { headlight FALSE transitionType \"TELEPORT\" } DEF A Viewpoint { } DEF B Viewpoint { position "
        "3 0 10 } Transform { translation 20 0 0 children " +
        square(20, unlit("1 1 1")) + "}");
    s.picture();
    ASSERT_TRUE(s.scene.sendEvent(s.node("B"), x3d::Viewpoint::set_bind.index, Value(true)));
    s.scene.newFrame(1);
    const Picture p = s.picture();
    EXPECT_NEAR(s.light->camera().position.x, 3, 1e-6);
    int between = 0;
    for (int x = 0; x < kShutterSide; ++x) between += p.at(x, 16).r > .01 && p.at(x, 16).r < .99;
    EXPECT_LE(between, 1);
}

/// The shape that is blurred here is not in front of the eye; only its shadow, or its mirror image, is.
TEST(Shutter, ShadowsAndReflectionsMoveWithWhatTheyAreOf) {
    // Light at 45 degrees: a thing at z = 5 has its shadow on the wall at z = 0 five metres further along x.
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        ShutterScene s("DirectionalLight { direction 1 0 -1 intensity 1 shadows TRUE } " + square(20, matte("1 1 1")) +
                           "DEF T Transform { translation -7 0 5 children " + square(1, unlit("0 0 0")) + "}",
                       1, 1024);
        s.options.settings.integrator = integrator;
        const Picture lit = s.picture();
        s.move("T", {-4, 0, 5});
        const Picture p = s.picture();
        const float full = lit.at(30, 16).r;
        EXPECT_GT(full, .3f);
        for (int x = 9; x < kShutterSide; ++x) {  // the thing itself is seen to the left of these
            const double fraction = 1 - fractionOfTime(x, 1, -2, 1);
            EXPECT_NEAR(p.at(x, 16).r / full, fraction, integrator == Integrator::whitted ? .02 : .03) << x;
        }
    }
    // A mirror at z = 0 shows what goes by 5 m behind the eye at 15 m behind itself: at 25 m from the eye.
    ShutterScene s(
        square(20, mirror("1")) + "DEF T Transform { translation -5 0 15 children " + square(2, unlit("1 1 1")) + "}",
        1, 1024);
    s.picture();
    s.move("T", {5, 0, 15});
    const Picture p = s.picture();
    for (int x = 0; x < kShutterSide; ++x)
        EXPECT_NEAR(p.at(x, 16).r, fractionOfTime(x, 2 / 2.5, -5 / 2.5, 5 / 2.5), .015) << x;
}

// The light of a lamp that moves is the mean of its light on its way: by an integral over lamp and time, in double.
TEST(Shutter, LampsThatMoveLightAsLongAsTheyAreThere) {
    const auto lamp = [](const char* at) {
        return std::string("NavigationInfo { headlight FALSE } Viewpoint { position 0 0 1 orientation 1 0 0 0 } ") +
               "Background { skyColor 0 0 0 } Transform { translation 0 0 0 children " + square(3, matte("1 1 1")) +
               "} DEF T Transform { translation " + at + " rotation 1 0 0 3.14159265 children " +
               square(.4, "material Material { diffuseColor 0 0 0 emissiveColor 1 1 1 }", "solid TRUE") + "}";
    };
    ShutterScene s(lamp("-1.5 0 1.5"), 1, 4096);
    s.options.settings.width = s.options.settings.height = 3;
    s.options.settings.integrator = Integrator::path;
    s.picture();
    s.move("T", {1.5f, 0, 1.5f});
    const Picture p = s.picture();
    constexpr int kSteps = 60, kTimes = 200;
    const auto shows = [&](double x, double y) {
        double sum = 0;
        for (int t = 0; t < kTimes; ++t)
            for (int i = 0; i < kSteps; ++i)
                for (int k = 0; k < kSteps; ++k) {
                    const Vec3d at(-1.5 + 3 * (t + .5) / kTimes + .4 * (2 * (i + .5) / kSteps - 1) - x,
                                   .4 * (2 * (k + .5) / kSteps - 1) - y, 1.5);
                    sum += std::pow(at.z / glm::length(at), 2) / glm::dot(at, at);
                }
        return sum * .64 / (kSteps * kSteps) / kTimes / kPi;
    };
    const double half = std::tan(.7854 / 2), third = 2 * half / 3;
    for (int x = 0; x < 3; ++x) {
        double expected = 0;  // over the pixel
        for (int i = 0; i < 3; ++i) expected += shows((x - 1 + (i - 1) / 3.0) * third, 0) / 3;
        EXPECT_NEAR(p.at(x, 1).r / expected, 1, .04) << x;
    }
}

// A transparent shape lets light through where it is; and glass on the way casts no shadow where it has been.
TEST(Shutter, ShadowsOfWhatIsClearMoveToo) {
    ShutterScene s("DirectionalLight { direction 1 0 -1 intensity 1 shadows TRUE } " + square(20, matte("1 1 1")) +
                       "DEF T Transform { translation -7 0 5 children " +
                       square(1, "material UnlitMaterial { emissiveColor 0 0 0 transparency .5 }") + "}",
                   1, 1024);
    const Picture lit = s.picture();
    s.move("T", {-4, 0, 5});
    const Picture p = s.picture();
    for (int x = 9; x < kShutterSide; ++x)
        EXPECT_NEAR(p.at(x, 16).r / lit.at(30, 16).r, 1 - .5 * fractionOfTime(x, 1, -2, 1), .02) << x;
}

TEST(Shutter, WhatRestsCostsNothingAndIsTheSamePicture) {
    const std::string ball =
        "DEF T Transform { children Shape { appearance Appearance { material Material { } } "
        "geometry Sphere { } } } PointLight { location 3 3 3 }";
    ShutterScene open(ball, 1, 4), closed(ball, 0, 4);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(open.picture().pixels, closed.picture().pixels) << i;
    // Nor does an eye that is given another shape by a layer's part of the picture.
    const std::string part =
        "LayerSet { activeLayer 1 order [1] layers [ Layer { viewport Viewport { clipBoundary [ 0 .5 "
        "0 1 ] } children [ Viewpoint { } " +
        ball + "] } ] }";
    ShutterScene halfOpen(part, 1, 4), halfClosed(part, 0, 4);
    for (int i = 0; i < 2; ++i) EXPECT_EQ(halfOpen.picture().pixels, halfClosed.picture().pixels) << i;
    // Nor does a thing that came since move.
    const NodeId more = open.scene.findName("T");
    ASSERT_TRUE(open.scene.set(more, x3d::Transform::children, Array<NodeId>()));
    EXPECT_EQ(open.picture().pixels[0], closed.picture().pixels[0]);
}

// The same picture whether the scene's thread makes it or another one from states; and by one thread or two.
TEST(Shutter, PicturesOfStatesAreTheSame) {
    const std::string body = "DEF T Transform { children " + square(1, matte(".8 .5 .2")) +
                             "} PointLight { location 1 2 5 } Transform { translation 0 0 -2 children " +
                             square(3, matte("1 1 1")) + "}";
    ShutterScene here(body, .7f, 16);
    here.options.settings.threads = 1;
    LightRenderer::Options options;
    options.image.settings = here.options.settings;
    options.image.settings.threads = 2;
    LightScene there(body, kShutterSide, kShutterSide, options);
    for (int i = 0; i < 3; ++i) {
        const Rotation turned{0, 1, 1, .4f * static_cast<float>(i)};
        for (LightScene* s : std::initializer_list<LightScene*>{&here, &there}) {
            ASSERT_TRUE(s->scene.set(s->node("T"), x3d::Transform::rotation, turned));
            s->scene.newFrame(i + 1);
        }
        const auto state = there.light->prepare();
        ASSERT_TRUE(state) << state.error().format();
        ASSERT_TRUE(there.light->renderFrame(**state));
        EXPECT_EQ(there.light->frame().pixels, here.picture().pixels) << i;
    }
}

// With an error to reach, two eyes, all around, and in linear light of an .exr: the closed form is the same.
TEST(Shutter, GoesWithTheOthers) {
    const std::string body = "DEF T Transform { translation -2 0 0 children " + square(1, unlit("1 1 1")) + "}";
    ShutterScene known(body, 1, 1 << 14);
    known.options.settings.error = .02f;
    known.picture();
    known.move("T", {1.5f, 0, 0});
    const Picture sampled = known.picture();
    ASSERT_FALSE(sampled.interval.empty());
    for (int x = 0; x < kShutterSide; ++x) EXPECT_NEAR(sampled.at(x, 16).r, fractionOfTime(x, 1, -2, 1.5), .05) << x;
    EXPECT_LT(known.stats.error, .025);

    // A resting shape beside it is as smooth as without a shutter: a pixel that it covers by a third shows a third.
    const double edge = columnAt(24) - kShutterHalf / kShutterSide + 2 * kShutterHalf / kShutterSide / 3;
    ShutterScene still("DEF T Transform { translation -2 3 0 children " + square(.5, unlit("1 1 1")) +
                           "} Transform { translation " + fmt::format("{} 0 0", edge - 1) + " children " +
                           square(1, unlit("1 1 1")) + "}",
                       1, 1 << 14);
    still.options.settings.error = .01f;
    still.picture();
    still.move("T", {1.5f, 3, 0});
    EXPECT_NEAR(still.picture().at(24, 16).r, 1. / 3, .015);

    ShutterScene eyes(body, 1, 512);
    eyes.options.stereo = Stereo::beside, eyes.options.focus = 20, eyes.options.eyeDistance = 1;
    eyes.picture();
    eyes.move("T", {1.5f, 0, 0});
    const Picture both = eyes.picture();
    ASSERT_EQ(both.width, 2 * kShutterSide);
    // Half way to the plane in which the eyes meet, half of their distance is left.
    for (int x = 0; x < kShutterSide; ++x) {
        EXPECT_NEAR(both.at(x, 16).r, fractionOfTime(x, 1, -1.75, 1.75), .02) << x;
        EXPECT_NEAR(both.at(kShutterSide + x, 16).r, fractionOfTime(x, 1, -2.25, 1.25), .02) << x;
    }

    ShutterScene around(
        "Viewpoint { position 0 0 0 } DEF T Transform { rotation 0 1 0 .8 children Transform { translation "
        "0 0 -5 children " +
            square(1, unlit("1 1 1")) + "} }",
        1, 512);
    around.options.panorama = true;
    around.picture();
    around.rotate("T", {0, 1, 0, -.8f});
    const Picture p = around.picture();
    const double width = std::atan(.2);
    for (int x = 0; x < kShutterSide; ++x) {
        const double longitude = ((x + .5) / kShutterSide - .5) * 2 * kPi;
        if (std::abs(longitude) < .8 - width - .1) {
            EXPECT_NEAR(p.at(x, 16).r, 2 * width / 1.6, .03) << x << ": it turns at an even rate, 5 m away";
        } else if (std::abs(longitude) > .8 + width + .1) {
            EXPECT_EQ(p.at(x, 16).r, 0) << x;
        }
    }
}

// In a layer over another what moves is blurred as ever, and the eye of the active one is the one that moves: the
// other layer's has a place of its own, of which nothing is known before.
TEST(Shutter, OfLayersTheActiveEyeMoves) {
    const std::string moves = "DEF T Transform { translation -2 0 0 children " + square(1, unlit("0 1 0")) + "}",
                      wall = "Transform { translation 40 0 -10 children " + square(40, unlit("1 0 0")) + "}";
    ShutterScene s("LayerSet { activeLayer 1 order [1 2] layers [ Layer { children [ DEF V Viewpoint { } " + wall +
                       "] } Layer { children [ DEF W Viewpoint { } " + moves + "] } ] }",
                   1, 1024);
    s.picture();
    s.move("T", {1.5f, 0, 0});
    ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewpoint::position, Vec3f(2, 0, 10)));
    ASSERT_TRUE(s.scene.set(s.node("W"), x3d::Viewpoint::position, Vec3f(1, 0, 10)));
    const Picture p = s.picture();
    for (int x = 0; x < kShutterSide; ++x) {
        double wallFraction = 0;
        for (int i = 0; i < 100; ++i) wallFraction += std::clamp(columnAt(x, (i + .5) / 100 - .5) + 1, 0.0, 1.0) / 100;
        const double green = fractionOfTime(x, 1, -3, .5);
        EXPECT_NEAR(p.at(x, 16).g, green, .015) << x;
        EXPECT_NEAR(p.at(x, 16).r, wallFraction * (1 - green), .02) << x << ": the layers are laid over each other";
    }
}

TEST(Shutter, SaysWhatItCannotDo) {
    ShutterScene s(square(1, unlit("1 1 1")), 1, 1);
    const auto one = s.light->picture(s.options);
    ASSERT_FALSE(one);
    EXPECT_NE(one.error().text.find("more than one sample"), std::string::npos);
    s.options.settings.samplesPerPixel = 4;
    for (const float wrong : {-.1f, 1.1f, std::nanf("")}) {
        s.options.settings.shutter = wrong;
        EXPECT_FALSE(s.light->picture(s.options)) << wrong;
    }
}

}  // namespace
}  // namespace rtsg
