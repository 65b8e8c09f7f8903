// Which meshes are round bodies: cylinders, parts of them, and spheres; and which are not.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "audio/trace/round_shapes.h"
#include "geometry/round_shapes.h"
#include "geometry/wall_edges.h"

namespace rtsg {
namespace {

using namespace test;

std::vector<RoundBody> bodiesOf(const Walled& walls) {
    std::vector<RoundBody> bodies;
    walls.geometry.visitRoundBodies([&](const RoundBody& body) { bodies.push_back(body); });
    return bodies;
}
TEST(RoundShapes, PrismsOfFewSidesKeepTheirEdges) {
    for (const int sides : {4, 6, 8, 11}) {
        const Walled prism = cylinderMesh(.5, -1, 1, sides).walled();
        EXPECT_TRUE(bodiesOf(prism).empty()) << sides;
        EXPECT_EQ(prism.edges(), 3 * sides);
    }
}

TEST(RoundShapes, ACylinderIsOneHoweverItIsCut) {
    for (const int sides : {12, 24, 48, 64, 200, 700}) {
        const Walled one = turned({{.5, -1}, {.5, 0}, {.5, .25}, {.5, 1}}, sides).walled();
        const std::vector<RoundBody> bodies = bodiesOf(one);
        ASSERT_EQ(bodies.size(), 1u) << sides;
        EXPECT_FALSE(bodies[0].sphere);
        EXPECT_NEAR(bodies[0].radius, .5, 1e-6);
        EXPECT_NEAR(glm::length(bodies[0].center), 0, 1e-6);
        EXPECT_NEAR(std::abs(bodies[0].axis.z), 1, 1e-9);
        EXPECT_NEAR(bodies[0].halfLength, 1, 1e-6);
        EXPECT_NEAR(bodies[0].facet, 2 * M_PI / sides, 1e-5);
        EXPECT_NEAR(bodies[0].halfArc, M_PI, 1e-9);
        EXPECT_EQ(one.edges(), 2 * sides) << "its rims";
    }
}

TEST(RoundShapes, ASphereIsOneAndNoStripsOfCylinders) {
    for (const int sides : {12, 24, 48, 64}) {
        const std::vector<RoundBody> bodies = bodiesOf(sphereMesh(.5, sides).walled());
        ASSERT_EQ(bodies.size(), 1u) << sides;
        EXPECT_TRUE(bodies[0].sphere);
        EXPECT_NEAR(bodies[0].radius, .5, 1e-4);
    }
}

TEST(RoundShapes, OfACapsuleTheMiddleIsRoundAndOfARoundedBoxTheCorners) {
    std::vector<std::array<double, 2>> capsule;
    for (int i = -8; i <= 8; ++i) {
        const double latitude = i * M_PI / 16;
        const std::array<double, 2> at{std::max(1e-4, .5 * std::cos(latitude)), .5 * std::sin(latitude)};
        if (i <= 0) capsule.push_back({at[0], at[1] - 1});
        if (i >= 0) capsule.push_back({at[0], at[1] + 1});
    }
    const std::vector<RoundBody> middle = bodiesOf(turned(capsule, 32).walled());
    ASSERT_EQ(middle.size(), 1u);
    EXPECT_NEAR(middle[0].halfLength, 1, 1e-6);

    std::vector<glm::dvec3> outline;
    for (int corner = 0; corner < 4; ++corner)
        for (int i = 0; i <= 8; ++i) {
            const glm::dvec3 center(corner == 0 || corner == 3 ? 1 : -1, corner < 2 ? .6 : -.6, 0);
            outline.push_back(center + about(.2, 90.0 * corner + 11.25 * i, 0));
        }
    const std::vector<RoundBody> corners = bodiesOf(drawn(outline, 3).walled());
    ASSERT_EQ(corners.size(), 4u);
    for (const RoundBody& one : corners) {
        EXPECT_NEAR(one.radius, .2, 1e-5);
        EXPECT_NEAR(one.halfArc, M_PI / 4, 1e-5);
        EXPECT_GT(glm::dot(one.middle, glm::normalize(glm::dvec3(one.center.x, one.center.y / .6, 0))), .999);
    }
}

TEST(RoundShapes, OvalsAndConesAreNotRound) {
    std::vector<glm::dvec3> oval;
    for (int i = 0; i < 48; ++i) oval.push_back({.5 * std::cos(i * M_PI / 24), .3 * std::sin(i * M_PI / 24), 0});
    EXPECT_TRUE(bodiesOf(drawn(oval, 3).walled()).empty());
    EXPECT_TRUE(bodiesOf(turned({{.5, -1}, {.2, 1}}, 24).walled()).empty());
}

TEST(RoundShapes, AWaveInALandscapeIsNone) {
    std::vector<glm::dvec3> outline;
    for (int i = 0; i <= 63; ++i) outline.emplace_back(i, 3 * std::sin(.1 * i), 0);
    outline.emplace_back(63, -9, 0);
    outline.emplace_back(0, -9, 0);
    EXPECT_TRUE(bodiesOf(drawn(outline, 60).walled()).empty());
}

TEST(RoundShapes, AnOvalAndADiscHaveEdgesInPlaceOfABody) {
    WorldFromLocal oval(1.0), tall(1.0);
    oval[0][0] = 2;
    tall[2][2] = 3;
    tall[3] = {5, 6, 7};
    const RoundMesh mesh = cylinderMesh(.5, -1, 1, 48);
    const Walled stretched = mesh.walled(0, {oval});
    EXPECT_TRUE(bodiesOf(stretched).empty());
    EXPECT_EQ(stretched.edges(), 3 * 48);
    const Walled disc = cylinderMesh(.6, .7, .74, 32).walled();
    EXPECT_TRUE(bodiesOf(disc).empty());
    EXPECT_EQ(disc.edges(), 3 * 32);
    const std::vector<RoundBody> bodies = bodiesOf(mesh.walled(0, {tall}));
    ASSERT_EQ(bodies.size(), 1u);
    EXPECT_NEAR(bodies[0].halfLength, 3, 1e-6);
    EXPECT_NEAR(bodies[0].radius, .5, 1e-6);
    EXPECT_NEAR(glm::distance(bodies[0].center, glm::dvec3(5, 6, 7)), 0, 1e-6);
}

}  // namespace
}  // namespace rtsg
