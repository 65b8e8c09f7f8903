// Makes samples of diffracted sound: the spectrum between the tones, turned by its delay, transformed back into time.
#include "diffraction_waves.h"

#include <algorithm>
#include <array>
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

/// Samples within which the waves that one transform makes begin: so much less is left of the transform for what edges
/// do to the lowest tones of the last of them.
constexpr std::size_t kTogether = 2048;
/// The largest share of an octave's energy that all waves which are left out have together: 40 dB below what arrives.
constexpr double kLeftOut = 1e-4;

/// Complex numbers with their parts apart, as vector instructions want them.
struct Parts {
    std::vector<float> real, imaginary;

    void assign(std::size_t count, float value) {
        real.assign(count, value);
        imaginary.assign(count, value);
    }
};

/// The responses of waves, by one transform that is long enough for what edges do to the lowest tones.
class WaveResponses {
  public:
    explicit WaveResponses(int sampleRate) : rate_(sampleRate), fft_(RealFft::kept(edgeWaveFrames(sampleRate))) {
        const auto bins = static_cast<double>(fft_->bins());
        const double lowest = std::log2(edgeToneHz(0)), inOctave = 1 / (std::log2(edgeToneHz(1)) - lowest);
        for (std::vector<float>& weights : weights_) weights.resize(fft_->bins());
        for (std::size_t i = 0; i < fft_->bins(); ++i) {
            const double hz = static_cast<double>(i) * rate_ / static_cast<double>(fft_->size());
            // Below the lowest tone, 22 Hz, it is as there, beyond the last one as there.
            const double tone = std::clamp((std::log2(std::max(hz, 1.0)) - lowest) * inOctave, 0.0,
                                           static_cast<double>(kEdgeTones - 1));
            const std::size_t at = std::min(static_cast<std::size_t>(tone), kEdgeTones - 2);
            if (spans_.empty() || spans_.back().tone != at) spans_.push_back({at, i});
            spans_.back().end = i + 1;
            const auto t = static_cast<float>(tone - static_cast<double>(at));
            const double high = std::clamp((static_cast<double>(i) / bins - 0.92) / 0.08, 0.0, 1.0);
            const auto left = static_cast<float>(0.5 + 0.5 * std::cos(std::numbers::pi * high));
            // Catmull and Rom's cubic.
            weights_[0][i] = left * t * (-1 + t * (2 - t)) / 2;
            weights_[1][i] = left * (2 + t * t * (3 * t - 5)) / 2;
            weights_[2][i] = left * t * (1 + t * (4 - 3 * t)) / 2;
            weights_[3][i] = left * t * t * (t - 1) / 2;
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

    /// The spectrum of a wave that comes `delay` samples after the first one, at the rate of the response.
    void spectrumOf(const EdgeWave& wave, double delay, Parts& spectrum) const {
        spectrum.real.resize(fft_->bins());
        spectrum.imaginary.resize(fft_->bins());
        for (const Span& span : spans_) {
            const auto tone = [&](std::size_t t) { return wave.pressure[std::min(t, kEdgeTones - 1)]; };
            const std::array<Sample, 4> four{tone(span.tone == 0 ? 0 : span.tone - 1), tone(span.tone),
                                             tone(span.tone + 1), tone(span.tone + 2)};
            for (std::size_t i = span.begin; i < span.end; ++i) {
                spectrum.real[i] = weights_[0][i] * four[0].real() + weights_[1][i] * four[1].real() +
                                   weights_[2][i] * four[2].real() + weights_[3][i] * four[3].real();
                spectrum.imaginary[i] = weights_[0][i] * four[0].imag() + weights_[1][i] * four[1].imag() +
                                        weights_[2][i] * four[2].imag() + weights_[3][i] * four[3].imag();
            }
        }
        shiftPhase(-2 * std::numbers::pi * delay / static_cast<double>(fft_->size()), spectrum);
    }

    /// The samples of a spectrum as above; sound that is still to come at the end fades.
    void samplesOf(const Parts& parts, std::vector<float>& samples) const {
        RealFft::Spectrum spectrum(fft_->bins());
        for (std::size_t i = 0; i < spectrum.size(); ++i) spectrum[i] = {parts.real[i], parts.imaginary[i]};
        samples.resize(fft_->size());
        fft_->inverse(std::move(spectrum), samples);
        const std::size_t size = samples.size();
        // Sound after the end wraps round to the beginning, as little else than a level, which is 0 before the delay.
        const std::size_t before = size / 32;
        const float level = std::accumulate(samples.end() - static_cast<std::ptrdiff_t>(before), samples.end(), 0.0f) /
                            static_cast<float>(before);
        for (float& sample : samples) sample -= level;
        for (std::size_t i = 0; i < begin_.size(); ++i) samples[i] *= begin_[i];
        for (std::size_t i = 0; i < end_.size(); ++i) samples[size - 1 - i] *= end_[i];
    }

    const RealFft& fft() const { return *fft_; }

  private:
    /// Bins between two tones.
    struct Span {
        std::size_t tone = 0, begin = 0, end = 0;
    };

    /// Each bin by `step` radians more than the one before it: by tables of few bins and of many.
    static void shiftPhase(double step, Parts& spectrum) {
        constexpr std::size_t kFew = 64;
        std::array<float, kFew> real, imaginary;
        const std::complex<double> fine = std::polar(1.0, step), coarse = std::polar(1.0, step * kFew);
        std::complex<double> phase = 1;
        for (std::size_t i = 0; i < kFew; ++i, phase *= fine) {
            real[i] = static_cast<float>(phase.real());
            imaginary[i] = static_cast<float>(phase.imag());
        }
        phase = 1;
        for (std::size_t from = 0; from < spectrum.real.size(); from += kFew, phase *= coarse) {
            const auto c = static_cast<float>(phase.real()), s = static_cast<float>(phase.imag());
            const std::size_t count = std::min(kFew, spectrum.real.size() - from);
            float *const x = spectrum.real.data() + from, *const y = spectrum.imaginary.data() + from;
            for (std::size_t i = 0; i < count; ++i) {
                const float re = c * real[i] - s * imaginary[i], im = c * imaginary[i] + s * real[i];
                const float was = x[i];
                x[i] = was * re - y[i] * im;
                y[i] = was * im + y[i] * re;
            }
        }
    }

    double rate_;
    std::shared_ptr<const RealFft> fft_;
    std::vector<Span> spans_;
    std::array<std::vector<float>, 4> weights_;  // by bin: what of four tones counts there
    std::vector<float> begin_, end_;             // factors for the first samples, and for the last ones from the end on
};

/// Samples from `at` on, which may be below 0.
void addAt(std::span<const float> samples, std::ptrdiff_t at, std::vector<float>& channel) {
    const std::ptrdiff_t end = std::min(std::ssize(samples), std::ssize(channel) - at);
    for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, -at); i < end; ++i)
        channel[static_cast<std::size_t>(at + i)] += samples[static_cast<std::size_t>(i)];
}

/// A wave as it arrives in each channel; through a head, in both ears at once, with the head's response.
struct Heard {
    const EdgeWave* wave = nullptr;
    bool throughHead = false;
    std::vector<ArrivalPan> pans;   // but through a head
    std::vector<double> positions;  // by channel, samples
    double first = 0;               // of these
};

/// Sorted by time.
std::vector<Heard> heardBy(const std::vector<const EdgeWave*>& waves, double firstArrival,
                           const ImpulseResponseOptions& options, std::size_t channels) {
    const bool heads = options.hrtf && options.channels == ImpulseResponseOptions::Channels::binaural;
    std::vector<Heard> all;
    for (const EdgeWave* wave : waves) {
        Heard& heard = all.emplace_back();
        heard.wave = wave;
        heard.throughHead = heads && wave->seconds <= firstArrival + options.hrtfSeconds;
        for (std::size_t c = 0; c < channels; ++c) {
            const double position = wave->seconds * options.sampleRate;
            if (heard.throughHead) {
                heard.positions.push_back(position - static_cast<double>(options.hrtf->early()));
                continue;
            }
            heard.pans.push_back(panOf(wave->direction, static_cast<int>(c), options));
            heard.positions.push_back(std::max(0.0, position + heard.pans.back().delay * options.sampleRate));
        }
        heard.first = std::ranges::min(heard.positions);
    }
    std::ranges::stable_sort(all, {}, &Heard::first);
    return all;
}

/// Sums what begins together, and makes samples of it.
class WaveSum {
  public:
    WaveSum(const WaveResponses& responses, const ImpulseResponseOptions& options, std::size_t channels)
        : responses_(responses), options_(options), sums_(channels) {}

    void add(std::span<const Heard> together, std::vector<std::vector<float>>& channels) {
        const double base = std::floor(together.front().first) - static_cast<double>(kBefore);
        for (Parts& sum : sums_) sum.assign(responses_.fft().bins(), 0);
        for (const Heard& heard : together) {
            glm::dvec3 local(0);
            Hrtf::Ears ears;
            if (heard.throughHead) {
                local = inListenersFrame(heard.wave->direction, options_);
                ears = options_.hrtf->at(local);
            }
            double created = -1;  // the delay that the spectrum has
            for (std::size_t c = 0; c < sums_.size(); ++c) {
                if (const double delay = heard.positions[c] - base; delay != created) {
                    responses_.spectrumOf(*heard.wave, delay, spectrum_);
                    created = delay;
                }
                if (heard.throughHead)
                    addThroughEar(ears[c], sums_[c]);
                else
                    addPanned(static_cast<float>(heard.pans[c].gain), sums_[c]);
            }
        }
        for (std::size_t c = 0; c < sums_.size(); ++c) {
            responses_.samplesOf(sums_[c], samples_);
            addAt(samples_, static_cast<std::ptrdiff_t>(base), channels[c]);
        }
    }

  private:
    void addPanned(float gain, Parts& sum) const {
        if (gain == 0) return;
        for (std::size_t i = 0; i < sum.real.size(); ++i) {
            sum.real[i] += gain * spectrum_.real[i];
            sum.imaginary[i] += gain * spectrum_.imaginary[i];
        }
    }
    void addThroughEar(const std::vector<float>& ear, Parts& sum) {
        samples_.assign(responses_.fft().size(), 0.0f);
        std::copy_n(ear.begin(), std::min(ear.size(), samples_.size()), samples_.begin());
        responses_.fft().forward(samples_, head_);
        for (std::size_t i = 0; i < sum.real.size(); ++i) {
            const float x = head_[i].real(), y = head_[i].imag();
            sum.real[i] += x * spectrum_.real[i] - y * spectrum_.imaginary[i];
            sum.imaginary[i] += x * spectrum_.imaginary[i] + y * spectrum_.real[i];
        }
    }

    const WaveResponses& responses_;
    const ImpulseResponseOptions& options_;
    std::vector<Parts> sums_;
    Parts spectrum_;
    RealFft::Spectrum head_;
    std::vector<float> samples_;
};

/// Without the faintest: as many as together have kLeftOut of the energy of no octave.
std::vector<const EdgeWave*> wavesThatCount(const Echogram& echogram, std::uint32_t firstOrder) {
    const Bands total = echogram.total();
    struct Fraction {
        const EdgeWave* wave = nullptr;
        Bands of{};
        double maximum = 0;
    };
    std::vector<Fraction> fractions;
    for (const EdgeWave& wave : echogram.edges.waves) {
        if (wave.order < firstOrder) continue;
        Fraction& fraction = fractions.emplace_back(&wave);
        for (std::size_t tone = 0; tone < kEdgeTones; ++tone)
            fraction.of[tone * static_cast<std::size_t>(kBandCount) / kEdgeTones] +=
                static_cast<double>(std::norm(wave.pressure[tone])) * kBandCount / kEdgeTones;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            // Any share of no energy is large.
            fraction.of[b] = fraction.of[b] == 0 ? 0 : fraction.of[b] / (4 * std::numbers::pi * total[b]);
            fraction.maximum = std::max(fraction.maximum, fraction.of[b]);
        }
    }
    std::ranges::stable_sort(fractions, {}, &Fraction::maximum);
    Bands sum{};
    std::vector<const EdgeWave*> waves;
    for (const Fraction& fraction : fractions) {
        bool counts = !waves.empty();
        for (std::size_t b = 0; b < kBandCount; ++b) counts = counts || !((sum[b] += fraction.of[b]) <= kLeftOut);
        if (counts) waves.push_back(fraction.wave);
    }
    return waves;
}

}  // namespace

void weaken(EdgeTonePressures& pressure, double sent, const Bands& attenuation, double pathLength) {
    for (std::size_t tone = 0; tone < kEdgeTones; ++tone)
        pressure[tone] *= static_cast<float>(std::sqrt(
            sent * std::exp(-attenuation[tone * static_cast<std::size_t>(kBandCount) / kEdgeTones] * pathLength)));
}

EdgeWave straightWave(const glm::dvec3& from, const glm::dvec3& listener, double speedOfSound) {
    const glm::dvec3 middle = 0.5 * (from + listener);
    const double pathLength = glm::distance(from, listener);
    EdgeWave wave;
    wave.seconds = pathLength / speedOfSound;
    wave.direction = (from - listener) / pathLength;
    wave.route = {middle, middle, glm::dvec3(0), glm::dvec3(0)};
    return wave;
}

bool isFaint(const EdgeTonePressures& pressure, double pathLength) {
    return std::ranges::all_of(
        pressure, [&](const Sample& tone) { return !(static_cast<double>(std::abs(tone)) * pathLength > 1e-4); });
}

std::size_t edgeWaveFrames(int sampleRate) {
    return RealFft::sizeFor(static_cast<std::size_t>(0.15 * sampleRate));
}

void addEdgeWaves(const Echogram& echogram, const ImpulseResponseOptions& options,
                  std::vector<std::vector<float>>& channels) {
    const std::vector<const EdgeWave*> waves = wavesThatCount(echogram, options.firstOrder);
    if (waves.empty()) return;
    const double first = echogram.arrivals.empty() ? 0 : echogram.arrivals.front().seconds;
    const std::vector<Heard> all = heardBy(waves, first, options, channels.size());
    WaveSum sum(WaveResponses::kept(options.sampleRate), options, channels.size());
    for (auto from = all.begin(); from != all.end();) {
        const double end = from->first + static_cast<double>(kTogether);
        const auto to = std::ranges::find_if(from, all.end(), [&](const Heard& one) { return !(one.first < end); });
        sum.add(std::span(from, to), channels);
        from = to;
    }
}

}  // namespace rtsg
