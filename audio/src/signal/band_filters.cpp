// Weighs the bins of a spectrum by octave bands whose neighbours fade over within half an octave.
#include "band_filters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace rtsg {
namespace {

/// Width of the transition between neighbouring bands, octaves.
constexpr double kTransition = 0.5;

/// On the octave axis on which band b spans b - 1/2 ... b + 1/2.
double octaveOf(double hz) {
    return std::log2(hz / 1000) + kBand1k;
}

double weightAt(int band, double octave) {
    const auto rise = [](double x) {  // 0 below an edge, 1 above
        const double u = std::clamp(x / kTransition + 0.5, 0.0, 1.0);
        const double s = std::sin(u * std::numbers::pi / 2);
        return s * s;
    };
    const double lower = band == 0 ? 1 : rise(octave - (band - 0.5));
    const double upper = band == kBandCount - 1 ? 0 : rise(octave - (band + 0.5));
    return lower - upper;
}

}  // namespace

double octaveWeight(int band, double hz) {
    if (hz <= 0) return band == 0 ? 1 : 0;
    return weightAt(band, octaveOf(hz));
}

BandFilters::BandFilters(std::size_t fftSize, int sampleRate, const Classes& classes)
    : size_(fftSize), rate_(sampleRate), classes_(classes) {
    const std::size_t bins = fftSize / 2 + 1;
    for (const std::size_t c : classes) weights_[c].resize(bins);
    weights_[classes[0]][0] = 1;
    for (std::size_t i = 1; i < bins; ++i) {
        const double octave = octaveOf(static_cast<double>(i) * sampleRate / static_cast<double>(fftSize));
        // No others have a share here.
        const int middle = std::clamp(static_cast<int>(std::lround(octave)), 0, kBandCount - 1);
        for (int b = std::max(0, middle - 1); b <= std::min(kBandCount - 1, middle + 1); ++b)
            weights_[classes[static_cast<std::size_t>(b)]][i] += static_cast<float>(weightAt(b, octave));
    }
}

std::shared_ptr<const BandFilters> BandFilters::kept(std::size_t fftSize, int sampleRate, const Classes& classes) {
    constexpr std::size_t kMax = 4;
    thread_local std::vector<std::shared_ptr<const BandFilters>> all;
    auto found = std::ranges::find_if(all, [&](const auto& one) {
        return one->size_ == fftSize && one->rate_ == sampleRate && one->classes_ == classes;
    });
    if (found == all.end()) {
        if (all.size() == kMax) all.erase(all.begin());
        all.push_back(std::make_shared<BandFilters>(fftSize, sampleRate, classes));
        found = std::prev(all.end());
    }
    std::rotate(found, std::next(found), all.end());  // the last one used is the last to go
    return all.back();
}

BandFilters::Classes BandFilters::apart() {
    Classes classes;
    std::iota(classes.begin(), classes.end(), std::size_t{0});
    return classes;
}

}  // namespace rtsg
