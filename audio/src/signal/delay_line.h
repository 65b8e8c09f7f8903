// DelayLine: a signal read at a moving, fractional delay, which is how Doppler shift comes about.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "fractional_delay.h"

namespace rtsg {

class DelayLine {
  public:
    void write(std::span<const float> block, std::size_t longestDelay) {
        const std::size_t need = longestDelay + block.size() + 4 * SincTable::kHalf;
        if (ring_.size() < need) {
            std::vector<float> larger(2 * need);
            for (std::size_t back = 1; back <= ring_.size() && back <= written_; ++back)
                larger[(written_ - back) % larger.size()] = ring_[(written_ - back) % ring_.size()];
            ring_ = std::move(larger);
        }
        for (const float sample : block) ring_[written_++ % ring_.size()] = sample;
    }

    /// The sample `delay` before sample `index` (absolute, counted from the first written); what is not there yet is 0.
    float read(std::size_t index, double delay) const {
        // So near that the taps would reach into the future: to the nearest sample.
        if (delay < SincTable::kHalf) delay = std::round(delay);
        const double position = static_cast<double>(index) - delay;
        const double whole = std::floor(position), fraction = position - whole;
        const auto first = static_cast<std::ptrdiff_t>(whole);
        if (fraction == 0) return at(first);
        float sum = 0;
        for (int k = 0; k < 2 * SincTable::kHalf; ++k)
            sum += at(first + k - (SincTable::kHalf - 1)) * sinc().tap(fraction, k);
        return sum;
    }
    std::size_t written() const { return written_; }

  private:
    static const SincTable& sinc() {
        static const SincTable table;
        return table;
    }
    float at(std::ptrdiff_t index) const {
        if (index < 0 || index >= static_cast<std::ptrdiff_t>(written_)) return 0;
        const auto i = static_cast<std::size_t>(index);
        return written_ - i > ring_.size() ? 0 : ring_[i % ring_.size()];
    }
    std::vector<float> ring_;
    std::size_t written_ = 0;
};

}  // namespace rtsg
