// Looks for the shortest ways round pairs of edges, and bends sound there twice.
#include "edge_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <initializer_list>
#include <numbers>
#include <utility>

#include "edge_overlaps.h"
#include "edge_pair_waves.h"
#include "edge_pair_way.h"
#include "edge_rows.h"
#include "edge_tones.h"
#include "edge_triples.h"
#include "edge_waves.h"

namespace rtsg {
namespace {

/// Of pairs, the shortest are looked at.
constexpr std::size_t kPairs = 48;

/// Nearer to a boundary than this, in radians, one is on it.
constexpr double kGrazing = 1e-5;

bool isSame(const WallEdge& a, const WallEdge& b) {
    WallEdge both;
    return (a.from == b.from && a.axis == b.axis && a.length == b.length) || joinedEdge(a, b, both);
}

/// Of edges that lie on each other in part one is left, that reaches as far as all.
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
        // What it has joined may reach to another one.
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

/// What is heard of an edge by itself, with all that goes on from there round a second one.
class GoesOn {
  public:
    explicit GoesOn(const BentArrival& part) : part_(part) {}

    bool isOf(const BentArrival& part) const { return &part_ == &part; }
    /// One pair more: a factor of the arrival's energy.
    void add(const PairWay& way, const PairField& field, const EdgeTones& tones, BodyWeights& bodies,
             Arrival& arrival) {
        const BodyWeights::Tones& weights = bodies.of(part_.edge.body);
        for (std::size_t b = 0; b < kBandCount; ++b) {
            const double mirrors = tones.mirrors(part_.edge.material, b);
            double with = 0, without = 0;
            tones.each(b, [&](std::size_t tone, double waveNumber) {
                const WedgeField f = wedgeField(part_.round.path, waveNumber);
                const std::complex<double> before = weights[tone] * (f.besideDirect + mirrors * f.besideMirrored) +
                                                    (part_.lit ? f.direct : 0.0) + more_[tone];
                const std::complex<double> one = field.sum(tone, waveNumber, way.path.way + way.past);
                more_[tone] += one;
                without += std::norm(before);
                with += std::norm(before + one);
            });
            if (without > 0) arrival.energy[b] *= with / without;
        }
    }

  private:
    const BentArrival& part_;
    std::array<std::complex<double>, kEdgeTones> more_{};
};

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

/// The pairs of a source and a listener, one after the other, and what goes on round a third edge.
class EdgePairs {
  public:
    EdgePairs(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
              const TraceOptions& options, const EdgesAlone& known, const std::vector<const WallEdge*>& edges,
              BodyWeights& bodies, std::vector<Arrival>& arrivals, EdgeField& field)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          options_(options),
          tones_(geometry, options.air.speedOfSound),
          known_(known),
          edges_(edges),
          bodies_(bodies),
          arrivals_(arrivals),
          field_(field) {}

    /// Whether it is heard.
    bool add(const PairWay& way) {
        const bool firstHides = hides(way.atFirst, *way.second), secondHides = hides(way.atSecond, *way.first);
        BodyWeights::Tones weights = bodies_.of(way.first->body, way.second->body);
        if (!isFreeAlong(geometry_, way) || !reaches(way, firstHides, secondHides, weights)) return false;
        const bool byItself = firstHides && secondHides;
        const std::vector<const BentArrival*> parts = partsOf(way, firstHides, secondHides);
        if (parts.empty() && !byItself && !way.onFace) return false;
        if (way.onFace && (firstHides || secondHides)) {
            const BodyWeights::Tones share =
                rowShareOf(way, source_, firstHides, listener_, secondHides, edges_, bodies_, c());
            for (std::size_t t = 0; t < kEdgeTones; ++t) weights[t] *= share[t];
        }
        PairWay sided = way;
        sided.path = offBoundaries(way, firstHides, secondHides);
        PairField pressure = fieldOf(sided, tones_, c());
        weigh(pressure, weights);
        weigh(pressure, leftOf({way.first, way.second}));
        Bent both = bentBy(way, pressure, source_, listener_, options_, tones_);
        addWave(both.wave, way.path.way);
        for (const EdgeWave& end : both.ends) ends_.add(end);
        if (byItself && !goOnInLine(way, pressure)) {
            heard_.push_back({&way, arrivals_.size(), way.path.way + way.past, both.scale, pressure});
            addArrival(both.arrival);
        }
        if (!byItself && parts.size() == 1)
            // Where both edges are heard by themselves as well, levels of octaves have what each does to direct sound.
            goingOn(*parts.front()).add(way, pressure, tones_, bodies_, arrivals_[parts.front()->arrival]);
        return true;
    }
    /// What a third edge does to them.
    void add(TripleField triple) {
        weigh(triple.field, bodies_.of(triple.first->body, triple.third->body));
        weigh(triple.field, leftOf({triple.first, triple.second, triple.third}));
        const Bands attenuation = airAttenuation(options_.air);
        const glm::dvec3 last = offEnds(*triple.third, triple.byThird);
        EdgeWave wave;
        wave.order = 3;
        wave.seconds = triple.way / c();
        wave.direction = glm::normalize(last - listener_);
        wave.route = {triple.byFirst, triple.byThird, glm::dvec3(0), glm::dvec3(0)};
        for (std::size_t t = 0; t < kEdgeTones; ++t) wave.pressure[t] = std::complex<float>(triple.field.wave[t]);
        const double sent = options_.pattern ? options_.pattern(glm::normalize(triple.byFirst - source_)) : 1;
        weaken(wave, sent, attenuation, triple.way);
        addWave(wave, triple.way);
        for (const EdgeWave& end : endWaves(triple.field, source_, listener_, options_, 3)) ends_.add(end);
        if (triple.firstHides != triple.thirdHides) return goOnThird(triple);
        if (!triple.firstHides) return;
        Arrival arrival;
        arrival.seconds = wave.seconds;
        arrival.order = 3;
        arrival.direction = wave.direction;
        Bands scale;
        for (std::size_t b = 0; b < kBandCount; ++b)
            scale[b] = sent / (4 * std::numbers::pi) * std::exp(-attenuation[b] * triple.way);
        setEnergies(triple.field, triple.way, tones_, scale, arrival);
        addArrival(arrival);
    }
    /// Of ends those above -54 dB: there are many.
    void addEnds() {
        constexpr double kFaint = 20;
        for (const EdgeWave& end : ends_.waves()) addWave(end, end.seconds * c() / kFaint);
    }

  private:
    /// A pair with an arrival of its own, and all that goes on into that.
    struct Heard {
        const PairWay* pair;
        std::size_t arrival;
        double way;
        Bands scale;  // of its energies
        PairField field;
    };

    double c() const { return options_.air.speedOfSound; }

    /// On a boundary it is chance whether a ray finds its way: that side counts on which the other edge alone is.
    bool hides(const EdgeTurn& turn, const WallEdge& other) const {
        return isOnBoundary(turn) ? !alone(other) : turn.shadow() > 0;
    }

    /// Whether it comes to both edges from outside; what small bodies let through of it is a factor of `weights`.
    bool reaches(const PairWay& way, bool firstHides, bool secondHides, BodyWeights::Tones& weights) {
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

    /// Into the arrival of another pair on one line with it, as of faces in a row, if there is one.
    bool goOnInLine(const PairWay& way, const PairField& field) {
        constexpr double kInLine = 0.99;
        const auto across = [](const PairWay& one) { return glm::normalize(one.bySecond - one.byFirst); };
        const auto known = std::ranges::find_if(heard_, [&](const Heard& one) {
            return (one.pair->first == way.first || one.pair->second == way.second) &&
                   glm::dot(across(*one.pair), across(way)) > kInLine;
        });
        if (!way.onFace || known == heard_.end()) return false;
        goOn(*known, field, way.path.way + way.past);
        return true;
    }
    void goOn(Heard& heard, const PairField& more, double way) {
        for (std::size_t t = 0; t < kEdgeTones; ++t) {
            const double waveNumber = 2 * std::numbers::pi * edgeToneHz(static_cast<double>(t)) / c();
            heard.field.wave[t] += more.sum(t, waveNumber, way) * std::polar(1.0, waveNumber * heard.way);
        }
        setEnergies(heard.field, heard.way, tones_, heard.scale, arrivals_[heard.arrival]);
    }

    GoesOn& goingOn(const BentArrival& part) {
        const auto known = std::ranges::find_if(goingOn_, [&](const GoesOn& one) { return one.isOf(part); });
        return known == goingOn_.end() ? goingOn_.emplace_back(part) : *known;
    }
    /// Into the arrival of the pair of which the third edge takes a part, or which it lets go on.
    void goOnThird(const TripleField& triple) {
        const WallEdge* const first = triple.firstHides ? triple.first : triple.second;
        const WallEdge* const second = triple.firstHides ? triple.second : triple.third;
        const auto heard = std::ranges::find_if(
            heard_, [&](const Heard& one) { return one.pair->first == first && one.pair->second == second; });
        if (heard != heard_.end()) goOn(*heard, triple.field, triple.way);
    }

    const BentArrival* alone(const WallEdge& edge) const {
        const auto found =
            std::ranges::find_if(known_.bent, [&](const BentArrival& one) { return isSame(one.edge, edge); });
        return found == known_.bent.end() ? nullptr : &*found;
    }
    /// The arrivals that it goes on into.
    std::vector<const BentArrival*> partsOf(const PairWay& way, bool firstHides, bool secondHides) const {
        if (firstHides && secondHides) return {};
        if (firstHides != secondHides) {
            const BentArrival* const parent = alone(firstHides ? *way.first : *way.second);
            if (parent && !parent->lit) return {parent};
        }
        std::vector<const BentArrival*> parts;
        for (const WallEdge* edge : {way.first, way.second})
            if (const BentArrival* const one = alone(*edge); one && one->lit) parts.push_back(one);
        return parts;
    }
    /// What edges that are seen in part leave to it.
    BodyWeights::Tones leftOf(std::initializer_list<const WallEdge*> edges) const {
        BodyWeights::Tones left;
        left.fill(1);
        for (const PartlySeen& one : known_.partly)
            if (std::ranges::any_of(edges, [&](const WallEdge* edge) { return isSame(one.edge, *edge); }))
                for (std::size_t t = 0; t < kEdgeTones; ++t) left[t] *= static_cast<double>(one.left[t]);
        return left;
    }
    void addWave(const EdgeWave& wave, double length) {
        if (!isFaint(wave, length)) field_.waves.push_back(wave);
    }
    void addArrival(Arrival arrival) {
        arrival.straight = static_cast<std::int32_t>(field_.straight.size());
        field_.straight.push_back({});
        arrivals_.push_back(arrival);
    }

    const AcousticGeometry& geometry_;
    const glm::dvec3 &source_, &listener_;
    const TraceOptions& options_;
    const EdgeTones tones_;
    const EdgesAlone& known_;
    const std::vector<const WallEdge*>& edges_;
    BodyWeights& bodies_;
    std::vector<Arrival>& arrivals_;
    EdgeField& field_;
    EndWaves ends_;
    std::vector<Heard> heard_;
    std::vector<GoesOn> goingOn_;
};

}  // namespace

EdgeCandidate candidateBy(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener) {
    const glm::dvec3 toSource = source - edge.from, toListener = listener - edge.from;
    const double zs = glm::dot(toSource, edge.axis), zr = glm::dot(toListener, edge.axis);
    const double rs = glm::length(toSource - edge.axis * zs), rr = glm::length(toListener - edge.axis * zr);
    const double z = std::clamp(rs + rr > 0 ? zs + (zr - zs) * rs / (rs + rr) : zs, 0.0, edge.length);
    const glm::dvec3 by = edge.from + edge.axis * z;
    return {edge, glm::distance(source, by) + glm::distance(by, listener), by};
}

EdgePairCount addEdgePairs(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                           const TraceOptions& options, double seconds, const std::vector<EdgeCandidate>& candidates,
                           std::size_t edgeCount, const EdgesAlone& known, BodyWeights& bodies,
                           std::vector<Arrival>& arrivals, EdgeField& field) {
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
            PairWay way;
            way.first = &first.edge;
            way.second = &second.edge;
            if (findWay(source, listener, known.heardStraight, way) && way.path.way < longest) ways.push_back(way);
        }
    std::stable_sort(ways.begin(), ways.end(),
                     [](const PairWay& a, const PairWay& b) { return a.path.way < b.path.way; });
    if (ways.size() > kPairs) {
        count.leftOut += ways.size() - kPairs;
        ways.resize(kPairs);
    }
    std::vector<const WallEdge*> all;
    for (const EdgeCandidate& one : edges) all.push_back(&one.edge);
    EdgePairs pairs(geometry, source, listener, options, known, all, bodies, arrivals, field);
    for (const PairWay& way : ways) count.heard += pairs.add(way);
    const EdgeTones tones(geometry, options.air.speedOfSound);
    for (const TripleField& triple :
         triplesOf(geometry, source, listener, known.heardStraight, all, longest, tones, options.air.speedOfSound))
        pairs.add(triple);
    pairs.addEnds();
    return count;
}

}  // namespace rtsg
