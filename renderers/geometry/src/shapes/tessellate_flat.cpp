// The geometries of the Geometry2D component: arcs, discs, rectangles, polylines, triangles in the plane z = 0.
#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include <rtsg/core/portable_math.h>

#include "tessellate_detail.h"

namespace rtsg {

using detail::CornerMesh;
using detail::warn;

namespace {

Vec2f onCircle(double angle) {
    return {static_cast<float>(portable::cos(angle)), static_cast<float>(portable::sin(angle))};
}

}  // namespace

Mesh tessellate(const Disk2DParams& params, const TessellationOptions& options) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (!detail::isPositive(mesh, "outerRadius", params.outerRadius)) return mesh;
    if (!(params.innerRadius >= 0) || !(params.innerRadius <= params.outerRadius)) {
        warn(mesh, fmt::format("innerRadius {} is not between 0 and outerRadius {}: nothing is drawn",
                               params.innerRadius, params.outerRadius));
        return mesh;
    }
    // 14.3.4: equal radii are a circle's line.
    if (params.innerRadius == params.outerRadius) return tessellate(Arc2DParams{0, 0, params.outerRadius}, options);
    mesh.curveSize = params.outerRadius;
    const int n = options.segmentsAround();
    const float inner = params.innerRadius / params.outerRadius;
    CornerMesh out;
    const auto add = [&](Vec2f direction, float part) {
        out.addPosition(Vec3f(params.outerRadius * part * direction, 0));
        out.addTexCoord(Vec2f(0.5f) + 0.5f * part * direction);
    };
    for (int k = 0; k < n; ++k) add(onCircle(2 * std::numbers::pi * k / n), 1);
    if (inner > 0) {
        for (int k = 0; k < n; ++k) add(onCircle(2 * std::numbers::pi * k / n), inner);
        for (int k = 0; k < n; ++k) {
            const int next = (k + 1) % n;
            out.addQuad({n + k, 0, n + k}, {k, 0, k}, {next, 0, next}, {n + next, 0, n + next});
        }
    } else {
        add({1, 0}, 0);
        for (int k = 0; k < n; ++k) out.addTriangle({n, 0, n}, {k, 0, k}, {(k + 1) % n, 0, (k + 1) % n});
    }
    out.finish(mesh);
    return mesh;
}

Mesh tessellate(const Rectangle2DParams& params) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (!detail::isPositive(mesh, "size", params.size.x) || !detail::isPositive(mesh, "size", params.size.y))
        return mesh;
    CornerMesh out;
    for (const Vec2f st : {Vec2f(0, 0), Vec2f(1, 0), Vec2f(1, 1), Vec2f(0, 1)}) {
        out.addPosition(Vec3f((st - Vec2f(0.5f)) * params.size, 0));
        out.addTexCoord(st);
    }
    out.addQuad({0, 0, 0}, {1, 0, 1}, {2, 0, 2}, {3, 0, 3});
    out.finish(mesh);
    return mesh;
}

Mesh tessellate(const TriangleSet2DParams& params) {
    PrimitiveSetParams set;
    Array<Vec3f> coord = Array<Vec3f>::ofSize(params.vertices.size());
    Vec3f* out = coord.mutableData();
    for (std::size_t i = 0; i < params.vertices.size(); ++i) out[i] = Vec3f(params.vertices[i], 0);
    // A front is where +Z sees it: a triangle listed clockwise is turned around.
    for (std::size_t i = 0; i + 3 <= params.vertices.size(); i += 3) {
        const Vec3f e1 = out[i + 1] - out[i], e2 = out[i + 2] - out[i];
        if (e1.x * e2.y - e1.y * e2.x < 0) std::swap(out[i + 1], out[i + 2]);
    }
    set.coord = std::move(coord);
    set.solid = params.solid;
    set.kind = PrimitiveSetParams::Kind::triangleSet;
    return tessellate(set);
}

Mesh tessellate(const ArcClose2DParams& params, const TessellationOptions& options) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (!detail::isPositive(mesh, "radius", params.radius)) return mesh;
    mesh.curveSize = params.radius;
    if (!std::isfinite(params.startAngle) || !std::isfinite(params.endAngle)) {
        warn(mesh, "startAngle and endAngle are not finite: nothing is drawn");
        return mesh;
    }
    // 14.3.2: from startAngle counter-clockwise to endAngle; a full turn or equal angles give the whole circle.
    const double rotation = 2 * std::numbers::pi;
    const double span = double{params.endAngle} - double{params.startAngle};
    const bool whole = span == 0 || std::abs(span) >= rotation - 1e-6;
    double angle = whole ? rotation : std::fmod(span, rotation);
    if (angle < 0) angle += rotation;
    const int n = std::max(1, static_cast<int>(std::ceil(options.segmentsAround() * angle / rotation - 1e-6)));
    CornerMesh out;
    const auto add = [&](Vec2f direction) {
        out.addPosition(Vec3f(params.radius * direction, 0));
        out.addTexCoord(Vec2f(0.5f) + 0.5f * direction);
    };
    const int last = whole ? n - 1 : n;
    for (int k = 0; k <= last; ++k) add(onCircle(params.startAngle + angle * k / n));
    const bool pie = whole || params.closure == ArcClose2DParams::Closure::pie;
    if (pie) {
        add({0, 0});
        const int center = last + 1;
        for (int k = 0; k < n; ++k) {
            const int next = k + 1 > last ? 0 : k + 1;
            out.addTriangle({center, 0, center}, {k, 0, k}, {next, 0, next});
        }
    } else {
        for (int k = 1; k < last; ++k) out.addTriangle({0, 0, 0}, {k, 0, k}, {k + 1, 0, k + 1});
    }
    if (out.positionIndex.empty()) warn(mesh, "the arc is too short to enclose an area");
    out.finish(mesh);
    return mesh;
}

}  // namespace rtsg
