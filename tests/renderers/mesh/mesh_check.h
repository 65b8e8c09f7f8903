// Checks of meshes shared by the tessellation tests.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <numbers>
#include <set>
#include <utility>

#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/tessellate.h>

namespace rtsg {

constexpr double kPiOfMesh = std::numbers::pi;

/// Each directed edge once, and its reverse once: closed, consistently oriented, watertight by index.
inline ::testing::AssertionResult isWatertight(const Mesh& mesh) {
    std::map<std::pair<unsigned, unsigned>, int> edges;
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c) ++edges[{mesh.vertexIndex(t, c), mesh.vertexIndex(t, (c + 1) % 3)}];
    for (const auto& [edge, count] : edges) {
        const auto reverse = edges.find({edge.second, edge.first});
        if (count != 1 || reverse == edges.end())
            return ::testing::AssertionFailure()
                   << "edge " << edge.first << " -> " << edge.second << " occurs " << count << " times, its reverse "
                   << (reverse == edges.end() ? 0 : reverse->second);
    }
    return ::testing::AssertionSuccess();
}

/// Vertices - edges + faces over the referenced vertices.
inline int eulerCharacteristic(const Mesh& mesh) {
    std::set<unsigned> vertices;
    std::set<std::pair<unsigned, unsigned>> edges;
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c) {
            const unsigned a = mesh.vertexIndex(t, c), b = mesh.vertexIndex(t, (c + 1) % 3);
            vertices.insert(a);
            edges.insert(std::minmax(a, b));
        }
    return static_cast<int>(vertices.size()) - static_cast<int>(edges.size()) + static_cast<int>(mesh.triangleCount);
}

inline void expectVec(Vec3f actual, Vec3d expected, double tolerance = 1e-6) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(actual[i], expected[i], tolerance) << "component " << i;
}

/// The texture coordinate of the surface nearest to `at` with a geometric normal near `normal`, by trying corners.
inline Vec2f texCoordAt(const Mesh& mesh, Vec3f at, Vec3f normal) {
    double best = 1e30;
    Vec2f result(-99);
    for (unsigned t = 0; t < mesh.triangleCount; ++t) {
        if (glm::dot(mesh.geometricNormal(t), normal) < 0.9f) continue;
        for (const Vec2f uv : {Vec2f(0, 0), Vec2f(1, 0), Vec2f(0, 1)}) {
            const double d = glm::length(mesh.position(t, uv.x, uv.y) - at);
            if (d < best) {
                best = d;
                result = Vec2f(mesh.texCoord(t, uv.x, uv.y));
            }
        }
    }
    EXPECT_LT(best, 1e-4) << "no corner there";
    return result;
}

inline Array<Vec3f> cubePoints() {
    return {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {-1, 1, 1}, {1, 1, 1}};
}
inline Array<std::int32_t> cubeFaces() {
    return {4, 5, 7, 6, -1, 1, 0, 2, 3, -1, 5, 1, 3, 7, -1, 0, 4, 6, 2, -1, 6, 7, 3, 2, -1, 0, 1, 5, 4, -1};
}

}  // namespace rtsg
