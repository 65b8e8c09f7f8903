// ViewerPose: the position and orientation of a viewer or a viewpoint.
//
// Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 23.2.
#pragma once

#include <array>
#include <optional>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

class Node;

/// The viewer looks along -Z of `orientation`, a unit quaternion, with +Y up.
struct ViewerPose {
    Vec3d position{0};
    glm::dquat orientation{1, 0, 0, 0};
    double zoom = 1;  // of an OrthoViewpoint: things look so many times as large as its author's fieldOfView shows them
    friend bool operator==(const ViewerPose&, const ViewerPose&) = default;
};

/// The pose of a Viewpoint or OrthoViewpoint in the coordinates around the node. If it is bound, this includes the
/// user's motion away from its fields. Nothing for other nodes.
std::optional<ViewerPose> viewOf(const Node& viewpoint);
/// The same if the user has moved away from the viewpoint's fields; else nothing.
std::optional<ViewerPose> movedView(const Node& viewpoint);
/// Minimum x, minimum y, maximum x and maximum y of what an OrthoViewpoint shows, with the user's zoom about the
/// middle.
std::array<double, 4> extentOf(const Node& orthoViewpoint);
/// The orientation as a value for a viewpoint's field; the angle is at most pi.
Rotation orientationOf(const ViewerPose& pose);

}  // namespace rtsg
