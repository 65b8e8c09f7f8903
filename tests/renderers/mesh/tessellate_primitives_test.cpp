// Primitives against areas, volumes and texture places in closed form.
#include "mesh_check.h"

namespace rtsg {
namespace {

TEST(TessellateBox, AreaVolumeAndTopology) {
    const Mesh mesh = tessellate(BoxParams{.size = {2, 3, 5}});
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_EQ(mesh.triangleCount, 12u);
    EXPECT_DOUBLE_EQ(surfaceArea(mesh), 2 * (2 * 3 + 3 * 5 + 2 * 5));
    EXPECT_DOUBLE_EQ(enclosedVolume(mesh), 30);
    EXPECT_TRUE(isWatertight(mesh));
    EXPECT_EQ(eulerCharacteristic(mesh), 2);
    EXPECT_EQ(mesh.bounds.min, Vec3f(-1, -1.5f, -2.5f));
    EXPECT_EQ(mesh.bounds.max, Vec3f(1, 1.5f, 2.5f));
    for (unsigned t = 0; t < 12; ++t) {
        const Vec3f n = mesh.geometricNormal(t);
        EXPECT_EQ(std::abs(n.x) + std::abs(n.y) + std::abs(n.z), 1.0f);
        EXPECT_GT(glm::dot(n, mesh.position(t, 1 / 3.0f, 1 / 3.0f)), 0);
    }
}

// ISO/IEC 19775-1 V4.0, 13.3.1: upright from outside; top tilted towards +Z, bottom towards -Z.
TEST(TessellateBox, TexturesAreUprightOnEachFace) {
    const Mesh mesh = tessellate(BoxParams{});
    struct Case {
        Vec3f normal, lowerLeft, upperRight;
    };
    for (const Case& c : {Case{{0, 0, 1}, {-1, -1, 1}, {1, 1, 1}}, Case{{0, 0, -1}, {1, -1, -1}, {-1, 1, -1}},
                          Case{{1, 0, 0}, {1, -1, 1}, {1, 1, -1}}, Case{{-1, 0, 0}, {-1, -1, -1}, {-1, 1, 1}},
                          Case{{0, 1, 0}, {-1, 1, 1}, {1, 1, -1}}, Case{{0, -1, 0}, {-1, -1, -1}, {1, -1, 1}}}) {
        EXPECT_EQ(texCoordAt(mesh, c.lowerLeft, c.normal), Vec2f(0, 0));
        EXPECT_EQ(texCoordAt(mesh, c.upperRight, c.normal), Vec2f(1, 1));
    }
}

TEST(TessellateBox, BadSizes) {
    for (const Vec3f size : {Vec3f(-1, 2, 2), Vec3f(NAN, 2, 2), Vec3f(2, INFINITY, 2), Vec3f(0, 0, 1)}) {
        const Mesh mesh = tessellate(BoxParams{.size = size});
        EXPECT_TRUE(mesh.empty());
        EXPECT_EQ(mesh.diagnostics.warnings(), 1u);
    }
    const Mesh flat = tessellate(BoxParams{.size = {2, 0, 2}});
    EXPECT_EQ(flat.diagnostics.warnings(), 1u);
    EXPECT_DOUBLE_EQ(surfaceArea(flat), 8);
    EXPECT_EQ(findDefect(flat), "");
}

TEST(TessellationOptions, SegmentsFollowFromTheChordOrAreGivenWithinLimits) {
    EXPECT_EQ(TessellationOptions{}.segmentsAround(), 48);
    for (const auto& [asked, given] : {std::pair{1, 4}, {5, 5}, {4096, 4096}, {100'000, 4096}})
        EXPECT_EQ((TessellationOptions{.segments = asked}.segmentsAround()), given);
    for (const float error : {.1f, .01f, 1e-3f, 1e-4f}) {
        const int n = TessellationOptions{.chordError = error}.segmentsAround();
        EXPECT_LE(1 - std::cos(kPiOfMesh / n), error) << n;
        EXPECT_TRUE(n == 8 || 1 - std::cos(kPiOfMesh / (n - 8)) > error) << n << " are more than it takes";
    }
    // Half as many rings from pole to pole: all corners but the poles are on 7 circles of 16.
    std::set<float> heights;
    const Mesh sphere = tessellate(SphereParams{}, {.segments = 16});
    for (const Vec3f& p : sphere.positions) heights.insert(p.y);
    EXPECT_EQ(heights.size(), 9U);
}

TEST(TessellateSphere, ConvergesWithSecondOrder) {
    double lastArea = 0, lastVolume = 0;
    for (const int n : {16, 32, 64, 128}) {
        const Mesh mesh = tessellate(SphereParams{.radius = 2}, {.segments = n});
        EXPECT_EQ(findDefect(mesh), "");
        EXPECT_TRUE(isWatertight(mesh));
        EXPECT_EQ(eulerCharacteristic(mesh), 2);
        const double area = 1 - surfaceArea(mesh) / (16 * kPiOfMesh),
                     volume = 1 - enclosedVolume(mesh) / (32 * kPiOfMesh / 3);
        EXPECT_GT(area, 0);
        EXPECT_GT(volume, 0);
        if (lastArea > 0) {
            EXPECT_NEAR(lastArea / area, 4, 0.2);
            EXPECT_NEAR(lastVolume / volume, 4, 0.2);
        }
        lastArea = area;
        lastVolume = volume;
    }
    EXPECT_LT(lastArea, 1e-3);
}

TEST(TessellateSphere, NormalsAreExactAndOutward) {
    const Mesh mesh = tessellate(SphereParams{.radius = 0.3f});
    for (unsigned t = 0; t < mesh.triangleCount; ++t) {
        EXPECT_GT(glm::dot(mesh.geometricNormal(t), mesh.shadingNormal(t, 0.3f, 0.3f)), 0.98f);
        for (unsigned c = 0; c < 3; ++c)
            expectVec(Vec3f(mesh.normals.value(t, c)), Vec3d(glm::normalize(Vec3d(mesh.vertex(t, c)))), 1e-6);
    }
    EXPECT_EQ(mesh.bounds.max, Vec3f(0.3f));
    EXPECT_EQ(mesh.bounds.min, Vec3f(-0.3f));
}

// 13.3.7: the seam is at the back, s runs counter-clockwise seen from above, t from south to north.
TEST(TessellateSphere, TextureWraps) {
    const Mesh mesh = tessellate(SphereParams{}, {.segments = 64});
    EXPECT_EQ(texCoordAt(mesh, {-1, 0, 0}, {-1, 0, 0}), Vec2f(0.25f, 0.5f));
    EXPECT_EQ(texCoordAt(mesh, {0, 0, 1}, {0, 0, 1}), Vec2f(0.5f, 0.5f));
    EXPECT_EQ(texCoordAt(mesh, {1, 0, 0}, {1, 0, 0}), Vec2f(0.75f, 0.5f));
    EXPECT_EQ(texCoordAt(mesh, {0, 1, 0}, {0, 1, 0}).y, 1);
    EXPECT_EQ(texCoordAt(mesh, {0, -1, 0}, {0, -1, 0}).y, 0);
    // No triangle spans the seam.
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c)
            EXPECT_LT(
                std::abs(mesh.texCoords[0].values.value(t, c).x - mesh.texCoords[0].values.value(t, (c + 1) % 3).x),
                0.02f);
}

TEST(TessellateOptions, ChordErrorIsKept) {
    EXPECT_EQ(TessellationOptions{}.segmentsAround(), 48);
    for (const float error : {0.02f, 0.01f, 0.001f, 1e-5f}) {
        const int n = TessellationOptions{.chordError = error}.segmentsAround();
        EXPECT_LE(1 - std::cos(kPiOfMesh / n), error);
        EXPECT_TRUE(n == 8 || 1 - std::cos(kPiOfMesh / (n - 8)) > error);
    }
    EXPECT_EQ(TessellationOptions{.segments = 1}.segmentsAround(), 4);
    EXPECT_EQ(TessellationOptions{.chordError = NAN}.segmentsAround(), 48);
}

TEST(TessellatePrimitives, AnyNumberOfSegmentsIsWatertight) {
    for (int n = 4; n < 20; ++n)
        for (const Mesh& mesh : {tessellate(SphereParams{}, {.segments = n}), tessellate(ConeParams{}, {.segments = n}),
                                 tessellate(CylinderParams{}, {.segments = n})}) {
            EXPECT_EQ(findDefect(mesh), "") << n;
            EXPECT_TRUE(isWatertight(mesh)) << n;
            EXPECT_EQ(eulerCharacteristic(mesh), 2) << n;
            EXPECT_GT(enclosedVolume(mesh), 0) << n;
        }
}

TEST(TessellateCone, ClosedForms) {
    const int n = 96;
    const double r = 1.5, h = 2.5;
    const Mesh mesh = tessellate(ConeParams{.bottomRadius = 1.5f, .height = 2.5f}, {.segments = n});
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_TRUE(isWatertight(mesh));
    EXPECT_EQ(eulerCharacteristic(mesh), 2);
    // Exactly that of the inscribed pyramid, which tends to the cone's.
    const double base = n * 0.5 * r * r * std::sin(2 * kPiOfMesh / n);
    const double apothem = r * std::cos(kPiOfMesh / n), side = n * r * std::sin(kPiOfMesh / n) * std::hypot(h, apothem);
    EXPECT_NEAR(surfaceArea(mesh), base + side, 1e-5);
    EXPECT_NEAR(enclosedVolume(mesh), base * h / 3, 1e-5);
    EXPECT_NEAR(enclosedVolume(mesh), kPiOfMesh * r * r * h / 3, 0.01);
    // Exact normals lean by the slope everywhere along a base corner.
    for (unsigned t = 0; t < static_cast<unsigned>(n); ++t) {
        const Vec3f p = mesh.vertex(t, 0), normal(mesh.normals.value(t, 0));
        const Vec3d expected = glm::normalize(Vec3d(p.x / r * h, r, p.z / r * h));
        expectVec(normal, expected);
    }
    EXPECT_EQ(tessellate(ConeParams{.side = false}, {.segments = n}).triangleCount, static_cast<unsigned>(n));
    EXPECT_EQ(tessellate(ConeParams{.bottom = false}, {.segments = n}).triangleCount, static_cast<unsigned>(n));
    EXPECT_TRUE(tessellate(ConeParams{.side = false, .bottom = false}).empty());
    EXPECT_EQ(texCoordAt(mesh, {-1.5f, -1.25f, 0}, glm::normalize(Vec3f(-2.5f, 1.5f, 0))), Vec2f(0.25f, 0));
    EXPECT_EQ(texCoordAt(mesh, {0, -1.25f, -1.5f}, {0, -1, 0}), Vec2f(0.5f, 0));
    EXPECT_EQ(texCoordAt(mesh, {0, -1.25f, 1.5f}, {0, -1, 0}), Vec2f(0.5f, 1));
}

TEST(TessellateCylinder, ClosedForms) {
    const int n = 96;
    const double r = 0.5, h = 4;
    const Mesh mesh = tessellate(CylinderParams{.radius = 0.5f, .height = 4}, {.segments = n});
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_TRUE(isWatertight(mesh));
    EXPECT_EQ(eulerCharacteristic(mesh), 2);
    const double base = n * 0.5 * r * r * std::sin(2 * kPiOfMesh / n), side = n * 2 * r * std::sin(kPiOfMesh / n) * h;
    EXPECT_NEAR(surfaceArea(mesh), 2 * base + side, 1e-5);
    EXPECT_NEAR(enclosedVolume(mesh), base * h, 1e-5);
    EXPECT_NEAR(surfaceArea(mesh), 2 * kPiOfMesh * r * (r + h), 0.02);
    for (unsigned t = 0; t < mesh.triangleCount; ++t) {
        const Vec3f n3 = mesh.shadingNormal(t, 0.2f, 0.2f), centre = mesh.position(t, 1 / 3.0f, 1 / 3.0f);
        EXPECT_GT(glm::dot(n3, mesh.geometricNormal(t)), 0.99f);
        EXPECT_GT(glm::dot(n3, std::abs(n3.y) > 0.5f ? centre : Vec3f(centre.x, 0, centre.z)), 0);
    }
    EXPECT_EQ(texCoordAt(mesh, {-0.5f, -2, 0}, {-1, 0, 0}), Vec2f(0.25f, 0));
    EXPECT_EQ(texCoordAt(mesh, {0.5f, 2, 0}, {1, 0, 0}), Vec2f(0.75f, 1));
    EXPECT_EQ(texCoordAt(mesh, {0, 2, 0.5f}, {0, 1, 0}), Vec2f(0.5f, 0));
    EXPECT_EQ(texCoordAt(mesh, {0.5f, 2, 0}, {0, 1, 0}), Vec2f(1, 0.5f));
    EXPECT_EQ(texCoordAt(mesh, {0.5f, -2, 0}, {0, -1, 0}), Vec2f(1, 0.5f));
    EXPECT_EQ(texCoordAt(mesh, {0, -2, 0.5f}, {0, -1, 0}), Vec2f(0.5f, 1));
    const auto count = [&](bool withSide, bool withTop, bool withBottom) {
        return tessellate(CylinderParams{.side = withSide, .top = withTop, .bottom = withBottom}, {.segments = n})
            .triangleCount;
    };
    EXPECT_EQ(count(true, false, false), 2u * n);
    EXPECT_EQ(count(false, true, false), 1u * n);
    EXPECT_EQ(count(false, false, true), 1u * n);
    EXPECT_EQ(count(false, false, false), 0u);
}

TEST(TessellatePrimitives, BadMeasuresDrawNothing) {
    for (const float bad : {0.0f, -1.0f, NAN, INFINITY, -INFINITY, 1e30f}) {
        for (const Mesh& mesh :
             {tessellate(SphereParams{.radius = bad}), tessellate(ConeParams{.bottomRadius = bad}),
              tessellate(ConeParams{.height = bad}), tessellate(CylinderParams{.radius = bad}),
              tessellate(CylinderParams{.height = bad}), tessellate(Disk2DParams{.outerRadius = bad}),
              tessellate(Rectangle2DParams{.size = {1, bad}}), tessellate(ArcClose2DParams{.radius = bad})}) {
            EXPECT_TRUE(mesh.empty()) << bad;
            EXPECT_EQ(mesh.diagnostics.warnings(), 1u) << bad;
            EXPECT_NE(mesh.diagnostics.all().front().text.find("is not above 0 and up to 1e+18"), std::string::npos);
        }
    }
}

TEST(TessellateFlat, AreasAndFronts) {
    const int n = 128;
    const double circle = n * 0.5 * std::sin(2 * kPiOfMesh / n);
    const Mesh disk = tessellate(Disk2DParams{.outerRadius = 2}, {.segments = n});
    EXPECT_NEAR(surfaceArea(disk), 4 * circle, 1e-5);
    const Mesh ring = tessellate(Disk2DParams{.innerRadius = 1, .outerRadius = 2}, {.segments = n});
    EXPECT_NEAR(surfaceArea(ring), 3 * circle, 1e-5);
    const Mesh rectangle = tessellate(Rectangle2DParams{.size = {3, 2}});
    EXPECT_DOUBLE_EQ(surfaceArea(rectangle), 6);
    EXPECT_EQ(texCoordAt(rectangle, {1.5f, 1, 0}, {0, 0, 1}), Vec2f(1, 1));
    const Mesh pie = tessellate(ArcClose2DParams{}, {.segments = n});
    EXPECT_NEAR(surfaceArea(pie), circle / 4, 1e-5);
    const Mesh chord = tessellate(ArcClose2DParams{.closure = ArcClose2DParams::Closure::chord}, {.segments = n});
    EXPECT_NEAR(surfaceArea(chord), circle / 4 - 0.5, 1e-5);
    const Mesh whole = tessellate(ArcClose2DParams{.startAngle = 1, .endAngle = 1}, {.segments = n});
    EXPECT_NEAR(surfaceArea(whole), circle, 1e-5);
    const Mesh triangles =
        tessellate(TriangleSet2DParams{.vertices = {{0, 0}, {1, 0}, {0, 1}, {0, 0}, {0, 1}, {1, 0}}});
    EXPECT_EQ(triangles.triangleCount, 2u);
    for (const Mesh* mesh : {&disk, &ring, &rectangle, &pie, &chord, &whole, &triangles}) {
        EXPECT_EQ(findDefect(*mesh), "");
        EXPECT_FALSE(mesh->solid);
        for (unsigned t = 0; t < mesh->triangleCount; ++t) EXPECT_EQ(mesh->geometricNormal(t), Vec3f(0, 0, 1));
    }
    EXPECT_TRUE(tessellate(Disk2DParams{.innerRadius = 2, .outerRadius = 1}).empty());
}

TEST(TessellateFlat, ADiskOfEqualRadiiIsACircleOfLines) {
    const Mesh circle = tessellate(Disk2DParams{.innerRadius = 2, .outerRadius = 2}, {.segments = 40});
    EXPECT_TRUE(circle.diagnostics.all().empty());
    EXPECT_GE(circle.strokeCount, 40u);
    double length = 0;
    for (std::uint32_t i = 0; i < circle.strokeCount; ++i) {
        EXPECT_NEAR(glm::length(circle.vertex(i, 0)), 2, 1e-6);
        length += double{glm::distance(circle.vertex(i, 0), circle.vertex(i, 1))};
    }
    EXPECT_NEAR(length, 4 * kPiOfMesh, .02);
}

}  // namespace
}  // namespace rtsg
