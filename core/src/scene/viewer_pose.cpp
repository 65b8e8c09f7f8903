// Poses of viewpoints: by their authors, after the user's motion, and in the world.
#include <rtsg/core/viewer_pose.h>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>

#include <rtsg/core/rotation.h>
#include "view_pose.h"

namespace rtsg {

ViewerPose authorsView(const Node& viewpoint, const ViewFields& fields) {
    const Rotation r = viewpoint.get(fields.orientation);
    const glm::dvec3 axis(r.x, r.y, r.z);
    // A GeoViewpoint is where its coordinates are: see geoTransform().
    ViewerPose pose;
    if (fields.position.index != kNoField) pose.position = Vec3d(viewpoint.get(fields.position));
    if (glm::length(axis) > 0) pose.orientation = rotationAround(glm::normalize(axis), double(r.angle));
    return pose;
}

glm::dvec3 centerOfRotation(const Scene& scene, const Node& viewpoint, const ViewFields& fields) {
    if (fields.centerOfRotation.index != kNoField) return glm::dvec3(viewpoint.get(fields.centerOfRotation));
    const auto reference = GeoReference::of(scene, viewpoint);
    const auto transform = reference ? geoTransform(scene, viewpoint) : std::unexpected(reference.error());
    if (!transform) return glm::dvec3(0);
    const Vec3d center = reference->toScene(viewpoint.get(x3d::GeoViewpoint::centerOfRotation));
    return glm::transpose(glm::dmat3(*transform)) * (center - glm::dvec3((*transform)[3]));
}

double fieldOfViewOf(const Node* viewpoint) {
    if (viewpoint && viewpoint->is(x3d::Viewpoint::type)) return viewpoint->get(x3d::Viewpoint::fieldOfView);
    if (viewpoint && viewpoint->is(x3d::GeoViewpoint::type)) return viewpoint->get(x3d::GeoViewpoint::fieldOfView);
    return M_PI / 4;
}

ViewerPose userOffset(const Node& viewpoint, const ViewFields& fields) {
    const Vec4d& q = viewpoint.get(fields.userRotation);
    ViewerPose offset = zoomedPose(viewpoint.get(fields.userPosition), glm::dquat(q.w, q.x, q.y, q.z));
    if (!viewpoint.is(x3d::OrthoViewpoint::type)) offset.zoom = 1;
    return isFinite(offset) ? offset : ViewerPose{};
}

std::optional<glm::dmat4> worldAround(const Scene& scene, NodeId node) {
    WorldTransforms worldTransforms(scene);
    const glm::dmat4 world = worldTransforms.worldFromLocal(node, scene.root());
    const double volume = glm::determinant(world);
    return volume != 0 && std::isfinite(volume) ? std::optional(world) : std::nullopt;
}

std::optional<ViewerPose> viewOf(const Node& viewpoint) {
    const auto fields = viewFields(viewpoint);
    if (!fields) return std::nullopt;
    const auto moved = movedView(viewpoint);
    return moved ? moved : authorsView(viewpoint, *fields);
}

std::optional<ViewerPose> movedView(const Node& viewpoint) {
    const auto fields = viewFields(viewpoint);
    if (!fields || !viewpoint.get(fields->isBound)) return std::nullopt;
    const ViewerPose offset = userOffset(viewpoint, *fields);
    if (offset == ViewerPose{}) return std::nullopt;
    return composed(authorsView(viewpoint, *fields), offset);
}

std::array<double, 4> extentOf(const Node& orthoViewpoint) {
    std::array<double, 4> extent{-1, -1, 1, 1};
    if (!orthoViewpoint.is(x3d::OrthoViewpoint::type)) return extent;
    const auto& field = orthoViewpoint.get(x3d::OrthoViewpoint::fieldOfView);
    for (std::size_t i = 0; i < 4 && field.size() >= 4; ++i) extent[i] = double{field[i]};
    const auto moved = movedView(orthoViewpoint);
    if (!moved || moved->zoom == 1) return extent;
    for (std::size_t i = 0; i < 2; ++i) {
        const double middle = (extent[i] + extent[i + 2]) / 2, half = (extent[i + 2] - extent[i]) / 2 / moved->zoom;
        extent[i] = middle - half, extent[i + 2] = middle + half;
    }
    return extent;
}

Rotation orientationOf(const ViewerPose& pose) {
    return toRotation(pose.orientation);
}

}  // namespace rtsg
