#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/audio/acoustic_tracer.h>
#include <rtsg/audio/world_geometry.h>

#include "triangle_geometry.h"

namespace rtsg {
namespace {

using test::Shoebox;
using test::TriangleGeometry;
const glm::dvec3 kSource{1, 1, 1.5}, kListener{4, 3, 1.5};

/// Box of unit edge from the origin, fronts inwards or outwards: no matter.
std::shared_ptr<Mesh> unitBox() {
    auto mesh = std::make_shared<Mesh>();
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
    RayWorld world;
    InstanceDelta delta;
    std::uint32_t next = 0;

    void mesh(NodeId node, std::shared_ptr<const Mesh> m) { delta.geometries.push_back({node, std::move(m)}); }
    InstanceId add(NodeId geometry, const WorldFromLocal& m, NodeId acoustics = {}) {
        Instance instance;
        instance.id = {next++, 0};
        instance.shape = NodeId{100 + next};
        instance.geometry = geometry;
        instance.acoustics = acoustics;
        instance.worldFromLocal = m;
        delta.added.push_back(instance);
        return instance.id;
    }
    void commit() {
        world.apply(delta);
        delta.clear();
    }
};

AcousticMaterial uniform(double absorption, double scattering) {
    return {allBands(absorption), allBands(scattering), allBands(0)};
}

TEST(WorldGeometry, TheBoxThroughTheBvhHasTheImagesOfTheLattice) {
    for (const double angle : {0.0, 0.6}) {
        Room room;
        room.mesh(NodeId{1}, unitBox());
        const WorldFromLocal m = placed({7, -2, 3}, {6, 5, 3}, angle);
        room.add(NodeId{1}, m, NodeId{9});
        room.commit();
        WorldGeometry geometry(room.world);
        geometry.setMaterial(NodeId{9}, uniform(.1, 0));
        EXPECT_TRUE(geometry.update());
        EXPECT_FALSE(geometry.update());
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

TEST(WorldGeometry, RaysInTheBvhAgreeWithTheReferenceAndNothingLeaks) {
    Room room;
    room.mesh(NodeId{1}, unitBox());
    room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}), NodeId{9});
    room.commit();
    WorldGeometry geometry(room.world);
    geometry.setMaterial(NodeId{9}, uniform(.1, .5));
    geometry.update();
    TraceOptions options;
    options.rays = 9600;
    options.imageOrder = 3;
    options.maxSeconds = 3;
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
    Room room;
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
    WorldGeometry geometry(room.world, {.defaultMaterial = uniform(.2, .1)});
    geometry.update();
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
    room.mesh(NodeId{1}, unitBox());
    room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}), NodeId{9});
    const InstanceId screen = room.add(NodeId{1}, placed({2.4, -1, 1}, {.1, 7, 4}), NodeId{9});
    room.commit();
    WorldGeometry geometry(room.world);
    geometry.setMaterial(NodeId{9}, uniform(.1, 0));
    geometry.update();
    EXPECT_TRUE(findImageSources(geometry, kSource, kListener, {.maxOrder = 0}, 343, {}).arrivals.empty());
    room.delta.moved.push_back({screen, placed({2.4, 10, 1}, {.1, 7, 4})});
    room.commit();
    EXPECT_TRUE(geometry.update());
    EXPECT_EQ(findImageSources(geometry, kSource, kListener, {.maxOrder = 1}, 343, {}).arrivals.size(), 7u);
    geometry.setMaterial(NodeId{9}, uniform(.75, 0));
    EXPECT_TRUE(geometry.update());
    const auto soft = findImageSources(geometry, kSource, kListener, {.maxOrder = 1}, 343, {});
    const double d = soft.arrivals[1].seconds * 343;
    EXPECT_NEAR(soft.arrivals[1].energy[3] * 4 * M_PI * d * d, .25, 1e-9);
    room.delta.removed.push_back(screen);
    room.commit();
    EXPECT_TRUE(geometry.update());
    EXPECT_EQ(geometry.planes().size(), 6u);
}

TEST(WorldGeometry, WithoutPlanesRaysDoItAll) {
    Room room;
    room.mesh(NodeId{1}, unitBox());
    room.add(NodeId{1}, placed({0, 0, 0}, {6, 5, 3}));
    room.commit();
    WorldGeometry geometry(room.world, {.defaultMaterial = uniform(.3, .1), .maxPlaneTriangles = 5});
    geometry.update();
    TraceOptions options;
    options.rays = 9600;
    options.maxSeconds = 2;
    const TraceResult result = AcousticTracer(geometry).trace(kSource, kListener, options);
    EXPECT_EQ(result.imageOrder, 0);
    EXPECT_EQ(result.arrivals.size(), 1u);
    const MetricsEstimate m = result.metrics();
    EXPECT_NEAR(m.value.t20[0], .3596, 2 * m.ci95.t20[0] + 0.003);
    EXPECT_NEAR(m.value.g[0], 19.271, 2 * m.ci95.g[0] + 0.05);
    EXPECT_LT(result.escaped[0], 1e-3);
}

TEST(WorldGeometry, AnEmptyWorldIsAVoid) {
    RayWorld world;
    WorldGeometry geometry(world);
    geometry.update();
    AcousticHit hit;
    EXPECT_FALSE(geometry.closest({0, 0, 0}, {0, 0, 1}, 10, kNoPlane, hit));
    EXPECT_EQ(geometry.distanceToSurface({0, 0, 0}), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace rtsg
