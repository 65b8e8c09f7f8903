// Things that move together become one object, resting things are merged, and changes between the two cost little.
#include <gtest/gtest.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr std::uint32_t kBodiesSeed = 20090617;

/// A room of 200 boxes on a grid, slots 0 to 199.
struct Room {
    RayWorld world;
    BruteForce truth;
    std::mt19937 random{kBodiesSeed};
    std::map<std::uint32_t, std::shared_ptr<Mesh>> meshes;

    explicit Room(const RayWorld::Options& options, std::uint32_t boxes = 200) : world(options) {
        InstanceDelta delta;
        for (std::uint32_t i = 0; i < boxes; ++i)
            add(delta, i, translation({3.0 * (i % 15), 3.0 * (i / 15), 0}), makeBox());
        world.apply(delta);
    }
    Instance& add(InstanceDelta& delta, std::uint32_t slot, const WorldFromLocal& m, std::shared_ptr<Mesh> mesh) {
        const NodeId node{slot + 1};
        meshes[slot] = mesh;
        delta.geometries.push_back({node, mesh});
        delta.added.push_back(makeInstance(slot, node, m));
        truth.items[slot] = {delta.added.back(), mesh};
        return delta.added.back();
    }
    void moveTo(InstanceDelta& delta, std::uint32_t slot, const WorldFromLocal& m) {
        truth.items.at(slot).info.worldFromLocal = m;
        delta.moved.push_back({truth.items.at(slot).info.id, m});
    }
    void rest(unsigned frames) {
        for (unsigned i = 0; i < frames; ++i) world.apply({});
    }
    void compare() { expectSameHits(world, truth, random, 20, 30, 1e-4); }
};

TEST(RayWorldBodies, AHundredShapesBelowOneMovingTransformAreOneObject) {
    Room room({});
    InstanceDelta delta;
    std::vector<WorldFromLocal> parts;
    for (std::uint32_t i = 0; i < 100; ++i) {
        parts.push_back(randomTransform(room.random, 4));
        Instance& part = room.add(delta, 200 + i, parts.back(), i % 2 ? makeBox() : makeSphere(2));
        part.motion = Motion::moving;
        part.rigid = 7;
    }
    room.world.apply(delta);
    EXPECT_EQ(room.world.stats().bodies, 1u);
    const std::size_t bvh = room.world.memory().bvhBytes;
    room.compare();
    for (int frame = 0; frame < 30; ++frame) {
        const WorldFromLocal car = randomTransform(room.random, 20);
        delta = {};
        for (std::uint32_t i = 0; i < 100; ++i) room.moveTo(delta, 200 + i, compose(car, parts[i]));
        room.world.apply(delta);
        if (frame % 10 == 0) room.compare();
    }
    const RayWorld::Stats stats = room.world.stats();
    EXPECT_EQ(stats.bodiesBuilt, 1u);
    EXPECT_EQ(stats.bodies, 1u);
    EXPECT_EQ(stats.baked, 300u);
    EXPECT_EQ(room.world.memory().bvhBytes, bvh) << "moving builds nothing";
}

TEST(RayWorldBodies, APartThatGoesItsOwnWayLeavesTheBody) {
    Room room({});
    InstanceDelta delta;
    std::vector<WorldFromLocal> parts;
    for (std::uint32_t i = 0; i < 20; ++i) {
        parts.push_back(randomTransform(room.random, 4));
        Instance& part = room.add(delta, 200 + i, parts.back(), makeBox());
        part.motion = Motion::moving;
        part.rigid = 7;
    }
    room.world.apply(delta);
    for (int frame = 0; frame < 50; ++frame) {
        const WorldFromLocal car = randomTransform(room.random, 10);
        parts[3] = randomTransform(room.random, 4);
        delta = {};
        for (std::uint32_t i = 0; i < 20; ++i) room.moveTo(delta, 200 + i, compose(car, parts[i]));
        room.world.apply(delta);
        if (frame % 10 == 0) room.compare();
    }
    EXPECT_EQ(room.world.stats().bodies, 1u);
    EXPECT_EQ(room.world.stats().bodiesBuilt, 1u);
    EXPECT_EQ(room.world.stats().baked, 219u);
    // All but a few stay where they are.
    delta = {};
    for (std::uint32_t i = 4; i < 7; ++i) room.moveTo(delta, 200 + i, randomTransform(room.random, 10));
    room.world.apply(delta);
    room.compare();
    EXPECT_EQ(room.world.stats().baked, 216u);
    EXPECT_EQ(room.world.stats().bodiesBuilt, 1u);
}

TEST(RayWorldBodies, WhatRestsForLongIsMergedInTheBackground) {
    for (const bool background : {true, false}) {
        Room room({.restFrames = 32, .background = background});
        EXPECT_EQ(room.world.stats().groups, 1u);
        InstanceDelta delta;
        room.add(delta, 200, translation({5, 5, 5}), makeSphere(3));
        room.world.apply(delta);
        EXPECT_EQ(room.world.stats().baked, 200u) << "one addition costs what it touches";
        room.rest(20);
        room.world.finishBackgroundWork();
        EXPECT_EQ(room.world.stats().merges, 0u);
        room.rest(30);
        if (!background) {
            EXPECT_EQ(room.world.stats().merges, 0u) << "without a thread only finishBackgroundWork() builds";
        }
        room.world.finishBackgroundWork();
        const RayWorld::Stats stats = room.world.stats();
        EXPECT_EQ(stats.merges, 1u);
        EXPECT_EQ(stats.groups, 1u);
        EXPECT_EQ(stats.baked, 201u);
        room.compare();
    }
}

TEST(RayWorldBodies, ARestingOneThatMovesIsTakenOutAlone) {
    Room room({.restFrames = 32, .background = false});
    InstanceDelta delta;
    room.moveTo(delta, 17, translation({4, 4, 4}));
    room.world.apply(delta);
    RayWorld::Stats stats = room.world.stats();
    EXPECT_EQ(stats.groupsBuilt, 0u) << "nothing else is built in that frame";
    EXPECT_EQ(stats.splits, 1u);
    EXPECT_EQ(stats.baked, 199u);
    room.compare();
    for (int i = 0; i < 40; ++i) {
        delta = {};
        room.moveTo(delta, 17, translation({4.0 + i, 4, 4}));
        room.world.apply(delta);
    }
    room.world.finishBackgroundWork();
    EXPECT_EQ(room.world.stats().merges, 0u) << "it has not rested";
    room.compare();
    // Once it was wrong to merge it, so that it must rest twice as long.
    room.rest(50);
    room.world.finishBackgroundWork();
    EXPECT_EQ(room.world.stats().merges, 0u);
    room.rest(30);
    room.world.finishBackgroundWork();
    EXPECT_EQ(room.world.stats().merges, 1u);
    EXPECT_EQ(room.world.stats().baked, 200u);
    room.compare();
}

// Resting a little longer than is asked for, moving once, over and over: the worst that can be done.
TEST(RayWorldBodies, AThousandFlapsRebuildAFewTimes) {
    Room room({.restFrames = 8, .background = false});
    for (const unsigned period : {1u, 20u}) {
        const std::size_t before = room.world.stats().merges;
        for (int flap = 0; flap < 1000; ++flap) {
            InstanceDelta delta;
            room.moveTo(delta, 17 + period, translation({4.0 + flap % 7, 4, 4}));
            room.world.apply(delta);
            room.rest(period - 1);
            room.world.finishBackgroundWork();
        }
        // It is merged after 8, 16, 32 ... frames of rest; with 20 frames to rest in, that is at most twice. A thing
        // that moves in every frame is never merged.
        EXPECT_LE(room.world.stats().merges - before, period == 1 ? 0u : 2u) << period;
    }
    room.compare();
    // With ever longer rests it is merged again and again, but half as often each time, eight times over.
    const std::size_t before = room.world.stats().merges;
    int flaps = 0;
    for (unsigned frames = 0; frames < 40000; ++flaps) {
        InstanceDelta delta;
        room.moveTo(delta, 60, translation({4.0 + flaps % 7, 4, 4}));
        room.world.apply(delta);
        const std::size_t merges = room.world.stats().merges;
        for (++frames; frames < 40000 && room.world.stats().merges == merges; ++frames) {
            room.world.apply({});
            room.world.finishBackgroundWork();
        }
    }
    EXPECT_LE(room.world.stats().merges - before, 8u + 40000 / (8 * 256)) << flaps;
    EXPECT_GE(room.world.stats().merges - before, 8u);
    room.compare();
}

TEST(RayWorldBodies, PartsThatArriveOneByOneBecomeOneGroup) {
    Room room({.restFrames = 16, .background = false}, 0);
    for (std::uint32_t slot = 0; slot < 300; ++slot) {
        InstanceDelta delta;
        room.add(delta, slot, translation({3.0 * (slot % 15), 3.0 * (slot / 15), 0}), makeBox());
        room.world.apply(delta);
        room.world.finishBackgroundWork();
    }
    for (int i = 0; i < 4; ++i) {
        room.rest(40);
        room.world.finishBackgroundWork();
    }
    const RayWorld::Stats stats = room.world.stats();
    EXPECT_EQ(stats.groups, 1u);
    EXPECT_EQ(stats.baked, 300u);
    EXPECT_LE(stats.merges, 30u);
    room.compare();
}

// The box is 300 m away in the same body, whose frame is that much coarser than the sphere.
TEST(RayWorldBodies, LeavingRaysDoNotHitTheSurfaceOfABody) {
    std::mt19937 random(kBodiesSeed);
    for (const double offset : {0.0, 1e4, 1e6}) {
        SCOPED_TRACE(testing::Message() << offset << " seed " << kBodiesSeed);
        RayWorld world;
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, makeSphere(3)});
        delta.geometries.push_back({NodeId{2}, makeBox()});
        delta.geometries.push_back({NodeId{3}, makeBox()});
        // A third one at 0 keeps the origin there: the worst case for float.
        delta.added.push_back(makeInstance(2, NodeId{3}, translation({0, 0, -50})));
        const WorldFromLocal body = compose(translation({offset, 0, 0}), randomTransform(random, 0));
        delta.added.push_back(makeInstance(0, NodeId{1}, body));
        delta.added.push_back(makeInstance(1, NodeId{2}, compose(body, translation({300, 0, 0}))));
        for (std::uint32_t i : {1u, 2u}) {
            delta.added[i].motion = Motion::moving;
            delta.added[i].rigid = 1;
        }
        world.apply(delta);
        ASSERT_EQ(world.stats().bodies, 1u);
        int hits = 0, falseHits = 0;
        for (int i = 0; i < 20000; ++i) {
            Ray ray = randomRay(random, 3);
            ray.origin.x += static_cast<float>(offset);
            ray.direction = Vec3f(static_cast<float>(offset), 0, 0) - ray.origin + .5f * ray.direction;
            const Hit hit = world.intersect(ray);
            if (!hit || hit.instance != 0) continue;
            ++hits;
            const HitPoint point = world.point(hit);
            const Vec3f outwards = hit.normal + .9f * glm::normalize(randomRay(random, 1).direction);
            const Hit again = world.intersect({RayWorld::leave(point, outwards), 0, outwards, 1});
            falseHits += again && again.instance == 0 && again.triangle == hit.triangle;
        }
        EXPECT_GT(hits, 100);
        EXPECT_EQ(falseHits, 0) << "of " << hits;
    }
}

}  // namespace
}  // namespace rtsg
