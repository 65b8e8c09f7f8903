// Meshes of round things: turned about the z axis, or drawn along it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "walled.h"

namespace rtsg::test {

struct RoundMesh {
    std::vector<glm::dvec3> corners;
    std::vector<std::uint32_t> triangles;

    void addQuad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
        triangles.insert(triangles.end(), {a, b, c, a, c, d});
    }
    Walled walled(double absorption = 0, const std::vector<WorldFromLocal>& transforms = {WorldFromLocal(1.0)}) const {
        return {corners, triangles, absorption, transforms};
    }
};

/// A surface of revolution by radii and heights; open at both ends.
inline RoundMesh turned(const std::vector<std::array<double, 2>>& profile, int sides) {
    RoundMesh mesh;
    const auto n = static_cast<std::uint32_t>(sides);
    for (const auto& [radius, height] : profile)
        for (int i = 0; i < sides; ++i) mesh.corners.push_back(about(radius, 360.0 * i / sides, height));
    for (std::uint32_t j = 0; j + 1 < profile.size(); ++j)
        for (std::uint32_t i = 0; i < n; ++i)
            mesh.addQuad(j * n + i, j * n + (i + 1) % n, (j + 1) * n + (i + 1) % n, (j + 1) * n + i);
    return mesh;
}

/// With flat ends.
inline RoundMesh cylinderMesh(double radius, double low, double high, int sides) {
    RoundMesh mesh = turned({{radius, low}, {radius, high}}, sides);
    const auto n = static_cast<std::uint32_t>(sides);
    for (std::uint32_t i = 1; i + 1 < n; ++i)
        mesh.triangles.insert(mesh.triangles.end(), {0, i + 1, i, n, n + i, n + i + 1});
    return mesh;
}

/// The poles on the z axis; as good as closed.
inline RoundMesh sphereMesh(double radius, int sides) {
    std::vector<std::array<double, 2>> profile;
    for (int i = 0; i <= sides / 2; ++i) {
        const double latitude = 2 * M_PI * i / sides - M_PI / 2;
        profile.push_back({std::max(1e-6, radius * std::cos(latitude)), radius * std::sin(latitude)});
    }
    return turned(profile, sides);
}

/// The walls of a polygon, from 0 to a height.
inline RoundMesh drawn(const std::vector<glm::dvec3>& outline, double height) {
    RoundMesh mesh;
    const auto n = static_cast<std::uint32_t>(outline.size());
    for (const double z : {0.0, height})
        for (const glm::dvec3& p : outline) mesh.corners.emplace_back(p.x, p.y, z);
    for (std::uint32_t i = 0; i < n; ++i) mesh.addQuad(i, (i + 1) % n, n + (i + 1) % n, n + i);
    return mesh;
}

}  // namespace rtsg::test
