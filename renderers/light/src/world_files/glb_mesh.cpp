// Finds the corners of triangles that are one vertex, by their values.
#include "glb_mesh.h"

#include <array>
#include <bit>
#include <cmath>

namespace rtsg::mesh_files {

namespace {

/// What makes a vertex: the bits of position, normal, texture coordinate and colour, as far as they are written.
using VertexKey = std::array<std::uint32_t, 12>;

std::uint64_t hashOf(const VertexKey& key) {
    std::uint64_t hash = 0xcbf29ce484222325ull;
    for (const std::uint32_t bits : key) {
        hash = (hash ^ bits) * 0x9E3779B97F4A7C15ull;
        hash ^= hash >> 29;
    }
    return hash;
}

bool isPlain(const Vec3f& point) {
    constexpr float kFar = 1e18f;  // as for positions that triangles use
    return std::abs(point.x) < kFar && std::abs(point.y) < kFar && std::abs(point.z) < kFar;
}

}  // namespace

GlbMesh::GlbMesh(const Mesh& mesh, std::size_t channel, bool isTextured) : mesh_(mesh), channel_(channel) {
    const bool hasChannel = channel < mesh.texCoords.size();
    hasTexCoords_ = isTextured || (hasChannel && mesh.texCoords[channel].authored);
    // Meshes whose points triangles share, and which have nothing else, are written as they are.
    isWhole_ = !hasNormals() && !hasTexCoords_ && !hasColors() && mesh.positions.size() < indexCount();
    for (std::size_t i = 0; isWhole_ && i < mesh.positions.size(); ++i) isWhole_ = isPlain(mesh.positions[i]);
    if (!isWhole_) join();
    if (isWhole_)
        for (const Vec3f& point : mesh.positions) bounds_.extend(point);
    else
        forEachVertex([&](std::uint32_t t, std::uint32_t c) { bounds_.extend(mesh_.vertex(t, c)); });
}

void GlbMesh::join() {
    vertices_.resize(indexCount());
    const auto keyOf = [&](std::uint32_t t, std::uint32_t c) {
        VertexKey key{};
        const auto put = [&](std::size_t at, const auto& value, int count) {
            for (int i = 0; i < count; ++i)
                key[at + static_cast<std::size_t>(i)] = std::bit_cast<std::uint32_t>(value[i] + 0.0f);  // -0 is 0
        };
        put(0, mesh_.vertex(t, c), 3);
        if (hasNormals()) put(3, normalAt(t, c), 3);
        if (hasTexCoords_) put(6, texCoordAt(t, c), 2);
        if (hasColors()) {
            const ColorRGBA color = mesh_.color(t, weightU(c), weightV(c));
            put(8, Vec4f(color.r, color.g, color.b, color.a), 4);
        }
        return key;
    };
    // A table of vertices with gaps, at most half full.
    constexpr std::uint32_t kNone = 0xFFFFFFFF;
    std::vector<std::uint32_t> table(64, kNone);
    const auto slotOf = [&](const VertexKey& key) {
        std::size_t at = hashOf(key) & (table.size() - 1);
        while (table[at] != kNone && keyOf(corners_[table[at]] / 3, corners_[table[at]] % 3) != key)
            at = (at + 1) & (table.size() - 1);
        return at;
    };
    for (std::uint32_t t = 0; t < mesh_.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const VertexKey key = keyOf(t, c);
            std::size_t at = slotOf(key);
            if (table[at] == kNone) {
                corners_.push_back(3 * t + c);
                table[at] = static_cast<std::uint32_t>(corners_.size() - 1);
                if (2 * corners_.size() >= table.size()) {
                    table.assign(4 * table.size(), kNone);
                    for (std::uint32_t v = 0; v < corners_.size(); ++v)
                        table[slotOf(keyOf(corners_[v] / 3, corners_[v] % 3))] = v;
                    at = slotOf(key);
                }
            }
            vertices_[std::size_t{3} * t + c] = table[at];
        }
}

void GlbMesh::writePositions(Output& out) const {
    if (isWhole_)
        for (const Vec3f& point : mesh_.positions) out.put(point);
    else
        forEachVertex([&](std::uint32_t t, std::uint32_t c) { out.put(mesh_.vertex(t, c)); });
}

void GlbMesh::writeNormals(Output& out) const {
    forEachVertex([&](std::uint32_t t, std::uint32_t c) { out.put(normalAt(t, c)); });
}

void GlbMesh::writeIndices(Output& out) const {
    for (std::uint32_t t = 0; t < mesh_.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const std::uint32_t vertex = isWhole_ ? mesh_.vertexIndex(t, c) : vertices_[std::size_t{3} * t + c];
            if (isSmall())
                out.put(static_cast<std::uint16_t>(vertex));
            else
                out.put(vertex);
        }
}

}  // namespace rtsg::mesh_files
