// Geometry nodes of a scene: fields, bindings, what is reported.
#include <gmock/gmock.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "mesh_check.h"

namespace rtsg {
namespace {

std::shared_ptr<const Mesh> meshOf(const Scene& scene, NodeId id) {
    const auto mesh = tessellate(scene, id);
    if (!mesh) {
        ADD_FAILURE() << mesh.error().text;
        return std::make_shared<Mesh>();
    }
    EXPECT_EQ(findDefect(**mesh), "");
    return *mesh;
}

TEST(TessellateScene, DefaultsOfEveryGeometryNode) {
    Scene scene;
    struct Case {
        TypeIndex type;
        double area;
    };
    // Without coordinates a set is empty, and that is nothing to report.
    for (const Case& c :
         {Case{x3d::Box::type, 24}, Case{x3d::Sphere::type, 4 * kPiOfMesh}, Case{x3d::Cylinder::type, 6 * kPiOfMesh},
          Case{x3d::Cone::type, kPiOfMesh * (1 + std::sqrt(5.0))}, Case{x3d::Extrusion::type, 16},
          Case{x3d::Rectangle2D::type, 4}, Case{x3d::Disk2D::type, kPiOfMesh},
          Case{x3d::ArcClose2D::type, kPiOfMesh / 4}, Case{x3d::IndexedFaceSet::type, 0},
          Case{x3d::IndexedTriangleSet::type, 0}, Case{x3d::IndexedTriangleStripSet::type, 0},
          Case{x3d::IndexedTriangleFanSet::type, 0}, Case{x3d::IndexedQuadSet::type, 0},
          Case{x3d::TriangleSet::type, 0}, Case{x3d::TriangleStripSet::type, 0}, Case{x3d::TriangleFanSet::type, 0},
          Case{x3d::QuadSet::type, 0}, Case{x3d::ElevationGrid::type, 0}, Case{x3d::TriangleSet2D::type, 0}}) {
        const NodeId id = scene.createNode(c.type);
        SCOPED_TRACE(scene.node(id).type().name);
        const auto mesh = meshOf(scene, id);
        EXPECT_NEAR(surfaceArea(*mesh), c.area, 0.02 * c.area);
        EXPECT_EQ(mesh->diagnostics.warnings(), 0u);
    }
}

TEST(TessellateScene, WhatShowsNothingThoughSomethingIsGivenSaysWhy) {
    Scene scene;
    const NodeId points = scene.createNode(x3d::Coordinate::type);
    const auto reported = [&](NodeId id) {
        const auto mesh = meshOf(scene, id);
        EXPECT_TRUE(mesh->empty());
        return mesh->diagnostics.all().empty() ? std::string() : mesh->diagnostics.all()[0].text;
    };
    const NodeId faces = scene.createNode(x3d::IndexedFaceSet::type);
    ASSERT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coordIndex, Array<std::int32_t>{0, 1, 2, -1}));
    EXPECT_THAT(reported(faces), testing::HasSubstr("coordIndex refers to points, and there are none"));
    const NodeId set = scene.createNode(x3d::IndexedTriangleSet::type);
    ASSERT_TRUE(scene.set(set, x3d::IndexedTriangleSet::index, Array<std::int32_t>{0, 1, 2}));
    EXPECT_THAT(reported(set), testing::HasSubstr("index refers to points, and there are none"));
    ASSERT_TRUE(scene.set(points, x3d::Coordinate::point, Array<Vec3f>{{0, 0, 0}, {1, 0, 0}}));
    const NodeId triangles = scene.createNode(x3d::TriangleSet::type);
    ASSERT_TRUE(scene.set(triangles, x3d::TriangleSet::coord, points));
    EXPECT_THAT(reported(triangles), testing::HasSubstr("points left over, too few for a triangle"));
    const NodeId lines = scene.createNode(x3d::LineSet::type);
    ASSERT_TRUE(scene.set(lines, x3d::LineSet::coord, points));
    EXPECT_THAT(reported(lines), testing::HasSubstr("vertexCount is empty: of 2 points no line is drawn"));
    const NodeId grid = scene.createNode(x3d::ElevationGrid::type);
    ASSERT_TRUE(scene.set(grid, x3d::ElevationGrid::xDimension, 1));
    EXPECT_EQ(reported(grid), "");
    ASSERT_TRUE(scene.set(grid, x3d::ElevationGrid::zDimension, 3));
    EXPECT_THAT(reported(grid), testing::HasSubstr("xDimension 1 and zDimension 3 make no faces"));
}

TEST(TessellateScene, WeightsOfNurbsThatDoNotFitAreTold) {
    Scene scene;
    const NodeId points = scene.createNode(x3d::Coordinate::type);
    ASSERT_TRUE(scene.set(points, x3d::Coordinate::point, Array<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}));
    const NodeId patch = scene.createNode(x3d::NurbsPatchSurface::type);
    using T = x3d::NurbsPatchSurface;
    ASSERT_TRUE(scene.set(patch, T::controlPoint, points));
    for (const auto& field : {T::uDimension, T::vDimension, T::uOrder, T::vOrder})
        ASSERT_TRUE(scene.set(patch, field, 2));
    EXPECT_EQ(meshOf(scene, patch)->diagnostics.warnings(), 0u);
    ASSERT_TRUE(scene.set(patch, T::weight, Array<double>{1, 1, 1, 1}));
    EXPECT_EQ(meshOf(scene, patch)->diagnostics.warnings(), 0u);
    ASSERT_TRUE(scene.set(patch, T::weight, Array<double>{1, 1}));
    const auto mesh = meshOf(scene, patch);
    ASSERT_EQ(mesh->diagnostics.warnings(), 1u);
    EXPECT_THAT(mesh->diagnostics.all()[0].text, testing::HasSubstr("2 weights for 4 control points"));
}

TEST(TessellateScene, FacesShareTheArraysOfTheScene) {
    Scene scene;
    const NodeId faces = scene.createNode(x3d::IndexedFaceSet::type), points = scene.createNode(x3d::Coordinate::type);
    const NodeId colors = scene.createNode(x3d::ColorRGBA::type), normals = scene.createNode(x3d::Normal::type);
    ASSERT_TRUE(scene.set(points, x3d::Coordinate::point, Array<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}));
    ASSERT_TRUE(scene.set(colors, x3d::ColorRGBA::color, Array<ColorRGBA>{{1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 1, 0}}));
    ASSERT_TRUE(scene.set(normals, x3d::Normal::vector, Array<Vec3f>{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}));
    ASSERT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coordIndex, Array<std::int32_t>{0, 1, 2, -1}));
    ASSERT_TRUE(scene.set(faces, x3d::IndexedFaceSet::solid, false));
    ASSERT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coord, points));
    ASSERT_TRUE(scene.set(faces, x3d::IndexedFaceSet::color, colors));
    ASSERT_TRUE(scene.set(faces, x3d::IndexedFaceSet::normal, normals));
    const auto mesh = meshOf(scene, faces);
    ASSERT_EQ(mesh->triangleCount, 1u);
    EXPECT_FALSE(mesh->solid);
    EXPECT_TRUE(mesh->positions.sameStorage(scene.node(points).get(x3d::Coordinate::point)));
    EXPECT_TRUE(mesh->triangles.sameStorage(scene.node(faces).get(x3d::IndexedFaceSet::coordIndex)));
    EXPECT_TRUE(mesh->normals.values().as<Array<Vec3f>>().sameStorage(scene.node(normals).get(x3d::Normal::vector)));
    EXPECT_EQ(interpolate(*mesh, 0, 0, 1).color, (ColorRGBA{0, 0, 1, 0}));
}

TEST(TessellateScene, DoublesMultiTextureAndGenerator) {
    Scene scene;
    const NodeId set = scene.createNode(x3d::TriangleSet::type), points = scene.createNode(x3d::CoordinateDouble::type);
    const NodeId multi = scene.createNode(x3d::MultiTextureCoordinate::type);
    const NodeId plain = scene.createNode(x3d::TextureCoordinate::type);
    const NodeId generator = scene.createNode(x3d::TextureCoordinateGenerator::type);
    const NodeId sphere = scene.createNode(x3d::TextureCoordinateGenerator::type);
    ASSERT_TRUE(scene.set(points, x3d::CoordinateDouble::point, Array<Vec3d>{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}));
    ASSERT_TRUE(scene.set(plain, x3d::TextureCoordinate::point, Array<Vec2f>{{0, 0}, {0, 1}, {1, 0}}));
    ASSERT_TRUE(scene.set(generator, x3d::TextureCoordinateGenerator::mode, String("COORD")));
    ASSERT_TRUE(scene.set(multi, x3d::MultiTextureCoordinate::texCoord, Array<NodeId>{plain, generator, sphere}));
    ASSERT_TRUE(scene.set(set, x3d::TriangleSet::coord, points));
    ASSERT_TRUE(scene.set(set, x3d::TriangleSet::texCoord, multi));
    ASSERT_TRUE(scene.setName(set, "PLATE"));
    const auto mesh = meshOf(scene, set);
    ASSERT_EQ(mesh->triangleCount, 1u);
    ASSERT_EQ(mesh->texCoords.size(), 3u);
    EXPECT_EQ(mesh->texCoord(0, 1, 0, 0), Vec4f(0, 1, 0, 1));
    EXPECT_EQ(mesh->texCoord(0, 1, 0, 1), Vec4f(2, 0, 0, 1));
    EXPECT_EQ(mesh->texCoords[1].generator, TexCoords::Generator::none);
    EXPECT_EQ(mesh->texCoords[2].generator, TexCoords::Generator::sphere);
    EXPECT_EQ(mesh->diagnostics.warnings(), 0u);
    ASSERT_TRUE(scene.set(sphere, x3d::TextureCoordinateGenerator::mode, String("SPIRAL")));
    const auto unknown = meshOf(scene, set);
    EXPECT_EQ(unknown->texCoord(0, 1, 0, 2), Vec4f(1, 0, 0, 1));
    ASSERT_EQ(unknown->diagnostics.warnings(), 1u);
    EXPECT_EQ(unknown->diagnostics.all()[0].text.substr(0, 18), "TriangleSet PLATE:");
}

TEST(TessellateScene, ProtoInstanceStandsForTheFirstNodeOfItsBody) {
    Scene scene;
    auto type = std::make_shared<NodeType>();
    type->name = "Slab";
    type->kind = NodeType::Kind::proto;
    type->implements = {"X3DGeometryNode"};
    FieldDef body;
    body.name = "body";
    body.type = FieldType::MFNode;
    body.hidden = true;
    body.defaultValue = Value::zero(FieldType::MFNode);
    type->fields.push_back(body);
    ASSERT_TRUE(type->finish());
    const auto index = scene.defineType(type);
    ASSERT_TRUE(index);
    const NodeId slab = scene.createNode(*index), box = scene.createNode(x3d::Box::type, slab);
    EXPECT_FALSE(tessellate(scene, slab));
    ASSERT_TRUE(scene.setField(slab, 0, Value(Array<NodeId>{box})));
    EXPECT_EQ(meshOf(scene, slab)->triangleCount, 12u);
}

TEST(TessellateScene, AnInlineGeometryIsWhatItHasLoaded) {
    Scene scene;
    const NodeId holder = scene.createNode(x3d::InlineGeometry::type);
    EXPECT_TRUE(meshOf(scene, holder)->empty());
    EXPECT_TRUE(meshOf(scene, holder)->diagnostics.all().empty()) << "who loads says what is missing";
    const NodeId box = scene.createNode(x3d::Box::type, holder);
    ASSERT_TRUE(scene.set(holder, x3d::InlineGeometry::body, Array<NodeId>{box}));
    EXPECT_EQ(meshOf(scene, holder)->triangleCount, 12u);
}

TEST(TessellateScene, WhatHasNoTrianglesSaysSo) {
    Scene scene;
    for (const TypeIndex type : {x3d::NurbsPatchSurface::type, x3d::NurbsCurve::type}) {
        const auto mesh = meshOf(scene, scene.createNode(type));
        EXPECT_TRUE(mesh->empty());
        EXPECT_EQ(mesh->diagnostics.warnings(), 1u);
    }
    EXPECT_FALSE(tessellate(scene, NodeId{}));
    EXPECT_FALSE(tessellate(scene, NodeId{999999}));
    EXPECT_FALSE(tessellate(scene, scene.createNode(x3d::Transform::type)));
}

TEST(TessellateScene, TrianglesWithoutAreaAreTold) {
    const Array<Vec3f> line{{0, 0, 0}, {1, 2, 3}, {2, 4, 6}, {0, 1, 0}};
    const auto reported = [](const Mesh& mesh) {
        return mesh.diagnostics.all().empty() ? std::string() : mesh.diagnostics.all()[0].text;
    };
    for (const bool ccw : {true, false}) {
        PrimitiveSetParams set;
        set.coord = line, set.ccw = ccw, set.kind = PrimitiveSetParams::Kind::indexedTriangleSet;
        set.index = {0, 1, 3, 0, 1, 2, 3, 3, 0};
        EXPECT_EQ(reported(tessellate(set)), "2 triangles have no area and show nothing");
        set.kind = PrimitiveSetParams::Kind::indexedQuadSet, set.index = {0, 1, 3, 3, 0, 1, 2, 2};
        EXPECT_EQ(reported(tessellate(set)), "2 triangles have no area and show nothing");
        set.kind = PrimitiveSetParams::Kind::indexedTriangleStripSet, set.index = {0, 1, 2, 3, 3, 1};
        EXPECT_EQ(reported(tessellate(set)), "") << "strips are joined by such";
        IndexedFaceSetParams faces;
        faces.coord = line, faces.ccw = ccw, faces.coordIndex = {0, 1, 3, -1, 2, 1, 0, -1};
        EXPECT_EQ(reported(tessellate(faces)), "1 triangles have no area and show nothing");
    }
    // Very thin, very small and far from the origin: it has one.
    PrimitiveSetParams thin;
    thin.coord = {{1000, 0, 0},   {1000, 1, 0},   {std::nextafter(1000.f, 2000.f), .5f, 0},
                  {1e-20f, 0, 0}, {0, 1e-20f, 0}, {0, 0, 0}};
    EXPECT_EQ(reported(tessellate(thin)), "");
}

}  // namespace
}  // namespace rtsg
