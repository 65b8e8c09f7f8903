// Levels of tones with the phases of all that comes, and how far they are off.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>

#include "rigid_round.h"
#include "walled.h"

namespace rtsg::test {

/// The level at a tone re the source in the open, with the phases of all that comes, dB. `line`: as of a source that is
/// a line along z, as long as all comes square to that; without what comes by far ends.
inline double decibelsOf(const TraceResult& traced, std::size_t tone, double distance, bool line = false) {
    const double rotations = 2 * M_PI * edgeToneHz(static_cast<double>(tone));
    std::complex<double> sum;
    const auto wide = [&](double seconds) {
        return !line ? 1.0 : seconds * 343 < 6 * distance ? std::sqrt(seconds * 343 / distance) : 0.0;
    };
    const Echogram echogram = traced.echogram();
    for (const Arrival& arrival : echogram.arrivals)
        sum += std::polar(wide(arrival.seconds) * std::sqrt(4 * M_PI * echogram.straightEnergy(arrival)[tone / 5]),
                          -rotations * arrival.seconds);
    for (const EdgeWave& wave : echogram.edges.waves)
        sum += std::complex<double>(wave.pressure[tone]) * std::polar(wide(wave.seconds), -rotations * wave.seconds);
    return 20 * std::log10(std::abs(sum) * distance);
}
inline double decibelsOf(RoundValue pressure, double distance) {
    return 20 * std::log10(std::abs(pressure) * distance);
}

/// The level of an octave, as of a source that is a line: what comes by a longer way is less weak.
inline double octaveOfLine(const TraceResult& traced, double distance, std::size_t band) {
    double energy = 0;
    for (const Arrival& arrival : traced.arrivals)
        if (const double pathLength = arrival.seconds * 343; pathLength < 6 * distance)
            energy += arrival.energy[band] * pathLength / distance;
    return 10 * std::log10(energy * 4 * M_PI * distance * distance);
}

struct Errors {
    void add(double error) {
        sum += error * error;
        worst = std::max(worst, std::abs(error));
        ++count;
    }
    double rms() const { return std::sqrt(sum / std::max(1, count)); }

    double sum = 0, worst = 0;
    int count = 0;
};

}  // namespace rtsg::test
