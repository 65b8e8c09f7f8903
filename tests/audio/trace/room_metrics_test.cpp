// Room-acoustic figures of impulse responses whose figures are known in closed form.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <tuple>
#include <utility>

#include <gtest/gtest.h>

#include <rtsg/audio/room_metrics.h>

#include "response/decay_slopes.h"

#include "audio/triangle_geometry.h"

namespace rtsg {
namespace {

using test::kListener;
using test::kSource;
using test::Shoebox;

/// Ideal decay: energy density exp(-13.8155 t / T) from t = 0 on, in bins.
EnergyHistogram exponential(double reverberationTime, double seconds, double binsPerSecond = 1000) {
    EnergyHistogram histogram{binsPerSecond, {}};
    const double k = 6 * std::log(10.0) / reverberationTime;
    const int bins = static_cast<int>(seconds * binsPerSecond);
    for (int i = 0; i < bins; ++i)
        histogram.add((i + 0.5) / binsPerSecond,
                      allBands(std::exp(-k * i / binsPerSecond) - std::exp(-k * (i + 1) / binsPerSecond)));
    return histogram;
}

TEST(RoomMetrics, ExponentialDecayInClosedForm) {
    for (const double T : {0.3, 1.0, 2.5}) {
        Echogram echogram;
        echogram.late = exponential(T, 3 * T);
        const RoomMetrics m = roomMetrics(echogram);
        const double k = 6 * std::log(10.0) / T;
        EXPECT_NEAR(m.edt[kBand1k], T, 1e-4 * T);
        EXPECT_NEAR(m.t20[kBand1k], T, 1e-4 * T);
        EXPECT_NEAR(m.t30[kBand1k], T, 1e-4 * T);
        EXPECT_NEAR(m.c50[kBand1k], 10 * std::log10(std::exp(k * 0.05) - 1), 1e-4);
        EXPECT_NEAR(m.c80[kBand1k], 10 * std::log10(std::exp(k * 0.08) - 1), 1e-4);
        EXPECT_NEAR(m.d50[kBand1k], 1 - std::exp(-k * 0.05), 1e-5);
        EXPECT_NEAR(m.ts[kBand1k], 1 / k, 3e-4 / k);
        EXPECT_NEAR(m.g[kBand1k], 10 * std::log10(4 * M_PI * 100), 1e-4);
    }
}

/// Least squares through the levels of a millionth of a second each, between two of them.
double fineReverberationTime(const std::function<double(double)>& energyAfter, double fromDb, double toDb) {
    double n = 0, sumT = 0, sumL = 0, sumTT = 0, sumTL = 0;
    for (std::size_t k = 0;; ++k) {
        const double t = (static_cast<double>(k) + .5) * 1e-6, level = 10 * std::log10(energyAfter(t));
        if (level > fromDb) continue;
        if (level < toDb) break;
        n += 1, sumT += t, sumL += level, sumTT += t * t, sumTL += t * level;
    }
    return -60 * (n * sumTT - sumT * sumT) / (n * sumTL - sumT * sumL);
}

/// Where direct sound and single echoes stand out, one more sample or one less is seen.
TEST(RoomMetrics, SlopesAreThoseOfLevelsAtAllTimes) {
    constexpr double T = .5, k = 13.815510557964274 / T;
    for (const double direct : {.1, .4, .6}) {
        Echogram echogram;
        std::vector<std::pair<double, double>> pulses{{.01, direct}, {.013, .1}, {.0217, .05}};
        double pulsed = 0;
        for (const auto& [seconds, energy] : pulses) {
            Arrival& arrival = echogram.arrivals.emplace_back();
            arrival.seconds = seconds;
            arrival.energy = allBands(energy);
            pulsed += energy;
        }
        echogram.late = exponential(T, 3 * T);
        echogram.late.start = .01;
        for (Bands& bin : echogram.late.bins)
            for (double& energy : bin) energy *= 1 - pulsed;
        const auto after = [&](double t) {  // the first arrival
            double energy = (1 - pulsed) * std::exp(-k * t);
            for (const auto& [seconds, each] : pulses)
                if (seconds - .01 > t) energy += each;
            return energy;
        };
        const RoomMetrics m = roomMetrics(echogram);
        EXPECT_NEAR(m.edt[kBand1k], fineReverberationTime(after, 0, -10), 3e-4 * T) << direct;
        EXPECT_NEAR(m.t20[kBand1k], fineReverberationTime(after, -5, -25), 3e-4 * T) << direct;
        EXPECT_NEAR(m.t30[kBand1k], fineReverberationTime(after, -5, -35), 3e-4 * T) << direct;
    }
}

TEST(RoomMetrics, TheLargestErrorIsThatOfTheEarlyDecayTimeToo) {
    MetricsEstimate estimate;
    for (Bands* figure : {&estimate.value.edt, &estimate.value.t20, &estimate.value.t30}) *figure = allBands(1);
    estimate.ci95.edt = allBands(.1);
    EXPECT_NEAR(largestError(estimate), 2, 1e-12) << "of 5 % each";
}

TEST(RoomMetrics, DoubleSlopeFollowsTheEarlyThenTheLateDecay) {
    Echogram echogram;
    echogram.late = exponential(0.5, 9);
    echogram.late.accumulate(exponential(3.0, 9), 0.003);
    const RoomMetrics m = roomMetrics(echogram);
    EXPECT_LT(m.edt[0], 0.52);
    EXPECT_GT(m.t30[0], 1.5 * m.t20[0]);
    EXPECT_NEAR(curvature(m)[0], 100 * (m.t30[0] / m.t20[0] - 1), 1e-12);
    MetricsEstimate estimate{m, {}};
    EXPECT_TRUE(hasTwoSlopes(estimate, 0));
    // Not beyond doubt; and of a straight decay, or one without a T30, none.
    estimate.ci95.t30[0] = m.t30[0] - 1.09 * m.t20[0];
    EXPECT_FALSE(hasTwoSlopes(estimate, 0));
    estimate.ci95.t30[0] = m.t30[0] - 1.11 * m.t20[0];
    EXPECT_TRUE(hasTwoSlopes(estimate, 0));
    estimate.ci95.t20[0] = 0.02 * m.t20[0];
    EXPECT_FALSE(hasTwoSlopes(estimate, 0));
    estimate.value.t30[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(hasTwoSlopes(estimate, 0));
    Echogram straight;
    straight.late = exponential(1.0, 9);
    EXPECT_NEAR(curvature(roomMetrics(straight))[0], 0, 0.1);
    EXPECT_FALSE(hasTwoSlopes({roomMetrics(straight), {}}, 0));
}

TEST(RoomMetrics, BothTimesOfADoubleSlopeAreFound) {
    for (const auto& [early, late, fraction] :
         {std::tuple{.5, 3., .003}, {1.448, 5.597, .05}, {.3, .9, .02}, {1., 2.5, .1}}) {
        Echogram echogram;
        echogram.late = exponential(early, 20);
        echogram.late.accumulate(exponential(late, 20), fraction);
        const DecaySlopes slopes = fitSlopes(decayCurveDb(echogram, 0, .001), .001);
        EXPECT_NEAR(slopes.early, early, .01 * early);
        EXPECT_NEAR(slopes.late, late, .01 * late);
        // Several equal batches: reported for each band.
        const EnergyHistogram batches[] = {echogram.late, echogram.late};
        const MetricsEstimate estimate = estimateMetrics({}, batches);
        ASSERT_TRUE(hasTwoSlopes(estimate, kBand1k)) << early;
        for (std::size_t b = 0; b < kBandCount; ++b) EXPECT_NEAR(estimate.slopes[b].late, late, .01 * late);
    }
    // One slope, or one that bends down; and a decay that ends too early.
    Echogram one;
    one.late = exponential(1.0, 9);
    EXPECT_TRUE(std::isnan(fitSlopes(decayCurveDb(one, 0, .001), .001).late));
    std::vector<double> bent, brief;
    for (int k = 0; k < 700; ++k)
        bent.push_back(-1e-4 * k * k), brief.push_back(k < 200 ? -.1 * k : -20 - .03 * (k - 200));
    EXPECT_TRUE(std::isnan(fitSlopes(bent, .001).late));
    EXPECT_TRUE(std::isnan(fitSlopes(brief, .001).late));
    EXPECT_TRUE(std::isnan(fitSlopes({}, .001).early));
    const EnergyHistogram straight[] = {one.late, one.late};
    EXPECT_TRUE(std::isnan(estimateMetrics({}, straight).slopes[0].late));
}

TEST(RoomMetrics, FreeFieldHasDirectSoundOnly) {
    Echogram echogram;
    Arrival direct;
    direct.seconds = 10 / 343.0;
    direct.energy = allBands(1 / (4 * M_PI * 100));
    echogram.arrivals = {direct};
    const RoomMetrics m = roomMetrics(echogram);
    EXPECT_NEAR(m.g[3], 0, 1e-12);
    EXPECT_NEAR(m.d50[3], 1, 1e-12);
    EXPECT_NEAR(m.ts[3], 0, 1e-12);
    EXPECT_TRUE(std::isnan(m.t30[3]));
    EXPECT_TRUE(std::isnan(m.c50[3]));
    EXPECT_TRUE(std::isnan(roomMetrics(Echogram{}).g[0]));
}

/// Arrivals that are alike in all bands, by time and energy.
Echogram arrivalsAt(const std::vector<std::pair<double, double>>& arrivals) {
    Echogram echogram;
    for (const auto& [seconds, energy] : arrivals) {
        echogram.arrivals.emplace_back().seconds = seconds;
        echogram.arrivals.back().energy = allBands(energy);
    }
    return echogram;
}

double db(double level) {
    return std::pow(10.0, level / 10);
}

TEST(RoomMetrics, BeginWhereAMillisecondIsWithin20DbOfTheLoudest) {
    const auto begin = [](const std::vector<std::pair<double, double>>& arrivals) {
        return onset(arrivalsAt(arrivals), kBand1k);
    };
    EXPECT_EQ(begin({{.02, 1}, {.09, .5}}), .02) << "direct sound";
    EXPECT_EQ(begin({{.0123, db(-30)}, {.02, 1}}), .02);
    EXPECT_EQ(begin({{.0195, db(-30)}, {.02, 1}}), .02) << "within a millisecond of it";
    EXPECT_EQ(begin({{.0123, db(-20.1)}, {.02, 1}}), .02);
    EXPECT_EQ(begin({{.0123, db(-19.9)}, {.02, 1}}), .0123);
    EXPECT_EQ(begin({{.0123, db(-19)}, {.02, 1}, {.3, .9}}), .0123);
    // Two together: the second brings it over, if the first is not too long ago.
    EXPECT_EQ(begin({{.0123, db(-22)}, {.0129, db(-22)}, {.02, 1}}), .0129);
    EXPECT_EQ(begin({{.0123, db(-22)}, {.0134, db(-22)}, {.02, 1}}), .02);
    // And what is loudest may be two as well.
    EXPECT_EQ(begin({{.0123, db(-19)}, {.02, 1}, {.0209, 1}}), .02);
    EXPECT_EQ(begin({{.0123, db(-19)}, {.02, 1}, {.0211, 1}}), .0123);
    // Later, too: a focus 21 dB above direct sound is where the response begins, one 19 dB above it not.
    EXPECT_EQ(begin({{.02, db(-21)}, {.06, 1}}), .06);
    EXPECT_EQ(begin({{.02, db(-19)}, {.06, 1}}), .02);
    EXPECT_TRUE(std::isnan(begin({})));
    EXPECT_TRUE(std::isnan(begin({{.02, 0}})));
}

/// Bins by time of their start, energy.
Echogram binned(const std::vector<std::pair<double, double>>& bins, double binsPerSecond = 1000, double start = 0) {
    Echogram echogram{{}, {binsPerSecond, {}, start}};
    for (const auto& [seconds, energy] : bins) echogram.late.add(seconds + .5 / binsPerSecond, allBands(energy));
    return echogram;
}

TEST(RoomMetrics, BeginWithinABinWhereItsEnergyHasComeSoFar) {
    constexpr double kNone = 1e-12;
    // A bin of b begins what counts when .01 of the loudest has come of it: .01 / b of its millisecond.
    EXPECT_NEAR(onset(binned({{.02, 1}, {.021, .5}}), 0), .02001, kNone);
    EXPECT_NEAR(onset(binned({{.0202, 1}, {.0212, .5}}, 1000, .0002), 0), .02021, kNone);
    EXPECT_NEAR(onset(binned({{.012, .02}, {.02, 1}}), 0), .0125, kNone);
    EXPECT_NEAR(onset(binned({{.012, .0101}, {.02, 1}}), 0), .012 + .001 / 1.01, kNone);
    EXPECT_NEAR(onset(binned({{.012, .0099}, {.02, 1}}), 0), .02001, kNone);
    EXPECT_NEAR(onset(binned({{.012, .006}, {.013, .016}, {.02, 1}}), 0), .0134, kNone)
        << "evenly from one to the next";
    // A millisecond has a quarter of a bin of 4 ms; it holds four bins of 4000 a second.
    EXPECT_NEAR(onset(binned({{.04, 4}, {.044, 1}}, 250), 0), .04001, kNone);
    EXPECT_NEAR(onset(binned({{.02, .004}, {.02025, .004}, {.02075, .004}, {.04, 1}}, 4000), 0), .020875, kNone);
    // Arrivals and bins count together.
    Echogram both = arrivalsAt({{.0125, .007}, {.02, 1}});
    EXPECT_EQ(onset(both, 0), .02);
    both.late = binned({{.012, .008}}).late;
    EXPECT_EQ(onset(both, 0), .0125) << "half of the bin has come";
    both.late = binned({{.012, .004}}).late;
    EXPECT_NEAR(onset(both, 0), .01275, kNone) << "three quarters of it";
    both.late = binned({{.012, .0029}}).late;
    EXPECT_EQ(onset(both, 0), .02) << "not with all of it";
    // The loudest ends as an arrival leaves it and all of a bin has come.
    both = arrivalsAt({{.0123, .011}, {.02, 1}});
    both.late = binned({{.02, 1}}).late;
    EXPECT_EQ(onset(both, 0), .02);
    EXPECT_TRUE(std::isnan(onset(binned({{.02, 0}}), 0)));
}

/// Against a search over each microsecond.
TEST(RoomMetrics, BeginWhereASearchOfAllTimesFindsIt) {
    std::mt19937 random(3382);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int round = 0; round < 40; ++round) {
        Echogram echogram = binned({}, round % 2 ? 1000 : 1700, .0003);
        for (int k = 0; k < 60; ++k) {
            const double rise = db(-40 + k), energy = rise * std::pow(uniform(random), 4);
            if (k % 3) echogram.late.add(k * 1e-3 * uniform(random), allBands(energy));
            if (k % 4 == 0) echogram.arrivals.push_back({k * 1e-3 * uniform(random), allBands(energy), {}, 0});
        }
        const auto upTo = [&](double t) {
            double energy = 0;
            for (const Arrival& arrival : echogram.arrivals) energy += arrival.seconds <= t ? arrival.energy[0] : 0;
            for (std::size_t k = 0; k < echogram.late.bins.size(); ++k)
                energy += echogram.late.bins[k][0] *
                          std::clamp((t - echogram.late.startOf(k)) * echogram.late.binsPerSecond, 0.0, 1.0);
            return energy;
        };
        std::vector<double> last;
        for (int k = 0; k < 70'000; ++k) last.push_back(upTo(k * 1e-6) - upTo(k * 1e-6 - .001));
        const double enough = .01 * *std::max_element(last.begin(), last.end());
        const auto found = std::find_if(last.begin(), last.end(), [&](double energy) { return energy >= enough; });
        EXPECT_NEAR(onset(echogram, 0), 1e-6 * static_cast<double>(found - last.begin()), 2.1e-6) << round;
    }
}

/// Earlier energy counts in G only.
TEST(RoomMetrics, AreThoseOfTheResponseFromItsOnsetOn) {
    const double faint = db(-30);
    Echogram with = arrivalsAt({{.013, faint}, {.02, .5}});
    with.late = exponential(.5, 1.5);
    with.late.bins.insert(with.late.bins.begin(), 30, Bands{});
    with.late.bins[5] = allBands(faint / 10);
    Echogram without = with;
    without.arrivals.erase(without.arrivals.begin());
    without.late.bins[5] = {};
    const RoomMetrics m = roomMetrics(with), n = roomMetrics(without);
    for (auto figure : {&RoomMetrics::edt, &RoomMetrics::t20, &RoomMetrics::t30, &RoomMetrics::c50, &RoomMetrics::c80,
                        &RoomMetrics::d50, &RoomMetrics::ts})
        EXPECT_NEAR((m.*figure)[kBand1k], (n.*figure)[kBand1k], 1e-12);
    EXPECT_NEAR(m.g[kBand1k] - n.g[kBand1k], 10 * std::log10((1.5 + 1.1 * faint) / 1.5), 1e-9);
    EXPECT_EQ(decayCurveDb(with, kBand1k, .01), decayCurveDb(without, kBand1k, .01));
    EXPECT_EQ(decayCurveDb(with, kBand1k, .01).front(), 0);
    // Only the part of a bin from the onset on counts.
    const double half = roomMetrics(binned({{.012, .02}, {.02, 1}})).ts[kBand1k];
    EXPECT_NEAR(half, (.01 * .00025 + 1 * .008) / 1.01, 1e-12);
}

TEST(RoomMetrics, BeginInEachBandByItself) {
    Echogram echogram = arrivalsAt({{.01, 1}, {.02, 1}, {.03, 1}});
    echogram.arrivals[0].energy[2] = db(-25), echogram.arrivals[0].energy[7] = 0;
    echogram.arrivals[1].energy[7] = db(-25);
    for (std::size_t b = 0; b < kBandCount; ++b) {
        EXPECT_EQ(onset(echogram, b), b == 2 ? .02 : b == 7 ? .03 : .01) << b;
        EXPECT_NEAR(roomMetrics(echogram).ts[b], b == 2 ? .005 : b == 7 ? 0 : .01, 1e-12) << b;
    }
    for (Arrival& arrival : echogram.arrivals) arrival.energy[4] = 0;
    EXPECT_TRUE(std::isnan(onset(echogram, 4)));
    for (auto figure : {&RoomMetrics::c50, &RoomMetrics::d50, &RoomMetrics::ts, &RoomMetrics::g})
        EXPECT_TRUE(std::isnan((roomMetrics(echogram).*figure)[4]));
    EXPECT_TRUE(decayCurveDb(echogram, 4, .01).empty());
}

/// One batch of sixteen brings a first bin, so that without it the response begins 3 ms later, and only that.
TEST(RoomMetrics, IntervalsKnowThatTheOnsetHangsOnOneBatch) {
    constexpr int kBatches = 16;
    std::vector<EnergyHistogram> batches(kBatches);
    for (EnergyHistogram& batch : batches) {
        batch = exponential(.5, 1.5);
        batch.bins.insert(batch.bins.begin(), 13, Bands{});
    }
    const double loudest = batches[0].bins[13][0];
    batches[5].bins[10] = allBands(.02 * loudest * kBatches);
    const MetricsEstimate m = estimateMetrics({}, batches);
    // It begins half a bin after the tenth; with each batch left out so but for one, and then .01 ms after the 13th.
    const double moves = 60 / .5 * .00251;  // dB by which what comes after 80 ms falls
    const double late = db(-60 / .5 * (.08 - .0025)), early = 1 + .01 * loudest - late;
    EXPECT_NEAR(m.value.c80[0], 10 * std::log10(early / late), .01);
    const double slope = (1 + late / early) * moves;  // and falls it less what it rises by
    EXPECT_NEAR(m.ci95.c80[0], studentT95(15) * slope * 15 / 16, .15 * m.ci95.c80[0]);
    // Ts is from .0025 s earlier, but for .01 of the energy that comes there.
    EXPECT_NEAR(m.ci95.ts[0], studentT95(15) * .00251 * 15 / 16, .15 * m.ci95.ts[0]);
    // A batch that brings as little to what is later does not move it.
    batches[5].bins[10] = {};
    batches[5].bins[20][0] += .02 * loudest * kBatches;
    EXPECT_LT(estimateMetrics({}, batches).ci95.c80[0], .05);
}

/// All that there is comes in one batch: what its figures vary by cannot be had.
TEST(RoomMetrics, HaveNoIntervalWhereOneBatchHoldsAll) {
    std::vector<EnergyHistogram> batches(4, EnergyHistogram{1000, {}, 0});
    batches[2] = exponential(.5, 1.5);
    const MetricsEstimate m = estimateMetrics({}, batches);
    EXPECT_TRUE(std::isfinite(m.value.c80[0]));
    for (auto figure : {&RoomMetrics::edt, &RoomMetrics::c50, &RoomMetrics::c80, &RoomMetrics::d50, &RoomMetrics::ts,
                        &RoomMetrics::g})
        EXPECT_TRUE(std::isnan((m.ci95.*figure)[0]));
}

struct MetricsRow {
    double absorption, edt, t20, t30, c50, c80, d50, ts, g;
};

TEST(RoomMetrics, SpecularBoxIsExact) {
    // Independent of the tracer: the image lattice summed in closed form. The reference counts time from the start of
    // the millisecond in which direct sound arrives; with exact times C50 differs by .05 to .08 dB.
    for (const MetricsRow& row : {MetricsRow{.1, 1.1741, 1.2978, 1.3696, -.687, 2.145, .4605, .0841, 25.442},
                                  MetricsRow{.3, .3432, .3868, .4078, 8.340, 13.463, .8722, .0241, 19.251}}) {
        Echogram binned, exact;
        const double reach = 343.0 * (row.absorption < 0.2 ? 1.6 : 0.7);
        double direct = 0;
        Shoebox::uniform({6, 5, 3}, row.absorption)
            .images(kSource, kListener, reach, [&](double distance, double energy, int order) {
                if (order == 0) direct = distance;
                binned.late.add(distance / 343, allBands(energy));
                if (distance < 60) {
                    exact.arrivals.push_back({distance / 343, allBands(energy), {}, 0});
                } else {
                    exact.late.add(distance / 343, allBands(energy));
                }
            });
        EXPECT_NEAR(direct / 343 * 1000, 10.5118, 1e-4);
        const auto compare = [&](const RoomMetrics& m, double relative, double db, double ratio, double seconds) {
            EXPECT_NEAR(m.edt[0], row.edt, relative * row.edt);
            EXPECT_NEAR(m.t20[0], row.t20, relative * row.t20);
            EXPECT_NEAR(m.t30[0], row.t30, relative * row.t30);
            EXPECT_NEAR(m.c50[0], row.c50, db);
            EXPECT_NEAR(m.c80[0], row.c80, db);
            EXPECT_NEAR(m.d50[0], row.d50, ratio);
            EXPECT_NEAR(m.ts[0], row.ts, seconds);
            EXPECT_NEAR(m.g[0], row.g, 0.001);
        };
        // The response begins when a hundredth of the first bin has come, .01 ms after it began: .003 dB.
        compare(roomMetrics(binned), 0.0012, 0.003, 2e-4, 6e-4);
        compare(roomMetrics(exact), 0.006, 0.09, 0.003, 6e-4);
    }
}

TEST(RoomMetrics, IntervalsCoverTheTruthAsOftenAsTheySay) {
    // Batches with known expectation: exponential decay whose bins scatter by 30 %.
    constexpr std::uint64_t kSeed = 20090615;
    SCOPED_TRACE(kSeed);
    std::mt19937_64 random(kSeed);
    std::gamma_distribution<double> noise(11.0, 1 / 11.0);
    const EnergyHistogram truth = exponential(1.0, 2.0, 200);
    constexpr int kTrials = 60;
    int coveredT20 = 0, coveredG = 0, total = 0;
    for (int trial = 0; trial < kTrials / 4; ++trial) {
        std::vector<EnergyHistogram> batches(10, truth);
        for (EnergyHistogram& batch : batches)
            for (Bands& bin : batch.bins)
                for (double& energy : bin) energy *= noise(random);
        const MetricsEstimate estimate = estimateMetrics({}, batches);
        for (std::size_t b = 0; b < kBandCount; ++b, ++total) {
            coveredT20 += std::abs(estimate.value.t20[b] - 1.0) <= estimate.ci95.t20[b];
            coveredG += std::abs(estimate.value.g[b] - 10 * std::log10(4 * M_PI * 100)) <= estimate.ci95.g[b];
        }
    }
    // Binomial with p = .95, n = 120: 5 standard deviations below the mean is 102.
    EXPECT_GE(coveredT20, 102) << "of " << total;
    EXPECT_GE(coveredG, 102) << "of " << total;
}

TEST(RoomMetrics, StudentQuantiles) {
    EXPECT_NEAR(studentT95(1), 12.706, 1e-3);
    EXPECT_NEAR(studentT95(15), 2.131, 2e-3);
    EXPECT_NEAR(studentT95(30), 2.042, 2e-3);
    // By bisection of the integral of its density.
    EXPECT_NEAR(studentT95(1.5), 6.0167, .03 * 6);
    EXPECT_NEAR(studentT95(2.5), 3.5747, .005 * 3.6);
    EXPECT_NEAR(studentT95(10.5), 2.2138, 2e-3);
    EXPECT_NEAR(studentT95(1e9), 1.96, 1e-3);
    EXPECT_TRUE(std::isnan(studentT95(.5)));
}

/// Decays whose batches have each an energy of their own, of mean 1; of how many the interval of G covers the truth,
/// and how wide intervals are on average.
std::pair<double, double> coverage(const std::function<double()>& energy, int batches) {
    constexpr int kTrials = 1500;
    const EnergyHistogram truth = exponential(.5, 1, 20);
    double covered = 0, width = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        std::vector<EnergyHistogram> parts(static_cast<std::size_t>(batches), truth);
        for (EnergyHistogram& part : parts) {
            const double factor = energy();
            for (Bands& bin : part.bins)
                for (double& value : bin) value *= factor;
        }
        const MetricsEstimate m = estimateMetrics({}, parts);
        covered += std::abs(m.value.g[0] - 10 * std::log10(4 * M_PI * 100)) <= m.ci95.g[0] ? 1.0 / kTrials : 0;
        width += m.ci95.g[0] / kTrials;
    }
    return {covered, width};
}

/// Where few batches hold most of the energy the spread among them is itself hardly known. With n - 1 degrees of
/// freedom the intervals of the last would cover the truth .917 of the time; with bias and skewness they do so for
/// .969.
TEST(RoomMetrics, IntervalsKnowOfBatchesThatStandOut) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> even(1, .2);
    std::gamma_distribution<double> uneven(2, .5), rare(.2, 5);
    const auto [normal, width] = coverage([&] { return even(random); }, 16);
    // Binomial with n = 1500: .0056 is one standard deviation.
    EXPECT_NEAR(normal, .953, .015);
    // 20 % of a mean of 16 by Student's t, in decibels: hardly more for the normal ones.
    EXPECT_NEAR(width, 2.131 * .2 / 4 * 10 / std::log(10.0), .02);
    EXPECT_NEAR(coverage([&] { return uneven(random); }, 16).first, .952, .015);
    EXPECT_NEAR(coverage([&] { return rare(random); }, 16).first, .96, .015);
}

TEST(Air, IsoTable) {
    const std::array warm{.1, .3, 1.1, 2.8, 5.0, 9.0, 22.9, 76.6},
        cool{.1, .4, 1.0, 1.9, 3.7, 9.7, 32.8, 117.0};  // from 63 Hz on
    for (const auto& [celsius, table] : {std::pair{20.0, warm}, std::pair{10.0, cool}}) {
        Air air;
        air.celsius = celsius;
        air.relativeHumidity = 70;
        const Bands m = airAttenuation(air);
        for (std::size_t b = 0; b < table.size(); ++b)
            EXPECT_NEAR(m[b + 1] * 10 / std::log(10.0) * 1000, table[b], std::max(0.05, 0.005 * table[b]))
                << kBandHz[b + 1];
        // Far below all relaxations it grows with the square of the frequency, far above them more slowly.
        EXPECT_NEAR(m[1] / m[0], std::pow(10, .6), .2);
        EXPECT_GT(m[9], 2 * m[8]);
        EXPECT_LT(m[9], std::pow(10, .6) * m[8]);
    }
    Air still;
    still.absorbs = false;
    EXPECT_EQ(airAttenuation(still), Bands{});
    // It absorbs unless told otherwise: at 20 degrees and 50 %, where the same standard has 4.7 and 9.9 dB/km.
    EXPECT_NEAR(airAttenuation(Air{})[kBand1k] * 10 / std::log(10.0) * 1000, 4.66, .05);
    EXPECT_NEAR(airAttenuation(Air{})[kBand1k + 1] * 10 / std::log(10.0) * 1000, 9.86, .05);
}

TEST(Air, WhatSomebodySaysGoesBeforeWhatIs) {
    AirChoice scene, user;
    scene.celsius = 0;
    scene.relativeHumidity = 30;
    user.relativeHumidity = 80;
    const Air air = user.over(scene.over(Air{}));
    EXPECT_EQ(air.celsius, 0);
    EXPECT_EQ(air.relativeHumidity, 80);
    EXPECT_NEAR(air.speedOfSound, 331.3, .1);
    user.speedOfSound = 340;
    EXPECT_EQ(user.over(air).speedOfSound, 340);
}

}  // namespace
}  // namespace rtsg
