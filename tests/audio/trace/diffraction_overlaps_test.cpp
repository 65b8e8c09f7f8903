// Edges on one line: which are one, and how far that reaches.
#include <gtest/gtest.h>

#include "edges/diffraction_overlaps.h"

namespace rtsg {
namespace {

/// Along x from one place to another, at a height; faces down and back.
WallEdge along(double from, double to, double height = 0) {
    WallEdge edge;
    edge.from = {from, height, 0};
    edge.axis = {to > from ? 1 : -1, 0, 0};
    edge.length = std::abs(to - from);
    edge.faceA = {0, -1, 0};
    edge.faceB = {0, 0, -1};
    return edge;
}

TEST(EdgeOverlaps, WhatMeetsOnOneLineIsOne) {
    WallEdge both;
    for (const WallEdge& other : {along(2, 5), along(5, 2), along(3, 5), along(5, 1)}) {
        ASSERT_TRUE(joinedEdge(along(0, 3), other, both));
        EXPECT_NEAR(glm::length(both.from + both.axis * both.length - both.from), 5, 1e-12);
        EXPECT_NEAR(std::min(both.from.x, both.from.x + both.axis.x * both.length), 0, 1e-12);
    }
    // The one that lies in the other adds nothing.
    ASSERT_TRUE(joinedEdge(along(1, 2), along(0, 3), both));
    EXPECT_NEAR(both.length, 3, 1e-12);
    WallEdge turned = along(2, 5);
    std::swap(turned.faceA, turned.faceB);
    EXPECT_TRUE(joinedEdge(along(0, 3), turned, both));
}

TEST(EdgeOverlaps, WhatIsApartOrOfOtherFacesIsNot) {
    WallEdge both;
    EXPECT_FALSE(joinedEdge(along(0, 3), along(3.001, 5), both));
    EXPECT_FALSE(joinedEdge(along(0, 3), along(2, 5, .001), both));
    WallEdge other = along(2, 5);
    other.faceB = {0, 0, 1};
    EXPECT_FALSE(joinedEdge(along(0, 3), other, both));
    // The longer one's material would count for both.
    other = along(2, 5);
    other.material = 1;
    EXPECT_FALSE(joinedEdge(along(0, 3), other, both));
    other = along(2, 5);
    other.axis = glm::normalize(glm::dvec3(1, 1e-3, 0));
    EXPECT_FALSE(joinedEdge(along(0, 3), other, both));
}

}  // namespace
}  // namespace rtsg
