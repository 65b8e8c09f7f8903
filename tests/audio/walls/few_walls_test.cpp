// Worlds of a few triangles, whose rays are tested against all of them: what they meet is what brute force has, nothing
// slips through where walls meet, and walls may come and go.
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "audio/triangle_geometry.h"
#include "geometry/world_geometry.h"
#include "walls/few_walls.h"

namespace rtsg {
namespace {

using test::TriangleGeometry;

/// Meshes that are placed, and the same triangles for the reference.
struct FewRoom {
    static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

    RayWorld world;
    Walls walls{world};
    WorldGeometry geometry;
    InstanceDelta delta;
    std::vector<std::shared_ptr<const Mesh>> meshes;
    std::vector<std::pair<std::size_t, WorldFromLocal>> placed;  // mesh, by slot
    std::uint32_t next = 0;

    std::size_t mesh(const std::vector<Vec3f>& points, const std::vector<int>& triangles) {
        auto created = std::make_shared<Mesh>();
        for (const Vec3f& p : points) created->positions.push_back(p);
        for (const int corner : triangles) created->triangles.push_back(corner);
        created->triangleCount = static_cast<std::uint32_t>(triangles.size() / 3);
        for (const Vec3f& p : points) created->bounds.extend(p);
        meshes.push_back(created);
        delta.geometries.push_back({NodeId{static_cast<std::uint32_t>(meshes.size())}, created});
        return meshes.size() - 1;
    }
    std::size_t box() {
        std::vector<Vec3f> points;
        for (int i = 0; i < 8; ++i) points.emplace_back(i & 1 ? 1.f : 0.f, i & 2 ? 1.f : 0.f, i & 4 ? 1.f : 0.f);
        return mesh(points, {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                             2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5});
    }
    enum class Kind : std::uint8_t { wall, volume, boundingBox };
    /// Shapes that are no walls are not in the reference.
    InstanceId add(std::size_t of, const WorldFromLocal& at, Kind kind = Kind::wall) {
        Instance instance;
        instance.id = {next++, 0};
        instance.shape = NodeId{100 + next};
        instance.geometry = NodeId{static_cast<std::uint32_t>(of + 1)};
        instance.acoustics = NodeId{500 + next};
        instance.worldFromLocal = at;
        instance.volume = kind == Kind::volume;
        instance.boundingBox = kind == Kind::boundingBox;
        delta.added.push_back(instance);
        placed.emplace_back(kind == Kind::wall ? of : kNone, at);
        return instance.id;
    }
    void remove(InstanceId id) {
        delta.removed.push_back(id);
        placed[id.slot].first = kNone;
    }
    void commit() {
        world.apply(delta);
        walls.apply(delta);
        delta.clear();
        geometry.follow(walls.freeze(), world);
    }
    TriangleGeometry reference() const {
        TriangleGeometry all;
        const std::uint32_t material = all.addMaterial(.1, .1);
        for (const auto& [of, m] : placed) {
            if (of == kNone) continue;
            for (std::uint32_t t = 0; t < meshes[of]->triangleCount; ++t) {
                const auto corner = [&](std::uint32_t c) { return m * glm::dvec4(meshes[of]->vertex(t, c), 1.0); };
                all.addTriangle(corner(0), corner(1), corner(2), material);
            }
        }
        all.finish();
        return all;
    }
};

WorldFromLocal turnedAndPlaced(const glm::dvec3& position, const glm::dvec3& size, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    WorldFromLocal m;
    m[0] = glm::dvec3(c, s, 0) * size.x;
    m[1] = glm::dvec3(-s, c, 0) * size.y;
    m[2] = glm::dvec3(0, 0, 1) * size.z;
    m[3] = position;
    return m;
}

glm::dvec3 anyDirection(std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
}

/// The reference's plane on which this one lies.
std::uint32_t sameIn(const TriangleGeometry& reference, const ReflectingPlane& plane) {
    for (std::uint32_t k = 0; k < reference.planes().size(); ++k) {
        const double alike = glm::dot(reference.planes()[k].normal, plane.normal);
        if (std::abs(std::abs(alike) - 1) < 1e-9 &&
            std::abs(reference.planes()[k].offset - (alike > 0 ? 1 : -1) * plane.offset) < 1e-6)
            return k;
    }
    return kNoPlane;
}

/// Paths of some reflections, sixteen side by side, hit by hit.
void expectAsReference(const FewRoom& room, std::mt19937_64& random, int packets, const std::string& what) {
    const TriangleGeometry reference = room.reference();
    std::uniform_real_distribution<double> uniform;
    int met = 0, blocked = 0;
    for (int n = 0; n < packets; ++n) {
        AcousticRays rays;
        for (int i = 0; i < 3 + n % 14; ++i)
            rays.add({.5 + 5 * uniform(random), .5 + 4 * uniform(random), .3 + 2.4 * uniform(random)}, glm::dvec3(0),
                     anyDirection(random), n % 3 == 0 ? 2.0 : 1e6, kNoPlane);
        for (int bounce = 0; bounce < 4 && rays.count > 0; ++bounce) {
            AcousticHits hits;
            const std::uint32_t found = room.geometry.closestOf(rays, hits);
            const std::uint32_t stopped = room.geometry.blockedOf(rays);
            EXPECT_EQ(found >> rays.count, 0u);
            AcousticRays next;
            for (int i = 0; i < rays.count; ++i) {
                const std::uint32_t except =
                    rays.except[i] == kNoPlane ? kNoPlane : sameIn(reference, room.geometry.planes()[rays.except[i]]);
                AcousticHit expected;
                const bool any =
                    reference.closest(rays.origin[i], rays.direction[i], rays.maxDistance[i], except, expected);
                ASSERT_EQ((found >> i & 1) != 0, any) << what << ' ' << n << ' ' << bounce;
                EXPECT_EQ((stopped >> i & 1) != 0, any) << what << ' ' << n << ' ' << bounce;
                ++(any ? met : blocked);
                if (!any) continue;
                const AcousticHit& hit = hits[static_cast<std::size_t>(i)];
                ASSERT_NEAR(hit.distance, expected.distance, 1e-9 * (1 + expected.distance)) << what;
                ASSERT_EQ(sameIn(reference, room.geometry.planes()[hit.plane]), expected.plane) << what;
                // One ray by itself goes through the BVH, and knows whose wall it is.
                AcousticHit single;
                ASSERT_TRUE(room.geometry.closest(rays.origin[i], rays.direction[i], rays.maxDistance[i],
                                                  rays.except[i], single));
                EXPECT_EQ(hit.material, single.material) << what;
                EXPECT_EQ(hit.plane, single.plane) << what;
                const double cosine = glm::dot(rays.direction[i], hit.normal);
                const glm::dvec3 facing = cosine > 0 ? -hit.normal : hit.normal;
                glm::dvec3 direction = anyDirection(random);
                if (glm::dot(direction, facing) < 0) direction = -direction;
                next.add(rays.origin[i] + rays.direction[i] * hit.distance, facing, direction, rays.maxDistance[i],
                         hit.plane);
            }
            rays = next;
        }
    }
    EXPECT_GT(met, packets) << what;
    EXPECT_GT(blocked, 0) << what;
}

TEST(FewWalls, RaysMeetWhatBruteForceHas) {
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        std::mt19937_64 random(seed);
        std::uniform_real_distribution<double> uniform;
        FewRoom room;
        const std::size_t box = room.box();
        const std::size_t panel = room.mesh({{0, 0, 0}, {1, 0, 0}, {1, 1, .25f}, {0, 1, .25f}}, {0, 1, 2, 0, 2, 3});
        room.add(box, turnedAndPlaced({0, 0, 0}, {6, 5, 3}, seed % 2 == 0 ? 0 : .3));
        room.add(box, turnedAndPlaced({2, 2, .5}, {.7, 1.3, 1.1}, uniform(random)));
        for (int i = 0; i < 4; ++i)
            room.add(panel, turnedAndPlaced({1 + 3 * uniform(random), 1 + 2 * uniform(random), 2 * uniform(random)},
                                            {1, 1, 1}, 6 * uniform(random)));
        room.commit();
        expectAsReference(room, random, 60, "seed " + std::to_string(seed));
    }
}

/// Exactly at edges and corners, along walls, and from places on them: all of it is met.
TEST(FewWalls, NothingSlipsThroughWhereWallsMeet) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform;
    for (const double angle : {0.0, .37}) {
        FewRoom room;
        const WorldFromLocal m = turnedAndPlaced({30, -20, 5}, {6, 5, 3}, angle);
        room.add(room.box(), m);
        room.commit();
        const auto at = [&](const glm::dvec3& p) { return m * glm::dvec4(p, 1); };
        const auto side = [&] { return static_cast<double>(random() % 2); };
        AcousticRays rays;
        AcousticHits hits;
        for (int n = 0; n < 40'000; ++n) {
            glm::dvec3 target(uniform(random), uniform(random), uniform(random));
            const int axis = static_cast<int>(random() % 3);
            target[(axis + 1) % 3] = side();
            target[(axis + 2) % 3] = side();
            if (n % 4 == 0) target[axis] = side();
            const glm::dvec3 inside(.01 + .98 * uniform(random), .01 + .98 * uniform(random),
                                    n % 5 == 0 ? 1e-9 : .01 + .98 * uniform(random));
            rays.add(at(inside), glm::dvec3(0), glm::normalize(at(target) - at(inside)), 1e6, kNoPlane);
            if (rays.count < AcousticRays::kMax) continue;
            ASSERT_EQ(room.geometry.closestOf(rays, hits), 0xFFFFu) << n;
            rays = {};
        }
    }
}

/// The boxes of volumes, and those that are drawn around groups, are seen, but no walls.
TEST(FewWalls, WhatIsSeenButNoWallIsPassed) {
    std::mt19937_64 random(3);
    for (const auto kind : {FewRoom::Kind::volume, FewRoom::Kind::boundingBox}) {
        FewRoom room;
        const std::size_t box = room.box();
        room.add(box, turnedAndPlaced({0, 0, 0}, {6, 5, 3}, 0));
        const InstanceId around = room.add(box, turnedAndPlaced({1, 1, .5}, {3, 3, 2}, .1), kind);
        room.commit();
        expectAsReference(room, random, 20, "with it");
        room.remove(around);
        room.commit();
        expectAsReference(room, random, 20, "without");
    }
}

/// From few to many and back, of whatever came in between.
TEST(FewWalls, MayComeAndGo) {
    static_assert(FewWalls::kMaxTriangles < 60);
    std::mt19937_64 random(9);
    FewRoom room;
    const std::size_t box = room.box();
    room.add(box, turnedAndPlaced({0, 0, 0}, {6, 5, 3}, .2));
    room.commit();
    expectAsReference(room, random, 20, "one box");
    const InstanceId first = room.add(box, turnedAndPlaced({1, 1, .5}, {1, 1, 1}, .1));
    room.commit();
    expectAsReference(room, random, 20, "two boxes");
    const InstanceId second = room.add(box, turnedAndPlaced({3, 2, .7}, {1, 1.5, 1}, .5));
    const InstanceId third = room.add(box, turnedAndPlaced({2, .4, .1}, {.3, .5, .4}, 1));
    const InstanceId fourth = room.add(box, turnedAndPlaced({4, 1, 1}, {.4, .2, .3}, 2));
    room.commit();
    expectAsReference(room, random, 20, "five boxes");
    for (const InstanceId id : {first, third, fourth}) room.remove(id);
    room.commit();
    expectAsReference(room, random, 20, "two boxes again");
    room.delta.moved.push_back({second, turnedAndPlaced({2, 3, .4}, {.5, 1, 2}, .9)});
    room.placed[second.slot].second = room.delta.moved.back().worldFromLocal;
    room.commit();
    expectAsReference(room, random, 20, "one has moved");
    room.remove(second);
    room.commit();
    expectAsReference(room, random, 20, "one box again");
}

/// Whether the triangles of a room are few in number and kind, from change to change.
class FewOf {
  public:
    explicit FewOf(FewRoom& room, std::size_t maxPlanes = 20'000) : room_(room), planes_(maxPlanes) {}
    bool usable() {
        room_.commit();
        const WallsVersion now = room_.walls.freeze();
        PagedArray<Wall>::differences(known_.walls, now.walls,
                                      [&](std::size_t at, const Wall& before, const Wall& after) {
                                          if (before.stamp == after.stamp) return;
                                          few_.change(static_cast<std::uint32_t>(at), before, after);
                                          planes_.change(static_cast<std::uint32_t>(at), after);
                                      });
        planes_.settle(now.walls, room_.geometry.materials());
        few_.build(now.walls, planes_, room_.world);
        known_ = now;
        return few_.usable();
    }

  private:
    FewRoom& room_;
    FewWalls few_;
    WallPlanes planes_;
    WallsVersion known_;
};

TEST(FewWalls, AreUsedWhileTheyAreFewAndFlat) {
    FewRoom room;
    FewOf few(room);
    const std::size_t box = room.box();
    std::vector<InstanceId> boxes;
    for (int i = 0; i < 4; ++i) boxes.push_back(room.add(box, turnedAndPlaced({2.0 * i, 0, 0}, {1, 1, 1}, .1 * i)));
    EXPECT_TRUE(few.usable());
    const InstanceId fifth = room.add(box, turnedAndPlaced({9, 0, 0}, {1, 1, 1}, .7));
    EXPECT_FALSE(few.usable());
    room.remove(fifth);
    EXPECT_TRUE(few.usable());
    // Two triangles in one plane as far as mirrors go, one of them half a tenth of a millimetre off.
    const std::size_t bent = room.mesh({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 5e-5f}}, {0, 1, 2, 0, 2, 3});
    room.remove(boxes[0]);
    room.add(bent, turnedAndPlaced({0, 0, 3}, {4, 4, 1}, 0));
    EXPECT_FALSE(few.usable());
}

/// One wall more of each kind that they are not, beside a box, and gone again.
TEST(FewWalls, AreNotUsedWithVolumesBoundingBoxesSliversFarWallsOrMany) {
    FewRoom room;
    FewOf few(room);
    const std::size_t box = room.box();
    room.add(box, turnedAndPlaced({0, 0, 0}, {6, 5, 3}, 0));
    ASSERT_TRUE(few.usable());
    const auto with = [&](std::size_t of, const WorldFromLocal& at, FewRoom::Kind kind = FewRoom::Kind::wall) {
        const InstanceId one = room.add(of, at, kind);
        const bool usable = few.usable();
        room.remove(one);
        EXPECT_TRUE(few.usable());
        return usable;
    };
    const auto near = turnedAndPlaced({1, 1, .5}, {1, 1, 1}, 0);
    EXPECT_TRUE(with(box, near));
    EXPECT_FALSE(with(box, near, FewRoom::Kind::volume));
    EXPECT_FALSE(with(box, near, FewRoom::Kind::boundingBox));
    // Edges of a micrometre are none.
    const std::size_t right = room.mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    EXPECT_TRUE(with(right, turnedAndPlaced({1, 1, 1}, {1e-5, 1, 1}, 0)));
    EXPECT_FALSE(with(right, turnedAndPlaced({1, 1, 1}, {5e-7, 1, 1}, 0)));
    EXPECT_TRUE(with(right, turnedAndPlaced({9'000, 1, 1}, {1, 1, 1}, 0)));
    EXPECT_FALSE(with(right, turnedAndPlaced({10'001, 1, 1}, {1, 1, 1}, 0)));
    // One that reaches there with a corner, too.
    EXPECT_FALSE(with(right, turnedAndPlaced({1, 1, 1}, {10'001, 1, 1}, 0)));
    // 12 of the box, and a fan of small triangles in one plane: as many as there may be, and one more.
    for (const int count : {36, 37}) {
        std::vector<Vec3f> points{{0, 0, 0}};
        std::vector<int> triangles;
        for (int i = 0; i <= count; ++i) {
            points.emplace_back(std::cos(.1f * static_cast<float>(i)), std::sin(.1f * static_cast<float>(i)), 0);
            if (i > 0) triangles.insert(triangles.end(), {0, i, i + 1});
        }
        EXPECT_EQ(with(room.mesh(points, triangles), turnedAndPlaced({2, 2, 1}, {.01, .01, 1}, 0)), count == 36);
    }
    // More planes than are looked for.
    FewOf ofNoPlanes(room, 5);
    EXPECT_FALSE(ofNoPlanes.usable());
}

}  // namespace
}  // namespace rtsg
