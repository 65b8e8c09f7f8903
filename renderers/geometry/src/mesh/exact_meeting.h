// Intersects a line with a triangle, in double precision.
#pragma once

#include <optional>

#include "triangle_distance.h"

namespace rtsg::exact {

/// The place where a line through `from` meets a triangle's plane.
struct Meeting {
    Weights where;
    double distance = 0;
    /// Inside, or outside by no more than `slack` of an edge.
    bool isInside(double slack) const {
        return where.u >= -slack && where.v >= -slack && where.u + where.v <= 1 + slack;
    }
};

/// Nothing where the line runs along the plane.
inline std::optional<Meeting> meet(const Triangle& t, const Vec3d& from, const Vec3d& unit) {
    const Vec3d ab = t.b - t.a, ac = t.c - t.a, h = glm::cross(unit, ac), s = from - t.a, q = glm::cross(s, ab);
    const double det = glm::dot(ab, h);
    if (det == 0) return std::nullopt;
    return Meeting{{glm::dot(s, h) / det, glm::dot(unit, q) / det}, glm::dot(ac, q) / det};
}

}  // namespace rtsg::exact
