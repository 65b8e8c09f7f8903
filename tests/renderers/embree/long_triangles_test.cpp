// Long slanting triangles in pieces: the same surface without seams, and hits on the triangles that the mesh has.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <tuple>

#include "embree/long_triangles.h"
#include "renderers/ray_support.h"

namespace rtsg {
namespace {

constexpr std::uint32_t kLongSeed = 20261122;
using Edge = std::pair<std::tuple<float, float, float>, std::tuple<float, float, float>>;

std::tuple<float, float, float> keyOf(const Vec3f& p) {
    return {p.x + 0.0f, p.y + 0.0f, p.z + 0.0f};
}

/// How often each directed edge is there, by where its ends are.
std::map<Edge, int> pieceEdgesOf(const bvh::LongTriangles& cut) {
    std::map<Edge, int> edges;
    for (std::size_t i = 0; i < cut.corners.size(); i += 3) {
        if (cut.corners[i] < 0) continue;
        for (std::size_t k = 0; k < 3; ++k) {
            const auto at = [&](std::size_t c) {
                return keyOf(cut.positions[static_cast<std::size_t>(cut.corners[i + c % 3])]);
            };
            ++edges[{at(k), at(k + 1)}];
        }
    }
    return edges;
}

std::shared_ptr<const bvh::LongTriangles> cutOf(const Mesh& mesh) {
    return bvh::cutLongTriangles(mesh, mesh.positions);
}

/// The same triangles, each with points of its own.
std::shared_ptr<Mesh> withOwnPoints(const Mesh& mesh) {
    std::vector<Vec3f> p;
    std::vector<std::int32_t> t;
    for (std::uint32_t i = 0; i < mesh.triangleCount; ++i)
        for (std::uint32_t k = 0; k < 3; ++k) {
            t.push_back(static_cast<std::int32_t>(p.size()));
            p.push_back(mesh.vertex(i, k));
        }
    return test::makeMesh(std::move(p), std::move(t));
}

TEST(LongTriangles, LeavesOthersAlone) {
    std::mt19937 random(kLongSeed);
    EXPECT_FALSE(cutOf(*test::makeBox()));
    EXPECT_FALSE(cutOf(*test::makeSphere(4)));
    EXPECT_FALSE(cutOf(*test::makeSoup(random, 500)));
    EXPECT_FALSE(cutOf(*test::makeMesh({}, {})));
    // Long ones along an axis: their boxes are as thin as they are.
    const auto columns = test::makeBeams(random, 40, 8, .05f);
    std::vector<Vec3f> upright(columns->positions.begin(), columns->positions.end());
    for (std::size_t i = 0; i < upright.size(); i += 16)
        for (std::size_t k = 0; k < 8; ++k) upright[i + 8 + k] = upright[i + k] + Vec3f(0, 8, 0);
    EXPECT_FALSE(cutOf(*test::makeMesh(upright, {columns->triangles.begin(), columns->triangles.end()})));
    // Flat ones, which no ray meets.
    EXPECT_FALSE(cutOf(*test::makeMesh({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {0, 1, 2})));
}

// On every cut triangle the pieces lie side by side, turned as it is, and each corner is where it says, to half a unit
// in the last place.
TEST(LongTriangles, PiecesFillTheirTriangles) {
    std::mt19937 random(kLongSeed);
    const auto mesh = test::makeBeams(random, 40, 6, .05f);
    const auto cut = cutOf(*mesh);
    ASSERT_TRUE(cut);
    ASSERT_EQ(cut->wholes, mesh->triangleCount);
    std::map<std::uint32_t, double> filled;
    for (std::size_t i = 0; i < cut->pieces.size(); ++i) {
        const bvh::LongTriangles::Piece& piece = cut->pieces[i];
        const double area = .5 * ((double{piece.u[1]} - piece.u[0]) * (double{piece.v[2]} - piece.v[0]) -
                                  (double{piece.v[1]} - piece.v[0]) * (double{piece.u[2]} - piece.u[0]));
        EXPECT_GT(area, 0);
        filled[piece.triangle] += area;
        EXPECT_EQ(cut->corners[3 * std::size_t{piece.triangle}], -1);
        EXPECT_EQ(cut->triangleOf(cut->wholes + static_cast<std::uint32_t>(i)), piece.triangle);
        const Vec3d a(mesh->vertex(piece.triangle, 0)), b(mesh->vertex(piece.triangle, 1)),
            c(mesh->vertex(piece.triangle, 2));
        EXPECT_GT(glm::dot(glm::normalize(Vec3d(piece.normal)), glm::normalize(glm::cross(b - a, c - a))), 1 - 1e-12);
        for (int k = 0; k < 3; ++k) {
            const Vec3f is = cut->positions[static_cast<std::size_t>(
                cut->corners[3 * (cut->wholes + i) + static_cast<std::size_t>(k)])];
            const double u = piece.u[k], v = piece.v[k];
            const Vec3d exact = (1 - u - v) * a + u * b + v * c;
            for (int axis = 0; axis < 3; ++axis)
                EXPECT_NEAR(is[axis], exact[axis], 0x1p-24 * std::abs(exact[axis]) + 1e-14);
        }
    }
    EXPECT_GT(filled.size(), mesh->triangleCount / 2);
    for (const auto& [triangle, area] : filled) EXPECT_NEAR(area, .5, 1e-12) << triangle;
    for (std::uint32_t i = 0; i < mesh->triangleCount; ++i) {
        EXPECT_EQ(cut->triangleOf(i), i);
        if (filled.contains(i)) continue;
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_EQ(cut->corners[3 * std::size_t{i} + k], mesh->triangles[3 * std::size_t{i} + k]);
    }
}

// A closed surface stays closed bit for bit: each edge is met from the other side as often. Also where every triangle
// has points of its own.
TEST(LongTriangles, LeavesNoSeams) {
    std::mt19937 random(kLongSeed);
    const auto beams = test::makeBeams(random, 30, 5, .05f);
    for (const auto& mesh : {beams, withOwnPoints(*beams)}) {
        const auto cut = cutOf(*mesh);
        ASSERT_TRUE(cut);
        EXPECT_GT(cut->pieces.size(), 10 * std::size_t{mesh->triangleCount});
        const std::map<Edge, int> edges = pieceEdgesOf(*cut);
        int seams = 0;
        for (const auto& [edge, count] : edges) {
            const auto back = edges.find({edge.second, edge.first});
            seams += back == edges.end() || back->second != count;
        }
        EXPECT_EQ(seams, 0) << "of " << edges.size() << " seed " << kLongSeed;
    }
}

// What a triangle has for itself may be another mesh's, too: it stays whole, and so does what would gain nothing then.
TEST(LongTriangles, OuterEdgesStayWhole) {
    std::mt19937 random(kLongSeed);
    const auto beams = test::makeBeams(random, 40, 6, .05f);
    // The first ten lose a side.
    std::vector<std::int32_t> open;
    const std::uint32_t perBeam = beams->triangleCount / 40;
    for (std::uint32_t i = 0; i < beams->triangleCount; ++i)
        if (i >= 10 * perBeam || i % perBeam >= 2)
            for (std::uint32_t k = 0; k < 3; ++k) open.push_back(beams->triangles[3 * i + k]);
    const auto mesh = test::makeMesh({beams->positions.begin(), beams->positions.end()}, open);
    const auto cut = cutOf(*mesh);
    ASSERT_TRUE(cut);
    const std::map<Edge, int> edges = pieceEdgesOf(*cut);
    std::map<Edge, int> before;
    for (std::size_t i = 0; i < open.size(); i += 3)
        for (std::size_t k = 0; k < 3; ++k) {
            const auto at = [&](std::size_t c) {
                return keyOf(mesh->positions[static_cast<std::size_t>(open[i + c % 3])]);
            };
            ++before[{at(k), at(k + 1)}];
        }
    int outer = 0;
    for (const auto& [edge, count] : before) {
        if (before.contains({edge.second, edge.first})) continue;
        ++outer;
        EXPECT_TRUE(edges.contains(edge));
    }
    EXPECT_GE(outer, 40);
    // Strips of two triangles: nothing but outer edges and a diagonal between them.
    std::vector<std::int32_t> strips;
    for (std::uint32_t i = 0; i < beams->triangleCount; i += perBeam)
        for (std::uint32_t k = 0; k < 6; ++k) strips.push_back(beams->triangles[3 * i + k]);
    EXPECT_FALSE(cutOf(*test::makeMesh({beams->positions.begin(), beams->positions.end()}, strips)));
    // Two sides of a sheet are no neighbours.
    std::vector<std::int32_t> sheets = strips;
    for (std::size_t i = 0; i < strips.size(); i += 3)
        sheets.insert(sheets.end(), {strips[i], strips[i + 2], strips[i + 1]});
    EXPECT_FALSE(cutOf(*test::makeMesh({beams->positions.begin(), beams->positions.end()}, sheets)));
}

// Rays report the mesh's own triangles, places on them and normals: merged, moved, and as instances.
TEST(LongTriangles, HitsAreOnWholeTriangles) {
    for (const auto mapping : {RayWorld::Mapping::merged, RayWorld::Mapping::hybrid, RayWorld::Mapping::perShape}) {
        std::mt19937 random(kLongSeed);
        const auto beams = test::makeBeams(random, 30, 6, .2f);
        ASSERT_TRUE(cutOf(*beams));
        RayWorld::Options options;
        options.mapping = mapping;
        RayWorld world(options);
        test::BruteForce truth;
        InstanceDelta delta;
        delta.geometries.push_back({NodeId{1}, beams});
        for (std::uint32_t slot = 0; slot < 3; ++slot) {
            WorldFromLocal m = test::randomTransform(random, 4);
            if (slot == 0) m = identityTransform();
            delta.added.push_back(test::makeInstance(slot, NodeId{1}, m));
            delta.added.back().motion = slot == 2 ? Motion::moving : Motion::fixed;
            truth.items[slot] = {delta.added.back(), beams};
        }
        world.apply(delta);
        test::expectSameHits(world, truth, random, 60, 6, 1e-4);
        // Queries of what is near see them, too.
        std::uint32_t maximum = 0;
        world.visitNear(Vec3f(0), 100, [&](std::uint32_t, std::uint32_t triangle) {
            maximum = std::max(maximum, triangle);
            return 100.0f;
        });
        EXPECT_EQ(maximum, beams->triangleCount - 1);
    }
}

// Places on a triangle are linear: the corners of a piece, and its middle.
TEST(LongTriangles, PlacesAreRestored) {
    bvh::LongTriangles cut;
    cut.wholes = 5;
    cut.pieces.push_back({3, {.25f, .5f, .25f}, {.25f, .25f, .5f}, {0, 0, 2}});
    const auto restored = [&](float u, float v) {
        std::uint32_t number = 5;
        float x = 1, y = 1, z = 1;
        cut.restore(number, u, v, x, y, z);
        EXPECT_EQ(number, 3u);
        EXPECT_EQ(Vec3f(x, y, z), Vec3f(0, 0, 2));
        return std::pair(u, v);
    };
    EXPECT_EQ(restored(0, 0), std::pair(.25f, .25f));
    EXPECT_EQ(restored(1, 0), std::pair(.5f, .25f));
    EXPECT_EQ(restored(0, 1), std::pair(.25f, .5f));
    EXPECT_EQ(restored(.5f, .5f), std::pair(.375f, .375f));
    std::uint32_t number = 4;
    float u = .3f, v = .4f, x = 1, y = 2, z = 3;
    cut.restore(number, u, v, x, y, z);
    EXPECT_EQ(number, 4u);
    EXPECT_EQ(u, .3f);
    EXPECT_EQ(z, 3);
}

}  // namespace
}  // namespace rtsg
