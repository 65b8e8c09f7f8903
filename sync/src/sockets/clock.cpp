// Estimates the offset of the server's clock, and the delay, from exchanges of pings.
#include "clock.h"

#include <algorithm>
#include <cmath>

namespace rtsg {

void MirrorClock::sample(std::uint64_t asked, std::uint64_t theirs, std::uint64_t answered) {
    if (answered < asked) return;
    const std::uint64_t trip = answered - asked, middle = asked + trip / 2;
    const auto ahead = static_cast<std::int64_t>(theirs - middle);
    samples_[count_ % samples_.size()] = {static_cast<double>(ahead) * 1e-9, static_cast<double>(trip) * 1e-9};
    ++count_;
    const auto last = samples_.begin() + static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(count_, samples_.size()));
    best_ =
        *std::min_element(samples_.begin(), last, [](const Sample& a, const Sample& b) { return a.delay < b.delay; });
}

std::uint64_t MirrorClock::here(std::uint64_t theirs) const {
    return theirs - static_cast<std::uint64_t>(std::llround(best_.offset * 1e9));
}

void MirrorClock::arrival(std::uint64_t published, std::uint64_t arrived) {
    const auto transit = static_cast<std::int64_t>(arrived - published);
    if (seen_) jitter_ += (std::abs(static_cast<double>(transit - transit_)) * 1e-9 - jitter_) / 16;
    transit_ = transit;
    seen_ = true;
}

}  // namespace rtsg
