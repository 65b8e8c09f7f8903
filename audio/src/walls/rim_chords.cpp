// Follows rims from corner to corner, and lays chords along them.
#include "rim_chords.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "straight_edges.h"

namespace rtsg {
namespace {

constexpr std::uint32_t kNoPiece = 0xFFFFFFFF;
constexpr std::size_t kChords = 12;
constexpr double kMostTurn = 0.27;  // radians, from a piece to the next
/// A closed line that turns by a full turn in all is convex and in a plane (Fenchel); by so much more it may be off.
constexpr double kOffPlane = 0.01;
/// Of the pieces the longest is at most so many times as long as the shortest: else it is a side, as of a round corner.
constexpr double kMostUneven = 3;

glm::dvec3 towards(const MeshEdge& edge, const Vec3f& beside) {
    const glm::dvec3 from(edge.from), axis = glm::normalize(glm::dvec3(edge.to) - from);
    const glm::dvec3 way = glm::dvec3(beside) - from, across = way - axis * glm::dot(way, axis);
    const double length = glm::length(across);
    return length > 0 ? across / length : glm::dvec3(0);
}

/// Pieces that go on in each other, and come back to the first one.
struct Loop {
    std::vector<std::uint32_t> pieces;
    std::vector<glm::dvec3> corners;  // where each piece begins
};

/// The ends of edges by corners: 2 of an edge and 1 for its `to`. Edges between facets of what is round are not told.
class RimLinks {
  public:
    explicit RimLinks(const std::vector<MeshEdge>& edges) : edges_(edges), next_(2 * edges.size(), kNoPiece) {
        std::vector<std::uint32_t> ends;
        for (std::uint32_t i = 0; i < edges.size(); ++i)
            if (edges[i].round == MeshEdge::kNotRound) ends.insert(ends.end(), {2 * i, 2 * i + 1});
        std::ranges::sort(ends, [&](std::uint32_t a, std::uint32_t b) {
            return cornerOf(a) != cornerOf(b) ? isBefore(cornerOf(a), cornerOf(b)) : a < b;
        });
        for (std::size_t i = 0, after = 0; i < ends.size(); i = after) {
            while (after < ends.size() && cornerOf(ends[after]) == cornerOf(ends[i])) ++after;
            if (after - i != 2 || !goesOnRound(ends[i], ends[i + 1])) continue;
            next_[ends[i]] = ends[i + 1];
            next_[ends[i + 1]] = ends[i];
        }
    }

    /// That an edge is a piece of; false if it is of none.
    bool loopOf(std::uint32_t edge, Loop& loop) const {
        loop.pieces.clear();
        loop.corners.clear();
        std::uint32_t at = 2 * edge;
        do {
            loop.pieces.push_back(at / 2);
            loop.corners.emplace_back(cornerOf(at));
            at = next_[at ^ 1];
        } while (at != kNoPiece && at != 2 * edge && loop.pieces.size() <= edges_.size());
        return at == 2 * edge;
    }

  private:
    const Vec3f& cornerOf(std::uint32_t end) const { return end % 2 ? edges_[end / 2].to : edges_[end / 2].from; }
    /// Away from the corner.
    glm::dvec3 direction(std::uint32_t end) const {
        return glm::normalize(glm::dvec3(cornerOf(end ^ 1)) - glm::dvec3(cornerOf(end)));
    }
    bool goesOnRound(std::uint32_t a, std::uint32_t b) const {
        return a / 2 != b / 2 && glm::dot(direction(a), direction(b)) < -std::cos(kMostTurn);
    }

    const std::vector<MeshEdge>& edges_;
    std::vector<std::uint32_t> next_;
};

double turnBetween(const glm::dvec3& a, const glm::dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

/// The chords of one rim.
class Rim {
  public:
    Rim(const std::vector<MeshEdge>& edges, Loop loop) : edges_(edges), loop_(std::move(loop)) {}

    bool isRound() {
        const std::size_t count = loop_.pieces.size();
        if (count < 2 * kChords) return false;
        begin();
        turned_ = {0};
        double all = 0, shortest = glm::distance(corner(0), corner(1)), longest = shortest;
        for (std::size_t i = 0; i < count; ++i) {
            const double length = glm::distance(corner(i), corner(i + 1));
            shortest = std::min(shortest, length);
            longest = std::max(longest, length);
            all += turnBetween(corner(i + 1) - corner(i), corner(i + 2) - corner(i + 1));
            turned_.push_back(all);
        }
        return std::abs(all - 2 * std::numbers::pi) < kOffPlane && longest <= kMostUneven * shortest && setFaces();
    }

    void addChords(std::vector<MeshEdge>& edges, std::vector<MeshRim>& rims) {
        // From the corners at which a part of the whole turn is made; the last one is the first again.
        for (std::size_t i = 0, at = 0; i <= kChords; ++i) {
            const double part = 2 * std::numbers::pi * static_cast<double>(i) / kChords - 1e-3;
            while (at < loop_.pieces.size() && turned_[at] < part) ++at;
            ends_[i] = at;
        }
        if (std::ranges::adjacent_find(ends_) != ends_.end()) return;
        std::array<glm::dvec3, kChords + 1> places;
        for (std::size_t i = 0; i < kChords; ++i) {
            const std::size_t before = (i + kChords - 1) % kChords;
            const glm::dvec3 here = corner(ends_[i]), other = corner(ends_[before]), next = corner(ends_[i + 1]);
            const double inside = 0.5 * (insideOf(before) + insideOf(i));
            places[i] = here + inside * glm::normalize(here - 0.5 * (other + next));
        }
        places[kChords] = places[0];
        for (std::size_t i = 0; i < kChords; ++i) addChord(i, places[i], places[i + 1], edges, rims);
    }

    const std::vector<std::uint32_t>& pieces() const { return loop_.pieces; }

  private:
    glm::dvec3 corner(std::size_t i) const { return loop_.corners[i % loop_.corners.size()]; }

    /// At the corner that is farthest out in a direction in which few are alike: that of a cylinder's other rim, too.
    void begin() {
        const glm::dvec3 direction(0.813, 0.337, 0.475);
        const auto farthest = std::ranges::max_element(
            loop_.corners, {}, [&](const glm::dvec3& place) { return glm::dot(place, direction); });
        const auto by = farthest - loop_.corners.begin();
        std::ranges::rotate(loop_.corners, farthest);
        std::ranges::rotate(loop_.pieces, loop_.pieces.begin() + by);
    }

    /// Both directions into the surfaces of each piece, in one order; false where they do not go on in each other.
    bool setFaces() {
        for (const std::uint32_t piece : loop_.pieces) {
            const MeshEdge& edge = edges_[piece];
            std::array<glm::dvec3, 2> both{towards(edge, edge.besideA), towards(edge, edge.besideB)};
            if (!faces_.empty()) {
                const auto& last = faces_.back();
                const auto alike = [&](std::size_t a, std::size_t b) {
                    return glm::dot(both[a], last[0]) + glm::dot(both[b], last[1]);
                };
                if (alike(1, 0) > alike(0, 1)) std::swap(both[0], both[1]);
                if (alike(0, 1) < 2 * std::cos(2 * kMostTurn)) return false;
            }
            faces_.push_back(both);
        }
        return true;
    }

    /// How far a chord is inside of its rim, metres, on average.
    double insideOf(std::size_t chord) const {
        const glm::dvec3 from = corner(ends_[chord]), axis = glm::normalize(corner(ends_[chord + 1]) - from);
        double most = 0;
        for (std::size_t i = ends_[chord]; i < ends_[chord + 1]; ++i) {
            const glm::dvec3 way = corner(i) - from;
            most = std::max(most, glm::length(way - axis * glm::dot(way, axis)));
        }
        return 2.0 / 3.0 * most;
    }

    void addChord(std::size_t chord, const glm::dvec3& from, const glm::dvec3& to, std::vector<MeshEdge>& edges,
                  std::vector<MeshRim>& rims) const {
        std::array<glm::dvec3, 2> face{};
        MeshRim rim;
        for (std::size_t i = ends_[chord]; i < ends_[chord + 1]; ++i) {
            rim.corners.emplace_back(corner(i));
            for (std::size_t k = 0; k < 2; ++k) face[k] += faces_[i][k];
        }
        rim.corners.emplace_back(corner(ends_[chord + 1]));
        MeshEdge edge = edges_[loop_.pieces[ends_[chord]]];
        edge.from = Vec3f(from);
        edge.to = Vec3f(to);
        const double length = glm::distance(from, to);
        edge.besideA = Vec3f(0.5 * (from + to) + length * glm::normalize(face[0]));
        edge.besideB = Vec3f(0.5 * (from + to) + length * glm::normalize(face[1]));
        if (isBefore(edge.to, edge.from)) {
            std::swap(edge.from, edge.to);
            std::ranges::reverse(rim.corners);
        }
        edge.rim = static_cast<std::uint32_t>(rims.size());
        edges.push_back(edge);
        rims.push_back(std::move(rim));
    }

    const std::vector<MeshEdge>& edges_;
    Loop loop_;
    std::vector<double> turned_;  // up to each corner
    std::vector<std::array<glm::dvec3, 2>> faces_;
    std::array<std::size_t, kChords + 1> ends_{};
};

}  // namespace

std::vector<MeshRim> rimsOf(const std::vector<MeshEdge>& edges, std::vector<MeshEdge>& withChords) {
    withChords.clear();
    std::vector<MeshRim> rims;
    const RimLinks links(edges);
    std::vector<char> done(edges.size(), 0), replaced(edges.size(), 0);
    std::vector<MeshEdge> chords;
    Loop loop;
    for (std::uint32_t i = 0; i < edges.size(); ++i) {
        if (done[i] || edges[i].round != MeshEdge::kNotRound) continue;
        const bool closed = links.loopOf(i, loop);
        for (const std::uint32_t piece : loop.pieces) done[piece] = 1;
        if (!closed) continue;
        Rim rim(edges, std::move(loop));
        const std::size_t known = chords.size();
        if (rim.isRound()) rim.addChords(chords, rims);
        if (chords.size() > known)
            for (const std::uint32_t piece : rim.pieces()) replaced[piece] = 1;
    }
    if (chords.empty()) return rims;
    for (std::uint32_t i = 0; i < edges.size(); ++i)
        if (!replaced[i]) withChords.push_back(edges[i]);
    withChords.insert(withChords.end(), chords.begin(), chords.end());
    std::ranges::sort(withChords, [](const MeshEdge& a, const MeshEdge& b) {
        return a.from != b.from ? isBefore(a.from, b.from) : isBefore(a.to, b.to);
    });
    return rims;
}

WallRim placedRim(const MeshRim& rim, const WorldFromLocal& worldFromLocal, const WallEdge& edge) {
    WallRim placed;
    for (const Vec3f& corner : rim.corners)
        placed.corners.emplace_back(worldFromLocal * glm::dvec4(glm::dvec3(corner), 1));
    placed.from = edge.from;
    placed.axis = edge.axis;
    placed.length = edge.length;
    const glm::dvec3 middle = 0.5 * (placed.corners.front() + placed.corners.back());
    for (const glm::dvec3& corner : placed.corners) {
        const glm::dvec3 way = corner - middle, out = way - edge.axis * glm::dot(way, edge.axis);
        if (glm::dot(out, out) > glm::dot(placed.bulge, placed.bulge)) placed.bulge = out;
    }
    return placed;
}

glm::dvec3 WallRim::at(const glm::dvec3& place) const {
    const glm::dvec3 first = corners.front(), way = corners.back() - first;
    const double part = std::clamp(glm::dot(place - from, axis) / length, 0.0, 1.0);
    const auto along = [&](const glm::dvec3& corner) { return glm::dot(corner - first, way) / glm::dot(way, way); };
    std::size_t i = 1;
    while (i + 1 < corners.size() && along(corners[i]) < part) ++i;
    const double begin = along(corners[i - 1]), end = along(corners[i]);
    return glm::mix(corners[i - 1], corners[i], end > begin ? (part - begin) / (end - begin) : 0.0);
}

}  // namespace rtsg
