// Bodies that are small beside a wave: levels beside boundary elements, and what is not small though it is thin.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "rigid_body.h"
#include "walled.h"

namespace rtsg {
namespace {

using namespace test;

/// Boxes in one mesh, each from its low corner to its high one.
Walled boxesOf(const std::vector<std::array<glm::dvec3, 2>>& boxes) {
    std::vector<glm::dvec3> corners;
    std::vector<std::uint32_t> triangles;
    for (const auto& [low, high] : boxes) {
        const auto first = static_cast<std::uint32_t>(corners.size());
        for (int i = 0; i < 8; ++i)
            corners.emplace_back(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
        for (const std::uint32_t corner : {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5})
            triangles.push_back(first + corner);
    }
    return {corners, triangles};
}
double octaveAt(const TraceResult& traced, std::size_t band, double distance) {
    return 10 * std::log10(4 * M_PI * distance * distance * total(traced.arrivals)[band]);
}

TEST(SmallBodies, LevelsAreThoseOfTheIntegralOverTheSurface) {
    constexpr unsigned kSeed = 20;
    std::mt19937 random(kSeed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const auto direction = [&] {
        return glm::normalize(glm::dvec3(uniform(random), uniform(random), uniform(random)));
    };
    double sum = 0, worst = 0, nearer = 0, octaves = 0;
    int count = 0;
    for (const glm::dvec3& size :
         {glm::dvec3(.02, .02, .02), glm::dvec3(.1, .1, .1), glm::dvec3(.02, .06, .05), glm::dvec3(.01, .1, .1)}) {
        const glm::dvec3 half = .5 * size;
        const double reach = glm::length(half);
        const Walled wall = boxesOf({{-half, half}});
        RigidBox box(-half, half, 5);
        for (int index = 0; index < 8; ++index) {
            const glm::dvec3 source = direction() * (reach + .5);
            const glm::dvec3 listener = index < 3
                                            ? source * (-(reach + .03 + .3 * index) / glm::length(source))  // behind
                                            : direction() * (reach + .01 + (index < 5 ? 0 : .1 * index));
            const TraceResult traced = wall.traced(source, listener);
            for (const double hz : {125.0, 500.0, 1000.0}) {
                box.light(source, 2 * M_PI * hz / 343);
                const double off = heardAt(traced, hz, glm::distance(source, listener)) - box.level(listener);
                sum += off * off;
                worst = std::max(worst, std::abs(off));
                if (hz < 200) nearer = std::max(nearer, std::abs(off));
                ++count;
            }
            box.light(source, 2 * M_PI * 250 / 343);
            octaves =
                std::max(octaves, std::abs(octaveAt(traced, 3, glm::distance(source, listener)) - box.level(listener)));
        }
    }
    // It was 1 dB, and 3.9 in single places: next to a cube at 125 Hz, too.
    EXPECT_LT(std::sqrt(sum / count), .4) << "seed " << kSeed;
    EXPECT_LT(worst, 1.85) << "seed " << kSeed;
    EXPECT_LT(nearer, .2) << "seed " << kSeed;
    EXPECT_LT(octaves, .5) << "seed " << kSeed;
}

/// The cross-section counts of what is long: a rod that is thin beside a wave is not there, in the way and beside it.
TEST(SmallBodies, ALongRodIsNotThereWhereItIsThin) {
    const Walled rod = boxesOf({{glm::dvec3(-.01, -.01, -3), glm::dvec3(.01, .01, 3)}});
    const glm::dvec3 source(-2, 0, .3);
    for (const double y : {0.0, .03, .2})
        for (const double hz : {125.0, 500.0, 1000.0}) {
            const glm::dvec3 listener(.7, y, -.2);
            const double distance = glm::distance(source, listener);
            EXPECT_NEAR(heardAt(rod.traced(source, listener), hz, distance), 0, .4) << y << ' ' << hz;
            EXPECT_NEAR(octaveAt(rod.traced(source, listener), 3, distance), 0, .4) << y << ' ' << hz;
        }
    // At 16 kHz it hides what is behind it.
    EXPECT_LT(heardAt(rod.traced(source, {.1, 0, .3}), 16000, 2.1), -1.5);
}

/// Broad and thin is not small; nor is it where light sound comes: there it mirrors.
TEST(SmallBodies, AThinPlateHidesAsOneOfNoThickness) {
    const Walled plate = boxesOf({{glm::dvec3(-.001, -1, -1), glm::dvec3(.001, 1, 1)}});
    const Walled sheet({{0, -1, -1}, {0, 1, -1}, {0, 1, 1}, {0, -1, 1}}, {0, 1, 2, 0, 2, 3}, 0, {WorldFromLocal(1.0)},
                       false);
    const glm::dvec3 source(-1.5, .1, .2), before(-1, -.3, .1);
    const TraceResult lit = plate.traced(source, before), open = sheet.traced(source, before);
    for (const double hz : {250.0, 1000.0})
        EXPECT_NEAR(heardAt(lit, hz, glm::distance(source, before)), heardAt(open, hz, glm::distance(source, before)),
                    1.3)
            << hz;
}

/// Walls of boxes are no small bodies where they stand between others, neither mirrors nor to be heard through.
TEST(SmallBodies, WallsOfARoomAreNone) {
    const auto at = [](double x, double y, double z) { return glm::dvec3(x, y, z); };
    const double t = .1;
    const std::vector<std::array<glm::dvec3, 2>> walls{
        {at(-t, -t, -t), at(5 + t, 0, 4 + t)}, {at(-t, 3, -t), at(5 + t, 3 + t, 4 + t)},
        {at(-t, 0, 0), at(0, 3, 4)},           {at(5, 0, 0), at(5 + t, 3, 4)},
        {at(-t, 0, -t), at(5 + t, 3, 0)},      {at(-t, 0, 4), at(5 + t, 3, 4 + t)}};
    std::vector<glm::dvec3> cube;
    for (int i = 0; i < 8; ++i) cube.emplace_back(i & 1, i >> 1 & 1, i >> 2 & 1);
    std::vector<WorldFromLocal> placed;
    for (const auto& [low, high] : walls) {
        WorldFromLocal m(1.0);
        for (int i = 0; i < 3; ++i) m[i][i] = high[i] - low[i];
        m[3] = low;
        placed.push_back(m);
    }
    const std::vector<std::uint32_t> box{0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                         2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    const Walled room(cube, box, .1, placed);
    const glm::dvec3 source(1, 1.2, 1.1), listener(3.6, 1.5, 2.9);
    const Bands heard = total(room.arrivals(source, listener)), bare = total(room.arrivals(source, listener, 0));
    for (std::size_t b = 0; b < kBandCount; ++b) EXPECT_NEAR(10 * std::log10(heard[b] / bare[b]), 0, .05) << b;
    EXPECT_TRUE(room.arrivals(source, {9, 1.5, 2}).empty());
}

/// A cube from -1 to 1 as often as there are places for it.
Walled cubes(const std::vector<WorldFromLocal>& placed, bool solid = true) {
    std::vector<glm::dvec3> corners;
    for (int i = 0; i < 8; ++i) corners.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    return {
        corners,
        {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5},
        1,
        placed,
        solid};
}
WorldFromLocal cubeAt(const glm::dvec3& middle, const glm::dvec3& half, double angle) {
    WorldFromLocal m(1.0);
    m[0] = half.x * glm::dvec3(std::cos(angle), std::sin(angle), 0);
    m[1] = half.y * glm::dvec3(-std::sin(angle), std::cos(angle), 0);
    m[2] = half.z * glm::dvec3(0, 0, 1);
    m[3] = middle;
    return m;
}

/// All axes of a cube are alike to its moments: turned by a twentieth it took the bass of what goes straight on.
TEST(SmallBodies, ATurnedCubeIsAsSmallAsOneThatIsNot) {
    const glm::dvec3 source(-2, .01, .003), listener(2, -.02, .01);
    const glm::dvec3 half(.025);
    const TraceResult straight = cubes({cubeAt({}, half, 0)}).traced(source, listener);
    for (const double angle : {.05, .1, .7, 1.5}) {
        const TraceResult traced = cubes({cubeAt({}, half, angle)}).traced(source, listener);
        for (const double hz : {31.0, 125.0, 500.0}) {
            EXPECT_NEAR(heardAt(traced, hz, 4), heardAt(straight, hz, 4), .3) << angle << ' ' << hz;
            EXPECT_NEAR(heardAt(traced, hz, 4), 0, .3) << angle << ' ' << hz;
        }
        for (std::size_t b = 0; b < 4; ++b) EXPECT_NEAR(octaveAt(traced, b, 4), 0, .3) << angle << ' ' << b;
    }
}

TEST(SmallBodies, InAClosedRoomTheyAreAsSmallAsInTheOpen) {
    const glm::dvec3 source(-1, .01, .003), listener(1, -.02, .01);
    const TraceResult traced =
        cubes({cubeAt({.1, 0, 0}, glm::dvec3(3, 2, 1.5), 0), cubeAt({}, glm::dvec3(.05), .3)}, false)
            .traced(source, listener);
    for (const double hz : {31.0, 125.0, 500.0}) EXPECT_NEAR(heardAt(traced, hz, 2), 0, 1) << hz;
    for (std::size_t b = 0; b < 4; ++b) EXPECT_NEAR(octaveAt(traced, b, 2), 0, 1) << b;
}

/// A body at a wall lets nothing through the wall, whether its back lies in the wall's plane, before it, or behind it.
TEST(SmallBodies, AWallBehindOneHidesAsEver) {
    const glm::dvec3 source(-2, .01, .003), listener(2, -.02, .01), wall(.01, 30, 30);
    const TraceResult alone = cubes({cubeAt({.01, 0, 0}, wall, 0)}).traced(source, listener);
    for (const double gap : {0.0, 1e-3, -.01}) {
        const TraceResult traced =
            cubes({cubeAt({.01, 0, 0}, wall, 0), cubeAt({-.03 - gap, 0, 0}, glm::dvec3(.03, .05, .05), 0)})
                .traced(source, listener);
        for (std::size_t b = 0; b < kBandCount; ++b)
            EXPECT_LT(octaveAt(traced, b, 4), octaveAt(alone, b, 4) + 2) << gap << ' ' << b;
    }
}

/// Where a way goes through an edge or a corner it meets two or three surfaces in one place.
TEST(SmallBodies, AWayThroughTheirEdgesAndCornersEnds) {
    for (const double angle : {M_PI / 4, .3})
        for (const glm::dvec3& off :
             {glm::dvec3(0), glm::dvec3(0, 0, .025), glm::dvec3(0, .025, 0), glm::dvec3(.025)}) {
            const glm::dvec3 source = glm::dvec3(-2, 0, 0) + off, listener = glm::dvec3(2, 0, 0) + off;
            const TraceResult traced = cubes({cubeAt({}, glm::dvec3(.025), angle)}).traced(source, listener);
            EXPECT_NEAR(heardAt(traced, 125, 4), 0, .5) << angle << ' ' << off.x << ' ' << off.y << ' ' << off.z;
        }
}

}  // namespace
}  // namespace rtsg
