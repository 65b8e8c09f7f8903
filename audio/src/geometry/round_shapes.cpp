// Finds spheres, and then follows parallel edges from facet to facet as long as they lie on one circle.
#include "round_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

namespace rtsg {
namespace {

constexpr std::uint32_t kNoRound = MeshEdge::kNotRound;
constexpr double kShapePi = std::numbers::pi;
/// The share of the radius by which corners may be off the circle or the sphere.
constexpr double kOff = 4e-3;
/// A circle has so many edges at least; any three lie on one.
constexpr std::size_t kFewest = 4;
/// A facet beside a round part that is so many times as wide is flat.
constexpr double kFlatBeside = 1.5;
/// If there are no more parallel edges in one mesh, each is tried with each other.
constexpr std::size_t kMaxParallel = 4096;
/// A sphere has so many corners at least.
constexpr std::size_t kFewestCorners = 40;

/// An edge that may be one of many.
struct Gentle {
    std::uint32_t number = 0;  // of the MeshEdge
    glm::dvec3 from{0}, to{0}, axis{0}, faceA{0}, faceB{0}, outward{0};
    double angle = 0;
    bool used = false;
};

glm::dvec3 faceFrom(const Vec3f& position, const Gentle& edge) {
    const glm::dvec3 displacement = glm::dvec3(position) - edge.from,
                     across = displacement - edge.axis * glm::dot(displacement, edge.axis);
    const double length = glm::length(across);
    return length > 0 ? across / length : glm::dvec3(0);
}

std::vector<Gentle> gentleOf(const std::vector<MeshEdge>& edges) {
    std::vector<Gentle> result;
    for (std::uint32_t i = 0; i < edges.size(); ++i) {
        Gentle one;
        one.angle = turnAngle(edges[i]);
        if (one.angle > kMaxRoundRotation) continue;
        one.number = i;
        one.from = edges[i].from;
        one.to = edges[i].to;
        one.axis = glm::normalize(one.to - one.from);
        one.faceA = faceFrom(edges[i].besideA, one);
        one.faceB = faceFrom(edges[i].besideB, one);
        one.outward = glm::normalize(-one.faceA - one.faceB);
        result.push_back(one);
    }
    return result;
}

/// Edges of one direction, and places square to it.
class Parallel {
  public:
    Parallel(std::vector<Gentle*> edges, const glm::dvec3& axis) : edges_(std::move(edges)), axis_(axis) {
        for (const Gentle* edge : edges_) {
            const auto [low, high] = std::minmax({glm::dot(edge->from, axis), glm::dot(edge->to, axis)});
            positions_.push_back({edge->from - axis * glm::dot(edge->from, axis), low, high});
        }
    }

    void find(std::vector<MeshRound>& rounds, std::vector<std::uint32_t>& roundOf) {
        for (auto& next : next_) next.assign(edges_.size(), kNoRound);
        for (std::uint32_t i = 0; i < edges_.size(); ++i) link(i);
        for (std::uint32_t i = 0; i < edges_.size(); ++i) {
            if (edges_[i]->used) continue;
            const std::vector<std::uint32_t> row = rowFrom(i);
            if (row.size() < kFewest) continue;
            if (const std::optional<MeshRound> round = cylinderOf(row)) {
                for (const std::uint32_t one : row) {
                    edges_[one]->used = true;
                    roundOf[edges_[one]->number] = static_cast<std::uint32_t>(rounds.size());
                }
                rounds.push_back(*round);
            }
        }
    }

  private:
    /// An edge's place square to the axis, and where it begins and ends along the axis.
    struct Position {
        glm::dvec3 across{0};
        double low = 0, high = 0;
    };

    /// Looks for the edge at the far end of both facets.
    void link(std::uint32_t i) {
        const Gentle& edge = *edges_[i];
        const Position& at = positions_[i];
        std::array<double, 2> nearest{1e300, 1e300};
        for (std::uint32_t k = 0; k < edges_.size(); ++k) {
            const Gentle& other = *edges_[k];
            if (k == i || !together(at, positions_[k])) continue;
            const glm::dvec3 displacement = positions_[k].across - at.across;
            const double distance = glm::length(displacement);
            for (std::size_t side = 0; side < 2; ++side) {
                const glm::dvec3& face = side == 0 ? edge.faceA : edge.faceB;
                if (!(distance > 0) || distance >= nearest[side] ||
                    glm::dot(displacement, face) < (1 - 1e-5) * distance)
                    continue;
                if (std::min(glm::dot(other.faceA, face), glm::dot(other.faceB, face)) > -1 + 1e-5) continue;
                nearest[side] = distance;
                next_[side][i] = k;
            }
        }
    }
    /// Whether both begin and end together: of the strips of a sphere neighbours do not.
    static bool together(const Position& a, const Position& b) {
        const double maximum = 2e-3 * (a.high - a.low);
        return std::abs(a.low - b.low) < maximum && std::abs(a.high - b.high) < maximum;
    }

    /// Through three places square to the axis; none if they are on a line.
    struct Circle {
        glm::dvec3 center{0};
        double radius = 0;
    };
    Circle circle(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
        const glm::dvec3 p = positions_[a].across, u = positions_[b].across - p, v = positions_[c].across - p;
        const glm::dvec3 n = glm::cross(u, v);
        const double twice = 2 * glm::dot(n, n);
        if (!(twice > 0)) return {};
        const glm::dvec3 off = (glm::dot(u, u) * glm::cross(v, n) + glm::dot(v, v) * glm::cross(n, u)) / twice;
        return {p + off, glm::length(off)};
    }
    bool isOn(const Circle& circle, std::uint32_t i) const {
        const glm::dvec3 displacement = positions_[i].across - circle.center;
        return std::abs(glm::length(displacement) - circle.radius) < kOff * circle.radius &&
               glm::dot(displacement, edges_[i]->outward) > 0.95 * circle.radius;
    }

    double facet(std::uint32_t a, std::uint32_t b) const {
        return glm::distance(positions_[a].across, positions_[b].across);
    }
    static bool isAsWide(double a, double b) { return std::abs(a - b) < 0.1 * std::max(a, b); }

    /// The edges of a possible circle in order, from one edge to both sides; each once if the circle is complete.
    std::vector<std::uint32_t> rowFrom(std::uint32_t i) const {
        const std::uint32_t before = next_[0][i], after = next_[1][i];
        if (before == kNoRound || after == kNoRound || before == after) return {};
        const double wide = facet(i, after);
        std::vector<std::uint32_t> row{i};
        if (!isAsWide(wide, facet(i, before))) return {};
        for (const std::uint32_t first : {after, before}) {
            std::uint32_t last = i, at = first;
            while (at != kNoRound && !edges_[at]->used && std::ranges::find(row, at) == row.end()) {
                // If it continues as an oval, it is no circle; if it ends in something flat, or at an edge, it is.
                const double next = facet(last, at);
                if (next > kFlatBeside * wide) break;
                if (!isAsWide(wide, next)) return {};
                row.push_back(at);
                const std::uint32_t on0 = next_[0][at], on1 = next_[1][at];
                last = std::exchange(at, on0 == last ? on1 : on1 == last ? on0 : kNoRound);
            }
            if (first == after) std::ranges::reverse(row);
        }
        return row;
    }

    std::optional<MeshRound> cylinderOf(const std::vector<std::uint32_t>& row) const {
        const auto n = static_cast<std::uint32_t>(row.size());
        const bool whole = next_[0][row.front()] == row.back() || next_[1][row.front()] == row.back();
        const Circle on = circle(row[0], row[n / 3], row[whole ? 2 * n / 3 : n - 1]);
        MeshRound round;
        RoundBody& body = round.body;
        double low = -1e300, high = 1e300, arc = 0;
        for (std::size_t k = 0; k < row.size(); ++k) {
            if (!isOn(on, row[k])) return {};
            low = std::max(low, positions_[row[k]].low);
            high = std::min(high, positions_[row[k]].high);
            if (k == 0) continue;
            const double facet =
                std::acos(std::clamp(glm::dot(outward(row[k - 1], on), outward(row[k], on)), -1.0, 1.0));
            arc += facet;
            body.facet = std::max(body.facet, facet);
        }
        if (!(high > low) || body.facet > 1.2 * kMaxRoundRotation || !bendsEvenly(row, whole, body.facet)) return {};
        body.center = on.center + axis_ * (0.5 * (low + high));
        body.radius = on.radius;
        body.axis = axis_;
        body.halfLength = 0.5 * (high - low);
        body.halfArc = whole ? kShapePi : 0.5 * arc;
        const glm::dvec3 first = outward(row.front(), on);
        glm::dvec3 side = glm::cross(axis_, first);
        if (glm::dot(side, outward(row[1], on)) < 0) side = -side;
        body.middle = std::cos(body.halfArc) * first + std::sin(body.halfArc) * side;
        return round;
    }
    /// Whether the angle at each edge is that between neighbouring facets, except at the ends of a part.
    bool bendsEvenly(const std::vector<std::uint32_t>& row, bool whole, double facet) const {
        const std::size_t ends = whole ? 0 : 1;
        return std::all_of(row.begin() + static_cast<std::ptrdiff_t>(ends),
                           row.end() - static_cast<std::ptrdiff_t>(ends),
                           [&](std::uint32_t i) { return std::abs(edges_[i]->angle - facet) < 0.35 * facet; });
    }
    glm::dvec3 outward(std::uint32_t i, const Circle& on) const {
        return glm::normalize(positions_[i].across - on.center);
    }

    std::vector<Gentle*> edges_;
    std::vector<Position> positions_;
    glm::dvec3 axis_;
    std::array<std::vector<std::uint32_t>, 2> next_;
};

/// The direction of a line, in steps; it is the same for both ways along the line.
std::array<std::int64_t, 3> roundedDirection(const glm::dvec3& axis) {
    std::array<std::int64_t, 3> steps{};
    int sign = 0;
    for (int i = 0; i < 3; ++i) {
        steps[static_cast<std::size_t>(i)] = std::llround(axis[i] * 1024);
        if (sign == 0 && steps[static_cast<std::size_t>(i)] != 0)
            sign = steps[static_cast<std::size_t>(i)] < 0 ? -1 : 1;
    }
    if (sign < 0)
        for (std::int64_t& step : steps) step = -step;
    return steps;
}

void findCylinders(std::vector<Gentle>& gentle, std::vector<MeshRound>& rounds, std::vector<std::uint32_t>& roundOf) {
    using Direction = std::pair<std::array<std::int64_t, 3>, Gentle*>;
    std::vector<Direction> byDirection;  // and of one direction as they come
    for (Gentle& edge : gentle)
        if (!edge.used) byDirection.emplace_back(roundedDirection(edge.axis), &edge);
    std::ranges::sort(byDirection);
    for (auto first = byDirection.begin(); first != byDirection.end();) {
        const auto last =
            std::find_if(first, byDirection.end(), [&](const Direction& d) { return d.first != first->first; });
        std::vector<Gentle*> edges;
        for (; first != last; ++first) edges.push_back(first->second);
        if (edges.size() < kFewest || edges.size() > kMaxParallel) continue;
        glm::dvec3 axis(0);
        for (const Gentle* edge : edges)
            axis += glm::dot(edge->axis, edges.front()->axis) < 0 ? -edge->axis : edge->axis;
        Parallel(std::move(edges), glm::normalize(axis)).find(rounds, roundOf);
    }
}

/// Edges that hang together by their corners, and what sphere all of them are on.
class Spheres {
  public:
    explicit Spheres(std::vector<Gentle>& gentle) : gentle_(gentle), parent_(gentle.size()) {
        std::iota(parent_.begin(), parent_.end(), 0u);
        std::vector<std::pair<std::array<double, 3>, std::uint32_t>> byCorner;
        byCorner.reserve(2 * gentle.size());
        for (std::uint32_t i = 0; i < gentle.size(); ++i)
            for (const glm::dvec3& p : {gentle[i].from, gentle[i].to}) byCorner.push_back({{p.x, p.y, p.z}, i});
        std::ranges::sort(byCorner);
        for (std::size_t k = 1; k < byCorner.size(); ++k)
            if (byCorner[k].first == byCorner[k - 1].first)
                parent_[root(byCorner[k].second)] = root(byCorner[k - 1].second);
    }

    void find(std::vector<MeshRound>& rounds, std::vector<std::uint32_t>& roundOf) {
        std::map<std::uint32_t, std::vector<std::uint32_t>> parts;
        for (std::uint32_t i = 0; i < gentle_.size(); ++i) parts[root(i)].push_back(i);
        for (const auto& [first, part] : parts)
            if (const std::optional<MeshRound> round = sphereOf(part)) {
                for (const std::uint32_t i : part) {
                    gentle_[i].used = true;
                    roundOf[gentle_[i].number] = static_cast<std::uint32_t>(rounds.size());
                }
                rounds.push_back(*round);
            }
    }

  private:
    std::uint32_t root(std::uint32_t i) {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    /// The middle of the box about it, if it reaches as far on all sides.
    std::optional<MeshRound> sphereOf(const std::vector<std::uint32_t>& part) const {
        if (part.size() < kFewestCorners) return {};
        glm::dvec3 low(1e300), high(-1e300);
        for (const std::uint32_t i : part)
            for (const glm::dvec3& p : {gentle_[i].from, gentle_[i].to})
                low = glm::min(low, p), high = glm::max(high, p);
        MeshRound round;
        RoundBody& body = round.body;
        body.sphere = true;
        body.center = 0.5 * (low + high);
        double sum = 0;
        for (const std::uint32_t i : part)
            sum += glm::distance(gentle_[i].from, body.center) + glm::distance(gentle_[i].to, body.center);
        body.radius = sum / (2.0 * static_cast<double>(part.size()));
        for (const std::uint32_t i : part) {
            const Gentle& edge = gentle_[i];
            for (const glm::dvec3& p : {edge.from, edge.to})
                if (std::abs(glm::distance(p, body.center) - body.radius) > kOff * body.radius) return {};
            if (glm::dot(edge.outward, edge.from - body.center) < 0.8 * body.radius) return {};
            body.facet = std::max(body.facet, edge.angle);
        }
        return round;
    }

    std::vector<Gentle>& gentle_;
    std::vector<std::uint32_t> parent_;
};

}  // namespace

std::vector<MeshRound> roundsOf(std::vector<MeshEdge>& edges) {
    std::vector<MeshRound> rounds;
    std::vector<Gentle> gentle = gentleOf(edges);
    if (gentle.size() < kFewest) return rounds;
    std::vector<std::uint32_t> roundOf(edges.size(), kNoRound);
    Spheres(gentle).find(rounds, roundOf);
    findCylinders(gentle, rounds, roundOf);
    for (std::size_t i = 0; i < edges.size(); ++i) edges[i].round = roundOf[i];
    return rounds;
}

bool placedRound(const MeshRound& round, const WorldFromLocal& m, RoundBody& result) {
    constexpr double kOval = 4e-3;
    result = round.body;
    result.center = m * glm::dvec4(round.body.center, 1);
    const glm::dmat3 linear(m[0], m[1], m[2]);
    const auto sameSize = [&](double a, double b) { return std::abs(a - b) <= kOval * std::max(a, b); };
    if (round.body.sphere) {
        const double scale = glm::length(linear[0]);
        result.radius *= scale;
        const double maximum = kOval * scale * scale;
        return scale > 0 && sameSize(scale, glm::length(linear[1])) && sameSize(scale, glm::length(linear[2])) &&
               std::abs(glm::dot(linear[0], linear[1])) < maximum &&
               std::abs(glm::dot(linear[1], linear[2])) < maximum && std::abs(glm::dot(linear[2], linear[0])) < maximum;
    }
    const glm::dvec3 side = glm::cross(round.body.axis, round.body.middle);
    const glm::dvec3 along = linear * round.body.axis, u = linear * round.body.middle, v = linear * side;
    const double length = glm::length(along), scale = glm::length(u);
    if (!(length > 0) || !(scale > 0) || !sameSize(scale, glm::length(v))) return false;
    if (std::abs(glm::dot(u, v)) > kOval * scale * scale || std::abs(glm::dot(u, along)) > kOval * scale * length ||
        std::abs(glm::dot(v, along)) > kOval * scale * length)
        return false;
    result.axis = along / length;
    result.middle = u / scale;
    result.radius *= scale;
    result.halfLength *= length;
    // Round a disc, as a table's top, sound bends over its rim: with its side as a round body levels are 2 dB farther
    // from boundary elements than with the edges of its facets.
    return result.halfArc < kShapePi || result.halfLength >= result.radius;
}

}  // namespace rtsg
