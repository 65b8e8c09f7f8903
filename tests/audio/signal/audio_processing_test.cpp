// Audio nodes against closed forms: transfer functions, static curves, series.
#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include <rtsg/audio/audio_processing.h>

namespace rtsg {
namespace {

constexpr double kRate = 48000;

/// Amplitude and phase of what comes out of a steady tone.
template <class Process>
std::complex<double> through(double hz, const Process& process) {
    constexpr std::size_t kCount = 48000;  // whole turns of whole hertz
    std::vector<float> x(3 * kCount);
    for (std::size_t i = 0; i < x.size(); ++i)
        x[i] = static_cast<float>(std::sin(2 * M_PI * hz * static_cast<double>(i) / kRate));
    process(x);
    std::complex<double> sum = 0;
    for (std::size_t i = 2 * kCount; i < x.size(); ++i)
        sum += static_cast<double>(x[i]) * std::polar(2.0 / kCount, -2 * M_PI * hz * static_cast<double>(i) / kRate);
    return sum * std::complex<double>(0, 1);
}

/// The filter in closed form: analogue prototypes by the bilinear transform with their frequency held.
std::complex<double> prototype(Biquad::Type type, double hz, double f0, double q, double gainDb) {
    using enum Biquad::Type;
    const double a = std::pow(10.0, gainDb / 40);
    const std::complex<double> s(0, std::tan(M_PI * hz / kRate) / std::tan(M_PI * f0 / kRate));
    const double linear = std::pow(10.0, q / 20), root = std::sqrt(a) * std::sqrt(2.0);
    switch (type) {
        case lowpass:
            return 1.0 / (s * s + s / linear + 1.0);
        case highpass:
            return s * s / (s * s + s / linear + 1.0);
        case bandpass:
            return (s / q) / (s * s + s / q + 1.0);
        case notch:
            return (s * s + 1.0) / (s * s + s / q + 1.0);
        case allpass:
            return (s * s - s / q + 1.0) / (s * s + s / q + 1.0);
        case peaking:
            return (s * s + s * (a / q) + 1.0) / (s * s + s / (a * q) + 1.0);
        case lowshelf:
            return a * (s * s + root * s + a) / (a * s * s + root * s + 1.0);
        case highshelf:
            return a * (a * s * s + root * s + 1.0) / (s * s + root * s + a);
    }
    return 0;
}

TEST(Biquad, AllEightTypesHaveTheTransferFunctionOfTheirPrototype) {
    using enum Biquad::Type;
    for (const Biquad::Type type : {lowpass, highpass, bandpass, lowshelf, highshelf, peaking, notch, allpass})
        for (const double hz : {100.0, 700.0, 1000.0, 5000.0, 15000.0}) {
            const double q = 1.7, gain = -7.5;
            const std::complex<double> got = through(hz, [&](std::vector<float>& x) {
                Biquad filter;
                filter.process(Biquad::coefficients(type, 1000, kRate, q, gain), x);
            });
            const std::complex<double> expected = prototype(type, hz, 1000, q, gain);
            EXPECT_NEAR(std::abs(got - expected), 0, 1e-6) << static_cast<int>(type) << " at " << hz;
        }
}

TEST(Biquad, AtTheEndsOfTheSpectrumItIsWhatItTendsTo) {
    using enum Biquad::Type;
    const auto flat = [](Biquad::Type type, double hz, double q = 1) {
        const Biquad::Coefficients c = Biquad::coefficients(type, hz, kRate, q, 12);
        EXPECT_EQ(c.b1, 0);
        EXPECT_EQ(c.a1, 0);
        return c.b0;
    };
    EXPECT_EQ(flat(lowpass, 24000), 1);
    EXPECT_EQ(flat(lowpass, 0), 0);
    EXPECT_EQ(flat(highpass, 24000), 0);
    EXPECT_EQ(flat(highpass, 0), 1);
    EXPECT_EQ(flat(bandpass, 1000, 0), 1);
    EXPECT_EQ(flat(notch, 1000, 0), 0);
    EXPECT_EQ(flat(allpass, 1000, 0), -1);
    EXPECT_NEAR(flat(lowshelf, 24000), std::pow(10, .6), 1e-12);
    EXPECT_NEAR(flat(highshelf, 0), std::pow(10, .6), 1e-12);
    EXPECT_NEAR(flat(peaking, 1000, 0), std::pow(10, .6), 1e-12);
}

TEST(AudioDelay, IsExactAtSamplesAndLinearBetween) {
    std::vector<float> ramp(300);
    for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<float>(i + 1);
    for (const double delay : {0.0, 1.0, 97.0, 40.25}) {
        AudioDelay line;
        std::vector<float> out;
        for (std::size_t block = 0; block < 3; ++block) {
            std::vector<float> x(ramp.begin() + static_cast<std::ptrdiff_t>(100 * block),
                                 ramp.begin() + static_cast<std::ptrdiff_t>(100 * block + 100));
            line.process(delay, x);
            out.insert(out.end(), x.begin(), x.end());
        }
        for (std::size_t i = 0; i < 300; ++i) {
            const double at = static_cast<double>(i) - delay;
            const double expected = at >= 0 ? at + 1 : at > -1 ? at + 1 : 0;
            EXPECT_NEAR(out[i], expected, 1e-4) << delay << " " << i;
        }
    }
}

TEST(Compressor, FollowsItsStaticCurve) {
    const Compressor::Settings s{-30, 10, 4, .003, .05};
    const auto dB = [](double x) { return 20 * std::log10(x); };
    const auto amplitude = [](double x) { return std::pow(10.0, x / 20); };
    EXPECT_NEAR(dB(Compressor::curve(s, amplitude(-40))), -40, 1e-9);
    EXPECT_NEAR(dB(Compressor::curve(s, amplitude(-30))), -30, 1e-9);
    // Half the knee: 5 dB above, of which a half times 3/4 times 25 / 10 are lost.
    EXPECT_NEAR(dB(Compressor::curve(s, amplitude(-25))), -25 - .75 * 25 / 20, 1e-9);
    const double kneeEnd = -30 + 10 - .75 * 100 / 20;
    EXPECT_NEAR(dB(Compressor::curve(s, amplitude(-20))), kneeEnd, 1e-9);
    EXPECT_NEAR(dB(Compressor::curve(s, 1)), kneeEnd + 20 / 4.0, 1e-9);
    // Slope 1 / ratio from there on, without a step.
    EXPECT_NEAR(dB(Compressor::curve(s, amplitude(-19.9))) - kneeEnd, .1 / 4, 1e-9);
    // A square wave has one loudness: what comes out after a while is the curve with its make-up.
    for (const double level : {-50.0, -25.0, -6.0}) {
        std::vector<std::vector<float>> channels(2, std::vector<float>(48000));
        for (std::size_t i = 0; i < 48000; ++i)
            channels[0][i] = channels[1][i] = static_cast<float>((i / 50 % 2 ? 1 : -1) * amplitude(level));
        Compressor compressor;
        compressor.process(s, kRate, channels);
        const double expected = Compressor::curve(s, amplitude(level)) * std::pow(1 / Compressor::curve(s, 1), .6);
        EXPECT_NEAR(std::abs(channels[1].back()), expected, 1e-6);
        EXPECT_NEAR(compressor.reductionDb(), dB(Compressor::curve(s, amplitude(level))) - level, 1e-5);
    }
    // Look-ahead of 6 ms, and 10 dB in the attack's time.
    std::vector<std::vector<float>> step{std::vector<float>(4800)};
    std::fill(step[0].begin() + 1000, step[0].end(), 1.0f);
    Compressor compressor;
    compressor.process(s, kRate, step);
    EXPECT_EQ(step[0][1287], 0);
    EXPECT_GT(step[0][1288], 0);
}

TEST(WaveShaper, IsLinearBetweenThePointsOfItsCurve) {
    const std::vector<float> curve{-1, -.5f, .75f, 1, .5f};
    for (const float x : {-2.f, -1.f, -.75f, -.2f, 0.f, .3f, .5f, .9f, 1.f, 7.f}) {
        const double at = std::clamp(2 * (static_cast<double>(x) + 1), 0.0, 4.0);
        const auto k = std::min<std::size_t>(3, static_cast<std::size_t>(at));
        const double expected = curve[k] + (curve[k + 1] - curve[k]) * (at - static_cast<double>(k));
        EXPECT_NEAR(shaped(curve, x), expected, 1e-6) << x;
    }
    EXPECT_EQ(shaped({}, .3f), .3f);
    EXPECT_EQ(shaped(std::vector<float>{.25f}, .3f), .25f);
}

/// Amplitude of one frequency (a share of the rate) in the last `length` samples, a whole number of its periods.
double amplitudeAt(const std::vector<float>& samples, std::size_t length, double fraction) {
    std::complex<double> sum = 0;
    for (std::size_t i = 0; i < length; ++i)
        sum += static_cast<double>(samples[samples.size() - length + i]) *
               std::polar(1.0, -2 * std::numbers::pi * fraction * static_cast<double>(i));
    return 2 * std::abs(sum) / static_cast<double>(length);
}

TEST(OversampledShaper, GivesTheHarmonicsThatFitAndNoOthers) {
    // x^3 of a sine is 3/4 of it less 1/4 of its third harmonic; x^5: 10/16, 5/16 of the third, 1/16 of the fifth.
    std::vector<float> cube, fifth;
    for (int i = -20'000; i <= 20'000; ++i) {
        const double x = i / 20'000.0;
        cube.push_back(static_cast<float>(x * x * x));
        fifth.push_back(static_cast<float>(x * x * x * x * x));
    }
    const auto play = [](std::span<const float> curve, unsigned factor, double fraction) {
        std::vector<float> samples(4000);
        for (std::size_t i = 0; i < samples.size(); ++i)
            samples[i] = static_cast<float>(std::sin(2 * std::numbers::pi * fraction * static_cast<double>(i)));
        OversampledShaper shaper;
        // In blocks of several lengths: what is between them does not matter.
        for (std::size_t at = 0, size = 1; at < samples.size(); at += size, size = size % 97 + 1)
            shaper.process(curve, factor, std::span(samples).subspan(at, std::min(size, samples.size() - at)));
        return samples;
    };
    for (const unsigned factor : {2u, 4u}) {
        // The third harmonic of .3 lies at .9 of the rate, and would come back as .1.
        const auto high = play(cube, factor, .3);
        EXPECT_NEAR(amplitudeAt(high, 1000, .3), .75, 2e-5) << factor;
        EXPECT_LT(amplitudeAt(high, 1000, .1), 1e-5) << factor;
        const auto low = play(cube, factor, .1);
        EXPECT_NEAR(amplitudeAt(low, 1000, .1), .75, 2e-5) << factor;
        EXPECT_NEAR(amplitudeAt(low, 1000, .3), .25, 2e-5) << factor;
    }
    // The fifth of .45 lies at 2.25: twice the rate has it back as .25, four times not.
    EXPECT_NEAR(amplitudeAt(play(fifth, 2, .45), 1000, .25), 1.0 / 16, 1e-4);
    EXPECT_LT(amplitudeAt(play(fifth, 4, .45), 1000, .25), 1e-5);
}

TEST(OversampledShaper, IsLateByAWholeNumberOfSamples) {
    const std::vector<float> straight{-1, 1};
    for (const unsigned factor : {2u, 4u}) {
        std::vector<float> samples(1000);
        for (std::size_t i = 0; i < samples.size(); ++i)
            samples[i] = static_cast<float>(.5 * std::sin(.7 * static_cast<double>(i)));
        const std::vector<float> before = samples;
        OversampledShaper shaper;
        shaper.process(straight, factor, samples);
        for (std::size_t i = 400; i < samples.size(); ++i)
            ASSERT_NEAR(samples[i], before[i - OversampledShaper::kDelay], 2e-5) << factor << " " << i;
    }
}

TEST(SpectrumAnalyser, ATonesBinHasTheWindowsShareOfIt) {
    SpectrumAnalyser analyser(2048);
    std::vector<float> x(4096);
    const double hz = 64 * kRate / 2048;
    for (std::size_t i = 0; i < x.size(); ++i)
        x[i] = static_cast<float>(.5 * std::cos(2 * M_PI * hz * static_cast<double>(i) / kRate));
    analyser.write(x);
    const std::vector<double> spectrum = analyser.decibels(0);
    ASSERT_EQ(spectrum.size(), 1024u);
    // The mean of the Blackman window is .42, half of which is at the positive frequency; its neighbours have .25 of 1.
    EXPECT_NEAR(spectrum[64], 20 * std::log10(.5 * .42 / 2), 1e-6);
    EXPECT_NEAR(spectrum[65], 20 * std::log10(.5 * .25 / 2), 1e-5);
    EXPECT_NEAR(spectrum[66], 20 * std::log10(.5 * .04 / 2), 1e-4);
    EXPECT_LT(spectrum[70], -100);
    // Smoothed with what it was: 3/4 of silence and 1/4 of the tone.
    SpectrumAnalyser slow(2048);
    slow.write(x);
    EXPECT_NEAR(slow.decibels(.75)[64], 20 * std::log10(.25 * .5 * .42 / 2), 1e-6);
}

TEST(PeriodicWave, IsItsSeries) {
    const std::vector<float> real{9, .2f, 0, .1f}, imag{9, .5f, -.3f};
    const PeriodicWave wave = PeriodicWave::custom(real, imag);
    ASSERT_EQ(wave.harmonics(), 3u);
    const auto series = [](double t, int maximum) {
        const double a[] = {0, .2, 0, .1}, b[] = {0, .5, -.3, 0};
        double sum = 0;
        for (int k = 1; k <= maximum; ++k) sum += a[k] * std::cos(2 * M_PI * k * t) + b[k] * std::sin(2 * M_PI * k * t);
        return sum;
    };
    double peak = 0;
    for (int i = 0; i < 2048; ++i) peak = std::max(peak, std::abs(series(i / 2048.0, 3)));
    for (const double t : {0.0, .1, .37, .9}) {
        EXPECT_NEAR(wave.at(t, 3), series(t, 3) / peak, 1e-6);
        EXPECT_NEAR(wave.at(t, 2), series(t, 2) / peak, 1e-6);
    }
    EXPECT_NEAR(PeriodicWave::named("SINE").at(.125, 10), std::sqrt(.5), 1e-12);
    // Ratios of harmonics: odd ones as 1 / n of the square, all of the saw, odd ones as 1 / n^2 of the triangle.
    const auto harmonic = [](const PeriodicWave& w, int k) {
        double sum = 0;
        for (int i = 0; i < 4096; ++i) sum += w.at(i / 4096.0, 100) * std::sin(2 * M_PI * k * i / 4096.0) / 2048;
        return sum;
    };
    for (const auto& [type, second, third] : {std::tuple("SQUARE", 0.0, 1 / 3.0), std::tuple("SAWTOOTH", -.5, 1 / 3.0),
                                              std::tuple("TRIANGLE", 0.0, -1 / 9.0)}) {
        const PeriodicWave w = PeriodicWave::named(type);
        EXPECT_NEAR(harmonic(w, 2) / harmonic(w, 1), second, 1e-6) << type;
        EXPECT_NEAR(harmonic(w, 3) / harmonic(w, 1), third, 1e-6) << type;
    }
}

}  // namespace
}  // namespace rtsg
