// A hall of long triangles, which Embree sees in pieces: nothing gets through where they meet, and nothing that leaves
// a triangle meets it again.
#include <random>

#include "embree/long_triangles.h"
#include "renderers/ray_support.h"

namespace rtsg {
namespace {

constexpr std::uint32_t kHallSeed = 20261123;

struct HallStage {
    std::vector<std::pair<Vec3f, Vec3f>> axes;
    std::shared_ptr<const Mesh> mesh;
    RayWorld world;

    HallStage(std::mt19937& random, const Vec3d& position, bool isMoving)
        : mesh(test::makeBeams(random, 60, 7, .1f, &axes)), world(RayWorld::Options{}) {
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, mesh});
        delta.added.push_back(test::makeInstance(0, NodeId{1}, test::translation(position)));
        delta.added.back().motion = isMoving ? Motion::moving : Motion::fixed;
        // A second one at 0 keeps the origin there, or nearly so: the worst case for float.
        delta.geometries.push_back({NodeId{2}, test::makeSphere(1)});
        delta.added.push_back(test::makeInstance(1, NodeId{2}, test::translation({0, 0, -200})));
        world.apply(delta);
    }
};

// From inside of each beam at its shell, at any place of its edges: nothing gets through, whether by itself or in a
// packet. Where an edge is cut there are corners, and next to corners, to a few units in the last place of what the ray
// is seen at, Embree's robust flag lets rays through whatever the mesh (RayWorld.ClosedSurfacesDoNotLeak): of rays that
// run along the beams within 2 mm of those places some 2 in 100,000, of others none in as many.
TEST(LongTrianglesInAHall, NothingGetsThroughSharedEdges) {
    for (const bool isMoving : {false, true})
        for (const double away : {0.0, 100.0}) {
            std::mt19937 random(kHallSeed);
            HallStage stage(random, Vec3d(away, 0, 0), isMoving);
            ASSERT_TRUE(bvh::cutLongTriangles(*stage.mesh, stage.mesh->positions));
            std::uniform_real_distribution<double> unit(0, 1);
            const std::uint32_t perBeam = stage.mesh->triangleCount / 60;
            int leaks = 0, packetLeaks = 0, cornerLeaks = 0, rays = 0;
            for (int round = 0; round < 12'000; ++round) {
                RayPacket16 packet;
                for (int lane = 0; lane < 16; ++lane) {
                    const std::uint32_t triangle = static_cast<std::uint32_t>(random()) % stage.mesh->triangleCount;
                    const std::uint32_t k = static_cast<std::uint32_t>(random()) % 3;
                    const Vec3d a(stage.mesh->vertex(triangle, k)), b(stage.mesh->vertex(triangle, (k + 1) % 3));
                    // Every other one passes close to where an edge is cut.
                    double s = unit(random);
                    if (round & 1) s = (std::floor(32 * s) + 1e-2 * (unit(random) - .5)) / 32;
                    s = std::clamp(s, .001, .999);
                    const auto& [from, to] = stage.axes[triangle / perBeam];
                    const Vec3d position(away, 0, 0);
                    const double inside = .01 + .98 * unit(random);
                    const Vec3f start =
                        stage.world.fromWorld(position + Vec3d(from) * (1 - inside) + Vec3d(to) * inside);
                    const Ray ray{start, 0, stage.world.fromWorld(position + a * (1 - s) + b * s) - start};
                    packet.set(lane, ray);
                    const Hit hit = stage.world.intersect(ray);
                    (round & 1 ? cornerLeaks : leaks) += !hit || !(hit.t < 1.01f);
                    ++rays;
                }
                const std::uint32_t hits = stage.world.intersect(packet);
                for (int lane = 0; lane < 16 && !(round & 1); ++lane)
                    packetLeaks += !(hits >> lane & 1u) || !(stage.world.hit(packet, lane).t < 1.01f);
            }
            EXPECT_LE(cornerLeaks, rays / 2 / 4000) << "moving " << isMoving << " away " << away;
            EXPECT_EQ(leaks, 0) << "of " << rays / 2 << " moving " << isMoving << " away " << away;
            EXPECT_EQ(packetLeaks, 0) << "moving " << isMoving << " away " << away;
        }
}

TEST(LongTrianglesInAHall, LeavingRaysDoNotHitTheTriangleTheyLeave) {
    for (const bool isMoving : {false, true})
        for (const double away : {0.0, 1e3}) {
            std::mt19937 random(kHallSeed);
            HallStage stage(random, Vec3d(away, 0, 0), isMoving);
            int hits = 0, falseHits = 0;
            for (int i = 0; i < 50'000; ++i) {
                Ray ray = test::randomRay(random, 8);
                ray.origin.x += static_cast<float>(away);
                ray.origin = stage.world.fromWorld(Vec3d(ray.origin));
                const Hit hit = stage.world.intersect(ray);
                if (!hit || hit.instance != 0) continue;
                ++hits;
                const HitPoint point = stage.world.point(hit);
                const Vec3f outwards = hit.normal + .9f * glm::normalize(test::randomRay(random, 1).direction);
                const Hit again = stage.world.intersect({RayWorld::leave(point, outwards), 0, outwards});
                falseHits += again && again.instance == 0 && again.triangle == hit.triangle;
            }
            EXPECT_GT(hits, 5000);
            EXPECT_EQ(falseHits, 0) << "of " << hits << " moving " << isMoving << " away " << away;
        }
}

}  // namespace
}  // namespace rtsg
