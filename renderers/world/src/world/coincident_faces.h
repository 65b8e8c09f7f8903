// Finds all triangles that a ray meets in one place: it reports any one of several that coincide, and rounding decides
// which.
//
// Threading: re-entrant.
#pragma once

#include <algorithm>
#include <cmath>

#include <rtsg/renderers/ray_view.h>

#include "mesh/exact_meeting.h"

namespace rtsg {

namespace in_place {

inline exact::Triangle inRaySpace(const RayInstance& instance, std::uint32_t triangle) {
    const glm::dmat4x3 m(instance.rayFromLocal);
    const auto corner = [&](std::uint32_t i) { return m * glm::dvec4(Vec3d(instance.mesh->vertex(triangle, i)), 1); };
    return {corner(0), corner(1), corner(2)};
}

/// The normal that Hit::normal has.
inline Vec3f outwards(const RayInstance& instance, std::uint32_t triangle) {
    const Vec3d a(instance.mesh->vertex(triangle, 0)), b(instance.mesh->vertex(triangle, 1)),
        c(instance.mesh->vertex(triangle, 2));
    const Vec3d normal = glm::dmat3(instance.normalFromLocal) * glm::cross(b - a, c - a);
    const double length = glm::length(normal);
    return length > 0 ? Vec3f(normal / length) : Vec3f(0, 0, 1);
}

}  // namespace in_place

/// How far rounding may move a hit at `at` by a ray from `from`.
inline float roundingAt(const Vec3f& from, const Vec3f& at) {
    const Vec3f sizes = glm::max(glm::abs(from), glm::abs(at));
    return 0x1p-20f * std::max({sizes.x, sizes.y, sizes.z}) + 1e-30f;
}

/// Calls `tell(hit)` for all triangles that the ray meets at `t`, give or take `radius` from their planes. `near`:
/// RayView::visitNear() of those that count.
template <class Near, class Visitor>
void visitCoincident(const RayView& view, const Near& near, const Ray& ray, float t, float radius,
                     const Visitor& report) {
    const Vec3d from(ray.origin), along(ray.direction);
    const double length = glm::length(along);
    near(ray.origin + t * ray.direction, radius, [&](std::uint32_t slot, std::uint32_t triangle) {
        const RayInstance& instance = view.instance(slot);
        const exact::Triangle corners = in_place::inRaySpace(instance, triangle);
        const auto m = exact::meet(corners, from, along / length);
        constexpr double kEdge = 1e-9;  // so that no ray slips between two triangles
        if (!m || !m->isInside(kEdge)) return radius;
        // Planes that lie as close as `radius` are farther apart along a ray that grazes them.
        const Vec3d normal = glm::cross(corners.b - corners.a, corners.c - corners.a);
        const double steep = std::abs(glm::dot(normal, along)) / (glm::length(normal) * length);
        if (std::abs(m->distance - t * length) * std::max(steep, 0x1p-10) > radius) return radius;
        const float u = std::clamp(static_cast<float>(m->where.u), 0.0f, 1.0f);
        const float v = std::clamp(static_cast<float>(m->where.v), 0.0f, 1 - u);
        report(Hit{static_cast<float>(m->distance / length), slot, triangle, u, v,
                   in_place::outwards(instance, triangle)});
        return radius;
    });
}

}  // namespace rtsg
