// --foxglove: what a client of the protocol sees of a scene that is served, run or mirrored, and that none of them
// waits for it.
#include <gmock/gmock.h>

#include "mirror_session.h"
#include "support/foxglove_client.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Foxglove : public Mirror {
  protected:
    /// Serves the moving box live; its first line.
    json live(std::vector<std::string> more = {}) {
        std::vector<std::string> arguments{"serve",
                                           file,
                                           "--bind",
                                           "tcp://127.0.0.1:*",
                                           "--json",
                                           "--fps",
                                           "30",
                                           "--foxglove",
                                           "0",
                                           "--fields",
                                           "BOX.translation,CLOCK.fraction_changed"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        server = std::make_unique<Program>(arguments, streams());
        return json::parse(server->firstLine());
    }
    /// The parsed messages of a subscription.
    static std::vector<json> of(const FoxgloveClient& viewer, std::uint32_t subscription) {
        std::vector<json> all;
        for (const FoxgloveMessage& message : viewer.messages)
            if (message.subscription == subscription) all.push_back(json::parse(message.json));
        return all;
    }
    static std::optional<json> frameOf(const json& transforms, const std::string& name) {
        for (const json& one : transforms.at("transforms"))
            if (one.at("child_frame_id").get<std::string>().starts_with(name)) return one;
        return std::nullopt;
    }
};

TEST_F(Foxglove, AViewerSeesFramesShapesChangesAndFields) {
    const json first = live();
    FoxgloveClient viewer(first.at("foxglove").get<std::string>());
    ASSERT_EQ(viewer.status, 101);
    ASSERT_TRUE(viewer.readUntil([&] { return !viewer.advertised.empty(); }));
    const json channels = json::parse(viewer.advertised.front()).at("channels");
    std::map<std::string, std::string> schemas;
    for (const json& channel : channels) {
        schemas[channel.at("topic")] = channel.at("schemaName");
        EXPECT_EQ(channel.at("encoding"), "json");
        EXPECT_EQ(json::parse(channel.at("schema").get<std::string>()).at("type"), "object");
    }
    EXPECT_EQ(schemas, (std::map<std::string, std::string>{{"/tf", "foxglove.FrameTransforms"},
                                                           {"/scene", "foxglove.SceneUpdate"},
                                                           {"/rtsg/changes", "rtsg.Changes"},
                                                           {"/fields/BOX/translation", "rtsg.SFVec3f"},
                                                           {"/fields/CLOCK/fraction_changed", "rtsg.SFFloat"}}));
    viewer.subscribe(1, "/tf");
    viewer.subscribe(2, "/scene");
    viewer.subscribe(3, "/fields/BOX/translation");
    viewer.subscribe(4, "/rtsg/changes");
    ASSERT_TRUE(viewer.readUntil(
        [&] { return of(viewer, 1).size() >= 10 && of(viewer, 2).size() >= 1 && of(viewer, 4).size() >= 10; }));
    // The shapes come whole and once, since only the box moves.
    const std::vector<json> scenes = of(viewer, 2);
    EXPECT_EQ(scenes.size(), 1u);
    EXPECT_EQ(scenes[0].at("entities").size(), 2u);
    EXPECT_EQ(scenes[0].at("entities")[0].at("cubes").size(), 1u);
    // The frame is where the field says, at the time of the message.
    const json frame = *frameOf(of(viewer, 1).back(), "BOX");
    bool found = false;
    for (const FoxgloveMessage& message : viewer.messages) {
        if (message.subscription != 3) continue;
        const json field = json::parse(message.json);
        if (field.at("timestamp") != frame.at("timestamp")) continue;
        found = true;
        EXPECT_NEAR(field.at("value")[0], frame.at("translation").at("x"), 1e-6);
        const std::uint64_t at = field.at("timestamp").at("sec").get<std::uint64_t>() * 1'000'000'000 +
                                 field.at("timestamp").at("nsec").get<std::uint64_t>();
        EXPECT_EQ(message.nanoseconds, at);
    }
    EXPECT_TRUE(found);
    EXPECT_GT(viewer.time, 1'700'000'000'000'000'000u) << "the clock of a served scene";
    EXPECT_EQ(of(viewer, 4).back().at("hash").get<std::string>().size(), 32u);
    // Who comes later gets all there is first.
    FoxgloveClient late(first.at("foxglove").get<std::string>());
    ASSERT_TRUE(late.readUntil([&] { return !late.advertised.empty(); }));
    late.subscribe(9, "/scene");
    ASSERT_TRUE(late.readUntil([&] { return !late.messages.empty(); }));
    EXPECT_EQ(of(late, 9).front().at("entities").size(), 2u);
    EXPECT_EQ(of(late, 9).front().at("deletions")[0].at("type"), 1);
    server->signal(SIGINT);
    EXPECT_FALSE(late.readUntil([&] { return false; }));
    EXPECT_TRUE(late.closed);
    const Outcome end = server->wait();
    EXPECT_EQ(end.status, 0) << end.err;
    const json counts = json::parse(lastLine(end.out)).at("foxglove");
    EXPECT_GE(counts.at("messages"), 22);
    EXPECT_EQ(counts.at("missed"), 0);
}

/// A scene that rests tells all to who comes, and what an edit changes.
TEST_F(Foxglove, ASceneThatRestsIsShown) {
    writeFile(
        file,
        "#X3D V4.0 utf8\nPROFILE Immersive\nDEF BOX Transform { children Shape { geometry DEF S Sphere { } } }\n");
    server = std::make_unique<Program>(
        std::vector<std::string>{"serve", file, "--bind", "tcp://127.0.0.1:*", "--json", "--foxglove", "0", "--fields",
                                 "BOX.scale,S.*", "--feed", "tcp://127.0.0.1:0"},
        streams());
    const json first = json::parse(server->firstLine());
    FoxgloveClient viewer(first.at("foxglove").get<std::string>());
    ASSERT_TRUE(viewer.readUntil([&] { return !viewer.advertised.empty(); }));
    viewer.subscribe(1, "/fields/BOX/scale");
    viewer.subscribe(2, "/scene");
    ASSERT_TRUE(viewer.readUntil([&] { return viewer.messages.size() == 2; }));
    EXPECT_EQ(of(viewer, 1)[0].at("value"), json::array({1, 1, 1}));
    Line feed(std::stoi(first.at("feeds")[0].get<std::string>().substr(16)));
    feed.say("BOX,scale,2 2 2\n");
    ASSERT_TRUE(viewer.readUntil([&] { return viewer.messages.size() == 4; }));
    EXPECT_EQ(of(viewer, 1)[1].at("value"), json::array({2, 2, 2}));
    EXPECT_NEAR(of(viewer, 2)[1].at("entities")[0].at("spheres")[0].at("size").at("x"), 4, 1e-6);
}

/// What changes while nobody wants it is there for who comes then.
TEST_F(Foxglove, WhoComesLaterSeesWhatChangedBefore) {
    writeFile(
        file,
        "#X3D V4.0 utf8\nPROFILE Immersive\nDEF BOX Transform { children Shape { geometry DEF S Sphere { } } }\n");
    server = std::make_unique<Program>(
        std::vector<std::string>{"serve", file, "--bind", "tcp://127.0.0.1:*", "--json", "--foxglove", "0", "--feed",
                                 "tcp://127.0.0.1:0", "--publish", "tcp://127.0.0.1:0", "--fields", "BOX.scale"},
        streams());
    const json first = json::parse(server->firstLine());
    Line feed(std::stoi(first.at("feeds")[0].get<std::string>().substr(16)));
    Line published(std::stoi(first.at("published")[0].get<std::string>().substr(16)));
    for (const int size : {1, 2, 3}) {
        FoxgloveClient viewer(first.at("foxglove").get<std::string>());
        ASSERT_TRUE(viewer.readUntil([&] { return !viewer.advertised.empty(); }));
        viewer.subscribe(1, "/tf");
        viewer.subscribe(2, "/scene");
        ASSERT_TRUE(viewer.readUntil([&] { return viewer.messages.size() == 2; }));
        EXPECT_NEAR(of(viewer, 2)[0].at("entities")[0].at("spheres")[0].at("size").at("x"), 2 * size, 1e-6);
        EXPECT_EQ(of(viewer, 1)[0].at("transforms").size(), 1u);
        viewer.ask(R"({"op":"unsubscribe","subscriptionIds":[1,2]})");
        const std::string more = std::to_string(size + 1);
        for (const std::string& text : {std::string("0.5"), more}) {
            published.heard.clear();
            feed.say("BOX,scale," + text + " " + text + " " + text + "\n");
            ASSERT_TRUE(published.hear([&] { return published.heard.find('\n') != std::string::npos; }));
        }
    }
}

TEST_F(Foxglove, AMirrorAndARunAreShown) {
    serve({}, "tcp://127.0.0.1:*");
    Program mirror({"mirror", endpoint, "--foxglove", "0", "--fields", "BOX.translation"}, streams());
    const std::string said = "live for viewers at ";
    const auto addressOf = [&](const Program& program) {
        const auto end = std::chrono::steady_clock::now() + kLinePatience;
        std::string text;
        while (text.find(said) == text.npos && std::chrono::steady_clock::now() < end) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            text = program.said();
        }
        const std::size_t at = text.find("ws://", text.find(said));
        return text.substr(at, text.find('\n', at) - at);
    };
    Program run({"run", file, "--for", "20s", "--realtime", "--fps", "30", "--foxglove", "0"}, streams());
    for (Program* program : {&mirror, &run}) {
        FoxgloveClient viewer(addressOf(*program));
        ASSERT_TRUE(viewer.readUntil([&] { return !viewer.advertised.empty(); }));
        EXPECT_EQ(viewer.channels.contains("/fields/BOX/translation"), program == &mirror);
        viewer.subscribe(1, "/tf");
        viewer.subscribe(2, "/scene");
        ASSERT_TRUE(viewer.readUntil([&] { return of(viewer, 1).size() >= 5 && !of(viewer, 2).empty(); }));
        EXPECT_EQ(of(viewer, 2)[0].at("entities").size(), 2u);
        program->signal(SIGINT);
    }
    EXPECT_EQ(mirror.wait().status, 0);
    EXPECT_EQ(run.wait().status, 1) << "interrupted before its end";
}

TEST_F(Foxglove, WhoStopsReadingDoesNotHoldUpTheScene) {
    // A mesh of 10,000 points that moves as a whole, written in each frame.
    std::string points;
    for (int i = 0; i < 10'000; ++i) points += std::to_string(i % 100) + " " + std::to_string(i / 100) + " 0,";
    writeFile(file, R"(#X3D V4.0 utf8
PROFILE Immersive
DEF T Transform { children Shape { geometry PointSet { coord DEF C Coordinate { point [ )" +
                        points + R"( ] } } } }
DEF CLOCK TimeSensor { cycleInterval 1 loop TRUE }
DEF PATH CoordinateInterpolator { key [ 0 1 ] keyValue [ )" +
                        points + points + R"( ] }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO C.point
)");
    server = std::make_unique<Program>(
        std::vector<std::string>{"serve", file, "--bind", "tcp://127.0.0.1:*", "--json", "--fps", "30", "--foxglove",
                                 "0", "--fields", "C.point,CLOCK.time", "--for", "4s"},
        streams());
    const std::string address = json::parse(server->firstLine()).at("foxglove");
    FoxgloveClient slow(address), quick(address);
    for (FoxgloveClient* one : {&slow, &quick}) ASSERT_TRUE(one->readUntil([&] { return !one->advertised.empty(); }));
    slow.subscribe(1, "/fields/C/point");
    quick.subscribe(1, "/fields/CLOCK/time");
    EXPECT_FALSE(quick.readUntil([&] { return false; }));
    const Outcome end = server->wait();
    EXPECT_EQ(end.status, 0) << end.err;
    const json summary = json::parse(lastLine(end.out));
    EXPECT_GT(summary.at("foxglove").at("missed"), 0);
    EXPECT_GE(of(quick, 1).size() + 5, summary.at("frames").get<std::size_t>());
}

TEST_F(Foxglove, WhatMakesNoSenseIsRefused) {
    EXPECT_EQ(rtsg({"serve", file, "--foxglove", "x", "--for", "0.1s"}).status, 1);
    const Outcome open = rtsg({"serve", file, "--foxglove", "0.0.0.0:0", "--for", "0.1s"});
    EXPECT_EQ(open.status, 1);
    EXPECT_THAT(open.err, HasSubstr("--insecure"));
    const Outcome field = rtsg({"run", file, "--foxglove", "0", "--fields", "BOXX.translation", "--for", "0.1s"});
    EXPECT_EQ(field.status, 1);
    EXPECT_THAT(field.err, HasSubstr("BOXX"));
    const Outcome input = rtsg({"run", file, "--foxglove", "0", "--fields", "FLAG.set_boolean", "--for", "0.1s"});
    EXPECT_EQ(input.status, 1);
    EXPECT_EQ(rtsg({"run", file, "--fields", "BOX.translation", "--for", "0.1s"}).status, 2);
    EXPECT_EQ(rtsg({"mirror", "tcp://127.0.0.1:1", "--fields", "BOX.translation"}).status, 2);
    EXPECT_EQ(rtsg({"mirror", "tcp://127.0.0.1:1", "--insecure"}).status, 2);
}

}  // namespace
}  // namespace rtsg::test
