// Finds the shortest ways round pairs of edges, and computes the diffraction at both.
#include "diffraction_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "diffraction_lit_rows.h"
#include "diffraction_pair_path.h"
#include "diffraction_pair_waves.h"
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
            all.pathLength = std::min(all.pathLength, result[i].pathLength);
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

bool isOnBoundary(const EdgeSide& side) {
    return std::abs(side.shadow()) <= kGrazing;
}

/// Off boundaries that it is on.
TwoWedgePath offBoundaries(const PairPath& pairPath, bool firstHides, bool secondHides) {
    // On a face itself sound and its mirror image are one: the other angle it is that moves.
    const auto half = [](bool hides) { return std::numbers::pi + (hides ? 1e-8 : -1e-8); };
    TwoWedgePath path = pairPath.path;
    TwoWedgePath::Wedge &first = path.first, &second = path.second;
    if (isOnBoundary(pairPath.atFirst)) first.in = first.out - std::copysign(half(firstHides), first.out - first.in);
    if (isOnBoundary(pairPath.atSecond))
        second.out = second.in + std::copysign(half(secondHides), second.out - second.in);
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
    bool add(const PairPath& path) {
        const bool firstHides = hides(path.atFirst, *path.second), secondHides = hides(path.atSecond, *path.first);
        BodyWeights::Tones weights = bodies_.of(path.first->body, path.second->body);
        if (!isFreeAlong(geometry_, path) || !reaches(path, firstHides, secondHides, weights)) return false;
        const bool byItself = firstHides && secondHides;
        if (!byItself && !path.onFace && !goesOn(path, firstHides, secondHides)) return false;
        if (path.onFace && (firstHides || secondHides)) {
            const BodyWeights::Tones fraction =
                rowFractionOf(path, source_, firstHides, listener_, secondHides, edges_, c());
            for (std::size_t t = 0; t < kEdgeTones; ++t) weights[t] *= fraction[t];
        }
        PairPath sided = path;
        sided.path = offBoundaries(path, firstHides, secondHides);
        PairField pressure = fieldOf(sided, tones_, c());
        LitRow row;
        const bool inRow = path.onFace && !firstHides && !secondHides &&
                           litRowOf(sided, source_, listener_, edges_, tones_, bodies_, row);
        PairField ofImage = pressure;
        if (inRow) {
            weigh(pressure, row.all);
            weigh(ofImage, row.image);
        } else {
            weigh(pressure, weights);
        }
        const Bent both = bentBy(path, pressure, source_, listener_, options_);
        if (path.onFace && !byItself)
            addImage(path, both.wave,
                     inRow ? bentBy(path, ofImage, source_, listener_, options_).wave.pressure
                           : mirroredOf(both.wave.pressure, path.first->material));
        addWave(both.wave, path.path.pathLength);
        for (const EdgeWave& end : both.ends) ends_.add(end);
        if (byItself && isOnBoundary(path.atFirst) && isOnBoundary(path.atSecond)) takeDirectAway();
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
    bool hides(const EdgeSide& side, const WallEdge& other) const {
        return isOnBoundary(side) ? !alone(other) : side.shadow() > 0;
    }

    /// Whether it comes to both edges from outside; what small bodies let through of it is a factor of `weights`.
    bool reaches(const PairPath& path, bool firstHides, bool secondHides, BodyWeights::Tones& weights) {
        if (isBehindFace(geometry_, *path.first, path.atFirst, false, source_) ||
            isBehindFace(geometry_, *path.second, path.atSecond, true, listener_))
            return false;
        const glm::dvec3 first = offEnds(*path.first, path.byFirst), second = offEnds(*path.second, path.bySecond);
        // In the plane of a face the next one in that plane may hide the edge or not.
        const auto above = [](bool hidden) { return hidden ? -1e-3 : 1e-3; };
        glm::dvec3 source = source_, listener = listener_;
        if (path.onFace && isOnBoundary(path.atFirst))
            source += above(firstHides) * path.atFirst.offFace(*path.first, true);
        if (path.onFace && isOnBoundary(path.atSecond))
            listener += above(secondHides) * path.atSecond.offFace(*path.second, false);
        if (path.atFirst.inOnFace && !alone(*path.first))
            source += above(true) * path.atFirst.offFace(*path.first, false);
        if (path.atSecond.outOnFace && !alone(*path.second))
            listener += above(true) * path.atSecond.offFace(*path.second, true);
        if (seen(geometry_, source, aimAt(*path.first, first, source)) &&
            seen(geometry_, listener, aimAt(*path.second, second, listener)))
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
    bool goesOn(const PairPath& path, bool firstHides, bool secondHides) const {
        if (firstHides != secondHides) {
            const BentByOne* const parent = alone(firstHides ? *path.first : *path.second);
            if (parent && !parent->lit) return true;
        }
        const auto isLit = [&](const WallEdge& edge) {
            const BentByOne* const one = alone(edge);
            return one && one->lit;
        };
        return isLit(*path.first) || isLit(*path.second);
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
    void addImage(const PairPath& path, const EdgeWave& wave, const EdgeTonePressures& pressure) {
        const glm::dvec3 off = path.atFirst.offFace(*path.first, true);
        ImagePart part;
        part.image = source_ - 2 * glm::dot(source_ - path.first->from, off) * off;
        const double distance = glm::distance(part.image, listener_);
        if (!isFaint(wave.pressure, path.path.pathLength)) part.wave = field_.waves.size();
        if (part.wave == ImagePart::kFaint && isFaint(pressure, path.path.pathLength)) return;
        part.seconds = wave.seconds;
        part.direction = wave.direction;
        part.pressure = pressure;
        for (std::size_t b = 0; b < kBandCount; ++b) part.whole[b] = tones_.mirrors(path.first->material, b) / distance;
        parts_.images.push_back(part);
    }
    /// Along a plane of faces it is chance whether a ray finds its way over them, where both edges hide it.
    void takeDirectAway() {
        if (!known_.heardStraight || std::exchange(directTaken_, true)) return;
        const double pathLength = glm::distance(source_, listener_);
        EdgeWave wave = straightWave(source_, listener_, c());
        wave.pressure.fill(static_cast<float>(-1 / pathLength));
        weaken(wave.pressure, options_.pattern ? options_.pattern((listener_ - source_) / pathLength) : 1,
               airAttenuation(options_.air), pathLength);
        addWave(wave, pathLength);
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
    return {edge, beside.pathLengthBy(z), edge.from + edge.axis * z};
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
    std::vector<PairPath> paths;
    for (const EdgeCandidate& first : edges)
        for (const EdgeCandidate& second : edges) {
            if (&first == &second) continue;
            const bool sheet = areOfOneSheet(first.edge, second.edge);
            for (const double side : {1.0, -1.0}) {
                if (!sheet && side < 0) break;
                PairPath path;
                path.first = &first.edge;
                path.second = &second.edge;
                if (sheet) path.side = side * sheetNormal(first.edge);
                if (findPath(sheet ? offSheet(first.edge, source) : source,
                             sheet ? offSheet(second.edge, listener) : listener, known.heardStraight, path) &&
                    path.path.pathLength < longest)
                    paths.push_back(path);
            }
        }
    std::stable_sort(paths.begin(), paths.end(),
                     [](const PairPath& a, const PairPath& b) { return a.path.pathLength < b.path.pathLength; });
    if (paths.size() > kPairs) {
        count.leftOut += paths.size() - kPairs;
        paths.resize(kPairs);
    }
    std::vector<const WallEdge*> all;
    for (const EdgeCandidate& one : edges) all.push_back(&one.edge);
    EdgePairs pairs(geometry, source, listener, options, known, all, bodies, parts, field);
    for (const PairPath& path : paths) count.heard += pairs.add(path);
    pairs.addEnds();
    return count;
}

}  // namespace rtsg
