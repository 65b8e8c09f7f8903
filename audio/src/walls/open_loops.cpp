// Chains edges with a single triangle to loops.
#include "open_loops.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace rtsg {
namespace {

using Ends = std::array<std::uint32_t, 2>;

/// Corners by number: those at one place have one.
std::vector<std::uint32_t> weldedCorners(const Mesh& mesh, std::vector<Vec3f>& positions) {
    const std::size_t count = std::size_t{mesh.triangleCount} * 3;
    std::vector<std::uint32_t> order(count), number(count);
    // + 0: there is one zero.
    const auto at = [&](std::uint32_t k) { return mesh.vertex(k / 3, k % 3) + Vec3f(0); };
    for (std::size_t i = 0; i < count; ++i) order[i] = static_cast<std::uint32_t>(i);
    const auto before = [](const Vec3f& a, const Vec3f& b) {
        return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
    };
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return before(at(a), at(b)); });
    for (const std::uint32_t k : order) {
        if (positions.empty() || positions.back() != at(k)) positions.push_back(at(k));
        number[k] = static_cast<std::uint32_t>(positions.size() - 1);
    }
    return number;
}

/// Pairs of corners that one triangle alone connects; sorted.
std::vector<Ends> singleEdges(const std::vector<std::uint32_t>& corners) {
    std::vector<Ends> all;
    for (std::size_t t = 0; t + 2 < corners.size(); t += 3)
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t a = corners[t + c], b = corners[t + (c + 1) % 3];
            if (a != b) all.push_back({std::min(a, b), std::max(a, b)});
        }
    std::sort(all.begin(), all.end());
    std::vector<Ends> single;
    for (std::size_t i = 0; i < all.size();) {
        std::size_t next = i + 1;
        while (next < all.size() && all[next] == all[i]) ++next;
        if (next == i + 1) single.push_back(all[i]);
        i = next;
    }
    return single;
}

/// Whether the way by these goes straight on, or back on itself: as along the edge of a floor whose wall stands on it
/// in two parts.
bool lieOnOneLine(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const glm::dvec3 in = glm::dvec3(b) - glm::dvec3(a), out = glm::dvec3(c) - glm::dvec3(b);
    return glm::length(glm::cross(in, out)) <= 1e-5 * glm::length(in) * glm::length(out);
}

/// A loop's corners where it turns; none if it goes round nothing.
std::vector<Vec3f> windingOf(const std::vector<Vec3f>& loop) {
    std::vector<Vec3f> kept;
    for (const Vec3f& corner : loop) {
        kept.push_back(corner);
        for (std::size_t n = kept.size(); n >= 3 && lieOnOneLine(kept[n - 3], kept[n - 2], kept[n - 1]); --n)
            kept.erase(kept.end() - 2);
    }
    for (std::size_t n = kept.size(); n >= 3; n = kept.size()) {
        if (lieOnOneLine(kept[n - 2], kept[n - 1], kept[0]))
            kept.pop_back();
        else if (lieOnOneLine(kept[n - 1], kept[0], kept[1]))
            kept.erase(kept.begin());
        else
            break;
    }
    return kept;
}

}  // namespace

std::vector<std::vector<Vec3f>> openLoopsOf(const Mesh& mesh) {
    std::vector<std::vector<Vec3f>> loops;
    if (mesh.triangleCount > kMaxTrianglesWithLoops || mesh.isClosed()) return loops;
    std::vector<Vec3f> positions;
    const std::vector<Ends> edges = singleEdges(weldedCorners(mesh, positions));
    std::vector<std::vector<std::uint32_t>> beside(positions.size());  // edges by corner
    for (std::uint32_t i = 0; i < edges.size(); ++i)
        for (const std::uint32_t end : edges[i]) beside[end].push_back(i);
    std::vector<bool> used(edges.size());
    for (std::uint32_t first = 0; first < edges.size(); ++first) {
        if (used[first]) continue;
        used[first] = true;
        std::vector<Vec3f> loop{positions[edges[first][0]]};
        std::uint32_t at = edges[first][1];
        while (at != edges[first][0]) {
            loop.push_back(positions[at]);
            const auto next =
                std::find_if(beside[at].begin(), beside[at].end(), [&](std::uint32_t e) { return !used[e]; });
            if (next == beside[at].end()) break;  // no loop: an edge that three triangles share ends it
            used[*next] = true;
            at = edges[*next][0] == at ? edges[*next][1] : edges[*next][0];
        }
        if (at != edges[first][0]) continue;
        loop = windingOf(loop);
        if (loop.size() >= 3) loops.push_back(std::move(loop));
    }
    return loops;
}

}  // namespace rtsg
