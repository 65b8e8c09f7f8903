// Rigid bodies against closed forms: falling, throwing, bouncing, sliding, swinging, turning and meeting.
#include <cmath>
#include <memory>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include "physics/body_stage.h"

namespace rtsg {
namespace {

using test::collidable;
using Body = x3d::RigidBody;

/// A scene whose bodies move, frame by frame.
struct Stage : test::BodyStage {
    using BodyStage::BodyStage;
    double now = 0;

    void runTo(double end, double fps = 60) {
        for (const double start = now; now < end - 1e-9;) {
            now = std::min(end, start + (std::round((now - start) * fps) + 1) / fps);
            scene.newFrame(now);
        }
    }
    bool says(std::string_view text) {
        for (const Diagnostic& one : scene.diagnostics().all())
            if (one.text.find(text) != std::string::npos) return true;
        return false;
    }
};

/// A box of a metre's half on a floor whose top is at 0, that leans by `slope` radians about z.
std::string onFloor(const std::string& collider, const std::string& body, double slope = 0) {
    return fmt::format(
        "RigidBodyCollection {{ gravity {} {} 0 collider CollisionCollection {{ {} collidables [ {} {} ] }}\n"
        "bodies [ RigidBody {{ fixed TRUE position 0 -1 0 geometry USE F }} DEF B RigidBody {{ {} geometry USE C }} ] "
        "}}",
        10 * std::sin(slope), -10 * std::cos(slope), collider, collidable("F", "Box { size 100 2 100 }"),
        collidable("C", "Box { size 1 1 1 }"), body);
}

TEST(RigidBodies, FallAndFlyAsGalileoHasIt) {
    Stage stage(
        "RigidBodyCollection { gravity 0 -10 0 bodies DEF B RigidBody { position 1 2 3 linearVelocity 4 5 6 } }");
    stage.runTo(2);
    const Vec3d at = stage.position("B");  // exact for a constant force; floats hold it
    EXPECT_NEAR(at.x, 1 + 4 * 2, 1e-5);
    EXPECT_NEAR(at.y, 2 + 5 * 2 - 5 * 4, 1e-5);
    EXPECT_NEAR(at.z, 3 + 6 * 2, 1e-5);
    EXPECT_NEAR(stage.velocity("B").y, 5 - 20, 1e-5);
}

TEST(RigidBodies, MoveAlikeAtAnyFrameRate) {
    const std::string text =
        onFloor("bounce .5 frictionCoefficients .3 0", "position 0 3 0 linearVelocity 1 0 .5 angularVelocity 1 2 3");
    Stage fast(text), slow(text), odd(text);
    fast.runTo(4, 120), slow.runTo(4, 12), odd.runTo(4, 47);
    for (const char* name : {"B"}) {
        EXPECT_EQ(fast.position(name), slow.position(name));
        EXPECT_EQ(fast.position(name), odd.position(name));
        EXPECT_TRUE(fast.node(name).get(Body::orientation) == odd.node(name).get(Body::orientation));
    }
}

TEST(RigidBodies, BounceToTheHeightOfTheirRestitution) {
    for (const double e : {.3, .5, .8}) {
        // A box turns when one corner meets first; a ball does not.
        Stage stage(
            fmt::format("RigidBodyCollection {{ gravity 0 -10 0 collider CollisionCollection {{ bounce {} collidables "
                        "[ {} {} ] }}\n"
                        "bodies [ RigidBody {{ fixed TRUE position 0 -1 0 geometry USE F }}\n"
                        "DEF B RigidBody {{ position 0 2.5 0 geometry USE C }} ] }}",
                        e, collidable("F", "Box { size 100 2 100 }"), collidable("C", "Sphere { radius .5 }")));
        double highest = 0, before = 0;
        bool rises = false;
        while (stage.now < 3) {
            stage.runTo(stage.now + RigidBodyPhysics::kStep, 120);
            const double v = stage.velocity("B").y;
            if (rises && v < 0) break;
            rises = rises || (before < 0 && v > 0);
            before = v;
            if (rises) highest = std::max(highest, stage.position("B").y - .5);
        }
        EXPECT_NEAR(highest, 2 * e * e, .04 * 2) << e;  // a step of 6.3 m/s is 5 cm
    }
}

TEST(RigidBodies, SlideOrStickAsCoulombHasIt) {
    const double mu = .4, repose = std::atan(mu);
    const std::string collider = fmt::format("bounce 0 frictionCoefficients {} 0", mu);
    Stage sticks(onFloor(collider, "position 0 .5 0", repose - .03));
    sticks.runTo(2);
    EXPECT_NEAR(sticks.position("B").x, 0, .02);
    Stage slides(onFloor(collider, "position 0 .5 0", repose + .2));
    slides.runTo(1);
    const double from = slides.velocity("B").x;
    slides.runTo(2);
    const double a = 10 * (std::sin(repose + .2) - mu * std::cos(repose + .2));
    EXPECT_NEAR(slides.velocity("B").x - from, a, .03 * a);
}

TEST(RigidBodies, SwingInThePendulumsPeriod) {
    for (const char* joint : {"BallJoint { anchorPoint 0 0 0", "SingleAxisHingeJoint { anchorPoint 0 0 0 axis 0 0 1"}) {
        // A small body on a rod of 1 m, let go at .1 rad: T = 2 pi sqrt((m l^2 + I) / (m g l)) (1 + .1^2 / 16).
        Stage stage(fmt::format(
            "RigidBodyCollection {{ gravity 0 -10 0 errorCorrection .8 constantForceMix 0 preferAccuracy TRUE\n"
            "bodies DEF B RigidBody {{ position {} {} 0 inertia .01 0 0 0 .01 0 0 0 .01 }} joints {} body1 USE B }} }}",
            std::sin(.1), -std::cos(.1), joint));
        const double expected = 2 * std::acos(-1.0) * std::sqrt(1.01 / 10) * (1 + .01 / 16);
        std::vector<double> crossings;
        double before = stage.position("B").x;
        while (stage.now < 12) {
            stage.runTo(stage.now + RigidBodyPhysics::kStep, 120);
            const double x = stage.position("B").x;
            if (before < 0 && x >= 0) crossings.push_back(stage.now - RigidBodyPhysics::kStep * x / (x - before));
            before = x;
        }
        ASSERT_GE(crossings.size(), 4u) << joint;
        const double period = (crossings.back() - crossings.front()) / double(crossings.size() - 1);
        EXPECT_NEAR(period, expected, .005 * expected) << joint;
        const Vec3d at = stage.position("B");
        EXPECT_NEAR(glm::length(at), 1, 1e-3) << joint;
    }
}

TEST(RigidBodies, KeepTheirAngularMomentum) {
    Stage stage(
        "RigidBodyCollection { gravity 0 0 0 bodies DEF B RigidBody { angularVelocity 1 2 .5 inertia 1 0 0 0 2 0 0 0 3 "
        "} }");
    const auto momentum = [&] {
        const Rotation r = stage.node("B").get(Body::orientation);
        const glm::dquat q = glm::angleAxis(double(r.angle), glm::normalize(Vec3d(r.x, r.y, r.z)));
        return q * (Vec3d(1, 2, 3) * (glm::conjugate(q) * Vec3d(stage.node("B").get(Body::angularVelocity))));
    };
    const Vec3d before = momentum();
    stage.runTo(2);
    EXPECT_NEAR(glm::length(momentum() - before) / glm::length(before), 0, .03);
}

TEST(RigidBodies, KeepTheirMomentumWhenTheyMeet) {
    Stage stage(
        fmt::format("RigidBodyCollection {{ gravity 0 0 0 constantForceMix 0 collider CollisionCollection {{ bounce .5 "
                    "collidables [ {} {} ] }}\n"
                    "bodies [ DEF A RigidBody {{ mass 2 position -2 0 0 linearVelocity 3 0 0 geometry USE CA }}\n"
                    "DEF B RigidBody {{ mass 1 position 2 0 0 linearVelocity -1 0 0 geometry USE CB }} ] }}",
                    collidable("CA", "Sphere { radius .5 }"), collidable("CB", "Sphere { radius .5 }")));
    stage.runTo(2);
    const double a = stage.velocity("A").x, b = stage.velocity("B").x;
    EXPECT_NEAR(2 * a + b, 5, 1e-3);
    EXPECT_NEAR(b - a, .5 * 4, .02);  // the speed at which they part
}

TEST(RigidBodies, StackAndComeToRest) {
    std::string bodies, members;
    for (int i = 0; i < 6; ++i) {
        bodies += fmt::format(" DEF B{} RigidBody {{ position 0 {} 0 geometry USE C{} }}", i, .5 + i, i);
        members += ' ' + collidable(fmt::format("C{}", i), "Box { size 1 1 1 }");
    }
    Stage stage(
        fmt::format("RigidBodyCollection {{ autoDisable TRUE disableTime .5 disableLinearSpeed .2 disableAngularSpeed "
                    ".3 contactSurfaceThickness .002 "
                    "iterations 40 collider CollisionCollection {{ frictionCoefficients .6 0 collidables [ {} {} ] }}\n"
                    "bodies [ RigidBody {{ fixed TRUE position 0 -1 0 geometry USE F }} {} ] }}",
                    collidable("F", "Box { size 100 2 100 }"), members, bodies));
    stage.runTo(5);
    for (int i = 0; i < 6; ++i) {
        const Vec3d at = stage.position(fmt::format("B{}", i));
        EXPECT_NEAR(at.x, 0, .05);
        EXPECT_NEAR(at.y, .5 + i, .05);
    }
    EXPECT_EQ(stage.physics.counts().awake, 0u);
    const std::uint64_t steps = stage.physics.counts().steps;
    stage.runTo(10);
    EXPECT_EQ(stage.physics.counts().steps, steps);  // who rests costs nothing
    // A push wakes it.
    ASSERT_TRUE(stage.scene.sendEvent(stage.scene.findName("B5"), Body::linearVelocity.index, Vec3f(0, 3, 0)));
    stage.runTo(10.1);
    EXPECT_GT(stage.position("B5").y, 5.6);
}

TEST(RigidBodies, MeetWithoutAColliderWhatContactsAreGiven) {
    for (const bool given : {false, true}) {
        Stage stage(fmt::format(
            "DEF W RigidBodyCollection {{ gravity 0 0 0 constantForceMix 0 errorCorrection 0\n"
            "bodies DEF B RigidBody {{ linearVelocity 0 -1 0 geometry {} }} }}\n"
            "DEF S CollisionSensor {{ collider CollisionCollection {{ collidables [ USE C\n"
            "CollidableShape {{ translation 0 -.99 0 shape Shape {{ geometry Box {{ size 9 1 9 }} }} }} ] }} }}\n{}",
            collidable("C", "Sphere { radius .5 }"), given ? "ROUTE S.contacts TO W.set_contacts" : ""));
        stage.runTo(.25);
        EXPECT_NEAR(stage.velocity("B").y, given ? 0 : -1, 1e-5);
        EXPECT_TRUE(stage.node("S").get(x3d::CollisionSensor::isActive));
    }
}

/// Bodies that begin half inside each other are pushed apart no faster than that; a negative speed is no limit.
TEST(RigidBodies, ArePushedApartAtMostAtMaxCorrectionSpeed) {
    const auto speed = [](const char* maximum) {
        Stage stage(
            fmt::format("RigidBodyCollection {{ gravity 0 0 0 constantForceMix 0 errorCorrection .5 "
                        "maxCorrectionSpeed {} preferAccuracy TRUE\n"
                        "collider CollisionCollection {{ collidables [ {} {} ] }}\n"
                        "bodies [ DEF A RigidBody {{ position -.25 0 0 geometry USE CA }} "
                        "DEF B RigidBody {{ position .25 0 0 geometry USE CB }} ] }}",
                        maximum, collidable("CA", "Sphere { radius .5 }"), collidable("CB", "Sphere { radius .5 }")));
        stage.runTo(.1);
        return stage.velocity("B").x - stage.velocity("A").x;
    };
    EXPECT_NEAR(speed(".25"), .25, .02);
    EXPECT_NEAR(speed("1"), 1, .05);
    EXPECT_GT(speed("-1"), 2);
}

/// Beside a body that goes down at 1 m/s.
struct Given : Stage {
    Given()
        : Stage(
              "DEF W RigidBodyCollection { gravity 0 0 0 constantForceMix 0 errorCorrection 0\n"
              "bodies DEF B RigidBody { linearVelocity 0 -1 0 } }") {}
    NodeId contact(const std::vector<NodeId>& bodies) {
        using T = x3d::Contact;
        const NodeId id = scene.createNode(T::type);
        EXPECT_TRUE(scene.set(id, T::contactNormal, Vec3f(0, 1, 0)));
        EXPECT_TRUE(scene.set(id, T::body1, bodies[0]));
        EXPECT_TRUE(scene.set(id, T::body2, bodies[1]));
        return id;
    }
    void give(const Array<NodeId>& contacts) {
        EXPECT_TRUE(
            scene.sendEvent(scene.findName("W"), x3d::RigidBodyCollection::set_contacts.index, Value(contacts)));
        runTo(now + .1);
    }
};

TEST(RigidBodies, StopWhereAGivenContactSaysInTheFirstFrameToo) {
    Given stage;
    const NodeId body = stage.scene.findName("B");
    stage.give({stage.contact({body, NodeId{}})});
    EXPECT_NEAR(stage.velocity("B").y, 0, 1e-5);
}

TEST(RigidBodies, StopWhereAContactSaysThatCameBetweenTwoSteps) {
    Given stage;
    stage.runTo(.1);
    const NodeId body = stage.scene.findName("B");
    const Array<NodeId> contacts{stage.contact({body, NodeId{}})};
    stage.scene.newFrame(.1);  // the nodes are new: what is here is met again
    EXPECT_TRUE(stage.scene.sendEvent(stage.scene.findName("W"), x3d::RigidBodyCollection::set_contacts.index,
                                      Value(contacts)));
    stage.scene.newFrame(.1001);
    stage.scene.newFrame(.15);
    EXPECT_NEAR(stage.velocity("B").y, 0, 1e-5);
}

TEST(RigidBodies, OfContactsWithNobodyOrThemselvesTakeNoNotice) {
    Given stage;
    const NodeId body = stage.scene.findName("B");
    stage.give({stage.contact({body, body}), stage.contact({NodeId{}, NodeId{}})});
    EXPECT_NEAR(stage.velocity("B").y, -1, 1e-6);
    EXPECT_NEAR(stage.position("B").y, -stage.now, 1e-4);
    EXPECT_TRUE(stage.scene.diagnostics().all().empty());
}

TEST(RigidBodies, TurnedByWhatIsNoAngleStayAsTheyWere) {
    Given stage;
    ASSERT_TRUE(stage.scene.set(stage.scene.findName("B"), Body::orientation, Rotation{0, 0, 1, INFINITY}));
    stage.runTo(.5);
    EXPECT_TRUE(stage.says("orientation is no number"));
    EXPECT_TRUE(std::isfinite(stage.node("B").get(Body::orientation).angle));
    EXPECT_NEAR(stage.position("B").y, -.5, 1e-4);
}

TEST(RigidBodies, RestWhenTheirPhysicsGoes) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nDEF W RigidBodyCollection { bodies DEF B RigidBody { } }\n"
                         "CollisionSensor { }",
                         diagnostics));
    const NodeId body = scene.findName("B");
    auto physics = std::make_unique<RigidBodyPhysics>(scene);
    scene.newFrame(0);
    scene.newFrame(1);
    const Vec3f reached = scene.node(body).get(Body::position);
    EXPECT_LT(reached.y, -4);
    physics.reset();
    scene.newFrame(2);
    EXPECT_EQ(scene.node(body).get(Body::position), reached);
    physics = std::make_unique<RigidBodyPhysics>(scene);
    scene.newFrame(3);
    scene.newFrame(4);
    EXPECT_LT(scene.node(body).get(Body::position).y, reached.y - 4);
}

TEST(RigidBodies, HangByOffsetsWhereTheyAreDrawn) {
    Stage stage(
        "RigidBodyCollection { gravity 0 -10 0 bodies DEF B RigidBody { position 1 0 0\n"
        "geometry DEF O CollidableOffset { translation 0 2 0 rotation 0 0 1 1.5707963\n"
        "collidable DEF C CollidableShape { shape Shape { geometry Box { } } } } } }");
    stage.runTo(1);
    const Vec3f inner = stage.node("C").get(x3d::CollidableShape::translation);
    // Below the offset's quarter turn: (x, y) is drawn at (-y, x + 2), and the body is at (1, -5).
    EXPECT_NEAR(-inner.y, 1, 1e-4);
    EXPECT_NEAR(inner.x + 2, -5 + 2, 1e-4);
    EXPECT_EQ(stage.node("O").get(x3d::CollidableOffset::translation), Vec3f(0, 2, 0));
}

TEST(RigidBodies, ThatAreNotEnabledLeaveTheirShapesWhereTheyAre) {
    Stage stage(
        "RigidBodyCollection { bodies [ DEF B RigidBody { enabled FALSE position 0 5 0 geometry DEF C CollidableShape "
        "{ "
        "translation 1 2 3 shape Shape { geometry Sphere { } } } } ] }");
    stage.runTo(1);
    EXPECT_EQ(stage.position("B"), Vec3d(0, 5, 0));
    EXPECT_EQ(stage.node("C").get(x3d::CollidableShape::translation), Vec3f(1, 2, 3));
    ASSERT_TRUE(stage.scene.set(stage.scene.findName("B"), Body::enabled, true));
    stage.runTo(2);
    EXPECT_LT(stage.position("B").y, 1);
    EXPECT_EQ(Vec3d(stage.node("C").get(x3d::CollidableShape::translation)), stage.position("B"));
}

TEST(RigidBodies, PassThroughWallsThinnerThanAStepOfTheirs) {
    for (const double speed : {5.0, 200.0}) {
        Stage stage(fmt::format(
            "RigidBodyCollection {{ gravity 0 0 0 collider CollisionCollection {{ bounce .5 collidables [ {} {} ] }}\n"
            "bodies [ RigidBody {{ fixed TRUE geometry USE W }}\n"
            "DEF B RigidBody {{ position -2 0 0 linearVelocity {} 0 0 geometry USE C }} ] }}",
            collidable("W", "Box { size .1 9 9 }"), collidable("C", "Sphere { radius .05 }"), speed));
        stage.runTo(1);
        EXPECT_EQ(stage.position("B").x > 0, speed > 100) << speed;  // docs/limits.md
    }
}

TEST(RigidBodies, AreToldOfWhatCannotBe) {
    Stage stage(
        "RigidBodyCollection { bodies [ DEF M RigidBody { mass 0 } DEF N RigidBody { mass -1 }\n"
        "DEF I RigidBody { inertia 1 0 0 0 -1 0 0 0 1 } DEF B RigidBody { } ]\n"
        "joints [ BallJoint { } SingleAxisHingeJoint { axis 0 0 0 body1 USE B } ] }");
    stage.runTo(.5);
    EXPECT_EQ(stage.position("M").y, 0);
    EXPECT_LT(stage.position("I").y, -1);
    EXPECT_TRUE(stage.says("mass 0 is none"));
    EXPECT_TRUE(stage.says("positive definite"));
    EXPECT_TRUE(stage.says("holds no body"));
    EXPECT_TRUE(stage.says("axis without a direction"));
    const double y = stage.position("B").y;
    ASSERT_TRUE(stage.scene.sendEvent(stage.scene.findName("B"), Body::position.index, Vec3f(NAN, 0, 0)));
    stage.runTo(.6);
    EXPECT_TRUE(stage.says("position is no number"));
    EXPECT_LT(stage.position("B").y, y);
    // Bodies that go while they move.
    ASSERT_TRUE(stage.scene.destroyNode(stage.scene.findName("B")));
    stage.runTo(1);
    EXPECT_EQ(stage.physics.counts().bodies, 3u);
}

TEST(RigidBodies, OfNumbersThatCannotBeEndNothing) {
    Stage stage(
        "DEF W RigidBodyCollection { collider CollisionCollection { appliedParameters [\"BOUNCE\"\n"
        "\"SLIP-1\" \"CONSTANT_FORCE\"] collidables [ DEF C CollidableShape { shape Shape { geometry\n"
        "Cone { } } } DEF D CollidableShape { shape Shape { geometry Cone { bottomRadius -1 height 0 } }\n"
        "} DEF E CollidableShape { shape Shape { geometry Cylinder { } } } DEF F CollidableShape { shape\n"
        "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 ] coord Coordinate { point [ 0 0 0,\n"
        "1e30 0 0, 0 1 0, 5 5 5 ] } } } } DEF G CollidableShape { shape Shape { geometry ElevationGrid {\n"
        "xDimension 2 zDimension 2 height [ 0 0 0 0 ] xSpacing 10 zSpacing 10 } } } ] }\n"
        " bodies [ RigidBody { geometry USE C position 5 3 5 } RigidBody { geometry USE D mass 1e38 }\n"
        "RigidBody { geometry USE E linearVelocity 1e30 0 0 } RigidBody { geometry USE F forces [ 1e38 0\n"
        "0 ] } RigidBody { fixed TRUE geometry USE G } DEF H RigidBody { position 1e11 0 0\n"
        "linearVelocity 1e11 0 0 } DEF I RigidBody { angularVelocity 1e9 1e10 0 } ]\n"
        " joints [ UniversalJoint { axis1 1 0 0 axis2 1 0 0 } DEF J DoubleAxisHingeJoint { body1 USE H\n"
        "body2 USE I axis1 1e-30 0 0 } MotorJoint { body1 USE H body2 USE I enabledAxes 9 autoCalc TRUE\n"
        "forceOutput \"ALL\" } MotorJoint { body1 USE I enabledAxes 3 axis1Torque 1e30 forceOutput\n"
        "\"ALL\" } DoubleAxisHingeJoint { body1 USE I maxTorque1 1e20 desiredAngularVelocity1 1e20\n"
        "forceOutput \"ALL\" } UniversalJoint { body1 USE H body2 USE I forceOutput \"ALL\" } ] }\n"
        "DEF S CollisionSensor { collider CollisionCollection { collidables [ USE C USE G USE E\n"
        "CollisionSpace { collidables [ USE F USE C ] } ] } }\n");
    stage.runTo(2);
    EXPECT_TRUE(stage.says("two axes that are one"));
    EXPECT_TRUE(stage.says("axis without a direction"));
    EXPECT_TRUE(stage.says("needs two bodies"));
    EXPECT_FALSE(stage.says("bodies rest from now on"));
    EXPECT_TRUE(std::isfinite(stage.position("I").x));
}

TEST(RigidBodies, InOnePlaceEndNothing) {
    std::string bodies, members;
    for (int i = 0; i < 400; ++i) {
        bodies += fmt::format(" RigidBody {{ geometry USE C{} }}", i);
        members += ' ' + collidable(fmt::format("C{}", i), "Box { size 1 1 1 }");
    }
    Stage stage("RigidBodyCollection { preferAccuracy TRUE iterations 2 collider CollisionCollection { collidables [" +
                members + " ] } bodies [" + bodies + " ] }");
    stage.runTo(2 * RigidBodyPhysics::kStep, 120);
    EXPECT_TRUE(stage.says("preferAccuracy is left out"));
    EXPECT_LE(stage.physics.counts().contacts, RigidBodyPhysics::kMaxContacts + 16);
}

}  // namespace
}  // namespace rtsg
