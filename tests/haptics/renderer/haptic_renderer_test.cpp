// The forces on a hand in scenes: closed forms of force and friction, moving things, events, and bad hands.
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <random>
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

void expectWithin(const Vec3d& got, const Vec3d& wanted, double maximum) {
    EXPECT_LT(glm::length(got - wanted), maximum)
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

/// Its facets are up to 6 degrees wide, and the force turns with the hand all the same; a box keeps its edges.
TEST(HapticRenderer, ASphereOfFacetsIsFeltAsASphere) {
    for (const std::string geometry : {"Sphere { radius .1 }", "Sphere { radius 1 }"}) {
        const double radius = geometry.contains(".1") ? .1 : 1;
        Touched ball((radius == 1 ? "Transform { scale .1 .1 .1 children " : "Group { children ") +
                     ("Shape { geometry " + geometry + " } }"));
        Vec3d before(0);
        for (int i = 0; i <= 2000; ++i) {
            const double angle = .3 + i * 5e-4, up = .2 + i * 3e-4;
            const Vec3d out(std::cos(angle) * std::cos(up), std::sin(up), std::sin(angle) * std::cos(up));
            const Vec3d force = ball.tick((i == 0 ? .12 : .097) * out).force;
            if (i < 10) continue;
            const double outwards = glm::dot(force, out);
            EXPECT_GT(outwards, 2.5);
            EXPECT_LT(glm::length(force - outwards * out), .02 * outwards) << "beside the normal, step " << i;
            if (i > 10) {
                EXPECT_LT(glm::length(force - before), .06) << "in a step of .05 mm, " << i;
            }
            before = force;
        }
    }
    Touched box("Shape { geometry Box { size 1 1 1 } }");
    for (int degrees = 10; degrees <= 80; degrees += 10) {
        const double angle = degrees * 3.14159265358979 / 180;
        const Vec3d out(std::sin(angle), std::cos(angle), 0);
        box.go(Vec3d(.5, .5, 0) + .02 * out, Vec3d(.5, .5, 0) - .001 * out, 50);
        expectWithin(glm::normalize(box.last.force), out, 1e-3);
        box.go(Vec3d(.5, .5, 0) - .001 * out, Vec3d(.5, .5, 0) + .02 * out, 50);
    }
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
    EXPECT_NEAR(rough.last.force.x, -500 * .0019, 3e-2) << "it moves by .05 mm a tick";
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
    EXPECT_EQ(table.renderer->report().unknown, 3u);
}

/// However far it goes in a tick, the ball is swept along and does not pass.
TEST(HapticRenderer, AHandThatJumpsThroughAThingIsHeldBeforeIt) {
    Touched plate("Shape { geometry Box { size 1 .01 1 } }");
    for (const double depth : {.1, 3., 1000.}) {
        plate.go({0, .1, 0}, {0, .1, 0}, 30);
        const HapticTick through = plate.tick({0, -depth, 0});
        EXPECT_TRUE(through.known);
        expectWithin(through.proxy, {0, .005 + kProxy, 0}, 1e-6);
        expectWithin(through.force, {0, HapticOptions().maxForce, 0}, 1e-6);
        EXPECT_TRUE(plate.go({0, -depth, 0}, {0, -depth, 0}, 50).touching) << "and stays there";
    }
    // Past it, a hand is where it says.
    plate.go({0, .1, 0}, {0, .1, 0}, 30);
    expectWithin(plate.tick({2, .1, 0}).proxy, {2, .1, 0}, 1e-9);
    expectWithin(plate.tick({2, -40, 0}).proxy, {2, -40, 0}, 1e-9);
    // .3 m/s with 500 m for a metre.
    Touched slab("Shape { geometry Box { size 400 10 400 } }");
    EXPECT_TRUE(slab.go({0, 20, 0}, {0, -4.9, 0}, 166).touching);
    EXPECT_NEAR(slab.last.proxy.y, 5 + kProxy, 1e-5);
}

/// Hands that begin inside, rest, and move by next to nothing.
TEST(HapticRenderer, ForcesAreNumbersWhateverTheHandIs) {
    Touched table(kTable);
    const double tiny[] = {0, 5e-324, 1e-310, -1e-310, 1e-200, 1e-20, -1e-13, .005, -.02, .08, 1e7, 1e300};
    const unsigned seed = 91;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto any = [&] { return tiny[random() % std::size(tiny)]; };
    for (const Vec3d& hand : {Vec3d(1e7, 1e7, 0), Vec3d(0, .08, 0), Vec3d(1e-310, 0, 1e-310), Vec3d(0, 5e-324, 1e-310)})
        EXPECT_TRUE(std::isfinite(glm::length(table.tick(hand).force)));
    for (int i = 0; i < 3000; ++i) {
        const HapticTick tick = table.tick({any(), any(), any()});
        ASSERT_LE(glm::length(tick.force), HapticOptions().maxForce + 1e-9) << i;
        ASSERT_TRUE(!tick.known || glm::length(tick.proxy) < 1e12) << i;
    }
}

/// A mass on a spring-less wall, thrown at it: what it has afterwards beside what it had.
double reboundFraction(double stiffness, double speed, double mass) {
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
            const double fraction = reboundFraction(stiffness, speed, .1);
            EXPECT_LT(fraction, 1.001) << stiffness << " N/m, " << speed << " m/s";
            EXPECT_GT(fraction, .5) << stiffness << " N/m, " << speed << " m/s: and takes not much";
        }
}

std::string wall(const std::string& placed) {
    return "Transform { " + placed + " children Shape { geometry Box { size .1 1 1 } } }\n";
}
const std::string kFloor = wall("rotation 0 0 1 1.570796326794897 translation 0 -.05 0");
const std::string kLeft = wall("translation -.05 0 0");
const std::string kBack = wall("rotation 0 1 0 1.570796326794897 translation 0 0 -.05");

/// A mass that an arm holds.
class Hand {
  public:
    Hand(Touched& touched, double mass, const Vec3d& at) : touched_(touched), mass_(mass), at_(at) {}
    /// A tick in which the arm draws it to a place; the force that it then feels.
    Vec3d tick(const Vec3d& target) {
        const Vec3d force = touched_.tick(at_).force;
        for (int k = 0; k < 20; ++k) {
            velocity_ += 5e-5 / mass_ * (200. * (target - at_) - 2. * velocity_ + force);
            at_ += 5e-5 * velocity_;
        }
        return force;
    }
    double speed() const { return glm::length(velocity_); }

  private:
    Touched& touched_;
    const double mass_;
    Vec3d at_, velocity_{0};
};

/// Without friction, and as stiff as one wall may be.
TEST(HapticRenderer, AHandRestsInGroovesAndCorners) {
    const std::string wedge = wall("rotation 0 0 1 .1745 translation -.05 0 0") +
                              wall("rotation 0 0 1 -.1745 translation .05 0 0");  // of 20 degrees
    for (const std::string& scene : {kFloor, kFloor + kLeft, kFloor + kLeft + kBack, wedge})
        for (const double stiffness : {1000., 3900., 5000., 20'000., 50'000.})
            for (const double mass : {.05, .1}) {
                if (stiffness * 1e-6 > .5 * mass) continue;  // beyond, nothing that is held for a tick can be stable
                HapticOptions options;
                options.surface.stiffness = stiffness;
                Touched touched(scene, options);
                const bool isWedge = scene == wedge;
                const Vec3d from = isWedge ? Vec3d(0, .35, .03) : Vec3d(.03),
                            to = isWedge ? Vec3d(.002, 0, .02) : Vec3d(-.01, -.005, -.008);
                Hand hand(touched, mass, from);
                for (int i = 0; i < 200; ++i) hand.tick(from + i / 200. * (to - from));
                for (int i = 0; i < 1000; ++i) hand.tick(to);
                double speed = 0, along = 0;
                for (int i = 0; i < 200; ++i) {
                    const Vec3d force = hand.tick(to);
                    speed = std::max(speed, hand.speed());
                    if (scene != kFloor + kLeft + kBack) along = std::max(along, std::abs(force.z));
                }
                EXPECT_LT(speed, 1e-3) << stiffness << " N/m, " << mass << " kg in\n" << scene;
                EXPECT_LT(along, 1e-3) << "nothing holds it along z";
                EXPECT_TRUE(touched.last.touching);
            }
}

/// Its walls come and go by 2 cm at up to .13 m/s: what rests in it goes along, and gets no faster.
TEST(HapticRenderer, AHandRestsInAGrooveThatMoves) {
    HapticOptions options;
    options.surface.stiffness = 5000;
    Touched touched(
        "DEF C TimeSensor { loop TRUE cycleInterval 1 }\n"
        "DEF P PositionInterpolator { key [0 .25 .5 .75 1] keyValue [0 0 0, .01 .01 0, .02 0 0, .01 -.01 0, 0 0 0] }\n"
        "DEF W Transform { children [ " +
            kFloor + kLeft +
            " ] }\n"
            "ROUTE C.fraction_changed TO P.set_fraction\nROUTE P.value_changed TO W.set_translation\n",
        options);
    Hand hand(touched, .1, Vec3d(.04));
    const Vec3d to(-.01, -.01, .04);
    for (int i = 0; i < 3000; ++i) {
        const Vec3d force = hand.tick(to);
        EXPECT_LT(std::abs(force.z), 1e-3) << i;
        if (i > 500) {
            ASSERT_LT(hand.speed(), .3) << i;
        }
    }
}

/// The ball does not fit any more: it stays until it is in a solid, and then comes out of it.
TEST(HapticRenderer, WallsThatCloseOnTheHandPushItOut) {
    for (const double speed : {.2, 1.}) {
        Touched walls(
            "DEF C TimeSensor { loop TRUE cycleInterval 10 }\n"
            "DEF P PositionInterpolator { key [0 1] keyValue [-.2 0 0, " +
            std::to_string(10 * speed - .2) +
            " 0 0] }\n"
            "DEF Q PositionInterpolator { key [0 1] keyValue [.2 0 0, " +
            std::to_string(.2 - 10 * speed) +
            " 0 0] }\n"
            "DEF A Transform { children Shape { geometry Box { size .2 .3 .3 } } }\n"
            "DEF B Transform { children Shape { geometry Box { size .2 .3 .3 } } }\n"
            "ROUTE C.fraction_changed TO P.set_fraction\nROUTE P.value_changed TO A.set_translation\n"
            "ROUTE C.fraction_changed TO Q.set_fraction\nROUTE Q.value_changed TO B.set_translation\n");
        const Vec3d hand(.01, .02, 0);
        // From when they touch each other until their far sides are at the hand, it lies in one of them.
        const double meet = .1 / speed, over = .19 / speed;
        for (int i = 0; walls.ticks < 1e3 * over; ++i) {
            const HapticTick tick = walls.tick(hand);
            const double seconds = 1e-3 * walls.ticks;
            if (seconds < meet - .005 / speed || seconds > over - .04) continue;
            ASSERT_GT(glm::length(tick.force), .5) << seconds << " s at " << speed << " m/s";
            ASSERT_LE(glm::length(tick.force), HapticOptions().maxForce + 1e-9);
        }
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
    EXPECT_GE(report.largestForce, 500 * .003 - .05);  // the spring's, and while the hand comes its damper's
    EXPECT_LE(report.largestForce, 500 * .003 + .15);
}

}  // namespace
}  // namespace rtsg
