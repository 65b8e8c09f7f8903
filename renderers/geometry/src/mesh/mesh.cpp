// Interpolation, areas, volumes and the validity check of a mesh.
#include <rtsg/renderers/mesh.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "texture_tangents.h"

namespace rtsg {

SurfacePoint interpolate(const Mesh& mesh, std::uint32_t triangle, float u, float v) {
    SurfacePoint point;
    point.position = mesh.position(triangle, u, v);
    point.geometricNormal = mesh.geometricNormal(triangle);
    point.shadingNormal = point.geometricNormal;
    if (mesh.normals.present()) point.shadingNormal = mesh.shadingNormal(triangle, u, v);
    point.texCoord = mesh.texCoord(triangle, u, v);
    point.color = mesh.color(triangle, u, v);
    point.hasColor = mesh.colors.present();
    point.colorHasAlpha = mesh.colors.components() == 4;
    return point;
}

bool textureTangents(const Mesh& mesh, std::uint32_t triangle, std::size_t channel, Vec3f& dPds, Vec3f& dPdt) {
    const Vec3f a = mesh.vertex(triangle, 0);
    const Vec3f e1 = mesh.vertex(triangle, 1) - a, e2 = mesh.vertex(triangle, 2) - a;
    const Vec2f st0(mesh.texCoord(triangle, 0, 0, channel));
    const Vec2f d1 = Vec2f(mesh.texCoord(triangle, 1, 0, channel)) - st0;
    const Vec2f d2 = Vec2f(mesh.texCoord(triangle, 0, 1, channel)) - st0;
    return textureTangents({e1, e2}, {d1, d2}, dPds, dPdt);
}

namespace {

std::string defectOf(const MeshAttribute& attribute, const Mesh& mesh, const char* name) {
    if (!attribute.present()) return {};
    if (attribute.components() < 2 || attribute.components() > 4)
        return std::string(name) + ": " + std::to_string(attribute.components()) + " components";
    const std::uint32_t corners = attribute.binding() == MeshAttribute::Binding::face ? 1 : 3;
    if (!attribute.indices().empty() && mesh.triangleCount > 0) {
        const std::size_t needed = std::size_t{mesh.triangleCount - 1} * attribute.triangleStep() + corners;
        if (attribute.indices().size() < needed) return std::string(name) + ": too few indices";
    }
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < corners; ++c)
            if (const std::uint32_t i = attribute.valueIndex(t, c); i >= attribute.valueCount())
                return std::string(name) + ": triangle " + std::to_string(t) + " refers to value " + std::to_string(i) +
                       " of " + std::to_string(attribute.valueCount());
    return {};
}

}  // namespace

std::string findDefect(const Mesh& mesh) {
    if (mesh.triangleCount == 0) return {};
    if (mesh.triangleStride != 3 && mesh.triangleStride != 4) return "stride is neither 3 nor 4";
    if (mesh.triangles.size() < std::size_t{mesh.triangleCount - 1} * mesh.triangleStride + 3)
        return "fewer indices than triangles";
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const std::uint32_t i = mesh.vertexIndex(t, c);
            if (i >= mesh.positions.size())
                return "triangle " + std::to_string(t) + " refers to position " + std::to_string(i) + " of " +
                       std::to_string(mesh.positions.size());
            const Vec3f p = mesh.positions[i];
            for (int axis = 0; axis < 3; ++axis) {
                if (!(std::abs(p[axis]) <= 1e18f)) return "position " + std::to_string(i) + " is out of range";
                if (p[axis] < mesh.bounds.min[axis] || p[axis] > mesh.bounds.max[axis])
                    return "position " + std::to_string(i) + " is outside of the bounds";
            }
        }
    if (mesh.texCoords.empty()) return "no texture coordinates";
    if (mesh.normals.present() && mesh.normals.components() != 3) return "normals have not three components";
    std::string defect = defectOf(mesh.normals, mesh, "normals");
    if (defect.empty()) defect = defectOf(mesh.colors, mesh, "colors");
    if (defect.empty()) defect = defectOf(mesh.fogDepths, mesh, "fogDepths");
    if (defect.empty()) defect = defectOf(mesh.tangents, mesh, "tangents");
    for (const TexCoords& set : mesh.texCoords)
        if (defect.empty()) defect = defectOf(set.values, mesh, "texCoords");
    return defect;
}

namespace {

/// Corners with numbers that are equal where their places are.
std::vector<std::uint32_t> orderOf(const Mesh& mesh) {
    std::vector<std::uint32_t> order(mesh.positions.size()), position(mesh.positions.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](std::uint32_t i) {
        const Vec3f p = mesh.positions[i];
        return std::array{p.x, p.y, p.z};  // -0 equals 0
    };
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
    for (std::size_t i = 0; i < order.size(); ++i)
        position[order[i]] = i > 0 && key(order[i]) == key(order[i - 1]) ? position[order[i - 1]] : order[i];
    return position;
}

bool hasAllEdgesTwice(const Mesh& mesh) {
    const std::vector<std::uint32_t> order = orderOf(mesh);
    std::vector<std::pair<std::uint64_t, int>> edges;  // which, and by one in which direction
    edges.reserve(std::size_t{3} * mesh.triangleCount);
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        for (std::uint32_t c = 0; c < 3; ++c) {
            const std::uint64_t a = order[mesh.vertexIndex(t, c)], b = order[mesh.vertexIndex(t, (c + 1) % 3)];
            if (a != b) edges.emplace_back(std::min(a, b) << 32 | std::max(a, b), a < b ? 1 : -1);
        }
    }
    std::sort(edges.begin(), edges.end());
    for (std::size_t i = 0; i < edges.size();) {
        const std::uint64_t edge = edges[i].first;
        int sum = 0;
        for (; i < edges.size() && edges[i].first == edge; ++i) sum += edges[i].second;
        if (sum != 0) return false;
    }
    return !edges.empty();
}

}  // namespace

bool Mesh::isClosed() const {
    std::int8_t known = closed_.value.load(std::memory_order_relaxed);
    if (known < 0) closed_.value.store(known = hasAllEdgesTwice(*this), std::memory_order_relaxed);
    return known != 0;
}

double surfaceArea(const Mesh& mesh) {
    double area = 0;
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const Vec3d a(mesh.vertex(t, 0)), b(mesh.vertex(t, 1)), c(mesh.vertex(t, 2));
        area += 0.5 * glm::length(glm::cross(b - a, c - a));
    }
    return area;
}

double enclosedVolume(const Mesh& mesh) {
    double volume = 0;
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const Vec3d a(mesh.vertex(t, 0)), b(mesh.vertex(t, 1)), c(mesh.vertex(t, 2));
        volume += glm::dot(a, glm::cross(b, c)) / 6.0;
    }
    return volume;
}

std::size_t memoryUse(const Mesh& mesh) {
    std::unordered_set<const void*> seen;
    std::size_t bytes = sizeof(Mesh) + mesh.texCoords.size() * sizeof(TexCoords);
    const auto add = [&](const void* data, std::size_t size) {
        if (data && seen.insert(data).second) bytes += size;
    };
    const auto addAttribute = [&](const MeshAttribute& a) {
        add(a.data(), std::size_t{a.valueCount()} * static_cast<std::size_t>(a.components()) * sizeof(float));
        add(a.indices().data(), a.indices().size() * sizeof(std::int32_t));
    };
    add(mesh.positions.data(), mesh.positions.size() * sizeof(Vec3f));
    add(mesh.triangles.data(), mesh.triangles.size() * sizeof(std::int32_t));
    addAttribute(mesh.normals);
    addAttribute(mesh.colors);
    addAttribute(mesh.fogDepths);
    addAttribute(mesh.tangents);
    for (const TexCoords& set : mesh.texCoords) addAttribute(set.values);
    return bytes;
}

}  // namespace rtsg
