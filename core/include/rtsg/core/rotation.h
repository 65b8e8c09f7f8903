// Converts rotations between fields, quaternions and matrices, with the same bits everywhere; glm would take sines from
// the C library.
//
// Angles are in radians, counterclockwise if the axis points at the observer. Threading: functions without state.
#pragma once

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

/// The quaternion of a turn. `axis` has length 1.
glm::dquat rotationAround(const glm::dvec3& axis, double angle);

/// The axis may have any length. If it is 0, or if a number is not finite, the result is the identity.
glm::dquat toQuaternion(const Rotation& r);

/// The rotation of a quaternion of any length; its angle is at most pi. The identity has +z as its axis.
Rotation toRotation(glm::dquat q);

/// The matrix of a turn. `axis` may have any length but 0.
glm::dmat3 rotationMatrixOf(const glm::dvec3& axis, double angle);

/// Interpolates along the shorter arc between two quaternions of length 1; `share` is from 0 to 1.
glm::dquat alongShorterArc(const glm::dquat& from, glm::dquat to, double fraction);

}  // namespace rtsg
