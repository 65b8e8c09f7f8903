// Avatars among triangles, against distances that are sampled densely.
#include "input/avatar_sweep.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

using Facet = std::array<glm::dvec3, 3>;
const Avatar kGrown;  // .25, 1.6, .75

/// From the avatar's axis, or from its eye if it flies, to the nearest of many points of the triangle.
double sampled(const glm::dvec3& eye, const Facet& t, bool walks) {
    constexpr int kParts = 160;
    double nearest = INFINITY;
    for (int i = 0; i <= kParts; ++i)
        for (int j = 0; i + j <= kParts; ++j) {
            const glm::dvec3 p = t[0] + (t[1] - t[0]) * (double(i) / kParts) + (t[2] - t[0]) * (double(j) / kParts);
            glm::dvec3 away = p - eye;
            if (walks) {
                if (p.y > eye.y || p.y < eye.y - kGrown.height + kGrown.step) continue;
                away.y = 0;
            }
            nearest = std::min(nearest, glm::length(away));
        }
    return nearest;
}

TEST(AnAvatarsSweep, EndsWhereTheRadiusIsReached) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> position(-1.5, 1.5), angle(-M_PI, M_PI);
    int met = 0;
    for (int i = 0; i < 600; ++i) {
        const bool walks = i % 2 == 0;
        Facet triangle;
        for (glm::dvec3& corner : triangle) corner = {position(random), 1.6 + position(random), position(random)};
        const double a = angle(random);
        const AvatarPath path{{2.5 * std::cos(a), 1.6, 2.5 * std::sin(a)}, {-std::cos(a), 0, -std::sin(a)}, 5, walks};
        if (sampled(path.eye, triangle, walks) < kGrown.radius + .1) continue;
        const auto contact = sweepAvatar(path, kGrown, triangle);
        const glm::dvec3 normal = glm::cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
        if (walks && std::abs(normal.y) > .45 * glm::length(normal)) continue;  // may be ground
        double first = INFINITY;
        for (double gone = 0; gone < 5 && first == INFINITY; gone += .02)
            if (sampled(path.eye + path.direction * gone, triangle, walks) < kGrown.radius - .02) first = gone;
        if (!contact) {
            EXPECT_EQ(first, INFINITY) << i;
            continue;
        }
        ++met;
        EXPECT_LT(contact->distance, first + .03) << i;
        EXPECT_GT(sampled(path.eye + path.direction * contact->distance, triangle, walks), kGrown.radius - 1e-3)
            << i;  // of 314 one is .3 mm too near
        EXPECT_NEAR(glm::length(contact->normal), 1, 1e-9);
        EXPECT_LT(glm::dot(contact->normal, path.direction), 0);
    }
    EXPECT_GT(met, 100);
}

/// A pole of 4 cm, wherever it stands before the avatar: it is met at the radius, or passed beside it.
TEST(AnAvatarsSweep, MeetsThinPoles) {
    for (double aside = -.4; aside <= .4; aside += .01) {
        const Facet pole{{{aside - .02, -9, 0}, {aside + .02, -9, 0}, {aside, 90, 0}}};
        for (const bool walks : {true, false}) {
            const auto met = sweepAvatar({{0, 1.6, 5}, {0, 0, -1}, 10, walks}, kGrown, pole);
            const double edge = std::max(0., std::abs(aside) - .02);
            if (edge > .25) {
                EXPECT_FALSE(met) << aside;
            }
            if (edge > .23) continue;
            ASSERT_TRUE(met) << aside;
            EXPECT_NEAR(met->distance, 5 - std::sqrt(.0625 - edge * edge), .01) << aside;
        }
    }
}

/// A rail at the height of the breast, and one that a step takes.
TEST(AnAvatarsSweep, MeetsRailsAboveAStep) {
    const auto rail = [](double height) { return Facet{{{-20, height, 0}, {20, height, 0}, {0, height + .03, 0}}}; };
    const auto met = sweepAvatar({{0, 1.6, 5}, {0, 0, -1}, 10, true}, kGrown, rail(1.1));
    ASSERT_TRUE(met);
    EXPECT_NEAR(met->distance, 4.75, 1e-6);
    EXPECT_FALSE(sweepAvatar({{0, 1.6, 5}, {0, 0, -1}, 10, true}, kGrown, rail(.5)));
    EXPECT_FALSE(sweepAvatar({{0, 1.6, 5}, {0, 0, -1}, 10, false}, kGrown, rail(1.1))) << "half a metre below a ball";
}

TEST(AnAvatarsSweep, SlidesRoundAPole) {
    const Facet pole{{{.08, -9, 0}, {.12, -9, 0}, {.1, 90, 0}}};
    const glm::dvec3 end =
        slideBy({0, 1.6, 5}, {0, 0, -10}, [&](const glm::dvec3& eye, const glm::dvec3& direction, double length) {
            const auto met = sweepAvatar({eye, direction, length, true}, kGrown, pole);
            const glm::dvec3 at = eye + direction * (met ? met->distance : length);
            EXPECT_GT(std::hypot(at.x - .1, at.z), .25 - .021);
            return met;
        });
    EXPECT_LT(end.x, -.05) << "it goes aside";
}

/// 61 degrees are too steep for more than a step; 59 and stairs are not.
TEST(AnAvatarsSweep, SlopesOfMoreThanSixtyDegreesAreNotClimbed) {
    const auto highest = [](const std::function<double(double)>& ground, double steep) {
        const CastRay cast = [&](const glm::dvec3& from, const glm::dvec3&, double) -> std::optional<Met> {
            return Met{from.y - ground(from.x), {-std::sin(steep), std::cos(steep), 0}};
        };
        glm::dvec3 eye(-1, 1.6, 0);
        for (int i = 0; i < 400; ++i) {
            const glm::dvec3 motion(.02, 0, 0);
            const Stand stand = standOrFall(eye + motion, 0, .02, kGrown, cast, motion);
            if (!stand.blocked) eye = stand.eye;
        }
        return eye.y - 1.6;
    };
    for (const double degrees : {30., 59., 61., 65., 71., 80.}) {
        const double steep = degrees * M_PI / 180;
        const double reached = highest([&](double x) { return x > 0 ? x * std::tan(steep) : 0; }, steep);
        if (degrees < 60)
            EXPECT_GT(reached, 3) << degrees;
        else
            EXPECT_LT(reached, .8 + .02 * std::tan(steep)) << degrees;
    }
    EXPECT_GT(highest([](double x) { return x > 0 ? .3 * std::floor(x / .2) : 0; }, 0), 3) << "a steep stair";
}

}  // namespace
}  // namespace rtsg
