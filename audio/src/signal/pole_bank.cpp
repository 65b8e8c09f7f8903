// One-pole filters side by side, and the weights by which their sum comes next to a spectrum.
#include "pole_bank.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <utility>

namespace rtsg {

std::array<double, PoleBank::kPoles> PoleBank::poles(int sampleRate) {
    // From below the audible range up to where the samples beside it are enough, evenly by octaves.
    constexpr double kLowest = 8;
    const double highest = 0.1 * sampleRate, step = std::pow(highest / kLowest, 1.0 / (kPoles - 1));
    std::array<double, kPoles> keeps;
    for (std::size_t k = 0; k < kPoles; ++k)
        keeps[k] = std::exp(-2 * std::numbers::pi * kLowest * std::pow(step, static_cast<double>(k)) / sampleRate);
    return keeps;
}

PoleBank::PoleBank(int sampleRate) {
    const auto keeps = poles(sampleRate);
    std::ranges::copy(keeps, keeps_.begin());
}

void PoleBank::restart() {
    values_.fill(0);
    input_.assign(kTaps - 1, 0.0f);
}

void PoleBank::process(std::span<const float> ahead, const Weights& before, const Weights& now,
                       std::span<float> heard) {
    input_.resize(kTaps - 1 + ahead.size());
    std::ranges::copy(ahead, input_.begin() + (kTaps - 1));
    std::ranges::fill(heard, 0.0f);
    addTaps(before, now, heard);
    addPoles(before, now, heard);
    std::copy_n(input_.end() - (kTaps - 1), kTaps - 1, input_.begin());
    // The rest of a sound long gone must not become denormal numbers, with which processors are slow.
    for (float& value : values_)
        if (std::abs(value) < 1e-30f) value = 0;
}

void PoleBank::addTaps(const Weights& before, const Weights& now, std::span<float> heard) const {
    const float step = 1 / static_cast<float>(heard.size());
    for (std::size_t t = 0; t < kTaps; ++t) {
        const float from = before[kPoles + t], lane = (now[kPoles + t] - from) * step;
        const float* const input = input_.data() + (kTaps - 1 - t);
        for (std::size_t i = 0; i < heard.size(); ++i) heard[i] += input[i] * (from + lane * static_cast<float>(i + 1));
    }
}

void PoleBank::addPoles(const Weights& before, const Weights& now, std::span<float> heard) {
    Eight keeps, values, weights, lanes;
    std::memcpy(&keeps, keeps_.data(), sizeof keeps);
    std::memcpy(&values, values_.data(), sizeof values);
    std::memcpy(&weights, before.data(), sizeof weights);
    std::memcpy(&lanes, now.data(), sizeof lanes);
    lanes = (lanes - weights) / static_cast<float>(heard.size());
    const Eight takes = 1 - keeps;
    const float* const input = input_.data() + (kTaps - 1 - kAhead);
    for (std::size_t i = 0; i < heard.size(); ++i) {
        values = keeps * values + takes * input[i];
        const Eight parts = values * (weights + lanes * static_cast<float>(i + 1));
        heard[i] += ((parts[0] + parts[1]) + (parts[2] + parts[3])) + ((parts[4] + parts[5]) + (parts[6] + parts[7]));
    }
    std::memcpy(values_.data(), &values, sizeof values);
}

namespace {

/// Solves by Cholesky's factors of a symmetric matrix, which are left in it: one right side after the other.
class Factors {
  public:
    static constexpr std::size_t kSize = PoleBank::kWeights;
    using Row = std::array<double, kSize>;

    explicit Factors(const std::array<Row, kSize>& matrix) : f_(matrix) {
        for (std::size_t j = 0; j < kSize; ++j) {
            for (std::size_t k = 0; k < j; ++k) f_[j][j] -= f_[j][k] * f_[j][k];
            f_[j][j] = std::sqrt(f_[j][j]);
            for (std::size_t i = j + 1; i < kSize; ++i) {
                for (std::size_t k = 0; k < j; ++k) f_[i][j] -= f_[i][k] * f_[j][k];
                f_[i][j] /= f_[j][j];
            }
        }
    }
    Row solve(Row x) const {
        for (std::size_t i = 0; i < kSize; ++i) {
            for (std::size_t k = 0; k < i; ++k) x[i] -= f_[i][k] * x[k];
            x[i] /= f_[i][i];
        }
        for (std::size_t i = kSize; i-- > 0;) {
            for (std::size_t k = i + 1; k < kSize; ++k) x[i] -= f_[k][i] * x[k];
            x[i] /= f_[i][i];
        }
        return x;
    }

  private:
    std::array<Row, kSize> f_;
};

}  // namespace

PoleFit::PoleFit(int sampleRate, std::vector<double> hz) : hz_(std::move(hz)) {
    // Small enough to have an effect only where weights would be large without need.
    constexpr double kRidge = 1e-9, kTop = 0.45;
    const auto keeps = PoleBank::poles(sampleRate);
    std::array<Factors::Row, Factors::kSize> normal{};
    for (std::size_t k = 0; k < Factors::kSize; ++k) normal[k][k] = kRidge;
    std::vector<double> counts;
    for (const double f : hz_) {
        const double angle = 2 * std::numbers::pi * f / sampleRate;
        auto& of = values_.emplace_back();
        for (std::size_t k = 0; k < PoleBank::kPoles; ++k)
            of[k] = (1 - keeps[k]) / (1.0 - std::polar(keeps[k], -angle));
        for (std::size_t t = 0; t < PoleBank::kTaps; ++t)
            of[PoleBank::kPoles + t] =
                std::polar(1.0, angle * (static_cast<double>(PoleBank::kAhead) - static_cast<double>(t)));
        // Edges diffract high tones less than low ones; the small values must be accurate, too.
        const double count = f < kTop * sampleRate ? std::sqrt(f / 1000) : 0;
        counts.push_back(count);
        for (std::size_t i = 0; i < Factors::kSize; ++i)
            for (std::size_t j = 0; j < Factors::kSize; ++j)
                normal[i][j] += count * (of[i].real() * of[j].real() + of[i].imag() * of[j].imag());
    }
    const Factors factors(normal);
    for (std::size_t at = 0; at < hz_.size(); ++at) {
        Factors::Row real, imaginary;
        for (std::size_t k = 0; k < Factors::kSize; ++k) {
            real[k] = counts[at] * values_[at][k].real();
            imaginary[k] = counts[at] * values_[at][k].imag();
        }
        ofReal_.push_back(factors.solve(real));
        ofImaginary_.push_back(factors.solve(imaginary));
    }
}

PoleFit::Weights PoleFit::weightsOf(std::span<const std::complex<double>> spectrum) const {
    Weights weights{};
    for (std::size_t at = 0; at < spectrum.size(); ++at)
        for (std::size_t k = 0; k < weights.size(); ++k)
            weights[k] += spectrum[at].real() * ofReal_[at][k] + spectrum[at].imag() * ofImaginary_[at][k];
    return weights;
}

std::complex<double> PoleFit::valueOf(const Weights& weights, std::size_t at) const {
    std::complex<double> sum;
    for (std::size_t k = 0; k < weights.size(); ++k) sum += weights[k] * values_[at][k];
    return sum;
}

}  // namespace rtsg
