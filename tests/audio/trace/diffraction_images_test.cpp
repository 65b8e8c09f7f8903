// Diffraction before or after a specular reflection: bodies on a floor and above it, compared with boundary elements of
// the bodies and their images; and the sound while one walks behind them.
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "edges/diffraction_route.h"
#include "images/diffraction_mirror_world.h"
#include "rigid_body.h"
#include "walled.h"

namespace rtsg {
namespace {

using namespace test;

/// A box above a floor of 80 m, or on it; the floor has a hole of 2 m about (hole, 0) if that is not 0.
Walled boxOnFloor(const glm::dvec3& low, const glm::dvec3& high, double absorption = 0) {
    std::vector<glm::dvec3> corners{{-40, -40, 0}, {40, -40, 0}, {40, 40, 0}, {-40, 40, 0}};
    std::vector<std::uint32_t> triangles{0, 1, 2, 0, 2, 3};
    for (int i = 0; i < 8; ++i)
        corners.emplace_back(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
    constexpr std::uint32_t kFaces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                            {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (int f = low.z > 0 ? 0 : 1; f < 6; ++f)
        for (const int corner : {0, 1, 2, 0, 2, 3}) triangles.push_back(4 + kFaces[f][corner]);
    return {corners, triangles, absorption};
}

/// With its image in the floor, one body if it stands there.
RigidBox withImage(const glm::dvec3& low, const glm::dvec3& high) {
    if (!(low.z > 0)) return {{low.x, low.y, -high.z}, high, 9};
    RigidBox body(low, high, 9);
    body.add(RigidBox({low.x, low.y, -high.z}, {high.x, high.y, -low.z}, 9));
    return body;
}

/// Root mean squares by 63, 125, 250 and 500 Hz of what the octave's energy is off the sum of both: what comes from the
/// source, and what comes from its image.
std::vector<double> offBothSources(const glm::dvec3& low, const glm::dvec3& high) {
    const unsigned seed = 3;
    std::mt19937 random(seed);
    const auto in = [&](double from, double to) { return std::uniform_real_distribution<>(from, to)(random); };
    const Walled walls = boxOnFloor(low, high);
    RigidBox body = withImage(low, high);
    std::vector<double> off(4);
    constexpr int kSources = 2, kListeners = 10;
    for (int s = 0; s < kSources; ++s) {
        const glm::dvec3 source(in(-1, 1), -in(1, 3), in(.3, 1.8));
        std::vector<glm::dvec3> listeners;
        std::vector<Bands> heard;
        for (int i = 0; i < kListeners; ++i) {
            listeners.emplace_back(in(-2, 2), in(.8, 3), in(.2, 1.6));
            heard.push_back(total(walls.arrivals(source, listeners.back())));
        }
        for (std::size_t tone = 0; tone < 4; ++tone) {
            body.light(source, 2 * M_PI * 62.5 * std::exp2(tone) / 343);
            for (int i = 0; i < kListeners; ++i) {
                const glm::dvec3 &here = listeners[i], there(here.x, here.y, -here.z);
                const double both = std::norm(body.pressure(here)) + std::norm(body.pressure(there));
                off[tone] += std::pow(10 * std::log10(heard[i][tone + 1] * 4 * M_PI / both), 2);
            }
        }
    }
    for (double& one : off) one = std::sqrt(one / (kSources * kListeners));
    return off;
}

TEST(ImageBending, BehindAScreenOnAFloorBothSourcesBend) {
    // Without it 4.2 dB at 63 Hz: the way by the floor was missing.
    const std::vector<double> off = offBothSources({-1, -.25, 0}, {1, .25, 1.4});
    EXPECT_LT(off[0], 1.1);
    EXPECT_LT(off[1], 2.2);
    EXPECT_LT(off[2], 2.6);
    EXPECT_LT(off[3], 3.6);
}

TEST(ImageBending, BehindABoxOnAFloorBothSourcesBend) {
    const std::vector<double> off = offBothSources({-.6, -.6, 0}, {.6, .6, .9});
    for (const double one : off) EXPECT_LT(one, 1.6);
}

TEST(ImageBending, BelowATableBothSourcesBend) {
    const std::vector<double> off = offBothSources({-1, -.5, .5}, {1, .5, .9});
    EXPECT_LT(off[0], 1.2);
    EXPECT_LT(off[1], 1.2);
    EXPECT_LT(off[2], 1.8);
    EXPECT_LT(off[3], 2);
}

TEST(ImageBending, AnImageIsHiddenWithoutAStep) {
    // A board hangs before the wall's image, and one walks into what it hides; direct sound is heard all along.
    const Walled walls = boxOnFloor({-.8, -.1, .3}, {.8, .1, .7});
    const glm::dvec3 source(0, -2.5, 1.6);
    Bands last{};
    bool image = false, none = false;
    for (int i = 0; i <= 300; ++i) {
        const glm::dvec3 listener(.3, 2, .9 + .005 * i);
        const std::vector<Arrival> arrivals = walls.arrivals(source, listener);
        const bool seen = std::ranges::any_of(
            arrivals, [](const Arrival& one) { return one.order == 1 && one.rotation != glm::mat3(0.0f); });
        image = image || seen;
        none = none || !seen;
        const Bands now = total(arrivals);
        for (std::size_t b = 1; i > 0 && b < 6; ++b) {
            EXPECT_NEAR(10 * std::log10(now[b] / last[b]), 0, .45) << listener.z << " m, band " << b;
        }
        last = now;
    }
    EXPECT_TRUE(image && none);
}

/// A room from (0, 0, 0) on with a screen across it that stands on the floor.
Walled roomWithScreen(const glm::dvec3& size, const glm::dvec3& low, const glm::dvec3& high, double absorption) {
    std::vector<glm::dvec3> corners;
    for (const auto& [from, to] : {std::pair(glm::dvec3(0), size), std::pair(low, high)})
        for (int i = 0; i < 8; ++i)
            corners.emplace_back(i & 1 ? to.x : from.x, i & 2 ? to.y : from.y, i & 4 ? to.z : from.z);
    std::vector<std::uint32_t> triangles;
    for (const std::uint32_t first : {0, 8})
        for (const std::uint32_t corner : {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5})
            triangles.push_back(first + corner);
    return {corners, triangles, absorption, {WorldFromLocal(1.0)}, false};
}

TEST(ImageBending, ImagesByEveryWallAreHiddenByAScreenWithoutAStep) {
    // Behind a screen that reaches from wall to wall, and one that ends before them, the images by ceiling, floor and
    // walls come into its shadow one after the other. With the loudest alone levels stepped by 3 to 17 dB.
    const Walled office = roomWithScreen({12, 8, 2.8}, {5.97, .01, 0}, {6.03, 7.99, 1.6}, .5);
    const Walled dead = roomWithScreen({10, 8, 3.5}, {4.95, 2, 0}, {5.05, 6, 2}, .98);
    struct Walk {
        const Walled& walls;
        glm::dvec3 source, from, to;
    };
    for (const Walk& walk : {Walk{office, {4, 4, 1.2}, {6.5, 4, .75}, {6.5, 4, 1.15}},
                             Walk{dead, {2.5, 4, 1.2}, {5.4, 4, 1.2}, {5.8, 4, 1.2}},
                             Walk{dead, {2.5, 4, 1.2}, {6, 5.8, 1.2}, {6, 6.2, 1.2}}}) {
        constexpr int kSteps = 40;
        Bands last{};
        for (int i = 0; i <= kSteps; ++i) {
            const glm::dvec3 listener = glm::mix(walk.from, walk.to, double(i) / kSteps);
            const Bands now = total(walk.walls.arrivals(walk.source, listener));
            for (std::size_t b = 2; i > 0 && b < 8; ++b)
                EXPECT_NEAR(10 * std::log10(now[b] / last[b]), 0, 1)
                    << listener.x << ' ' << listener.y << ' ' << listener.z << " m, band " << b;
            last = now;
        }
    }
}

TEST(ImageBending, WhatAFloorAbsorbsIsNotHeard) {
    const glm::dvec3 source(.2, -2, .8), listener(-.1, 2, .7);
    const auto waves = [&](double absorption) {
        double sum = 0;
        const TraceResult heard = boxOnFloor({-1, -.1, 0}, {1, .1, 1.4}, absorption).traced(source, listener);
        for (const EdgeWave& wave : heard.edges.waves) sum += std::norm(wave.pressure[10]) * (wave.order > 1);
        return sum;
    };
    EXPECT_GT(waves(0), 2 * waves(.999));
}

TEST(ImageBending, RoutesOfWavesAreAsLongAsTheyAre) {
    const glm::dvec3 source(.2, -2, .8), listener(-.1, 2, .7);
    const TraceResult heard = boxOnFloor({-1, -.1, 0}, {1, .1, 1.4}).traced(source, listener);
    int through = 0;
    for (const EdgeWave& wave : heard.edges.waves) {
        // By the floor: its first or its last place is where that is mirrored, below it.
        if (!(std::min(wave.route.first.z, wave.route.last.z) < -1e-6)) continue;
        ++through;
        EXPECT_NEAR(edgePath(wave.route, source, listener).length, wave.seconds * 343.2, .01) << through;
    }
    EXPECT_GT(through, 10);
}

TEST(ImageBending, ASourceThatSendsNothingDownHasNoImage) {
    const Walled walls = boxOnFloor({-1, -.1, 0}, {1, .1, 1.4});
    TraceOptions options;
    options.rays = 2;
    options.imageOrder = 1;
    options.maxSeconds = .5;
    const glm::dvec3 source(.2, -2, .8), listener(-.1, 2, .7);
    const auto mirrored = [&] {
        double sum = 0;
        const TraceResult heard = AcousticTracer(walls.geometry).trace(source, listener, options);
        for (const EdgeWave& wave : heard.edges.waves)
            if (wave.route.first.z < 0) sum += std::norm(wave.pressure[10]);
        return sum;
    };
    const double all = mirrored();
    options.pattern = [](const glm::dvec3& direction) { return direction.z < -.02 ? 0.0 : 1.0; };
    EXPECT_GT(all, 0);
    EXPECT_LT(mirrored(), 1e-3 * all);
}

/// In the floor at z = 0 of a box on it, from above.
struct InFloor {
    Walled walls = boxOnFloor({-1, -.1, 0}, {1, .1, 1.4});
    std::uint32_t plane = 0;

    InFloor() {
        const auto planes = walls.geometry.planes();
        while (plane < planes.size() &&
               (std::abs(planes[plane].normal.z) < .9 || std::abs(planes[plane].offset) > 1e-6))
            ++plane;
    }
};

TEST(MirrorWorld, HasAllOnceMoreBeyondTheMirror) {
    const InFloor floor;
    const MirrorWorld world(floor.walls.geometry, floor.plane, {0, 2, 1});
    AcousticHit hit;
    // From below through the floor to the box above it, and from the image of its top up to nothing.
    const glm::dvec3 below(0, -2, -1), displacement = glm::normalize(glm::dvec3(0, 1.9, 1.5));
    ASSERT_TRUE(world.closest(below, displacement, 100, kNoPlane, hit));
    EXPECT_NEAR(hit.distance, 1.9 / displacement.y, 1e-6);
    EXPECT_NEAR(std::abs(hit.normal.y), 1, 1e-6);
    ASSERT_TRUE(world.closest({.5, 0, -3}, {0, 0, 1}, 100, kNoPlane, hit));
    EXPECT_NEAR(hit.distance, 1.6, 1e-6);
    EXPECT_NEAR(std::abs(hit.normal.z), 1, 1e-6);
    EXPECT_FALSE(world.closest({3, 3, -5}, {0, 0, 1}, 1000, kNoPlane, hit)) << "the floor is no wall";
    // Beside the floor one sees nothing of what is mirrored.
    ASSERT_TRUE(world.closest({50, 0, -5}, {0, 0, 1}, 1000, kNoPlane, hit));
    EXPECT_NEAR(hit.distance, 5, 1e-6);
    EXPECT_FALSE(world.closest({50, 0, -5}, {0, 0, -1}, 1000, kNoPlane, hit));
}

TEST(MirrorWorld, CutsEdgesWhereTheyGoThroughTheMirror) {
    // A sheet that leans through the floor, one way and the other.
    for (const double lean : {1.0, -1.0}) {
        const Walled walls({{-40, -40, 0},
                            {40, -40, 0},
                            {40, 40, 0},
                            {-40, 40, 0},
                            {0, 0, lean},
                            {1, 0, -lean},
                            {1, 1, -lean},
                            {0, 1, lean}},
                           {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7});
        std::uint32_t plane = 0;
        while (std::abs(walls.geometry.planes()[plane].normal.z) < .99) ++plane;
        const MirrorWorld world(walls.geometry, plane, {0, 0, 3});
        int leaning = 0;
        world.visitEdges([&](const WallEdge& edge) {
            if (std::abs(edge.axis.z) < .1) return;
            ++leaning;
            const glm::dvec3 ends[] = {edge.from, edge.from + edge.axis * edge.length};
            const bool first = std::abs(ends[0].z) < std::abs(ends[1].z);
            const glm::dvec3 in = ends[first ? 0 : 1], off = ends[first ? 1 : 0];
            EXPECT_NEAR(in.z, 0, 1e-6);
            EXPECT_NEAR(in.x, .5, 1e-6);
            EXPECT_NEAR(std::abs(off.z), 1, 1e-6);
            EXPECT_NEAR(off.x, lean > 0 ? 0 : 1, 1e-6);
        });
        EXPECT_EQ(leaning, 4) << "two, and their images";
    }
}

TEST(MirrorWorld, HasEdgesOnBothSidesAndNoneInTheMirror) {
    const InFloor floor;
    const MirrorWorld world(floor.walls.geometry, floor.plane, {0, 2, 1});
    int above = 0, below = 0, bodies = 0;
    world.visitEdges([&](const WallEdge& edge) {
        const double low = edge.from.z, high = (edge.from + edge.axis * edge.length).z;
        EXPECT_GT(std::max(std::abs(low), std::abs(high)), 1e-6);
        EXPECT_GE(low * high, -1e-9) << "on one side";
        (low + high > 0 ? above : below) += 1;
        EXPECT_NEAR(glm::length(edge.axis), 1, 1e-9);
        bodies += edge.body != nullptr;
    });
    EXPECT_EQ(above, 8);
    EXPECT_EQ(below, 8);
    // From below the floor there is nothing above it.
    const MirrorWorld other(floor.walls.geometry, floor.plane, {0, 2, -1});
    other.visitEdges([&](const WallEdge&) { ADD_FAILURE() << "an edge behind the mirror"; });
}

}  // namespace
}  // namespace rtsg
