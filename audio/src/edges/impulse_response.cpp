// Turns energy over time into pressure: sharp arrivals, shaped noise, filtered in octave bands.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <utility>

#include <rtsg/audio/impulse_response.h>

#include "arrival_pan.h"
#include "diffraction_waves.h"
#include "response/band_classes.h"
#include "signal/ambisonics.h"
#include "signal/band_filters.h"
#include "signal/band_noise.h"
#include "signal/fft.h"
#include "signal/fractional_delay.h"
#include "signal/panning.h"
#include "signal/random.h"
#include "signal/sphere_ear.h"

namespace rtsg {
namespace {

constexpr double kFourPi = 4 * std::numbers::pi;
/// Samples in which filters of bands ring, before and after together.
constexpr std::size_t kFilterRings = 4096;

}  // namespace

ArrivalPan panOfEar(double right, int ear, double radius, double speedOfSound) {
    return {stereoGains({right, 0, 0})[static_cast<std::size_t>(ear)],
            sphereEarDelay(right, ear, radius, speedOfSound)};
}

ArrivalPan panOf(const glm::dvec3& direction, int channel, const ImpulseResponseOptions& options) {
    if (options.channels == ImpulseResponseOptions::Channels::mono) return {};
    if (options.channels == ImpulseResponseOptions::Channels::ambisonic) {
        const glm::dvec3 local = inListenersFrame(direction, options);
        std::array<double, ambisonicChannels(kMaxAmbisonicOrder)> gains;
        ambisonicGains(options.ambisonicOrder, ambisonicAxes(local), gains);
        return {gains[static_cast<std::size_t>(channel)], 0};
    }
    const double right = glm::dot(direction, options.listenerRight);
    if (options.channels == ImpulseResponseOptions::Channels::binaural)
        return panOfEar(right, channel, options.headRadius, options.speedOfSound);
    return {stereoGains({right, 0, 0})[static_cast<std::size_t>(channel)], 0};
}

namespace {

/// When every band has less than `share` of its energy left, s.
double usefulDuration(const Echogram& echogram, double fraction) {
    const Bands total = echogram.total();
    Bands left{};
    const auto enough = [&] {
        for (std::size_t b = 0; b < kBandCount; ++b)
            if (left[b] > fraction * total[b]) return true;
        return false;
    };
    std::size_t arrival = echogram.arrivals.size(), k = echogram.late.bins.size();
    while (arrival > 0 || k > 0) {
        const double binTime = echogram.late.startOf(k);
        if (k == 0 || (arrival > 0 && echogram.arrivals[arrival - 1].seconds > binTime)) {
            --arrival;
            for (std::size_t b = 0; b < kBandCount; ++b) left[b] += echogram.arrivals[arrival].energy[b];
            if (enough()) return echogram.arrivals[arrival].seconds;
        } else {
            --k;
            for (std::size_t b = 0; b < kBandCount; ++b) left[b] += echogram.late.bins[k][b];
            if (enough()) return binTime;
        }
    }
    return 0;
}

/// Until the last wave by an edge has faded that has more than that share of the energy; 0 without.
std::size_t framesOfWaves(const Echogram& echogram, const ImpulseResponseOptions& options) {
    const Bands total = echogram.total();
    const double all = kFourPi * *std::max_element(total.begin(), total.end());
    double last = -1;
    for (const EdgeWave& wave : echogram.edges.waves) {
        const bool counts = std::ranges::any_of(wave.pressure, [&](const std::complex<float>& tone) {
            return static_cast<double>(std::norm(tone)) > options.cutFraction * all;
        });
        if (counts) last = std::max(last, wave.seconds);
    }
    return last < 0 ? 0 : static_cast<std::size_t>(last * options.sampleRate) + edgeWaveFrames(options.sampleRate);
}

/// An arrival through a head: samples from `first` on, by ear.
struct HeadArrival {
    std::ptrdiff_t first = 0;
    Hrtf::Ears ears;
};

/// The arrivals that are pulses, with their energies as if nothing bent: all but those that edges alone bring.
std::vector<Arrival> pulsesOf(const Echogram& echogram) {
    std::vector<Arrival> pulses;
    pulses.reserve(echogram.arrivals.size());
    for (const Arrival& arrival : echogram.arrivals) {
        pulses.push_back(arrival);
        pulses.back().energy = echogram.straightEnergy(arrival);
    }
    return pulses;
}

/// For each early arrival; empty without a head.
std::vector<HeadArrival> throughHead(std::span<const Arrival> arrivals, const ImpulseResponseOptions& options) {
    std::vector<HeadArrival> result;
    if (!options.hrtf) return result;
    for (const Arrival& arrival : arrivals) {
        if (arrival.seconds > arrivals.front().seconds + options.hrtfSeconds) break;
        const double position = arrival.seconds * options.sampleRate - static_cast<double>(options.hrtf->early());
        const double whole = std::floor(position), earlier = whole - position;
        HeadArrival& placed = result.emplace_back();
        placed.first = static_cast<std::ptrdiff_t>(whole);
        if (arrival.order < options.firstOrder) continue;
        options.hrtf->at(inListenersFrame(arrival.direction, options), placed.ears, {earlier, earlier});
    }
    return result;
}

/// Adds an arrival to the samples of one band.
void addArrival(const Arrival& arrival, const HeadArrival* head, std::size_t band, int channel,
                const ImpulseResponseOptions& options, std::span<float> samples) {
    static const SincTable sinc;
    const double pressure = std::sqrt(kFourPi * arrival.energy[band]);
    if (head) {
        const std::vector<float>& ear = head->ears[static_cast<std::size_t>(channel)];
        for (std::size_t i = 0; i < ear.size(); ++i) {
            const std::ptrdiff_t at = head->first + static_cast<std::ptrdiff_t>(i);
            if (at >= 0 && at < std::ssize(samples))
                samples[static_cast<std::size_t>(at)] += static_cast<float>(pressure) * ear[i];
        }
        return;
    }
    const ArrivalPan pan = panOf(arrival.direction, channel, options);
    const double position = std::max(0.0, (arrival.seconds + pan.delay) * options.sampleRate);
    const double whole = std::floor(position);
    const auto amplitude = static_cast<float>(pan.gain * pressure);
    for (int k = 0; k < 2 * SincTable::kHalf; ++k) {
        const double at = whole - (SincTable::kHalf - 1) + k;
        if (at >= 0 && at < static_cast<double>(samples.size()))
            samples[static_cast<std::size_t>(at)] += amplitude * sinc.tap(position - whole, k);
    }
}

}  // namespace

double bandWeight(int band, double hz) {
    return octaveWeight(band, hz);
}

namespace {

/// Adds the arrivals to the channels, filtered in bands where those differ. The transform is as long as they last.
void addPulses(std::span<const Arrival> pulses, std::span<const HeadArrival> heads,
               const ImpulseResponseOptions& options, std::size_t throughEars,
               std::vector<std::vector<float>>& channels) {
    double last = -1;
    for (const Arrival& pulse : pulses)
        if (pulse.order >= options.firstOrder && pulse.energy != Bands{}) last = std::max(last, pulse.seconds);
    if (last < 0) return;
    const std::size_t frames =
        std::min(channels.front().size(), static_cast<std::size_t>(last * options.sampleRate) + throughEars);
    const auto kept = RealFft::kept(RealFft::sizeFor(frames + kFilterRings));
    const RealFft& fft = *kept;
    const trace::BandClasses classes = trace::bandClasses(pulses, {});
    const auto filters = BandFilters::kept(fft.size(), options.sampleRate, classes.of);
    RealFft::Spectrum sum(fft.bins()), spectrum;
    std::vector<float> band(fft.size());
    for (std::size_t channel = 0; channel < channels.size(); ++channel) {
        sum.assign(fft.bins(), 0);
        for (std::size_t c = 0; c < classes.count; ++c) {
            const std::size_t b = classes.first[c];
            std::fill(band.begin(), band.end(), 0.0f);
            for (std::size_t i = 0; i < pulses.size(); ++i) {
                const Arrival& arrival = pulses[i];
                if (arrival.order < options.firstOrder || !(arrival.energy[b] > 0)) continue;
                addArrival(arrival, i < heads.size() ? &heads[i] : nullptr, b, static_cast<int>(channel), options,
                           std::span(band).first(frames));
            }
            fft.forward(band, spectrum);
            for (std::size_t i = 0; i < fft.bins(); ++i) sum[i] += spectrum[i] * (*filters)[c][i];
        }
        fft.inverse(std::move(sum), band);
        const std::size_t count = std::min(channels[channel].size(), frames + kFilterRings / 2);
        for (std::size_t i = 0; i < count; ++i) channels[channel][i] += band[i];
    }
}

}  // namespace

ImpulseResponse makeImpulseResponse(const Echogram& echogram, const ImpulseResponseOptions& asked) {
    using Channels = ImpulseResponseOptions::Channels;
    ImpulseResponseOptions options = asked;
    if (options.channels != Channels::binaural)
        options.hrtf = nullptr;
    else if (!options.hrtf)
        options.hrtf = Hrtf::sphere(options.sampleRate, options.headRadius, options.speedOfSound);
    const bool ambisonic = options.channels == Channels::ambisonic;
    const int channelCount = ambisonic ? ambisonicChannels(std::clamp(options.ambisonicOrder, 0, kMaxAmbisonicOrder))
                             : options.channels == Channels::mono ? 1
                                                                  : 2;
    const double rate = options.sampleRate;
    const std::vector<Arrival> pulses = pulsesOf(echogram);
    const std::vector<HeadArrival> heads = throughHead(pulses, options);
    const auto farEar = static_cast<std::size_t>(
        options.channels == Channels::binaural ? std::ceil(2 * options.headRadius / options.speedOfSound * rate) : 0);
    std::size_t throughEars = 0;
    for (const HeadArrival& head : heads) throughEars = std::max(throughEars, head.ears[0].size());
    const std::size_t useful = static_cast<std::size_t>(usefulDuration(echogram, options.cutFraction) * rate) +
                               2 * SincTable::kHalf + 64 + farEar + throughEars;
    const std::size_t frames = std::max(useful, framesOfWaves(echogram, options));
    ImpulseResponse result;
    result.sampleRate = options.sampleRate;
    result.channels.assign(static_cast<std::size_t>(channelCount), std::vector<float>(frames));
    addPulses(pulses, heads, options, 2 * SincTable::kHalf + 64 + farEar + throughEars, result.channels);
    const auto noise = options.sharedNoise ? BandNoise::kept(options.sampleRate, frames)
                                           : BandNoise::of(options.seed, options.sampleRate, frames, channelCount);
    for (int channel = 0; channel < channelCount; ++channel) {
        // In a diffuse field a channel of degree l carries 1 / (2 l + 1) of the pressure's energy.
        const double diffuseFraction = ambisonic ? 1.0 / (2 * ambisonicDegree(channel) + 1) : 1;
        const auto c = static_cast<std::size_t>(channel);
        noise->add({echogram.late.bins, echogram.late.start, echogram.late.binsPerSecond}, kFourPi * diffuseFraction,
                   options.seed, c, result.channels[c]);
    }
    addEdgeWaves(echogram, options, result.channels);
    if (options.seconds > 0)
        for (auto& channel : result.channels)
            channel.resize(static_cast<std::size_t>(std::llround(options.seconds * rate)));
    return result;
}

std::uint64_t noiseSeed(std::uint64_t seed, const glm::dvec3& source, const glm::dvec3& listener) {
    for (const glm::dvec3& point : {source, listener})
        for (int axis = 0; axis < 3; ++axis)
            seed = Random::mix(seed, std::bit_cast<std::uint64_t>(point[axis] + 0.0));  // no -0
    return seed;
}

}  // namespace rtsg
