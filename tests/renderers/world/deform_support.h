// Shared by tests of deforming meshes.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "renderers/ray_support.h"

namespace rtsg::test {

/// The mesh with every position moved; the triangles are the same array.
inline std::shared_ptr<Mesh> moved(const Mesh& mesh, auto move) {
    auto result = std::make_shared<Mesh>(mesh);
    Vec3f* out = result->positions.mutableData();
    result->bounds = {};
    for (std::size_t i = 0; i < result->positions.size(); ++i) result->bounds.extend(out[i] = move(out[i]));
    return result;
}

inline Vec3f twist(Vec3f p, float amount) {
    const float a = amount * p.y, c = std::cos(a), s = std::sin(a);
    return {c * p.x - s * p.z, p.y, s * p.x + c * p.z};
}

/// A world of one moving shape, whose mesh is given anew each time.
struct OneShape {
    RayWorld world{{.buildThreads = 1}};
    void show(const std::shared_ptr<const Mesh>& mesh) {
        InstanceDelta delta;
        if (!std::exchange(shown, true)) {
            Instance instance = makeInstance(0, NodeId{1});
            instance.motion = Motion::moving;
            delta.added.push_back(instance);
        }
        delta.geometries.push_back({NodeId{1}, mesh});
        world.finishBackgroundWork();  // the same updates give the same trees
        world.apply(delta);
    }
    bool shown = false;
};

/// Random rays through the box of `b` find the same distances in both; some must hit.
inline ::testing::AssertionResult sameHits(const RayView& a, const RayView& b, std::mt19937& random, int rays) {
    const Bounds box = b.bounds();
    std::uniform_real_distribution<float> unit(-1, 1);
    int hits = 0;
    for (int i = 0; i < rays; ++i) {
        const Vec3f direction(unit(random), unit(random), unit(random));
        const Vec3f at = box.center() + .5f * box.size() * Vec3f(unit(random), unit(random), unit(random));
        const Ray ray{.origin = at - direction * (3 + glm::length(box.size())), .direction = direction};
        const Hit x = a.intersect(ray), y = b.intersect(ray);
        hits += static_cast<bool>(y);
        // At an edge or where two surfaces cross either triangle may be named: the distance is the same.
        if (static_cast<bool>(x) != static_cast<bool>(y) || (x && std::abs(x.t - y.t) > 1e-5f * (1 + y.t)))
            return ::testing::AssertionFailure() << "ray " << i << ": " << x.t << ", from scratch " << y.t;
    }
    if (hits == 0) return ::testing::AssertionFailure() << "no ray hit anything";
    return ::testing::AssertionSuccess();
}

}  // namespace rtsg::test
