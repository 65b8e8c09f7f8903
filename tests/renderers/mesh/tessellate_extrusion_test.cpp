// Extrusions against closed forms and the rules of ISO/IEC 19775-1 V4.0, 13.3.5.
#include <algorithm>
#include <random>

#include "mesh_check.h"

namespace rtsg {
namespace {

/// Counter-clockwise seen from +Y: z runs downwards there.
Array<Vec2f> circle(int n, double radius = 1, bool closed = true) {
    Array<Vec2f> result;
    for (int i = 0; i < n + (closed ? 1 : 0); ++i) {
        const double a = 2 * kPiOfMesh * (i % n) / n;
        result.push_back({static_cast<float>(radius * std::cos(a)), static_cast<float>(-radius * std::sin(a))});
    }
    return result;
}

TEST(TessellateExtrusion, DefaultIsABox) {
    const Mesh mesh = tessellate(ExtrusionParams{});
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_TRUE(isWatertight(mesh));
    EXPECT_EQ(eulerCharacteristic(mesh), 2);
    EXPECT_NEAR(surfaceArea(mesh), 2 * 4 + 4 * 2, 1e-6);
    EXPECT_NEAR(enclosedVolume(mesh), 4, 1e-6);
    EXPECT_EQ(mesh.bounds.min, Vec3f(-1, 0, -1));
    EXPECT_EQ(mesh.bounds.max, Vec3f(1, 1, 1));
    ExtrusionParams p;
    p.ccw = false;
    EXPECT_NEAR(enclosedVolume(tessellate(p)), -4, 1e-6);
}

TEST(TessellateExtrusion, CircleAlongStraightSpineIsACylinder) {
    const int n = 90;
    for (const Vec3f end :
         {Vec3f(0, 3, 0), Vec3f(0, -3, 0), Vec3f(3, 0, 0), Vec3f(1, 2, -2), Vec3f(0, -2.9999f, .01f)}) {
        ExtrusionParams p;
        p.crossSection = circle(n, 0.5);
        p.spine = {{0, 0, 0}, 0.25f * end, 0.5f * end, end};
        p.creaseAngle = 0.5f;
        const Mesh mesh = tessellate(p);
        EXPECT_EQ(findDefect(mesh), "");
        EXPECT_TRUE(isWatertight(mesh));
        const double h = glm::length(Vec3d(end)), base = n * 0.125 * std::sin(2 * kPiOfMesh / n);
        EXPECT_NEAR(surfaceArea(mesh), 2 * base + n * std::sin(kPiOfMesh / n) * h, 1e-4);
        EXPECT_NEAR(enclosedVolume(mesh), base * h, 1e-4);
        // Smooth around the side, flat caps although they meet it.
        const Vec3d axis = glm::normalize(Vec3d(end));
        for (unsigned t = 0; t < mesh.triangleCount; ++t) {
            const Vec3d g(mesh.geometricNormal(t));
            for (unsigned c = 0; c < 3; ++c) {
                const Vec3d s(mesh.normals.value(t, c)), at(mesh.vertex(t, c));
                if (std::abs(glm::dot(g, axis)) > 0.5)
                    EXPECT_GT(glm::dot(s, g), 0.99999);
                else
                    EXPECT_GT(glm::dot(s, glm::normalize(at - glm::dot(at, axis) * axis)), 0.999);
            }
        }
    }
}

// 13.3.5.4.3: the plane Y = 0 is turned by the rotation that takes +Y to the spine.
TEST(TessellateExtrusion, CollinearSpineTurnsTheSectionTheShortWay) {
    ExtrusionParams p;
    p.spine = {{0, 0, 0}, {0, 0, 5}};
    const Mesh mesh = tessellate(p);
    // +Y to +Z is a quarter turn about X: section x stays, section z becomes -y.
    EXPECT_NEAR(mesh.vertex(0, 0).x, 1, 1e-6);
    EXPECT_NEAR(mesh.vertex(0, 0).y, -1, 1e-6);
    EXPECT_NEAR(enclosedVolume(mesh), 20, 1e-5);
}

TEST(TessellateExtrusion, ConcaveAndOpenSections) {
    ExtrusionParams p;
    p.crossSection = {{0, 0}, {0, -2}, {-1, -2}, {-1, -1}, {-2, -1}, {-2, 0}, {0, 0}};
    p.convex = false;
    p.spine = {{0, 0, 0}, {0, 2, 0}};
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_TRUE(isWatertight(mesh));
    EXPECT_NEAR(surfaceArea(mesh), 2 * 3 + 8 * 2, 1e-5);
    EXPECT_NEAR(enclosedVolume(mesh), 6, 1e-5);
    // An open section still has caps, closed by one more edge; its side stays open.
    p.crossSection = {{1, 0}, {0, -1}, {-1, 0}};
    const Mesh open = tessellate(p);
    EXPECT_EQ(findDefect(open), "");
    EXPECT_NEAR(surfaceArea(open), 2 * 1 + 2 * std::sqrt(2.0) * 2, 1e-5);
    EXPECT_FALSE(isWatertight(open));
    p.beginCap = p.endCap = false;
    EXPECT_NEAR(surfaceArea(tessellate(p)), 2 * std::sqrt(2.0) * 2, 1e-5);
}

TEST(TessellateExtrusion, ClosedSpineIsATorus) {
    const int n = 64, m = 32;
    ExtrusionParams p;
    p.crossSection = circle(m, 0.5);
    Array<Vec3f> spine;
    for (int i = 0; i <= n; ++i) {
        const double a = 2 * kPiOfMesh * (i % n) / n;
        spine.push_back({static_cast<float>(2 * std::cos(a)), 0, static_cast<float>(2 * std::sin(a))});
    }
    p.spine = spine;
    p.beginCap = p.endCap = false;
    p.creaseAngle = 1;
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_TRUE(isWatertight(mesh));
    EXPECT_EQ(eulerCharacteristic(mesh), 0);
    EXPECT_EQ(mesh.normals.binding(), MeshAttribute::Binding::vertex);
    EXPECT_NEAR(surfaceArea(mesh), 4 * kPiOfMesh * kPiOfMesh * 2 * 0.5, 0.3);
    EXPECT_NEAR(std::abs(enclosedVolume(mesh)), 2 * kPiOfMesh * kPiOfMesh * 2 * 0.25, 0.2);
    // 13.3.5.6: caps are made even then.
    p.beginCap = p.endCap = true;
    EXPECT_EQ(tessellate(p).triangleCount, mesh.triangleCount + 2u * (m - 2));
}

// 13.3.5.3: at a bend the section lies in the plane that halves it; Y across the neighbours, Z out of the bend.
TEST(TessellateExtrusion, BendHalvesTheAngle) {
    ExtrusionParams p;
    p.spine = {{0, 0, 0}, {0, 2, 0}, {2, 2, 0}};
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(findDefect(mesh), "");
    EXPECT_TRUE(isWatertight(mesh));
    for (int j = 0; j < 4; ++j) {
        const Vec3d middle = Vec3d(mesh.positions[static_cast<std::size_t>(4 + j)]) - Vec3d(0, 2, 0);
        EXPECT_NEAR(glm::dot(middle, Vec3d(1, 1, 0)), 0, 1e-5);
        EXPECT_NEAR(std::abs(middle.z), 1, 1e-5);
    }
    EXPECT_GT(enclosedVolume(mesh), 0);
}

TEST(TessellateExtrusion, ZigZagDoesNotFlip) {
    ExtrusionParams p;
    p.crossSection = circle(12, 0.1);
    Array<Vec3f> spine;
    for (int i = 0; i < 20; ++i) spine.push_back({i % 2 ? 0.2f : -0.2f, static_cast<float>(i), 0});
    p.spine = spine;
    const Mesh mesh = tessellate(p);
    EXPECT_TRUE(isWatertight(mesh));
    // A flip would twist the side through itself; then neighbouring rings' corners are far apart.
    for (std::size_t i = 0; i + 12 < mesh.positions.size(); ++i)
        EXPECT_LT(glm::length(mesh.positions[i + 12] - mesh.positions[i]), 1.3f);
}

/// An S in the plane z = 0: by itself Z is +z in the first bend and -z in the second, "flipped" there as its product
/// with the one before is negative (13.3.5.4). So Z is +z everywhere and X = (Y.y, -Y.x, 0).
TEST(TessellateExtrusion, ZIsFlippedWhereTheSpineBendsTheOtherWay) {
    ExtrusionParams p;
    p.spine = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {2, 1, 0}};
    p.crossSection = {{0.125f, 0.25f}, {0.375f, 0.25f}};
    p.beginCap = p.endCap = false;
    const double half = std::sqrt(0.5);
    const Vec2d ys[] = {{1, 0}, {half, half}, {half, half}, {1, 0}};
    std::vector<Vec3d> expected;
    for (std::size_t i = 0; i < 4; ++i)
        for (const double x : {0.125, 0.375})
            expected.push_back(Vec3d(p.spine[i]) + Vec3d(ys[i].y * x, -ys[i].x * x, 0.25));
    const Mesh mesh = tessellate(p);
    ASSERT_EQ(mesh.triangleCount, 6u);
    std::vector<bool> met(expected.size());
    for (unsigned t = 0; t < mesh.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c) {
            const Vec3d at(mesh.vertex(t, c));
            const auto same = std::ranges::find_if(expected, [&](Vec3d e) { return glm::distance(e, at) < 1e-6; });
            ASSERT_NE(same, expected.end()) << at.x << ' ' << at.y << ' ' << at.z;
            met[static_cast<std::size_t>(same - expected.begin())] = true;
        }
    EXPECT_EQ(std::ranges::count(met, true), 8);
}

/// Where all points of the spine coincide, sections lie as they are given, turned and scaled.
TEST(TessellateExtrusion, ASpineOfOnePointTurnsAndScales) {
    constexpr int kSteps = 64;
    ExtrusionParams ball;
    ball.beginCap = ball.endCap = false;
    ball.crossSection = {}, ball.spine = {}, ball.orientation = {};
    for (int i = 0; i <= kSteps; ++i) {
        const double at = kPiOfMesh * i / kSteps;
        ball.crossSection.push_back(Vec2f(i % kSteps ? std::sin(at) : 0, std::cos(at)));
        ball.spine.push_back(Vec3f(1, 2, 3));
        ball.orientation.push_back({0, 0, 1, static_cast<float>(2 * at)});
    }
    const Mesh sphere = tessellate(ball);
    EXPECT_EQ(findDefect(sphere), "");
    EXPECT_EQ(sphere.diagnostics.warnings(), 0u);
    for (unsigned t = 0; t < sphere.triangleCount; ++t)
        for (unsigned c = 0; c < 3; ++c)
            EXPECT_NEAR(glm::distance(Vec3d(sphere.vertex(t, c)), Vec3d(1, 2, 3)), 1, 1e-6);
    EXPECT_NEAR(surfaceArea(sphere), 4 * kPiOfMesh, .02);
    EXPECT_NEAR(std::abs(enclosedVolume(sphere)), 4 * kPiOfMesh / 3, .02);

    ExtrusionParams ring;
    ring.beginCap = ring.endCap = false;
    ring.spine = {{0, 5, 0}, {0, 5, 0}};
    ring.scale = {{1, 1}, {2, 3}};
    const Mesh flat = tessellate(ring);
    EXPECT_NEAR(surfaceArea(flat), 4 * 6 - 4, 1e-5);
    EXPECT_EQ(flat.bounds.min, Vec3f(-2, 5, -3));
    EXPECT_EQ(flat.bounds.max, Vec3f(2, 5, 3));

    ring.scale = {{1, 1}};
    const Mesh nothing = tessellate(ring);
    EXPECT_TRUE(nothing.empty());
    EXPECT_GE(nothing.diagnostics.warnings(), 1u);
}

TEST(TessellateExtrusion, ScaleOrientationAndCoincidentPoints) {
    ExtrusionParams p;
    p.spine = {{0, 0, 0}, {0, 3, 0}};
    p.scale = {{1, 1}, {0, 0}};
    const Mesh pyramid = tessellate(p);
    EXPECT_EQ(findDefect(pyramid), "");
    EXPECT_NEAR(enclosedVolume(pyramid), 4, 1e-5);
    EXPECT_NEAR(surfaceArea(pyramid), 4 + 4 * std::sqrt(10.0), 1e-5);

    p.scale = {{2, 3}};
    p.orientation = {Rotation{0, 1, 0, static_cast<float>(kPiOfMesh / 2)}};
    const Mesh turned = tessellate(p);
    EXPECT_NEAR(turned.bounds.max.x, 3, 1e-5);
    EXPECT_NEAR(turned.bounds.max.z, 2, 1e-5);

    p = {};
    p.spine = {{0, 0, 0}, {0, 1, 0}, {0, 1, 0}, {0, 1, 0}, {0, 2, 0}};
    p.scale = {{1, 1}, {1, 1}, {2, 2}, {.5f, .5f}, {.5f, .5f}};
    const Mesh steps = tessellate(p);
    EXPECT_EQ(findDefect(steps), "");
    EXPECT_TRUE(isWatertight(steps));
    EXPECT_NEAR(enclosedVolume(steps), 4 + 1, 1e-5);
    EXPECT_EQ(steps.diagnostics.warnings(), 0u);
}

TEST(TessellateExtrusion, TextureCoordinates) {
    ExtrusionParams p;
    p.crossSection = {{2, 1}, {2, -1}, {-2, -1}, {-2, 1}, {2, 1}};
    const Mesh mesh = tessellate(p);
    EXPECT_EQ(texCoordAt(mesh, {2, 0, 1}, {1, 0, 0}), Vec2f(0, 0));
    EXPECT_EQ(texCoordAt(mesh, {2, 1, -1}, {1, 0, 0}), Vec2f(.25f, 1));
    EXPECT_EQ(texCoordAt(mesh, {2, 1, 1}, {0, 0, 1}), Vec2f(1, 1));
    EXPECT_EQ(texCoordAt(mesh, {-2, 1, -1}, {0, 1, 0}), Vec2f(0, 0));
    EXPECT_EQ(texCoordAt(mesh, {2, 1, 1}, {0, 1, 0}), Vec2f(1, .5f));
    EXPECT_EQ(texCoordAt(mesh, {2, 0, 1}, {0, -1, 0}), Vec2f(1, .5f));
}

TEST(TessellateExtrusion, DifficultSpinesStayFinite) {
    const std::vector<Array<Vec3f>> spines = {
        {{0, 0, 0}, {1, 0, 0}, {0, 0, 0}},                                   // there and back
        {{0, 0, 0}, {0, 1, 0}, {0, 0, 0}, {0, 1, 0}},                        // again and again
        {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {3, 1, 0}, {3, 2, 0}},  // collinear, then not
        {{0, 0, 0}, {1, 1, 0}, {0, 0, 0}, {0, 0, 1}},                        // back on itself at a corner
        {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {0, 0, 0}},  // closed with coincident ends
        {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 0, 0}},             // closed, turning back
        {{1e17f, 0, 0}, {1e17f, 1, 0}, {-1e17f, 1, 5}},                      // huge
        {{0, 0, 0}, {1e-30f, 0, 0}, {1e-30f, 1e-30f, 0}},                    // tiny
        {{1000, 0, 0}, {1000, 1, 0}, {1000.0001f, 2, 0}, {1000, 3, 0}},      // collinear but for rounding
    };
    for (std::size_t i = 0; i < spines.size(); ++i) {
        SCOPED_TRACE(i);
        ExtrusionParams p;
        p.spine = spines[i];
        p.creaseAngle = 1;
        const Mesh mesh = tessellate(p);
        EXPECT_EQ(findDefect(mesh), "");
        EXPECT_FALSE(mesh.empty());
        for (unsigned t = 0; t < mesh.triangleCount; ++t)
            EXPECT_NEAR(glm::length(mesh.shadingNormal(t, .25f, .25f)), 1, 1e-4);
    }
}

TEST(TessellateExtrusion, RandomGarbageStaysFinite) {
    for (unsigned seed = 1; seed <= 500; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937 random(seed);
        const auto below = [&](unsigned n) { return static_cast<int>(random() % n); };
        const auto number = [&]() -> float {
            const int kind = below(60);
            return kind == 0 ? NAN : kind == 1 ? 1e19f : kind == 2 ? 1e-40f : static_cast<float>(below(5)) - 2;
        };
        ExtrusionParams p;
        p.spine = {};
        p.crossSection = {};
        p.scale = {};
        p.orientation = {};
        for (int i = below(8); i > 0; --i) p.spine.push_back({number(), number(), number()});
        for (int i = below(8); i > 0; --i) p.crossSection.push_back({number(), number()});
        for (int i = below(8); i > 0; --i) p.scale.push_back({number(), number()});
        for (int i = below(8); i > 0; --i) p.orientation.push_back({number(), number(), number(), number()});
        p.beginCap = below(2);
        p.endCap = below(2);
        p.ccw = below(2);
        p.creaseAngle = number();
        const Mesh mesh = tessellate(p);
        ASSERT_EQ(findDefect(mesh), "");
        EXPECT_TRUE(!mesh.empty() || mesh.diagnostics.warnings() > 0);
        for (unsigned t = 0; t < mesh.triangleCount; ++t)
            ASSERT_NEAR(glm::length(mesh.shadingNormal(t, .25f, .25f)), 1, 1e-4);
    }
}

TEST(TessellateExtrusion, TooMuchIsRefused) {
    ExtrusionParams p;
    p.spine = Array<Vec3f>::ofSize(20000);
    p.crossSection = Array<Vec2f>::ofSize(20000);
    const Mesh mesh = tessellate(p);
    EXPECT_TRUE(mesh.empty());
    EXPECT_EQ(mesh.diagnostics.warnings(), 1u);
}

}  // namespace
}  // namespace rtsg
