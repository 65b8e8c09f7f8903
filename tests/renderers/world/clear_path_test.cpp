// The surfaces that shadow rays pass, found in one traversal, against a loop over all triangles in double precision.
#include "world/clear_path.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr unsigned kClearSeed = 20261128;

bool isEven(const void*, std::uint32_t slot) {
    return slot % 2 == 0;
}

/// All that a ray meets, one after the other.
struct WholePath {
    std::vector<BruteForce::Answer> hits;
    double margin = HUGE_VAL;
    WholePath(const BruteForce& truth, Ray ray) {
        for (;;) {
            const BruteForce::Answer hit = truth.intersect(ray);
            margin = std::min(margin, hit.margin);
            if (hit.instance == kNoInstance || margin < 1e-4) return;
            hits.push_back(hit);
            ray.tMin = static_cast<float>(hit.t * (1 + 3e-5));
        }
    }
    bool isStopped() const {
        return std::ranges::any_of(hits, [](const auto& hit) { return hit.instance % 2 != 0; });
    }
};

void expectPassed(ClearPath& clear, const Ray& ray, int lane, const WholePath& whole) {
    EXPECT_EQ(clear.passesAny(lane), !whole.hits.empty());
    std::size_t next = 0;
    clear.visit(ray, lane, [&](const Hit& hit, std::span<const Hit>) {
        if (next == whole.hits.size()) return ++next, false;
        const BruteForce::Answer& expected = whole.hits[next++];
        EXPECT_EQ(hit.instance, expected.instance);
        EXPECT_EQ(hit.triangle, expected.triangle);
        EXPECT_NEAR(hit.t, expected.t, 1e-4 * expected.t + 1e-5);
        EXPECT_NEAR(hit.u, expected.u, 2e-3);
        EXPECT_NEAR(hit.v, expected.v, 2e-3);
        EXPECT_GT(glm::dot(Vec3d(hit.normal), expected.normal), .999);
        return true;
    });
    EXPECT_EQ(next, whole.hits.size());
}

/// Things that rest and things that move, some of them of long triangles, every other one clear.
void fillMixed(CheckedWorld& w, std::mt19937& random) {
    w.add(makeSoup(random, 60), scaling(Vec3d(4)));
    w.add(makeBox(), identityTransform());
    for (int i = 0; i < 12; ++i) {
        const bool isClear = w.truth.items.size() % 2 == 0;
        const WorldFromLocal at = randomTransform(random, 4);
        w.add(isClear && i % 3 == 0 ? makeBeams(random, 3, 4, .05f) : makeSphere(isClear ? 1 : 0), at,
              i % 4 < 2 ? Motion::fixed : Motion::moving);
    }
    w.world.apply(w.delta);
}

TEST(ClearPath, PassesWhatALoopOverAllTrianglesMeets) {
    std::mt19937 random(kClearSeed);
    CheckedWorld w;
    fillMixed(w, random);
    int stopped = 0, passed = 0, several = 0;
    for (int p = 0; p < 300; ++p) {
        RayPacket16 rays;
        Ray lanes[16];
        const bool together = p % 3 == 0;
        const Ray middle = randomRay(random, 5);
        for (int i = 0; i < 16; ++i) {
            lanes[i] = together ? middle : randomRay(random, 5);
            if (together) lanes[i].direction += .01f * randomRay(random, 1).direction;
            if (i % 5 == 4) lanes[i].tMax = 1;
            rays.set(i, lanes[i]);
        }
        rays.skip(7);
        ClearPath clear(w.world, isEven, nullptr);
        std::uint32_t unknown = 0;
        const std::uint32_t blocked = clear.find(rays, together, RayKind::shadow, unknown);
        EXPECT_EQ(unknown, 0u);
        EXPECT_FALSE(blocked & 1u << 7);
        EXPECT_FALSE(clear.passesAny(7));
        for (int i = 0; i < 16; ++i) {
            const WholePath whole(w.truth, lanes[i]);
            if (i == 7 || whole.margin < 1e-4) continue;
            ASSERT_EQ((blocked >> i & 1u) != 0, whole.isStopped()) << p << '/' << i;
            stopped += whole.isStopped();
            if (whole.isStopped()) continue;
            passed += !whole.hits.empty(), several += whole.hits.size() > 2;
            expectPassed(clear, lanes[i], i, whole);
        }
    }
    EXPECT_GT(stopped, 200);
    EXPECT_GT(passed, 400);
    EXPECT_GT(several, 100);
}

// Each square is two triangles, which a ray through its middle meets at their common edge; and there are two of each.
TEST(ClearPath, SurfacesInOnePlaceCountOnce) {
    CheckedWorld w;
    const auto square = makeMesh({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {0, 1, 2, 0, 2, 3});
    for (int i = 0; i < 5; ++i) {
        w.add(square, translation(Vec3d(0, 0, i / 2)), i < 2 ? Motion::fixed : Motion::moving);
        w.add(makeSphere(0), translation(Vec3d(100 + 3 * i, 0, 0)));
    }
    w.world.apply(w.delta);
    RayPacket16 rays;
    for (int i = 0; i < 16; ++i) {
        const float at = .05f * static_cast<float>(i);
        rays.set(i, {{at, i % 2 == 0 ? at : 0, -1}, 0, {0, 0, 1}});
    }
    ClearPath clear(w.world, isEven, nullptr);
    std::uint32_t unknown = 0;
    EXPECT_EQ(clear.find(rays, false, RayKind::shadow, unknown), 0u);
    EXPECT_EQ(unknown, 0u);
    for (int i = 0; i < 16; ++i) {
        std::vector<float> met;
        std::size_t others = 0;
        clear.visit(rays.ray(i), i, [&](const Hit& hit, std::span<const Hit> inPlace) {
            others += inPlace.size();
            return met.push_back(hit.t), true;
        });
        EXPECT_GE(others, 2u) << i;
        EXPECT_THAT(met, testing::Pointwise(testing::FloatNear(1e-6f), {1.f, 2.f, 3.f})) << i;
    }
}

TEST(ClearPath, SaysOfWhichRaysItDoesNotTell) {
    CheckedWorld w;
    const auto square = makeMesh({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {0, 1, 2, 0, 2, 3});
    constexpr auto kMax = static_cast<int>(bvh::PassedHits::kMax);
    for (int i = 0; i <= kMax; ++i) {
        // Beside the last one there is nothing.
        w.add(square, translation(Vec3d(i == kMax ? -1 : 0, 0, i)));
        w.add(makeSphere(0), translation(Vec3d(100 + 3 * i, 0, 0)));
    }
    w.world.apply(w.delta);
    RayPacket16 rays;
    for (int i = 0; i < 16; ++i) rays.set(i, {{i % 2 == 0 ? -.5f : .5f, .1f, -1}, 0, {0, 0, 1}});
    ClearPath clear(w.world, isEven, nullptr);
    std::uint32_t unknown = 0;
    EXPECT_EQ(clear.find(rays, false, RayKind::shadow, unknown), 0u);
    EXPECT_EQ(unknown, 0x5555u);
    int count = 0;
    clear.visit(rays.ray(1), 1, [&](const Hit&, std::span<const Hit>) { return ++count, true; });
    EXPECT_EQ(count, kMax);
}

}  // namespace
}  // namespace rtsg
