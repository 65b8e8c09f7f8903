// Animated changes of the viewer's pose, and the moves that navigation and applications send.
#include "transitions.h"

#include <algorithm>
#include <cmath>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "behaviours.h"
#include "input/viewer_move.h"
#include "scene/view_pose.h"
#include "scene/world_transforms.h"

namespace rtsg::behaviours {

namespace {

/// ViewFields::transition.
struct Transition {
    double begin = 0, seconds = 0;
    bool eased = false;
    ViewerPose from, to;
    static constexpr std::size_t kNumbers = 3 + 7 + 7;

    Array<double> toValue() const {
        Array<double> value{begin, seconds, double(eased)};
        for (const ViewerPose& pose : {from, to}) {
            const glm::dquat q = zoomedRotation(pose);
            for (const double number : {pose.position.x, pose.position.y, pose.position.z, q.x, q.y, q.z, q.w})
                value.push_back(number);
        }
        return value;
    }
    /// Nothing if the value describes no transition.
    static std::optional<Transition> fromValue(const Array<double>& v) {
        if (v.size() != kNumbers || !std::ranges::all_of(v, [](double n) { return std::isfinite(n); }))
            return std::nullopt;
        const auto pose = [&](std::size_t i) {
            return zoomedPose({v[i], v[i + 1], v[i + 2]}, glm::dquat(v[i + 6], v[i + 3], v[i + 4], v[i + 5]));
        };
        const Transition t{v[0], v[1], v[2] != 0, pose(3), pose(10)};
        if (!(t.seconds > 0) || !isFinite(t.from) || !isFinite(t.to)) return std::nullopt;
        return t;
    }
    ViewerPose at(double time) const {
        double fraction = std::clamp((time - begin) / seconds, 0.0, 1.0);
        if (eased) fraction = fraction * fraction * (3 - 2 * fraction);
        return {glm::mix(from.position, to.position, fraction),
                glm::normalize(alongShorterArc(from.orientation, to.orientation, fraction)),
                glm::mix(from.zoom, to.zoom, fraction)};
    }
};

void storeOffset(Cascade& cascade, const Node& viewpoint, const ViewFields& fields, const ViewerPose& offset) {
    const glm::dquat q = zoomedRotation(offset);
    cascade.store(viewpoint, fields.userPosition, offset.position);
    cascade.store(viewpoint, fields.userRotation, Vec4d(q.x, q.y, q.z, q.w));
}
void endTransition(Cascade& cascade, const Node& viewpoint, const ViewFields& fields) {
    if (!viewpoint.get(fields.transition).empty()) cascade.store(viewpoint, fields.transition, Array<double>());
}

/// `center`: in the coordinates that the viewer's pose is in.
void setCenterOfRotation(Cascade& cascade, const Node& viewpoint, const ViewFields& fields, const Vec3d& center) {
    if (!std::isfinite(center.x + center.y + center.z)) return;
    if (fields.centerOfRotation.index != kNoField)
        return cascade.emit(viewpoint, fields.centerOfRotation, Vec3f(center));
    const auto reference = GeoReference::of(cascade.scene(), viewpoint);
    const auto transform = geoTransform(cascade.scene(), viewpoint);
    if (!reference || !transform) return;
    const Vec3d around(*transform * glm::dvec4(center, 1));
    cascade.emit(viewpoint, x3d::GeoViewpoint::centerOfRotation, reference->fromScene(around));
}

/// The one that is bound in the viewpoint's layer.
const Node* infoOf(const Scene& scene, const Node& viewpoint) {
    const Node* holder = layerOf(scene, viewpoint.id());
    if (!holder) return nullptr;
    const FieldIndex field = holder->type().findExact("_navigationStack");
    if (field == kNoField) return nullptr;
    const auto& stack = holder->get(Field<Array<NodeId>>{field});
    const Node* info = stack.empty() ? nullptr : scene.find(stack[0]);
    return info && info->is(x3d::NavigationInfo::type) ? info : nullptr;
}

void complete(Cascade& cascade, const Node& viewpoint, const ViewFields& fields, const ViewerPose& there) {
    endTransition(cascade, viewpoint, fields);
    storeOffset(cascade, viewpoint, fields, there);
    if (const Node* info = infoOf(cascade.scene(), viewpoint))
        cascade.emit(*info, x3d::NavigationInfo::transitionComplete, true);
}

/// 23.4.4: the first type that is known; without a NavigationInfo its defaults.
void begin(Cascade& cascade, const Node& viewpoint, const ViewFields& fields, const ViewerPose& from,
           const ViewerPose& to) {
    using N = x3d::NavigationInfo;
    Transition transition{cascade.now(), 1, false, from, to};
    if (const Node* info = infoOf(cascade.scene(), viewpoint)) {
        transition.seconds = info->get(N::transitionTime).seconds;
        for (const String& type : info->get(N::transitionType)) {
            if (type.view() == "TELEPORT") transition.seconds = 0;
            transition.eased = type.view() == "ANIMATE";
            if (transition.seconds == 0 || transition.eased || type.view() == "LINEAR") break;
        }
    }
    if (!(transition.seconds > 0) || !std::isfinite(transition.seconds) || from == to)
        return complete(cascade, viewpoint, fields, to);
    storeOffset(cascade, viewpoint, fields, from);
    cascade.store(viewpoint, fields.transition, transition.toValue());
    cascade.wake(viewpoint);
}

}  // namespace

std::optional<ViewerPose> worldView(const Scene& scene, NodeId id) {
    const Node* viewpoint = scene.find(id);
    const auto pose = viewpoint ? viewOf(*viewpoint) : std::nullopt;
    const auto world = pose ? worldAround(scene, id) : std::nullopt;
    if (!world) return std::nullopt;
    return transformed(*world, *pose);
}

void arriveAt(Cascade& cascade, const Node& viewpoint, const std::optional<ViewerPose>& from, ViewEntry entry,
              bool jump) {
    const auto fields = viewFields(viewpoint);
    if (!fields) return;
    endTransition(cascade, viewpoint, *fields);
    const ViewerPose to = entry == ViewEntry::asLeft ? userOffset(viewpoint, *fields) : ViewerPose{};
    const auto world = worldAround(cascade.scene(), viewpoint.id());
    if (!from || !world) return storeOffset(cascade, viewpoint, *fields, to);
    const ViewerPose around = transformed(glm::inverse(*world), *from);
    ViewerPose start = relative(authorsView(viewpoint, *fields), around);
    start.zoom = 1;  // the other viewpoint's says nothing about this one
    if (!isFinite(start)) return storeOffset(cascade, viewpoint, *fields, to);
    if (jump)
        begin(cascade, viewpoint, *fields, start, to);
    else
        storeOffset(cascade, viewpoint, *fields, start);
}

void stopTransition(Cascade& cascade, const Node& viewpoint) {
    const auto fields = viewFields(viewpoint);
    if (!fields || viewpoint.get(fields->transition).empty()) return;
    // Keeps the place at which the transition would have ended, not the place that it had reached.
    if (const auto transition = Transition::fromValue(viewpoint.get(fields->transition)))
        storeOffset(cascade, viewpoint, *fields, transition->to);
    endTransition(cascade, viewpoint, *fields);
}

double goOnWithTransition(Cascade& cascade, const Node& viewpoint) {
    const auto fields = viewFields(viewpoint);
    if (!fields || viewpoint.get(fields->transition).empty()) return kNever;
    const auto transition = Transition::fromValue(viewpoint.get(fields->transition));
    if (!transition) return endTransition(cascade, viewpoint, *fields), kNever;
    if (cascade.now() >= transition->begin + transition->seconds) {
        complete(cascade, viewpoint, *fields, transition->to);
        return kNever;
    }
    storeOffset(cascade, viewpoint, *fields, transition->at(cascade.now()));
    return cascade.now();
}

void viewerOnEvent(Cascade& cascade, const Node& root, EventValue value) {
    using R = x3d::RtsgScene;
    using Kind = ViewerMove::Kind;
    const auto move = ViewerMove::fromValue(value.as<Array<double>>());
    if (!move) return cascade.warn(root, move.error().text);
    if (move->state) cascade.store(root, R::_navigation, move->state->toValue());
    const Node* viewpoint = cascade.scene().find(move->viewpoint);
    const auto fields = viewpoint ? viewFields(*viewpoint) : std::nullopt;
    if (!fields || move->kind == Kind::stay) return;
    if (move->kind == Kind::jump) {
        endTransition(cascade, *viewpoint, *fields);
        return storeOffset(cascade, *viewpoint, *fields, move->offset);
    }
    if (move->kind == Kind::look) {
        setCenterOfRotation(cascade, *viewpoint, *fields, move->center);
    }
    begin(cascade, *viewpoint, *fields, userOffset(*viewpoint, *fields), move->offset);
}

}  // namespace rtsg::behaviours
