// Gives the corners of triangles one index, and lines and points four corners.
#include "raster_shapes.h"

namespace rtsg {

namespace {

Vec4f colorOf(const ColorRGBA& c) {
    return {c.r, c.g, c.b, c.a};
}

void addTriangles(const Mesh& mesh, std::size_t channel, RasterArrays& out) {
    const VertexArrays arrays = vertexArrays(mesh, channel);
    out.vertices.resize(arrays.positions.size());
    for (std::size_t i = 0; i < out.vertices.size(); ++i) {
        RasterVertex& vertex = out.vertices[i];
        vertex.position = arrays.positions[i], vertex.normal = arrays.normals[i];
        vertex.coordinates = Vec3f(arrays.texCoords[i], 0);
        if (!arrays.colors.empty()) vertex.color = colorOf(arrays.colors[i]);
    }
    out.indices.assign(arrays.triangles.begin(), arrays.triangles.end());
}

/// Each corner by itself, with how deep it is in fog.
void addFogged(const Mesh& mesh, std::size_t channel, RasterArrays& out) {
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const float u = c == 1 ? 1 : 0, v = c == 2 ? 1 : 0;
            const Vec4f st = mesh.texCoord(t, u, v, channel);
            out.indices.push_back(static_cast<std::uint32_t>(out.vertices.size()));
            out.vertices.push_back({mesh.vertex(t, c), mesh.shadingNormal(t, u, v),
                                    Vec3f(st.x, st.y, mesh.fogDepths.value(t, c).x), colorOf(mesh.color(t, u, v))});
        }
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

}  // namespace rtsg
