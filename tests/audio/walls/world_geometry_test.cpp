// WorldGeometry against brute force, against closed forms, and followed against built from scratch.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "audio/triangle_geometry.h"
#include "geometry/world_geometry.h"
#include "images/image_sources.h"
#include "rays/acoustic_tracer.h"

namespace rtsg {
namespace {

using test::kListener;
using test::kSource;
using test::Shoebox;
using test::TriangleGeometry;

/// Box of unit edge from the origin, fronts inwards or outwards: no matter.
std::shared_ptr<Mesh> unitBox() {
    auto mesh = std::make_shared<Mesh>();
    mesh->solid = false;  // as of rooms
    for (int i = 0; i < 8; ++i) mesh->positions.push_back({i & 1 ? 1.f : 0.f, i & 2 ? 1.f : 0.f, i & 4 ? 1.f : 0.f});
    mesh->triangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                       2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    mesh->triangleCount = 12;
    for (const Vec3f& p : mesh->positions) mesh->bounds.extend(p);
    return mesh;
}

WorldFromLocal placed(const glm::dvec3& position, const glm::dvec3& size, double angle = 0) {
    const double c = std::cos(angle), s = std::sin(angle);
    WorldFromLocal m;
    m[0] = glm::dvec3(c, s, 0) * size.x;
    m[1] = glm::dvec3(-s, c, 0) * size.y;
    m[2] = glm::dvec3(0, 0, 1) * size.z;
    m[3] = position;
    return m;
}

struct Room {
    explicit Room(const AcousticMaterial& defaults = {}, const WorldGeometry::Options& options = {})
        : walls(world, defaults), geometry(options) {}

    RayWorld world;
    Walls walls;
    WorldGeometry geometry;
    InstanceDelta delta;
    std::uint32_t next = 0;

    void mesh(NodeId node, std::shared_ptr<const Mesh> m) { delta.geometries.push_back({node, std::move(m)}); }
    InstanceId add(NodeId geometryNode, const WorldFromLocal& m, NodeId acoustics = {}) {
        Instance instance;
        instance.id = {next++, 0};
        instance.shape = NodeId{100 + next};
        instance.geometry = geometryNode;
        instance.acoustics = acoustics;
        instance.worldFromLocal = m;
        delta.added.push_back(instance);
        return instance.id;
    }
    /// Hands the delta on, as a flattened scene would.
    void commit() {
        world.apply(delta);
        walls.apply(delta);
        delta.clear();
        follow();
    }
    const WorldGeometry::Changes& follow() { return geometry.follow(walls.freeze(), world); }
    std::size_t planesInUse() const {
        return static_cast<std::size_t>(std::count_if(geometry.planes().begin(), geometry.planes().end(),
                                                      [](const ReflectingPlane& p) { return p.mirrors > 0; }));
    }
};

/// The mirroring planes without their numbers: offset, bounds and share of each plane in use.
std::vector<std::array<double, 6>> described(const WorldGeometry& geometry) {
    std::vector<std::array<double, 6>> all;
    const auto rounded = [](double value) { return std::round(value * 1e6) * 1e-6 + 0.0; };
    for (const ReflectingPlane& p : geometry.planes())
        if (p.mirrors > 0)
            all.push_back({rounded(std::abs(p.offset)), rounded(p.center.x), rounded(p.center.y), rounded(p.center.z),
                           rounded(p.radius), p.mirrors});
    std::sort(all.begin(), all.end());
    return all;
}

AcousticMaterial uniform(double absorption, double scattering) {
    return {allBands(absorption), allBands(scattering), allBands(0)};
}

TEST(WorldGeometry, TheBoxThroughTheBvhHasTheImagesOfTheLattice) {
    for (const double angle : {0.0, 0.6}) {
        Room room;
        room.mesh(NodeId{1}, unitBox());
        const WorldFromLocal m = placed({7, -2, 3}, {6, 5, 3}, angle);
        room.add(NodeId{1}, m, NodeId{9});
        WorldGeometry& geometry = room.geometry;
        room.walls.setMaterial(NodeId{9}, uniform(.1, 0));
        room.commit();
        ASSERT_EQ(geometry.planes().size(), 6u);
        const auto at = [&](const glm::dvec3& p) { return m * glm::dvec4(p / glm::dvec3(6, 5, 3), 1); };
        const ImageSources found = findImageSources(geometry, at(kSource), at(kListener), {.maxOrder = 20}, 343, {});
        ASSERT_EQ(found.arrivals.size(), 11521u) << angle;
        std::vector<std::pair<double, double>> lattice;
        Shoebox::uniform({6, 5, 3}, .1).images(kSource, kListener, 300, [&](double d, double e, int order) {
            if (order <= 20) lattice.emplace_back(d, e);
        });
        std::sort(lattice.begin(), lattice.end());
        double expected = 0, got = 0;
        for (std::size_t i = 0; i < lattice.size(); ++i) {
            ASSERT_NEAR(found.arrivals[i].seconds * 343, lattice[i].first, 1e-5);
            expected += lattice[i].second;
            got += found.arrivals[i].energy[0];
        }
        EXPECT_NEAR(got / expected, 1, 1e-6);
    }
}

TEST(WorldGeometry, PlacesAtWallsHaveTheImagesOfTheLatticeToo) {
    const Shoebox box = Shoebox::uniform({6, 5, 3}, .1);
    for (const double angle : {0.0, 0.6}) {
        Room room;
        room.mesh(NodeId{1}, unitBox());
        const WorldFromLocal m = placed({7, -2, 3}, {6, 5, 3}, angle);
        room.add(NodeId{1}, m, NodeId{9});
        room.walls.setMaterial(NodeId{9}, uniform(.1, 0));
        room.commit();
        const auto at = [&](const glm::dvec3& p) { return m * glm::dvec4(p / glm::dvec3(6, 5, 3), 1); };
        for (const glm::dvec3& source :
             {glm::dvec3(1e-4, 1, 1.5), glm::dvec3(1e-6, 1, 1.5), glm::dvec3(0, 1, 1.5), glm::dvec3(0, 0, 0)})
            for (const glm::dvec3& listener : {kListener, glm::dvec3(5.9999, 3, 1.5), glm::dvec3(6, 3, 1.5)}) {
                std::vector<double> lattice;
                box.images(source, listener, 200, [&](double d, double, int order) {
                    if (order <= 5) lattice.push_back(d);
                });
                std::sort(lattice.begin(), lattice.end());
                const ImageSources found =
                    findImageSources(room.geometry, at(source), at(listener), {.maxOrder = 5}, 343, {});
                std::size_t first = 0;
                while (first < found.arrivals.size() && first < lattice.size() &&
                       std::abs(found.arrivals[first].seconds * 343 - lattice[first]) < 1e-4)
                    ++first;
                ASSERT_EQ(found.arrivals.size(), lattice.size())
                    << angle << " " << source.x << " " << source.y << " " << listener.x
                    << ": the first that differs is " << lattice[first] << " of arrival " << first;
                for (std::size_t i = 0; i < lattice.size(); ++i)
                    EXPECT_NEAR(found.arrivals[i].seconds * 343, lattice[i], 1e-4);
                TraceOptions options;
                options.rays = 4000;
                options.imageOrder = 0;
                options.maxSeconds = 1;
                EXPECT_LT(AcousticTracer(room.geometry).trace(at(source), at(listener), options).escaped[0], 1e-6);
            }
    }
}

TEST(WorldGeometry, RaysInTheBvhAgreeWithTheReferenceAndNothingLeaks) {
    Room room;
    room.mesh(NodeId{1}, unitBox());
    room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}), NodeId{9});
    WorldGeometry& geometry = room.geometry;
    room.walls.setMaterial(NodeId{9}, uniform(.1, .5));
    room.commit();
    TraceOptions options;
    options.rays = 9600;
    options.imageOrder = 3;
    options.maxSeconds = 3;
    options.air.absorbs = false;
    const TraceResult result = AcousticTracer(geometry).trace(kSource, kListener, options);
    const MetricsEstimate m = result.metrics();
    EXPECT_NEAR(m.value.t30[0], 1.1088, 2 * m.ci95.t30[0] + 0.006);
    EXPECT_NEAR(m.value.c80[0], 2.212, 2 * m.ci95.c80[0] + 0.1);
    EXPECT_NEAR(m.value.g[0], 25.323, 2 * m.ci95.g[0] + 0.03);
    EXPECT_LT(result.escaped[0], 1e-6);
    EXPECT_NEAR(result.receiverRadius, 0.5, 1e-12);
    EXPECT_EQ(room.world.badRays(), 0u);
}

TEST(WorldGeometry, AgreesWithBruteForceAmongManyObjects) {
    constexpr std::uint64_t kSeed = 4;
    SCOPED_TRACE(kSeed);
    std::mt19937_64 random(kSeed);
    std::uniform_real_distribution<double> unit(0, 1);
    Room room(uniform(.2, .1));
    room.mesh(NodeId{1}, unitBox());
    TriangleGeometry reference;
    reference.addMaterial(.2, .1);
    const auto add = [&](const WorldFromLocal& m) {
        room.add(NodeId{1}, m);
        const auto box = unitBox();
        for (std::uint32_t t = 0; t < 12; ++t)
            reference.addTriangle(m * glm::dvec4(box->vertex(t, 0), 1), m * glm::dvec4(box->vertex(t, 1), 1),
                                  m * glm::dvec4(box->vertex(t, 2), 1), 0);
    };
    add(placed({-6, -6, -6}, {12, 12, 12}));
    for (int i = 0; i < 30; ++i)
        add(placed({unit(random) * 8 - 5, unit(random) * 8 - 5, unit(random) * 8 - 5},
                   {.2 + unit(random), .2 + unit(random), .2 + unit(random)}, unit(random) * 3));
    room.commit();
    reference.finish();
    const WorldGeometry& geometry = room.geometry;
    EXPECT_EQ(geometry.planes().size(), reference.planes().size());
    int hits = 0;
    for (int i = 0; i < 2000; ++i) {
        const glm::dvec3 origin(unit(random) * 12 - 6, unit(random) * 12 - 6, unit(random) * 12 - 6);
        const glm::dvec3 direction =
            glm::normalize(glm::dvec3(unit(random) - .5, unit(random) - .5, unit(random) - .5));
        AcousticHit a, b;
        ASSERT_TRUE(geometry.closest(origin, direction, 100, kNoPlane, a));
        ASSERT_TRUE(reference.closest(origin, direction, 100, kNoPlane, b));
        if (std::abs(a.distance - b.distance) < 1e-5) ++hits;
        // And from there on, mirrored, leaving out the plane just hit.
        const glm::dvec3 next = origin + direction * a.distance;
        const glm::dvec3 mirrored = direction - a.normal * (2 * glm::dot(direction, a.normal));
        AcousticHit c;
        EXPECT_TRUE(geometry.closest(next, mirrored, 100, a.plane, c));
        EXPECT_NE(c.plane, a.plane);
        ASSERT_NEAR(geometry.distanceToSurface(origin), reference.distanceToSurface(origin), 1e-5);
    }
    EXPECT_GE(hits, 1998);  // an edge may be missed by one and hit by the other
}

TEST(WorldGeometry, FollowsMovesAndMaterials) {
    Room room;
    WorldGeometry& geometry = room.geometry;
    room.mesh(NodeId{1}, unitBox());
    room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}), NodeId{9});
    const InstanceId screen = room.add(NodeId{1}, placed({2.4, -1, 1}, {.1, 7, 4}), NodeId{9});
    room.walls.setMaterial(NodeId{9}, uniform(.1, 0));
    room.commit();
    EXPECT_TRUE(findImageSources(geometry, kSource, kListener, {.maxOrder = 0}, 343, {}).arrivals.empty());
    room.delta.moved.push_back({screen, placed({2.4, 10, 1}, {.1, 7, 4})});
    room.commit();
    EXPECT_EQ(findImageSources(geometry, kSource, kListener, {.maxOrder = 1}, 343, {}).arrivals.size(), 7u);
    room.walls.setMaterial(NodeId{9}, uniform(.75, 0));
    EXPECT_TRUE(room.follow().everything);
    EXPECT_FALSE(room.follow().everything);
    const auto soft = findImageSources(geometry, kSource, kListener, {.maxOrder = 1}, 343, {});
    const double d = soft.arrivals[1].seconds * 343;
    EXPECT_NEAR(soft.arrivals[1].energy[3] * 4 * M_PI * d * d, .25, 1e-9);
    room.delta.removed.push_back(screen);
    room.commit();
    EXPECT_EQ(room.planesInUse(), 6u);
}

TEST(WorldGeometry, FollowingIsBuildingFromScratch) {
    constexpr std::uint64_t kSeed = 11;
    SCOPED_TRACE(kSeed);
    std::mt19937_64 random(kSeed);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto anywhere = [&] {
        // On a grid, so that planes meet and part again.
        const auto at = [&] { return std::floor(unit(random) * 6); };
        return placed({at(), at(), at()}, {1 + at(), 1 + at(), 1 + at()}, unit(random) < .3 ? .5 : 0);
    };
    Room room;
    room.mesh(NodeId{1}, unitBox());
    std::vector<Instance> alive;
    for (int step = 0; step < 60; ++step) {
        const double what = unit(random);
        if (alive.empty() || what < .4) {
            const NodeId acoustics{unit(random) < .5 ? 9u : 0u};
            room.add(NodeId{1}, anywhere(), acoustics);
            alive.push_back(room.delta.added.back());
        } else if (what < .6) {
            const auto at = static_cast<std::ptrdiff_t>(unit(random) * static_cast<double>(alive.size()));
            room.delta.removed.push_back(alive[static_cast<std::size_t>(at)].id);
            alive.erase(alive.begin() + at);
        } else if (what < .8) {
            Instance& instance = alive[static_cast<std::size_t>(unit(random) * static_cast<double>(alive.size()))];
            instance.acoustics = instance.acoustics ? NodeId{} : NodeId{9};
            room.delta.rebound.push_back(instance);
        } else {
            Instance& instance = alive[static_cast<std::size_t>(unit(random) * static_cast<double>(alive.size()))];
            instance.worldFromLocal = anywhere();
            room.delta.moved.push_back({instance.id, instance.worldFromLocal});
        }
        if (step == 30) room.walls.setMaterial(NodeId{9}, uniform(.5, .2));
        room.commit();

        Room scratch;
        scratch.walls.setMaterial(NodeId{9}, step < 30 ? AcousticMaterial{} : uniform(.5, .2));
        scratch.mesh(NodeId{1}, unitBox());
        scratch.delta.added = alive;
        scratch.commit();
        ASSERT_EQ(described(room.geometry), described(scratch.geometry)) << "step " << step;
        for (int i = 0; i < 50; ++i) {
            const glm::dvec3 origin(unit(random) * 12, unit(random) * 12, unit(random) * 12);
            const glm::dvec3 direction =
                glm::normalize(glm::dvec3(unit(random) - .5, unit(random) - .5, unit(random) - .5));
            AcousticHit a, b;
            ASSERT_EQ(room.geometry.closest(origin, direction, 100, kNoPlane, a),
                      scratch.geometry.closest(origin, direction, 100, kNoPlane, b));
            if (a.plane == kNoPlane) continue;
            ASSERT_NEAR(a.distance, b.distance, 1e-5);
            ASSERT_NEAR(std::abs(glm::dot(a.normal, b.normal)), 1, 1e-6);
            // Coincident surfaces may differ in material: either is right.
        }
        const auto more = findImageSources(room.geometry, {-1, -2, -3}, {-2, 1, -1}, {.maxOrder = 2}, 343, {});
        const auto same = findImageSources(scratch.geometry, {-1, -2, -3}, {-2, 1, -1}, {.maxOrder = 2}, 343, {});
        ASSERT_EQ(more.arrivals.size(), same.arrivals.size()) << "step " << step;
    }
}

/// A program that asks for paths in every frame and traces seldom pays for planes and edges when tracing only.
TEST(WorldGeometry, WhatIsNotedIsMetAtOnceAndSettledOnce) {
    const auto screenAt = [](double x) { return placed({x, 1, 0}, {.1, 2, 2}); };
    Room noted, followed;
    InstanceId screen;
    for (Room* room : {&noted, &followed}) {
        room->mesh(NodeId{1}, unitBox());
        room->add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}));
        screen = room->add(NodeId{1}, screenAt(2));
        room->commit();
    }
    const std::uint64_t before = noted.geometry.work();
    for (double x = 2.1; x < 4; x += .1) {
        noted.delta.moved.push_back({screen, screenAt(x)});
        followed.delta = noted.delta;
        followed.commit();
        noted.world.apply(noted.delta);
        noted.walls.apply(noted.delta);
        noted.delta.clear();
        EXPECT_EQ(noted.geometry.note(noted.walls.freeze(), noted.world).slots.size(), 2u);
        AcousticHit hit;
        ASSERT_TRUE(noted.geometry.closest({1, 2, 1}, {1, 0, 0}, 100, kNoPlane, hit));
        EXPECT_NEAR(hit.distance, x - 1, 1e-5);
    }
    noted.geometry.settle();
    EXPECT_EQ(described(noted.geometry), described(followed.geometry));
    EXPECT_LT(3 * (noted.geometry.work() - before), 2 * (followed.geometry.work() - before));
    int edges[2] = {0, 0};
    noted.geometry.visitEdges([&](const WallEdge& edge) { edges[0] += std::abs(edge.from.x - 3.9) < .2; });
    followed.geometry.visitEdges([&](const WallEdge& edge) { edges[1] += std::abs(edge.from.x - 3.9) < .2; });
    EXPECT_EQ(edges[0], edges[1]);
    EXPECT_GT(edges[0], 0);
}

/// Boxes in rows, floors and columns, so that thousands share a plane.
std::unique_ptr<Room> rowsOfBoxes(std::uint32_t count) {
    auto room = std::make_unique<Room>();
    room->mesh(NodeId{1}, unitBox());
    std::uint32_t side = 1;
    while (side * side * side < count) ++side;
    for (std::uint32_t i = 0; i < count; ++i)
        room->add(NodeId{1}, placed(2.0 * glm::dvec3(i % side, i / side % side, i / side / side), {1, 1, 1}));
    room->commit();
    return room;
}

TEST(WorldGeometry, WorkFollowsWhatMovesHoweverMuchThereIs) {
    std::vector<std::uint64_t> work;
    for (const std::uint32_t count : {1000u, 10'000u, 100'000u}) {
        const auto room = rowsOfBoxes(count);
        const std::uint64_t before = room->geometry.work();
        constexpr std::uint32_t kMoves = 20;
        for (std::uint32_t i = 0; i < kMoves; ++i) {
            const InstanceId id{i * (count / kMoves), 0};
            WorldFromLocal m = room->world.instance(id.slot).info.worldFromLocal;
            m[3] += glm::dvec3(.1, .2, .3);
            room->delta.moved.push_back({id, m});
            room->commit();
        }
        work.push_back((room->geometry.work() - before) / kMoves);
    }
    // A full rescan would look at every box. Planes of more surfaces are trees with one more level.
    EXPECT_LT(work[0], 1000u);
    EXPECT_LE(work[1], 2 * work[0]);
    EXPECT_LE(work[2], 2 * work[0]);
}

TEST(WorldGeometry, TheSearchForPlanesEndsAtTheLimit) {
    constexpr std::uint64_t kSeed = 5;
    SCOPED_TRACE(kSeed);
    std::mt19937_64 random(kSeed);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto anywhere = [&] { return placed({unit(random) * 99, unit(random) * 99, unit(random) * 99}, {1, 1, 1}); };
    std::vector<std::uint64_t> work;
    for (const int count : {1000, 4000}) {
        Room room({}, {.maxPlanes = 600});
        room.mesh(NodeId{1}, unitBox());
        for (int i = 0; i < count; ++i) room.add(NodeId{1}, anywhere());
        room.commit();
        EXPECT_TRUE(room.geometry.planes().empty());
        // The only trace of a box is that its slot was looked at.
        work.push_back(room.geometry.work() - static_cast<std::uint64_t>(count));
    }
    EXPECT_LT(work[1], 1.2 * static_cast<double>(work[0]));

    // Around the limit, up and down: as from scratch.
    Room room({}, {.maxPlanes = 60});
    room.mesh(NodeId{1}, unitBox());
    std::vector<Instance> alive;
    bool above = false, below = false;
    for (int step = 0; step < 200; ++step) {
        const bool grow = alive.empty() || unit(random) < (step / 40 % 2 ? .2 : .8);
        if (grow) {
            room.add(NodeId{1}, anywhere());
            alive.push_back(room.delta.added.back());
        } else {
            const auto at = static_cast<std::ptrdiff_t>(unit(random) * static_cast<double>(alive.size()));
            room.delta.removed.push_back(alive[static_cast<std::size_t>(at)].id);
            alive.erase(alive.begin() + at);
        }
        room.commit();
        Room scratch({}, {.maxPlanes = 60});
        scratch.mesh(NodeId{1}, unitBox());
        scratch.delta.added = alive;
        scratch.commit();
        ASSERT_EQ(described(room.geometry), described(scratch.geometry)) << "step " << step;
        (room.geometry.planes().empty() ? above : below) = true;
    }
    EXPECT_TRUE(above && below);
}

TEST(WorldGeometry, AVersionIsNotTouchedByWhatComesAfter) {
    Room room;
    room.mesh(NodeId{1}, unitBox());
    const InstanceId box = room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}), NodeId{9});
    room.walls.setMaterial(NodeId{9}, uniform(.1, 0));
    room.commit();
    const WallsVersion version = room.walls.freeze();
    const Wall before = version.walls[box.slot];
    room.delta.moved.push_back({box, placed({1, 1, 1}, {2, 2, 2})});
    room.walls.setMaterial(NodeId{9}, uniform(.5, 0));
    room.commit();
    room.delta.removed.push_back(box);
    room.commit();
    EXPECT_EQ(version.walls[box.slot].worldFromLocal, before.worldFromLocal);
    EXPECT_EQ(version.walls[box.slot].mesh, before.mesh);
    EXPECT_EQ(version.materials[before.material].absorption[0], .1);
    EXPECT_EQ(room.walls.freeze().walls[box.slot].mesh, nullptr);
}

TEST(WorldGeometry, CoplanarSurfacesOfSeveralShapesAreOneMirror) {
    Room room;
    room.mesh(NodeId{1}, unitBox());
    // A floor of sixteen tiles, and a carpet flush with it.
    for (int i = 0; i < 16; ++i) room.add(NodeId{1}, placed({i % 4, i / 4, -1}, {1, 1, 1}));
    room.add(NodeId{1}, placed({1, 1, -.01}, {2, 2, .01}));
    room.commit();
    const auto found = findImageSources(room.geometry, {1.3, 1.4, 1}, {2.6, 2.7, 1}, {.maxOrder = 3}, 343, {});
    EXPECT_EQ(found.arrivals.size(), 2u);
    // From the common surface nothing but the open sky is seen.
    AcousticHit floor, up;
    ASSERT_TRUE(room.geometry.closest({1.5, 1.5, 1}, {0, 0, -1}, 10, kNoPlane, floor));
    EXPECT_NEAR(floor.distance, 1, 1e-6);
    EXPECT_FALSE(room.geometry.closest({1.5, 1.5, 0}, glm::normalize(glm::dvec3(.3, .2, .5)), 10, floor.plane, up));
}

TEST(WorldGeometry, WithoutPlanesRaysDoItAll) {
    Room room(uniform(.3, .1), {.maxPlanes = 5});
    room.mesh(NodeId{1}, unitBox());
    room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}));
    room.commit();
    TraceOptions options;
    options.rays = 9600;
    options.maxSeconds = 2;
    options.air.absorbs = false;
    const TraceResult result = AcousticTracer(room.geometry).trace(kSource, kListener, options);
    EXPECT_EQ(result.imageOrder, 0);
    EXPECT_EQ(result.arrivals.size(), 1u);
    const MetricsEstimate m = result.metrics();
    EXPECT_NEAR(m.value.t20[0], .3596, 2 * m.ci95.t20[0] + 0.003);
    EXPECT_NEAR(m.value.g[0], 19.271, 2 * m.ci95.g[0] + 0.05);
    EXPECT_LT(result.escaped[0], 1e-3);
}

// A bounding box that is shown, a Billboard, a level of detail for the eye alone: no wall, however near.
TEST(WorldGeometry, WhatIsSeenAndNotHeardIsNoSurface) {
    for (const bool wall : {false, true}) {
        Room room;
        room.mesh(NodeId{1}, unitBox());
        room.add(NodeId{1}, placed({0, 0, 0}, {4, 4, 4}));
        room.delta.added.back().heard = wall;
        if (!wall) {
            room.add(NodeId{1}, placed({30, 0, 0}, {4, 4, 4}));  // so that there are walls
            room.delta.added.back().seen = false;
        }
        room.commit();
        int near = 0;
        room.geometry.surfacesNear({2, 2, 3.75}, .5, [&](const NearSurface&) { ++near; });
        EXPECT_EQ(near > 0, wall);
        EXPECT_NEAR(room.geometry.distanceToSurface({2, 2, 3.75}), wall ? .25 : 28.0, 1e-5);
    }
}

TEST(WorldGeometry, AnEmptyWorldIsAVoid) {
    RayWorld world;
    Walls walls(world);
    WorldGeometry geometry;
    geometry.follow(walls.freeze(), world);
    EXPECT_TRUE(geometry.planes().empty());
    AcousticHit hit;
    EXPECT_FALSE(geometry.closest({0, 0, 0}, {0, 0, 1}, 10, kNoPlane, hit));
    EXPECT_EQ(geometry.distanceToSurface({0, 0, 0}), std::numeric_limits<double>::infinity());
}

/// A hall with boxes in it, in double precision too, each turned another way.
void furnish(Room& room, TriangleGeometry& reference) {
    room.mesh(NodeId{1}, unitBox());
    const auto box = unitBox();
    const std::uint32_t material = reference.addMaterial(.1, .5);
    const auto add = [&](const WorldFromLocal& m) {
        room.add(NodeId{1}, m);
        for (std::uint32_t t = 0; t < box->triangleCount; ++t)
            reference.addTriangle(m * glm::dvec4(box->vertex(t, 0), 1), m * glm::dvec4(box->vertex(t, 1), 1),
                                  m * glm::dvec4(box->vertex(t, 2), 1), material);
    };
    add(placed({-5, -4, 0}, {10, 8, 4}, .3));
    for (int i = 0; i < 12; ++i) add(placed({-2.1 + .4 * i, 2 * std::sin(i), .1 * i}, {.5, .3, .4 + .1 * i}, .7 * i));
    room.commit();
    reference.finish();
}

/// By planes, or by the triangles alone.
class AskedTogether : public testing::TestWithParam<bool> {};

TEST_P(AskedTogether, MeetsWhatEachMeetsAlone) {
    const bool planes = GetParam();
    Room room({}, {.maxPlanes = planes ? 20'000u : 5u});
    TriangleGeometry reference;
    furnish(room, reference);
    ASSERT_EQ(room.geometry.planes().empty(), !planes);
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    const auto direction = [&] { return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random))); };
    const glm::dvec3 position(.3, -1.2, 3.1);
    // Without planes a hit is where single precision has it: the reference starts as far before it as that may be off.
    const double off = planes ? 1e-7 : 2e-5, same = planes ? 0 : 1e-4;
    int met = 0, hidden = 0, asked = 0;
    for (int round = 0; round < 300; ++round) {
        // From the air to a wall, from there on, and back to the place.
        AcousticRays out, on, back;
        const int count = 1 + round % AcousticRays::kMax;
        for (int i = 0; i < count; ++i) out.add(position, glm::dvec3(0), direction(), 1e6, kNoPlane);
        AcousticHits first, second;
        ASSERT_EQ(room.geometry.closestOf(out, first), (1u << count) - 1);
        for (int i = 0; i < count; ++i) {
            const AcousticHit& hit = first[static_cast<std::size_t>(i)];
            const glm::dvec3 point = position + out.direction[i] * hit.distance;
            const glm::dvec3 side = glm::dot(hit.normal, out.direction[i]) < 0 ? hit.normal : -hit.normal;
            glm::dvec3 leaving = direction();
            if (glm::dot(leaving, side) < 0) leaving = -leaving;
            const double maximum = i % 3 ? 1e6 : 1;
            on.add(point, side, leaving, maximum, hit.plane);
            const glm::dvec3 to = glm::dvec3(-.5, 1.9, 3.5) - point;
            EXPECT_EQ(hit.clear > 0, !planes);
            EXPECT_LT(hit.clear, 1e-4);
            if (glm::dot(to, side) > 0)
                back.add(point, side, glm::normalize(to), glm::length(to), hit.plane, hit.clear);
        }
        const std::uint32_t bits = room.geometry.closestOf(on, second), shut = room.geometry.blockedOf(back);
        for (int i = 0; i < on.count; ++i) {
            AcousticHit alone, exact;
            const bool expected = reference.closest(on.origin[i] + off * on.facing[i], on.direction[i],
                                                    on.maxDistance[i], kNoPlane, exact);
            ASSERT_EQ(room.geometry.closest(on.origin[i], on.direction[i], on.maxDistance[i], on.except[i], alone),
                      expected);
            ASSERT_EQ((bits >> i & 1) != 0, expected) << round << ' ' << i;
            if (!expected) continue;
            ++met;
            const AcousticHit& hit = second[static_cast<std::size_t>(i)];
            EXPECT_NEAR(hit.distance, exact.distance, planes ? 1e-5 : 1e-4);
            EXPECT_NEAR(hit.distance, alone.distance, same);
            EXPECT_EQ(hit.plane, alone.plane);
        }
        for (int i = 0; i < back.count; ++i) {
            AcousticHit exact;
            const bool expected = reference.closest(back.origin[i] + off * back.facing[i], back.direction[i],
                                                    back.maxDistance[i], kNoPlane, exact);
            ASSERT_EQ((shut >> i & 1) != 0, expected) << round << ' ' << i;
            ++asked;
            hidden += expected;
        }
    }
    EXPECT_GT(met, 1500);
    EXPECT_GT(hidden, 40);
    EXPECT_LT(hidden, asked);
}

INSTANTIATE_TEST_SUITE_P(WorldGeometry, AskedTogether, testing::Bool());

/// Two triangles of one mesh that face each other, one after the other in it, in either order: what leaves one of them
/// meets the other, and does not meet where it starts.
TEST(WorldGeometry, WithoutPlanesNoTriangleStandsForItsNeighbour) {
    for (std::uint32_t first = 0; first < 2; ++first) {
        auto mesh = std::make_shared<Mesh>();
        for (const float z : {-5.f, 0.f, 1.f})
            for (const Vec3f& p : {Vec3f(-1, -1, z), Vec3f(3, -1, z), Vec3f(-1, 3, z)}) mesh->positions.push_back(p);
        mesh->triangles = first == 0 ? Array<std::int32_t>{3, 4, 5, 6, 7, 8, 0, 1, 2}
                                     : Array<std::int32_t>{0, 1, 2, 3, 4, 5, 6, 7, 8};
        mesh->triangleCount = 3;
        for (const Vec3f& p : mesh->positions) mesh->bounds.extend(p);
        Room room({}, {.maxPlanes = 1});
        room.mesh(NodeId{1}, mesh);
        room.add(NodeId{1}, placed({0, 0, 0}, {1, 1, 1}));
        room.commit();
        ASSERT_TRUE(room.geometry.planes().empty());
        AcousticHit floor, ceiling;
        ASSERT_TRUE(room.geometry.closest({.1, .2, .5}, {0, 0, -1}, 10, kNoPlane, floor));
        ASSERT_TRUE(room.geometry.closest({.1, .2, 0}, {0, 0, 1}, 10, floor.plane, ceiling));
        EXPECT_NEAR(ceiling.distance, 1, 1e-6);
        AcousticRays rays;
        rays.add({.1, .2, 0}, {0, 0, 1}, {0, 0, 1}, 10, floor.plane, floor.clear);
        rays.add({.1, .2, 0}, {0, 0, 1}, {0, 0, 1}, .9, floor.plane, floor.clear);
        AcousticHits hits;
        EXPECT_EQ(room.geometry.closestOf(rays, hits), 1u);
        EXPECT_EQ(room.geometry.blockedOf(rays), 1u);
    }
}

/// Tiles of which one lies a little deeper are one plane: what leaves it from below the others is not blocked by them,
/// but by a lid above all.
TEST(WorldGeometry, TilesThatAreOffTheirPlaneBlockNothingThatStartsOnIt) {
    for (const bool lid : {false, true}) {
        Room room;
        room.mesh(NodeId{1}, unitBox());
        room.add(NodeId{1}, placed({0, 0, -1}, {1, 1, 1}));
        room.add(NodeId{1}, placed({0, 0, -1 + 5e-5}, {1, 1, 1}));
        if (lid) room.add(NodeId{1}, placed({0, 0, 2}, {1, 1, 1}));
        room.commit();
        AcousticHit floor;
        ASSERT_TRUE(room.geometry.closest({.5, .5, 1}, {0, 0, -1}, 10, kNoPlane, floor));
        EXPECT_EQ(floor.clear, 0);
        AcousticRays rays;
        for (const double z : {0., 1e-5, 4e-5})
            rays.add({.5, .5, z}, {0, 0, 1}, glm::normalize(glm::dvec3(.1, .05, 1)), 10, floor.plane, floor.clear);
        EXPECT_EQ(room.geometry.blockedOf(rays), lid ? 7u : 0u);
    }
}

TEST(WorldGeometry, WhatIsOpenIsOpenToRaysThatAreAskedAboutTogether) {
    for (const bool planes : {true, false}) {
        Room room({}, {.maxPlanes = planes ? 20'000u : 1u});
        room.mesh(NodeId{1}, unitBox());
        room.add(NodeId{1}, placed({-5, -5, -5}, {10, 10, 10}));
        const InstanceId body = room.add(NodeId{1}, placed({-.5, -.5, -.5}, {1, 1, 1}));
        room.commit();
        const OpenedGeometry opened(room.geometry, {body.slot});
        AcousticRays rays;
        AcousticHits hits;
        rays.add({.1, 0, 0}, glm::dvec3(0), {1, 0, 0}, 100, kNoPlane);
        ASSERT_EQ(room.geometry.closestOf(rays, hits), 1u);
        EXPECT_NEAR(hits[0].distance, .4, 1e-6);
        ASSERT_EQ(opened.closestOf(rays, hits), 1u);
        EXPECT_NEAR(hits[0].distance, 4.9, 1e-6);
        rays.maxDistance[0] = 3;
        EXPECT_EQ(opened.blockedOf(rays), 0u);
        EXPECT_EQ(room.geometry.blockedOf(rays), 1u);
        // As from a wall whose clearance is known.
        rays.clear[0] = 1e-5;
        EXPECT_EQ(opened.blockedOf(rays), 0u);
        EXPECT_EQ(room.geometry.blockedOf(rays), 1u);
    }
}

// Near and in a corner of three walls, seen from the diagonal of the room, along which paths meet edges, and from
// elsewhere; at the origin, where coordinates are small, and away from it: all images of the lattice, and no other.
TEST(WorldGeometry, NoImageIsLostInACorner) {
    const Shoebox box = Shoebox::uniform({6, 5, 3}, .1);
    constexpr int kOrder = 6;
    for (const glm::dvec3& at : {glm::dvec3(0), glm::dvec3(10, 20, 30), glm::dvec3(-3, -2.5, -1.5)}) {
        AcousticMaterial wall;
        wall.absorption = allBands(.1), wall.scattering = allBands(0);
        Room room(wall);
        room.mesh(NodeId{1}, unitBox());
        room.add(NodeId{1}, placed(at, box.size));
        room.commit();
        for (const glm::dvec3& far :
             {glm::dvec3(4.1, 2.3, 1.2), glm::dvec3(2.5, 2.5, 1.5), glm::dvec3(1.5), glm::dvec3(2)})
            for (const double e : {.02, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 1e-5, 1e-6, 0.0}) {
                const glm::dvec3 corner(e);
                double expected = 0;
                std::size_t images = 0;
                box.images(corner, far, 400, [&](double, double energy, int order) {
                    if (order <= kOrder) expected += energy, ++images;
                });
                const ImageSources found = findImageSources(room.geometry, at + corner, at + far,
                                                            {.maxOrder = kOrder, .maxCandidates = 100'000}, 343, {});
                double sum = 0;
                for (const Arrival& arrival : found.arrivals) sum += arrival.energy[0];
                SCOPED_TRACE(testing::Message() << at.x << ": " << e << " to " << far.x);
                EXPECT_NEAR(sum / expected, 1, 2e-3);
                EXPECT_NEAR(static_cast<double>(found.arrivals.size()), static_cast<double>(images), 2.0);
            }
    }
}

TEST(WorldGeometry, TrianglesNearAPlaceAreAllOfThemOrNotKnown) {
    Room room;
    room.mesh(NodeId{1}, unitBox());
    room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}));
    room.commit();
    const auto near = [&](const glm::dvec3& position, double radius) {
        std::vector<WallTriangle> found;
        return room.geometry.trianglesNear(position, radius, found) ? static_cast<int>(found.size()) : -1;
    };
    EXPECT_EQ(near({3, 2.5, 1.5}, .2), 0);
    EXPECT_EQ(near({.1, 2.5, 1.5}, .2), 2) << "both halves of a wall meet along its diagonal";
    EXPECT_GE(near({.01, .01, .01}, .2), 3);
    std::vector<WallTriangle> corner;
    ASSERT_TRUE(room.geometry.trianglesNear({.01, .01, .01}, .2, corner));
    for (const WallTriangle& one : corner) {
        EXPECT_LT(one.margin, 1e-9) << "its walls are even";
        for (const glm::dvec3& p : one.corners) EXPECT_NEAR(glm::dot(one.normal, p), one.offset, 1e-9);
    }
    // A shape that a transform flattens exists for rays, and has no plane.
    room.add(NodeId{1}, placed({2, 2, 1}, {1, 1, 0}));
    room.commit();
    EXPECT_EQ(near({2.5, 2.5, 1.05}, .2), -1);
    EXPECT_EQ(near({3, 2.5, 2}, .2), 0);
}

}  // namespace
}  // namespace rtsg
