// Box, Cone, Cylinder and Sphere.
#include <algorithm>
#include <numbers>

#include <fmt/format.h>

#include <rtsg/core/portable_math.h>

#include "tessellate_detail.h"

namespace rtsg {

using detail::CornerMesh;
using detail::warn;
using Corner = CornerMesh::Corner;

int TessellationOptions::segmentsAround() const {
    if (segments > 0) return std::clamp(segments, 4, 4096);
    // A chord is radius * (1 - cos(pi / n)) away from its arc.
    const double error = std::clamp(chordError > 0 ? double{chordError} : 0.0025, 1e-6, 0.25);
    const double exact = std::numbers::pi / portable::acos(1.0 - error);
    return std::clamp(static_cast<int>(std::ceil(exact / 8.0)) * 8, 8, 4096);
}

namespace {

/// cos and sin of k/n of a turn, seen from +Y, counted from the seam at -Z towards -X, as textures wrap.
/// x = -sin, z = -cos. Computed in one octant's range, so that quarter turns are exact and opposite points agree.
struct SinCos {
    float x, z;
};
std::vector<SinCos> angles(int n) {
    std::vector<SinCos> result(static_cast<std::size_t>(n) + 1);
    for (int k = 0; k <= n; ++k) {
        const int m = k % n;
        double s = portable::sin(2.0 * std::numbers::pi * m / n), c = portable::cos(2.0 * std::numbers::pi * m / n);
        if (2 * m % n == 0) s = 0;
        if (4 * m % n == 0 && 2 * m % n != 0) c = 0;
        result[static_cast<std::size_t>(k)] = {static_cast<float>(-s), static_cast<float>(-c)};
    }
    return result;
}

/// A cap at height y, facing +Y or -Y, over ring positions ringStart ... ringStart + n - 1.
/// Upright when the top is tilted towards +Z (top cap) or -Z (bottom cap), 13.3.2 and 13.3.3.
void addCap(CornerMesh& out, const std::vector<SinCos>& ring, int ringStart, float y, bool top) {
    const int n = static_cast<int>(ring.size()) - 1;
    const int center = out.addPosition({0, y, 0});
    const int normal = out.addNormal({0, top ? 1.0f : -1.0f, 0});
    const int centerTexCoord = out.addTexCoord({0.5f, 0.5f});
    const int firstTexCoord = static_cast<int>(out.texCoords.size());
    for (int k = 0; k < n; ++k) {
        const SinCos t = ring[static_cast<std::size_t>(k)];
        out.addTexCoord({0.5f + 0.5f * t.x, 0.5f + (top ? -0.5f : 0.5f) * t.z});
    }
    for (int k = 0; k < n; ++k) {
        const int next = (k + 1) % n;
        const Corner a{ringStart + k, normal, firstTexCoord + k}, b{ringStart + next, normal, firstTexCoord + next};
        const Corner c{center, normal, centerTexCoord};
        top ? out.addTriangle(c, a, b) : out.addTriangle(c, b, a);
    }
}

}  // namespace

Mesh tessellate(const BoxParams& params) {
    Mesh mesh;
    mesh.solid = params.solid;
    const Vec3f size = params.size;
    int zeros = 0;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(size[axis] >= 0.0f) || !detail::usable(size[axis])) {
            warn(mesh, fmt::format("size {} {} {} is not within 0 to {:g}: nothing is drawn", size.x, size.y, size.z,
                                   detail::kLargestCoordinate));
            return mesh;
        }
        zeros += size[axis] == 0.0f;
    }
    if (zeros > 0) {
        warn(mesh, fmt::format("size {} {} {} is not above 0: {}", size.x, size.y, size.z,
                               zeros == 1 ? "drawn flat" : "nothing is drawn"));
        if (zeros > 1) return mesh;
    }
    // Position k has +x, +y, +z where its bits 0, 1, 2 are set. Each face starts at the texture's lower left.
    CornerMesh out;
    const Vec3f h = 0.5f * size;
    for (int k = 0; k < 8; ++k) out.addPosition({k & 1 ? h.x : -h.x, k & 2 ? h.y : -h.y, k & 4 ? h.z : -h.z});
    for (const Vec2f st : {Vec2f(0, 0), Vec2f(1, 0), Vec2f(1, 1), Vec2f(0, 1)}) out.addTexCoord(st);
    static constexpr int kFaces[6][4] = {
        {4, 5, 7, 6},  // front, +Z
        {1, 0, 2, 3},  // back, -Z
        {5, 1, 3, 7},  // right, +X
        {0, 4, 6, 2},  // left, -X
        {6, 7, 3, 2},  // top, +Y: upright when tilted towards +Z
        {0, 1, 5, 4},  // bottom, -Y: upright when tilted towards -Z
    };
    for (const auto& f : kFaces) out.addQuad({f[0], 0, 0}, {f[1], 0, 1}, {f[2], 0, 2}, {f[3], 0, 3});
    out.finish(mesh);
    return mesh;
}

Mesh tessellate(const SphereParams& params, const TessellationOptions& options) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (!detail::isPositive(mesh, "radius", params.radius)) return mesh;
    mesh.curveSize = 2 * params.radius;  // across the diagonal of two triangles both directions' errors add up
    const int n = options.segmentsAround();
    const int rings = std::max(n / 2, 2);
    const std::vector<SinCos> angle = angles(n);

    // Positions: the south pole, rings - 1 circles of n, the north pole. Texture seam at the back, t from south.
    CornerMesh out;
    const auto addPoint = [&](Vec3f direction) {
        out.addNormal(direction);
        out.addPosition(params.radius * direction);
    };
    addPoint({0, -1, 0});
    for (int j = 1; j < rings; ++j) {
        const double latitude = std::numbers::pi * (static_cast<double>(j) / rings - 0.5);
        const float y = 2 * j == rings ? 0.0f : static_cast<float>(portable::sin(latitude));
        const float r = 2 * j == rings ? 1.0f : static_cast<float>(portable::cos(latitude));
        for (int k = 0; k < n; ++k)
            addPoint({r * angle[static_cast<std::size_t>(k)].x, y, r * angle[static_cast<std::size_t>(k)].z});
    }
    addPoint({0, 1, 0});
    for (int j = 0; j <= rings; ++j) {
        const bool pole = j == 0 || j == rings;
        // At a pole each triangle has the coordinate of its own middle.
        for (int k = 0; k <= n; ++k)
            out.addTexCoord({(static_cast<float>(k) + (pole ? 0.5f : 0.0f)) / static_cast<float>(n),
                             static_cast<float>(j) / static_cast<float>(rings)});
    }
    const auto corner = [&](int j, int k) {
        int position = 1 + (j - 1) * n + k % n;
        if (j == 0) position = 0;
        if (j == rings) position = 1 + (rings - 1) * n;
        return Corner{position, position, j * (n + 1) + k};
    };
    // The seam runs towards -X: seen from outside, that is from left to right.
    for (int j = 0; j < rings; ++j)
        for (int k = 0; k < n; ++k) {
            const Corner a = corner(j, k), b = corner(j, k + 1), c = corner(j + 1, k + 1), d = corner(j + 1, k);
            if (j == 0)
                out.addTriangle(a, c, d);
            else if (j == rings - 1)
                out.addTriangle(a, b, d);
            else
                out.addQuad(a, b, c, d);
        }
    out.finish(mesh);
    return mesh;
}

Mesh tessellate(const ConeParams& params, const TessellationOptions& options) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (!detail::isPositive(mesh, "bottomRadius", params.bottomRadius) ||
        !detail::isPositive(mesh, "height", params.height))
        return mesh;
    mesh.curveSize = params.bottomRadius;
    const int n = options.segmentsAround();
    const std::vector<SinCos> angle = angles(n), between = angles(2 * n);
    const float r = params.bottomRadius, y = 0.5f * params.height;
    CornerMesh out;
    for (int k = 0; k < n; ++k)
        out.addPosition({r * angle[static_cast<std::size_t>(k)].x, -y, r * angle[static_cast<std::size_t>(k)].z});
    if (params.side) {
        const int apex = out.addPosition({0, y, 0});
        // The normal leans by the slope; at the apex it is that of the middle of the segment.
        const double slant = portable::hypot(double{params.height}, double{r});
        const auto across = static_cast<float>(params.height / slant), up = static_cast<float>(r / slant);
        for (const SinCos t : between) out.addNormal({across * t.x, up, across * t.z});
        for (int k = 0; k <= n; ++k) out.addTexCoord({static_cast<float>(k) / static_cast<float>(n), 0.0f});
        for (int k = 0; k < n; ++k) out.addTexCoord({(static_cast<float>(k) + 0.5f) / static_cast<float>(n), 1.0f});
        for (int k = 0; k < n; ++k)
            out.addTriangle({k, 2 * k, k}, {(k + 1) % n, 2 * k + 2, k + 1}, {apex, 2 * k + 1, n + 1 + k});
    }
    if (params.bottom) addCap(out, angle, 0, -y, false);
    out.finish(mesh);
    return mesh;
}

Mesh tessellate(const CylinderParams& params, const TessellationOptions& options) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (!detail::isPositive(mesh, "radius", params.radius) || !detail::isPositive(mesh, "height", params.height))
        return mesh;
    mesh.curveSize = params.radius;
    const int n = options.segmentsAround();
    const std::vector<SinCos> angle = angles(n);
    const float r = params.radius, y = 0.5f * params.height;
    CornerMesh out;
    for (const float level : {-y, y})
        for (int k = 0; k < n; ++k)
            out.addPosition(
                {r * angle[static_cast<std::size_t>(k)].x, level, r * angle[static_cast<std::size_t>(k)].z});
    if (params.side) {
        for (const SinCos t : angle) out.addNormal({t.x, 0, t.z});
        for (const float level : {0.0f, 1.0f})
            for (int k = 0; k <= n; ++k) out.addTexCoord({static_cast<float>(k) / static_cast<float>(n), level});
        for (int k = 0; k < n; ++k) {
            const int next = (k + 1) % n;
            out.addQuad({k, k, k}, {next, k + 1, k + 1}, {n + next, k + 1, n + 1 + k + 1}, {n + k, k, n + 1 + k});
        }
    }
    if (params.top) addCap(out, angle, n, y, true);
    if (params.bottom) addCap(out, angle, 0, -y, false);
    out.finish(mesh);
    return mesh;
}

}  // namespace rtsg
