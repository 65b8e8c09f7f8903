// The forces on a hand in scenes: closed forms of force and friction, moving things, events, and bad hands.
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

#include <glm/geometric.hpp>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/haptics/haptic_renderer.h>
#include <rtsg/physics/rigid_body_physics.h>
#include <rtsg/renderers/world_queries.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/sync/replay.h>

namespace rtsg {
namespace {

constexpr double kProxy = 0.005;
const char* const kTable =
    "Transform { translation 0 -.5 0 children Shape { appearance DEF A Appearance { } geometry Box { size 2 1 2 } } "
    "}\n";

/// A scene that is touched by a clock of one's own.
class Touched {
  public:
    explicit Touched(const std::string& text, HapticOptions options = {}) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Immersive\n" + text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        world = std::make_unique<SharedWorld>(scene);
        queries = std::make_unique<WorldQueries>(*world);
        scene.setSpaceQueries(queries.get());
        options.radius = kProxy;
        renderer = std::make_unique<HapticRenderer>(*world, options);
        scene.newFrame(0);
        EXPECT_TRUE(renderer->attachToScene(scene));
        EXPECT_TRUE(renderer->renderFrame());
        EXPECT_TRUE(world->present());
    }
    ~Touched() {
        renderer.reset();
        scene.setSpaceQueries(nullptr);
    }
    /// One millisecond on; a frame of the scene each 16.
    HapticTick tick(const Vec3d& hand) {
        if (++ticks % 16 == 0) frame();
        return last = renderer->touch(hand, 1e-3 * ticks);
    }
    void frame() {
        renderer->sendEvents();
        scene.newFrame(1e-3 * ticks);
        EXPECT_TRUE(world->present());
    }
    /// Along a straight line, `steps` ticks.
    HapticTick go(const Vec3d& from, const Vec3d& to, int steps) {
        for (int i = 1; i <= steps; ++i) tick(from + static_cast<double>(i) / steps * (to - from));
        return last;
    }
    const Node& named(const char* name) { return scene.node(scene.findName(name)); }

    Scene scene;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<WorldQueries> queries;
    std::unique_ptr<HapticRenderer> renderer;
    HapticTick last;
    int ticks = 0;
};

void expectWithin(const Vec3d& got, const Vec3d& wanted, double most) {
    EXPECT_LT(glm::length(got - wanted), most)
        << got.x << ' ' << got.y << ' ' << got.z << " for " << wanted.x << ' ' << wanted.y << ' ' << wanted.z;
}

std::string withSurface(const std::string& entries) {
    return "Transform { translation 0 -.5 0 children Shape { appearance Appearance { metadata MetadataSet { name "
           "\"RTSG\" value [" +
           entries + "] } } geometry Box { size 2 1 2 } } }\n";
}
std::string entry(const std::string& name, double value) {
    return " MetadataFloat { name \"" + name + "\" value " + std::to_string(value) + " }";
}

TEST(HapticRenderer, APlaneIsASpring) {
    Touched table(kTable);
    EXPECT_FALSE(table.go({.1, .1, .2}, {.1, .01, .2}, 100).touching);
    const HapticTick in = table.go({.1, .01, .2}, {.1, .001, .2}, 50);
    EXPECT_TRUE(in.touching);
    expectWithin(in.proxy, {.1, kProxy, .2}, 1e-6);
    expectWithin(in.force, {0, 500 * .004, 0}, 1e-3);
    expectWithin(in.normal, {0, 1, 0}, 1e-9);
    // Another surface, as the scene says.
    Touched soft(withSurface(entry("stiffness", 120)));
    expectWithin(soft.go({0, .1, 0}, {0, 0, 0}, 200).force, {0, 120 * kProxy, 0}, 1e-3);
}

TEST(HapticRenderer, ForcesAreBounded) {
    Touched table(kTable);
    table.go({0, .1, 0}, {0, -.3, 0}, 400);
    EXPECT_NEAR(glm::length(table.last.force), HapticOptions().maxForce, 1e-9);
    expectWithin(table.last.proxy, {0, kProxy, 0}, 1e-6);
}

TEST(HapticRenderer, AThinWallHoldsAtAnySpeed) {
    Touched wall(
        "Shape { geometry IndexedFaceSet { solid FALSE coord Coordinate { point [-1 -1 0, 1 -1 0, 1 1 0, -1 1 0] } "
        "coordIndex [0 1 2 3 -1] } }");
    wall.tick({0, 0, .05});
    const HapticTick through = wall.tick({.01, 0, -.04});  // 90 m/s
    EXPECT_TRUE(through.touching);
    EXPECT_GT(through.proxy.z, 0);
    EXPECT_NEAR(through.proxy.z, kProxy, 1e-6);
}

TEST(HapticRenderer, FrictionIsACone) {
    // At 4 mm depth with a coefficient of .5 the proxy sticks until the hand is 2 mm aside, and then lags by .3 * 4.
    Touched rough(withSurface(entry("staticFriction", .5) + entry("dynamicFriction", .3)));
    rough.go({0, .01, 0}, {0, .001, 0}, 60);
    rough.go({0, .001, 0}, {.0019, .001, 0}, 40);
    expectWithin(rough.last.proxy, {0, kProxy, 0}, 2e-5);
    EXPECT_NEAR(rough.last.force.x, -500 * .0019, 2e-2);
    rough.go({.0019, .001, 0}, {.05, .001, 0}, 300);
    expectWithin(rough.last.proxy, {.05 - .3 * .004, kProxy, 0}, 2e-5);
    EXPECT_NEAR(-rough.last.force.x / rough.last.force.y, .3, 5e-3) << "Coulomb's law";
    // Back a little: it sticks again.
    const Vec3d stood = rough.last.proxy;
    rough.go({.05, .001, 0}, {.0495, .001, 0}, 20);
    expectWithin(rough.last.proxy, stood, 1e-6);
    Touched smooth(kTable);
    smooth.go({0, .01, 0}, {0, .001, 0}, 60);
    EXPECT_NEAR(smooth.go({0, .001, 0}, {.05, .001, 0}, 300).force.x, 0, 1e-6);
}

TEST(HapticRenderer, ADamperWorksAgainstMotionAndNeverPulls) {
    Touched damped(withSurface(entry("stiffness", 100) + entry("damping", 2)));
    damped.go({0, .1, 0}, {0, .002, 0}, 980);  // .1 m/s
    EXPECT_NEAR(damped.last.force.y, 100 * .003 + 2 * .1, 5e-3);
    for (int i = 1; i < 40; ++i) EXPECT_GE(damped.tick({0, .002 + 1e-4 * i, 0}).force.y, 0);
}

TEST(HapticRenderer, AWallThatMovesPushesAndCarriesTheProxy) {
    // A wall at 1 m/s comes from the left; the hand stands still.
    Touched wall(
        "DEF C TimeSensor { loop TRUE cycleInterval 4 }\n"
        "DEF P PositionInterpolator { key [0 1] keyValue [-1 0 0, 3 0 0] }\n"
        "DEF W Transform { children Shape { geometry Box { size .2 2 2 } } }\n"
        "ROUTE C.fraction_changed TO P.set_fraction\nROUTE P.value_changed TO W.set_translation\n");
    const Vec3d hand(0, 0, 0);
    double worst = 0;
    for (int i = 0; i < 1000; ++i) {
        const HapticTick t = wall.tick(hand);
        const double face = 1e-3 * wall.ticks - 1 + .1;
        if (face + kProxy > .002 && face < .04) {
            ASSERT_TRUE(t.touching) << i;
            // Between two frames the wall is taken to go on; the state is up to a frame old.
            worst = std::max(worst, std::abs(t.proxy.x - (face + kProxy)));
            EXPECT_GE(t.force.x, 0) << i;
        }
    }
    EXPECT_LT(worst, .018) << "a frame of 16 ms and a tick";
    EXPECT_NEAR(wall.last.velocity.x, 1, .2);
    EXPECT_GT(wall.last.proxy.x, .05) << "it was pushed all the way";
}

TEST(HapticRenderer, AMeshThatDeformsPushesToo) {
    Touched sheet(
        "DEF C TimeSensor { loop TRUE cycleInterval 2 }\n"
        "DEF I CoordinateInterpolator { key [0 1] keyValue [-.3 -.2 -.3, -.3 -.2 .3, .3 -.2 .3, .3 -.2 -.3, "
        "-.3 .2 -.3, -.3 .2 .3, .3 .2 .3, .3 .2 -.3] }\n"
        "Shape { geometry IndexedFaceSet { coord DEF P Coordinate { point [-.3 -.2 -.3, -.3 -.2 .3, .3 -.2 .3, .3 -.2 "
        "-.3] } "
        "coordIndex [0 1 2 3 -1] } }\n"
        "ROUTE C.fraction_changed TO I.set_fraction\nROUTE I.value_changed TO P.set_point\n");
    for (int i = 0; i < 1100; ++i) sheet.tick({0, 0, 0});  // it rises at .2 m/s and is at .02 then
    EXPECT_TRUE(sheet.last.touching);
    EXPECT_NEAR(sheet.last.proxy.y, .02 + kProxy, .2 * .017 + 1e-4);
    EXPECT_GT(sheet.last.force.y, 0);
}

TEST(HapticRenderer, WhatComesOverTheHandPushesItOutWithBoundedForce) {
    Touched scene("DEF T Transform { translation 5 0 0 children Shape { geometry Box { size .4 .2 .4 } } }");
    for (int i = 0; i < 20; ++i) EXPECT_FALSE(scene.tick({0, .08, 0}).touching);
    ASSERT_TRUE(scene.scene.set(scene.scene.findName("T"), x3d::Transform::translation, Vec3f(0, 0, 0)));
    scene.frame();
    const HapticTick out = scene.tick({0, .08, 0});
    EXPECT_TRUE(out.touching);
    expectWithin(out.proxy, {0, .1 + kProxy, 0}, 1e-5);
    EXPECT_LE(glm::length(out.force), HapticOptions().maxForce + 1e-9);
    EXPECT_GT(out.force.y, 0);
    // So does a scene that begins with the hand in a thing.
    Touched begun(kTable);
    expectWithin(begun.tick({0, -.02, 0}).proxy, {0, kProxy, 0}, 1e-5);
}

TEST(HapticRenderer, PosesThatCannotBeGiveNoForceAndItGoesOn) {
    Touched table(kTable);
    table.go({0, .01, 0}, {0, .001, 0}, 60);
    ASSERT_TRUE(table.last.touching);
    for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e300}) {
        const HapticTick lost = table.tick({0, bad, 0});
        EXPECT_FALSE(lost.known);
        EXPECT_EQ(lost.force, Vec3d(0));
        EXPECT_TRUE(table.go({0, .01, 0}, {0, .001, 0}, 60).touching);
    }
    EXPECT_FALSE(table.tick({0, .5, 0}).known) << "half a metre in a tick";
    EXPECT_EQ(table.renderer->report().unknown, 4u);
}

/// A mass on a spring-less wall, thrown at it: what it has afterwards beside what it had.
double reboundShare(double stiffness, double speed, double mass) {
    HapticOptions options;
    options.surface.stiffness = stiffness;
    options.maxForce = 1e4;
    Touched wall(kTable, options);
    double at = .02, velocity = -speed;
    for (int i = 0; i < 2000 && (velocity < 0 || at < .02); ++i) {
        const double force = wall.tick({0, at, 0}).force.y;
        for (int k = 0; k < 10; ++k) velocity += 1e-4 * force / mass, at += 1e-4 * velocity;
    }
    return velocity * velocity / (speed * speed);
}

TEST(HapticRenderer, AStillSceneGivesNoEnergy) {
    for (const double stiffness : {100., 500., 2000., 8000.})
        for (const double speed : {.02, .1, .4}) {
            const double share = reboundShare(stiffness, speed, .1);
            EXPECT_LT(share, 1.001) << stiffness << " N/m, " << speed << " m/s";
            EXPECT_GT(share, .5) << stiffness << " N/m, " << speed << " m/s: and takes not much";
        }
}

TEST(HapticRenderer, ATouchSensorAnswersToTheHand) {
    Touched bell(
        "DEF G Group { children [ DEF S TouchSensor { } Transform { translation 0 -.5 0 children Shape { geometry Box "
        "{ size 2 1 2 } } } ] }");
    std::vector<std::string> heard;
    const Node& sensor = bell.named("S");
    using T = x3d::TouchSensor;
    bell.go({0, .02, 0}, {0, .02, 0}, 32);
    EXPECT_FALSE(sensor.get(T::isOver));
    bell.go({0, .02, 0}, {.1, .001, .2}, 100);
    EXPECT_TRUE(sensor.get(T::isOver));
    EXPECT_TRUE(sensor.get(T::isActive)) << "2 N press";
    EXPECT_NEAR(sensor.get(T::hitPoint_changed).y, 0, 1e-4);
    bell.go({.1, .001, .2}, {.1, .02, .2}, 64);
    EXPECT_FALSE(sensor.get(T::isActive));
    EXPECT_FALSE(sensor.get(T::isOver));
    EXPECT_GT(sensor.get(T::touchTime).seconds, 0) << "let go over it";
}

TEST(HapticRenderer, AShortTapBetweenTwoFramesIsHeard) {
    Touched bell(
        "DEF S TouchSensor { } Transform { translation 0 -.5 0 children Shape { geometry Box { size 2 1 2 } } }");
    while (bell.ticks % 16 != 2) bell.tick({0, .03, 0});
    bell.go({0, .03, 0}, {0, .001, 0}, 4);
    bell.go({0, .001, 0}, {0, .03, 0}, 4);
    bell.go({0, .03, 0}, {0, .03, 0}, 64);
    EXPECT_GT(bell.named("S").get(x3d::TouchSensor::touchTime).seconds, 0);
}

TEST(HapticRenderer, TheForceIsAFieldOfTheScene) {
    Touched scene(withSurface(" DEF F MetadataFloat { name \"force\" value [0 0 0] }"));
    scene.go({0, .02, 0}, {0, .001, 0}, 100);
    scene.go({0, .001, 0}, {0, .001, 0}, 32);
    const auto felt = scene.named("F").get(x3d::MetadataFloat::value);
    ASSERT_EQ(felt.size(), 3u);
    EXPECT_NEAR(felt[1], 2, 1e-2);
    scene.go({0, .001, 0}, {0, .03, 0}, 64);
    EXPECT_EQ(scene.named("F").get(x3d::MetadataFloat::value)[1], 0);
}

TEST(HapticRenderer, ABodyIsPushedWithWhatPushesTheHand) {
    if (!RigidBodyPhysics::isAvailable()) GTEST_SKIP() << "no physics engine";
    Touched scene(
        "DEF K CollidableShape { shape DEF H Shape { geometry Box { size .2 .2 .2 } } }\n"
        "RigidBodyCollection { gravity 0 0 0 bodies DEF B RigidBody { mass 2 linearDampingFactor 0 geometry USE K } }\n"
        "CollisionCollection { collidables USE K }\n");
    RigidBodyPhysics physics(scene.scene);
    scene.go({-.2, 0, 0}, {-.11, 0, 0}, 64);
    using Body = x3d::RigidBody;
    EXPECT_TRUE(scene.named("B").get(Body::forces).empty());
    // Held 5 mm in for .1 s: 2.5 N, which a mass of 2 kg that goes away feels less and less.
    const HapticTick in = scene.go({-.1, 0, 0}, {-.1, 0, 0}, 16);
    ASSERT_TRUE(in.touching);
    EXPECT_LE(in.force.x, 0) << "nothing draws a hand in";
    scene.frame();
    const auto forces = scene.named("B").get(Body::forces);
    ASSERT_EQ(forces.size(), 1u);
    EXPECT_NEAR(forces[0].x, -scene.last.force.x, 1e-3);
    for (int i = 0; i < 100; ++i) scene.tick({-.1, 0, 0});
    EXPECT_GT(scene.named("B").get(Body::linearVelocity).x, .01);
    scene.go({-.1, 0, 0}, {-.3, 0, 0}, 64);
    EXPECT_TRUE(scene.named("B").get(Body::forces).empty()) << "let go";
}

TEST(HapticRenderer, AReplicaOfTheSessionNeedsNoDevice) {
    const std::filesystem::path log =
        std::filesystem::temp_directory_path() / ("touched-" + std::to_string(::getpid()) + ".rlog");
    std::string hash;
    {
        Touched bell(
            "DEF S TouchSensor { } Transform { translation 0 -.5 0 children Shape { geometry Box { size 2 1 2 } } }");
        auto recorder = LogRecorder::start(bell.scene, log.string());
        ASSERT_TRUE(recorder) << recorder.error().format();
        bell.go({0, .02, 0}, {.1, .001, .2}, 100);
        bell.go({.1, .001, .2}, {.1, .02, .2}, 64);
        bell.scene.seal();
        ASSERT_TRUE((*recorder)->stop());
        hash = bell.scene.hash().hex();
        EXPECT_GT(bell.named("S").get(x3d::TouchSensor::touchTime).seconds, 0);
    }
    auto player = Replayer::open(log);
    ASSERT_TRUE(player) << player.error().format();
    for (auto more = (*player)->step(); more && *more;) more = (*player)->step();
    EXPECT_EQ((*player)->scene().hash().hex(), hash);
    std::filesystem::remove(log);
}

TEST(HapticRenderer, AHandThatRestsSendsNothing) {
    Touched scene(withSurface(" DEF F MetadataFloat { name \"force\" value [0 0 0] }"));
    scene.go({0, .02, 0}, {0, .001, 0}, 100);
    for (int i = 0; i < 64; ++i) scene.tick({0, .001, 0});
    ASSERT_TRUE(scene.last.touching);
    scene.renderer->sendEvents();
    EXPECT_TRUE(scene.scene.newFrame(10)->changes.empty()) << "nothing has changed";
}

TEST(HapticRenderer, SurfacesThatCannotBeAreSaid) {
    Touched scene(withSurface(entry("stiffness", -3)));
    ASSERT_EQ(scene.renderer->report().diagnostics.all().size(), 1u);
    EXPECT_NE(scene.renderer->report().diagnostics.all()[0].format().find("stiffness"), std::string::npos);
    EXPECT_NEAR(scene.go({0, .02, 0}, {0, .003, 0}, 100).force.y, 500 * .002, 1e-3) << "as if it said nothing";
}

TEST(HapticRenderer, SurfacesFollowEdits) {
    Touched scene(withSurface(" DEF F MetadataFloat { name \"stiffness\" value 200 }"));
    EXPECT_NEAR(scene.go({0, .02, 0}, {0, .003, 0}, 100).force.y, 200 * .002, 1e-3);
    ASSERT_TRUE(scene.scene.set(scene.scene.findName("F"), x3d::MetadataFloat::value, Array<float>{800.f}));
    scene.frame();
    EXPECT_NEAR(scene.tick({0, .003, 0}).force.y, 800 * .002, 1e-3);
}

TEST(HapticRenderer, AThreadTicksWhileTheSceneRuns) {
    Touched table(kTable);
    SimulatedHand hand;
    hand.path = {{0, {0, .02, 0}}, {.1, {0, .002, 0}}, {.25, {0, .002, 0}}};
    ASSERT_TRUE(table.renderer->start(simulatedDevice(hand)));
    EXPECT_FALSE(table.renderer->start(simulatedDevice(hand))) << "one device";
    for (int i = 0; i < 3000 && !table.renderer->hasEnded(); ++i) {
        table.scene.newFrame(1 + .001 * i);
        table.renderer->sendEvents();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    const HapticReport report = table.renderer->stop();
    EXPECT_TRUE(table.renderer->hasEnded());
    EXPECT_EQ(report.failure, "");
    EXPECT_GT(report.ticks, 20u);
    EXPECT_GE(report.contacts, 1u);
    EXPECT_NEAR(report.largestForce, 500 * .003, .05);
}

}  // namespace
}  // namespace rtsg
