// Sixteen rays side by side: what walls make of them is what they would make of each alone.
#include "rays/ray_lanes.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

namespace rtsg::trace {
namespace {

constexpr int kMax = AcousticRays::kMax;

TEST(CosineDirections, StandWhereTheirNumbersSay) {
    Random random(7);
    double across[kMax], round[kMax];
    AcousticRays::Vectors normals, directions;
    for (int time = 0; time < 500; ++time) {
        drawPairs(random, across, round);
        if (time == 0) across[0] = 0, round[0] = 0, round[1] = .25, round[2] = .5, across[3] = 1 - 0x1p-32;
        for (int i = 0; i < kMax; ++i) normals.set(i, directionFrom(random.uniform(), random.uniform()));
        if (time == 0) normals.set(4, {0, 0, -1}), normals.set(5, {0, 0, 1}), normals.set(6, {1, 0, 0});
        cosineDirections(normals, across, round, directions);
        for (int i = 0; i < kMax; ++i) {
            const glm::dvec3 n = normals[i], d = directions[i];
            EXPECT_NEAR(glm::length(d), 1, 1e-13);
            EXPECT_NEAR(glm::dot(d, n), std::sqrt(1 - across[i]), 1e-13) << "even on the disc below";
            // The same normal and the same place across it, half a turn on: on the other side.
            double on[kMax];
            for (int k = 0; k < kMax; ++k) on[k] = round[k] < .5 ? round[k] + .5 : round[k] - .5;
            AcousticRays::Vectors opposite;
            cosineDirections(normals, across, on, opposite);
            EXPECT_LT(glm::length(d + opposite[i] - 2 * glm::dot(d, n) * n), 1e-6);
            // And a share of a turn on: at that angle.
            for (int k = 0; k < kMax; ++k) on[k] = std::fmod(round[k] + .15, 1);
            cosineDirections(normals, across, on, opposite);
            const glm::dvec3 a = d - glm::dot(d, n) * n, b = opposite[i] - glm::dot(opposite[i], n) * n;
            EXPECT_NEAR(glm::dot(a, b), across[i] * std::cos(.3 * std::numbers::pi), 1e-6);
        }
    }
}

TEST(CosineDirections, FillTheDiscEvenly) {
    Random random(3);
    double across[kMax], round[kMax], x = 0, y = 0, xx = 0, xy = 0, up = 0;
    AcousticRays::Vectors normals, directions;
    for (int i = 0; i < kMax; ++i) normals.set(i, {0, 0, 1});
    constexpr int kTimes = 10'000;
    for (int time = 0; time < kTimes; ++time) {
        drawPairs(random, across, round);
        cosineDirections(normals, across, round, directions);
        for (int i = 0; i < kMax; ++i) {
            ASSERT_TRUE(across[i] >= 0 && across[i] < 1 && round[i] >= 0 && round[i] < 1);
            const glm::dvec3 d = directions[i];
            x += d.x, y += d.y, xx += d.x * d.x, xy += d.x * d.y, up += d.z;
        }
    }
    const double count = double{kTimes} * kMax;
    EXPECT_NEAR(x / count, 0, .005);
    EXPECT_NEAR(y / count, 0, .005);
    EXPECT_NEAR(xy / count, 0, .005);
    EXPECT_NEAR(xx / count, .25, .003);
    EXPECT_NEAR(up / count, 2.0 / 3, .003);
}

/// A wall that tells two kinds of bands apart.
AcousticMaterial wall(double absorbs, double scatters, double lets) {
    AcousticMaterial material;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const bool high = b >= kBandCount / 2;
        material.absorption[b] = absorbs * (high ? .5 : 1);
        material.scattering[b] = scatters * (high ? .8 : 1);
        material.transmission[b] = lets;
    }
    return material;
}

struct Lanes {
    std::vector<AcousticMaterial> materials;
    std::vector<Fractions<4>> walls;
    std::vector<ReflectingPlane> planes;
    RayLanes<4> lanes;
    AcousticHits hits;
    glm::dvec3 direction[kMax];

    explicit Lanes(const std::vector<AcousticMaterial>& of) : materials(of), planes(3) {
        const BandClasses classes = bandClasses(std::span<const AcousticMaterial>(materials));
        for (const AcousticMaterial& material : materials) walls.emplace_back(material, classes);
        for (std::size_t i = 0; i < planes.size(); ++i) planes[i].mirrors = .5 + .1 * static_cast<double>(i);
        lanes.rays.count = kMax;
        for (int i = 0; i < kMax; ++i) {
            direction[i] = glm::normalize(glm::dvec3(.1 * i - .7, .3, i % 3 - 1.2));
            lanes.start(i, {1.0 * i, 2, 3}, direction[i], {1, 2, 0, 0}, 1e-4);
            AcousticHit& hit = hits[static_cast<std::size_t>(i)];
            hit = {.5 + i, glm::normalize(glm::dvec3(i % 2 ? 1 : -1, .2, .1 * i)),
                   i % 4 == 3 ? kNoPlane : static_cast<std::uint32_t>(i % 4),
                   static_cast<std::uint32_t>(i) % static_cast<std::uint32_t>(materials.size()), .01};
        }
    }
    const AcousticHit& hit(int i) const { return hits[static_cast<std::size_t>(i)]; }
};

TEST(RayLanes, ArriveWhereTheyMetSomething) {
    Lanes l({wall(.2, .5, .1), wall(.4, .25, .2)});
    constexpr std::uint32_t kMet = 0xFF7F;
    l.lanes.arrive(kMet, l.hits, l.walls);
    for (int i = 0; i < kMax; ++i) {
        if (!(kMet >> i & 1)) continue;
        EXPECT_EQ(l.lanes.before[i], glm::dvec3(i, 2, 3));
        EXPECT_LT(glm::distance(l.lanes.rays.origin[i], glm::dvec3(i, 2, 3) + l.direction[i] * l.hit(i).distance),
                  1e-14);
        EXPECT_EQ(l.lanes.travelled[i], l.hit(i).distance);
        EXPECT_EQ(l.lanes.rays.except[i], l.hit(i).plane);
        EXPECT_LT(glm::dot(l.lanes.rays.facing[i], l.direction[i]), 0) << "towards where it came from";
        EXPECT_EQ(std::abs(glm::dot(l.lanes.rays.facing[i], l.hit(i).normal)) > 1 - 1e-14, true);
        const Fractions<4>& w = l.walls[l.hit(i).material];
        EXPECT_EQ(l.lanes.scattered(i)[0], w.diffuse[0]);
        EXPECT_EQ(l.lanes.scattered(i)[1], 2 * w.diffuse[1]);
    }
    EXPECT_EQ(l.lanes.left(kMet), kMet);
    EXPECT_EQ(l.lanes.scatters(kMet), kMet);
}

TEST(RayLanes, WallsThatLeaveNothingOrScatterNothingAreTold) {
    Lanes l({wall(1, 0, 0), wall(.2, 0, 0), wall(.2, 1, 0), wall(0, 0, 1)});
    // The first wall leaves half of the high bands.
    for (std::size_t b = 0; b < 4; ++b) l.walls[0].mirror[b] = 0;
    l.lanes.arrive(0xFFFF, l.hits, l.walls);
    EXPECT_EQ(l.lanes.left(0xFFFF), 0xEEEEu);
    EXPECT_EQ(l.lanes.left(0xFF), 0xEEu);
    EXPECT_EQ(l.lanes.scatters(0xFFFF), 0x4444u);
    EXPECT_EQ(l.lanes.scatters(0x4), 0x4u);
}

TEST(RayLanes, GoOnBySharesOfEnergy) {
    for (int step = 0; step < 40; ++step) {
        Lanes l({wall(.2, .5, .1), wall(.4, .25, .2)});
        l.lanes.arrive(0xFFFF, l.hits, l.walls);
        double choice[kMax], across[kMax], round[kMax];
        for (int i = 0; i < kMax; ++i) choice[i] = (step + i / 16.0) / 40, across[i] = .3, round[i] = .1;
        l.lanes.goOn(choice, across, round, l.planes);
        for (int i = 0; i < kMax; ++i) {
            SCOPED_TRACE(testing::Message() << step << ' ' << i);
            const Fractions<4>& w = l.walls[l.hit(i).material];
            const double d = w.diffuse[0] + 2 * w.diffuse[1], m = w.mirror[0] + 2 * w.mirror[1],
                         t = w.through[0] + 2 * w.through[1], at = choice[i] * (d + m + t);
            const glm::dvec3 n = l.hit(i).normal, towards = l.lanes.rays.direction[i];
            const glm::dvec3 side = glm::dot(n, l.direction[i]) > 0 ? -n : n;
            const bool scatters = at < d, reflects = !scatters && at < d + m;
            const auto& of = scatters ? w.diffuse : reflects ? w.mirror : w.through;
            const double chance = (scatters ? d : reflects ? m : t) / (d + m + t);
            EXPECT_NEAR(l.lanes.energy[0][i], of[0] / chance, 1e-12);
            EXPECT_NEAR(l.lanes.energy[1][i], 2 * of[1] / chance, 1e-12);
            EXPECT_EQ(l.lanes.energy[3][i], 0);
            EXPECT_LT(glm::distance(l.lanes.rays.facing[i], scatters || reflects ? side : -side), 1e-14);
            EXPECT_GT(glm::dot(towards, l.lanes.rays.facing[i]), 0);
            if (scatters)
                EXPECT_NEAR(glm::dot(towards, side), std::sqrt(.7), 1e-13);
            else if (reflects)
                EXPECT_LT(glm::distance(towards, glm::reflect(l.direction[i], n)), 1e-14);
            else
                EXPECT_EQ(towards, l.direction[i]);
            using Event = RayLanes<4>::Event;
            EXPECT_EQ(l.lanes.last[i], scatters ? Event::diffuse : reflects ? Event::mirror : Event::emitted);
            EXPECT_EQ(l.lanes.onlyMirrors[i], !scatters);
            EXPECT_EQ(l.lanes.mirrorOrder[i], reflects ? 1 : 0);
            MirrorSequence expected;
            if (reflects) expected.append(l.hit(i).plane);
            EXPECT_EQ(l.lanes.mirrors[i], expected);
            const bool known = reflects && l.hit(i).plane < 3;
            EXPECT_EQ(l.lanes.mirrorFraction[i], known ? l.planes[l.hit(i).plane].mirrors : 1);
        }
    }
}

TEST(RayLanes, ScatteringForgetsMirrors) {
    Lanes l({wall(.2, .5, 0)});
    double choice[kMax], across[kMax] = {}, round[kMax] = {};
    for (const double at : {.99, .0}) {
        for (double& c : choice) c = at;
        l.lanes.arrive(0xFFFF, l.hits, l.walls);
        l.lanes.goOn(choice, across, round, l.planes);
        for (int i = 0; i < kMax; ++i) EXPECT_EQ(l.lanes.mirrors[i] == MirrorSequence(), at == 0);
    }
    for (int i = 0; i < kMax; ++i) EXPECT_FALSE(l.lanes.onlyMirrors[i]);
    EXPECT_EQ(l.lanes.mirrorOrder[2], 1);
}

TEST(RayLanes, FaintOnesAreThoseWithLessThanTheirShareInEveryBand) {
    Lanes l({wall(.2, .5, 0)});
    for (int i = 0; i < kMax; ++i) l.lanes.energy[0][i] = l.lanes.energy[1][i] = 0;
    l.lanes.energy[0][2] = 2e-4;
    l.lanes.energy[3][5] = 2e-4;
    l.lanes.energy[1][6] = 2e-4, l.lanes.roulette[6] = 3e-4;
    EXPECT_EQ(l.lanes.faint(0xFFFF, 1), 0xFFFFu & ~(1u << 2 | 1u << 5));
    EXPECT_EQ(l.lanes.faint(0x64, 1), 0x40u);
    EXPECT_EQ(l.lanes.faint(0x64, .5), 0u);
    EXPECT_EQ(l.lanes.faint(0x64, 3), 0x64u);
}

TEST(RayLanes, ACopyIsWhole) {
    Lanes l({wall(.2, .5, .1)});
    l.lanes.wallsMet[3] = 4;
    l.lanes.roulette[3] = 5e-5;
    double choice[kMax], across[kMax] = {}, round[kMax] = {};
    for (double& c : choice) c = .6;
    l.lanes.arrive(0xFFFF, l.hits, l.walls);
    l.lanes.goOn(choice, across, round, l.planes);
    l.lanes.onlyMirrors[3] = false, l.lanes.mirrorOrder[3] = 7, l.lanes.mirrorFraction[3] = .25;
    ASSERT_NE(l.lanes.mirrors[3], l.lanes.mirrors[0]);
    l.lanes.copy(3, 0);
    EXPECT_EQ(l.lanes.rays.origin[0], l.lanes.rays.origin[3]);
    EXPECT_EQ(l.lanes.rays.direction[0], l.lanes.rays.direction[3]);
    EXPECT_EQ(l.lanes.rays.facing[0], l.lanes.rays.facing[3]);
    EXPECT_EQ(l.lanes.before[0], l.lanes.before[3]);
    EXPECT_EQ(l.lanes.rays.except[0], l.lanes.rays.except[3]);
    EXPECT_EQ(l.lanes.energyOf(0), l.lanes.energyOf(3));
    EXPECT_EQ(l.lanes.travelled[0], l.lanes.travelled[3]);
    EXPECT_EQ(l.lanes.roulette[0], 5e-5);
    EXPECT_EQ(l.lanes.last[0], l.lanes.last[3]);
    EXPECT_EQ(l.lanes.mirrorOrder[0], 7);
    EXPECT_EQ(l.lanes.mirrors[0], l.lanes.mirrors[3]);
    EXPECT_EQ(l.lanes.mirrorFraction[0], .25);
    EXPECT_FALSE(l.lanes.onlyMirrors[0]);
    EXPECT_EQ(l.lanes.wallsMet[0], 4);
}

}  // namespace
}  // namespace rtsg::trace
