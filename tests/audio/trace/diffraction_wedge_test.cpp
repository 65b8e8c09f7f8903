// Sound round edges against the exact solution of the half plane, and across the boundaries of light and shadow.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "walled.h"

namespace rtsg {
namespace {

using namespace test;

WedgePath pathTo(double degrees, double opening = 2 * M_PI) {
    WedgePath path;
    path.opening = opening;
    path.sourceRadius = 3;
    path.receiverRadius = 2;
    path.along = 1;
    path.sourceAngle = M_PI / 3;
    path.receiverAngle = degrees * M_PI / 180;
    return path;
}

/// dB re the free field.
double level(const WedgePath& path, double hz) {
    const double distance =
        std::sqrt(9 + 4 - 12 * std::cos(path.receiverAngle - path.sourceAngle) + path.along * path.along);
    return 20 * std::log10(std::abs(wedgeField(path, 2 * M_PI * hz / 343).total()) * distance);
}

/// Degrees; dB re the free field at 125, 500, 2,000 and 8,000 Hz: Macdonald's solution, computed apart from this.
constexpr double kHalfPlaneLevels[][5] = {{90, 2.21, -3.14, -.15, 2.39},         {150, -1.09, .74, .45, .05},
                                          {200, -.60, .59, -.02, .03},           {235, -3.70, -3.96, -3.07, -.84},
                                          {245, -4.80, -6.33, -8.11, -10.87},    {270, -7.59, -11.62, -16.93, -22.85},
                                          {300, -10.70, -16.03, -21.95, -27.97}, {340, -14.47, -20.24, -26.24, -32.26}};

TEST(Wedge, TheHalfPlaneHasTheLevelsOfTheExactSolution) {
    for (const auto& row : kHalfPlaneLevels)
        for (int i = 0; i < 4; ++i)
            EXPECT_NEAR(level(pathTo(row[0]), 125 * std::pow(4.0, i)), row[i + 1], .1) << row[0] << "°, " << i;
}

TEST(Wedge, IsContinuousAcrossShadowAndReflection) {
    for (const double opening : {2 * M_PI, 1.5 * M_PI, 1.2 * M_PI})
        for (const double hz : {63.0, 1000.0, 8000.0})
            for (const double boundary : {120.0, 240.0})
                for (const double step : {1e-3, 1e-6, 1e-8, 0.0}) {
                    if (boundary * M_PI / 180 > opening - .01) continue;
                    const auto before = wedgeField(pathTo(boundary - step, opening), 2 * M_PI * hz / 343);
                    const auto after = wedgeField(pathTo(boundary + step, opening), 2 * M_PI * hz / 343);
                    const double tolerance = 1e-5 + 2 * step * std::sqrt(hz);
                    EXPECT_NEAR(std::abs(before.total() - after.total()), 0, tolerance) << boundary << ' ' << step;
                    EXPECT_NEAR(std::abs(before.direct + before.besideDirect - after.direct - after.besideDirect), 0,
                                tolerance);
                }
    // At the very boundary of the shadow half the pressure is left.
    const auto edge = wedgeField(pathTo(240), 2 * M_PI * 4000 / 343);
    EXPECT_NEAR(std::abs(edge.direct + edge.besideDirect) * std::sqrt(26.0), .5, .01);
}

TEST(Wedge, IsTheSameSeenFromTheOtherFaceAndTheOtherEnd) {
    for (const double opening : {2 * M_PI, 1.5 * M_PI, 1.25 * M_PI})
        for (const double degrees : {10.0, 100.0, 170.0, 215.0}) {
            const WedgePath path = pathTo(degrees, opening);
            WedgePath mirrored = path, back = path;
            mirrored.sourceAngle = opening - path.sourceAngle;
            mirrored.receiverAngle = opening - path.receiverAngle;
            std::swap(back.sourceAngle, back.receiverAngle);
            std::swap(back.sourceRadius, back.receiverRadius);
            const auto field = wedgeField(path, 20).total();
            EXPECT_NEAR(std::abs(wedgeField(mirrored, 20).total() - field), 0, 1e-9) << degrees;
            EXPECT_NEAR(std::abs(wedgeField(back, 20).total() - field), 0, 1e-9) << degrees;
        }
}

TEST(Wedge, AFlatWallIsAMirrorAndNoMore) {
    const WedgePath path = pathTo(100, M_PI);
    const auto field = wedgeField(path, 30);
    EXPECT_NEAR(std::abs(field.besideDirect), 0, 1e-12);
    EXPECT_NEAR(std::abs(field.besideMirrored), 0, 1e-12);
    EXPECT_GT(std::abs(field.mirrored), .1);
}

TEST(Wedge, TheTransitionFunctionIsFresnels) {
    // By its integral, in steps, from a start where the asymptotic series is exact to 1e-8.
    for (const double x : {1e-4, .01, .3, 1.0, 3.0, 6.2, 6.3, 10.0, 40.0, 63.9, 64.1, 300.0}) {
        const double from = std::sqrt(x), to = 60;
        const int steps = 1'000'000;
        std::complex<double> integral;
        for (int i = 0; i < steps; ++i) {
            const double t = from + (to - from) * (i + .5) / steps;
            integral += std::polar((to - from) / steps, -t * t);
        }
        // The rest: exp(-i t^2) / (2 i t) (1 - 1 / (2 i t^2)).
        const std::complex<double> i(0, 1);
        integral += std::polar(1.0, -to * to) / (2.0 * i * to) * (1.0 - 1.0 / (2.0 * i * to * to));
        const auto expected = 2.0 * i * std::sqrt(x) * std::polar(1.0, x) * integral;
        EXPECT_NEAR(std::abs(diffractionTransition(x) - expected), 0, 1e-6) << x;
    }
    EXPECT_EQ(diffractionTransition(0), 0.0);
}

/// A half plane y = 0, x > 0, so large that its other edges are far; the edge is the z axis.
Walled halfPlane() {
    const double far = 200;
    return Walled({{0, 0, -far}, {far, 0, -far}, {far, 0, far}, {0, 0, far}}, {0, 1, 2, 0, 2, 3});
}
TEST(Edges, BehindAHalfPlaneSoundArrivesByWayOfTheEdge) {
    const Walled wall = halfPlane();
    EXPECT_EQ(wall.edges(), 4);
    const glm::dvec3 source = about(3, 60, 0);
    for (const double degrees : {245.0, 270.0, 300.0, 340.0}) {
        const std::vector<Arrival> arrivals = wall.arrivals(source, about(2, degrees, 1));
        ASSERT_EQ(arrivals.size(), 1u) << degrees;
        EXPECT_NEAR(arrivals[0].seconds * 343, std::sqrt(26.0), 1e-6);
        EXPECT_NEAR(glm::distance(arrivals[0].direction, glm::normalize(glm::dvec3(0, 0, .6) - about(2, degrees, 1))),
                    0, 1e-6);
        for (std::size_t b = 1; b < kBandCount; b += 2) {
            // The octave's mean of what Wedge.TheHalfPlaneHasTheLevelsOfTheExactSolution compares.
            double mean = 0;
            for (int i = 0; i < 101; ++i)
                mean +=
                    std::norm(wedgeField(pathTo(degrees),
                                         2 * M_PI * 1000 * std::pow(2.0, double(b) - kBand1k + (i - 50) / 100.0) / 343)
                                  .total()) /
                    101;
            EXPECT_NEAR(10 * std::log10(4 * M_PI * arrivals[0].energy[b] / mean), 0, .1) << degrees << ' ' << b;
        }
        EXPECT_TRUE(wall.arrivals(source, about(2, degrees, 1), 0).empty());
    }
}

TEST(Edges, EnergyIsContinuousFromLightToShadowAndRoundTheImage) {
    const Walled wall = halfPlane();
    const glm::dvec3 source = about(3, 60, 0);
    const auto at = [&](double degrees) { return total(wall.arrivals(source, about(2, degrees, 1))); };
    for (const double boundary : {120.0, 240.0}) {
        // Images are looked for from some tenths of a millimetre aside.
        const Bands before = at(boundary - .03), after = at(boundary + .03);
        for (std::size_t b = 0; b < kBandCount; ++b)
            EXPECT_NEAR(10 * std::log10(before[b] / after[b]), 0, .1) << boundary << ' ' << b;
        // Without edges it is a step.
        const Bands lit = total(wall.arrivals(source, about(2, boundary - .1, 1), 0));
        const Bands dark = total(wall.arrivals(source, about(2, boundary + .1, 1), 0));
        EXPECT_GT(lit[kBand1k], 1.2 * dark[kBand1k]);
    }
    // No steps anywhere else.
    Bands last = at(10);
    for (double degrees = 10.5; degrees < 350; degrees += .5) {
        const Bands now = at(degrees);
        for (std::size_t b = 0; b < kBand1k; ++b)
            ASSERT_NEAR(10 * std::log10(now[b] / last[b]), 0, .5) << degrees << ' ' << b;
        last = now;
    }
}

TEST(Edges, WhatIsHeardHasTheLevelsOfTheExactSolution) {
    const Walled wall = halfPlane();
    const glm::dvec3 source = about(3, 60, 0);
    for (const auto& row : kHalfPlaneLevels)
        for (int i = 0; i < 4; ++i) {
            const glm::dvec3 listener = about(2, row[0], 1);
            EXPECT_NEAR(heardAt(wall.traced(source, listener), 125 * std::pow(4.0, i), glm::distance(source, listener)),
                        row[i + 1], .05)
                << row[0] << "°, " << i;
        }
}

TEST(Edges, WhatIsHeardIsContinuousWhereTheImageEndsAndInTheShadow) {
    const Walled wall = halfPlane();
    const glm::dvec3 source = about(3, 60, 0);
    const auto at = [&](double degrees, double hz) {
        const glm::dvec3 listener = about(2, degrees, 1);
        return heardAt(wall.traced(source, listener), hz, glm::distance(source, listener));
    };
    // From centimetres to far less than images are looked for aside.
    for (const double boundary : {120.0, 240.0})
        for (const double step : {.1, .03, .01, 1e-3, 1e-4, 1e-6, 0.0})
            for (const double hz : {125., 500., 2000., 8000.})
                for (const double degrees : {boundary - step, boundary + step})
                    EXPECT_NEAR(at(degrees, hz), level(pathTo(degrees), hz), .05) << degrees << ' ' << hz;
}

TEST(Edges, EveryChannelHasTheirWaves) {
    const Walled wall = halfPlane();
    const glm::dvec3 source = about(3, 60, 0), listener = about(2, 300, 1);
    const TraceResult traced = wall.traced(source, listener);
    ASSERT_EQ(traced.edges.waves.size(), 1u);
    const glm::dvec3 from = traced.edges.waves[0].direction;
    const double distance = glm::distance(source, listener), expected = level(pathTo(300), 500);
    ImpulseResponseOptions options;
    options.channels = ImpulseResponseOptions::Channels::stereo;
    for (const double side : {-1.0, 1.0}) {
        options.listenerRight = side * from;
        options.listenerBack = glm::normalize(glm::cross(options.listenerRight, glm::dvec3(0, 0, 1)));
        options.listenerUp = glm::cross(options.listenerBack, options.listenerRight);
        for (std::size_t c = 0; c < 2; ++c)
            EXPECT_NEAR(heardAt(traced, 500, distance, options, c),
                        expected + 20 * std::log10(stereoGains({side, 0, 0})[c]), .05);
    }
    // The first channels of ambisonics, SN3D: pressure, and the same times the cosine along each axis.
    options = {};
    options.channels = ImpulseResponseOptions::Channels::ambisonic;
    EXPECT_NEAR(heardAt(traced, 500, distance, options, 0), expected, .05);
    EXPECT_NEAR(heardAt(traced, 500, distance, options, 3), expected + 20 * std::log10(std::abs(from.z)), .1);
    // The ears of a sphere differ by what they do for a pulse from there.
    options = {};
    options.channels = ImpulseResponseOptions::Channels::binaural;
    options.listenerRight = from;
    const ImpulseResponse response = makeImpulseResponse(traced.echogram(), options);
    const auto peak = [&](std::size_t c) {
        const auto& samples = response.channels[c];
        return std::distance(samples.begin(), std::ranges::max_element(samples));
    };
    EXPECT_NEAR(static_cast<double>(peak(0) - peak(1)), (1 + M_PI / 2) * options.headRadius / 343 * 48000, 1.5);
}

TEST(Edges, AirAndPatternWeakenTheirWaves) {
    const Walled wall = halfPlane();
    const glm::dvec3 source = about(3, 60, 0), listener = about(2, 300, 1);
    TraceOptions options;
    options.rays = 2;
    options.imageOrder = 1;
    options.maxSeconds = .5;
    options.air.speedOfSound = 343;
    options.pattern = [](const glm::dvec3&) { return .25; };
    const TraceResult weak = AcousticTracer(wall.geometry).trace(source, listener, options);
    const double distance = glm::distance(source, listener), pathLength = std::sqrt(26.0);
    for (const double hz : {1000., 8000., 16000.}) {
        const auto band = static_cast<std::size_t>(std::lround(std::log2(hz / 1000))) + kBand1k;
        EXPECT_NEAR(heardAt(weak, hz, distance) - heardAt(wall.traced(source, listener), hz, distance),
                    10 * std::log10(.25) - 10 * std::log10(M_E) * airAttenuation(options.air)[band] * pathLength, .02)
            << hz;
    }
}

TEST(Edges, AreThoseRoundWhichSoundBends) {
    const std::vector<glm::dvec3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                          {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
    const std::vector<std::uint32_t> box{0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                         2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    WorldFromLocal large(4.0);
    large[3] = {-2, -2, -2};
    const Walled room(corners, box, 0, {large});
    EXPECT_EQ(room.edges(), 12);  // and not the diagonals
    // Within a box no edge is convex; from outside one sees round it.
    EXPECT_EQ(room.arrivals({-1, .2, .3}, {1, .4, -.3}).size(), room.arrivals({-1, .2, .3}, {1, .4, -.3}, 0).size());
    // Straight on come waves alone that are longer than it is.
    const auto bent = [&](int order) {
        std::vector<Arrival> arrivals = room.arrivals({-3, 0, 0}, {0, 3, 0}, order);
        std::erase_if(arrivals, [](const Arrival& one) { return one.seconds * 343 < std::hypot(3.0, 3.0) + 1e-6; });
        return arrivals;
    };
    const double byEdge = 2 * std::hypot(1.0, 2.0);
    for (const int order : {1, 2}) {
        const std::vector<Arrival> round = bent(order);
        ASSERT_FALSE(round.empty());
        EXPECT_EQ(round[0].order, 1u);
        EXPECT_NEAR(round[0].seconds * 343, byEdge, 1e-6);
        // By its ends, over its sides, and by other faces it comes later.
        for (std::size_t i = 1; i < round.size(); ++i) {
            EXPECT_GT(round[i].seconds * 343, byEdge + .1);
            EXPECT_LT(round[i].energy[kBand1k], .3 * round[0].energy[kBand1k]);
        }
    }
    const auto isTwice = [](const Arrival& one) { return one.order > 1; };
    EXPECT_TRUE(std::ranges::none_of(bent(1), isTwice));
    EXPECT_TRUE(std::ranges::any_of(bent(2), isTwice));
    // Opposite sides: no single edge is seen from both.
    for (const Arrival& low : room.arrivals({-5, .1, 0}, {5, 0, 0}, 1)) {
        EXPECT_LT(low.energy[kBand1k], 1e-9) << "but of waves as long as it";
    }
    // The mirror image by a wall that absorbs half: so does what goes round the edge.
    const Walled dull({{0, 0, -200}, {200, 0, -200}, {200, 0, 200}, {0, 0, 200}}, {0, 1, 2, 0, 2, 3}, 1);
    const auto dark = dull.arrivals(about(3, 60, 0), about(2, 300, 1));
    ASSERT_EQ(dark.size(), 1u);
    EXPECT_NEAR(4 * M_PI * dark[0].energy[kBand1k + 3],
                std::norm(wedgeField(pathTo(300), 2 * M_PI * 8000 / 343).besideDirect),
                .1 * 4 * M_PI * dark[0].energy[kBand1k + 3]);
}

TEST(Edges, OfTwoWallsThatMeetOrLieInOnePlaceAreOne) {
    const double far = 200;
    const std::vector<glm::dvec3> corners{{0, 0, -far}, {far, 0, -far}, {far, 0, far}, {0, 0, far}};
    const std::vector<std::uint32_t> quad{0, 1, 2, 0, 2, 3};
    WorldFromLocal down(1.0);  // turned by 270 degrees about the edge
    down[0] = {0, -1, 0};
    down[1] = {1, 0, 0};
    const Walled corner(corners, quad, 0, {WorldFromLocal(1.0), down});
    EXPECT_EQ(corner.edges(), 7);
    const Walled one({{0, 0, -far}, {far, 0, -far}, {far, 0, far}, {0, 0, far}, {0, -far, -far}, {0, -far, far}},
                     {0, 1, 2, 0, 2, 3, 0, 4, 5, 0, 5, 3});
    const Walled twice(corners, quad, 0, {WorldFromLocal(1.0), WorldFromLocal(1.0)}), once(corners, quad);
    EXPECT_EQ(twice.edges(), 4);
    const glm::dvec3 source = about(3, 60, 0);
    for (const double degrees : {150.0, 200.0, 235.0, 250.0}) {
        const glm::dvec3 listener = about(2, degrees, 1);
        const double distance = glm::distance(source, listener);
        for (const double hz : {125.0, 1000.0}) {
            // Earlier, two walls had no sound in the shadow, and a doubled wall had 6 dB too much.
            EXPECT_NEAR(heardAt(corner.traced(source, listener), hz, distance),
                        heardAt(one.traced(source, listener), hz, distance), .01)
                << degrees;
            EXPECT_NEAR(heardAt(twice.traced(source, listener), hz, distance),
                        heardAt(once.traced(source, listener), hz, distance), .01)
                << degrees;
        }
    }
}

TEST(Edges, SeamsOfWallsAreNone) {
    // Two plates side by side, not of one piece: nothing comes through between them, nothing is taken from the image.
    const double far = 200;
    const std::vector<glm::dvec3> corners{{0, 0, -far}, {far, 0, -far},  {far, 0, far},  {0, 0, far},
                                          {0, 0, -far}, {-far, 0, -far}, {-far, 0, 150}, {0, 0, 150}};
    const Walled wall(corners, {0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6});
    EXPECT_EQ(wall.edges(), 7);  // both go on in each other at one end
    EXPECT_TRUE(wall.arrivals(about(3, 60, 0), about(2, 300, 1)).empty());
    const auto with = wall.arrivals(about(3, 60, 0), about(2, 119, 1));
    const auto without = wall.arrivals(about(3, 60, 0), about(2, 119, 1), 0);
    ASSERT_EQ(with.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(with[i].energy, without[i].energy);
}

}  // namespace
}  // namespace rtsg
