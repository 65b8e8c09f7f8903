// Filters that change geometry: what is drawn is the same before and after.
#include <algorithm>
#include <array>
#include <map>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/filters.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/session/triangulate.h>

namespace rtsg {
namespace {

/// The triangles in the world, as sums over each that no order of corners or triangles changes.
struct Drawn {
    std::size_t triangles = 0;
    double area = 0;
    glm::dvec3 flow{0};    // of all areas, towards their fronts
    glm::dvec3 moment{0};  // area times middle
};

Drawn drawn(const std::string& text) {
    Scene scene;
    Diagnostics diagnostics("test");
    loadText(scene, text, diagnostics);
    EXPECT_EQ(diagnostics.errors(), 0u) << text;
    const SharedWorld world(scene, {});
    const InstanceDelta all = world.flattener().snapshot();
    std::map<NodeId, std::shared_ptr<const Mesh>> meshes;
    for (const auto& geometry : all.geometries) meshes[geometry.node] = geometry.mesh;
    Drawn result;
    for (const Instance& instance : all.added) {
        const Mesh* mesh = meshes[instance.geometry].get();
        if (!mesh) continue;
        for (std::uint32_t t = 0; t < mesh->triangleCount; ++t) {
            std::array<glm::dvec3, 3> p;
            for (std::uint32_t c = 0; c < 3; ++c)
                p[c] = glm::dvec3(instance.worldFromLocal * glm::dvec4(glm::dvec3(mesh->vertex(t, c)), 1));
            glm::dvec3 across = glm::cross(p[1] - p[0], p[2] - p[0]) / 2.0;
            if (glm::determinant(glm::dmat3(instance.worldFromLocal)) < 0) across = -across;
            const double area = glm::length(across);
            result.area += area;
            result.flow += across;
            result.moment += area * (p[0] + p[1] + p[2]) / 3.0;
        }
        result.triangles += mesh->triangleCount;
    }
    return result;
}

std::string filtered(const std::string& name, const std::string& text) {
    std::string out;
    Diagnostics diagnostics("test");
    const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { out += piece; }, diagnostics);
    const auto filter = name == "triangulate" ? makeTriangulate(*writer, diagnostics)
                                              : makeFilter(name, *writer, FilterContext{diagnostics});
    readDocument(text, **filter, diagnostics);
    EXPECT_EQ(diagnostics.errors(), 0u);
    return out;
}

void expectSame(const std::string& name, const std::string& text) {
    const std::string after = filtered(name, text);
    const Drawn a = drawn(text), b = drawn(after);
    EXPECT_EQ(a.triangles, b.triangles) << after;
    EXPECT_NEAR(a.area, b.area, 1e-4 * (1 + a.area)) << after;
    for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(a.flow[i], b.flow[i], 1e-4 * (1 + a.area)) << after;
        EXPECT_NEAR(a.moment[i], b.moment[i], 1e-3 * (1 + a.area)) << after;
    }
}

constexpr const char* kHead = "#X3D V4.0 utf8\nPROFILE Full\n";

TEST(Triangulate, WhatIsDrawnStaysWhateverTheGeometry) {
    for (const char* geometry :
         {"Box { size 1 2 3 solid FALSE }", "Sphere { radius 2 }", "Cone { }", "Cylinder { top FALSE }",
          "IndexedFaceSet { creaseAngle 1 coordIndex [ 0 1 2 3 -1 0 3 4 ] coord Coordinate { point [ 0 0 0 1 0 0 1 1 0 "
          "0 1 "
          "0 0 0 1 ] } color Color { color [ 1 0 0 0 1 0 ] } colorPerVertex FALSE ccw FALSE }",
          "ElevationGrid { xDimension 3 zDimension 2 height [ 0 1 0 2 0 1 ] }", "Extrusion { }",
          "TriangleStripSet { stripCount 4 coord Coordinate { point [ 0 0 0 1 0 0 0 1 0 1 1 0 ] } }",
          "Rectangle2D { size 2 3 }"}) {
        const std::string text = std::string(kHead) + "Transform { scale 1 2 1 children [ Shape { geometry DEF G " +
                                 geometry + " } Shape { geometry USE G } ] }";
        expectSame("triangulate", text);
        EXPECT_THAT(filtered("triangulate", text), testing::HasSubstr("DEF G IndexedTriangleSet"));
    }
}

TEST(Triangulate, WhatMovesOrIsSharedStaysAndSoDoLines) {
    for (const char* text :
         {"Shape { geometry DEF B Box { } } DEF S Script { outputOnly SFBool b } ROUTE S.b TO B.solid",
          "Shape { geometry IndexedFaceSet { coord DEF C Coordinate { } } } Shape { geometry PointSet { coord USE C } "
          "}",
          "Shape { geometry IndexedLineSet { coordIndex [ 0 1 ] coord Coordinate { point [ 0 0 0 1 1 1 ] } } }",
          "PROTO P [ initializeOnly SFVec3f s 1 1 1 ] { Shape { geometry Box { size IS s } } }"})
        EXPECT_THAT(filtered("triangulate", std::string(kHead) + text),
                    testing::Not(testing::HasSubstr("IndexedTriangleSet")));
}

/// A tree of Transforms, shared ones too, with faces and boxes in them.
class Tree {
  public:
    explicit Tree(std::uint32_t seed) : engine_(seed) {}
    std::string text() {
        std::string text = kHead;
        for (int i = 0; i < 2; ++i) text += transform(0);
        return text;
    }

  private:
    double number() { return std::uniform_real_distribution(-2.0, 2.0)(engine_); }
    bool chance(double p) { return std::bernoulli_distribution(p)(engine_); }
    std::string transform(int depth) {
        std::string text = chance(.2) ? fmt::format("DEF T{} ", ++names_) : "";
        const int own = names_;
        const bool named = !text.empty();
        text += fmt::format("Transform {{ translation {} {} {} rotation {} 1 {} {} ", number(), number(), number(),
                            number(), number(), number());
        if (chance(.5)) text += chance(.5) ? fmt::format("scale {0} {0} {0} ", number()) : "scale 1 -2 3 ";
        if (chance(.2)) text += "center 1 2 3 scaleOrientation 1 0 0 .5 ";
        text += "children [ ";
        for (int i = 0; i < 3; ++i) text += child(depth + 1);
        text += "] } ";
        if (named) done_.push_back(own);
        return text;
    }
    std::string child(int depth) {
        if (depth < 4 && chance(.6)) return transform(depth);
        if (!done_.empty() && chance(.2)) return fmt::format("USE T{} ", done_[engine_() % done_.size()]);
        if (chance(.3)) return "Shape { geometry Box { size 1 2 .5 } } ";
        return "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 0 2 3 ] coord Coordinate { point [ 0 0 0 1 0 0 "
               "1 1 "
               "0 0 1 1 ] } } } ";
    }
    std::mt19937 engine_;
    int names_ = 0;
    std::vector<int> done_;
};

TEST(FlattenTransforms, WhatIsDrawnStays) {
    for (std::uint32_t seed = 0; seed < 30; ++seed) {
        SCOPED_TRACE(seed);
        const std::string text = Tree(seed).text();
        expectSame("flatten-transforms", text);
        expectSame("share", text);
        expectSame("index", text);
    }
}

}  // namespace
}  // namespace rtsg
