#include <algorithm>
#include <numbers>

#include <fmt/format.h>

#include "tessellate_detail.h"

namespace rtsg::detail {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// Handbook of Mathematical Functions 4.4.46, error below 2e-8: weights need no more, and std::acos is six times slower.
float fastAcos(float x) {
    const float a = std::min(std::abs(x), 1.0f);
    float p = -0.0012624911f;
    p = p * a + 0.0066700901f;
    p = p * a - 0.0170881256f;
    p = p * a + 0.0308918810f;
    p = p * a - 0.0501743046f;
    p = p * a + 0.0889789874f;
    p = p * a - 0.2145988016f;
    p = p * a + 1.5707963050f;
    p *= std::sqrt(1.0f - a);
    return x < 0 ? kPi - p : p;
}

struct TriangleFrame {
    Vec3f normal{0};  // unit, or zero for a triangle without area
    float angle[3] = {0, 0, 0};
};

TriangleFrame frameOf(const Mesh& mesh, std::uint32_t triangle) {
    TriangleFrame frame;
    const Vec3f a = mesh.vertex(triangle, 0), b = mesh.vertex(triangle, 1), c = mesh.vertex(triangle, 2);
    Vec3f e[3] = {b - a, c - b, a - c};
    float longest = 0, lengths[3];
    for (int i = 0; i < 3; ++i) longest = std::max(longest, lengths[i] = glm::dot(e[i], e[i]));
    double size = 1;
    if (!(longest > 1e-24f && longest < 1e24f)) {
        // Products of such edges leave the range of float: bring the triangle to unit size.
        size = std::max({glm::length(Vec3d(e[0])), glm::length(Vec3d(e[1])), glm::length(Vec3d(e[2]))});
        if (!(size > 0.0)) return frame;
        longest = 0;
        for (int i = 0; i < 3; ++i) {
            e[i] = Vec3f(Vec3d(e[i]) / size);
            longest = std::max(longest, lengths[i] = glm::dot(e[i], e[i]));
        }
    }
    Vec3f n = glm::cross(e[0], -e[2]);
    const float area = std::sqrt(glm::dot(n, n));
    // Cutting polygons leaves slivers between collinear corners. Where the height is below the rounding of the
    // coordinates the direction is noise, and the widest angle would give it the greatest weight.
    const Vec3f offset = glm::abs(a);
    const double reach = std::max({offset.x, offset.y, offset.z}) / size + double{std::sqrt(longest)};
    if (!(area > 4 * double{std::numeric_limits<float>::epsilon()} * std::sqrt(longest) * reach)) return frame;
    frame.normal = n / area;
    for (int i = 0; i < 3; ++i) e[i] /= std::sqrt(lengths[i]);
    frame.angle[0] = fastAcos(-glm::dot(e[0], e[2]));
    frame.angle[1] = fastAcos(-glm::dot(e[1], e[0]));
    frame.angle[2] = std::max(0.0f, kPi - frame.angle[0] - frame.angle[1]);
    return frame;
}

Vec3f unitOrZero(Vec3f n) {
    const float length = std::sqrt(glm::dot(n, n));
    return length > 1e-6f ? n / length : Vec3f(0);
}

MeshAttribute smoothEverywhere(const Mesh& mesh) {
    Array<Vec3f> normals = Array<Vec3f>::ofSize(mesh.positions.size());
    Vec3f* out = normals.mutableData();
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        const TriangleFrame frame = frameOf(mesh, t);
        for (std::uint32_t c = 0; c < 3; ++c) out[mesh.vertexIndex(t, c)] += frame.angle[c] * frame.normal;
    }
    for (std::size_t i = 0; i < normals.size(); ++i) out[i] = unitOrZero(out[i]);
    return MeshAttribute(std::move(normals), MeshAttribute::Binding::vertex, mesh.triangles, mesh.triangleStride);
}

/// The corners around one vertex, joined into groups across their smooth edges.
class CornerGroups {
  public:
    void begin() {
        edges_.clear();
        parent_.clear();
    }
    void addCorner(std::uint32_t neighbourA, std::uint32_t neighbourB) {
        const auto corner = static_cast<std::uint32_t>(parent_.size());
        parent_.push_back(corner);
        edges_.emplace_back(neighbourA, corner);
        edges_.emplace_back(neighbourB, corner);
    }
    /// Only corners next to each other in the sorted run of an edge are compared, so that an edge shared by very
    /// many triangles stays n log n.
    template <class IsSmooth>
    void join(IsSmooth isSmooth) {
        std::sort(edges_.begin(), edges_.end());
        for (std::size_t i = 1; i < edges_.size(); ++i)
            if (edges_[i].first == edges_[i - 1].first && isSmooth(edges_[i].second, edges_[i - 1].second))
                parent_[root(edges_[i].second)] = root(edges_[i - 1].second);
    }
    std::uint32_t root(std::uint32_t corner) {
        while (parent_[corner] != corner) corner = parent_[corner] = parent_[parent_[corner]];
        return corner;
    }

  private:
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges_;
    std::vector<std::uint32_t> parent_;
};

MeshAttribute smoothWithinCrease(const Mesh& mesh, float creaseAngle) {
    const std::size_t vertices = mesh.positions.size();
    const std::uint32_t triangles = mesh.triangleCount;
    std::vector<Vec3f> faceNormals(triangles);
    std::vector<std::uint32_t> first(vertices + 1, 0), incident(std::size_t{triangles} * 3);
    std::vector<float> angles(std::size_t{triangles} * 3);
    for (std::uint32_t t = 0; t < triangles; ++t) {
        const TriangleFrame frame = frameOf(mesh, t);
        faceNormals[t] = frame.normal;
        for (std::uint32_t c = 0; c < 3; ++c) {
            angles[t * 3 + c] = frame.angle[c];
            ++first[mesh.vertexIndex(t, c) + 1];
        }
    }
    for (std::size_t v = 0; v < vertices; ++v) first[v + 1] += first[v];
    // Filling moves each start to the next vertex's start; it is read back shifted by one.
    for (std::uint32_t t = 0; t < triangles; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) incident[first[mesh.vertexIndex(t, c)]++] = t * 3 + c;

    // Chords of unit normals stay exact for small angles, where cosines all round to 1.
    const float chord = 2.0f * std::sin(0.5f * creaseAngle);
    const auto isSmooth = [&](std::uint32_t a, std::uint32_t b) {
        const Vec3f na = faceNormals[a / 3], nb = faceNormals[b / 3];
        if (na == Vec3f(0) || nb == Vec3f(0)) return true;
        const Vec3f d = na - nb;
        return glm::dot(d, d) < chord * chord;
    };

    // The first group of a vertex has the vertex's own place; the others follow behind.
    std::vector<Vec3f> normals(vertices, Vec3f(0));
    Array<std::int32_t> index = Array<std::int32_t>::ofSize(std::size_t{triangles} * 3);
    std::int32_t* out = index.mutableData();
    CornerGroups groups;
    std::vector<std::int32_t> placeOfRoot;
    for (std::size_t v = 0; v < vertices; ++v) {
        const std::uint32_t begin = v == 0 ? 0 : first[v - 1], end = first[v];
        if (begin == end) continue;
        groups.begin();
        for (std::uint32_t i = begin; i < end; ++i) {
            const std::uint32_t t = incident[i] / 3, c = incident[i] % 3;
            groups.addCorner(mesh.vertexIndex(t, (c + 1) % 3), mesh.vertexIndex(t, (c + 2) % 3));
        }
        groups.join(
            [&](std::uint32_t a, std::uint32_t b) { return isSmooth(incident[begin + a], incident[begin + b]); });
        placeOfRoot.assign(end - begin, -1);
        bool ownPlaceTaken = false;
        for (std::uint32_t i = begin; i < end; ++i) {
            std::int32_t& place = placeOfRoot[groups.root(i - begin)];
            if (place < 0) {
                place = static_cast<std::int32_t>(ownPlaceTaken ? normals.size() : v);
                if (ownPlaceTaken) normals.emplace_back(0);
                ownPlaceTaken = true;
            }
            normals[static_cast<std::size_t>(place)] += angles[incident[i]] * faceNormals[incident[i] / 3];
            out[incident[i]] = place;
        }
    }
    for (Vec3f& n : normals) n = unitOrZero(n);
    if (normals.size() == vertices)
        return MeshAttribute(toArray(normals), MeshAttribute::Binding::vertex, mesh.triangles, mesh.triangleStride);
    return MeshAttribute(toArray(normals), MeshAttribute::Binding::corner, std::move(index), 3);
}

}  // namespace

MeshAttribute generateNormals(const Mesh& mesh, float creaseAngle) {
    if (mesh.empty() || !(creaseAngle > 0.0f)) return {};
    return creaseAngle >= kPi ? smoothEverywhere(mesh) : smoothWithinCrease(mesh, creaseAngle);
}

float checkedCreaseAngle(Mesh& mesh, float creaseAngle) {
    if (creaseAngle >= 0.0f) return creaseAngle;
    warn(mesh, fmt::format("creaseAngle {} is not 0 or more: taken as 0", creaseAngle));
    return 0.0f;
}

}  // namespace rtsg::detail
