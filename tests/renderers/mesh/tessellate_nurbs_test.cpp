// NURBS against closed forms: circles, spheres, tori, trimmed areas, and the error that cuts are asked to keep.
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/nurbs.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/tessellate.h>

#include "mesh_check.h"

namespace rtsg {
namespace {

Mesh nurbsMesh(const std::string& geometry, float chordError = .0025f) {
    Scene scene;
    Diagnostics diagnostics;
    EXPECT_TRUE(
        loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry DEF G " + geometry + " }", diagnostics));
    for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    TessellationOptions options;
    options.chordError = chordError;
    const auto mesh = tessellate(scene, scene.findName("G"), options);
    EXPECT_TRUE(mesh);
    return mesh ? Mesh(**mesh) : Mesh();
}
std::string said(const Mesh& mesh) {
    std::string all;
    for (const Diagnostic& d : mesh.diagnostics.all()) all += d.text + "\n";
    return all;
}

// A circle as nine points of order 3 (The NURBS Book, 7.5).
const char* const kCircleKnots = "0 0 0 1 1 2 2 3 3 4 4 4";
const double kRoot = std::sqrt(.5);
const Vec2d kCircle[9] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}, {1, 0}};
double circleWeight(int i) {
    return i % 2 ? kRoot : 1;
}
/// The nine points of a circle as fields have them, times their weights; `place` says where a corner is.
template <class F>
std::string circleOf(const F& map) {
    std::string text;
    for (int i = 0; i < 9; ++i) {
        const auto p = map(kCircle[i]) * circleWeight(i);
        for (glm::length_t c = 0; c < p.length(); ++c) text += fmt::format("{} ", p[c]);
        text += ",";
    }
    return text;
}
std::string weights(int rows, const std::vector<double>& row = {1}) {
    std::string text;
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i < 9; ++i)
            text += fmt::format("{} ", row[static_cast<std::size_t>(j) % row.size()] * circleWeight(i));
    return text;
}

TEST(NurbsCurves, ACircleIsRoundToItsError) {
    const std::string points = circleOf([](const Vec2d& p) { return Vec3d(3 * p.x, 3 * p.y, 2); });
    const std::string text =
        fmt::format("NurbsCurve {{ order 3 knot [ {} ] weight [ {} ] controlPoint CoordinateDouble {{ point [ {} ] }}",
                    kCircleKnots, weights(1), points);
    std::uint32_t before = 0;
    for (const float error : {.01f, .0025f, .0001f}) {
        const Mesh mesh = nurbsMesh(text + " }", error);
        ASSERT_GT(mesh.strokeCount, before);
        before = mesh.strokeCount;
        const double allowed = error * std::sqrt(18.);  // of half the diagonal of the control points
        for (std::uint32_t i = 0; i < mesh.strokeCount; ++i) {
            const Vec2d a(mesh.vertex(i, 0)), b(mesh.vertex(i, 1));
            EXPECT_NEAR(glm::length(a), 3, 1e-5);
            EXPECT_LT(3 - glm::length((a + b) * .5), allowed);
        }
        // And not much finer than asked.
        EXPECT_LT(mesh.strokeCount, 2.5 * kPiOfMesh / std::acos(1 - allowed / 3));
    }
    EXPECT_EQ(nurbsMesh(text + " tessellation 40 }").strokeCount, 40u);
    EXPECT_EQ(nurbsMesh(text + " tessellation -5 }").strokeCount, 45u);
}

TEST(NurbsCurves, KnotsThatDoNotFitAreEven) {
    // Even knots of order 2: a polyline between its points.
    const Mesh line = nurbsMesh("NurbsCurve { order 2 controlPoint Coordinate { point [ 0 0 0, 1 2 0, 3 0 0 ] } }");
    EXPECT_TRUE(said(line).empty()) << said(line);
    ASSERT_EQ(line.strokeCount, 2u);
    EXPECT_EQ(line.vertex(0, 1), Vec3f(1, 2, 0));
    // An even quadratic reaches its ends, and in between the middle of its polygon's inner side.
    const Mesh even = nurbsMesh(
        "NurbsCurve { order 3 tessellation 2 knot [ 3 2 1 0 0 0 0 ] "
        "controlPoint Coordinate { point [ 0 0 0, 2 0 0, 2 2 0, 5 2 0 ] } }");
    EXPECT_NE(said(even).find("even"), std::string::npos);
    ASSERT_EQ(even.strokeCount, 2u);
    EXPECT_LT(glm::distance(even.vertex(0, 0), Vec3f(0, 0, 0)), 1e-6f);
    EXPECT_LT(glm::distance(even.vertex(0, 1), Vec3f(2, 1, 0)), 1e-6f);
    EXPECT_LT(glm::distance(even.vertex(1, 1), Vec3f(5, 2, 0)), 1e-6f);
    // Closed it comes back to where it began.
    const Mesh closed = nurbsMesh(
        "NurbsCurve { order 3 closed TRUE controlPoint Coordinate { point [ 0 0 0, 2 0 0, 2 2 0, 0 2 0, 0 0 0 ] } }");
    EXPECT_LT(glm::distance(closed.vertex(0, 0), closed.vertex(closed.strokeCount - 1, 1)), 1e-6f);
    EXPECT_LT(glm::distance(closed.vertex(0, 0), Vec3f(1, 0, 0)), 1e-6f) << "rounded everywhere alike";
    // Knots that do not fit are none.
    const Mesh unfit = nurbsMesh(
        "NurbsCurve { order 3 closed TRUE knot [ 0 1 2 3 4 ] "
        "controlPoint Coordinate { point [ 0 0 0, 2 0 0, 2 2 0, 0 2 0, 0 0 0 ] } }");
    EXPECT_NE(said(unfit).find("do not fit 5 control points of order 3"), std::string::npos) << said(unfit);
    EXPECT_LT(glm::distance(unfit.vertex(0, 0), Vec3f(1, 0, 0)), 1e-6f);
    EXPECT_EQ(unfit.strokeCount, closed.strokeCount);
    // A curve whose ends differ is not closed, whatever the field says.
    const Mesh open = nurbsMesh(
        "NurbsCurve { order 3 closed TRUE controlPoint Coordinate { point [ 0 0 0, 2 0 0, 2 2 0, 0 2 0 ] } }");
    EXPECT_EQ(open.vertex(0, 0), Vec3f(0));
    EXPECT_LT(glm::distance(open.vertex(open.strokeCount - 1, 1), Vec3f(0, 2, 0)), 1e-6f);
}

TEST(NurbsSurfaces, ReachTheirCornersWithoutKnots) {
    const Mesh patch = nurbsMesh(
        "NurbsPatchSurface { uDimension 4 vDimension 3 controlPoint Coordinate { point [ "
        "0 0 0, 1 1 0, 2 1 0, 3 0 0, 0 1 1, 1 2 1, 2 2 1, 3 1 1, 0 0 2, 1 1 2, 2 1 2, 3 0 2 ] } }");
    EXPECT_TRUE(said(patch).empty()) << said(patch);
    EXPECT_LT(glm::distance(patch.bounds.min, Vec3f(0)), 1e-6f);
    EXPECT_NEAR(patch.bounds.max.x, 3, 1e-6);
    EXPECT_NEAR(patch.bounds.max.z, 2, 1e-6);
    // Closed along u it is a ring, whose seam is rounded as the rest is.
    const Mesh ring = nurbsMesh(
        "NurbsPatchSurface { uClosed TRUE uDimension 5 vDimension 2 vOrder 2 controlPoint Coordinate { point [ "
        "1 0 1, -1 0 1, -1 0 -1, 1 0 -1, 1 0 1, 1 2 1, -1 2 1, -1 2 -1, 1 2 -1, 1 2 1 ] } }");
    EXPECT_NEAR(ring.bounds.max.x, 1, 1e-5) << "the middles of the sides";
    EXPECT_NEAR(ring.bounds.min.z, -1, 1e-5);
    EXPECT_NEAR(ring.bounds.max.y, 2, 1e-6);
    const Mesh unfit = nurbsMesh(
        "NurbsPatchSurface { uClosed TRUE uKnot 0 uDimension 5 vDimension 2 vOrder 2 controlPoint Coordinate { point [ "
        "1 0 1, -1 0 1, -1 0 -1, 1 0 -1, 1 0 1, 1 2 1, -1 2 1, -1 2 -1, 1 2 -1, 1 2 1 ] } }");
    EXPECT_NE(said(unfit).find("along u do not fit 5"), std::string::npos) << said(unfit);
    EXPECT_EQ(unfit.bounds.min, ring.bounds.min);
    EXPECT_EQ(unfit.bounds.max, ring.bounds.max);
    for (std::uint32_t t = 0; t < ring.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const Vec3f p = ring.vertex(t, c);
            EXPECT_LT(std::hypot(p.x, p.z), 1.13) << "no corner is reached";
        }
}

/// A surface of revolution about y: rows of circles through (r, y) of the profile's points.
std::string revolved(const std::vector<Vec2d>& profile, const std::vector<double>& profileWeights, int order,
                     const char* knots) {
    std::string points;
    for (std::size_t i = 0; i < profile.size(); ++i) {
        const Vec2d row = profile[i];
        const double w = profileWeights[i % profileWeights.size()];
        points += circleOf([&](const Vec2d& p) { return w * Vec3d(row.x * p.x, row.y, -row.x * p.y); });
    }
    return fmt::format(
        "NurbsPatchSurface {{ uDimension 9 vDimension {} uOrder 3 vOrder {} uKnot [ {} ] vKnot [ {} ] weight [ {} ] "
        "controlPoint CoordinateDouble {{ point [ {} ] }}",
        profile.size(), order, kCircleKnots, knots, weights(static_cast<int>(profile.size()), profileWeights), points);
}
std::string sphere(double r) {
    // Half a circle from the south pole to the north.
    return revolved({{0, -r}, {r, -r}, {r, 0}, {r, r}, {0, r}}, {1, kRoot, 1, kRoot, 1}, 3, "0 0 0 1 1 2 2 2");
}

TEST(NurbsSurfaces, ASphereIsRoundToItsErrorAndClosed) {
    for (const float error : {.02f, .0025f}) {
        const Mesh mesh = nurbsMesh(sphere(2) + " }", error);
        EXPECT_TRUE(said(mesh).empty()) << said(mesh);
        EXPECT_EQ(findDefect(mesh), "");
        const double allowed = error * std::sqrt(12.);
        double deepest = 0;
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
            for (const auto& [u, v] : {std::pair(1 / 3.f, 1 / 3.f), {.5f, 0.f}, {0.f, .5f}, {.5f, .5f}})
                deepest = std::max(deepest, 2. - glm::length(mesh.position(t, u, v)));
            for (std::uint32_t c = 0; c < 3; ++c) {
                const Vec3f p = mesh.vertex(t, c);
                EXPECT_NEAR(glm::length(p), 2, 1e-5);
                const Vec3f n = mesh.shadingNormal(t, c == 1, c == 2);
                EXPECT_GT(glm::dot(n, p) / 2, .9999f);
            }
            EXPECT_GT(glm::dot(mesh.geometricNormal(t), mesh.position(t, 1 / 3.f, 1 / 3.f)), 0);
        }
        EXPECT_LT(deepest, allowed);
        EXPECT_GT(deepest, allowed / 12) << "much finer than asked for";
        EXPECT_NEAR(surfaceArea(mesh), 16 * kPiOfMesh, 16 * kPiOfMesh * 3 * allowed);
        EXPECT_NEAR(enclosedVolume(mesh), 32 * kPiOfMesh / 3, 32 * kPiOfMesh * allowed);
    }
}

TEST(NurbsSurfaces, TessellationSaysHowManyParts) {
    EXPECT_EQ(nurbsMesh(sphere(1) + " uTessellation 8 vTessellation 4 }").triangleCount, 8u * 2 * 4 - 16);
    EXPECT_GT(nurbsMesh(sphere(1) + " uTessellation -2 vTessellation -2 }").triangleCount, 300u);
}

TEST(NurbsSurfaces, TexturesLieAlongTheirParametersOrTheirOwnSurface) {
    const std::string flat =
        "NurbsPatchSurface { uDimension 2 vDimension 2 uOrder 2 vOrder 2 uKnot [ 0 0 1 1 ] vKnot [ 0 0 1 1 ] "
        "controlPoint Coordinate { point [ 0 0 0, 4 0 0, 0 2 0, 4 2 0 ] }";
    const auto st = [](const Mesh& mesh, Vec2f at) {
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
            for (std::uint32_t c = 0; c < 3; ++c)
                if (glm::distance(Vec2f(mesh.vertex(t, c)), at) < 1e-6f) return Vec2f(mesh.texCoord(t, c == 1, c == 2));
        ADD_FAILURE();
        return Vec2f(-1);
    };
    EXPECT_EQ(st(nurbsMesh(flat + " }"), {4, 0}), Vec2f(1, 0));
    EXPECT_EQ(st(nurbsMesh(flat + " uTessellation 2 vTessellation 2 }"), {2, 1}), Vec2f(.5f));
    const Mesh own = nurbsMesh(
        flat + " uTessellation 2 vTessellation 2 texCoord TextureCoordinate { point [ 1 1, 3 1, 1 2, 3 2 ] } }");
    EXPECT_EQ(st(own, {2, 1}), Vec2f(2, 1.5f));
    const Mesh nurbs = nurbsMesh(flat +
                                 " uTessellation 2 vTessellation 2 texCoord NurbsTextureCoordinate { uDimension 2 "
                                 "vDimension 2 uOrder 2 vOrder 2 "
                                 "uKnot [ 0 0 1 1 ] vKnot [ 0 0 1 1 ] controlPoint [ 0 0, 8 0, 0 6, 8 6 ] } }");
    EXPECT_EQ(st(nurbs, {2, 1}), Vec2f(4, 3));
}

TEST(NurbsSurfaces, SwungOnesAreProfilesTimesTrajectories) {
    // A profile circle of radius 1 around (3, 0), swung along a circle: a torus.
    const std::string profile = circleOf([](const Vec2d& p) { return Vec2d(3 + p.x, p.y); }),
                      curve = circleOf([](const Vec2d& p) { return p; });
    const Mesh torus =
        nurbsMesh(fmt::format("NurbsSwungSurface {{ profileCurve NurbsCurve2D {{ order 3 knot [ {0} ] weight [ {1} ] "
                              "controlPoint [ {2} ] }} trajectoryCurve NurbsCurve2D {{ order 3 knot [ {0} ] "
                              "weight [ {1} ] controlPoint [ {3} ] }} }}",
                              kCircleKnots, weights(1), profile, curve),
                  .001f);
    EXPECT_TRUE(said(torus).empty()) << said(torus);
    for (std::uint32_t t = 0; t < torus.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const Vec3d p(torus.vertex(t, c));
            EXPECT_NEAR(std::hypot(std::hypot(p.x, p.z) - 3, p.y), 1, 1e-5);
        }
    EXPECT_NEAR(surfaceArea(torus), 4 * kPiOfMesh * kPiOfMesh * 3, .5);
    EXPECT_NEAR(std::abs(enclosedVolume(torus)), 2 * kPiOfMesh * kPiOfMesh * 3, .5);
    const Mesh turned = nurbsMesh(
        fmt::format("NurbsSwungSurface {{ ccw FALSE profileCurve NurbsCurve2D {{ order 3 knot [ {0} ] weight [ "
                    "{1} ] controlPoint [ {2} ] }} trajectoryCurve NurbsCurve2D {{ order 3 knot [ {0} ] "
                    "weight [ {1} ] controlPoint [ {3} ] }} }}",
                    kCircleKnots, weights(1), profile, curve),
        .001f);
    EXPECT_NEAR(enclosedVolume(turned), -enclosedVolume(torus), 1e-3);
}

TEST(NurbsSurfaces, SweptOnesFollowTheirTrajectory) {
    const std::string section = circleOf([](const Vec2d& p) { return p; });
    const Mesh tube = nurbsMesh(
        fmt::format("NurbsSweptSurface {{ crossSectionCurve NurbsCurve2D {{ order 3 knot [ {} ] weight [ {} ] "
                    "controlPoint [ {} ] }} trajectoryCurve NurbsCurve {{ order 2 controlPoint "
                    "Coordinate {{ point [ 0 0 0, 0 5 0 ] }} }} }}",
                    kCircleKnots, weights(1), section),
        .001f);
    EXPECT_TRUE(said(tube).empty()) << said(tube);
    EXPECT_NEAR(surfaceArea(tube), 2 * kPiOfMesh * 5, .05);
    const Mesh square = nurbsMesh(
        "NurbsSweptSurface { crossSectionCurve ContourPolyline2D { controlPoint [ -1 -1, 1 -1, 1 1, -1 1, -1 -1 ] } "
        "trajectoryCurve NurbsCurve { order 2 "
        "controlPoint Coordinate { point [ 0 0 0, 0 5 0 ] } } }");
    EXPECT_NEAR(surfaceArea(square), 8 * 5, 1e-4);
}

TEST(NurbsSurfaces, TrimmedOnesHaveTheirContoursInside) {
    // A plane of 4 x 4 m over the domain 0 to 4, cut so that cells and contours cross.
    const auto trimmed = [](const std::string& contours) {
        return "NurbsTrimmedSurface { uDimension 3 vDimension 3 uOrder 3 vOrder 3 uKnot [ 0 0 0 4 4 4 ] vKnot [ 0 0 0 "
               "4 4 4 ] uTessellation 7 vTessellation 5 solid FALSE "
               "controlPoint Coordinate { point [ 0 0 0, 2 0 0, 4 0 0, 0 2 0, 2 2 0, 4 2 0, 0 4 0, 2 4 0, 4 4 0 ] } "
               "trimmingContour [ " +
               contours + " ] }";
    };
    const std::string outer =
        "Contour2D { children ContourPolyline2D { controlPoint [ .5 .5, 3.5 .5, 3.5 3.5, .5 3.5, .5 .5 ] } }";
    const Mesh square = nurbsMesh(trimmed(outer));
    EXPECT_EQ(findDefect(square), "");
    EXPECT_NEAR(surfaceArea(square), 9, 1e-5);
    EXPECT_EQ(square.bounds.min, Vec3f(.5f, .5f, 0));
    EXPECT_EQ(square.bounds.max, Vec3f(3.5f, 3.5f, 0));
    for (std::uint32_t t = 0; t < square.triangleCount; ++t) EXPECT_GT(square.geometricNormal(t).z, .99f);
    const std::string circle = circleOf([](const Vec2d& p) { return Vec2d(2 + p.x, 2 - p.y); });
    const std::string hole =
        fmt::format("Contour2D {{ children NurbsCurve2D {{ order 3 knot [ {} ] weight [ {} ] controlPoint [ {} ] }} }}",
                    kCircleKnots, weights(1), circle);
    EXPECT_NEAR(surfaceArea(nurbsMesh(trimmed(outer + hole), .0001f)), 9 - kPiOfMesh, 1e-3);
    EXPECT_NEAR(surfaceArea(nurbsMesh(trimmed(hole), .0001f)), kPiOfMesh, 1e-3);
    EXPECT_NEAR(surfaceArea(nurbsMesh(trimmed(""))), 16, 1e-5);
    // A contour of two pieces, the second of which leads back.
    EXPECT_NEAR(surfaceArea(nurbsMesh(trimmed("Contour2D { children [ ContourPolyline2D { controlPoint [ 1 1, 3 1 ] } "
                                              "ContourPolyline2D { controlPoint [ 3 1, 1 3, 1 1 ] } ] }"))),
                2, 1e-5);
    // Beyond the domain there is nothing.
    EXPECT_NEAR(surfaceArea(nurbsMesh(trimmed(
                    "Contour2D { children ContourPolyline2D { controlPoint [ -9 -9, 9 -9, 9 2, -9 2, -9 -9 ] } }"))),
                8, 1e-4);
}

TEST(NurbsSurfaces, WhatCannotBeIsNamed) {
    for (const char* bad : {
             "NurbsPatchSurface { uDimension 3 vDimension 3 controlPoint Coordinate { point [ 0 0 0 ] } }",
             "NurbsPatchSurface { uDimension 2 vDimension 2 uOrder 3 vOrder 3 controlPoint Coordinate { point [ 0 0 0, "
             "1 0 0, 0 1 0, 1 1 0 ] } }",
             "NurbsPatchSurface { uDimension 2147483647 vDimension 2147483647 controlPoint Coordinate { point [ 0 0 0 "
             "] } }",
             "NurbsCurve { order 2000000000 controlPoint Coordinate { point [ 0 0 0, 1 0 0 ] } }",
             "NurbsSweptSurface { }",
             "NurbsSwungSurface { profileCurve ContourPolyline2D { } }",
         }) {
        const Mesh mesh = nurbsMesh(bad);
        EXPECT_EQ(mesh.triangleCount + mesh.strokeCount, 0u) << bad;
        EXPECT_FALSE(said(mesh).empty()) << bad;
    }
    // A point far away asks for many parts, of which there are bounds.
    EXPECT_EQ(
        findDefect(nurbsMesh(
            "NurbsPatchSurface { uDimension 3 vDimension 3 uKnot [ 0 0 0 1 1 1 ] vKnot [ 0 0 0 1 1 1 ] "
            "controlPoint Coordinate { point [ 0 0 0, 2 0 0, 4 0 1e9, 0 2 0, 2 2 0, 4 2 0, 0 4 0, 2 4 0, 4 4 0 ] } }")),
        "");
}

}  // namespace
}  // namespace rtsg
