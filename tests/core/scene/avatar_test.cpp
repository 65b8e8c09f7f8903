// Avatars against closed forms: planes and balls whose meetings with rays are known in one line.
#include "input/avatar.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

/// The half space dot(normal, p) < offset is solid.
struct Wall {
    glm::dvec3 normal;
    double offset;
};
CastRay castAt(std::vector<Wall> walls) {
    return [walls](const glm::dvec3& origin, const glm::dvec3& direction, double length) -> std::optional<Met> {
        std::optional<Met> nearest;
        for (const Wall& wall : walls) {
            const double t = (wall.offset - glm::dot(wall.normal, origin)) / glm::dot(wall.normal, direction);
            if (!(t >= 0 && t <= length) || (nearest && nearest->distance < t)) continue;
            const bool before = glm::dot(wall.normal, direction) < 0;
            nearest = Met{t, before ? wall.normal : -wall.normal};
        }
        return nearest;
    };
}
void expectAt(const glm::dvec3& actual, const glm::dvec3& expected, double tolerance = 1e-12) {
    EXPECT_LT(glm::length(actual - expected), tolerance)
        << actual.x << ' ' << actual.y << ' ' << actual.z << " instead of " << expected.x << ' ' << expected.y << ' '
        << expected.z;
}
constexpr glm::dvec3 kEast(1, 0, 0), kNorth(0, 0, -1), kAbove(0, 1, 0);
const Avatar kAdult;  // .25, 1.6, .75

TEST(Avatar, StopsItsRadiusBeforeAWall) {
    const auto cast = castAt({{{-1, 0, 0}, -5}});
    expectAt(slideBy({0, 1.6, 0}, {4, 0, 0}, kAdult, true, cast), {4, 1.6, 0});
    expectAt(slideBy({0, 1.6, 0}, {9, 0, 0}, kAdult, true, cast), {4.75, 1.6, 0});
    expectAt(slideBy({0, 1.6, 0}, {9, 0, 0}, kAdult, false, cast), {4.75, 1.6, 0});
    expectAt(slideBy({4.75, 1.6, 0}, {1, 0, 0}, kAdult, true, cast), {4.75, 1.6, 0});
    expectAt(slideBy({4.9, 1.6, 0}, {-1, 0, 0}, kAdult, true, cast), {3.9, 1.6, 0});
}

TEST(Avatar, SlidesAlongWallsAtAnyAngleAndNeverComesNearer) {
    std::mt19937 random(20);
    std::uniform_real_distribution<double> angle(-M_PI, M_PI), far(1, 30);
    for (int i = 0; i < 2000; ++i) {
        const double a = angle(random), b = angle(random), offset = -far(random), length = far(random);
        const glm::dvec3 normal(std::cos(a), 0, std::sin(a)), motion = glm::dvec3(std::cos(b), 0, std::sin(b)) * length;
        const glm::dvec3 start(0, 1.6, 0);
        const bool walks = i % 2 == 0;
        const glm::dvec3 end = slideBy(start, motion, kAdult, walks, castAt({{normal, offset}}));
        // Free until .25 before the plane, and then only the part of the motion along it.
        const double approach = -glm::dot(motion, normal), room = -offset - kAdult.radius;
        const glm::dvec3 wanted = start + motion + normal * std::max(0.0, approach - room);
        expectAt(end, wanted, .002 * length);
        EXPECT_GT(glm::dot(end, normal) - offset, kAdult.radius * .998);
    }
}

TEST(Avatar, StopsInACorner) {
    const auto cast = castAt({{{-1, 0, 0}, -5}, {{0, 0, 1}, -3}});
    expectAt(slideBy({0, 1.6, 0}, glm::normalize(kEast + kNorth) * 20.0, kAdult, true, cast), {4.75, 1.6, -2.75}, 1e-3);
    const auto sharp =
        castAt({{glm::normalize(glm::dvec3(-1, 0, 1)), -2}, {glm::normalize(glm::dvec3(-1, 0, -1)), -2}});
    const glm::dvec3 end = slideBy({0, 1.6, 0}, kEast * 20.0, kAdult, true, sharp);
    expectAt(end, {(2 - .25) * std::sqrt(2), 1.6, 0}, 1e-3);
}

TEST(Avatar, FlyingFeelsCeilingsAndSlopes) {
    const auto ceiling = castAt({{{0, -1, 0}, -10}});
    expectAt(slideBy({0, 1.6, 0}, {0, 20, 0}, kAdult, false, ceiling), {0, 9.75, 0});
    const auto slope = castAt({{glm::normalize(glm::dvec3(-1, 2, 0)), 0}});
    expectAt(slideBy({-10, 1.6, 0}, {2, 0, 0}, kAdult, true, slope), {-8, 1.6, 0});  // gentle: ground
    expectAt(slideBy({-1, 1.1, 0}, {2, 0, 0}, kAdult, true, slope), {1, 1.1, 0});    // though rays meet it
    const glm::dvec3 flown = slideBy({-2, .1, 0}, {8, 0, 0}, kAdult, false, slope);
    EXPECT_NEAR(glm::dot(flown, glm::normalize(glm::dvec3(-1, 2, 0))), .25, 1e-3);
    EXPECT_GT(flown.y, .1);
}

TEST(Avatar, StandsOnStairsUpAndDown) {
    const auto stairs = [&](double height) { return castAt({{kAbove, height}}); };
    expectAt(standOrFall({0, 1.6, 0}, 0, .1, kAdult, stairs(.75)).eye, {0, 2.35, 0});
    expectAt(standOrFall({0, 1.6, 0}, 0, .1, kAdult, stairs(-.75)).eye, {0, .85, 0});
    EXPECT_TRUE(standOrFall({0, 1.6, 0}, 0, .1, kAdult, stairs(.76)).blocked);
    EXPECT_FALSE(standOrFall({0, 1.6, 0}, 0, .1, kAdult, stairs(.75)).blocked);
    EXPECT_NEAR(standOrFall({0, 1.6, 0}, 3, .1, kAdult, stairs(-.5)).eye.y, 1.6 - 3 * .1 - kGravity / 2 * .01, 1e-12)
        << "who is in the air already does not snap to the ground";
    EXPECT_EQ(standOrFall({0, 1.6, 0}, 0, 10, kAdult, castAt({})).eye, glm::dvec3(0, 1.6, 0)) << "no ground, no fall";
}

TEST(Avatar, WalksOverWhatIsNoHigherThanAStep) {
    for (const double height : {.3, .75, .76, 3.0}) {
        // The face at x = 5 of a thing that ends at `height`; the eye is 1.6 above the ground.
        const CastRay cast = [&](const glm::dvec3& origin, const glm::dvec3& direction, double length) {
            const double t = (5 - origin.x) / direction.x;
            const bool meets = t >= 0 && t <= length && origin.y + direction.y * t <= height;
            return meets ? std::optional(Met{t, {-1, 0, 0}}) : std::nullopt;
        };
        expectAt(slideBy({0, 1.6, 0}, {9, 0, 0}, kAdult, true, cast), {height > .75 ? 4.75 : 9, 1.6, 0});
    }
}

TEST(Avatar, LandsOnTheGround) {
    const Stand stand = standOrFall({0, 2.6, 0}, 2, .5, kAdult, castAt({{kAbove, 0}}));  // 2.2 m in the air
    EXPECT_EQ(stand.eye, glm::dvec3(0, 1.6, 0));
    EXPECT_EQ(stand.fallSpeed, 0);
}

TEST(Avatar, FallsByGravityHoweverTimeIsCut) {
    const auto ground = castAt({{kAbove, -1000}});
    for (const int parts : {1, 7, 1000}) {
        Stand stand{{0, 0, 0}, 0, false};
        for (int i = 0; i < parts; ++i) stand = standOrFall(stand.eye, stand.fallSpeed, 3.0 / parts, kAdult, ground);
        EXPECT_NEAR(stand.eye.y, -kGravity / 2 * 9, 1e-9) << parts;
        EXPECT_NEAR(stand.fallSpeed, kGravity * 3, 1e-9) << parts;
        stand = standOrFall(stand.eye, stand.fallSpeed, 100, kAdult, ground);
        EXPECT_EQ(stand.eye.y, -998.4);
        EXPECT_EQ(stand.fallSpeed, 0);
    }
}

TEST(Avatar, TurnsAndGoesRound) {
    const ViewerPose pose{{0, 0, 5}, {1, 0, 0, 0}};
    const ViewerPose side = orbited(pose, {0, 0, 1}, M_PI / 2, 0);
    expectAt(side.position, {4, 0, 1});
    expectAt(side.orientation * kNorth, {-1, 0, 0});
    const ViewerPose over = orbited(pose, {0, 0, 0}, 0, -M_PI / 6);
    expectAt(over.position, {0, 2.5, 5 * std::sqrt(.75)});
    expectAt(over.orientation * kNorth, glm::normalize(-over.position));
    const ViewerPose left = turned(pose, M_PI / 2, M_PI / 4);
    expectAt(left.orientation * kNorth, {-std::sqrt(.5), std::sqrt(.5), 0});
    expectAt(turned(left, 0, 9).orientation * kNorth, {-std::cos(89 * M_PI / 180), std::sin(89 * M_PI / 180), 0});
    expectAt(turned(turned(left, 0, 9), 0, -.5).orientation * kNorth,
             {-std::cos(89 * M_PI / 180 - .5), std::sin(89 * M_PI / 180 - .5), 0});
    for (const glm::dvec3& direction :
         {kEast, kNorth, glm::dvec3(1, 2, 3), glm::dvec3(0, 1, 0), glm::dvec3(0, -2, 0)}) {
        const glm::dquat q = lookAlong(direction, pose);
        expectAt(q * kNorth, glm::normalize(direction));
        EXPECT_NEAR(glm::length(q), 1, 1e-12);
        EXPECT_GE((q * kAbove).y, -1e-12) << "upright";
    }
}

}  // namespace
}  // namespace rtsg
