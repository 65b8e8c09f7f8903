// A user's pointer and keys, from the command line: a door that is touched opens, in runs, logs, replays and mirrors.
#include "program.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

class PointedDoor : public CommandLine {
  protected:
    void SetUp() override {
        writeFile(file, R"(#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 1.6 4 }
DEF DOOR Transform { translation 0 1 0 center -.45 0 0 children [
  DEF TOUCH TouchSensor { description "a door" }
  Shape { geometry Box { size .9 2 .04 } }
] }
DEF OPENING TimeSensor { cycleInterval 1 startTime -10 }
DEF SWING OrientationInterpolator { key [ 0 1 ] keyValue [ 0 -1 0 0, 0 -1 0 1.4 ] }
DEF FIELD StringSensor { }
ROUTE TOUCH.touchTime TO OPENING.startTime
ROUTE OPENING.fraction_changed TO SWING.set_fraction
ROUTE SWING.value_changed TO DOOR.rotation
)");
    }
    /// The last angle of DOOR.rotation in the output; 0 if there is none.
    static double angle(const std::string& out) {
        double found = 0;
        std::istringstream lines(out);
        for (std::string line; std::getline(lines, line);) {
            const json event = json::parse(line);
            if (event.at("node") == "DOOR") found = event.at("value").at(3);
        }
        return found;
    }
    std::string run(std::vector<std::string> more, int status = 0) {
        std::vector<std::string> arguments{"run", file, "--for", "2s", "--fps", "20", "--watch", "DOOR.rotation"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, status) << outcome.err;
        return status == 0 ? outcome.out : outcome.err;
    }
};

TEST_F(PointedDoor, OpensWhenItIsClicked) {
    EXPECT_NEAR(angle(run({"--set", "pointer=down 0 1 5 0 0 -1@0.5", "--set", "pointer=up@0.6"})), 1.4, 1e-5);
    EXPECT_NEAR(angle(run({"--set", "pointer=down .5 .6@0.5", "--set", "pointer=up@0.6"})), 1.4, 1e-5)
        << "a place in the picture: the eye is at 1.6 m and looks ahead, the door is 2 m high";
    EXPECT_NEAR(angle(run({"--set", "pointer=down .5 .6 1@0.5", "--set", "pointer=up@0.5"})), 1.4, 1e-5);
    EXPECT_EQ(angle(run({"--set", "pointer=down 3 1 5 0 0 -1@0.5", "--set", "pointer=up@0.6"})), 0) << "beside it";
    EXPECT_EQ(angle(run({"--set", "pointer=down .5 .6@0.5", "--set", "pointer=up leave@0.6"})), 0)
        << "let go elsewhere";
    EXPECT_EQ(angle(run({})), 0);
}

TEST_F(PointedDoor, IsPicturedFromTheWorldThatItsPointerMeets) {
    // The first pointer comes before there are pictures: what was built for it serves them.
    for (const std::string live : {"", "--live"}) {
        std::vector<std::string> arguments{"run",      file,
                                           "--for",    "0.4s",
                                           "--fps",    "10",
                                           "--set",    "pointer=.5 .6@0",
                                           "--set",    "pointer=down .5 .6@0.2",
                                           "--render", folder / "p%d.png",
                                           "--size",   "8x6",
                                           "--listen", folder / "p.wav",
                                           "--json",   "--force"};
        if (!live.empty()) arguments.push_back(live);
        const Outcome outcome = rtsg(arguments);
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        const json report = json::parse(outcome.out);
        EXPECT_EQ(report.at("worlds"), 1) << live;
        EXPECT_EQ(report.at("flattenings"), 1) << live;
    }
}

TEST_F(PointedDoor, OpensInLogsThatAreRerunWithoutGeometry) {
    const std::string log = folder / "door.rlog";
    for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--inputs"}, {"--mode", "input"}}) {
        std::vector<std::string> arguments{"record",
                                           file,
                                           "-o",
                                           log,
                                           "--for",
                                           "2s",
                                           "--fps",
                                           "20",
                                           "--force",
                                           "--set",
                                           "pointer=down .5 .6@0.5",
                                           "--set",
                                           "pointer=up@0.6"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        ASSERT_EQ(rtsg(arguments).status, 0);
        const Outcome verified = rtsg({"replay", log, "--verify", "--save", folder / "end.x3dv", "--force"});
        EXPECT_EQ(verified.status, 0) << verified.err;
        EXPECT_THAT(readFile(folder / "end.x3dv"), HasSubstr("1.4")) << testing::PrintToString(more);
    }
    const Outcome again = rtsg({"replay", log, "--rerun", file});
    EXPECT_EQ(again.status, 0) << again.err << again.out;
}

TEST_F(PointedDoor, OpensForAPeer) {
    Program server({"serve", file, "--for", "20s", "--bind", "ipc://" + folder / "s", "--upstream", "events"},
                   streams());
    server.firstLine();
    const Outcome mirrored = rtsg({"mirror", "ipc://" + folder / "s", "--for", "3s", "--set", "pointer=down .5 .6@0.3",
                                   "--set", "pointer=up@0.5", "--save", folder / "m.x3dv", "--json"});
    EXPECT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_THAT(readFile(folder / "m.x3dv"), HasSubstr("1.4"));
    server.signal(SIGINT);
    server.wait();
}

TEST_F(PointedDoor, KeysAndTextsComeInToo) {
    const Outcome outcome = rtsg({"run", file, "--for", "1s", "--fps", "20", "--watch", "FIELD.*", "--set", "key=a@0.1",
                                  "--set", "text= b\\nc@0.2", "--set", "key=SHIFT@0.3", "--set", "wheel=0 -1@0.4",
                                  "--set", "head=0 1.7 0 0 1 0 .1@0.4"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    std::vector<std::string> events;
    std::istringstream lines(outcome.out);
    for (std::string line; std::getline(lines, line);) {
        const json event = json::parse(line);
        events.push_back(event.at("field").get<std::string>() + " " + event.at("value").dump());
    }
    // Active while a text is being typed (21.4.2).
    EXPECT_THAT(events, ElementsAre("isActive true", "enteredText \"a\"", "isActive false", "finalText \"a b\"",
                                    "isActive true", "enteredText \"c\""));
}

TEST_F(PointedDoor, WhatNoDeviceDoesIsNamed) {
    for (const auto& [what, says] : std::initializer_list<std::pair<const char*, const char*>>{
             {"pointer=down@1", "X Y Z DX DY DZ"},
             {"pointer=64: 1 1@1", "0 to 63"},
             {"pointer=1 2 3 4@1", "X Y Z DX DY DZ"},
             {"pointer=sideways@1", "in the picture, from 0 (left, top) to 1"},
             {"pointer=48,36@1", "X Y [ASPECT] in the picture"},
             {"wheel=down@1", "its steps X Y"},
             {"head=0 1.7 0@1", "a rotation AX AY AZ RADIANS"},
             {"key=NOKEY@1", "is no key"},
             {"key=press a@1", "[down|up] NAME"},
             {"wheel=1@1", "2 numbers"},
             {"head=1@1", "7 numbers"},
             {"pointer=1 1", "WHAT@TIME"}})
        EXPECT_THAT(run({"--set", what}, 2), HasSubstr(says)) << what;
}

}  // namespace
}  // namespace rtsg::test
