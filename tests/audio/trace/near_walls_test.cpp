// Scattering to a listener by walls within centimetres: against an integral, the law of a lossless room, and the same
// paths in reverse.
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/audio/acoustic_tracer.h>

#include "audio/trace/scattered.h"
#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"
#include "rays/near_walls.h"
#include "walls/even_direction.h"

namespace rtsg {
namespace {

using test::fromPlaneBelow;
using test::scatteredEnergy;
using test::Shoebox;
using test::shortTrace;
using test::TriangleGeometry;

TriangleGeometry planeOf(double absorption, double scattering) {
    TriangleGeometry plane;
    plane.addQuad({-300, -300, 0}, {300, -300, 0}, {300, 300, 0}, {-300, 300, 0},
                  plane.addMaterial(absorption, scattering));
    plane.finish();
    return plane;
}

TEST(NearWalls, ADiffusePlaneSendsWhatTheIntegralSaysFromAnyHeight) {
    const TriangleGeometry plane = planeOf(.2, 1);
    for (const double height : {0., 1e-4, .001, .01, .03, .06, .09, .11, .2}) {
        const double exact = fromPlaneBelow(.2, 2, std::max(height, 1e-6));
        constexpr int kRuns = 40;
        double sum = 0, squares = 0;
        for (int run = 0; run < kRuns; ++run) {
            const double late =
                scatteredEnergy(AcousticTracer(plane).trace({0, 0, 2}, {0, 0, height}, shortTrace(4000, 1 + run, 2)));
            sum += late / kRuns, squares += late * late / kRuns;
        }
        const double error = std::sqrt(std::max(0.0, squares - sum * sum) / (kRuns - 1));
        EXPECT_NEAR(sum, exact, 4 * error + .004 * exact) << height;
        // On the wall there is next to no chance in it.
        if (height < .002) {
            EXPECT_LT(error, .002 * exact) << height;
        }
    }
}

/// For direct sound, and for mirror images of any order. If both are on the wall, the result was 118 dB before.
TEST(NearWalls, NearerThanACentimetreWhatWallsScatterHasTheLevelOfOne) {
    const TriangleGeometry plane = planeOf(.1, .5);
    for (const double height : {0., 1e-6, 1e-4, 1e-3})
        for (const double apart : {0., 1e-5, 1e-3}) {
            const TraceResult traced =
                AcousticTracer(plane).trace({0, 0, height}, {apart, 0, height}, shortTrace(4000, 1, 2));
            const double direct = 1 / (4 * M_PI * 1e-4);
            EXPECT_LT(scatteredEnergy(traced), direct) << height << ' ' << apart;
            ASSERT_EQ(traced.arrivals.size(), 2u);
            for (const Arrival& arrival : traced.arrivals) EXPECT_LE(arrival.energy[kBand1k], direct * (1 + 1e-9));
        }
    // From there on it is the integral's.
    const double exact = fromPlaneBelow(.1, .02, .02) * .5;
    EXPECT_NEAR(scatteredEnergy(AcousticTracer(plane).trace({0, 0, .02}, {0, 0, .02}, shortTrace(40'000, 1, 2))), exact,
                .03 * exact);
}

/// A listener on a wall sees it in half of all directions, however the wall lies.
TEST(NearWalls, OfAWallThatIsTouchedHalfOfAllDirectionsCount) {
    for (int i = -3; i < 40; ++i) {
        const glm::dvec3 normal = i < 0 ? glm::dvec3(i == -1, i == -2, i == -3) : evenDirection(i, 40);
        const glm::dvec3 one = glm::normalize(glm::cross(normal, glm::dvec3(.3, .9, .1))) * 300.0,
                         other = glm::cross(normal, one), away = normal * 4e-6;
        TriangleGeometry plane;
        plane.addQuad(-one - other, one - other, one + other, other - one, plane.addMaterial(.2, 1));
        plane.finish();
        const trace::BandClasses classes = trace::bandClasses(plane.materials());
        for (const double distance : {2.0, .11}) {
            const trace::NearWalls near(plane, classes, normal * distance, away);
            double fraction = 0;
            near.echo(normal, [&](double, const Bands& fractions) { fraction += fractions[0]; });
            EXPECT_NEAR(fraction, 2 * .8, 1e-9) << i << ' ' << distance;
        }
    }
}

/// One of the rays that look for walls, or another, is nearly parallel to it and meets it 50 m away: the spot that
/// counts ends at the reach. See TheirEchoComesAsMuchLaterAsItsWayIsLonger.
TEST(NearWalls, AFlatRayToAWallThatIsTouchedIsNoLongerThanTheSpot) {
    constexpr double kOff = 4e-6, kReach = .1;
    const glm::dmat3 rotation({.36, .48, -.8}, {-.8, .6, 0}, {.48, .64, .6});
    for (const int ray : {0, 100, 1000, 2000}) {
        const glm::dvec3 flat = rotation * evenDirection(ray, 4096);
        const glm::dvec3 normal =
            glm::normalize(glm::normalize(glm::cross(flat, glm::dvec3(.3, .9, .1))) - kOff / 50 * flat);
        const glm::dvec3 one = glm::normalize(glm::cross(normal, glm::dvec3(.3, .9, .1))) * 300.0,
                         other = glm::cross(normal, one);
        TriangleGeometry plane;
        plane.addQuad(-one - other, one - other, one + other, other - one, plane.addMaterial(.2, 1));
        plane.finish();
        const trace::NearWalls near(plane, trace::bandClasses(plane.materials()), normal * 2.0, normal * kOff);
        int walls = 0;
        near.echo(normal, [&](double later, const Bands&) {
            ++walls;
            // To some rays of two thousand.
            EXPECT_NEAR(later, kOff * std::log(kReach / kOff) + kOff, 3 * kReach / 2048) << ray;
        });
        EXPECT_EQ(walls, 1) << ray;
    }
}

/// Where no wall takes anything away the field is the same in every place and from all sides, so that what comes from
/// the open part of the sphere and its echo are together what the whole sphere would send.
TEST(NearWalls, InALosslessRoomNoCornerIsQuieterThanTheMiddle) {
    constexpr int kDirections = 20'000;
    const glm::dvec3 source(3, 2.5, 1.5);
    for (const double scattering : {1., .6, .2})
        for (const glm::dvec3& listener :
             {glm::dvec3(1e-5, 2.5, 1.5), glm::dvec3(1e-5, 1e-5, 1.5), glm::dvec3(1e-5, 1e-5, 1e-5)}) {
            TriangleGeometry room;
            const std::uint32_t wall = room.addMaterial(0, scattering);
            room.addBox({0, 0, 0}, {6, 5, 3}, {wall, wall, wall, wall, wall, wall});
            room.finish();
            const trace::BandClasses classes = trace::bandClasses(room.materials());
            const trace::NearWalls near(room, classes, source, listener);
            ASSERT_DOUBLE_EQ(near.reach(), .1);
            double heard = 0;
            for (int i = 0; i < kDirections; ++i) {
                glm::dvec3 from = evenDirection(i, kDirections);
                double left = 1;  // what comes by way of the mirrors right here, as arrivals of their own
                for (int axis = 0; axis < 3; ++axis)
                    if (listener[axis] < .1 && from[axis] < 0) left *= 1 - scattering;
                heard += left / kDirections;
                near.echo(from, [&](double later, const Bands& fractions) {
                    EXPECT_GE(later, 0);
                    EXPECT_LT(later, .2);
                    heard += left * fractions[0] / kDirections;
                });
            }
            EXPECT_NEAR(heard, 1, .01) << scattering << ", " << glm::length(listener);
        }
}

/// For a spot that is seen under angles up to acos(d / r), the mean distance is d ln(r / d) / (1 - d / r). Sound that
/// continues straight travels that much farther, plus the height.
TEST(NearWalls, TheirEchoComesAsMuchLaterAsItsWayIsLonger) {
    const TriangleGeometry plane = planeOf(.2, 1);
    const trace::BandClasses classes = trace::bandClasses(plane.materials());
    for (const double height : {.02, .05}) {
        const trace::NearWalls near(plane, classes, {0, 0, 2}, {0, 0, height});
        int walls = 0;
        near.echo({0, 0, 1}, [&](double later, const Bands& fractions) {
            ++walls;
            EXPECT_NEAR(later, height * std::log(.1 / height) / (1 - height / .1) + height, 5e-4) << height;
            EXPECT_NEAR(fractions[0], 2 * .8 * (1 - height / .1), .004) << height;
        });
        EXPECT_EQ(walls, 1);
        near.echo({0, 0, -1}, [](double, const Bands&) { ADD_FAILURE() << "from behind the wall"; });
    }
}

TEST(NearWalls, WhatIsFarMirrorsOrIsNextToTheSourceIsLeftToRays) {
    const TriangleGeometry scatters = planeOf(.2, 1), mirrors = planeOf(.2, 0);
    const trace::BandClasses classes = trace::bandClasses(scatters.materials());
    const auto reach = [&](const TriangleGeometry& plane, const glm::dvec3& source, double height) {
        return trace::NearWalls(plane, classes, source, {0, 0, height}).reach();
    };
    EXPECT_EQ(reach(scatters, {0, 0, 2}, .099), .1);
    EXPECT_EQ(reach(scatters, {0, 0, 2}, .101), 0);
    EXPECT_EQ(reach(mirrors, {0, 0, 2}, .01), 0);
    EXPECT_NEAR(reach(scatters, {.1, 0, .01}, .01), .02, 1e-12);
    EXPECT_EQ(reach(scatters, {0, 0, .01}, .01), 0);
}

/// Paths are the same the other way round, and a source on a wall has nothing to do with any of this.
TEST(NearWalls, AtWallsEdgesAndCornersItIsHeardAsTheOtherWayRound) {
    const TriangleGeometry room = Shoebox::uniform({6, 5, 3}, .1, .5).geometry();
    const glm::dvec3 positions[] = {{6, 3, 1.5}, {5.99, 3, 1.5}, {6, 3, 0}, {6, 5, 3}, {5.99, 4.99, 2.99}};
    TraceOptions options;
    options.rays = 8000;
    options.air.absorbs = false;
    const auto together = AcousticTracer(room).trace(test::kSource, positions, options);
    for (std::size_t i = 0; i < std::size(positions); ++i) {
        const MetricsEstimate alone = AcousticTracer(room).trace(test::kSource, positions[i], options).metrics(),
                              back = AcousticTracer(room).trace(positions[i], test::kSource, options).metrics(),
                              shared = together[i].metrics();
        for (const MetricsEstimate* there : {&alone, &shared}) {
            const double error = std::hypot(there->ci95.g[kBand1k], back.ci95.g[kBand1k]) / 2;
            EXPECT_NEAR(there->value.g[kBand1k], back.value.g[kBand1k], 4 * error + .03)
                << i << (there == &shared ? ", with others" : "");
            EXPECT_LT(there->ci95.g[kBand1k], .7) << i;
        }
    }
}

}  // namespace
}  // namespace rtsg
