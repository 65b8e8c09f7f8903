// Band-limited reading between samples: Kaiser-windowed sincs, exact at whole samples.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>
#include <vector>

namespace rtsg {

/// `Half`: taps on either side. `Shape`: of the Kaiser window.
template <int Half, int Phases, int Shape>
class BasicSinc {
  public:
    static constexpr int kHalf = Half;
    static constexpr int kPhases = Phases;

    BasicSinc() : taps_(static_cast<std::size_t>((kPhases + 1) * 2 * kHalf)) {
        const double top = bessel(Shape);
        for (int phase = 0; phase <= kPhases; ++phase)
            for (int k = 0; k < 2 * kHalf; ++k) {
                const double x = k - (kHalf - 1) - static_cast<double>(phase) / kPhases;
                const double window =
                    std::abs(x) < kHalf ? bessel(Shape * std::sqrt(1 - x * x / (kHalf * kHalf))) / top : 0;
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
        Eight sums = eightSums(fraction, samples);
        return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
    }
    /// The same for eight fractions and where the samples of each begin: equal to eight calls, bit for bit. The sums of
    /// eight are added together, not one after the other.
    void weighted(const std::array<double, 8>& fractions, const std::array<const float*, 8>& samples,
                  float* out) const {
        std::array<Eight, 8> sums;
        for (std::size_t k = 0; k < 8; ++k) sums[k] = eightSums(fractions[k], samples[k]);
        for (std::size_t k = 0; k < 4; ++k) sums[k] = addPairs(sums[2 * k], sums[2 * k + 1]);
        for (std::size_t k = 0; k < 2; ++k) sums[k] = addPairs(sums[2 * k], sums[2 * k + 1]);
        const Eight low = __builtin_shufflevector(sums[0], sums[1], 0, 1, 2, 3, 8, 9, 10, 11);
        const Eight high = __builtin_shufflevector(sums[0], sums[1], 4, 5, 6, 7, 12, 13, 14, 15);
        const Eight all = low + high;
        std::memcpy(out, &all, sizeof all);
    }

  private:
    using Eight = float __attribute__((vector_size(32)));

    static Eight load(const float* from) {
        Eight result;
        std::memcpy(&result, from, sizeof result);
        return result;
    }
    Eight eightSums(double fraction, const float* samples) const {
        const double position = fraction * kPhases;
        const auto phase = static_cast<std::size_t>(position);
        const auto blend = static_cast<float>(position - static_cast<double>(phase));
        const float* near = taps_.data() + phase * 2 * kHalf;
        const float* next = near + 2 * kHalf;
        Eight sums{};
        for (std::size_t k = 0; k < 2 * kHalf; k += 8) {
            const Eight from = load(near + k);
            sums += load(samples + k) * (from + (load(next + k) - from) * blend);
        }
        return sums;
    }
    /// Sums of neighbours, of `a` and `b` in turn by halves.
    static Eight addPairs(Eight a, Eight b) {
        return __builtin_shufflevector(a, b, 0, 2, 8, 10, 4, 6, 12, 14) +
               __builtin_shufflevector(a, b, 1, 3, 9, 11, 5, 7, 13, 15);
    }

    static double bessel(double x) {  // I0
        double sum = 1, term = 1;
        for (int k = 1; k < 60 && term > 1e-18 * sum; ++k) {
            term *= (x / (2 * k)) * (x / (2 * k));
            sum += term;
        }
        return sum;
    }
    std::vector<float> taps_;
};

using SincTable = BasicSinc<16, 512, 9>;

}  // namespace rtsg
