// Poses of viewers, and how they hang together: the author's, the user's offset from it, the world's.
#pragma once

#include <cmath>
#include <optional>

#include <rtsg/core/scene.h>
#include <rtsg/core/viewer_pose.h>
#include <rtsg/core/x3d.h>

#include "world_transforms.h"

namespace rtsg {

/// X3DViewpointNode's hidden fields, of the types that can be bound.
struct ViewFields {
    Field<Vec3f> position{kNoField}, centerOfRotation{kNoField};  // not a GeoViewpoint's, whose are geographic
    Field<Rotation> orientation;
    Field<Vec3d> userPosition;
    Field<Vec4d> userRotation;
    Field<Array<double>> transition;
    Field<bool> isBound;
};
inline std::optional<ViewFields> viewFields(const Node& node) {
    const auto of = []<class V>(const V*) {
        ViewFields fields{.orientation = V::orientation,
                          .userPosition = V::_userPosition,
                          .userRotation = V::_userTurn,
                          .transition = V::_transition,
                          .isBound = V::isBound};
        if constexpr (!std::is_same_v<V, x3d::GeoViewpoint>)
            fields.position = V::position, fields.centerOfRotation = V::centerOfRotation;
        return fields;
    };
    if (node.is(x3d::Viewpoint::type)) return of(static_cast<const x3d::Viewpoint*>(nullptr));
    if (node.is(x3d::OrthoViewpoint::type)) return of(static_cast<const x3d::OrthoViewpoint*>(nullptr));
    if (node.is(x3d::GeoViewpoint::type)) return of(static_cast<const x3d::GeoViewpoint*>(nullptr));
    return std::nullopt;
}

inline bool isFinite(const ViewerPose& pose) {
    const glm::dquat& q = pose.orientation;
    return std::isfinite(pose.position.x + pose.position.y + pose.position.z) && std::isfinite(q.x + q.y + q.z + q.w) &&
           glm::length(q) > 0 && std::isfinite(pose.zoom) && pose.zoom > 0;
}
/// The orientation as hidden fields keep it: a quaternion as long as the zoom.
inline glm::dquat zoomedRotation(const ViewerPose& pose) {
    return pose.zoom == 1 ? pose.orientation : pose.orientation * pose.zoom;
}
/// The other way round.
inline ViewerPose zoomedPose(const Vec3d& position, const glm::dquat& zoomed) {
    constexpr double kRounding = 1e-9;  // of a rotation without zoom
    const double zoom = glm::length(zoomed);
    if (!(zoom > 0) || std::abs(zoom - 1) < kRounding) return {position, zoomed};
    return {position, zoomed / zoom, zoom};
}
/// `inner` is in `outer`'s own frame.
inline ViewerPose composed(const ViewerPose& outer, const ViewerPose& inner) {
    return {outer.position + outer.orientation * inner.position, glm::normalize(outer.orientation * inner.orientation),
            outer.zoom * inner.zoom};
}
/// The other way round: `pose` as seen from `outer`.
inline ViewerPose relative(const ViewerPose& outer, const ViewerPose& pose) {
    const glm::dquat back = glm::conjugate(outer.orientation);
    return {back * (pose.position - outer.position), glm::normalize(back * pose.orientation), pose.zoom / outer.zoom};
}
inline ViewerPose transformed(const glm::dmat4& matrix, const ViewerPose& pose) {
    return {matrix * glm::dvec4(pose.position, 1), glm::normalize(rotationPart(matrix) * pose.orientation), pose.zoom};
}

/// The pose that the viewpoint's fields describe, without the user's way from there.
ViewerPose authorsView(const Node& viewpoint, const ViewFields& fields);
/// In the coordinates that the pose is in.
glm::dvec3 centerOfRotation(const Scene& scene, const Node& viewpoint, const ViewFields& fields);
/// The field of view of the picture's smaller side, in radians; for nodes that have none, a Viewpoint's default.
double fieldOfViewOf(const Node* viewpoint);
/// The way of the user from the author's pose. The stored numbers may be anything; bad ones count as no way at all.
ViewerPose userOffset(const Node& viewpoint, const ViewFields& fields);
/// From the coordinates around a node to the world's; nothing if there is no way back.
std::optional<glm::dmat4> worldAround(const Scene& scene, NodeId node);

}  // namespace rtsg
