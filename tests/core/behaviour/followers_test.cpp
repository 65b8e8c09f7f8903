// Followers against closed forms, against a chain of filters integrated numerically, and at other frame rates.
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

struct FollowerScene {
    Scene scene;
    explicit FollowerScene(const std::string& node) {
        Diagnostics diagnostics("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nDEF F " + node, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    }
    NodeId id() const { return scene.findName("F"); }
    const Node& node() const { return scene.node(id()); }
    template <class T>
    void send(FieldIndex field, T value) {
        ASSERT_TRUE(scene.sendEvent(id(), field, Value(std::move(value))));
    }
};

/// The response of a chain of `order` filters to a step from 0 to 1, at t / tau = s.
double damped(int order, double s) {
    double rest = 0, term = std::exp(-s);
    for (int k = 0; k < order; ++k) {
        rest += term;
        term *= s / (k + 1);
    }
    return 1 - rest;
}

TEST(Followers, ADamperIsAChainOfFiltersWhateverTheFrameRate) {
    using D = x3d::ScalarDamper;
    for (int order = 1; order <= 5; ++order)
        for (const double step : {.001, .017, .25, 1.3}) {
            FollowerScene f("ScalarDamper { tau .4 order " + std::to_string(order) + " tolerance 0 }");
            f.scene.newFrame(10);
            f.send(D::set_destination.index, 5.0f);
            f.scene.newFrame(10);
            EXPECT_EQ(f.node().get(D::value_changed), 0);
            for (double t = step; t < 3; t += step) {
                f.scene.newFrame(10 + t);
                EXPECT_NEAR(f.node().get(D::value_changed), 5 * damped(order, t / .4), 2e-6) << order << ' ' << t;
                EXPECT_TRUE(f.node().get(D::isActive));
            }
        }
}

TEST(Followers, ADamperWithManyDestinationsIsTheIntegratedChain) {
    using D = x3d::PositionDamper;
    const unsigned seed = 7;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> when(.01, .3), where(-10, 10);
    FollowerScene f("PositionDamper { tau .25 order 4 tolerance 0 initialValue 1 2 3 initialDestination 1 2 3 }");
    f.scene.newFrame(0);
    glm::dvec3 goal(1, 2, 3), filters[4] = {goal, goal, goal, goal};
    double t = 0, tau = .25;
    for (int i = 0; i < 30; ++i) {
        const double next = t + when(random);
        // Runge and Kutta's fourth order, in steps far below tau.
        const int steps = 400;
        const double h = (next - t) / steps;
        for (int n = 0; n < steps; ++n) {
            const auto slope = [&](const glm::dvec3* x, glm::dvec3* out) {
                for (int k = 0; k < 4; ++k) out[k] = ((k == 0 ? goal : x[k - 1]) - x[k]) / tau;
            };
            glm::dvec3 a[4], b[4], c[4], d[4], x[4];
            slope(filters, a);
            for (int k = 0; k < 4; ++k) x[k] = filters[k] + a[k] * (h / 2);
            slope(x, b);
            for (int k = 0; k < 4; ++k) x[k] = filters[k] + b[k] * (h / 2);
            slope(x, c);
            for (int k = 0; k < 4; ++k) x[k] = filters[k] + c[k] * h;
            slope(x, d);
            for (int k = 0; k < 4; ++k) filters[k] += (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]) * (h / 6);
        }
        t = next;
        const Vec3f to(where(random), where(random), where(random));
        f.send(D::set_destination.index, to);
        if (i == 15) f.send(D::tau.index, Time{.1});
        f.scene.newFrame(t);
        goal = glm::dvec3(to);
        if (i == 15) tau = .1;
        EXPECT_LT(glm::length(glm::dvec3(f.node().get(D::value_changed)) - filters[3]), 2e-5) << i << " seed " << seed;
    }
}

TEST(Followers, AChaserAddsUpHalfCosines) {
    using C = x3d::PositionChaser2D;
    const unsigned seed = 11;
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> where(-10, 10);
    FollowerScene f("PositionChaser2D { duration .8 initialValue 1 1 initialDestination 1 1 }");
    std::vector<std::pair<double, glm::dvec2>> steps{{-100.0, glm::dvec2(1, 1)}};
    for (int i = 0; i < 200; ++i) {
        const double t = i * .031;
        if (i % 7 == 0 && i < 150) {
            const Vec2f to(where(random), where(random));
            f.send(C::set_destination.index, to);
            steps.emplace_back(t, glm::dvec2(to));
        }
        f.scene.newFrame(t);
        glm::dvec2 expected = steps[0].second;
        for (std::size_t j = 1; j < steps.size(); ++j) {
            const double u = std::clamp((t - steps[j].first) / .8, 0.0, 1.0);
            expected += (steps[j].second - steps[j - 1].second) * (.5 - .5 * std::cos(std::numbers::pi * u));
        }
        EXPECT_LT(glm::length(glm::dvec2(f.node().get(C::value_changed)) - expected), 1e-5) << i << " seed " << seed;
    }
    // A follower that has arrived is exactly at its destination, and rests.
    EXPECT_EQ(f.node().get(C::value_changed), Vec2f(steps.back().second));
    EXPECT_FALSE(f.node().get(C::isActive));
    EXPECT_TRUE(f.scene.newFrame(100)->changes.empty());
}

TEST(Followers, AChaserThatIsDrivenWithoutEndKeepsALimitedNumberOfSteps) {
    using C = x3d::ScalarChaser;
    FollowerScene f("ScalarChaser { duration 10 }");
    const double speed = 3;
    for (int i = 0; i < 40'000; ++i) {
        const double t = i * .001;
        f.send(C::set_destination.index, static_cast<float>(speed * t));
        f.scene.newFrame(t);
        ASSERT_LE(f.node().get(C::_times).size(), 520u);
    }
    // Behind a ramp it lags by the mean of its response: half of the duration.
    EXPECT_NEAR(f.node().get(C::value_changed), speed * (39.999 - 5), .03 * speed);
}

TEST(Followers, OrientationsAboutOneAxisGoAsNumbersDoTheShorterWay) {
    using D = x3d::OrientationDamper;
    using C = x3d::OrientationChaser;
    FollowerScene damper("OrientationDamper { tau .5 order 3 tolerance 0 }"),
        chaser("OrientationChaser { duration 2 }");
    damper.scene.newFrame(0);
    chaser.scene.newFrame(0);
    // Five sixths of a turn: the shorter way is a third back.
    const double angle = 10 * std::numbers::pi / 6, distance = angle - 2 * std::numbers::pi;
    const Rotation goal{0, 0, 1, static_cast<float>(angle)};
    damper.send(D::set_destination.index, goal);
    chaser.send(C::set_destination.index, goal);
    const auto signedAngle = [](const Rotation& r) { return double(r.z) * r.angle; };
    for (double t = 0; t < 1.9; t += .1) {
        damper.scene.newFrame(t);
        chaser.scene.newFrame(t);
        EXPECT_NEAR(signedAngle(damper.node().get(D::value_changed)), distance * damped(3, t / .5), 1e-6) << t;
        EXPECT_NEAR(signedAngle(chaser.node().get(C::value_changed)),
                    distance * (.5 - .5 * std::cos(std::numbers::pi * t / 2)), 1e-6)
            << t;
    }
    chaser.scene.newFrame(2);
    EXPECT_EQ(chaser.node().get(C::value_changed), goal);
}

TEST(Followers, OfOppositeOrientationsOneWayIsTakenAndEveryValueIsFinite) {
    using C = x3d::OrientationChaser;
    FollowerScene f("OrientationChaser { duration 1 }");
    f.scene.newFrame(0);
    f.send(C::set_destination.index, Rotation{0, 1, 0, static_cast<float>(std::numbers::pi)});
    for (double t = 0; t <= 1.1; t += .1) {
        f.scene.newFrame(t);
        const Rotation r = f.node().get(C::value_changed);
        EXPECT_TRUE(std::isfinite(r.x + r.y + r.z + r.angle));
    }
}

TEST(Followers, ArraysMoveElementByElementAndTakeOnTheLengthOfTheDestination) {
    using C = x3d::CoordinateChaser;
    FollowerScene f(
        "CoordinateChaser { duration 1 initialValue [ 0 0 0, 1 1 1 ] initialDestination [ 0 0 0, 1 1 1 ] }");
    f.scene.newFrame(0);
    f.send(C::set_destination.index, Array<Vec3f>{Vec3f(4, 0, 0), Vec3f(1, 5, 1)});
    f.scene.newFrame(0);
    f.scene.newFrame(.5);
    EXPECT_EQ(f.node().get(C::value_changed), (Array<Vec3f>{Vec3f(2, 0, 0), Vec3f(1, 3, 1)}));
    f.send(C::set_destination.index, Array<Vec3f>{Vec3f(4, 0, 0), Vec3f(1, 5, 1), Vec3f(9, 9, 9)});
    f.scene.newFrame(.5);
    ASSERT_EQ(f.node().get(C::value_changed).size(), 3u);
    EXPECT_EQ(f.node().get(C::value_changed)[2], Vec3f(9, 9, 9));
    EXPECT_EQ(f.node().get(C::value_changed)[0], Vec3f(2, 0, 0));
    f.send(C::set_destination.index, Array<Vec3f>{});
    f.scene.newFrame(.75);
    EXPECT_TRUE(f.node().get(C::value_changed).empty());
    f.scene.newFrame(5);
    EXPECT_FALSE(f.node().get(C::isActive));

    using D = x3d::CoordinateDamper;
    FollowerScene g(
        "CoordinateDamper { tau 1 order 2 tolerance 0 initialValue [ 1 0 0 ] initialDestination [ 1 0 0 ] }");
    g.scene.newFrame(0);
    g.send(D::set_destination.index, Array<Vec3f>{Vec3f(3, 0, 0), Vec3f(7, 0, 0)});
    g.scene.newFrame(0);
    g.scene.newFrame(1);
    ASSERT_EQ(g.node().get(D::value_changed).size(), 2u);
    EXPECT_NEAR(g.node().get(D::value_changed)[0].x, 1 + 2 * damped(2, 1), 1e-6);
    EXPECT_EQ(g.node().get(D::value_changed)[1].x, 7);
}

TEST(Followers, BadParametersMeanAtOnce) {
    for (const char* node : {"ScalarChaser { duration 0 }", "ScalarDamper { tau 0 }", "ScalarDamper { order 0 }"}) {
        FollowerScene f(node);
        f.scene.newFrame(0);
        const auto& type = f.node().type();
        f.send(type.find("set_destination"), 4.0f);
        f.scene.newFrame(1);
        EXPECT_EQ(f.node().value(type.find("value_changed")), Value(4.0f)) << node;
        EXPECT_EQ(f.node().value(type.find("isActive")), Value(false)) << node;
    }
}

TEST(Followers, TimesThatAreNoneMeanAtOnce) {
    for (const double none : {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(), -1.0,
                              std::numeric_limits<double>::quiet_NaN()})
        for (const char* node : {"ScalarChaser { }", "ScalarDamper { }", "OrientationChaser { }", "ColorDamper { }"}) {
            FollowerScene f(node);
            const NodeType& type = f.node().type();
            const FieldIndex time = type.find(type.find("tau") != kNoField ? "tau" : "duration");
            ASSERT_TRUE(f.scene.setField(f.node().id(), time, Value(Time{none})));
            f.scene.newFrame(0);
            const FieldType what = type.fields[type.find("value_changed")].type;
            const Value goal = what == FieldType::SFFloat   ? Value(4.0f)
                               : what == FieldType::SFColor ? Value(Color{.5f, .25f, 1})
                                                            : Value(Rotation{0, 1, 0, 1});
            f.send(type.find("set_destination"), goal);
            f.scene.newFrame(1);
            EXPECT_EQ(f.node().value(type.find("value_changed")), goal) << node << none;
            EXPECT_EQ(f.node().value(type.find("isActive")), Value(false)) << node << none;
        }
}

TEST(Followers, ADamperArrivesWithinItsToleranceAndThenRests) {
    using D = x3d::ScalarDamper;
    FollowerScene f("ScalarDamper { tau 1 order 1 tolerance .01 }");
    f.scene.newFrame(0);
    f.send(D::set_destination.index, 1.0f);
    f.scene.newFrame(0);
    const double arrival = std::log(100.0);  // exp(-t) = .01
    f.scene.newFrame(arrival - .01);
    EXPECT_TRUE(f.node().get(D::isActive));
    f.scene.newFrame(arrival + .01);
    EXPECT_FALSE(f.node().get(D::isActive));
    EXPECT_EQ(f.node().get(D::value_changed), 1);
    EXPECT_TRUE(f.scene.newFrame(arrival + 1)->changes.empty());
}

}  // namespace
}  // namespace rtsg
