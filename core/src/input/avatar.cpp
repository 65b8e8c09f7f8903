// Walking, flying and turning, by closed forms and a few rays.
#include "avatar.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

constexpr glm::dvec3 kUp(0, 1, 0);
/// The outermost rays start at this share of the avatar's radius, so that a wall along which it slides does not stop
/// them.
constexpr double kWithin = .999;

/// The starts of rays, relative to the eye, for a motion along `direction`.
std::vector<glm::dvec3> startsOf(const glm::dvec3& direction, const Avatar& avatar, bool walks) {
    glm::dvec3 side = glm::cross(direction, kUp);
    side = glm::length(side) > 1e-9 ? glm::normalize(side) : glm::dvec3(1, 0, 0);
    const double r = avatar.radius * kWithin;
    std::vector<glm::dvec3> starts;
    if (walks) {
        const double low = std::min(0.0, avatar.step * (1 + kStepMargin) - avatar.height);
        for (const double height : {low, low / 2, 0.0})
            for (const double across : {0.0, -r, r, -r / 2, r / 2}) starts.push_back(side * across + kUp * height);
        return starts;
    }
    const glm::dvec3 other = glm::cross(side, direction);
    starts.emplace_back(0);
    for (int i = 0; i < 8; ++i) {
        const double angle = i * M_PI / 4;
        for (const double fraction : {1.0, .5})
            starts.push_back((side * portable::cos(angle) + other * portable::sin(angle)) * (r * fraction));
    }
    return starts;
}

}  // namespace

glm::dvec3 slideBy(glm::dvec3 eye, glm::dvec3 motion, const Avatar& avatar, bool walks, const CastRay& cast) {
    constexpr int kMaxRotations = 4;
    for (int i = 0; i < kMaxRotations; ++i) {
        const double length = glm::length(motion);
        if (!(length > 1e-9)) break;
        const glm::dvec3 direction = motion / length;
        double free = length;
        glm::dvec3 wall(0);
        for (const glm::dvec3& start : startsOf(direction, avatar, walks)) {
            const auto met = cast(eye + start, direction, length + 1.1 * avatar.radius);
            if (!met) continue;
            glm::dvec3 normal = met->normal;
            if (walks) {
                if (normal.y > kSteepest) continue;
                normal.y = 0;
                if (!(glm::length(normal) > 1e-6)) continue;
                normal = glm::normalize(normal);
            }
            const double approach = -glm::dot(direction, normal);
            if (!(approach > 1e-6)) continue;
            const double distance = -glm::dot(start + direction * met->distance, normal);
            const double here = std::max(0.0, (distance - avatar.radius) / approach);
            if (here < free) {
                free = here;
                wall = normal;
            }
        }
        eye += direction * free;
        if (wall == glm::dvec3(0)) break;
        const glm::dvec3 rest = direction * (length - free);
        motion = rest - wall * glm::dot(rest, wall);
    }
    return eye;
}

glm::dvec3 slideBy(glm::dvec3 eye, glm::dvec3 motion, const SweepAvatar& sweep) {
    constexpr int kMaxContacts = 6;
    for (int i = 0; i < kMaxContacts; ++i) {
        const double length = glm::length(motion);
        if (!(length > 1e-9)) break;
        const glm::dvec3 direction = motion / length;
        const auto met = sweep(eye, direction, length);
        if (!met) return eye + motion;
        eye += direction * met->distance;
        const glm::dvec3 rest = direction * (length - met->distance);
        motion = rest - met->normal * glm::dot(rest, met->normal);
    }
    return eye;
}

bool stopsAvatars(const Scene& scene, std::span<const NodeId> path) {
    using N = x3d::Collision;
    for (std::size_t i = 0; i < path.size(); ++i) {
        const Node* node = scene.find(path[i]);
        if (!node || !node->is(N::type)) continue;
        if (!node->get(N::enabled)) return false;
        const NodeId proxy = node->get(N::proxy);
        if (proxy && i + 1 < path.size() && path[i + 1] != proxy) return false;
    }
    return true;
}

namespace {

/// Whether the way to here rose too steeply: over the run at which a slope of 60 degrees is as high as a step, the
/// ground rises by more.
bool isTooSteep(const glm::dvec3& eye, const glm::dvec3& motion, double ground, double step, const CastRay& cast) {
    const double length = glm::length(motion);
    if (!(length > 0) || !(step > 0)) return false;
    const double run = step * kSteepest / std::sqrt(1 - kSteepest * kSteepest);
    const auto behind = cast(eye - motion * (run / length), -kUp, INFINITY);
    return behind && behind->distance - ground > step;
}

}  // namespace

Stand standOrFall(glm::dvec3 eye, double fallSpeed, double seconds, const Avatar& avatar, const CastRay& cast,
                  const glm::dvec3& motion) {
    const auto below = cast(eye, -kUp, INFINITY);
    if (!below) return {eye, 0, false};
    const double drop = below->distance - avatar.height;
    const double step = avatar.step * (1 + kStepMargin);
    if (-drop > step) return {eye, 0, true};
    if (drop < 0 && below->normal.y < kSteepest && isTooSteep(eye, motion, below->distance, step, cast))
        return {eye, 0, true};
    // One walks down a stair as up one; one who is already in the air falls.
    if (drop <= 0 || (drop <= step && fallSpeed == 0)) {
        constexpr double kTouches = 1e-6;  // of the height: what rays are good for
        if (std::abs(drop) > kTouches * std::max(1.0, avatar.height)) eye.y -= drop;
        return {eye, 0, false};
    }
    const double fall = fallSpeed * seconds + kGravity / 2 * seconds * seconds;
    if (fall >= drop) return {eye - kUp * drop, 0, false};
    return {eye - kUp * fall, fallSpeed + kGravity * seconds, false};
}

ViewerPose orbited(const ViewerPose& pose, const glm::dvec3& center, double across, double over) {
    const glm::dquat q = rotationAround(kUp, across) * rotationAround(pose.orientation * glm::dvec3(1, 0, 0), over);
    return {center + q * (pose.position - center), glm::normalize(q * pose.orientation)};
}

ViewerPose turned(const ViewerPose& pose, double left, double up) {
    constexpr double kMax = 89 * M_PI / 180;
    const double now = portable::asin(std::clamp((pose.orientation * glm::dvec3(0, 0, -1)).y, -1.0, 1.0));
    const double then = std::clamp(now + up, std::min(-kMax, now), std::max(kMax, now));
    const glm::dquat q = rotationAround(kUp, left) * pose.orientation * rotationAround(glm::dvec3(1, 0, 0), then - now);
    return {pose.position, glm::normalize(q)};
}

glm::dquat lookAlong(const glm::dvec3& direction, const ViewerPose& pose) {
    const glm::dvec3 back = -glm::normalize(direction);
    glm::dvec3 up = kUp;
    if (glm::length(glm::cross(up, back)) < 1e-6) up = pose.orientation * kUp;
    if (glm::length(glm::cross(up, back)) < 1e-6) up = pose.orientation * glm::dvec3(0, 0, 1);
    const glm::dvec3 right = glm::normalize(glm::cross(up, back));
    return glm::normalize(glm::quat_cast(glm::dmat3(right, glm::cross(back, right), back)));
}

}  // namespace rtsg
