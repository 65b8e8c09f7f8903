// Volumes and boxes of the closed bodies of meshes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

#include "walls/mesh_bodies.h"

namespace rtsg {
namespace {

Mesh meshOfCorners(const std::vector<glm::vec3>& corners, const std::vector<int>& triangles) {
    Mesh mesh;
    for (const glm::vec3& p : corners) mesh.positions.push_back(Vec3f(p));
    mesh.triangles = Array<int>(std::span<const int>(triangles));
    mesh.triangleCount = static_cast<std::uint32_t>(triangles.size() / 3);
    return mesh;
}
/// Boxes, each from its low corner to its high one.
Mesh boxMesh(const std::vector<std::array<glm::vec3, 2>>& boxes) {
    std::vector<glm::vec3> corners;
    std::vector<int> triangles;
    for (const auto& [low, high] : boxes) {
        const int first = static_cast<int>(corners.size());
        for (int i = 0; i < 8; ++i)
            corners.emplace_back(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
        for (const int corner : {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5})
            triangles.push_back(first + corner);
    }
    return meshOfCorners(corners, triangles);
}

TEST(MeshBodies, ABoxIsItselfHoweverItIsTurned) {
    const MeshBodies bodies(boxMesh({{glm::vec3(-.1f, -.2f, -.3f), glm::vec3(.3f, .2f, 1.7f)}}));
    ASSERT_EQ(bodies.all().size(), 1u);
    EXPECT_EQ(bodies.at({.3f, .2f, 1.7f}), 0u);
    EXPECT_EQ(bodies.at({0, 0, 0}), MeshBodies::kNone);
    const glm::dmat4 turned =
        glm::rotate(glm::translate(glm::dmat4(1), glm::dvec3(5, -3, 2)), .7, glm::normalize(glm::dvec3(1, 2, -.5)));
    WallBody body;
    ASSERT_TRUE(placedBody(bodies.all()[0], WorldFromLocal(glm::scale(turned, glm::dvec3(1, -1, 2))), body));
    EXPECT_NEAR(body.fill, 1, 1e-6);
    EXPECT_NEAR(8 * std::abs(glm::determinant(body.half)), .4 * .4 * 4, 1e-6);
    EXPECT_LT(glm::distance(body.middle, glm::dvec3(turned * glm::dvec4(.1, 0, 1.4, 1))), 1e-6);
    EXPECT_LT(glm::distance(body.half[2], glm::dvec3(turned[2]) * 2.0), 1e-6);
    EXPECT_LT(glm::distance(body.boxFromWorld * body.half[1], glm::dvec3(0, 1, 0)), 1e-9);
}

TEST(MeshBodies, WhatMeetsIsOneAndWhatIsOpenIsNone) {
    // In each other, side by side, and apart.
    const MeshBodies bodies(boxMesh({{glm::vec3(0), glm::vec3(1)},
                                     {glm::vec3(.5f, 0, 0), glm::vec3(2, 1, 1)},
                                     {glm::vec3(2, 0, 0), glm::vec3(3, 1, 1)},
                                     {glm::vec3(4, 0, 0), glm::vec3(5, 1, 1)}}));
    ASSERT_EQ(bodies.all().size(), 2u);
    const MeshBody& joined = bodies.all()[bodies.at({0, 0, 0})];
    EXPECT_NEAR(joined.volume, 3.5, 1e-9);
    EXPECT_EQ(joined.low, glm::dvec3(0));
    EXPECT_EQ(joined.high, glm::dvec3(3, 1, 1));
    EXPECT_EQ(bodies.at({3, 1, 1}), bodies.at({0, 0, 0}));
    EXPECT_NEAR(bodies.all()[bodies.at({4, 0, 0})].volume, 1, 1e-9);
    // A tetrahedron, with a face and without it, and with one turned over.
    const std::vector<glm::vec3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const MeshBodies whole(meshOfCorners(corners, {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}));
    ASSERT_EQ(whole.all().size(), 1u);
    EXPECT_NEAR(whole.all()[0].volume, 1 / 6.0, 1e-9);
    EXPECT_EQ(whole.all()[0].high, glm::dvec3(1));
    EXPECT_TRUE(MeshBodies(meshOfCorners(corners, {0, 2, 1, 0, 1, 3, 0, 3, 2})).all().empty());
    EXPECT_TRUE(MeshBodies(meshOfCorners(corners, {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 3, 2})).all().empty());
}

}  // namespace
}  // namespace rtsg
