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

/// The places on both edges by which the way is shortest: its length is convex in both, so Newton's steps, halved where
/// they do not shorten it, find them. False if they lie beyond the edges' ends.
bool shortest(const glm::dvec3& source, const glm::dvec3& listener, PairWay& way) {
    const WallEdge &a = *way.first, &b = *way.second;
    double x = 0.5 * a.length, y = 0.5 * b.length;
    const auto length = [&](double i, double j) {
        const glm::dvec3 p = a.from + a.axis * i, q = b.from + b.axis * j;
        return glm::distance(source, p) + glm::distance(p, q) + glm::distance(q, listener);
    };
    double now = length(x, y);
    for (int step = 0; step < 40; ++step) {
        const glm::dvec3 p = a.from + a.axis * x, q = b.from + b.axis * y;
        const double s = glm::distance(source, p), w = glm::distance(p, q), r = glm::distance(q, listener);
        if (!(s > 0 && w > 1e-6 * (s + r) && r > 0)) return false;
        const double sa = glm::dot(p - source, a.axis) / s, wa = glm::dot(q - p, a.axis) / w;
        const double wb = glm::dot(q - p, b.axis) / w, rb = glm::dot(listener - q, b.axis) / r;
        const double between = glm::dot(a.axis, b.axis) - wa * wb;
        const double xx = (1 - sa * sa) / s + (1 - wa * wa) / w, yy = (1 - wb * wb) / w + (1 - rb * rb) / r;
        const double xy = -between / w, slopeX = sa - wa, slopeY = wb - rb, determinant = xx * yy - xy * xy;
        if (!(determinant > 0)) return false;
        const double dx = (slopeY * xy - slopeX * yy) / determinant, dy = (slopeX * xy - slopeY * xx) / determinant;
        if (std::abs(dx) + std::abs(dy) < 1e-7 * now) {
            way.byFirst = p;
            way.bySecond = q;
            way.path.first.sine = std::sqrt(1 - sa * sa);
            way.path.second.sine = std::sqrt(1 - rb * rb);
            setDistances(way.path, s, w, r, between);
            return x >= 0 && x <= a.length && y >= 0 && y <= b.length;
        }
        double share = 1;
        // But for rounding.
        while (!(length(x + share * dx, y + share * dy) <= now * (1 + 1e-14)) && share > 1e-6) share /= 2;
        x += share * dx;
        y += share * dy;
        now = length(x, y);
    }
    return false;
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
