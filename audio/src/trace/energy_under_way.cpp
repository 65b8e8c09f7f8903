// Follows some rays together, step by step, and puts those with much energy in the place of those with little.
#include "trace/energy_under_way.h"

#include <algorithm>
#include <cmath>

#include "signal/random.h"
#include "trace/directions.h"
#include "walls/even_direction.h"

namespace rtsg::trace {
namespace {

constexpr std::size_t kRays = 64, kSteps = 64;
/// Of the energy: where fewer rays with more energy begin, and where the rest is taken to fade as it did.
constexpr double kFewer = 3e-3, kEnough = 1e-5;
/// Of what walls absorb: less differs too little to matter.
constexpr double kDiffersLittle = 0.1;
/// Walls that all rays together meet: more would cost more than is gained, and in corners of walls that take nothing
/// rays without a length go on for ever.
constexpr std::size_t kMostWalls = kRays * 512;

struct Walker {
    glm::dvec3 origin, direction, facing{0};
    std::uint32_t plane = kNoPlane;
    Bands energy{};      // by class
    double arrived = 0;  // of it the most, before the last wall: what it had on its way there
    double metres = 0;

    double most() const { return *std::max_element(energy.begin(), energy.end()); }
    void meet(const AcousticHit& hit, const AcousticMaterial& material, const BandClasses& classes, Random& random) {
        double scattered = 0, mirrored = 0, through = 0;
        arrived = most();
        for (std::size_t c = 0; c < classes.count; ++c) {
            const std::size_t b = classes.first[c];
            scattered += energy[c] * material.reflected(b) * material.scattering[b];
            mirrored += energy[c] * material.mirrored(b);
            through += energy[c] * material.transmission[b];
            energy[c] *= 1 - material.absorption[b];
        }
        metres += hit.distance;
        origin += direction * hit.distance;
        plane = hit.plane;
        const double choice = random.uniform() * (scattered + mirrored + through);
        const double cosine = glm::dot(direction, hit.normal);
        facing = cosine > 0 ? -hit.normal : hit.normal;
        if (choice < scattered)
            direction = cosineDirection(facing, random);
        else if (choice < scattered + mirrored)
            direction -= hit.normal * (2 * cosine);
        else
            facing = -facing;
    }
};

bool takeAlike(std::span<const AcousticMaterial> materials, const BandClasses& classes) {
    for (std::size_t c = 0; c < classes.count; ++c) {
        const auto takes = [&](const AcousticMaterial& m) { return m.absorption[classes.first[c]]; };
        const auto [least, most] = std::ranges::minmax(materials, {}, takes);
        if (takes(most) - takes(least) > kDiffersLittle) return false;
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
            if (walker.metres < metres && walker.most() > 0 && under.size() < AcousticRays::kMost)
                under.push_back(&walker);
        if (under.empty()) return true;
        walls -= std::min(walls, under.size());
        AcousticRays rays;
        for (const Walker* w : under) rays.add(w->origin, w->facing, w->direction, 1e6, w->plane);
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        for (std::size_t i = 0; i < under.size(); ++i)
            if (met >> i & 1)
                under[i]->meet(hits[i], geometry.materials()[hits[i].material], classes, random);
            else
                under[i]->energy = {}, under[i]->arrived = 0;
    }
    return false;
}

/// As many as before, each with the mean of all: by a comb across their energies in a row.
void equalise(std::vector<Walker>& walkers, double mean, Random& random) {
    std::vector<Walker> chosen;
    double at = random.uniform(), sum = 0;
    for (const Walker& walker : walkers) {
        const double has = walker.most();
        for (sum += has / mean; at < sum && chosen.size() < walkers.size(); at += 1) {
            chosen.push_back(walker);
            for (double& e : chosen.back().energy) e *= mean / has;
            chosen.back().arrived *= mean / has;
        }
    }
    // Rounding may take the comb past the last one.
    while (chosen.size() < walkers.size()) chosen.push_back(chosen.back());
    walkers = std::move(chosen);
}

}  // namespace

EnergyUnderWay::EnergyUnderWay(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& source,
                               const TraceOptions& options, double metres) {
    if (geometry.materials().empty() || takeAlike(geometry.materials(), classes) || !(metres > 0)) return;
    Random random(Random::mix(options.seed, 0xE6E));
    std::vector<Walker> walkers;
    for (std::size_t i = 0; i < kRays; ++i) {
        Walker walker{.origin = source, .direction = evenDirection(static_cast<int>(i), static_cast<int>(kRays))};
        const double sent = options.pattern ? options.pattern(walker.direction) : 1;
        std::fill_n(walker.energy.begin(), classes.count, sent);
        walkers.push_back(walker);
    }
    stepsPerMetre_ = kSteps / metres;
    std::vector<double> logarithms{0};  // at the ends of the steps
    std::size_t walls = kMostWalls;
    for (std::size_t step = 1; step <= kSteps; ++step) {
        if (!walk(geometry, classes, static_cast<double>(step) / stepsPerMetre_, walkers, walls, random)) break;
        double under = 0, mean = 0, most = 0;
        for (const Walker& walker : walkers) {
            under += walker.arrived / kRays, mean += walker.most() / kRays;
            most = std::max(most, walker.most());
        }
        if (!(mean > 0)) break;
        logarithms.push_back(std::log(under));
        if (mean < kEnough) break;
        if (most > 2 * mean) equalise(walkers, mean, random);
    }
    if (logarithms.size() < 2) return;
    for (std::size_t step = 0; step < kSteps; ++step) {
        // Beyond what is known it goes on as in the last step, but never grows.
        const std::size_t from = std::min(step, logarithms.size() - 2);
        const double slope = std::min(0.0, logarithms[from + 1] - logarithms[from]);
        const double logarithm = logarithms[from] + slope * (static_cast<double>(step - from) + 0.5);
        const double fewer = std::log(kFewer);
        shares_.push_back(std::exp(logarithm < fewer ? (logarithm + fewer) / 2 : logarithm));
    }
}

}  // namespace rtsg::trace
