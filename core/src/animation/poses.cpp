// HAnimPose: ISO/IEC 19775-1 V4.1 (committee draft), clause 26. Moves the joints of the humanoids that it is in towards
// the joints that it holds, by name, or all of them back to their defaults.
//
// Where the draft leaves it open: of a joint its translation, rotation and scale are moved; a pose without joints is
// that of the defaults; set_fraction goes between where the joints stood when the first of its events came and the
// pose, until a fraction of 1 was reached or a transition has begun.
#include <algorithm>
#include <cmath>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/x3d.h>

#include <rtsg/core/rotation.h>
#include "behaviour/behaviours.h"
#include "humanoids.h"

namespace rtsg::behaviours {

namespace {

using PoseNode = x3d::HAnimPose;
using J = x3d::HAnimJoint;

/// The values of `_task`.
enum Task : std::int32_t { kNothing, kToThePose, kToTheDefaults };

struct Placed {
    glm::dvec3 translation{0};
    glm::dquat rotation{1, 0, 0, 0};
    glm::dvec3 scale{1};
};
constexpr std::size_t kNumbers = 10;  // of one in `_from`

Placed placedAs(const Node& joint) {
    return {glm::dvec3(joint.get(J::translation)), toQuaternion(joint.get(J::rotation)),
            glm::dvec3(joint.get(J::scale))};
}

/// The joints that are to move, and where to.
std::vector<std::pair<const Node*, Placed>> aims(const Scene& scene, const Node& pose, std::int32_t task) {
    std::vector<std::pair<std::string_view, Placed>> wanted;
    for (const NodeId id : pose.get(PoseNode::children).span())
        if (const Node* joint = scene.effectiveNode(id); joint && joint->is(J::type))
            wanted.emplace_back(joint->get(J::name).view(), placedAs(*joint));
    std::vector<std::pair<const Node*, Placed>> list;
    forEachHumanoidOf(scene, pose, x3d::HAnimHumanoid::children.index, [&](const Node& humanoid) {
        for (const NodeId id : humanoid.get(x3d::HAnimHumanoid::joints).span()) {
            const Node* joint = scene.effectiveNode(id);
            if (!joint || !joint->is(J::type)) continue;
            const auto found =
                std::ranges::find(wanted, joint->get(J::name).view(), &decltype(wanted)::value_type::first);
            if (task == kToTheDefaults || wanted.empty())
                list.emplace_back(joint, Placed{});
            else if (found != wanted.end())
                list.emplace_back(joint, found->second);
        }
    });
    return list;
}

void setOut(Cascade& cascade, const Node& pose, std::int32_t task) {
    std::vector<float> from;
    for (const auto& [joint, aim] : aims(cascade.scene(), pose, task)) {
        const Placed at = placedAs(*joint);
        for (const double x : {at.translation.x, at.translation.y, at.translation.z, at.rotation.w, at.rotation.x,
                               at.rotation.y, at.rotation.z, at.scale.x, at.scale.y, at.scale.z})
            from.push_back(static_cast<float>(x));
    }
    cascade.store(pose, PoseNode::_from, Array<float>(from));
}

/// `fraction` of the way, 0 to 1. Joints that have come or gone since it set out: from where they are now.
void showPose(Cascade& cascade, const Node& pose, std::int32_t task, double fraction) {
    const auto list = aims(cascade.scene(), pose, task);
    if (pose.get(PoseNode::_from).size() != list.size() * kNumbers) setOut(cascade, pose, task);
    const Array<float> from = pose.get(PoseNode::_from);
    for (std::size_t i = 0; i < list.size(); ++i) {
        const auto& [joint, aim] = list[i];
        const float* f = from.data() + i * kNumbers;
        const glm::dquat turned(f[3], f[4], f[5], f[6]);
        const auto between = [&](const float* a, const glm::dvec3& b) {
            return Vec3f(fraction < 1 ? glm::mix(glm::dvec3(a[0], a[1], a[2]), b, fraction) : b);
        };
        const glm::dquat rotation =
            fraction < 1 ? alongShorterArc(glm::normalize(turned), aim.rotation, fraction) : aim.rotation;
        setJoint(cascade, pose, *joint, J::translation, between(f, aim.translation));
        setJoint(cascade, pose, *joint, J::rotation, toRotation(rotation));
        setJoint(cascade, pose, *joint, J::scale, between(f + 7, aim.scale));
    }
}

void endPose(Cascade& cascade, const Node& pose) {
    cascade.store(pose, PoseNode::_task, std::int32_t{kNothing});
    if (!pose.get(PoseNode::_from).empty()) cascade.store(pose, PoseNode::_from, Array<float>());
    if (pose.get(PoseNode::isActive)) cascade.emit(pose, PoseNode::isActive, false);
}

void poseOnEvent(Cascade& cascade, const Node& pose, FieldIndex field, EventValue value) {
    if (!pose.get(PoseNode::enabled)) return;
    const auto plan = [&](Task task, double start) {
        cascade.store(pose, PoseNode::_task, std::int32_t{task});
        cascade.store(pose, PoseNode::_start, Time{start});
        if (!pose.get(PoseNode::_from).empty()) cascade.store(pose, PoseNode::_from, Array<float>());
    };
    if (field == PoseNode::commencePose.index && value.as<bool>()) plan(kToThePose, cascade.now());
    if (field == PoseNode::resetAllJoints.index && value.as<bool>()) plan(kToTheDefaults, cascade.now());
    if (field == PoseNode::set_startTime.index) plan(kToThePose, value.as<Time>().seconds);
    if (field != PoseNode::set_fraction.index || pose.get(PoseNode::isActive)) return;
    const double fraction = std::clamp(value.as<Time>().seconds, 0.0, 1.0);
    if (std::isnan(fraction)) return;
    showPose(cascade, pose, kToThePose, fraction);
    if (fraction == 1) cascade.store(pose, PoseNode::_from, Array<float>());
}

double poseOnTime(Cascade& cascade, const Node& pose) {
    const std::int32_t task = pose.get(PoseNode::_task);
    if (!pose.get(PoseNode::enabled)) {
        if (task != kNothing) endPose(cascade, pose);
        return kNever;
    }
    const double start = pose.get(PoseNode::_start).seconds, now = cascade.now();
    if (task == kNothing) return kNever;
    if (!(start <= now)) return start;
    const double duration = pose.get(PoseNode::transitionDuration).seconds;
    const double fraction = duration > 0 ? std::min((now - start) / duration, 1.0) : 1;
    // One that takes no time is still seen: it becomes active now and ends in the next frame.
    const bool begins = !pose.get(PoseNode::isActive);
    if (begins) cascade.emit(pose, PoseNode::isActive, true);
    if (pose.get(PoseNode::_from).empty()) setOut(cascade, pose, task);
    showPose(cascade, pose, task, fraction);
    if (fraction < 1 || begins) return now;
    endPose(cascade, pose);
    return kNever;
}

}  // namespace

void appendPoses(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::HAnimPose::type, {.onEvent = poseOnEvent, .onTime = poseOnTime}});
}

}  // namespace rtsg::behaviours
