// Finds the ways round each body and round two of them, and sums up what comes.
#include "round_bodies.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <memory>

#include "edges/edge_paths.h"
#include "edges/edge_waves.h"
#include "response/edge_tones.h"
#include "round_rows.h"

namespace rtsg {
namespace {

/// Of edges those by which the way is shortest are tried with bodies.
constexpr std::size_t kRowEdges = 12;

}  // namespace

class RoundBodies::Impl {
  public:
    Impl(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
         const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          options_(options),
          longest_(seconds * options.air.speedOfSound),
          attenuation_(airAttenuation(options.air)),
          tones_(geometry, options.air.speedOfSound),
          arrivals_(arrivals),
          field_(field),
          air_(geometry, source, listener),
          rows_(air_, tones_, source, listener, longest_) {}

    void addAlone() {
        if (air_.bodies().empty()) return;
        heard_ = findsDirect();
        open_ = heard_ && std::ranges::none_of(air_.bodies(), [](const PlacedBody& one) {
                    return grazes(one) && RoundSide(one, false).hides();
                });
        std::vector<RoundWave> waves;
        for (const PlacedBody& one : air_.bodies()) add(one, waves);
        if (options_.diffractionOrder > 1) rows_.addBodies(open_, waves);
        for (const RoundWave& wave : waves) addWave(wave);
    }

    void addRows(const EdgesSeen& edges) {
        if (air_.bodies().empty() || options_.diffractionOrder < 2) return;
        const std::vector<PartlySeen> shortest = nearest(edges);
        std::vector<RoundWave> waves;
        rows_.addEdges(shortest, open_, waves);
        rows_.addEdgePairs(shortest, waves);
        for (const RoundWave& wave : waves) addWave(wave);
    }

  private:
    double c() const { return options_.air.speedOfSound; }
    bool findsDirect() const {
        const double seconds = glm::distance(source_, listener_) / c();
        return std::ranges::any_of(arrivals_, [&](const Arrival& one) {
            return one.order == 0 && std::abs(one.seconds - seconds) < 1e-8 + 1e-6 * seconds;
        });
    }

    /// Of those by which the way is shortest the ones with air beside them.
    std::vector<PartlySeen> nearest(const EdgesSeen& edges) const {
        std::vector<PartlySeen> result;
        for (std::size_t i = 0; i < std::min(2 * kRowEdges, edges.shortest.size()) && result.size() < kRowEdges; ++i) {
            const EdgeCandidate& one = edges.shortest[i];
            if (!isOpen(geometry_.unnoted(), one.edge, offEnds(one.edge, one.by))) continue;
            PartlySeen edge{one.edge, {}};
            edge.left.fill(1);
            for (const PartlySeen& known : edges.partly)
                if (known.edge.from == one.edge.from && known.edge.axis == one.edge.axis) edge.left = known.left;
            result.push_back(edge);
        }
        return result;
    }

    /// Facets are within the circle: beside them direct sound may be heard a little into its shadow.
    static bool grazes(const PlacedBody& placed) {
        return placed.covered() < 2 * placed.depth() + 1e-6 * placed.body().radius;
    }

    void add(const PlacedBody& placed, std::vector<RoundWave>& waves) {
        const RoundSide near(placed, false), far(placed, true);
        const bool beside = near.lit() ? open_ : heard_ && grazes(placed);
        const bool byNear = addSide(near, beside, waves);
        if (near.lit() && open_ && !byNear) return;
        const bool byFar = addSide(far, heard_, waves);
        if (byNear || (heard_ && byFar)) removeImages(placed);
    }

    /// Whether there is air on the way by one side; adds what comes by it. `beside`: direct sound is there, too.
    bool addSide(const RoundSide& side, bool beside, std::vector<RoundWave>& waves) const {
        constexpr double kRounding = 1e-6;
        RoundWave main;
        main.way = side.way().length();
        main.first = side.first();
        main.last = side.last();
        main.direction = side.arriving(side.last(), listener_);
        if (!(main.way < longest_) || !side.touches()) return false;
        const std::array<bool, 2> past = side.past();
        const bool within = !past[0] && !past[1];
        const bool free = air_.isFree(side, source_, listener_);
        // What hides the place where it mirrors does not hide what is near to the straight way.
        const bool opens = side.lit() && beside && air_.isClearButBodies(source_, main.first) &&
                           air_.isClearButBodies(listener_, main.first);
        if (within && !free && !opens) return false;
        const bool missed = side.lit() && !heard_ &&
                            side.placed().covered() > -kRounding * side.placed().body().radius &&
                            air_.isClear(source_, listener_, &side.placed().body());
        const Bands mirrors = free ? mirrorsOf(side.placed()) : allBands(0);
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                main.pressure[tone] = side.pressure(beside, k, mirrors[b]);
                // Along the boundary itself a ray may have met a facet; where something else hides direct sound it is
                // the mirror image alone.
                if (missed)
                    main.pressure[tone] += std::polar(1 / side.placed().path().distance(),
                                                      -k * (side.placed().path().distance() - main.way));
                else if (side.lit() && !beside)
                    main.pressure[tone] -= side.pressure(beside, k, 0);
            });
        // Where it leads past one end it comes by that alone.
        bool any = within;
        for (std::size_t e = 0; e < 2; ++e)
            if (!side.placed().body().sphere && (within || past[e])) any = addEnd(side, e, main, waves) || any;
        if (within) waves.push_back(main);
        return any;
    }

    Bands mirrorsOf(const PlacedBody& placed) const {
        Bands mirrors;
        for (std::size_t b = 0; b < kBandCount; ++b) mirrors[b] = tones_.mirrors(placed.body().material, b);
        return mirrors;
    }

    /// What is missing beyond an end of a cylinder that is in the air, or what comes by it; whether it is.
    bool addEnd(const RoundSide& side, std::size_t end, const RoundWave& main, std::vector<RoundWave>& waves) const {
        const RoundWay& way = side.way();
        const PlacedBody& placed = side.placed();
        const double at = placed.ends()[end];
        RoundWave wave;
        wave.way = side.lengthByEnd(end);
        wave.first = placed.at(way.firstAngle(), side.far(), at);
        wave.last = placed.at(way.lastAngle(), side.far(), at);
        wave.direction = side.arriving(wave.last, listener_);
        if (!air_.isEnd(side, end)) return false;
        if (side.past()[end] && !air_.isFree(side, source_, listener_, at - way.middleAlong())) return false;
        bool any = false;
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                wave.pressure[tone] = side.byEnd(end, k) * main.pressure[tone];
                any = any || std::abs(wave.pressure[tone]) * wave.way > 1e-3;
            });
        if (any) waves.push_back(wave);
        return any;
    }

    /// The mirror images by its facets.
    void removeImages(const PlacedBody& placed) {
        std::erase_if(arrivals_, [&](const Arrival& arrival) {
            if (arrival.order != 1) return false;
            const glm::dvec3 image = listener_ + arrival.direction * (arrival.seconds * c()), way = source_ - image;
            const double apart = glm::length(way);
            if (!(apart > 0)) return false;
            const glm::dvec3 normal = way / apart, middle = 0.5 * (source_ + image);
            const double towards = glm::dot(arrival.direction, normal);
            if (!(std::abs(towards) > 1e-12)) return false;
            const glm::dvec3 by = listener_ + arrival.direction * (glm::dot(middle - listener_, normal) / towards);
            return liesOn(placed, by, normal);
        });
    }
    static bool liesOn(const PlacedBody& placed, const glm::dvec3& place, const glm::dvec3& normal) {
        const RoundBody& body = placed.body();
        glm::dvec3 way = place - body.center;
        if (!body.sphere) {
            const double along = glm::dot(way, body.axis);
            if (std::abs(along) > body.halfLength * (1 + 1e-6) + 1e-6) return false;
            way -= body.axis * along;
        }
        const double radius = glm::length(way), rounding = 1e-3 * body.radius + 1e-5;
        return radius < body.radius + rounding && radius > body.radius - 2 * placed.depth() - rounding &&
               std::abs(glm::dot(way, normal)) > radius * std::cos(body.facet + 0.01) && placed.has(place);
    }

    double sentTo(const glm::dvec3& by) const {
        return options_.pattern && by != source_ ? options_.pattern(glm::normalize(by - source_)) : 1;
    }

    void addWave(const RoundWave& side) {
        EdgeWave wave;
        wave.seconds = side.way / c();
        wave.direction = side.direction;
        // Where source and listener move a little it touches the body elsewhere, at the same length but for its square.
        wave.route = {side.first, side.last, glm::dvec3(0), glm::dvec3(0)};
        wave.order = side.order;
        wave.route.over = side.way - glm::distance(source_, side.first) - glm::distance(side.first, side.last) -
                          glm::distance(side.last, listener_);
        for (std::size_t t = 0; t < kEdgeTones; ++t) wave.pressure[t] = std::complex<float>(side.pressure[t]);
        weaken(wave.pressure, sentTo(side.first), attenuation_, side.way);
        if (!isFaint(wave.pressure, side.way)) field_.waves.push_back(wave);
    }

    const AcousticGeometry& geometry_;
    const glm::dvec3 source_, listener_;
    const TraceOptions& options_;
    const double longest_;
    const Bands attenuation_;
    const EdgeTones tones_;
    std::vector<Arrival>& arrivals_;
    EdgeField& field_;
    const RoundAir air_;
    const RoundRows rows_;
    bool heard_ = false, open_ = false;  // direct sound; and no body's circle is in its way
};

RoundBodies::RoundBodies(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                         const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field)
    : impl_(std::make_unique<Impl>(geometry, source, listener, options, seconds, arrivals, field)) {}

RoundBodies::~RoundBodies() = default;

void RoundBodies::addAlone() {
    impl_->addAlone();
}

void RoundBodies::addRows(const EdgesSeen& edges) {
    impl_->addRows(edges);
}

}  // namespace rtsg
