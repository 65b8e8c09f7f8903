// Finds edges by the corners that triangles share.
#include "wall_edges.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace rtsg {
namespace {

/// From the middle of surfaces that lie in one plane but for this (radians) nothing bends.
constexpr double kFlat = 0.1;

using Corner = std::tuple<float, float, float>;

struct Sides {
    Vec3f beside[2];
    int count = 0;
};

/// Unit, square to the axis, from the edge towards a place.
glm::dvec3 acrossTo(const glm::dvec3& place, const glm::dvec3& from, const glm::dvec3& axis) {
    const glm::dvec3 way = place - from, across = way - axis * glm::dot(way, axis);
    const double length = glm::length(across);
    return length > 0 ? across / length : glm::dvec3(0);
}

bool flat(const Vec3f& from, const Vec3f& to, const Sides& sides) {
    const glm::dvec3 axis = glm::normalize(glm::dvec3(to) - glm::dvec3(from));
    const glm::dvec3 a = acrossTo(sides.beside[0], from, axis), b = acrossTo(sides.beside[1], from, axis);
    return glm::dot(a, b) < -std::cos(kFlat);
}

}  // namespace

std::vector<MeshEdge> edgesOf(const Mesh& mesh) {
    std::vector<MeshEdge> result;
    if (mesh.triangleCount > kMostTrianglesWithEdges) return result;
    std::map<std::pair<Corner, Corner>, Sides> edges;
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            // + 0: there is one zero.
            const auto corner = [&](std::uint32_t k) { return mesh.vertex(t, k % 3) + Vec3f(0); };
            const Vec3f a = corner(c), b = corner(c + 1), beside = corner(c + 2);
            Corner from(a.x, a.y, a.z), to(b.x, b.y, b.z);
            if (!std::isfinite(a.x + a.y + a.z + b.x + b.y + b.z) || from == to) continue;
            if (to < from) std::swap(from, to);
            Sides& sides = edges[{from, to}];
            if (sides.count < 2) sides.beside[sides.count] = beside;
            ++sides.count;
        }
    for (const auto& [ends, sides] : edges) {
        const Vec3f from(std::get<0>(ends.first), std::get<1>(ends.first), std::get<2>(ends.first));
        const Vec3f to(std::get<0>(ends.second), std::get<1>(ends.second), std::get<2>(ends.second));
        // Where more than two meet there is no wedge.
        if (sides.count > 2 || (sides.count == 2 && flat(from, to, sides))) continue;
        result.push_back({from, to, sides.beside[0], sides.beside[sides.count - 1]});
    }
    return result;
}

bool placedEdge(const MeshEdge& edge, const WorldFromLocal& m, WallEdge& result) {
    const auto placed = [&](const Vec3f& p) { return m * glm::dvec4(glm::dvec3(p), 1); };
    result.from = placed(edge.from);
    const glm::dvec3 way = placed(edge.to) - result.from;
    result.length = glm::length(way);
    if (!(result.length > 0) || !std::isfinite(result.length)) return false;
    result.axis = way / result.length;
    result.faceA = acrossTo(placed(edge.besideA), result.from, result.axis);
    result.faceB = acrossTo(placed(edge.besideB), result.from, result.axis);
    return glm::dot(result.faceA, result.faceA) > 0.5 && glm::dot(result.faceB, result.faceB) > 0.5;
}

void EdgeTable::change(std::uint32_t slot, const Wall& wall) {
    if (slot >= edges_.size()) {
        if (!wall.mesh) return;
        edges_.resize(slot + 1);
    }
    edges_[slot].clear();
    if (!wall.mesh) return;
    CachedMesh& cached = meshes_[wall.mesh.get()];
    // The address may be another mesh's by now.
    if (cached.mesh.lock() != wall.mesh)
        cached = {wall.mesh, std::make_shared<const std::vector<MeshEdge>>(edgesOf(*wall.mesh))};
    for (const MeshEdge& edge : *cached.edges) {
        WallEdge placed;
        if (!placedEdge(edge, wall.worldFromLocal, placed)) continue;
        placed.material = wall.material;
        edges_[slot].push_back(placed);
    }
    if (meshes_.size() > 2 * meshesAtPurge_ + 64) {
        std::erase_if(meshes_, [](const auto& entry) { return entry.second.mesh.expired(); });
        meshesAtPurge_ = meshes_.size();
    }
}

void EdgeTable::visitBut(std::span<const std::uint32_t> open, const AcousticGeometry::EdgeVisitor& visit) const {
    for (std::uint32_t slot = 0; slot < edges_.size(); ++slot)
        if (std::find(open.begin(), open.end(), slot) == open.end())
            for (const WallEdge& edge : edges_[slot]) visit(edge);
}

}  // namespace rtsg
