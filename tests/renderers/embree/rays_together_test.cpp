// Packets whose rays run together and packets whose rays do not: each meets what its rays meet one by one, whether
// told that it is coherent or not, whichever of its lanes are active.
#include "trees/rays_together.h"

#include <gtest/gtest.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr unsigned kTogetherSeed = 4091;

/// Shapes at rest and in motion, rotated and scaled, in a box.
struct TogetherRoom {
    RayWorld world;
    std::mt19937 random{kTogetherSeed};

    explicit TogetherRoom(bool rests) {
        InstanceDelta delta;
        const auto add = [&](std::shared_ptr<Mesh> mesh, const WorldFromLocal& m, Motion motion) {
            const auto slot = static_cast<std::uint32_t>(delta.added.size());
            Instance instance = makeInstance(slot, NodeId{10 + slot}, m);
            instance.motion = motion;
            delta.geometries.push_back({NodeId{10 + slot}, std::move(mesh)});
            delta.added.push_back(instance);
        };
        if (rests) add(makeBox(), scaling({9, 7, 11}), Motion::fixed);
        if (rests) add(makeSoup(random, 400), scaling({3, 3, 3}), Motion::fixed);
        for (int i = 0; i < 12; ++i) add(makeSoup(random, 60), randomTransform(random, 3), Motion::moving);
        world.apply(delta);
    }

    /// Sixteen rays from about one place into about one direction; `turned`, `apart`: by how much they differ.
    RayPacket16 packet(float turned, float apart) {
        std::uniform_real_distribution<float> unit(-1, 1);
        const auto vector = [&](float by) { return by * Vec3f(unit(random), unit(random), unit(random)); };
        const Vec3f origin = vector(3), direction = vector(1);
        RayPacket16 rays;
        const std::uint32_t lanes = random() % 4 == 0 ? 0xffff : random() & random();
        for (int lane = 0; lane < 16; ++lane) {
            const float tMax = random() % 4 == 0 ? 1.0f : HUGE_VALF;
            rays.set(lane, {origin + vector(apart), 0, direction + vector(turned), tMax});
            if (!(lanes >> lane & 1u)) rays.skip(lane);
        }
        return rays;
    }
};

TEST(RaysTogether, MeetWhatTheyMeetOneByOne) {
    for (const bool rests : {true, false}) {
        TogetherRoom room(rests);
        int asked = 0, met = 0, others = 0;
        for (int round = 0; round < 3000; ++round) {
            SCOPED_TRACE(testing::Message() << "seed " << kTogetherSeed << ", round " << round);
            const float turned[] = {0, .01f, .2f, .5f, 2}, apart[] = {0, 1e-3f, .05f, 1};
            const RayPacket16 rays = room.packet(turned[round % 5], apart[round % 4]);
            for (const bool coherent : {false, true}) {
                RayPacket16 traced = rays, shadows = rays;
                const std::uint32_t hits = room.world.intersect(traced, coherent),
                                    blocked = room.world.occluded(shadows, coherent, RayKind::view);
                for (int lane = 0; lane < 16; ++lane) {
                    if (!rays.active[lane]) {
                        EXPECT_FALSE((hits | blocked) >> lane & 1u);
                        continue;
                    }
                    const Hit one = room.world.intersect(rays.ray(lane));
                    const Hit together = hits >> lane & 1u ? room.world.hit(traced, lane) : Hit{};
                    ++asked, met += static_cast<bool>(one);
                    // Along the edges of triangles either may be met.
                    const bool same = static_cast<bool>(one) == static_cast<bool>(together) &&
                                      (!one || std::abs(one.t - together.t) <= 1e-5f * one.t);
                    others += !same || static_cast<bool>(one) != static_cast<bool>(blocked >> lane & 1u);
                }
            }
        }
        EXPECT_GT(met, asked / 5);
        EXPECT_LE(others * 20'000, asked) << asked;
    }
}

TEST(RaysTogether, AreToldByDirectionsAndOriginsOfActiveLanes) {
    alignas(64) std::int32_t valid[16];
    RayPacket16 rays;
    for (int lane = 0; lane < 16; ++lane) {
        const float at = static_cast<float>(lane);
        valid[lane] = -1;
        rays.set(lane, {Vec3f(.01f * at, 1, 2), 0, 5.0f * Vec3f(1, .02f * at, 0)});  // up to 17 degrees and .15 m
    }
    const float turned = .08435f, apart = .0225f;  // 1 - cos 16.7 and sin 16.7 degrees, squared and added; .15 squared
    const auto both = [&](float parallel, float nearby) { return bvh::runTogether(rays, valid, parallel, nearby); };
    EXPECT_TRUE(both(1.01f * turned, 1.01f * apart));
    EXPECT_FALSE(both(.99f * turned, 1.01f * apart));
    EXPECT_FALSE(both(1.01f * turned, .99f * apart));
    valid[15] = valid[0] = 0;  // both ends
    EXPECT_TRUE(both(.9f * turned, .9f * apart));
    rays.set(15, {Vec3f(NAN), 0, Vec3f(0)});
    EXPECT_TRUE(both(.9f * turned, .9f * apart));
    for (std::int32_t& v : valid) v = 0;
    EXPECT_FALSE(both(1, 1));
}

}  // namespace
}  // namespace rtsg
