// Makes samples of what comes by way of edges: the spectrum between the tones, turned by its delay, back into time.
#include "diffraction_waves.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "arrival_pan.h"
#include "signal/fft.h"

namespace rtsg {
namespace {

using Sample = std::complex<float>;

/// Samples before a wave's delay where what limits its band rings.
constexpr std::size_t kBefore = 64;

/// The responses of waves, by one transform that is long enough for what edges do to the lowest tones.
class WaveResponses {
  public:
    explicit WaveResponses(int sampleRate)
        : rate_(sampleRate), fft_(RealFft::kept(edgeWaveFrames(sampleRate))), places_(fft_->bins()) {
        const auto bins = static_cast<double>(fft_->bins());
        const double lowest = std::log2(edgeToneHz(0)), inOctave = 1 / (std::log2(edgeToneHz(1)) - lowest);
        for (std::size_t i = 0; i < places_.size(); ++i) {
            const double hz = static_cast<double>(i) * rate_ / static_cast<double>(fft_->size());
            Place& place = places_[i];
            // Below the lowest tone, 22 Hz, it is as there, beyond the last one as there.
            const double tone = std::clamp((std::log2(std::max(hz, 1.0)) - lowest) * inOctave, 0.0,
                                           static_cast<double>(kEdgeTones - 1));
            place.tone = std::min(static_cast<std::size_t>(tone), kEdgeTones - 2);
            const auto t = static_cast<float>(tone - static_cast<double>(place.tone));
            // Catmull and Rom's cubic.
            place.weights = {t * (-1 + t * (2 - t)) / 2, (2 + t * t * (3 * t - 5)) / 2, t * (1 + t * (4 - 3 * t)) / 2,
                             t * t * (t - 1) / 2};
            const double high = std::clamp((static_cast<double>(i) / bins - 0.92) / 0.08, 0.0, 1.0);
            for (float& weight : place.weights)
                weight *= static_cast<float>(0.5 + 0.5 * std::cos(std::numbers::pi * high));
        }
        const auto fade = [](double x) { return static_cast<float>(0.5 - 0.5 * std::cos(std::numbers::pi * x)); };
        for (std::size_t i = 0; i < kBefore / 2; ++i) begin_.push_back(fade(i / (kBefore / 2.0)));
        const std::size_t quarter = fft_->size() / 4;
        for (std::size_t i = 0; i < quarter; ++i)
            end_.push_back(fade(static_cast<double>(i) / static_cast<double>(quarter)));
    }
    /// Good as long as the thread.
    static const WaveResponses& kept(int sampleRate) {
        thread_local std::vector<std::pair<int, std::unique_ptr<const WaveResponses>>> all;
        for (const auto& [rate, one] : all)
            if (rate == sampleRate) return *one;
        return *all.emplace_back(sampleRate, std::make_unique<const WaveResponses>(sampleRate)).second;
    }

    /// The spectrum of a wave whose delay is `fraction` of a sample, kBefore samples late.
    void spectrumOf(const EdgeWave& wave, double fraction, RealFft::Spectrum& spectrum) const {
        spectrum.resize(places_.size());
        const auto tone = [&](std::size_t t) { return wave.pressure[std::min(t, kEdgeTones - 1)]; };
        const double turn = -2 * std::numbers::pi * (kBefore + fraction) / static_cast<double>(fft_->size());
        const std::complex<double> step = std::polar(1.0, turn);
        std::complex<double> phase = 1;
        for (std::size_t i = 0; i < places_.size(); ++i) {
            // Anew now and then, so that rounding does not add up.
            if (i % 256 == 0) phase = std::polar(1.0, turn * static_cast<double>(i));
            const auto& [at, w] = places_[i];
            const Sample value =
                w[0] * tone(at == 0 ? 0 : at - 1) + w[1] * tone(at) + w[2] * tone(at + 1) + w[3] * tone(at + 2);
            spectrum[i] = value * Sample(phase);
            phase *= step;
        }
    }

    /// Of a spectrum as above, of which nothing is left; what is still to come at its end fades.
    void samplesOf(RealFft::Spectrum& spectrum, std::vector<float>& samples) const {
        samples.resize(fft_->size());
        fft_->inverse(std::move(spectrum), samples);
        const std::size_t size = samples.size();
        // What is to come later than its end comes round: little else than a level, which is 0 before the delay.
        const std::size_t before = size / 32;
        const float level = std::accumulate(samples.end() - static_cast<std::ptrdiff_t>(before), samples.end(), 0.0f) /
                            static_cast<float>(before);
        for (float& sample : samples) sample -= level;
        for (std::size_t i = 0; i < begin_.size(); ++i) samples[i] *= begin_[i];
        for (std::size_t i = 0; i < end_.size(); ++i) samples[size - 1 - i] *= end_[i];
    }

    const RealFft& fft() const { return *fft_; }

  private:
    /// Between which tones a bin lies, and what of four of them counts there.
    struct Place {
        std::size_t tone = 0;
        std::array<float, 4> weights{};
    };

    double rate_;
    std::shared_ptr<const RealFft> fft_;
    std::vector<Place> places_;
    std::vector<float> begin_, end_;  // what is left of the first samples, and of the last ones from the end on
};

/// Samples from `at` on, which may be below 0.
void addAt(std::span<const float> samples, std::ptrdiff_t at, float gain, std::vector<float>& channel) {
    const std::ptrdiff_t end = std::min(std::ssize(samples), std::ssize(channel) - at);
    for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, -at); i < end; ++i)
        channel[static_cast<std::size_t>(at + i)] += gain * samples[static_cast<std::size_t>(i)];
}

/// Through a head.
void addThroughHead(const EdgeWave& wave, const WaveResponses& responses, const ImpulseResponseOptions& options,
                    std::vector<std::vector<float>>& channels) {
    const glm::dvec3 local = inListenersFrame(wave.direction, options);
    const Hrtf::Ears measured = options.hrtf->at(local);
    const double position = wave.seconds * options.sampleRate - static_cast<double>(options.hrtf->early());
    const double whole = std::floor(position);
    RealFft::Spectrum bare, head, spectrum;
    responses.spectrumOf(wave, position - whole, bare);
    std::vector<float> samples;
    for (std::size_t ear = 0; ear < 2; ++ear) {
        samples.assign(responses.fft().size(), 0.0f);
        std::copy_n(measured[ear].begin(), std::min(measured[ear].size(), samples.size()), samples.begin());
        responses.fft().forward(samples, head);
        spectrum.resize(bare.size());
        for (std::size_t i = 0; i < bare.size(); ++i) spectrum[i] = bare[i] * head[i];
        responses.samplesOf(spectrum, samples);
        addAt(samples, static_cast<std::ptrdiff_t>(whole) - static_cast<std::ptrdiff_t>(kBefore), 1, channels[ear]);
    }
}

}  // namespace

void weaken(EdgeTonePressures& pressure, double sent, const Bands& attenuation, double way) {
    for (std::size_t tone = 0; tone < kEdgeTones; ++tone)
        pressure[tone] *= static_cast<float>(
            std::sqrt(sent * std::exp(-attenuation[tone * static_cast<std::size_t>(kBandCount) / kEdgeTones] * way)));
}

EdgeWave straightWave(const glm::dvec3& from, const glm::dvec3& listener, double speedOfSound) {
    const glm::dvec3 middle = 0.5 * (from + listener);
    const double way = glm::distance(from, listener);
    EdgeWave wave;
    wave.seconds = way / speedOfSound;
    wave.direction = (from - listener) / way;
    wave.route = {middle, middle, glm::dvec3(0), glm::dvec3(0)};
    return wave;
}

bool isFaint(const EdgeTonePressures& pressure, double way) {
    return std::ranges::all_of(pressure,
                               [&](const Sample& tone) { return !(static_cast<double>(std::abs(tone)) * way > 1e-4); });
}

std::size_t edgeWaveFrames(int sampleRate) {
    return RealFft::sizeFor(static_cast<std::size_t>(0.15 * sampleRate));
}

void addEdgeWaves(const Echogram& echogram, const ImpulseResponseOptions& options,
                  std::vector<std::vector<float>>& channels) {
    if (echogram.edges.waves.empty()) return;
    const WaveResponses& responses = WaveResponses::kept(options.sampleRate);
    const double first = echogram.arrivals.empty() ? 0 : echogram.arrivals.front().seconds;
    const bool heads = options.hrtf && options.channels == ImpulseResponseOptions::Channels::binaural;
    RealFft::Spectrum spectrum;
    std::vector<float> samples;
    for (const EdgeWave& wave : echogram.edges.waves) {
        if (wave.order < options.firstOrder) continue;
        if (heads && wave.seconds <= first + options.hrtfSeconds) {
            addThroughHead(wave, responses, options, channels);
            continue;
        }
        double made = -1;  // the delay that `samples` have
        for (std::size_t c = 0; c < channels.size(); ++c) {
            const ArrivalPan pan = panOf(wave.direction, static_cast<int>(c), options);
            const double position = std::max(0.0, (wave.seconds + pan.delay) * options.sampleRate);
            const double whole = std::floor(position);
            if (position != made) {
                responses.spectrumOf(wave, position - whole, spectrum);
                responses.samplesOf(spectrum, samples);
                made = position;
            }
            addAt(samples, static_cast<std::ptrdiff_t>(whole) - static_cast<std::ptrdiff_t>(kBefore),
                  static_cast<float>(pan.gain), channels[c]);
        }
    }
}

}  // namespace rtsg
