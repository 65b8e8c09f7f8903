// Sound that comes while it is heard: streams cut anywhere, pipes with nobody at the other end, devices that run on.
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/audio/sound_input.h>

#include "support/temp_folder.h"

namespace rtsg {
namespace {

/// Before OpenAL is first asked for anything: no device is there, whatever this machine has.
const int kNothingToHear = ::setenv("ALSOFT_DRIVERS", "null", 1);

std::string number(std::uint64_t value, int bytes) {
    std::string text;
    for (int i = 0; i < bytes; ++i) text += static_cast<char>(i < 8 ? value >> 8 * i : 0);
    return text;
}
std::string chunk(const std::string& tag, const std::string& content, std::uint32_t size) {
    return tag + number(size, 4) + content + (content.size() % 2 ? std::string(1, '\0') : "");
}
std::string wave(int kind, int bits, int channels, const std::string& data, std::uint32_t size,
                 const std::string& more = {}) {
    const std::string format = number(static_cast<std::uint64_t>(kind), 2) +
                               number(static_cast<std::uint64_t>(channels), 2) + number(44100, 4) + number(0, 6) +
                               number(static_cast<std::uint64_t>(bits), 2) + more;
    return "RIFF" + number(0xFFFFFFFF, 4) + "WAVE" + chunk("LIST", "odd", 3) +
           chunk("fmt ", format, static_cast<std::uint32_t>(format.size())) + chunk("data", data, size);
}
template <class T>
std::string bytesOf(std::initializer_list<T> values) {
    std::string text;
    for (const T value : values) {
        char bytes[sizeof value];
        std::memcpy(bytes, &value, sizeof value);
        text.append(bytes, sizeof value);
    }
    return text;
}
std::span<const std::byte> asBytes(std::string_view text) {
    return std::as_bytes(std::span(text));
}

Result<std::vector<float>> decodeIn(const std::string& text, std::size_t piece, SoundStreamDecoder& decoder) {
    std::vector<float> samples;
    for (std::size_t i = 0; i < text.size(); i += piece)
        if (auto ok = decoder.decode(asBytes(std::string_view(text).substr(i, piece)), samples); !ok)
            return std::unexpected(ok.error());
    return samples;
}

TEST(SoundStream, EveryCodingIsReadHoweverItIsCut) {
    // An eighth, minus three quarters, and the ends of the scale.
    const std::string endings[] = {
        wave(1, 8, 2, bytesOf<std::uint8_t>({144, 32, 128, 0}), 4),
        wave(1, 16, 2, bytesOf<std::int16_t>({4096, -24576, 0, -32768}), 8),
        wave(1, 24, 2,
             number(1 << 20, 3) + number(0xFFFFFF + 1 - 6 * (1 << 20), 3) + number(0, 3) + number(0x800000, 3), 12),
        wave(1, 32, 2, bytesOf<std::int32_t>({1 << 28, -6 * (1 << 28), 0, INT32_MIN}), 16),
        wave(3, 32, 2, bytesOf<float>({.125f, -.75f, 0, -1}), 0),
        wave(3, 64, 2, bytesOf<double>({.125, -.75, 0, -1}), 0xFFFFFFFF),
        wave(0xFFFE, 16, 2, bytesOf<std::int16_t>({4096, -24576, 0, -32768}), 0x7FFFF000,
             number(22, 2) + number(16, 2) + number(3, 4) + number(1, 2) + number(0, 14))};
    for (const std::string& text : endings)
        for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, text.size()}) {
            SoundStreamDecoder decoder;
            const auto samples = decodeIn(text, piece, decoder);
            ASSERT_TRUE(samples) << samples.error().text;
            EXPECT_EQ(*samples, (std::vector<float>{.125f, -.75f, 0, -1}));
            EXPECT_EQ(decoder.channels(), 2);
            EXPECT_EQ(decoder.sampleRate(), 44100);
        }
    // Bytes after the samples are not played; a stream without an end has no such bytes.
    SoundStreamDecoder ends, goesOn, raw(RawSound{RawSound::Sample::float32, 8000, 1});
    EXPECT_EQ(decodeIn(endings[1] + "LISTxxxxxxxxxxxx", 5, ends)->size(), 4u);
    EXPECT_TRUE(ends.ended());
    EXPECT_EQ(decodeIn(endings[4] + bytesOf<float>({.5f, .25f}), 3, goesOn)->size(), 6u);
    EXPECT_FALSE(goesOn.ended());
    EXPECT_EQ(*decodeIn(bytesOf<float>({.5f, NAN, .25f}), 3, raw), (std::vector<float>{.5f, 0, .25f}));
    EXPECT_EQ(raw.sampleRate(), 8000);
}

TEST(SoundStream, WhatIsNoSoundIsSaid) {
    for (const std::string& text :
         {std::string("OggS and what else may follow it"), wave(2, 4, 1, "xx", 2), wave(1, 12, 1, "xx", 2),
          wave(1, 16, 0, "xx", 2), "RIFF" + number(0, 4) + "WAVE" + chunk("data", "xx", 2),
          "RIFF" + number(0, 4) + "WAVE" + chunk("junk", "xx", 0x40000000)}) {
        SoundStreamDecoder decoder;
        EXPECT_FALSE(decodeIn(text, 4, decoder)) << text.substr(0, 4);
    }
}

/// The samples until its end, block by block, without the silence of waiting.
std::vector<float> heardOf(SoundInput& input, std::int64_t& first, double seconds = 60) {
    std::vector<float> heard;
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    int silent = 0;
    while (silent < 3 && std::chrono::steady_clock::now() < end) {
        const bool over = input.ended();
        const auto block = input.block(first += 256, 256, 0);
        const std::size_t before = heard.size();
        for (const float sample : block)
            if (sample != 0) heard.push_back(sample);
        silent = over && heard.size() == before ? silent + 1 : 0;
        if (heard.size() == before) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return heard;
}

TEST(SoundInput, APipeLosesNothingAndNobodyWaitsForIt) {
    const test::TempFolder folder;
    const std::string path = folder / "pipe";
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
    auto opened = SoundInput::openPipe(path, 48000, RawSound{RawSound::Sample::float32, 48000, 2});
    ASSERT_TRUE(opened) << opened.error().text;
    SoundInput& input = **opened;
    // Nobody writes to it yet.
    const auto silence = input.block(0, 256, 0);
    EXPECT_EQ(std::count(silence.begin(), silence.end(), 0.0f), 256);
    // More than it holds at a time: the writer waits.
    constexpr int kSamples = 300'000;
    std::thread writer([&] {
        std::ofstream to(path, std::ios::binary);
        for (int i = 1; i <= kSamples; ++i) to << bytesOf<float>({static_cast<float>(i)});
    });
    std::int64_t first = 0;
    const std::vector<float> heard = heardOf(input, first);
    writer.join();
    ASSERT_EQ(heard.size(), static_cast<std::size_t>(kSamples));
    for (int i = 0; i < kSamples; ++i) ASSERT_EQ(heard[static_cast<std::size_t>(i)], static_cast<float>(i + 1));
    EXPECT_EQ(input.channels(), 2u);
    EXPECT_EQ(input.dropped(), 0u);
    EXPECT_EQ(input.problem(), "");
    EXPECT_FALSE(SoundInput::openPipe(folder / "nothing", 48000));
}

TEST(SoundInput, WhatIsNoSoundEndsAndSaysWhy) {
    const test::TempFolder folder;
    std::ofstream(folder / "text") << "this is not a sound, however long it is";
    const auto opened = SoundInput::openPipe(folder / "text", 48000);
    ASSERT_TRUE(opened);
    for (int i = 0; i < 6000 && !(*opened)->ended(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_NE((*opened)->problem().find("no WAV"), std::string::npos);
    EXPECT_FALSE(readPipe(folder / "text", {}, 1));
    std::ofstream(folder / "empty").flush();
    const auto empty = readPipe(folder / "empty", {}, 1);
    ASSERT_FALSE(empty);
    EXPECT_NE(empty.error().text.find("before any sound came"), std::string::npos);
}

TEST(SoundInput, APipeThatHasMoreThanItMayIsRefusedAndNotReadOn) {
    const test::TempFolder folder;
    {
        std::ofstream file(folder / "raw", std::ios::binary);
        for (int i = 0; i < 4000; ++i) file << bytesOf<float>({.5f});
    }
    const RawSound raw{RawSound::Sample::float32, 48000, 1};
    const auto whole = readPipe(folder / "raw", raw, 10, {}, 4000);
    ASSERT_TRUE(whole) << whole.error().text;
    EXPECT_EQ(whole->samples.size(), 4000u);
    const auto refused = readPipe(folder / "raw", raw, 10, {}, 3999);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text.find("more than 3999 samples; --limit samples=N raises this"), std::string::npos)
        << refused.error().text;
}

/// An input whose thread has written all of this.
std::unique_ptr<SoundInput> inputOf(SoundInput::Waits waits, int rate, std::vector<float> samples) {
    auto input = std::make_unique<SoundInput>(48000, waits, [rate, all = std::move(samples)](SoundFeed& feed) {
        if (feed.begin(1, rate)) feed.write(all);
    });
    for (int i = 0; i < 6000 && !input->ended() && waits == SoundInput::Waits::no; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return input;
}

TEST(SoundInput, AllWhoHearABlockHearTheSameFromWhereItBegins) {
    std::vector<float> ramp(10'000);
    for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<float>(i + 1);
    const auto input = inputOf(SoundInput::Waits::yes, 48000, ramp);
    for (int i = 0; i < 6000 && !input->ended(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const auto once = input->block(1000, 256, 100);
    const std::vector<float> begun(once.begin(), once.end());
    EXPECT_EQ(begun[99], 0);
    EXPECT_EQ(begun[100], 1) << "what waits waits until it is heard";
    EXPECT_EQ(begun[255], 156);
    const auto again = input->block(1000, 256, 0);
    EXPECT_TRUE(std::ranges::equal(again, begun));
    EXPECT_EQ(input->block(1256, 256, 0)[0], 157);
}

TEST(SoundInput, OfADeviceWhatIsOldIsDropped) {
    std::vector<float> ramp(30'000);
    for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<float>(i + 1);
    const auto input = inputOf(SoundInput::Waits::no, 48000, ramp);
    const float begun = input->block(0, 256, 0)[0];
    EXPECT_GT(begun, 30'000 - .1 * 48000);
    EXPECT_EQ(static_cast<double>(input->dropped()), begun - 1);
    // More than it holds: nothing in it is of now.
    const auto full = inputOf(SoundInput::Waits::no, 48000, std::vector<float>(100'000, 1));
    EXPECT_EQ(full->block(0, 256, 0)[0], 0);
    EXPECT_EQ(full->dropped(), 100'000u);
}

TEST(SoundInput, ComesAtTheRateItIsHeardAt) {
    std::vector<float> tone;
    for (int i = 0; i < 12'000; ++i) tone.push_back(static_cast<float>(std::sin(2 * M_PI * 500 * i / 24000)));
    const auto input = inputOf(SoundInput::Waits::yes, 24000, tone);
    std::int64_t first = 0;
    const std::vector<float> heard = heardOf(*input, first);
    // Zeros were left out: some of the tone's own too.
    EXPECT_NEAR(static_cast<double>(heard.size()), 24'000, 600);
    int rounds = 0;
    for (std::size_t i = 1; i < heard.size(); ++i) rounds += heard[i - 1] < 0 && heard[i] > 0;
    EXPECT_NEAR(rounds, 250, 2);
    EXPECT_NEAR(*std::max_element(heard.begin() + 1000, heard.end() - 1000), 1, .01);
    const auto never = inputOf(SoundInput::Waits::yes, 1, {1});
    EXPECT_EQ(never->block(0, 16, 0)[0], 0);
}

TEST(SoundInput, WithoutADeviceThatCapturesThisIsSaid) {
    ASSERT_EQ(kNothingToHear, 0);
    for (const std::string name : {"", "no such device"}) {
        const auto none = SoundInput::openDevice(name, 48000);
        ASSERT_FALSE(none);
        EXPECT_NE(none.error().text.find("captured"), std::string::npos) << none.error().text;
        EXPECT_NE(none.error().text.find(name), std::string::npos);
    }
}

}  // namespace
}  // namespace rtsg
