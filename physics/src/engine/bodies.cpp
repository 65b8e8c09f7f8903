// Hands the fields of bodies to the engine, and the engine's results back to the fields.
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "engine.h"

namespace rtsg {

using namespace physics;

namespace {

using B = x3d::RigidBody;

bool isSound(const Vec3f& v) {
    return std::abs(v.x) < 1e12f && std::abs(v.y) < 1e12f && std::abs(v.z) < 1e12f;
}
bool isSound(const Rotation& r) {
    return isSound(Vec3f(r.x, r.y, r.z)) && std::abs(r.angle) < 1e12f;
}
bool isSame(const Vec3f& a, const Vec3f& b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

/// The sum of forces or torques at each step. Values that are not finite are left out, and `sound` becomes false.
glm::dvec3 sumOf(const Array<Vec3f>& all, bool& sound) {
    glm::dvec3 sum(0);
    for (const Vec3f& one : all) {
        if (isSound(one))
            sum += glm::dvec3(one);
        else
            sound = false;
    }
    return sum;
}

}  // namespace

/// Whether any field holds another value than was written last: takes those that can be, into the doubles.
bool RigidBodyPhysics::Engine::takeField(Body& body, const Node& node) {
    bool taken = false;
    const auto take = [&](const auto& field, auto& written, const char* name, const auto& store) {
        if (field == written) return;
        written = field;
        if (!isSound(field)) return warn(node.id(), fmt::format("{} is no number: it stays as it was", name));
        store();
        taken = true;
    };
    take(node.get(B::position), body.written.position, "position",
         [&] { body.pose.position = glm::dvec3(body.written.position); });
    take(node.get(B::orientation), body.written.orientation, "orientation",
         [&] { body.pose.rotation = toQuaternion(body.written.orientation); });
    take(node.get(B::linearVelocity), body.written.linearVelocity, "linearVelocity",
         [&] { body.linear = glm::dvec3(body.written.linearVelocity); });
    take(node.get(B::angularVelocity), body.written.angularVelocity, "angularVelocity",
         [&] { body.angular = glm::dvec3(body.written.angularVelocity); });
    return taken;
}

void RigidBodyPhysics::Engine::takeFields(Body& body, const Node& node) {
    if (takeField(body, node)) body.isStuck = false;
}

/// The engine's body and geometries to where the doubles say.
void RigidBodyPhysics::Engine::moveBody(Body& body) {
    hasMoved_ = true;
    if (!body.body) {
        for (const std::size_t geom : body.geoms) moveGeom(*geoms_[geom]);
        return;
    }
    const glm::dvec3 at = body.pose.position + body.pose.rotation * body.centre;
    dBodySetPosition(body.body, at.x, at.y, at.z);
    const dQuaternion rotation{body.pose.rotation.w, body.pose.rotation.x, body.pose.rotation.y, body.pose.rotation.z};
    dBodySetQuaternion(body.body, rotation);
    dBodySetLinearVel(body.body, body.linear.x, body.linear.y, body.linear.z);
    dBodySetAngularVel(body.body, body.angular.x, body.angular.y, body.angular.z);
}

void RigidBodyPhysics::Engine::wake(Body& body) {
    if (!body.body || body.isStuck) return;
    dBodyEnable(body.body);
    isAwake_ = true;
}

void RigidBodyPhysics::Engine::setWorld(World& world, const Node& node) {
    using C = x3d::RigidBodyCollection;
    const Vec3f gravity = node.get(C::gravity);
    if (isSound(gravity))
        dWorldSetGravity(world.world, gravity.x, gravity.y, gravity.z);
    else
        warn(node.id(), "gravity is no number: it stays as it was");
    const auto within = [](double value, double low, double high, double otherwise) {
        return value >= low && value <= high ? value : otherwise;
    };
    dWorldSetERP(world.world, within(node.get(C::errorCorrection), 0, 1, 0.8));
    dWorldSetCFM(world.world, within(node.get(C::constantForceMix), 0, 1e6, 1e-4));
    const double correction = node.get(C::maxCorrectionSpeed);
    dWorldSetContactMaxCorrectingVel(world.world, correction >= 0 ? correction : dInfinity);
    dWorldSetContactSurfaceLayer(world.world, within(node.get(C::contactSurfaceThickness), 0, 1e6, 0));
    dWorldSetQuickStepNumIterations(world.world, std::clamp(node.get(C::iterations), 1, 1000));
}

/// Sets the properties that may change in motion without building anything anew.
void RigidBodyPhysics::Engine::setBody(Body& body, const Node& node, const Node& collection) {
    using C = x3d::RigidBodyCollection;
    const dBodyID b = body.body;
    dBodySetGravityMode(b, node.get(B::useGlobalGravity));
    dBodySetFiniteRotationMode(b, node.get(B::useFiniteRotation));
    const Vec3f axis = node.get(B::finiteRotationAxis);
    if (node.get(B::useFiniteRotation) && isSound(axis)) dBodySetFiniteRotationAxis(b, axis.x, axis.y, axis.z);
    const auto fraction = [](float factor) { return factor >= 0 && factor <= 1 ? double(factor) : 0.0; };
    const bool damps = node.get(B::autoDamp);
    dBodySetDamping(b, damps ? fraction(node.get(B::linearDampingFactor)) : 0,
                    damps ? fraction(node.get(B::angularDampingFactor)) : 0);
    dBodySetLinearDampingThreshold(b, 0), dBodySetAngularDampingThreshold(b, 0);
    const bool own = node.get(B::autoDisable), rests = own || collection.get(C::autoDisable);
    dBodySetAutoDisableFlag(b, rests);
    if (!rests) return;
    const auto limit = [](double value) { return value > 0 ? value : 0.0; };
    dBodySetAutoDisableLinearThreshold(
        b, limit(own ? node.get(B::disableLinearSpeed) : collection.get(C::disableLinearSpeed)));
    dBodySetAutoDisableAngularThreshold(
        b, limit(own ? node.get(B::disableAngularSpeed) : collection.get(C::disableAngularSpeed)));
    dBodySetAutoDisableTime(b, limit((own ? node.get(B::disableTime) : collection.get(C::disableTime)).seconds));
    dBodySetAutoDisableSteps(b, 0);
    // Setting it forgets how long the body has been slow.
    if (dBodyGetAutoDisableAverageSamplesCount(b) != 1) dBodySetAutoDisableAverageSamplesCount(b, 1);
}

/// Forces and torques of one step, and those of joints that push.
void RigidBodyPhysics::Engine::push() {
    for (World& world : worlds_) {
        const Node* collection = scene_.find(world.id);
        if (!collection || !collection->get(x3d::RigidBodyCollection::enabled)) continue;
        for (const std::size_t index : world.bodies) {
            Body& body = bodies_[index];
            const Node* node = body.body && dBodyIsEnabled(body.body) ? scene_.find(body.id) : nullptr;
            if (!node || (node->get(B::forces).empty() && node->get(B::torques).empty())) continue;
            bool sound = true;
            const glm::dvec3 force = sumOf(node->get(B::forces), sound), rotation = sumOf(node->get(B::torques), sound);
            if (!sound) warn(node->id(), "has forces or torques that are no numbers: they do nothing");
            dBodyAddForce(body.body, force.x, force.y, force.z);
            dBodyAddTorque(body.body, rotation.x, rotation.y, rotation.z);
        }
        for (const Joint& joint : world.joints) {
            const Node* node = scene_.find(joint.id);
            if (!node || !joint.joint) continue;
            if (node->is(x3d::SliderJoint::type)) {
                const double force = node->get(x3d::SliderJoint::sliderForce);
                if (std::isfinite(force) && force != 0) dJointAddSliderForce(joint.joint, force);
            } else if (node->is(x3d::MotorJoint::type)) {
                using M = x3d::MotorJoint;
                const double t[3] = {node->get(M::axis1Torque), node->get(M::axis2Torque), node->get(M::axis3Torque)};
                const bool sound = std::isfinite(t[0]) && std::isfinite(t[1]) && std::isfinite(t[2]);
                if (sound && (t[0] != 0 || t[1] != 0 || t[2] != 0))
                    dJointAddAMotorTorques(joint.joint, t[0], t[1], t[2]);
            }
        }
    }
}

/// Into the doubles. A body that nothing touches moves by the mean of its velocities before and after, which is exact
/// for a constant force; the engine moves it by the one after.
void RigidBodyPhysics::Engine::settle(World& world) {
    for (const std::size_t index : world.bodies) {
        Body& body = bodies_[index];
        if (!body.body || !dBodyIsEnabled(body.body)) continue;
        const dReal *at = dBodyGetPosition(body.body), *q = dBodyGetQuaternion(body.body);
        const dReal *v = dBodyGetLinearVel(body.body), *w = dBodyGetAngularVel(body.body);
        glm::dvec3 position(at[0], at[1], at[2]);
        const glm::dvec3 linear(v[0], v[1], v[2]);
        if (dBodyGetNumJoints(body.body) == 0) {
            position -= 0.5 * kStep * (linear - body.before);
            dBodySetPosition(body.body, position.x, position.y, position.z);
        }
        Pose pose{position, {q[0], q[1], q[2], q[3]}};
        pose.position -= pose.rotation * body.centre;
        if (!isFinite(pose) || !isFinite({linear, {}}) || !isFinite({{w[0], w[1], w[2]}, {}})) {
            warn(body.id, "has come to a place or speed that is no number: it rests until it is set");
            body.isStuck = true, body.linear = body.angular = glm::dvec3(0);
            moveBody(body);
            dBodyDisable(body.body);
            continue;
        }
        body.pose = pose, body.linear = linear, body.angular = {w[0], w[1], w[2]};
    }
}

/// The events of a frame: a body's fields, and the places of its collidables.
void RigidBodyPhysics::Engine::send(Body& body, const Node& node) {
    Cascade& cascade = *cascade_;
    const auto put = [&](auto field, auto& written, const auto& value) {
        const bool same = node.get(field) == value;
        written = value;
        if (!same) cascade.emit(node, field, value);
    };
    put(B::position, body.written.position, Vec3f(body.pose.position));
    put(B::orientation, body.written.orientation, toRotation(body.pose.rotation));
    put(B::linearVelocity, body.written.linearVelocity, Vec3f(body.linear));
    put(B::angularVelocity, body.written.angularVelocity, Vec3f(body.angular));
    if (!node.get(B::enabled)) return;  // it does not act, on its shapes neither
    for (const std::size_t index : body.geoms) {
        const Geom& geom = *geoms_[index];
        const Node* leaf = scene_.find(geom.leaf);
        if (!leaf) continue;
        // Drawn below its CollidableOffsets, it is where the body has it.
        const Pose local = geom.listed == geom.leaf ? body.pose : geom.offset.inverse() * body.pose * geom.offset;
        const Vec3f position(local.position);
        const Rotation rotation = toRotation(local.rotation);
        using S = x3d::CollidableShape;
        if (!isSame(leaf->get(S::translation), position)) cascade.emit(*leaf, S::translation, position);
        if (!(leaf->get(S::rotation) == rotation)) cascade.emit(*leaf, S::rotation, rotation);
    }
}

}  // namespace rtsg
