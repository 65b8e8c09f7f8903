// Openings of rooms: places, sizes and shares against closed forms; several at a time; none where there are none.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "geometry/world_geometry.h"
#include "rays/acoustic_tracer.h"

namespace rtsg {
namespace {

AcousticMaterial matte(double absorption, double transmission = 0) {
    return {allBands(absorption), allBands(1), allBands(transmission)};
}

using Quad = std::array<Vec3f, 4>;

std::shared_ptr<Mesh> meshOf(const std::vector<Quad>& quads, const std::vector<std::array<Vec3f, 3>>& triangles = {}) {
    auto mesh = std::make_shared<Mesh>();
    const auto add = [&](const Vec3f& p) {
        mesh->positions.push_back(p);
        mesh->bounds.extend(p);
        return static_cast<std::int32_t>(mesh->positions.size() - 1);
    };
    for (const Quad& q : quads) {
        const std::int32_t a = add(q[0]), b = add(q[1]), c = add(q[2]), d = add(q[3]);
        for (const std::int32_t corner : {a, b, c, a, c, d}) mesh->triangles.push_back(corner);
        mesh->triangleCount += 2;
    }
    for (const auto& t : triangles) {
        for (const Vec3f& corner : t) mesh->triangles.push_back(add(corner));
        ++mesh->triangleCount;
    }
    return mesh;
}

/// The faces of a box: x low, x high, y low, y high, z low, z high.
std::vector<Quad> facesOf(const Vec3f& low, const Vec3f& high) {
    const auto at = [&](int i) {
        return Vec3f(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
    };
    return {{at(0), at(4), at(6), at(2)}, {at(1), at(3), at(7), at(5)}, {at(0), at(1), at(5), at(4)},
            {at(2), at(6), at(7), at(3)}, {at(0), at(2), at(3), at(1)}, {at(4), at(5), at(7), at(6)}};
}

/// A face at x with a rectangle in y and z left out: four strips that share their corners with each other.
void addFaceWithHole(std::vector<Quad>& quads, float x, glm::vec2 low, glm::vec2 high, glm::vec2 from, glm::vec2 to) {
    const auto at = [&](float y, float z) { return Vec3f(x, y, z); };
    quads.push_back({at(low.x, low.y), at(high.x, low.y), at(to.x, from.y), at(from.x, from.y)});
    quads.push_back({at(high.x, low.y), at(high.x, high.y), at(to.x, to.y), at(to.x, from.y)});
    quads.push_back({at(high.x, high.y), at(low.x, high.y), at(from.x, to.y), at(to.x, to.y)});
    quads.push_back({at(low.x, high.y), at(low.x, low.y), at(from.x, from.y), at(from.x, to.y)});
}

struct LeakyRoom {
    RayWorld world;
    Walls walls;
    WorldGeometry geometry;
    InstanceDelta delta;
    std::uint32_t next = 0;
    TraceResult traced;

    explicit LeakyRoom(const AcousticMaterial& material = matte(.1)) : walls(world, material) {}

    void add(std::shared_ptr<const Mesh> mesh) {
        const NodeId node{1 + next};
        delta.geometries.push_back({node, std::move(mesh)});
        Instance instance;
        instance.id = {next++, 0};
        instance.shape = NodeId{100 + next};
        instance.geometry = node;
        instance.worldFromLocal = WorldFromLocal(1.0);
        delta.added.push_back(instance);
    }
    void addBox(const Vec3f& low, const Vec3f& high) { add(meshOf(facesOf(low, high))); }
    RoomOpenings find(const glm::dvec3& source, std::uint64_t rays = 20'000, std::uint64_t seed = 1) {
        world.apply(delta);
        walls.apply(delta);
        delta.clear();
        geometry.follow(walls.freeze(), world);
        TraceOptions options;
        options.rays = rays;
        options.seed = seed;
        options.imageOrder = 0;
        options.diffractionOrder = 0;
        options.connectedOrder = 0;
        options.air.absorbs = false;
        options.exits = 64;
        const glm::dvec3 listener = source + glm::dvec3(.4, .3, .2);
        traced = AcousticTracer(geometry).trace(source, listener, options);
        return geometry.openings(source, traced.exits, traced.escaped);
    }
};

constexpr glm::dvec3 kInside{2, 1.5, 1.2};

/// The six slabs of a room, of 20 cm but for one of 2 cm, of which one is short by a gap along a wall of 3 m.
std::vector<std::array<Vec3f, 2>> slabsWithGap(float gap) {
    return {{Vec3f(-.2f, -.2f, -.2f), Vec3f(6.2f, 5.2f, 0)}, {Vec3f(-.2f, -.2f, 3), Vec3f(6.2f, 5.2f, 3.2f)},
            {Vec3f(-.2f, -.2f, 0), Vec3f(0, 5.2f, 3)},       {Vec3f(6, 0, 0), Vec3f(6.02f, 5, 3)},
            {Vec3f(0, -.2f, 0), Vec3f(6.02f, -gap, 3)},      {Vec3f(0, 5, 0), Vec3f(6.02f, 5.2f, 3)}};
}

/// A hole of 30 by 20 cm in the wall at x = 6 takes its area's share of what walls take.
TEST(RoomOpenings, AHoleHasItsShareItsPlaceAndItsArea) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        LeakyRoom room;
        std::vector<Quad> quads = facesOf({0, 0, 0}, {6, 5, 3});
        quads.erase(quads.begin() + 1);
        addFaceWithHole(quads, 6, {0, 0}, {5, 3}, {3, 1}, {3.3f, 1.2f});
        room.add(meshOf(quads));
        const RoomOpenings found = room.find(kInside, 40'000, seed);
        EXPECT_TRUE(found.leak) << seed;
        EXPECT_FALSE(found.triangle);
        EXPECT_NEAR(found.area, .06, 1e-4) << seed;
        EXPECT_LT(glm::distance(found.center, glm::dvec3(6, 3.15, 1.1)), 1e-3) << seed;
        EXPECT_NEAR(found.escaped / (.06 / (.06 + .1 * 125.94)), 1, .25) << seed;
        EXPECT_GT(found.fraction, .9 * found.escaped) << seed;
        EXPECT_LE(found.fraction, found.escaped * 1.0001) << seed;
        ASSERT_EQ(found.beside.size(), 1u);
        EXPECT_EQ(found.beside[0].shape, NodeId{101});
    }
}

TEST(RoomOpenings, AForgottenTriangleIsALeakWhateverItsSize) {
    LeakyRoom room;
    std::vector<Quad> quads = facesOf({0, 0, 0}, {6, 5, 3});
    const Quad cut = quads[1];
    quads.erase(quads.begin() + 1);
    room.add(meshOf(quads, {{cut[0], cut[1], cut[2]}}));
    const RoomOpenings found = room.find(kInside);
    EXPECT_TRUE(found.leak);
    EXPECT_TRUE(found.triangle);
    EXPECT_NEAR(found.area, 7.5, 1e-3);
    EXPECT_NEAR(found.escaped / (7.5 / (7.5 + .1 * 118.5)), 1, .15);  // all of it is at one end
}

/// One slab is 1, 3 or 30 mm short: what is beside is this one and the next, and it is a crack all the way.
TEST(RoomOpenings, ACrackBetweenShapesIsFoundAllItsLength) {
    for (const float gap : {.001f, .003f, .03f})
        for (std::uint64_t seed = 1; seed <= 4; ++seed) {
            LeakyRoom room(matte(.02));
            for (const auto& slab : slabsWithGap(gap)) room.addBox(slab[0], slab[1]);
            const RoomOpenings found = room.find(kInside, 20'000, seed);
            ASSERT_GT(found.fraction, 0) << gap << ' ' << seed;
            EXPECT_TRUE(found.leak) << gap << ' ' << seed;
            EXPECT_NEAR(found.length, 3, .03) << gap << ' ' << seed;
            // Across, or from the inner edge of one to the outer edge of the other.
            EXPECT_GT(found.width, .97 * gap) << gap << ' ' << seed;
            EXPECT_LT(found.width, 1.05 * std::hypot(gap, gap > .01f ? .02 : 0)) << gap << ' ' << seed;
            EXPECT_LT(glm::distance(glm::dvec2(found.center), glm::dvec2(6.01, -gap / 2)), .012) << gap << ' ' << seed;
            EXPECT_NEAR(found.center.z, 1.5, .03) << gap << ' ' << seed;
            std::vector<std::uint32_t> beside;
            for (std::size_t i = 0; i < 2 && i < found.beside.size(); ++i)
                beside.push_back(found.beside[i].shape.value);
            std::sort(beside.begin(), beside.end());
            EXPECT_EQ(beside, (std::vector<std::uint32_t>{104, 105})) << gap << ' ' << seed;
        }
}

/// A door and two holes: the door is found, which takes most, and is no leak.
TEST(RoomOpenings, OfSeveralTheOneThatTakesMost) {
    LeakyRoom room;
    std::vector<Quad> quads = facesOf({0, 0, 0}, {6, 5, 3});
    quads.erase(quads.begin(), quads.begin() + 2);
    addFaceWithHole(quads, 6, {0, 0}, {5, 3}, {3, 1}, {3.3f, 1.3f});
    addFaceWithHole(quads, 0, {0, 0}, {2.5f, 3}, {.5f, 2}, {.9f, 2.2f});
    const auto wall = [](float y0, float y1, float z0, float z1) {
        return Quad{Vec3f(0, y0, z0), Vec3f(0, y1, z0), Vec3f(0, y1, z1), Vec3f(0, y0, z1)};
    };
    quads.push_back(wall(2.5f, 3, 0, 3));
    quads.push_back(wall(4, 5, 0, 3));
    quads.push_back(wall(3, 4, 2, 3));
    room.add(meshOf(quads));
    const RoomOpenings found = room.find(kInside, 40'000);
    EXPECT_FALSE(found.leak);
    EXPECT_NEAR(found.area, 2, .02);
    EXPECT_LT(glm::distance(found.center, glm::dvec3(0, 3.5, 1)), .02);
    EXPECT_NEAR(found.fraction / (2 / (2 + .17 + .1 * (126 - 2.17))), 1, .15);
    EXPECT_LT(found.fraction, found.escaped);
}

/// The ground goes on outside, and another house is near: straight ahead, or on one side of the way out.
TEST(RoomOpenings, WhatIsOutsideIsNotTakenForTheRim) {
    const std::array<std::array<Vec3f, 2>, 3> houses{{{Vec3f(25, -5, 0), Vec3f(30, 10, 4)},
                                                      {Vec3f(12, -14, 0), Vec3f(13, 2.5f, 9)},
                                                      {Vec3f(12, 3.8f, 0), Vec3f(13, 20, 9)}}};
    for (const auto& [low, high] : houses) {
        LeakyRoom room;
        std::vector<Quad> quads = facesOf({0, 0, 0}, {6, 5, 3});
        quads.erase(quads.begin() + 1);
        addFaceWithHole(quads, 6, {0, 0}, {5, 3}, {3, .5f}, {3.3f, .8f});
        room.add(meshOf(quads));
        room.add(
            meshOf({{Vec3f(-60, -60, -.01f), Vec3f(60, -60, -.01f), Vec3f(60, 60, -.01f), Vec3f(-60, 60, -.01f)}}));
        room.addBox(low, high);
        for (std::uint64_t seed = 1; seed <= 4; ++seed) {
            const RoomOpenings found = room.find(kInside, 12'000, seed);
            EXPECT_NEAR(found.area, .09, 1e-3) << low.y << ' ' << seed;
            EXPECT_LT(glm::distance(found.center, glm::dvec3(6, 3.15, .65)), 1e-2) << low.y << ' ' << seed;
        }
    }
}

TEST(RoomOpenings, NoneWhereNothingOrEverythingIsOpen) {
    {
        LeakyRoom closed;
        closed.addBox({0, 0, 0}, {6, 5, 3});
        const RoomOpenings found = closed.find(kInside, 40'000);
        EXPECT_EQ(found.fraction, 0);
        EXPECT_FALSE(found.outdoors && found.escaped > 0);
        EXPECT_LT(found.escaped, 1e-5);
    }
    {
        // Slabs that meet exactly.
        LeakyRoom slabs;
        for (const auto& slab : slabsWithGap(0)) slabs.addBox(slab[0], slab[1]);
        EXPECT_FALSE(slabs.find(kInside, 40'000).leak);
    }
    {
        LeakyRoom ground;
        ground.addBox({-20, -20, -1}, {20, 20, 0});
        ground.addBox({3, 0, 0}, {4, 4, 3});
        const RoomOpenings found = ground.find(kInside);
        EXPECT_TRUE(found.outdoors);
        EXPECT_EQ(found.fraction, 0);
        EXPECT_GT(found.escaped, .5);
    }
    {
        // Energy that passes through walls goes by no opening.
        LeakyRoom thin(matte(.1, .1));
        thin.addBox({0, 0, 0}, {6, 5, 3});
        const RoomOpenings found = thin.find(kInside);
        EXPECT_EQ(found.fraction, 0);
        EXPECT_NEAR(found.escaped, .5, .03);
    }
}

/// A concert hall with its doors open, and a stage that is open to one side.
TEST(RoomOpenings, WhatIsOpenOnPurposeIsNoLeak) {
    LeakyRoom hall;
    std::vector<Quad> quads = facesOf({0, 0, 0}, {40, 25, 15});
    quads.erase(quads.begin() + 1);
    addFaceWithHole(quads, 40, {0, 0}, {25, 15}, {10, .1f}, {12, 2.3f});
    hall.add(meshOf(quads));
    const RoomOpenings doors = hall.find({10, 10, 2});
    EXPECT_GT(doors.fraction, 0);
    EXPECT_FALSE(doors.leak);
    LeakyRoom stage;
    quads = facesOf({0, 0, 0}, {6, 5, 3});
    quads.erase(quads.begin() + 1);
    stage.add(meshOf(quads));
    const RoomOpenings open = stage.find(kInside);
    EXPECT_FALSE(open.leak);
    EXPECT_NEAR(open.area, 15, .05);
    EXPECT_NEAR(open.fraction, 15 / (15 + .1 * 111), .08);
}

/// Exits are a sample that knows nothing of what is heard, and energies are those of the batches.
TEST(RoomOpenings, ExitsChangeNothingThatIsHeard) {
    LeakyRoom room;
    std::vector<Quad> quads = facesOf({0, 0, 0}, {6, 5, 3});
    quads.pop_back();
    room.add(meshOf(quads));
    room.find(kInside, 4000);
    const TraceResult with = room.traced;
    ASSERT_EQ(with.exits.size(), 16u * 64);
    double mean = 0;
    for (const EscapedRay& exit : with.exits) {
        EXPECT_NEAR(glm::length(exit.direction), 1, 1e-6);
        EXPECT_GT(exit.direction.z, 0);
        mean += exit.energy[0] / static_cast<double>(with.exits.size());
    }
    // Rays that leave carry what is left of them; about as many as leave out of all.
    EXPECT_GT(mean, .5);
    EXPECT_LE(mean, 1);
    TraceOptions options;
    options.rays = 4000;
    options.imageOrder = 0;
    options.diffractionOrder = 0;
    options.connectedOrder = 0;
    options.air.absorbs = false;
    const TraceResult without = AcousticTracer(room.geometry).trace(kInside, kInside + glm::dvec3(.4, .3, .2), options);
    EXPECT_TRUE(without.exits.empty());
    ASSERT_EQ(without.batches.size(), with.batches.size());
    for (std::size_t i = 0; i < with.batches.size(); ++i) EXPECT_EQ(without.batches[i].bins, with.batches[i].bins);
    EXPECT_EQ(without.escaped, with.escaped);
}

}  // namespace
}  // namespace rtsg
