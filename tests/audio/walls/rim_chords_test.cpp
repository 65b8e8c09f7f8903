// Round rims in many pieces: the chords that stand for them, and what is none.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

#include "audio/trace/walled.h"

namespace rtsg {
namespace {

using namespace test;

glm::dvec3 onCircle(int i, int sides, double z) {
    return {std::cos(2 * M_PI * i / sides), std::sin(2 * M_PI * i / sides), z};
}

/// Along z; its upper end has so many times its radius.
Walled prism(int sides, const WorldFromLocal& inMesh = WorldFromLocal(1.0), double upper = 1,
             const WorldFromLocal& inWorld = WorldFromLocal(1.0)) {
    std::vector<glm::dvec3> corners{{0, 0, -.5}, {0, 0, .5}};
    std::vector<std::uint32_t> triangles;
    for (int i = 0; i < sides; ++i) {
        corners.push_back(onCircle(i, sides, -.5));
        corners.push_back(onCircle(i, sides, .5) * glm::dvec3(upper, upper, 1));
        const auto low = static_cast<std::uint32_t>(2 + 2 * i), high = low + 1;
        const auto nextLow = static_cast<std::uint32_t>(2 + 2 * ((i + 1) % sides)), nextHigh = nextLow + 1;
        triangles.insert(triangles.end(),
                         {0, nextLow, low, 1, high, nextHigh, low, nextLow, nextHigh, low, nextHigh, high});
    }
    for (glm::dvec3& corner : corners) corner = inMesh * glm::dvec4(corner, 1);
    return {corners, triangles, 0, {inWorld}};
}

std::vector<WallEdge> edgesOf(const Walled& walls) {
    std::vector<WallEdge> edges;
    walls.geometry.visitEdges([&](const WallEdge& edge) { edges.push_back(edge); });
    return edges;
}
bool hasRims(const Walled& walls) {
    return std::ranges::any_of(edgesOf(walls), [](const WallEdge& edge) { return edge.rim != nullptr; });
}

TEST(RimChords, TwelveStandForEachRimAndAreAsFarOutAsItOnAverage) {
    for (const int sides : {24, 25, 36, 48, 64, 100, 1000}) {
        const Walled walls = prism(sides);
        const std::vector<WallEdge> edges = edgesOf(walls);
        ASSERT_EQ(edges.size(), 24u) << sides;
        double out = 0, length = 0;
        for (const WallEdge& edge : edges) {
            ASSERT_NE(edge.rim, nullptr);
            EXPECT_NEAR(std::abs(edge.from.z), .5, 1e-6);
            constexpr int kPlaces = 20;
            for (int i = 0; i < kPlaces; ++i) {
                const glm::dvec3 place = edge.from + edge.axis * (edge.length * (i + .5) / kPlaces);
                out += std::hypot(place.x, place.y) * edge.length / kPlaces;
                // Where there is a surface: between the circle and its polygon.
                const glm::dvec3 on = edge.onSurface(place);
                EXPECT_LT(std::hypot(on.x, on.y), 1 + 1e-6);
                EXPECT_GT(std::hypot(on.x, on.y), std::cos(M_PI / sides) - 1e-6);
                EXPECT_LT(glm::distance(on, place), .045);
            }
            length += edge.length;
        }
        EXPECT_NEAR(out / length, 1, sides < 36 ? 6e-3 : 3e-3) << sides;
        EXPECT_NEAR(length, 4 * M_PI, .15);
    }
}

TEST(RimChords, GoRoundWithoutAGapAndKnowTheirFaces) {
    const std::vector<WallEdge> edges = edgesOf(prism(48));
    for (const WallEdge& edge : edges) {
        int before = 0, after = 0;
        for (const WallEdge& other : edges)
            for (const glm::dvec3& end : {other.from, other.from + other.axis * other.length}) {
                before += &other != &edge && glm::distance(end, edge.from) < 1e-6;
                after += &other != &edge && glm::distance(end, edge.from + edge.axis * edge.length) < 1e-6;
            }
        EXPECT_EQ(before, 1);
        EXPECT_EQ(after, 1);
        const glm::dvec3 middle = edge.from + edge.axis * (.5 * edge.length);
        const glm::dvec3 inward = -glm::normalize(glm::dvec3(middle.x, middle.y, 0));
        const glm::dvec3 along(0, 0, middle.z > 0 ? -1 : 1);
        const bool firstIsEnd = std::abs(edge.faceA.z) < .5;
        EXPECT_LT(glm::distance(firstIsEnd ? edge.faceA : edge.faceB, inward), 1e-5);
        EXPECT_LT(glm::distance(firstIsEnd ? edge.faceB : edge.faceA, along), 1e-5);
    }
}

TEST(RimChords, OfBothEndsLieAboveEachOtherHoweverTheMeshIsTurned) {
    const glm::dvec3 axis = glm::normalize(glm::dvec3(.3, -.8, .5));
    const WorldFromLocal turned(glm::rotate(glm::dmat4(1), 1.2345, axis));
    const std::vector<WallEdge> edges = edgesOf(prism(50, turned));
    ASSERT_EQ(edges.size(), 24u);
    const glm::dvec3 up(turned * glm::dvec4(0, 0, 1, 0));
    for (const WallEdge& edge : edges) {
        const double side = glm::dot(edge.from, up) > 0 ? -1 : 1;
        const glm::dvec3 from = edge.from + side * up, to = from + edge.axis * edge.length;
        EXPECT_TRUE(std::ranges::any_of(edges, [&](const WallEdge& other) {
            const glm::dvec3 end = other.from + other.axis * other.length;
            return (glm::distance(other.from, from) < 1e-5 && glm::distance(end, to) < 1e-5) ||
                   (glm::distance(other.from, to) < 1e-5 && glm::distance(end, from) < 1e-5);
        }));
    }
}

TEST(RimChords, AHoleHasThem) {
    // A square of 4 m with a hole of 1 m: its outer corners are joined to those of a quarter each.
    constexpr int kSides = 48;
    std::vector<glm::dvec3> corners{{2, 2, 0}, {-2, 2, 0}, {-2, -2, 0}, {2, -2, 0}};
    std::vector<std::uint32_t> triangles;
    for (int i = 0; i < kSides; ++i) corners.push_back(onCircle(i, kSides, 0));
    for (std::uint32_t i = 0; i < kSides; ++i) triangles.insert(triangles.end(), {4 + i, i / 12, 4 + (i + 1) % kSides});
    for (std::uint32_t q = 0; q < 4; ++q)
        triangles.insert(triangles.end(), {q, (q + 1) % 4, 4 + (12 * (q + 1)) % kSides});
    const Walled walls(corners, triangles);
    int chords = 0;
    for (const WallEdge& edge : edgesOf(walls)) {
        if (!edge.rim) continue;
        ++chords;
        const glm::dvec3 middle = edge.from + edge.axis * (.5 * edge.length);
        EXPECT_GT(glm::dot(edge.faceA, middle), 0) << "away from the hole";
    }
    EXPECT_EQ(chords, 12);
    EXPECT_EQ(edgesOf(walls).size(), 16u);
}

TEST(RimChords, WhatIsNoRoundRimStaysInPieces) {
    EXPECT_FALSE(hasRims(prism(23)));
    EXPECT_EQ(edgesOf(prism(23)).size(), 46u);
    EXPECT_TRUE(hasRims(prism(48, WorldFromLocal(1.0), 1, WorldFromLocal(glm::scale(glm::dmat4(1), glm::dvec3(2))))));
    // Half of one is open.
    std::vector<glm::dvec3> corners{{0, 0, 0}};
    std::vector<std::uint32_t> triangles;
    for (int i = 0; i <= 48; ++i) corners.push_back(onCircle(i, 96, 0));
    for (std::uint32_t i = 1; i <= 48; ++i) triangles.insert(triangles.end(), {0, i, i + 1});
    EXPECT_FALSE(hasRims(Walled(corners, triangles)));
    // Round corners have sides between them.
    const auto rounded = [](double side) {
        std::vector<glm::dvec3> rim{{0, 0, 0}};
        for (int i = 0; i < 48; ++i) rim.push_back(onCircle(i, 48, 0) + glm::dvec3(i < 24 ? 0 : side, 0, 0));
        std::vector<std::uint32_t> fan;
        for (std::uint32_t i = 0; i < 48; ++i) fan.insert(fan.end(), {0, 1 + i, 1 + (i + 1) % 48});
        return Walled(rim, fan);
    };
    EXPECT_TRUE(hasRims(rounded(0)));
    EXPECT_FALSE(hasRims(rounded(-.4)));
    // One that winds out of its plane turns more.
    corners.assign(1, glm::dvec3(0));
    triangles.clear();
    for (int i = 0; i < 96; ++i) corners.push_back(onCircle(i, 96, .2 * std::sin(4 * M_PI * i / 96)));
    for (std::uint32_t i = 0; i < 96; ++i) triangles.insert(triangles.end(), {0, 1 + i, 1 + (i + 1) % 96});
    EXPECT_FALSE(hasRims(Walled(corners, triangles)));
}

/// Of the edges those of round sides: from rim to rim, or to an apex.
std::vector<WallEdge> sidesOf(const std::vector<WallEdge>& edges) {
    std::vector<WallEdge> sides;
    std::ranges::copy_if(edges, std::back_inserter(sides),
                         [](const WallEdge& edge) { return edge.rim && !edge.rim->facet.empty(); });
    return sides;
}
/// That each corner is one of four edges, or two of twelve at an apex, and that all faces are flat.
void expectClosed(const std::vector<WallEdge>& edges) {
    for (const WallEdge& edge : edges)
        for (const double side : {0.0, 1.0}) {
            const glm::dvec3 end = edge.from + edge.axis * (edge.length * side);
            const auto at = std::ranges::count_if(edges, [&](const WallEdge& other) {
                return glm::distance(end, other.from) < 1e-5 ||
                       glm::distance(end, other.from + other.axis * other.length) < 1e-5;
            });
            EXPECT_TRUE(at == 3 || at == 4 || at == 12) << at;
        }
    for (const WallEdge& edge : sidesOf(edges)) {
        const std::vector<glm::dvec3>& c = edge.rim->facet;
        ASSERT_EQ(c.size(), 4u);
        const glm::dvec3 normal = glm::normalize(glm::cross(c[1] - c[0], edge.axis));
        for (const glm::dvec3& corner : c) EXPECT_NEAR(glm::dot(corner - c[0], normal), 0, 1e-5);
        // One of its faces is that facet.
        EXPECT_LT(std::min(std::abs(glm::dot(edge.faceA, normal)), std::abs(glm::dot(edge.faceB, normal))), 1e-5);
    }
}

TEST(RimChords, OfAFrustumTwelveEdgesLeadFromOneToTheOther) {
    const WorldFromLocal turned(glm::rotate(glm::dmat4(1), 1.2345, glm::normalize(glm::dvec3(.3, -.8, .5))));
    const WorldFromLocal wide(glm::scale(glm::dmat4(1), glm::dvec3(1, 1.4, 1)));
    const auto frustum = [&](int sides, double upper, const WorldFromLocal& inMesh, const WorldFromLocal& inWorld) {
        const Walled walls = prism(sides, inMesh, upper, inWorld);
        const std::vector<WallEdge> edges = edgesOf(walls);
        EXPECT_EQ(edges.size(), 36u) << sides;
        EXPECT_EQ(sidesOf(edges).size(), 12u) << sides;
        expectClosed(edges);
    };
    const WorldFromLocal same(1.0);
    for (const int sides : {24, 25, 37, 48, 64, 100, 300}) {
        frustum(sides, .5, same, same);
        frustum(sides, 1.3, turned, same);
    }
    // What is oval by itself, and what only the world makes so.
    frustum(60, 1, wide, same);
    frustum(48, 1, same, wide);
    frustum(48, .7, turned, wide);
}

TEST(RimChords, OfAConeTheyLeadToItsApex) {
    for (const bool base : {true, false}) {
        std::vector<glm::dvec3> corners{{0, 0, 2}, {0, 0, 0}};
        std::vector<std::uint32_t> triangles;
        for (int i = 0; i < 50; ++i) corners.push_back(onCircle(i, 50, 0));
        for (std::uint32_t i = 0; i < 50; ++i) {
            const std::uint32_t at = 2 + i, next = 2 + (i + 1) % 50;
            triangles.insert(triangles.end(), {0, at, next});
            if (base) triangles.insert(triangles.end(), {1, next, at});
        }
        const Walled walls(corners, triangles);
        const std::vector<WallEdge> edges = edgesOf(walls);
        EXPECT_EQ(edges.size(), 24u);
        expectClosed(edges);
        for (const WallEdge& edge : sidesOf(edges)) {
            EXPECT_NEAR(std::max(edge.from.z, edge.from.z + edge.axis.z * edge.length), 2, 1e-6);
            // Farther out than the cone at its corners, and the cone farther out than its faces between them.
            const glm::dvec3 foot = edge.from.z < 1 ? edge.from : edge.from + edge.axis * edge.length;
            EXPECT_GT(std::hypot(foot.x, foot.y), 1.015);
            EXPECT_LT(std::hypot(foot.x, foot.y), 1.03);
            const glm::dvec3 outward = glm::normalize(glm::dvec3(foot.x, foot.y, 0));
            EXPECT_NEAR(edge.bulges(outward), 1 - std::cos(M_PI / 12), .012);
            EXPECT_LT(glm::distance(edge.onSurface(foot), foot), 1e-12);
        }
        for (const WallEdge& edge : edges)
            if (edge.rim && edge.rim->facet.empty()) {
                EXPECT_EQ(base, glm::dot(edge.faceA, edge.faceB) < .9) << "a rim of a sheet, without a base";
            }
    }
}

TEST(RimChords, OfAVaseTheyLeadOnFromRimToRim) {
    // Three rims, and two round sides between them; the mesh numbers each ring from elsewhere on.
    constexpr int kSides = 48;
    const double radii[] = {.5, 1, .7};
    std::vector<glm::dvec3> corners;
    for (int ring = 0; ring < 3; ++ring)
        for (int i = 0; i < kSides; ++i)
            corners.push_back(onCircle(i + 5 * ring, kSides, ring) * glm::dvec3(radii[ring], radii[ring], 1));
    std::vector<std::uint32_t> triangles;
    const auto at = [&](int ring, int i) {
        return static_cast<std::uint32_t>(kSides * ring + (i - 5 * ring + 2 * kSides) % kSides);
    };
    for (int ring = 0; ring < 2; ++ring)
        for (int i = 0; i < kSides; ++i)
            triangles.insert(triangles.end(), {at(ring, i), at(ring, i + 1), at(ring + 1, i + 1), at(ring, i),
                                               at(ring + 1, i + 1), at(ring + 1, i)});
    const Walled walls(corners, triangles, 0, {WorldFromLocal(1.0)}, false);
    const std::vector<WallEdge> edges = edgesOf(walls);
    EXPECT_EQ(edges.size(), 60u);
    EXPECT_EQ(sidesOf(edges).size(), 24u);
    expectClosed(edges);
}

TEST(RimChords, OfSeveralFrustaInAMeshEachHasThem) {
    std::vector<glm::dvec3> corners;
    std::vector<std::uint32_t> triangles;
    constexpr std::uint32_t kSides = 48;
    for (const double x : {-3.0, 0.0, 3.0}) {
        const auto first = static_cast<std::uint32_t>(corners.size());
        for (const double z : {-.5, .5})
            for (int i = 0; i < 48; ++i)
                corners.push_back(onCircle(i, 48, z) * glm::dvec3(z < 0 ? 1 : .6, z < 0 ? 1 : .6, 1) +
                                  glm::dvec3(x, 0, 0));
        for (std::uint32_t i = 0; i < kSides; ++i) {
            const std::uint32_t at = first + i, next = first + (i + 1) % kSides;
            triangles.insert(triangles.end(), {at, next, next + kSides, at, next + kSides, at + kSides});
        }
    }
    const Walled walls(corners, triangles, 0, {WorldFromLocal(1.0)}, false);
    EXPECT_EQ(edgesOf(walls).size(), 3u * 36);
    expectClosed(edgesOf(walls));
}

TEST(RimChords, WhereASideLeadsElsewhereAllStaysInPieces) {
    // From one corner of the rim of a cone a facet leads to another place than the apex.
    std::vector<glm::dvec3> corners{{0, 0, 2}, {0, 0, 0}, {.02, 0, 2}};
    std::vector<std::uint32_t> triangles;
    for (int i = 0; i < 48; ++i) corners.push_back(onCircle(i, 48, 0));
    for (std::uint32_t i = 0; i < 48; ++i) {
        const std::uint32_t here = 3 + i, next = 3 + (i + 1) % 48;
        triangles.insert(triangles.end(), {1, next, here, i == 0 || i == 47 ? 2u : 0u, here, next});
    }
    EXPECT_FALSE(hasRims(Walled(corners, triangles)));
}

TEST(RimChords, KnowWhereTheirRimIsWhenTheyAreCut) {
    const Walled walls = prism(48);
    WallEdge edge = edgesOf(walls).front();
    const glm::dvec3 place = edge.from + edge.axis * (.3 * edge.length), on = edge.onSurface(place);
    edge.from += edge.axis * (.25 * edge.length);
    edge.length *= .5;
    EXPECT_EQ(edge.onSurface(place), on);
    // How far it reaches out between its ends.
    const glm::dvec3 outward = glm::normalize(glm::dvec3(place.x, place.y, 0));
    EXPECT_NEAR(edge.bulges(outward), 1 - std::cos(M_PI / 12), 2e-3);
    EXPECT_EQ(edge.bulges(-outward), 0);
}

}  // namespace
}  // namespace rtsg
