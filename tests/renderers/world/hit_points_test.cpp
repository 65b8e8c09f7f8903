// Places of hits: how far they are from those in double precision, and what is said of that.
#include <cmath>
#include <random>
#include <span>

#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/renderers/ray_world.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

using namespace test;

constexpr std::uint32_t kPointSeed = 20261129;

struct Spot {
    const char* name;
    WorldFromLocal transform;
    float size;  // of the triangles
};

WorldFromLocal spun(const Vec3d& axis, double angle, const Vec3d& scale) {
    const glm::dmat3 m = glm::mat3_cast(glm::angleAxis(angle, glm::normalize(axis)));
    return {m[0] * scale.x, m[1] * scale.y, m[2] * scale.z, Vec3d(0)};
}

/// The largest share that errors have of their bounds, by axis.
Vec3d largestFraction(const RayWorld& world, const WorldFromLocal& m, const Mesh& mesh, std::mt19937& random) {
    std::uniform_real_distribution<float> unit(0, 1);
    Vec3d largest(0);
    for (std::uint32_t triangle = 0; triangle < mesh.triangleCount; ++triangle)
        for (int i = 0; i < 50; ++i) {
            Hit hit;
            hit.t = 1, hit.instance = 0, hit.triangle = triangle;
            hit.u = unit(random), hit.v = unit(random) * (1 - hit.u);
            const Vec3d a(mesh.vertex(triangle, 0)), b(mesh.vertex(triangle, 1)), c(mesh.vertex(triangle, 2));
            const Vec3d local = (1 - double{hit.u} - double{hit.v}) * a + double{hit.u} * b + double{hit.v} * c;
            const Vec3d exact = m * Vec4d(local, 1) - world.origin();
            const HitPoint point = world.point(hit);
            largest = glm::max(largest, glm::abs(Vec3d(point.position) - exact) / Vec3d(point.error));
        }
    return largest;
}

// The bound holds on each axis by itself, and says no more than fifty times what there is.
TEST(HitPoints, ErrorsAreWithinTheirBoundsWhichAreNotWide) {
    std::mt19937 random(kPointSeed);
    const auto moved = [](WorldFromLocal m, const Vec3d& by) {
        m[3] = by;
        return m;
    };
    const Spot spots[] = {
        {"as it is", identityTransform(), 1},
        {"small", scaling(Vec3d(1e-3)), 1e-3f},
        {"large", scaling(Vec3d(1e2)), 1e3f},
        {"large, of small ones", scaling(Vec3d(1e4)), 1e-3f},
        {"long in x", scaling({1e3, 1, 1e-3}), 20},
        {"long in y", scaling({1e-3, 1e3, 1}), .02f},
        {"long in z", scaling({1, 1e-3, 1e3}), 5},
        {"turned", spun({1, 2, 3}, .7, Vec3d(1)), 300},
        {"turned and mirrored", spun({3, -1, 2}, 2.1, {-.01, .01, .01}), .03f},
        {"far away", moved(scaling({2, .5, 1}), {1e4, -2e4, 3e4}), 10},
    };
    for (const Spot& ray : spots) {
        SCOPED_TRACE(testing::Message() << ray.name << ", seed " << kPointSeed);
        const std::shared_ptr<Mesh> mesh = makeSoup(random, 200);
        for (Vec3f& p : std::span<Vec3f>(mesh->positions.mutableData(), mesh->positions.size())) p *= ray.size;
        mesh->bounds = {mesh->bounds.min * ray.size, mesh->bounds.max * ray.size};
        RayWorld world;
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, mesh});
        delta.added.push_back(makeInstance(0, NodeId{1}, ray.transform));
        world.apply(delta);
        ASSERT_EQ(world.stats().traced, 1u);
        const Vec3d fraction = largestFraction(world, ray.transform, *mesh, random);
        for (int axis = 0; axis < 3; ++axis) {
            EXPECT_LE(fraction[axis], 1) << axis;
            EXPECT_GE(fraction[axis], 1. / 50) << axis;
        }
    }
}

// A transform that is hard to invert magnifies the errors of rays that go through it, and the bound as much.
TEST(HitPoints, ErrorsAreWithinTheirBoundsWhateverTheTransform) {
    std::mt19937 random(kPointSeed + 1);
    std::uniform_real_distribution<double> exponent(-2, 2);
    for (int i = 0; i < 40; ++i) {
        SCOPED_TRACE(testing::Message() << i << ", seed " << kPointSeed + 1);
        WorldFromLocal m = randomTransform(random, 100);
        for (int k = 0; k < 3; ++k) m[k] *= std::pow(10, exponent(random));
        const std::shared_ptr<Mesh> mesh = makeSoup(random, 50);
        RayWorld world;
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, mesh});
        delta.added.push_back(makeInstance(0, NodeId{1}, m));
        world.apply(delta);
        ASSERT_EQ(world.stats().traced, 1u);
        const Vec3d fraction = largestFraction(world, m, *mesh, random);
        const double condition = world.instance(0).errorScale;
        for (int axis = 0; axis < 3; ++axis) {
            EXPECT_LE(fraction[axis], 1) << axis;
            EXPECT_GE(fraction[axis] * condition, 1. / 50) << axis << " " << condition;
        }
    }
}

}  // namespace
}  // namespace rtsg
