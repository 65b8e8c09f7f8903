// Follows edges from corner to corner as long as they go straight on.
#include "straight_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

namespace rtsg {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFF;
/// If more edges end at one place, not all are tried with each other.
constexpr std::size_t kMaxAtCorner = 64;

/// The distance by which single precision may shift a corner, with some to spare.
double roundingOf(const Vec3f& a, const Vec3f& b) {
    double size = 0;
    for (int i = 0; i < 3; ++i)
        size = std::max({size, std::abs(static_cast<double>(a[i])), std::abs(static_cast<double>(b[i]))});
    return 2.5e-7 * size;
}

/// The distance to the line; if both ends of the line are one place, to that.
double distanceToLine(const Vec3f& position, const Vec3f& from, const Vec3f& to) {
    const glm::dvec3 displacement = glm::dvec3(position) - glm::dvec3(from);
    if (from == to) return glm::length(displacement);
    const glm::dvec3 axis = glm::normalize(glm::dvec3(to) - glm::dvec3(from));
    return glm::length(displacement - axis * glm::dot(displacement, axis));
}

/// Unit, in a surface and away from an edge.
glm::dvec3 faceOf(const MeshEdge& edge, const Vec3f& beside) {
    const glm::dvec3 axis = glm::normalize(glm::dvec3(edge.to) - glm::dvec3(edge.from));
    const glm::dvec3 displacement = glm::dvec3(beside) - glm::dvec3(edge.from),
                     across = displacement - axis * glm::dot(displacement, axis);
    const double length = glm::length(across);
    return length > 0 ? across / length : glm::dvec3(0);
}

bool haveSameFaces(const MeshEdge& a, const MeshEdge& b) {
    const std::array<glm::dvec3, 2> of{faceOf(a, a.besideA), faceOf(a, a.besideB)};
    const std::array<glm::dvec3, 2> other{faceOf(b, b.besideA), faceOf(b, b.besideB)};
    const auto same = [&](std::size_t i, std::size_t k) { return glm::dot(of[i], other[k]) > 1 - 1e-6; };
    return (same(0, 0) && same(1, 1)) || (same(0, 1) && same(1, 0));
}

/// Whether `b`, which has a corner with `a` in common, goes straight on from there.
bool goesOn(const MeshEdge& a, const MeshEdge& b, const Vec3f& corner) {
    const Vec3f &from = a.from == corner ? a.to : a.from, &to = b.from == corner ? b.to : b.from;
    const glm::dvec3 in = glm::dvec3(corner) - glm::dvec3(from), out = glm::dvec3(to) - glm::dvec3(corner);
    return glm::dot(in, out) > 0 && distanceToLine(corner, from, to) <= roundingOf(from, to) && haveSameFaces(a, b);
}

/// Edges by the corners where they end.
class Links {
  public:
    explicit Links(const std::vector<MeshEdge>& edges) : edges_(edges), next_(2 * edges.size(), kNone) {
        std::vector<std::uint32_t> ends(2 * edges.size());  // twice the edge, and 1 for its `to`
        for (std::uint32_t i = 0; i < ends.size(); ++i) ends[i] = i;
        std::sort(ends.begin(), ends.end(), [&](std::uint32_t a, std::uint32_t b) {
            return cornerOf(a) != cornerOf(b) ? isBefore(cornerOf(a), cornerOf(b)) : a < b;
        });
        for (std::size_t i = 0; i < ends.size(); ++i)
            for (std::size_t k = i + 1;
                 k < std::min(ends.size(), i + kMaxAtCorner) && cornerOf(ends[k]) == cornerOf(ends[i]); ++k)
                if (next_[ends[i]] == kNone && next_[ends[k]] == kNone &&
                    goesOn(edges_[ends[i] / 2], edges_[ends[k] / 2], cornerOf(ends[i]))) {
                    next_[ends[i]] = ends[k];
                    next_[ends[k]] = ends[i];
                }
    }

    const Vec3f& cornerOf(std::uint32_t end) const { return end % 2 ? edges_[end / 2].to : edges_[end / 2].from; }
    /// The end of another edge that goes on here; kNone if there is none.
    std::uint32_t next(std::uint32_t end) const { return next_[end]; }

  private:
    const std::vector<MeshEdge>& edges_;
    std::vector<std::uint32_t> next_;
};

/// Of corners in a row those between which it goes straight, as Douglas and Peucker find them; `last` of each piece.
void addStraight(const std::vector<Vec3f>& corners, std::size_t first, std::size_t last,
                 std::vector<std::size_t>& ends) {
    std::vector<std::pair<std::size_t, std::size_t>> left{{first, last}};
    while (!left.empty()) {
        const auto [from, to] = left.back();
        left.pop_back();
        std::size_t farthest = 0;
        double maximum = roundingOf(corners[from], corners[to]);
        for (std::size_t i = from + 1; i < to; ++i)
            if (const double off = distanceToLine(corners[i], corners[from], corners[to]); off > maximum) {
                maximum = off;
                farthest = i;
            }
        if (farthest == 0) {
            ends.push_back(to);
            continue;
        }
        left.emplace_back(farthest, to);
        left.emplace_back(from, farthest);
    }
}

}  // namespace

bool isBefore(const Vec3f& a, const Vec3f& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

void joinStraight(std::vector<MeshEdge>& edges) {
    const Links links(edges);
    std::vector<MeshEdge> result;
    std::vector<char> done(edges.size(), 0);
    std::vector<Vec3f> corners;
    std::vector<std::uint32_t> pieces;
    std::vector<std::size_t> ends;
    for (std::uint32_t i = 0; i < edges.size(); ++i) {
        if (done[i]) continue;
        // Goes back to where the edge begins, and from there on; a straight line meets no edge twice.
        std::uint32_t begin = 2 * i;
        for (std::uint32_t other = links.next(begin); other != kNone && other / 2 != i; other = links.next(begin))
            begin = other ^ 1;
        corners = {links.cornerOf(begin)};
        pieces.clear();
        for (std::uint32_t at = begin; at != kNone && !done[at / 2]; at = links.next(at ^ 1)) {
            done[at / 2] = 1;
            pieces.push_back(at / 2);
            corners.push_back(links.cornerOf(at ^ 1));
        }
        ends.clear();
        addStraight(corners, 0, corners.size() - 1, ends);
        std::size_t from = 0;
        for (const std::size_t to : ends) {
            MeshEdge one = edges[pieces[from]];
            one.from = corners[from];
            one.to = corners[to];
            if (isBefore(one.to, one.from)) std::swap(one.from, one.to);
            result.push_back(one);
            from = to;
        }
    }
    std::sort(result.begin(), result.end(), [](const MeshEdge& a, const MeshEdge& b) {
        return a.from != b.from ? isBefore(a.from, b.from) : isBefore(a.to, b.to);
    });
    edges = std::move(result);
}

}  // namespace rtsg
