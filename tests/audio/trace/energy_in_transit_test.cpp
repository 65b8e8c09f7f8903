// Energy under way, and rays that are split by it, against rays that are neither split nor played for.
#include <cmath>
#include <random>
#include <utility>

#include <gtest/gtest.h>

#include <rtsg/renderers/parallel_for.h>

#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"
#include "rays/energy_in_transit.h"

namespace rtsg {
namespace {

using namespace test;

/// Late sound is that between two walls, of one ray in some hundred.
Shoebox liveFloor() {
    Shoebox box = Shoebox::uniform({6, 5, 3}, .6, .3);
    box.absorption[4] = box.absorption[5] = .1;
    return box;
}

/// Mean energy of rays in a box after some metres, by following each to there; what goes towards the last wall escapes
/// if that is open.
double followed(const Shoebox& box, double metres, int rays, double& escaped, bool open = false) {
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform;
    double sum = 0;
    escaped = 0;
    for (int ray = 0; ray < rays; ++ray) {
        const double up = 2 * uniform(random) - 1, round = 2 * M_PI * uniform(random), across = std::sqrt(1 - up * up);
        glm::dvec3 at = kSource, path(across * std::cos(round), across * std::sin(round), up);
        double energy = 1, left = metres;
        for (;;) {
            double nearest = 1e9;
            int axis = 0;
            for (int a = 0; a < 3; ++a) {
                const double distance = ((path[a] > 0 ? box.size[a] : 0) - at[a]) / path[a];
                if (path[a] != 0 && distance < nearest) nearest = distance, axis = a;
            }
            const int wall = 2 * axis + (path[axis] > 0 ? 1 : 0);
            if (open && wall == 5) {
                escaped += std::exchange(energy, 0) / rays;
                break;
            }
            if (nearest > left) break;
            left -= nearest;
            at += path * nearest;
            at[axis] = path[axis] > 0 ? box.size[axis] : 0;
            energy *= 1 - box.absorption[static_cast<std::size_t>(wall)];
            if (uniform(random) >= box.scattering) {
                path[axis] = -path[axis];
                continue;
            }
            const double square = uniform(random), rotation = 2 * M_PI * uniform(random);
            glm::dvec3 out;
            out[axis] = std::sqrt(1 - square) * (path[axis] > 0 ? -1 : 1);
            out[(axis + 1) % 3] = std::sqrt(square) * std::cos(rotation);
            out[(axis + 2) % 3] = std::sqrt(square) * std::sin(rotation);
            path = out;
        }
        sum += energy / rays;
    }
    return sum;
}

TEST(EnergyInTransit, IsInTheMeanWhatRaysHaveThatAreFollowedOneByOne) {
    const Shoebox box = liveFloor();
    const TriangleGeometry room = box.geometry();
    const trace::BandClasses classes = trace::bandClasses(room.materials());
    // Middles of steps of 80 m / 64.
    for (const double metres : {8.125, 20.625, 40.625}) {
        double mean = 0, escaped = 0;
        constexpr int kRuns = 400;
        for (int seed = 0; seed < kRuns; ++seed) {
            TraceOptions options;
            options.seed = static_cast<std::uint64_t>(seed);
            mean += trace::EnergyInTransit(room, classes, kSource, options, 80).at(metres) / kRuns;
        }
        // Below 3e-3 as the root; the mean of roots is a little less than the root of the mean.
        const double energy = followed(box, metres, 1'000'000, escaped);
        EXPECT_NEAR(mean / (energy < 3e-3 ? std::sqrt(energy * 3e-3) : energy), 1, .05) << metres << ' ' << energy;
    }
}

TEST(EnergyInTransit, RaysThatAreSplitCarryAsMuchAsThoseThatAreNot) {
    const Shoebox box = liveFloor();
    const TriangleGeometry room = box.geometry();
    TriangleGeometry open = room;
    open.removeLastTriangle(), open.removeLastTriangle();  // the ceiling
    for (const bool hole : {false, true})
        for (const double seconds : {.03, .12}) {
            double escaped = 0, gone = 0;
            const double energy = followed(box, seconds * 343, 2'000'000, escaped, hole);
            constexpr std::size_t kRuns = 64;
            std::vector<double> late(kRuns), out(kRuns);
            parallelFor(kRuns, [&](std::size_t i) {
                TraceOptions o = shortTrace(2000, i, 0);
                o.maxSeconds = seconds;
                const TraceResult result = AcousticTracer(hole ? open : room).trace(kSource, kListener, o);
                late[i] = result.truncated[0], out[i] = result.escaped[0];
                EXPECT_NEAR(result.absorbed[0] + result.escaped[0] + result.truncated[0], 1, 1e-9);
            });
            double mean = 0, square = 0;
            for (std::size_t i = 0; i < kRuns; ++i)
                mean += late[i] / kRuns, square += late[i] * late[i] / kRuns, gone += out[i] / kRuns;
            // Four deviations of the mean of the runs, and some of the rays that were followed.
            const double deviation = std::sqrt((square - mean * mean) / kRuns);
            EXPECT_NEAR(mean, energy, 4 * deviation + (seconds < .1 ? .005 : .04) * energy) << hole << ' ' << seconds;
            EXPECT_LT(deviation, .03 * energy) << hole << ' ' << seconds;
            EXPECT_NEAR(gone, escaped, .002) << hole << ' ' << seconds;
        }
}

/// Half of the rays have met the floor by then: each has little, together they have a twentieth.
TEST(EnergyInTransit, WhatOutlivesARouletteCarriesWhatOthersLost) {
    Shoebox box = Shoebox::uniform({6, 5, 3}, .02, .3);
    box.absorption[4] = .95;
    const TriangleGeometry room = box.geometry();
    constexpr std::size_t kRuns = 64;
    const double seconds = .016;
    std::vector<double> late(kRuns);
    parallelFor(kRuns, [&](std::size_t i) {
        TraceOptions o = shortTrace(4000, i, 0);
        o.maxSeconds = seconds;
        late[i] = AcousticTracer(room).trace(kSource, kListener, o).truncated[0];
    });
    double mean = 0, escaped = 0;
    for (const double one : late) mean += one / kRuns;
    const double energy = followed(box, seconds * 343, 2'000'000, escaped);
    EXPECT_NEAR(mean, energy, .004 * energy);
}

TEST(EnergyInTransit, EndsWhereRaysHaveNoLengthAndIsNotAskedWhereWallsAreAlike) {
    TraceOptions options;
    const TriangleGeometry alike = Shoebox::uniform({6, 5, 3}, .3, .5).geometry();
    EXPECT_FALSE(trace::EnergyInTransit(alike, trace::bandClasses(alike.materials()), kSource, options, 80).known());
    // From a corner of walls that take nothing, in a room with one that does.
    Shoebox box = Shoebox::uniform({6, 5, 3}, 0, .5);
    box.absorption[5] = .5;
    const TriangleGeometry room = box.geometry();
    const trace::EnergyInTransit corner(room, trace::bandClasses(room.materials()), {0, 0, 0}, options, 1e5);
    for (double metres = 0; metres < 1e5; metres += 1000)
        EXPECT_TRUE(std::isfinite(corner.known() ? corner.at(metres) : 0));
}

}  // namespace
}  // namespace rtsg
