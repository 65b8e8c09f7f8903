// The user's inputs for microphones and streams: files, pipes, standard input, devices; live and not.
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>

#include "program.h"

namespace rtsg {
namespace {

using namespace test;
using testing::HasSubstr;

template <class T>
std::string bytesOf(T value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    return {bytes, sizeof bytes};
}

/// The left of two channels of a WAV of whole numbers in 24 bits, or of floating-point ones.
std::vector<float> leftOf(const std::string& file) {
    const std::string text = readFile(file);
    const std::size_t data = text.find("data");
    std::vector<float> left;
    if (data == std::string::npos) return left;
    const bool floats = static_cast<unsigned char>(text[34]) == 32;
    for (std::size_t at = data + 8, size = floats ? 4 : 3; at + 2 * size <= text.size(); at += 2 * size) {
        float value = 0;
        std::int32_t whole = 0;
        if (floats)
            std::memcpy(&value, &text[at], 4);
        else
            std::memcpy(reinterpret_cast<char*>(&whole) + 1, &text[at], 3);
        left.push_back(floats ? value : static_cast<float>(whole / 2147483648.0));
    }
    return left;
}

class GivenSounds : public testing::Test {
  protected:
    void SetUp() override {
        const std::string head = "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { }\nAudioDestination { children ";
        writeFile(scene_, head + "MicrophoneSource { mediaDeviceID \"left\" } }\n");
        writeFile(feed_, head + "StreamAudioSource { streamIdentifier \"feed\" } }\n");
        for (int i = 0; i < 9600; ++i) raw_ += bytesOf(static_cast<float>(i % 100) / 200);
        writeFile(folder_ / "ramp.wav", "RIFF" + bytesOf<std::uint32_t>(36 + 38400) + "WAVEfmt " +
                                            bytesOf<std::uint32_t>(16) + bytesOf<std::uint16_t>(3) +
                                            bytesOf<std::uint16_t>(1) + bytesOf<std::uint32_t>(48000) +
                                            bytesOf<std::uint32_t>(192000) + bytesOf<std::uint16_t>(4) +
                                            bytesOf<std::uint16_t>(32) + "data" + bytesOf<std::uint32_t>(38400) + raw_);
    }
    Outcome listen(std::vector<std::string> more, const std::string& input = {}) {
        const bool feed = std::ranges::find(more, "--stream") != more.end();
        std::vector<std::string> arguments{"listen", feed ? feed_ : scene_, "--for", "0.1s"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return Program(arguments, folder_ / "listen", input).wait();
    }
    /// Whether a tenth of a second of the ramp was heard, from its beginning.
    void expectRamp(const std::string& file) {
        const std::vector<float> left = leftOf(file);
        ASSERT_EQ(left.size(), 4800u);
        for (std::size_t i = 0; i < left.size(); ++i)
            ASSERT_NEAR(left[i], static_cast<float>(i % 100) / 200, 1e-6) << i;
    }

    const TempFolder folder_;
    const std::string scene_ = folder_ / "scene.x3dv", feed_ = folder_ / "feed.x3dv";
    std::string raw_;
};

TEST_F(GivenSounds, FilesPipesAndStandardInputAreHeardFromTheirBeginning) {
    const std::string out = folder_ / "out.wav";
    const std::string wav = readFile(folder_ / "ramp.wav");
    const auto hear = [&](std::vector<std::string> given, const std::string& input = {}) {
        std::filesystem::remove(out);
        given.insert(given.end(), {"-o", out});
        const Outcome outcome = listen(given, input);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        expectRamp(out);
    };
    hear({"--microphone", "left=" + (folder_ / "ramp.wav")});
    // It begins when it is heard, not when its node did, decades ago.
    hear({"--microphone", folder_ / "ramp.wav", "--at", "2026-11-20T12:00:00Z"});
    hear({"--stream", "feed=" + (folder_ / "ramp.wav")});
    hear({"--microphone", "-"}, wav);
    hear({"--stream", "feed=f32@48000x1:-"}, raw_);
    const std::string pipe = folder_ / "pipe";
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    // The writer may start later, and may write more than is wanted.
    std::thread writer([&] {
        ::signal(SIGPIPE, SIG_IGN);
        std::ofstream to(pipe, std::ios::binary);
        to << wav;
    });
    hear({"--microphone", "left=" + pipe});
    writer.join();
}

/// Nothing replaces what it is made from.
TEST_F(GivenSounds, AreNotWrittenOver) {
    const std::string ramp = folder_ / "ramp.wav", before = readFile(ramp), streams = folder_ / "over";
    const std::vector<std::string> given{"--for", "0.1s", "--microphone", "left=" + ramp};
    for (std::vector<std::string> arguments : {std::vector<std::string>{"listen", scene_, "-o", ramp},
                                               {"listen", scene_, "--stream-out", ramp},
                                               {"listen", scene_, "--ir", ramp},
                                               {"run", scene_, "--listen", ramp}}) {
        arguments.insert(arguments.end(), given.begin(), given.end());
        const Outcome refused = Program(arguments, streams).wait();
        EXPECT_EQ(refused.status, 2) << arguments[0] << refused.err;
        EXPECT_THAT(refused.err, HasSubstr("is the input itself")) << arguments[0];
        ASSERT_EQ(readFile(ramp), before) << arguments[2];
    }
    const std::string head = folder_ / "head.sofa";
    writeFile(head, "a head");
    EXPECT_EQ(Program({"listen", scene_, "--binaural", "--sofa", head, "--ir", head}, streams).wait().status, 2);
    EXPECT_EQ(readFile(head), "a head");
}

/// A device plays two channels: ambisonics are refused and not played as something else.
TEST_F(GivenSounds, AmbisonicsAreNotLive) {
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"listen", scene_, "--live", "--ambisonic", "1"},
          {"run", scene_, "--live", "--listen", "device", "--ambisonic", "1"}}) {
        const Outcome refused = Program(arguments, folder_ / "live").wait();
        EXPECT_EQ(refused.status, 2) << refused.err;
        EXPECT_THAT(refused.err, HasSubstr("--ambisonic")) << refused.err;
    }
}

TEST_F(GivenSounds, StreamsGoToTheFilesThatTheUserNames) {
    const std::string scene = folder_ / "streams.x3dv", one = folder_ / "one.wav", all = folder_ / "all.wav";
    writeFile(scene,
              "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { }\n"
              "StreamAudioDestination { streamIdentifier \"desk\" children ChannelMerger { children [ Gain { children "
              "MicrophoneSource { } } Gain { children MicrophoneSource { } } ] } }\n"
              "StreamAudioDestination { streamIdentifier \"truck\" gain .5 children MicrophoneSource { } }\n");
    const auto send = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments{"listen", scene, "--for", "0.1s", "--microphone", folder_ / "ramp.wav"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return Program(arguments, folder_ / "send").wait();
    };
    const Outcome done = send({"--stream-out", "desk=" + one, "--stream-out", all});
    EXPECT_EQ(done.status, 0) << done.err;
    expectRamp(one);
    const std::vector<float> both = leftOf(all);
    ASSERT_EQ(both.size(), 4800u);
    for (std::size_t i = 0; i < both.size(); ++i)
        ASSERT_NEAR(both[i], 1.5 * static_cast<double>(i % 100) / 200, 1e-6) << i;

    const auto says = [&](const std::string& given, const std::string& text, int status) {
        std::filesystem::remove(one);
        const Outcome outcome = send({"--stream-out", given});
        EXPECT_EQ(outcome.status, status) << given;
        EXPECT_THAT(outcome.err, HasSubstr(text));
        EXPECT_FALSE(std::filesystem::exists(one));
    };
    says("desk=", "a file is missing", 2);
    says("radio=" + one, "no StreamAudioDestination has the streamIdentifier \"radio\"", 1);
    says("desk=" + (folder_ / "one.mp3"), ".wav", 2);
    says("desk=" + scene, "streams.x3dv", 2);
    const Outcome live = send({"--live", "--stream-out", one});
    EXPECT_EQ(live.status, 2);
    EXPECT_THAT(live.err, HasSubstr("--live"));
}

TEST_F(GivenSounds, WhatCannotBeHeardIsSaid) {
    const std::string out = folder_ / "out.wav";
    const auto says = [&](const std::string& option, const std::string& given, const std::string& text,
                          const std::string& input = {}, int status = 2) {
        const Outcome outcome = listen({"-o", out, option, given}, input);
        EXPECT_EQ(outcome.status, status) << given;
        EXPECT_THAT(outcome.err, HasSubstr(text));
        EXPECT_THAT(outcome.err, HasSubstr(option));
        EXPECT_FALSE(std::filesystem::exists(out));
    };
    says("--microphone", "device", "live");
    says("--stream", "feed=device:front", "live");
    says("--microphone", "left=", "missing");
    // The same happens for a scene that does not exist.
    says("--microphone", folder_ / "nothing.wav", "nothing.wav", "", 1);
    says("--stream", folder_ / "nothing.wav", "nothing.wav", "", 1);
    says("--stream", "s16@0x1:-", "raw sound");
    says("--stream", "f32@48000:-", "raw sound");
    says("--microphone", "-", "no WAV", "this is text and will never be sound", 1);
    says("--microphone", "-", "before any sound came", "", 1);
    const std::string ramp = folder_ / "ramp.wav";
    says("--microphone", "right=" + ramp, "has the mediaDeviceID \"right\"; there are: \"left\"", "", 1);
    says("--stream", "right=" + ramp, "has the streamIdentifier \"right\"; there are: \"feed\"", "", 1);
    const Outcome twice = listen({"-o", out, "--microphone", "-", "--stream", "-"});
    EXPECT_EQ(twice.status, 2);
    EXPECT_THAT(twice.err, HasSubstr("standard input"));
    ::setenv("ALSOFT_DRIVERS", "null", 1);
    const Outcome none = listen({"--live", "--microphone", "left=device:front"});
    ::unsetenv("ALSOFT_DRIVERS");
    EXPECT_EQ(none.status, 1);
    EXPECT_THAT(none.err, HasSubstr("'front'"));
}

TEST_F(GivenSounds, ThatNobodyHearsAreErrorsInEveryVerb) {
    const std::string out = folder_ / "out.wav", ramp = folder_ / "ramp.wav";
    for (const std::vector<std::string>& verb :
         {std::vector<std::string>{"listen", feed_, "-o", out}, {"run", feed_, "--listen", out}}) {
        std::vector<std::string> arguments = verb;
        arguments.insert(arguments.end(), {"--for", "0.1s", "--microphone", "left=" + ramp});
        const Outcome outcome = Program(arguments, folder_ / "verb").wait();
        EXPECT_EQ(outcome.status, 1) << verb[0];
        EXPECT_THAT(outcome.err, HasSubstr("--microphone: the scene has no MicrophoneSource"));
        EXPECT_FALSE(std::filesystem::exists(out));
    }
}

TEST_F(GivenSounds, AHeadThatIsNotThereIsBadInputAsAMicrophoneIs) {
    const std::string out = folder_ / "out.wav";
    const Outcome outcome = listen({"-o", out, "--binaural", "--sofa", folder_ / "no.sofa"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("--sofa: "));
    EXPECT_THAT(outcome.err, HasSubstr("no.sofa"));
}

TEST_F(GivenSounds, ThatWereCutShortAreNamed) {
    const std::string out = folder_ / "out.wav", cut = folder_ / "cut.wav";
    writeFile(cut, readFile(folder_ / "ramp.wav").substr(0, 44 + 19200));
    const Outcome outcome = listen({"-o", out, "--microphone", "left=" + cut});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("cut.wav is damaged or cut short: 0.1 s of the 0.2 s that its header gives"));
    expectRamp(out);
}

/// OpenAL's device that is a file: what is heard live can be read.
TEST_F(GivenSounds, APipeIsHeardLiveAndNobodyWaitsForIt) {
    const std::string pipe = folder_ / "pipe", played = folder_ / "played.wav", settings = folder_ / "openal.conf";
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    writeFile(settings, "[general]\ndrivers = wave\nfrequency = 48000\n[wave]\nfile = " + played + "\n");
    ::setenv("ALSOFT_CONF", settings.c_str(), 1);
    // Nobody at the other end: it ends as it would without.
    const Outcome alone = listen({"--live", "--microphone", "left=" + pipe});
    EXPECT_EQ(alone.status, 0) << alone.err;
    Program program({"listen", scene_, "--live", "--for", "2s", "--microphone", "left=f32@48000x1:" + pipe},
                    folder_ / "live");
    std::thread writer([&] {
        ::signal(SIGPIPE, SIG_IGN);
        std::ofstream to(pipe, std::ios::binary);
        to << raw_;
    });
    const Outcome outcome = program.wait();
    writer.join();
    ::unsetenv("ALSOFT_CONF");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    const std::vector<float> left = leftOf(played);
    // All of it, in a row, wherever it began.
    std::size_t maximum = 0, row = 0;
    for (std::size_t i = 1; i < left.size(); ++i) {
        const float next = left[i - 1] + .005f > .4975f ? 0 : left[i - 1] + .005f;
        row = std::abs(left[i] - next) < 1e-3f ? row + 1 : 0;
        maximum = std::max(maximum, row);
    }
    EXPECT_GE(maximum, 9500u);
}

/// Before its first frame the source is where the listener is.
TEST_F(GivenSounds, LiveSoundBeginsWithTheFirstFrame) {
    const std::string played = folder_ / "played.wav", settings = folder_ / "openal.conf", scene = folder_ / "far.x3dv";
    writeFile(settings, "[general]\ndrivers = wave\nfrequency = 48000\n[wave]\nfile = " + played + "\n");
    writeFile(
        scene,
        "#X3D V4.0 utf8\nPROFILE Full\nDEF T TimeSensor { loop TRUE }\n"
        "DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 100 0 0 100 0 0 ] }\n"
        "DEF X Transform { children Sound { minFront 5 minBack 5 maxFront 20 maxBack 20 source OscillatorSource { "
        "frequency 500 } } }\nListenerPointSource { position 0 0 1 }\n"
        "ROUTE T.fraction_changed TO P.set_fraction\nROUTE P.value_changed TO X.set_translation\n");
    ::setenv("ALSOFT_CONF", settings.c_str(), 1);
    const Outcome outcome = Program({"listen", scene, "--live", "--for", "0.5s"}, folder_ / "live").wait();
    ::unsetenv("ALSOFT_CONF");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    const std::vector<float> left = leftOf(played);
    ASSERT_GT(left.size(), 4800u);
    EXPECT_LT(*std::ranges::max_element(left), 1e-3f);
}

}  // namespace
}  // namespace rtsg
