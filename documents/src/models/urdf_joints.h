// The joints of a robot as prototypes: a field for its angle or position, which interpolators turn into a pose.
//
// A prototype of interpolators is X3D that every browser plays. Its field `pose` follows them, so that a saved joint is
// loaded where it was: no browser sends the value of `angle` on loading. The interpolators keep to their first and last
// keys, which is how a joint keeps to its limits; between keys a rotation about one axis goes evenly with the angle.
// Threading: pure functions. Source: ISO/IEC 19775-1 V4.0 4.4.4 (prototypes), 19.4.6 and 19.4.7 (interpolators).
#pragma once

#include <array>
#include <string_view>

#include <rtsg/core/value.h>
#include <rtsg/documents/document_handler.h>

#include "urdf_model.h"

namespace rtsg::detail {

/// The field of a joint's value: "angle" or "position".
std::string_view valueField(UrdfJoint::Kind kind);

/// Declares the prototype of a kind of joint that has a value: RevoluteJoint, ContinuousJoint or PrismaticJoint.
void declareJoint(DocumentHandler& out, UrdfJoint::Kind kind);
/// Begins an instance of it in field `children`, which nodes of the joint's child link may follow in.
void beginJoint(DocumentHandler& out, const UrdfJoint& joint, std::string_view def);
/// A ScalarInterpolator from the value of the joint that is mimicked to that of the one that mimics.
void writeMimic(DocumentHandler& out, const UrdfJoint& leader, const UrdfJoint::Mimic& mimic, std::string_view def);

/// Turns about the fixed axes x, y and z, in that order: x y z w, and as a rotation.
std::array<double, 4> quaternionOf(const std::array<double, 3>& rpy);
Rotation rotationOfAngles(const std::array<double, 3>& rpy);
/// translation and rotation of a Transform, where they are not the defaults.
void writePose(DocumentHandler& out, const UrdfPose& pose);
bool isIdentity(const UrdfPose& pose);

}  // namespace rtsg::detail
