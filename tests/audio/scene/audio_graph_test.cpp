// Audio graphs of scenes, heard through an AudioDestination: what each node does to known sounds.
#include <cmath>
#include <complex>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "heard_graph.h"
#include "scene/process_player.h"
#include "support/plain_film.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using namespace test;

constexpr double kGraphRate = 48000;

/// The last quarter second's line at a frequency of whole turns in it.
double lineOf(const std::vector<double>& x, double hz) {
    std::complex<double> sum = 0;
    for (std::size_t i = x.size() - 12000; i < x.size(); ++i)
        sum += x[i] * std::polar(2.0 / 12000, -2 * M_PI * hz * static_cast<double>(i) / kGraphRate);
    return std::abs(sum);
}

const std::string kGraphTone = "OscillatorSource { frequency 1000 }";
/// An impulse a second, of .5.
const std::string kClick = "BufferAudioSource { buffer [ .5 0 0 0 ] sampleRate 48000 }";

TEST(AudioGraph, AFilterIsHeard) {
    // At its corner a lowpass of 0 dB has gain 1; the gain of the node is that of what comes out.
    EXPECT_NEAR(
        lineOf(hear("BiquadFilter { frequency 1000 qualityFactor 0 gain .5 children " + kGraphTone + " }")[0], 1000),
        .5, 1e-5);
    EXPECT_NEAR(
        lineOf(hear("BiquadFilter { type \"HIGHPASS\" frequency 1000 qualityFactor 6 children " + kGraphTone + " }")[0],
               1000),
        std::pow(10, .3), 1e-5);
    // For peaks and shelves it is the filter's own gain, in decibels.
    EXPECT_NEAR(
        lineOf(hear("BiquadFilter { type \"PEAKING\" frequency 1000 gain -12 children " + kGraphTone + " }")[0], 1000),
        std::pow(10, -.6), 1e-5);
    EXPECT_LT(
        lineOf(hear("BiquadFilter { type \"NOTCH\" frequency 500 detune 1200 children " + kGraphTone + " }")[0], 1000),
        1e-4);
}

TEST(AudioGraph, DelaysAndResponsesComeInTime) {
    const auto delayed = hear("Delay { delayTime .01 gain .5 children " + kClick + " }", .1)[0];
    for (std::size_t i = 0; i < 2000; ++i) ASSERT_NEAR(delayed[i], i == 480 ? .25 : 0, 1e-6) << i;
    // No longer than it may.
    EXPECT_NEAR(hear("Delay { delayTime 5 maxDelayTime .02 children " + kClick + " }", .1)[0][960], .5, 1e-6);
    const auto convolved = hear("Convolver { buffer [ .5 0 -.25 ] children " + kClick + " }", .1)[1];
    EXPECT_NEAR(convolved[0], .25, 1e-6);
    EXPECT_NEAR(convolved[1], 0, 1e-6);
    EXPECT_NEAR(convolved[2], -.125, 1e-6);
    // Normalised: .00125 over the root mean square, at 44,100 over 48,000.
    const auto normal = hear("Convolver { normalize TRUE buffer [ .5 0 -.25 ] children " + kClick + " }", .1)[0];
    EXPECT_NEAR(normal[0], .25 * .00125 / std::sqrt((.25 + .0625) / 3) * 44100 / 48000, 1e-6);
}

TEST(AudioGraph, ShapersAndCompressorsWorkOnWhatLeadsIntoThem) {
    // A curve that squares: half of a tone at twice the frequency.
    const std::string square = "metadata MetadataFloat { name \"curve\" value [ " + [] {
        std::string values;
        for (int i = -500; i <= 500; ++i) values += fmt::format("{} ", i * i / 250000.0);
        return values;
    }() + "]}";
    const auto shaped = hear("WaveShaper { " + square + " children Gain { gain .8 children " + kGraphTone + " } }")[0];
    EXPECT_NEAR(lineOf(shaped, 2000), .32, 1e-5);
    EXPECT_LT(lineOf(shaped, 1000), 1e-5);
    // Twice as loud is four times, where the gain comes before.
    const auto louder = hear("WaveShaper { " + square + " children Gain { gain .4 children " + kGraphTone + " } }")[0];
    EXPECT_NEAR(lineOf(louder, 2000), .08, 1e-5);
    // The third harmonic of 14.4 kHz comes back as 4.8 kHz at 48,000 Hz, and not at 96,000 or 192,000.
    const std::string cube = "metadata MetadataFloat { name \"curve\" value [ " + [] {
        std::string values;
        for (int i = -500; i <= 500; ++i) values += fmt::format("{} ", i * i * i / 125e6);
        return values;
    }() + "]}";
    const std::string high = cube + " children OscillatorSource { frequency 14400 } }";
    EXPECT_NEAR(lineOf(hear("WaveShaper { " + high)[0], 4800), .25, 1e-3);
    EXPECT_LT(lineOf(hear("WaveShaper { oversample \"2X\" " + high)[0], 4800), 1e-3);
    EXPECT_LT(lineOf(hear("WaveShaper { oversample \"4X\" " + high)[0], 4800), 1e-3);
    // Below its threshold a compressor only makes up.
    const Compressor::Settings usual;
    EXPECT_NEAR(lineOf(hear("DynamicsCompressor { children Gain { gain .01 children " + kGraphTone + " } }")[0], 1000),
                .01 * Compressor::makeUp(usual), 1e-5);
}

TEST(AudioGraph, AWaveThatIsNotEnabledLeavesASine) {
    const auto tone = [](const char* enabled) {
        return hear(
            fmt::format("OscillatorSource {{ frequency 1000 periodicWave PeriodicWave {{ enabled {} type "
                        "\"CUSTOM\" optionsReal [ 0 0 0 ] optionsImag [ 0 0 1 ] }} }}",
                        enabled))[0];
    };
    EXPECT_NEAR(lineOf(tone("TRUE"), 2000), 1, 1e-5);
    EXPECT_LT(lineOf(tone("TRUE"), 1000), 1e-5);
    EXPECT_NEAR(lineOf(tone("FALSE"), 1000), 1, 1e-5);
    EXPECT_LT(lineOf(tone("FALSE"), 2000), 1e-5);
}

TEST(AudioGraph, AWaveOfNoKnownTypeIsASquare) {
    const auto tone = [](const char* type) {
        std::string reported;
        return hear(
            fmt::format("OscillatorSource {{ frequency 1000 periodicWave PeriodicWave {{ type \"{}\" }} }}", type), .1,
            &reported)[0];
    };
    EXPECT_EQ(tone("FOO"), tone("SQUARE"));
    EXPECT_NE(tone("SINE"), tone("SQUARE"));
}

TEST(AudioGraph, ABranchThatMakesNoNumbersIsSilentAloneAndNamed) {
    for (const std::string& bad :
         {"DEF BAD DynamicsCompressor { threshold -1e30 children " + kGraphTone + " }",
          "DEF BAD Convolver { normalize FALSE buffer [ 1e38 1e38 1e38 ] children " + kGraphTone + " }"}) {
        std::string reported;
        const auto heard = hear(bad + " Gain { children " + kGraphTone + " }", .5, &reported);
        for (const double sample : heard[0]) ASSERT_TRUE(std::isfinite(sample)) << bad;
        EXPECT_NEAR(lineOf(heard[0], 1000), 1, 1e-5) << bad;
        EXPECT_EQ(reported, "BAD is silent where it makes values that are no numbers, or too large for a sound\n");
    }
}

/// Together with its own gain, the sound is louder than any valid number.
TEST(AudioGraph, ASoundThatIsTooLoudIsSilentAloneAndNamed) {
    for (const std::string& bad :
         {"DEF BAD SpatialSound { location 0 0 -2 gain 1e38 children " + kGraphTone + " }",
          "DEF BAD AudioDestination { gain 1e30 children Gain { gain 1e38 children " + kGraphTone + " } }",
          std::string("DEF BAD Sound { location 0 0 -2 source BufferAudioSource { loop TRUE sampleRate 48000 gain 1e38 "
                      "buffer [ 1e38 ] } }")}) {
        std::string reported;
        const auto heard =
            hear("Gain { children " + kGraphTone + " } ] } " + bad + " Group { children [", .5, &reported);
        for (const double sample : heard[0]) ASSERT_TRUE(std::isfinite(sample)) << bad;
        EXPECT_NEAR(lineOf(heard[0], 1000), 1, 1e-5) << bad;
        EXPECT_EQ(reported, "BAD is silent where it makes values that are no numbers, or too large for a sound\n")
            << bad;
    }
}

TEST(AudioGraph, ChannelsAreSplitSelectedAndMerged) {
    const std::string pair = "BufferAudioSource { numberOfChannels 2 sampleRate 48000 loop TRUE buffer [ .25 -.5 ] }";
    const auto straight = hear(pair, .1);
    EXPECT_NEAR(straight[0][1000], .25, 1e-6);
    EXPECT_NEAR(straight[1][1000], -.5, 1e-6);
    const auto second = hear("ChannelSelector { channelSelection 1 children " + pair + " }", .1);
    EXPECT_NEAR(second[0][1000], -.5, 1e-6);
    EXPECT_NEAR(second[1][1000], -.5, 1e-6);
    // Crossed over, and what is silent stays so.
    const auto crossed = hear("ChannelMerger { children [ ChannelSelector { channelSelection 1 children " + pair +
                                  " } ChannelSelector { channelSelection 0 gain .5 children " + pair + " } ] }",
                              .1);
    EXPECT_NEAR(crossed[0][1000], -.5, 1e-6);
    EXPECT_NEAR(crossed[1][1000], .125, 1e-6);
    const auto whole = hear("ChannelMerger { children ChannelSplitter { children " + pair + " } }", .1);
    EXPECT_NEAR(whole[0][1000], .25, 1e-6);
    EXPECT_NEAR(whole[1][1000], -.5, 1e-6);
    // Two channels into one of a merger: their mean.
    EXPECT_NEAR(hear("ChannelMerger { children [ " + pair + " " + kGraphTone + " ] }", .1)[0][1000], -.125, 1e-6);
    EXPECT_NEAR(hear("ChannelSelector { channelSelection 7 children " + pair + " }", .1)[0][1000], 0, 1e-12);
}

TEST(AudioGraph, ASplittersOutputsGetAChannelEach) {
    const std::string pair = "BufferAudioSource { numberOfChannels 2 sampleRate 48000 loop TRUE buffer [ .25 -.5 ] }";
    const auto split = [&](const std::string& outputs, std::string* reported = nullptr) {
        const auto heard = hear("ChannelSplitter { outputs [ " + outputs + " ] children " + pair + " }", .1, reported);
        return std::pair(heard[0][2000], heard[1][2000]);
    };
    using Both = testing::Matcher<std::pair<double, double>>;
    const auto both = [](double left, double right) -> Both {
        return testing::Pair(testing::DoubleNear(left, 1e-6), testing::DoubleNear(right, 1e-6));
    };
    EXPECT_THAT(split("Gain { gain .5 } Gain { gain 3 }"), both(.125, -1.5));
    EXPECT_THAT(split("Gain { children Delay { } } Delay { gain -1 }"), both(.25, .5));
    EXPECT_THAT(split("ChannelSelector { channelSelection 0 } ChannelSelector { channelSelection 1 }"), both(.25, 0));
    // A channel without an output is not heard, nor one whose output is off; one of mono goes to both sides.
    EXPECT_THAT(split("Gain { }"), both(.25, .25));
    EXPECT_THAT(split("Gain { enabled FALSE } Gain { }"), both(0, -.5));
    // The additional input of an output.
    EXPECT_THAT(split("Gain { gain 2 children " + pair + " } Delay { children " + pair + " }"),
                both(2 * (.25 + .5 * (.25 - .5)), -.5 + .5 * (.25 - .5)));
    // How a splitter mixes what it gets.
    const std::string one = "BufferAudioSource { sampleRate 48000 loop TRUE buffer [ .125 ] }";
    for (const bool discrete : {false, true}) {
        const auto heard =
            hear("ChannelSplitter { " + std::string(discrete ? "channelInterpretation \"DISCRETE\" " : "") +
                     "outputs [ Gain { } Gain { } ] children [ " + pair + " " + one + " ] }",
                 .1);
        EXPECT_THAT(std::pair(heard[0][2000], heard[1][2000]), both(.375, discrete ? -.5 : -.375));
    }
    // Splitters and mergers as outputs.
    EXPECT_THAT(split("ChannelMerger { children Gain { } } ChannelSplitter { gain 4 outputs Gain { gain .5 } }"),
                both(.125, -1));
    std::string reported;
    EXPECT_THAT(split("Gain { } " + pair, &reported), both(.25, .5 * (.25 - .5)));
    EXPECT_THAT(reported, testing::HasSubstr("is a source: as an output of a ChannelSplitter it hears nothing of it"));
}

TEST(AudioGraph, FollowsASplittersOutputs) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene,
                 "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 0 0 } AudioDestination { children "
                 "ChannelSplitter { outputs DEF G Gain { gain 1 } children BufferAudioSource { sampleRate 48000 "
                 "loop TRUE buffer [ .25 ] } } }",
                 diagnostics));
    SharedWorld world(scene);
    ListenOptions options;
    options.metrics = false;
    SoundRenderer sound(world, options);
    const auto heard = [&](int frame) {
        scene.newFrame(frame / 60.0);
        EXPECT_TRUE(sound.renderFrame());
        return sound.block().back();
    };
    for (int frame = 1; frame < 4; ++frame) heard(frame);
    EXPECT_NEAR(heard(4), .25, 1e-6);
    ASSERT_TRUE(scene.set(scene.findName("G"), x3d::Gain::gain, -2.0f));
    for (int frame = 5; frame < 9; ++frame) heard(frame);
    EXPECT_NEAR(heard(9), -.5, 1e-6);
}

// The table of the Web Audio API, section 4: what one of each channel becomes.
TEST(AudioGraph, LoudspeakersAreMixedUpAndDown) {
    const float h = std::sqrt(.5f);
    using Row = std::vector<float>;
    const struct {
        std::size_t from, to;
        std::vector<Row> out;  // by channel of `to`: what it has of those of `from`
    } table[] = {
        {1, 1, {{1}}},
        {1, 2, {{1}, {1}}},
        {1, 4, {{1}, {1}, {0}, {0}}},
        {1, 6, {{0}, {0}, {1}, {0}, {0}, {0}}},
        {2, 2, {{1, 0}, {0, 1}}},
        {2, 4, {{1, 0}, {0, 1}, {0, 0}, {0, 0}}},
        {2, 6, {{1, 0}, {0, 1}, {0, 0}, {0, 0}, {0, 0}, {0, 0}}},
        {4, 6, {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}},
        {2, 1, {{.5f, .5f}}},
        {4, 1, {{.25f, .25f, .25f, .25f}}},
        {6, 1, {{h, h, 1, 0, .5f, .5f}}},
        {4, 2, {{.5f, 0, .5f, 0}, {0, .5f, 0, .5f}}},
        {6, 2, {{1, 0, h, 0, h, 0}, {0, 1, h, 0, 0, h}}},
        {6, 4, {{1, 0, h, 0, 0, 0}, {0, 1, h, 0, 0, 0}, {0, 0, 0, 0, 1, 0}, {0, 0, 0, 0, 0, 1}}},
        {3, 5, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}, {0, 0, 0}}},
        {1, 3, {{1}, {0}, {0}}},
        {5, 2, {{1, 0, 0, 0, 0}, {0, 1, 0, 0, 0}}},
    };
    for (const auto& row : table)
        for (std::size_t from = 0; from < row.from; ++from) {
            SCOPED_TRACE(fmt::format("{} to {}, channel {}", row.from, row.to, from));
            AudioChannels in(row.from, std::vector<float>(3)), out(row.to, std::vector<float>(3, 10)), own = out;
            in[from] = {1, 2, -4};
            mixInto(out, in, false);
            mixInto(own, in, true);
            for (std::size_t to = 0; to < row.to; ++to)
                for (std::size_t i = 0; i < 3; ++i) {
                    EXPECT_FLOAT_EQ(out[to][i], 10 + row.out[to][from] * in[from][i]) << to;
                    EXPECT_FLOAT_EQ(own[to][i], 10 + (to == from ? in[from][i] : 0)) << to;
                }
        }
}

/// A mono tone beside sounds of more channels, and six channels through an input of a merger.
TEST(AudioGraph, NodesMixTheirInputsAsTheySay) {
    const std::string one = "BufferAudioSource { sampleRate 48000 loop TRUE buffer [ .25 ] }",
                      pair = "BufferAudioSource { numberOfChannels 2 sampleRate 48000 loop TRUE buffer [ .5 -.5 ] }",
                      six =
                          "BufferAudioSource { numberOfChannels 6 sampleRate 48000 loop TRUE buffer [ .1 .2 .3 .4 .5 "
                          ".6 ] }";
    for (const bool discrete : {false, true}) {
        const std::string how = discrete ? "channelInterpretation \"DISCRETE\" " : "";
        const auto both = hear("Delay { " + how + "children [ " + one + " " + pair + " ] }", .1);
        EXPECT_NEAR(both[0][1000], .75, 1e-6);
        EXPECT_NEAR(both[1][1000], discrete ? -.5 : -.25, 1e-6);
        const auto merged = hear("ChannelMerger { " + how + "children [ " + six + " " + one + " ] }", .1);
        EXPECT_NEAR(merged[0][1000], discrete ? .1 : std::sqrt(.5) * .3 + .3 + .5 * 1.1, 1e-6);
        EXPECT_NEAR(merged[1][1000], .25, 1e-6);
    }
}

/// Sounds with a position are mixed down as before a panner.
TEST(AudioGraph, SoundsOfManyChannelsAreMixedAsADestinationMixesThem) {
    for (const int count : {3, 4, 6}) {
        std::string clip =
            "BufferAudioSource { sampleRate 48000 loop TRUE numberOfChannels " + std::to_string(count) + " buffer [";
        for (int c = 1; c <= count; ++c) clip += " ." + std::to_string(c);
        clip += " ] }";
        const auto mixed = hear(clip, .1);
        for (const std::string& sound :
             {"Sound { spatialize FALSE minFront 10 minBack 10 maxFront 20 maxBack 20 source " + clip + " }",
              "SpatialSound { spatialize FALSE children " + clip + " }"}) {
            std::string reported;
            const auto placed = hear("", .1, &reported, "", sound + " Viewpoint { position 0 0 0 }");
            for (std::size_t ear = 0; ear < 2; ++ear) EXPECT_NEAR(placed[ear][4000], mixed[ear][4000], 1e-5) << sound;
        }
    }
}

/// Whatever leads into a destination is mixed to its two loudspeakers as into any node, or to as many as it has.
TEST(AudioGraph, ADestinationMixesToItsLoudspeakers) {
    const float h = std::sqrt(.5f);
    const std::string four =
                          "BufferAudioSource { numberOfChannels 4 sampleRate 48000 loop TRUE buffer [ .1 .2 .3 .4 ] }",
                      six =
                          "BufferAudioSource { numberOfChannels 6 sampleRate 48000 loop TRUE buffer [ .1 .2 .3 .4 .5 "
                          "-.6 ] }",
                      three = "BufferAudioSource { numberOfChannels 3 sampleRate 48000 loop TRUE buffer [ .1 .2 .3 ] }";
    const auto heard = [](const std::string& graph, const std::string& fields = "") {
        const auto both = hear(graph, .1, nullptr, fields);
        return std::pair(both[0][2000], both[1][2000]);
    };
    const auto both = [](double left, double right) {
        return testing::Pair(testing::DoubleNear(left, 1e-6), testing::DoubleNear(right, 1e-6));
    };
    EXPECT_THAT(heard(four), both(.5 * .4, .5 * .6));
    EXPECT_THAT(heard(six), both(.1 + h * .8, .2 + h * -.3));
    EXPECT_THAT(heard(three), both(.1, .2));
    EXPECT_THAT(heard(kSteady), both(.25, .25));
    // Each as if alone: what is mono does not go to the middle of six.
    EXPECT_THAT(heard(kSteady + " " + six), both(.25 + .1 + h * .8, .25 + .2 + h * -.3));
    const std::string own = "channelInterpretation \"DISCRETE\"";
    EXPECT_THAT(heard(four, own), both(.1, .2));
    EXPECT_THAT(heard(kSteady + " " + six, own), both(.25 + .1, .2));
    EXPECT_THAT(heard(four, "maxChannelCount 1"), both(.25, .25));
    EXPECT_THAT(heard(kSteadyPair, "maxChannelCount 1"), both(.125, .125));
    EXPECT_THAT(heard(four, "maxChannelCount 6"), both(.5 * .4, .5 * .6));
}

/// Outside its times what leads into it comes out as it is.
TEST(AudioGraph, ANodeProcessesWhileItIsActive) {
    for (const char* node : {"Gain { gain 2", "WaveShaper { gain 2"}) {
        SCOPED_TRACE(node);
        const auto x = hear(
            "Gain { gain .5 children " + std::string(node) + " startTime .1 stopTime .2 children " + kSteady + " } }",
            .3)[0];
        for (std::size_t i = 0; i < x.size(); ++i) ASSERT_NEAR(x[i], i >= 4800 && i < 9600 ? .25 : .125, 1e-6) << i;
    }
    const auto paused = hear("Gain { gain 2 pauseTime .1 children " + kSteady + " }", .2)[0];
    EXPECT_NEAR(paused[4700], .5, 1e-6);
    EXPECT_NEAR(paused[4900], .25, 1e-6);
}

/// bufferDuration: what is used of it; loops go round there.
TEST(AudioGraph, ABufferIsUsedAsFarAsItIsTold) {
    const std::string buffer = "BufferAudioSource { sampleRate 48000 bufferDuration 4.1666667e-5 buffer [ .1 .2 .3 ] ";
    const auto round = hear(buffer + "loop TRUE }", .1)[0], once = hear(buffer + "}", .1)[0];
    for (std::size_t i = 0; i < 600; ++i) {
        ASSERT_NEAR(round[i], i % 2 == 0 ? .1 : .2, 1e-6) << i;
        ASSERT_NEAR(once[i], i == 0 ? .1 : i == 1 ? .2 : 0, 1e-6) << i;
    }
    const auto all = hear("BufferAudioSource { sampleRate 48000 bufferDuration 9 loop TRUE buffer [ .1 .2 .3 ] }", .1);
    EXPECT_NEAR(all[0][302], .3, 1e-6);
}

/// A pitch is above 0 (16.4.2): with another a clip neither plays nor says that it does.
TEST(AudioGraph, AClipWithoutAPitchIsSilentAndNotActive) {
    SoundBuffer tone{48000, 1, std::vector<float>(4800, .25f)};
    const test::TempFolder folder;
    const auto file = folder.path() / "tone.wav";
    ASSERT_TRUE(writeWav(file.string(), tone, WavFormat::float32));
    std::ifstream written(file, std::ios::binary);
    const std::string url = test::dataUrl(
        "audio/wav", std::string(std::istreambuf_iterator<char>(written), std::istreambuf_iterator<char>()));
    for (const double pitch : {-1., 0., 1.}) {
        SCOPED_TRACE(pitch);
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(
            loadText(scene,
                     fmt::format("#X3D V4.0 utf8\nPROFILE Full\nViewpoint {{ position 0 0 0 }} AudioDestination "
                                 "{{ children DEF C AudioClip {{ pitch {} loop TRUE url \"{}\" }} }}",
                                 pitch, url),
                     diagnostics));
        ASSERT_TRUE(scene.set(scene.findName("C"), x3d::AudioClip::_duration, Time{.1}));
        SharedWorld world(scene);
        ListenOptions options;
        options.metrics = false;
        SoundRenderer sound(world, options);
        float loudest = 0;
        for (int frame = 1; frame < 9; ++frame) {
            scene.newFrame(frame / 60.0);
            ASSERT_TRUE(sound.renderFrame());
            for (const float sample : sound.block()) loudest = std::max(loudest, std::abs(sample));
        }
        EXPECT_EQ(scene.node(scene.findName("C")).get(x3d::AudioClip::isActive), pitch > 0);
        EXPECT_NEAR(loudest, pitch > 0 ? .25 : 0, 1e-6);
        std::string reported;
        const ListenReport report = sound.finish();
        for (const Diagnostic& d : report.diagnostics.all()) reported += d.text + '\n';
        EXPECT_EQ(reported, pitch > 0 ? "" : std::string("C is silent: its pitch is not above 0\n"));
    }
}

/// One channel's samples after the other's, as Web Audio has them (16.4.5 goes by that).
TEST(AudioGraph, ABuffersChannelsStandOneAfterTheOther) {
    const auto x = hear(
        "BufferAudioSource { numberOfChannels 2 sampleRate 48000 loop TRUE buffer [ .1 .2 .3 -.1 -.2 -.3 .9 ] }", .1);
    for (std::size_t i = 0; i < 600; ++i) {
        ASSERT_NEAR(x[0][i], .1 * static_cast<double>(i % 3 + 1), 1e-6) << i;
        ASSERT_NEAR(x[1][i], -.1 * static_cast<double>(i % 3 + 1), 1e-6) << i;
    }
}

/// Backwards a loop goes on at its other end, and what does not repeat is over after the sample that it begins with; at
/// no speed it stands there (Web Audio API, AudioBufferSourceNode).
TEST(AudioGraph, ABufferIsPlayedBackwardsAndNotAtAll) {
    const double values[] = {.1, .2, .3, .4, .5};
    const auto played = [&](double rate, const char* more) {
        return hear(fmt::format("BufferAudioSource {{ sampleRate 48000 buffer [ .1 .2 .3 .4 .5 ] playbackRate {} {} }}",
                                rate, more),
                    .1)[0];
    };
    const auto back = played(-1, "loop TRUE"), still = played(0, "loop TRUE"), once = played(-1, ""),
               part = played(-1, "loop TRUE loopStart 2.083333e-5 loopEnd 8.333333e-5"), fast = played(-2, "loop TRUE");
    for (std::size_t i = 0; i < 400; ++i) {
        const auto n = static_cast<std::ptrdiff_t>(i);
        ASSERT_NEAR(back[i], values[(5 - n % 5) % 5], 1e-6) << i;
        ASSERT_NEAR(still[i], .1, 1e-6) << i;
        ASSERT_NEAR(once[i], i == 0 ? .1 : 0, 1e-6) << i;
        // Samples 1 to 3 repeat.
        ASSERT_NEAR(part[i], values[3 - n % 3], 1e-6) << i;
    }
    // Twice as fast, with what lies above half the rate by then left out: its mean stays.
    double sum = 0;
    for (std::size_t i = 1000; i < 2000; ++i) sum += fast[i] / 1000;
    EXPECT_NEAR(sum, .3, 1e-3);
}

TEST(AudioGraph, AFilmIsHeardAtItsSpeedAndNotBackwards) {
    const std::string film =
        "MovieTexture { loop TRUE url \"" + test::dataUrl("video/avi", test::plainFilm(4, 10, 4, 2, 48000)) + "\" ";
    const auto once = hear(film + "}", .5);
    const auto twice = hear(film + "speed 2 }", .5);
    for (std::size_t i : {std::size_t{100}, std::size_t{9000}, std::size_t{20'000}}) {
        EXPECT_NEAR(once[0][i], static_cast<double>(i % 19'200) / 32768, 1e-6) << i;
        EXPECT_NEAR(once[1][i], -static_cast<double>(i % 19'200) / 32768, 1e-6) << i;
        EXPECT_NEAR(twice[0][i], static_cast<double>(2 * i % 19'200) / 32768, 1e-5) << i;
    }
    for (const char* silent : {"speed -1 }", "speed 0 }", "load FALSE }"}) {
        std::string reported;
        const auto nothing = hear(film + silent, .1, &reported);
        for (const double sample : nothing[0]) ASSERT_EQ(sample, 0) << silent;
        EXPECT_THAT(reported, testing::HasSubstr("nothing that sounds leads into it"));
    }
}

TEST(AudioGraph, ABufferLoopsWhereItIsTold) {
    std::string values;
    for (int i = 0; i < 480; ++i) values += fmt::format("{} ", i / 480.0);
    const auto x = hear(
        "BufferAudioSource { sampleRate 48000 loop TRUE loopStart .002 loopEnd .005 buffer [ " + values + "] }", .1)[0];
    for (std::size_t i = 0; i < 2000; ++i) {
        const std::size_t at = i < 240 ? i : 96 + (i - 96) % 144;
        ASSERT_NEAR(x[i], static_cast<double>(at) / 480, 1e-6) << i;
    }
}

/// A loop that would begin at the end or behind it is the whole buffer, whatever rounding its seconds have.
TEST(AudioGraph, ALoopThatBeginsAtTheEndIsTheWholeBuffer) {
    for (const int count : {375, 480}) {  // .0078125 s exactly, and .01 s
        std::string values;
        for (int i = 0; i < count; ++i) values += fmt::format("{} ", i / 480.0);
        const auto x =
            hear(fmt::format("BufferAudioSource {{ sampleRate 48000 loop TRUE loopStart {} loopEnd 1 buffer [ "
                             "{} ] }}",
                             count / 48000.0, values),
                 .1)[0];
        for (std::size_t i = 0; i < 2000; ++i)
            ASSERT_NEAR(x[i], static_cast<double>(i % static_cast<std::size_t>(count)) / 480, 1e-6)
                << count << ' ' << i;
    }
}

TEST(AudioGraph, FollowsEdits) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene,
                 "#X3D V4.0 utf8\nPROFILE Full\nAudioDestination { children DEF F BiquadFilter { type \"LOWPASS\" "
                 "frequency 24000 children " +
                     kGraphTone + " } }\nViewpoint { }\n",
                 diagnostics));
    ListenOptions options;
    options.metrics = false;
    SharedWorld world(scene);
    SoundRenderer sound(world, options);
    const auto level = [&](double until) {
        scene.seal();  // what was edited is heard from now on
        EXPECT_TRUE(sound.renderFrame());
        scene.newFrame(until);
        EXPECT_TRUE(sound.renderFrame());
        const std::vector<double> x(sound.block().begin(), sound.block().end());
        double maximum = 0;
        for (std::size_t i = x.size() / 2; i < x.size(); ++i) maximum = std::max(maximum, std::abs(x[i]));
        return maximum;
    };
    EXPECT_NEAR(level(.2), 1, 1e-3);
    ASSERT_TRUE(scene.set(scene.findName("F"), x3d::BiquadFilter::frequency, 10.f));
    EXPECT_LT(level(1.2), .01);
    const FieldIndex type = scene.node(scene.findName("F")).type().findExact("type");
    ASSERT_TRUE(scene.set(scene.findName("F"), Field<String>{type}, String("HIGHPASS")));
    EXPECT_NEAR(level(2.2), 1, 1e-2);
    // A filter that becomes another one does not ring with what the first has left: no louder than what goes in.
    ASSERT_TRUE(scene.set(scene.findName("F"), Field<String>{type}, String("LOWPASS")));
    scene.newFrame(2.4);
    ASSERT_TRUE(sound.renderFrame());
    for (const float sample : sound.block()) ASSERT_LT(std::abs(sample), 1.3f);
}

/// Another response counts, and so does the same one made as loud as others are.
TEST(AudioGraph, AConvolverFollowsEdits) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nAudioDestination { children DEF C Convolver { buffer [ .5 ] "
                         "normalize FALSE children " +
                             kSteady + " } }\nViewpoint { }\n",
                         diagnostics));
    ListenOptions options;
    options.metrics = false;
    SharedWorld world(scene);
    SoundRenderer sound(world, options);
    const NodeId convolver = scene.findName("C");
    const auto level = [&](double until) {
        scene.seal();  // what was edited is heard from now on
        EXPECT_TRUE(sound.renderFrame());
        scene.newFrame(until);
        EXPECT_TRUE(sound.renderFrame());
        return sound.block().back();
    };
    EXPECT_NEAR(level(.2), .25 * .5, 1e-5);
    ASSERT_TRUE(scene.set(convolver, x3d::Convolver::buffer, Array<float>{.25f}));
    EXPECT_NEAR(level(.6), .25 * .25, 1e-5);
    ASSERT_TRUE(scene.set(convolver, x3d::Convolver::normalize, true));
    const float normalized = level(1);
    EXPECT_GT(std::abs(normalized - .25f * .25f), 1e-4f);
    ASSERT_TRUE(scene.set(convolver, x3d::Convolver::buffer, Array<float>{.5f}));
    EXPECT_NEAR(level(1.4), normalized, 1e-5) << "as loud as any";
}

/// The spectrum of a tone in the middle of a bin, in the scene and along a route.
TEST(AudioGraph, WhatAnAnalyserFindsComesAsEvents) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(
        scene,
        "#X3D V4.0 utf8\nPROFILE Full\nAudioDestination { children DEF A Analyser { fftSize 512 gain .25 "
        "smoothingTimeConstant .5 metadata MetadataSet { value [ DEF D MetadataFloat { name \"frequencyData\" } DEF B "
        "MetadataFloat { name \"byteFrequencyData\" } DEF N MetadataFloat { name \"other\" value [ 7 ] } ] } children "
        "OscillatorSource { frequency 1500 gain .5 } } }\nDEF T MetadataFloat { }\nViewpoint { position 0 0 0 }\n"
        "ROUTE D.value_changed TO T.set_value\n",
        diagnostics));
    ListenOptions options;
    options.metrics = false;
    options.seconds = 1;
    ASSERT_TRUE(listen(scene, options));
    scene.newFrame(1.1);
    const auto valueOf = [&](const char* name) {
        return scene.node(scene.findName(name)).get(x3d::MetadataFloat::value);
    };
    EXPECT_EQ(scene.node(scene.findName("A")).get(x3d::Analyser::frequencyBinCount), 256);
    const Array<float> found = valueOf("D"), bytes = valueOf("B"), routed = valueOf("T");
    ASSERT_EQ(found.size(), 256u);
    ASSERT_EQ(bytes.size(), 256u);
    // Bin 16: half of the Blackman window's mean of .42, and its neighbours' .25 and .04; before the node's gain. After
    // 60 frames smoothing has converged.
    const double level = 20 * std::log10(.5 * .42 / 2), beside = 20 * std::log10(.5 * .25 / 2);
    EXPECT_NEAR(found[16], level, 1e-4);
    EXPECT_NEAR(found[15], beside, 1e-3);
    EXPECT_NEAR(found[17], beside, 1e-3);
    EXPECT_LT(found[60], -90);
    EXPECT_EQ(bytes[16], 255);  // above -30 dB
    EXPECT_EQ(bytes[14], std::floor(255 / 70.0 * (static_cast<double>(found[14]) + 100)) > 255
                             ? 255
                             : std::floor(255 / 70.0 * (static_cast<double>(found[14]) + 100)));
    EXPECT_EQ(bytes[60], 0);
    ASSERT_EQ(routed.size(), 256u);
    EXPECT_NEAR(routed[16], level, 1e-4);
    EXPECT_EQ(valueOf("N").size(), 1u);
}

/// By the Web Audio API, without a knee: levels above the threshold are divided by the ratio; the gain falls by 10 dB
/// in `attack` and rises by 10 dB in `release`; without a signal the reduction is 0. The make-up gain is not included.
TEST(AudioGraph, WhatACompressorTakesAwayComesAsEvents) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(
        scene,
        "#X3D V4.0 utf8\nPROFILE Full\nDEF C DynamicsCompressor { threshold -24 knee 0 ratio 4 attack .1 release .2 "
        "children BufferAudioSource { loop TRUE stopTime 1 buffer [ .5 -.5 ] } }\n"
        "AudioDestination { children [ USE C Gain { gain .5 children USE C } ] }\nDEF T Gain { gain 7 }\n"
        "Viewpoint { position 0 0 0 }\nROUTE C.reduction TO T.gain\n",
        diagnostics));
    ListenOptions options;
    options.metrics = false;
    SharedWorld world(scene);
    SoundRenderer sound(world, options);
    const auto reductionAt = [&](double t) {
        scene.newFrame(t);
        EXPECT_TRUE(sound.renderFrame());
        sound.sendEvents();
        scene.newFrame(t);
        const auto reported =
            static_cast<double>(scene.node(scene.findName("C")).get(x3d::DynamicsCompressor::reduction));
        EXPECT_EQ(static_cast<double>(scene.node(scene.findName("T")).get(x3d::Gain::gain)), reported);
        return reported;
    };
    // Sound is made in blocks of 256 samples: what is found is that of up to one later.
    const double block = 10 * 256 / 4800.0;
    EXPECT_EQ(scene.node(scene.findName("C")).get(x3d::DynamicsCompressor::reduction), 0);
    EXPECT_NEAR(reductionAt(.05), -5, block);
    EXPECT_NEAR(reductionAt(.1), -10, block);
    const double all = -.75 * (24 + 20 * std::log10(.5));
    EXPECT_NEAR(reductionAt(.5), all, 1e-5);
    EXPECT_NEAR(reductionAt(1), all, block / 2);
    EXPECT_NEAR(reductionAt(1.1), all + 5, block / 2);
    EXPECT_EQ(reductionAt(1.5), 0);
    // Told once: a scene whose compressors rest has nothing to send.
    sound.sendEvents();
    EXPECT_TRUE(scene.newFrame(1.5)->changes.empty());
}

TEST(AudioGraph, AnAnalyserLetsSoundPassAndSaysWhatSizeItTakes) {
    EXPECT_NEAR(lineOf(hear("Analyser { gain .5 children " + kGraphTone + " }")[0], 1000), .5, 1e-5);
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nAudioDestination { children DEF A Analyser { fftSize 1000 "
                         "children " +
                             kGraphTone + " } }\n",
                         diagnostics));
    ListenOptions options;
    options.metrics = false;
    options.seconds = .1;
    const auto report = listen(scene, options);
    ASSERT_TRUE(report);
    ASSERT_EQ(report->diagnostics.all().size(), 1u);
    EXPECT_EQ(report->diagnostics.all()[0].text, "fftSize 1000 of A is no power of two from 32 to 32768: 512 is used");
    scene.newFrame(.2);
    EXPECT_EQ(scene.node(scene.findName("A")).get(x3d::Analyser::frequencyBinCount), 256);
}

}  // namespace
}  // namespace rtsg
