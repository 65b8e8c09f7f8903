// Finds the ways round each body, and weights them by the share that others leave of them.
#include "diffraction_round_bodies.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <optional>

#include "diffraction_round_air.h"
#include "diffraction_round_side.h"
#include "edges/diffraction_paths.h"
#include "edges/diffraction_waves.h"
#include "response/edge_tones.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
using TonePressures = std::array<Complex, kEdgeTones>;

/// Only this many bodies, nearest to the direct path, are tested beside paths round others: this bounds the work.
constexpr std::size_t kBeside = 5;

/// A wave that comes by a way round bodies.
struct RoundWave {
    double pathLength = 0;
    glm::dvec3 first{0}, last{0}, direction{0};  // as of an arrival
    std::uint32_t order = 1;
    TonePressures pressure{};  // re the phase of its way
};

/// The side by which a path leads round the body's axis in one direction or the other; for a sphere the near or the far
/// one. None if one of the two points is inside the body.
std::optional<RoundSide> sideOf(const RoundBody& body, bool backwards, const glm::dvec3& from, const glm::dvec3& to) {
    const PlacedBody placed(body, from, to);
    if (placed.within()) return {};
    return RoundSide(placed, body.sphere ? backwards : (glm::dot(placed.axis(), body.axis) < 0) != backwards);
}

bool isBackwards(const RoundSide& side) {
    const RoundBody& body = side.placed().body();
    return body.sphere ? side.far() : (glm::dot(side.placed().axis(), body.axis) < 0) != side.far();
}

/// Whether the circle is in the way, and whether the surface is there, too.
bool isDark(const PlacedBody& body) {
    if (body.within()) return false;
    const RoundSide side(body, false);
    return !side.lit() && !side.past()[0] && !side.past()[1];
}
bool hides(const PlacedBody& body) {
    return isDark(body) && RoundSide(body, false).touches();
}

class RoundBends {
  public:
    RoundBends(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
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
          air_(geometry, source, listener) {}

    void add() {
        if (air_.bodies().empty()) return;
        heard_ = findsDirect();
        open_ = heard_ && std::ranges::none_of(air_.bodies(), [](const PlacedBody& one) {
                    return grazes(one) && RoundSide(one, false).hides();
                });
        std::vector<RoundWave> waves;
        for (const PlacedBody& one : air_.bodies()) add(one, waves);
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

    /// Whether the path by one side is free; if so, adds its wave. `beside`: there is direct sound, too.
    bool addSide(const RoundSide& side, bool beside, std::vector<RoundWave>& waves) const {
        constexpr double kRounding = 1e-6;  // of the radius
        RoundWave main;
        main.pathLength = side.path().length();
        main.first = side.first();
        main.last = side.last();
        main.direction = side.arriving(side.last(), listener_);
        if (!(main.pathLength < longest_)) return false;
        const std::array<bool, 2> past = side.past();
        const bool within = !past[0] && !past[1];
        TonePressures left;
        const PlacedBody* behind = nullptr;
        const bool hidden = !besideOthers(side, left, behind), free = !hidden && air_.isFree(side, source_, listener_);
        if (behind && !side.lit()) {
            const bool any = addRows(side, *behind, waves);
            if (any || hidden) return any;
        }
        if (!side.touches() || (hidden && !side.lit())) return false;
        // A body that hides the place of the mirroring does not hide sound near the straight way.
        const bool opens =
            side.lit() && beside && air_.isClear(source_, main.first) && air_.isClear(listener_, main.first);
        if (within && !free && !opens) return false;
        const bool missed = side.lit() && !heard_ &&
                            side.placed().covered() > -kRounding * side.placed().body().radius &&
                            air_.isClear(source_, listener_);
        const Bands mirrors = free ? mirrorsOf(side.placed()) : allBands(0);
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                main.pressure[tone] = side.pressure(beside, k, mirrors[b]);
                // On the boundary itself a ray may have hit a facet; if another body hides direct sound, the mirror
                // image alone is added.
                if (missed)
                    main.pressure[tone] += std::polar(1 / side.placed().path().distance(),
                                                      -k * (side.placed().path().distance() - main.pathLength));
                else if (side.lit() && !beside)
                    main.pressure[tone] -= side.pressure(beside, k, 0);
                main.pressure[tone] *= left[tone];
            });
        // A way that leads past one end comes by that end alone.
        bool any = within;
        for (std::size_t e = 0; e < 2; ++e)
            if (!side.placed().body().sphere && (within || past[e])) any = addEnd(side, e, main, waves) || any;
        if (within) waves.push_back(main);
        return any;
    }

    /// The pressure that other bodies leave of a way on one side. False if a body hides this one from the source or the
    /// listener, or if a way round both may touch its surface: then that body is `behind`.
    bool besideOthers(const RoundSide& side, TonePressures& left, const PlacedBody*& behind) const {
        left.fill(1);
        const std::size_t count = std::min(kBeside, air_.bodies().size());
        for (std::size_t i = 0; i < count; ++i) {
            const PlacedBody& other = air_.bodies()[i];
            if (isOnOneAxis(other.body(), side.placed().body())) continue;
            const PlacedBody before(other.body(), source_, side.first()), after(other.body(), side.last(), listener_);
            if (hides(before)) return false;
            if (isDark(after)) behind = &other;
            if (hides(after)) return false;
            for (const PlacedBody* leg : {&before, &after})
                if (!leg->within()) weighBeside(RoundSide(*leg, false), left);
        }
        return true;
    }
    /// Whether the bodies are parts of one, or stand on each other on one axis.
    static bool isOnOneAxis(const RoundBody& a, const RoundBody& b) {
        constexpr double kOff = 0.05;  // of the radius: a tolerance of drawing
        const glm::dvec3 displacement = b.center - a.center;
        const double off = kOff * std::max(a.radius, b.radius);
        if (a.sphere || b.sphere) return a.sphere == b.sphere && glm::length(displacement) < off;
        return glm::length(glm::cross(a.axis, b.axis)) < kOff &&
               glm::length(displacement - a.axis * glm::dot(displacement, a.axis)) < off;
    }
    /// Weakens a wave by the share that a body near its path takes away, so that there is no step where the body begins
    /// to hide the path.
    void weighBeside(const RoundSide& side, TonePressures& left) const {
        constexpr double kFar = 0.5;  // m off the leg: a bound of work, from where on it takes little
        if (!side.lit() || !side.touches() || side.past()[0] || side.past()[1] || side.placed().covered() < -kFar)
            return;
        const double leg = side.placed().path().distance();
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                left[tone] *=
                    1.0 + leg * side.pressure(true, k, 0) * std::polar(1.0, -k * (side.path().length() - leg));
            });
    }

    /// Round a body and then round another one that hides it: whether anything comes.
    bool addRows(const RoundSide& alone, const PlacedBody& other, std::vector<RoundWave>& waves) const {
        bool any = false;
        for (const bool backwards : {false, true}) any = addRow(alone, other.body(), backwards, waves) || any;
        return any;
    }
    bool addRow(const RoundSide& alone, const RoundBody& other, bool backwards, std::vector<RoundWave>& waves) const {
        constexpr int kSteps = 30;  // each comes nearer by the ratio of the radii to the ways: a bound of work
        const RoundBody& body = alone.placed().body();
        RoundSide first = alone;
        std::optional<RoundSide> second;
        // A string round both.
        for (int step = 0; step < kSteps; ++step) {
            second = sideOf(other, backwards, first.last(), listener_);
            if (!second || second->lit()) return false;
            const std::optional<RoundSide> next = sideOf(body, isBackwards(alone), source_, second->first());
            if (!next || next->lit()) return false;
            const double moved = glm::distance(next->last(), first.last());
            first = *next;
            if (moved < 1e-9 * first.path().length()) break;
        }
        const glm::dvec3 over = second->first() - first.last();
        const double between = glm::length(over);
        // The second one as from where the source is on the way made straight.
        const std::optional<RoundSide> whole =
            between > 0
                ? sideOf(other, backwards, second->first() - over * (first.path().length() / between), listener_)
                : std::nullopt;
        if (!whole || !first.touches() || !second->touches() || !air_.isFree(first, source_, second->first()) ||
            !air_.isFree(*second, first.last(), listener_))
            return false;
        RoundWave wave;
        wave.pathLength = first.path().length() + second->path().length() - between;
        wave.order = 2;
        wave.first = first.first();
        wave.last = second->last();
        wave.direction = second->arriving(second->last(), listener_);
        if (!(wave.pathLength < longest_)) return false;
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                wave.pressure[tone] =
                    first.path().length() * first.pressure(false, k, 0) * whole->pressure(false, k, 0);
            });
        waves.push_back(wave);
        return true;
    }

    Bands mirrorsOf(const PlacedBody& placed) const {
        Bands mirrors;
        for (std::size_t b = 0; b < kBandCount; ++b) mirrors[b] = tones_.mirrors(placed.body().material, b);
        return mirrors;
    }

    /// Adds the wave beyond an end of a cylinder that is in the air, or subtracts the missing part; returns whether the
    /// end is in the air.
    bool addEnd(const RoundSide& side, std::size_t end, const RoundWave& main, std::vector<RoundWave>& waves) const {
        const Detour& path = side.path();
        const PlacedBody& placed = side.placed();
        const double at = placed.ends()[end];
        RoundWave wave;
        wave.pathLength = side.lengthByEnd(end);
        wave.first = placed.at(path.firstAngle(), side.far(), at);
        wave.last = placed.at(path.lastAngle(), side.far(), at);
        wave.direction = side.arriving(wave.last, listener_);
        if (!air_.isEnd(side, end)) return false;
        if (side.past()[end] && !air_.isFree(side, source_, listener_, at - path.middleAlong())) return false;
        bool any = false;
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                wave.pressure[tone] = side.byEnd(end, k) * main.pressure[tone];
                any = any || std::abs(wave.pressure[tone]) * wave.pathLength > 1e-3;
            });
        if (any) waves.push_back(wave);
        return any;
    }

    /// The mirror images by its facets.
    void removeImages(const PlacedBody& placed) {
        std::erase_if(arrivals_, [&](const Arrival& arrival) {
            if (arrival.order != 1) return false;
            const glm::dvec3 image = listener_ + arrival.direction * (arrival.seconds * c()),
                             displacement = source_ - image;
            const double apart = glm::length(displacement);
            if (!(apart > 0)) return false;
            const glm::dvec3 normal = displacement / apart, middle = 0.5 * (source_ + image);
            const double towards = glm::dot(arrival.direction, normal);
            if (!(std::abs(towards) > 1e-12)) return false;
            const glm::dvec3 by = listener_ + arrival.direction * (glm::dot(middle - listener_, normal) / towards);
            return liesOn(placed, by, normal);
        });
    }
    static bool liesOn(const PlacedBody& placed, const glm::dvec3& position, const glm::dvec3& normal) {
        const RoundBody& body = placed.body();
        glm::dvec3 displacement = position - body.center;
        if (!body.sphere) {
            const double along = glm::dot(displacement, body.axis);
            if (std::abs(along) > body.halfLength * (1 + 1e-6) + 1e-6) return false;
            displacement -= body.axis * along;
        }
        const double radius = glm::length(displacement), rounding = 1e-3 * body.radius + 1e-5;
        return radius < body.radius + rounding && radius > body.radius - 2 * placed.depth() - rounding &&
               std::abs(glm::dot(displacement, normal)) > radius * std::cos(body.facet + 0.01) && placed.has(position);
    }

    double sentTo(const glm::dvec3& by) const {
        return options_.pattern && by != source_ ? options_.pattern(glm::normalize(by - source_)) : 1;
    }

    void addWave(const RoundWave& side) {
        EdgeWave wave;
        wave.seconds = side.pathLength / c();
        wave.direction = side.direction;
        // If source and listener move a little, it touches the body elsewhere, with the same length to first order.
        wave.route = {side.first, side.last, glm::dvec3(0), glm::dvec3(0)};
        wave.order = side.order;
        wave.route.over = side.pathLength - glm::distance(source_, side.first) - glm::distance(side.first, side.last) -
                          glm::distance(side.last, listener_);
        for (std::size_t t = 0; t < kEdgeTones; ++t) wave.pressure[t] = std::complex<float>(side.pressure[t]);
        weaken(wave.pressure, sentTo(side.first), attenuation_, side.pathLength);
        if (!isFaint(wave.pressure, side.pathLength)) field_.waves.push_back(wave);
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
    bool heard_ = false, open_ = false;  // direct sound; and no body's circle is in its way
};

}  // namespace

void addRoundBodies(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field) {
    RoundBends(geometry, source, listener, options, seconds, arrivals, field).add();
}

}  // namespace rtsg
