// Rays against the shapes of the drag sensors: closed forms, continuous at the edges.
#include "drag_geometry.h"

#include <cmath>

#include <glm/geometric.hpp>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>

namespace rtsg::behaviours {

std::optional<glm::dvec3> onPlane(const DragRay& ray, const glm::dvec3& point, const glm::dvec3& normal) {
    const double along = glm::dot(ray.direction, normal);
    const double t = glm::dot(point - ray.origin, normal) / along;
    if (along == 0 || !std::isfinite(t) || t < 0) return std::nullopt;
    return ray.origin + ray.direction * t;
}

double rotationAboutY(const glm::dvec3& point) {
    return portable::atan2(point.x, point.z);
}

double wrapped(double angle) {
    const double rest = std::remainder(angle, 2 * M_PI);
    return rest <= -M_PI ? rest + 2 * M_PI : rest;
}

namespace {

glm::dvec3 flat(const glm::dvec3& v) {
    return {v.x, 0, v.z};
}
/// Along the ray, where it is nearest to the origin.
double nearest(const glm::dvec3& origin, const glm::dvec3& direction) {
    return -glm::dot(origin, direction) / glm::dot(direction, direction);
}

}  // namespace

std::optional<OnCylinder> onCylinder(const DragRay& ray, double radius, bool far) {
    const glm::dvec3 o = flat(ray.origin), d = flat(ray.direction);
    const double dd = glm::dot(d, d);
    if (!(dd > 1e-24 * glm::dot(ray.direction, ray.direction))) return std::nullopt;
    const double middle = nearest(o, d);
    const glm::dvec3 foot = o + d * middle;
    const double rest = radius * radius - glm::dot(foot, foot);
    OnCylinder found;
    found.facing = rotationAboutY(far ? d : -d);
    if (rest >= 0) {
        const double half = std::sqrt(rest / dd), t = far ? middle + half : middle - half;
        found.point = ray.origin + ray.direction * t;
        found.beside = wrapped(rotationAboutY(found.point) - found.facing);
        return found;
    }
    const double distance = glm::length(foot);
    const double edge = wrapped(rotationAboutY(foot) - found.facing);  // a right angle to one side or the other
    found.beside = edge + std::copysign((distance - radius) / radius, edge);
    const double angle = found.facing + found.beside;
    found.point = {radius * portable::sin(angle), ray.origin.y + ray.direction.y * middle,
                   radius * portable::cos(angle)};
    return found;
}

bool leavesCylinder(const DragRay& ray, const glm::dvec3& point) {
    return glm::dot(flat(point), flat(ray.direction)) > 0;
}

std::optional<glm::dvec3> onSphere(const DragRay& ray, double radius, bool far) {
    const double dd = glm::dot(ray.direction, ray.direction);
    if (!(dd > 0)) return std::nullopt;
    const double middle = nearest(ray.origin, ray.direction);
    const glm::dvec3 foot = ray.origin + ray.direction * middle;
    const double distance = glm::length(foot), rest = radius * radius - distance * distance;
    if (rest >= 0) {
        const double half = std::sqrt(rest / dd);
        return ray.origin + ray.direction * (far ? middle + half : middle - half);
    }
    const glm::dvec3 ahead = ray.direction / std::sqrt(dd), facing = far ? ahead : -ahead, edge = foot / distance;
    const double beyond = (distance - radius) / radius;
    return radius * (edge * portable::cos(beyond) - facing * portable::sin(beyond));
}

bool leavesSphere(const DragRay& ray, const glm::dvec3& point) {
    return glm::dot(point, ray.direction) > 0;
}

glm::dquat shortestRotation(const glm::dvec3& from, const glm::dvec3& to) {
    const glm::dvec3 a = glm::normalize(from), b = glm::normalize(to);
    glm::dvec3 axis = glm::cross(a, b);
    const double sine = glm::length(axis), cosine = glm::dot(a, b);
    if (sine > 1e-15) return rotationAround(axis / sine, portable::atan2(sine, cosine));
    if (cosine > 0) return {1, 0, 0, 0};
    const glm::dvec3 other = std::abs(a.y) < .5 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
    axis = glm::normalize(other - a * glm::dot(a, other));
    return {0, axis.x, axis.y, axis.z};
}

}  // namespace rtsg::behaviours
