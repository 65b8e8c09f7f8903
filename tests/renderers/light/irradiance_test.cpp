// Irradiance at places against form factors and closed rooms.
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/renderers/irradiance.h>

#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

struct Measured {
    LightScene s;
    LightTracer tracer;
    IrradianceSettings settings;
    explicit Measured(const std::string& body) : s(body) {
        s.world->add(tracer);
        settings.error = 0.004;
    }
    Irradiance at(const Vec3d& position, const Vec3d& normal) {
        const auto result = measureIrradiance(*tracer.latest(), s.world->rays(), position, normal, settings);
        EXPECT_TRUE(result);
        return result ? *result : Irradiance();
    }
};

/// Within the interval, widened to five standard errors, and `slack` for tessellation and rounding.
void expectIrradiance(const Irradiance& found, double expected, double slack = 1e-6) {
    EXPECT_TRUE(found.reached);
    EXPECT_NEAR(found.luminous, expected, 2.6 * found.luminousInterval + slack * expected);
    EXPECT_LE(found.luminousInterval, 0.004 * found.luminous);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(found.value[c], expected, 2.6 * found.interval[c] + slack * expected);
}

/// Shines downwards from `height` with radiance 1.
std::string above(double height, const std::string& geometry) {
    return fmt::format(
        "Transform {{ translation 0 {} 0 rotation 1 0 0 1.5707963267948966 children Shape {{ appearance Appearance {{ "
        "material Material {{ diffuseColor 0 0 0 emissiveColor 1 1 1 }} }} geometry {} }} }}\n",
        height, geometry);
}

// E = pi L F: of a disk R^2 / (R^2 + h^2), of a ball sin^2 of half its angle, of a square as reference tables have it.
TEST(Irradiance, IsThatOfFormFactors) {
    Measured disk(above(2, "Disk2D { outerRadius 1.5 solid FALSE }"));
    expectIrradiance(disk.at({0, 0, 0}, {0, 3, 0}), kPi * 1.5 * 1.5 / (1.5 * 1.5 + 4), 0.01);
    Measured ball(above(3, "Sphere { radius 1 }"));
    expectIrradiance(ball.at({0, 0, 0}, {0, 1, 0}), kPi / 9, 0.01);
    expectIrradiance(ball.at({0, 0, 0}, {0, 1, 1}), kPi / 9 * std::sqrt(.5), 0.01);
    Measured panel(above(1, "Rectangle2D { size 2 2 solid FALSE }"));
    expectIrradiance(panel.at({0, 0, 0}, {0, 1, 0}), kPi * .5541264);
    expectIrradiance(panel.at({1, 0, 1}, {0, 1, 0}), kPi * .2077571);
    const Irradiance below = panel.at({0, 0, 0}, {0, -1, 0});
    EXPECT_EQ(below.luminous, 0);
    EXPECT_TRUE(below.reached);
}

// A white sky gives pi to what faces anywhere, and half of that to a wall on a black floor; a small far lamp its
// inverse square; a light of intensity 1 head-on pi, whatever the headlight does.
TEST(Irradiance, IsThatOfSkyAndLights) {
    Measured sky("Background { skyColor 1 1 1 }");
    expectIrradiance(sky.at({1, 2, 3}, {.3, -.2, .7}), kPi);
    Measured half("Background { skyColor 1 1 1 } Transform { rotation 1 0 0 -1.5707963267948966 children " +
                  square(10000, matte("0 0 0")) + "}");
    expectIrradiance(half.at({0, 1, 0}, {1, 0, 0}), kPi / 2, 1e-3);
    Measured light("NavigationInfo { headlight TRUE } DirectionalLight { direction 0 -1 0 }");
    expectIrradiance(light.at({0, 0, 0}, {0, 1, 0}), kPi);
    EXPECT_EQ(light.at({0, 0, 0}, {0, 0, 1}).luminous, 0) << "the headlight shines along -z";
    Measured lamp("PointLight { location 0 2 0 attenuation 0 0 1 }");
    expectIrradiance(lamp.at({0, 0, 0}, {0, 1, 0}), kPi / 4);
    expectIrradiance(lamp.at({2, 0, 0}, {0, 1, 0}), kPi / 8 * std::sqrt(.5));
}

// In a closed ball with walls of albedo rho that glow, E = pi L with L = Le / (1 - rho).
TEST(Irradiance, CountsLightBetweenSurfaces) {
    const double srgb = double{srgbFromLinear(0.5f)};
    Measured ball(
        fmt::format("Shape {{ appearance Appearance {{ material Material {{ diffuseColor {0} {0} {0} emissiveColor "
                    "{0} {0} {0} }} }} geometry Sphere {{ radius 2 solid FALSE }} }}",
                    srgb));
    expectIrradiance(ball.at({.3, .2, -.4}, {1, 2, 3}), kPi, 1e-3);
}

// On a floor, exactly: the floor is below it. On the back of a thing: inside.
TEST(Irradiance, APlaceOnAWallIsBeforeIt) {
    Measured floor(
        "Background { skyColor 1 1 1 } Transform { translation 0 100 0 rotation 1 0 0 -1.5707963267948966 "
        "children " +
        square(10, matte("1 1 1")) + "}");
    expectIrradiance(floor.at({0, 100, 0}, {0, 1, 0}), kPi);
}

// The place is lifted by what floats are off and no more: not by metres far from the origin, nor past what is near.
TEST(Irradiance, IsRightFarAwayAndCloseBy) {
    for (const auto& [x, slack] : {std::pair{300., .001}, {4000., .002}, {100000., .015}}) {
        Measured panel(fmt::format("Transform {{ translation {} 0 0 children {} }}", x,
                                   above(1, "Rectangle2D { size 2 2 solid FALSE }")));
        SCOPED_TRACE(x);
        expectIrradiance(panel.at({x, 0, 0}, {0, 1, 0}), kPi * .5541264, slack);
    }
    for (const double small : {1e-2, 1e-3, 1e-4}) {
        Measured disk(above(small, fmt::format("Disk2D {{ outerRadius {} solid FALSE }}", small)));
        SCOPED_TRACE(small);
        expectIrradiance(disk.at({0, 0, 0}, {0, 1, 0}), kPi / 2, .015);
    }
}

TEST(Irradiance, IntervalsHoldTheTruthAsOftenAsTheySay) {
    Measured panel(above(1, "Rectangle2D { size 2 2 solid FALSE }"));
    panel.settings.error = 0.02;
    int inside = 0;
    for (int seed = 1; seed <= 200; ++seed) {
        panel.settings.seed = static_cast<std::uint64_t>(seed);
        const Irradiance found = panel.at({1, 0, 1}, {0, 1, 0});
        inside += std::abs(found.luminous - kPi * .2077571) <= found.luminousInterval;
    }
    EXPECT_GE(inside, 183);  // four standard deviations of 200 at .95
    EXPECT_LE(inside, 200);
}

TEST(Irradiance, IsTheSameForAnyNumberOfThreads) {
    Measured ball(above(3, "Sphere { radius 1 }"));
    ball.settings.threads = 1;
    const Irradiance one = ball.at({0, 0, 0}, {0, 1, 1});
    ball.settings.threads = 2;
    const Irradiance two = ball.at({0, 0, 0}, {0, 1, 1});
    EXPECT_EQ(one.value, two.value);
    EXPECT_EQ(one.interval, two.interval);
}

// Between two mirrors a metre apart and 300 m wide only what is within an angle of tangent .03 bounces 10,000 times.
TEST(Irradiance, SaysWhatIsCutOffBetweenMirrors) {
    Measured mirrors(
        fmt::format("Transform {{ rotation 1 0 0 1.5707963267949 children [ {0} Transform {{ translation 0 0 -1 "
                    "children {0} }} ] }}",
                    square(300, mirror("1"))));
    mirrors.settings.samples = 16'384;
    const Irradiance found = mirrors.at({0, .5, 0}, {0, 1, 0});
    EXPECT_GT(found.missing, 2e-4);
    EXPECT_LT(found.missing, 4e-3);
    Measured open(above(1, "Rectangle2D { size 2 2 solid FALSE }"));
    EXPECT_EQ(open.at({0, 0, 0}, {0, 1, 0}).missing, 0);
}

TEST(Irradiance, LightsOfGroupsAndLayersAreListed) {
    Measured some(R"(
        DirectionalLight { direction 0 -1 0 }
        Group { children [ DEF INSIDE DirectionalLight { direction 0 -1 0 } Shape { geometry Box { } } ] }
        Group { children [ DEF OFF PointLight { global FALSE on FALSE } DEF GLOBAL PointLight { location 0 9 0 } ] })");
    EXPECT_EQ(lightsLeftOut(*some.tracer.latest()), std::vector{some.s.node("INSIDE")});
    Measured layered(R"(LayerSet { order [0 1] layers Layer { children DEF LAMP PointLight { } } })");
    EXPECT_EQ(lightsLeftOut(*layered.tracer.latest()), std::vector{layered.s.node("LAMP")});
}

TEST(Irradiance, EndsWhereItMustAndRefusesWhatIsNoPlace) {
    Measured ball(above(3, "Sphere { radius 1 }"));
    ball.settings.error = 1e-9, ball.settings.samples = 20'000;
    const Irradiance few = ball.at({0, 0, 0}, {0, 1, 0});
    EXPECT_FALSE(few.reached);
    EXPECT_LE(few.samples, 20'000u);
    EXPECT_GT(few.samples, 1000u);
    const auto state = ball.tracer.latest();
    const RayView& rays = ball.s.world->rays();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(measureIrradiance(*state, rays, {0, 0, 0}, {0, 0, 0}));
    EXPECT_FALSE(measureIrradiance(*state, rays, {0, nan, 0}, {0, 1, 0}));
    EXPECT_FALSE(measureIrradiance(*state, rays, {0, 0, 0}, {0, nan, 0}));
    IrradianceSettings none;
    none.error = 0;
    EXPECT_FALSE(measureIrradiance(*state, rays, {0, 0, 0}, {0, 1, 0}, none));
}

}  // namespace
}  // namespace rtsg
