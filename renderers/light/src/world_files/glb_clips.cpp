// Follows routes from clocks by interpolators to Transforms.
#include "glb_clips.h"

#include <cmath>
#include <limits>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>

namespace rtsg::mesh_files {

namespace {

std::string_view fieldName(const Scene& scene, NodeId node, FieldIndex field) {
    const Node* its = scene.find(node);
    return its ? std::string_view(its->type().fields[field].name) : std::string_view();
}

/// A node's keys, as seconds of a cycle. Two keys at one time are a step: of glTF's keys each is later than the one
/// before.
bool takeTimes(const Array<float>& keys, double cycle, std::vector<float>& times) {
    for (const float key : keys) {
        auto time = static_cast<float>(double{key} * cycle);
        if (!std::isfinite(time)) return false;
        if (!times.empty() && time <= times.back()) {
            if (time < times.back() - 1e-3f * static_cast<float>(cycle)) return false;
            time = std::nextafter(times.back(), std::numeric_limits<float>::infinity());
        }
        times.push_back(time);
    }
    return !times.empty();
}

void takeRotation(const Rotation& r, std::vector<float>& values) {
    const double length = std::sqrt(double{r.x} * double{r.x} + double{r.y} * double{r.y} + double{r.z} * double{r.z});
    const double half = double{r.angle} / 2, sine = length > 0 ? portable::sin(half) / length : 0;
    for (const float axis : {r.x, r.y, r.z}) values.push_back(static_cast<float>(double{axis} * sine));
    values.push_back(static_cast<float>(length > 0 ? portable::cos(half) : 1));
}

/// The channel of a route from an interpolator; false if glTF has none for it.
bool readChannel(const Scene& scene, const Node& from, double cycle, const Route& route, GlbChannel& to) {
    const Node* target = scene.find(route.toNode);
    if (!target || !target->is(x3d::Transform::type)) return false;
    to.transform = route.toNode;
    to.path = fieldName(scene, route.toNode, route.toField);
    if (from.is(x3d::PositionInterpolator::type) && (to.path == "translation" || to.path == "scale")) {
        using I = x3d::PositionInterpolator;
        if (from.get(I::key).size() != from.get(I::keyValue).size()) return false;
        for (const Vec3f& v : from.get(I::keyValue)) to.values.insert(to.values.end(), {v.x, v.y, v.z});
        return takeTimes(from.get(I::key), cycle, to.times);
    }
    if (from.is(x3d::OrientationInterpolator::type) && to.path == "rotation") {
        using I = x3d::OrientationInterpolator;
        if (from.get(I::key).size() != from.get(I::keyValue).size()) return false;
        for (const Rotation& r : from.get(I::keyValue)) takeRotation(r, to.values);
        return takeTimes(from.get(I::key), cycle, to.times);
    }
    return false;
}

}  // namespace

std::vector<GlbClip> findClips(const Scene& scene, std::size_t& leftOut) {
    std::vector<GlbClip> clips;
    scene.forEachNode([&](const Node& clock) {
        if (!clock.is(x3d::TimeSensor::type)) return;
        GlbClip clip{std::string(clock.get(x3d::TimeSensor::description).view()), {}};
        if (clip.name.empty()) clip.name = scene.name(clock.id());
        const double cycle = clock.get(x3d::TimeSensor::cycleInterval).seconds;
        for (const Route& route : scene.routesFrom(clock.id())) {
            const Node* interpolator = scene.find(route.toNode);
            if (!interpolator || fieldName(scene, route.toNode, route.toField) != "set_fraction") continue;
            for (const Route& onward : scene.routesFrom(route.toNode)) {
                GlbChannel channel;
                if (readChannel(scene, *interpolator, cycle, onward, channel))
                    clip.channels.push_back(std::move(channel));
                else
                    ++leftOut;
            }
        }
        if (!clip.channels.empty()) clips.push_back(std::move(clip));
    });
    return clips;
}

}  // namespace rtsg::mesh_files
