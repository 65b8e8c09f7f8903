// Bindings, normals, defects and vertex arrays of meshes made by hand.
#include <random>

#include "mesh_check.h"

namespace rtsg {
namespace {

TEST(MeshAttribute, BindingsAddressTheirValues) {
    using Binding = MeshAttribute::Binding;
    const Array<Vec2f> values{{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}, {5, 0}};
    const MeshAttribute corner(values, Binding::corner, {}, 3), face(values, Binding::face, {}, 1);
    const MeshAttribute indexed(values, Binding::corner, {5, 4, 3, -1, 2, 1, 0}, 4);
    EXPECT_EQ(corner.valueIndex(1, 2), 5u);
    EXPECT_EQ(face.valueIndex(1, 2), 1u);
    EXPECT_EQ(indexed.valueIndex(0, 1), 4u);
    EXPECT_EQ(indexed.valueIndex(1, 0), 2u);
    EXPECT_EQ(indexed.value(1, 0), Vec4f(2, 0, 0, 1));
    EXPECT_EQ(corner.interpolate(0, .25f, .5f), Vec4f(1.25f, 0, 0, 1));
    EXPECT_EQ(face.interpolate(1, .25f, .5f), Vec4f(1, 0, 0, 1));
    EXPECT_FALSE(MeshAttribute().present());
    EXPECT_FALSE(MeshAttribute(Array<Vec3f>(), Binding::vertex, {}, 3).present());
    // The arrays outlive those they were taken from.
    MeshAttribute kept;
    {
        Array<Vec4f> temporary{{1, 2, 3, 4}};
        kept = MeshAttribute(temporary, Binding::face, Array<std::int32_t>{0, 0}, 1);
    }
    EXPECT_EQ(kept.value(1, 0), Vec4f(1, 2, 3, 4));
}

TEST(Mesh, IsClosedWhereEveryEdgeIsRunBothWays) {
    EXPECT_TRUE(tessellate(BoxParams{}).isClosed());
    EXPECT_TRUE(tessellate(SphereParams{}).isClosed());
    EXPECT_TRUE(tessellate(ConeParams{}).isClosed());
    EXPECT_FALSE(tessellate(ConeParams{.bottom = false}).isClosed());
    EXPECT_FALSE(Mesh().isClosed());
    Mesh mesh;  // a tetrahedron whose faces share no corner, and whose 0 is -0 now and then
    const Vec3f a(0), b(1, -0.0f, 0), c(-0.0f, 1, 0), d(0, 0, 1), e(0, 1, 0);
    mesh.positions = {a, e, b, a, b, d, a, d, c, b, c, d};
    mesh.triangles = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
    mesh.triangleCount = 4;
    EXPECT_TRUE(mesh.isClosed());
    Mesh open = mesh;
    open.triangleCount = 3;
    EXPECT_FALSE(open.isClosed()) << "a copy asks anew";
    Mesh turned = mesh;
    turned.triangles = {0, 2, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11};
    EXPECT_FALSE(turned.isClosed()) << "one face shows its back";
    mesh.triangles = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 0, 0, 1};
    mesh.triangleCount = 5;
    EXPECT_TRUE(Mesh(mesh).isClosed()) << "a triangle without area changes nothing";
}

TEST(Mesh, GeometricNormalsOfTinyHugeAndEmptyTriangles) {
    for (const float size : {1e-30f, 1e-12f, 1.0f, 1e12f, 9e17f}) {
        Mesh mesh;
        mesh.positions = {{0, 0, 0}, {size, 0, 0}, {0, 0, size}};
        mesh.triangles = {0, 1, 2, 0, 0, 0};
        mesh.triangleCount = 2;
        EXPECT_EQ(mesh.geometricNormal(0), Vec3f(0, -1, 0)) << size;
        EXPECT_EQ(mesh.geometricNormal(1), Vec3f(0, 0, 1)) << size;
    }
}

TEST(Mesh, UselessNormalsFallBackToTheGeometricOne) {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {0, 1, 2};
    mesh.triangleCount = 1;
    for (const Vec3f bad : {Vec3f(0), Vec3f(NAN, 0, 0), Vec3f(INFINITY, 0, 0), Vec3f(1e30f, 0, 0)}) {
        mesh.normals = MeshAttribute(Array<Vec3f>{bad}, MeshAttribute::Binding::face, {}, 1);
        EXPECT_EQ(mesh.shadingNormal(0, .3f, .3f), Vec3f(0, 0, 1));
    }
    // Opposite normals cancel half-way.
    mesh.normals = MeshAttribute(Array<Vec3f>{{1, 0, 0}, {-1, 0, 0}, {1, 0, 0}}, MeshAttribute::Binding::corner, {}, 3);
    EXPECT_EQ(mesh.shadingNormal(0, .5f, 0), Vec3f(0, 0, 1));
}

TEST(Mesh, FindDefectFindsEach) {
    const Mesh good = tessellate(SphereParams{}, {.segments = 8});
    ASSERT_EQ(findDefect(good), "");
    const auto broken = [&](auto change) {
        Mesh mesh = good;
        change(mesh);
        return findDefect(mesh);
    };
    EXPECT_NE(broken([](Mesh& m) { m.triangles.mutableData()[5] = 100000; }), "");
    EXPECT_NE(broken([](Mesh& m) { m.triangles.mutableData()[5] = -1; }), "");
    EXPECT_NE(broken([](Mesh& m) { m.triangleCount += 1; }), "");
    EXPECT_NE(broken([](Mesh& m) { m.triangleStride = 5; }), "");
    EXPECT_NE(broken([](Mesh& m) { m.positions.mutableData()[3].y = NAN; }), "");
    EXPECT_NE(broken([](Mesh& m) { m.bounds.max.x = 0; }), "");
    EXPECT_NE(broken([](Mesh& m) { m.texCoords.clear(); }), "");
    EXPECT_NE(broken([](Mesh& m) {
                  m.normals = MeshAttribute(Array<Vec3f>{{0, 1, 0}}, MeshAttribute::Binding::corner, m.triangles, 3);
              }),
              "");
    EXPECT_NE(
        broken([](Mesh& m) { m.colors = MeshAttribute(Array<Color>{{0, 1, 0}}, MeshAttribute::Binding::face, {}, 1); }),
        "");
}

void expectSameSurface(const Mesh& mesh) {
    const VertexArrays arrays = vertexArrays(mesh);
    ASSERT_EQ(arrays.triangles.size(), std::size_t{mesh.triangleCount} * 3);
    ASSERT_EQ(arrays.normals.size(), arrays.positions.size());
    ASSERT_EQ(arrays.texCoords.size(), arrays.positions.size());
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c) {
            const SurfacePoint point = interpolate(mesh, t, c == 1 ? 1.0f : 0.0f, c == 2 ? 1.0f : 0.0f);
            const std::uint32_t v = arrays.triangles[t * 3 + c];
            EXPECT_EQ(arrays.positions[v], mesh.vertex(t, c));
            EXPECT_EQ(arrays.normals[v], point.shadingNormal);
            EXPECT_EQ(arrays.texCoords[v], Vec2f(point.texCoord));
            if (mesh.colors.present()) {
                EXPECT_EQ(arrays.colors[v], point.color);
            }
        }
}

TEST(VertexArrays, SplitOnlyWhereAttributesDiffer) {
    const Mesh sphere = tessellate(SphereParams{}, {.segments = 16});
    expectSameSurface(sphere);
    // Seam doubled, poles once per triangle.
    EXPECT_EQ(vertexArrays(sphere).positions.size(), 7u * 17 + 2 * 16);
    const Mesh box = tessellate(BoxParams{});
    expectSameSurface(box);
    EXPECT_EQ(vertexArrays(box).positions.size(), 24u);
    IndexedFaceSetParams p;
    p.coord = cubePoints();
    p.coordIndex = cubeFaces();
    p.creaseAngle = 4;
    p.colorPerVertex = false;
    p.color = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {0, 1, 1}, {1, 0, 1}};
    expectSameSurface(tessellate(p));
    p.color = {};
    const Mesh smooth = tessellate(p);
    expectSameSurface(smooth);
    EXPECT_EQ(vertexArrays(smooth).positions.size(), 8u);
    const Mesh empty;
    EXPECT_TRUE(vertexArrays(empty).triangles.empty());
}

TEST(VertexArrays, HubOfManyFacetsIsNotQuadratic) {
    ConeParams cone;
    Mesh mesh = tessellate(cone, {.segments = 4096});
    mesh.normals = {};
    expectSameSurface(mesh);
}

}  // namespace
}  // namespace rtsg
