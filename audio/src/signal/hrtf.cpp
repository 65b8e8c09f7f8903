// Puts the responses of a head where they belong in time.
#include <algorithm>
#include <array>
#include <cmath>

#include <rtsg/audio/hrtf.h>

#include "fractional_delay.h"
#include "hrtf_impl.h"

namespace rtsg {

Hrtf::Hrtf(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Hrtf::~Hrtf() = default;
int Hrtf::sampleRate() const {
    return impl_->rate;
}
std::size_t Hrtf::early() const {
    return impl_->early;
}
double Hrtf::smoothDelay(const glm::dvec3& direction, int ear) const {
    return impl_->lineDelay + impl_->sphereDelay(direction, ear);
}

Hrtf::Ears Hrtf::at(const glm::dvec3& direction) const {
    Ears ears;
    at(direction, ears);
    return ears;
}

void Hrtf::at(const glm::dvec3& direction, Ears& ears, const std::array<double, 2>& earlier) const {
    static const SincTable sinc;
    const Impl& s = *impl_;
    // A millisecond more for an ear that hears late by a delay instead of by its response.
    const auto size = s.length + s.early + static_cast<std::size_t>(0.001 * s.rate) + 3 * SincTable::kHalf;
    // The measured responses lie behind those computed for the left ear.
    for (std::vector<float>& ear : ears) ear.assign(size + 2 * s.length, 0.0f);
    const float* measured = nullptr;
    const auto delays = s.raw(direction, ears[0].data() + size, measured);
    const std::array<double, 2> shifts{static_cast<double>(s.early) - s.lead + delays[0] - earlier[0],
                                       static_cast<double>(s.early) - s.lead + delays[1] - earlier[1]};
    if (shifts == std::array<double, 2>{}) {  // a line has all of the delay
        ears[1].assign(measured + s.length, measured + 2 * s.length);
        std::copy_n(measured, s.length, ears[0].begin());
        ears[0].resize(s.length);
        return;
    }
    for (std::size_t e = 0; e < 2; ++e) {
        const double shift = shifts[e], whole = std::floor(shift);
        std::array<float, 2 * SincTable::kHalf> taps;
        for (std::size_t k = 0; k < taps.size(); ++k) taps[k] = sinc.tap(shift - whole, static_cast<int>(k));
        const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(whole) - (SincTable::kHalf - 1);
        for (std::size_t i = 0; i < s.length; ++i) {
            const float sample = measured[e * s.length + i];
            if (sample == 0) continue;
            const std::ptrdiff_t start = first + static_cast<std::ptrdiff_t>(i);
            const std::ptrdiff_t from = std::max<std::ptrdiff_t>(0, -start);
            const auto to = std::min(std::ssize(taps), static_cast<std::ptrdiff_t>(size) - start);
            for (std::ptrdiff_t k = from; k < to; ++k)
                ears[e][static_cast<std::size_t>(start + k)] += sample * taps[static_cast<std::size_t>(k)];
        }
    }
    for (std::vector<float>& ear : ears) ear.resize(size);
}

}  // namespace rtsg
