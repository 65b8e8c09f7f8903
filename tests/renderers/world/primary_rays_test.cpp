// A picture's rays together: what they find against rays one by one and against a loop over all triangles.
#include "world/primary_rays.h"

#include <algorithm>
#include <cstring>
#include <numbers>

#include <gtest/gtest.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr unsigned kPrimarySeed = 1974;

bvh::PixelGrid gridAt(const Vec3f& eye, const Vec3f& forward, int width, int height, float halfAngle = .5f) {
    const Vec3f f = glm::normalize(forward);
    const Vec3f right = glm::normalize(glm::cross(f, std::abs(f.y) < .9f ? Vec3f(0, 1, 0) : Vec3f(1, 0, 0)));
    const float step = 2 * std::tan(halfAngle) / static_cast<float>(height);
    return {eye, right, glm::cross(right, f), f, 0, step, 0, step, width, height};
}
Vec3f directionAt(const bvh::PixelGrid& g, float x, float y) {
    return g.forward + g.right * (g.middleX + g.across * x) + g.up * (g.middleY - g.down * y);
}

/// A sample anywhere in each pixel, also at its very borders.
bvh::TilePositions anywhere(std::mt19937& random) {
    std::uniform_real_distribution<float> unit(-.01f, 1.01f);
    bvh::TilePositions positions;
    for (int block = 0; block < 16; ++block)
        for (int i = 0; i < 16; ++i) {
            const auto coordinate = [&] { return std::clamp(unit(random), 0.0f, 0x1.fffffep-1f); };
            positions.x[block][i] = static_cast<float>(block % 4 * 4 + i % 4 - 8) + coordinate();
            positions.y[block][i] = static_cast<float>(block / 4 * 4 + i / 4 - 8) + coordinate();
        }
    return positions;
}

/// A block's rays as pictures make them; those outside are inactive. `places`: null: in the pixels' middles.
RayPacket16 raysOf(const bvh::PixelGrid& g, int tileX, int tileY, int block, float tMax = HUGE_VALF,
                   const bvh::TilePositions* positions = nullptr) {
    RayPacket16 rays;
    std::memset(&rays, 0x7f, sizeof rays);
    for (int lane = 0; lane < 16; ++lane) {
        const int x = tileX * 16 + block % 4 * 4 + lane % 4, y = tileY * 16 + block / 4 * 4 + lane / 4;
        const float inX = positions ? positions->x[block][lane] + 8 : static_cast<float>(x - tileX * 16) + .5f,
                    inY = positions ? positions->y[block][lane] + 8 : static_cast<float>(y - tileY * 16) + .5f;
        const Vec3f d = directionAt(g, inX + static_cast<float>(tileX * 16) - static_cast<float>(g.width) / 2,
                                    inY + static_cast<float>(tileY * 16) - static_cast<float>(g.height) / 2);
        rays.set(lane, {g.eye, 0, glm::normalize(d), tMax});
        if (x >= g.width || y >= g.height) rays.skip(lane);
    }
    return rays;
}

/// Calls visit(rays as they were, rays with their hits, bits of these) for all blocks of tiles that are found together.
/// Returns the number of tiles that are not.
template <class Visit>
int forBlocks(const RayView& world, const bvh::PixelGrid& grid, const Visit& visit, float tMax = HUGE_VALF,
              RayKind kind = RayKind::view, std::size_t samples = 1) {
    const PrimaryRays primary(world, grid, kind, static_cast<int>(samples));
    EXPECT_TRUE(primary);
    if (!primary) return -1;
    int left = 0;
    std::mt19937 random(kPrimarySeed);
    std::vector<bvh::TileHits> tile(samples);
    std::vector<bvh::TilePositions> positions(samples);
    for (int y = 0; y * 16 < grid.height; ++y)
        for (int x = 0; x * 16 < grid.width; ++x) {
            for (bvh::TilePositions& sample : positions) sample = anywhere(random);
            const bool inMiddles = samples == 1;
            if (!primary.find(x, y, tile, inMiddles ? nullptr : positions.data())) {
                ++left;
                continue;
            }
            for (std::size_t s = 0; s < samples; ++s)
                for (int block = 0; block < 16; ++block) {
                    const RayPacket16 before = raysOf(grid, x, y, block, tMax, inMiddles ? nullptr : &positions[s]);
                    RayPacket16 rays = before;
                    visit(before, rays, primary.intersect(rays, tile[s], block));
                }
        }
    return left;
}

/// Needles as long as the room, a finely cut ball, a ball within it that stays whole behind others, scattered
/// triangles.
struct SeenRoom : CheckedWorld {
    std::mt19937 random{kPrimarySeed};
    void build() {
        world.apply(delta);
        delta = {};
    }
    explicit SeenRoom(bool moving) {
        add(makeSphere(4), translation({1, .2, -2}));
        add(makeBeams(random, 8, 24, .3f), scaling({.5, .7, .6}));
        add(makeSoup(random, 60), randomTransform(random, 3));
        add(makeBox(), scaling({9, 7, 11}));
        if (moving) add(makeSphere(2), translation({-.5, .1, -1}), Motion::moving);
        build();
    }
};

TEST(PrimaryRays, FindWhatALoopOverAllTrianglesFinds) {
    for (const auto& [moving, samples] : {std::pair(false, 1), {true, 1}, {false, 3}}) {
        SeenRoom room(moving);
        std::uniform_real_distribution<float> unit(-1, 1);
        int compared = 0, hits = 0;
        for (int camera = 0; camera < 6; ++camera) {
            SCOPED_TRACE(testing::Message() << "seed " << kPrimarySeed << ", " << moving << ", " << samples
                                            << " samples, camera " << camera);
            const Vec3f eye(3 * unit(room.random), 2 * unit(room.random), 3 + 3 * unit(room.random));
            bvh::PixelGrid grid =
                gridAt(eye, {unit(room.random), .5f * unit(room.random), -1.3f}, 61, 35, camera == 5 ? 1.4f : .4f);
            if (camera == 3) grid.up = grid.up * 1.5f + grid.right * .3f;  // a viewpoint that is scaled and sheared
            if (camera == 4) grid.middleX = .2f, grid.middleY = -.1f;
            (void)forBlocks(
                room.world, grid,
                [&](const RayPacket16& before, const RayPacket16& rays, std::uint32_t met) {
                    for (int lane = 0; lane < 16; ++lane) {
                        if (!before.active[lane]) {
                            EXPECT_FALSE(met >> lane & 1u);
                            continue;
                        }
                        const BruteForce::Answer expected = room.truth.intersect(before.ray(lane));
                        if (expected.margin < 1e-4) continue;
                        ++compared;
                        const Hit hit = room.world.hit(rays, lane);
                        ASSERT_EQ(bool(hit), expected.instance != kNoInstance);
                        EXPECT_EQ(bool(hit), (met >> lane & 1u) != 0);
                        if (!hit) continue;
                        ++hits;
                        EXPECT_EQ(hit.instance, expected.instance);
                        EXPECT_EQ(hit.triangle, expected.triangle);
                        EXPECT_NEAR(hit.t, expected.t, 1e-5 * expected.t);
                        EXPECT_NEAR(hit.u, expected.u, 1e-3);
                        EXPECT_NEAR(hit.v, expected.v, 1e-3);
                        EXPECT_GT(glm::dot(Vec3d(hit.normal), expected.normal), .9999);
                    }
                },
                HUGE_VALF, RayKind::view, static_cast<std::size_t>(samples));
        }
        EXPECT_GT(compared, 9000);
        EXPECT_GT(hits, 9000);
    }
}

/// Closed and seen from within, with corners exactly where rays run: neither these nor others slip through.
TEST(PrimaryRays, NothingShowsBetweenTriangles) {
    for (const float scale : {1e-3f, 1.0f, 1e5f}) {
        SCOPED_TRACE(scale);
        // A wall whose corners are on every second pixel's ray, and every third corner's neighbours cut the other way.
        const int width = 96, height = 64;
        bvh::PixelGrid grid = gridAt({scale * .25f, 0, 0}, {0, 0, -1}, width, height);
        std::vector<Vec3f> corners;
        std::vector<std::int32_t> triangles;
        constexpr int kAcross = 50, kDown = 34;
        for (int y = 0; y < kDown; ++y)
            for (int x = 0; x < kAcross; ++x) {
                const Vec3f d = directionAt(grid, static_cast<float>(2 * x) - 49.5f, static_cast<float>(2 * y) - 33.5f);
                corners.push_back(grid.eye + scale * (3 + static_cast<float>((x * 7 + y * 5) % 4)) * d);
                if (x + 1 == kAcross || y + 1 == kDown) continue;
                const std::int32_t a = y * kAcross + x, b = a + 1, c = a + kAcross, e = c + 1;
                if ((x + y) % 3)
                    triangles.insert(triangles.end(), {a, b, c, b, e, c});
                else
                    triangles.insert(triangles.end(), {a, b, e, a, e, c});
            }
        RayWorld world;
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, makeMesh(corners, triangles)});
        delta.added.push_back(makeInstance(0, NodeId{1}));
        world.apply(delta);
        int rays = 0, leaks = 0;
        const auto count = [&](const RayPacket16& before, const RayPacket16&, std::uint32_t met) {
            for (int lane = 0; lane < 16; ++lane) {
                rays += before.active[lane] != 0;
                leaks += before.active[lane] && !(met >> lane & 1u);
            }
        };
        EXPECT_EQ(forBlocks(world, grid, count), 0);
        EXPECT_EQ(leaks, 0);
        for (const float angle : {.001f, .37f, 2.0f}) {  // and anyhow, along edges and between
            const float c = std::cos(angle), s = std::sin(angle);
            bvh::PixelGrid turned = gridAt(grid.eye, {0, 0, -1}, width, height, .2f);
            turned.right = {c, s, 0}, turned.up = {-s, c, 0};
            EXPECT_EQ(forBlocks(world, turned, count), 0);
            EXPECT_EQ(forBlocks(world, turned, count, HUGE_VALF, RayKind::view, 4), 0);
        }
        EXPECT_EQ(rays, (4 + 3 * 4) * width * height);
        EXPECT_EQ(leaks, 0);
    }
}

TEST(PrimaryRays, DifferFromRaysOneByOneInNothingButRoundings) {
    SeenRoom room(true);
    std::uniform_real_distribution<float> unit(-1, 1);
    int rays = 0, others = 0;
    for (int camera = 0; camera < 8; ++camera) {
        const std::size_t samples = camera % 4 == 3 ? 2 : 1;
        const Vec3f eye(3 * unit(room.random), 2 * unit(room.random), 3 + 3 * unit(room.random));
        const bvh::PixelGrid grid = gridAt(eye, {unit(room.random), .5f * unit(room.random), -1}, 400, 300, .6f);
        const auto visit = [&](const RayPacket16& before, const RayPacket16& together, std::uint32_t) {
            RayPacket16 alone = before;
            (void)room.world.intersect(alone, true);
            for (int lane = 0; lane < 16; ++lane) {
                if (!before.active[lane]) continue;
                ++rays;
                const Hit a = room.world.hit(alone, lane), b = room.world.hit(together, lane);
                const bool same = a.instance == b.instance && std::abs(a.t - b.t) <= 1e-5f * a.t;
                others += !same && (a || b);
                if (same && a && a.triangle == b.triangle) {
                    EXPECT_NEAR(a.u, b.u, 2e-3f);
                    EXPECT_NEAR(a.v, b.v, 2e-3f);
                }
            }
        };
        (void)forBlocks(room.world, grid, visit, HUGE_VALF, RayKind::view, samples);
    }
    EXPECT_GT(rays, 900'000);
    // Rays that graze an edge; how many do depends on the width of Embree's kernels: 8 to 12 of 1,200,000.
    EXPECT_LE(others * 40'000, rays);
}

/// Most of them lie between the middles of pixels and are left out early; what is seen is there all the same.
TEST(PrimaryRays, FindTrianglesSmallerThanPixels) {
    std::mt19937 random(kPrimarySeed);
    for (const auto& [distance, halfAngle] : {std::pair(3.0, .4f), {40.0, .03f}, {4000.0, 3e-4f}}) {
        SCOPED_TRACE(distance);
        SeenRoom room(false);
        room.add(makeSphere(6), translation({.3, .1, .2}));
        room.add(makeBeams(random, 90, 40, .02f), scaling({.4, .5, .3}));
        room.build();
        bvh::PixelGrid grid = gridAt({0, 0, static_cast<float>(distance)}, {0, 0, -1}, 400, 300, halfAngle);
        for (const float angle : {0.0f, .6f}) {
            const float c = std::cos(angle), s = std::sin(angle);
            grid.right = {c, s, 0}, grid.up = {-s, c, 0};
            int rays = 0, hits = 0, others = 0;
            const auto visit = [&](const RayPacket16& before, const RayPacket16& together, std::uint32_t met) {
                RayPacket16 alone = before;
                const std::uint32_t expected = room.world.intersect(alone, true);
                for (int lane = 0; lane < 16; ++lane) {
                    if (!before.active[lane]) continue;
                    ++rays, hits += expected >> lane & 1u;
                    const bool same = ((expected ^ met) >> lane & 1u) == 0;
                    others += !same || !(std::abs(alone.tMax[lane] - together.tMax[lane]) <= 1e-4f * alone.tMax[lane]);
                }
            };
            EXPECT_EQ(forBlocks(room.world, grid, visit), 0);
            EXPECT_EQ(rays, 400 * 300);
            EXPECT_GT(hits, rays / 4);
            EXPECT_LE(others * 4000, rays) << others;
        }
    }
}

TEST(PrimaryRays, KnowEndsKindsAndWhatIsTakenAway) {
    SeenRoom room(false);
    const bvh::PixelGrid grid = gridAt({0, 0, 4}, {0, 0, -1}, 192, 144);
    const auto compare = [&](float tMax, RayKind kind) {
        int hits = 0;
        const auto visit = [&](const RayPacket16& before, const RayPacket16& together, std::uint32_t met) {
            RayPacket16 alone = before;
            const std::uint32_t expected = room.world.intersect(alone, true, kind);
            EXPECT_EQ(met, expected);
            for (std::uint32_t rest = met & expected; rest; rest &= rest - 1, ++hits) {
                const int lane = std::countr_zero(rest);
                EXPECT_EQ(room.world.hit(together, lane).instance, room.world.hit(alone, lane).instance);
            }
        };
        EXPECT_EQ(forBlocks(room.world, grid, visit, tMax, kind), 0);
        return hits;
    };
    const int all = compare(HUGE_VALF, RayKind::view), near = compare(5.5f, RayKind::view);
    EXPECT_GT(near, 1000);
    EXPECT_LT(near, all);
    // The ball is not seen, then not there; who asks before finds the ball of then.
    Instance unseen = room.truth.items[0].info;
    room.delta.removed.push_back(unseen.id);
    room.world.apply(room.delta);
    EXPECT_EQ(compare(HUGE_VALF, RayKind::view), all) << "the box is behind it";
    EXPECT_LT(compare(5.5f, RayKind::view), near);
}

TEST(PrimaryRays, LeaveTilesOfManyTrianglesToRays) {
    std::mt19937 random(kPrimarySeed);
    std::vector<std::int32_t> shuffled;
    const auto sphere = makeSphere(5);
    std::vector<std::uint32_t> order(sphere->triangleCount);
    for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
    std::ranges::shuffle(order, random);
    for (const std::uint32_t t : order)
        for (std::uint32_t c = 0; c < 3; ++c) shuffled.push_back(static_cast<std::int32_t>(sphere->vertexIndex(t, c)));
    RayWorld world;
    InstanceDelta delta;
    delta.geometries.push_back(
        {NodeId{1}, makeMesh({sphere->positions.begin(), sphere->positions.end()}, std::move(shuffled))});
    delta.added.push_back(makeInstance(0, NodeId{1}));
    world.apply(delta);
    EXPECT_FALSE(PrimaryRays(world, gridAt({0, 0, 4}, {0, 0, -1}, 48, 32))) << "fewer pixels than triangles";
    const PrimaryRays many(world, gridAt({0, 0, 30}, {0, 0, -1}, 320, 240));
    ASSERT_TRUE(many) << "all in a few tiles";
    bvh::TileHits tile;
    EXPECT_FALSE(many.find(10, 7, {&tile, 1}));
    EXPECT_TRUE(many.find(1, 1, {&tile, 1}));
    EXPECT_FALSE(PrimaryRays(world, gridAt({0, 0, .5f}, {0, 0, -1}, 320, 240))) << "every box in every tile";
    EXPECT_FALSE(PrimaryRays(RayWorld(), gridAt({0, 0, 4}, {0, 0, -1}, 640, 480)));
}

TEST(PrimaryRays, CountTheMemoryOfTheirClusters) {
    SeenRoom room(false);
    const RayWorld::Memory before = room.world.memory();
    ASSERT_TRUE(PrimaryRays(room.world, gridAt({0, 0, 4}, {0, 0, -1}, 320, 240)));
    const std::size_t more = room.world.memory().bvhBytes - before.bvhBytes;
    EXPECT_GE(more, before.triangles / bvh::Cluster::kTriangles * sizeof(bvh::Cluster));
    EXPECT_LE(more, before.triangles * 4 + 4096);
}

/// Whatever numbers a camera holds.
TEST(PrimaryRays, TakeNoCameraWithoutASpaceToLookInto) {
    SeenRoom room(false);
    bvh::PixelGrid grid = gridAt({0, 0, 4}, {0, 0, -1}, 64, 48);
    grid.up = grid.right;
    EXPECT_FALSE(PrimaryRays(room.world, grid));
    grid = gridAt({0, 0, 4}, {0, 0, -1}, 64, 48);
    grid.eye.x = std::numeric_limits<float>::quiet_NaN();
    const PrimaryRays nowhere(room.world, grid);
    bvh::TileHits tile;
    if (nowhere && nowhere.find(0, 0, {&tile, 1})) {
        RayPacket16 rays = raysOf(grid, 0, 0, 0);
        EXPECT_EQ(nowhere.intersect(rays, tile, 0), 0u);
    }
}

TEST(PrimaryRays, AreTheSameAtEveryWidth) {
    if (!bvh::primaryKernels16()) GTEST_SKIP() << "no AVX-512 here";
    std::mt19937 random(kPrimarySeed);
    const auto mesh = makeSoup(random, 400);
    const bvh::ClusteredMesh where{mesh->positions.data(), mesh->triangles.data(), mesh->triangleStride,
                                   mesh->triangleCount};
    std::vector<bvh::Cluster> clusters;
    std::vector<bvh::PrimaryHits::Seen> seen;
    for (std::uint32_t first = 0; first < mesh->triangleCount; first += 16) {
        seen.push_back({static_cast<std::uint32_t>(clusters.size()), HUGE_VALF, 0xffff});
        clusters.push_back({Vec3f(-2), 0, Vec3f(2), first});
    }
    int met = 0;
    for (int round = 0; round < 30; ++round) {
        const float angle = static_cast<float>(round) * .2f;
        const bvh::PixelGrid grid = gridAt({3 * std::sin(angle), .3f, 3 * std::cos(angle)},
                                           {-std::sin(angle), 0, -std::cos(angle)}, 16, 16, .3f);
        const bvh::TileFrame frame(grid, bvh::PictureRows(grid), 0, 0);
        bvh::TileHits tiles[2], more[2][3];
        const bvh::PrimaryKernels* kernels[] = {&bvh::primaryKernels8(), bvh::primaryKernels16()};
        for (int k = 0; k < 2; ++k)
            kernels[k]->find(frame, seen.data(), seen.data() + seen.size(), clusters.data(), &where, nullptr, &tiles[k],
                             1);
        ASSERT_EQ(std::memcmp(&tiles[0], &tiles[1], sizeof tiles[0]), 0);
        const bvh::TilePositions positions[3] = {anywhere(random), anywhere(random), anywhere(random)};
        for (int k = 0; k < 2; ++k)
            kernels[k]->find(frame, seen.data(), seen.data() + seen.size(), clusters.data(), &where, positions, more[k],
                             3);
        ASSERT_EQ(std::memcmp(more[0], more[1], sizeof more[0]), 0);
        for (int block = 0; block < 16; ++block) {
            RayPacket16 rays[2] = {raysOf(grid, 0, 0, block), raysOf(grid, 0, 0, block)};
            for (int k = 0; k < 2; ++k) {
                std::memset(rays[k].geom_, 0xff, sizeof rays[k].geom_);
                rays[k].skip(3);
                EXPECT_TRUE(kernels[k]->meet(tiles[k], block, rays[k].active, clusters.data(), &where, rays[k]));
            }
            ASSERT_EQ(std::memcmp(&rays[0], &rays[1], sizeof rays[0]), 0) << block;
            for (int lane = 0; lane < 16; ++lane) met += rays[0].hasHit(lane);
        }
    }
    EXPECT_GT(met, 3000);
}

}  // namespace
}  // namespace rtsg
