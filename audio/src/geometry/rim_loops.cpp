// Joins the ends of edges at corners, and follows them until they come back.
#include "rim_loops.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "straight_edges.h"

namespace rtsg {
namespace {

constexpr std::uint32_t kNoPiece = 0xFFFFFFFF;

class RimLinks {
  public:
    explicit RimLinks(const std::vector<MeshEdge>& edges)
        : edges_(edges), next_(2 * edges.size(), kNoPiece), cornerAt_(2 * edges.size()) {
        for (const MeshEdge& edge : edges) turns_.push_back(turnOf(edge));
        std::vector<EdgeEndNumber> ends;
        for (std::uint32_t i = 0; i < edges.size(); ++i)
            if (edges[i].round == MeshEdge::kNotRound) ends.insert(ends.end(), {2 * i, 2 * i + 1});
        std::ranges::sort(ends, [&](EdgeEndNumber a, EdgeEndNumber b) {
            const Vec3f &p = cornerOf(edges, a), &q = cornerOf(edges, b);
            return p != q ? isBefore(p, q) : a < b;
        });
        for (std::size_t i = 0, after = 0; i < ends.size(); i = after) {
            while (after < ends.size() && cornerOf(edges, ends[after]) == cornerOf(edges, ends[i])) ++after;
            link({ends.begin() + static_cast<std::ptrdiff_t>(i), ends.begin() + static_cast<std::ptrdiff_t>(after)});
        }
    }

    /// That an edge is a piece of; false if it is of none.
    bool loopOf(std::uint32_t edge, RimLoop& loop) const {
        loop = {};
        EdgeEndNumber at = 2 * edge;
        do {
            loop.pieces.push_back(at / 2);
            loop.corners.emplace_back(cornerOf(edges_, at));
            loop.sides.push_back(sides_[cornerAt_[at]]);
            at = next_[at ^ 1];
        } while (at != kNoPiece && at != 2 * edge && loop.pieces.size() <= edges_.size());
        return at == 2 * edge;
    }

  private:
    static constexpr std::size_t kMostAtCorner = 4;

    /// Of all that ends at a corner the two that go on in each other, if there are no more: others turn less, as
    /// facets do.
    void link(std::vector<EdgeEndNumber> ends) {
        for (const EdgeEndNumber end : ends) cornerAt_[end] = sides_.size();
        sides_.emplace_back();
        if (ends.size() > kMostAtCorner) std::erase_if(ends, [&](EdgeEndNumber end) { return isFlat(end / 2); });
        if (ends.size() < 2 || ends.size() > kMostAtCorner) return;
        std::array<EdgeEndNumber, 2> both{kNoPiece, kNoPiece};
        int found = 0;
        for (std::size_t i = 0; i < ends.size(); ++i)
            for (std::size_t k = i + 1; k < ends.size(); ++k) {
                if (isFlat(ends[i] / 2) || isFlat(ends[k] / 2) || !goesOnRound(ends[i], ends[k])) continue;
                both = {ends[i], ends[k]};
                ++found;
            }
        std::erase_if(ends, [&](EdgeEndNumber end) { return end == both[0] || end == both[1]; });
        if (found != 1 || std::ranges::any_of(ends, [&](EdgeEndNumber end) { return !isGentle(end / 2); })) return;
        next_[both[0]] = both[1];
        next_[both[1]] = both[0];
        sides_.back() = std::move(ends);
    }
    bool isFlat(std::uint32_t edge) const { return turns_[edge] < kFlatEdge; }
    bool isGentle(std::uint32_t edge) const { return turns_[edge] < kMostRimTurn; }
    /// Away from the corner.
    glm::dvec3 direction(EdgeEndNumber end) const {
        return glm::normalize(glm::dvec3(cornerOf(edges_, end ^ 1)) - glm::dvec3(cornerOf(edges_, end)));
    }
    bool goesOnRound(EdgeEndNumber a, EdgeEndNumber b) const {
        return a / 2 != b / 2 && glm::dot(direction(a), direction(b)) < -std::cos(kMostRimTurn);
    }

    const std::vector<MeshEdge>& edges_;
    std::vector<double> turns_;
    std::vector<EdgeEndNumber> next_;
    std::vector<std::size_t> cornerAt_;              // by end, in `sides_`
    std::vector<std::vector<EdgeEndNumber>> sides_;  // by corner
};

}  // namespace

const Vec3f& cornerOf(const std::vector<MeshEdge>& edges, EdgeEndNumber end) {
    return end % 2 ? edges[end / 2].to : edges[end / 2].from;
}

std::vector<RimLoop> rimLoopsOf(const std::vector<MeshEdge>& edges) {
    const RimLinks links(edges);
    std::vector<char> done(edges.size(), 0);
    std::vector<RimLoop> loops;
    RimLoop loop;
    for (std::uint32_t i = 0; i < edges.size(); ++i) {
        if (done[i] || edges[i].round != MeshEdge::kNotRound) continue;
        const bool closed = links.loopOf(i, loop);
        for (const std::uint32_t piece : loop.pieces) done[piece] = 1;
        if (closed) loops.push_back(std::move(loop));
    }
    return loops;
}

}  // namespace rtsg
