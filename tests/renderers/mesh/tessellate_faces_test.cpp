// IndexedFaceSets: cutting, bindings, creases, repairs.
#include <algorithm>
#include <numeric>
#include <random>

#include "mesh_check.h"

namespace rtsg {
namespace {

IndexedFaceSetParams cube() {
    IndexedFaceSetParams p;
    p.coord = cubePoints();
    p.coordIndex = cubeFaces();
    return p;
}

IndexedFaceSetParams polygon(std::vector<Vec3f> points) {
    IndexedFaceSetParams p;
    Array<Vec3f> coord = Array<Vec3f>::ofSize(points.size());
    Array<std::int32_t> index = Array<std::int32_t>::ofSize(points.size());
    std::copy(points.begin(), points.end(), coord.mutableData());
    std::iota(index.mutableData(), index.mutableData() + points.size(), 0);
    p.coord = coord;
    p.coordIndex = index;
    p.convex = false;
    return p;
}

TEST(TessellateFaces, CubeIsClosedAndFaceted) {
    const Mesh mesh = tessellate(cube());
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_DOUBLE_EQ(surfaceArea(mesh), 24);
    EXPECT_DOUBLE_EQ(enclosedVolume(mesh), 8);
    EXPECT_TRUE(isWatertight(mesh));
    EXPECT_EQ(eulerCharacteristic(mesh), 2);
    EXPECT_FALSE(mesh.normals.present());
    EXPECT_EQ(mesh.diagnostics.warnings(), 0u);
}

TEST(TessellateFaces, CcwFalseTurnsFrontsAround) {
    IndexedFaceSetParams p = cube();
    p.ccw = false;
    p.creaseAngle = 4;
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_DOUBLE_EQ(enclosedVolume(mesh), -8);
    // Generated normals follow the fronts.
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        EXPECT_GT(glm::dot(mesh.shadingNormal(t, 0, 0), mesh.geometricNormal(t)), 0.5f);
}

TEST(TessellateFaces, TrianglesAreReadInPlace) {
    IndexedFaceSetParams p;
    p.coord = cubePoints();
    p.coordIndex = {0, 2, 1, -1, 1, 2, 3, -1, 4, 5, 6};
    p.normal = {{0, 0, -1}, {0, 0, 1}};
    p.normalIndex = {0, 0, 0, -1, 0, 0, 0, -1, 1, 1, 1};
    p.texCoord.resize(1);
    p.texCoord[0].point = {{0, 0}, {1, 0}, {0, 1}, {1, 1}, {0, 0}, {0, 0}, {0, 0}, {.5f, .5f}};
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_EQ(mesh.triangleCount, 3u);
    EXPECT_EQ(mesh.triangleStride, 4u);
    EXPECT_TRUE(mesh.positions.sameStorage(p.coord));
    EXPECT_TRUE(mesh.triangles.sameStorage(p.coordIndex));
    EXPECT_TRUE(mesh.normals.indices().sameStorage(p.normalIndex));
    EXPECT_TRUE(mesh.normals.values().as<Array<Vec3f>>().sameStorage(p.normal));
    EXPECT_TRUE(mesh.texCoords[0].values.indices().sameStorage(p.coordIndex));
    EXPECT_EQ(mesh.shadingNormal(1, .2f, .2f), Vec3f(0, 0, -1));
    EXPECT_EQ(mesh.shadingNormal(2, .2f, .2f), Vec3f(0, 0, 1));
    EXPECT_EQ(Vec2f(mesh.texCoord(0, 0, 1)), Vec2f(1, 0));
    EXPECT_EQ(mesh.bounds.min, Vec3f(-1, -1, -1));
    EXPECT_EQ(mesh.bounds.max, Vec3f(1, 1, 1));
}

TEST(TessellateFaces, BoundsIgnorePointsNotReferenced) {
    IndexedFaceSetParams p;
    p.coord = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {100, NAN, 100}};
    p.coordIndex = {0, 1, 2, -1};
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(mesh.triangleCount, 1u);
    EXPECT_EQ(mesh.bounds.max, Vec3f(1, 1, 0));
    EXPECT_EQ(mesh.diagnostics.warnings(), 0u);
}

TEST(TessellateFaces, ConcavePolygons) {
    // An L, a comb, a square whose hole is joined by a bridge, an arrowhead.
    const std::vector<std::pair<std::vector<Vec3f>, double>> cases = {
        {{{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}}, 3},
        {{{0, 0, 0},
          {5, 0, 0},
          {5, 2, 0},
          {4, 2, 0},
          {4, 1, 0},
          {3, 1, 0},
          {3, 2, 0},
          {2, 2, 0},
          {2, 1, 0},
          {1, 1, 0},
          {1, 2, 0},
          {0, 2, 0}},
         8},
        {{{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {0, 0, 0}, {1, 1, 0}, {1, 3, 0}, {3, 3, 0}, {3, 1, 0}, {1, 1, 0}},
         12},
        {{{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {1, 1, 0}}, 1},
    };
    const glm::mat3 rotations[] = {
        glm::mat3(1), glm::mat3(0, 1, 0, 0, 0, 1, 1, 0, 0),
        glm::mat3(.6f, .8f, 0, -.8f, .6f, 0, 0, 0, 1) * glm::mat3(1, 0, 0, 0, .6f, .8f, 0, -.8f, .6f)};
    for (const auto& [shape, area] : cases)
        for (const auto& rotation : rotations)
            for (std::size_t start = 0; start < shape.size(); ++start)
                for (const bool backwards : {false, true}) {
                    std::vector<Vec3f> points = shape;
                    std::rotate(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(start), points.end());
                    if (backwards) std::reverse(points.begin(), points.end());
                    for (Vec3f& p : points) p = rotation * p;
                    IndexedFaceSetParams p = polygon(points);
                    p.creaseAngle = 4;
                    const Mesh mesh = tessellate(p);
                    ASSERT_EQ(findDefect(mesh), "");
                    ASSERT_NEAR(surfaceArea(mesh), area, 1e-5) << shape.size() << " corners from " << start;
                    SCOPED_TRACE(std::to_string(shape.size()) + " corners from " + std::to_string(start) +
                                 (backwards ? " backwards" : ""));
                    ASSERT_EQ(mesh.diagnostics.warnings(), 0u);
                    const Vec3f front = rotation * Vec3f(0, 0, backwards ? -1 : 1);
                    for (unsigned t = 0; t < mesh.triangleCount; ++t)
                        for (unsigned c = 0; c < 3; ++c)
                            ASSERT_GT(glm::dot(Vec3f(mesh.normals.value(t, c)), front), 0.9999f);
                    // Slivers between collinear corners have no direction of their own; whatever has, faces front.
                    Vec3d sum(0);
                    for (unsigned t = 0; t < mesh.triangleCount; ++t)
                        sum += 0.5 * glm::cross(Vec3d(mesh.vertex(t, 1) - mesh.vertex(t, 0)),
                                                Vec3d(mesh.vertex(t, 2) - mesh.vertex(t, 0)));
                    ASSERT_NEAR(glm::dot(sum, Vec3d(front)), area, 1e-5);
                }
}

TEST(TessellateFaces, RandomStarPolygonsKeepTheirArea) {
    for (unsigned seed = 1; seed <= 40; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> radius(0.2, 3);
        const int n = 5 + static_cast<int>(random() % 60);
        std::vector<Vec3f> points;
        double area = 0;
        for (int i = 0; i < n; ++i) {
            const double a = 2 * kPiOfMesh * i / n, r = radius(random);
            points.emplace_back(r * std::cos(a), 0.5, -r * std::sin(a));
        }
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Vec3d a(points[i]), b(points[(i + 1) % points.size()]);
            area += 0.5 * (a.z * b.x - a.x * b.z);
        }
        const Mesh mesh = tessellate(polygon(points));
        EXPECT_EQ(findDefect(mesh), "");
        EXPECT_EQ(mesh.triangleCount, static_cast<unsigned>(n - 2));
        EXPECT_NEAR(surfaceArea(mesh), area, 1e-4);
    }
}

TEST(TessellateFaces, LargePolygonIsNotQuadratic) {
    // A comb of 100,000 teeth; quadratic ear clipping would take hours.
    std::vector<Vec3f> points;
    const int teeth = 100000;
    for (int i = 0; i < teeth; ++i) {
        const float x = static_cast<float>(i) / teeth;
        points.emplace_back(x, i % 2 ? 1.0f : 2.0f, 0);
    }
    points.emplace_back(1, 0, 0);
    points.emplace_back(0, 0, 0);
    const Mesh mesh = tessellate(polygon(points));
    EXPECT_EQ(mesh.triangleCount, static_cast<unsigned>(teeth));
    EXPECT_EQ(findDefect(mesh), "");
}

TEST(TessellateFaces, CornersAtOnePlaceAreOneCorner) {
    // Different points with the same coordinates, as exporters without welding write them.
    const Mesh step = tessellate(
        polygon({{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {2, 1, 0}, {1, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}, {0, 0, 0}}));
    EXPECT_EQ(findDefect(step), "");
    EXPECT_EQ(step.triangleCount, 4u);
    EXPECT_DOUBLE_EQ(surfaceArea(step), 3);
    EXPECT_EQ(step.diagnostics.warnings(), 0u);
    const Mesh quad = tessellate(polygon({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}}));
    EXPECT_EQ(quad.triangleCount, 1u);
}

TEST(TessellateFaces, CrossingOutlineTooLongToCutIsReported) {
    std::vector<Vec3f> points;
    for (int i = 0; i < 40001; ++i) points.emplace_back(i % 200, (i * 7919) % 40009, 0);
    const Mesh mesh = tessellate(polygon(points));
    EXPECT_TRUE(mesh.empty());
    EXPECT_EQ(mesh.diagnostics.warnings(), 1u);
}

TEST(TessellateFaces, CrossingPolygonsAreReported) {
    const Mesh bow = tessellate(polygon({{0, 0, 0}, {2, 2, 0}, {2, 0, 0}, {0, 1, 0}}));
    EXPECT_EQ(findDefect(bow), "");
    EXPECT_EQ(bow.diagnostics.warnings(), 1u);
    std::vector<Vec3f> star;
    for (int i = 0; i < 5; ++i) star.emplace_back(std::cos(4 * kPiOfMesh * i / 5), std::sin(4 * kPiOfMesh * i / 5), 0);
    const Mesh pentagram = tessellate(polygon(star));
    EXPECT_EQ(findDefect(pentagram), "");
    EXPECT_EQ(pentagram.diagnostics.warnings(), 1u);
}

// 13.3.6, 11.2.3: hard edges from the crease angle on, smooth below it.
TEST(TessellateFaces, CreaseAngleOfACube) {
    IndexedFaceSetParams p = cube();
    p.creaseAngle = 1.5f;
    const Mesh hard = tessellate(p);
    EXPECT_EQ(findDefect(hard), "");
    for (unsigned t = 0; t < hard.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c) EXPECT_EQ(Vec3f(hard.normals.value(t, c)), hard.geometricNormal(t));
    p.creaseAngle = 1.6f;
    const Mesh smooth = tessellate(p);
    EXPECT_EQ(smooth.normals.binding(), MeshAttribute::Binding::vertex);
    p.creaseAngle = 3.2f;
    const Mesh smoother = tessellate(p);
    for (const Mesh* mesh : {&smooth, &smoother})
        for (unsigned t = 0; t < mesh->triangleCount; ++t)
            for (unsigned c = 0; c < 3; ++c)
                expectVec(Vec3f(mesh->normals.value(t, c)), Vec3d(mesh->vertex(t, c)) / std::sqrt(3.0), 1e-5);
}

TEST(TessellateFaces, CreaseSplitsOnlyWhereTheEdgeIsSharp) {
    // A roof: 20 degrees between the two slopes, a wall at 90 degrees to one of them.
    IndexedFaceSetParams p;
    const float s = std::sin(0.349f), c = std::cos(0.349f);
    p.coord = {{-1, 0, 0}, {-1, 0, 1}, {0, 0, 1}, {0, 0, 0}, {c, s, 1}, {c, s, 0}, {-1, -1, 0}, {-1, -1, 1}};
    p.coordIndex = {0, 1, 2, 3, -1, 3, 2, 4, 5, -1, 0, 6, 7, 1, -1};
    p.creaseAngle = 0.5f;
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_EQ(mesh.normals.binding(), MeshAttribute::Binding::corner);
    const Vec3d up(0, 1, 0), slope(-s, c, 0), left(-1, 0, 0), between = glm::normalize(up + slope);
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        for (unsigned k = 0; k < 3; ++k) {
            const unsigned v = mesh.vertexIndex(t, k);
            Vec3d expected = t < 2 ? up : t < 4 ? slope : left;
            if (v == 2 || v == 3) expected = between;
            expectVec(Vec3f(mesh.normals.value(t, k)), expected, 1e-5);
        }
}

TEST(TessellateFaces, SmoothNormalsDoNotDependOnTheTriangulation) {
    IndexedFaceSetParams quads = cube(), triangles = cube();
    quads.creaseAngle = triangles.creaseAngle = 4;
    triangles.coordIndex = {4, 5, 7, -1, 4, 7, 6, -1, 0, 2, 3, -1, 0, 3, 1, -1, 5, 1, 7, -1, 1, 3, 7, -1,
                            0, 4, 6, -1, 0, 6, 2, -1, 6, 7, 3, -1, 6, 3, 2, -1, 0, 1, 4, -1, 1, 5, 4, -1};
    const Mesh a = tessellate(quads), b = tessellate(triangles);
    EXPECT_EQ(b.triangleStride, 4u);
    for (unsigned t = 0; t < 12; ++t)
        for (unsigned c = 0; c < 3; ++c)
            expectVec(Vec3f(b.normals.value(t, c)), Vec3d(b.vertex(t, c)) / std::sqrt(3.0), 1e-5);
    EXPECT_EQ(a.triangleCount, b.triangleCount);
}

TEST(TessellateFaces, GeneratedNormalsOfASphereAreRadial) {
    const Mesh sphere = tessellate(SphereParams{}, {.segments = 128});
    IndexedFaceSetParams p;
    p.coord = sphere.positions;
    Array<std::int32_t> index = Array<std::int32_t>::ofSize(sphere.triangleCount * 4);
    for (unsigned t = 0; t < sphere.triangleCount; ++t)
        for (unsigned c = 0; c < 4; ++c)
            index.mutableData()[t * 4 + c] = c == 3 ? -1 : static_cast<int>(sphere.vertexIndex(t, c));
    p.coordIndex = index;
    for (const float crease : {0.5f, 3.2f}) {
        p.creaseAngle = crease;
        const Mesh mesh = tessellate(p);
        EXPECT_EQ(mesh.normals.binding(), MeshAttribute::Binding::vertex);
        for (unsigned t = 0; t < mesh.triangleCount; ++t)
            expectVec(Vec3f(mesh.normals.value(t, 0)), Vec3d(mesh.vertex(t, 0)), 2e-3);
    }
}

// 13.3.6: the four ways of binding colours, and with them normals.
TEST(TessellateFaces, ColorBindings) {
    const Color red{1, 0, 0}, green{0, 1, 0}, blue{0, 0, 1}, white{1, 1, 1};
    IndexedFaceSetParams p;
    p.coord = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {2, 0, 0}, {2, 1, 0}};
    p.coordIndex = {0, 1, 2, 3, -1, 1, 4, 5, 2, -1};
    p.color = {red, green, blue, white, red, green};
    const auto at = [](const Mesh& mesh, float x, float y, bool secondFace) {
        for (unsigned t = secondFace ? 2 : 0; t < (secondFace ? 4u : 2u); ++t)
            for (const Vec2f uv : {Vec2f(0, 0), Vec2f(1, 0), Vec2f(0, 1)})
                if (mesh.position(t, uv.x, uv.y) == Vec3f(x, y, 0)) {
                    const ColorRGBA c = mesh.color(t, uv.x, uv.y);
                    EXPECT_EQ(c.a, 1);
                    return Color{c.r, c.g, c.b};
                }
        ADD_FAILURE();
        return Color{};
    };
    const Mesh perVertex = tessellate(p);
    EXPECT_EQ(at(perVertex, 1, 0, false), green);
    EXPECT_EQ(at(perVertex, 1, 0, true), green);
    EXPECT_TRUE(perVertex.colors.values().as<Array<Color>>().sameStorage(p.color));

    p.colorIndex = {3, 2, 1, 0, -1, 0, 0, 0, 0, -1};
    const Mesh perCorner = tessellate(p);
    EXPECT_EQ(at(perCorner, 1, 0, false), blue);
    EXPECT_EQ(at(perCorner, 1, 0, true), red);

    p.colorPerVertex = false;
    p.colorIndex = {2, 1};
    const Mesh perFaceIndexed = tessellate(p);
    EXPECT_EQ(at(perFaceIndexed, 1, 0, false), blue);
    EXPECT_EQ(at(perFaceIndexed, 1, 0, true), green);

    p.colorIndex = {};
    const Mesh perFace = tessellate(p);
    EXPECT_EQ(at(perFace, 1, 0, false), red);
    EXPECT_EQ(at(perFace, 1, 0, true), green);

    p.normalPerVertex = false;
    p.normal = {{0, 0, 1}, {0, 0.6f, 0.8f}};
    p.normalIndex = {1, 0};
    p.colorRGBA = {{1, 0, 0, .5f}, {0, 1, 0, .25f}};
    const Mesh normals = tessellate(p);
    EXPECT_EQ(normals.shadingNormal(0, .3f, .3f), Vec3f(0, 0.6f, 0.8f));
    EXPECT_EQ(normals.shadingNormal(3, .3f, .3f), Vec3f(0, 0, 1));
    EXPECT_EQ(normals.color(3, .3f, .3f).a, .25f);
    EXPECT_TRUE(interpolate(normals, 3, .3f, .3f).colorHasAlpha);
    for (const Mesh* mesh : {&perVertex, &perCorner, &perFaceIndexed, &perFace, &normals}) {
        EXPECT_EQ(findDefect(*mesh), "");
        EXPECT_EQ(mesh->diagnostics.warnings(), 0u);
    }
}

TEST(TessellateFaces, FacesLeftOutKeepTheColorsOfTheOthersInStep) {
    IndexedFaceSetParams p;
    p.coord = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    p.coordIndex = {0, 1, 99, -1, 0, 1, -1, 0, 1, 2, 3};
    p.color = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    p.colorPerVertex = false;
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_EQ(mesh.triangleCount, 2u);
    EXPECT_EQ(mesh.diagnostics.warnings(), 2u);
    EXPECT_EQ(mesh.color(1, .2f, .2f), (ColorRGBA{0, 0, 1, 1}));
}

TEST(TessellateFaces, ShortOrWrongAttributesAreRepairedAndReported) {
    IndexedFaceSetParams p;
    p.coord = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    p.coordIndex = {0, 1, 2, -1, 0, 2, 3, -1};
    p.color = {{1, 0, 0}, {0, 1, 0}};
    p.normal = {{0, 0, 1}};
    p.normalIndex = {0, -7, 0, -1, 5};
    p.texCoord.resize(1);
    p.texCoord[0].point = {{.25f, .5f}};
    p.texCoordIndex = {1000000, 0, 0, -1, 0, 0, 0, -1};
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_EQ(mesh.triangleCount, 2u);
    EXPECT_EQ(mesh.diagnostics.warnings(), 3u);
    EXPECT_EQ(mesh.color(0, 0, 1), (ColorRGBA{0, 1, 0, 1}));
    EXPECT_EQ(mesh.shadingNormal(1, .5f, .5f), Vec3f(0, 0, 1));
}

// 13.3.6: s along the longest side of the bounding box, t along the next in the same scale; ties go X, Y, Z.
TEST(TessellateFaces, DefaultTextureCoordinates) {
    struct Case {
        Vec3f size;
        int s, t;
    };
    for (const Case& c : {Case{{4, 2, 1}, 0, 1}, Case{{1, 2, 4}, 2, 1}, Case{{2, 1, 4}, 2, 0}, Case{{2, 2, 2}, 0, 1},
                          Case{{1, 3, 3}, 1, 2}, Case{{3, 1, 3}, 0, 2}}) {
        IndexedFaceSetParams p = cube();
        Vec3f* points = p.coord.mutableData();
        for (std::size_t i = 0; i < 8; ++i) points[i] = Vec3f(7, -3, 1) + 0.5f * c.size * points[i];
        const Mesh mesh = tessellate(p);
        const float longest = c.size[c.s];
        for (unsigned t = 0; t < mesh.triangleCount; ++t) {
            const Vec3f at = (mesh.position(t, .25f, .5f) - mesh.bounds.min) / longest;
            const Vec4f st = mesh.texCoord(t, .25f, .5f);
            EXPECT_NEAR(st.x, at[c.s], 1e-5);
            EXPECT_NEAR(st.y, at[c.t], 1e-5);
        }
    }
}

TEST(TessellateFaces, TexCoordsOfThreeAndFourComponentsAndSeveralChannels) {
    IndexedFaceSetParams p;
    p.coord = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    p.coordIndex = {0, 1, 2};
    p.texCoord.resize(3);
    p.texCoord[0].point3 = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
    p.texCoord[1].point4 = {{1, 2, 3, 4}, {1, 2, 3, 4}, {1, 2, 3, 4}};
    p.texCoord[1].mapping = "normals";
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(mesh.texCoord(0, .25f, .25f, 0), Vec4f(1, 2, 3, 1));
    EXPECT_EQ(mesh.texCoord(0, .25f, .25f, 1), Vec4f(1, 2, 3, 4));
    EXPECT_EQ(mesh.texCoord(0, .25f, .5f, 2), Vec4f(.25f, .5f, 0, 1));
    EXPECT_EQ(mesh.texCoord(0, .25f, .5f, 9), Vec4f(0, 0, 0, 1));
    EXPECT_EQ(mesh.texCoords[1].mapping, String("normals"));
    Vec3f dPds, dPdt;
    ASSERT_TRUE(textureTangents(mesh, 0, 2, dPds, dPdt));
    EXPECT_EQ(dPds, Vec3f(1, 0, 0));
    EXPECT_EQ(dPdt, Vec3f(0, 1, 0));
    EXPECT_FALSE(textureTangents(mesh, 0, 0, dPds, dPdt));
}

TEST(TessellateFaces, BadInput) {
    IndexedFaceSetParams p = cube();
    p.coordIndex = {};
    EXPECT_TRUE(tessellate(p).empty());
    p = cube();
    p.coord = {};
    EXPECT_TRUE(tessellate(p).empty());
    p = cube();
    p.coord.mutableData()[0].x = NAN;
    const Mesh nan = tessellate(p);
    EXPECT_EQ(nan.triangleCount, 6u);
    EXPECT_EQ(nan.diagnostics.warnings(), 1u);
    EXPECT_EQ(findDefect(nan), "");
    p.coord.mutableData()[0].x = 1e30f;
    EXPECT_EQ(tessellate(p).triangleCount, 6u);
    for (const float crease : {-1.0f, NAN, -INFINITY}) {
        p = cube();
        p.creaseAngle = crease;
        const Mesh mesh = tessellate(p);
        EXPECT_EQ(mesh.triangleCount, 12u);
        EXPECT_FALSE(mesh.normals.present());
        EXPECT_EQ(mesh.diagnostics.warnings(), 1u);
    }
    p = cube();
    p.creaseAngle = INFINITY;
    EXPECT_TRUE(tessellate(p).normals.present());
    // All points of a polygon coincide, lie on a line, or repeat.
    EXPECT_TRUE(tessellate(polygon({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}})).empty());
    EXPECT_TRUE(tessellate(polygon({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {1.5f, 0, 0}})).empty());
    p = cube();
    p.coordIndex = {0, 0, 0, 0, -1, 4, 5, 5, 7, 6, 6, 4, -1, -1, -5, 1, 2, -1};
    const Mesh repeated = tessellate(p);
    EXPECT_EQ(repeated.triangleCount, 2u);
    EXPECT_DOUBLE_EQ(surfaceArea(repeated), 4);
}

TEST(TessellateFaces, RandomGarbageNeverLeavesTheArrays) {
    for (unsigned seed = 1; seed <= 400; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937 random(seed);
        const auto below = [&](unsigned n) { return static_cast<std::int32_t>(random() % n); };
        const auto indices = [&](int maximum) {
            Array<std::int32_t> result;
            const int n = below(60);
            for (int i = 0; i < n; ++i) {
                switch (below(12)) {
                    case 0:
                        result.push_back(-1);
                        break;
                    case 1:
                        result.push_back(static_cast<std::int32_t>(random()));
                        break;
                    default:
                        result.push_back(below(static_cast<unsigned>(maximum)));
                }
            }
            return result;
        };
        const auto number = [&]() -> float {
            switch (below(40)) {
                case 0:
                    return NAN;
                case 1:
                    return INFINITY;
                case 2:
                    return 3e38f;
                case 3:
                    return 1e-38f;
                default:
                    return static_cast<float>(below(7)) - 3;
            }
        };
        IndexedFaceSetParams p;
        for (int i = below(12); i > 0; --i) p.coord.push_back({number(), number(), number()});
        for (int i = below(12); i > 0; --i) p.normal.push_back({number(), number(), number()});
        for (int i = below(12); i > 0; --i) p.color.push_back({number(), number(), number()});
        if (below(2)) {
            p.texCoord.resize(1);
            for (int i = below(12); i > 0; --i) p.texCoord[0].point.push_back({number(), number()});
        }
        p.coordIndex = indices(10);
        if (below(3) == 0) {
            Array<std::int32_t> regular = p.coordIndex;
            for (std::size_t i = 0; i < regular.size(); ++i) regular.mutableData()[i] = i % 4 == 3 ? -1 : below(10);
            p.coordIndex = regular;
        }
        p.colorIndex = indices(10);
        p.normalIndex = indices(10);
        p.texCoordIndex = indices(10);
        p.ccw = below(2);
        p.convex = below(2);
        p.colorPerVertex = below(2);
        p.normalPerVertex = below(2);
        p.creaseAngle = number();
        const Mesh mesh = tessellate(p);
        ASSERT_EQ(findDefect(mesh), "");
        for (unsigned t = 0; t < mesh.triangleCount; ++t) {
            const SurfacePoint point = interpolate(mesh, t, .25f, .25f);
            ASSERT_NEAR(glm::length(point.geometricNormal), 1, 1e-4);
            ASSERT_NEAR(glm::length(point.shadingNormal), 1, 1e-4);
        }
        PrimitiveSetParams set;
        static_cast<SurfaceParams&>(set) = p;
        set.index = p.coordIndex;
        set.count = p.colorIndex;
        for (int kind = 0; kind < 8; ++kind) {
            set.kind = static_cast<PrimitiveSetParams::Kind>(kind);
            const Mesh other = tessellate(set);
            ASSERT_EQ(findDefect(other), "") << "kind " << kind;
            for (unsigned t = 0; t < other.triangleCount; ++t)
                ASSERT_NEAR(glm::length(interpolate(other, t, .25f, .25f).shadingNormal), 1, 1e-4);
        }
    }
}

}  // namespace
}  // namespace rtsg
