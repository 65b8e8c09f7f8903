// Impulse responses: arrivals, decays of bands, and how they are panned.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/audio/impulse_response.h>
#include <rtsg/audio/room_metrics.h>

#include "signal/band_filters.h"
#include "signal/fft.h"

namespace rtsg {
namespace {

Arrival arrivalAt(double metres, double factor = 1) {
    Arrival arrival;
    arrival.seconds = metres / 343;
    arrival.energy = allBands(factor / (4 * M_PI * metres * metres));
    arrival.direction = {0, 0, -1};
    return arrival;
}

TEST(ImpulseResponse, DirectSoundIsOneSampleOfTheRightHeight) {
    Echogram echogram;
    echogram.arrivals = {arrivalAt(343.0 * 480 / 48000)};  // exactly 480 samples
    const ImpulseResponse response = makeImpulseResponse(echogram, {});
    const auto& p = response.channels.at(0);
    for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(p[i], i == 480 ? 1 / 3.43 : 0, 1e-5) << i;
}

TEST(ImpulseResponse, FractionalDelaysKeepPhaseAndLevel) {
    Echogram echogram;
    echogram.arrivals = {arrivalAt(343.0 * 480.37 / 48000)};
    const auto p = makeImpulseResponse(echogram, {}).channels.at(0);
    for (const double hz : {200.0, 1000.0, 5000.0, 12000.0}) {
        double re = 0, im = 0;
        for (std::size_t i = 0; i < p.size(); ++i) {
            const double phase = 2 * M_PI * hz * (static_cast<double>(i) - 480.37) / 48000;
            re += p[i] * std::cos(phase);
            im -= p[i] * std::sin(phase);
        }
        EXPECT_NEAR(re, 48000 / (343 * 480.37), 2e-4) << hz;
        EXPECT_NEAR(im, 0, 2e-4) << hz;
    }
}

TEST(ImpulseResponse, BandWeightsAddUpToOne) {
    for (double hz = 1; hz < 24000; hz *= 1.03) {
        double sum = 0;
        for (int b = 0; b < kBandCount; ++b) sum += bandWeight(b, hz);
        EXPECT_NEAR(sum, 1, 1e-12) << hz;
    }
    for (int b = 0; b < kBandCount; ++b) EXPECT_NEAR(bandWeight(b, kBandHz[static_cast<std::size_t>(b)]), 1, 1e-3);
}

/// Energy over time in octave bands of a response.
EnergyHistogram analyseImpulseResponse(std::span<const float> samples, int sampleRate) {
    constexpr double binsPerSecond = 1000;
    EnergyHistogram histogram{binsPerSecond, {}};
    const auto kept = RealFft::kept(RealFft::sizeFor(samples.size() + 4096));
    const RealFft& fft = *kept;
    const BandFilters filters(fft.size(), sampleRate, BandFilters::apart());
    std::vector<float> padded(fft.size()), band(fft.size());
    std::copy(samples.begin(), samples.end(), padded.begin());
    RealFft::Spectrum all, filtered(fft.bins());
    fft.forward(padded, all);
    histogram.bins.resize(static_cast<std::size_t>(static_cast<double>(samples.size()) * binsPerSecond / sampleRate) +
                          1);
    for (std::size_t b = 0; b < kBandCount; ++b) {
        // The energy of an impulse in this band, so that a flat spectrum reads the same in all of them.
        double width = 0;
        for (std::size_t i = 0; i < fft.bins(); ++i) {
            filtered[i] = all[i] * filters[b][i];
            const double w = static_cast<double>(filters[b][i]);
            width += w * w * (i == 0 || i + 1 == fft.bins() ? 1 : 2);
        }
        width /= static_cast<double>(fft.size());
        fft.inverse(filtered, band);
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const double pressure = static_cast<double>(band[i]);
            histogram.bins[static_cast<std::size_t>(static_cast<double>(i) * binsPerSecond / sampleRate)][b] +=
                pressure * pressure / (4 * M_PI * width);
        }
    }
    return histogram;
}

TEST(ImpulseResponse, DecayOfEachBandComesBackOut) {
    // One reverberation time per octave; the energies at a microphone must show them again.
    const Bands times{1.25, 1.2, 1.1, 1.0, .9, .8, .7, .6, .5, .45};
    Echogram echogram;
    const double distance = 2;
    echogram.arrivals = {arrivalAt(distance)};
    for (int i = 6; i < 1500; ++i) {
        Bands energy;
        for (std::size_t b = 0; b < kBandCount; ++b)
            energy[b] = echogram.arrivals[0].energy[b] * 0.02 * std::exp(-6 * std::log(10.0) / times[b] * i * 0.001);
        echogram.late.add((i + 0.5) * 0.001, energy);
    }
    const ImpulseResponse response = makeImpulseResponse(echogram, {});
    Echogram measured;
    measured.late = analyseImpulseResponse(response.channels[0], response.sampleRate);
    const RoomMetrics in = roomMetrics(echogram), out = roomMetrics(measured);
    for (std::size_t b = 2; b < kBandCount; ++b) {
        // Noise of a band of B hertz decaying within T: the estimate scatters by about 1 / sqrt(B T).
        const double scatter = 3 / std::sqrt(kBandHz[b] * 0.7 * times[b] / 2);
        EXPECT_NEAR(out.t20[b] / in.t20[b], 1, scatter) << kBandHz[b];
        EXPECT_NEAR(out.g[b], in.g[b], 0.4 + 4 * scatter) << kBandHz[b];
    }
    EXPECT_NEAR(out.t20[kBand1k + 3] / in.t20[kBand1k + 3], 1, 0.04);
    EXPECT_NEAR(out.g[kBand1k + 3], in.g[kBand1k + 3], 0.3);
}

/// Bands that hold the same are filtered together; a hair's difference keeps them apart.
TEST(ImpulseResponse, BandsThatAreAlikeSoundAsIfFilteredOneByOne) {
    Echogram together;
    together.arrivals = {arrivalAt(2)};
    for (std::size_t b = 3; b < 7; ++b) together.arrivals[0].energy[b] *= .25;
    for (int i = 6; i < 300; ++i) {
        Bands energy = allBands(1e-4 * std::exp(-.02 * i));
        for (std::size_t b = 3; b < 7; ++b) energy[b] *= .5;
        together.late.add((i + 0.5) * 0.001, energy);
    }
    Echogram apart = together;
    for (std::size_t b = 0; b < kBandCount; ++b) apart.arrivals[0].energy[b] *= 1 + 1e-9 * static_cast<double>(b);
    const auto a = makeImpulseResponse(together, {}).channels.at(0), c = makeImpulseResponse(apart, {}).channels.at(0);
    ASSERT_EQ(a.size(), c.size());
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], c[i], 2e-6) << i;
}

TEST(ImpulseResponse, StereoPansAndRepeats) {
    Echogram echogram;
    echogram.arrivals = {arrivalAt(3.43)};
    echogram.arrivals[0].direction = {1, 0, 0};  // from the right
    for (int i = 20; i < 100; ++i) echogram.late.add(i * 0.001, allBands(1e-4));
    ImpulseResponseOptions options;
    options.channels = ImpulseResponseOptions::Channels::stereo;
    const ImpulseResponse a = makeImpulseResponse(echogram, options), b = makeImpulseResponse(echogram, options);
    ASSERT_EQ(a.channels.size(), 2u);
    EXPECT_EQ(a.channels, b.channels);
    EXPECT_GT(a.channels[1][480], 3 * a.channels[0][480]);
    // The reverberation is alike in level and unlike in detail.
    double left = 0, right = 0, both = 0;
    for (std::size_t i = 1000; i < 4800; ++i) {
        left += a.channels[0][i] * a.channels[0][i];
        right += a.channels[1][i] * a.channels[1][i];
        both += a.channels[0][i] * a.channels[1][i];
    }
    EXPECT_NEAR(10 * std::log10(left / right), 0, 0.3);
    EXPECT_LT(std::abs(both) / std::sqrt(left * right), 0.1);
    options.channels = ImpulseResponseOptions::Channels::binaural;
    const ImpulseResponse ears = makeImpulseResponse(echogram, options);
    const auto peak = [](const std::vector<float>& x) {
        return std::max_element(x.begin(), x.begin() + 900) - x.begin();
    };
    EXPECT_NEAR(static_cast<double>(peak(ears.channels[0]) - peak(ears.channels[1])),
                0.0875 / 343 * (1 + M_PI / 2) * 48000, 1.5);
    options.headRadius = 0.25;
    const ImpulseResponse wide = makeImpulseResponse(echogram, options);
    EXPECT_NEAR(static_cast<double>(peak(wide.channels[0]) - peak(wide.channels[1])),
                0.25 / 343 * (1 + M_PI / 2) * 48000, 1.5);
    options.firstOrder = 1;
    EXPECT_NEAR(makeImpulseResponse(echogram, options).channels[1][468], 0, 1e-3);
}

/// Loud and faint ones, between which the transforms of waves begin anew.
Echogram bentSound(int loud, int faint) {
    Echogram echogram;
    echogram.arrivals = {arrivalAt(3)};
    for (int i = 0; i < loud + faint; ++i) {
        EdgeWave& wave = echogram.edges.waves.emplace_back();
        wave.seconds = .01 + .0013 * i;
        wave.direction = glm::normalize(glm::dvec3(std::sin(i), 0, std::cos(i)));
        const float amplitude = i < loud ? .05f : 3e-4f;
        // A pulse that fades within a millisecond, with nothing before it.
        for (std::size_t t = 0; t < kEdgeTones; ++t)
            wave.pressure[t] =
                amplitude / std::complex<float>(1, static_cast<float>(edgeToneHz(static_cast<double>(t)) / 500));
    }
    return echogram;
}

double energyOf(const std::vector<float>& samples) {
    double sum = 0;
    for (const float sample : samples) sum += static_cast<double>(sample) * static_cast<double>(sample);
    return sum;
}

/// Energy of what a response is off the sum of those of its waves, dB re that.
double offSingleWaves(const Echogram& echogram, ImpulseResponseOptions options) {
    options.firstOrder = 1;
    const ImpulseResponse all = makeImpulseResponse(echogram, options);
    double off = 0, sum = 0;
    for (std::size_t c = 0; c < all.channels.size(); ++c) {
        std::vector<float> rest = all.channels[c], single(rest.size());
        for (const EdgeWave& wave : echogram.edges.waves) {
            // The first arrival says what is heard through a head; less of it, and no wave is faint beside it.
            Echogram one{.arrivals = echogram.arrivals, .late = {}, .edges = {.waves = {wave}, .straight = {}}};
            for (double& energy : one.arrivals[0].energy) energy *= 1e-9;
            const std::vector<float> part = makeImpulseResponse(one, options).channels[c];
            for (std::size_t i = 0; i < std::min(part.size(), rest.size()); ++i) single[i] += part[i];
        }
        for (std::size_t i = 0; i < rest.size(); ++i) rest[i] -= single[i];
        off += energyOf(rest);
        sum += energyOf(single);
    }
    return 10 * std::log10(off / sum);
}

TEST(ImpulseResponse, WavesThatAreSummedAreTheSumOfEach) {
    using Channels = ImpulseResponseOptions::Channels;
    for (const Channels channels : {Channels::mono, Channels::stereo, Channels::binaural, Channels::ambisonic}) {
        ImpulseResponseOptions options;
        options.channels = channels;
        EXPECT_LT(offSingleWaves(bentSound(60, 0), options), -35) << static_cast<int>(channels);
    }
}

TEST(ImpulseResponse, WavesThatAreLeftOutAre40DbBelowAll) {
    const Echogram echogram = bentSound(10, 200);
    EXPECT_LT(offSingleWaves(echogram, {}), -30);
    // They have one part in 10,000 of the energy that arrives, direct sound included.
    Echogram faint = echogram;
    faint.edges.waves.erase(faint.edges.waves.begin(), faint.edges.waves.begin() + 10);
    ImpulseResponseOptions options;
    options.firstOrder = 1;
    const double direct = 1.0 / 9;
    EXPECT_LT(energyOf(makeImpulseResponse(faint, options).channels[0]), 2e-4 * direct);
}

/// Late sound of some octaves, each bin unlike its neighbours, as few rays bring it.
Echogram unevenDecay(double low, double high) {
    Echogram echogram;
    for (int i = 20; i < 1000; ++i) {
        Bands energy = allBands(low * (i % 3 == 0 ? 2.5 : .25) * 1e-5 * std::exp(-.005 * i));
        for (std::size_t b = 6; b < kBandCount; ++b) energy[b] *= high / low;
        echogram.late.add((i + .5) * .001, energy);
    }
    return echogram;
}

TEST(ImpulseResponse, NoiseHasTheEnergyOfEachOctaveAndLeaksNone) {
    const Echogram even = unevenDecay(1, 1), steep = unevenDecay(1, 1e-6);
    for (const std::uint64_t seed : {1, 2, 3}) {
        ImpulseResponseOptions options;
        options.seed = seed;
        const auto levels = [&](const Echogram& echogram) {
            Echogram measured;
            measured.late = analyseImpulseResponse(makeImpulseResponse(echogram, options).channels[0], 48000);
            const Bands is = measured.total(), asked = echogram.total();
            Bands ratio;
            for (std::size_t b = 0; b < kBandCount; ++b) ratio[b] = 10 * std::log10(is[b] / asked[b]);
            return ratio;
        };
        const Bands same = levels(even), down = levels(steep);
        for (std::size_t b = 2; b < kBandCount; ++b)
            EXPECT_NEAR(same[b], 0, .2 + 30 / std::sqrt(kBandHz[b])) << kBandHz[b] << " Hz, seed " << seed;
        for (std::size_t b = 7; b < kBandCount; ++b)
            EXPECT_LT(down[b], 20) << "60 dB below the other octaves: " << kBandHz[b] << " Hz";
    }
}

double correlation(std::span<const float> a, std::span<const float> b) {
    double both = 0, as = 0, bs = 0;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
        const auto x = static_cast<double>(a[i]), y = static_cast<double>(b[i]);
        both += x * y, as += x * x, bs += y * y;
    }
    return both / std::sqrt(as * bs);
}

TEST(ImpulseResponse, NoiseOfSourcesAndChannelsIsUnlike) {
    const Echogram late = unevenDecay(1, 1);
    ImpulseResponseOptions options;
    options.channels = ImpulseResponseOptions::Channels::ambisonic;
    for (const bool shared : {false, true}) {
        options.sharedNoise = shared;
        std::vector<std::vector<float>> all;
        for (const std::uint64_t seed : {1, 2, 3}) {
            options.seed = seed;
            const ImpulseResponse response = makeImpulseResponse(late, options);
            all.insert(all.end(), response.channels.begin(), response.channels.end());
        }
        for (std::size_t a = 0; a < all.size(); ++a)
            for (std::size_t b = 0; b < a; ++b)
                EXPECT_LT(std::abs(correlation(all[a], all[b])), .15) << a << " and " << b;
    }
}

/// Whatever delay one has: responses of two seeds are not parts of one noise.
TEST(ImpulseResponse, NoiseOfOneSeedIsNowhereInThatOfAnother) {
    Echogram late;
    for (int i = 20; i < 1000; ++i) late.late.add((i + .5) * .001, allBands(1e-5));
    ImpulseResponseOptions options;
    options.sampleRate = 16'000;
    std::vector<std::vector<float>> all;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        options.seed = seed;
        all.push_back(makeImpulseResponse(late, options).channels[0]);
        EXPECT_EQ(makeImpulseResponse(late, options).channels[0], all.back()) << "equal seeds";
    }
    // A tenth of a second of each, at all delays of the others that are whole milliseconds, and some that are not.
    for (const auto& a : all)
        for (const auto& b : all)
            for (std::size_t delay = 400; &a != &b && delay + 1600 < b.size(); delay += delay % 3 ? 16 : 15)
                ASSERT_LT(std::abs(correlation(std::span(a).subspan(8000, 1600), std::span(b).subspan(delay, 1600))),
                          .35)
                    << delay;
}

TEST(ImpulseResponse, SeedsOfNoiseDependOnTheSeedAndOnBothPoints) {
    const glm::dvec3 source(1, 2, 3), listener(4, 0, 6);
    const std::uint64_t seed = noiseSeed(1, source, listener);
    EXPECT_EQ(noiseSeed(1, source, {4, -0.0, 6}), seed);
    for (const std::uint64_t other : {noiseSeed(2, source, listener), noiseSeed(1, {1, 2, 3.001}, listener),
                                      noiseSeed(1, source, {4, 1e-9, 6}), noiseSeed(1, listener, source)})
        EXPECT_NE(other, seed);
}

TEST(ImpulseResponse, HasTheLengthThatIsAskedFor) {
    const Echogram late = unevenDecay(1, 1);
    ImpulseResponseOptions options;
    const std::vector<float> whole = makeImpulseResponse(late, options).channels[0];
    for (const double seconds : {.25, 3.0}) {
        options.seconds = seconds;
        const std::vector<float> cut = makeImpulseResponse(late, options).channels[0];
        ASSERT_EQ(cut.size(), static_cast<std::size_t>(seconds * 48'000));
        for (std::size_t i = 0; i < cut.size(); ++i) ASSERT_EQ(cut[i], i < whole.size() ? whole[i] : 0) << i;
    }
}

}  // namespace
}  // namespace rtsg
