// Joints of two axes, motors and the slip of contacts against closed forms; who meets whom in which collection.
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include "physics/body_stage.h"

namespace rtsg {
namespace {

using test::collidable;
using RigidBody = x3d::RigidBody;

struct JointStage : test::BodyStage {
    using BodyStage::BodyStage;
    int frames = 0;

    ~JointStage() {
        for (const Diagnostic& one : scene.diagnostics().all()) ADD_FAILURE() << one.format();
    }
    void runTo(double end) {
        while (frames < std::lround(end * 120)) scene.newFrame(++frames / 120.);
    }
    Vec3d spin(std::string_view name) const { return Vec3d(node(name).get(RigidBody::angularVelocity)); }
    /// How far it has turned about an axis of the world that it keeps; -pi to pi.
    double rotationAround(std::string_view name, const Vec3d& axis) const {
        const Rotation r = node(name).get(RigidBody::orientation);
        return std::remainder(glm::dot(axis, Vec3d(r.x, r.y, r.z)) * double{r.angle}, 2 * std::acos(-1.0));
    }
};

std::string inertiaOf(double x, double y, double z) {
    return fmt::format("inertia {} 0 0 0 {} 0 0 0 {}", x, y, z);
}

}  // namespace

TEST(Joints, StopsWithoutBounceKeepNoSpeed) {
    // The body that moves is the first or the second of its joint; a rate counts as the first one's or the second's.
    for (const bool isFirst : {true, false})
        for (const double bounce : {0.0, 1.0}) {
            SCOPED_TRACE(fmt::format("first {} bounce {}", isFirst, bounce));
            const std::string limits = fmt::format("stopBounce {} forceOutput \"ALL\"", bounce);
            JointStage stage(fmt::format(
                "RigidBodyCollection {{ gravity 0 0 0 preferAccuracy TRUE bodies [ DEF F RigidBody {{ fixed TRUE }}\n"
                "  DEF S RigidBody {{ position 1 0 0 linearVelocity 1 0 0 }}\n"
                "  DEF H RigidBody {{ position 0 9 0 angularVelocity 0 0 1 inertia 1 0 0 0 1 0 0 0 1 }} ]\n"
                "joints [ DEF J SliderJoint {{ axis 1 0 0 {0} minSeparation -.3 maxSeparation .3 {2} }}\n"
                "  DEF K SingleAxisHingeJoint {{ axis 0 0 1 anchorPoint 0 9 0 {1} minAngle -.3 maxAngle .3 {2} }} ] }}",
                isFirst ? "body1 USE S body2 USE F" : "body1 USE F body2 USE S",
                isFirst ? "body1 USE H body2 USE F" : "body1 USE F body2 USE H", limits));
            stage.runTo(.6);
            const double speed = Vec3d(stage.node("S").get(RigidBody::linearVelocity)).x;
            EXPECT_NEAR(speed, -bounce, 1e-3);
            EXPECT_NEAR(stage.spin("H").z, -bounce, 1e-3);
            if (bounce > 0) continue;
            EXPECT_NEAR(std::abs(stage.node("J").get(x3d::SliderJoint::separation)), .3, 1e-4);
            EXPECT_NEAR(std::abs(stage.node("K").get(x3d::SingleAxisHingeJoint::angle)), .3, 1e-4);
            EXPECT_NEAR(stage.node("J").get(x3d::SliderJoint::separationRate), 0, 1e-3);
        }
}

TEST(Joints, AUniversalJointTurnsItsShaftsAsHookeHasIt) {
    // Two shafts that bearings hold, at an angle b, and the joint between them: tan of the second's turn is cos b times
    // tan of the first's, counted from where the first one's fork stands upright on their plane.
    const double b = .6;
    const Vec3d second(std::cos(b), std::sin(b), 0);
    JointStage stage(fmt::format(
        "RigidBodyCollection {{ gravity 0 0 0 preferAccuracy TRUE constantForceMix .000001\n"
        "bodies [ DEF A RigidBody {{ angularVelocity 1.5 0 0 {} }} DEF B RigidBody {{ angularVelocity {} {} 0 {} }} "
        "]\n"
        "joints [ SingleAxisHingeJoint {{ body1 USE A axis 1 0 0 }} SingleAxisHingeJoint {{ body1 USE B axis {} {} 0 "
        "}}\n"
        "  DEF U UniversalJoint {{ body1 USE A body2 USE B axis1 0 0 1 axis2 {} {} 0 forceOutput \"ALL\" }} ] }}",
        inertiaOf(100, 100, 100), 1.5 * std::cos(b) * second.x, 1.5 * std::cos(b) * second.y, inertiaOf(.1, .1, .1),
        second.x, second.y, -second.y, second.x));
    double maximum = 0;
    for (int k = 1; k <= 60; ++k) {
        stage.runTo(k / 15.);
        const double one = stage.rotationAround("A", {1, 0, 0}), two = stage.rotationAround("B", second);
        const double expected = std::atan2(std::sin(one) * std::cos(b), std::cos(one));
        EXPECT_NEAR(std::remainder(two - expected, 2 * std::acos(-1.0)), 0, 5e-3) << k;
        maximum = std::max(maximum, std::abs(two - one));
        const Vec3d first(stage.node("U").get(x3d::UniversalJoint::body1Axis)),
            other(stage.node("U").get(x3d::UniversalJoint::body2Axis));
        EXPECT_NEAR(glm::dot(first, other), 0, 5e-3);  // a cross stays a cross
        EXPECT_NEAR(first.x, 0, 5e-3);                 // that turns with the shafts
        EXPECT_NEAR(glm::dot(other, second), 0, 5e-3);
    }
    EXPECT_GT(maximum, .09);  // the shafts do not turn alike
    EXPECT_GT(std::abs(stage.spin("A").x), 1.3);
}

TEST(Joints, AWheelsMotorHasItsTorqueAndItsSpeed) {
    const double torque = .5, inertia = .25, wanted = 3;
    JointStage stage(fmt::format(
        "RigidBodyCollection {{ gravity 0 0 0 preferAccuracy TRUE\n"
        "bodies [ DEF C RigidBody {{ mass 1e6 {} }} DEF W RigidBody {{ position 1 0 0 {} }} ]\n"
        "joints DEF J DoubleAxisHingeJoint {{ body1 USE C body2 USE W anchorPoint 1 0 0 axis1 0 1 0 axis2 1 0 0\n"
        "  maxTorque2 {} desiredAngularVelocity2 {} minAngle1 0 maxAngle1 0 forceOutput \"ALL\" }} }}",
        inertiaOf(1e6, 1e6, 1e6), inertiaOf(inertia, inertia, inertia), torque, wanted));
    stage.runTo(1);
    EXPECT_NEAR(std::abs(stage.spin("W").x), torque / inertia, .01 * torque / inertia);
    stage.runTo(3);
    EXPECT_NEAR(std::abs(stage.spin("W").x), wanted, .01);
    EXPECT_NEAR(stage.node("J").get(x3d::DoubleAxisHingeJoint::hinge2AngleRate), wanted, .01);
    EXPECT_NEAR(glm::length(stage.position("W") - Vec3d(1, 0, 0)), 0, 1e-3);
}

TEST(Joints, AWheelIsSteeredAsFarAsItsStop) {
    JointStage stage(fmt::format(
        "RigidBodyCollection {{ gravity 0 0 0 preferAccuracy TRUE\n"
        "bodies [ DEF C RigidBody {{ mass 1e6 {} }} DEF W RigidBody {{ position 1 0 0 {} }} ]\n"
        "joints DEF J DoubleAxisHingeJoint {{ body1 USE C body2 USE W anchorPoint 1 0 0 axis1 0 1 0 axis2 1 0 0\n"
        "  maxTorque1 1 desiredAngularVelocity1 .5 minAngle1 -.4 maxAngle1 .4 stop1ConstantForceMix 0 forceOutput "
        "\"ALL\" }} }}",
        inertiaOf(1e6, 1e6, 1e6), inertiaOf(.01, .01, .01)));
    using J = x3d::DoubleAxisHingeJoint;
    stage.runTo(.5);
    EXPECT_NEAR(std::abs(stage.rotationAround("W", {0, 1, 0})), .25, .01);
    EXPECT_NEAR(stage.node("J").get(J::hinge1Angle), .25, .01);
    EXPECT_NEAR(stage.node("J").get(J::hinge1AngleRate), .5, .01);
    stage.runTo(3);
    EXPECT_NEAR(std::abs(stage.rotationAround("W", {0, 1, 0})), .4, .01);
    EXPECT_NEAR(stage.node("J").get(J::hinge1Angle), .4, .01);
}

TEST(Joints, ASuspensionGivesWayAsItsSpringHasIt) {
    // A step of h solves a spring of k = erp / (h cfm): a force F moves it by F / k.
    const double softness = .02, correction = .5, force = 10;
    JointStage stage(fmt::format(
        "RigidBodyCollection {{ gravity 0 0 0 preferAccuracy TRUE\n"
        "bodies [ DEF C RigidBody {{ mass 1e7 {} }} DEF W RigidBody {{ position 1 0 0 {} forces 0 {} 0 }} ]\n"
        "joints DoubleAxisHingeJoint {{ body1 USE C body2 USE W anchorPoint 1 0 0 axis1 0 1 0 axis2 1 0 0\n"
        "  suspensionForce {} suspensionErrorCorrection {} }} }}",
        inertiaOf(1e7, 1e7, 1e7), inertiaOf(1, 1, 1), -force, softness, correction));
    stage.runTo(4);
    const double expected = force * RigidBodyPhysics::kStep * softness / correction;
    EXPECT_NEAR(stage.position("W").y, -expected, .03 * expected);
    EXPECT_NEAR(stage.position("W").x, 1, 1e-3);
}

TEST(Joints, MotorsTurnByTheirTorques) {
    // Torques act on both bodies, the other way round on the second: 3 / 2 and 3 / 6 rad/s2 for two seconds.
    JointStage stage(
        fmt::format("RigidBodyCollection {{ gravity 0 0 0\n"
                    "bodies [ DEF A RigidBody {{ {} }} DEF B RigidBody {{ position 5 0 0 {} }} ]\n"
                    "joints DEF M MotorJoint {{ body1 USE A body2 USE B enabledAxes 1 motor1Axis 0 1 0 "
                    "axis1Torque 3 axis1Angle .75 forceOutput \"ALL\" }} }}",
                    inertiaOf(2, 2, 2), inertiaOf(6, 6, 6)));
    stage.runTo(2);
    using M = x3d::MotorJoint;
    EXPECT_NEAR(glm::length(stage.spin("A") - Vec3d(0, 3, 0)), 0, 1e-4);
    EXPECT_NEAR(glm::length(stage.spin("B") - Vec3d(0, -1, 0)), 0, 1e-4);
    EXPECT_NEAR(stage.node("M").get(M::motor1AngleRate), 4, 1e-4);
    EXPECT_NEAR(stage.node("M").get(M::motor1Angle), .75, 1e-6);  // as given, without autoCalc
    EXPECT_EQ(stage.node("M").get(M::motor2AngleRate), 0);
    // Several axes at once, each with its own.
    JointStage two(
        fmt::format("RigidBodyCollection {{ gravity 0 0 0 bodies DEF A RigidBody {{ {} }}\n"
                    "joints MotorJoint {{ body1 USE A enabledAxes 2 motor1Axis 0 1 0 motor2Axis 0 0 1 "
                    "axis1Torque 1 axis2Torque -2 axis3Torque 7 }} }}",
                    inertiaOf(10, 10, 10)));
    two.runTo(1);
    EXPECT_NEAR(glm::length(two.spin("A") - Vec3d(0, .1, -.2)), 0, 1e-4);
}

TEST(Joints, MotorsFindTheirAnglesThemselves) {
    using M = x3d::MotorJoint;
    const Vec3d axes[] = {{1, 0, 0}, {0, 0, 1}};
    for (int i = 0; i < 2; ++i) {
        const Vec3d rate = axes[i] * .4;
        JointStage stage(fmt::format(
            "RigidBodyCollection {{ gravity 0 0 0 bodies [ DEF A RigidBody {{ {} angularVelocity {} {} {} }} "
            "DEF B RigidBody {{ position 9 0 0 {} }} ]\n"
            "joints DEF M MotorJoint {{ body1 USE A body2 USE B autoCalc TRUE enabledAxes 3 motor1Axis 1 0 0 "
            "motor3Axis 0 0 1 forceOutput \"ALL\" }} }}",
            inertiaOf(1, 1, 1), rate.x, rate.y, rate.z, inertiaOf(1, 1, 1)));
        stage.runTo(1.5);
        const Node& m = stage.node("M");
        const float angles[] = {m.get(M::motor1Angle), m.get(M::motor2Angle), m.get(M::motor3Angle)};
        // The engine looks at angles when a step begins.
        EXPECT_NEAR(std::abs(angles[2 * i]), .4 * (1.5 - RigidBodyPhysics::kStep), 1e-4);
        EXPECT_NEAR(angles[1], 0, 1e-3);
        EXPECT_NEAR(angles[2 - 2 * i], 0, 1e-3);
    }
}

TEST(Contacts, SlipAsTheirForceHasIt) {
    // Force-dependent slip: what is pushed over the ground with F goes at slip times F. A ball that hardly can be
    // turned has one point of contact.
    const auto speed = [](const std::string& collider) {
        JointStage stage(
            fmt::format("RigidBodyCollection {{ gravity 0 -10 0 collider CollisionCollection {{ bounce 0 "
                        "frictionCoefficients 100 100 {} "
                        "collidables [ {} {} ] }}\n"
                        "bodies [ RigidBody {{ fixed TRUE position 0 -1 0 geometry USE F }} DEF B RigidBody {{ "
                        "position 0 .5 0 {} forces 2 0 0 "
                        "geometry USE C }} ] }}",
                        collider, collidable("F", "Box { size 100 2 100 }"), collidable("C", "Sphere { radius .5 }"),
                        inertiaOf(1e7, 1e7, 1e7)));
        stage.runTo(4);
        EXPECT_NEAR(stage.position("B").y, .5, .02);
        return stage.velocity("B").x;
    };
    const auto expected = [](double slip) { return 2 * slip * (1 - std::exp(-4 / slip)); };
    const std::string applied = "appliedParameters [ \"FRICTION_COEFFICIENT-2\" \"SLIP-1\" \"SLIP-2\" ] ";
    EXPECT_NEAR(speed(applied + "slipFactors .5 .5"), expected(.5), .01);
    EXPECT_NEAR(speed(applied + "slipFactors 1.5 1.5"), expected(1.5), .02);
    // It slides along the first direction, whatever the second one's slip.
    EXPECT_NEAR(speed(applied + "slipFactors .5 0"), expected(.5), .01);
    EXPECT_NEAR(speed("appliedParameters [ \"FRICTION_COEFFICIENT-2\" ] slipFactors .5 .5"), 0, .02);
}

TEST(Contacts, MeetOnlyInACollectionThatBothAreIn) {
    const auto heights = [](const std::string& first, const std::string& second, const std::string& enabled = {}) {
        JointStage stage(fmt::format(
            "RigidBodyCollection {{ gravity 0 -10 0 collider DEF K CollisionCollection {{ {} bounce 0 "
            "collidables [ {} {} {} ] }}\n"
            "bodies [ RigidBody {{ fixed TRUE position 0 -1 0 geometry USE F }}\n"
            "  DEF A RigidBody {{ position -5 1 0 geometry USE CA }} DEF B RigidBody {{ position 5 1 0 "
            "geometry {} }} ] }}\n"
            "RigidBodyCollection {{ gravity 0 -10 0 collider CollisionCollection {{ collidables {} }}\n"
            "  bodies RigidBody {{ position 300 0 0 geometry USE D }} }}\n"
            "DEF S CollisionSensor {{ collider CollisionCollection {{ collidables [ {} ] }} }}",
            enabled, collidable("F", "Box { size 100 2 100 }"), collidable("CA", "Box { size 1 1 1 }"), first,
            first.empty() ? collidable("CB", "Box { size 1 1 1 }") : "USE CB", collidable("D", "Sphere { }"), second));
        bool sensed = false;
        stage.scene.setEventListener([&](double, const Node& node, FieldIndex field, const Value& value) {
            sensed = sensed || (node.is(x3d::CollisionSensor::type) && field == x3d::CollisionSensor::isActive.index &&
                                value.as<bool>());
        });
        stage.runTo(1.5);
        return std::tuple(stage.position("A").y, stage.position("B").y, sensed);
    };
    const double fallen = 1 - .5 * 10 * 1.5 * 1.5;
    {  // both are in the collider's
        const auto [a, b, sensed] = heights(collidable("CB", "Box { size 1 1 1 }"), "USE CA USE CB");
        EXPECT_NEAR(a, .5, .02);
        EXPECT_NEAR(b, .5, .02);
        EXPECT_FALSE(sensed);  // the sensor's has no floor
    }
    {  // B is in the sensor's alone, with the floor: it is seen there, and falls through
        const auto [a, b, sensed] = heights("", "USE F USE CB");
        EXPECT_NEAR(a, .5, .02);
        EXPECT_NEAR(b, fallen, 1e-3);
        EXPECT_TRUE(sensed);
    }
    {  // B and the floor are in no collection together
        const auto [a, b, sensed] = heights("", "USE CB USE CA");
        EXPECT_NEAR(a, .5, .02);
        EXPECT_NEAR(b, fallen, 1e-3);
        EXPECT_FALSE(sensed);
    }
    {  // a collection that is not enabled lets all pass, though another one is
        const auto [a, b, sensed] = heights(collidable("CB", "Box { size 1 1 1 }"), "USE F USE CB", "enabled FALSE");
        EXPECT_NEAR(a, fallen, 1e-3);
        EXPECT_NEAR(b, fallen, 1e-3);
        EXPECT_TRUE(sensed);
    }
}

}  // namespace rtsg
