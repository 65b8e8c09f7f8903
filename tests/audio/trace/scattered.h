// Scattering by walls: of a trace, and of a plane in closed form.
#pragma once

#include <cmath>
#include <numbers>

#include "rays/acoustic_tracer.h"

namespace rtsg::test {

inline double scatteredEnergy(const TraceResult& result) {
    double sum = 0;
    for (const Bands& bin : result.echogram().late.bins) sum += bin[kBand1k];
    return sum;
}

/// The energy that a Lambert plane z = 0 sends from a source at height h to a listener at height k above the same
/// point.
inline double fromPlaneBelow(double absorption, double h, double k) {
    constexpr int kSteps = 400'000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
        // r = k tan(u): as many steps within k of the foot as beyond.
        const double u = (i + .5) / kSteps * std::numbers::pi / 2, r = k * std::tan(u);
        const double dr = k * (1 + std::tan(u) * std::tan(u)) * std::numbers::pi / 2 / kSteps;
        sum += 2 * std::numbers::pi * r * dr * h / (4 * std::numbers::pi * std::pow(r * r + h * h, 1.5)) * k /
               (std::numbers::pi * std::pow(r * r + k * k, 1.5));
    }
    return (1 - absorption) * sum;
}

}  // namespace rtsg::test
