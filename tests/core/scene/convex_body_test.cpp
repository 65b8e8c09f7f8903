// Triangles against convex bodies: closed forms, and random ones against a nested search.
#include "input/convex_body.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

#include "support/convex_gauge.h"

namespace rtsg {
namespace {

using Triangle = ConvexBody::Triangle;

/// A triangle in the plane through `at` that stands upright on `normal`, its corners `size` away from there.
Triangle facing(const Vec3d& at, const Vec3d& normal, double size) {
    const Vec3d n = glm::normalize(normal);
    const Vec3d u = glm::normalize(glm::cross(n, std::abs(n.x) < .5 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0)));
    const Vec3d v = glm::cross(n, u);
    Triangle t;
    for (int i = 0; i < 3; ++i) t[i] = at + size * (std::cos(2.1 * i) * u + std::sin(2.1 * i) * v);
    return t;
}

/// Planes with this normal meet the body up to `reach` from the origin, be the triangle large or small.
void expectReach(const ConvexBody& body, const Vec3d& normal, double reach, const Vec3d& touched) {
    const Vec3d n = glm::normalize(normal);
    EXPECT_NEAR(glm::dot(touched, n), reach, 1e-12);
    for (const double size : {.001, 1., 1000.}) {
        EXPECT_TRUE(body.meets(facing(touched, n, size))) << size;
        EXPECT_TRUE(body.meets(facing(touched - 1e-6 * n, n, size))) << size;
        EXPECT_FALSE(body.meets(facing(touched + 1e-6 * n, n, size))) << size;
    }
}

TEST(ConvexBody, IsTouchedByPlanesWhereClosedFormsSay) {
    const double s = std::sqrt(.5);
    expectReach(ConvexBody::sphere(2), {1, 1, 0}, 2, Vec3d(s, s, 0) * 2.0);
    expectReach(ConvexBody::box({1, 2, 3}), {0, 1, 0}, 2, {.3, 2, .4});
    expectReach(ConvexBody::box({1, 2, 3}), {1, 1, 0}, 3 * s, {1, 2, .5});
    expectReach(ConvexBody::box({1, 2, 3}), {-1, 1, 1}, 6 / std::sqrt(3), {-1, 2, 3});
    expectReach(ConvexBody::cylinder(2, 3), {0, -1, 0}, 3, {.5, -3, 1});
    expectReach(ConvexBody::cylinder(2, 3), {0, 0, 1}, 2, {0, 1, 2});
    expectReach(ConvexBody::cylinder(2, 3), {1, 1, 0}, 5 * s, {2, 3, 0});
    expectReach(ConvexBody::cone(2, 1), {0, 1, 0}, 1, {0, 1, 0});
    expectReach(ConvexBody::cone(2, 1), {0, -1, 0}, 1, {.5, -1, .5});
    // The side of this cone falls as far as it goes out: its normal is that of a slope of 45 degrees.
    expectReach(ConvexBody::cone(2, 1), {0, 1, 1}, s, {0, 0, 1});
    expectReach(ConvexBody::cone(2, 1), {1, -1, 0}, 3 * s, {2, -1, 0});
    expectReach(ConvexBody::hull({{1, 1, 0}, {-1, 1, 0}, {0, -1, 0}, {0, 0, 3}}), {0, 0, 1}, 3, {0, 0, 3});
    expectReach(ConvexBody::hull({{1, 1, 0}, {-1, 1, 0}, {0, -1, 0}, {0, 0, 3}}), {0, 0, -1}, 0, {0, .2, 0});
}

TEST(ConvexBody, MeetsWhatIsWhollyInsideAndWhatItIsWhollyInsideOf) {
    const ConvexBody bodies[] = {
        ConvexBody::sphere(1), ConvexBody::box({1, 1, 1}), ConvexBody::cylinder(1, 1), ConvexBody::cone(1, 1),
        ConvexBody::hull({{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}})};
    for (const ConvexBody& body : bodies) {
        for (const Vec3d& normal : {Vec3d(0, 1, 0), Vec3d(1, 0, 0), Vec3d(1, 2, 3)}) {
            EXPECT_TRUE(body.meets(facing({0, -.2, 0}, normal, .1)));
            EXPECT_TRUE(body.meets(facing({0, 0, 0}, normal, 1e6)));
            EXPECT_FALSE(body.meets(facing(2.0 * normal, normal, 1e6)));
        }
        EXPECT_TRUE(body.meets({Vec3d(0), Vec3d(0), Vec3d(0)})) << "a point";
        EXPECT_FALSE(body.meets({Vec3d(1, 1.1, 1), Vec3d(1, 1.1, 1), Vec3d(1, 1.1, 1)}));
        EXPECT_TRUE(body.meets({Vec3d(-9, 0, 0), Vec3d(9, 0, 0), Vec3d(0)})) << "a line";
        EXPECT_FALSE(body.meets({Vec3d(NAN, 0, 0), Vec3d(0), Vec3d(0)}));
        EXPECT_FALSE(body.meets({Vec3d(INFINITY, 0, 0), Vec3d(0), Vec3d(0)}));
    }
    EXPECT_TRUE(ConvexBody::sphere(0).meets({Vec3d(-1, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0)})) << "a point of a body";
    EXPECT_TRUE(ConvexBody::cone(1, 0).meets({Vec3d(.5, -1, 0), Vec3d(.5, 1, 0), Vec3d(.6, 1, 0)})) << "a disc";
    EXPECT_FALSE(ConvexBody::cone(1, 0).meets({Vec3d(5, -1, 0), Vec3d(5, 1, 0), Vec3d(6, 1, 0)}));
    EXPECT_TRUE(ConvexBody::hull({{1, 2, 3}}).meets({Vec3d(1, 2, 2), Vec3d(1, 2, 4), Vec3d(1, 2, 5)}));
    EXPECT_FALSE(ConvexBody::hull({{1, 2, 3}}).meets({Vec3d(1, 2.001, 2), Vec3d(1, 2.001, 4), Vec3d(1, 2.001, 5)}));
}

struct RandomTriangles {
    std::mt19937 engine;
    double operator()(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine); }
    Vec3d position(double size) { return {(*this)(-size, size), (*this)(-size, size), (*this)(-size, size)}; }
    /// Large, small, thin, or without area.
    Triangle triangle() {
        const double size = std::pow(10, (*this)(-2, 2));
        Triangle t{position(size), position(size), position(size)};
        switch (engine() % 8) {
            case 0:
                t[2] = t[1];
                break;
            case 1:
                t[1] = t[0], t[2] = t[0];
                break;
            case 2:
                t[2] = t[0] + (t[1] - t[0]) * (*this)(-1, 2);
                break;
            case 3:
                t[2] = t[0] + (t[1] - t[0]) * (*this)(-1, 2) + position(1e-5);
                break;
            default:
                break;
        }
        return t;
    }
};

/// Moves random triangles from afar until they first touch: there the nested search must find depth 0.
void expectTouchWhereSearchSays(const ConvexBody& body, const test::Gauge& gauge, RandomTriangles& random, int count) {
    for (int i = 0; i < count; ++i) {
        const Triangle t = random.triangle();
        const double u = random(0, 1), v = random(0, 1 - u);
        const Vec3d inner = t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
        const Vec3d away = glm::normalize(random.position(1)) * 1000.0;
        const auto moved = [&](double far) {
            const Vec3d by = far * away - inner;
            return Triangle{t[0] + by, t[1] + by, t[2] + by};
        };
        ASSERT_TRUE(body.meets(moved(0))) << i;
        ASSERT_FALSE(body.meets(moved(1))) << i;
        double in = 0, out = 1;
        for (int k = 0; k < 60; ++k) {
            const double middle = (in + out) / 2;
            (body.meets(moved(middle)) ? in : out) = middle;
        }
        EXPECT_NEAR(test::minOnTriangle(gauge, moved(in)), 0, 1e-7) << "triangle " << i << " at " << in;
    }
}

TEST(ConvexBody, IsFirstTouchedWhereANestedSearchSays) {
    constexpr unsigned kSeed = 20;
    SCOPED_TRACE(kSeed);
    RandomTriangles random{std::mt19937(kSeed)};
    for (int i = 0; i < 12; ++i) {
        const double a = random(.2, 2), b = random(.2, 2), c = random(.2, 2);
        expectTouchWhereSearchSays(ConvexBody::box({a, b, c}), test::boxGauge({a, b, c}), random, 12);
        expectTouchWhereSearchSays(ConvexBody::sphere(a), test::sphereGauge(a), random, 12);
        expectTouchWhereSearchSays(ConvexBody::cylinder(a, b), test::cylinderGauge(a, b), random, 12);
        expectTouchWhereSearchSays(ConvexBody::cone(a, b), test::coneGauge(a, b), random, 12);
        std::vector<Vec3d> points;
        for (int k = 0; k < 4 + i / 2; ++k) points.push_back(random.position(1));
        Vec3d middle(0);
        for (const Vec3d& p : points) middle += p / double(points.size());
        for (Vec3d& p : points) p -= middle;
        expectTouchWhereSearchSays(ConvexBody::hull(points), test::hullGauge(points), random, 12);
    }
}

/// Flat, straight and point-like hulls, and ones of many points that lie in one plane, are boxes in disguise.
TEST(ConvexBody, HullsOfBoxesAreBoxes) {
    constexpr unsigned kSeed = 21;
    SCOPED_TRACE(kSeed);
    RandomTriangles random{std::mt19937(kSeed)};
    int met = 0;
    for (int i = 0; i < 40; ++i) {
        const Vec3d half(random(.2, 2), i % 3 == 0 ? 0 : random(.2, 2), i % 4 == 0 ? 0 : random(.2, 2));
        std::vector<Vec3d> points;
        for (int x = -2; x <= 2; ++x)
            for (int y = -2; y <= 2; ++y)
                for (int z = -2; z <= 2; ++z) points.push_back(half * Vec3d(x, y, z) * .5);
        const glm::dmat3 rotation(glm::rotate(glm::dmat4(1), random(-3, 3), glm::normalize(random.position(1))));
        const Vec3d shift = random.position(5);
        for (Vec3d& p : points) p = rotation * p + shift;
        const ConvexBody hull = ConvexBody::hull(points), box = ConvexBody::box(half);
        for (int k = 0; k < 100; ++k) {
            Triangle local = random.triangle(), world;
            const Vec3d by = random.position(2);
            if (k % 5 == 0)
                for (Vec3d& p : local) p.y = 0;  // in the plane of a flat one
            for (std::size_t c = 0; c < 3; ++c) local[c] += k % 5 == 0 ? Vec3d(by.x, 0, by.z) : by;
            for (std::size_t c = 0; c < 3; ++c) world[c] = rotation * local[c] + shift;
            const double depth = test::minOnTriangle(test::boxGauge(half), local);
            if (std::abs(depth) < 1e-7 && half.y > 0 && half.z > 0) continue;
            if (depth > 0 && depth < 1e-7) continue;
            EXPECT_EQ(hull.meets(world), box.meets(local)) << i << ' ' << k << ": " << depth;
            met += box.meets(local) ? 1 : 0;
        }
    }
    EXPECT_GT(met, 300);
    EXPECT_LT(met, 3500);
}

}  // namespace
}  // namespace rtsg
