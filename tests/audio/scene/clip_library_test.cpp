// Clips that are read once, within the limit on samples, silent where they cannot be, and played at any rate.
#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <fstream>
#include <numbers>

#include <gtest/gtest.h>

#include <rtsg/audio/clip_library.h>

#include "scene/process_player.h"
#include "support/plain_film.h"
#include "support/temp_folder.h"
#include "test_paths.h"

namespace rtsg {
namespace {

constexpr int kFileRate = 48000;

class Clips : public testing::Test {
  protected:
    void write(const char* name, std::size_t frames, int rate, int channels = 1) const {
        SoundBuffer sound{rate, channels, std::vector<float>(frames * static_cast<std::size_t>(channels), .25f)};
        ASSERT_TRUE(writeWav((folder_.path() / name).string(), sound, WavFormat::float32));
    }
    SoundVoice voice(std::vector<std::string> urls) const {
        SoundVoice result;
        result.name = "V";
        result.urls = std::move(urls);
        result.folders = {folder_.path()};
        return result;
    }
    ClipLibrary library(std::uint64_t maximumSamples) const {
        ResourcePolicy policy;
        policy.roots = {folder_.path()};
        policy.maximumSamples = maximumSamples;
        return {kFileRate, Resources(folder_.path(), policy)};
    }
    static bool isSilent(const SoundBuffer& sound) {
        return std::ranges::all_of(sound.samples, [](float sample) { return sample == 0; });
    }

    const test::TempFolder folder_;
};

TEST_F(Clips, AreReadOnceAndMayBeTheSecondOfTheirUrls) {
    write("a.wav", 1000, kFileRate, 2);
    ClipLibrary clips = library(1 << 20);
    const auto first = clips.get(voice({"nowhere.wav", "a.wav"}));
    EXPECT_EQ(first->frames(), 1000U);
    EXPECT_EQ(first->channels, 2);
    EXPECT_EQ(clips.get(voice({"nowhere.wav", "a.wav"})), first);
    EXPECT_EQ(clips.diagnostics().warnings(), 0U);
}

TEST_F(Clips, MayBeWhatAFilmIsHeardBy) {
    std::ofstream(folder_.path() / "film.avi", std::ios::binary) << test::plainFilm(3, 10, 4, 2, kFileRate);
    std::ofstream(folder_.path() / "silent.avi", std::ios::binary) << test::plainFilm(3, 10);
    ClipLibrary clips = library(1 << 20);
    const auto sound = clips.get(voice({"silent.avi", "film.avi"}));
    EXPECT_EQ(sound->channels, 2);
    ASSERT_EQ(sound->frames(), 14'400U);
    EXPECT_EQ(sound->samples[2 * 1000], 1000 / 32768.0f);
    EXPECT_EQ(sound->samples[2 * 1000 + 1], -1000 / 32768.0f);
    EXPECT_EQ(clips.diagnostics().warnings(), 0U);
    ClipLibrary few = library(20'000);
    EXPECT_TRUE(isSilent(*few.get(voice({"film.avi"}))));
}

/// A quarter of a second of 1 kHz at half of full scale, each as an encoder makes it: blocks may be filled up.
TEST_F(Clips, OfCodecsThatTheSoundLibraryDoesNotKnowAreKnownByTheirContent) {
    const std::filesystem::path data = std::filesystem::path(RTSG_SOURCE_DIR) / "tests/audio/scene/data";
    for (const char* name : {"tone.aac", "tone.ac3", "tone.wma", "tone.mka", "tone.webm", "flac.ogg"}) {
        std::filesystem::copy_file(data / name, folder_.path() / "clip.wav",  // whatever it is called
                                   std::filesystem::copy_options::overwrite_existing);
        ClipLibrary clips = library(1 << 20);
        const auto sound = clips.get(voice({"clip.wav"}));
        EXPECT_EQ(clips.diagnostics().warnings(), 0U) << name;
        EXPECT_EQ(sound->channels, 1) << name;
        EXPECT_NEAR(static_cast<double>(sound->frames()), 12'000, 3100) << name;
        double squares = 0;
        for (std::size_t i = 5000; i < 9800; ++i) squares += static_cast<double>(sound->samples[i] * sound->samples[i]);
        EXPECT_NEAR(std::sqrt(2 * squares / 4800), .5, .03) << name;
        EXPECT_TRUE(isSilent(*library(1000).get(voice({"clip.wav"})))) << name;
    }
    // A file that begins like a WAV but is none is reported with the sound library's message.
    std::ofstream(folder_.path() / "clip.wav", std::ios::binary)
        << "no sound at all, but some text that is long enough";
    ClipLibrary clips = library(1 << 20);
    EXPECT_TRUE(isSilent(*clips.get(voice({"clip.wav"}))));
    EXPECT_NE(clips.diagnostics().all()[0].text.find("cannot read sound"), std::string::npos);
}

TEST_F(Clips, WhatCannotBeReadIsSilentAndIsNamed) {
    ClipLibrary clips = library(1 << 20);
    EXPECT_TRUE(isSilent(*clips.get(voice({"nowhere.wav"}))));
    EXPECT_TRUE(isSilent(*clips.get(voice({}))));
    ASSERT_EQ(clips.diagnostics().warnings(), 2U);
    EXPECT_NE(clips.diagnostics().all()[0].text.find("nowhere.wav"), std::string::npos);
}

TEST_F(Clips, TogetherHaveNoMoreSamplesThanThePolicyLets) {
    write("a.wav", 30'000, kFileRate, 2);
    write("b.wav", 50'000, kFileRate);
    write("c.wav", 40'000, kFileRate);
    ClipLibrary clips = library(100'000);
    EXPECT_EQ(clips.get(voice({"a.wav"}))->samples.size(), 60'000U);
    EXPECT_TRUE(isSilent(*clips.get(voice({"b.wav"}))));
    ASSERT_EQ(clips.diagnostics().warnings(), 1U);
    EXPECT_NE(clips.diagnostics().all()[0].text.find("--limit samples=N"), std::string::npos);
    EXPECT_EQ(clips.get(voice({"c.wav"}))->samples.size(), 40'000U) << "it fits exactly";
}

/// However few samples a second a file says that it has, it is kept as it is.
TEST_F(Clips, CountAsTheyAreStored) {
    write("slow.wav", 1000, 1);
    ClipLibrary clips = library(1000);
    const auto sound = clips.get(voice({"slow.wav"}));
    EXPECT_EQ(clips.diagnostics().warnings(), 0U);
    EXPECT_EQ(sound->frames(), 1000U);
    EXPECT_EQ(sound->sampleRate, 1);
}

SoundVoice bufferVoice(const std::vector<float>& samples) {
    SoundVoice voice;
    voice.kind = SoundVoice::Kind::buffer;
    voice.node = NodeId{7};
    voice.buffer = Array<float>(samples);
    return voice;
}
SoundVoice rampVoice() {
    std::vector<float> ramp(20 * kFileRate);
    for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<float>(i) * 0x1p-20f;
    return bufferVoice(ramp);
}
/// Which sample of the ramp is heard at each; -1: none.
std::vector<double> heard(const SoundVoice& voice, VoicePlayer& player, ClipLibrary& clips, double from,
                          std::size_t frames) {
    std::vector<std::vector<float>> out(1, std::vector<float>(frames));
    player.play(voice, clips, std::llround(from * kFileRate), out);
    std::vector<double> result;
    for (const float sample : out[0]) result.push_back(sample == 0 ? -1 : static_cast<double>(sample) * 0x1p20);
    return result;
}

TEST_F(Clips, ThatWerePausedAreWhereTheyWentOn) {
    ClipLibrary clips = library(1 << 24);
    SoundVoice voice = rampVoice();
    voice.pauseTime = 2;
    voice.resumeTime = 3.5;
    voice.pausedTotal = 1.5;
    VoicePlayer joins;
    EXPECT_EQ(heard(voice, joins, clips, 5, 4)[1], 3.5 * kFileRate + 1);
    VoicePlayer waits;
    voice.paused = true;
    voice.pausedTotal = 0;
    EXPECT_EQ(heard(voice, waits, clips, 3, 4)[1], -1);
    voice.paused = false;
    voice.pausedTotal = 1.5;
    EXPECT_EQ(heard(voice, waits, clips, 3.5, 4)[1], 2 * kFileRate + 1);
}

/// Whatever its fields say by now: past its last sample there is nothing to read.
TEST_F(Clips, TurnedRoundAtTheirEndComeBackFromThere) {
    ClipLibrary clips = library(1 << 24);
    std::vector<float> ramp(100);
    for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<float>(i) * 0x1p-20f;
    SoundVoice voice = bufferVoice(ramp);
    VoicePlayer player;
    EXPECT_EQ(heard(voice, player, clips, 0, 100).back(), 99);
    voice.pitch = -1;
    EXPECT_EQ(heard(voice, player, clips, 100.0 / kFileRate, 4), (std::vector<double>{-1, 99, 98, 97}));
    // A loop of no length ends.
    voice.pitch = .5;
    voice.loop = true;
    voice.loopStart = 10.0 / kFileRate;
    voice.loopEnd = 10.000001 / kFileRate;
    VoicePlayer other;
    for (const double at : heard(voice, other, clips, 0, 40)) EXPECT_LT(at, 11);
}

/// 8.2.4.4: a node pauses when its pauseTime comes if that is later than its resumeTime.
TEST(Voices, PauseAsTheirClocksDo) {
    SoundVoice voice;
    voice.startTime = 1;
    EXPECT_TRUE(voice.active(5)) << "all times 0 but the start";
    voice.pauseTime = 1;
    EXPECT_FALSE(voice.active(1)) << "from the start on";
    voice.pauseTime = 3;
    EXPECT_TRUE(voice.active(2.9));
    EXPECT_FALSE(voice.active(3));
    voice.resumeTime = 4;
    EXPECT_TRUE(voice.active(3.5)) << "that it resumes later was known before its pause";
    voice.paused = true;
    EXPECT_FALSE(voice.active(3.5));
    EXPECT_TRUE(voice.active(4));
    voice.paused = false;
    voice.pausedTotal = 1;
    EXPECT_FALSE(voice.active(3.5));
    EXPECT_TRUE(voice.active(4));
    voice.stopTime = 6;
    EXPECT_FALSE(voice.active(6));
}

/// Between samples too the end of a loop leads to its beginning, whatever else the clip holds there.
TEST_F(Clips, RepeatWithoutASeam) {
    ClipLibrary clips = library(1 << 24);
    std::vector<float> samples(4000, .9f);
    for (std::size_t i = 0; i < 1000; ++i)
        samples[1000 + i] = static_cast<float>(std::sin(2 * std::numbers::pi * static_cast<double>(i) / 100));
    SoundVoice voice = bufferVoice(samples);
    voice.loop = true;
    voice.loopStart = 1000.0 / kFileRate;
    voice.loopEnd = 2000.0 / kFileRate;
    voice.pitch = .75;
    VoicePlayer player;
    std::vector<std::vector<float>> out(1, std::vector<float>(8000));
    player.play(voice, clips, 0, out);
    // When it has come round once nothing of what is beside the loop is heard any more.
    for (std::size_t i = 2700; i < 8000; ++i)
        ASSERT_NEAR(out[0][i], std::sin(2 * std::numbers::pi * .75 * static_cast<double>(i) / 100), 1e-4) << i;
}

/// A voice whose channels are cosines of so many hertz.
SoundVoice cosines(int rate, std::size_t frames, const std::vector<double>& hertz) {
    std::vector<float> samples;
    for (const double hz : hertz)
        for (std::size_t i = 0; i < frames; ++i)
            samples.push_back(static_cast<float>(std::cos(2 * std::numbers::pi * hz * static_cast<double>(i) / rate)));
    SoundVoice voice = bufferVoice(samples);
    voice.bufferRate = rate;
    voice.bufferChannels = static_cast<int>(hertz.size());
    voice.loop = true;
    return voice;
}
/// The largest difference from the cosines, from sample 2000 on: the clips begin all at once.
double offCosines(const SoundVoice& voice, ClipLibrary& clips, const std::vector<double>& hertz, std::size_t frames) {
    VoicePlayer player, inBlocks;
    std::vector<std::vector<float>> out(hertz.size(), std::vector<float>(frames)), block = out;
    player.play(voice, clips, 0, out);
    double off = 0;
    for (std::size_t first = 0; first < frames; first += 480) {
        for (auto& channel : block) channel.assign(480, 0);
        inBlocks.play(voice, clips, static_cast<std::int64_t>(first), block);
        for (std::size_t c = 0; c < hertz.size(); ++c)
            for (std::size_t i = 0; i < 480; ++i) {
                EXPECT_EQ(block[c][i], out[c][first + i]) << "live";
                const double angle = hertz[c] * voice.pitch * static_cast<double>(first + i) / kFileRate;
                if (first + i >= 2000)
                    off = std::max(off, std::abs(static_cast<double>(block[c][i]) -
                                                 std::cos(2 * std::numbers::pi * (angle - std::floor(angle)))));
            }
    }
    return off;
}

TEST_F(Clips, LoopAsTheTonesThatTheyAreAtAnyRateAndPitch) {
    ClipLibrary clips = library(1 << 24);
    for (const int rate : {8000, 22'050, 24'000, 44'100, 48'000, 96'000, 192'000})
        for (const double pitch : {1.0, .7, 1.3}) {
            // Whole periods in a fifth of a second: a low tone, and the highest that both rates have.
            const double highest = 5 * std::floor(.45 * std::min<double>(rate, kFileRate / pitch) / 5);
            const std::vector<double> hertz{100, highest};
            SoundVoice voice = cosines(rate, static_cast<std::size_t>(rate / 5), hertz);
            voice.pitch = pitch;
            EXPECT_LT(offCosines(voice, clips, hertz, 96'000), 2e-5) << rate << " Hz, pitch " << pitch;
        }
}

TEST_F(Clips, OfFilesLoopToo) {
    const std::size_t frames = 8820;
    SoundBuffer sound{44'100, 1, std::vector<float>(frames)};
    for (std::size_t i = 0; i < frames; ++i)
        sound.samples[i] = static_cast<float>(std::cos(2 * std::numbers::pi * 100 * static_cast<double>(i) / 44'100));
    ASSERT_TRUE(writeWav((folder_.path() / "loop.wav").string(), sound, WavFormat::float32));
    ClipLibrary clips = library(1 << 20);
    SoundVoice loops = voice({"loop.wav"});
    loops.loop = true;
    EXPECT_LT(offCosines(loops, clips, {100}, 96'000), 2e-5);
}

/// 50 samples at 44.1 kHz are 882 Hz: after ten seconds an error of 1e-9 would be seen.
TEST_F(Clips, LoopWithTheirExactPeriod) {
    ClipLibrary clips = library(1 << 24);
    EXPECT_LT(offCosines(cosines(44'100, 50, {882, 1764}), clips, {882, 1764}, 480'000), 2e-5);
}

/// Loops within a clip, of which neither end is at a sample.
TEST_F(Clips, LoopBetweenSamplesForwardsAndBackwards) {
    ClipLibrary clips = library(1 << 24);
    for (const double hz : {440.0, 9870.0})
        for (const double pitch : {1.0, -1.0, 1.6}) {
            SoundVoice voice = cosines(44'100, 44'100, {hz});
            voice.loopStart = .1234567;
            voice.loopEnd = voice.loopStart + std::round(hz / 30) / hz;
            voice.pitch = pitch;
            VoicePlayer player;
            std::vector<std::vector<float>> out(1, std::vector<float>(48'000));
            player.play(voice, clips, 0, out);
            // Whatever its phase, it is one tone from end to end.
            std::complex<double> sum;
            const auto rotation = [&](std::size_t i) {
                return std::polar(1.0, 2 * std::numbers::pi * hz * pitch * static_cast<double>(i) / kFileRate);
            };
            for (std::size_t i = 24'000; i < 48'000; ++i)
                sum += static_cast<double>(out[0][i]) * std::conj(rotation(i)) / 12'000.0;
            EXPECT_NEAR(std::abs(sum), 1, 5e-6);
            for (std::size_t i = 12'000; i < 48'000; ++i)
                ASSERT_NEAR(out[0][i], (sum * rotation(i)).real(), 5e-5) << hz << " Hz, pitch " << pitch << ", " << i;
        }
}

TEST_F(Clips, OfMoreSamplesThanAreHeardLoseWhatIsAboveTheBand) {
    ClipLibrary clips = library(1 << 24);
    SoundVoice voice = cosines(192'000, 38'400, {100});
    std::vector<float> both(voice.buffer.begin(), voice.buffer.end());
    for (std::size_t i = 0; i < both.size(); ++i)
        both[i] += static_cast<float>(std::cos(2 * std::numbers::pi * 40'000 * static_cast<double>(i) / 192'000));
    voice.buffer = Array<float>(both);
    EXPECT_LT(offCosines(voice, clips, {100}, 48'000), 2e-5);
}

TEST_F(Clips, HaveTheRateThatTheirNodeSaysByNow) {
    ClipLibrary clips = library(1 << 24);
    std::vector<float> samples(48000);
    for (std::size_t i = 0; i < samples.size(); ++i)
        samples[i] = static_cast<float>(std::sin(2 * std::numbers::pi * 1000 * static_cast<double>(i) / kFileRate));
    SoundVoice voice = bufferVoice(samples);
    voice.loop = true;
    const auto crossings = [](const std::vector<float>& x) {
        int count = 0;
        for (std::size_t i = 1; i < x.size(); ++i) count += x[i - 1] < 0 && x[i] >= 0 ? 1 : 0;
        return count;
    };
    VoicePlayer player;
    std::vector<std::vector<float>> out(1, std::vector<float>(9600));
    player.play(voice, clips, 0, out);
    EXPECT_NEAR(crossings(out[0]), 200, 1);
    voice.bufferRate = 24000;
    out.assign(1, std::vector<float>(9600));
    player.play(voice, clips, 9600, out);
    EXPECT_NEAR(crossings(out[0]), 100, 1);
}

/// Amplitude of what is heard of a sine of `hz` that is played `pitch` times as fast, away from its ends.
double heardOfSine(ClipLibrary& clips, double hz, double pitch) {
    std::vector<float> samples(2 * kFileRate);
    for (std::size_t i = 0; i < samples.size(); ++i)
        samples[i] = static_cast<float>(std::sin(2 * std::numbers::pi * hz * static_cast<double>(i) / kFileRate));
    SoundVoice voice = bufferVoice(samples);
    voice.pitch = pitch;
    VoicePlayer player;
    std::vector<std::vector<float>> out(1, std::vector<float>(9600));
    player.play(voice, clips, 0, out);
    double energy = 0;
    for (std::size_t i = 2400; i < 4800; ++i) energy += static_cast<double>(out[0][i]) * static_cast<double>(out[0][i]);
    return std::sqrt(2 * energy / 2400);
}

TEST_F(Clips, ThatPlayFasterLoseWhatWouldBeAboveHalfTheRate) {
    ClipLibrary clips = library(1 << 24);
    const auto level = [&](double hz, double pitch) { return 20 * std::log10(heardOfSine(clips, hz, pitch)); };
    EXPECT_LT(level(10'000, 4), -60);
    EXPECT_LT(level(15'000, 2.5), -60);
    EXPECT_LT(level(2'400, 16), -60);
    EXPECT_NEAR(level(1'000, 2), 0, .1);
    EXPECT_NEAR(level(1'000, 7.5), 0, .1);
    EXPECT_NEAR(level(10'000, 1), 0, .001);
    EXPECT_NEAR(level(10'000, .7), 0, .01);
}

TEST_F(Clips, OscillatorsBeyondHalfTheRateAreSilent) {
    ClipLibrary clips = library(1 << 24);
    SoundVoice voice;
    voice.kind = SoundVoice::Kind::oscillator;
    const auto peak = [&](double hz) {
        voice.frequency = hz;
        VoicePlayer player;
        std::vector<std::vector<float>> out(1, std::vector<float>(4800));
        player.play(voice, clips, 0, out);
        return *std::max_element(out[0].begin(), out[0].end());
    };
    EXPECT_NEAR(peak(23'000), 1, .01);
    for (const double hz : {24'001.0, 30'000.0, -30'000.0, 47'000.0}) EXPECT_EQ(peak(hz), 0) << hz;
}

/// Two ways to one clip are two sounds of it, each at its own pace.
TEST_F(Clips, MayBeHeardByTwoWaysAtOnce) {
    ClipLibrary clips = library(1 << 24);
    SoundVoice once = rampVoice(), half = once;
    half.gain = .5;
    AudioMix mix;
    AudioChannels out;
    const SoundEmitter emitter{{}, std::make_shared<SoundNode>(), WorldFromLocal(1.0), {}};
    const ListenerPose listener;
    const auto head = Hrtf::sphere(48000, .0875, 343);
    for (std::int64_t first = 0; first < 1024; first += 256) {
        out.clear();
        mix.render({once, half}, {}, {clips, first, 256, emitter, listener, *head}, out);
        for (std::size_t i = 0; i < 256; ++i)
            ASSERT_EQ(out[0][i], 1.5f * static_cast<float>(first + static_cast<std::int64_t>(i)) * 0x1p-20f);
    }
    // One that is gone for a while comes back where the clock is by then.
    out.clear();
    mix.render({once}, {}, {clips, 1024, 256, emitter, listener, *head}, out);
    out.clear();
    mix.render({once, half}, {}, {clips, 48000, 256, emitter, listener, *head}, out);
    EXPECT_EQ(out[0][5], (1285 + .5f * 48005) * 0x1p-20f);
}

}  // namespace
}  // namespace rtsg
