// Clips that are read once, within the limit on samples, and what stands in for those that cannot be.
#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/audio/clip_library.h>

#include "support/plain_film.h"
#include "support/temp_folder.h"

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
    /// The second that a test signal takes.
    static bool standsIn(const SoundBuffer& sound) { return sound.frames() == kFileRate && sound.samples[100] != .25f; }

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
    EXPECT_TRUE(standsIn(*few.get(voice({"film.avi"}))));
}

TEST_F(Clips, WhatCannotBeReadIsATestSignalAndIsNamed) {
    ClipLibrary clips = library(1 << 20);
    EXPECT_TRUE(standsIn(*clips.get(voice({"nowhere.wav"}))));
    EXPECT_TRUE(standsIn(*clips.get(voice({}))));
    ASSERT_EQ(clips.diagnostics().warnings(), 2U);
    EXPECT_NE(clips.diagnostics().all()[0].text.find("nowhere.wav"), std::string::npos);
}

TEST_F(Clips, TogetherHaveNoMoreSamplesThanThePolicyLets) {
    write("a.wav", 30'000, kFileRate, 2);
    write("b.wav", 50'000, kFileRate);
    write("c.wav", 40'000, kFileRate);
    ClipLibrary clips = library(100'000);
    EXPECT_EQ(clips.get(voice({"a.wav"}))->samples.size(), 60'000U);
    EXPECT_TRUE(standsIn(*clips.get(voice({"b.wav"}))));
    ASSERT_EQ(clips.diagnostics().warnings(), 1U);
    EXPECT_NE(clips.diagnostics().all()[0].text.find("--limit samples=N"), std::string::npos);
    EXPECT_EQ(clips.get(voice({"c.wav"}))->samples.size(), 40'000U) << "it fits exactly";
}

/// A file that says that it has few samples a second becomes many when it is played at the usual rate.
TEST_F(Clips, CountAsTheyArePlayed) {
    write("slow.wav", 1000, 200);
    write("slower.wav", 1000, 1);
    ClipLibrary clips = library(100'000);
    for (const char* name : {"slow.wav", "slower.wav"}) EXPECT_TRUE(standsIn(*clips.get(voice({name})))) << name;
    EXPECT_EQ(clips.diagnostics().warnings(), 2U);
    EXPECT_FALSE(resample(SoundBuffer{1, 1, std::vector<float>(10)}, kFileRate)) << "too far apart";
    ClipLibrary more = library(300'000);
    EXPECT_NEAR(static_cast<double>(more.get(voice({"slow.wav"}))->frames()), 240'000, 2);

    SoundVoice buffer;
    buffer.kind = SoundVoice::Kind::buffer;
    buffer.buffer = Array<float>::ofSize(10'000);
    buffer.bufferRate = 1000;
    EXPECT_TRUE(standsIn(*clips.get(buffer)));
    EXPECT_EQ(clips.diagnostics().warnings(), 3U);
    ClipLibrary enough = library(500'000);
    EXPECT_NEAR(static_cast<double>(enough.get(buffer)->frames()), 480'000, 2);
}

}  // namespace
}  // namespace rtsg
