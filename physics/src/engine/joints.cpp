// The joints of clause 37 as ODE's: their anchors, their limits, and their outputs.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "engine.h"

namespace rtsg {

using namespace physics;

namespace {

glm::dvec3 vectorOf(const dVector3& v) {
    return {v[0], v[1], v[2]};
}

bool isUsable(const Vec3f& v) {
    return std::abs(v.x) < 1e9f && std::abs(v.y) < 1e9f && std::abs(v.z) < 1e9f;
}
bool isAxis(const Vec3f& v) {
    return isUsable(v) && glm::length(glm::dvec3(v)) > 1e-9;
}

dReal limited(double value, double low, double high) {
    return value >= low ? std::min(value, high) : low;  // NaN: low
}

/// The world's point and axes from which a joint is made, and which cannot change in motion.
std::vector<Vec3f> frameOf(const Node& node) {
    using namespace x3d;
    if (node.is(BallJoint::type)) return {node.get(BallJoint::anchorPoint)};
    if (node.is(SingleAxisHingeJoint::type))
        return {node.get(SingleAxisHingeJoint::anchorPoint), node.get(SingleAxisHingeJoint::axis)};
    if (node.is(SliderJoint::type)) return {Vec3f(0), node.get(SliderJoint::axis)};
    if (node.is(UniversalJoint::type))
        return {node.get(UniversalJoint::anchorPoint), node.get(UniversalJoint::axis1),
                node.get(UniversalJoint::axis2)};
    if (node.is(DoubleAxisHingeJoint::type))
        return {node.get(DoubleAxisHingeJoint::anchorPoint), node.get(DoubleAxisHingeJoint::axis1),
                node.get(DoubleAxisHingeJoint::axis2)};
    if (node.is(MotorJoint::type))
        return {Vec3f(0), node.get(MotorJoint::motor1Axis), node.get(MotorJoint::motor2Axis),
                node.get(MotorJoint::motor3Axis),
                Vec3f(node.get(MotorJoint::enabledAxes), node.get(MotorJoint::autoCalc) ? 1 : 0, 0)};
    return {};
}

/// Empty: it can be made.
std::string problemOf(const Node& node, const std::vector<Vec3f>& frame) {
    if (frame.empty()) return "is no joint of this component: it holds nothing";
    if (!std::ranges::all_of(frame, isUsable)) return "has an anchor or axis that is no number: it holds nothing";
    const std::size_t axes = node.is(x3d::MotorJoint::type) ? 4 : frame.size();
    for (std::size_t i = 1; i < axes; ++i)
        if (!isAxis(frame[i])) return "has an axis without a direction: it holds nothing";
    const bool two = node.is(x3d::UniversalJoint::type) || node.is(x3d::DoubleAxisHingeJoint::type);
    if (two &&
        glm::length(glm::cross(glm::normalize(glm::dvec3(frame[1])), glm::normalize(glm::dvec3(frame[2])))) < 1e-3)
        return "has two axes that are one: it holds nothing";
    return {};
}

dJointID create(dWorldID world, const Node& node) {
    using namespace x3d;
    if (node.is(BallJoint::type)) return dJointCreateBall(world, nullptr);
    if (node.is(SingleAxisHingeJoint::type)) return dJointCreateHinge(world, nullptr);
    if (node.is(SliderJoint::type)) return dJointCreateSlider(world, nullptr);
    if (node.is(UniversalJoint::type)) return dJointCreateUniversal(world, nullptr);
    if (node.is(DoubleAxisHingeJoint::type)) return dJointCreateHinge2(world, nullptr);
    return dJointCreateAMotor(world, nullptr);
}

void setFrame(dJointID joint, const Node& node, const std::vector<Vec3f>& f) {
    using namespace x3d;
    if (node.is(BallJoint::type)) {
        dJointSetBallAnchor(joint, f[0].x, f[0].y, f[0].z);
    } else if (node.is(SingleAxisHingeJoint::type)) {
        dJointSetHingeAnchor(joint, f[0].x, f[0].y, f[0].z);
        dJointSetHingeAxis(joint, f[1].x, f[1].y, f[1].z);
    } else if (node.is(SliderJoint::type)) {
        dJointSetSliderAxis(joint, f[1].x, f[1].y, f[1].z);
    } else if (node.is(UniversalJoint::type)) {
        dJointSetUniversalAnchor(joint, f[0].x, f[0].y, f[0].z);
        dJointSetUniversalAxis1(joint, f[1].x, f[1].y, f[1].z);
        dJointSetUniversalAxis2(joint, f[2].x, f[2].y, f[2].z);
    } else if (node.is(DoubleAxisHingeJoint::type)) {
        dJointSetHinge2Anchor(joint, f[0].x, f[0].y, f[0].z);
        const dVector3 first{f[1].x, f[1].y, f[1].z}, second{f[2].x, f[2].y, f[2].z};
        dJointSetHinge2Axes(joint, first, second);
    } else {
        dJointSetAMotorMode(joint, node.get(MotorJoint::autoCalc) ? dAMotorEuler : dAMotorUser);
        const int count = std::clamp(node.get(MotorJoint::enabledAxes), 0, 3);
        // Euler's angles need all three axes: the second follows from the others.
        if (node.get(MotorJoint::autoCalc)) {
            dJointSetAMotorAxis(joint, 0, 1, f[1].x, f[1].y, f[1].z);
            dJointSetAMotorAxis(joint, 2, 2, f[3].x, f[3].y, f[3].z);
        } else {
            dJointSetAMotorNumAxes(joint, count);
            for (int i = 0; i < count; ++i) {
                const auto& axis = f[static_cast<std::size_t>(i) + 1];
                dJointSetAMotorAxis(joint, i, 1, axis.x, axis.y, axis.z);
            }
        }
    }
}

const Array<String>& wantedOf(const Node& node) {
    using namespace x3d;
    if (node.is(BallJoint::type)) return node.get(BallJoint::forceOutput);
    if (node.is(SingleAxisHingeJoint::type)) return node.get(SingleAxisHingeJoint::forceOutput);
    if (node.is(SliderJoint::type)) return node.get(SliderJoint::forceOutput);
    if (node.is(UniversalJoint::type)) return node.get(UniversalJoint::forceOutput);
    if (node.is(DoubleAxisHingeJoint::type)) return node.get(DoubleAxisHingeJoint::forceOutput);
    return node.get(MotorJoint::forceOutput);
}

/// Sends the outputs that forceOutput names, where they have changed.
struct JointOutputs {
    Cascade& cascade;
    const Node& node;
    bool wants(std::string_view name) const {
        return std::ranges::any_of(wantedOf(node),
                                   [&](const String& one) { return one.view() == "ALL" || one.view() == name; });
    }
    template <class T>
    void put(std::string_view name, Field<T> field, const T& value) const {
        if (wants(name) && !(node.get(field) == value)) cascade.emit(node, field, value);
    }
    void put(std::string_view name, Field<Vec3f> field, void (*ask)(dJointID, dVector3), dJointID joint) const {
        dVector3 v{};
        ask(joint, v);
        put(name, field, Vec3f(vectorOf(v)));
    }
    void put(std::string_view name, Field<float> field, dReal value) const {
        put<float>(name, field, static_cast<float>(value));
    }
};

}  // namespace

std::size_t RigidBodyPhysics::Engine::findBody(NodeId id) const {
    const auto found = bodyOf_.find(id.value);
    return found == bodyOf_.end() ? kNone : found->second;
}

void RigidBodyPhysics::Engine::buildJoint(const Node& node, std::size_t world) {
    const std::vector<Vec3f> frame = frameOf(node);
    if (const std::string problem = problemOf(node, frame); !problem.empty()) return warn(node.id(), problem);
    const auto named = [&](std::string_view field) {
        const void* at = node.storage(node.type().findExact(field));
        const Node* body = scene_.effectiveNode(*static_cast<const NodeId*>(at));
        return body ? findBody(body->id()) : kNone;
    };
    Joint joint{.id = node.id(), .joint = nullptr, .first = named("body1"), .second = named("body2")};
    noteUse(node.id(), Use::joint);
    const dBodyID a = bodyOf(joint.first, world), b = bodyOf(joint.second, world);
    if ((!a && !b) || a == b) {
        if (joint.first == kNone && joint.second == kNone) warn(node.id(), "holds no body of its collection");
        return;
    }
    if (node.is(x3d::DoubleAxisHingeJoint::type) && (!a || !b))
        return warn(node.id(), "needs two bodies that move: it holds nothing");
    std::vector<float> signature{static_cast<float>(joint.first == kNone ? 0 : bodies_[joint.first].id.value),
                                 static_cast<float>(joint.second == kNone ? 0 : bodies_[joint.second].id.value)};
    for (const Vec3f& one : frame) signature.insert(signature.end(), {one.x, one.y, one.z});
    const auto poseOfBody = [&](std::size_t body) { return body == kNone ? Pose{} : bodies_[body].pose; };
    JointStart& start = starts_[node.id().value];
    if (start.signature != signature) start = {signature, poseOfBody(joint.first), poseOfBody(joint.second)};
    // Made where its bodies were then, so that its angles go on.
    const Pose first = poseOfBody(joint.first), second = poseOfBody(joint.second);
    const auto put = [&](std::size_t body, const Pose& pose) {
        if (body == kNone) return;
        bodies_[body].pose = pose;
        moveBody(bodies_[body]);
    };
    put(joint.first, start.first), put(joint.second, start.second);
    joint.joint = create(worlds_[world].world, node);
    dJointAttach(joint.joint, a, b);
    setFrame(joint.joint, node, frame);
    put(joint.first, first), put(joint.second, second);
    worlds_[world].joints.push_back(joint);
}

/// Stops and motors, which may change in flight.
void RigidBodyPhysics::Engine::setJoint(const Joint& joint, const Node& node) {
    using namespace x3d;
    const dJointID j = joint.joint;
    const auto stop = [&](void (*set)(dJointID, int, dReal), int group, double low, double high) {
        // Beyond a half turn the engine takes a stop for none; the one that is set first must not pass the other.
        const int shift = group * dParamGroup;
        set(j, dParamLoStop + shift, -dInfinity), set(j, dParamHiStop + shift, dInfinity);
        if (!(low <= high)) return warn(node.id(), "has a lower stop above the upper one: it has none");
        set(j, dParamLoStop + shift, low), set(j, dParamHiStop + shift, high);
    };
    const auto soft = [&](void (*set)(dJointID, int, dReal), int group, double bounce, double correction) {
        set(j, dParamBounce + group * dParamGroup, limited(bounce, 0, 1));
        set(j, dParamStopERP + group * dParamGroup, limited(correction, 0, 1));
    };
    if (node.is(SingleAxisHingeJoint::type)) {
        using H = SingleAxisHingeJoint;
        stop(dJointSetHingeParam, 0, node.get(H::minAngle), node.get(H::maxAngle));
        soft(dJointSetHingeParam, 0, node.get(H::stopBounce), node.get(H::stopErrorCorrection));
    } else if (node.is(SliderJoint::type)) {
        using S = SliderJoint;
        stop(dJointSetSliderParam, 0, node.get(S::minSeparation), node.get(S::maxSeparation));
        soft(dJointSetSliderParam, 0, node.get(S::stopBounce), node.get(S::stopErrorCorrection));
    } else if (node.is(UniversalJoint::type)) {
        using U = UniversalJoint;
        soft(dJointSetUniversalParam, 0, node.get(U::stop1Bounce), node.get(U::stop1ErrorCorrection));
        soft(dJointSetUniversalParam, 1, node.get(U::stop2Bounce), node.get(U::stop2ErrorCorrection));
    } else if (node.is(DoubleAxisHingeJoint::type)) {
        using H = DoubleAxisHingeJoint;
        const auto set = dJointSetHinge2Param;
        stop(set, 0, node.get(H::minAngle1), node.get(H::maxAngle1));
        soft(set, 0, node.get(H::stop1Bounce), node.get(H::stop1ErrorCorrection));
        set(j, dParamStopCFM, limited(node.get(H::stop1ConstantForceMix), 0, 1e9));
        set(j, dParamVel, limited(node.get(H::desiredAngularVelocity1), -1e9, 1e9));
        set(j, dParamFMax, limited(node.get(H::maxTorque1), 0, 1e30));
        set(j, dParamVel2, limited(node.get(H::desiredAngularVelocity2), -1e9, 1e9));
        set(j, dParamFMax2, limited(node.get(H::maxTorque2), 0, 1e30));
        set(j, dParamSuspensionERP, limited(node.get(H::suspensionErrorCorrection), 0, 1));
        set(j, dParamSuspensionCFM, limited(node.get(H::suspensionForce), 0, 1e9));
    } else if (node.is(MotorJoint::type)) {
        using M = MotorJoint;
        soft(dJointSetAMotorParam, 0, node.get(M::stop1Bounce), node.get(M::stop1ErrorCorrection));
        soft(dJointSetAMotorParam, 1, node.get(M::stop2Bounce), node.get(M::stop2ErrorCorrection));
        soft(dJointSetAMotorParam, 2, node.get(M::stop3Bounce), node.get(M::stop3ErrorCorrection));
        const float angles[] = {node.get(M::axis1Angle), node.get(M::axis2Angle), node.get(M::axis3Angle)};
        if (!node.get(M::autoCalc))
            for (int i = 0; i < dJointGetAMotorNumAxes(j); ++i)
                if (std::isfinite(angles[i])) dJointSetAMotorAngle(j, i, angles[i]);
    }
}

/// A stop that does not bounce takes all speed. But the engine reacts only after the stop is passed, and the speed that
/// then brings a body back remains. So a joint that would pass a stop within the step is driven exactly to the stop.
void RigidBodyPhysics::Engine::driveToStops(const Joint& joint) {
    const dJointID j = joint.joint;
    const bool slides = dJointGetType(j) == dJointTypeSlider;
    if (!slides && dJointGetType(j) != dJointTypeHinge) return;
    const auto get = slides ? dJointGetSliderParam : dJointGetHingeParam;
    const auto set = slides ? dJointSetSliderParam : dJointSetHingeParam;
    const dReal at = slides ? dJointGetSliderPosition(j) : dJointGetHingeAngle(j);
    const dReal there = at + kStep * (slides ? dJointGetSliderPositionRate(j) : dJointGetHingeAngleRate(j));
    dReal low = get(j, dParamLoStop), high = get(j, dParamHiStop);
    if (!slides && low < -M_PI) low = -dInfinity;  // beyond a half turn it is none
    if (!slides && high > M_PI) high = dInfinity;
    const bool passes = get(j, dParamBounce) == 0 && ((at < high && there > high) || (at > low && there < low));
    set(j, dParamFMax, passes ? dInfinity : 0);
    if (passes) set(j, dParamVel, ((there > high ? high : low) - at) / kStep);
}

void RigidBodyPhysics::Engine::sendJoint(const Joint& joint, const Node& node) {
    using namespace x3d;
    const dJointID j = joint.joint;
    const JointOutputs out{*cascade_, node};
    if (node.is(BallJoint::type)) {
        out.put("body1AnchorPoint", BallJoint::body1AnchorPoint, dJointGetBallAnchor, j);
        out.put("body2AnchorPoint", BallJoint::body2AnchorPoint, dJointGetBallAnchor2, j);
    } else if (node.is(SingleAxisHingeJoint::type)) {
        using H = SingleAxisHingeJoint;
        out.put("body1AnchorPoint", H::body1AnchorPoint, dJointGetHingeAnchor, j);
        out.put("body2AnchorPoint", H::body2AnchorPoint, dJointGetHingeAnchor2, j);
        out.put("angle", H::angle, dJointGetHingeAngle(j));
        out.put("angleRate", H::angleRate, dJointGetHingeAngleRate(j));
    } else if (node.is(SliderJoint::type)) {
        out.put("separation", SliderJoint::separation, dJointGetSliderPosition(j));
        out.put("separationRate", SliderJoint::separationRate, dJointGetSliderPositionRate(j));
    } else if (node.is(UniversalJoint::type)) {
        using U = UniversalJoint;
        out.put("body1AnchorPoint", U::body1AnchorPoint, dJointGetUniversalAnchor, j);
        out.put("body2AnchorPoint", U::body2AnchorPoint, dJointGetUniversalAnchor2, j);
        out.put("body1Axis", U::body1Axis, dJointGetUniversalAxis1, j);
        out.put("body2Axis", U::body2Axis, dJointGetUniversalAxis2, j);
    } else if (node.is(DoubleAxisHingeJoint::type)) {
        using H = DoubleAxisHingeJoint;
        out.put("body1AnchorPoint", H::body1AnchorPoint, dJointGetHinge2Anchor, j);
        out.put("body2AnchorPoint", H::body2AnchorPoint, dJointGetHinge2Anchor2, j);
        out.put("body1Axis", H::body1Axis, dJointGetHinge2Axis1, j);
        out.put("body2Axis", H::body2Axis, dJointGetHinge2Axis2, j);
        out.put("hinge1Angle", H::hinge1Angle, dJointGetHinge2Angle1(j));
        out.put("hinge1AngleRate", H::hinge1AngleRate, dJointGetHinge2Angle1Rate(j));
        out.put("hinge2Angle", H::hinge2Angle, dJointGetHinge2Angle2(j));
        out.put("hinge2AngleRate", H::hinge2AngleRate, dJointGetHinge2Angle2Rate(j));
    } else if (node.is(MotorJoint::type)) {
        using M = MotorJoint;
        const int axes = dJointGetAMotorNumAxes(j);
        const auto angle = [&](int i) { return i < axes ? dJointGetAMotorAngle(j, i) : 0.0; };
        const auto rate = [&](int i) { return i < axes ? dJointGetAMotorAngleRate(j, i) : 0.0; };
        out.put("motor1Angle", M::motor1Angle, angle(0)), out.put("motor1AngleRate", M::motor1AngleRate, rate(0));
        out.put("motor2Angle", M::motor2Angle, angle(1)), out.put("motor2AngleRate", M::motor2AngleRate, rate(1));
        out.put("motor3Angle", M::motor3Angle, angle(2)), out.put("motor3AngleRate", M::motor3AngleRate, rate(2));
    }
}

}  // namespace rtsg
