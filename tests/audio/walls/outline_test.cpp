// Outlines of openings: which places they hold, and how long and wide they are.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "walls/outline.h"

namespace rtsg {
namespace {

using opening::Outline;
using opening::outlineOf;

/// A parallelogram about `center`, in the plane z = 2.
Outline parallelogram(double length, double width, double skew) {
    const glm::dvec3 center(1, -3, 2), a(length / 2, 0, 0), b(skew / 2, width / 2, 0);
    return outlineOf({center - a - b, center + a - b, center + a + b, center - a + b}, {0, 0, 1});
}

TEST(Outline, HoldsWhatIsInItOrNearer) {
    const Outline outline = parallelogram(4, 1, 0);
    EXPECT_NEAR(outline.area, 4, 1e-9);
    EXPECT_LT(glm::distance(outline.center, glm::dvec3(1, -3, 2)), 1e-9);
    for (const double height : {0.0, .7}) {  // above its plane or on it
        const auto at = [&](double x, double y) { return glm::dvec3(1 + x, -3 + y, 2 + height); };
        EXPECT_TRUE(outline.holds(at(0, 0), 1, 0));
        EXPECT_TRUE(outline.holds(at(1.9, .45), 1, 0));
        EXPECT_FALSE(outline.holds(at(2.1, 0), 1, .01));
        EXPECT_TRUE(outline.holds(at(2.1, 0), 1, .11));
        EXPECT_TRUE(outline.holds(at(0, -.6), 1, .11));
        EXPECT_FALSE(outline.holds(at(2.1, .6), 1, .11));  // .14 from the corner
        EXPECT_TRUE(outline.holds(at(2.1, .52), 1, .11));
        // Inside the outline enlarged by this factor.
        EXPECT_TRUE(outline.holds(at(2.1, 0), 1.06, 0));
        EXPECT_FALSE(outline.holds(at(2.1, 0), 1.04, 0));
        EXPECT_FALSE(outline.holds(at(2.1, 0), 1, 0));
    }
}

TEST(Outline, WhatIsLongAndNarrowIsAsWideAsItsAreaSays) {
    EXPECT_NEAR(parallelogram(4, 1, 0).length(), 4, 1e-9);
    EXPECT_NEAR(parallelogram(4, 1, 0).width(), 1, 1e-9);
    // Cut off aslant, it lies a little turned, and across its axis seems wider than it is.
    const Outline crack = parallelogram(3, .02, .3);
    EXPECT_NEAR(crack.width() * crack.length(), crack.area, 1e-9);
    EXPECT_NEAR(crack.area, .06, 1e-9);
    EXPECT_LT(crack.width(), .02);
}

/// The axes of a square's moments are any: its sides are not its diagonal.
TEST(Outline, ASquareHasItsSidesHoweverItLies) {
    const auto turned = [](double length, double width, double angle, int corners) {
        std::vector<glm::dvec3> points;
        for (int i = 0; i < corners; ++i) {
            // Along its sides, as a rim is felt.
            const int side = i * 4 / corners;
            const double t = 8.0 * i / corners - 2 * side - 1;
            const glm::dvec2 flat[] = {{t, -1}, {1, t}, {-t, 1}, {-1, -t}};
            const glm::dvec2 p = flat[side] * glm::dvec2(length / 2, width / 2);
            points.emplace_back(std::cos(angle) * p.x - std::sin(angle) * p.y,
                                std::sin(angle) * p.x + std::cos(angle) * p.y, 1);
        }
        return outlineOf(points, {0, 0, 1});
    };
    for (const double angle : {0., .3, .785, 1.2, 1.5, 2.5}) {
        const Outline square = turned(.2, .2, angle, 128), nearly = turned(.2, .17, angle, 4);
        EXPECT_NEAR(square.length(), .2, .001) << angle;
        EXPECT_NEAR(square.width(), .2, .001) << angle;
        EXPECT_NEAR(nearly.length(), .2, .001) << angle;
        EXPECT_NEAR(nearly.width(), .17, .001) << angle;
    }
    EXPECT_NEAR(turned(3, 1, .4, 64).length(), 3, 1e-9);
    EXPECT_NEAR(turned(1, 3, .4, 64).length(), 3, 1e-9);
    EXPECT_NEAR(turned(1, 3, .4, 64).width(), 1, 1e-9);
}

}  // namespace
}  // namespace rtsg
