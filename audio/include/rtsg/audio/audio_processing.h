// The arithmetic of the audio graph's nodes on samples: filter, delay, compressor, shaper, spectrum, periodic wave.
//
// The arithmetic is that of the Web Audio API, from which X3D takes these nodes; states are in double precision. If
// defaults differ, those of X3D count. Threading: one thread an object; free functions are pure. Source: W3C Web Audio
// API 1.1, sections 1.8 (AnalyserNode), 1.13 (BiquadFilterNode), 1.18 (DelayNode), 1.19 (DynamicsCompressorNode), 1.28
// (PeriodicWave), 1.31 (WaveShaperNode).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace rtsg {

/// A filter with two poles and two zeros, for one channel.
class Biquad {
  public:
    enum class Type : std::uint8_t { lowpass, highpass, bandpass, lowshelf, highshelf, peaking, notch, allpass };
    /// y[n] = b0 x[n] + b1 x[n-1] + b2 x[n-2] - a1 y[n-1] - a2 y[n-2]
    struct Coefficients {
        double b0 = 1, b1 = 0, b2 = 0, a1 = 0, a2 = 0;
    };
    /// `q` is in dB for lowpass and highpass; `gainDb` is used by shelves and peaking only.
    static Coefficients coefficients(Type type, double hz, double sampleRate, double q, double gainDb);

    void process(const Coefficients& c, std::span<float> samples);

  private:
    double x1_ = 0, x2_ = 0, y1_ = 0, y2_ = 0;
};

/// A delay of one channel, with linear interpolation between samples.
class AudioDelay {
  public:
    /// 0 <= delay, in samples; the delay may change from block to block.
    void process(double delay, std::span<float> samples);

  private:
    std::vector<float> ring_;
    std::size_t written_ = 0;
};

/// Compresses all channels by the same gain, which follows the loudest.
class Compressor {
  public:
    struct Settings {
        double thresholdDb = -24, kneeDb = 30, ratio = 12;
        double attack = 0.003, release = 0.25;  // seconds for 10 dB
        friend bool operator==(const Settings&, const Settings&) = default;
    };
    /// The static curve from amplitude to amplitude: linear up to the threshold, curved over the knee, and above it
    /// with a slope of 1 / ratio in decibels.
    static double curve(const Settings& settings, double amplitude);
    /// The make-up gain: (1 / curve(1)) to the power of .6.
    static double makeUp(const Settings& settings);

    void process(const Settings& settings, double sampleRate, std::span<std::vector<float>> channels);
    /// The gain of the compressor at the last sample in dB, at most 0; without make-up gain.
    double reductionDb() const;

  private:
    double gain_ = 1;
    std::vector<AudioDelay> ahead_;  // by channel: 6 ms
    std::vector<double> gains_;      // of a block
};

/// A curve over -1 to 1, linear between its points. Without points it changes nothing.
float shaped(std::span<const float> curve, float x);

/// Applies a curve to one channel at a multiple of the sample rate, so that frequencies above half the rate which the
/// curve adds do not alias. The resampling filters (Kaiser window, 100 dB) pass up to .45 of the rate and add a delay.
class OversampledShaper {
  public:
    /// The delay of the output, in samples.
    static constexpr std::size_t kDelay = 128;

    /// `factor`: 2 or 4; another factor than before resets the filters.
    void process(std::span<const float> curve, unsigned factor, std::span<float> samples);

  private:
    void begin(unsigned factor);

    unsigned factor_ = 0;
    std::vector<double> filter_;      // at the higher rate
    std::vector<double> low_, high_;  // the last samples at either rate, stored twice so that they are contiguous
    std::size_t lowAt_ = 0, highAt_ = 0;
};

/// The spectrum of the last fftSize samples (a power of two, 32 to 32768) by a Blackman window: fftSize / 2 bins in
/// decibels.
class SpectrumAnalyser {
  public:
    explicit SpectrumAnalyser(std::size_t fftSize = 2048);
    void write(std::span<const float> samples);
    /// Smoothed with the result of the last call.
    std::vector<double> decibels(double smoothing);

  private:
    std::vector<float> ring_;
    std::size_t written_ = 0;
    std::vector<double> smoothed_;
};

/// One period of a wave as a Fourier series.
class PeriodicWave {
  public:
    /// SINE, SQUARE, SAWTOOTH, TRIANGLE; anything else is SINE.
    static PeriodicWave named(std::string_view type);
    /// A wave made of cosines and sines, scaled to a peak of 1. The first number of each is ignored.
    static PeriodicWave custom(std::span<const float> real, std::span<const float> imag);

    /// The value at `phase` periods, from the harmonics up to `most`.
    double at(double phase, std::size_t maximum) const;
    std::size_t harmonics() const { return cosines_.size() - 1; }

  private:
    void normalise();
    std::vector<double> cosines_{0}, sines_{0};
};

}  // namespace rtsg
