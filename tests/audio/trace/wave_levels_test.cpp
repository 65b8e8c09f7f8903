// Levels of octaves from waves with phases: beside means over many tones, and across the boundaries of light.
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include <gtest/gtest.h>

#include "response/wave_levels.h"
#include "walled.h"

namespace rtsg {
namespace {

constexpr double kWaveSpeed = 343;
const glm::dvec3 kFrom(0), kTo(10, 0, 0);

double waveNumberAt(double hz) {
    return 2 * M_PI * hz / kWaveSpeed;
}

EdgeWave waveOf(double pathLength, std::complex<float> pressure) {
    EdgeWave wave;
    wave.seconds = pathLength / kWaveSpeed;
    wave.direction = {-1, 0, 0};
    wave.pressure.fill(pressure);
    return wave;
}
Arrival straight(double pathLength, std::uint32_t order, double pressure) {
    Arrival arrival;
    arrival.seconds = pathLength / kWaveSpeed;
    arrival.order = order;
    arrival.direction = {-1, 0, 0};
    arrival.energy = allBands(pressure * pressure / (4 * M_PI));
    return arrival;
}
double decibels(double energy) {
    return 10 * std::log10(energy * 4 * M_PI);
}

TEST(WaveLevels, AreMeansOverTheOctaveOfAllThatComesAsOne) {
    // Three waves; the last one so late that it is another one at each tone.
    for (const double apart : {0.0, .02, .05, .1, .2, .4, 3.0, 40.0}) {
        EdgeField field;
        field.waves = {waveOf(10, .1f), waveOf(10 + apart, -.07f), waveOf(10 + 2 * apart, {0, .05f})};
        std::vector<Arrival> arrivals;
        setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, field);
        const Bands levels = test::total(arrivals);
        for (std::size_t b = 0; b < kBandCount; ++b) {
            // Each tone of five stands for a fifth of the octave.
            double mean = 0;
            constexpr int kTones = 4000;
            for (int i = 0; i < kTones; ++i) {
                const double k =
                    waveNumberAt(1000 * std::pow(2.0, double(b) - double(kBand1k) + (i + .5) / kTones - .5));
                mean += std::norm(.1 - .07 * std::polar(1.0, -k * apart) +
                                  std::complex<double>(0, .05) * std::polar(1.0, -2 * k * apart)) /
                        kTones;
            }
            // A band with soft ends leaves a little more of the ripple, of .0154 where nothing is left of it.
            EXPECT_NEAR(4 * M_PI * levels[b] / mean, 1, .25) << apart << " m, band " << b;
            if (apart * waveNumberAt(1000 * std::pow(2.0, double(b) - double(kBand1k))) < 4) {
                EXPECT_NEAR(decibels(levels[b]), 10 * std::log10(mean), .3) << apart << " m, band " << b;
            }
        }
    }
}

TEST(WaveLevels, EnergiesOfWavesFarApartAddUp) {
    EdgeField field;
    field.waves = {waveOf(10, .1f), waveOf(210, -.07f), waveOf(310, {0, .05f})};
    std::vector<Arrival> arrivals;
    setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, field);
    ASSERT_EQ(arrivals.size(), 3u);
    for (std::size_t b = 2; b < kBandCount; ++b) {
        EXPECT_NEAR(4 * M_PI * arrivals[0].energy[b], .01, 2e-5);
        EXPECT_NEAR(4 * M_PI * arrivals[1].energy[b], .0049, 2e-5);
        EXPECT_NEAR(4 * M_PI * arrivals[2].energy[b], .0025, 2e-5);
    }
    for (const Arrival& one : arrivals) {
        ASSERT_GE(one.straight, 0);
        EXPECT_EQ(field.straight[static_cast<std::size_t>(one.straight)], Bands{}) << "no pulse of its own";
    }
}

TEST(WaveLevels, WhatCancelsLeavesNothingAndNothingIsNegative) {
    EdgeField field;
    field.waves = {waveOf(10, .1f), waveOf(10.0001, -.0999f), waveOf(25, .001f)};
    std::vector<Arrival> arrivals{straight(8, 0, .02)};
    setLevels(kFrom, {8, 0, 0}, kWaveSpeed, {}, arrivals, field);
    double last = 0;
    for (const Arrival& one : arrivals) {
        EXPECT_GE(one.seconds, last);
        last = one.seconds;
        for (const double energy : one.energy) EXPECT_GE(energy, 0);
    }
    EXPECT_NEAR(decibels(test::total(arrivals)[kBand1k]), 20 * std::log10(.02), .1);
}

TEST(WaveLevels, DirectSoundIsOneWithWhatBendsAndKeepsItsPulse) {
    EdgeField field;
    field.waves = {waveOf(10.001, -.05f)};
    std::vector<Arrival> arrivals{straight(10, 0, .1)};
    setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, field);
    EXPECT_NEAR(decibels(test::total(arrivals)[kBand1k]), 20 * std::log10(.05), .05);
    ASSERT_EQ(arrivals[0].order, 0u);
    ASSERT_GE(arrivals[0].straight, 0);
    EXPECT_NEAR(decibels(field.straight[static_cast<std::size_t>(arrivals[0].straight)][kBand1k]), -20, 1e-9);
}

TEST(WaveLevels, WithoutWavesNothingChanges) {
    EdgeField field;
    std::vector<Arrival> arrivals{straight(10, 0, .1), straight(12, 1, .08)};
    setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, field);
    ASSERT_EQ(arrivals.size(), 2u);
    EXPECT_EQ(arrivals[0].straight, -1);
    EXPECT_EQ(arrivals[1].straight, -1);
    EXPECT_TRUE(field.straight.empty());
}

/// Direct sound of .1 and a mirror image of .08, of which an edge leaves a share behind: less, if it is heard.
Bands besideImage(bool heard, bool lit, double fraction, double detour, float wave = 0) {
    const double pathLength = 12;
    const float left = static_cast<float>(.08 * (heard ? fraction - 1 : fraction));
    EdgeField field;
    field.waves = {waveOf(pathLength + detour, wave + left)};
    ImagePart part;
    part.image = kTo - glm::dvec3(pathLength, 0, 0);
    part.whole = allBands(.08);
    part.wave = 0;
    part.seconds = field.waves[0].seconds;
    part.direction = field.waves[0].direction;
    part.pressure.fill(left);
    BentParts parts;
    parts.images = {part};
    std::vector<Arrival> arrivals;
    if (lit) arrivals.push_back(straight(10, 0, .1));
    if (heard) arrivals.push_back(straight(pathLength, 1, .08));
    setLevels(kFrom, kTo, kWaveSpeed, parts, arrivals, field);
    return test::total(arrivals);
}

TEST(WaveLevels, AreContinuousWhereAMirrorImageBegins) {
    for (const bool lit : {true, false})
        for (const float wave : {0.f, .03f, -.02f}) {
            const Bands heard = besideImage(true, lit, .5, 1e-9, wave);
            const Bands unheard = besideImage(false, lit, .5, 1e-9, wave);
            for (std::size_t b = 0; b < kBandCount; ++b)
                EXPECT_NEAR(decibels(heard[b]), decibels(unheard[b]), .02) << lit << ' ' << wave;
        }
}

TEST(WaveLevels, AWholeImageAddsItsEnergyAndWhatIsLeftOfOneItsPressure) {
    // Nothing of it is bent.
    for (const Bands& levels : {besideImage(true, true, 1, 5), besideImage(false, true, 1, 1e-9)})
        EXPECT_NEAR(4 * M_PI * levels[kBand1k], .01 + .0064, 1e-6);
    // A twentieth of it comes as a wave does that is of no image.
    const Bands little = besideImage(false, true, .05, .001);
    EdgeField field;
    field.waves = {waveOf(12.001, .004f)};
    std::vector<Arrival> arrivals{straight(10, 0, .1)};
    setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, field);
    for (std::size_t b = 0; b < kBandCount; ++b)
        EXPECT_NEAR(decibels(little[b]), decibels(test::total(arrivals)[b]), .01) << b;
    // Half of it, as at its boundary, is one with direct sound; of three quarters (7/16 / 3/4) squared are.
    EXPECT_NEAR(4 * M_PI * besideImage(false, true, .5, -1.999)[kBand1k], .14 * .14, 1e-4);
    EXPECT_NEAR(4 * M_PI * besideImage(false, true, .75, -1.999)[kBand1k],
                .01 + .0036 + 2 * std::pow(7. / 12, 2) * .1 * .06, 1e-4);
}

TEST(WaveLevels, TwoEdgesOfANarrowMirrorBendItAsOne) {
    // Beyond a mirror that is narrow beside a wave one edge has half of the image, and the other takes it away.
    const auto level = [](double apart) {
        EdgeField field;
        BentParts parts;
        for (const float sign : {1.f, -1.f}) {
            EdgeWave wave = waveOf(12 + (sign < 0 ? apart : 0), sign * .04f);
            ImagePart part;
            part.image = kTo - glm::dvec3(11.9, 0, 0);
            part.whole = allBands(.08);
            part.wave = field.waves.size();
            part.seconds = wave.seconds;
            part.direction = wave.direction;
            part.pressure = wave.pressure;
            field.waves.push_back(wave);
            parts.images.push_back(part);
        }
        std::vector<Arrival> arrivals;
        setLevels(kFrom, kTo, kWaveSpeed, parts, arrivals, field);
        return 4 * M_PI * test::total(arrivals)[kBand1k];
    };
    EXPECT_LT(level(.005), .0016 * .05);
    EXPECT_NEAR(level(60), 2 * .0016, 1e-4);
}

TEST(WaveLevels, WhatIsFirstMayBeFaintOrTakeMoreThanItHas) {
    EdgeField faint;
    faint.waves = {waveOf(10, 1e-4f), waveOf(15, .1f)};
    std::vector<Arrival> arrivals;
    setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, faint);
    ASSERT_EQ(arrivals.size(), 1u);
    EXPECT_NEAR(arrivals[0].seconds, 15 / kWaveSpeed, 1e-9);
    // Little direct sound beside a wave of the other sign.
    EdgeField other;
    other.waves = {waveOf(10.0001, -.1f)};
    arrivals = {straight(10, 0, .01)};
    setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, other);
    for (const Arrival& one : arrivals)
        for (const double energy : one.energy) EXPECT_GE(energy, 0);
    EXPECT_NEAR(4 * M_PI * test::total(arrivals)[kBand1k], .09 * .09, 1e-5);
}

TEST(WaveLevels, AWaveThatCountsIsAnArrivalBesideDirectSound) {
    EdgeField field;
    field.waves = {waveOf(15, .05f), waveOf(16, 1e-4f)};
    std::vector<Arrival> arrivals{straight(10, 0, .1)};
    setLevels(kFrom, kTo, kWaveSpeed, {}, arrivals, field);
    ASSERT_EQ(arrivals.size(), 2u);
    EXPECT_NEAR(4 * M_PI * arrivals[0].energy[kBand1k], .1 * .1, 2e-4);
    EXPECT_NEAR(4 * M_PI * arrivals[1].energy[kBand1k], .05 * .05, 1e-4);
}

TEST(WaveLevels, APartWhoseWaveIsNothingStillCounts) {
    // Direct sound takes as much as the image gives: no wave is left, but the image does not add to direct sound.
    BentParts parts;
    ImagePart part;
    part.image = kTo - glm::dvec3(12, 0, 0);
    part.whole = allBands(.04);
    part.seconds = 12 / kWaveSpeed;
    part.direction = {-1, 0, 0};
    part.pressure.fill(.04f);
    parts.images = {part};
    EdgeField field;
    std::vector<Arrival> arrivals{straight(11.999, 0, .08)};
    setLevels(kTo - glm::dvec3(11.999, 0, 0), kTo, kWaveSpeed, parts, arrivals, field);
    EXPECT_NEAR(4 * M_PI * test::total(arrivals)[kBand1k], .04 * .04 + .04 * .04, 1e-4);
}

}  // namespace
}  // namespace rtsg
