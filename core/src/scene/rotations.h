// Rotations as fields hold them, of quaternions.
#pragma once

#include <cmath>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

/// The rotation of a unit quaternion; its angle is at most pi. The identity has +z as its axis.
inline Rotation toRotation(glm::dquat q) {
    if (q.w < 0) q = -q;
    const double s = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    if (!(s > 0)) return {0, 0, 1, 0};
    return {static_cast<float>(q.x / s), static_cast<float>(q.y / s), static_cast<float>(q.z / s),
            static_cast<float>(2 * std::atan2(s, q.w))};
}

}  // namespace rtsg
