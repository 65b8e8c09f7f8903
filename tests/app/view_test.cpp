// rtsg view without a screen: what is seen is what render makes; what cannot be seen is named.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "mirror_session.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class View : public Mirror {
  protected:
    View() { ::setenv("SDL_VIDEODRIVER", "offscreen", 1); }
    ~View() override { ::unsetenv("SDL_VIDEODRIVER"); }
    /// Its summary.
    json view(std::vector<std::string> arguments, int status = 0) {
        arguments.insert(arguments.begin(), "view");
        arguments.insert(arguments.end(), {"--json", "--mute", "--size", "160x90"});
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, status) << outcome.err;
        said = outcome.err;
        return outcome.out.empty() ? json() : json::parse(outcome.out);
    }
    std::string said;
};

TEST_F(View, AScreenshotIsThePictureThatRenderMakes) {
    const std::string still = folder / "still.x3dv";
    writeFile(still,
              "#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearance Appearance { material Material { diffuseColor 1 0 "
              "0 } } geometry Cone { } }\n");
    const json summary = view({still, "--for", "1s", "--screenshot", folder / "a.png"});
    EXPECT_TRUE(summary.at("whole").get<bool>()) << summary;
    EXPECT_GE(summary.at("samples"), 4) << summary;
    EXPECT_LE(summary.at("frames"), 12) << "nothing moves: the scene is left alone: " << summary;
    ASSERT_EQ(rtsg({"render", still, "-o", folder / "b.png", "--size", "160x90"}).status, 0);
    EXPECT_EQ(readFile(folder / "a.png"), readFile(folder / "b.png"));
    // A picture that is there is kept.
    view({still, "--for", "1s", "--screenshot", folder / "a.png"}, 1);
    EXPECT_THAT(said, HasSubstr("--force"));
}

TEST_F(View, WhatIsSetAndPointedAtHappens) {
    const json summary = view({file, "--for", "1s", "--set", "BOX.scale=2 2 2@0.1"});
    EXPECT_GT(summary.at("frames"), 10) << "its clock runs: " << summary;
    EXPECT_GT(summary.at("pictures"), 1) << summary;
}

TEST_F(View, AServedSceneIsFollowed) {
    serve({"--for", "60s"}, "ipc://" + folder / "socket");
    const json summary = view({endpoint, "--for", "3s"});
    EXPECT_GT(summary.at("sequence"), 3) << summary;
    EXPECT_GT(summary.at("pictures"), 1) << summary;
    EXPECT_GT(summary.at("frames"), 20) << "what comes by the connection wakes it: " << summary;
    view({"ipc://" + folder / "nobody", "--wait", "300ms"}, 1);
    EXPECT_THAT(said, HasSubstr("no server for 0.3 s"));
    // One that dies is missed, with the status of something that went wrong.
    Program window({"view", endpoint, "--wait", "1s", "--mute", "--size", "160x90"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(800));
    server->signal(SIGKILL);
    const Outcome ended = window.wait();
    EXPECT_EQ(ended.status, 1);
    EXPECT_THAT(ended.err, HasSubstr("silent"));
}

/// It waits at its connection: between heartbeats and pings nobody is woken.
TEST_F(View, AtRestTheWindowOfAServedSceneWakesSeldom) {
    const std::string still = folder / "still.x3dv";
    writeFile(still, "#X3D V4.0 utf8\nPROFILE Immersive\nShape { geometry Box { } }\n");
    serve({"--for", "90s"}, "ipc://" + folder / "socket", still);
    const auto rotations = [&](const char* duration) {
        return view({endpoint, "--for", duration}).at("frames").get<std::int64_t>();
    };
    const std::int64_t begun = rotations("5s");  // what it takes to get there
    EXPECT_LE(rotations("11s") - begun, 5 * 6);
}

TEST_F(View, ALogIsPlayed) {
    const std::string log = folder / "a.rlog";
    const Outcome created = rtsg({"record", file, "-o", log, "--for", "500ms", "--json"});
    ASSERT_EQ(created.status, 0);
    const json summary = view({log, "--for", "1500ms"});
    EXPECT_EQ(summary.at("hash"), json::parse(created.out).at("hash")) << "to its end: " << summary;
    view({log, "--set", "BOX.scale=2 2 2@0"}, 1);
    EXPECT_THAT(said, HasSubstr("--set goes with a scene's file"));
}

TEST_F(View, AnEditedFileIsFollowedAndOneThatIsBrokenIsNot) {
    const std::string edited = folder / "edited.x3dv";
    const auto write = [&](const char* color) {
        writeFile(edited, fmt::format("#X3D V4.0 utf8\nPROFILE Immersive\nShape {{ appearance Appearance {{ material "
                                      "UnlitMaterial {{ emissiveColor {} }} }} geometry Box {{ size 90 90 1 }} }}\n",
                                      color));
    };
    write("1 0 0");
    Program window(
        {"view", edited, "--reload", "--mute", "--for", "4s", "--size", "16x9", "--screenshot", folder / "d.png"},
        streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(1000));
    write("0 1 0");
    std::this_thread::sleep_for(std::chrono::milliseconds(1000));
    writeFile(edited, "nothing at all");
    const Outcome ended = window.wait();
    EXPECT_EQ(ended.status, 1) << "the file as it is now has not been shown: " << ended.err;
    EXPECT_THAT(ended.err, HasSubstr("edited.x3dv: error: it was edited, and is not followed"));
    write("0 1 0");
    ASSERT_EQ(rtsg({"render", edited, "-o", folder / "e.png", "--size", "16x9"}).status, 0);
    EXPECT_EQ(readFile(folder / "d.png"), readFile(folder / "e.png"));
}

TEST_F(View, WithoutAScreenItSaysSo) {
    ::setenv("SDL_VIDEODRIVER", "x11", 1);
    ::setenv("DISPLAY", ":987", 1);
    view({file, "--for", "1s"}, 1);
    ::unsetenv("DISPLAY");
    EXPECT_THAT(said, HasSubstr("no window can be opened"));
    ::unsetenv("SDL_VIDEODRIVER");
    ::unsetenv("WAYLAND_DISPLAY");
    view({file, "--for", "1s"}, 1);
    EXPECT_THAT(said, HasSubstr("there is no display")) << "nobody looks at one that SDL makes up";
    ::setenv("SDL_VIDEODRIVER", "offscreen", 1);
    view({folder / "nothing.x3d"}, 1);
    EXPECT_THAT(said, HasSubstr("nothing.x3d"));
}

TEST_F(View, CtrlCClosesItInOrder) {
    Program window({"view", file, "--mute", "--json", "--size", "160x90", "--screenshot", folder / "c.png"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(800));
    window.signal(SIGINT);
    const Outcome ended = window.wait();
    EXPECT_EQ(ended.status, 0) << ended.err;
    EXPECT_TRUE(std::filesystem::exists(folder / "c.png"));
    EXPECT_GT(json::parse(ended.out).at("pictures"), 0);
}

TEST_F(View, AHandFeelsWhatIsShown) {
    const std::string table = std::string(RTSG_SOURCE_DIR) + "/examples/touch.x3dv",
                      hand = std::string("sim:") + RTSG_SOURCE_DIR + "/examples/knock.csv";
    const json summary = view({table, "--for", "2s", "--touch", hand});
    EXPECT_GT(summary.at("ticks"), 20) << summary;
    EXPECT_GE(summary.at("contacts"), 1) << "it strokes the stone from half a second on: " << summary;
    view({table, "--for", "1s", "--touch", "hand"}, 2);
    view({table, "--for", "1s", "--touch", "sim:/nowhere.csv"}, 1);
}

}  // namespace
}  // namespace rtsg::test
