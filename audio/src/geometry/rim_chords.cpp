// Lays chords along rims, and edges from corner to corner along the sides between them.
#include "rim_chords.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <numbers>
#include <utility>

#include "rim_loops.h"
#include "straight_edges.h"

namespace rtsg {
namespace {

constexpr std::size_t kChords = 12;
/// A closed line that turns by a full turn in all is convex and in a plane (Fenchel); by so much more it may be off.
constexpr double kOffPlane = 0.01;
/// Of the pieces the longest is at most so many times as long as the shortest: else it is a side, as of a round corner.
constexpr double kMostUneven = 3;

using ChordCorners = std::array<glm::dvec3, kChords>;

glm::dvec3 towards(const MeshEdge& edge, const Vec3f& beside) {
    const glm::dvec3 from(edge.from), axis = glm::normalize(glm::dvec3(edge.to) - from);
    const glm::dvec3 way = glm::dvec3(beside) - from, across = way - axis * glm::dot(way, axis);
    const double length = glm::length(across);
    return length > 0 ? across / length : glm::dvec3(0);
}

double turnBetween(const glm::dvec3& a, const glm::dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

/// What stands for edges of a mesh.
struct Chords {
    std::vector<MeshEdge> edges;
    std::vector<MeshRim> rims;

    void add(MeshEdge edge, const glm::dvec3& from, const glm::dvec3& to, MeshRim rim) {
        edge.from = Vec3f(from);
        edge.to = Vec3f(to);
        if (isBefore(edge.to, edge.from)) {
            std::swap(edge.from, edge.to);
            std::ranges::reverse(rim.corners);
        }
        edge.round = MeshEdge::kNotRound;
        edge.rim = static_cast<std::uint32_t>(rims.size());
        edges.push_back(edge);
        rims.push_back(std::move(rim));
    }
};

/// The chords of one rim.
class Rim {
  public:
    Rim(const std::vector<MeshEdge>& edges, RimLoop loop) : edges_(&edges), loop_(std::move(loop)) {}

    bool isRound() {
        const std::size_t count = size();
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

    const RimLoop& loop() const { return loop_; }
    std::size_t size() const { return loop_.pieces.size(); }
    /// The corners of chords.
    const ChordCorners& places() const { return places_; }

    /// In an order of its own; false if there are too few corners at some part of it.
    bool place() {
        // From the corners at which a part of the whole turn is made.
        forwards_ = true;
        for (std::size_t i = 0, at = 0; i < kChords; ++i) {
            const double part = 2 * std::numbers::pi * static_cast<double>(i) / kChords - 1e-3;
            while (at < size() && turned_[at] < part) ++at;
            if (at >= size() || (i > 0 && at == starts_[i - 1])) return false;
            starts_[i] = at;
        }
        setPlaces();
        return true;
    }
    /// In the order of another one, each of whose corners goes with the corner `with[i]` of this one, all in a row.
    void placeAs(const Rim& other, const std::vector<std::size_t>& with) {
        forwards_ = (with[1] == (with[0] + 1) % size()) == other.forwards_;
        starts_ = startsWith(other, with);
        setPlaces();
    }
    bool isPlacedAs(const Rim& other, const std::vector<std::size_t>& with) const {
        return starts_ == startsWith(other, with);
    }

    /// `across`: where round sides lead to from the chords' corners.
    void addChords(const std::vector<ChordCorners>& across, Chords& chords) const {
        for (std::size_t i = 0; i < kChords; ++i) addChord(i, across, chords);
    }
    /// Along a round side; `sideAt`: the edges of the mesh, by corner, of which those at the chords' corners are some.
    void addSide(const ChordCorners& across, const std::vector<std::uint32_t>& sideAt, Chords& chords) const {
        for (std::size_t i = 0; i < kChords; ++i) {
            const std::size_t before = (i + kChords - 1) % kChords, after = (i + 1) % kChords;
            const glm::dvec3 outward = glm::normalize(places_[i] - 0.5 * (places_[before] + places_[after]));
            const double most = std::max(mostInside(before), mostInside(i));
            MeshEdge edge = (*edges_)[sideAt[starts_[i]]];
            edge.besideA = Vec3f(places_[after]);
            edge.besideB = Vec3f(places_[before]);
            MeshRim rim;
            rim.corners = {Vec3f(places_[i]), Vec3f(across[i])};
            rim.out = Vec3f(0.5 * (places_[i] + across[i]) + most * outward);
            rim.facet = {Vec3f(places_[i]), Vec3f(places_[after]), Vec3f(across[after]), Vec3f(across[i])};
            chords.add(edge, places_[i], across[i], std::move(rim));
        }
    }

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
        std::ranges::rotate(loop_.sides, loop_.sides.begin() + by);
    }

    /// Both directions into the surfaces of each piece, in one order; false where they do not go on in each other.
    bool setFaces() {
        for (const std::uint32_t piece : loop_.pieces) {
            const MeshEdge& edge = (*edges_)[piece];
            std::array<glm::dvec3, 2> both{towards(edge, edge.besideA), towards(edge, edge.besideB)};
            if (!faces_.empty()) {
                const auto& last = faces_.back();
                const auto alike = [&](std::size_t a, std::size_t b) {
                    return glm::dot(both[a], last[0]) + glm::dot(both[b], last[1]);
                };
                if (alike(1, 0) > alike(0, 1)) std::swap(both[0], both[1]);
                if (alike(0, 1) < 2 * std::cos(2 * kMostRimTurn)) return false;
            }
            faces_.push_back(both);
        }
        return true;
    }

    static std::array<std::size_t, kChords> startsWith(const Rim& other, const std::vector<std::size_t>& with) {
        std::array<std::size_t, kChords> starts{};
        for (std::size_t i = 0; i < kChords; ++i) starts[i] = with[other.starts_[i]];
        return starts;
    }
    std::size_t startAfter(std::size_t chord) const { return starts_[(chord + 1) % kChords]; }
    /// Calls with each corner from the beginning of a chord on, but its last one, and with the piece from there.
    template <class Call>
    void eachPiece(std::size_t chord, const Call& call) const {
        for (std::size_t at = starts_[chord]; at != startAfter(chord);) {
            const std::size_t next = (at + (forwards_ ? 1 : size() - 1)) % size();
            call(at, forwards_ ? at : next);
            at = next;
        }
    }

    void setPlaces() {
        for (std::size_t i = 0; i < kChords; ++i) {
            const std::size_t before = (i + kChords - 1) % kChords;
            const glm::dvec3 here = corner(starts_[i]);
            const glm::dvec3 middle = 0.5 * (corner(starts_[before]) + corner(startAfter(i)));
            // A chord is inside of its rim by two thirds of the most on average.
            const double inside = (mostInside(before) + mostInside(i)) / 3;
            places_[i] = here + inside * glm::normalize(here - middle);
        }
    }

    /// How far a chord is inside of its rim, metres, at most.
    double mostInside(std::size_t chord) const {
        const glm::dvec3 from = corner(starts_[chord]), axis = glm::normalize(corner(startAfter(chord)) - from);
        double most = 0;
        eachPiece(chord, [&](std::size_t at, std::size_t) {
            const glm::dvec3 way = corner(at) - from;
            most = std::max(most, glm::length(way - axis * glm::dot(way, axis)));
        });
        return most;
    }

    void addChord(std::size_t chord, const std::vector<ChordCorners>& across, Chords& chords) const {
        std::array<glm::dvec3, 2> face{};
        MeshRim rim;
        eachPiece(chord, [&](std::size_t at, std::size_t piece) {
            rim.corners.emplace_back(corner(at));
            for (std::size_t k = 0; k < 2; ++k) face[k] += faces_[piece][k];
        });
        rim.corners.emplace_back(corner(startAfter(chord)));
        const glm::dvec3 from = places_[chord], to = places_[(chord + 1) % kChords], middle = 0.5 * (from + to);
        MeshEdge edge = (*edges_)[loop_.pieces[starts_[chord]]];
        const std::array<Vec3f*, 2> beside{&edge.besideA, &edge.besideB};
        for (std::size_t k = 0; k < 2; ++k)
            *beside[k] = Vec3f(middle + glm::distance(from, to) * glm::normalize(face[k]));
        // The face of a round side has the other rim's chord, too, or the apex; of a sheet both are that.
        for (const ChordCorners& side : across) {
            const glm::dvec3 way = side[chord] - from;
            const double more = glm::dot(way, face[0] - face[1]), rounding = 1e-6 * glm::length(way);
            if (more > -rounding) edge.besideA = Vec3f(side[chord]);
            if (more < rounding) edge.besideB = Vec3f(side[chord]);
        }
        chords.add(edge, from, to, std::move(rim));
    }

    const std::vector<MeshEdge>* edges_;
    RimLoop loop_;
    std::vector<double> turned_;                    // up to each corner
    std::vector<std::array<glm::dvec3, 2>> faces_;  // by piece
    std::array<std::size_t, kChords> starts_{};     // the corner where each chord begins
    bool forwards_ = true;                          // they follow each other as corners do
    ChordCorners places_{};
};

/// From each corner of a rim one edge leads to another rim, or to one place.
struct RoundSide {
    static constexpr std::uint32_t kApex = 0xFFFFFFFF;

    std::uint32_t rim = kApex;
    glm::dvec3 apex{0};
    std::vector<std::uint32_t> edges;  // by corner
    std::vector<std::size_t> with;     // corners of the other rim
};

/// All rims of a mesh, and the round sides between them.
class Rims {
  public:
    explicit Rims(const std::vector<MeshEdge>& edges) : edges_(edges), replaced_(edges.size(), 0) {
        for (RimLoop& loop : rimLoopsOf(edges)) {
            Rim rim(edges, std::move(loop));
            if (rim.isRound()) rims_.push_back(std::move(rim));
        }
        for (std::uint32_t r = 0; r < rims_.size(); ++r)
            for (std::size_t i = 0; i < rims_[r].size(); ++i)
                for (const EdgeEndNumber end : rims_[r].loop().sides[i]) ends_[end] = {r, i};
        for (const Rim& rim : rims_) sides_.push_back(sidesOf(rim));
        done_.resize(rims_.size(), 0);
    }

    Chords chords() {
        Chords result;
        for (std::uint32_t r = 0; r < rims_.size(); ++r) {
            if (done_[r]) continue;
            std::vector<std::uint32_t> together{r};
            const bool all = place(together);
            for (const std::uint32_t one : together) {
                done_[one] = 1;
                if (all)
                    addWithSides(one, result);
                else
                    addAlone(one, result);
            }
        }
        return result;
    }
    bool isReplaced(std::uint32_t edge) const { return replaced_[edge] != 0; }

  private:
    /// None where something else ends at a corner.
    using Sides = std::optional<std::vector<RoundSide>>;

    Sides sidesOf(const Rim& rim) const {
        std::vector<RoundSide> sides;
        for (std::size_t i = 0; i < rim.size(); ++i)
            for (const EdgeEndNumber end : rim.loop().sides[i]) {
                const auto other = ends_.find(end ^ 1);
                RoundSide to;
                if (other == ends_.end())
                    to.apex = cornerOf(edges_, end ^ 1);
                else
                    to.rim = other->second.first;
                auto side = std::ranges::find_if(
                    sides, [&](const RoundSide& one) { return one.rim == to.rim && one.apex == to.apex; });
                if (side == sides.end()) {
                    if (i > 0) return {};
                    side = sides.insert(side, to);
                }
                if (side->edges.size() != i) return {};
                side->edges.push_back(end / 2);
                if (other != ends_.end()) side->with.push_back(other->second.second);
            }
        for (const RoundSide& side : sides)
            if (side.edges.size() != rim.size() || (side.rim != RoundSide::kApex && !isInRow(side))) return {};
        return sides;
    }
    bool isInRow(const RoundSide& side) const {
        const std::size_t count = side.with.size();
        if (rims_[side.rim].size() != count) return false;
        const std::size_t step = side.with[1] == (side.with[0] + 1) % count ? 1 : count - 1;
        for (std::size_t i = 0; i < count; ++i)
            if (side.with[(i + 1) % count] != (side.with[i] + step) % count) return false;
        return true;
    }

    /// A rim, and all that round sides lead to from there; false if not all can be in one order.
    bool place(std::vector<std::uint32_t>& together) {
        bool all = rims_[together.front()].place();
        for (std::size_t at = 0; all && at < together.size(); ++at) {
            const std::uint32_t one = together[at];
            all = sides_[one].has_value();
            if (!all) break;
            for (const RoundSide& side : *sides_[one]) {
                if (side.rim == RoundSide::kApex) continue;
                if (std::ranges::find(together, side.rim) != together.end()) {
                    all = all && rims_[side.rim].isPlacedAs(rims_[one], side.with);
                } else {
                    rims_[side.rim].placeAs(rims_[one], side.with);
                    together.push_back(side.rim);
                }
            }
        }
        return all;
    }

    void addWithSides(std::uint32_t number, Chords& chords) {
        const Rim& rim = rims_[number];
        std::vector<ChordCorners> across;
        for (const RoundSide& side : *sides_[number]) {
            ChordCorners& corners = across.emplace_back();
            if (side.rim == RoundSide::kApex)
                corners.fill(side.apex);
            else
                corners = rims_[side.rim].places();
            for (const std::uint32_t edge : side.edges) replaced_[edge] = 1;
            if (side.rim == RoundSide::kApex || number < side.rim) rim.addSide(corners, side.edges, chords);
        }
        rim.addChords(across, chords);
        for (const std::uint32_t piece : rim.loop().pieces) replaced_[piece] = 1;
    }

    /// Where nothing else ends at its corners but what is flat beside an edge.
    void addAlone(std::uint32_t number, Chords& chords) {
        Rim& rim = rims_[number];
        for (const auto& ends : rim.loop().sides)
            for (const EdgeEndNumber end : ends)
                if (!(turnOf(edges_[end / 2]) < kFlatEdge)) return;
        if (!rim.place()) return;
        rim.addChords({}, chords);
        for (const std::uint32_t piece : rim.loop().pieces) replaced_[piece] = 1;
    }

    const std::vector<MeshEdge>& edges_;
    std::vector<Rim> rims_;
    std::map<EdgeEndNumber, std::pair<std::uint32_t, std::size_t>> ends_;  // of sides: which rim and corner they are at
    std::vector<Sides> sides_;
    std::vector<char> done_, replaced_;
};

}  // namespace

std::vector<MeshRim> rimsOf(const std::vector<MeshEdge>& edges, std::vector<MeshEdge>& withChords) {
    withChords.clear();
    Rims rims(edges);
    Chords chords = rims.chords();
    if (chords.edges.empty()) return {};
    for (std::uint32_t i = 0; i < edges.size(); ++i)
        if (!rims.isReplaced(i)) withChords.push_back(edges[i]);
    withChords.insert(withChords.end(), chords.edges.begin(), chords.edges.end());
    std::ranges::sort(withChords, [](const MeshEdge& a, const MeshEdge& b) {
        return a.from != b.from ? isBefore(a.from, b.from) : isBefore(a.to, b.to);
    });
    return std::move(chords.rims);
}

WallRim placedRim(const MeshRim& rim, const WorldFromLocal& worldFromLocal, const WallEdge& edge) {
    const auto inWorld = [&](const Vec3f& place) {
        return glm::dvec3(worldFromLocal * glm::dvec4(glm::dvec3(place), 1));
    };
    WallRim placed;
    for (const Vec3f& corner : rim.corners) placed.corners.push_back(inWorld(corner));
    for (const Vec3f& corner : rim.facet) placed.facet.push_back(inWorld(corner));
    placed.from = edge.from;
    placed.axis = edge.axis;
    placed.length = edge.length;
    const glm::dvec3 middle = 0.5 * (placed.corners.front() + placed.corners.back());
    if (rim.out) placed.bulge = inWorld(*rim.out) - middle;
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
