// Sound files that are damaged or were cut short: what can be read of them is given, and what is missing is told.
#include <cmath>
#include <fstream>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/sound_file.h>

#include "support/encoded_sound.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;
using testing::MatchesRegex;

constexpr int kFormatRate = 48000;
constexpr std::size_t kFormatFrames = 3 * kFormatRate;

struct Format {
    const char* name;
    int code;
};
const Format kFormats[] = {{"wav", SF_FORMAT_WAV | SF_FORMAT_PCM_16},
                           {"wav of floats", SF_FORMAT_WAV | SF_FORMAT_FLOAT},
                           {"wav of ADPCM", SF_FORMAT_WAV | SF_FORMAT_IMA_ADPCM},
                           {"big-endian wav", SF_FORMAT_WAV | SF_FORMAT_PCM_16 | SF_ENDIAN_BIG},
                           {"rf64", SF_FORMAT_RF64 | SF_FORMAT_PCM_16},
                           {"w64", SF_FORMAT_W64 | SF_FORMAT_PCM_16},
                           {"aiff", SF_FORMAT_AIFF | SF_FORMAT_PCM_16},
                           {"au", SF_FORMAT_AU | SF_FORMAT_PCM_16},
                           {"flac", SF_FORMAT_FLAC | SF_FORMAT_PCM_16},
                           {"vorbis", SF_FORMAT_OGG | SF_FORMAT_VORBIS},
                           {"opus", SF_FORMAT_OGG | SF_FORMAT_OPUS},
                           {"mp3", SF_FORMAT_MPEG | SF_FORMAT_MPEG_LAYER_III}};

/// Two tones and some noise, so that packed formats have something to pack.
std::vector<float> threeSeconds() {
    std::mt19937 random(5);
    std::vector<float> samples(2 * kFormatFrames);
    for (std::size_t i = 0; i < kFormatFrames; ++i) {
        const double t = static_cast<double>(i), noise = static_cast<double>(random() >> 8) * 0x1p-24 - .5;
        samples[2 * i] = static_cast<float>(.5 * std::sin(.04 * t) + .1 * noise);
        samples[2 * i + 1] = static_cast<float>(.3 * std::sin(.06 * t));
    }
    return samples;
}
std::string encoded(const Format& format) {
    return test::encodedSound(format.code, kFormatRate, 2, threeSeconds());
}

TEST(DamagedSound, OfWholeFilesNothingIsMissing) {
    for (const Format& format : kFormats) {
        const std::string bytes = encoded(format);
        if (bytes.empty()) continue;
        std::string damage;
        const auto sound = readSoundBytes(bytes, 1 << 24, &damage);
        ASSERT_TRUE(sound) << format.name;
        EXPECT_NEAR(static_cast<double>(sound->frames()), kFormatFrames, 1000) << format.name;
        EXPECT_EQ(damage, "") << format.name;
    }
}

TEST(DamagedSound, AnOggFileWithoutItsLastByteHasNoEnd) {
    int files = 0;
    for (const Format& format : kFormats) {
        if ((format.code & SF_FORMAT_TYPEMASK) != SF_FORMAT_OGG) continue;
        std::string bytes = encoded(format);
        if (bytes.empty()) continue;
        ++files;
        std::string damage;
        ASSERT_TRUE(readSoundBytes(bytes + "a tag behind the end", 1 << 24, &damage)) << format.name;
        EXPECT_EQ(damage, "") << format.name;
        bytes.pop_back();
        ASSERT_TRUE(readSoundBytes(bytes, 1 << 24, &damage)) << format.name;
        EXPECT_THAT(damage, testing::HasSubstr("before the page that ends an Ogg stream")) << format.name;
    }
    if (files == 0) GTEST_SKIP() << "this libsndfile writes no Ogg";
}

TEST(DamagedSound, ThatWasCutSaysHowMuchOfItThereIs) {
    for (const Format& format : kFormats) {
        const std::string bytes = encoded(format);
        if (bytes.empty()) continue;
        for (const double fraction : {.4, .8}) {
            std::string damage;
            const auto cut = static_cast<std::size_t>(fraction * static_cast<double>(bytes.size()));
            const auto sound = readSoundBytes(std::string_view(bytes).substr(0, cut), 1 << 24, &damage);
            ASSERT_TRUE(sound) << format.name;
            // Packed seconds differ in size.
            EXPECT_NEAR(sound->seconds(), 3 * fraction, .4) << format.name;
            const bool isOgg = (format.code & SF_FORMAT_TYPEMASK) == SF_FORMAT_OGG;
            const std::string is = fmt::format("{:.3g} s", sound->seconds());
            if (isOgg)
                EXPECT_EQ(damage, "it ends after " + is + ", before the page that ends an Ogg stream") << format.name;
            else  // ADPCM comes in blocks
                EXPECT_THAT(damage, MatchesRegex(is + " of the 3(.0[0-9])? s that its header gives can be read"))
                    << format.name;
        }
    }
}

/// 40 bytes in the middle are others, 4,000 are 0, or 3,001 are not there.
std::string damaged(std::string bytes, int how) {
    const std::size_t middle = bytes.size() / 2;
    if (how == 0)
        for (std::size_t i = 0; i < 40; ++i) bytes[middle + i] = static_cast<char>(bytes[middle + i] ^ 0x5a);
    if (how == 1) std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(middle), 4000, '\0');
    if (how == 2) bytes.erase(middle, 3001);
    return bytes;
}

TEST(DamagedSound, IsToldWhereTheFormatIsBroken) {
    for (const Format& format : kFormats) {
        const std::string bytes = encoded(format);
        if (bytes.empty()) continue;
        const int container = format.code & SF_FORMAT_TYPEMASK;
        const bool checked = container == SF_FORMAT_FLAC || container == SF_FORMAT_OGG;
        // Samples of any value may be meant, in a frame of MP3, too.
        for (int how = checked ? 0 : container == SF_FORMAT_MPEG ? 1 : 2; how < 3; ++how) {
            std::string damage;
            testing::internal::CaptureStderr();
            const auto sound = readSoundBytes(damaged(bytes, how), 1 << 24, &damage);
            EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << format.name << how;
            ASSERT_TRUE(sound) << format.name << how;
            EXPECT_NE(damage, "") << format.name << how;
            EXPECT_GT(sound->seconds(), 1) << format.name << how;
        }
    }
}

/// It is decoded by another way than the others.
TEST(DamagedSound, MpegIsReadAsLibsndfileReadsIt) {
    const std::string bytes = encoded(kFormats[11]);
    if (bytes.empty()) GTEST_SKIP() << "this libsndfile writes no MP3";
    const test::TempFolder folder;
    const std::string path = folder.path() / "a.mp3";
    std::ofstream(path, std::ios::binary) << bytes;
    SF_INFO info{};
    SNDFILE* file = sf_open(path.c_str(), SFM_READ, &info);
    ASSERT_TRUE(file);
    std::vector<float> expected(2 * kFormatFrames + 2);
    expected.resize(2 * static_cast<std::size_t>(sf_readf_float(file, expected.data(), kFormatFrames + 1)));
    sf_close(file);
    const auto sound = readSound(path);
    ASSERT_TRUE(sound);
    EXPECT_EQ(sound->sampleRate, kFormatRate);
    EXPECT_EQ(sound->channels, 2);
    EXPECT_EQ(sound->samples, expected);
    EXPECT_FALSE(readSound(path, expected.size() - 1)) << "too many samples";
    EXPECT_TRUE(readSound(path, expected.size()));
    const auto seconds = soundSeconds(*Resources(folder.path()).open(folder.path(), "a.mp3"));
    ASSERT_TRUE(seconds);
    EXPECT_EQ(*seconds, 3);
    // Tags before it, as players want them; two files, one behind the other.
    const std::string tag("ID3\x03\0\0\0\0\x01\0", 10), tagged = tag + std::string(128, '\0') + bytes;
    std::string damage;
    EXPECT_EQ(readSoundBytes(tagged, 1 << 24, &damage)->samples, expected);
    EXPECT_EQ(damage, "");
}

TEST(DamagedSound, MpegThatStopsAtOnceIsAnErrorWithoutALibrarysText) {
    const std::string bytes = encoded(kFormats[11]);
    if (bytes.empty()) GTEST_SKIP() << "this libsndfile writes no MP3";
    testing::internal::CaptureStderr();
    const auto sound = readSoundBytes(std::string_view(bytes).substr(0, 60));
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    ASSERT_FALSE(sound);
    EXPECT_THAT(sound.error().text, HasSubstr("cannot read sound: "));
}

/// A writer into a pipe cannot go back to write the size; some programs include the header in it.
TEST(DamagedSound, SizesThatWereNotKnownPromiseNothing) {
    std::string bytes = encoded(kFormats[0]);
    const std::size_t size = bytes.find("data") + 4;
    for (const char* unknown : {"\xff\xff\xff\xff", "\xff\xff\xff\x7f", "\x2c\xca\x08\0"}) {
        bytes.replace(size, 4, unknown, 4);
        std::string damage;
        ASSERT_TRUE(readSoundBytes(bytes, 1 << 24, &damage));
        EXPECT_EQ(damage, "");
    }
}

TEST(DamagedSound, OfAnOggStreamThatWasCutTheLengthIsWhatThereIs) {
    const test::TempFolder folder;
    const std::string bytes = encoded(kFormats[9]);
    std::ofstream(folder.path() / "a.ogg", std::ios::binary) << bytes.substr(0, bytes.size() * 2 / 5);
    const auto file = Resources(folder.path()).open(folder.path(), "a.ogg");
    ASSERT_TRUE(file);
    const auto seconds = soundSeconds(*file);
    ASSERT_TRUE(seconds);
    EXPECT_EQ(*seconds, readSound(folder.path() / "a.ogg")->seconds());
}

TEST(DamagedSound, AsAClipIsPlayedAndNamedOnce) {
    const test::TempFolder folder;
    for (const Format& format : {kFormats[0], kFormats[9], kFormats[11]}) {
        const std::string bytes = encoded(format);
        if (bytes.empty()) continue;
        std::ofstream(folder.path() / "clip", std::ios::binary) << bytes.substr(0, bytes.size() * 2 / 5);
        ResourcePolicy policy;
        policy.roots = {folder.path()};
        ClipLibrary clips(kFormatRate, Resources(folder.path(), policy));
        SoundVoice voice;
        voice.name = "BELL";
        voice.urls = {"clip"};
        voice.folders = {folder.path()};
        EXPECT_NEAR(clips.get(voice)->seconds(), 1.2, .4) << format.name;
        clips.get(voice);
        ASSERT_EQ(clips.diagnostics().warnings(), 1U) << format.name;
        EXPECT_THAT(clips.diagnostics().all()[0].text, HasSubstr("BELL: "));
        EXPECT_THAT(clips.diagnostics().all()[0].text, HasSubstr("clip is damaged or cut short: "));
    }
}

}  // namespace
}  // namespace rtsg
