// Transforms of real signals against the sum that defines them, in double precision.
#include <cmath>
#include <complex>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "signal/fft.h"

namespace rtsg {
namespace {

std::vector<float> noiseOf(std::size_t size) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> values(-1, 1);
    std::vector<float> samples(size);
    for (float& sample : samples) sample = values(random);
    return samples;
}

std::complex<double> binOf(const std::vector<float>& samples, std::size_t bin) {
    std::complex<double> sum = 0;
    for (std::size_t i = 0; i < samples.size(); ++i)
        sum += static_cast<double>(samples[i]) *
               std::polar(1.0, -2 * std::numbers::pi * static_cast<double>(bin * i % samples.size()) /
                                   static_cast<double>(samples.size()));
    return sum;
}

TEST(RealFft, IsTheSumThatDefinesItAndBack) {
    // Powers of two, as responses have them, ten seconds of one too, and others, as blocks of a device may ask for.
    for (const std::size_t size :
         {2ul, 4ul, 8ul, 16ul, 32ul, 250ul, 256ul, 512ul, 1000ul, 4096ul, 8192ul, 131'072ul, 262'144ul, 524'288ul}) {
        const RealFft fft(size);
        const std::vector<float> samples = noiseOf(size);
        RealFft::Spectrum spectrum;
        fft.forward(samples, spectrum);
        ASSERT_EQ(spectrum.size(), size / 2 + 1);
        const double rounding = 1e-6 * std::sqrt(static_cast<double>(size));
        for (std::size_t bin = 0; bin <= size / 2; bin += 1 + size / (size > 8192 ? 8 : 64)) {
            const std::complex<double> exact = binOf(samples, bin);
            EXPECT_NEAR(spectrum[bin].real(), exact.real(), rounding) << size << ", bin " << bin;
            EXPECT_NEAR(spectrum[bin].imag(), exact.imag(), rounding) << size << ", bin " << bin;
        }
        const RealFft::Spectrum before = spectrum;
        std::vector<float> back(size);
        fft.inverse(spectrum, back);
        EXPECT_EQ(spectrum, before);
        for (std::size_t i = 0; i < size; ++i) ASSERT_NEAR(back[i], samples[i], 2e-6) << size << " at " << i;
        std::vector<float> again(size);
        fft.inverse(std::move(spectrum), again);
        EXPECT_EQ(back, again) << size;
    }
}

TEST(RealFft, AThreadKeepsThoseOfTheLastFewSizes) {
    const auto first = RealFft::kept(64), second = RealFft::kept(128);
    EXPECT_EQ(first->size(), 64u);
    EXPECT_EQ(second->size(), 128u);
    EXPECT_EQ(RealFft::kept(64), first);
    for (std::size_t i = 1; i <= 7; ++i) EXPECT_EQ(RealFft::kept(256 * i)->size(), 256 * i);
    EXPECT_EQ(RealFft::kept(64), first);
    EXPECT_NE(RealFft::kept(128), second);  // eight others have been used since
}

}  // namespace
}  // namespace rtsg
