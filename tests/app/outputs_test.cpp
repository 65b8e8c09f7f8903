// Pictures and sound of `run`, `replay` and `mirror`: the same of the same instants whichever verb makes them, which
// states they are of, and what --live makes of the newest ones.
#include "program.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

/// A box that moves all the time, a tone, and at .5 s an Inline that puts another box and tone beside them.
class OutputFiles : public CommandLine {
  protected:
    void SetUp() override {
        beginsAtZero = true;
        writeFile(folder / "part.x3dv",
                  "#X3D V4.0 utf8\nPROFILE Immersive\n"
                  "Shape { appearance Appearance { material Material { emissiveColor 1 1 0 } } geometry Sphere { } }\n"
                  "Sound { maxFront 50 maxBack 50 source OscillatorSource { frequency 660 } }\n");
        writeFile(file, R"(#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 0 6 }
DEF BOX Transform { children Shape { appearance Appearance { material Material { } } geometry Box { } } }
Sound { location 0 3 0 maxFront 50 maxBack 50 source OscillatorSource { frequency 440 } }
DEF LATER Inline { load FALSE url "part.x3dv" }
DEF CLOCK TimeSensor { cycleInterval 1000 loop TRUE }
DEF WHEN BooleanSequencer { key [ 0 0.0005 ] keyValue [ FALSE TRUE ] }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 2000 0 0 ] }
ROUTE CLOCK.fraction_changed TO WHEN.set_fraction
ROUTE WHEN.value_changed TO LATER.set_load
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BOX.set_translation
)");
    }
    /// Runs a verb that makes NAME0.png … and NAME.wav, ten pictures a second, and returns what it says.
    json make(std::vector<std::string> verb, const std::string& name, const std::vector<std::string>& more = {}) {
        for (const std::string& one :
             {std::string("--for"), std::string("1s"), std::string("--fps"), std::string("10"), std::string("--render"),
              folder / (name + "%d.png"), std::string("--listen"), folder / (name + ".wav"), std::string("--size"),
              std::string("16x9"), std::string("--rays"), std::string("50"), std::string("--json")})
            verb.push_back(one);
        verb.insert(verb.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(verb);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return json::parse(lastLine(outcome.out), nullptr, false);
    }
    std::string bytes(const std::string& name) { return pictureIn(folder / name); }
    void expectSameFiles(const std::string& a, const std::string& b) {
        for (int k = 0; k < 10; ++k) {
            const std::string picture = std::to_string(k) + ".png";
            EXPECT_EQ(bytes(a + picture), bytes(b + picture)) << b << picture;
        }
        EXPECT_EQ(bytes(a + ".wav"), bytes(b + ".wav")) << b;
    }
    double seconds(const std::string& wav) {  // 24-bit stereo at 48 kHz
        const std::string all = bytes(wav);
        std::uint32_t size = 0;
        std::memcpy(&size, all.data() + all.find("data") + 4, 4);
        return size / 6 / 48000.;
    }
    /// A server leaves out frames that there was no time for, and then pictures are others: it is asked again.
    json mirror(const std::string& name, std::vector<std::string> more = {}) {
        const std::string endpoint = "ipc://" + folder / "s";
        more.insert(more.end(), {"--base", folder / "", "--force"});
        json report;
        for (int attempt = 0; attempt < 5; ++attempt) {
            Program server(atZero({"serve", file, "--for", "1.5s", "--fps", "10", "--bind", endpoint, "--await", "1",
                                   "--linger", "60s", "--json"}),
                           streams());
            server.firstLine();
            report = make({"mirror", endpoint}, name, more);
            const Outcome served = server.wait();
            EXPECT_EQ(served.status, 0) << served.err;
            if (json::parse(lastLine(served.out)).at("frames") == 16) break;
        }
        return report;
    }
};

// A picture of the end is the last of many, and nothing is made of what goes before it.
TEST_F(OutputFiles, OfTheEndTakeGeometryOfTheEndAlone) {
    const auto run = [&](const std::string& duration, const std::string& picture) {
        const Outcome created = rtsg(
            {"run", file, "--for", duration, "--fps", "10", "--render", folder / picture, "--size", "16x9", "--json"});
        EXPECT_EQ(created.status, 0) << created.err;
        return json::parse(lastLine(created.out), nullptr, false);
    };
    const json many = run("1.1s", "many%d.png"), report = run("1s", "one.png");
    EXPECT_GT(many.at("commits"), 10);
    EXPECT_LE(report.at("commits"), 1);
    EXPECT_EQ(report.at("pictures"), 1);
    EXPECT_EQ(bytes("one.png"), bytes("many10.png"));
    EXPECT_NE(bytes("one.png"), bytes("many0.png"));
}

TEST_F(OutputFiles, AreTheSameInRunReplayAndMirrorAlsoWhereAnInlineLoads) {
    const json run = make({"run", file}, "a");
    ASSERT_EQ(rtsg({"record", file, "-o", folder / "s.rlog", "--for", "1s", "--fps", "10"}).status, 0);
    const json replay = make({"replay", folder / "s.rlog"}, "b");
    const json mirrored = mirror("c", {"--record", folder / "c.rlog"});
    expectSameFiles("a", "b");
    expectSameFiles("a", "c");
    EXPECT_NE(bytes("a4.png"), bytes("a5.png"));
    EXPECT_DOUBLE_EQ(seconds("a.wav"), 1);
    // State 2 is the first frame; what the Inline brings is one more state of the instant .5 s, and the one shown.
    const json states = {2, 3, 4, 5, 6, 8, 9, 10, 11, 12};
    for (const json& report : {run, replay, mirrored}) {
        EXPECT_EQ(report.at("picture_states"), states);
        EXPECT_EQ(report.at("sound_states"), states);  // picture and sound of one frame are of one state
        EXPECT_TRUE(report.at("missing").is_null());
        EXPECT_EQ(report.at("worlds"), 1);
    }
    // The numbers are those of the log: a replay of what the mirror recorded finds them again.
    EXPECT_EQ(make({"replay", folder / "c.rlog"}, "d").at("picture_states"), states);
    expectSameFiles("a", "d");
}

// States that no picture shows are not tessellated; pictures are the same as if they had been.
TEST_F(OutputFiles, APictureOfALaterTimeIsOfThatStateAlone) {
    const std::string scene = folder / "later.x3dv";
    writeFile(scene,
              "#X3D V4.0 utf8\nPROFILE Full\nDEF T Transform { scale 1 0 0 children Shape { geometry Sphere { } } }\n"
              "ParticleSystem { emitter PointEmitter { speed 1 } geometryType \"QUAD\" particleSize .3 .3 }\n");
    const std::vector<std::string> more{"--set", "T.scale=1 1 1@0.5", "--size", "40x30"};
    const auto with = [&](std::vector<std::string> arguments) {
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return outcome.err;
    };
    EXPECT_THAT(with({"run", scene, "--for", "1s", "--fps", "10", "--render", folder / "each%d.png"}),
                HasSubstr("is not traced"));
    EXPECT_EQ(with({"run", scene, "--for", "1s", "--render", folder / "run.png"}), "");
    EXPECT_EQ(with({"render", scene, "--time", "1s", "-o", folder / "late.png"}), "");
    EXPECT_EQ(bytes("run.png"), bytes("late.png"));
}

// The box goes .2 m between two pictures. The first one has none before it; a single one is told of a time before.
TEST_F(OutputFiles, AShutterBlursThemAlikeWhicheverVerbMakesThem) {
    const std::vector<std::string> shutter{"--shutter", "1"};
    make({"run", file}, "sharp");
    make({"run", file}, "a", shutter);
    ASSERT_EQ(rtsg({"record", file, "-o", folder / "s.rlog", "--for", "1s", "--fps", "10"}).status, 0);
    make({"replay", folder / "s.rlog"}, "b", shutter);
    mirror("c", shutter);
    expectSameFiles("a", "b");
    expectSameFiles("a", "c");
    EXPECT_EQ(bytes("a0.png"), bytes("sharp0.png"));
    EXPECT_NE(bytes("a1.png"), bytes("sharp1.png"));
    const auto render = [&](const char* name, std::vector<std::string> more) {
        more.insert(more.begin(), {"render", file, "-o", folder / name, "--size", "16x9", "--fps", "10"});
        const Outcome outcome = rtsg(more);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
    };
    render("d%d.png", {"--frames", "4", "--shutter", "1"});
    for (const char* picture : {"0.png", "1.png", "2.png", "3.png"})
        EXPECT_EQ(bytes(std::string("a") + picture), bytes(std::string("d") + picture)) << picture;
    render("one.png", {"--time", ".25", "--shutter", "1"});
    render("sharp.png", {"--time", ".25"});
    EXPECT_NE(bytes("one.png"), bytes("sharp.png"));
    EXPECT_NE(bytes("one.png"), "");
}

TEST_F(OutputFiles, OfATestReplayAreThoseOfTheReplay) {
    const std::string log = folder / "s.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.9s", "--fps", "10"}).status, 0);
    ASSERT_EQ(rtsg({"replay", log, "--render", folder / "a%d.png", "--fps", "10", "--listen", folder / "a.wav",
                    "--size", "16x9", "--rays", "50"})
                  .status,
              0);
    const Outcome tested = rtsg({"replay", log, "--rerun", file, "--render", folder / "b%d.png", "--fps", "10",
                                 "--listen", folder / "b.wav", "--size", "16x9", "--rays", "50"});
    ASSERT_EQ(tested.status, 0) << tested.err;
    expectSameFiles("a", "b");
}

TEST_F(OutputFiles, OfOneFrameAreMadeWhileTheNextRuns) {
    // Each picture takes many times as long as a frame's cascade, so that is over long before.
    const auto slow = [&](std::vector<std::string> verb) {
        verb.insert(verb.end(),
                    {"--render", folder / "p%d.png", "--fps", "10", "--size", "320x180", "--spp", "4", "--json"});
        const Outcome outcome = rtsg(verb);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return json::parse(outcome.out);
    };
    EXPECT_GE(slow({"run", file, "--for", "0.9s"}).at("overlapped"), 5);
    ASSERT_EQ(rtsg({"record", file, "-o", folder / "s.rlog", "--for", "0.9s", "--fps", "10"}).status, 0);
    EXPECT_GE(slow({"replay", folder / "s.rlog"}).at("overlapped"), 5);
}

TEST_F(OutputFiles, SayBySoMuchThatLoudSoundIsSofter) {
    writeFile(file,
              "#X3D V4.0 utf8\nPROFILE Full\nDEF OUT AudioDestination { gain 2 children OscillatorSource { } }\n");
    const std::string wav = folder / "loud.wav", said = "note: the sound exceeded -1 dBFS: all of it is 7.0 dB softer";
    EXPECT_THAT(rtsg({"listen", file, "-o", wav, "--for", ".1s"}).err, HasSubstr(said));
    EXPECT_THAT(rtsg({"run", file, "--listen", wav, "--for", ".1s"}).err, HasSubstr(said));
    EXPECT_EQ(rtsg({"run", file, "--listen", wav, "--for", ".1s", "--set", "OUT.gain=.8@0"}).err, "");
}

TEST_F(OutputFiles, AFilmHasTheSoundThatGoesIntoIt) {
    const std::string film = folder / "film.mp4";
    for (const bool live : {false, true}) {
        std::vector<std::string> run{"run",      file, "--for",  "1s",   "--fps",  "10", "--render", film,
                                     "--listen", film, "--size", "16x8", "--rays", "50", "--json"};
        if (live) run.push_back("--live");
        const Outcome created = rtsg(run);
        ASSERT_EQ(created.status, 0) << created.err;
        EXPECT_DOUBLE_EQ(json::parse(lastLine(created.out)).at("sound_seconds").get<double>(), 1);
        const std::string player = folder / "player.x3dv";
        writeFile(
            player,
            "#X3D V4.0 utf8\nPROFILE Full\nSound { spatialize FALSE maxFront 50 maxBack 50 source AudioClip { url "
            "\"film.mp4\" startTime 0 stopTime -1 } }\n");
        const Outcome heard = rtsg(atZero({"listen", player, "-o", folder / "heard.wav", "--for", "1s", "--json"}));
        ASSERT_EQ(heard.status, 0) << heard.err;
        EXPECT_EQ(heard.err, "");
        const std::string wav = bytes("heard.wav");
        int peak = 0;
        for (std::size_t at = wav.find("data") + 10; at < wav.size(); at += 3)
            peak = std::max(peak, std::abs(static_cast<signed char>(wav[at])));
        EXPECT_GT(peak, 20) << "of 127";
        std::filesystem::remove(film);
    }
}

TEST_F(OutputFiles, SoundGoesIntoNoFilmButThatOfThePictures) {
    const std::string film = folder / "film.mp4";
    const auto refused = [&](std::vector<std::string> more) {
        std::vector<std::string> run{"run", file, "--for", "1s", "--fps", "10", "--listen", film, "--size", "16x8"};
        run.insert(run.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(run);
        EXPECT_EQ(outcome.status, 2);
        EXPECT_FALSE(std::filesystem::exists(film));
        return outcome.err;
    };
    EXPECT_THAT(refused({}), HasSubstr("the film of --render"));
    EXPECT_THAT(refused({"--render", folder / "other.mp4"}), HasSubstr("the film of --render"));
    EXPECT_THAT(refused({"--render", film, "--ambisonic", "1"}), HasSubstr("--ambisonic"));
    EXPECT_THAT(refused({"--render", film, "--save", film}), HasSubstr("--save"));
}

/// Files are told apart as files, however they are written.
TEST_F(OutputFiles, AFilmIsThatOfThePicturesByWhateverNameItHas) {
    std::filesystem::create_directory(std::filesystem::path(folder / "sub"));
    std::filesystem::create_directory_symlink(".", std::filesystem::path(folder / "here"));
    for (const char* other : {"sub/../film.mp4", "./film.mp4", "here/film.mp4"}) {
        const Outcome created = rtsg({"run", file, "--for", ".5s", "--fps", "10", "--render", folder / other,
                                      "--listen", folder / "film.mp4", "--size", "16x8", "--rays", "50", "--json"});
        ASSERT_EQ(created.status, 0) << other << created.err;
        EXPECT_DOUBLE_EQ(json::parse(lastLine(created.out)).at("sound_seconds").get<double>(), .5) << other;
        EXPECT_THAT(bytes("film.mp4"), HasSubstr("soun")) << "its track of sound";
    }
}

/// A name that nothing has costs no run: it is told before the first frame, unless the viewpoint may come yet.
TEST_F(OutputFiles, AViewpointThatIsNotThereIsToldAtTheStart) {
    const std::string plain = folder / "views.x3dv", scripted = folder / "scripted.x3dv",
                      text =
                          "#X3D V4.0 utf8\nPROFILE Full\nDEF V Viewpoint { description \"by the door\" }\nShape { "
                          "geometry Box { } }\n";
    writeFile(plain, text);
    writeFile(scripted, text +
                            "DEF G Group { }\nScript { directOutput TRUE field SFNode group USE G url \"ecmascript: "
                            "function initialize() { group.children = new MFNode(Browser.currentScene.createNode("
                            "'Viewpoint')); group.children[0].description = 'LATE'; }\" }\n");
    const std::string picture = folder / "view.png";
    const auto run = [&](const std::string& scene, const std::string& name, std::vector<std::string> more = {}) {
        std::vector<std::string> all{"run",    scene, "--for",  "2s",          "--render", picture,
                                     "--size", "8x8", "--hash", "--viewpoint", name};
        all.insert(all.end(), more.begin(), more.end());
        return rtsg(all);
    };
    for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--live"}}) {
        const Outcome none = run(plain, "NOPE", more);
        EXPECT_EQ(none.status, 1);
        EXPECT_EQ(none.out, "") << "no frame";
        EXPECT_THAT(none.err, HasSubstr("no viewpoint is called \"NOPE\"; there are: \"V\""));
        EXPECT_FALSE(std::filesystem::exists(picture));
    }
    for (const char* known : {"V", "by the door"}) EXPECT_EQ(run(plain, known).status, 0) << known;
    const Outcome late = run(scripted, "LATE"), never = run(scripted, "NOPE");
    EXPECT_EQ(late.status, 0) << late.err;
    EXPECT_THAT(late.err, HasSubstr("note: no viewpoint is called \"LATE\" as yet"));
    EXPECT_EQ(never.status, 1);
    EXPECT_THAT(never.err, HasSubstr("no viewpoint is called \"NOPE\"; there are: \"V\", \"LATE\""));
}

TEST_F(OutputFiles, WithoutSoundNameNoStateOfIt) {
    const Outcome outcome =
        rtsg({"run", file, "--for", "0.2s", "--fps", "10", "--render", folder / "p%d.png", "--size", "8x8", "--json"});
    const json report = json::parse(outcome.out);
    EXPECT_EQ(report.at("picture_states"), json({2, 3}));
    EXPECT_EQ(report.at("sound_states"), json({0, 0}));
    EXPECT_EQ(report.at("picture_times"), json({0.0, 0.1}));
    EXPECT_EQ(report.at("picture_samples"), json({4, 4}));
    EXPECT_FALSE(report.contains("live"));
}

/// --live: what is made is of some states, each whole; how many were merged is said.
class LiveOutputsOf : public OutputFiles {
  protected:
    void expectConsistent(const json& report, const std::string& name, std::uint64_t states) {
        const json& live = report.at("live");
        EXPECT_EQ(live.at("states"), states);
        const auto pictured = report.at("picture_states").get<std::vector<std::uint64_t>>();
        const auto heard = report.at("sound_states").get<std::vector<std::uint64_t>>();
        const auto times = report.at("picture_times").get<std::vector<double>>();
        ASSERT_GE(pictured.size(), 1u);
        EXPECT_EQ(report.at("pictures"), pictured.size());
        EXPECT_EQ(live.at("states_pictured"), pictured.size());
        EXPECT_EQ(pictured.size() + live.at("pictures_skipped").get<std::size_t>(), 10u);
        EXPECT_EQ(std::set(pictured.begin(), pictured.end()).size(), pictured.size());  // none twice
        EXPECT_GE(live.at("states_heard"), 1);
        EXPECT_LE(live.at("states_heard"), states);
        EXPECT_DOUBLE_EQ(seconds(name + ".wav"), 1);
        EXPECT_FALSE(std::filesystem::exists(folder / (name + std::to_string(pictured.size()) + ".png")));
        for (std::size_t k = 0; k < pictured.size(); ++k) {
            // The picture shows the last state of that time: the loaded one and that of the first frame are both at 0
            // s, the Inline's two states at .5 s.
            const bool two = std::abs(times[k] - .5) < 1e-4 || std::abs(times[k]) < 1e-4;
            EXPECT_GE(heard[k], pictured[k] - (two ? 1 : 0)) << k;
            const std::string picture = bytes(name + std::to_string(k) + ".png");
            const auto instant = static_cast<std::size_t>(std::lround(times[k] * 10));
            if (instant > 9) continue;  // the machine was so busy that its first picture came after the end
            const bool before = std::abs(times[k] - .5) < 1e-4 && pictured[k] == 7;  // as it was without the Inline
            EXPECT_EQ(picture == bytes("a" + std::to_string(instant) + ".png"), !before) << k << " at " << times[k];
        }
    }
};

TEST_F(LiveOutputsOf, RunReplayAndMirrorAreOfWholeStates) {
    make({"run", file}, "a");  // those of every instant, to compare with
    const auto start = std::chrono::steady_clock::now();
    expectConsistent(make({"run", file}, "b", {"--live"}), "b", 12);
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::seconds(1)) << "one second a second";
    ASSERT_EQ(rtsg({"record", file, "-o", folder / "s.rlog", "--for", "1s", "--fps", "10"}).status, 0);
    const auto replayed = std::chrono::steady_clock::now();
    expectConsistent(make({"replay", folder / "s.rlog"}, "c", {"--live"}), "c", 13);
    EXPECT_GE(std::chrono::steady_clock::now() - replayed, std::chrono::seconds(1));
    const json mirrored = mirror("d", {"--live"});
    expectConsistent(mirrored, "d", mirrored.at("live").at("states"));
    EXPECT_EQ(mirrored.at("equal"), true);
}

TEST_F(LiveOutputsOf, ASlowPictureHoldsUpNeitherTheSceneNorTheSound) {
    // Each picture takes far longer than a frame: most are skipped, no state of the scene is, and all of the sound is
    // there.
    const Outcome outcome =
        rtsg({"run", file, "--for", "1s", "--fps", "100", "--live", "--render", folder / "p%d.png", "--size",
              "1280x720", "--spp", "64", "--listen", folder / "p.wav", "--rays", "50", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json report = json::parse(outcome.out);
    EXPECT_EQ(report.at("frames"), 101);
    EXPECT_GE(report.at("pictures"), 1);
    EXPECT_EQ(report.at("pictures").get<int>() + report.at("live").at("pictures_skipped").get<int>(), 100);
    EXPECT_LE(report.at("pictures"), 30);
    EXPECT_GT(report.at("live").at("states_heard"), report.at("pictures"));
    EXPECT_DOUBLE_EQ(seconds("p.wav"), 1);
    EXPECT_EQ(report.at("flattenings"), 1);
    EXPECT_EQ(report.at("worlds"), 1);
}

// A still picture by paths gets better with time, filtered or not, and says how many samples it has.
TEST_F(LiveOutputsOf, PicturesByPathsGoOnAddingSamples) {
    writeFile(folder / "still.x3dv",
              "#X3D V4.0 utf8\nPROFILE Immersive\nBackground { skyColor .6 .7 .9 }\nViewpoint { position 0 1 5 }\n"
              "NavigationInfo { headlight FALSE }\n"
              "Transform { translation 0 -1.1 0 children Shape { appearance Appearance { material Material { } } "
              "geometry Box { size 9 .2 9 } } }\n"
              "Shape { appearance Appearance { material Material { diffuseColor .8 .4 .2 } } geometry Sphere { } }\n");
    for (const bool filtered : {false, true}) {
        const std::string name = filtered ? "f" : "n";
        std::vector<std::string> run{"run",
                                     folder / "still.x3dv",
                                     "--for",
                                     "1s",
                                     "--fps",
                                     "10",
                                     "--live",
                                     "--integrator",
                                     "path",
                                     "--spp",
                                     "2",
                                     "--render",
                                     folder / (name + "%d.png"),
                                     "--size",
                                     "32x18",
                                     "--json"};
        if (filtered) run.push_back("--denoise");
        const Outcome outcome = rtsg(run);
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        const auto samples = json::parse(outcome.out).at("picture_samples").get<std::vector<double>>();
        ASSERT_GE(samples.size(), 3u);
        for (std::size_t k = 0; k < samples.size(); ++k) EXPECT_EQ(samples[k], 2. * (double(k) + 1));
        EXPECT_NE(bytes(name + "0.png"), bytes(name + "1.png"));
    }
}

TEST_F(LiveOutputsOf, OnePictureIsOfTheLastState) {
    ASSERT_EQ(rtsg({"render", file, "--time", "0.3", "-o", folder / "d.png", "--size", "16x9"}).status, 0);
    const Outcome outcome = rtsg({"run", file, "--for", "0.3s", "--fps", "10", "--live", "--render", folder / "p.png",
                                  "--size", "16x9", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(bytes("p.png"), bytes("d.png"));
    EXPECT_EQ(json::parse(outcome.out).at("picture_states"), json({5}));
}

TEST_F(LiveOutputsOf, AnAnimationKeepsItsTime) {
    const Outcome outcome = rtsg({"run", file, "--for", "1s", "--fps", "50", "--live", "--render", folder / "p.gif",
                                  "--size", "320x180", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json report = json::parse(outcome.out);
    const std::string gif = bytes("p.gif");
    std::size_t frames = 0;  // each begins with a graphic control extension
    for (auto at = gif.find(std::string("\x21\xf9\x04", 3)); at != gif.npos;
         at = gif.find(std::string("\x21\xf9\x04", 3), at + 1))
        ++frames;
    EXPECT_EQ(frames,
              report.at("pictures").get<std::size_t>() + report.at("live").at("pictures_skipped").get<std::size_t>());
}

/// With one sample a pixel, noise does not compress and smooth parts do; the option is for nothing else.
TEST_F(OutputFiles, LivePicturesAreDenoisedIfAsked) {
    writeFile(file,
              "#X3D V4.0 utf8\nPROFILE Immersive\nNavigationInfo { headlight FALSE } Viewpoint { position 0 0 3 } "
              "Background { "
              "skyColor [ 1 1 1, 0 0 0 ] skyAngle 1.57 }\nShape { appearance Appearance { material Material { "
              "diffuseColor 1 1 1 } "
              "} geometry Rectangle2D { size 9 9 } }\n");
    const auto sizeOf = [&](const char* name, std::vector<std::string> more) {
        std::vector<std::string> words{"run",   file,           "--for",    "0.2s",        "--fps",
                                       "5",     "--live",       "--render", folder / name, "--size",
                                       "64x48", "--integrator", "path",     "--spp",       "1"};
        std::ranges::move(more, std::back_inserter(words));
        const Outcome outcome = rtsg(words);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return bytes(name).size();
    };
    const std::size_t plain = sizeOf("plain.png", {}), filtered = sizeOf("filtered.png", {"--denoise"});
    EXPECT_GT(filtered, 100u);
    EXPECT_LT(filtered, plain * 7 / 10);
    for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--integrator", "path"},
                                                  {"--live"},
                                                  {"--live", "--integrator", "path", "--error", ".1"},
                                                  {"--live", "--integrator", "path", "--shutter", ".5"}}) {
        std::vector<std::string> words{"run", file, "--for", "0.1s", "--render", folder / "w.png", "--denoise"};
        words.insert(words.end(), wrong.begin(), wrong.end());
        const Outcome outcome = rtsg(words);
        EXPECT_EQ(outcome.status, 2);
        EXPECT_THAT(outcome.err, HasSubstr("--denoise"));
    }
}

TEST_F(LiveOutputsOf, WhatFailsEndsTheVerbAndIsSaidOnce) {
    const Outcome outcome = rtsg({"run", file, "--for", "60min", "--fps", "10", "--live", "--render",
                                  folder / "no/such/%d.png", "--size", "8x8", "--json"});
    EXPECT_EQ(outcome.status, 1);
    const auto first = outcome.err.find("No such file or directory");
    ASSERT_NE(first, outcome.err.npos) << outcome.err;
    EXPECT_EQ(outcome.err.find("No such file or directory", first + 1), outcome.err.npos) << outcome.err;
}

TEST_F(LiveOutputsOf, OnesThatAreThereAreKeptWhenInterrupted) {
    Program program({"run", file, "--for", "60min", "--fps", "10", "--live", "--render", folder / "p%d.png", "--size",
                     "8x8", "--listen", folder / "p.wav", "--rays", "50", "--json"},
                    streams());
    while (!std::filesystem::exists(folder / "p2.png")) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    program.signal(SIGINT);
    const Outcome outcome = program.wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("interrupted after"));
    EXPECT_THAT(outcome.err, HasSubstr("s of sound"));
    EXPECT_GE(json::parse(outcome.out).at("pictures"), 3);
    EXPECT_FALSE(std::filesystem::exists(folder / "p.wav")) << "it is not whole";
}

/// --listen device, on OpenAL's back ends that need no hardware.
class SoundOnADevice : public OutputFiles {
  protected:
    void TearDown() override {
        ::unsetenv("ALSOFT_DRIVERS");
        ::unsetenv("ALSOFT_CONF");
    }
    /// OpenAL plays into played.wav.
    void useWaveWriter() {
        writeFile(folder / "alsoft.conf",
                  "[general]\ndrivers=wave\nsample-type=int16\n[wave]\nfile=" + folder / "played.wav" + "\n");
        ::setenv("ALSOFT_CONF", (folder / "alsoft.conf").c_str(), 1);
    }
};

TEST_F(SoundOnADevice, PlaysAMirroredSceneBesideItsPictures) {
    useWaveWriter();
    const std::string endpoint = "ipc://" + folder / "s";
    Program server({"serve", file, "--for", "3s", "--fps", "60", "--bind", endpoint, "--await", "1", "--linger", "60s"},
                   streams());
    server.firstLine();
    const Outcome outcome =
        rtsg({"mirror", endpoint, "--base", folder / "", "--for", "2s", "--listen", "device", "--render",
              folder / "p%d.png", "--fps", "5", "--size", "64x36", "--record", folder / "m.rlog", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(server.wait().status, 0);
    const json report = json::parse(lastLine(outcome.out));
    EXPECT_EQ(report.at("equal"), true);
    EXPECT_EQ(report.at("gaps"), 0);
    EXPECT_EQ(report.at("flattenings"), 1);
    EXPECT_EQ(report.at("worlds"), 1);
    EXPECT_GE(report.at("pictures"), 1);
    const json& device = report.at("live").at("device");
    EXPECT_NE(device.at("name"), "");
    EXPECT_GT(device.at("blocks"), 20);
    EXPECT_GT(device.at("latency_ms"), 0);
    // Tone and all: half of full scale is far more than any rounding.
    const std::string wav = bytes("played.wav");
    int maximum = 0;
    for (std::size_t at = wav.find("data") + 8; at + 1 < wav.size(); at += 2)
        maximum = std::max(maximum,
                           std::abs(static_cast<int>(static_cast<std::int16_t>(
                               static_cast<unsigned char>(wav[at]) | static_cast<unsigned char>(wav[at + 1]) << 8))));
    EXPECT_GT(maximum, 300);
    EXPECT_FALSE(std::filesystem::exists("device"));
    ASSERT_EQ(rtsg({"replay", folder / "m.rlog", "--verify"}).status, 0);
}

TEST_F(SoundOnADevice, PlaysRunsAndReplays) {
    ::setenv("ALSOFT_DRIVERS", "null", 1);
    for (const std::vector<std::string>& verb :
         {std::vector<std::string>{"run", file, "--for", "0.5s"}, {"replay", folder / "s.rlog"}}) {
        if (verb[0] == "replay") {
            ASSERT_EQ(rtsg({"record", file, "-o", folder / "s.rlog", "--for", "0.5s", "--fps", "30"}).status, 0);
        }
        std::vector<std::string> arguments = verb;
        arguments.insert(arguments.end(), {"--listen", "device", "--json"});
        const Outcome outcome = rtsg(arguments);
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_GT(json::parse(outcome.out).at("live").at("device").at("blocks"), 5) << verb[0];
    }
}

TEST_F(SoundOnADevice, ThatIsNotThereIsSaid) {
    ::setenv("ALSOFT_DRIVERS", "null", 1);
    const Outcome missing =
        rtsg({"run", file, "--for", "60min", "--listen", "device", "--device", "no such device", "--json"});
    EXPECT_EQ(missing.status, 1);
    EXPECT_THAT(missing.err, HasSubstr("no such device"));
    const Outcome unasked = rtsg({"run", file, "--device", "a device"});
    EXPECT_EQ(unasked.status, 2);
    EXPECT_THAT(unasked.err, HasSubstr("--listen device"));
}

}  // namespace
}  // namespace rtsg::test
