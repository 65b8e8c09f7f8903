// Whether boxes that lie askew meet, by the separating axis theorem.
#pragma once

#include <cmath>

#include <glm/glm.hpp>

namespace rtsg {

/// The first box is about the origin along the axes, half its size; the second, which may be any parallelepiped, is
/// about `center` and has three half edges. Boxes that touch meet.
inline bool boxesMeet(const glm::dvec3& half, const glm::dvec3& center, const glm::dvec3 (&edges)[3]) {
    const auto apart = [&](const glm::dvec3& axis) {
        double reach = glm::dot(half, glm::abs(axis));
        for (const glm::dvec3& edge : edges) reach += std::abs(glm::dot(edge, axis));
        return std::abs(glm::dot(center, axis)) > reach;
    };
    const glm::dvec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 3; ++i) {
        if (apart(axes[i]) || apart(glm::cross(edges[(i + 1) % 3], edges[(i + 2) % 3]))) return false;
        for (const glm::dvec3& edge : edges)
            if (apart(glm::cross(axes[i], edge))) return false;
    }
    return true;
}

}  // namespace rtsg
