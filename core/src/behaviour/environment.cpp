// Environmental sensors: ISO/IEC 19775-1 V4.0, clause 22. They look at places once everything has come to rest, and
// only at those of theirs that have changed. One below a Switch or LOD that does not show it senses nothing.
#include <algorithm>
#include <cmath>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>

#include "behaviours.h"
#include "scene/box_overlap.h"
#include "scene/places.h"
#include "scene/rotations.h"
#include "scene/view_pose.h"

namespace rtsg::behaviours {

namespace {

/// A width against a height of one, as nothing here knows the window: wide, so that nothing that is seen is missed.
constexpr double kAspect = 16.0 / 9;

bool isFinite(const glm::dmat4& matrix) {
    const double volume = glm::determinant(matrix);
    return volume != 0 && std::isfinite(volume);
}
bool isBox(const Vec3f& size) {
    return size.x > 0 && size.y > 0 && size.z > 0;
}
bool isInBox(const glm::dvec3& point, const glm::dvec3& center, const Vec3f& size) {
    const glm::dvec3 from = glm::abs(point - center), half = glm::dvec3(size) * .5;
    return from.x <= half.x && from.y <= half.y && from.z <= half.z;
}
template <class T>
void sendIfNew(Cascade& cascade, const Node& node, Field<T> field, const T& value, bool always) {
    if (always || node.get(field) != value) cascade.emit(node, field, value);
}
/// The edges of isActive, with their times. Returns whether it has just begun.
template <class N>
bool enterOrExit(Cascade& cascade, const Node& node, bool active) {
    if (node.get(N::isActive) == active) return false;
    cascade.emit(node, N::isActive, active);
    cascade.emit(node, active ? N::enterTime : N::exitTime, Time{cascade.now()});
    return active;
}
template <class N>
double rests(Cascade& cascade, const Node& node) {
    enterOrExit<N>(cascade, node, false);
    return kNever;
}

glm::dvec3 boxCenter(const Node& node, const x3d::ProximitySensor*, const GeoReference*) {
    return glm::dvec3(node.get(x3d::ProximitySensor::center));
}
/// The box lies along the axes around the sensor: about its geographic centre, and from there by `center`.
glm::dvec3 boxCenter(const Node& node, const x3d::GeoProximitySensor*, const GeoReference* reference) {
    using N = x3d::GeoProximitySensor;
    return reference->toScene(node.get(N::geoCenter)) + node.get(N::center);
}

/// 22.4.1, 25.3.8
template <class N>
double proximityOnTime(Cascade& cascade, const Node& node) {
    constexpr bool kIsGeo = std::is_same_v<N, x3d::GeoProximitySensor>;
    std::optional<GeoReference> reference;
    if constexpr (kIsGeo) {
        auto read = GeoReference::of(cascade.scene(), node);
        if (!read) return cascade.warn(node, read.error().text), rests<N>(cascade, node);
        reference = *read;
    }
    if (!node.get(N::enabled) || !isBox(node.get(N::size))) return rests<N>(cascade, node);
    const Viewer& viewer = cascade.viewer(node);
    const glm::dmat4& world = cascade.worldFromLocal(node, node);
    if (!isFinite(world)) return enterOrExit<N>(cascade, node, false), kUntilMoved;
    const glm::dmat4 local = glm::inverse(world);
    const glm::dvec3 position = local * glm::dvec4(viewer.position, 1);
    const bool inside =
        cascade.isShown(node, node) &&
        isInBox(position, boxCenter(node, static_cast<const N*>(nullptr), reference ? &*reference : nullptr),
                node.get(N::size));
    const bool entered = enterOrExit<N>(cascade, node, inside);
    if (!inside) return kUntilMoved;
    if constexpr (kIsGeo) sendIfNew(cascade, node, N::geoCoord_changed, reference->fromScene(position), entered);
    const glm::dvec3 center = local * glm::dvec4(viewer.centerOfRotation, 1);
    sendIfNew(cascade, node, N::position_changed, Vec3f(position), entered);
    sendIfNew(cascade, node, N::orientation_changed, toRotation(turnOf(local) * viewer.orientation), entered);
    sendIfNew(cascade, node, N::centerOfRotation_changed, Vec3f(center), entered);
    return kUntilMoved;
}

/// The half spaces that bound what the viewpoint shows, in its own coordinates: inside is where dot(plane, p) >= 0.
std::vector<glm::dvec4> viewVolume(const Scene& scene, const Viewer& viewer) {
    std::vector<glm::dvec4> planes{{0, 0, -1, 0}};  // before the eye
    const Node* view = viewer.viewpoint ? scene.find(viewer.viewpoint) : nullptr;
    if (view && view->is(x3d::OrthoViewpoint::type)) {
        const auto& field = view->get(x3d::OrthoViewpoint::fieldOfView);
        const double low = field.size() == 4 ? std::min<double>(field[0], field[1]) : -1;
        const double high = field.size() == 4 ? std::max<double>(field[2], field[3]) : 1;
        planes.insert(planes.end(), {{1, 0, 0, -low * kAspect}, {-1, 0, 0, high * kAspect}});
        planes.insert(planes.end(), {{0, 1, 0, -low}, {0, -1, 0, high}});
        return planes;
    }
    const double field = fieldOfViewOf(view);
    if (field < M_PI) {
        const double t = std::tan(std::max(field, 1e-6) / 2), wide = t * kAspect;
        planes.insert(planes.end(), {{1, 0, -wide, 0}, {-1, 0, -wide, 0}, {0, 1, -t, 0}, {0, -1, -t, 0}});
    }
    return planes;
}

/// 22.4.3: the box against the view's volume; what is in between may hide it from the eye, but not from here.
double visibilityOnTime(Cascade& cascade, const Node& node) {
    using N = x3d::VisibilitySensor;
    const Vec3f size = node.get(N::size);
    if (!node.get(N::enabled) || !(size.x >= 0 && size.y >= 0 && size.z >= 0)) return rests<N>(cascade, node);
    const Viewer& viewer = cascade.viewer(node);
    const glm::dmat4& world = cascade.worldFromLocal(node, node);
    const glm::dvec3 center(node.get(N::center)), half = glm::dvec3(size) * .5;
    const glm::dquat toView = glm::conjugate(viewer.orientation);
    glm::dvec3 corners[8];
    for (int i = 0; i < 8; ++i) {
        const glm::dvec3 sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
        corners[i] = toView * (glm::dvec3(world * glm::dvec4(center + half * sign, 1)) - viewer.position);
    }
    bool visible = cascade.isShown(node, node);
    for (const glm::dvec4& plane : viewVolume(cascade.scene(), viewer))
        visible = visible && std::ranges::any_of(
                                 corners, [&](const glm::dvec3& c) { return glm::dot(plane, glm::dvec4(c, 1)) > 0; });
    enterOrExit<N>(cascade, node, visible);
    return kUntilMoved;
}

/// 22.4.2: the target's bounding box where its author gave one, else its origin.
double transformOnTime(Cascade& cascade, const Node& node) {
    using N = x3d::TransformSensor;
    const Scene& scene = cascade.scene();
    const Node* target = scene.find(node.get(N::targetObject));
    if (!node.get(N::enabled) || !isBox(node.get(N::size)) || !target) return rests<N>(cascade, node);
    // The first reference ends with the second call, which may move what it refers to.
    const glm::dmat4 world = cascade.worldFromLocal(node, node);
    if (!isFinite(world)) return enterOrExit<N>(cascade, node, false), kUntilMoved;
    const glm::dmat4 relative = glm::inverse(world) * cascade.worldFromLocal(*target, node);
    const glm::dvec3 position(relative[3]);
    bool inside = isInBox(position, glm::dvec3(node.get(N::center)), node.get(N::size));
    const auto find = [&](const char* name) {
        const FieldIndex i = target->type().findExact(name);
        return i != kNoField && target->type().fields[i].type == FieldType::SFVec3f ? i : kNoField;
    };
    const FieldIndex boxCenter = find("bboxCenter"), boxSize = find("bboxSize");
    if (boxCenter != kNoField && boxSize != kNoField && target->get(Field<Vec3f>{boxSize}).x >= 0) {
        // A bounding box is in the coordinates of the parent.
        const glm::dmat4 outside = relative * glm::inverse(parentFromLocal(scene, *target));
        const glm::dvec3 half = glm::dvec3(target->get(Field<Vec3f>{boxSize})) * .5;
        const glm::dvec3 at = outside * glm::dvec4(glm::dvec3(target->get(Field<Vec3f>{boxCenter})), 1);
        const glm::dvec3 edges[3] = {glm::dvec3(outside[0]) * half.x, glm::dvec3(outside[1]) * half.y,
                                     glm::dvec3(outside[2]) * half.z};
        inside = boxesMeet(glm::dvec3(node.get(N::size)) * .5, at - glm::dvec3(node.get(N::center)), edges);
    }
    const bool entered = enterOrExit<N>(cascade, node, inside);
    if (!inside) return kUntilMoved;
    sendIfNew(cascade, node, N::position_changed, Vec3f(position), entered);
    sendIfNew(cascade, node, N::orientation_changed, toRotation(turnOf(relative)), entered);
    return kUntilMoved;
}

}  // namespace

void appendEnvironmentalSensors(std::vector<BuiltinBehaviour>& table) {
    const auto add = [&](TypeIndex type, auto onTime) { table.push_back({type, {.onTime = onTime, .last = true}}); };
    add(x3d::ProximitySensor::type, proximityOnTime<x3d::ProximitySensor>);
    add(x3d::GeoProximitySensor::type, proximityOnTime<x3d::GeoProximitySensor>);
    add(x3d::VisibilitySensor::type, visibilityOnTime);
    add(x3d::TransformSensor::type, transformOnTime);
}

}  // namespace rtsg::behaviours
