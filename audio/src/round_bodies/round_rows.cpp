// Tightens a string round both, looks whether there is air along it, and multiplies what each of them does.
#include "round_rows.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "edge_rows/edge_face_pairs.h"
#include "edges/edge_paths.h"
#include "edges/two_shadows.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
/// So many bodies, nearest to the straight way, are tried with each other and with edges.
constexpr std::size_t kRowBodies = 5;
/// Of ways by two edges along a face, the shortest are tried with bodies.
constexpr std::size_t kRowPairs = 6;
/// Of pressures re the source in the open, less does not count.
constexpr double kFaintRow = 1e-3, kFaintLit = 1e-3;

/// By some of the tones, whether all of them will be: most that is found is, and all tones of it take far longer.
template <class Pressure>
bool looksFaint(const EdgeTones& tones, const Pressure& pressure, double way) {
    constexpr std::size_t kEvery = 2;  // octaves
    constexpr double kBetween = 0.5;
    for (std::size_t b = 0; b < kBandCount; b += kEvery) {
        const double waveNumber =
            2 * std::numbers::pi * edgeToneHz(double(b * EdgeTones::kTones)) / tones.speedOfSound();
        if (std::abs(pressure(b, waveNumber)) * way >= kBetween * kFaintRow) return false;
    }
    return true;
}

bool isFaint(const RoundWave& wave) {
    return std::ranges::all_of(wave.pressure, [&](const Complex& one) { return std::abs(one) * wave.way < kFaintRow; });
}

/// How much counts of what is beside a way: not what throws sound back.
double besideShare(const glm::dvec3& from, const glm::dvec3& place, const glm::dvec3& to) {
    const glm::dvec3 in = place - from, out = to - place;
    const double cosine = glm::dot(in, out) / std::max(1e-12, glm::length(in) * glm::length(out));
    const double part = std::clamp(cosine * std::numbers::sqrt2, 0.0, 1.0);  // from a right angle to half of one
    return part * part * (3 - 2 * part);
}

/// How much places on both are correlated: by the three parts of the way and the directions off both.
double correlation(double before, double between, double after, const glm::dvec3& off, const glm::dvec3& other) {
    return std::sqrt(before * after / ((before + between) * (between + after))) * glm::dot(off, other);
}

/// On one axis, as a column's foot and its shaft: no string leads from the one to the other.
bool areOnOneAxis(const RoundBody& a, const RoundBody& b) {
    constexpr double kOff = 0.05;
    const glm::dvec3 way = b.center - a.center;
    if (a.sphere || b.sphere || glm::length(glm::cross(a.axis, b.axis)) > kOff) return false;
    return glm::length(way - a.axis * glm::dot(way, a.axis)) < kOff * std::max(a.radius, b.radius);
}

/// As the rim of a cylinder's flat end is, or a facet's edge.
bool isOnBody(const WallEdge& edge, const RoundBody& body) {
    const auto isOn = [&](const glm::dvec3& place) {
        glm::dvec3 way = place - body.center;
        if (!body.sphere) {
            const double along = glm::dot(way, body.axis);
            if (std::abs(along) > body.halfLength * (1 + 1e-3)) return false;
            way -= body.axis * along;
        }
        return std::abs(glm::length(way) - body.radius) < 1e-2 * body.radius;
    };
    return isOn(edge.from) && isOn(edge.from + edge.axis * edge.length);
}

}  // namespace

/// A string round both: each as seen from where the other one is left or touched, and from where source and listener
/// were if the other one did not bend it.
struct RoundRows::Row {
    const BendingLink &first, &second;
    LinkWay atFirst, atSecond;        // from the source to the second, from the first to the listener
    LinkWay wholeFirst, wholeSecond;  // with the rest of the way straightened
    double between = 0, way = 0;      // m
};

bool RoundRows::findRow(Row& row) const {
    constexpr int kSteps = 60;
    std::optional<LinkWay> first, second = row.second.way(source_, listener_);
    // Of a thick wall an edge alone may have the source, or the listener, behind a face of its own.
    if (!second && !row.second.edge()) return false;
    const WallEdge* const edge = row.second.edge();
    const glm::dvec3 near = second ? second->first : candidateBy(*edge, BesideEdge(*edge, source_, listener_)).by;
    glm::dvec3 target = second && second->lit ? listener_ : near;
    for (int step = 0; step < kSteps; ++step) {
        first = row.first.way(source_, target);
        if (!first && step == 0) first = row.first.way(source_, near);
        if (!first) return false;
        second = row.second.way(first->lit ? source_ : first->last, listener_);
        if (!second) return false;
        const glm::dvec3 next = second->lit ? listener_ : second->first;
        const double moved = glm::distance(next, target);
        target = next;
        if (moved < 1e-9 * (first->length + second->length)) break;
    }
    row.atFirst = *first;
    row.atSecond = *second;
    if (first->lit || second->lit) return true;
    if (!first->there || !second->there) return false;
    const glm::dvec3 over = second->first - first->last;
    row.between = glm::length(over);
    row.way = first->length + second->length - row.between;
    if (!(row.between > 0)) return false;
    const auto wholeSecond = row.second.way(second->first - over * (first->length / row.between), listener_);
    const auto wholeFirst = row.first.way(source_, first->last + over * (second->length / row.between));
    if (!wholeFirst || !wholeSecond) return false;
    row.wholeFirst = *wholeFirst;
    row.wholeSecond = *wholeSecond;
    return true;
}

bool RoundRows::isClear(const glm::dvec3& from, const BendingLink* leaving, const glm::dvec3& to,
                        const BendingLink* coming) const {
    // Of an edge a place in the air beside it.
    const auto aimed = [](const WallEdge* edge, const glm::dvec3& place, const glm::dvec3& other) {
        return edge ? aimAt(*edge, offEnds(*edge, place), other) : place;
    };
    const RoundBody* const one = leaving ? leaving->body() : nullptr;
    const RoundBody* const other = coming ? coming->body() : nullptr;
    // Looked at from the place that is on no edge, as an edge is as good as seen a little before it.
    if (leaving && leaving->edge()) return air_.isClear(to, aimed(leaving->lastEdge(), from, to), one, other);
    return air_.isClear(from, aimed(coming ? coming->edge() : nullptr, to, from), one, other);
}

bool RoundRows::isFreeAlong(const LinkWay& way, double offset) const {
    if (way.pair) return rtsg::isFreeAlong(air_.geometry(), *way.pair);
    return !way.side || air_.isFreeAlong(*way.side, offset);
}

bool RoundRows::isFree(const BendingLink& link, const LinkWay& way, const glm::dvec3& from,
                       const glm::dvec3& to) const {
    return isClear(from, nullptr, way.first, &link) && isClear(way.last, &link, to, nullptr) && isFreeAlong(way);
}

/// What is beside a way is near to it, so that round bodies that hide the place where it would mirror do not count.
bool RoundRows::isOpenBeside(const BendingLink& link, const LinkWay& way, const glm::dvec3& from,
                             const glm::dvec3& to) const {
    const auto seenFrom = [&](const glm::dvec3& other) {
        if (!link.edge()) return air_.isClearButBodies(way.first, other);
        return air_.isClearButBodies(other, aimAt(*link.edge(), offEnds(*link.edge(), way.first), other));
    };
    return seenFrom(from) && seenFrom(to);
}

glm::dvec3 RoundRows::arriving(const LinkWay& way) const {
    return way.side ? way.side->arriving(way.last, listener_) : glm::normalize(way.last - listener_);
}

template <class Pressure>
void RoundRows::fill(const Pressure& pressure, TonePressures& result) const {
    for (std::size_t b = 0; b < kBandCount; ++b)
        tones_.each(b, [&](std::size_t tone, double k) { result[tone] = pressure(b, k); });
}

void RoundRows::add(const BendingLink& first, const BendingLink& second, bool open,
                    std::vector<RoundWave>& waves) const {
    Row row{first, second, {}, {}, {}, {}};
    if (!findRow(row)) return;
    if (row.atFirst.lit != row.atSecond.lit)
        return addBeside(row.atFirst.lit ? second : first, row.atFirst.lit ? first : second, row.atFirst.lit, waves);
    if (!row.atFirst.lit) return addDark(row, waves);
    if (open) addLit(first, second, waves);
}

void RoundRows::addDark(const Row& row, std::vector<RoundWave>& waves) const {
    if (!(row.way < longest_)) return;
    if (!isClear(source_, nullptr, row.atFirst.first, &row.first) ||
        !isClear(row.atFirst.last, &row.first, row.atSecond.first, &row.second) ||
        !isClear(row.atSecond.last, &row.second, listener_, nullptr) || !isFreeAlong(row.atFirst) ||
        !isFreeAlong(row.atSecond))
        return;
    const double far = BendingLink::fromBoundary(row.wholeFirst), near = BendingLink::fromBoundary(row.wholeSecond);
    const double squares = far * far + near * near, share = squares > 0 ? far * far / squares : 0.5;
    const glm::dvec3 along = glm::normalize(row.atSecond.first - row.atFirst.last);
    const ShadowRow shadows{
        false, false, far, near,
        correlation(glm::distance(source_, row.atFirst.first) + row.atFirst.toMiddle(),
                    row.atFirst.fromMiddle() + row.between + row.atSecond.toMiddle(),
                    row.atSecond.fromMiddle() + glm::distance(row.atSecond.last, listener_),
                    row.first.outward(row.atFirst, along), row.second.outward(row.atSecond, along))};
    RoundWave wave;
    wave.order = row.first.bends() + row.second.bends();
    wave.way = row.way;
    wave.first = row.atFirst.first;
    wave.last = row.atSecond.last;
    wave.direction = arriving(row.atSecond);
    const auto pressure = [&](std::size_t b, double k) {
        const std::array<double, 2> m = row.first.mirrors(tones_, b), n = row.second.mirrors(tones_, b);
        const auto both = [&](const LinkWay& one, const LinkWay& other, double length) {
            return row.first.pressure(one, k, m) * row.second.pressure(other, k, n) * length;
        };
        // The one that is nearer to its boundary has the shorter distances.
        Complex sum = 0;
        if (share < 1) sum += (1 - share) * both(row.atFirst, row.wholeSecond, row.atFirst.length);
        if (share > 0) sum += share * both(row.wholeFirst, row.atSecond, row.atSecond.length);
        return sum * (1.0 + rowExcess(shadows, k));
    };
    if (looksFaint(tones_, pressure, wave.way)) return;
    fill(pressure, wave.pressure);
    addWithEnds(row, wave, waves);
}

/// With what ends take away from it, or what comes by one past which it leads.
void RoundRows::addWithEnds(const Row& row, const RoundWave& main, std::vector<RoundWave>& waves) const {
    const auto isPast = [](const std::array<bool, 2>& past) { return past[0] || past[1]; };
    const std::array<bool, 2> pastFirst = row.first.past(row.wholeFirst), pastSecond = row.second.past(row.wholeSecond);
    const bool within = !isPast(pastFirst) && !isPast(pastSecond);
    if (isFaint(main)) return;
    if (within) waves.push_back(main);
    const auto addEnd = [&](double longer, const TonePressures& pressure) {
        RoundWave wave = main;
        wave.way += longer;
        wave.pressure = pressure;
        if (wave.way < longest_ && !isFaint(wave)) waves.push_back(wave);
    };
    for (const bool atFirst : {true, false}) {
        const BendingLink& link = atFirst ? row.first : row.second;
        const LinkWay& whole = atFirst ? row.wholeFirst : row.wholeSecond;
        const std::array<bool, 2>& past = atFirst ? pastFirst : pastSecond;
        if (!within && isPast(atFirst ? pastSecond : pastFirst)) continue;
        for (std::size_t e = 0; e < 2; ++e) {
            if (!link.ends() || (!within && !past[e]) || (whole.side && !air_.isEnd(*whole.side, e))) continue;
            std::size_t tone = 0;
            TonePressures share;
            fill([&](std::size_t, double k) { return main.pressure[tone++] * link.byEnd(whole, e, k); }, share);
            addEnd(link.lengthByEnd(whole, e) - whole.length, share);
        }
        for (const BendingLink::PairEnd& end : link.pairEnds(whole, tones_)) {
            TonePressures share;
            for (std::size_t t = 0; t < kEdgeTones; ++t) share[t] = main.pressure[t] * end.share[t];
            addEnd(end.length - whole.length, share);
        }
    }
}

void RoundRows::addBeside(const BendingLink& dark, const BendingLink& lit, bool litFirst,
                          std::vector<RoundWave>& waves) const {
    const std::optional<LinkWay> alone = dark.way(source_, listener_);
    if (!alone || alone->lit || !alone->there || !(alone->length < longest_) ||
        !isFree(dark, *alone, source_, listener_))
        return;
    const glm::dvec3 from = litFirst ? source_ : alone->last, to = litFirst ? alone->first : listener_;
    const std::optional<LinkWay> by = lit.way(from, to);
    if (!by || !by->lit || !by->there) return;
    const double counts = besideShare(from, by->first, to);
    if (!(counts > 0) || !isOpenBeside(lit, *by, from, to)) return;
    const double straight = glm::distance(from, to);
    const glm::dvec3 along = (to - from) / straight;
    const double towards = glm::dot(by->first - from, along), before = std::clamp(towards, 0.0, straight);
    const double rest = litFirst ? alone->fromMiddle() + glm::distance(alone->last, listener_)
                                 : glm::distance(source_, alone->first) + alone->toMiddle();
    const double over = litFirst ? alone->toMiddle() : alone->fromMiddle();
    const ShadowRow shadows{
        litFirst, !litFirst, BendingLink::fromBoundary(litFirst ? *by : *alone),
        BendingLink::fromBoundary(litFirst ? *alone : *by),
        correlation(litFirst ? before : straight - before, over + (litFirst ? straight - before : before), rest,
                    dark.outward(*alone, along), lit.outward(*by, along))};
    RoundWave wave;
    wave.order = dark.bends() + lit.bends();
    wave.way = alone->length + by->length - straight;
    wave.first = litFirst ? by->first : alone->first;
    wave.last = litFirst ? alone->last : by->last;
    wave.direction = arriving(litFirst ? *alone : *by);
    const auto byDark = [&](std::size_t b, double k) { return dark.pressure(*alone, k, dark.mirrors(tones_, b)); };
    const auto byLit = [&](std::size_t b, double k) {
        const Complex more = straight * lit.pressure(*by, k, lit.mirrors(tones_, b));
        const Complex turned = std::polar(1.0, k * (by->length - straight));
        return counts * (more + rowExcess(shadows, k) * turned *
                                    litShare(more / turned, litFirst ? shadows.first : shadows.second, k));
    };
    const auto pressure = [&](std::size_t b, double k) { return byDark(b, k) * byLit(b, k); };
    if (looksFaint(tones_, pressure, wave.way)) return;
    fill(pressure, wave.pressure);
    if (!isFaint(wave)) waves.push_back(wave);
}

void RoundRows::addLit(const BendingLink& first, const BendingLink& second, std::vector<RoundWave>& waves) const {
    const std::optional<LinkWay> a = first.way(source_, listener_), b = second.way(source_, listener_);
    if (!a || !b || !a->lit || !b->lit || !a->there || !b->there) return;
    const double counts = besideShare(source_, a->first, listener_) * besideShare(source_, b->first, listener_);
    if (!(counts > 0)) return;
    const double straight = glm::distance(source_, listener_);
    const glm::dvec3 along = (listener_ - source_) / straight;
    const auto placeOf = [&](const LinkWay& way) {
        return std::clamp(glm::dot(way.first - source_, along), 0.0, straight);
    };
    const double low = std::min(placeOf(*a), placeOf(*b)), high = std::max(placeOf(*a), placeOf(*b));
    const ShadowRow shadows{
        true, true, BendingLink::fromBoundary(*a), BendingLink::fromBoundary(*b),
        correlation(low, high - low, straight - high, first.outward(*a, along), second.outward(*b, along))};
    // Of lower tones there is more.
    const double lowest = 2 * std::numbers::pi * edgeToneHz(0) / 343;
    if (std::abs(first.pressure(*a, lowest, {1, 1}) * second.pressure(*b, lowest, {1, 1})) * straight * straight <
        kFaintLit)
        return;
    // An edge that the body hides is none by itself.
    const auto isHidden = [&](const BendingLink& edge, const LinkWay& way, const BendingLink& body) {
        if (!edge.edge() || isFree(edge, way, source_, listener_)) return false;
        const std::optional<LinkWay> before = body.way(source_, way.first), after = body.way(way.first, listener_);
        return (before && !before->lit) || (after && !after->lit);
    };
    const bool hiddenFirst = isHidden(first, *a, second), hiddenSecond = isHidden(second, *b, first);
    RoundWave wave;
    wave.order = 2;
    wave.way = a->length + b->length - straight;
    wave.first = a->first;
    wave.last = b->last;
    wave.direction = arriving(*b);
    fill(
        [&](std::size_t band, double k) {
            const auto beside = [&](const BendingLink& link, const LinkWay& way) {
                return straight * link.pressure(way, k, link.mirrors(tones_, band));
            };
            const Complex one = beside(first, *a), other = beside(second, *b);
            const auto turned = [&](const LinkWay& way) { return std::polar(1.0, k * (way.length - straight)); };
            const Complex hidden = hiddenFirst ? one * turned(*b) : hiddenSecond ? other * turned(*a) : 0.0;
            const Complex both = turned(*a) * turned(*b) * litShare(one / turned(*a), shadows.first, k) *
                                 litShare(other / turned(*b), shadows.second, k);
            return (hidden + counts * (one * other + rowExcess(shadows, k) * both)) / straight;
        },
        wave.pressure);
    if (isFaint(wave) || !isOpenBeside(first, *a, source_, listener_) || !isOpenBeside(second, *b, source_, listener_))
        return;
    waves.push_back(wave);
}

void RoundRows::addBodies(bool open, std::vector<RoundWave>& waves) const {
    const std::size_t count = std::min(kRowBodies, air_.bodies().size());
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = 0; j < count; ++j) {
            if (i == j || areOnOneAxis(air_.bodies()[i].body(), air_.bodies()[j].body())) continue;
            for (int sides = 0; sides < 4; ++sides) {
                const BendingLink first(air_.bodies()[i].body(), (sides & 1) != 0);
                const BendingLink second(air_.bodies()[j].body(), (sides & 2) != 0);
                // In the light of both there is no order.
                add(first, second, open && i < j, waves);
            }
        }
}

void RoundRows::addWith(const BendingLink& edges, const TonePressures& left, bool open,
                        std::vector<RoundWave>& waves) const {
    const std::size_t count = std::min(kRowBodies, air_.bodies().size());
    const std::size_t before = waves.size();
    for (std::size_t i = 0; i < count; ++i) {
        const RoundBody& round = air_.bodies()[i].body();
        if (isOnBody(*edges.edge(), round) || isOnBody(*edges.lastEdge(), round)) continue;
        for (const bool backwards : {false, true}) {
            const BendingLink body(round, backwards);
            add(body, edges, open, waves);
            add(edges, body, false, waves);
        }
    }
    for (std::size_t w = before; w < waves.size(); ++w)
        for (std::size_t t = 0; t < kEdgeTones; ++t) waves[w].pressure[t] *= left[t];
}

void RoundRows::addEdges(const std::vector<PartlySeen>& edges, bool open, std::vector<RoundWave>& waves) const {
    for (const PartlySeen& one : edges) {
        TonePressures left;
        std::ranges::copy(one.left, left.begin());
        std::vector<WallEdge> others;
        for (const PartlySeen& other : edges)
            if (&other != &one && FacePair::shareFace(one.edge, other.edge)) others.push_back(other.edge);
        addWith(BendingLink(one.edge, others), left, open, waves);
    }
}

void RoundRows::addEdgePairs(const std::vector<PartlySeen>& edges, std::vector<RoundWave>& waves) const {
    struct Pair {
        const PartlySeen *first, *second;
        double way;
    };
    std::vector<Pair> pairs;
    for (const PartlySeen& first : edges)
        for (const PartlySeen& second : edges)
            if (&first != &second && FacePair::shareFace(first.edge, second.edge))
                if (const auto way = BendingLink(first.edge, second.edge).way(source_, listener_))
                    pairs.push_back({&first, &second, way->length});
    std::ranges::stable_sort(pairs, {}, &Pair::way);
    if (pairs.size() > kRowPairs) pairs.resize(kRowPairs);
    for (const Pair& pair : pairs) {
        TonePressures left;
        for (std::size_t t = 0; t < kEdgeTones; ++t) left[t] = pair.first->left[t] * pair.second->left[t];
        addWith(BendingLink(pair.first->edge, pair.second->edge), left, false, waves);
    }
}

}  // namespace rtsg
