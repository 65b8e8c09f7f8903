// Follows some rays together, step by step, and replaces rays of little energy by copies of rays with much.
#include "energy_in_transit.h"

#include <algorithm>
#include <cmath>

#include "probe_ray.h"
#include "signal/random.h"
#include "walls/even_direction.h"

namespace rtsg::trace {
namespace {

constexpr std::size_t kRays = 64, kSteps = 64;
/// Shares of the energy: below the first fewer rays have more energy each, below the second the rest is taken to fade
/// as before.
constexpr double kFewer = 3e-3, kEnough = 1e-5;
/// Absorption coefficients that differ by less are taken for one.
constexpr double kDiffersLittle = 0.1;
/// Walls that all rays together meet: more would cost more than is gained, and in corners of walls that take nothing
/// rays without a length go on for ever.
constexpr std::size_t kMaxWalls = kRays * 512;

struct Walker {
    ProbeRay ray;
    double arrived = 0;  // the largest energy before the last wall, on its way there
};

bool takeAlike(std::span<const AcousticMaterial> materials, const BandClasses& classes) {
    for (std::size_t c = 0; c < classes.count; ++c) {
        const auto takes = [&](const AcousticMaterial& m) { return m.absorption[classes.first[c]]; };
        const auto [minimum, maximum] = std::ranges::minmax(materials, {}, takes);
        if (takes(maximum) - takes(minimum) > kDiffersLittle) return false;
    }
    return true;
}

/// All as far as `metres`; what escapes has no energy any more. False if that takes more than so many walls.
bool walk(const AcousticGeometry& geometry, const BandClasses& classes, double metres, std::vector<Walker>& walkers,
          std::size_t& walls, Random& random) {
    std::vector<Walker*> under;
    while (walls > 0) {
        under.clear();
        for (Walker& walker : walkers)
            if (walker.ray.metres < metres && walker.ray.maximum() > 0 && under.size() < AcousticRays::kMax)
                under.push_back(&walker);
        if (under.empty()) return true;
        walls -= std::min(walls, under.size());
        AcousticRays rays;
        for (const Walker* w : under) rays.add(w->ray.origin, w->ray.facing, w->ray.direction, 1e6, w->ray.plane);
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        for (std::size_t i = 0; i < under.size(); ++i) {
            const bool shut = (met >> i & 1) != 0;
            under[i]->arrived = shut ? under[i]->ray.maximum() : 0;
            if (shut)
                under[i]->ray.meet(hits[i], geometry.materials()[hits[i].material], classes, random);
            else
                under[i]->ray.energy = {};
        }
    }
    return false;
}

/// Keeps the number of walkers and gives each the mean energy, by a comb across their energies in a row.
void equalise(std::vector<Walker>& walkers, double mean, Random& random) {
    std::vector<Walker> chosen;
    double at = random.uniform(), sum = 0;
    for (const Walker& walker : walkers) {
        const double has = walker.ray.maximum();
        for (sum += has / mean; at < sum && chosen.size() < walkers.size(); at += 1) {
            chosen.push_back(walker);
            for (double& e : chosen.back().ray.energy) e *= mean / has;
            chosen.back().arrived *= mean / has;
        }
    }
    // Rounding may take the comb past the last one.
    while (chosen.size() < walkers.size()) chosen.push_back(chosen.back());
    walkers = std::move(chosen);
}

}  // namespace

EnergyInTransit::EnergyInTransit(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& source,
                                 const TraceOptions& options, double metres) {
    if (geometry.materials().empty() || takeAlike(geometry.materials(), classes) || !(metres > 0)) return;
    Random random(Random::mix(options.seed, 0xE6E));
    std::vector<Walker> walkers;
    for (std::size_t i = 0; i < kRays; ++i) {
        Walker walker{
            .ray = {.origin = source, .direction = evenDirection(static_cast<int>(i), static_cast<int>(kRays))}};
        const double sent = options.pattern ? options.pattern(walker.ray.direction) : 1;
        std::fill_n(walker.ray.energy.begin(), classes.count, sent);
        walkers.push_back(walker);
    }
    stepsPerMetre_ = kSteps / metres;
    std::vector<double> logarithms{0};  // at the ends of the steps
    std::size_t walls = kMaxWalls;
    for (std::size_t step = 1; step <= kSteps; ++step) {
        if (!walk(geometry, classes, static_cast<double>(step) / stepsPerMetre_, walkers, walls, random)) break;
        double under = 0, mean = 0, maximum = 0;
        for (const Walker& walker : walkers) {
            under += walker.arrived / kRays, mean += walker.ray.maximum() / kRays;
            maximum = std::max(maximum, walker.ray.maximum());
        }
        if (!(mean > 0)) break;
        logarithms.push_back(std::log(under));
        if (mean < kEnough) break;
        if (maximum > 2 * mean) equalise(walkers, mean, random);
    }
    if (logarithms.size() < 2) return;
    for (std::size_t step = 0; step < kSteps; ++step) {
        // Beyond the known steps it continues like the last step, but never grows.
        const std::size_t from = std::min(step, logarithms.size() - 2);
        const double slope = std::min(0.0, logarithms[from + 1] - logarithms[from]);
        const double logarithm = logarithms[from] + slope * (static_cast<double>(step - from) + 0.5);
        const double fewer = std::log(kFewer);
        fractions_.push_back(std::exp(logarithm < fewer ? (logarithm + fewer) / 2 : logarithm));
    }
}

}  // namespace rtsg::trace
