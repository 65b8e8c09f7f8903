// Describes a hit on a triangle that lies on none of the planes found.
//
// Threading: functions of their arguments.
#pragma once

#include <algorithm>
#include <cstdint>

#include <glm/glm.hpp>

#include <rtsg/renderers/ray_view.h>

#include "walls.h"

namespace rtsg {

/// The number by which rays that start on it leave it out; no plane has it, nor is it kNoPlane.
inline std::uint32_t looseNumber(std::uint32_t instance, std::uint32_t triangle) {
    const std::uint32_t own = (instance * 0x9E3779B1u + triangle) & 0x7FFFFFFFu;
    return 0x80000000u | std::min(own, 0x7FFFFFFEu);
}

/// A normal of length 1 in single precision; one step of Newton's makes it so here.
inline glm::dvec3 looseNormal(const Vec3f& found) {
    const glm::dvec3 normal(found);
    return normal * (1.5 - 0.5 * glm::dot(normal, normal));
}

/// How far rays may be off a triangle of an instance, or it off where it is in double precision (RayView::point() has
/// the bound and where it is from). `origin`: of the view.
inline double looseClearance(const Wall& wall, const RayInstance& instance, const glm::dvec3& origin) {
    constexpr double kEps = 0x1p-24, kGamma = 12 * kEps / (1 - 12 * kEps);
    // The bound for the whole mesh: a little larger than that of the triangle, but already known.
    const glm::dvec3 moved = glm::abs(wall.worldFromLocal[3] - origin);
    const Vec3f& floor = instance.errorFloor;
    return (wall.reach * double{instance.errorScale} + moved.x + moved.y + moved.z) * kGamma + double{floor.x} +
           double{floor.y} + double{floor.z};
}

}  // namespace rtsg
