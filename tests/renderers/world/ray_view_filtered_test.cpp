// Rays and filters where surfaces coincide: of which one a ray tells is a matter of roundings, and what is left out
// hides nothing.
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/renderers/ray_world.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr std::uint32_t kFilterSeed = 20261129;

/// Keeps the part of slot 0 above a plane, the part of slot 1 below it, and all of the others.
class Halves final : public RayFilter {
  public:
    Halves(const Vec3f& normal, float offset) : normal_(normal), offset_(offset) {}
    bool concerns(std::uint32_t slot) const override { return slot < 2; }
    bool leavesOut(std::uint32_t slot, const Vec3f& at, float error) const override {
        if (!concerns(slot)) return false;
        const double above = side(Vec3d(at));
        return (slot == 0 ? above : -above) < -2 * double{error};
    }
    double side(const Vec3d& at) const { return glm::dot(Vec3d(normal_), at) + double{offset_}; }

  private:
    Vec3f normal_;
    float offset_;
};

/// The square from -1 to 1 of the plane z = 0, of `n` by `n` squares of two triangles each.
std::shared_ptr<Mesh> makeGrid(int n) {
    std::vector<Vec3f> p;
    std::vector<std::int32_t> t;
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x)
            p.emplace_back(2 * static_cast<float>(x) / static_cast<float>(n) - 1,
                           2 * static_cast<float>(y) / static_cast<float>(n) - 1, 0);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            const int a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            t.insert(t.end(), {a, b, d, a, d, c});
        }
    return makeMesh(std::move(p), std::move(t));
}

struct Coincident {
    WorldFromLocal worldFromLocal;
    RayWorld world;
    Coincident(RayWorld::Mapping mapping, const WorldFromLocal& m, Motion motion)
        : worldFromLocal(m), world({.mapping = mapping}) {
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{10}, makeGrid(3)});
        delta.geometries.push_back({NodeId{11}, makeGrid(7)});
        delta.geometries.push_back({NodeId{12}, makeGrid(1)});
        WorldFromLocal behind = m;
        behind[3] -= .5 * m[2];
        delta.added = {makeInstance(0, NodeId{10}, m), makeInstance(1, NodeId{11}, m),
                       makeInstance(2, NodeId{12}, behind)};
        for (Instance& instance : delta.added) instance.motion = motion;
        world.apply(delta);
    }
};

/// Rays to places of two squares that coincide, each of which is left out where the other one is kept. `steep`: the
/// sine of their angle with the plane. How many met the one that is kept, of all.
std::pair<int, int> meetTheKept(const Coincident& scene, double steep, float length, std::mt19937& random) {
    std::uniform_real_distribution<double> unit(-1, 1);
    const Vec3d across = glm::normalize(scene.worldFromLocal[0] + .3 * scene.worldFromLocal[1]);
    const Vec3d origin = scene.world.origin(), middle = scene.worldFromLocal[3] - origin;
    const Halves filter{Vec3f(across), static_cast<float>(-glm::dot(Vec3d(Vec3f(across)), middle))};
    const LensedView view(scene.world, PixelLens(), &filter);
    const Vec3d normal = glm::normalize(glm::cross(scene.worldFromLocal[0], scene.worldFromLocal[1]));
    const double size = glm::length(scene.worldFromLocal[0]);
    int met = 0, all = 0;
    for (int i = 0; i < 1000; ++i) {
        const Vec3d target = scene.worldFromLocal * Vec4d(.9 * unit(random), .9 * unit(random), 0, 1) - origin;
        const double angle = 3.15 * unit(random);
        const Vec3d flat = std::cos(angle) * glm::normalize(scene.worldFromLocal[0]) +
                           std::sin(angle) * glm::normalize(glm::cross(normal, scene.worldFromLocal[0]));
        const Vec3d displacement = std::sqrt(1 - steep * steep) * flat - steep * normal;
        Ray ray;
        ray.origin = Vec3f(target - (1 + unit(random) / 2) * size * displacement);
        ray.direction = length * Vec3f(displacement);
        // Where it really goes through the plane.
        const Vec3d from(ray.origin), along(ray.direction);
        const double t = glm::dot(middle - from, normal) / glm::dot(along, normal);
        const Vec3d at = from + t * along;
        const Vec3d local = glm::inverse(glm::dmat3(scene.worldFromLocal)) * (at - middle);
        if (std::max(std::abs(local.x), std::abs(local.y)) > .95 || std::abs(filter.side(at)) < .01 * size) continue;
        ++all;
        const Hit hit = view.intersect(ray);
        const std::uint32_t kept = filter.side(at) > 0 ? 0 : 1;
        const bool right = hit.instance == kept && std::abs(hit.t - t) * length * steep < 1e-5 * size;
        met += right;
        RayPacket16 packet;
        for (int lane = 0; lane < 16; ++lane) packet.skip(lane);
        packet.set(3, ray);
        view.intersect(packet);
        EXPECT_EQ(view.hit(packet, 3).instance, hit.instance);
    }
    return {met, all};
}

TEST(RayViewFiltered, WhatIsLeftOutHidesNothingInItsPlace) {
    for (const auto mapping : {RayWorld::Mapping::merged, RayWorld::Mapping::perShape, RayWorld::Mapping::hybrid})
        for (const Motion motion : {Motion::fixed, Motion::moving})
            for (const double steep : {1., .3, .03, .003})
                for (const float length : {.05f, 1.f, 1e4f}) {
                    const std::uint32_t seed = kFilterSeed + static_cast<std::uint32_t>(1000 * steep);
                    SCOPED_TRACE(testing::Message()
                                 << "mapping " << int(mapping) << ", moving " << (motion == Motion::moving)
                                 << ", steep " << steep << ", length " << length << ", seed " << seed);
                    std::mt19937 random(seed);
                    WorldFromLocal m = identityTransform();
                    const glm::dmat3 rotation = glm::mat3_cast(glm::angleAxis(.7, glm::normalize(Vec3d(1, 2, 3))));
                    for (int i = 0; i < 3; ++i) m[i] = 30. * rotation[i];
                    m[3] = {20, -50, 70};
                    const Coincident scene(mapping, m, motion);
                    const auto [met, all] = meetTheKept(scene, steep, length, random);
                    EXPECT_GT(all, 200);
                    EXPECT_EQ(met, all);
                }
}

}  // namespace
}  // namespace rtsg
