// Band-limited reading between samples: a Kaiser-windowed sinc of 32 taps, exact at whole samples.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace rtsg {

class SincTable {
  public:
    static constexpr int kHalf = 16;  // taps on either side
    static constexpr int kPhases = 512;

    SincTable() : taps_(static_cast<std::size_t>((kPhases + 1) * 2 * kHalf)) {
        for (int phase = 0; phase <= kPhases; ++phase)
            for (int k = 0; k < 2 * kHalf; ++k) {
                const double x = k - (kHalf - 1) - static_cast<double>(phase) / kPhases;
                const double window =
                    std::abs(x) < kHalf ? bessel(9 * std::sqrt(1 - x * x / (kHalf * kHalf))) / bessel(9) : 0;
                const double sinc = std::abs(x) < 1e-12 ? 1 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
                // Exact zeros where the sinc has them, so that whole delays copy samples bit for bit.
                taps_[static_cast<std::size_t>(phase) * 2 * kHalf + static_cast<std::size_t>(k)] =
                    phase % kPhases == 0 && std::abs(x) > 0.5 ? 0.0f : static_cast<float>(sinc * window);
            }
    }
    /// Weights of the samples floor(position) - kHalf + 1 ... floor(position) + kHalf, for a fraction in [0, 1):
    /// tap k is interpolated between the two nearest phases.
    float tap(double fraction, int k) const {
        const double position = fraction * kPhases;
        const auto phase = static_cast<std::size_t>(position);
        const auto blend = static_cast<float>(position - static_cast<double>(phase));
        const std::size_t at = phase * 2 * kHalf + static_cast<std::size_t>(k);
        return taps_[at] + (taps_[at + 2 * kHalf] - taps_[at]) * blend;
    }

    /// The 2 * kHalf samples, one after the other, weighted by the taps of a fraction in [0, 1): in eight sums, which
    /// machines add side by side.
    float weighted(double fraction, const float* samples) const {
        const double position = fraction * kPhases;
        const auto phase = static_cast<std::size_t>(position);
        const auto blend = static_cast<float>(position - static_cast<double>(phase));
        const float* near = taps_.data() + phase * 2 * kHalf;
        const float* next = near + 2 * kHalf;
        std::array<float, 8> sums{};
        for (std::size_t k = 0; k < 2 * kHalf; k += sums.size())
            for (std::size_t i = 0; i < sums.size(); ++i)
                sums[i] += samples[k + i] * (near[k + i] + (next[k + i] - near[k + i]) * blend);
        return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
    }

  private:
    static double bessel(double x) {  // I0
        double sum = 1, term = 1;
        for (int k = 1; k < 60; ++k) {
            term *= (x / (2 * k)) * (x / (2 * k));
            sum += term;
        }
        return sum;
    }
    std::vector<float> taps_;
};

}  // namespace rtsg
