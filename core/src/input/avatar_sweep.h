// Moves an avatar through triangles until it first touches one: a cylinder that walks, or a ball that flies.
//
// Everything is in the coordinates around the viewpoint, with +Y up. The distance between a point and a convex set is a
// convex function along a line, so Newton's method from the start finds the first contact and never passes it. Pure
// functions of their arguments. Source: ISO/IEC 19775-1 V4.0 23.4.4 (avatarSize).
#pragma once

#include <array>
#include <optional>

#include "avatar.h"

namespace rtsg {

/// Part of a way.
struct AvatarPath {
    glm::dvec3 eye{0}, direction{0};  // a unit vector, which is horizontal for who walks
    double length = 0;
    bool walks = false;
};

/// The ball that holds all that the avatar may touch on its way.
struct SweptBall {
    glm::dvec3 center{0};
    double radius = 0;
};
SweptBall ballAround(const AvatarPath& path, const Avatar& avatar);

/// How far it goes until it touches the triangle, and the direction from there to the avatar, which is horizontal for
/// who walks. Nothing: it does not touch it, comes no nearer, or the triangle is ground for who walks.
std::optional<Met> sweepAvatar(const AvatarPath& path, const Avatar& avatar, const std::array<glm::dvec3, 3>& triangle);

}  // namespace rtsg
