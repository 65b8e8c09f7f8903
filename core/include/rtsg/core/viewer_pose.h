// ViewerPose: where a viewer is, and where it looks; those of viewpoints.
//
// Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 23.2.
#pragma once

#include <optional>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

class Node;

/// From where, and which way: along -Z of `orientation`, a unit quaternion, with +Y up.
struct ViewerPose {
    Vec3d position{0};
    glm::dquat orientation{1, 0, 0, 0};
    friend bool operator==(const ViewerPose&, const ViewerPose&) = default;
};

/// The pose of a Viewpoint or OrthoViewpoint in the coordinates around the node: its fields, and while it is bound also
/// where the user has gone from there. Other nodes have none.
std::optional<ViewerPose> viewOf(const Node& viewpoint);
/// The same where the user has gone anywhere; else nothing.
std::optional<ViewerPose> movedView(const Node& viewpoint);
/// The orientation as a Viewpoint's field has it; the angle is at most pi.
Rotation orientationOf(const ViewerPose& pose);

}  // namespace rtsg
