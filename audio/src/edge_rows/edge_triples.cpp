// Chains a pair of edges and a third one, each way round.
#include "edge_triples.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>

#include "edge_thin_faces.h"

namespace rtsg {
namespace {

/// Of ways round three edges, the shortest are looked at.
constexpr std::size_t kTriples = 32;

/// A pair, and beyond it a third edge that lets through a share of what the pair brings there.
struct Chain {
    PairWay pair;
    const WallEdge* third = nullptr;
    glm::dvec3 byThird{0}, flat{0};
    EdgeTurn atThird;
    double toThird = 0, fromThird = 0, sine = 0;

    TwoWedgePath::Wedge wedge() const {
        TwoWedgePath::Wedge result;
        result.opening = atThird.opening;
        result.in = atThird.in;
        result.out = atThird.out;
        result.whole = toThird * fromThird / (toThird + fromThird) * sine * sine;
        return result;
    }
    std::complex<double> share(double waveNumber, double mirrors) const {
        WedgePath path;
        path.opening = atThird.opening;
        path.sourceAngle = atThird.in;
        path.receiverAngle = atThird.out;
        path.sourceRadius = toThird * sine;
        path.receiverRadius = fromThird * sine;
        path.along = (toThird + fromThird) * std::sqrt(std::max(0.0, 1 - sine * sine));
        const auto [direct, mirrored] = WedgeBend(path).at(waveNumber);
        // On a face sound and its mirror image are one.
        return (direct + mirrors * mirrored) * ((toThird + fromThird) / (1 + mirrors));
    }
};

bool chain(const WallEdge& first, const WallEdge& second, const WallEdge& third, const glm::dvec3& source,
           const glm::dvec3& listener, bool heardStraight, Chain& result) {
    WallEdge part;
    if (!FacePair::seenAcross(second, third, listener, part, result.flat)) return false;
    PairWay& pair = result.pair;
    pair.first = &first;
    pair.second = &part;
    const bool found = findWay(source, result.flat, true, pair);
    pair.second = &second;
    if (!found || !pair.atSecond.outOnFace) return false;
    result.third = &third;
    result.byThird = FacePair::crossing(pair.bySecond, result.flat, third);
    const glm::dvec3 across = result.byThird - pair.bySecond, out = listener - result.byThird;
    result.toThird = glm::length(across);
    result.fromThird = glm::length(out);
    if (!(result.toThird > 1e-9 * result.fromThird && result.fromThird > 0)) return false;
    result.sine = glm::length(glm::cross(across / result.toThird, third.axis));
    if (!(result.sine > 1e-9) || !turnAt(third, -across, out, result.atThird) || !result.atThird.inOnFace) return false;
    constexpr double kWaveNumber = 2.3;
    return pair.flat.strength(pair.path) * std::abs(result.share(kWaveNumber, 1)) > leastOnFace(heardStraight);
}

/// What is chained from the source on, and from the listener back.
struct Triple {
    Chain on, back;
    bool hasOn = false, hasBack = false;

    const Chain& any() const { return hasOn ? on : back; }
    double way() const { return any().pair.path.way; }
};

void add(const Chain& one, const glm::dvec3& source, bool reversed, double weight, const EdgeTones& tones,
         PairField& result) {
    PairField field = fieldOf(one.pair, tones, tones.speedOfSound());
    blendThinFace(one.pair, source, one.flat, tones, field);
    for (FacePair::End& end : field.ends) {
        const glm::dvec3 last = FacePair::crossing(end.second, one.flat, *one.third);
        end.second = reversed ? end.first : last;
        if (reversed) end.first = last;
    }
    for (std::size_t b = 0; b < kBandCount; ++b)
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            const std::complex<double> share = weight * one.share(waveNumber, tones.mirrors(one.third->material, b));
            result.wave[tone] += share * field.wave[tone];
            for (FacePair::End& end : field.ends) end.pressure[tone] *= share;
        });
    result.ends.insert(result.ends.end(), field.ends.begin(), field.ends.end());
}

/// Along a face, a little off it.
bool isFreeAlong(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& to, glm::dvec3 off,
                 const WallEdge& edge) {
    const glm::dvec3 size = glm::max(glm::abs(from), glm::abs(to)), way = to - from;
    off *= std::max({1e-3, 1e-5 * std::max({size.x, size.y, size.z}), 1.1 * edge.bulges(off)});
    const double length = glm::length(way), rounding = std::min(0.25 * length, 1e-5 * (1 + length));
    AcousticHit hit;
    return !geometry.closest(from + off + way * (rounding / length), way / length, length - 2 * rounding, kNoPlane,
                             hit);
}

/// Whether there is air on the whole way of a chain.
bool isFree(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener, const Chain& one) {
    const WallEdge &a = *one.pair.first, &b = *one.pair.second, &c = *one.third;
    const glm::dvec3 first = offEnds(a, one.pair.byFirst), second = offEnds(b, one.pair.bySecond);
    const glm::dvec3 third = offEnds(c, one.byThird);
    return !isBehindFace(geometry, a, one.pair.atFirst, false, source) &&
           !isBehindFace(geometry, c, one.atThird, true, listener) && seen(geometry, source, aimAt(a, first, source)) &&
           seen(geometry, listener, aimAt(c, third, listener)) &&
           isFreeAlong(geometry, first, second, one.pair.atFirst.offFace(a, true), a) &&
           isFreeAlong(geometry, second, third, one.atThird.offFace(c, false), c) &&
           isOpen(geometry, a, first, one.pair.atFirst.opening, one.pair.atFirst.turn) &&
           isOpen(geometry, b, second, one.pair.atSecond.opening, one.pair.atSecond.turn) &&
           isOpen(geometry, c, third, one.atThird.opening, one.atThird.turn);
}

TripleField fieldOf(const Triple& triple, const glm::dvec3& source, const glm::dvec3& listener,
                    const EdgeTones& tones) {
    TripleField result;
    const Chain& one = triple.any();
    result.first = triple.hasOn ? one.pair.first : one.third;
    result.second = one.pair.second;
    result.third = triple.hasOn ? one.third : one.pair.first;
    result.byFirst = triple.hasOn ? one.pair.byFirst : one.byThird;
    result.bySecond = one.pair.bySecond;
    result.byThird = triple.hasOn ? one.byThird : one.pair.byFirst;
    result.firstHides = (triple.hasOn ? one.pair.atFirst : one.atThird).shadow() > 0;
    result.thirdHides = (triple.hasOn ? one.atThird : one.pair.atFirst).shadow() > 0;
    result.way = triple.way();
    double on = triple.hasOn ? 1 : 0;
    if (triple.hasOn && triple.hasBack) {
        TwoWedgePath ends;
        ends.first = triple.back.wedge();
        ends.second = triple.on.wedge();
        on = nearerToSecond(ends);
    }
    if (on > 1e-6) add(triple.on, source, false, on, tones, result.field);
    if (1 - on > 1e-6) add(triple.back, listener, true, 1 - on, tones, result.field);
    return result;
}

}  // namespace

std::vector<TripleField> triplesOf(const AcousticGeometry& geometry, const glm::dvec3& source,
                                   const glm::dvec3& listener, bool heardStraight,
                                   const std::vector<const WallEdge*>& edges, double longest, const EdgeTones& tones) {
    std::vector<Triple> triples;
    for (const WallEdge* second : edges) {
        std::vector<const WallEdge*> beside;
        for (const WallEdge* edge : edges)
            if (edge != second && FacePair::shareFace(*edge, *second)) beside.push_back(edge);
        for (const WallEdge* first : beside)
            for (const WallEdge* third : beside) {
                if (first == third) continue;
                Triple triple;
                triple.hasOn = chain(*first, *second, *third, source, listener, heardStraight, triple.on);
                triple.hasBack = chain(*third, *second, *first, listener, source, heardStraight, triple.back);
                if ((triple.hasOn || triple.hasBack) && triple.way() < longest) triples.push_back(triple);
            }
    }
    std::stable_sort(triples.begin(), triples.end(),
                     [](const Triple& a, const Triple& b) { return a.way() < b.way(); });
    if (triples.size() > kTriples) triples.resize(kTriples);
    std::vector<TripleField> result;
    for (const Triple& triple : triples)
        if (triple.hasOn ? isFree(geometry, source, listener, triple.on)
                         : isFree(geometry, listener, source, triple.back))
            result.push_back(fieldOf(triple, source, listener, tones));
    return result;
}

}  // namespace rtsg
