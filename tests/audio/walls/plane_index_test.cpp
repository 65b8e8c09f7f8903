// Planes that are one, and planes that only look like it.
#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "walls/plane_index.h"

namespace rtsg {
namespace {

/// Where two coordinates of a normal are alike, rounding says which of them is the larger, and so the sign.
TEST(PlaneIndex, APlaneIsFoundWhicheverOfTwoLikeCoordinatesIsLarger) {
    const glm::dvec3 along = glm::normalize(glm::dvec3(1, 1, 0));
    for (const double more : {0.0, 1e-9, -1e-9})
        for (const double less : {0.0, 1e-9, -1e-9})
            for (const double sign : {1.0, -1.0}) {
                PlaneIndex index;
                ReflectingPlane plane;
                plane.normal = glm::normalize(glm::dvec3(1 + more, -1, .3));
                plane.offset = .7;
                const std::uint32_t known = index.insert(plane);
                const glm::dvec3 foot = plane.normal * plane.offset;
                const std::array<glm::dvec3, 3> points{foot, foot + along, foot - along};
                const glm::dvec3 normal = sign * glm::normalize(glm::dvec3(1, -1 + less, .3));
                EXPECT_EQ(index.find(normal, points), known) << more << ' ' << less << ' ' << sign;
            }
}

TEST(PlaneIndex, ASmallSurfaceThatIsTiltedIsOnAPlaneOfItsOwn) {
    PlaneIndex index;
    index.insert({{0, 0, 1}, 0, {}, 1, 1});
    // A millimetre across: nowhere farther off than surfaces of one plane may be.
    const double tilt = .01;
    const glm::dvec3 normal = glm::normalize(glm::dvec3(tilt, 0, 1));
    const std::array<glm::dvec3, 3> points{glm::dvec3(0), glm::dvec3(.001, 0, -.001 * tilt), glm::dvec3(0, .001, 0)};
    EXPECT_EQ(index.find(normal, points), kNoPlane);
    EXPECT_EQ(index.find({0, 0, 1}, points), 0u);
}

TEST(PlaneMerger, TheLargestTriangleSaysWhereAPlaneIs) {
    const auto add = [](PlaneMerger& merger, double size, double tilt) {
        return merger.add({0, 0, 0}, {size, 0, tilt * size}, {0, size, 0});
    };
    for (const bool smallFirst : {true, false}) {
        PlaneMerger merger;
        for (const bool small : {smallFirst, !smallFirst})
            EXPECT_EQ(small ? add(merger, .01, 1e-5) : add(merger, 6, 0), 0u);
        const auto planes = merger.finish();
        ASSERT_EQ(planes.size(), 1u);
        EXPECT_LT(glm::length(glm::cross(planes[0].normal, glm::dvec3(0, 0, 1))), 1e-12) << smallFirst;
        EXPECT_NEAR(planes[0].radius, 3 * std::sqrt(2.0), 1e-6);
    }
}

TEST(PlaneMerger, SmallTrianglesHavePlanesToo) {
    PlaneMerger merger;
    EXPECT_EQ(merger.add({0, 0, 0}, {1e-4, 0, 0}, {0, 1e-4, 0}), 0u);
    EXPECT_EQ(merger.add({0, 0, 0}, {1e-4, 0, 0}, {0, 0, 1e-4}), 1u);
}

}  // namespace
}  // namespace rtsg
