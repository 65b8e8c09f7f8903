// Sets, strips and fans, indexed or not.
#include "mesh_check.h"

namespace rtsg {
namespace {

using Kind = PrimitiveSetParams::Kind;

PrimitiveSetParams set(Kind kind, Array<Vec3f> coord, Array<std::int32_t> index = {}, Array<std::int32_t> count = {}) {
    PrimitiveSetParams p;
    p.kind = kind;
    p.coord = std::move(coord);
    p.index = std::move(index);
    p.count = std::move(count);
    return p;
}

void expectFacing(const Mesh& mesh, Vec3f front) {
    EXPECT_EQ(findDefect(mesh), "");
    for (unsigned t = 0; t < mesh.triangleCount; ++t) EXPECT_EQ(mesh.geometricNormal(t), front) << "triangle " << t;
}

// Six points of a flat ladder: even ones below, odd ones above.
Array<Vec3f> ladder() {
    return {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {2, 0, 0}, {2, 1, 0}};
}

TEST(TessellateSets, IndexedTrianglesAreReadInPlace) {
    const PrimitiveSetParams p = set(Kind::indexedTriangleSet, cubePoints(), {0, 2, 1, 1, 2, 3});
    const Mesh mesh = tessellate(p);
    expectFacing(mesh, {0, 0, -1});
    EXPECT_TRUE(mesh.positions.sameStorage(p.coord));
    EXPECT_TRUE(mesh.triangles.sameStorage(p.index));
    EXPECT_EQ(mesh.triangleStride, 3u);
    EXPECT_DOUBLE_EQ(surfaceArea(mesh), 4);
}

TEST(TessellateSets, AllKindsCoverTheSameSquares) {
    const Array<std::int32_t> up{0, 1, 2, 3, 4, 5};
    struct Case {
        Kind kind;
        Array<Vec3f> coord;
        Array<std::int32_t> index, count;
        double area;
    };
    const Array<Vec3f> around{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    const Array<Vec3f> rung{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 2, 0}, {1, 2, 0}};
    const Case cases[] = {
        {Kind::triangleSet, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {}, {}, 1},
        {Kind::triangleStripSet, rung, {}, {6}, 2},
        {Kind::triangleStripSet, rung, {}, {3, 3}, 1},
        {Kind::triangleFanSet, around, {}, {4}, 1},
        {Kind::quadSet, around, {}, {}, 1},
        {Kind::indexedTriangleSet, around, {0, 1, 2, 0, 2, 3}, {}, 1},
        {Kind::indexedTriangleStripSet, rung, up, {}, 2},
        {Kind::indexedTriangleStripSet, rung, {0, 1, 2, 3, -1, 2, 3, 4, 5, -1}, {}, 2},
        {Kind::indexedTriangleFanSet, around, {0, 1, 2, 3}, {}, 1},
        {Kind::indexedTriangleFanSet, around, {0, 1, 2, -1, 0, 2, 3, -1}, {}, 1},
        {Kind::indexedQuadSet, rung, {0, 1, 3, 2, 2, 3, 5, 4}, {}, 2},
    };
    for (const Case& c : cases) {
        SCOPED_TRACE(static_cast<int>(c.kind));
        PrimitiveSetParams p = set(c.kind, c.coord, c.index, c.count);
        const Mesh mesh = tessellate(p);
        if (c.kind == Kind::triangleStripSet && c.count.size() == 2) {
            EXPECT_EQ(mesh.triangleCount, 2u);  // the second strip starts a new winding
        } else {
            expectFacing(mesh, {0, 0, 1});
        }
        EXPECT_DOUBLE_EQ(surfaceArea(mesh), c.area);
        EXPECT_EQ(mesh.diagnostics.warnings(), 0u);
        p.ccw = false;
        const Mesh back = tessellate(p);
        EXPECT_EQ(findDefect(back), "");
        ASSERT_EQ(back.triangleCount, mesh.triangleCount);
        for (unsigned t = 0; t < mesh.triangleCount; ++t) EXPECT_EQ(back.geometricNormal(t), -mesh.geometricNormal(t));
    }
}

// 11.4: without normals, normalPerVertex TRUE averages over the triangles that share a vertex.
TEST(TessellateSets, MissingNormals) {
    PrimitiveSetParams p = set(
        Kind::indexedTriangleSet, cubePoints(),
        {4, 5, 7, 4, 7, 6, 0, 2, 3, 0, 3, 1, 5, 1, 7, 1, 3, 7, 0, 4, 6, 0, 6, 2, 6, 7, 3, 6, 3, 2, 0, 1, 4, 1, 5, 4});
    const Mesh smooth = tessellate(p);
    EXPECT_DOUBLE_EQ(enclosedVolume(smooth), 8);
    for (unsigned t = 0; t < 12; ++t)
        for (unsigned c = 0; c < 3; ++c)
            expectVec(Vec3f(smooth.normals.value(t, c)), Vec3d(smooth.vertex(t, c)) / std::sqrt(3.0), 1e-5);
    p.normalPerVertex = false;
    EXPECT_FALSE(tessellate(p).normals.present());
    PrimitiveSetParams fan =
        set(Kind::triangleFanSet, {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {0, 0, -1}, {-1, 0, 0}, {0, 0, 1}}, {}, {6});
    const Mesh tent = tessellate(fan);
    expectVec(Vec3f(tent.normals.value(2, 0)), {0, 1, 0}, 1e-5);
}

// 11.4: colorPerVertex is ignored, and so is normalPerVertex where normals are given.
TEST(TessellateSets, AttributesBelongToVertices) {
    PrimitiveSetParams p = set(Kind::indexedTriangleStripSet, ladder(), {0, 2, 1, 3});
    p.color = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {0, 0, 0}, {0, 0, 0}};
    p.normal = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    p.colorPerVertex = p.normalPerVertex = false;
    const Mesh mesh = tessellate(p);
    expectFacing(mesh, {0, 0, 1});
    EXPECT_TRUE(mesh.colors.values().as<Array<Color>>().sameStorage(p.color));
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c) {
            EXPECT_EQ(mesh.colors.valueIndex(t, c), mesh.vertexIndex(t, c));
            EXPECT_EQ(mesh.normals.valueIndex(t, c), mesh.vertexIndex(t, c));
        }
}

TEST(TessellateSets, BadInput) {
    const auto warnings = [](const PrimitiveSetParams& p, unsigned triangles) {
        const Mesh mesh = tessellate(p);
        EXPECT_EQ(findDefect(mesh), "");
        EXPECT_EQ(mesh.triangleCount, triangles);
        return mesh.diagnostics.warnings();
    };
    EXPECT_EQ(warnings(set(Kind::triangleSet, {}), 0), 0u);
    EXPECT_EQ(warnings(set(Kind::triangleSet, {{0, 0, 0}, {1, 0, 0}}), 0), 1u);
    EXPECT_EQ(warnings(set(Kind::indexedTriangleSet, {}, {0, 1, 2}), 0), 1u);
    EXPECT_EQ(warnings(set(Kind::indexedTriangleStripSet, {}, {}), 0), 0u);
    EXPECT_EQ(warnings(set(Kind::triangleSet, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}}), 1), 1u);
    EXPECT_EQ(warnings(set(Kind::indexedTriangleSet, ladder(), {0, 1, 2, 0, 1, 6, 0}), 1), 2u);
    EXPECT_EQ(warnings(set(Kind::indexedTriangleSet, ladder(), {0, 1, -1, 2, 0, 1}), 1), 1u);
    EXPECT_EQ(warnings(set(Kind::indexedQuadSet, ladder(), {0, 1, 2, 3, 4}), 2), 1u);
    EXPECT_EQ(warnings(set(Kind::triangleStripSet, ladder(), {}, {2, 100}), 2), 2u);
    EXPECT_EQ(warnings(set(Kind::triangleFanSet, ladder(), {}, {-4, 3}), 1), 1u);
    EXPECT_EQ(warnings(set(Kind::indexedTriangleFanSet, ladder(), {0, 1, -1, -1, 0}), 0), 1u);
    // Strips joined by repeated points are common and nothing to report.
    EXPECT_EQ(warnings(set(Kind::indexedTriangleStripSet, ladder(), {0, 1, 2, 2, 3, 3, 4, 5}), 2), 0u);
}

// ---- lines and points ---------------------------------------------------------------------------------------------

StrokeParams linesThrough(Array<std::int32_t> coordIndex) {
    StrokeParams p;
    p.coord = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
    p.indexed = true;
    p.coordIndex = std::move(coordIndex);
    return p;
}
/// The numbers of the points that each stroke goes between.
std::vector<std::pair<int, int>> endsOf(const Mesh& mesh) {
    std::vector<std::pair<int, int>> ends;
    for (unsigned i = 0; i < mesh.strokeCount; ++i)
        ends.emplace_back(static_cast<int>(mesh.vertex(i, 0).x), static_cast<int>(mesh.vertex(i, 1).x));
    return ends;
}
using Ends = std::vector<std::pair<int, int>>;

TEST(TessellateStrokes, LinesGoThroughTheirPointsWhetherTheLastOneIsEndedOrNot) {
    for (const bool ended : {false, true}) {
        const Mesh mesh = tessellate(ended ? linesThrough({0, 1, 2, -1, 3, 0, -1}) : linesThrough({0, 1, 2, -1, 3, 0}));
        EXPECT_EQ(endsOf(mesh), (Ends{{0, 1}, {1, 2}, {3, 0}}));
        EXPECT_EQ(mesh.diagnostics.warnings(), 0u);
        EXPECT_EQ(mesh.bounds.max, Vec3f(3, 0, 0));
    }
}

// Those to a point that is not there, or nowhere, are left out one by one; 4 is the first number beyond.
TEST(TessellateStrokes, WhatLeadsNowhereIsLeftOutAndCounted) {
    const auto said = [](const Mesh& mesh) {
        std::string all;
        for (const Diagnostic& one : mesh.diagnostics.all()) all += one.text + '\n';
        return all;
    };
    StrokeParams p = linesThrough({0, 4, -1, 4, 1, -1, 1, 2, -1, 3, -1, -1});
    Mesh mesh = tessellate(p);
    EXPECT_EQ(endsOf(mesh), (Ends{{1, 2}}));
    EXPECT_EQ(said(mesh),
              "2 lines of fewer than two points are left out\n"
              "2 lines or points are left out: their coordinates do not exist or are not finite\n");
    for (const float nowhere : {NAN, INFINITY}) {
        p = linesThrough({0, 1, 2, 3});
        p.coord = {{0, 0, 0}, {1, 0, 0}, {2, nowhere, 0}, {3, 0, 0}};
        EXPECT_EQ(endsOf(tessellate(p)), (Ends{{0, 1}}));
        p.indexed = false, p.kind = Mesh::Strokes::points;
        EXPECT_EQ(endsOf(tessellate(p)), (Ends{{0, 0}, {1, 1}, {3, 3}}));
    }
    EXPECT_EQ(tessellate(linesThrough({})).strokes, Mesh::Strokes::none);
}

// 11.4.8: colours are one a point, by colorIndex in the places of coordIndex; the last one stands in for those that are
// not there.
TEST(TessellateStrokes, ColoursThatAreNotThereAreTheLastOne) {
    const auto reds = [](const Mesh& mesh) {
        Ends of;
        for (unsigned i = 0; i < mesh.strokeCount; ++i)
            of.emplace_back(static_cast<int>(mesh.colors.value(i, 0).x), static_cast<int>(mesh.colors.value(i, 1).x));
        return of;
    };
    StrokeParams p = linesThrough({0, 1, 2, -1, 2, 3});
    p.color = {{10, 0, 0}, {20, 0, 0}, {30, 0, 0}};
    EXPECT_EQ(reds(tessellate(p)), (Ends{{10, 20}, {20, 30}, {30, 30}}));
    EXPECT_EQ(tessellate(p).diagnostics.warnings(), 1u);
    p.colorIndex = {2, 1, 0, -1, 0};  // one place less
    EXPECT_EQ(reds(tessellate(p)), (Ends{{30, 20}, {20, 10}, {10, 30}}));
    EXPECT_EQ(tessellate(p).diagnostics.warnings(), 1u);
    p.colorIndex = {2, 1, 0, -1, 0, 1};
    EXPECT_EQ(reds(tessellate(p)), (Ends{{30, 20}, {20, 10}, {10, 20}}));
    EXPECT_EQ(tessellate(p).diagnostics.warnings(), 0u);
    p.colorPerVertex = false, p.colorIndex = {1, 0};  // one a line
    EXPECT_EQ(reds(tessellate(p)), (Ends{{20, 20}, {20, 20}, {10, 10}}));
    EXPECT_EQ(tessellate(p).diagnostics.warnings(), 0u);
}

// 11.4.9: a LineSet's lines take their points one after the other; colours are one a line, or one a point.
TEST(TessellateStrokes, LineSetsCountTheirPointsAndLines) {
    StrokeParams p;
    p.coord = linesThrough({}).coord;
    p.vertexCount = {2, 2};
    p.color = {{10, 0, 0}, {20, 0, 0}, {30, 0, 0}, {40, 0, 0}};
    Mesh mesh = tessellate(p);
    EXPECT_EQ(endsOf(mesh), (Ends{{0, 1}, {2, 3}}));
    EXPECT_EQ(mesh.colors.value(1, 0).x, 30);
    EXPECT_EQ(mesh.colors.value(1, 1).x, 40);
    p.colorPerVertex = false;
    mesh = tessellate(p);
    EXPECT_EQ(mesh.colors.value(0, 0).x, 10);
    EXPECT_EQ(mesh.colors.value(1, 0).x, 20);
    EXPECT_EQ(mesh.diagnostics.warnings(), 0u);
}

TEST(TessellateStrokes, TheLastFogDepthGoesOn) {
    StrokeParams p = linesThrough({0, 1, 2, 3});
    p.fogDepth = {.1f, .2f};
    const Mesh mesh = tessellate(p);
    ASSERT_EQ(mesh.strokeCount, 3u);
    EXPECT_EQ(mesh.fogDepths.value(0, 0).x, .1f);
    for (const auto& [stroke, end] :
         {std::pair(0, 1), std::pair(1, 0), std::pair(1, 1), std::pair(2, 0), std::pair(2, 1)})
        EXPECT_EQ(mesh.fogDepths.value(static_cast<unsigned>(stroke), static_cast<unsigned>(end)).x, .2f);
    EXPECT_EQ(mesh.diagnostics.warnings(), 1u);
}

TEST(TessellateStrokes, ArcsAreCutAsCirclesAreAndNeedTheirAngles) {
    for (const auto& [start, end] : {std::pair(NAN, 1.0f), std::pair(0.0f, NAN), std::pair(0.0f, INFINITY)}) {
        const Mesh mesh = tessellate(Arc2DParams{start, end, 1});
        EXPECT_EQ(mesh.strokeCount, 0u);
        EXPECT_EQ(mesh.diagnostics.warnings(), 1u);
    }
    const TessellationOptions options;
    const auto around = static_cast<unsigned>(options.segmentsAround());
    EXPECT_EQ(tessellate(Arc2DParams{0, 1.57f, 1}, options).strokeCount, (around + 3) / 4);
    EXPECT_EQ(tessellate(Arc2DParams{0, 0, 1}, options).strokeCount, around);
}

ElevationGridParams grid(int x, int z, Array<float> height) {
    ElevationGridParams p;
    p.xDimension = x;
    p.zDimension = z;
    p.height = std::move(height);
    return p;
}

// 13.3.4: ccw TRUE faces +Y; colours and normals per vertex or per quadrilateral; texture over the whole grid.
TEST(TessellateElevationGrid, FlatGridFacesUp) {
    ElevationGridParams p = grid(4, 3, Array<float>::ofSize(12));
    p.xSpacing = 2;
    p.zSpacing = .5f;
    const Mesh mesh = tessellate(p);
    expectFacing(mesh, {0, 1, 0});
    EXPECT_DOUBLE_EQ(surfaceArea(mesh), 6 * 1);
    EXPECT_EQ(mesh.bounds.max, Vec3f(6, 0, 1));
    EXPECT_EQ(texCoordAt(mesh, {0, 0, 0}, {0, 1, 0}), Vec2f(0, 0));
    EXPECT_EQ(texCoordAt(mesh, {6, 0, 1}, {0, 1, 0}), Vec2f(1, 1));
    EXPECT_EQ(texCoordAt(mesh, {6, 0, 0}, {0, 1, 0}), Vec2f(1, 0));
    p.ccw = false;
    expectFacing(tessellate(p), {0, -1, 0});
}

TEST(TessellateElevationGrid, AuthoredValuesPerVertexAndPerQuad) {
    ElevationGridParams p = grid(3, 2, {0, 0, 0, 0, 0, 0});
    p.color = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {0, 1, 1}, {1, 0, 1}};
    p.normal = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_TRUE(mesh.colors.values().as<Array<Color>>().sameStorage(p.color));
    for (unsigned t = 0; t < 4; ++t)
        for (unsigned c = 0; c < 3; ++c) {
            const Vec3f at = mesh.vertex(t, c);
            const auto i = static_cast<unsigned>(at.x + 3 * at.z);
            EXPECT_EQ(mesh.colors.valueIndex(t, c), i);
            EXPECT_EQ(mesh.normals.valueIndex(t, c), i);
        }
    p.colorPerVertex = p.normalPerVertex = false;
    mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    for (unsigned t = 0; t < 4; ++t) {
        const unsigned quad = mesh.position(t, .3f, .3f).x < 1 ? 0 : 1;
        EXPECT_EQ(mesh.colors.valueIndex(t, 0), quad);
        EXPECT_EQ(mesh.normals.valueIndex(t, 2), quad);
    }
}

TEST(TessellateElevationGrid, CreaseAngleSmoothsSlopes) {
    const int n = 33;
    Array<float> height = Array<float>::ofSize(n * n);
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) height.mutableData()[j * n + i] = 0.02f * static_cast<float>(i * i);
    ElevationGridParams p = grid(n, n, height);
    p.creaseAngle = 0.5f;
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_EQ(mesh.normals.binding(), MeshAttribute::Binding::vertex);
    for (unsigned t = 0; t < mesh.triangleCount; ++t) {
        const Vec3f at = mesh.vertex(t, 0);
        if (at.x < 1 || at.x > n - 2) continue;
        expectVec(Vec3f(mesh.normals.value(t, 0)), glm::normalize(Vec3d(-0.04 * at.x, 1, 0)), 0.01);
    }
}

TEST(TessellateElevationGrid, BadInput) {
    EXPECT_TRUE(tessellate(grid(1, 5, Array<float>::ofSize(5))).empty());
    EXPECT_EQ(tessellate(grid(-3, 5, Array<float>::ofSize(5))).diagnostics.warnings(), 1u);
    // A false dimension draws the rows that are there, and takes no memory for the others.
    const Mesh huge = tessellate(grid(2, 2147483647, {0, 0, 0, 0, 0}));
    EXPECT_EQ(huge.triangleCount, 2u);
    EXPECT_EQ(huge.diagnostics.warnings(), 1u);
    EXPECT_TRUE(tessellate(grid(2147483647, 2147483647, {0, 0, 0, 0, 0})).empty());
    // Where it can be no mistake, missing heights are 0.
    const Mesh level = tessellate(grid(3, 3, {0, 0, 0, 1}));
    EXPECT_EQ(level.triangleCount, 8u);
    EXPECT_EQ(level.diagnostics.warnings(), 1u);
    EXPECT_EQ(level.positions[3], Vec3f(0, 1, 1));
    EXPECT_EQ(level.positions[8], Vec3f(2, 0, 2));
    const Mesh nan = tessellate(grid(3, 2, {0, 0, 0, NAN, 0, INFINITY}));
    EXPECT_EQ(findDefect(nan), "");
    EXPECT_EQ(nan.triangleCount, 1u);
    EXPECT_EQ(nan.diagnostics.warnings(), 1u);
    for (const float bad : {0.0f, -1.0f, NAN, INFINITY}) {
        ElevationGridParams p = grid(2, 2, {0, 0, 0, 0});
        p.xSpacing = bad;
        EXPECT_TRUE(tessellate(p).empty());
        EXPECT_EQ(tessellate(p).diagnostics.warnings(), 1u);
    }
}

}  // namespace
}  // namespace rtsg
