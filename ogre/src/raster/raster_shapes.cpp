// Gives the corners of triangles one index, and lines and points four corners.
#include "raster_shapes.h"

#include <array>
#include <utility>

namespace rtsg {

namespace {

Vec4f colorOf(const ColorRGBA& c) {
    return {c.r, c.g, c.b, c.a};
}

void addTriangles(const Mesh& mesh, std::size_t channel, RasterArrays& out) {
    const VertexArrays arrays = vertexArrays(mesh, channel);
    out.vertices.resize(arrays.positions.size()), out.looks.resize(arrays.positions.size());
    for (std::size_t i = 0; i < out.vertices.size(); ++i) {
        out.vertices[i] = {arrays.positions[i], arrays.normals[i]};
        out.looks[i].coordinates = Vec3f(arrays.texCoords[i], 0);
        if (!arrays.colors.empty()) out.looks[i].color = colorOf(arrays.colors[i]);
    }
    out.indices.assign(arrays.triangles.begin(), arrays.triangles.end());
}

struct Corner {
    std::uint32_t triangle, corner;
    float u, v;
    explicit Corner(std::uint32_t number)
        : triangle(number / 3), corner(number % 3), u(corner == 1 ? 1 : 0), v(corner == 2 ? 1 : 0) {}
};

std::vector<RasterVertex> verticesOf(const Mesh& mesh, const std::vector<std::uint32_t>& corners) {
    std::vector<RasterVertex> vertices;
    vertices.reserve(corners.size());
    for (const std::uint32_t number : corners) {
        const Corner at(number);
        vertices.push_back({mesh.vertex(at.triangle, at.corner), mesh.shadingNormal(at.triangle, at.u, at.v)});
    }
    return vertices;
}
std::vector<RasterLook> looksOf(const Mesh& mesh, std::size_t channel, const std::vector<std::uint32_t>& corners) {
    std::vector<RasterLook> looks;
    looks.reserve(corners.size());
    for (const std::uint32_t number : corners) {
        const Corner at(number);
        const Vec4f st = mesh.texCoord(at.triangle, at.u, at.v, channel);
        const float depth = mesh.fogDepths.present() ? mesh.fogDepths.value(at.triangle, at.corner).x : 0;
        looks.push_back({Vec3f(st.x, st.y, depth), colorOf(mesh.color(at.triangle, at.u, at.v))});
    }
    return looks;
}

/// Each corner by itself, with how deep it is in fog.
void addFogged(const Mesh& mesh, std::size_t channel, RasterArrays& out) {
    for (std::uint32_t corner = 0; corner < 3 * mesh.triangleCount; ++corner) out.indices.push_back(corner);
    out.vertices = verticesOf(mesh, out.indices), out.looks = looksOf(mesh, channel, out.indices);
}

const MeshAttribute& coordinatesOf(const Mesh& mesh, std::size_t channel) {
    static const MeshAttribute none;
    return channel < mesh.texCoords.size() ? mesh.texCoords[channel].values : none;
}

/// Whether corners that had one value have one again.
bool sameIndices(const MeshAttribute& a, const MeshAttribute& b) {
    return a.binding() == b.binding() && a.triangleStep() == b.triangleStep() &&
           (a.indices().sameStorage(b.indices()) || a.indices() == b.indices());
}
bool sameCorners(const Mesh& a, const Mesh& b, std::size_t channel) {
    return a.triangleCount == b.triangleCount && a.triangleStride == b.triangleStride && b.strokeCount == 0 &&
           a.triangles.sameStorage(b.triangles) && sameIndices(a.normals, b.normals) &&
           sameIndices(a.colors, b.colors) && sameIndices(a.fogDepths, b.fogDepths) &&
           sameIndices(coordinatesOf(a, channel), coordinatesOf(b, channel));
}
bool sameLooks(const Mesh& a, const Mesh& b, std::size_t channel) {
    const MeshAttribute& coordinates = coordinatesOf(b, channel);
    // Coordinates that nobody has given lie on the geometry, and move with it.
    return a.colors.data() == b.colors.data() && a.fogDepths.data() == b.fogDepths.data() && coordinates.present() &&
           coordinatesOf(a, channel).data() == coordinates.data();
}

void addStrokes(const Mesh& mesh, RasterArrays& out) {
    for (std::uint32_t i = 0; i < mesh.strokeCount; ++i) {
        RasterStroke stroke;
        stroke.start = mesh.vertex(i, 0), stroke.end = mesh.vertex(i, 1);
        if (mesh.normals.present())
            stroke.startNormal = mesh.shadingNormal(i, 0, 0), stroke.endNormal = mesh.shadingNormal(i, 1, 0);
        stroke.startColor = colorOf(mesh.color(i, 0, 0)), stroke.endColor = colorOf(mesh.color(i, 1, 0));
        if (mesh.fogDepths.present()) {
            stroke.corner.z = mesh.fogDepths.interpolate(i, 0, 0).x;
            stroke.corner.w = mesh.fogDepths.interpolate(i, 1, 0).x;
        }
        const auto first = static_cast<std::uint32_t>(out.strokes.size());
        for (std::uint32_t corner = 0; corner < 4; ++corner) {
            stroke.corner.x = corner < 2 ? 0 : 1, stroke.corner.y = corner % 2 == 0 ? -1 : 1;
            out.strokes.push_back(stroke);
        }
        for (const std::uint32_t corner : {0u, 1u, 2u, 2u, 1u, 3u}) out.indices.push_back(first + corner);
    }
}

Bounds boundsOf(const std::vector<RasterStroke>& strokes) {
    Bounds bounds;
    for (const RasterStroke& stroke : strokes) bounds.extend(stroke.start), bounds.extend(stroke.end);
    return bounds;
}

}  // namespace

RasterArrays rasterArrays(const Mesh& mesh, std::size_t channel) {
    RasterArrays out;
    out.bounds = mesh.bounds;
    if (mesh.strokeCount > 0)
        addStrokes(mesh, out), out.bounds = boundsOf(out.strokes);
    else if (mesh.fogDepths.present())
        addFogged(mesh, channel, out);
    else
        addTriangles(mesh, channel, out);
    return out;
}

RasterArrays RasterCorners::start(std::shared_ptr<const Mesh> mesh, std::size_t channel) {
    mesh_ = std::move(mesh);
    corners_.clear();
    if (mesh_->strokeCount > 0) return rasterArrays(*mesh_, channel);
    constexpr std::uint32_t kNone = 0xFFFFFFFF;
    constexpr int kMaxTries = 16;  // at a hub of very many triangles
    using Values = std::array<std::uint32_t, 4>;
    const auto valueOf = [](const MeshAttribute& attribute, const Corner& at, std::uint32_t absent) {
        return attribute.present() ? attribute.valueIndex(at.triangle, at.corner) : absent;
    };
    const MeshAttribute& coordinates = coordinatesOf(*mesh_, channel);
    // The vertices made of one position form a list.
    std::vector<std::uint32_t> first(mesh_->positions.size(), kNone), next;
    std::vector<Values> values;
    RasterArrays out;
    out.bounds = mesh_->bounds;
    for (std::uint32_t number = 0; number < 3 * mesh_->triangleCount; ++number) {
        const Corner at(number);
        const Values wanted{valueOf(mesh_->normals, at, at.triangle), valueOf(coordinates, at, kNone),
                            valueOf(mesh_->colors, at, kNone), valueOf(mesh_->fogDepths, at, kNone)};
        std::uint32_t& head = first[mesh_->vertexIndex(at.triangle, at.corner)];
        std::uint32_t found = head;
        for (int tries = 0; found != kNone && values[found] != wanted;)
            found = ++tries < kMaxTries ? next[found] : kNone;
        if (found == kNone) {
            found = static_cast<std::uint32_t>(corners_.size());
            corners_.push_back(number), values.push_back(wanted), next.push_back(head);
            head = found;
        }
        out.indices.push_back(found);
    }
    out.vertices = verticesOf(*mesh_, corners_), out.looks = looksOf(*mesh_, channel, corners_);
    return out;
}

bool RasterCorners::next(std::shared_ptr<const Mesh> mesh, std::size_t channel, RasterArrays& out) {
    const std::shared_ptr<const Mesh> last = std::exchange(mesh_, std::move(mesh));
    if (!last || corners_.empty() || !sameCorners(*last, *mesh_, channel)) return false;
    out.bounds = mesh_->bounds;
    out.vertices = verticesOf(*mesh_, corners_);
    if (!sameLooks(*last, *mesh_, channel)) out.looks = looksOf(*mesh_, channel, corners_);
    return true;
}

}  // namespace rtsg
