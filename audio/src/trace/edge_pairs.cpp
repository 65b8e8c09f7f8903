// Looks for the shortest ways round pairs of edges, and bends sound there twice.
#include "edge_pairs.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "edge_tones.h"
#include "edge_waves.h"

namespace rtsg {
namespace {

/// Of edges, those by which the way is shortest are tried with each other; of pairs, the shortest are looked at.
constexpr std::size_t kEdges = 32, kPairs = 48;

/// Nearer to a boundary than this, in radians, one is on it.
constexpr double kGrazing = 1e-5;

/// A way round two edges.
struct PairWay {
    const WallEdge* first = nullptr;
    const WallEdge* second = nullptr;
    glm::dvec3 byFirst{0}, bySecond{0};
    EdgeTurn atFirst, atSecond;
    TwoWedgePath path;
};

/// By the shortest way from a source round a first edge to a place on a second one.
class WayToPlace {
  public:
    WayToPlace(const glm::dvec3& source, const glm::dvec3& listener, const WallEdge& first, const WallEdge& second)
        : source_(source), listener_(listener), first_(first), second_(second) {
        along_ = glm::dot(source - first.from, first.axis);
        radius_ = glm::length(source - first.from - first.axis * along_);
    }

    /// How the way's length grows with the place on the second edge, at most 2.
    double growthAt(double y) {
        bySecond = second_.from + second_.axis * y;
        const double along = glm::dot(bySecond - first_.from, first_.axis);
        const double radius = glm::length(bySecond - first_.from - first_.axis * along);
        if (!(radius_ + radius > 0)) return 0;
        x = along_ + (along - along_) * radius_ / (radius_ + radius);
        byFirst = first_.from + first_.axis * x;
        across = glm::distance(byFirst, bySecond);
        out = glm::distance(bySecond, listener_);
        if (!(across > 0 && out > 0)) return 0;
        return glm::dot(bySecond - byFirst, second_.axis) / across + glm::dot(bySecond - listener_, second_.axis) / out;
    }

    glm::dvec3 byFirst{0}, bySecond{0};
    double x = 0, across = 0, out = 0;

  private:
    glm::dvec3 source_, listener_;
    const WallEdge &first_, &second_;
    double along_ = 0, radius_ = 0;
};

/// The places on both edges by which the way is shortest. Its length is convex in both places, so that with the best
/// one on the first edge for each on the second it is so, too, and its growth has one zero, however near the edges come
/// to each other. False if that lies beyond the edges' ends.
bool shortest(const glm::dvec3& source, const glm::dvec3& listener, PairWay& way) {
    const WallEdge &a = *way.first, &b = *way.second;
    WayToPlace to(source, listener, a, b);
    // A little off the ends: at a corner that both share there is no direction from one to the other.
    constexpr double kOff = 1e-9;
    double low = kOff * b.length, high = (1 - kOff) * b.length;
    double atLow = to.growthAt(low), atHigh = to.growthAt(high);
    if (!(atLow < 0 && atHigh > 0)) return false;
    // Regula falsi; an end that stays counts half, as in the Illinois method.
    for (int step = 0, stayed = 0; step < 100 && high - low > 1e-10 * b.length; ++step) {
        const double y = (low * atHigh - high * atLow) / (atHigh - atLow);
        const double growth = to.growthAt(y);
        if (std::abs(growth) < 1e-13) break;
        if (growth < 0) {
            low = y;
            atLow = growth;
            if (stayed == 1) atHigh *= 0.5;
            stayed = 1;
        } else {
            high = y;
            atHigh = growth;
            if (stayed == -1) atLow *= 0.5;
            stayed = -1;
        }
    }
    const double toFirst = glm::distance(source, to.byFirst);
    if (!(toFirst > 0 && to.across > 1e-9 * (toFirst + to.out) && to.x >= 0 && to.x <= a.length)) return false;
    way.byFirst = to.byFirst;
    way.bySecond = to.bySecond;
    const glm::dvec3 in = (to.byFirst - source) / toFirst, out = (listener - to.bySecond) / to.out;
    const glm::dvec3 across = (to.bySecond - to.byFirst) / to.across;
    way.path.first.sine = glm::length(glm::cross(in, a.axis));
    way.path.second.sine = glm::length(glm::cross(out, b.axis));
    if (!(way.path.first.sine > 0 && way.path.second.sine > 0)) return false;
    setDistances(way.path, toFirst, to.across, to.out,
                 glm::dot(a.axis, b.axis) - glm::dot(across, a.axis) * glm::dot(across, b.axis));
    return true;
}

bool bends(const glm::dvec3& source, const glm::dvec3& listener, PairWay& way) {
    const glm::dvec3 across = way.bySecond - way.byFirst;
    if (!turnAt(*way.first, source - way.byFirst, across, way.atFirst) ||
        !turnAt(*way.second, -across, listener - way.bySecond, way.atSecond))
        return false;
    // Sound that neither hides is not bent by both.
    if (!(way.atFirst.shadow() > 0) && !(way.atSecond.shadow() > 0)) return false;
    way.path.first.opening = way.atFirst.opening;
    way.path.first.in = way.atFirst.in;
    way.path.first.out = way.atFirst.out;
    way.path.second.opening = way.atSecond.opening;
    way.path.second.in = way.atSecond.in;
    way.path.second.out = way.atSecond.out;
    way.path.onOneFace = way.atFirst.outOnFace && way.atSecond.inOnFace;
    return true;
}

/// Whether there is air on the whole way. What lies on a face is looked for a little off it.
bool isFree(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
            const PairWay& way) {
    if (!seen(geometry, source, way.byFirst) || !seen(geometry, listener, way.bySecond)) return false;
    glm::dvec3 off(0);
    if (way.atFirst.outOnFace)
        off = way.atFirst.offFace(*way.first, true);
    else if (way.atSecond.inOnFace)
        off = way.atSecond.offFace(*way.second, false);
    const glm::dvec3 size = glm::max(glm::abs(way.byFirst), glm::abs(way.bySecond));
    off *= std::max(1e-3, 1e-5 * std::max({size.x, size.y, size.z}));
    const glm::dvec3 across = way.bySecond - way.byFirst;
    const double length = glm::length(across), rounding = std::min(0.25 * length, 1e-5 * (1 + length));
    AcousticHit hit;
    if (geometry.closest(way.byFirst + off + across * (rounding / length), across / length, length - 2 * rounding,
                         kNoPlane, hit))
        return false;
    return isOpen(geometry, *way.first, way.byFirst, way.atFirst.opening, way.atFirst.turn) &&
           isOpen(geometry, *way.second, way.bySecond, way.atSecond.opening, way.atSecond.turn);
}

bool isSame(const WallEdge& a, const WallEdge& b) {
    return a.from == b.from && a.axis == b.axis && a.length == b.length;
}

/// What an edge bends by itself, with a part of what goes on round the other one: a factor of its energy. Gives the
/// share of that part.
double goOn(const PairWay& way, const BentArrival& parent, bool parentIsFirst, const EdgeTones& tones,
            Arrival& arrival) {
    const WedgePath& alone = parent.round.path;
    const double dark = std::abs(alone.receiverAngle - alone.sourceAngle) - std::numbers::pi;
    const double lit = -(parentIsFirst ? way.atSecond : way.atFirst).shadow();
    const double share = dark / (dark + lit);
    if (!(share > 0 && share <= 1)) return 0;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        double with = 0, without = 0;
        tones.each(b, [&](std::size_t, double waveNumber) {
            const double first = tones.mirrors(way.first->material, b), second = tones.mirrors(way.second->material, b);
            const WedgeField f = wedgeField(alone, waveNumber);
            const std::complex<double> by = f.besideDirect + (parentIsFirst ? first : second) * f.besideMirrored;
            with += std::norm(by + share * twoWedgeField(way.path, waveNumber, first, second));
            without += std::norm(by);
        });
        if (without > 0) arrival.energy[b] *= with / without;
    }
    return share;
}

/// The wave that both edges bend, and for an arrival of its own its energies.
struct Bent {
    EdgeWave wave;
    Arrival arrival;
};

Bent bentBy(const PairWay& way, const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options,
            const EdgeTones& tones) {
    const Bands attenuation = airAttenuation(options.air);
    const double length = way.path.way;
    Bent bent;
    bent.arrival.seconds = bent.wave.seconds = length / options.air.speedOfSound;
    bent.arrival.order = bent.wave.order = 2;
    bent.arrival.direction = bent.wave.direction = glm::normalize(way.bySecond - listener);
    const double sent = options.pattern ? options.pattern(glm::normalize(way.byFirst - source)) : 1;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        double energy = 0;
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            const std::complex<double> field = twoWedgeField(
                way.path, waveNumber, tones.mirrors(way.first->material, b), tones.mirrors(way.second->material, b));
            bent.wave.pressure[tone] = std::complex<float>(field * std::polar(1.0, waveNumber * length));
            energy += std::norm(field) / EdgeTones::kTones;
        });
        bent.arrival.energy[b] = sent * energy / (4 * std::numbers::pi) * std::exp(-attenuation[b] * length);
    }
    weaken(bent.wave, sent, attenuation, length);
    return bent;
}

}  // namespace

EdgePairCount addEdgePairs(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                           const TraceOptions& options, double seconds, std::vector<EdgeCandidate> edges,
                           const std::vector<BentArrival>& bent, std::vector<Arrival>& arrivals, EdgeField& field) {
    EdgePairCount count;
    const auto shorter = [](const EdgeCandidate& a, const EdgeCandidate& b) { return a.way < b.way; };
    std::stable_sort(edges.begin(), edges.end(), shorter);
    if (edges.size() > kEdges) {
        count.leftOut = edges.size() * (edges.size() - 1) - kEdges * (kEdges - 1);
        edges.resize(kEdges);
    }
    const double longest = seconds * options.air.speedOfSound;
    std::vector<PairWay> ways;
    for (const EdgeCandidate& first : edges)
        for (const EdgeCandidate& second : edges) {
            if (&first == &second) continue;
            PairWay way;
            way.first = &first.edge;
            way.second = &second.edge;
            if (shortest(source, listener, way) && way.path.way < longest && bends(source, listener, way))
                ways.push_back(way);
        }
    std::stable_sort(ways.begin(), ways.end(),
                     [](const PairWay& a, const PairWay& b) { return a.path.way < b.path.way; });
    if (ways.size() > kPairs) {
        count.leftOut += ways.size() - kPairs;
        ways.resize(kPairs);
    }
    const EdgeTones tones(geometry, options.air.speedOfSound);
    const auto addWave = [&](EdgeWave wave, double share, double length) {
        for (std::complex<float>& tone : wave.pressure) tone *= static_cast<float>(share);
        if (!isFaint(wave, length)) field.waves.push_back(wave);
    };
    const auto addByItself = [&](const PairWay& way) {
        Bent both = bentBy(way, source, listener, options, tones);
        addWave(both.wave, 1, way.path.way);
        both.arrival.straight = static_cast<std::int32_t>(field.straight.size());
        field.straight.push_back({});
        arrivals.push_back(both.arrival);
        ++count.heard;
    };
    for (const PairWay& way : ways) {
        if (!isFree(geometry, source, listener, way)) continue;
        const bool firstHides = way.atFirst.shadow() > 0, secondHides = way.atSecond.shadow() > 0;
        if (firstHides && secondHides) {
            addByItself(way);
            continue;
        }
        const WallEdge& hides = firstHides ? *way.first : *way.second;
        const auto parent = std::ranges::find_if(bent, [&](const BentArrival& one) { return isSame(one.edge, hides); });
        if (parent != bent.end()) {
            const double share = goOn(way, *parent, firstHides, tones, arrivals[parent->arrival]);
            if (share > 0) addWave(bentBy(way, source, listener, options, tones).wave, share, way.path.way);
            ++count.heard;
        } else if ((firstHides ? way.atSecond : way.atFirst).shadow() > -kGrazing) {
            // It is chance whether a ray along the boundary finds its way: half of it is left on either side.
            addByItself(way);
        }
    }
    return count;
}

}  // namespace rtsg
