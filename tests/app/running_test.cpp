// One loop for every verb: Inlines that are loaded while a scene runs, what is reported of it, and pictures and sound
// of `rtsg run`.
#include "program.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

std::size_t count(const std::string& text, const std::string& part) {
    std::size_t n = 0;
    for (auto at = text.find(part); at != text.npos; at = text.find(part, at + 1)) ++n;
    return n;
}

/// A scene whose box and tone are in another file, which is loaded at .5 s.
class LateInline : public CommandLine {
  protected:
    static constexpr const char* kPart =
        "#X3D V4.0 utf8\nPROFILE Immersive\n"
        "DEF THING Shape { appearance Appearance { material Material { emissiveColor 1 1 0 } } geometry Box { } }\n"
        "DEF TONE Sound { location 0 3 0 maxFront 50 maxBack 50 source OscillatorSource { frequency 440 } }\n";
    void SetUp() override {
        beginsAtZero = true;
        writeFile(folder / "part.x3dv", kPart);
        writeFile(file, head() + R"(
DEF LATER Inline { load FALSE url "part.x3dv" }
DEF CLOCK TimeSensor { cycleInterval 1000 loop TRUE }
DEF WHEN BooleanSequencer { key [ 0 0.0005 ] keyValue [ FALSE TRUE ] }
ROUTE CLOCK.fraction_changed TO WHEN.set_fraction
ROUTE WHEN.value_changed TO LATER.set_load
)");
        writeFile(folder / "there.x3dv", head() + "Inline { url \"part.x3dv\" }\n");
        writeFile(folder / "never.x3dv", head() + "Inline { load FALSE url \"part.x3dv\" }\n");
        expected = picture("there.x3dv");
        before = picture("never.x3dv");
        ASSERT_NE(expected, before);
    }
    static std::string head() { return "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { position 0 0 6 }\n"; }
    std::string picture(const std::string& scene) {
        const Outcome outcome = rtsg({"render", folder / scene, "-o", folder / "p.png", "--size", "16x9"});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return pictureIn(folder / "p.png");
    }
    std::string expected, before;  // the bytes of a picture
};

TEST_F(LateInline, IsInPicturesOfTheTimeWhenItIsLoaded) {
    for (const auto& [time, bytes] : {std::pair{"0.4", before}, {"0.5", expected}, {"0.9", expected}}) {
        const Outcome outcome = rtsg({"render", file, "-o", folder / "r.png", "--size", "16x9", "--time", time});
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_EQ(pictureIn(folder / "r.png"), bytes) << time;
    }
    // While an animation runs, as well.
    ASSERT_EQ(rtsg({"render", file, "-o", folder / "a%d.png", "--size", "16x9", "--time", "0.4", "--frames", "2",
                    "--fps", "10"})
                  .status,
              0);
    EXPECT_EQ(pictureIn(folder / "a0.png"), before);
    EXPECT_EQ(pictureIn(folder / "a1.png"), expected);
}

TEST_F(LateInline, IsMetByRays) {
    const std::vector<std::string> ray{"pick", file, "--ray", "0", "0", "9", "0", "0", "-1", "--json", "--time"};
    auto early = ray, late = ray;
    early.push_back("0.4");
    late.push_back("0.5");
    EXPECT_EQ(json::parse(rtsg(early).out).at("hit"), false);
    const json hit = json::parse(rtsg(late).out);
    ASSERT_EQ(hit.at("hit"), true);
    EXPECT_DOUBLE_EQ(hit.at("distance_m"), 8);
}

TEST_F(LateInline, IsHeardFromThenOn) {
    const std::string wav = folder / "l.wav";
    const Outcome outcome = rtsg({"listen", file, "-o", wav, "--for", "1s", "--rays", "20"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const std::string bytes = readFile(wav);
    const auto loud = [&](double from, double to) {  // anything but zeros, of 24-bit stereo after the head
        const std::size_t data = bytes.find("data") + 8;
        const auto at = [&](double t) { return data + static_cast<std::size_t>(t * 48000) * 6; };
        return bytes.substr(at(from), at(to) - at(from)).find_first_not_of('\0') != std::string::npos;
    };
    EXPECT_FALSE(loud(0, .45));
    EXPECT_TRUE(loud(.6, .95));
}

TEST_F(LateInline, IsInLogsAndReplays) {
    const std::string log = folder / "a.rlog";
    for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--inputs"}, {"--mode", "input"}}) {
        std::vector<std::string> arguments{"record", file, "-o", log, "--for", "1s", "--fps", "10", "--force"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        ASSERT_EQ(rtsg(arguments).status, 0);
        const Outcome replayed =
            rtsg({"replay", log, "--verify", "--render", folder / "r.png", "--size", "16x9", "--base", folder / ""});
        ASSERT_EQ(replayed.status, 0) << replayed.err;
        EXPECT_EQ(pictureIn(folder / "r.png"), expected) << testing::PrintToString(more);
    }
}

TEST_F(LateInline, IsServedToMirrors) {
    Program server({"serve", file, "--for", "20s", "--bind", "ipc://" + folder / "s"}, streams());
    server.firstLine();
    const Outcome mirrored = rtsg(
        {"mirror", "ipc://" + folder / "s", "--for", "1s", "--render", folder / "m.png", "--size", "16x9", "--json"});
    EXPECT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_EQ(pictureIn(folder / "m.png"), expected);
    server.signal(SIGINT);
    server.wait();
}

TEST_F(LateInline, IsInWhatRunMakes) {
    const Outcome outcome =
        rtsg({"run", file, "--for", "1s", "--fps", "10", "--render", folder / "r%d.png", "--size", "16x9", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    for (int k = 0; k < 10; ++k)
        EXPECT_EQ(pictureIn(folder / ("r" + std::to_string(k) + ".png")), k < 5 ? before : expected) << k;
}

TEST_F(LateInline, ThatIsNotThereIsReportedOnce) {
    std::filesystem::remove(folder / "part.x3dv");
    const std::string said = "Inline: 'part.x3dv' is not there";
    const std::string out = folder / "o";
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"run", file, "--for", "1s"},
             {"record", file, "-o", out + ".rlog", "--for", "1s"},
             {"render", file, "-o", out + ".png", "--size", "8x8", "--time", "1"},
             {"listen", file, "-o", out + ".wav", "--for", "1s", "--rays", "10"},
             {"pick", file, "--point", "0", "0", "0", "--time", "1"},
             {"serve", file, "--for", "700ms", "--linger", "0"},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(count(outcome.err, said), 1u) << arguments.front();
        EXPECT_EQ(count(outcome.err, "had 1 error: this was made of the rest of it"), 1u) << arguments.front();
        EXPECT_EQ(outcome.status, 1) << arguments.front() << ": as where it is not there from the start";
    }
}

class RunOutputs : public CommandLine {
  protected:
    double seconds(const std::string& wav) {  // 24-bit stereo at 48 kHz
        const std::string bytes = readFile(wav);
        const std::size_t data = bytes.find("data");
        std::uint32_t size = 0;
        std::memcpy(&size, bytes.data() + data + 4, 4);
        return size / 6 / 48000.;
    }
    std::size_t pictures() const {
        std::size_t n = 0;
        while (std::filesystem::exists(folder / ("r" + std::to_string(n) + ".png"))) ++n;
        return n;
    }
};

class AwaitedMirrors : public RunOutputs {};

TEST_F(AwaitedMirrors, HaveEveryFrameFromTheStart) {
    const std::string endpoint = "ipc://" + folder / "s";
    Program server(
        atZero({"serve", file, "--for", "1s", "--fps", "20", "--bind", endpoint, "--await", "1", "--linger", "60s"}),
        streams());
    server.firstLine();
    std::this_thread::sleep_for(std::chrono::milliseconds(300));  // without --await a third of it would have gone by
    const Outcome mirrored = rtsg({"mirror", endpoint, "--for", "1s", "--fps", "10", "--render", folder / "r%d.png",
                                   "--size", "16x9", "--listen", folder / "r.wav", "--rays", "50", "--json"});
    EXPECT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_EQ(server.wait().status, 0);
    EXPECT_EQ(pictures(), 10u);
    EXPECT_DOUBLE_EQ(seconds(folder / "r.wav"), 1);
    // The first picture is of the scene's start.
    ASSERT_EQ(rtsg(atZero({"render", file, "-o", folder / "d.png", "--size", "16x9"})).status, 0);
    EXPECT_EQ(pictureIn(folder / "r0.png"), pictureIn(folder / "d.png"));
}

TEST_F(AwaitedMirrors, ThatDoNotComeDoNotKeepTheServerFromEnding) {
    Program server({"serve", file, "--bind", "ipc://" + folder / "s", "--await", "1"}, streams());
    server.firstLine();
    server.signal(SIGINT);
    EXPECT_EQ(server.wait().status, 0);
}

class RecordedFrames : public CommandLine {};

TEST_F(RecordedFrames, AreAllInTheLogHoweverFastTheSceneRuns) {
    const std::string log = folder / "a.rlog";
    const Outcome created = rtsg({"record", file, "-o", log, "--for", "20s", "--fps", "1000", "--json"});
    ASSERT_EQ(created.status, 0) << created.err;
    EXPECT_EQ(json::parse(created.out).at("frames"), 20001);
    const json info = json::parse(rtsg({"info", log, "--json"}).out);
    // The state that was loaded, and each frame: none merged with another.
    EXPECT_EQ(info.at("last_state").get<int>() - info.at("first_state").get<int>(), 20001);
    const json replayed = json::parse(rtsg({"replay", log, "--verify", "--json"}).out);
    EXPECT_EQ(replayed.at("frames"), 20002);
    EXPECT_EQ(replayed.at("verified"), 20002);
}

/// A script that fails in every frame, in words that would turn a terminal red.
class FailingScript : public CommandLine {
  protected:
    void SetUp() override {
        writeFile(file, R"(#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 0 6 }
Shape { geometry Box { } }
DEF CLOCK TimeSensor { cycleInterval 1 loop TRUE }
DEF BAD Script { inputOnly SFFloat tick url "ecmascript: function tick() { throw new Error('no \u001b[31m luck'); }" }
ROUTE CLOCK.fraction_changed TO BAD.tick
)");
    }
    void expectOnce(const std::vector<std::string>& arguments) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(count(outcome.err, "luck"), 1u) << arguments.front() << ": " << outcome.err;
        EXPECT_THAT(outcome.err, HasSubstr("\\x1b[31m")) << arguments.front();
        EXPECT_EQ(outcome.err.find('\033'), std::string::npos) << arguments.front();
    }
};

TEST_F(FailingScript, IsReportedOnceByEveryVerbThatRunsIt) {
    const std::string out = folder / "o";
    expectOnce({"run", file, "--for", "0.2s"});
    expectOnce({"record", file, "-o", out + ".rlog", "--for", "0.2s", "--mode", "input"});
    expectOnce({"render", file, "-o", out + ".png", "--size", "8x8", "--time", "0.2"});
    expectOnce({"listen", file, "-o", out + ".wav", "--for", "0.2s", "--rays", "10"});
    expectOnce({"pick", file, "--point", "0", "0", "0", "--time", "0.2"});
    expectOnce({"serve", file, "--for", "200ms", "--linger", "0"});
    expectOnce({"replay", out + ".rlog", "--rerun", file});
}

TEST_F(FailingScript, OfOutputsIsReportedOnceWhereScenesAreFollowed) {
    const std::string log = folder / "o.rlog", nowhere = folder / "no/such/%d.png", endpoint = "ipc://" + folder / "s";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.2s"}).status, 0);
    Program server({"serve", file, "--for", "20s", "--bind", endpoint}, streams());
    server.firstLine();
    for (const std::vector<std::string>& arguments :
         std::vector<std::vector<std::string>>{{"run", file, "--for", "0.2s"},
                                               {"replay", log},
                                               {"mirror", endpoint, "--for", "0.3s"},
                                               {"mirror", endpoint, "--for", "0.3s", "--live"}}) {
        std::vector<std::string> making = arguments;
        making.insert(making.end(), {"--render", nowhere, "--size", "8x8"});
        const Outcome outcome = rtsg(making);
        EXPECT_EQ(outcome.status, 1) << arguments.front();
        EXPECT_EQ(count(outcome.err, "No such file or directory"), 1u) << arguments.front() << ": " << outcome.err;
        EXPECT_THAT(outcome.err, HasSubstr("no/such/0.png: error: ")) << arguments.front();
    }
    server.signal(SIGINT);
    server.wait();
}

class ControlCharacters : public CommandLine {};

TEST_F(ControlCharacters, OfASceneAreShownAndNotSent) {
    const std::string xml = folder / "c.x3d", csi = "\xc2\x9b";
    writeFile(xml, "<?xml version='1.0' encoding='UTF-8'?>\n<X3D profile='Imm" + csi +
                       "31m' version='4.0'><Scene>\n"
                       "<Shape DEF='RED" +
                       csi + "31m'><Box/></Shape></Scene></X3D>\n");
    const Outcome info = rtsg({"info", xml});
    EXPECT_THAT(info.out, HasSubstr("Imm\\x9b31m"));
    EXPECT_THAT(info.out, Not(HasSubstr(csi)));
    const Outcome pick = rtsg({"pick", xml, "--ray", "0", "0", "9", "0", "0", "-1"});
    EXPECT_THAT(pick.out, HasSubstr("RED\\x9b31m"));
    EXPECT_THAT(pick.out, Not(HasSubstr(csi)));
}

TEST_F(RunOutputs, ArePicturesAtEveryFrameAndAllOfTheSound) {
    const Outcome outcome = rtsg({"run", file, "--for", "0.9s", "--fps", "10", "--render", folder / "r%d.png", "--size",
                                  "16x9", "--listen", folder / "r.wav", "--rays", "50", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json report = json::parse(outcome.out);
    EXPECT_EQ(pictures(), 9u);
    EXPECT_EQ(report.at("pictures"), 9);
    EXPECT_DOUBLE_EQ(seconds(folder / "r.wav"), .9);
    EXPECT_EQ(report.at("worlds"), 1);
    EXPECT_EQ(report.at("flattenings"), 1);
    // Those of `render`, at the same times.
    for (const int k : {0, 4, 8}) {
        ASSERT_EQ(
            rtsg({"render", file, "-o", folder / "d.png", "--size", "16x9", "--time", "0." + std::to_string(k)}).status,
            0);
        EXPECT_EQ(pictureIn(folder / ("r" + std::to_string(k) + ".png")), pictureIn(folder / "d.png")) << k;
    }
}

/// A film of ten pictures and .4 s, whose length no head says, on a square before the eye; it starts at .1 s.
class FilmOnAScreen : public CommandLine {
  protected:
    void SetUp() override {
        std::filesystem::copy_file(RTSG_SOURCE_DIR "/tests/renderers/light/data/film.mpg", folder / "film.mpg");
        writeFile(file,
                  "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 0 2 }\nShape { appearance Appearance { texture "
                  "MovieTexture { url \"film.mpg\" startTime .1 } } geometry Rectangle2D { } }\n");
    }
};

TEST_F(FilmOnAScreen, IsInThePicturesOfItsTime) {
    const std::vector<std::string> options = {"--fps", "10", "--size", "32x16", "--render"};
    const auto with = [&](std::vector<std::string> first, const std::string& pictures) {
        first.insert(first.end(), options.begin(), options.end());
        first.push_back(folder / pictures);
        return rtsg(first);
    };
    const Outcome run = with({"run", file, "--at", "0", "--for", "0.8s"}, "r%d.png");
    ASSERT_EQ(run.status, 0) << run.err;
    const auto picture = [&](int k) { return pictureIn(folder / ("r" + std::to_string(k) + ".png")); };
    EXPECT_EQ(picture(0), picture(1)) << "its first picture until it starts";
    for (const int k : {2, 3, 4}) EXPECT_NE(picture(k), picture(k - 1)) << k;
    EXPECT_EQ(picture(6), picture(5)) << "it has ended";
    EXPECT_NE(picture(5), picture(0));
    // In replays of what was recorded, too.
    ASSERT_EQ(rtsg({"record", file, "-o", folder / "film.rlog", "--at", "0", "--for", "0.8s", "--fps", "10"}).status,
              0);
    const Outcome replay = with({"replay", folder / "film.rlog"}, "s%d.png");
    ASSERT_EQ(replay.status, 0) << replay.err;
    for (const int k : {0, 3, 6}) EXPECT_EQ(pictureIn(folder / ("s" + std::to_string(k) + ".png")), picture(k)) << k;
}

TEST_F(RunOutputs, HaveTheirLengthWhereNoFrameIsAtTheEnd) {
    const Outcome outcome = rtsg({"run", file, "--for", "0.5s", "--fps", "7", "--render", folder / "r%d.png", "--size",
                                  "8x8", "--listen", folder / "r.wav", "--rays", "50"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(pictures(), 4u);  // at 0, 1/7, 2/7, 3/7
    EXPECT_DOUBLE_EQ(seconds(folder / "r.wav"), .5);
}

TEST_F(RunOutputs, ThatCannotBeWrittenAreStatusOne) {
    const Outcome missing =
        rtsg({"run", file, "--for", "0.2s", "--render", folder / "no/such/r%d.png", "--size", "8x8"});
    EXPECT_EQ(missing.status, 1);
    EXPECT_THAT(missing.err, HasSubstr("no/such"));
    EXPECT_EQ(rtsg({"run", file, "--for", "0.2s", "--listen", file}).status, 2);
    EXPECT_EQ(readFile(file), scene());
}

TEST_F(RunOutputs, ThatAreThereAreKeptAndCountedWhenInterrupted) {
    Program program({"run", file, "--for", "60min", "--fps", "10", "--render", folder / "r%d.png", "--size", "8x8",
                     "--listen", folder / "r.wav", "--rays", "50", "--json"},
                    streams());
    while (pictures() < 3) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    program.signal(SIGINT);
    const Outcome outcome = program.wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("interrupted after"));
    EXPECT_THAT(outcome.err, HasSubstr("missing: "));
    EXPECT_EQ(json::parse(outcome.out).at("pictures"), pictures());
    EXPECT_EQ(json::parse(outcome.out).at("sound_seconds"), 0);
    EXPECT_FALSE(std::filesystem::exists(folder / "r.wav")) << "it is not whole";
}

class SizesOfTexts : public CommandLine {};

/// A Text that nobody asks for its size has none: the state then is that of a machine with any fonts, or none.
TEST_F(SizesOfTexts, AreMeasuredForThoseWhoHear) {
    const auto run = [&](const std::string& more, std::vector<std::string> options) {
        writeFile(file, "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry DEF T Text { string \"hello\" } }\n" + more);
        std::vector<std::string> arguments{"run", file, "--for", ".1s", "--json"};
        arguments.insert(arguments.end(), options.begin(), options.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return outcome.out;
    };
    const auto hashOf = [](const std::string& out) {
        return json::parse(out.substr(out.rfind('{'))).at("hash").get<std::string>();
    };
    const std::string silent = hashOf(run("", {}));
    EXPECT_EQ(hashOf(run("", {"--watch", "T.string"})), silent);
    const std::string watched = run("", {"--watch", "T.textBounds"});
    EXPECT_EQ(count(watched, "\"textBounds\""), 1u) << watched;
    EXPECT_NE(hashOf(watched), silent);
    const std::string routed =
        run("DEF M Transform { } ROUTE T.origin TO M.translation\n", {"--watch", "M.translation"});
    EXPECT_EQ(count(routed, "\"M\""), 1u) << routed;
}

}  // namespace
}  // namespace rtsg::test
