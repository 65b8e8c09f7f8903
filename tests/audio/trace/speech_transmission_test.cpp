// Speech transmission against closed forms of decays and noise, with the standard's tables typed anew.
#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/audio/speech_transmission.h>

namespace rtsg {
namespace {

constexpr std::size_t kFirstOctave = 2, kOctaves = 7;
using Octaves = std::array<double, kOctaves>;

/// Energy `all` that decays by 60 dB in T seconds, from `first` on.
EnergyHistogram decaying(double T, double all = 1, double first = 0) {
    EnergyHistogram histogram;
    histogram.start = first;
    const double k = 6 * std::log(10.0) / T;
    for (int i = 0; i < static_cast<int>(2500 * T); ++i)
        histogram.bins.push_back(allBands(all * (std::exp(-k * i / 1000.0) - std::exp(-k * (i + 1) / 1000.0))));
    return histogram;
}

/// IEC 60268-16:2011, annex A, step by step: modulations of each octave as `m(octave, hz)`.
template <class M>
double referenceIndex(const M& m, const Octaves& speechDb, const Octaves& noiseDb, bool female) {
    const Octaves threshold{46, 27, 12, 6.5, 7.5, 8, 12};
    const Octaves alpha =
        female ? Octaves{0, .117, .223, .216, .328, .25, .194} : Octaves{.085, .127, .23, .233, .309, .224, .173};
    const Octaves beta =
        female ? Octaves{0, .099, .066, .062, .025, .076} : Octaves{.085, .078, .065, .011, .047, .095};
    Octaves mti{};
    for (std::size_t k = female ? 1 : 0; k < kOctaves; ++k) {
        const double speech = std::pow(10, speechDb[k] / 10), noise = std::pow(10, noiseDb[k] / 10);
        double mask = 0;
        if (k > 0) {
            const double below = std::pow(10, speechDb[k - 1] / 10) + std::pow(10, noiseDb[k - 1] / 10);
            const double L = 10 * std::log10(below);
            const double slope = L < 63 ? .5 * L - 65 : L < 67 ? 1.8 * L - 146.9 : L < 100 ? .5 * L - 59.8 : -10;
            if (below > 0) mask = below * std::pow(10, slope / 10);
        }
        for (int i = 0; i < 14; ++i) {
            const double exact = .63 * std::pow(10, i / 10.0), F = std::round(exact * 100) / 100;
            const double nominal[] = {.63, .8, 1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8, 10, 12.5};
            EXPECT_NEAR(F, nominal[i], .02 * F);
            const double left = m(k, nominal[i]) * speech / (speech + noise) * (speech + noise) /
                                (speech + noise + mask + std::pow(10, threshold[k] / 10));
            const double snr = std::min(15.0, std::max(-15.0, 10 * std::log10(left / (1 - left))));
            mti[k] += (snr + 15) / 30 / 14;
        }
    }
    double sum = 0;
    for (std::size_t k = 0; k < kOctaves; ++k) {
        sum += alpha[k] * mti[k];
        if (k + 1 < kOctaves) sum -= beta[k] * std::sqrt(mti[k] * mti[k + 1]);
    }
    return std::min(1.0, sum);
}

Octaves speechAt(double level, bool female) {
    Octaves result =
        female ? Octaves{-1000, 5.3, -1.9, -9.1, -15.8, -16.7, -18} : Octaves{2.9, 2.9, -.8, -6.8, -12.8, -18.8, -24.8};
    for (double& octave : result) octave += level;
    return result;
}

TEST(SpeechTransmission, ModulationsOfAnExponentialDecayInClosedForm) {
    for (const double T : {.3, 1.0, 3.0})
        for (const double F : {.63, 2.5, 12.5}) {
            Echogram echogram;
            echogram.late = decaying(T, 1, .0004);
            EXPECT_NEAR(modulationTransfer(echogram, 5, F), 1 / std::hypot(1, 2 * M_PI * F * T / (6 * std::log(10))),
                        1e-4)
                << T << " s, " << F << " Hz";
        }
    // Two pulses of the same energy, .1 s apart.
    Echogram pulses;
    for (const double t : {.02, .12}) pulses.arrivals.push_back({t, allBands(1), {}, 0});
    EXPECT_NEAR(modulationTransfer(pulses, 5, 2.5), std::abs(std::cos(M_PI * 2.5 * .1)), 1e-12);
    EXPECT_TRUE(std::isnan(modulationTransfer({}, 5, 1)));
}

TEST(SpeechTransmission, OfDecaysAndNoiseAsTheStandardHasIt) {
    const double energyAtOneMetre = 1 / (4 * M_PI);
    for (const bool female : {false, true})
        for (const double T : {.4, 1.0, 2.5})
            for (const double level : {30.0, 60.0, 75.0, 105.0})
                for (const double noiseLevel : {-1000.0, 35.0, 60.0}) {
                    SpeechOptions options;
                    options.female = female;
                    options.level = level;
                    Octaves noise{};
                    options.noise = allBands(noiseLevel);
                    for (std::size_t k = 0; k < kOctaves; ++k) {
                        noise[k] = noiseLevel - 3 * static_cast<double>(k);
                        (*options.noise)[kFirstOctave + k] = noise[k];
                    }
                    const std::array batches{decaying(T, energyAtOneMetre), decaying(T, energyAtOneMetre)};
                    const SpeechEstimate found = estimateSpeech({}, batches, options);
                    const auto m = [&](std::size_t, double F) {
                        return 1 / std::hypot(1, 2 * M_PI * F * T / (6 * std::log(10)));
                    };
                    EXPECT_NEAR(found.sti, referenceIndex(m, speechAt(level, female), noise, female), 1e-4)
                        << T << " s, " << level << " and " << noiseLevel << " dB";
                    EXPECT_NEAR(found.ci95, 0, 1e-9);
                    EXPECT_NEAR(found.level[6], speechAt(level, female)[4], .01);
                    EXPECT_EQ(std::isnan(found.mti[2]), female);
                }
}

/// The sums of the weights are such that octaves which are alike give their own index.
TEST(SpeechTransmission, OfASignalToNoiseRatioAlone) {
    for (const double ratio : {-20.0, -9.0, 0.0, 9.0, 20.0}) {
        SpeechOptions options;
        options.level = 60;
        options.noise = Bands{};
        for (std::size_t k = 0; k < kOctaves; ++k) (*options.noise)[kFirstOctave + k] = speechAt(60, false)[k] - ratio;
        const std::array direct{Arrival{.003, allBands(1 / (4 * M_PI)), {0, 0, 1}, 0}};
        const double expected = std::min(1.0, std::max(0.0, (ratio + 15) / 30));
        EXPECT_NEAR(estimateSpeech(direct, {}, options).sti, expected, .01) << ratio;
        EXPECT_EQ(estimateSpeech(direct, {}, options).ci95, 0);
    }
    // It is quiet, and comes straight; too far away to be heard at all; and nothing.
    const std::array near{Arrival{.003, allBands(.08), {0, 0, 1}, 0}}, far{Arrival{9, allBands(1e-8), {0, 0, 1}, 0}};
    EXPECT_NEAR(estimateSpeech(near, {}, {}).sti, 1, 1e-6);
    EXPECT_LT(estimateSpeech(far, {}, {}).sti, .05);
    EXPECT_TRUE(std::isnan(estimateSpeech({}, {}, {}).sti));
}

/// Batches of few pulses each by chance: the interval holds the index of all of the decay 95 times in a hundred.
TEST(SpeechTransmission, IntervalsHoldTheTruth) {
    constexpr int kRuns = 400, kPulses = 60;
    const double T = 1, k = 6 * std::log(10.0) / T;
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform;
    const auto exact = [&](std::size_t, double F) { return 1 / std::hypot(1, 2 * M_PI * F / k); };
    const double truth =
        referenceIndex(exact, speechAt(60, false), {-1000, -1000, -1000, -1000, -1000, -1000, -1000}, false);
    int held = 0;
    for (int run = 0; run < kRuns; ++run) {
        std::vector<EnergyHistogram> batches(16);
        for (EnergyHistogram& batch : batches)
            for (int i = 0; i < kPulses; ++i)
                batch.add(-std::log(1 - uniform(random)) / k, allBands(1 / (4 * M_PI * kPulses)));
        const SpeechEstimate found = estimateSpeech({}, batches, {});
        held += std::abs(found.sti - truth) <= found.ci95 ? 1 : 0;
        ASSERT_LT(found.ci95, .05);
    }
    EXPECT_GT(held, .91 * kRuns);
    EXPECT_LT(held, .99 * kRuns);
}

TEST(SpeechTransmission, BackgroundNoiseHasNamesOrLevels) {
    const auto levels = [](std::string_view text) { return noiseLevels(text).value_or(allBands(-1)); };
    EXPECT_EQ(levels("NC35"), (Bands{60, 60, 52, 45, 40, 36, 34, 33, 32, 32}));
    EXPECT_EQ(levels("nc-35"), levels("NC35"));
    EXPECT_NEAR(levels("NC37.5")[5], 38.5, 1e-12);
    EXPECT_NEAR(levels("NR30")[5], 30, 1e-12);
    EXPECT_NEAR(levels("NR30")[2], 22 + .87 * 30, 1e-12);
    EXPECT_EQ(levels("50,40,35,30,25,20,15"), (Bands{50, 50, 50, 40, 35, 30, 25, 20, 15, 15}));
    EXPECT_EQ(levels("1,2,3,4,5,6,7,8,9,10"), (Bands{1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
    for (const char* wrong : {"", "NC", "NC10", "NC71", "NR200", "NR", "PNC35", "40", "1,2,3,4,5", "1,2,3,x,5,6,7",
                              "1,2,3,4,5,6,", "1,2,3,4,5,6,7,8,9,10,11", "1,2,3,nan,5,6,7", "1,2,3,4,5,6,999"})
        EXPECT_FALSE(noiseLevels(wrong)) << wrong;
    EXPECT_EQ(speechRating(.77), "A+");
    EXPECT_EQ(speechRating(.74), "A");
    EXPECT_EQ(speechRating(.5), "G");
    EXPECT_EQ(speechRating(.2), "U");
    EXPECT_EQ(speechRating(std::nan("")), "");
}

}  // namespace
}  // namespace rtsg
