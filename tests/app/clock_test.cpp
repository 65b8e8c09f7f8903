// A scene's clock: seconds since 1970, --at, and what counts from the start.
#include "program.h"

#include <chrono>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Clock : public CommandLine {
  protected:
    static constexpr const char* kSimulated = "2000-01-01";  // where simulated time begins
    static constexpr double kSimulatedSeconds = 946684800;
    void SetUp() override {
        writeFile(file, R"(#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 0 6 }
DEF BOX Transform { children Shape { appearance Appearance { material Material { emissiveColor 1 1 0 } } geometry Box { } } }
DEF ONCE TimeSensor { cycleInterval 2 }
DEF LOOP TimeSensor { cycleInterval 2 loop TRUE }
DEF OPEN PositionInterpolator { key [ 0 1 ] keyValue [ 1 0 0, 3 0 0 ] }
DEF TICK TimeTrigger { }
ROUTE ONCE.fraction_changed TO OPEN.set_fraction
ROUTE OPEN.value_changed TO BOX.set_translation
ROUTE TICK.triggerTime TO ONCE.startTime
)");
    }
    std::vector<json> events(std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), {"run", file, "--fps", "10"});
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        std::vector<json> lines;
        std::istringstream in(outcome.out);
        for (std::string line; std::getline(in, line);) lines.push_back(json::parse(line));
        return lines;
    }
    double timeOfFirst(const std::vector<std::string>& at) {
        std::vector<std::string> arguments{"--for", "0s", "--watch", "LOOP.time"};
        arguments.insert(arguments.end(), at.begin(), at.end());
        const std::vector<json> lines = events(arguments);
        return lines.empty() ? -1 : lines.front().at("value").get<double>();
    }
};

TEST_F(Clock, OfSimulationsBeginsAtAFixedDateAndElsewhereIfTold) {
    // Program sets --at 0 where a test says nothing: none at all is what this is about.
    const std::string plain = streams();
    const std::string command = std::string(RTSG_PROGRAM) + " run " + file + " --for 0s --watch LOOP.time > " + plain;
    ASSERT_EQ(std::system(command.c_str()), 0);
    EXPECT_EQ(json::parse(readFile(plain)).at("value"), kSimulatedSeconds);
    EXPECT_EQ(timeOfFirst({"--at", kSimulated}), kSimulatedSeconds);
    EXPECT_EQ(timeOfFirst({"--at", "0"}), 0);
    EXPECT_EQ(timeOfFirst({"--at", "1234.5"}), 1234.5);
    EXPECT_EQ(timeOfFirst({"--at", "1970-01-02T01:02:03.5Z"}), 86400 + 3723.5);
    EXPECT_EQ(timeOfFirst({"--at", "2024-02-29T12:00"}), 1709208000);  // date -d
    using std::chrono::system_clock;
    const double now = std::chrono::duration<double>(system_clock::now().time_since_epoch()).count();
    EXPECT_NEAR(timeOfFirst({"--at", "now"}), now, 60);
    for (const char* wrong : {"-1", "soon", "2023-02-29", "2024-13-01", "2024-01-01T25:00", "2024-01-01X", "nan"})
        EXPECT_EQ(rtsg({"run", file, "--at=" + std::string(wrong), "--for", "0s"}).status, 2) << wrong;
}

TEST_F(Clock, OfServersIsTheWorlds) {
    const std::string endpoint = "ipc://" + folder / "s";
    Program server({"serve", file, "--bind", endpoint, "--for", "20s", "--at", "now"}, streams());
    server.firstLine();
    const std::string log = folder / "m.rlog";
    const Outcome mirrored = rtsg({"mirror", endpoint, "--for", "0.5s", "--record", log, "--json"});
    ASSERT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_NEAR(json::parse(mirrored.out).at("t"), .5, .3);  // since it joined
    server.signal(SIGINT);
    server.wait();
    const double now = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
    EXPECT_NEAR(json::parse(rtsg({"info", log, "--json"}).out).at("t"), now, 120);
}

TEST_F(Clock, DoesNotPlayWhatIsLongOver) {
    // 8.2.4.3: the cycle that began at the default startTime, 0, ended two seconds later, in 1970.
    EXPECT_TRUE(events({"--at", kSimulated, "--for", "3s", "--watch", "BOX.translation", "--watch", "ONCE.*"}).empty());
    // At that time itself it plays.
    EXPECT_FALSE(events({"--at", "0", "--for", "1s", "--watch", "ONCE.fraction_changed"}).empty());
    // A sensor whose cycle ended some years before is not started for a moment either.
    writeFile(file, "#X3D V4.0 utf8\nPROFILE Immersive\nDEF ONCE TimeSensor { startTime 900000000 }\n");
    EXPECT_TRUE(events({"--at", kSimulated, "--for", "1s", "--watch", "ONCE.*"}).empty());
}

TEST_F(Clock, CountsFromTheStartWhatPeopleTypeAndRead) {
    const auto lines = events({"--at", kSimulated, "--for", "2s", "--set", "ONCE.set_startTime=now@0.5", "--watch",
                               "BOX.translation", "--watch", "ONCE.startTime"});
    ASSERT_GE(lines.size(), 3u);
    EXPECT_EQ(lines[0].at("t"), .5);
    EXPECT_EQ(lines[0].at("field"), "startTime");
    EXPECT_EQ(lines[0].at("value"), kSimulatedSeconds + .5);
    for (const json& line : lines) {
        if (line.at("node") != "BOX") continue;
        // From 1 to 3 within two seconds.
        EXPECT_NEAR(line.at("value")[0], 1 + line.at("t").get<double>() - .5, 1e-5) << line;
    }
    EXPECT_EQ(lines.back().at("t"), 2);
}

TEST_F(Clock, GivesTheSamePicturesSoundsAndPlacesWhereverItStands) {
    const auto created = [&](const std::string& at, const std::string& name) {
        const Outcome outcome = rtsg({"run", file, "--at", at, "--for", "1s", "--fps", "10", "--set",
                                      "TICK.set_boolean=TRUE@0.2", "--render", folder / (name + "%d.png"), "--size",
                                      "16x9", "--listen", folder / (name + ".wav"), "--rays", "20", "--json"});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_EQ(json::parse(outcome.out).at("pictures"), 10) << at;
        EXPECT_EQ(json::parse(outcome.out).at("t"), 1) << at;
    };
    created("100", "a");
    created(kSimulated, "b");
    created("2026-11-20T12:34:56.7Z", "c");
    for (int k = 0; k < 10; ++k)
        for (const char* other : {"b", "c"})
            EXPECT_EQ(pictureIn(folder / (other + std::to_string(k) + ".png")),
                      pictureIn(folder / ("a" + std::to_string(k) + ".png")))
                << other << k;
    EXPECT_EQ(readFile(folder / "b.wav").size(), readFile(folder / "a.wav").size());
    EXPECT_EQ(readFile(folder / "c.wav").size(), readFile(folder / "a.wav").size());
}

TEST_F(Clock, IsInLogsWhoseTimesAreTypedFromTheirStart) {
    const std::string log = folder / "a.rlog", shorter = folder / "b.rlog";
    const Outcome created = rtsg({"record", file, "--at", kSimulated, "-o", log, "--for", "3s", "--fps", "10", "--set",
                                  "TICK.set_boolean=TRUE@0.5", "--json"});
    ASSERT_EQ(created.status, 0) << created.err;
    EXPECT_EQ(json::parse(created.out).at("t"), 3);
    const json info = json::parse(rtsg({"info", log, "--json"}).out);
    EXPECT_EQ(info.at("t"), kSimulatedSeconds);
    EXPECT_EQ(info.at("duration_s"), 3);
    const Outcome seek = rtsg({"replay", log, "--seek", "1.5s", "--save", folder / "s.x3dv", "--json"});
    EXPECT_EQ(json::parse(seek.out).at("t"), 1.5) << seek.err;
    EXPECT_THAT(readFile(folder / "s.x3dv"), HasSubstr("translation 2 0 0"));
    EXPECT_EQ(json::parse(rtsg({"replay", log, "--verify", "--json"}).out).at("t"), 3);
    EXPECT_THAT(rtsg({"replay", log, "--seek", "4s"}).err, HasSubstr("ends at 3 s"));
    EXPECT_EQ(rtsg({"replay", log, "--compact", shorter, "--seek", "1s", "--for", "1s"}).status, 0);
    const json cut = json::parse(rtsg({"info", shorter, "--json"}).out);
    EXPECT_EQ(cut.at("t"), kSimulatedSeconds + 1);
    EXPECT_EQ(cut.at("duration_s"), 1);
    // Run afresh, the clock stands where the session's stood.
    const Outcome rerun = rtsg({"replay", log, "--rerun", file, "--json"});
    EXPECT_EQ(rerun.status, 0) << rerun.err << rerun.out;
    // Differences are numbered by the same count.
    writeFile(folder / "other.x3dv", readFile(file));
    ASSERT_EQ(rtsg({"record", folder / "other.x3dv", "--at", kSimulated, "-o", folder / "c.rlog", "--for", "3s",
                    "--fps", "10", "--set", "TICK.set_boolean=TRUE@1"})
                  .status,
              0);
    EXPECT_EQ(
        json::parse(rtsg({"replay", log, "--diff", folder / "c.rlog", "--json"}).out).at("first_divergence").at("t"),
        .5);
}

TEST_F(Clock, OfReplicasAndServersCountsForLengths) {
    const std::string endpoint = "ipc://" + folder / "s";
    Program server({"serve", file, "--bind", endpoint, "--at", "2026-11-20T12:34:56.7Z", "--for", "1s", "--fps", "30",
                    "--await", "1", "--linger", "60s", "--json"},
                   streams());
    server.firstLine();
    const Outcome mirrored = rtsg({"mirror", endpoint, "--for", "1s", "--fps", "10", "--render", folder / "m%d.png",
                                   "--size", "16x9", "--listen", folder / "m.wav", "--rays", "20", "--json"});
    EXPECT_EQ(mirrored.status, 0) << mirrored.err;
    const json report = json::parse(mirrored.out);
    EXPECT_EQ(report.at("pictures"), 10);
    EXPECT_EQ(report.at("sound_seconds"), 1);
    EXPECT_EQ(report.at("t"), 1);
    const Outcome origin = server.wait();
    EXPECT_EQ(json::parse(lastLine(origin.out)).at("t"), 1);
}

/// A glTF file with the clips Slide and Lift, which move a door within two seconds by 4 along x or by 6 along y.
std::string twoClips() {
    const auto clip = [](const char* name, int values) {
        return fmt::format(
            R"({{"name":"{}","channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}],"samplers":[{{"input":1,"output":{}}}]}})",
            name, values);
    };
    return fmt::format(
        R"({{"asset":{{"version":"2.0"}},"nodes":[{{"name":"Door","mesh":0}}],"meshes":[{{"primitives":[{{"attributes":)"
        R"({{"POSITION":0}}}}]}}],"animations":[{},{}],"accessors":[{{"bufferView":0,"componentType":5126,"count":3,)"
        R"("type":"VEC3"}},{{"bufferView":0,"byteOffset":36,"componentType":5126,"count":2,"type":"SCALAR"}},)"
        R"({{"bufferView":0,"byteOffset":44,"componentType":5126,"count":2,"type":"VEC3"}},{{"bufferView":0,)"
        R"("byteOffset":68,"componentType":5126,"count":2,"type":"VEC3"}}],"bufferViews":[{{"buffer":0,"byteLength":92}}],)"
        R"("buffers":[{{"byteLength":92,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAEAAAAAAAAAAAAAAAAAAAIBAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAADAQAAAAAA="}}]}})",
        clip("Slide", 2), clip("Lift", 3));
}

TEST_F(Clock, OneClipOfAGltfFilePlaysFromTheStart) {
    const std::string gltf = folder / "door.gltf";
    writeFile(gltf, twoClips());
    const auto last = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments{"run", gltf, "--fps", "2", "--for", "1.5s", "--watch", "Door.translation"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return lastLine(outcome.out);
    };
    EXPECT_EQ(last({}), R"({"t":1.5,"node":"Door","field":"translation","value":[3,0,0]})");
    EXPECT_EQ(last({"--clip", "Lift"}), R"({"t":1.5,"node":"Door","field":"translation","value":[0,4.5,0]})");
    EXPECT_EQ(last({"--set", "Slide.set_stopTime=now@1", "--set", "Lift.set_startTime=now@1"}),
              R"({"t":1.5,"node":"Door","field":"translation","value":[0,1.5,0]})");
    for (const char* start : {"0", "1.3", "2026-11-20"})
        EXPECT_EQ(last({"--at", start}), R"({"t":1.5,"node":"Door","field":"translation","value":[3,0,0]})") << start;
    // The document that it becomes says the same.
    EXPECT_EQ(rtsg({"convert", gltf, folder / "door.x3dv", "--clip", "Lift"}).status, 0);
    EXPECT_THAT(readFile(folder / "door.x3dv"), HasSubstr("ROUTE Lift_start.enterTime TO Lift.startTime"));

    const Outcome none = rtsg({"run", gltf, "--for", "0s", "--clip", "Shut"});
    EXPECT_EQ(none.status, 1);
    EXPECT_THAT(none.err, HasSubstr("door.gltf: error: the glTF file has no clip Shut; its clips are Slide, Lift"));
    const Outcome other = rtsg({"run", file, "--for", "0s", "--clip", "Shut"});
    EXPECT_EQ(other.status, 1);
    EXPECT_THAT(other.err, HasSubstr("it has no clip Shut: only glTF files have clips"));
}

}  // namespace
}  // namespace rtsg::test
