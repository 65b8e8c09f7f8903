// Chooses the images that are worth following, and makes filters of the share that walls and air left of them.
#include "followed_images.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/audio/impulse_response.h>

#include "signal/fft.h"

namespace rtsg {
namespace {

/// Weaker images are not followed: as a share of all energy, and as an amplitude relative to the loudest band.
constexpr double kMinOfLoudest = 1e-3, kMinAmplitude = 1e-4;
/// Bands that differ by less are the same; .01 dB.
constexpr double kSame = 1.0012;

double sumOf(const Bands& bands) {
    double sum = 0;
    for (const double band : bands) sum += band;
    return sum;
}

}  // namespace

std::vector<float> minimumPhase(const Bands& amplitudes, int sampleRate, std::size_t length) {
    // By the cepstrum: its part before zero is folded to behind zero.
    const auto kept = RealFft::kept(RealFft::sizeFor(4 * length));
    const RealFft& fft = *kept;
    const std::size_t size = fft.size();
    const double minimum = kMinAmplitude * *std::max_element(amplitudes.begin(), amplitudes.end());
    RealFft::Spectrum spectrum(fft.bins());
    for (std::size_t i = 0; i < fft.bins(); ++i) {
        const double hz = static_cast<double>(i) * sampleRate / static_cast<double>(size);
        double amplitude = 0;
        for (int b = 0; b < kBandCount; ++b) amplitude += bandWeight(b, hz) * amplitudes[static_cast<std::size_t>(b)];
        spectrum[i] = static_cast<float>(std::log(std::max(amplitude, std::max(minimum, 1e-30))));
    }
    std::vector<float> time(size);
    fft.inverse(spectrum, time);
    for (std::size_t i = 1; i < size / 2; ++i) {
        time[i] *= 2;
        time[size - i] = 0;
    }
    fft.forward(time, spectrum);
    for (auto& bin : spectrum) bin = std::exp(bin);
    fft.inverse(spectrum, time);
    time.resize(length);
    const std::size_t half = length / 2;
    const auto rest = static_cast<double>(length - half);
    for (std::size_t i = half; i < length; ++i)
        time[i] *= static_cast<float>(0.5 + 0.5 * std::cos(std::numbers::pi * static_cast<double>(i - half) / rest));
    return time;
}

void setAmplitudes(FollowedImage& image, const Bands& amplitudes, int sampleRate, std::size_t block) {
    const auto [low, high] = std::minmax_element(amplitudes.begin(), amplitudes.end());
    image.pressure = *high;
    image.filtered = *high > kSame * *low;
    if (image.filtered) image.filter = Convolver::prepare(block, minimumPhase(amplitudes, sampleRate, block));
}

std::vector<FollowedImage> followedImages(const Echogram& echogram, const glm::dvec3& source,
                                          const glm::dvec3& listener, double speedOfSound, int sampleRate,
                                          std::size_t block, std::size_t maximum) {
    const double minimum = kMinOfLoudest * sumOf(echogram.total());
    std::vector<std::pair<double, std::size_t>> loudest;
    for (std::size_t i = 0; i < echogram.arrivals.size(); ++i) {
        const Arrival& arrival = echogram.arrivals[i];
        const double energy = sumOf(echogram.straightEnergy(arrival));
        if (arrival.order > 0 && arrival.rotation != glm::mat3(0.0f) && energy > minimum)
            loudest.emplace_back(-energy, i);
    }
    const std::size_t count = std::min(maximum, loudest.size());
    std::partial_sort(loudest.begin(), loudest.begin() + static_cast<std::ptrdiff_t>(count), loudest.end());
    std::vector<FollowedImage> images;
    for (std::size_t k = 0; k < count; ++k) {
        const Arrival& arrival = echogram.arrivals[loudest[k].second];
        FollowedImage image;
        image.arrival = loudest[k].second;
        image.rotation = glm::dmat3(arrival.rotation);
        const double distance = arrival.seconds * speedOfSound;
        image.offset = listener + arrival.direction * distance - image.rotation * source;
        const Bands& energy = echogram.straightEnergy(arrival);
        Bands amplitudes;
        for (std::size_t b = 0; b < kBandCount; ++b)
            amplitudes[b] = std::sqrt(4 * std::numbers::pi * energy[b]) * distance;
        setAmplitudes(image, amplitudes, sampleRate, block);
        images.push_back(std::move(image));
    }
    return images;
}

Echogram without(const Echogram& echogram, const std::vector<FollowedImage>& images) {
    Echogram rest = echogram;
    std::vector<bool> followed(rest.edges.waves.size());
    for (const FollowedImage& image : images) {
        if (image.kind == FollowedImage::Kind::edge) followed[image.arrival] = true;
        if (image.kind != FollowedImage::Kind::image) continue;
        rest.arrivals[image.arrival].energy = {};
        rest.arrivals[image.arrival].straight = -1;
    }
    std::erase_if(rest.edges.waves, [&](const EdgeWave& wave) {
        return followed[static_cast<std::size_t>(&wave - rest.edges.waves.data())];
    });
    return rest;
}

}  // namespace rtsg
