// A ball that is drawn among triangles, against closed forms: plane, edge, corner, groove, sphere.
#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include "contact/ball.h"

namespace rtsg::haptics {
namespace {

constexpr double kRadius = 0.005;
constexpr double kExact = 3 * kSkin;

void addQuad(std::vector<NearTriangle>& triangles, const Vec3d& at, const Vec3d& u, const Vec3d& v) {
    NearTriangle& one = triangles.emplace_back();
    one.corners[0] = at, one.corners[1] = at + u, one.corners[2] = at + u + v;
    NearTriangle& other = triangles.emplace_back();
    other.corners[0] = at, other.corners[1] = at + u + v, other.corners[2] = at + v;
}

void expectNear(const Vec3d& got, const Vec3d& wanted, double maximum = kExact) {
    EXPECT_LT(glm::length(got - wanted), maximum)
        << got.x << ' ' << got.y << ' ' << got.z << " for " << wanted.x << ' ' << wanted.y << ' ' << wanted.z;
}

TEST(BallAmongTriangles, RestsAboveAPlaneWhereTheHandIsBelow) {
    std::vector<NearTriangle> plane;
    addQuad(plane, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
    expectNear(slide({.1, .1, .5}, {.3, .2, -.01}, kRadius, plane), {.3, .2, kRadius});
    expectNear(slide({.1, .1, -.5}, {.3, .2, .01}, kRadius, plane), {.3, .2, -kRadius});  // it has two sides
    expectNear(slide({.1, .1, .5}, {.3, .2, .25}, kRadius, plane), {.3, .2, .25});
}

TEST(BallAmongTriangles, GoesOnBehindTheRimOfASheet) {
    std::vector<NearTriangle> plane;
    addQuad(plane, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
    expectNear(slide({.5, 0, .1}, {1.2, 0, -.1}, kRadius, plane), {1.2, 0, -.1}, 1e-9);
}

TEST(BallAmongTriangles, StaysInACornerAndInAGroove) {
    std::vector<NearTriangle> corner;
    addQuad(corner, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    addQuad(corner, {0, 0, 0}, {0, 1, 0}, {0, 0, 1});
    addQuad(corner, {0, 0, 0}, {0, 0, 1}, {1, 0, 0});
    expectNear(slide({.3, .4, .5}, {-.1, -.2, -.3}, kRadius, corner), Vec3d(kRadius));
    expectNear(slide({.3, .4, .5}, {-.1, -.2, .3}, kRadius, corner), {kRadius, kRadius, .3});
    // A groove of 2 x 10 degrees, in which the ball rests high up: its middle is radius / sin(10 degrees) away.
    std::vector<NearTriangle> groove;
    const double half = 10 * std::numbers::pi / 180;
    addQuad(groove, {0, -1, 0}, {0, 2, 0}, {std::sin(half), 0, std::cos(half)});
    addQuad(groove, {0, -1, 0}, {0, 2, 0}, {-std::sin(half), 0, std::cos(half)});
    expectNear(slide({.01, 0, .5}, {0, .1, -.2}, kRadius, groove), {0, .1, kRadius / std::sin(half)}, 1e-5);
}

TEST(BallAmongTriangles, RollsOverAnEdgeAsACylinderRoundIt) {
    std::vector<NearTriangle> box;  // the edge is the y axis
    addQuad(box, {-1, -1, 0}, {1, 0, 0}, {0, 2, 0});
    addQuad(box, {0, -1, 0}, {0, 2, 0}, {0, 0, -1});
    for (int degrees = 0; degrees <= 90; degrees += 10) {
        const double angle = degrees * std::numbers::pi / 180;
        const Vec3d out(std::sin(angle), 0, std::cos(angle));
        expectNear(slide(.1 * out, -.001 * out, kRadius, box), kRadius * out, 1e-5);
    }
}

TEST(BallAmongTriangles, FollowsASphereToThePointNextToTheHand) {
    constexpr int kRings = 60;
    std::vector<NearTriangle> sphere;
    const auto at = [](int ring, int index) {
        const double a = std::numbers::pi * ring / kRings, b = 2 * std::numbers::pi * index / kRings;
        return Vec3d(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
    };
    for (int i = 0; i < kRings; ++i)
        for (int j = 0; j < kRings; ++j) {
            sphere.push_back({{at(i, j), at(i + 1, j), at(i + 1, j + 1)}, {}, 0, 0, false});
            sphere.push_back({{at(i, j), at(i + 1, j + 1), at(i, j + 1)}, {}, 0, 0, false});
        }
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 20; ++i) {
        Vec3d from(normal(random), normal(random), normal(random));
        from *= 1.2 / glm::length(from);
        const Vec3d hand = .98 / 1.2 * from + .1 * glm::normalize(glm::cross(from, Vec3d(0, 0, 1)));
        Vec3d ball = from;
        for (int step = 1; step <= 20; ++step) ball = slide(ball, from + step / 20. * (hand - from), kRadius, sphere);
        for (int step = 0; step < 3; ++step) ball = slide(ball, hand, kRadius, sphere);
        const double facets = 1 - std::cos(std::numbers::pi / kRings);
        EXPECT_GT(glm::length(ball), 1 - 2 * facets + kRadius - kExact) << i;
        // Facets are up to 3 degrees wide: so far the nearest point may be off.
        expectNear(ball, (1 + kRadius) / glm::length(hand) * hand, .003);
    }
}

TEST(BallAmongTriangles, NeverPassesThroughASheetHoweverItIsDrawn) {
    std::vector<NearTriangle> sheet;
    for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j) {
            const auto at = [](int x, int y) { return Vec3d(x, y, .3 * std::sin(x) * std::cos(2 * y)); };
            sheet.push_back({{at(i, j), at(i + 1, j), at(i + 1, j + 1)}, {}, 0, 0, false});
            sheet.push_back({{at(i, j), at(i + 1, j + 1), at(i, j + 1)}, {}, 0, 0, false});
        }
    std::mt19937 random(2);
    std::uniform_real_distribution<double> coordinate(1, 7), height(-2, 2);
    Vec3d ball(4, 4, 2);
    for (int i = 0; i < 3000; ++i) {
        const Vec3d before = ball, goal(coordinate(random), coordinate(random), height(random));
        ball = slide(ball, goal, kRadius, sheet);
        double nearest = 1e9;
        for (const NearTriangle& t : sheet)
            nearest = std::min(nearest, glm::length(ball - closestOnTriangle(ball, t.corners)));
        ASSERT_GT(nearest, kRadius - kExact) << i;
        const auto heightAt = [](const Vec3d& p) {  // well above or well below
            return p.z > .31 ? 1 : p.z < -.31 ? -1 : 0;
        };
        ASSERT_GE(heightAt(ball) * heightAt(before), 0) << i;
        ASSERT_GE(heightAt(ball), 0) << i;
    }
}

TEST(BallAmongTriangles, SlidesOverAGroundOfFacetsThatAreAllButFlat) {
    // Waves of a metre in facets of 5 mm: neighbours are 2 to 20 milliradians apart, and here and there next to none.
    constexpr double kSide = .005;
    const auto height = [](double x, double z) {
        return .05 * std::sin(2 * std::numbers::pi * x) * std::cos(2 * std::numbers::pi * z);
    };
    Vec3d ball(.85, .2, .55);
    for (int i = 0; i < 6300; ++i) {
        const double x = .55 + .3 * std::cos(.002 * i), z = .55 + .3 * std::sin(.002 * i);
        std::vector<NearTriangle> near;
        const int column = static_cast<int>(ball.x / kSide), row = static_cast<int>(ball.z / kSide);
        for (int u = column - 4; u <= column + 4; ++u)
            for (int v = row - 4; v <= row + 4; ++v) {
                const auto at = [&](int a, int b) { return Vec3d(a * kSide, height(a * kSide, b * kSide), b * kSide); };
                near.push_back({{at(u, v), at(u, v + 1), at(u + 1, v + 1)}, {}, 0, 0, false});
                near.push_back({{at(u, v), at(u + 1, v + 1), at(u + 1, v)}, {}, 0, 0, false});
            }
        const Vec3d hand(x, height(x, z) + .002, z);
        ball = slide(ball, hand, kRadius, near);
        ASSERT_LT(glm::length(ball - hand), .0035) << "it lags behind at step " << i;
    }
}

TEST(BallAmongTriangles, DegenerateTrianglesAreEdgesAndPoints) {
    std::vector<NearTriangle> odd(2);
    odd[0].corners[0] = odd[0].corners[1] = {-1, 0, 0}, odd[0].corners[2] = {1, 0, 0};  // an edge
    odd[1].corners[0] = odd[1].corners[1] = odd[1].corners[2] = {0, 1, 0};              // a point
    expectNear(slide({0, 0, .1}, {0, 0, .001}, kRadius, odd), {0, 0, kRadius});
    expectNear(slide({0, 1, .1}, {0, 1, .001}, kRadius, odd), {0, 1, kRadius});
    const Vec3d lies = slide({0, 0, 0}, {0, 0, .1}, kRadius, odd);  // on the edge itself
    EXPECT_TRUE(std::isfinite(lies.x) && std::isfinite(lies.y) && std::isfinite(lies.z));
}

}  // namespace
}  // namespace rtsg::haptics
