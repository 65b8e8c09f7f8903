// PoleBank: a filter with a smooth spectrum over the logarithm of frequency, which may change in every block.
//
// It is a weighted sum of one-pole low passes, which are fixed, and of a few samples around each. A response as long as
// that of an edge, 1 / sqrt(t), needs only 25 weights, and interpolating the weights between two sets is inaudible.
// PoleFit finds weights for a spectrum by least squares. Threading: one thread per object; PoleFit is const.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace rtsg {

class PoleBank {
  public:
    static constexpr std::size_t kPoles = 8;
    static constexpr std::size_t kAhead = 8;  // samples that it looks ahead, and back as many
    static constexpr std::size_t kTaps = 2 * kAhead + 1, kWeights = kPoles + kTaps;
    /// Weights of the poles, from the lowest on; then those of the samples, from the last one on.
    using Weights = std::array<float, kWeights>;

    explicit PoleBank(int sampleRate);
    /// Forgets its input.
    void restart();
    /// `ahead`: the samples kAhead later. Weights change linearly from those of the block before to those of this one.
    void process(std::span<const float> ahead, const Weights& before, const Weights& now, std::span<float> heard);

    /// The factors by which they multiply their last values.
    static std::array<double, kPoles> poles(int sampleRate);

  private:
    using Eight = float __attribute__((vector_size(32)));
    static_assert(sizeof(Eight) == kPoles * sizeof(float));

    void addTaps(const Weights& before, const Weights& now, std::span<float> heard) const;
    void addPoles(const Weights& before, const Weights& now, std::span<float> heard);

    std::array<float, kPoles> keeps_, values_{};
    std::vector<float> input_ = std::vector<float>(kTaps - 1);  // with what came before it
};

class PoleFit {
  public:
    using Weights = std::array<double, PoleBank::kWeights>;

    /// For spectra at these frequencies, of which those next to half the sample rate do not count.
    PoleFit(int sampleRate, std::vector<double> hz);
    const std::vector<double>& hz() const { return hz_; }
    Weights weightsOf(std::span<const std::complex<double>> spectrum) const;
    /// At one of the frequencies.
    std::complex<double> valueOf(const Weights& weights, std::size_t at) const;

  private:
    std::vector<double> hz_;
    std::vector<std::array<std::complex<double>, PoleBank::kWeights>> values_;  // by frequency
    // the contribution of a part of a value to each
    std::vector<PoleFit::Weights> ofReal_, ofImaginary_;
};

}  // namespace rtsg
