// Generates vertex normals from faces by crease angle, many corners at once.
#include <algorithm>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/portable_math.h>

#include "mesh/simd8.h"
#include "tessellate_detail.h"

namespace rtsg::detail {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

/// Heights below this part of the coordinates are rounding.
constexpr float kSliver = 4 * std::numeric_limits<float>::epsilon();

using simd::F8;
using simd::I8;

struct TriangleFrame {
    Vec3f normal{0};  // unit, or zero for a triangle without area
    float angle[3] = {0, 0, 0};
};

/// For edges whose products leave the range of float: in double, brought to unit size.
TriangleFrame frameOfExtreme(const Mesh& mesh, std::uint32_t triangle) {
    TriangleFrame frame;
    const Vec3d a(mesh.vertex(triangle, 0)), b(mesh.vertex(triangle, 1)), c(mesh.vertex(triangle, 2));
    Vec3d e[3] = {b - a, c - b, a - c};
    const double lengths[3] = {glm::length(e[0]), glm::length(e[1]), glm::length(e[2])};
    const double size = std::max({lengths[0], lengths[1], lengths[2]});
    if (!(size > 0.0)) return frame;
    const Vec3d n = glm::cross(e[0], -e[2]) / (size * size);
    const double area = glm::length(n), reach = std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)}) / size + 1;
    if (!(area > kSliver * reach)) return frame;
    frame.normal = Vec3f(n / area);
    for (int i = 0; i < 3; ++i) {
        if (!(lengths[i] > 0.0)) return {};
        e[i] /= lengths[i];
    }
    frame.angle[0] = static_cast<float>(portable::acos(std::clamp(-glm::dot(e[0], e[2]), -1.0, 1.0)));
    frame.angle[1] = static_cast<float>(portable::acos(std::clamp(-glm::dot(e[1], e[0]), -1.0, 1.0)));
    frame.angle[2] = std::max(0.0f, kPi - frame.angle[0] - frame.angle[1]);
    return frame;
}

/// Eight triangles' frames; weights need no more than acosOf's accuracy, and std::acos is six times slower.
struct alignas(32) EightFrames {
    float normal[3][8], angle[3][8];

    EightFrames(const Mesh& mesh, std::uint32_t first) {
        alignas(32) float corner[3][3][8];
        const std::uint32_t count = std::min<std::uint32_t>(8, mesh.triangleCount - first);
        for (std::uint32_t i = 0; i < 8; ++i)
            for (std::uint32_t c = 0; c < 3; ++c) {
                const Vec3f p = mesh.vertex(first + std::min(i, count - 1), c);
                for (int k = 0; k < 3; ++k) corner[c][k][i] = p[k];
            }
        const auto at = [&](int c) {
            return simd::V8{simd::load(corner[c][0]), simd::load(corner[c][1]), simd::load(corner[c][2])};
        };
        const simd::V8 a = at(0), b = at(1), c = at(2);
        const simd::V8 e0 = b - a, e1 = c - b, e2 = a - c;
        const F8 l0 = dot(e0, e0), l1 = dot(e1, e1), l2 = dot(e2, e2), longest = simd::max(l0, simd::max(l1, l2));
        const simd::V8 n{e0.z * e2.y - e0.y * e2.z, e0.x * e2.z - e0.z * e2.x, e0.y * e2.x - e0.x * e2.y};
        const F8 area = simd::sqrt(dot(n, n)), length = simd::sqrt(longest);
        const auto magnitude = [](F8 v) { return simd::max(v, -v); };
        const F8 reach = simd::max(magnitude(a.x), simd::max(magnitude(a.y), magnitude(a.z))) + length;
        // Cutting polygons leaves slivers between collinear corners. If the height is below the rounding of the
        // coordinates, the direction is noise, and the wide angle would give it the greatest weight.
        const I8 good = area > kSliver * length * reach;
        const F8 zero{}, one = simd::all(1);
        const F8 divisor = simd::select(good, area, simd::all(HUGE_VALF));
        simd::store(normal[0], n.x / divisor), simd::store(normal[1], n.y / divisor);
        simd::store(normal[2], n.z / divisor);
        const auto cosine = [&](const simd::V8& u, const simd::V8& v, F8 squares) {
            const F8 size = simd::sqrt(simd::select(good, squares, one));
            return simd::max(simd::min(-dot(u, v) / simd::max(size, simd::all(1e-30f)), one), -one);
        };
        const F8 angle0 = simd::acosOf(cosine(e0, e2, l0 * l2)), angle1 = simd::acosOf(cosine(e1, e0, l1 * l0));
        simd::store(angle[0], simd::select(good, angle0, zero));
        simd::store(angle[1], simd::select(good, angle1, zero));
        simd::store(angle[2], simd::select(good, simd::max(kPi - angle0 - angle1, zero), zero));
        // The products of four lengths must stay in range.
        const I8 extreme = ~((longest > 1e-16f) & (longest < 1e16f));
        if (!simd::any(extreme)) return;
        for (std::uint32_t i = 0; i < count; ++i) {
            if (!extreme[i]) continue;
            const TriangleFrame frame = frameOfExtreme(mesh, first + i);
            for (int k = 0; k < 3; ++k) normal[k][i] = frame.normal[k], angle[k][i] = frame.angle[k];
        }
    }
};

// Four lanes, the last of which is 0: one sum instead of three.
using Lanes = float __attribute__((vector_size(16)));

/// Unit vectors of the sums, or zero for those without direction.
Array<Vec3f> directions(const std::vector<Lanes>& sums) {
    Array<Vec3f> result = Array<Vec3f>::ofSize(sums.size());
    Vec3f* out = result.mutableData();
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const Lanes n = sums[i], squares = n * n;
        const float length = std::sqrt(squares[0] + squares[1] + squares[2]);
        const Lanes unit = n / (length > 1e-6f ? length : HUGE_VALF);
        out[i] = Vec3f(unit[0], unit[1], unit[2]);
    }
    return result;
}

/// Corners of one vertex, joined into groups.
class CornerGroups {
  public:
    void begin(std::uint32_t corners) {
        parent_.resize(corners);
        for (std::uint32_t i = 0; i < corners; ++i) parent_[i] = i;
    }
    void join(std::uint32_t a, std::uint32_t b) { parent_[root(a)] = root(b); }
    std::uint32_t root(std::uint32_t corner) {
        while (parent_[corner] != corner) corner = parent_[corner] = parent_[parent_[corner]];
        return corner;
    }

  private:
    std::vector<std::uint32_t> parent_;
};

}  // namespace

// ---- all of a mesh ------------------------------------------------------------------------------------------------

MeshAttribute NormalGenerator::make(const Mesh& mesh) {
    if (mesh.empty() || !(creaseAngle_ > 0.0f)) return {};
    return creaseAngle_ >= kPi ? smoothEverywhere(mesh) : smoothWithinCrease(mesh);
}

MeshAttribute NormalGenerator::smoothEverywhere(const Mesh& mesh) {
    std::vector<Lanes> sums(mesh.positions.size(), Lanes{});
    for (std::uint32_t t = 0; t < mesh.triangleCount; t += 8) {
        const EightFrames frames(mesh, t);
        for (std::uint32_t i = 0; i < std::min<std::uint32_t>(8, mesh.triangleCount - t); ++i) {
            const Lanes normal{frames.normal[0][i], frames.normal[1][i], frames.normal[2][i], 0};
            for (std::uint32_t c = 0; c < 3; ++c) sums[mesh.vertexIndex(t + i, c)] += frames.angle[c][i] * normal;
        }
    }
    return MeshAttribute(directions(sums), MeshAttribute::Binding::vertex, mesh.triangles, mesh.triangleStride);
}

void NormalGenerator::findFrames(const Mesh& mesh) {
    normals_.resize(mesh.triangleCount);
    angles_.resize(std::size_t{mesh.triangleCount} * 3);
    for (std::uint32_t t = 0; t < mesh.triangleCount; t += 8) {
        const EightFrames frames(mesh, t);
        for (std::uint32_t i = 0; i < std::min<std::uint32_t>(8, mesh.triangleCount - t); ++i) {
            normals_[t + i] = {frames.normal[0][i], frames.normal[1][i], frames.normal[2][i]};
            for (std::uint32_t c = 0; c < 3; ++c) angles_[(t + i) * 3 + c] = frames.angle[c][i];
        }
    }
}

bool NormalGenerator::isSmooth(std::uint32_t a, std::uint32_t b) const {
    const Vec3f na = normals_[a], nb = normals_[b];
    if (na == Vec3f(0) || nb == Vec3f(0)) return true;
    // Chords of unit normals stay exact for small angles, where cosines all round to 1.
    const Vec3f d = na - nb;
    return glm::dot(d, d) < chord_ * chord_;
}

void NormalGenerator::findCorners(const Mesh& mesh) {
    const std::size_t vertices = mesh.positions.size();
    first_.assign(vertices + 1, 0);
    incident_.resize(std::size_t{mesh.triangleCount} * 3);
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) ++first_[mesh.vertexIndex(t, c) + 1];
    for (std::size_t v = 0; v < vertices; ++v) first_[v + 1] += first_[v];
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) incident_[first_[mesh.vertexIndex(t, c)]++] = t * 3 + c;
    // Filling has moved each start to the next vertex's.
    for (std::size_t v = vertices; v > 0; --v) first_[v] = first_[v - 1];
    first_[0] = 0;
}

/// Calls visit(a, b, neighbour) for corners of vertex `v` (as places in its run of incident_) that share the edge to
/// the neighbour. Only corners next to each other in the sorted run of an edge are compared, so that an edge shared by
/// very many triangles stays n log n.
template <class Visit>
void NormalGenerator::forEachPair(const Mesh& mesh, std::size_t v, Visit visit) {
    edges_.clear();
    for (std::uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
        const std::uint32_t t = incident_[i] / 3, c = incident_[i] % 3;
        edges_.emplace_back(mesh.vertexIndex(t, (c + 1) % 3), i - first_[v]);
        edges_.emplace_back(mesh.vertexIndex(t, (c + 2) % 3), i - first_[v]);
    }
    std::sort(edges_.begin(), edges_.end());
    for (std::size_t i = 1; i < edges_.size(); ++i)
        if (edges_[i].first == edges_[i - 1].first) visit(edges_[i].second, edges_[i - 1].second, edges_[i].first);
}

/// Which normal each corner has: the first group of a vertex has the vertex's own place; the others follow behind.
void NormalGenerator::findGroups(const Mesh& mesh) {
    const std::size_t vertices = mesh.positions.size();
    const bool first = incident_.empty();
    if (first) findCorners(mesh);
    const bool known = remember_ && !first;
    if (remember_ && first) pairEnd_.reserve(vertices);
    checks_.clear();
    Array<std::int32_t> index = Array<std::int32_t>::ofSize(std::size_t{mesh.triangleCount} * 3);
    std::int32_t* out = index.mutableData();
    std::size_t values = vertices;
    CornerGroups groups;
    std::vector<std::int32_t> indexOfRoot;
    for (std::size_t v = 0; v < vertices; ++v) {
        const std::uint32_t begin = first_[v], end = first_[v + 1];
        groups.begin(end - begin);
        const auto meet = [&](std::uint32_t a, std::uint32_t b, std::uint32_t neighbour) {
            const std::uint32_t ta = incident_[begin + a] / 3, tb = incident_[begin + b] / 3;
            const bool smooth = isSmooth(ta, tb);
            if (smooth) groups.join(a, b);
            // An edge is met from both its ends.
            if (remember_ && v < neighbour) checks_.push_back({ta, tb, smooth});
        };
        if (known) {
            for (std::uint32_t i = v == 0 ? 0 : pairEnd_[v - 1]; i < pairEnd_[v]; ++i)
                meet(pairs_[i].a, pairs_[i].b, pairs_[i].neighbour);
        } else {
            forEachPair(mesh, v, [&](std::uint32_t a, std::uint32_t b, std::uint32_t neighbour) {
                if (remember_) pairs_.push_back({a, b, neighbour});
                meet(a, b, neighbour);
            });
            if (remember_) pairEnd_.push_back(static_cast<std::uint32_t>(pairs_.size()));
        }
        indexOfRoot.assign(end - begin, -1);
        bool ownSlotTaken = false;
        for (std::uint32_t i = begin; i < end; ++i) {
            std::int32_t& slot = indexOfRoot[groups.root(i - begin)];
            if (slot < 0) slot = static_cast<std::int32_t>(std::exchange(ownSlotTaken, true) ? values++ : v);
            out[incident_[i]] = slot;
        }
    }
    index_ = std::move(index);
    values_ = values;
}

MeshAttribute NormalGenerator::smoothWithinCrease(const Mesh& mesh) {
    findFrames(mesh);
    // A mesh that was seen before keeps its groups as long as every edge is as sharp or smooth as it was.
    bool same = !index_.empty();
    for (std::size_t i = 0; same && i < checks_.size(); ++i)
        same = isSmooth(checks_[i].a, checks_[i].b) == checks_[i].smooth;
    if (!same) findGroups(mesh);
    std::vector<Lanes> sums(values_, Lanes{});
    const std::int32_t* index = index_.data();
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const Lanes normal{normals_[t].x, normals_[t].y, normals_[t].z, 0};
        for (std::size_t k = std::size_t{t} * 3; k < std::size_t{t} * 3 + 3; ++k)
            sums[static_cast<std::size_t>(index[k])] += angles_[k] * normal;
    }
    if (values_ == mesh.positions.size())
        return MeshAttribute(directions(sums), MeshAttribute::Binding::vertex, mesh.triangles, mesh.triangleStride);
    return MeshAttribute(directions(sums), MeshAttribute::Binding::corner, index_, 3);
}

MeshAttribute generateNormals(const Mesh& mesh, float creaseAngle) {
    return NormalGenerator(creaseAngle, false).make(mesh);
}

float checkedCreaseAngle(Mesh& mesh, float creaseAngle) {
    if (creaseAngle >= 0.0f) return creaseAngle;
    warn(mesh, fmt::format("creaseAngle {} is not 0 or more: taken as 0", creaseAngle));
    return 0.0f;
}

}  // namespace rtsg::detail
