// Rotations as fields hold them, quaternions and matrices, with the same bits everywhere; those of glm take sines from
// the C library.
//
// Angles are in radians, counterclockwise where the axis points at who looks. Threading: functions without state.
#pragma once

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

/// The quaternion of a turn. `axis` has length 1.
glm::dquat turnAbout(const glm::dvec3& axis, double angle);

/// Its axis may have any length; without one, and with what is not finite, it turns nothing.
glm::dquat toQuaternion(const Rotation& r);

/// The rotation of a quaternion of any length; its angle is at most pi. The identity has +z as its axis.
Rotation toRotation(glm::dquat q);

/// The matrix of a turn. `axis` may have any length but 0.
glm::dmat3 turnMatrix(const glm::dvec3& axis, double angle);

/// Along the shorter arc between two quaternions of length 1, at a share from 0 to 1.
glm::dquat alongShorterArc(const glm::dquat& from, glm::dquat to, double share);

}  // namespace rtsg
