// How an avatar moves among surfaces: a cylinder that walks (23.2.4: collisions, steps, gravity), or a ball that flies.
//
// Everything is in the coordinates around the viewpoint, with +Y up. Where the scene's triangles are known, the avatar
// is moved through them (avatar_sweep.h); else rays along the way find surfaces, which are an avatar's radius apart at
// most, so that thinner things may slip between them. Pure functions of their arguments. Source: ISO/IEC 19775-1
// V4.0 23.2.4, 23.4.4.
#pragma once

#include <functional>
#include <optional>
#include <span>

#include <rtsg/core/node_type.h>
#include <rtsg/core/viewer_pose.h>

namespace rtsg {

class Scene;

/// NavigationInfo::avatarSize, metres.
struct Avatar {
    double radius = .25, height = 1.6, step = .75;
};

/// The first surface that a ray meets. `normal`: a unit vector towards where the ray came from.
struct Met {
    double distance = 0;
    glm::dvec3 normal{0};
};
/// `direction` is a unit vector.
using CastRay = std::function<std::optional<Met>(const glm::dvec3& origin, const glm::dvec3& direction, double length)>;

/// The first contact of the avatar when its eye goes that way; `normal` points to the avatar.
using SweepAvatar =
    std::function<std::optional<Met>(const glm::dvec3& eye, const glm::dvec3& direction, double length)>;

constexpr double kSteepest = .5;  // of slopes that one walks up: the cosine of 60 degrees
/// Added to the height of a step, as a part of it, so that one of exactly that height is climbed.
constexpr double kStepMargin = 1e-3;

/// The position that an eye reaches when it moves by `motion`: it stops at `radius` before obstacles, and slides along
/// them. For a walking avatar, things lower than a step and slopes up to 60 degrees are ground, not obstacles.
glm::dvec3 slideBy(glm::dvec3 eye, glm::dvec3 motion, const Avatar& avatar, bool walks, const CastRay& cast);
glm::dvec3 slideBy(glm::dvec3 eye, glm::dvec3 motion, const SweepAvatar& sweep);

struct Stand {
    glm::dvec3 eye{0};
    double fallSpeed = 0;
    bool blocked = false;  // the ground is higher than a step
};
constexpr double kGravity = 9.80665;
/// The stand on the ground below, or on the way down to it after `seconds`; without ground one does not fall. `motion`
/// led there: it is blocked where the ground rose by more than a step, and more steeply than 60 degrees.
Stand standOrFall(glm::dvec3 eye, double fallSpeed, double seconds, const Avatar& avatar, const CastRay& cast,
                  const glm::dvec3& motion = glm::dvec3(0));

/// Round `center`: by `across` about +Y, and by `over` about the view's own axis to the right. Radians.
ViewerPose orbited(const ViewerPose& pose, const glm::dvec3& center, double across, double over);
/// About +Y by `left`, and upwards by `up`, to 89 degrees at most. Radians.
ViewerPose turned(const ViewerPose& pose, double left, double up);
/// Looks along `direction` (not zero), upright where that says which way is up; else as `pose` does.
glm::dquat lookAlong(const glm::dvec3& direction, const ViewerPose& pose);

}  // namespace rtsg
