// How finely curved geometry is cut: errors by closed forms as they are seen, levels that stay, and work that follows.
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/tessellator.h>

#include "flattener_oracle.h"

namespace rtsg {
namespace {

using namespace test;

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// A flattener that follows a scene, and the meshes that it has handed out.
struct Cut {
    Scene scene;
    Diagnostics diagnostics;
    Flattener flattener;
    std::map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;
    std::size_t sent = 0;  // meshes, by the last call

    Cut(const std::string& body, const TessellationError& error) : flattener(with(error)) {
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Immersive\n" + body, diagnostics));
        take(flattener.apply(scene, scene.snapshot()));
    }
    static Flattener::Options with(const TessellationError& error) {
        Flattener::Options options;
        options.error = error;
        return options;
    }
    void take(const InstanceDelta& delta) {
        sent = delta.geometries.size();
        for (const auto& g : delta.geometries) meshes[g.node.value] = g.mesh;
    }
    /// A picture 1,000 pixels wide and high, in which a length at a distance in the middle is 500 / tangent of them.
    static LayerSight sight(const Vec3d& eye, double tangent = 0.5) {
        LayerSight s;
        s.width = s.height = 1000;
        s.eye = eye;
        s.edges = {-tangent, tangent, -tangent, tangent};
        return s;
    }
    void look(const LayerSight& from) {
        flattener.setViewer(from.eye, {from});
        take(flattener.updateViewer(scene));
    }
    void lookFrom(double z) { look(sight({0, 0, z})); }
    void edit() {
        const auto set = scene.seal();
        take(flattener.apply(scene, *set));
    }
    const Mesh& mesh(const char* name) { return *meshes.at(scene.findName(name).value); }
    std::size_t triangles(const char* name) { return mesh(name).triangleCount; }
};

/// The nearest that a triangle's plane comes to the origin: those of a sphere sag by its radius less this.
double minRadius(const Mesh& mesh) {
    double minimum = kUnlimited;
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const auto corner = [&](std::uint32_t c) { return Vec3d(mesh.positions[mesh.vertexIndex(t, c)]); };
        const Vec3d n = glm::cross(corner(1) - corner(0), corner(2) - corner(0));
        if (glm::length(n) > 1e-12) minimum = std::min(minimum, std::abs(glm::dot(corner(0), glm::normalize(n))));
    }
    return minimum;
}

TEST(TessellationByPixels, ASphereIsWithinItsErrorAndNotMuchFiner) {
    Cut cut("Shape { geometry DEF S Sphere { } }", {.pixels = 0.5f});
    for (const double z : {1.2, 2.0, 5.0, 20.0, 100.0, 1000.0, 20000.0}) {
        cut.lookFrom(z);
        // The nearest point is z - 1 away, where a pixel in the middle covers (z - 1) / 1000 of the tangent .5 twice.
        const double pixel = (z - 1) / 1000, sag = 1 - minRadius(cut.mesh("S"));
        EXPECT_LE(sag, 0.5 * pixel) << z;
        // Levels differ by 4; corners of the picture take 1.5, the diagonal 2, whole steps of eight segments 1.4.
        if (z < 100) {
            EXPECT_GE(sag, 0.5 * pixel / 40) << z;
        }
    }
    EXPECT_EQ(cut.triangles("S"), cut.flattener.cuts().triangles);
    EXPECT_EQ(cut.flattener.cuts().ofLevel[0], 1u);
}

TEST(TessellationByPixels, ALargePlaceOfSeveralDecides) {
    Cut cut(
        "Transform { translation -30 0 0 children DEF B Shape { geometry DEF S Sphere { } } } "
        "DEF T Transform { translation 30 0 0 scale 1 1 1 children USE B }",
        {.pixels = 0.5f});
    cut.lookFrom(100);
    const std::size_t before = cut.triangles("S");
    ASSERT_TRUE(cut.scene.set(cut.scene.findName("T"), x3d::Transform::scale, Vec3f(20)));
    cut.edit();
    const double distance = std::hypot(30, 100) - 20;
    EXPECT_GT(cut.triangles("S"), before);
    EXPECT_LE(20 * (1 - minRadius(cut.mesh("S"))), 0.5 * distance / 1000);
}

TEST(TessellationByPixels, WhatTheEyeIsWithinIsCutForItsWallAndNotForItsBox) {
    Cut cut("Shape { geometry DEF S Sphere { radius 100 solid FALSE } }", {.pixels = 0.5f});
    cut.lookFrom(0);
    EXPECT_LE(100 - minRadius(cut.mesh("S")), 0.5 * 100 / 1000);
    EXPECT_EQ(cut.flattener.cuts().tooCoarse, 0u);
    EXPECT_LT(cut.triangles("S"), 100'000u);
    cut.lookFrom(99.999);
    EXPECT_EQ(cut.flattener.cuts().tooCoarse, 1u) << "1 mm before the wall";
    EXPECT_EQ(cut.flattener.cuts().ofLevel[Tessellator::kLevels - 1], 1u);
}

TEST(TessellationByPixels, AnEyeThatSwaysMakesNothingAnew) {
    Cut cut("Shape { geometry Sphere { } } Shape { geometry Cylinder { } } Shape { geometry Box { } }",
            {.pixels = 0.5f});
    cut.lookFrom(10);
    const std::uint64_t created = cut.flattener.cuts().created;
    for (int i = 0; i < 50; ++i) {
        cut.lookFrom(10 + (i % 2) * 0.9 * 10);  // less than twice as far
        EXPECT_EQ(cut.sent, 0u) << i;
    }
    EXPECT_EQ(cut.flattener.cuts().created, created);
    cut.lookFrom(10);
    EXPECT_EQ(cut.sent, 0u) << "the same eye";
    cut.lookFrom(100);
    EXPECT_EQ(cut.sent, 2u) << "ten times as far: the sphere and the cylinder, not the box";
    const std::size_t coarse = cut.flattener.cuts().triangles;
    cut.lookFrom(10);
    EXPECT_EQ(cut.sent, 2u);
    EXPECT_GT(cut.flattener.cuts().triangles, 2 * coarse);
}

TEST(TessellationByPixels, WhatComesOrChangesIsCutAtItsLevelAtOnce) {
    Cut cut("DEF G Group { }", {.pixels = 0.5f});
    cut.look(Cut::sight({0, 0, 3}));
    const NodeId shape = cut.scene.createNode(x3d::Shape::type), sphere = cut.scene.createNode(x3d::Sphere::type);
    ASSERT_TRUE(cut.scene.set(shape, x3d::Shape::geometry, sphere));
    ASSERT_TRUE(cut.scene.insertChild(cut.scene.findName("G"), x3d::Group::children.index, shape));
    cut.edit();
    ASSERT_EQ(cut.sent, 1u);
    EXPECT_LE(1 - minRadius(*cut.meshes.at(sphere.value)), 0.5 * 2 / 1000);
    const std::size_t before = cut.flattener.cuts().triangles;
    ASSERT_TRUE(cut.scene.set(sphere, x3d::Sphere::radius, 0.01f));
    cut.edit();
    EXPECT_LT(cut.flattener.cuts().triangles, before / 8);
    ASSERT_TRUE(cut.scene.removeChild(cut.scene.findName("G"), x3d::Group::children.index, std::size_t{0}));
    cut.edit();
    EXPECT_EQ(cut.flattener.cuts().geometries, 0u);
}

TEST(TessellationByPixels, ParallelViewsAndPanoramasHaveTheirOwnPixels) {
    Cut cut("Shape { geometry DEF S Sphere { } }", {.pixels = 1});
    LayerSight s = Cut::sight({0, 0, 50}, 2);  // 4 metres are 1,000 pixels, however far
    s.kind = LayerSight::Kind::parallel;
    cut.look(s);
    EXPECT_LE(1 - minRadius(cut.mesh("S")), 0.004);
    EXPECT_GE(1 - minRadius(cut.mesh("S")), 0.004 / 20);
    s.kind = LayerSight::Kind::around;  // 4 radians are
    cut.look(s);
    EXPECT_LE(1 - minRadius(cut.mesh("S")), 0.004 * 49);
    EXPECT_GE(1 - minRadius(cut.mesh("S")), 0.004 * 49 / 20);
}

TEST(TessellationByPixels, WithoutAnEyeEverythingIsAsUsual) {
    Cut plain("Shape { geometry DEF S Sphere { } }", {}), cut("Shape { geometry DEF S Sphere { } }", {.pixels = 3});
    EXPECT_EQ(cut.triangles("S"), plain.triangles("S"));
    EXPECT_TRUE(cut.flattener.usesPixels());
    EXPECT_FALSE(plain.flattener.usesPixels());
    cut.lookFrom(2000);
    EXPECT_LT(cut.triangles("S"), plain.triangles("S"));
    cut.flattener.setViewer(std::nullopt);
    cut.take(cut.flattener.updateViewer(cut.scene));
    EXPECT_EQ(cut.triangles("S"), plain.triangles("S"));
}

TEST(TessellationByMetres, HoldsInTheWorldWhateverTheScaleAndTheEye) {
    Cut cut(
        "Transform { scale 7 7 7 children Shape { geometry DEF S Sphere { radius 3 } } } "
        "Transform { scale 1 50 1 children Shape { geometry DEF C Cylinder { } } }",
        {.metres = 0.01f});
    EXPECT_LE(7 * (3 - minRadius(cut.mesh("S"))), 0.01);
    EXPECT_GE(7 * (3 - minRadius(cut.mesh("S"))), 0.01 / 20);
    EXPECT_FALSE(cut.flattener.usesPixels());
    cut.lookFrom(1000);
    EXPECT_EQ(cut.sent, 0u);
}

TEST(TessellationByPixels, CurvesOfAllKindsFollow) {
    // Each is 2 units across; by far and near, the near one has more triangles or strokes.
    for (const char* geometry :
         {"Cone { }", "Cylinder { }", "Disk2D { }", "Disk2D { innerRadius .5 }", "ArcClose2D { }", "Arc2D { }",
          "Circle2D { }", "NurbsCurve { order 3 controlPoint Coordinate { point [ -1 0 0, 0 2 0, 1 0 0 ] } }",
          "NurbsPatchSurface { uDimension 3 vDimension 3 uOrder 3 vOrder 3 controlPoint Coordinate { point [ -1 0 -1, "
          "0 1 -1, 1 0 -1, -1 1 0, 0 3 0, 1 1 0, -1 0 1, 0 1 1, 1 0 1 ] } }"}) {
        Cut cut(fmt::format("Shape {{ geometry DEF S {} }}", geometry), {.pixels = 0.5f});
        const auto pieces = [&] { return cut.mesh("S").triangleCount + cut.mesh("S").strokeCount; };
        cut.lookFrom(1000);
        const auto far = pieces();
        cut.lookFrom(4);
        EXPECT_GT(pieces(), 2 * far) << geometry;
        EXPECT_EQ(cut.flattener.cuts().geometries, 1u) << geometry;
    }
}

TEST(TessellationByPixels, TextIsFinerWhereItIsNear) {
    Cut cut("Shape { geometry DEF S Text { string \"oOo\" } }", {.pixels = 0.25f});
    if (cut.triangles("S") == 0) GTEST_SKIP() << "there are no fonts";
    cut.lookFrom(500);
    const std::size_t far = cut.triangles("S");
    cut.lookFrom(1.5);
    EXPECT_GT(cut.triangles("S"), 2 * far);
}

TEST(TessellationByPixels, EqualSpheresOfOneLevelAreOneMesh) {
    Cut cut(
        "Shape { geometry DEF A Sphere { } } Shape { geometry DEF B Sphere { } } "
        "Transform { translation 0 0 -5000 children Shape { geometry DEF C Sphere { } } }",
        {.pixels = 0.5f});
    cut.lookFrom(5);
    EXPECT_EQ(&cut.mesh("A"), &cut.mesh("B"));
    EXPECT_LT(cut.triangles("C"), cut.triangles("A") / 8);
}

}  // namespace
}  // namespace rtsg
