// Places on walls are moved off them: in corners of every angle to where they are before both walls.
#include <cmath>

#include <gtest/gtest.h>

#include "audio/triangle_geometry.h"
#include "trace/places.h"

namespace rtsg {
namespace {

TEST(Places, InACornerOfAnyAngleAPlaceComesOffBothWalls) {
    for (const double degrees : {10.0, 20.0, 30.0, 60.0, 90.0, 140.0}) {
        const double angle = degrees * M_PI / 180;
        // Two walls from the z axis on; what lies between them is inside.
        const glm::dvec3 first(1, 0, 0), second(std::cos(angle), std::sin(angle), 0), up(0, 0, 1);
        test::TriangleGeometry corner;
        const std::uint32_t material = corner.addMaterial(.1, .1);
        for (const glm::dvec3& side : {first, second})
            corner.addQuad(-up, side * 5.0 - up, side * 5.0 + up, up, material);
        corner.finish();
        const glm::dvec3 inside = glm::normalize(first + second), place(0);
        const glm::dvec3 moved = offWalls(corner, place, inside * 3.0);
        const glm::dvec3 fromFirst(0, 1, 0), fromSecond(std::sin(angle), -std::cos(angle), 0);
        EXPECT_GT(glm::dot(moved, fromFirst), 1e-8) << degrees;
        EXPECT_GT(glm::dot(moved, fromSecond), 1e-8) << degrees;
        EXPECT_LT(glm::length(moved), 1e-4) << degrees;
    }
}

}  // namespace
}  // namespace rtsg
