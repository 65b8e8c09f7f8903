// Environmental sensors: ISO/IEC 19775-1 V4.0, clause 22. They look at places once everything has come to rest, and
// only at those of theirs that have changed. One below a Switch or LOD that does not show it senses nothing; one that
// stands in several places (DEF/USE) senses in all of them.
#include <algorithm>
#include <cmath>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>
#include "behaviour/behaviours.h"
#include "input/box_overlap.h"
#include "scene/view_pose.h"
#include "scene/world_transforms.h"

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
/// How far a point is from a box; 0: in it.
double distanceTo(const glm::dvec3& center, const Vec3f& size, const glm::dvec3& point) {
    return glm::length(glm::max(glm::abs(point - center) - glm::dvec3(size) * .5, glm::dvec3(0)));
}
/// Calls `visit` with each place of a node, its matrix and a function that says whether it is shown, until that returns
/// true.
template <class F>
void forEachDirection(Cascade& cascade, const Node& node, const Node& asker, const F& visit) {
    if (visit(cascade.worldFromLocal(node, asker), [&] { return cascade.isShown(node, asker); })) return;
    for (const Standing& other : cascade.otherTransforms(node, asker))
        if (visit(other.worldFromLocal, [&] { return other.shown; })) return;
}
/// The edges of isActive, with their times.
template <class N>
void enterOrExit(Cascade& cascade, const Node& node, bool active) {
    if (node.get(N::isActive) == active) return;
    cascade.emit(node, N::isActive, active);
    cascade.emit(node, active ? N::enterTime : N::exitTime, Time{cascade.now()});
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

/// 22.4.1: the centre of rotation is sent while the bound NavigationInfo has LOOKAT among its types.
bool letsLookAt(const Scene& scene) {
    const Node* info = topOfStack(scene, "_navigationStack");
    if (!info || !info->is(x3d::NavigationInfo::type)) return true;  // the default's are EXAMINE and ANY
    return std::ranges::any_of(info->get(x3d::NavigationInfo::type_),
                               [](const String& type) { return type.view() == "LOOKAT" || type.view() == "ANY"; });
}

/// The viewer as a sensor sees it: in the coordinates of the place whose box holds the viewer, or else of the place
/// whose box is nearest.
struct Sight {
    glm::dmat4 local{1};
    glm::dvec3 position{0};
    double distance = INFINITY;
};
template <class N>
Sight sightOf(Cascade& cascade, const Node& node, const glm::dvec3& viewer, const GeoReference* reference) {
    const glm::dvec3 center = boxCenter(node, static_cast<const N*>(nullptr), reference);
    const bool wasInside = node.get(N::isActive);
    Sight nearest;
    forEachDirection(cascade, node, node, [&](const glm::dmat4& world, const auto& isShown) {
        if (!isFinite(world)) return false;
        Sight sight{glm::inverse(world)};
        sight.position = sight.local * glm::dvec4(viewer, 1);
        sight.distance = distanceTo(center, node.get(N::size), sight.position);
        // Whether the place is shown does not matter if the viewer is outside, and was outside before.
        const bool matters = sight.distance == 0 || wasInside;
        if (sight.distance < nearest.distance && (!matters || isShown())) nearest = sight;
        return nearest.distance == 0;
    });
    return nearest;
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
    const Sight sight = sightOf<N>(cascade, node, viewer.position, reference ? &*reference : nullptr);
    const bool inside = sight.distance == 0, was = node.get(N::isActive);
    enterOrExit<N>(cascade, node, inside);
    if (!inside && !was) return kUntilMoved;
    // A sensor that has left the hierarchy cannot tell where the viewer is: its outputs keep their values.
    const bool edge = inside != was, lost = !std::isfinite(sight.distance);
    const auto send = [&](auto field, const auto& value) {
        sendIfNew(cascade, node, field, lost ? node.get(field) : value, edge);
    };
    if constexpr (kIsGeo) send(N::geoCoord_changed, reference->fromScene(sight.position));
    send(N::position_changed, Vec3f(sight.position));
    send(N::orientation_changed, toRotation(rotationPart(sight.local) * viewer.orientation));
    if (!inside || !letsLookAt(cascade.scene())) return kUntilMoved;
    const glm::dvec3 center = sight.local * glm::dvec4(viewer.centerOfRotation, 1);
    sendIfNew(cascade, node, N::centerOfRotation_changed, Vec3f(center), edge);
    return kUntilMoved;
}

/// The half spaces that bound the view of the viewpoint, in its own coordinates: inside is where dot(plane, p) >= 0.
std::vector<glm::dvec4> viewVolume(const Scene& scene, const Viewer& viewer) {
    std::vector<glm::dvec4> planes{{0, 0, -1, 0}};  // before the eye
    const Node* view = viewer.viewpoint ? scene.find(viewer.viewpoint) : nullptr;
    if (view && view->is(x3d::OrthoViewpoint::type)) {
        const auto field = extentOf(*view);
        const double low = std::min(field[0], field[1]), high = std::max(field[2], field[3]);
        planes.insert(planes.end(), {{1, 0, 0, -low * kAspect}, {-1, 0, 0, high * kAspect}});
        planes.insert(planes.end(), {{0, 1, 0, -low}, {0, -1, 0, high}});
        return planes;
    }
    const double field = fieldOfViewOf(view);
    if (field < M_PI) {
        const double t = portable::tan(std::max(field, 1e-6) / 2), wide = t * kAspect;
        planes.insert(planes.end(), {{1, 0, -wide, 0}, {-1, 0, -wide, 0}, {0, 1, -t, 0}, {0, -1, -t, 0}});
    }
    return planes;
}

/// Whether something of a box, placed so, lies within the planes.
bool isSeen(const Node& node, const glm::dmat4& world, const Viewer& viewer, const std::vector<glm::dvec4>& planes) {
    using N = x3d::VisibilitySensor;
    const glm::dvec3 center(node.get(N::center)), half = glm::dvec3(node.get(N::size)) * .5;
    const glm::dquat toView = glm::conjugate(viewer.orientation);
    glm::dvec3 corners[8];
    for (int i = 0; i < 8; ++i) {
        const glm::dvec3 sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
        corners[i] = toView * (glm::dvec3(world * glm::dvec4(center + half * sign, 1)) - viewer.position);
    }
    return std::ranges::all_of(planes, [&](const glm::dvec4& plane) {
        return std::ranges::any_of(corners, [&](const glm::dvec3& c) { return glm::dot(plane, glm::dvec4(c, 1)) > 0; });
    });
}

/// 22.4.3: tests the box against the view's volume. Things in between do not count, though they may hide it.
double visibilityOnTime(Cascade& cascade, const Node& node) {
    using N = x3d::VisibilitySensor;
    const Vec3f size = node.get(N::size);
    if (!node.get(N::enabled) || !(size.x >= 0 && size.y >= 0 && size.z >= 0)) return rests<N>(cascade, node);
    const Viewer& viewer = cascade.viewer(node);
    const std::vector<glm::dvec4> planes = viewVolume(cascade.scene(), viewer);
    bool visible = false;
    forEachDirection(cascade, node, node, [&](const glm::dmat4& world, const auto& isShown) {
        visible = isShown() && isSeen(node, world, viewer, planes);
        return visible;
    });
    enterOrExit<N>(cascade, node, visible);
    return kUntilMoved;
}

/// How far a target is from the sensor's box, 0 if it is in it: its bounding box where its author gave one, else its
/// origin. `relative`: from the target's coordinates to the sensor's.
double distanceOfTarget(const Scene& scene, const Node& node, const Node& target, const glm::dmat4& relative) {
    using N = x3d::TransformSensor;
    const glm::dvec3 center(node.get(N::center));
    const auto find = [&](const char* name) {
        const FieldIndex i = target.type().findExact(name);
        return i != kNoField && target.type().fields[i].type == FieldType::SFVec3f ? i : kNoField;
    };
    const FieldIndex boxCenter = find("bboxCenter"), boxSize = find("bboxSize");
    const double ofOrigin = distanceTo(center, node.get(N::size), glm::dvec3(relative[3]));
    if (boxCenter == kNoField || boxSize == kNoField || !(target.get(Field<Vec3f>{boxSize}).x >= 0)) return ofOrigin;
    // A bounding box is in the coordinates of the parent.
    const glm::dmat4 outside = relative * glm::inverse(parentFromLocal(scene, target));
    const glm::dvec3 half = glm::dvec3(target.get(Field<Vec3f>{boxSize})) * .5;
    const glm::dvec3 at = outside * glm::dvec4(glm::dvec3(target.get(Field<Vec3f>{boxCenter})), 1);
    const glm::dvec3 edges[3] = {glm::dvec3(outside[0]) * half.x, glm::dvec3(outside[1]) * half.y,
                                 glm::dvec3(outside[2]) * half.z};
    if (boxesMeet(glm::dvec3(node.get(N::size)) * .5, at - center, edges)) return 0;
    return std::max(ofOrigin, std::numeric_limits<double>::min());
}

/// 22.4.2
double transformOnTime(Cascade& cascade, const Node& node) {
    using N = x3d::TransformSensor;
    const Scene& scene = cascade.scene();
    const Node* target = scene.find(node.get(N::targetObject));
    if (!node.get(N::enabled) || !isBox(node.get(N::size)) || !target) return rests<N>(cascade, node);
    // In which of its places the sensor has the target in its box, or nearest to it.
    double distance = INFINITY;
    glm::dmat4 found{1};
    forEachDirection(cascade, *target, node, [&](const glm::dmat4& there, const auto&) {
        forEachDirection(cascade, node, node, [&](const glm::dmat4& here, const auto& isShown) {
            if (!isShown() || !isFinite(here)) return false;
            const glm::dmat4 relative = glm::inverse(here) * there;
            const double away = distanceOfTarget(scene, node, *target, relative);
            if (away < distance) distance = away, found = relative;
            return distance == 0;
        });
        return distance == 0;
    });
    const bool inside = distance == 0, was = node.get(N::isActive);
    enterOrExit<N>(cascade, node, inside);
    if (!inside && !was) return kUntilMoved;
    const bool edge = inside != was, lost = !std::isfinite(distance);
    const Vec3f position = lost ? node.get(N::position_changed) : Vec3f(glm::dvec3(found[3]));
    const Rotation rotation = lost ? node.get(N::orientation_changed) : toRotation(rotationPart(found));
    sendIfNew(cascade, node, N::position_changed, position, edge);
    sendIfNew(cascade, node, N::orientation_changed, rotation, edge);
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
