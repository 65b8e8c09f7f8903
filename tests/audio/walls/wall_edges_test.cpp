// Edges of meshes against a plain search among all pairs of triangles.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "geometry/straight_edges.h"
#include "geometry/wall_edges.h"

namespace rtsg {
namespace {

using Triangle = std::array<Vec3f, 3>;

/// Each corner a position of its own.
Mesh meshOfTriangles(const std::vector<Triangle>& triangles) {
    Mesh mesh;
    std::vector<Vec3f> positions;
    std::vector<std::int32_t> corners;
    for (const Triangle& triangle : triangles)
        for (const Vec3f& p : triangle) {
            corners.push_back(static_cast<std::int32_t>(positions.size()));
            positions.push_back(p);
        }
    mesh.positions = Array<Vec3f>(std::span<const Vec3f>(positions));
    mesh.triangles = Array<std::int32_t>(std::span<const std::int32_t>(corners));
    mesh.triangleCount = static_cast<std::uint32_t>(triangles.size());
    return mesh;
}

struct Ends {
    Vec3f a, b;
};
bool sameEnds(const Ends& x, const Vec3f& from, const Vec3f& to) {
    return (x.a == from && x.b == to) || (x.a == to && x.b == from);
}

/// Radians between the two surfaces beside an edge, pi where they go on as one.
double angleAt(const Vec3f& from, const Vec3f& to, const Vec3f& besideA, const Vec3f& besideB) {
    const glm::dvec3 axis = glm::normalize(glm::dvec3(to - from));
    const auto across = [&](const Vec3f& p) {
        const glm::dvec3 displacement(p - from);
        return glm::normalize(displacement - axis * glm::dot(displacement, axis));
    };
    return std::acos(std::clamp(glm::dot(across(besideA), across(besideB)), -1.0, 1.0));
}

/// By looking at each side of each triangle for all others with the same ends.
std::vector<Ends> plainEdges(const std::vector<Triangle>& triangles) {
    std::vector<Ends> found;
    for (const Triangle& triangle : triangles)
        for (std::size_t c = 0; c < 3; ++c) {
            const Ends ends{triangle[c], triangle[(c + 1) % 3]};
            std::vector<Vec3f> beside;
            for (const Triangle& other : triangles)
                for (std::size_t k = 0; k < 3; ++k)
                    if (sameEnds(ends, other[k], other[(k + 1) % 3])) beside.push_back(other[(k + 2) % 3]);
            if (beside.size() > 2 || (beside.size() == 2 && angleAt(ends.a, ends.b, beside[0], beside[1]) > M_PI - .1))
                continue;
            if (std::none_of(found.begin(), found.end(), [&](const Ends& e) { return sameEnds(ends, e.a, e.b); }))
                found.push_back(ends);
        }
    return found;
}

/// A sheet of n x n squares, every corner lifted by chance, some squares missing.
std::vector<Triangle> sheet(int n, std::mt19937& random) {
    std::vector<Vec3f> corners;
    std::uniform_real_distribution<float> lift(-.3f, .3f);
    for (int i = 0; i <= n; ++i)
        for (int k = 0; k <= n; ++k)
            corners.emplace_back(static_cast<float>(i) - 3, static_cast<float>(k) - 3, random() % 2 ? lift(random) : 0);
    std::vector<Triangle> triangles;
    const auto at = [&](int i, int k) { return corners[static_cast<std::size_t>(i * (n + 1) + k)]; };
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < n; ++k) {
            if (random() % 5 == 0) continue;
            triangles.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
            triangles.push_back({at(i, k + 1), at(i, k), at(i + 1, k + 1)});
        }
    // Fins, so that some sides belong to three.
    for (int k = 0; k < n; k += 2) triangles.push_back({at(1, k), at(1, k + 1), at(1, k) + Vec3f(0, 0, 2)});
    std::shuffle(triangles.begin(), triangles.end(), random);
    return triangles;
}

TEST(WallEdges, AreThoseThatAPlainSearchFindsAndInTheSameOrderHoweverTrianglesAreNumbered) {
    for (unsigned seed = 1; seed <= 12; ++seed) {
        std::mt19937 random(seed);
        std::vector<Triangle> triangles = sheet(6, random);
        const std::vector<MeshEdge> edges = edgesOf(meshOfTriangles(triangles));
        const std::vector<Ends> plain = plainEdges(triangles);
        ASSERT_EQ(edges.size(), plain.size()) << "seed " << seed;
        for (const Ends& e : plain)
            EXPECT_EQ(std::count_if(edges.begin(), edges.end(),
                                    [&](const MeshEdge& edge) { return sameEnds(e, edge.from, edge.to); }),
                      1)
                << "seed " << seed;
        std::shuffle(triangles.begin(), triangles.end(), random);
        const std::vector<MeshEdge> again = edgesOf(meshOfTriangles(triangles));
        ASSERT_EQ(again.size(), edges.size());
        for (std::size_t i = 0; i < edges.size(); ++i) {
            EXPECT_EQ(again[i].from, edges[i].from) << "seed " << seed;
            EXPECT_EQ(again[i].to, edges[i].to) << "seed " << seed;
            // The surfaces beside it may be told the other way round.
            const bool same = again[i].besideA == edges[i].besideA && again[i].besideB == edges[i].besideB;
            const bool turned = again[i].besideA == edges[i].besideB && again[i].besideB == edges[i].besideA;
            EXPECT_TRUE(same || turned) << "seed " << seed;
        }
    }
}

TEST(WallEdges, KnowOneZeroLeaveOutWhatIsNoNumberAndWhatHasNoLength) {
    const Triangle left{Vec3f(0, 0, 0), Vec3f(0, 1, 0), Vec3f(-1, 0, 0)};
    const Triangle up{Vec3f(-0.f, 1, -0.f), Vec3f(0, -0.f, 0), Vec3f(0, 0, 1)};
    // The side that they share, and two rims of each.
    EXPECT_EQ(edgesOf(meshOfTriangles({left, up})).size(), 5u);
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
    EXPECT_EQ(edgesOf(meshOfTriangles({{Vec3f(0), Vec3f(1, 0, 0), Vec3f(nan, 0, 0)}})).size(), 1u);
    EXPECT_EQ(edgesOf(meshOfTriangles({{Vec3f(0), Vec3f(1, 0, 0), Vec3f(0, infinite, 0)}})).size(), 1u);
    EXPECT_TRUE(edgesOf(meshOfTriangles({{Vec3f(1), Vec3f(1), Vec3f(1)}})).empty());
    EXPECT_TRUE(edgesOf(Mesh()).empty());
}

TEST(WallEdges, ToldOfAnEdgeAreACornerOfEachSurfaceBesideItAndAtARimTwiceTheSame) {
    const Triangle floor{Vec3f(0, 0, 0), Vec3f(2, 0, 0), Vec3f(1, 0, 1)};
    const Triangle wall{Vec3f(2, 0, 0), Vec3f(0, 0, 0), Vec3f(1, 3, 0)};
    const std::vector<MeshEdge> edges = edgesOf(meshOfTriangles({floor, wall}));
    ASSERT_EQ(edges.size(), 5u);
    for (const MeshEdge& edge : edges) {
        const bool shared = edge.from == Vec3f(0) && edge.to == Vec3f(2, 0, 0);
        EXPECT_EQ(edge.besideA == edge.besideB, !shared);
        if (!shared) continue;
        EXPECT_EQ(edge.besideA, floor[2]);
        EXPECT_EQ(edge.besideB, wall[2]);
    }
}

/// A triangle without area beside an edge is no surface that sound could bend round.
TEST(WallEdges, BothSurfacesOfAnEdgeHaveADirection) {
    const MeshEdge whole{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {.3f, 0, 1}};
    WallEdge placed;
    ASSERT_TRUE(placedEdge(whole, WorldFromLocal(1.0), placed));
    EXPECT_LT(glm::distance(placed.faceA, glm::dvec3(0, 1, 0)), 1e-6);
    EXPECT_LT(glm::distance(placed.faceB, glm::dvec3(0, 0, 1)), 1e-6);
    for (const bool first : {true, false}) {
        MeshEdge flat = whole;
        (first ? flat.besideA : flat.besideB) = Vec3f(.5f, 0, 0);
        EXPECT_FALSE(placedEdge(flat, WorldFromLocal(1.0), placed)) << first;
    }
}

/// The unit square in y = 0 as a wall.
Wall square(const WorldFromLocal& m = WorldFromLocal(1.0)) {
    Wall wall;
    wall.mesh = std::make_shared<const Mesh>(meshOfTriangles(
        {{Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(1, 0, 1)}, {Vec3f(0, 0, 0), Vec3f(1, 0, 1), Vec3f(0, 0, 1)}}));
    wall.worldFromLocal = m;
    return wall;
}

WorldFromLocal turnedAboutZ(double degrees, const glm::dvec3& by = glm::dvec3(0)) {
    const double a = degrees * M_PI / 180;
    WorldFromLocal m(1.0);
    m[0] = {std::cos(a), std::sin(a), 0};
    m[1] = {-std::sin(a), std::cos(a), 0};
    m[3] = by;
    return m;
}

/// Rims, and edges of two surfaces.
std::array<int, 2> kindsIn(const EdgeTable& table, const std::vector<std::uint32_t>& open = {}) {
    std::array<int, 2> kinds{};
    table.visitBut(open, [&](const WallEdge& edge) { ++kinds[glm::dot(edge.faceA, edge.faceB) > 1 - 1e-9 ? 0 : 1]; });
    return kinds;
}

TEST(EdgeTable, EdgesOfWallsAtOnePlaceAreOne) {
    using Kinds = std::array<int, 2>;
    EdgeTable table;
    table.change(0, square());
    EXPECT_EQ(kindsIn(table), (Kinds{4, 0}));
    table.change(3, square(turnedAboutZ(90)));
    EXPECT_EQ(kindsIn(table), (Kinds{6, 1}));
    // The other one has its rim while one of them is open, and again when that is away.
    EXPECT_EQ(kindsIn(table, {3}), (Kinds{4, 0}));
    EXPECT_EQ(kindsIn(table, {0}), (Kinds{4, 0}));
    table.change(3, square(turnedAboutZ(90, {0, .1, 0})));
    EXPECT_EQ(kindsIn(table), (Kinds{8, 0}));
    // Almost there: the rounding of single precision.
    table.change(3, square(turnedAboutZ(90, {3e-7, -2e-7, 1e-7})));
    EXPECT_EQ(kindsIn(table), (Kinds{6, 1}));
    // A surface that goes on, one that is there already, and a third one.
    table.change(3, square(turnedAboutZ(178)));
    EXPECT_EQ(kindsIn(table), (Kinds{6, 0}));
    table.change(3, square());
    EXPECT_EQ(kindsIn(table), (Kinds{4, 0}));
    table.change(3, square(turnedAboutZ(90)));
    table.change(1, square(turnedAboutZ(230)));
    EXPECT_EQ(kindsIn(table), (Kinds{9, 0}));
    EXPECT_EQ(kindsIn(table, {0}), (Kinds{6, 1}));
    table.change(3, Wall());
    EXPECT_EQ(kindsIn(table), (Kinds{6, 1}));
    table.change(0, Wall());
    table.change(1, Wall());
    EXPECT_EQ(kindsIn(table), (Kinds{0, 0}));
}

TEST(EdgeTable, RoundingIsThatOfTheEdgesEndsWhereverItsMiddleIs) {
    // From -100 to 100 m: the middle is 0, where cubes begin, and ends are good to some micrometres.
    WorldFromLocal large(200.0);
    large[3] = {0, 0, -100};
    for (const double off : {-6e-6, -2e-6, 2e-6, 6e-6}) {
        WorldFromLocal other = turnedAboutZ(90, {off, 0, -100 + off});
        for (int i = 0; i < 3; ++i) other[i] *= 200.0;
        EdgeTable table;
        table.change(0, square(large));
        table.change(1, square(other));
        EXPECT_EQ(kindsIn(table), (std::array<int, 2>{6, 1})) << off;
    }
}

TEST(EdgeTable, TinyMeshesAreLookedThroughAsQuickly) {
    // 20,000 triangles within a centimetre, as of a model in other units: with all of their edges in one list this took
    // seconds a change; the test is that it ends.
    std::vector<Triangle> triangles;
    for (int i = 0; i < 20'000; ++i) {
        const auto x = static_cast<float>(i % 150), y = static_cast<float>(i / 150);
        triangles.push_back({Vec3f(x, y, 0), Vec3f(x + .5f, y, .3f), Vec3f(x, y + .5f, .1f)});
    }
    Wall wall;
    wall.mesh = std::make_shared<const Mesh>(meshOfTriangles(triangles));
    wall.worldFromLocal = WorldFromLocal(1e-5);
    EdgeTable table;
    for (int frame = 0; frame < 5; ++frame) {
        wall.worldFromLocal[3] = {1e-4 * frame, 0, 0};
        table.change(0, wall);
    }
    EXPECT_EQ(kindsIn(table)[0], 60'000);
}

TEST(EdgeTable, IsAfterChangesAsOneThatWasBuiltAnew) {
    const unsigned seed = 1128;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    EdgeTable table;
    std::array<Wall, 6> walls;
    for (int step = 0; step < 300; ++step) {
        const std::uint32_t slot = random() % walls.size();
        // Large coordinates, and places at the cubes' sides.
        const glm::dvec3 by = glm::dvec3(.01 * (random() % 2), 0, 0) + 1000.0 * (random() % 2);
        walls[slot] = random() % 4 ? square(turnedAboutZ(90.0 * (random() % 4), by)) : Wall();
        table.change(slot, walls[slot]);
        EdgeTable anew;
        for (std::uint32_t i = 0; i < walls.size(); ++i) anew.change(i, walls[i]);
        const std::vector<std::uint32_t> open{static_cast<std::uint32_t>(random() % walls.size())};
        EXPECT_EQ(kindsIn(table), kindsIn(anew)) << step;
        EXPECT_EQ(kindsIn(table, open), kindsIn(anew, open)) << step;
    }
}

std::vector<MeshEdge> straightEdgesOf(const std::vector<Triangle>& triangles) {
    std::vector<MeshEdge> edges = edgesOf(meshOfTriangles(triangles));
    joinStraight(edges);
    return edges;
}

/// A square in so many pieces a side, from `corner` on, along `right` and `up`.
void addSquare(std::vector<Triangle>& triangles, int pieces, const glm::dvec3& corner, const glm::dvec3& right,
               const glm::dvec3& up) {
    const auto at = [&](int i, int j) {
        const auto fraction = [&](int k) { return static_cast<double>(k) / pieces; };
        return Vec3f(corner + right * fraction(i) + up * fraction(j));
    };
    for (int i = 0; i < pieces; ++i)
        for (int j = 0; j < pieces; ++j) {
            triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
}

TEST(WallEdges, WhatGoesStraightOnIsOne) {
    for (const int pieces : {1, 2, 7, 40}) {
        // Away from the origin, and not along the axes: the corners between are off the line by roundings.
        const glm::dvec3 corner(31.3, -7.7, 12.1), x(1.3, .4, .2), y(-.3, 1.1, .5), z(.1, -.7, 1.9);
        std::vector<Triangle> triangles;
        for (const glm::dvec3& side : {glm::dvec3(0), z}) addSquare(triangles, pieces, corner + side, x, y);
        for (const glm::dvec3& side : {glm::dvec3(0), y}) addSquare(triangles, pieces, corner + side, x, z);
        for (const glm::dvec3& side : {glm::dvec3(0), x}) addSquare(triangles, pieces, corner + side, y, z);
        std::mt19937 random(static_cast<unsigned>(pieces));
        std::shuffle(triangles.begin(), triangles.end(), random);
        const std::vector<MeshEdge> edges = straightEdgesOf(triangles);
        ASSERT_EQ(edges.size(), 12u) << pieces;
        for (const MeshEdge& edge : edges) {
            const double length = glm::length(glm::dvec3(edge.to) - glm::dvec3(edge.from));
            EXPECT_LT(std::min({std::abs(length - glm::length(x)), std::abs(length - glm::length(y)),
                                std::abs(length - glm::length(z))}),
                      1e-5);
            EXPECT_NEAR(angleAt(edge.from, edge.to, edge.besideA, edge.besideB),
                        angleAt(edge.from, edge.to, edge.besideB, edge.besideA), 1e-3);
        }
    }
}

TEST(WallEdges, WhatBendsHoweverLittleIsNotOne) {
    // The rims of a disk with a hole, with fewer than .1 degrees from one piece to the next.
    constexpr int kPieces = 4000;
    std::vector<Triangle> triangles;
    const auto at = [](double radius, int i) {
        const double angle = 2 * M_PI * (i % kPieces) / kPieces;
        return Vec3f(glm::dvec3(3 + radius * std::cos(angle), radius * std::sin(angle), 1));
    };
    for (int i = 0; i < kPieces; ++i) {
        triangles.push_back({at(2, i), at(2, i + 1), at(1, i)});
        triangles.push_back({at(1, i), at(2, i + 1), at(1, i + 1)});
    }
    // Each joined edge stays within roundings of the rims.
    for (const MeshEdge& edge : straightEdgesOf(triangles)) {
        const glm::dvec3 middle = (glm::dvec3(edge.from) + glm::dvec3(edge.to)) * .5 - glm::dvec3(3, 0, 1);
        const double radius = glm::length(middle);
        EXPECT_LT(std::min(std::abs(radius - 1), std::abs(radius - 2)), 1e-5);
    }
    // A corner where faces change ends an edge: a step in a wall's height, seen from above.
    const glm::dvec3 up(0, 0, 1), back(0, 1, 0);
    std::vector<Triangle> two;
    addSquare(two, 1, glm::dvec3(0), {1, 0, 0}, up);
    addSquare(two, 1, glm::dvec3(0), {1, 0, 0}, back);
    addSquare(two, 1, {1, 0, 0}, {1, 0, 0}, up);
    addSquare(two, 1, {1, 0, 0}, {1, 0, 0}, -back);
    const auto along = [](const MeshEdge& e) { return e.from.y == 0 && e.to.y == 0 && e.from.z == 0 && e.to.z == 0; };
    const std::vector<MeshEdge> edges = straightEdgesOf(two);
    EXPECT_EQ(std::ranges::count_if(edges, along), 2);
}

}  // namespace
}  // namespace rtsg
