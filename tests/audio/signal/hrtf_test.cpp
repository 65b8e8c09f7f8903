// Heads from SOFA files: delays and levels of the ears against the measured set itself, in responses and in sound.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <filesystem>
#include <fstream>
#include <limits>

#include <gtest/gtest.h>
#include <mysofa.h>

#include <rtsg/audio/hrtf.h>
#include <rtsg/audio/impulse_response.h>

#include "audio/listen/listen_scene.h"
#include "sound_io/netcdf_file.h"

namespace rtsg {
namespace {

/// The set of the KEMAR head that comes with libmysofa.
const std::filesystem::path kHead = "/usr/share/libmysofa/default.sofa";

/// Level of a signal at one frequency, and its phase re sample `at`.
std::complex<double> tone(std::span<const float> samples, double hz, double at, int rate = 48000) {
    std::complex<double> sum;
    for (std::size_t i = 0; i < samples.size(); ++i)
        sum += static_cast<double>(samples[i]) * std::polar(1.0, -2 * M_PI * hz * (static_cast<double>(i) - at) / rate);
    return sum;
}

class Head : public testing::Test {
  protected:
    void SetUp() override {
        if (!std::filesystem::exists(kHead)) GTEST_SKIP() << kHead << " is not there";
        auto loaded = Hrtf::load(kHead, 48000);
        ASSERT_TRUE(loaded) << loaded.error().text;
        head = *loaded;
        int length = 0, error = 0;
        easy = mysofa_open(kHead.c_str(), 48000, &length, &error);
        ASSERT_TRUE(easy);
        size = static_cast<std::size_t>(length);
    }
    void TearDown() override {
        if (easy) mysofa_close(easy);
    }
    /// The measured responses, left and right, for a direction in degrees to the left and up.
    std::array<std::complex<double>, 2> measured(double azimuth, double elevation, double hz) const {
        const double a = azimuth * M_PI / 180, e = elevation * M_PI / 180;
        std::vector<float> left(size), right(size);
        float leftDelay = 0, rightDelay = 0;
        mysofa_getfilter_float(easy, static_cast<float>(std::cos(e) * std::cos(a)),
                               static_cast<float>(std::cos(e) * std::sin(a)), static_cast<float>(std::sin(e)),
                               left.data(), right.data(), &leftDelay, &rightDelay);
        return {tone(left, hz, -static_cast<double>(leftDelay)), tone(right, hz, -static_cast<double>(rightDelay))};
    }
    static glm::dvec3 direction(double azimuth, double elevation) {
        const double a = azimuth * M_PI / 180, e = elevation * M_PI / 180;
        return {-std::cos(e) * std::sin(a), std::sin(e), -std::cos(e) * std::cos(a)};
    }
    static constexpr double kDirections[][2] = {{0, 0}, {30, 0}, {90, 0}, {-90, 0}, {140, 20}, {-45, -30}, {10, 70}};

    std::shared_ptr<const Hrtf> head;
    MYSOFA_EASY* easy = nullptr;
    std::size_t size = 0;
};

TEST_F(Head, EarsDifferInLevelAndTimeAsMeasured) {
    for (const auto& position : kDirections)
        for (const double hz : {300.0, 1000.0, 4000.0}) {
            const auto expected = measured(position[0], position[1], hz);
            const Hrtf::Ears ears = head->at(direction(position[0], position[1]));
            const auto left = tone(ears[0], hz, 0), right = tone(ears[1], hz, 0);
            EXPECT_NEAR(20 * std::log10(std::abs(left / right)), 20 * std::log10(std::abs(expected[0] / expected[1])),
                        .05)
                << position[0] << ' ' << hz;
            EXPECT_NEAR(std::arg(left / right * expected[1] / expected[0]), 0, .01) << position[0] << ' ' << hz;
            EXPECT_NEAR(20 * std::log10(std::abs(left / expected[0])), 0, .05) << position[0] << ' ' << hz;
        }
}

TEST_F(Head, TheEarOnTheSideOfTheSourceHearsItFirstAndSoundFromAheadComesInTime) {
    const auto onset = [](const std::vector<float>& ear) {
        float peak = 0;
        for (const float sample : ear) peak = std::max(peak, std::abs(sample));
        return std::find_if(ear.begin(), ear.end(), [&](float sample) { return std::abs(sample) > .1f * peak; }) -
               ear.begin();
    };
    const Hrtf::Ears ahead = head->at({0, 0, -1}), left = head->at({-1, 0, 0});
    EXPECT_NEAR(static_cast<double>(onset(ahead[0])), static_cast<double>(head->early()), 2);
    // A head of 8.75 cm: .66 ms, 31 samples.
    EXPECT_NEAR(static_cast<double>(onset(left[1]) - onset(left[0])), 31, 6);
    EXPECT_LT(onset(left[0]), static_cast<std::ptrdiff_t>(head->early()));
}

TEST_F(Head, ResponsesOfRoomsHaveItsLevelsForDirectAndEarlySound) {
    Echogram echogram;
    for (const double metres : {3.43, 6.86}) {
        Arrival arrival;
        arrival.seconds = metres / 343;
        arrival.energy = allBands(1 / (4 * M_PI * metres * metres));
        arrival.direction = metres < 5 ? direction(60, 0) : direction(-120, 10);
        arrival.order = metres < 5 ? 0 : 1;
        echogram.arrivals.push_back(arrival);
    }
    ImpulseResponseOptions options;
    options.channels = ImpulseResponseOptions::Channels::binaural;
    options.hrtf = head;
    for (const std::uint32_t first : {0u, 1u}) {
        options.firstOrder = first;
        const ImpulseResponse response = makeImpulseResponse(echogram, options);
        ASSERT_EQ(response.channels.size(), 2u);
        for (const double hz : {300.0, 1000.0, 3000.0}) {
            // The second alone, or both, half as loud and .01 s apart.
            const auto a = measured(60, 0, hz), b = measured(-120, 10, hz);
            const auto ahead = tone(head->at({0, 0, -1})[0], hz, static_cast<double>(head->early()));
            const auto lead = ahead / measured(0, 0, hz)[0];
            for (std::size_t e = 0; e < 2; ++e) {
                auto expected = b[e] / 6.86 * std::polar(1.0, -2 * M_PI * hz * .02);
                if (first == 0) expected += a[e] / 3.43 * std::polar(1.0, -2 * M_PI * hz * .01);
                const auto got = tone(response.channels[e], hz, 0) / lead;
                EXPECT_NEAR(std::abs(got - expected), 0, 2e-3 * (1 + std::abs(expected))) << hz << ' ' << e;
            }
        }
    }
}

using HeadInScene = test::Listen;

TEST_F(HeadInScene, DirectSoundGoesThroughIt) {
    if (!std::filesystem::exists(kHead)) GTEST_SKIP() << kHead << " is not there";
    const auto head = Hrtf::load(kHead, 48000);
    ASSERT_TRUE(head);
    Scene scene;
    // 3.43 m to the left, 480 samples away.
    load(scene,
         "Sound { location -3.43 0 0 minBack 30 minFront 30 maxBack 60 maxFront 60 spatialize TRUE source AudioClip { "
         "url \"impulse.wav\" } }\nViewpoint { position 0 0 0 }\n");
    ListenOptions asked = options();
    asked.render.binaural = true;
    asked.render.reflections = false;
    asked.render.hrtf = *head;
    asked.render.air.absorbs = false;
    const auto report = listen(scene, asked);
    ASSERT_TRUE(report) << report.error().text;
    const Hrtf::Ears ears = (*head)->at({-1, 0, 0});
    for (std::size_t e = 0; e < 2; ++e)
        for (std::size_t i = 0; i < 200; ++i)
            EXPECT_NEAR(report->sound.samples[2 * (480 + i - (*head)->early()) + e], .5f * ears[e][i], 2e-3)
                << e << ' ' << i;
}

TEST(Hrtf, WhatIsNoSofaFileIsRefused) {
    const test::TempFolder folder;
    const std::filesystem::path file = folder.path() / "a.sofa";
    EXPECT_FALSE(Hrtf::load(file, 48000));
    EXPECT_FALSE(Hrtf::load(folder.path(), 48000));
    std::ofstream(file) << "no head";
    const auto none = Hrtf::load(file, 48000);
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().text.find("a.sofa"), std::string::npos);
}

/// A head of six directions, ahead, behind, left, right, above and below, by two ears of 64 samples each, and what they
/// come later by, in samples.
struct SixDirections {
    std::vector<double> responses = std::vector<double>(6 * 2 * 64), delays = std::vector<double>(6 * 2);
    SixDirections() {
        for (std::size_t ear = 0; ear < 12; ++ear) responses[64 * ear + 20] = 1;
    }
    void write(const std::filesystem::path& file) const {
        const NetcdfAttributes metres{{"Type", "cartesian"}, {"Units", "metre"}};
        NetcdfFile head{
            {{'I', 1}, {'C', 3}, {'R', 2}, {'E', 1}, {'N', 64}, {'M', 6}},
            {{"Conventions", "SOFA"},
             {"Version", "1.0"},
             {"SOFAConventions", "SimpleFreeFieldHRIR"},
             {"SOFAConventionsVersion", "1.0"},
             {"DataType", "FIR"},
             {"RoomType", "free field"}},
            {{"ListenerPosition", "IC", {0, 0, 0}, {}, metres},
             {"ListenerView", "IC", {1, 0, 0}, {}, metres},
             {"ListenerUp", "IC", {0, 0, 1}, {}, {}},
             {"ReceiverPosition", "RCI", {0, .09, 0, 0, -.09, 0}, {}, metres},
             {"EmitterPosition", "ECI", {0, 0, 0}, {}, metres},
             {"SourcePosition", "MC", {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1}, {}, metres},
             {"Data.IR", "MRN", responses, {}, {}},
             {"Data.SamplingRate", "I", {48000}, {}, {{"Units", "hertz"}}},
             {"Data.Delay", "MR", delays, {}, {}}}};
        // libmysofa reads attributes as HDF5 keeps many, and not as it keeps few.
        for (const char* name : {"Title", "APIName", "APIVersion", "AuthorContact", "Organization", "License"})
            head.attributes.emplace_back(name, "unknown");
        EXPECT_EQ((*netcdfWriter())->write(file.string(), head), "");
    }
};

class WrittenHead : public testing::Test {
  protected:
    void SetUp() override {
        if (const auto writer = netcdfWriter(); !writer) GTEST_SKIP() << writer.error().text;
    }
    const test::TempFolder folder_;
    const std::filesystem::path file_ = folder_.path() / "a.sofa";
};

/// In samples of the file, whatever rate is asked for.
TEST_F(WrittenHead, EarsHearLaterByItsDelays) {
    SixDirections six;
    six.delays[2 * 2 + 1] = 30;  // from the left, the right ear
    for (double& delay : six.delays) delay += 7;
    six.write(file_);
    for (const int rate : {48000, 96000, 32000}) {
        const auto head = Hrtf::load(file_, rate);
        ASSERT_TRUE(head) << head.error().text;
        const auto peaks = [&](const glm::dvec3& from) {
            const Hrtf::Ears ears = (*head)->at(from);
            std::array<double, 2> at{};
            for (std::size_t e = 0; e < 2; ++e)
                at[e] = static_cast<double>(std::ranges::max_element(ears[e]) - ears[e].begin());
            return at;
        };
        const auto ahead = peaks({0, 0, -1}), left = peaks({-1, 0, 0});
        EXPECT_NEAR(ahead[0], static_cast<double>((*head)->early()), 4 * rate / 48000) << rate;
        EXPECT_EQ(ahead[1], ahead[0]) << rate;
        EXPECT_EQ(left[0], ahead[0]) << rate;
        EXPECT_EQ(left[1], ahead[0] + 30 * rate / 48000) << rate;
    }
}

/// A wave by an edge is heard as a pulse from there is, with its own spectrum.
TEST_F(WrittenHead, HearsWhatEdgesBend) {
    SixDirections six;
    six.delays[2 * 2 + 1] = 30;  // from the left, the right ear
    six.write(file_);
    const auto head = Hrtf::load(file_, 48000);
    ASSERT_TRUE(head) << head.error().text;
    const auto response = [&](std::complex<float> pressure, bool wave) {
        Echogram echogram;
        Arrival pulse;
        pulse.seconds = .0123;
        pulse.direction = {-1, 0, 0};
        pulse.energy = allBands(1 / (4 * M_PI));
        echogram.arrivals = {pulse};
        if (wave) {
            echogram.arrivals[0].straight = 0;
            echogram.edges.straight = {Bands{}};
            EdgeWave by;
            by.seconds = pulse.seconds;
            by.direction = pulse.direction;
            by.pressure.fill(pressure);
            echogram.edges.waves = {by};
        }
        ImpulseResponseOptions options;
        options.channels = ImpulseResponseOptions::Channels::binaural;
        options.hrtf = *head;
        return makeImpulseResponse(echogram, options);
    };
    const ImpulseResponse pulse = response(1, false), wave = response(-.5f, true);
    for (std::size_t ear = 0; ear < 2; ++ear)
        for (const double hz : {200.0, 1000.0, 8000.0}) {
            const auto ofPulse = tone(pulse.channels[ear], hz, 0), ofWave = tone(wave.channels[ear], hz, 0);
            EXPECT_NEAR(std::abs(ofWave + .5 * ofPulse), 0, .003) << ear << ' ' << hz;
        }
}

/// Wherever in a file they are.
TEST_F(WrittenHead, IsRefusedForWhatIsNoNumber) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    const auto reported = [&](double sample, double delay) {
        SixDirections six;
        six.responses[64 * 2 + 30] = sample;
        six.delays[2] = delay;
        six.write(file_);
        const auto loaded = Hrtf::load(file_, 48000);
        return loaded ? "" : loaded.error().text.substr(file_.string().size());
    };
    EXPECT_EQ(reported(.5, 30), "");
    for (const double sample : {nan, inf}) EXPECT_EQ(reported(sample, 0), ": it has samples that are no numbers");
    for (const double delay : {nan, -inf, 1e30, -48001.0})
        EXPECT_EQ(reported(0, delay), ": it has delays that are not those of a head");
}

}  // namespace
}  // namespace rtsg
