// Makes noise, filters it in octave bands, and gives it the energies of a response.
#include "band_noise.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>
#include <utility>

#include "band_filters.h"
#include "fft.h"
#include "random.h"

namespace rtsg {
namespace {

/// The least in which noise of many beginnings goes round, milliseconds; a power of two, for the transform.
constexpr std::size_t kMinSize = 4096;

std::size_t millisecondOf(int sampleRate) {
    return static_cast<std::size_t>(sampleRate / 1000);
}

/// Normally distributed numbers that do not depend on the standard library's taste.
double gaussian(Random& random) {
    const double u = 1 - random.uniform(), v = random.uniform();
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
}

/// Means over an odd number of bins; parts beyond the ends stay with the bins there.
std::vector<float> smoothed(const EnergySteps& late, std::size_t band, double factor, std::size_t half) {
    const std::size_t count = late.bins.size();
    std::vector<float> energy(count);
    const double fraction = factor / static_cast<double>(2 * half + 1);
    double within = 0;  // a part goes to each bin from the one `half` before on, which is counted where it begins
    std::vector<double> starts(count + 1);
    for (std::size_t k = 0; k < count; ++k) {
        const double part = fraction * late.bins[k][band];
        const std::size_t first = k > half ? k - half : 0, last = std::min(count - 1, k + half);
        starts[first] += part;
        starts[last + 1] -= part;
        energy[0] += static_cast<float>(part * static_cast<double>(half - (k - first)));
        energy[count - 1] += static_cast<float>(part * static_cast<double>(half - (last - k)));
    }
    for (std::size_t k = 0; k < count; ++k) {
        within += starts[k];
        energy[k] += static_cast<float>(std::max(0.0, within));
    }
    return energy;
}

}  // namespace

BandNoise::BandNoise(int sampleRate, std::size_t size, std::uint64_t seed) : rate_(sampleRate), size_(size) {
    Random random(Random::mix(seed, Random::mix(static_cast<std::uint64_t>(sampleRate), size)));
    std::vector<float> noise(size);
    const std::size_t millisecond = millisecondOf(sampleRate);
    for (std::size_t from = 0; from < size; from += millisecond) {
        const std::size_t end = std::min(size, from + millisecond);
        double energy = 0;
        for (std::size_t i = from; i < end; ++i) {
            noise[i] = static_cast<float>(gaussian(random));
            energy += static_cast<double>(noise[i]) * static_cast<double>(noise[i]);
        }
        const auto scale = static_cast<float>(std::sqrt(static_cast<double>(end - from) / std::max(energy, 1e-30)));
        for (std::size_t i = from; i < end; ++i) noise[i] *= scale;
    }
    const auto fft = RealFft::kept(size);
    const auto filters = BandFilters::kept(size, sampleRate, BandFilters::apart());
    RealFft::Spectrum all, filtered(fft->bins());
    fft->forward(noise, all);
    for (std::size_t b = 0; b < kBandCount; ++b) {
        for (std::size_t i = 0; i < fft->bins(); ++i) filtered[i] = all[i] * (*filters)[b][i];
        bands_[b].resize(size);
        fft->inverse(filtered, bands_[b]);
    }
}

std::shared_ptr<const BandNoise> BandNoise::of(std::uint64_t seed, int sampleRate, std::size_t frames, int channels) {
    const std::size_t millisecond = millisecondOf(sampleRate), whole = RealFft::sizeFor(frames / millisecond + 1);
    return std::make_shared<const BandNoise>(sampleRate,
                                             millisecond * (channels > 2 ? std::max(kMinSize, whole) : whole), seed);
}

std::shared_ptr<const BandNoise> BandNoise::kept(int sampleRate, std::size_t frames) {
    constexpr std::size_t kMax = 2;  // 8 MB each at 48 kHz, and more the longer
    static std::mutex mutex;
    static std::vector<std::shared_ptr<const BandNoise>> all;
    const std::size_t millisecond = millisecondOf(sampleRate);
    const std::size_t size = millisecond * std::max(kMinSize, RealFft::sizeFor(frames / millisecond + 1));
    const std::lock_guard lock(mutex);
    auto found =
        std::ranges::find_if(all, [&](const auto& one) { return one->rate_ == sampleRate && one->size_ == size; });
    if (found == all.end()) {
        if (all.size() == kMax) all.erase(all.begin());
        all.push_back(std::make_shared<BandNoise>(sampleRate, size, 0));
        found = std::prev(all.end());
    }
    std::rotate(found, std::next(found), all.end());  // the last one used is the last to go
    return all.back();
}

void BandNoise::add(const EnergySteps& late, double factor, std::uint64_t seed, std::size_t channel,
                    std::span<float> samples) const {
    if (late.bins.empty()) return;
    // Channels of one seed are as far from each other in the noise as the golden section leaves.
    const double position =
        static_cast<double>(channel) * std::numbers::phi + Random(Random::mix(seed, 0x5EED)).uniform();
    // The noise has its energy in each bin where these are its milliseconds.
    const std::size_t cell = millisecondOf(rate_), begin = static_cast<std::size_t>(std::llround(late.start * rate_));
    const auto first = static_cast<std::size_t>((position - std::floor(position)) * static_cast<double>(size_ / cell));
    const std::size_t offset = (first + 1) * cell - begin % cell;
    const double perSample = factor * late.binsPerSecond / rate_;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const auto half = static_cast<std::size_t>(0.5 * late.binsPerSecond / kBandHz[b]);
        addBand(smoothed(late, b, perSample, half), late, b, offset, samples);
    }
}

/// From the energies of a sample at the bins' middles.
void BandNoise::addBand(const std::vector<float>& energy, const EnergySteps& late, std::size_t band, std::size_t offset,
                        std::span<float> samples) const {
    const auto sampleOf = [&](double bin) {
        const double seconds = late.start + bin / late.binsPerSecond;
        return std::clamp<std::ptrdiff_t>(std::llround(seconds * rate_), 0, std::ssize(samples));
    };
    const auto count = static_cast<std::ptrdiff_t>(energy.size());
    // From the middle of bin k - 1 to that of bin k; constant before the first and behind the last middle.
    for (std::ptrdiff_t k = 0; k <= count; ++k) {
        const float from = energy[static_cast<std::size_t>(std::max<std::ptrdiff_t>(k - 1, 0))];
        const float to = energy[static_cast<std::size_t>(std::min(k, count - 1))];
        auto at = static_cast<std::size_t>(sampleOf(std::max(0.0, static_cast<double>(k) - 0.5)));
        const auto end =
            static_cast<std::size_t>(sampleOf(std::min(static_cast<double>(count), static_cast<double>(k) + 0.5)));
        if ((from == 0 && to == 0) || at >= end) continue;
        const float step = (to - from) / static_cast<float>(end - at);
        for (float before = from; at < end;) {
            // Go to the end of the noise, where it starts again.
            const std::size_t position = (offset + at) % size_, run = std::min(end - at, size_ - position);
            const float* const noise = bands_[band].data() + position;
            float* const sum = samples.data() + at;
            for (std::size_t i = 0; i < run; ++i)
                sum[i] += noise[i] *
                          std::sqrt(std::max(0.0f, before + step * (static_cast<float>(static_cast<int>(i)) + 0.5f)));
            before += step * static_cast<float>(run);
            at += run;
        }
    }
}

}  // namespace rtsg
