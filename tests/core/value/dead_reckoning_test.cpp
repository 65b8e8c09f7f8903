// Dead reckoning against what the equations of motion give by small steps in long double, and frames of exercises.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include <rtsg/core/dis_pdu.h>
#include <rtsg/core/geo_system.h>

namespace rtsg::dis {

namespace {

constexpr double kPi = std::numbers::pi;

struct LongVector {
    long double x = 0, y = 0, z = 0;
    LongVector operator+(const LongVector& b) const { return {x + b.x, y + b.y, z + b.z}; }
    LongVector operator*(long double s) const { return {x * s, y * s, z * s}; }
};
LongVector crossOf(const LongVector& a, const LongVector& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
LongVector longOf(const glm::dvec3& v) {
    return {v.x, v.y, v.z};
}

/// The body's axes in the world and where it is.
struct Motion {
    LongVector axes[3], position;
};

/// By Runge and Kutta's method of the fourth order: axes turn with the rate, which is given in them; the velocity is in
/// the body or in the world, and changes at a steady rate there.
Motion integrate(const EntityState& s, bool isBody, bool rotates, bool accelerates, double seconds) {
    const auto derivative = [&](const Motion& m, long double t) {
        Motion d;
        const LongVector v = longOf(s.velocity) + longOf(s.acceleration) * (accelerates ? t : 0.L);
        d.position = isBody ? m.axes[0] * v.x + m.axes[1] * v.y + m.axes[2] * v.z : v;
        const LongVector w = rotates ? longOf(s.angularVelocity) : LongVector{};
        const LongVector rate = m.axes[0] * w.x + m.axes[1] * w.y + m.axes[2] * w.z;
        for (int i = 0; i < 3; ++i) d.axes[i] = crossOf(rate, m.axes[i]);
        return d;
    };
    const auto moved = [](const Motion& m, const Motion& d, long double h) {
        Motion r;
        for (int i = 0; i < 3; ++i) r.axes[i] = m.axes[i] + d.axes[i] * h;
        r.position = m.position + d.position * h;
        return r;
    };
    Motion m;
    // 1278.1: first psi about z, then theta about y, then phi about x.
    const long double a = s.orientation.psi, b = s.orientation.theta, c = s.orientation.phi;
    const long double ca = std::cos(a), sa = std::sin(a), cb = std::cos(b), sb = std::sin(b), cc = std::cos(c),
                      sc = std::sin(c);
    m.axes[0] = {ca * cb, sa * cb, -sb};
    m.axes[1] = {ca * sb * sc - sa * cc, sa * sb * sc + ca * cc, cb * sc};
    m.axes[2] = {ca * sb * cc + sa * sc, sa * sb * cc - ca * sc, cb * cc};
    m.position = longOf(s.location);
    const int steps = 500 + static_cast<int>(800 * glm::length(glm::dvec3(s.angularVelocity)) * seconds);
    const long double h = static_cast<long double>(seconds) / steps;
    for (int k = 0; k < steps; ++k) {
        const long double t = k * h;
        const Motion k1 = derivative(m, t), k2 = derivative(moved(m, k1, h / 2), t + h / 2),
                     k3 = derivative(moved(m, k2, h / 2), t + h / 2), k4 = derivative(moved(m, k3, h), t + h);
        m = moved(moved(moved(moved(m, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6);
    }
    return m;
}

EntityState flight(std::uint8_t model, float rate) {
    EntityState s;
    s.deadReckoning = model;
    s.location = {1000, -2000, 300};
    s.orientation = {.7f, -.4f, 2.1f};
    s.velocity = {30, -4, 2};
    s.acceleration = {1.5f, .25f, -3};
    s.angularVelocity = {.5f * rate, -.7f * rate, .2f * rate};
    return s;
}

double distance(const LongVector& a, const glm::dvec3& b) {
    return static_cast<double>(std::hypot(a.x - b.x, a.y - b.y, a.z - b.z));
}

}  // namespace

TEST(DeadReckoning, EveryModelFollowsItsEquations) {
    struct Model {
        std::uint8_t number;
        bool isBody, rotates, accelerates;
    };
    for (const Model& m : {Model{2, false, false, false},
                           {3, false, true, false},
                           {4, false, true, true},
                           {5, false, false, true},
                           {6, true, false, false},
                           {7, true, true, false},
                           {8, true, true, true},
                           {9, true, false, true}})
        for (const float rate : {1e-6f, .01f, .3f, 1.f, 4.f})
            for (const double seconds : {.02, 1., 9.}) {
                const EntityState state = flight(m.number, rate);
                const Motion expected = integrate(state, m.isBody, m.rotates, m.accelerates, seconds);
                const EntityPose pose = deadReckon(state, seconds);
                SCOPED_TRACE(::testing::Message() << int(m.number) << " at " << rate << " after " << seconds);
                EXPECT_LT(distance(expected.position, pose.location), 2e-9);
                const glm::dmat3 axes = glm::mat3_cast(pose.worldFromBody);
                for (int i = 0; i < 3; ++i) EXPECT_LT(distance(expected.axes[i], axes[i]), 1e-9);
                EXPECT_TRUE(isMoving(state));
            }
}

TEST(DeadReckoning, WhatStandsStands) {
    for (const std::uint8_t model : {0, 1, 10, 255}) {
        const EntityState state = flight(model, 1);
        EXPECT_EQ(deadReckon(state, 5).location, state.location);
        EXPECT_EQ(deadReckon(state, 5).worldFromBody, orientationOf(state.orientation));
        EXPECT_FALSE(isMoving(state));
    }
    EntityState still;
    still.acceleration = {1, 0, 0};
    for (const std::uint8_t model : {2, 3, 6, 7}) {
        still.deadReckoning = model;
        EXPECT_FALSE(isMoving(still)) << int(model);  // these do not accelerate
    }
}

TEST(DeadReckoning, CirclesAreCircles) {
    EntityState s;
    s.deadReckoning = 7;
    s.velocity = {10, 0, 0};
    s.angularVelocity = {0, 0, .5f};  // to the right: z is down; a circle of 20 m
    const EntityPose half = deadReckon(s, kPi / .5);
    EXPECT_NEAR(glm::length(half.location - glm::dvec3(0, 40, 0)), 0, 1e-12);
    EXPECT_NEAR(glm::length(deadReckon(s, 2 * kPi / .5).location), 0, 1e-12);
    EXPECT_NEAR(anglesOf(deadReckon(s, kPi / 2 / .5).worldFromBody).psi, kPi / 2, 1e-6);
}

TEST(DeadReckoning, ClosedFormsAndSeriesMeet) {
    // Just below and just above the angle where one takes over from the other.
    const EntityState s = flight(8, 1);
    const double rate = glm::length(glm::dvec3(s.angularVelocity)), t = .25 / rate;
    const glm::dvec3 below = deadReckon(s, t * (1 - 1e-12)).location, above = deadReckon(s, t * (1 + 1e-12)).location;
    EXPECT_LT(glm::length(above - below), 1e-10);
}

TEST(DeadReckoning, AnglesGoBothWays) {
    for (float psi = -3; psi <= 3; psi += .5f)
        for (float theta = -1.5f; theta <= 1.5f; theta += .25f)
            for (float phi = -3; phi <= 3; phi += .75f) {
                const EulerAngles angles = anglesOf(orientationOf({psi, theta, phi}));
                EXPECT_NEAR(angles.psi, psi, 2e-6) << theta << ' ' << phi;
                EXPECT_NEAR(angles.theta, theta, 2e-6);
                EXPECT_NEAR(angles.phi, phi, 2e-6);
            }
    const auto up = orientationOf({.5f, static_cast<float>(kPi / 2), .25f});
    const auto again = orientationOf(anglesOf(up));
    EXPECT_NEAR(std::abs(glm::dot(up, again)), 1, 1e-7);
}

TEST(ExerciseFrame, APlaneHasDownForUs) {
    const auto frame = ExerciseFrame::of({}, Vec3d(0));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->toScene(glm::dvec3(1, 2, 3)), glm::dvec3(1, -3, 2));
    EXPECT_EQ(frame->toWorld(glm::dvec3(1, -3, 2)), glm::dvec3(1, 2, 3));
    const glm::dquat level = frame->toScene(orientationOf({}));
    EXPECT_NEAR(std::abs(level.w), 1, 1e-15);
    // A nose that turns to the right turns about our -y.
    const glm::dvec3 nose = frame->toScene(orientationOf({static_cast<float>(kPi / 2), 0, 0})) * glm::dvec3(1, 0, 0);
    EXPECT_NEAR(glm::length(nose - glm::dvec3(0, 0, 1)), 0, 1e-7);
    const glm::dvec3 climbs = frame->toScene(orientationOf({0, .5f, 0})) * glm::dvec3(1, 0, 0);
    EXPECT_GT(climbs.y, 0.4);
}

TEST(ExerciseFrame, APlaceHasEastUpAndSouth) {
    Array<String> gd;
    gd.push_back(String("GD"));
    gd.push_back(String("WE"));
    const Vec3d position(48, 11, 500);
    const auto frame = ExerciseFrame::of(gd, position);
    ASSERT_TRUE(frame);
    const GeoSystem system = GeoSystem::read(gd).value();
    const auto at = [&](double latitude, double longitude, double height) {
        return frame->toScene(glm::dvec3(system.toGeocentric({latitude, longitude, height})));
    };
    EXPECT_NEAR(glm::length(at(48, 11, 500)), 0, 1e-8);
    EXPECT_NEAR(glm::length(at(48, 11, 600) - glm::dvec3(0, 100, 0)), 0, 1e-8);
    EXPECT_GT(at(48, 11.001, 500).x, 70);    // to the east
    EXPECT_LT(at(48.001, 11, 500).z, -100);  // to the north
    // A body whose nose points north and whose belly points down: its model looks along -z.
    const glm::dmat3 eus = system.frameAt(system.toGeocentric(position));
    const glm::dmat3 body(-eus[2], eus[0], -eus[1]);  // forward, right, down
    const glm::dquat rotation = frame->toScene(glm::quat_cast(body));
    EXPECT_NEAR(glm::length(rotation * glm::dvec3(1, 0, 0) - glm::dvec3(0, 0, -1)), 0, 1e-12);
    EXPECT_NEAR(glm::length(rotation * glm::dvec3(0, 1, 0) - glm::dvec3(0, 1, 0)), 0, 1e-12);
    EXPECT_NEAR(std::abs(glm::dot(frame->toWorld(rotation), glm::quat_cast(body))), 1, 1e-12);
    Array<String> wrong;
    wrong.push_back(String("XX"));
    EXPECT_FALSE(ExerciseFrame::of(wrong, position));
    EXPECT_FALSE(ExerciseFrame::of(gd, Vec3d(NAN, 0, 0)));
}

TEST(ExerciseFrame, TheMiddleOfTheEarthIsAPlaceToo) {
    Array<String> gc;
    gc.push_back(String("GC"));
    const auto frame = ExerciseFrame::of(gc, Vec3d(0));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->toScene(glm::dvec3(1, 2, 3)), glm::dvec3(1, 2, 3));
}

}  // namespace rtsg::dis
