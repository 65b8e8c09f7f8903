// Finds the shortest ways round pairs of edges, and computes the diffraction at both.
#include "diffraction_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "diffraction_lit_rows.h"
#include "diffraction_pair_waves.h"
#include "diffraction_pair_way.h"
#include "diffraction_rows.h"
#include "edges/diffraction_overlaps.h"
#include "edges/diffraction_waves.h"
#include "response/edge_tones.h"

namespace rtsg {
namespace {

/// The most pairs that are looked at, those with the shortest ways: a bound of work.
constexpr std::size_t kPairs = 48;

/// Within this angle, in radians, one is on a boundary: roundings of single precision turn edges of 2 cm by as much.
constexpr double kGrazing = 1e-5;

bool isSame(const WallEdge& a, const WallEdge& b) {
    WallEdge both;
    return (a.from == b.from && a.axis == b.axis && a.length == b.length) || joinedEdge(a, b, both);
}

/// Joins edges that lie on each other in part into one that reaches as far as all of them.
std::vector<EdgeCandidate> withoutOverlaps(const AcousticGeometry& geometry, const std::vector<EdgeCandidate>& edges,
                                           std::size_t& looked) {
    std::vector<EdgeCandidate> result;
    looked = 0;
    for (std::size_t open = 0; looked < edges.size() && open < 2 * kPairedEdges; ++looked) {
        const EdgeCandidate& edge = edges[looked];
        // An edge that is far off and never heard is no reason to trace again when something is changed there.
        if (!isOpen(geometry.unnoted(), edge.edge, offEnds(edge.edge, edge.by))) continue;
        ++open;
        EdgeCandidate all = edge;
        // The joined edge may reach another one.
        for (std::size_t i = 0; i < result.size();) {
            if (!joinedEdge(all.edge, result[i].edge, all.edge)) {
                ++i;
                continue;
            }
            all.way = std::min(all.way, result[i].way);
            result.erase(result.begin() + static_cast<std::ptrdiff_t>(i));
            i = 0;
        }
        result.push_back(all);
    }
    return result;
}

/// Whether both are rims of one sheet, along each side of which sound goes.
bool areOfOneSheet(const WallEdge& first, const WallEdge& second) {
    return isRim(first) && isRim(second) && FacePair::shareFace(first, second);
}

bool isOnBoundary(const EdgeTurn& turn) {
    return std::abs(turn.shadow()) <= kGrazing;
}

/// Off boundaries that it is on.
TwoWedgePath offBoundaries(const PairWay& way, bool firstHides, bool secondHides) {
    // On a face itself sound and its mirror image are one: the other angle it is that moves.
    const auto half = [](bool hides) { return std::numbers::pi + (hides ? 1e-8 : -1e-8); };
    TwoWedgePath path = way.path;
    TwoWedgePath::Wedge &first = path.first, &second = path.second;
    if (isOnBoundary(way.atFirst)) first.in = first.out - std::copysign(half(firstHides), first.out - first.in);
    if (isOnBoundary(way.atSecond)) second.out = second.in + std::copysign(half(secondHides), second.out - second.in);
    return path;
}

/// The pairs of a source and a listener, one after the other.
class EdgePairs {
  public:
    EdgePairs(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
              const TraceOptions& options, const EdgesAlone& known, const std::vector<const WallEdge*>& edges,
              BodyWeights& bodies, BentParts& parts, EdgeField& field)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          options_(options),
          tones_(geometry, options.air.speedOfSound),
          known_(known),
          edges_(edges),
          bodies_(bodies),
          parts_(parts),
          field_(field) {}

    /// Whether it is heard.
    bool add(const PairWay& way) {
        const bool firstHides = hides(way.atFirst, *way.second), secondHides = hides(way.atSecond, *way.first);
        BodyWeights::Tones weights = bodies_.of(way.first->body, way.second->body);
        if (!isFreeAlong(geometry_, way) || !reaches(way, firstHides, secondHides, weights)) return false;
        const bool byItself = firstHides && secondHides;
        if (!byItself && !way.onFace && !goesOn(way, firstHides, secondHides)) return false;
        if (way.onFace && (firstHides || secondHides)) {
            const BodyWeights::Tones share = rowShareOf(way, source_, firstHides, listener_, secondHides, edges_, c());
            for (std::size_t t = 0; t < kEdgeTones; ++t) weights[t] *= share[t];
        }
        PairWay sided = way;
        sided.path = offBoundaries(way, firstHides, secondHides);
        PairField pressure = fieldOf(sided, tones_, c());
        LitRow row;
        const bool inRow = way.onFace && !firstHides && !secondHides &&
                           litRowOf(sided, source_, listener_, edges_, tones_, bodies_, row);
        PairField ofImage = pressure;
        if (inRow) {
            weigh(pressure, row.all);
            weigh(ofImage, row.image);
        } else {
            weigh(pressure, weights);
        }
        const Bent both = bentBy(way, pressure, source_, listener_, options_);
        if (way.onFace && !byItself)
            addImage(way, both.wave,
                     inRow ? bentBy(way, ofImage, source_, listener_, options_).wave.pressure
                           : mirroredOf(both.wave.pressure, way.first->material));
        addWave(both.wave, way.path.way);
        for (const EdgeWave& end : both.ends) ends_.add(end);
        if (byItself && isOnBoundary(way.atFirst) && isOnBoundary(way.atSecond)) takeDirectAway();
        return true;
    }
    /// Adds the waves of ends above -54 dB, twenty times the bound of isFaint(). They are many, so this bounds the
    /// work.
    void addEnds() {
        constexpr double kFaint = 20;
        for (const EdgeWave& end : ends_.waves()) addWave(end, end.seconds * c() / kFaint);
    }

  private:
    double c() const { return options_.air.speedOfSound; }

    /// On a boundary it is chance whether a ray finds its way: that side counts on which the other edge alone is.
    bool hides(const EdgeTurn& turn, const WallEdge& other) const {
        return isOnBoundary(turn) ? !alone(other) : turn.shadow() > 0;
    }

    /// Whether it comes to both edges from outside; what small bodies let through of it is a factor of `weights`.
    bool reaches(const PairWay& way, bool firstHides, bool secondHides, BodyWeights::Tones& weights) {
        if (isBehindFace(geometry_, *way.first, way.atFirst, false, source_) ||
            isBehindFace(geometry_, *way.second, way.atSecond, true, listener_))
            return false;
        const glm::dvec3 first = offEnds(*way.first, way.byFirst), second = offEnds(*way.second, way.bySecond);
        // In the plane of a face the next one in that plane may hide the edge or not.
        const auto above = [](bool hidden) { return hidden ? -1e-3 : 1e-3; };
        glm::dvec3 source = source_, listener = listener_;
        if (way.onFace && isOnBoundary(way.atFirst))
            source += above(firstHides) * way.atFirst.offFace(*way.first, true);
        if (way.onFace && isOnBoundary(way.atSecond))
            listener += above(secondHides) * way.atSecond.offFace(*way.second, false);
        if (way.atFirst.inOnFace && !alone(*way.first)) source += above(true) * way.atFirst.offFace(*way.first, false);
        if (way.atSecond.outOnFace && !alone(*way.second))
            listener += above(true) * way.atSecond.offFace(*way.second, true);
        if (seen(geometry_, source, aimAt(*way.first, first, source)) &&
            seen(geometry_, listener, aimAt(*way.second, second, listener)))
            return true;
        BodyWeights::Tones before, after;
        if (!bodies_.straightOn(source, first, before) || !bodies_.straightOn(listener, second, after)) return false;
        if (!(before.front() * after.front() < 1)) return false;
        for (std::size_t t = 0; t < kEdgeTones; ++t) weights[t] *= before[t] * after[t];
        return true;
    }

    const BentByOne* alone(const WallEdge& edge) const {
        const auto found =
            std::ranges::find_if(known_.bent, [&](const BentByOne& one) { return isSame(one.edge, edge); });
        return found == known_.bent.end() ? nullptr : &*found;
    }
    /// Whether it is a part of the wave over one of the edges alone.
    bool goesOn(const PairWay& way, bool firstHides, bool secondHides) const {
        if (firstHides != secondHides) {
            const BentByOne* const parent = alone(firstHides ? *way.first : *way.second);
            if (parent && !parent->lit) return true;
        }
        const auto isLit = [&](const WallEdge& edge) {
            const BentByOne* const one = alone(edge);
            return one && one->lit;
        };
        return isLit(*way.first) || isLit(*way.second);
    }
    /// Along a face, direct sound and its image arrive together: the reflected share of both belongs to the image.
    EdgeTonePressures mirroredOf(const EdgeTonePressures& both, std::uint32_t material) const {
        EdgeTonePressures result;
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            const double mirrors = tones_.mirrors(material, t / EdgeTones::kTones);
            result[t] = static_cast<float>(mirrors / (1 + mirrors)) * both[t];
        }
        return result;
    }
    /// Notes `pressure` as the part of a wave, which is to be added, that belongs to the image in the pair's face.
    void addImage(const PairWay& way, const EdgeWave& wave, const EdgeTonePressures& pressure) {
        const glm::dvec3 off = way.atFirst.offFace(*way.first, true);
        ImagePart part;
        part.image = source_ - 2 * glm::dot(source_ - way.first->from, off) * off;
        const double distance = glm::distance(part.image, listener_);
        if (!isFaint(wave.pressure, way.path.way)) part.wave = field_.waves.size();
        if (part.wave == ImagePart::kFaint && isFaint(pressure, way.path.way)) return;
        part.seconds = wave.seconds;
        part.direction = wave.direction;
        part.pressure = pressure;
        for (std::size_t b = 0; b < kBandCount; ++b) part.whole[b] = tones_.mirrors(way.first->material, b) / distance;
        parts_.images.push_back(part);
    }
    /// Along a plane of faces it is chance whether a ray finds its way over them, where both edges hide it.
    void takeDirectAway() {
        if (!known_.heardStraight || std::exchange(directTaken_, true)) return;
        const double way = glm::distance(source_, listener_);
        EdgeWave wave = straightWave(source_, listener_, c());
        wave.pressure.fill(static_cast<float>(-1 / way));
        weaken(wave.pressure, options_.pattern ? options_.pattern((listener_ - source_) / way) : 1,
               airAttenuation(options_.air), way);
        addWave(wave, way);
    }
    void addWave(const EdgeWave& wave, double length) {
        if (!isFaint(wave.pressure, length)) field_.waves.push_back(wave);
    }

    const AcousticGeometry& geometry_;
    const glm::dvec3 &source_, &listener_;
    const TraceOptions& options_;
    const EdgeTones tones_;
    const EdgesAlone& known_;
    const std::vector<const WallEdge*>& edges_;
    BodyWeights& bodies_;
    BentParts& parts_;
    EdgeField& field_;
    EndWaves ends_;
    bool directTaken_ = false;
};

}  // namespace

EdgeCandidate candidateBy(const WallEdge& edge, const BesideEdge& beside) {
    const double z = std::clamp(beside.z, 0.0, edge.length);
    return {edge, beside.wayBy(z), edge.from + edge.axis * z};
}

EdgePairCount addEdgePairs(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                           const TraceOptions& options, double seconds, const std::vector<EdgeCandidate>& candidates,
                           std::size_t edgeCount, const EdgesAlone& known, BodyWeights& bodies, BentParts& parts,
                           EdgeField& field) {
    EdgePairCount count;
    std::size_t looked = 0;
    std::vector<EdgeCandidate> edges = withoutOverlaps(geometry, candidates, looked);
    edgeCount -= looked - edges.size();
    if (edges.size() > kPairedEdges) edges.resize(kPairedEdges);
    count.leftOut = edgeCount * (edgeCount - 1) - edges.size() * (edges.size() - 1);
    const double longest = seconds * options.air.speedOfSound;
    std::vector<PairWay> ways;
    for (const EdgeCandidate& first : edges)
        for (const EdgeCandidate& second : edges) {
            if (&first == &second) continue;
            const bool sheet = areOfOneSheet(first.edge, second.edge);
            for (const double side : {1.0, -1.0}) {
                if (!sheet && side < 0) break;
                PairWay way;
                way.first = &first.edge;
                way.second = &second.edge;
                if (sheet) way.side = side * sheetNormal(first.edge);
                if (findWay(sheet ? offSheet(first.edge, source) : source,
                            sheet ? offSheet(second.edge, listener) : listener, known.heardStraight, way) &&
                    way.path.way < longest)
                    ways.push_back(way);
            }
        }
    std::stable_sort(ways.begin(), ways.end(),
                     [](const PairWay& a, const PairWay& b) { return a.path.way < b.path.way; });
    if (ways.size() > kPairs) {
        count.leftOut += ways.size() - kPairs;
        ways.resize(kPairs);
    }
    std::vector<const WallEdge*> all;
    for (const EdgeCandidate& one : edges) all.push_back(&one.edge);
    EdgePairs pairs(geometry, source, listener, options, known, all, bodies, parts, field);
    for (const PairWay& way : ways) count.heard += pairs.add(way);
    pairs.addEnds();
    return count;
}

}  // namespace rtsg
