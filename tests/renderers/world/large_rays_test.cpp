// Rays that a few large triangles are asked about first: what these tell, against the view and a loop over all
// triangles in double precision, and what they leave open.
#include "world/large_rays.h"

#include <bit>
#include <cstring>

#include <gtest/gtest.h>

#include "embree/large_triangles.h"
#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr unsigned kLargeSeed = 4021;

/// A turned room with a box, a mirrored wedge and, unless it is empty, a ball; all of it somewhere.
struct LargeRoom : CheckedWorld {
    std::mt19937 random{kLargeSeed};

    explicit LargeRoom(double size = 1, bool turned = true, bool ball = true) {
        WorldFromLocal all = turned ? randomTransform(random, 0) : scaling({1, 1, 1});
        for (int k = 0; k < 3; ++k) all[k] = glm::normalize(all[k]) * size;
        const auto transformed = [&](const WorldFromLocal& m) {
            return WorldFromLocal(glm::dmat4(all) * glm::dmat4(m));
        };
        add(makeBox(), transformed(scaling({4, 3, 5})));
        add(makeBox(), transformed(translation({-1.5, -2, 1.2}) * glm::dmat4(scaling({.6, .9, .5}))));
        add(makeMesh({{0, 0, 0}, {1, 0, .2}, {.3, 1, 0}, {.1, .2, 1}}, {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}),
            transformed(translation({.2, -2.8, -2}) * glm::dmat4(scaling({-1.1, .8, .9}))));
        if (ball) add(makeSphere(3), transformed(translation({1.5, -1, -.5})));
        world.apply(delta);
        delta = {};
    }
    /// Within the room or on a surface, whither it may be.
    RayPacket16 rays(float size, float tMax = HUGE_VALF) {
        std::uniform_real_distribution<float> unit(-1, 1);
        RayPacket16 packet;
        std::memset(&packet, 0x7f, sizeof packet);
        for (int lane = 0; lane < 16; ++lane) {
            Ray ray = randomRay(random, 2.5f * size);
            ray.direction = glm::normalize(ray.direction) * (tMax == 1 ? 4 * size : 1.0f);
            const Hit hit = world.intersect(ray);
            ray.tMin = 1e-30f;
            if (lane % 3 && hit) {
                const Vec3f towards = glm::normalize(Vec3f(unit(random), unit(random), unit(random)));
                ray.origin = RayView::leave(world.point(hit, ray), towards);
                ray.direction = towards * glm::length(ray.direction);
            }
            ray.tMax = tMax;
            packet.set(lane, ray);
            if (random() % 11 == 0) packet.skip(lane);
        }
        return packet;
    }
};

LargeRays::About bothSides(std::uint32_t slot) {
    return {LargeRays::kFront | LargeRays::kBack, false, static_cast<std::int32_t>(slot) + 70};
}
bvh::RayRows rowsOf(const RayPacket16& rays, std::uint32_t lanes) {
    return {{rays.originX, rays.originY, rays.originZ},
            {rays.directionX, rays.directionY, rays.directionZ},
            nullptr,
            rays.tMin[0],
            rays.tMax[0],
            lanes};
}
std::uint32_t activeLanes(const RayPacket16& rays) {
    std::uint32_t lanes = 0;
    for (int lane = 0; lane < 16; ++lane) lanes |= static_cast<std::uint32_t>(rays.active[lane] != 0) << lane;
    return lanes;
}

TEST(LargeRays, MeetWhatALoopOverAllTrianglesMeets) {
    for (const auto& [size, turned, ball] :
         {std::tuple(1.0, true, true), {1.0, false, true}, {1e-3, true, true}, {3e4, true, true}, {1.0, true, false}}) {
        SCOPED_TRACE(testing::Message() << "seed " << kLargeSeed << ", size " << size << ", " << turned << ball);
        LargeRoom room(size, turned, ball);
        const LargeRays large(room.world, bothSides);
        ASSERT_TRUE(large);
        int known = 0, left = 0, compared = 0;
        for (int p = 0; p < 1500; ++p) {
            const RayPacket16 before = room.rays(static_cast<float>(size));
            RayPacket16 rays, traced = before;
            bvh::LargeHits reported;
            std::uint32_t open = 0;
            const std::uint32_t active = activeLanes(before),
                                met = large.intersect(rowsOf(before, active), rays, reported, open);
            EXPECT_EQ(met & open, 0u);
            EXPECT_EQ((met | open) & ~active, 0u);
            (void)room.world.intersect(traced);
            const PacketHits16& hits = reported.hits;
            PacketHits16 asPacket;
            (void)room.world.hits(rays, met, asPacket);
            for (std::uint32_t rest = active; rest; rest &= rest - 1) {
                const int lane = std::countr_zero(rest);
                ++(open >> lane & 1u ? left : known);
                if (open >> lane & 1u) continue;
                const Hit hit = room.world.hit(traced, lane);
                ASSERT_EQ(bool(hit), (met >> lane & 1u) != 0);
                if (!hit) continue;
                EXPECT_EQ(hit.instance, hits.instance[lane]);
                EXPECT_EQ(hit.triangle, hits.triangle[lane]);
                EXPECT_EQ(reported.label[lane], static_cast<std::int32_t>(hit.instance) + 70);
                const Hit own = room.world.hit(rays, lane);
                EXPECT_EQ(own.instance, hits.instance[lane]);
                EXPECT_EQ(own.triangle, hits.triangle[lane]);
                EXPECT_EQ(own.u, hits.u[lane]);
                EXPECT_EQ(own.v, hits.v[lane]);
                EXPECT_GT(glm::dot(hit.normal, own.normal), .99999f);
                EXPECT_EQ(asPacket.instance[lane], hits.instance[lane]);
                EXPECT_NEAR(hit.t, rays.tMax[lane], 4e-5 * size);
                EXPECT_GT(glm::dot(hit.normal, Vec3f(hits.normalX[lane], hits.normalY[lane], hits.normalZ[lane])),
                          .99999f);
                const BruteForce::Answer expected = room.truth.intersect(before.ray(lane), room.world.origin());
                if (expected.margin < 1e-4) continue;
                ++compared;
                EXPECT_EQ(expected.instance, hits.instance[lane]);
                EXPECT_EQ(expected.triangle, hits.triangle[lane]);
                EXPECT_NEAR(expected.t, rays.tMax[lane], 4e-5 * size);
                EXPECT_NEAR(expected.u, hits.u[lane], 2e-5);
                EXPECT_NEAR(expected.v, hits.v[lane], 2e-5);
            }
        }
        EXPECT_GT(known, ball ? 4 * left : 50 * left) << left;
        EXPECT_GT(compared, 8000);
    }
}

TEST(LargeRays, AreBlockedByWhatNothingComesThrough) {
    LargeRoom room;
    const auto sides = [](std::uint32_t slot) {
        return slot == 0 ? LargeRays::kBack : slot < 3 ? LargeRays::kFront : 0;
    };
    const LargeRays large(room.world, [&](std::uint32_t slot) { return LargeRays::About{sides(slot), false, 0}; });
    ASSERT_TRUE(large);
    int blockedRays = 0, freeRays = 0, left = 0;
    for (int p = 0; p < 3000; ++p) {
        const RayPacket16 rays = room.rays(1, 1);
        std::uint32_t open = 0;
        const std::uint32_t active = activeLanes(rays), blocked = large.occluded(rowsOf(rays, active), open);
        EXPECT_EQ(blocked & open, 0u);
        EXPECT_EQ((blocked | open) & ~active, 0u);
        for (std::uint32_t rest = active; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            Ray ray = rays.ray(lane);
            // Whether anything is on the way, and whether it is something that nothing comes through from there.
            bool any = false, stops = false;
            while (const Hit hit = room.world.intersect(ray)) {
                any = true;
                const bool fromBack = glm::dot(hit.normal, ray.direction) > 0;
                stops |= (sides(hit.instance) & (fromBack ? LargeRays::kBack : LargeRays::kFront)) != 0;
                ray.tMin = std::nextafter(hit.t * (1 + 0x1p-20f), HUGE_VALF);
            }
            if (blocked >> lane & 1u) {
                EXPECT_TRUE(stops);
                ++blockedRays;
            } else if (open >> lane & 1u) {
                ++left;
            } else {
                EXPECT_FALSE(any);
                ++freeRays;
            }
        }
    }
    EXPECT_GT(blockedRays, 5000);
    EXPECT_GT(freeRays, 5000);
    EXPECT_LT(left, (blockedRays + freeRays) / 2);
}

/// Rays at edges, corners and from within planes: the view has the last word.
TEST(LargeRays, LeaveOpenWhatRoundingsDecide) {
    LargeRoom room(1, false, false);
    const LargeRays large(room.world, bothSides);
    ASSERT_TRUE(large);
    std::uniform_real_distribution<float> unit(-1, 1);
    for (int p = 0; p < 300; ++p) {
        RayPacket16 rays;
        for (int lane = 0; lane < 16; ++lane) {
            const Vec3f from(2 * unit(room.random), unit(room.random), 3 * unit(room.random));
            // Along the edges of the room, the diagonals of its walls, its corners.
            Vec3f to(4, 3, 5 * unit(room.random));
            if (lane % 3 == 1) to = {4 * unit(room.random), 3, 5}, to.x = std::abs(to.x);
            if (lane % 3 == 2) to = {-4, 3, 5};
            rays.set(lane, {from, 0, to - from});
        }
        std::uint32_t open = 0;
        bvh::LargeHits reported;
        RayPacket16 traced;
        const std::uint32_t met = large.intersect(rowsOf(rays, 0xFFFF), traced, reported, open);
        // Things in front of them are hit all the same.
        for (std::uint32_t rest = met; rest; rest &= rest - 1) EXPECT_LT(traced.tMax[std::countr_zero(rest)], .999f);
        EXPECT_EQ(met | open, 0xFFFFu);
    }
    // Two sheets in one place, and one that rays start in.
    RayWorld world;
    InstanceDelta delta;
    const auto sheet = makeMesh({{-1, -1, 0}, {1, -1, 0}, {0, 2, 0}}, {0, 1, 2});
    for (std::uint32_t slot = 0; slot < 2; ++slot) {
        delta.geometries.push_back({NodeId{10 + slot}, sheet});
        delta.added.push_back(makeInstance(slot, NodeId{10 + slot}));
    }
    world.apply(delta);
    const LargeRays sheets(world, bothSides);
    ASSERT_TRUE(sheets);
    RayPacket16 rays;
    for (int lane = 0; lane < 16; ++lane)
        rays.set(lane, {{.1f, .1f, lane < 8 ? 1.0f : -1e-7f}, 0, {0, 0, lane < 8 ? -1.0f : 1.0f}});
    std::uint32_t open = 0;
    bvh::LargeHits reported;
    RayPacket16 traced;
    EXPECT_EQ(sheets.intersect(rowsOf(rays, 0xFFFF), traced, reported, open), 0u);
    EXPECT_EQ(open, 0xFFFFu);
}

TEST(LargeRays, AreTheSameInRegistersOfAnyWidth) {
    const bvh::LargeKernels* const wide = bvh::largeKernels16();
    if (!wide) GTEST_SKIP() << "this machine has registers of one width";
    LargeRoom room;
    const LargeRays large(room.world, bothSides);
    ASSERT_TRUE(large);
    for (int p = 0; p < 500; ++p) {
        const RayPacket16 before = room.rays(1, p % 2 ? 1 : HUGE_VALF);
        const bvh::RayRows rows = rowsOf(before, activeLanes(before));
        RayPacket16 a, b;
        bvh::LargeHits reportedA, reportedB;
        std::uint32_t openA = 0, openB = 0;
        const std::uint32_t met = bvh::largeKernels8().intersect(large.table(), rows, a, reportedA, openA);
        ASSERT_EQ(met, wide->intersect(large.table(), rows, b, reportedB, openB));
        ASSERT_EQ(openA, openB);
        for (std::uint32_t rest = met; rest; rest &= rest - 1) {
            const int i = std::countr_zero(rest);
            EXPECT_EQ(a.tMax[i], b.tMax[i]);
            EXPECT_EQ(a.u_[i], b.u_[i]);
            EXPECT_EQ(a.v_[i], b.v_[i]);
            EXPECT_EQ(a.prim_[i], b.prim_[i]);
            EXPECT_EQ(a.geom_[i], b.geom_[i]);
            EXPECT_EQ(a.normalX_[i], b.normalX_[i]);
            EXPECT_EQ(reportedA.hits.instance[i], reportedB.hits.instance[i]);
            EXPECT_EQ(reportedA.label[i], reportedB.label[i]);
        }
        EXPECT_EQ(bvh::largeKernels8().occluded(large.table(), rows, openA),
                  wide->occluded(large.table(), rows, openB));
        EXPECT_EQ(openA, openB);
    }
}

TEST(LargeRays, PayWhereFewTrianglesAreMostOfWhatThereIs) {
    EXPECT_FALSE(LargeRays(RayWorld(), bothSides));
    RayWorld ball;
    InstanceDelta delta;
    delta.geometries.push_back({NodeId{1}, makeSphere(3)});
    delta.added.push_back(makeInstance(0, NodeId{1}));
    ball.apply(delta);
    EXPECT_FALSE(LargeRays(ball, bothSides)) << "too many";
    // A ball as large as the room, and one that moves through all of it.
    LargeRoom room(1, true, false);
    EXPECT_TRUE(LargeRays(room.world, bothSides));
    room.add(makeSphere(3), scaling({3.9, 2.9, 4.9}));
    room.world.apply(room.delta);
    EXPECT_FALSE(LargeRays(room.world, bothSides));
    for (const double radius : {.5, 3.9}) {
        LargeRoom moving(1, true, false);
        moving.add(makeSphere(3), scaling({radius, radius * .7, radius * 1.2}), Motion::moving);
        moving.world.apply(moving.delta);
        EXPECT_EQ(bool(LargeRays(moving.world, bothSides)), radius < 1);
    }
}

/// A ball bulges everywhere: rays that leave its front do not meet it again, others may.
TEST(LargeRays, KnowWhatLeavesABulge) {
    LargeRoom room(1, false);
    const LargeRays large(room.world, bothSides);
    ASSERT_TRUE(large);
    LargeRoom dented(1, false, false);
    auto dent = makeSphere(3);
    std::vector<Vec3f> positions(dent->positions.begin(), dent->positions.end());
    positions[2] *= .9f;
    dented.add(makeMesh(positions, {dent->triangles.begin(), dent->triangles.end()}), scaling({.9, .9, .9}));
    dented.world.apply(dented.delta);
    const LargeRays withDent(dented.world, bothSides);
    ASSERT_TRUE(withDent);
    EXPECT_EQ(large.table().convex[0], 3u);
    EXPECT_EQ(withDent.table().convex[0], bvh::LargeTable::kNone);
    int known = 0;
    for (int p = 0; p < 1000; ++p) {
        RayPacket16 from = room.rays(1);
        alignas(64) float front[16];
        for (int lane = 0; lane < 16; ++lane) front[lane] = std::bit_cast<float>(bvh::LargeTable::kNone);
        for (int lane = 0; lane < 16; ++lane) {
            // From the ball's own surface, outwards.
            Ray ray = from.ray(lane);
            ray.direction = Vec3f(room.world.instance(3).rayFromLocal[3]) - ray.origin;
            const Hit hit = room.world.intersect(ray);
            if (hit.instance != 3 || glm::dot(hit.normal, ray.direction) > 0) continue;
            Vec3f towards = glm::normalize(from.ray(lane).direction);
            if (glm::dot(towards, hit.normal) < 0) towards = -towards;
            from.set(lane, {RayView::leave(room.world.point(hit, ray), towards), 1e-30f, towards});
            front[lane] = std::bit_cast<float>(3u);
        }
        RayPacket16 rays, traced = from;
        bvh::LargeHits reported;
        std::uint32_t open = 0, openAll = 0;
        bvh::RayRows rows = rowsOf(from, 0xFFFF);
        (void)large.intersect(rows, rays, reported, openAll);
        rows.front = front;
        const std::uint32_t met = large.intersect(rows, rays, reported, open);
        EXPECT_EQ(open & ~openAll, 0u);
        (void)room.world.intersect(traced);
        for (std::uint32_t rest = openAll & ~open; rest; rest &= rest - 1, ++known) {
            const int lane = std::countr_zero(rest);
            const Hit hit = room.world.hit(traced, lane);
            ASSERT_TRUE(met >> lane & 1u);
            EXPECT_EQ(hit.instance, reported.hits.instance[lane]);
            EXPECT_NEAR(hit.t, rays.tMax[lane], 4e-5);
        }
    }
    EXPECT_GT(known, 1000);
}

/// A moving thing is a box; rays that hit the box are traced.
TEST(LargeRays, LeaveOpenWhatMayMeetWhatMoves) {
    LargeRoom room(1, true, false);
    room.add(makeSphere(2), translation({.5, 0, .5}), Motion::moving);
    room.world.apply(room.delta);
    const LargeRays large(room.world, bothSides);
    ASSERT_TRUE(large);
    int ofBall = 0;
    for (int p = 0; p < 1000; ++p) {
        const RayPacket16 before = room.rays(1);
        RayPacket16 rays;
        bvh::LargeHits reported;
        std::uint32_t open = 0;
        (void)large.intersect(rowsOf(before, activeLanes(before)), rays, reported, open);
        for (std::uint32_t rest = activeLanes(before) & ~open; rest; rest &= rest - 1)
            EXPECT_NE(room.world.intersect(before.ray(std::countr_zero(rest))).instance, 3u);
        for (std::uint32_t rest = open; rest; rest &= rest - 1)
            ofBall += room.world.intersect(before.ray(std::countr_zero(rest))).instance == 3;
    }
    EXPECT_GT(ofBall, 500);
}

}  // namespace
}  // namespace rtsg
