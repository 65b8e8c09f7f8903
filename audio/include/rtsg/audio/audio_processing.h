// The arithmetic of the audio graph's nodes on samples: filter, delay, compressor, shaper, spectrum, periodic wave.
//
// It is that of the Web Audio API, from which X3D takes these nodes; states are in double precision. If X3D's tables
// have other defaults, the scene's count. Threading: one thread an object; free functions are pure. Source:
// W3C Web Audio API 1.1, sections 1.8 (AnalyserNode), 1.13 (BiquadFilterNode), 1.18 (DelayNode), 1.19
// (DynamicsCompressorNode), 1.28 (PeriodicWave), 1.31 (WaveShaperNode).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace rtsg {

/// One channel through a filter of two poles and two zeros.
class Biquad {
  public:
    enum class Type : std::uint8_t { lowpass, highpass, bandpass, lowshelf, highshelf, peaking, notch, allpass };
    /// y[n] = b0 x[n] + b1 x[n-1] + b2 x[n-2] - a1 y[n-1] - a2 y[n-2]
    struct Coefficients {
        double b0 = 1, b1 = 0, b2 = 0, a1 = 0, a2 = 0;
    };
    /// `q` is in dB for lowpass and highpass; `gainDb` counts for shelves and peaking alone.
    static Coefficients coefficients(Type type, double hz, double sampleRate, double q, double gainDb);

    void process(const Coefficients& c, std::span<float> samples);

  private:
    double x1_ = 0, x2_ = 0, y1_ = 0, y2_ = 0;
};

/// One channel, later; between samples linear.
class AudioDelay {
  public:
    /// 0 <= delay, in samples; it may differ from block to block.
    void process(double delay, std::span<float> samples);

  private:
    std::vector<float> ring_;
    std::size_t written_ = 0;
};

/// All channels alike, by the loudest.
class Compressor {
  public:
    struct Settings {
        double thresholdDb = -24, kneeDb = 30, ratio = 12;
        double attack = 0.003, release = 0.25;  // seconds for 10 dB
        friend bool operator==(const Settings&, const Settings&) = default;
    };
    /// The static curve: an amplitude for an amplitude. Straight up to the threshold, bent over the knee, from there on
    /// 1 / ratio in decibels.
    static double curve(const Settings& settings, double amplitude);
    /// The gain after compression: (1 / curve(1)) to the power of .6.
    static double makeUp(const Settings& settings);

    void process(const Settings& settings, double sampleRate, std::span<std::vector<float>> channels);
    /// dB by which the last sample was reduced, at most 0; without make-up.
    double reductionDb() const;

  private:
    double gain_ = 1;
    std::vector<AudioDelay> ahead_;  // by channel: 6 ms
    std::vector<double> gains_;      // of a block
};

/// A curve over -1 to 1, linear between its points; as it is without any.
float shaped(std::span<const float> curve, float x);

/// One channel through a curve at several times the rate, so that what the curve adds above half the rate does not come
/// back as other tones. The filters on both ways (Kaiser's window, 100 dB) let pass up to .45 of the rate and are late.
class OversampledShaper {
  public:
    /// Samples by which what comes out is later than without.
    static constexpr std::size_t kDelay = 128;

    /// `factor`: 2 or 4; another one than before begins anew.
    void process(std::span<const float> curve, unsigned factor, std::span<float> samples);

  private:
    void begin(unsigned factor);

    unsigned factor_ = 0;
    std::vector<double> filter_;      // at the higher rate
    std::vector<double> low_, high_;  // the last samples at either rate, twice each so that they lie in a row
    std::size_t lowAt_ = 0, highAt_ = 0;
};

/// Decibels of each of fftSize / 2 bins, by a Blackman window over the last fftSize samples (a power of two, 32 to
/// 32768).
class SpectrumAnalyser {
  public:
    explicit SpectrumAnalyser(std::size_t fftSize = 2048);
    void write(std::span<const float> samples);
    /// Smoothed with what the last call gave.
    std::vector<double> decibels(double smoothing);

  private:
    std::vector<float> ring_;
    std::size_t written_ = 0;
    std::vector<double> smoothed_;
};

/// One turn of a wave as a Fourier series.
class PeriodicWave {
  public:
    /// SINE, SQUARE, SAWTOOTH, TRIANGLE; anything else is SINE.
    static PeriodicWave named(std::string_view type);
    /// A wave made of cosines and sines, scaled to a peak of 1. The first number of each is ignored.
    static PeriodicWave custom(std::span<const float> real, std::span<const float> imag);

    /// At `phase` turns, of the harmonics up to `most`.
    double at(double phase, std::size_t most) const;
    std::size_t harmonics() const { return cosines_.size() - 1; }

  private:
    void normalise();
    std::vector<double> cosines_{0}, sines_{0};
};

}  // namespace rtsg
