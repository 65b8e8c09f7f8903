// Looks for the shortest ways round pairs of edges, and bends sound there twice.
#include "edge_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "edge_overlaps.h"
#include "edge_tones.h"
#include "edge_waves.h"

namespace rtsg {
namespace {

/// Of pairs, the shortest are looked at.
constexpr std::size_t kPairs = 48;

/// Nearer to a boundary than this, in radians, one is on it.
constexpr double kGrazing = 1e-5;

/// A way round two edges.
struct PairWay {
    const WallEdge* first = nullptr;
    const WallEdge* second = nullptr;
    glm::dvec3 byFirst{0}, bySecond{0};
    EdgeTurn atFirst, atSecond;
    TwoWedgePath path;
    /// Of each edge: how far within it both ends are from the place, metres, negative beyond an end; and half of the
    /// second derivative of the way's length by the place, that of the other edge being the best.
    std::array<double, 2> fromLow{}, fromHigh{}, bend{};
    bool sharesLow[2]{}, sharesHigh[2]{};  // the end is one of the other edge, too
    /// How much longer the way is by the ends that it leads past, metres.
    double past = 0;
};

/// Ways past an end count as far as this share of the edge, at most a metre.
double reachPast(const WallEdge& edge) {
    return std::min(1.0, 0.5 * edge.length);
}

bool isOnePlace(const glm::dvec3& a, const glm::dvec3& b) {
    return glm::distance(a, b) <= 1e-6 * (1 + glm::length(a));
}

void setShared(PairWay& way) {
    const WallEdge* const edges[] = {way.first, way.second};
    for (std::size_t e = 0; e < 2; ++e) {
        const WallEdge &edge = *edges[e], &other = *edges[1 - e];
        const auto shared = [&](const glm::dvec3& end) {
            return isOnePlace(end, other.from) || isOnePlace(end, other.from + other.axis * other.length);
        };
        way.sharesLow[e] = shared(edge.from);
        way.sharesHigh[e] = shared(edge.from + edge.axis * edge.length);
    }
}

/// The complementary error function of sqrt(i x), x >= 0.
std::complex<double> diagonalErfc(double x) {
    if (!(x > 1e-12)) return 1;
    // diffractionTransition() is this times i sqrt(pi x) exp(i x) exp(-i pi / 4).
    return diffractionTransition(x) / std::polar(std::sqrt(std::numbers::pi * x), x + 0.25 * std::numbers::pi);
}

/// By the shortest way from a source round a first edge to a place on a second one.
class WayToPlace {
  public:
    WayToPlace(const glm::dvec3& source, const glm::dvec3& listener, const WallEdge& first, const WallEdge& second)
        : listener_(listener), first_(first), second_(second) {
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
    glm::dvec3 listener_;
    const WallEdge &first_, &second_;
    double along_ = 0, radius_ = 0;
};

/// The places on both edges by which the way is shortest. Its length is convex in both places, so that with the best
/// one on the first edge for each on the second it is so, too, and its growth has one zero, however near the edges come
/// to each other. False if that lies far beyond the edges' ends, or beyond a corner of both.
bool shortest(const glm::dvec3& source, const glm::dvec3& listener, PairWay& way) {
    const WallEdge &a = *way.first, &b = *way.second;
    WayToPlace to(source, listener, a, b);
    setShared(way);
    // A little off the ends: at a corner that both share there is no direction from one to the other.
    constexpr double kOff = 1e-9;
    double low = way.sharesLow[1] ? kOff * b.length : -reachPast(b);
    double high = b.length + (way.sharesHigh[1] ? -kOff * b.length : reachPast(b));
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
    if (!(toFirst > 0 && to.across > 1e-9 * (toFirst + to.out))) return false;
    if (!(to.x >= (way.sharesLow[0] ? 0 : -reachPast(a)) && a.length - to.x >= (way.sharesHigh[0] ? 0 : -reachPast(a))))
        return false;
    way.byFirst = to.byFirst;
    way.bySecond = to.bySecond;
    const glm::dvec3 in = (to.byFirst - source) / toFirst, out = (listener - to.bySecond) / to.out;
    const glm::dvec3 across = (to.bySecond - to.byFirst) / to.across;
    way.path.first.sine = glm::length(glm::cross(in, a.axis));
    way.path.second.sine = glm::length(glm::cross(out, b.axis));
    if (!(way.path.first.sine > 0 && way.path.second.sine > 0)) return false;
    const double between = glm::dot(a.axis, b.axis) - glm::dot(across, a.axis) * glm::dot(across, b.axis);
    setDistances(way.path, toFirst, to.across, to.out, between);
    const auto square = [](double x) { return x * x; };
    const auto squareSine = [&](const glm::dvec3& axis) { return 1 - square(glm::dot(across, axis)); };
    const double xx = square(way.path.first.sine) / toFirst + squareSine(a.axis) / to.across;
    const double yy = square(way.path.second.sine) / to.out + squareSine(b.axis) / to.across;
    const double xy = between / to.across;
    way.bend = {0.5 * std::max(0.0, xx - xy * xy / yy), 0.5 * std::max(0.0, yy - xy * xy / xx)};
    const double y = glm::dot(to.bySecond - b.from, b.axis);
    way.fromLow = {to.x, y};
    way.fromHigh = {a.length - to.x, b.length - y};
    way.past = 0;
    for (std::size_t e = 0; e < 2; ++e)
        way.past += way.bend[e] * square(std::min(0.0, std::min(way.fromLow[e], way.fromHigh[e])));
    return true;
}

/// Of the whole wave that is bent by edges without ends: its share, less the phase of PairWay::past.
std::complex<double> endsShare(const PairWay& way, double waveNumber) {
    using Complex = std::complex<double>;
    Complex share = std::polar(1.0, waveNumber * way.past);
    for (std::size_t e = 0; e < 2; ++e) {
        Complex one = 1;
        for (const auto& [within, shared] :
             {std::pair(way.fromLow[e], way.sharesLow[e]), std::pair(way.fromHigh[e], way.sharesHigh[e])}) {
            const double x = waveNumber * way.bend[e] * within * within;
            if (within >= 0 && x > 60) continue;
            Complex beyond = 0.5 * diagonalErfc(x);
            if (within < 0)
                // It fades towards where ways are not looked for any more.
                one *= beyond * (1 + within / reachPast(e == 0 ? *way.first : *way.second));
            else
                // What comes by the end is another wave, later: where that can be told it is not part of this one.
                one -= beyond * std::exp(-x / 8) * (shared ? 2.0 : 1.0);
        }
        share *= one;
    }
    return share;
}

/// Whether the second edge lies in a face of the first.
bool onFaceOf(const WallEdge& a, const WallEdge& b) {
    const glm::dvec3 way = b.from - a.from;
    const double place = placeRounding(a.from), rounding = 1e-5 * (glm::length(way) + b.length) + 2 * place;
    for (const glm::dvec3& face : {a.faceA, a.faceB}) {
        const glm::dvec3 normal = glm::cross(a.axis, face);
        if (std::abs(glm::dot(way, normal)) < rounding &&
            std::abs(glm::dot(b.axis, normal)) < 1e-5 + 2 * place / b.length)
            return true;
    }
    return false;
}

bool bends(const glm::dvec3& source, const glm::dvec3& listener, bool heardStraight, PairWay& way) {
    const glm::dvec3 across = way.bySecond - way.byFirst;
    if (!turnAt(*way.first, source - way.byFirst, across, way.atFirst) ||
        !turnAt(*way.second, -across, listener - way.bySecond, way.atSecond))
        return false;
    way.path.onOneFace = way.atFirst.outOnFace && way.atSecond.inOnFace;
    // Sound that neither hides is bent by both where it goes along a face; not that which is thrown back.
    constexpr double kBack = -0.5 * std::numbers::pi;
    const bool hidden = way.atFirst.shadow() > 0 || way.atSecond.shadow() > 0;
    if ((heardStraight || !hidden) && !way.path.onOneFace) return false;
    if (way.atFirst.shadow() < kBack || way.atSecond.shadow() < kBack) return false;
    way.path.first.opening = way.atFirst.opening;
    way.path.first.in = way.atFirst.in;
    way.path.first.out = way.atFirst.out;
    way.path.second.opening = way.atSecond.opening;
    way.path.second.in = way.atSecond.in;
    way.path.second.out = way.atSecond.out;
    return true;
}

/// Whether there is air on the whole way. What lies on a face is looked for a little off it.
bool isFree(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
            const PairWay& way) {
    const glm::dvec3 first = offEnds(*way.first, way.byFirst), second = offEnds(*way.second, way.bySecond);
    if (!seen(geometry, source, aimAt(*way.first, first, source)) ||
        !seen(geometry, listener, aimAt(*way.second, second, listener)))
        return false;
    glm::dvec3 off(0);
    if (way.atFirst.outOnFace)
        off = way.atFirst.offFace(*way.first, true);
    else if (way.atSecond.inOnFace)
        off = way.atSecond.offFace(*way.second, false);
    const glm::dvec3 size = glm::max(glm::abs(first), glm::abs(second));
    off *= std::max(1e-3, 1e-5 * std::max({size.x, size.y, size.z}));
    const glm::dvec3 across = second - first;
    const double length = glm::length(across), rounding = std::min(0.25 * length, 1e-5 * (1 + length));
    AcousticHit hit;
    if (geometry.closest(first + off + across * (rounding / length), across / length, length - 2 * rounding, kNoPlane,
                         hit))
        return false;
    return isOpen(geometry, *way.first, first, way.atFirst.opening, way.atFirst.turn) &&
           isOpen(geometry, *way.second, second, way.atSecond.opening, way.atSecond.turn);
}

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

/// What is there by itself, with what goes on round both edges: a factor of its energy. `parts`: of the edges by which
/// alone it comes, each in its shadow by itself, or both, or one, with direct sound.
void goOn(const PairWay& way, const std::vector<const BentArrival*>& parts, const EdgeTones& tones, Arrival& arrival) {
    for (std::size_t b = 0; b < kBandCount; ++b) {
        double with = 0, without = 0;
        tones.each(b, [&](std::size_t, double waveNumber) {
            const double first = tones.mirrors(way.first->material, b), second = tones.mirrors(way.second->material, b);
            std::complex<double> sum = twoWedgeField(way.path, waveNumber, first, second) *
                                       std::polar(1.0, -waveNumber * way.past) * endsShare(way, waveNumber);
            // Each edge has been a factor by itself.
            double product = 1, direct = 0;
            for (const BentArrival* part : parts) {
                const WedgeField f = wedgeField(part->round.path, waveNumber);
                const std::complex<double> by =
                    f.besideDirect + tones.mirrors(part->edge.material, b) * f.besideMirrored;
                if (part->lit && direct == 0) {
                    sum += f.direct;
                    direct = std::norm(f.direct);
                }
                sum += by;
                product *= std::norm(f.direct + by) / (part->lit ? direct : 1);
            }
            with += std::norm(sum);
            without += product * (direct > 0 ? direct : 1);
        });
        if (without > 0) arrival.energy[b] *= with / without;
    }
}

/// The wave that both edges bend, and for an arrival of its own its energies.
struct Bent {
    EdgeWave wave;
    Arrival arrival;
};

Bent bentBy(const PairWay& way, const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options,
            const EdgeTones& tones, const std::array<float, kEdgeTones>& left) {
    const Bands attenuation = airAttenuation(options.air);
    const double length = way.path.way + way.past;
    const glm::dvec3 first = offEnds(*way.first, way.byFirst), second = offEnds(*way.second, way.bySecond);
    Bent bent;
    bent.arrival.seconds = bent.wave.seconds = length / options.air.speedOfSound;
    bent.arrival.order = bent.wave.order = 2;
    bent.arrival.direction = bent.wave.direction = glm::normalize(second - listener);
    // What leads past an end goes by that end.
    const auto axisIf = [&](std::size_t e, const WallEdge& edge) {
        return way.fromLow[e] < 0 || way.fromHigh[e] < 0 ? glm::dvec3(0) : edge.axis;
    };
    bent.wave.route = {axisIf(0, *way.first) == glm::dvec3(0) ? first : way.byFirst,
                       axisIf(1, *way.second) == glm::dvec3(0) ? second : way.bySecond, axisIf(0, *way.first),
                       axisIf(1, *way.second)};
    const double sent = options.pattern ? options.pattern(glm::normalize(first - source)) : 1;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        double energy = 0;
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            const std::complex<double> field =
                static_cast<double>(left[tone]) * endsShare(way, waveNumber) *
                twoWedgeField(way.path, waveNumber, tones.mirrors(way.first->material, b),
                              tones.mirrors(way.second->material, b));
            bent.wave.pressure[tone] = std::complex<float>(field * std::polar(1.0, waveNumber * way.path.way));
            energy += std::norm(field) / EdgeTones::kTones;
        });
        bent.arrival.energy[b] = sent * energy / (4 * std::numbers::pi) * std::exp(-attenuation[b] * length);
    }
    weaken(bent.wave, sent, attenuation, length);
    return bent;
}

}  // namespace

EdgePairCount addEdgePairs(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                           const TraceOptions& options, double seconds, const std::vector<EdgeCandidate>& candidates,
                           std::size_t edgeCount, const std::vector<BentArrival>& bent,
                           const std::vector<PartlySeen>& partly, bool heardStraight, std::vector<Arrival>& arrivals,
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
            if (&first == &second || (heardStraight && !onFaceOf(first.edge, second.edge))) continue;
            PairWay way;
            way.first = &first.edge;
            way.second = &second.edge;
            if (shortest(source, listener, way) && way.path.way < longest &&
                bends(source, listener, heardStraight, way))
                ways.push_back(way);
        }
    std::stable_sort(ways.begin(), ways.end(),
                     [](const PairWay& a, const PairWay& b) { return a.path.way < b.path.way; });
    if (ways.size() > kPairs) {
        count.leftOut += ways.size() - kPairs;
        ways.resize(kPairs);
    }
    const EdgeTones tones(geometry, options.air.speedOfSound);
    const auto addWave = [&](const EdgeWave& wave, double length) {
        if (!isFaint(wave, length)) field.waves.push_back(wave);
    };
    const auto alone = [&](const WallEdge& edge) {
        const auto found = std::ranges::find_if(bent, [&](const BentArrival& one) { return isSame(one.edge, edge); });
        return found == bent.end() ? nullptr : &*found;
    };
    for (const PairWay& way : ways) {
        if (!isFree(geometry, source, listener, way)) continue;
        const bool firstHides = way.atFirst.shadow() > 0, secondHides = way.atSecond.shadow() > 0;
        std::vector<const BentArrival*> parts;
        if (firstHides != secondHides) {
            const BentArrival* const parent = alone(firstHides ? *way.first : *way.second);
            if (parent && !parent->lit) parts = {parent};
        }
        if (parts.empty() && !(firstHides && secondHides))
            for (const WallEdge* edge : {way.first, way.second})
                if (const BentArrival* const one = alone(*edge); one && one->lit) parts.push_back(one);
        // It is chance whether a ray along the boundary finds its way: half of it is left on either side.
        const bool grazes = (firstHides ? way.atSecond : way.atFirst).shadow() > -kGrazing;
        const bool byItself = (firstHides && secondHides) || (parts.empty() && grazes);
        if (parts.empty() && !byItself) continue;
        std::array<float, kEdgeTones> left;
        left.fill(1);
        for (const PartlySeen& one : partly)
            if (isSame(one.edge, *way.first) || isSame(one.edge, *way.second))
                for (std::size_t t = 0; t < kEdgeTones; ++t) left[t] *= one.left[t];
        Bent both = bentBy(way, source, listener, options, tones, left);
        addWave(both.wave, way.path.way);
        ++count.heard;
        if (!byItself) {
            // Where both edges are heard by themselves as well, levels of octaves have what each does to direct sound.
            if (parts.size() == 1) goOn(way, parts, tones, arrivals[parts.front()->arrival]);
            continue;
        }
        both.arrival.straight = static_cast<std::int32_t>(field.straight.size());
        field.straight.push_back({});
        arrivals.push_back(both.arrival);
    }
    return count;
}

}  // namespace rtsg
