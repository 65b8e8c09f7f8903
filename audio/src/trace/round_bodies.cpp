// Finds the ways round each body, looks whether there is air on them, and sums up what comes.
#include "round_bodies.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <utility>

#include <rtsg/audio/wedge.h>

#include "edge_paths.h"
#include "edge_tones.h"
#include "edge_waves.h"
#include "placed_body.h"
#include "round_way.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kBodyPi = std::numbers::pi;
/// Of bodies, those nearest to the straight way count.
constexpr std::size_t kMostBodies = 16;

/// What comes by one side, or by an end.
struct SideWave {
    double way = 0;
    glm::dvec3 first{0}, last{0}, direction{0};  // as of an arrival
    std::array<Complex, kEdgeTones> pressure{};  // re the phase of its way
};

/// exp(i x) erfc(sqrt(i x)).
Complex fresnel(double x) {
    if (!(x > 1e-12)) return 1;
    return diffractionTransition(x) * std::polar(1 / std::sqrt(kBodyPi * x), -kBodyPi / 4);
}

class RoundBodies {
  public:
    RoundBodies(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          options_(options),
          longest_(seconds * options.air.speedOfSound),
          attenuation_(airAttenuation(options.air)),
          tones_(geometry, options.air.speedOfSound),
          arrivals_(arrivals),
          field_(field) {}

    void run() {
        std::vector<std::pair<double, PlacedBody>> bodies;
        geometry_.visitRoundBodies([&](const RoundBody& body) {
            const PlacedBody placed(body, source_, listener_);
            if (placed.within()) return;
            const double detour = placed.detour();
            if (bodies.size() == kMostBodies && !(detour < bodies.back().first)) return;
            if (bodies.size() == kMostBodies) bodies.pop_back();
            bodies.emplace(std::ranges::upper_bound(bodies, detour, {}, [](const auto& one) { return one.first; }),
                           detour, placed);
        });
        if (bodies.empty()) return;
        const bool heard = direct() != nullptr;
        std::vector<SideWave> waves;
        for (std::size_t i = 0; i < bodies.size(); ++i)
            // What is there twice is next to itself.
            if (i == 0 || !isSame(bodies[i].second.body(), bodies[i - 1].second.body()))
                add(bodies[i].second, heard, waves);
        if (waves.empty()) return;
        addWaves(waves, heard);
        std::ranges::stable_sort(arrivals_, {}, &Arrival::seconds);
    }

  private:
    static bool isSame(const RoundBody& a, const RoundBody& b) {
        constexpr double kSame = 1e-4;
        return a.sphere == b.sphere && glm::distance(a.center, b.center) < kSame * a.radius &&
               std::abs(a.radius - b.radius) < kSame * a.radius &&
               (a.sphere ||
                (std::abs(glm::dot(a.axis, b.axis)) > 1 - kSame * kSame &&
                 std::abs(a.halfLength - b.halfLength) < kSame * a.radius && std::abs(a.halfArc - b.halfArc) < kSame &&
                 (a.halfArc >= kBodyPi || glm::distance(a.middle, b.middle) < kSame)));
    }

    double c() const { return options_.air.speedOfSound; }
    Arrival* direct() {
        const double seconds = glm::distance(source_, listener_) / c();
        const auto found = std::ranges::find_if(arrivals_, [&](const Arrival& one) {
            return one.order == 0 && std::abs(one.seconds - seconds) < 1e-8 + 1e-6 * seconds;
        });
        return found == arrivals_.end() ? nullptr : &*found;
    }

    void add(const PlacedBody& placed, bool heard, std::vector<SideWave>& waves) {
        const RoundWay near(placed.pathBy(false)), far(placed.pathBy(true));
        // Where something else hides direct sound, a wall whose end is round, say, it comes by the other side.
        if (near.lit() && !heard) return static_cast<void>(addSide(placed, far, true, false, waves));
        // Facets are within the circle: beside them direct sound may be heard a little into its shadow.
        const bool grazes = !near.lit() && heard && placed.covered() < 2 * placed.depth() + 1e-6 * placed.body().radius;
        const bool byNear = addSide(placed, near, false, near.lit() || grazes, waves);
        if (near.lit() && !byNear) return;
        const bool byFar = addSide(placed, far, true, heard, waves);
        if (heard && (byNear || byFar)) removeImages(placed);
    }

    /// Whether there is air on the way by one side; adds what comes by it. `beside`: direct sound is there, too.
    bool addSide(const PlacedBody& placed, const RoundWay& way, bool far, bool beside,
                 std::vector<SideWave>& waves) const {
        SideWave main;
        main.way = way.length();
        main.first = placed.at(way.firstAngle(), far, way.firstAlong());
        main.last = placed.at(way.lastAngle(), far, way.lastAlong());
        main.direction = arriving(placed, way, far, main.last);
        if (!(main.way < longest_)) return false;
        if (!placed.has(main.first) || !placed.has(main.last)) return false;
        const bool endless = placed.body().sphere;
        const std::array<double, 2> ends = placed.ends();
        const std::array<bool, 2> past{!endless && way.middleAlong() < ends[0],
                                       !endless && way.middleAlong() > ends[1]};
        const bool within = !past[0] && !past[1];
        if (within && !isFree(placed, way, far, 0)) return false;
        const Bands mirrors = mirrorsOf(placed);
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                main.pressure[tone] = pressureOf(placed, way, far, beside, k, mirrors[b]);
            });
        // Where it leads past one end it comes by that alone.
        bool any = within;
        for (std::size_t e = 0; e < 2; ++e)
            if (!endless && (within || past[e])) any = addEnd(placed, way, far, ends[e], past[e], main, waves) || any;
        if (within) waves.push_back(main);
        return any;
    }

    /// Next to the surface it comes along that.
    glm::dvec3 arriving(const PlacedBody& placed, const RoundWay& way, bool far, const glm::dvec3& last) const {
        constexpr double kBack = 0.01;
        const bool touches = glm::distance(last, listener_) < 0.05 * placed.body().radius;
        const glm::dvec3 back = touches
                                    ? placed.at(way.lastAngle() - kBack, far, 0) - placed.at(way.lastAngle(), far, 0)
                                    : last - listener_;
        return glm::normalize(back);
    }

    Bands mirrorsOf(const PlacedBody& placed) const {
        Bands mirrors;
        for (std::size_t b = 0; b < kBandCount; ++b) mirrors[b] = tones_.mirrors(placed.body().material, b);
        return mirrors;
    }

    Complex pressureOf(const PlacedBody& placed, const RoundWay& way, bool far, bool beside, double k,
                       double mirrors) const {
        const RoundPath& path = placed.path();
        const double distance = path.distance();
        const Complex direct = std::polar(1 / distance, -k * (distance - way.length()));
        // Where both sides of a sphere are about one way, they are no waves by themselves, but the series is short.
        constexpr double kSeries = 2.5, kSides = 4;
        const double apart = k * path.radius * (kBodyPi - path.angle);
        const double bySeries = path.sphere ? std::clamp((kSides - apart) / (kSides - kSeries), 0.0, 1.0) : 0.0;
        // Round a rod that is thin beside a wave sound goes as if it were not there.
        const double size = std::pow(k * path.radius / 0.15, 4), bends = path.sphere ? 1 : size / (1 + size);
        Complex sum = bySeries < 1 ? (1 - bySeries) * bends * way.pressure(k, mirrors) : 0;
        if (far) return sum;
        if (bySeries > 0)
            sum += bySeries * (1 - (1 - mirrors) * way.light(k)) * rigidSphereField(path, k) *
                   std::polar(1.0, k * way.length());
        const double straight = way.lit() ? 0 : bySeries + 1 - bends;
        return sum + (beside && !way.lit() ? straight - 1 : straight) * direct;
    }

    /// What is missing beyond an end of a cylinder that is in the air, or what comes by it; whether it is.
    bool addEnd(const PlacedBody& placed, const RoundWay& way, bool far, double end, bool past, const SideWave& main,
                std::vector<SideWave>& waves) const {
        const double offset = end - way.middleAlong();
        SideWave wave;
        wave.way = way.lengthBy(offset);
        wave.first = placed.at(way.firstAngle(), far, end);
        wave.last = placed.at(way.lastAngle(), far, end);
        wave.direction = arriving(placed, way, far, wave.last);
        if (!isEnd(placed, 0.5 * (way.firstAngle() + way.lastAngle()), far, end)) return false;
        if (past && !isFree(placed, way, far, offset)) return false;
        bool any = false;
        for (std::size_t b = 0; b < kBandCount; ++b)
            tones_.each(b, [&](std::size_t tone, double k) {
                const Complex share = (past ? 0.5 : -0.5) * fresnel(k * (wave.way - way.length()));
                wave.pressure[tone] = share * main.pressure[tone];
                any = any || std::abs(wave.pressure[tone]) * wave.way > 1e-3;
            });
        if (any) waves.push_back(wave);
        return any;
    }

    /// Whether the body ends in the air: nothing goes on beside its surface.
    bool isEnd(const PlacedBody& placed, double angle, bool far, double end) const {
        const double reach = std::min(0.05, 0.2 * placed.body().halfLength), side = end < placed.ends()[1] ? -1 : 1;
        const glm::dvec3 from = placed.at(angle, far, end - side * reach, 1.002);
        AcousticHit hit;
        return !geometry_.closest(from, side * placed.axis(), 2 * reach, kNoPlane, hit);
    }

    /// Whether there is air on the way, moved along the axis to an end.
    bool isFree(const PlacedBody& placed, const RoundWay& way, bool far, double offset) const {
        constexpr double kOff = 1 + 1e-2, kStep = kBodyPi / 12;
        const double first = way.firstAngle(), last = way.lastAngle();
        const double from = way.firstAlong() + offset, to = way.lastAlong() + offset;
        const glm::dvec3 begin = placed.at(first, far, from, kOff), end = placed.at(last, far, to, kOff);
        if (!seen(geometry_, source_, begin) || !seen(geometry_, listener_, end)) return false;
        const int steps = static_cast<int>(std::ceil((last - first) / kStep));
        if (steps == 0) return true;
        // By the corners of what is laid round it.
        const double each = (last - first) / steps, out = kOff / std::cos(0.5 * each);
        glm::dvec3 at = begin;
        for (int i = 0; i <= steps; ++i) {
            const double part = std::min(1.0, (i + 0.5) / steps);
            const glm::dvec3 next =
                i == steps ? end : placed.at(first + (last - first) * part, far, from + (to - from) * part, out);
            const double length = glm::distance(at, next);
            AcousticHit hit;
            if (length > 0 && geometry_.closest(at, (next - at) / length, length, kNoPlane, hit)) return false;
            at = next;
        }
        return true;
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

    /// How much of what two waves do to each other counts in levels of octaves: all where they come together, nothing
    /// where they come so far apart that it is another one at each tone.
    static double together(double waveNumber, double apart) {
        const double turns = waveNumber * apart / 10;
        return 1 / (1 + turns * turns);
    }

    void addWaves(const std::vector<SideWave>& waves, bool heard) {
        std::vector<Arrival> own(waves.size());
        Bands factor = allBands(1);
        for (std::size_t b = 0; b < kBandCount; ++b) {
            double with = 0, without = 0;
            std::vector<double> apart(waves.size());
            tones_.each(b,
                        [&](std::size_t tone, double k) { sumTone(waves, heard, b, tone, k, with, without, apart); });
            if (without > 0)
                factor[b] = with / without;
            else
                apart[shortest(waves)] += with;
            for (std::size_t i = 0; i < waves.size(); ++i)
                own[i].energy[b] = apart[i] / EdgeTones::kTones / (4 * kBodyPi);
        }
        for (std::size_t i = 0; i < waves.size(); ++i) {
            addWave(waves[i]);
            addArrival(waves[i], own[i], heard);
        }
        if (heard) scale(*direct(), factor);
    }

    static std::size_t shortest(const std::vector<SideWave>& waves) {
        return static_cast<std::size_t>(std::ranges::min_element(waves, {}, &SideWave::way) - waves.begin());
    }

    /// `with`: energies of what comes together with direct sound, or with the shortest way; `without`: of direct sound.
    void sumTone(const std::vector<SideWave>& waves, bool heard, std::size_t b, std::size_t tone, double k,
                 double& with, double& without, std::vector<double>& apart) {
        const double distance = glm::distance(source_, listener_);
        const double begin = heard ? distance : waves[shortest(waves)].way;
        Complex sum = 0;
        if (heard) {
            const Arrival& straight = *direct();
            const double energy =
                (straight.straight < 0 ? straight.energy
                                       : field_.straight[static_cast<std::size_t>(straight.straight)])[b];
            sum = std::polar(std::sqrt(4 * kBodyPi * energy), -k * distance);
            without += std::norm(sum);
        }
        for (std::size_t i = 0; i < waves.size(); ++i) {
            const SideWave& wave = waves[i];
            const double sent = sentTo(wave.first) * std::exp(-attenuation_[b] * wave.way);
            const double part = together(k, wave.way - begin);
            const Complex pressure = std::sqrt(sent) * wave.pressure[tone] * std::polar(1.0, -k * wave.way);
            sum += part * pressure;
            apart[i] += (1 - part * part) * std::norm(pressure);
        }
        with += std::norm(sum);
    }

    void addWave(const SideWave& side) {
        EdgeWave wave;
        wave.seconds = side.way / c();
        wave.direction = side.direction;
        // Where source and listener move a little it touches the body elsewhere, at the same length but for its square.
        wave.route = {side.first, side.last, glm::dvec3(0), glm::dvec3(0)};
        wave.route.over = side.way - glm::distance(source_, side.first) - glm::distance(side.first, side.last) -
                          glm::distance(side.last, listener_);
        for (std::size_t t = 0; t < kEdgeTones; ++t) wave.pressure[t] = std::complex<float>(side.pressure[t]);
        weaken(wave, sentTo(side.first), attenuation_, side.way);
        if (!isFaint(wave, side.way)) field_.waves.push_back(wave);
    }

    void addArrival(const SideWave& side, Arrival arrival, bool heard) {
        constexpr double kFaint = 1e-6;
        const double most = *std::ranges::max_element(arrival.energy);
        if (!(most * 4 * kBodyPi * side.way * side.way > (heard ? 1e-3 : kFaint))) return;
        arrival.seconds = side.way / c();
        arrival.order = 1;
        arrival.direction = side.direction;
        arrival.straight = static_cast<std::int32_t>(field_.straight.size());
        field_.straight.push_back({});
        arrivals_.push_back(arrival);
    }

    void scale(Arrival& arrival, const Bands& factor) {
        if (arrival.straight < 0) {
            arrival.straight = static_cast<std::int32_t>(field_.straight.size());
            field_.straight.push_back(arrival.energy);
        }
        for (std::size_t b = 0; b < kBandCount; ++b) arrival.energy[b] *= factor[b];
    }

    const AcousticGeometry& geometry_;
    const glm::dvec3 source_, listener_;
    const TraceOptions& options_;
    const double longest_;
    const Bands attenuation_;
    const EdgeTones tones_;
    std::vector<Arrival>& arrivals_;
    EdgeField& field_;
};

}  // namespace

void addRoundBodies(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field) {
    RoundBodies(geometry, source, listener, options, seconds, arrivals, field).run();
}

}  // namespace rtsg
