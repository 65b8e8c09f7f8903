// Sound as signals: ambisonics, convolution, files.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include <gtest/gtest.h>
#include <samplerate.h>
#include <unistd.h>

#include <rtsg/audio/sound_file.h>

#include "signal/ambisonics.h"
#include "signal/convolver.h"
#include "signal/panning.h"

namespace rtsg {
namespace {

constexpr std::uint64_t kSeed = 77;

std::vector<float> noise(std::size_t count, std::uint64_t seed = kSeed) {
    std::mt19937_64 random(seed);
    std::vector<float> result(count);
    for (float& sample : result) sample = static_cast<float>(random() >> 40) / 16777216.0f - 0.5f;
    return result;
}

std::string temporary(const char* name) {
    return (std::filesystem::temp_directory_path() / (std::to_string(::getpid()) + name)).string();
}

TEST(Ambisonics, FollowTheAdditionTheorem) {
    std::mt19937_64 random(kSeed);
    std::normal_distribution<double> normal;
    std::array<double, 64> a{}, b{};
    for (int trial = 0; trial < 50; ++trial) {
        const glm::dvec3 u = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
        const glm::dvec3 v = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
        ambisonicGains(7, u, a);
        ambisonicGains(7, v, b);
        const double x = glm::dot(u, v);
        double p0 = 1, p1 = x;  // Legendre polynomials
        for (int l = 0; l <= 7; ++l) {
            double sum = 0;
            for (int c = l * l; c < (l + 1) * (l + 1); ++c)
                sum += a[static_cast<std::size_t>(c)] * b[static_cast<std::size_t>(c)];
            EXPECT_NEAR(sum, l == 0 ? 1 : p1, 1e-12) << "degree " << l;
            if (l > 0) p0 = std::exchange(p1, ((2 * l + 1) * x * p1 - l * p0) / (l + 1));
        }
    }
    ambisonicGains(1, {0, 1, 0}, a);  // from the left
    EXPECT_NEAR(a[0], 1, 1e-15);
    EXPECT_NEAR(a[1], 1, 1e-15);
    EXPECT_NEAR(a[2], 0, 1e-15);
    EXPECT_NEAR(a[3], 0, 1e-15);
    EXPECT_EQ(ambisonicAxes({-1, 0, 0}), glm::dvec3(0, 1, 0));
    EXPECT_EQ(ambisonicDegree(0), 0);
    EXPECT_EQ(ambisonicDegree(3), 1);
    EXPECT_EQ(ambisonicDegree(4), 2);
}

TEST(Convolver, EqualsTheSumInTheTimeDomain) {
    // Around where long parts begin: after fifteen blocks, if there are more than sixteen.
    for (const auto& [length, rotation] : {std::pair{1ul, 0ul},
                                           {64ul, 0ul},
                                           {65ul, 3ul},
                                           {1000ul, 0ul},
                                           {1024ul, 1ul},
                                           {1025ul, 0ul},
                                           {1025ul, 15ul},
                                           {1984ul, 5ul},
                                           {1985ul, 16ul},
                                           {5000ul, 7ul}}) {
        const std::vector<float> response = noise(length, 3), input = noise(64 * 140, 4);
        Convolver convolver(64, 256, rotation);
        convolver.setResponse(response);
        std::vector<float> output(input.size());
        for (std::size_t i = 0; i < input.size(); i += 64)
            convolver.process(std::span(input).subspan(i, 64), std::span(output).subspan(i, 64));
        for (std::size_t i = 0; i < input.size(); i += 17) {
            double sum = 0;
            for (std::size_t k = 0; k < length && k <= i; ++k) sum += static_cast<double>(response[k]) * input[i - k];
            ASSERT_NEAR(output[i], sum, 2e-5) << length << " at " << i << ", turn " << rotation;
        }
    }
}

namespace {

/// The output of a convolver of blocks of 64 for an input, whose response is replaced before some blocks.
std::vector<float> changing(std::span<const float> input, std::size_t round,
                            const std::vector<std::pair<std::size_t, std::vector<float>>>& responses) {
    Convolver convolver(64, 64, round);
    std::vector<float> output(input.size());
    for (std::size_t k = 0; k < input.size() / 64; ++k) {
        for (const auto& [block, response] : responses)
            if (block == k) convolver.setResponse(response);
        convolver.process(input.subspan(64 * k, 64), std::span(output).subspan(64 * k, 64));
    }
    return output;
}

}  // namespace

TEST(Convolver, LongResponsesThatComeAtAnyBlockAreHeardWhole) {
    const std::vector<float> input = noise(64 * 90, 4), old = noise(3000, 5), fresh = noise(2500, 6);
    for (std::size_t round = 0; round < 17; ++round)
        for (std::size_t at = 50; at < 67; at += round % 2 ? 5 : 3) {
            const std::vector<float> output = changing(input, round, {{0, old}, {at, fresh}});
            for (std::size_t i = 64 * (at - 4); i < input.size(); i += 7) {
                if (i / 64 == at) continue;  // fades
                const std::vector<float>& response = i / 64 < at ? old : fresh;
                double sum = 0;
                for (std::size_t k = 0; k < response.size() && k <= i; ++k)
                    sum += static_cast<double>(response[k]) * input[i - k];
                ASSERT_NEAR(output[i], sum, 3e-5) << "at " << at << ", turn " << round << ", sample " << i;
            }
        }
}

TEST(Convolver, AFirstLongResponseHearsWhatAShortOneRemembered) {
    const std::vector<float> input = noise(64 * 60, 4), brief = noise(1024, 5), lengthy = noise(3000, 6);
    constexpr std::size_t kAt = 24, kRemembered = 16;  // blocks
    for (const std::size_t round : {0ul, 1ul, 8ul, 15ul}) {
        const std::vector<float> output = changing(input, round, {{0, brief}, {kAt, lengthy}});
        for (std::size_t i = 64 * (kAt + 1); i < input.size(); i += 7) {
            double sum = 0;
            for (std::size_t k = 0; k < lengthy.size() && i - k >= 64 * (kAt - kRemembered); ++k)
                sum += static_cast<double>(lengthy[k]) * input[i - k];
            ASSERT_NEAR(output[i], sum, 3e-5) << "turn " << round << ", sample " << i;
        }
    }
}

TEST(Convolver, WorkOfLongPartsIsInTurnWheneverResponsesCome) {
    const std::vector<float> response = noise(3000, 5), silence(64);
    std::vector<float> ignored(64);
    for (std::size_t round = 0; round < 18; ++round)
        for (const std::size_t at : {0ul, 1ul, 15ul, 16ul, 37ul}) {
            Convolver convolver(64, 64, round);
            EXPECT_EQ(convolver.blocksUntilLongWork(), 0);
            for (std::size_t k = 0; k < 50; ++k) {
                if (k == at) convolver.setResponse(response);
                if (k >= at) {
                    EXPECT_EQ((round + k + convolver.blocksUntilLongWork()) % 16, 0) << round << ", block " << k;
                }
                convolver.process(silence, ignored);
            }
        }
}

TEST(Convolver, OneBesideAnotherHearsTheSameUntilTheyPart) {
    const std::vector<float> left = noise(64 * 80, 4), right = noise(64 * 80, 7), first = noise(2000, 5),
                             second = noise(3000, 6), third = noise(100, 8);
    constexpr std::size_t kPart = 50, kChange = 37;  // blocks
    for (const std::size_t round : {0ul, 9ul}) {
        Convolver owner(64, 64, round), other = owner.beside(), alone(64, 64, round);
        owner.setResponse(third);
        other.setResponse(first), alone.setResponse(first);
        std::vector<float> ignored(64), output(left.size()), expected(left.size());
        for (std::size_t k = 0; k < left.size() / 64; ++k) {
            if (k == kPart) other.part();
            if (k == kChange) other.setResponse(second), alone.setResponse(second), owner.setResponse(first);
            const auto ofBlock = [k](auto& samples) { return std::span(samples).subspan(64 * k, 64); };
            const std::span<const float> input = k < kPart ? ofBlock(left) : ofBlock(right);
            owner.process(ofBlock(left), ignored);
            other.process(input, ofBlock(output));
            alone.process(input, ofBlock(expected));
        }
        for (std::size_t i = 0; i < output.size(); ++i)
            ASSERT_NEAR(output[i], expected[i], 1e-6) << i << ", turn " << round;
    }
}

TEST(Convolver, StartsAnewWithLongResponsesToo) {
    const std::vector<float> input = noise(64 * 40, 4), response = noise(3000, 5);
    Convolver convolver(64, 64, 3);
    std::vector<float> first(input.size()), second(input.size());
    for (std::vector<float>* output : {&first, &second}) {
        convolver.setResponse(response);
        for (std::size_t i = 0; i < input.size(); i += 64)
            convolver.process(std::span(input).subspan(i, 64), std::span(*output).subspan(i, 64));
        convolver.restart();
    }
    // Long parts go on in their turn: they are cut elsewhere the second time.
    for (std::size_t i = 0; i < first.size(); ++i) ASSERT_NEAR(first[i], second[i], 1e-5) << i;
}

TEST(Convolver, ANewResponseFadesInWithoutAClick) {
    Convolver convolver(64, 150);
    const std::vector<float> one{1.0f}, three{3.0f};
    convolver.setResponse(one);
    std::vector<float> input(64, 1.0f), output(64 * 6);
    for (std::size_t k = 0; k < 6; ++k) {
        if (k == 3) convolver.setResponse(three);
        convolver.process(input, std::span(output).subspan(64 * k, 64));
    }
    for (std::size_t i = 1; i < output.size(); ++i) EXPECT_LT(std::abs(output[i] - output[i - 1]), 0.05) << i;
    EXPECT_NEAR(output.front(), 1, 1e-5);
    EXPECT_NEAR(output[3 * 64 + 74], 2, .03);
    EXPECT_NEAR(output.back(), 3, 1e-5);
}

/// How far a tone is from what its last three samples lead to, at most; its amplitude is 1.
double largestStep(std::span<const float> tone) {
    double maximum = 0;
    for (std::size_t i = 3; i < tone.size(); ++i)
        maximum =
            std::max(maximum, std::abs(static_cast<double>(tone[i] - 3 * tone[i - 1] + 3 * tone[i - 2] - tone[i - 3])));
    return maximum;
}

/// Nothing was kept for it: heard at once it would be heard of one block more with each block.
TEST(Convolver, AFirstResponseThatComesWhileSomethingSoundsBeginsSoftly) {
    constexpr std::size_t kBlocks = 100, kFade = 640;
    std::vector<float> tone(64 * kBlocks), response(3000);
    for (std::size_t i = 0; i < tone.size(); ++i) tone[i] = std::sin(.05f * static_cast<float>(i) + 1);
    for (std::size_t i = 5; i < response.size(); i += 211) response[i] = .3f;
    for (const std::size_t before : {0ul, 1ul, 7ul, 40ul})
        for (const std::size_t fade : {0ul, 200ul}) {
            Convolver convolver(64, kFade, 3), other = convolver.beside();
            std::vector<float> output(tone.size()), second(tone.size());
            for (std::size_t k = 0; k < kBlocks; ++k) {
                if (k == before)
                    for (Convolver* one : {&convolver, &other}) one->setResponse(response), one->fadeOnceIn(fade);
                const auto block = std::span(tone).subspan(64 * k, 64);
                convolver.process(block, std::span(output).subspan(64 * k, 64));
                other.process(block, std::span(second).subspan(64 * k, 64));
            }
            EXPECT_EQ(output, second);
            // A sound from the first block on has its own beginning, and is heard completely from there.
            if (before > 0) {
                EXPECT_LT(largestStep(output), .003) << before << ", " << fade;
            }
            const std::size_t whole = before == 0 ? 0 : 64 * before + (fade > 0 ? fade : kFade);
            for (std::size_t i = whole + (before == 0 ? 0 : response.size()); i < output.size(); i += 7) {
                double sum = 0;
                for (std::size_t k = 0; k < response.size() && k <= i; ++k)
                    sum += static_cast<double>(response[k]) * static_cast<double>(tone[i - k]);
                ASSERT_NEAR(output[i], sum, 1e-4) << before << ", " << fade << ", at " << i;
            }
        }
}

TEST(Convolver, AFirstResponseAfterSilenceIsHeardAtOnce) {
    const std::vector<float> input = noise(64 * 8, 4), response = noise(100, 5);
    std::vector<float> silence(64), expected(input.size()), output(input.size());
    Convolver early(64, 640), late(64, 640);
    early.setResponse(response);
    for (int k = 0; k < 5; ++k) late.process(silence, silence);
    late.setResponse(response);
    for (std::size_t i = 0; i < input.size(); i += 64) {
        early.process(std::span(input).subspan(i, 64), std::span(expected).subspan(i, 64));
        late.process(std::span(input).subspan(i, 64), std::span(output).subspan(i, 64));
    }
    EXPECT_EQ(output, expected);
}

TEST(Convolver, AResponseThatComesWhileOneFadesInWaits) {
    Convolver convolver(64, 128);
    std::vector<float> input(64, 1.0f), output(64 * 8);
    const auto step = [&](std::size_t k) { convolver.process(input, std::span(output).subspan(64 * k, 64)); };
    convolver.setResponse(std::vector<float>{1.0f});
    step(0);
    convolver.setResponse(std::vector<float>{2.0f});
    step(1);
    convolver.setResponse(std::vector<float>{5.0f});
    convolver.setResponse(std::vector<float>{3.0f});
    for (std::size_t k = 2; k < 8; ++k) step(k);
    EXPECT_NEAR(output[64 * 3 - 1], 2, 1e-5);
    EXPECT_NEAR(output.back(), 3, 1e-5);
    for (const float sample : output) EXPECT_LE(sample, 3.0001f);
}

TEST(SoundFile, RoundTripIsExactAndBytesRepeat) {
    SoundBuffer sound{44100, 2, noise(2000)};
    for (const WavFormat format : {WavFormat::pcm16, WavFormat::pcm24, WavFormat::float32}) {
        const std::string a = temporary("a.wav"), b = temporary("b.wav");
        ASSERT_TRUE(writeWav(a, sound, format));
        ASSERT_TRUE(writeWav(b, sound, format));
        const auto bytes = [](const std::string& path) {
            std::ifstream in(path, std::ios::binary);
            return std::string(std::istreambuf_iterator<char>(in), {});
        };
        EXPECT_EQ(bytes(a), bytes(b));
        const auto back = readSound(a);
        ASSERT_TRUE(back);
        EXPECT_EQ(back->sampleRate, 44100);
        EXPECT_EQ(back->channels, 2);
        ASSERT_EQ(back->samples.size(), sound.samples.size());
        const float step = format == WavFormat::pcm16 ? 1 / 32768.0f : format == WavFormat::pcm24 ? 1 / 8388608.0f : 0;
        for (std::size_t i = 0; i < sound.samples.size(); ++i) ASSERT_NEAR(back->samples[i], sound.samples[i], step);
        std::filesystem::remove(a);
        std::filesystem::remove(b);
    }
}

TEST(SoundFile, TellsItsLengthByTheHeader) {
    SoundBuffer sound{8000, 2, noise(2 * 12'000)};
    const std::string path = temporary("length.wav");
    ASSERT_TRUE(writeWav(path, sound));
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    const auto lengthOf = [&](const std::string& url) {
        const auto file = Resources(folder).open(folder, url);
        EXPECT_TRUE(file) << url;
        return soundSeconds(*file);
    };
    const auto seconds = lengthOf(path);
    std::filesystem::remove(path);
    ASSERT_TRUE(seconds);
    EXPECT_EQ(*seconds, 1.5);
    EXPECT_FALSE(lengthOf("data:,no%20sound"));
    EXPECT_FALSE(lengthOf("data:,"));
}

TEST(SoundFile, RefusesWhatItCannotDo) {
    EXPECT_FALSE(readSound("/nowhere/no.wav"));
    const std::string garbage = temporary("garbage.wav");
    std::ofstream(garbage) << "RIFFxxxxWAVEfmt nothing of the kind";
    EXPECT_FALSE(readSound(garbage));
    std::filesystem::remove(garbage);
    SoundBuffer loud{48000, 1, {0.5f, -1.5f}};
    EXPECT_FALSE(writeWav(temporary("loud.wav"), loud, WavFormat::pcm16));
    loud.samples[0] = NAN;
    EXPECT_FALSE(writeWav(temporary("loud.wav"), loud, WavFormat::float32));
    EXPECT_FALSE(writeWav("/nowhere/no.wav", SoundBuffer{48000, 1, {0.0f}}));
    const auto other = writeWav(temporary("a.mp3"), SoundBuffer{48000, 1, {0.0f}});
    ASSERT_FALSE(other);
    EXPECT_NE(other.error().text.find("there is: .wav"), std::string::npos) << other.error().text;
    EXPECT_FALSE(std::filesystem::exists(temporary("a.mp3")));
    // A full disk: a device that never has room.
    const std::string full = temporary("full.wav");
    std::filesystem::create_symlink("/dev/full", full);
    EXPECT_FALSE(writeWav(full, SoundBuffer{48000, 1, std::vector<float>(100000)}));
    std::filesystem::remove(full);
    EXPECT_NEAR(normalise(loud, 1.0f), 1 / 1.5, 1e-6);
}

TEST(SoundFile, ComparesAndLimits) {
    const SoundBuffer tone{48000, 2, noise(4000)};
    EXPECT_EQ(*differenceDb(tone, tone), -std::numeric_limits<double>::infinity());
    SoundBuffer softer = tone;
    for (float& sample : softer.samples) sample *= .9f;
    EXPECT_NEAR(*differenceDb(tone, softer), -20, 1e-4);
    SoundBuffer other = tone;
    other.sampleRate = 44100;
    EXPECT_FALSE(differenceDb(tone, other));
    other = tone;
    other.channels = 1;
    EXPECT_FALSE(differenceDb(tone, other));
    other = tone;
    other.samples.resize(other.samples.size() - 8);  // .2 %
    EXPECT_FALSE(differenceDb(tone, other));
    other.samples = tone.samples;
    other.samples.resize(other.samples.size() - 2);  // what is left over counts
    EXPECT_GT(*differenceDb(tone, other), -60);

    SoundBuffer quiet{48000, 1, {.1f, -.2f}}, loud{48000, 1, {.5f, -2}};
    EXPECT_EQ(normalise(quiet), 1) << "never up";
    EXPECT_EQ(quiet.samples, (std::vector<float>{.1f, -.2f}));
    EXPECT_NEAR(normalise(loud, .5f), .25, 1e-6);
    EXPECT_EQ(loud.samples, (std::vector<float>{.125f, -.5f}));

    for (const char* name : {"a.wav", "a.WAV"}) EXPECT_TRUE(checkSoundName(name)) << name;
    for (const char* name : {"a.mp3", "wav", ""}) EXPECT_FALSE(checkSoundName(name)) << name;
    const std::string file = temporary("many.wav");
    ASSERT_TRUE(writeWav(file, tone));
    EXPECT_TRUE(readSound(file, 4000));
    EXPECT_FALSE(readSound(file, 3999)) << "all channels count";
    std::filesystem::remove(file);
}

/// Both channels together carry the same energy from everywhere, and the far one keeps a twentieth of it.
TEST(Panning, KeepsTheEnergyAndLeavesNoEarWithout) {
    std::mt19937_64 random(kSeed);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 200; ++i) {
        const auto [left, right] =
            stereoGains(glm::normalize(glm::dvec3(normal(random), normal(random), normal(random))));
        EXPECT_NEAR(left * left + right * right, 2, 1e-12);
        EXPECT_GE(std::min(left, right) * std::min(left, right), .1 - 1e-12);
    }
    for (const glm::dvec3 middle : {glm::dvec3(0, 0, -1), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)})
        EXPECT_EQ(stereoGains(middle), (std::array<double, 2>{1, 1}));
    EXPECT_NEAR(std::pow(stereoGains({1, 0, 0})[0], 2), 2 / 20., 1e-12);
}

/// The library is loaded within the first call, whose arguments are in registers meanwhile.
TEST(SoundLibraryDeathTest, TheFirstCallGetsItsArguments) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    EXPECT_EXIT(std::exit(src_is_valid_ratio(2.5) == 1 && src_is_valid_ratio(1e9) == 0 ? 7 : 1),
                testing::ExitedWithCode(7), "");
}

}  // namespace
}  // namespace rtsg
