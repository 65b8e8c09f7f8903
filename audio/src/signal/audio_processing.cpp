// The arithmetic of audio nodes.
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <rtsg/audio/audio_processing.h>

namespace rtsg {
namespace {

constexpr double kPi = std::numbers::pi;

double decibelsOf(double amplitude) {
    return 20 * std::log10(std::max(amplitude, 1e-30));
}
double amplitudeOf(double decibels) {
    return std::pow(10.0, decibels / 20);
}

/// At the ends of the spectrum the formulas have no value: uses their limits.
bool atTheEnds(Biquad::Type type, double fraction, double q, double a, Biquad::Coefficients& c) {
    using enum Biquad::Type;
    const auto flat = [&](double gain) {
        c = {gain, 0, 0, 0, 0};
        return true;
    };
    const bool low = !(fraction > 0), high = fraction >= 1;
    switch (type) {
        case lowpass:
            return high ? flat(1) : low ? flat(0) : false;
        case highpass:
            return high ? flat(0) : low ? flat(1) : false;
        case bandpass:
            return low || high ? flat(0) : !(q > 0) ? flat(1) : false;
        case notch:
            return low || high ? flat(1) : !(q > 0) ? flat(0) : false;
        case allpass:
            return low || high ? flat(1) : !(q > 0) ? flat(-1) : false;
        case peaking:
            return low || high ? flat(1) : !(q > 0) ? flat(a * a) : false;
        case lowshelf:
            return high ? flat(a * a) : low ? flat(1) : false;
        case highshelf:
            return high ? flat(1) : low ? flat(a * a) : false;
    }
    return false;
}

}  // namespace

Biquad::Coefficients Biquad::coefficients(Type type, double hz, double sampleRate, double q, double gainDb) {
    const double a = std::pow(10.0, gainDb / 40), fraction = 2 * hz / sampleRate;
    Coefficients ends;
    if (atTheEnds(type, fraction, q, a, ends)) return ends;
    const double w = kPi * fraction, c = std::cos(w), s = std::sin(w);
    const double alpha = type == Type::lowpass || type == Type::highpass ? s / (2 * amplitudeOf(q)) : s / (2 * q);
    const double shelf = s / 2 * std::numbers::sqrt2, root = 2 * shelf * std::sqrt(a);
    double b0 = 1, b1 = 0, b2 = 0, a0 = 1 + alpha, a1 = -2 * c, a2 = 1 - alpha;
    switch (type) {
        case Type::lowpass:
            b0 = b2 = (1 - c) / 2, b1 = 1 - c;
            break;
        case Type::highpass:
            b0 = b2 = (1 + c) / 2, b1 = -(1 + c);
            break;
        case Type::bandpass:
            b0 = alpha, b2 = -alpha;
            break;
        case Type::notch:
            b0 = b2 = 1, b1 = -2 * c;
            break;
        case Type::allpass:
            b0 = 1 - alpha, b1 = -2 * c, b2 = 1 + alpha;
            break;
        case Type::peaking:
            b0 = 1 + alpha * a, b1 = -2 * c, b2 = 1 - alpha * a;
            a0 = 1 + alpha / a, a2 = 1 - alpha / a;
            break;
        case Type::lowshelf:
            b0 = a * ((a + 1) - (a - 1) * c + root), b1 = 2 * a * ((a - 1) - (a + 1) * c);
            b2 = a * ((a + 1) - (a - 1) * c - root), a0 = (a + 1) + (a - 1) * c + root;
            a1 = -2 * ((a - 1) + (a + 1) * c), a2 = (a + 1) + (a - 1) * c - root;
            break;
        case Type::highshelf:
            b0 = a * ((a + 1) + (a - 1) * c + root), b1 = -2 * a * ((a - 1) + (a + 1) * c);
            b2 = a * ((a + 1) + (a - 1) * c - root), a0 = (a + 1) - (a - 1) * c + root;
            a1 = 2 * ((a - 1) - (a + 1) * c), a2 = (a + 1) - (a - 1) * c - root;
            break;
    }
    return {b0 / a0, b1 / a0, b2 / a0, a1 / a0, a2 / a0};
}

void Biquad::process(const Coefficients& c, std::span<float> samples) {
    for (float& sample : samples) {
        const auto x = static_cast<double>(sample);
        double y = c.b0 * x + c.b1 * x1_ + c.b2 * x2_ - c.a1 * y1_ - c.a2 * y2_;
        // A value that would fade for ever ends, and one that is no number does not stay.
        if (!(std::abs(y) > 1e-30) || !std::isfinite(y)) y = 0;
        x2_ = x1_, x1_ = x, y2_ = y1_, y1_ = y;
        sample = static_cast<float>(y);
    }
}

void AudioDelay::process(double delay, std::span<float> samples) {
    const double whole = std::floor(delay);
    const auto fraction = static_cast<float>(delay - whole);
    const auto back = static_cast<std::size_t>(whole);
    if (ring_.size() < back + 2) {
        std::vector<float> larger(2 * (back + 2));
        for (std::size_t i = 1; i <= ring_.size() && i <= written_; ++i)
            larger[(written_ - i) % larger.size()] = ring_[(written_ - i) % ring_.size()];
        ring_ = std::move(larger);
    }
    const auto before = [&](std::size_t i) { return i < written_ ? ring_[(written_ - 1 - i) % ring_.size()] : 0.0f; };
    for (float& sample : samples) {
        ring_[written_++ % ring_.size()] = sample;
        sample = fraction == 0 ? before(back) : before(back) * (1 - fraction) + before(back + 1) * fraction;
    }
}

double Compressor::curve(const Settings& s, double amplitude) {
    const double x = decibelsOf(amplitude), ratio = std::max(1.0, s.ratio), knee = std::max(0.0, s.kneeDb);
    if (x <= s.thresholdDb) return amplitude;
    const double above = x - s.thresholdDb;
    // Over the knee the slope falls evenly from 1 to 1 / ratio.
    const double bent = std::min(above, knee);
    const double y =
        s.thresholdDb + bent - (knee > 0 ? (1 - 1 / ratio) * bent * bent / (2 * knee) : 0) + (above - bent) / ratio;
    return amplitudeOf(y);
}

double Compressor::makeUp(const Settings& settings) {
    return std::pow(1 / curve(settings, 1), 0.6);
}

double Compressor::reductionDb() const {
    return std::min(0.0, decibelsOf(gain_));
}

void Compressor::process(const Settings& settings, double sampleRate, std::span<std::vector<float>> channels) {
    if (channels.empty()) return;
    ahead_.resize(std::max(ahead_.size(), channels.size()));
    const double makeUpGain = makeUp(settings), lookAhead = std::round(0.006 * sampleRate);
    const double fall = amplitudeOf(-10 / std::max(1.0, settings.attack * sampleRate));
    const double rise = amplitudeOf(10 / std::max(1.0, settings.release * sampleRate));
    std::vector<double>& gains = gains_;
    gains.resize(channels[0].size());
    for (std::size_t i = 0; i < gains.size(); ++i) {
        double loudest = 0;
        for (const std::vector<float>& channel : channels)
            loudest = std::max(loudest, std::abs(static_cast<double>(channel[i])));
        const double wanted = loudest > 1e-12 ? curve(settings, loudest) / loudest : 1;
        gain_ = wanted < gain_ ? std::max(wanted, gain_ * fall) : std::min(wanted, gain_ * rise);
        gains[i] = gain_ * makeUpGain;
    }
    for (std::size_t c = 0; c < channels.size(); ++c) {
        ahead_[c].process(lookAhead, channels[c]);
        for (std::size_t i = 0; i < gains.size(); ++i)
            channels[c][i] = static_cast<float>(static_cast<double>(channels[c][i]) * gains[i]);
    }
}

float shaped(std::span<const float> curve, float x) {
    if (curve.empty()) return x;
    const double last = static_cast<double>(curve.size() - 1);
    const double at = std::clamp(last / 2 * (static_cast<double>(x) + 1), 0.0, last);
    const auto k = static_cast<std::size_t>(at);
    if (k + 1 >= curve.size()) return curve.back();
    const double fraction = at - static_cast<double>(k);
    return static_cast<float>((1 - fraction) * static_cast<double>(curve[k]) +
                              fraction * static_cast<double>(curve[k + 1]));
}

namespace {

/// Modified Bessel function of order 0, by its series.
double bessel0(double x) {
    double sum = 1, term = 1;
    for (int k = 1; term > 1e-17 * sum; ++k) {
        term *= (x / 2 / k) * (x / 2 / k);
        sum += term;
    }
    return sum;
}

/// A low pass of 2 * reach + 1 taps at `factor` times the rate, -6 dB at .475 of the rate, by Kaiser's window.
std::vector<double> halfRateFilter(unsigned factor, std::size_t reach) {
    constexpr double kBeta = 10.06;  // 100 dB: .1102 (A - 8.7)
    const double cutoff = .475 / factor, middle = static_cast<double>(reach);
    std::vector<double> taps(2 * reach + 1);
    double sum = 0;
    for (std::size_t i = 0; i < taps.size(); ++i) {
        const double t = static_cast<double>(i) - middle, fraction = t / (middle + 1);
        const double sinc = t == 0 ? 2 * cutoff : std::sin(2 * kPi * cutoff * t) / (kPi * t);
        taps[i] = sinc * bessel0(kBeta * std::sqrt(1 - fraction * fraction)) / bessel0(kBeta);
        sum += taps[i];
    }
    for (double& tap : taps) tap /= sum;
    return taps;
}

}  // namespace

void OversampledShaper::begin(unsigned factor) {
    factor_ = factor;
    const std::size_t reach = kDelay / 2 * factor;  // each way half of the delay
    filter_ = halfRateFilter(factor, reach);
    low_.assign(2 * (kDelay + 1), 0);
    high_.assign(2 * filter_.size(), 0);
    lowAt_ = highAt_ = 0;
}

void OversampledShaper::process(std::span<const float> curve, unsigned factor, std::span<float> samples) {
    if (factor != factor_) begin(factor);
    const std::size_t taps = filter_.size(), lows = kDelay + 1;
    const auto push = [](std::vector<double>& ring, std::size_t& at, double value) {
        const std::size_t size = ring.size() / 2;
        ring[at] = ring[at + size] = value;
        at = (at + 1) % size;
    };
    for (float& sample : samples) {
        push(low_, lowAt_, std::isfinite(sample) ? static_cast<double>(sample) : 0);
        const double* const oldest = &low_[lowAt_];
        for (unsigned phase = 0; phase < factor; ++phase) {
            // Between the samples at the higher rate there is nothing: every factor-th tap counts.
            double between = 0;
            for (std::size_t k = phase, back = lows - 1; k < taps; k += factor, --back)
                between += filter_[k] * oldest[back];
            push(high_, highAt_, static_cast<double>(shaped(curve, static_cast<float>(between * factor))));
            if (phase > 0) continue;
            // The first of them lies at the time of the sample.
            const double* const row = &high_[highAt_];
            double out = 0;
            for (std::size_t k = 0; k < taps; ++k) out += filter_[k] * row[k];
            sample = static_cast<float>(out);
        }
    }
}

SpectrumAnalyser::SpectrumAnalyser(std::size_t fftSize) {
    std::size_t size = 32;
    while (size < fftSize && size < 32768) size *= 2;
    ring_.resize(size);
    smoothed_.resize(size / 2);
}

void SpectrumAnalyser::write(std::span<const float> samples) {
    for (const float sample : samples) ring_[written_++ % ring_.size()] = sample;
}

std::vector<double> SpectrumAnalyser::decibels(double smoothing) {
    const std::size_t size = ring_.size();
    std::vector<std::complex<double>> x(size);
    for (std::size_t i = 0; i < size; ++i) {
        const double angle = 2 * kPi * static_cast<double>(i) / static_cast<double>(size);
        const double window = 0.42 - 0.5 * std::cos(angle) + 0.08 * std::cos(2 * angle);
        x[i] = window * static_cast<double>(ring_[(written_ + i) % size]);
    }
    for (std::size_t i = 1, j = 0; i < size; ++i) {
        std::size_t bit = size >> 1;
        for (; j & bit; bit >>= 1) j ^= bit;
        j ^= bit;
        if (i < j) std::swap(x[i], x[j]);
    }
    for (std::size_t length = 2; length <= size; length *= 2)
        for (std::size_t k = 0; k < length / 2; ++k) {
            const auto angle = std::polar(1.0, -2 * kPi * static_cast<double>(k) / static_cast<double>(length));
            for (std::size_t i = 0; i < size; i += length) {
                const auto a = x[i + k], b = x[i + k + length / 2] * angle;
                x[i + k] = a + b;
                x[i + k + length / 2] = a - b;
            }
        }
    const double fraction = std::clamp(smoothing, 0.0, 1.0);
    std::vector<double> result(size / 2);
    for (std::size_t i = 0; i < result.size(); ++i) {
        smoothed_[i] = fraction * smoothed_[i] + (1 - fraction) * std::abs(x[i]) / static_cast<double>(size);
        result[i] = decibelsOf(smoothed_[i]);
    }
    return result;
}

PeriodicWave PeriodicWave::named(std::string_view type) {
    constexpr std::size_t kHarmonics = 1024;
    PeriodicWave wave;
    if (type != "SQUARE" && type != "SAWTOOTH" && type != "TRIANGLE") {
        wave.cosines_ = {0, 0};
        wave.sines_ = {0, 1};
        return wave;
    }
    for (std::size_t k = 1; k <= kHarmonics; ++k) {
        const auto n = static_cast<double>(k);
        const double odd = k % 2 ? 1 : 0;
        wave.cosines_.push_back(0);
        wave.sines_.push_back(type == "SQUARE"     ? 4 * odd / (n * kPi)
                              : type == "SAWTOOTH" ? (k % 2 ? 2 : -2) / (n * kPi)
                                                   : 8 * odd * (k % 4 == 1 ? 1 : -1) / (n * n * kPi * kPi));
    }
    wave.normalise();
    return wave;
}

PeriodicWave PeriodicWave::custom(std::span<const float> real, std::span<const float> imag) {
    constexpr std::size_t kMax = 4096;
    PeriodicWave wave;
    for (std::size_t k = 1; k < std::min(kMax, std::max(real.size(), imag.size())); ++k) {
        const auto finite = [&](std::span<const float> values) {
            return k < values.size() && std::isfinite(values[k]) ? static_cast<double>(values[k]) : 0.0;
        };
        wave.cosines_.push_back(finite(real));
        wave.sines_.push_back(finite(imag));
    }
    wave.normalise();
    return wave;
}

void PeriodicWave::normalise() {
    std::size_t points = 2048;
    while (points < 2 * cosines_.size()) points *= 2;
    double peak = 0;
    for (std::size_t i = 0; i < points; ++i)
        peak = std::max(peak, std::abs(at(static_cast<double>(i) / static_cast<double>(points), harmonics())));
    if (!(peak > 0)) return;
    for (double& value : cosines_) value /= peak;
    for (double& value : sines_) value /= peak;
}

double PeriodicWave::at(double phase, std::size_t maximum) const {
    const auto step = std::polar(1.0, 2 * kPi * phase);
    std::complex<double> angle(1);
    double sum = 0;
    for (std::size_t k = 1; k < cosines_.size() && k <= maximum; ++k) {
        angle *= step;
        sum += cosines_[k] * angle.real() + sines_[k] * angle.imag();
    }
    return sum;
}

}  // namespace rtsg
