// RigidBodyPhysics for builds without ODE: it warns once for each collection or sensor.
#include <rtsg/core/behaviour.h>
#include <rtsg/core/x3d.h>
#include <rtsg/physics/rigid_body_physics.h>

namespace rtsg {

class RigidBodyPhysics::Engine {};

namespace {

double restsOnTime(Cascade& cascade, const Node& node) {
    cascade.warn(node, "rests: this build has no ODE (libode-dev), by which bodies move and contacts are found");
    return kNever;
}

}  // namespace

RigidBodyPhysics::RigidBodyPhysics(Scene& scene) {
    for (const TypeIndex type : {x3d::RigidBodyCollection::type, x3d::CollisionSensor::type})
        scene.registerBehaviour(type, {.onTime = restsOnTime});
}
RigidBodyPhysics::~RigidBodyPhysics() = default;
bool RigidBodyPhysics::isAvailable() {
    return false;
}
RigidBodyPhysics::Counts RigidBodyPhysics::counts() const {
    return {};
}

}  // namespace rtsg
