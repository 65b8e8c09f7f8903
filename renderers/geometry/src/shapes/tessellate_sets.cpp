// Triangle and quad sets, strips and fans, indexed or not; line and point sets.
#include <fmt/format.h>

#include <numbers>

#include "tessellate_detail.h"

namespace rtsg {

using detail::Topology;
using detail::TopologyBuilder;
using detail::warn;
using Kind = PrimitiveSetParams::Kind;

namespace {

bool isIndexed(Kind kind) {
    return kind >= Kind::indexedTriangleSet;
}

/// Adds the triangles of a run of corners, leaving out those that cannot be drawn.
class RunCutter {
  public:
    RunCutter(Mesh& mesh, const Array<std::int32_t>& index, TopologyBuilder& builder)
        : mesh_(mesh), index_(index), builder_(builder) {}

    void triangles(std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i + 3 <= end; i += 3)
            if (add(i, i + 1, i + 2, face_++)) flat_ += isFlat(i, i + 1, i + 2);
        leftOver_ += (end - begin) % 3;
    }
    void quads(std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i + 4 <= end; i += 4) {
            const std::size_t face = face_++;
            const bool first = add(i, i + 1, i + 2, face), second = add(i, i + 2, i + 3, face);
            if (first && second && isFlat(i, i + 1, i + 2) && isFlat(i, i + 2, i + 3)) flat_ += 2;
        }
        leftOver_ += (end - begin) % 4;
    }
    /// Every second triangle of a strip is listed backwards.
    void strip(std::size_t begin, std::size_t end) {
        if (end - begin < 3) leftOver_ += end - begin;
        for (std::size_t i = begin; i + 3 <= end; ++i) {
            const bool odd = (i - begin) % 2 != 0;
            add(odd ? i + 1 : i, odd ? i : i + 1, i + 2, face_++);
        }
    }
    void fan(std::size_t begin, std::size_t end) {
        if (end - begin < 3) leftOver_ += end - begin;
        for (std::size_t i = begin + 1; i + 2 <= end; ++i) add(begin, i, i + 1, face_++);
    }
    void report() {
        if (outOfRange_)
            warn(mesh_, fmt::format("index: {} triangles left out: they refer to points that do not exist ({} do)",
                                    outOfRange_, mesh_.positions.size()));
        if (notFinite_)
            warn(mesh_, fmt::format("coord: {} triangles left out: their points are not finite", notFinite_));
        if (flat_) warn(mesh_, fmt::format("{} triangles have no area and show nothing", flat_));
        if (leftOver_) warn(mesh_, fmt::format("{} points left over, too few for a triangle or quad", leftOver_));
    }

    bool leftOutForPoints() const { return notFinite_ > 0; }

  private:
    /// False: its points are faulty, which has been counted already.
    bool add(std::size_t a, std::size_t b, std::size_t c, std::size_t face) {
        const std::int32_t v[3] = {index_[a], index_[b], index_[c]};
        for (const std::int32_t i : v) {
            if (static_cast<std::uint32_t>(i) >= mesh_.positions.size()) {
                ++outOfRange_;
                return false;
            }
            if (!detail::usable(mesh_.positions[static_cast<std::size_t>(i)])) {
                ++notFinite_;
                return false;
            }
        }
        // Strips are joined by triangles that repeat a point: common, and nothing to report.
        if (v[0] != v[1] && v[1] != v[2] && v[2] != v[0]) builder_.add(a, b, c, face);
        return true;
    }
    bool isFlat(std::size_t a, std::size_t b, std::size_t c) const {
        const auto point = [&](std::size_t i) { return mesh_.positions[static_cast<std::size_t>(index_[i])]; };
        return detail::isFlat(point(a), point(b), point(c));
    }

    Mesh& mesh_;
    const Array<std::int32_t>& index_;
    TopologyBuilder& builder_;
    std::size_t face_ = 0, outOfRange_ = 0, notFinite_ = 0, leftOver_ = 0, flat_ = 0;
};

Array<std::int32_t> countingUp(std::size_t count) {
    Array<std::int32_t> result = Array<std::int32_t>::ofSize(count);
    std::int32_t* out = result.mutableData();
    for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::int32_t>(i);
    return result;
}

void cutRuns(Mesh& mesh, const PrimitiveSetParams& params, const Array<std::int32_t>& index, RunCutter& cutter) {
    const std::size_t size = index.size();
    const bool strips = params.kind == Kind::triangleStripSet || params.kind == Kind::indexedTriangleStripSet;
    switch (params.kind) {
        case Kind::triangleSet:
        case Kind::indexedTriangleSet:
            cutter.triangles(0, size);
            break;
        case Kind::quadSet:
        case Kind::indexedQuadSet:
            cutter.quads(0, size);
            break;
        case Kind::triangleStripSet:
        case Kind::triangleFanSet: {
            std::size_t begin = 0, bad = 0;
            for (const std::int32_t wanted : params.count) {
                if (wanted < 0) {
                    ++bad;
                    continue;
                }
                const std::size_t end = std::min(size, begin + static_cast<std::size_t>(wanted));
                bad += wanted < 3 || end - begin < static_cast<std::size_t>(wanted);
                strips ? cutter.strip(begin, end) : cutter.fan(begin, end);
                begin = end;
            }
            if (bad)
                warn(mesh, fmt::format("{}: {} counts are below 3 or go past the last of {} points",
                                       strips ? "stripCount" : "fanCount", bad, size));
            break;
        }
        case Kind::indexedTriangleStripSet:
        case Kind::indexedTriangleFanSet:
            for (std::size_t i = 0; i < size; ++i) {
                const std::size_t begin = i;
                while (i < size && index[i] >= 0) ++i;
                if (i > begin) strips ? cutter.strip(begin, i) : cutter.fan(begin, i);
            }
            break;
    }
}

}  // namespace

Mesh tessellate(const PrimitiveSetParams& params) {
    return detail::tessellateSet(params, nullptr);
}

Mesh detail::tessellateSet(const PrimitiveSetParams& params, FacePlan* plan) {
    Mesh mesh;
    mesh.solid = params.solid;
    if (params.coord.empty()) {
        if (isIndexed(params.kind) && !params.index.empty()) warn(mesh, "index refers to points, and there are none");
        return mesh;
    }
    mesh.positions = params.coord;
    const bool plainTriangles = params.kind == Kind::triangleSet || params.kind == Kind::indexedTriangleSet;
    const std::size_t points = params.coord.size();
    const Array<std::int32_t> index =
        isIndexed(params.kind) ? params.index : countingUp(plainTriangles ? points / 3 * 3 : points);
    if (index.empty()) {
        if (!isIndexed(params.kind)) warn(mesh, "points left over, too few for a triangle");
        return mesh;
    }

    Topology topology;
    if (plainTriangles && params.ccw && index.size() >= 3 &&
        detail::scanTriangles(mesh.positions, index.data(), 3, index.size() / 3, mesh.bounds)) {
        mesh.triangles = index;
        mesh.triangleStride = 3;
        mesh.triangleCount = static_cast<std::uint32_t>(index.size() / 3);
        if (index.size() % 3 || (!isIndexed(params.kind) && points % 3))
            warn(mesh, "points left over, too few for a triangle");
        detail::reportOfFlatTriangles(mesh);
    } else {
        TopologyBuilder builder(index, params.ccw);
        builder.reserve(index.size() / (plainTriangles ? 3 : 1), false);
        RunCutter cutter(mesh, index, builder);
        cutRuns(mesh, params, index, cutter);
        cutter.report();
        if (plan) plan->dependsOnPoints = cutter.leftOutForPoints();
        topology = builder.finish(mesh);
        if (mesh.empty() && mesh.diagnostics.warnings() == 0) warn(mesh, "none of its faces has an area");
    }
    if (mesh.empty()) return mesh;
    // Clauses 11.4 and 32.4: all values belong to vertices; colorPerVertex is ignored and normalPerVertex only
    // says how missing normals are made.
    SurfaceParams perVertex = params;
    perVertex.colorPerVertex = perVertex.normalPerVertex = true;
    detail::bindAttributes(mesh, topology, perVertex, {});
    // Without normals, normalPerVertex alone decides: smooth over the triangles that share a vertex, or faceted.
    // Points that are never shared give faceted normals anyway, so those are left out.
    const bool canReuse = params.kind != Kind::triangleSet;
    if (!mesh.normals.present() && params.normalPerVertex && canReuse)
        mesh.normals = detail::generateNormals(mesh, std::numbers::pi_v<float>);
    return mesh;
}

}  // namespace rtsg
