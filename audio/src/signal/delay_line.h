// DelayLine: a signal read at a moving, fractional delay, which is how Doppler shift comes about.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "fractional_delay.h"

namespace rtsg {

class DelayLine {
  public:
    void write(std::span<const float> block, std::size_t longestDelay) {
        grow(longestDelay + block.size() + 4 * SincTable::kHalf);
        for (const float sample : block) {
            const std::size_t i = written_++ & mask_;
            ring_[i] = sample;
            if (i < kTaps) ring_[mask_ + 1 + i] = sample;
        }
    }

    /// The sample `delay` before sample `index` (absolute, counted from the first written); 0 before the first.
    float read(std::size_t index, double delay) const {
        // So near that the taps would reach into the future: uses the nearest sample.
        if (delay < SincTable::kHalf) delay = std::round(delay);
        const double position = static_cast<double>(index) - delay;
        const double whole = std::floor(position), fraction = position - whole;
        const auto offset = static_cast<std::ptrdiff_t>(whole);
        if (fraction == 0) return at(offset);
        const std::ptrdiff_t first = offset - (SincTable::kHalf - 1);
        if (const float* taps = tapsAt(first)) return sinc().weighted(fraction, taps);
        std::array<float, kTaps> samples;
        for (std::size_t k = 0; k < kTaps; ++k) samples[k] = at(first + static_cast<std::ptrdiff_t>(k));
        return sinc().weighted(fraction, samples.data());
    }
    /// Reads as many samples as there are delays, from sample `index` on, each at its own delay, as read() does for
    /// one.
    void read(std::size_t index, std::span<const double> delays, std::span<float> out) const {
        std::array<double, 8> fractions;
        std::array<const float*, 8> taps;
        std::size_t i = 0;
        for (; i + 8 <= delays.size(); i += 8) {
            std::size_t plain = 0;
            for (; plain < 8; ++plain) {
                if (!(delays[i + plain] >= SincTable::kHalf)) break;
                const double position = static_cast<double>(index + i + plain) - delays[i + plain];
                const double whole = std::floor(position);
                taps[plain] = tapsAt(static_cast<std::ptrdiff_t>(whole) - (SincTable::kHalf - 1));
                fractions[plain] = position - whole;
                if (!taps[plain] || fractions[plain] == 0) break;
            }
            if (plain == 8)
                sinc().weighted(fractions, taps, out.data() + i);
            else
                for (std::size_t k = 0; k < 8; ++k) out[i + k] = read(index + i + k, delays[i + k]);
        }
        for (; i < delays.size(); ++i) out[i] = read(index + i, delays[i]);
    }
    std::size_t written() const { return written_; }
    /// Forgets its samples, and keeps its memory.
    void restart() { written_ = 0; }

  private:
    static constexpr std::size_t kTaps = 2 * SincTable::kHalf;

    static const SincTable& sinc() {
        static const SincTable table;
        return table;
    }
    /// The samples from `first` on in a row; null where not all of them are there.
    const float* tapsAt(std::ptrdiff_t first) const {
        const bool there = first >= 0 &&
                           first + static_cast<std::ptrdiff_t>(kTaps) <= static_cast<std::ptrdiff_t>(written_) &&
                           written_ - static_cast<std::size_t>(first) <= mask_ + 1;
        return there ? ring_.data() + (static_cast<std::size_t>(first) & mask_) : nullptr;
    }
    float at(std::ptrdiff_t index) const {
        if (index < 0 || index >= static_cast<std::ptrdiff_t>(written_)) return 0;
        const auto i = static_cast<std::size_t>(index);
        return written_ - i > mask_ + 1 ? 0 : ring_[i & mask_];
    }
    void grow(std::size_t need) {
        if (!ring_.empty() && mask_ + 1 >= need) return;
        const std::size_t size = std::bit_ceil(2 * need);
        std::vector<float> larger(size + kTaps);
        for (std::size_t back = 1; !ring_.empty() && back <= mask_ + 1 && back <= written_; ++back) {
            const std::size_t i = (written_ - back) & (size - 1);
            larger[i] = ring_[(written_ - back) & mask_];
            if (i < kTaps) larger[size + i] = larger[i];
        }
        ring_ = std::move(larger);
        mask_ = size - 1;
    }

    // A ring whose size is a power of two, with its first samples once more at the end, so that all taps are in a row.
    std::vector<float> ring_;
    std::size_t mask_ = 0, written_ = 0;
};

}  // namespace rtsg
