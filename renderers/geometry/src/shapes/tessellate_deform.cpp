// Keeps the triangles of a composed geometry while its coordinates move, as long as a new cut would be the same.
#include "tessellate_deform.h"

#include <numbers>

namespace rtsg::detail {

namespace {

const SurfaceParams& surfaceOf(const ComposedParams& params) {
    return std::visit([](const auto& p) -> const SurfaceParams& { return p; }, params);
}

float creaseAngleOf(const ComposedParams& params) {
    if (const auto* faces = std::get_if<IndexedFaceSetParams>(&params)) return std::max(0.0f, faces->creaseAngle);
    return std::numbers::pi_v<float>;
}

bool isSame(const TexCoordParams& a, const TexCoordParams& b) {
    return a.point.sameStorage(b.point) && a.point3.sameStorage(b.point3) && a.point4.sameStorage(b.point4) &&
           a.fromPosition == b.fromPosition && a.generator == b.generator && a.parameter == b.parameter &&
           a.mapping == b.mapping;
}

bool isSame(const SurfaceParams& a, const SurfaceParams& b) {
    if (a.texCoord.size() != b.texCoord.size()) return false;
    for (std::size_t i = 0; i < a.texCoord.size(); ++i)
        if (!isSame(a.texCoord[i], b.texCoord[i])) return false;
    return a.anchor == b.anchor && a.fogDepth.sameStorage(b.fogDepth) && a.color.sameStorage(b.color) &&
           a.colorRGBA.sameStorage(b.colorRGBA) && a.normal.size() == b.normal.size() &&
           a.tangent.sameStorage(b.tangent) && a.ccw == b.ccw && a.solid == b.solid &&
           a.colorPerVertex == b.colorPerVertex && a.normalPerVertex == b.normalPerVertex;
}

/// But for the values of coordinates and normals.
bool isSame(const ComposedParams& a, const ComposedParams& b) {
    if (a.index() != b.index() || !isSame(surfaceOf(a), surfaceOf(b))) return false;
    if (const auto* p = std::get_if<IndexedFaceSetParams>(&a)) {
        const auto& q = std::get<IndexedFaceSetParams>(b);
        return p->coordIndex.sameStorage(q.coordIndex) && p->colorIndex.sameStorage(q.colorIndex) &&
               p->normalIndex.sameStorage(q.normalIndex) && p->texCoordIndex.sameStorage(q.texCoordIndex) &&
               p->convex == q.convex && p->creaseAngle == q.creaseAngle;
    }
    const auto& p = std::get<PrimitiveSetParams>(a);
    const auto& q = std::get<PrimitiveSetParams>(b);
    return p.kind == q.kind && p.index.sameStorage(q.index) && p.count.sameStorage(q.count);
}

bool usesAll(const Mesh& mesh) {
    std::vector<bool> used(mesh.positions.size());
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) used[mesh.vertexIndex(t, c)] = true;
    for (const bool u : used)
        if (!u) return false;
    return true;
}

/// Checks all points; fills `bounds` when they are usable.
bool scanPoints(const Array<Vec3f>& points, Bounds& bounds) {
    using Lanes = float __attribute__((vector_size(16)));
    using LaneMask = std::int32_t __attribute__((vector_size(16)));
    const Lanes limit = {kLargestCoordinate, kLargestCoordinate, kLargestCoordinate, kLargestCoordinate};
    const float infinity = std::numeric_limits<float>::infinity();
    Lanes low = {infinity, infinity, infinity, infinity}, high = -low;
    LaneMask good = {-1, -1, -1, -1};
    const Vec3f* point = points.data();
    for (std::size_t i = 0; i < points.size(); ++i) {
        Lanes p;  // arrays are padded, so a wide read of the last element is safe
        std::memcpy(&p, point + i, sizeof p);
        good &= (p <= limit) & (p >= -limit);
        low = p < low ? p : low;
        high = p > high ? p : high;
    }
    bounds = {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
    return good[0] && good[1] && good[2];
}

/// Clearly convex, by a margin that no rounding reaches: every corner turns left around the area's normal.
bool isClearlyConvex(const Vec3f* p0, const Vec3f* p1, const Vec3f* p2, const Vec3f* p3) {
    const Vec3f e0 = *p1 - *p0, e1 = *p2 - *p1, e2 = *p3 - *p2, e3 = *p0 - *p3;
    const Vec3f normal = glm::cross(*p2 - *p0, *p3 - *p1);
    const float minimum = 1e-3f * glm::dot(normal, normal);
    return minimum > 1e-30f && glm::dot(normal, glm::cross(e0, e1)) > minimum &&
           glm::dot(normal, glm::cross(e1, e2)) > minimum && glm::dot(normal, glm::cross(e2, e3)) > minimum &&
           glm::dot(normal, glm::cross(e3, e0)) > minimum;
}

}  // namespace

void FacePlan::add(const Array<std::int32_t>& index, const std::vector<std::size_t>& corners,
                   const std::vector<std::array<int, 3>>& triangles) {
    for (const std::size_t corner : corners) vertices.push_back(index[corner]);
    cuts.insert(cuts.end(), triangles.begin(), triangles.end());
    const bool isQuad = corners.size() == 4 && triangles.size() == 2 && triangles[0] == std::array<int, 3>{0, 1, 2} &&
                        triangles[1] == std::array<int, 3>{0, 2, 3};
    polygons.push_back({static_cast<std::uint32_t>(vertices.size()), static_cast<std::uint32_t>(cuts.size()), isQuad});
}

bool FacePlan::cutsAlike(const Array<Vec3f>& points, PolygonCutter& cutter) const {
    std::size_t begin = 0, cutBegin = 0;
    std::vector<Vec3f> corners;
    std::vector<std::array<int, 3>> again;
    const Vec3f* p = points.data();
    for (const Polygon& polygon : polygons) {
        const std::int32_t* v = vertices.data() + begin;
        if (!polygon.isQuad || !isClearlyConvex(p + v[0], p + v[1], p + v[2], p + v[3])) {
            corners.clear();
            for (std::size_t i = begin; i < polygon.end; ++i) {
                corners.push_back(p[vertices[i]]);
                if (!usable(corners.back())) return false;
            }
            if (cutter.cut(corners, again) != PolygonCutter::Outcome::good) return false;
            if (again.size() != polygon.cutEnd - cutBegin ||
                !std::equal(again.begin(), again.end(), cuts.begin() + static_cast<std::ptrdiff_t>(cutBegin)))
                return false;
        }
        begin = polygon.end, cutBegin = polygon.cutEnd;
    }
    return true;
}

DeformingSurface::DeformingSurface(const ComposedParams& params)
    : params_(params), normals_(creaseAngleOf(params), true) {
    Mesh created = std::visit(
        [&](const auto& p) {
            if constexpr (std::is_same_v<std::decay_t<decltype(p)>, IndexedFaceSetParams>)
                return tessellateFaces(p, &plan_);
            else
                return tessellateSet(p, &plan_);
        },
        params);
    generatesNormals_ = created.normals.present() && surfaceOf(params).normal.empty();
    usesAllPoints_ = usesAll(created);
    created.anchor = surfaceOf(params).anchor;
    mesh_ = std::make_shared<Mesh>(std::move(created));
    std::visit([](auto& p) { p.coord = {}; }, params_);
}

std::shared_ptr<Mesh> DeformingSurface::deform(const ComposedParams& params) {
    const Array<Vec3f>& coord = surfaceOf(params).coord;
    if (plan_.dependsOnPoints || mesh_->empty() || coord.size() != mesh_->positions.size() || !isSame(params_, params))
        return nullptr;
    Bounds bounds;
    const bool good = usesAllPoints_ ? scanPoints(coord, bounds)
                                     : scanTriangles(coord, mesh_->triangles.data(), mesh_->triangleStride,
                                                     mesh_->triangleCount, bounds);
    if (!good || !plan_.cutsAlike(coord, cutter_)) return nullptr;
    std::shared_ptr<Mesh> next(new Mesh(*mesh_));
    next->positions = coord;
    next->bounds = bounds;
    if (generatesNormals_) next->normals = normals_.make(*next);
    const Array<Vec3f>& normal = surfaceOf(params).normal;
    if (const MeshAttribute& last = mesh_->normals; !normal.empty() && last.present())
        next->normals = MeshAttribute(normal, last.binding(), last.indices(), last.triangleStep());
    const std::vector<TexCoordParams>& channels = surfaceOf(params).texCoord;
    for (std::size_t i = 0; i < next->texCoords.size(); ++i) {
        if (next->texCoords[i].values.present() || (i < channels.size() && channels[i].fromPosition)) continue;
        String mapping = std::move(next->texCoords[i].mapping);
        next->texCoords[i] = defaultTexCoords(bounds);
        next->texCoords[i].mapping = std::move(mapping);
        if (i < channels.size())
            next->texCoords[i].generator = channels[i].generator, next->texCoords[i].parameter = channels[i].parameter;
    }
    mesh_ = next;
    return next;
}

}  // namespace rtsg::detail
