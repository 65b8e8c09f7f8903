// Mirrors as a script uses them: two processes, and what must be the same in both.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <xxhash.h>

#include "mirror_session.h"
#include "support/tcp_proxy.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

TEST_F(Mirror, FollowsUntilTheServerLeaves) {
    const std::string served = folder / "served.rlog", mirrored = folder / "mirrored.rlog",
                      saved = folder / "saved.x3dv";
    serve({"--for", "2s", "--record", served}, "ipc://" + folder / "socket");
    Program mirror({"mirror", "--json", endpoint, "--record", mirrored, "--save", saved, "--wait", "60s"}, streams());
    const Outcome followed = mirror.wait();
    const Outcome origin = server->wait();
    EXPECT_EQ(followed.status, 0) << followed.err;
    EXPECT_EQ(origin.status, 0) << origin.err;
    const json report = json::parse(followed.out), summary = json::parse(lastLine(origin.out));
    expectEqual(report);
    EXPECT_EQ(report.at("snapshots"), 1);
    EXPECT_EQ(report.at("gaps"), 0);
    EXPECT_EQ(report.at("hash"), summary.at("hash"));
    EXPECT_EQ(report.at("sequence"), summary.at("sequence"));
    // Both logs end in the same state and agree on all they share.
    const Outcome difference = rtsg({"replay", "--json", served, "--diff", mirrored});
    EXPECT_EQ(difference.status, 0) << difference.out << difference.err;
    EXPECT_THAT(readFile(saved), HasSubstr("DEF BOX Transform"));
}

/// A frame is encoded once, and its bytes are what goes to mirrors and into every log.
TEST_F(Mirror, LogsHoldWhatIsSent) {
    const std::string served = folder / "served.rlog", mirrored = folder / "mirrored.rlog";
    serve({"--for", "2s", "--record", served, "--keyframe-seconds", "0.3"}, "ipc://" + folder / "socket");
    Program mirror({"mirror", "--json", endpoint, "--record", mirrored, "--render", folder / "p%03d.png", "--size",
                    "16x16", "--wait", "60s"},
                   streams());
    const Outcome followed = mirror.wait(), origin = server->wait();
    EXPECT_EQ(followed.status, 0) << followed.err;
    EXPECT_EQ(origin.status, 0) << origin.err;
    EXPECT_GT(json::parse(followed.out).at("frames"), 20);
    EXPECT_EQ(json::parse(followed.out).at("encoded"), 0);
    EXPECT_EQ(json::parse(lastLine(origin.out)).at("log_encoded"), 0);
    for (const std::string& log : {served, mirrored}) {
        const Outcome verified = rtsg({"replay", "--verify", "--json", log});
        EXPECT_EQ(verified.status, 0) << verified.err;
    }
}

/// A scene in which nothing happens: a frame now and then tells its time; what a mirror asks for is answered at once.
TEST_F(Mirror, AStillSceneIsLeftAlone) {
    const std::string still = folder / "still.x3dv";
    writeFile(still, "#X3D V4.0 utf8\nPROFILE Immersive\nDEF BOX Transform { children Shape { geometry Box { } } }\n");
    serve({"--for", "5s", "--upstream", "edits"}, "ipc://" + folder / "socket", still);
    const Outcome edits = rtsg({"mirror", "--json", endpoint, "--edit", "BOX.translation=1 0 0@0.5", "--for", "2s"});
    EXPECT_EQ(edits.status, 0) << edits.err;
    const json report = json::parse(edits.out);
    EXPECT_EQ(report.at("accepted"), 1);
    EXPECT_LE(report.at("frames"), 12) << "of 30 a second";
    EXPECT_EQ(report.at("equal"), true);
    const Outcome rest = server->wait();
    EXPECT_EQ(rest.status, 0) << rest.err;
    EXPECT_LE(json::parse(lastLine(rest.out)).at("frames"), 30) << "of 150";
    EXPECT_GE(json::parse(lastLine(rest.out)).at("t"), 4.9);
}

/// Pictures of the time before an edit show what was before it, though no frame came then.
TEST_F(Mirror, PicturesOfARestShowTheRest) {
    const std::string still = folder / "still.x3dv";
    writeFile(still,
              "#X3D V4.0 utf8\nPROFILE Immersive\nBackground { skyColor 0 0 0 }\nViewpoint { }\nDEF BOX Transform { "
              "translation 50 0 0 "
              "children Shape { appearance Appearance { material Material { emissiveColor 1 1 1 } } geometry Box { "
              "size 9 9 1 } } }\n");
    serve({"--for", "30s", "--upstream", "edits"}, "ipc://" + folder / "socket", still);
    Program watching(
        {"mirror", "--json", endpoint, "--render", folder / "p%02d.png", "--fps", "10", "--size", "8x8", "--for", "3s"},
        streams());
    const Outcome edits = rtsg({"mirror", endpoint, "--edit", "BOX.translation=0 0 0@1.5", "--for", "2s"});
    EXPECT_EQ(edits.status, 0) << edits.err;
    const Outcome watched = watching.wait();
    ASSERT_EQ(watched.status, 0) << watched.err;
    // The state that each shows changes once, and within a frame of when it was asked for.
    const auto states = json::parse(watched.out).at("picture_states").get<std::vector<std::uint64_t>>();
    ASSERT_EQ(states.size(), 30u);
    std::vector<std::string> pictures;
    for (int k = 0; k < 30; ++k) pictures.push_back(pictureIn(folder / fmt::format("p{:02}.png", k)));
    const auto changed = std::ranges::find_if(pictures, [&](const std::string& p) { return p != pictures.front(); });
    const auto at = changed - pictures.begin();
    EXPECT_GT(at, 8) << "it began a little before the other";
    EXPECT_LT(at, 19);
    for (auto p = changed; p != pictures.end(); ++p) EXPECT_EQ(*p, pictures.back());
}

TEST_F(Mirror, WhatItsUserAsksForIsTheirsInTheLog) {
    const std::string log = folder / "authors.rlog";
    serve({"--for", "30s", "--record", log, "--upstream", "events"}, "ipc://" + folder / "socket");
    for (const auto& [name, value] : {std::pair{"Ann", "1 2 3"}, {"B\x1b[31mob", "4 5 6"}}) {
        const Outcome mirror = rtsg({"mirror", endpoint, "--name", name, "--set",
                                     std::string("BOX.set_scale=") + value + "@0", "--for", "500ms"});
        EXPECT_EQ(mirror.status, 0) << mirror.err;
    }
    server->signal(SIGINT);
    EXPECT_NE(server->wait().status, -1);
    const Outcome blame = rtsg({"replay", log, "--blame", "BOX.scale"});
    EXPECT_EQ(blame.status, 0) << blame.err;
    EXPECT_THAT(blame.out, HasSubstr("Ann (set from outside)"));
    EXPECT_THAT(blame.out, HasSubstr("B\\x1b[31mob (set from outside)")) << "a name is not the terminal's to obey";
    const json reported = json::parse(rtsg({"replay", log, "--blame", "BOX.scale", "--json"}).out).at("steps");
    ASSERT_EQ(reported.size(), 3u) << reported;
    EXPECT_EQ(reported[0].at("author"), "");
    EXPECT_EQ(reported[1].at("author"), "Ann");
    EXPECT_EQ(reported[1].at("value"), "1 2 3");
    EXPECT_EQ(reported[2].at("value"), "4 5 6");
    for (const char* wrong : {"BOX.nothing", "NOBODY.scale", "BOX"}) {
        const Outcome none = rtsg({"replay", log, "--blame", wrong});
        EXPECT_EQ(none.status, 1) << none.out;
        EXPECT_NE(none.err, "");
        EXPECT_EQ(none.out, "");
    }
}

/// The snapshot takes longer than a server may be silent, and the origin is always ahead of what comes.
TEST_F(Mirror, OnASlowLinkJoinsAndCatchesUp) {
    std::string many =
        "#X3D V4.0 utf8\nPROFILE Full\nDEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }\n"
        "DEF WAY PositionInterpolator { key [ 0 .5 1 ] keyValue [ 0 0 0, 1 2 3, 0 0 0 ] }\n"
        "ROUTE CLOCK.fraction_changed TO WAY.set_fraction\nDEF BOX Transform { }\n"
        "WorldInfo { info \"" +
        std::string(80'000, 'x') + "\" }\n";
    for (int i = 0; i < 100; ++i)
        many += fmt::format("DEF T{0} Transform {{ }}\nROUTE WAY.value_changed TO T{0}.translation\n", i);
    writeFile(file, many);
    serve({"--for", "120s"}, "tcp://127.0.0.1:*");
    const TcpProxy proxy(endpoint, std::chrono::milliseconds(100), 20'000);
    const Outcome followed = rtsg({"mirror", "--json", proxy.endpoint, "--for", "2s", "--wait", "3s"});
    EXPECT_EQ(followed.status, 0) << followed.err;
    const json report = json::parse(followed.out);
    expectEqual(report);
    EXPECT_EQ(report.at("snapshots"), 1) << report;
    EXPECT_EQ(report.at("sequence"), report.at("origin_sequence")) << report;
}

/// Makes no sense of what a record holds; all else of it is right.
void emptyOfSense(std::string& bytes) {
    constexpr std::size_t kChecksumAt = 8, kKindAt = 16, kLengthAt = 18, kLengthSize = 6, kPayloadAt = 64;
    for (std::size_t at = 0; (at = bytes.find("RTSGrec1", at)) != std::string::npos; ++at) {
        if (at + kPayloadAt > bytes.size() || (bytes[at + kKindAt] != 2 && bytes[at + kKindAt] != 3)) continue;
        std::uint64_t length = 0;
        std::memcpy(&length, &bytes[at + kLengthAt], kLengthSize);
        if (at + kPayloadAt + length > bytes.size()) continue;
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at + kPayloadAt), length, '\xFF');
        const std::uint64_t checksum = XXH3_64bits(&bytes[at + kKindAt], kPayloadAt - kKindAt + length);
        std::memcpy(&bytes[at + kChecksumAt], &checksum, sizeof(checksum));
    }
}

/// Records come, and none can be applied: that is not to be waited for, however many come.
TEST_F(Mirror, EndsWithAnErrorWhereNothingThatComesCanBeApplied) {
    writeFile(file, "#X3D V4.0 utf8\nDEF CLOCK TimeSensor { loop TRUE }\n");  // whose records go in one piece each
    serve({"--for", "120s"}, "tcp://127.0.0.1:*");
    const TcpProxy proxy(endpoint, {}, 0, emptyOfSense);
    Program follower({"mirror", "--json", proxy.endpoint, "--for", "2s", "--wait", "4s"}, streams());
    const Outcome followed = follower.wait();
    EXPECT_EQ(followed.status, 1) << followed.err;
    EXPECT_THAT(followed.err, HasSubstr("nothing of what the server sends could be applied for 4 s"));
}

/// Its hash is the origin's, of a state that the origin has left since.
TEST_F(Mirror, IsNotEqualWhereTheOriginHasGoneOn) {
    writeFile(file, "#X3D V4.0 utf8\nDEF CLOCK TimeSensor { loop TRUE }\n");
    serve({"--for", "120s"}, "tcp://127.0.0.1:*");
    std::atomic<bool> bends = false;
    const TcpProxy proxy(endpoint, {}, 0, [&](std::string& bytes) {
        if (bends) emptyOfSense(bytes);
    });
    const std::string log = folder / "mirrored.rlog";
    Program mirror({"mirror", "--json", proxy.endpoint, "--record", log, "--wait", "2s"}, streams());
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (readFile(log).size() < 1000 && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    bends = true;
    const Outcome followed = mirror.wait();
    EXPECT_EQ(followed.status, 1) << followed.err;
    const json report = json::parse(followed.out);
    EXPECT_EQ(report.at("hash"), report.at("origin_hash")) << report;
    EXPECT_LT(report.at("sequence"), report.at("origin_sequence")) << report;
    EXPECT_EQ(report.at("equal"), false) << report;
}

TEST_F(Mirror, ManyOverTcpOneOfThemLate) {
    serve({"--for", "3s"}, "tcp://127.0.0.1:*");
    EXPECT_THAT(endpoint, HasSubstr("tcp://127.0.0.1:"));
    Program first({"mirror", "--json", endpoint, "--wait", "60s"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(800));
    Program second({"mirror", "--json", endpoint, "--for", "1s", "--wait", "60s"}, streams());
    const Outcome a = first.wait(), b = second.wait();
    EXPECT_EQ(server->wait().status, 0);
    EXPECT_EQ(a.status, 0) << a.err;
    EXPECT_EQ(b.status, 0) << b.err;
    expectEqual(json::parse(a.out));
    expectEqual(json::parse(b.out));
}

/// It does not see earlier states: its time begins with the session's present state.
TEST_F(Mirror, WhoComesLateBeginsWithTheStateOfNow) {
    serve({"--for", "60s", "--upstream", "events"}, "tcp://127.0.0.1:*");
    ASSERT_EQ(rtsg({"mirror", endpoint, "--for", "100ms"}).status, 0);
    std::this_thread::sleep_for(std::chrono::seconds(3));
    for (int i = 0; i < 2; ++i) {
        const auto start = std::chrono::steady_clock::now();
        const Outcome late = rtsg({"mirror", "--json", endpoint, "--for", "1s", "--set", "FLAG.set_boolean=TRUE@0.9"});
        EXPECT_EQ(late.status, 0) << late.err;
        EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(900));
        const json report = json::parse(late.out);
        expectEqual(report);
        EXPECT_EQ(report.at("accepted"), 1);
        EXPECT_NEAR(report.at("t"), 1, .2);
    }
}

TEST_F(Mirror, NothingThatWasAskedForEndsWithoutAnAnswer) {
    serve({"--for", "60s"}, "tcp://127.0.0.1:*");
    for (int i = 0; i < 4; ++i) {
        const Outcome refused =
            rtsg({"mirror", "--json", endpoint, "--for", "0.1s", "--set", "FLAG.set_boolean=TRUE@0"});
        EXPECT_EQ(refused.status, 1) << "the server takes none";
        EXPECT_EQ(json::parse(refused.out).at("refused"), 1);
    }
    const Outcome unsent = rtsg({"mirror", endpoint, "--for", "0.1s", "--set", "FLAG.set_boolean=TRUE@9"});
    EXPECT_EQ(unsent.status, 1);
    EXPECT_THAT(unsent.err, HasSubstr("not sent"));
    const Outcome bogus = rtsg({"mirror", endpoint, "--for", "0.1s", "--control", "status"});
    EXPECT_EQ(bogus.status, 1);
    EXPECT_THAT(bogus.err, HasSubstr("refused"));
}

TEST_F(Mirror, PartsThatNobodyFollowsMakeRoom) {
    serve({"--for", "60s", "--parts", "2"}, "tcp://127.0.0.1:*");
    for (const char* part : {"BOX", "CLOCK", "PATH", "FLAG", "BOX"}) {
        const Outcome mirror = rtsg({"mirror", endpoint, "--part", part, "--for", "0.1s", "--wait", "2s"});
        EXPECT_EQ(mirror.status, 0) << part << mirror.err;
    }
    // The parts that are followed stay.
    Program box({"mirror", endpoint, "--part", "BOX", "--for", "20s"}, streams());
    Program clock({"mirror", endpoint, "--part", "CLOCK", "--for", "20s"}, streams());
    std::this_thread::sleep_for(std::chrono::seconds(2));
    const Outcome third = rtsg({"mirror", endpoint, "--part", "PATH", "--for", "0.1s", "--wait", "300ms"});
    EXPECT_EQ(third.status, 1);
    EXPECT_THAT(third.err, HasSubstr("as many parts"));
}

/// A test is taken from a live session, too: its log begins with the document's state, and not with what is newest when
/// the log has been begun.
TEST_F(Mirror, ALogOfASessionHoldsItsFirstState) {
    for (int i = 0; i < 6; ++i) {
        const std::string log = folder / ("first" + std::to_string(i) + ".rlog");
        serve({"--for", "300ms", "--record", log}, "ipc://" + folder / ("s" + std::to_string(i)));
        EXPECT_EQ(server->wait().status, 0);
        const Outcome again = rtsg({"replay", log, "--rerun", file});
        EXPECT_EQ(again.status, 0) << again.out << again.err;
    }
}

/// A stranger's name breaks no report.
TEST_F(Mirror, NamesThatAreNoUtf8LeaveReportsThatAre) {
    const std::string log = folder / "named.rlog", other = folder / "other.x3dv", junit = folder / "a.xml",
                      page = folder / "a.html";
    serve({"--for", "30s", "--record", log, "--upstream", "events"}, "ipc://" + folder / "named");
    const Outcome mirror =
        rtsg({"mirror", endpoint, "--name", "\xff\x1b]]><b>", "--set", "BOX.set_scale=2 1 1@0", "--for", "500ms"});
    EXPECT_EQ(mirror.status, 0) << mirror.err;
    server->signal(SIGINT);
    EXPECT_NE(server->wait().status, -1);
    const Outcome blame = rtsg({"replay", log, "--blame", "BOX.scale", "--json"});
    EXPECT_THAT(blame.out, HasSubstr("\xEF\xBF\xBD"));
    EXPECT_EQ(blame.out.find('\xff'), std::string::npos);
    writeFile(other, "#X3D V4.0 utf8\nPROFILE Full\nDEF BOX Transform { }\n");
    (void)rtsg({"replay", log, "--rerun", other, "--field", "BOX.*", "--junit", junit, "--page", page});
    for (const std::string& report : {junit, page}) {
        const std::string text = readFile(report);
        EXPECT_NE(text.find("BOX"), std::string::npos) << report;
        EXPECT_EQ(text.find('\xff'), std::string::npos) << report;
        EXPECT_EQ(text.find('\x1b'), std::string::npos) << report;
    }
}

TEST_F(Mirror, PortsThatDoNotExistAreNoOthers) {
    const std::string log = folder / "played.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0s"}).status, 0);
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"serve", file, "--for", "50ms", "--bind", "tcp://127.0.0.1:99999"},
          {"serve", log, "--for", "50ms", "--bind", "tcp://127.0.0.1:99999"},
          {"relay", "ipc://" + folder / "nobody", "--for", "50ms", "--bind", "tcp://127.0.0.1:99999"},
          {"mirror", "tcp://127.0.0.1:70000", "--for", "50ms", "--wait", "50ms"},
          {"relay", "tcp://127.0.0.1:70000", "--for", "50ms"}}) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << arguments[0];
        EXPECT_THAT(outcome.err, HasSubstr("at most 65535")) << arguments[0];
    }
    for (const char* port : {"22x", "1 2", "80/"})
        for (const std::vector<std::string>& arguments :
             {std::vector<std::string>{"serve", file, "--for", "50ms", "--bind",
                                       std::string("tcp://127.0.0.1:") + port},
              {"mirror", std::string("tcp://127.0.0.1:") + port, "--wait", "50ms"}}) {
            const Outcome outcome = rtsg(arguments);
            EXPECT_EQ(outcome.status, 2) << arguments[0];
            EXPECT_THAT(outcome.err, HasSubstr(std::string("'") + port + "' is no port")) << arguments[0];
        }
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"serve", file, "--bind", "nowhere"}, {"mirror", "nowhere"}, {"relay", "nowhere"}}) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << arguments[0];
        EXPECT_THAT(outcome.err, HasSubstr("'nowhere' is no endpoint")) << arguments[0];
    }
}

TEST_F(Mirror, PicturesAndSoundOfTheReplica) {
    serve({"--for", "3s"}, "ipc://" + folder / "socket");
    Program mirror({"mirror", "--json", endpoint, "--render", folder / "p%02d.png", "--fps", "1", "--size", "32x24",
                    "--listen", folder / "m.wav", "--rays", "100", "--record", folder / "m.rlog", "--wait", "60s"},
                   streams());
    const Outcome followed = mirror.wait();
    EXPECT_EQ(server->wait().status, 0);
    ASSERT_EQ(followed.status, 0) << followed.err;
    const json report = json::parse(followed.out);
    expectEqual(report);
    ASSERT_GE(report.at("pictures"), 1);
    EXPECT_EQ(readFile(folder / "p00.png").substr(1, 3), "PNG");
    EXPECT_EQ(readFile(folder / "m.wav").substr(0, 4), "RIFF");
    EXPECT_GT(report.at("sound_seconds"), 0.5);
    // Pictures and sound are made from one flattening and one BVH, which had something to do once in each set that
    // moved the box: the mirror's log, made readable, tells how many these were.
    EXPECT_EQ(report.at("flattenings"), 1);
    EXPECT_EQ(report.at("worlds"), 1);
    ASSERT_EQ(rtsg({"replay", folder / "m.rlog", "--export", folder / "m.mcap", "--export-plain"}).status, 0);
    const std::string lines = folder / "lines";
    if (std::system(
            ("python3 " RTSG_SOURCE_DIR "/tests/app/mcap_reader.py " + folder / "m.mcap" + " > " + lines).c_str()))
        GTEST_SKIP() << "python3 is not installed";
    std::istringstream in(readFile(lines));
    std::size_t first = 0, moves = 0;
    for (std::string line; std::getline(in, line);) {
        const json message = json::parse(line, nullptr, false);
        if (!message.contains("topic") || message["topic"] != "/rtsg/changes") continue;
        const std::string changes = message["message"]["changes"].dump();
        (first == 0 ? first : moves) += first == 0 || changes.find("\"translation\"") != std::string::npos;
    }
    EXPECT_GT(moves, 10u);
    EXPECT_EQ(report.at("commits"), first + moves);
}

TEST_F(CommandLine, ReplayWithPicturesSoundAndExportFlattensOnceAndCommitsOnceASet) {
    const std::string log = folder / "box.rlog";
    ASSERT_EQ(rtsg(atZero({"record", file, "-o", log, "--for", "0.9s", "--fps", "10"})).status, 0);  // moves in each
    const Outcome replayed =
        rtsg({"replay", log, "--render", folder / "p%02d.png", "--size", "16x9", "--fps", "10", "--listen",
              folder / "r.wav", "--rays", "100", "--export", folder / "r.mcap", "--json"});
    ASSERT_EQ(replayed.status, 0) << replayed.err;
    const json report = json::parse(replayed.out);
    EXPECT_EQ(report.at("flattenings"), 1);
    EXPECT_EQ(report.at("worlds"), 1);
    // The recorded states: the loaded one, the start of the clock, in which nothing moves, and nine moves.
    EXPECT_EQ(report.at("frames"), 11);
    EXPECT_EQ(report.at("commits"), 10);
}

TEST_F(Mirror, SaysWhetherItGotInputs) {
    for (const std::string mode : {"state", "input"}) {
        serve({"--for", "20s", "--mode", mode}, "ipc://" + folder / mode);
        const Outcome mirror = rtsg({"mirror", endpoint, "--for", "0.5s", "--mode", "input"});
        EXPECT_EQ(mirror.status, 0) << mirror.err;
        EXPECT_THAT(mirror.out, HasSubstr("computed here from what came into them"));
        EXPECT_EQ(mirror.out.find("the server sends states") != std::string::npos, mode == "state") << mirror.out;
        server->signal(SIGINT);
        server->wait();
    }
}

TEST_F(Mirror, GivesUpWithoutAServer) {
    const auto start = std::chrono::steady_clock::now();
    const Outcome outcome = rtsg({"mirror", "ipc://" + folder / "nobody", "--wait", "500ms", "--json"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(500));
    EXPECT_THAT(outcome.err, HasSubstr("no server"));
    EXPECT_EQ(json::parse(outcome.out).at("equal"), false);
}

TEST_F(Mirror, SignalsEndBothInOrder) {
    const std::string log = folder / "served.rlog";
    serve({"--record", log}, "ipc://" + folder / "socket");
    Program mirror({"mirror", "--json", endpoint, "--record", folder / "mirrored.rlog", "--wait", "60s"}, streams());
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (readFile(folder / "mirrored.rlog").size() < 1000 && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    mirror.signal(SIGINT);
    const Outcome followed = mirror.wait();
    EXPECT_EQ(followed.status, 0) << followed.err;
    expectEqual(json::parse(followed.out));
    server->signal(SIGTERM);
    const Outcome origin = server->wait();
    EXPECT_EQ(origin.status, 0) << origin.err;
    EXPECT_GT(json::parse(lastLine(origin.out)).at("frames"), 0);
    EXPECT_EQ(rtsg({"replay", "--json", log, "--verify"}).status, 0);
    EXPECT_EQ(rtsg({"replay", "--json", folder / "mirrored.rlog", "--verify"}).status, 0);
}

/// Without --for an interruption is the end that was meant; with it the end is another.
TEST_F(Mirror, AnInterruptionIsTheEndWhereNoneWasStated) {
    serve({"--for", "120s"}, "ipc://" + folder / "socket");
    const std::string film = folder / "m.gif", sound = folder / "m.wav", log = folder / "m.rlog";
    for (const bool stated : {true, false}) {
        writeFile(film, "old");
        writeFile(sound, "old");
        std::vector<std::string> arguments{"mirror", "--json",   endpoint, "--render", film, "--listen",
                                           sound,    "--size",   "16x10",  "--rays",   "50", "--wait",
                                           "60s",    "--record", log,      "--force"};
        if (stated) arguments.insert(arguments.end(), {"--for", "100s"});
        std::filesystem::remove(log);
        Program mirror(arguments, streams());
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (std::chrono::steady_clock::now() < end) {
            const Outcome info = rtsg({"info", log, "--json"});
            if (info.status == 0 && json::parse(info.out).at("duration_s") > 1) break;
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
        }
        mirror.signal(SIGINT);
        const Outcome followed = mirror.wait();
        EXPECT_EQ(followed.status, stated ? 1 : 0) << followed.err;
        EXPECT_EQ(readFile(film) == "old", stated);
        EXPECT_EQ(readFile(sound) == "old", stated);
        const json report = json::parse(followed.out);
        EXPECT_EQ(report.at("pictures") == 0, stated) << report;
        EXPECT_EQ(report.at("sound_seconds") == 0, stated) << report;
        if (!stated) {
            EXPECT_EQ(readFile(film).substr(0, 3), "GIF");
        }
    }
}

/// A request with a time goes to the nodes that have the names at that time.
TEST_F(Mirror, RequestsGoToTheWorldOfTheirTime) {
    const auto world = [](const std::string& first, const std::string& next) {
        return "#X3D V4.0 utf8\nPROFILE Immersive\n" + first +
               "DEF GO BooleanFilter { }\nDEF T TimeTrigger { }\nDEF B Transform { }\n"
               "DEF S Script { inputOnly SFTime go url \"ecmascript: function go(v){ Browser.loadURL(new MFString('" +
               next +
               "'), new MFString()); }\" }\nDEF CLOCK TimeSensor { loop TRUE }\n"
               "ROUTE GO.inputTrue TO T.set_boolean\nROUTE T.triggerTime TO S.go\n";
    };
    writeFile(file, world("DEF BEFORE Group { }\n", "b.x3dv"));
    writeFile(folder / "b.x3dv", world("", "scene.x3dv"));
    serve({"--for", "120s", "--upstream", "edits"}, "ipc://" + folder / "socket");
    const Outcome outcome = rtsg({"mirror", endpoint, "--for", "3s", "--set", "GO.set_boolean=TRUE@.3", "--edit",
                                  "B.translation=4 5 6@2.5", "--lock", "B=1s@2.4", "--save", folder / "m.x3dv"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("3 requests sent, 3 accepted"));
    EXPECT_THAT(readFile(folder / "m.x3dv"), HasSubstr("translation 4 5 6"));
    EXPECT_THAT(readFile(folder / "m.x3dv"), testing::Not(HasSubstr("BEFORE")));
}

TEST_F(Mirror, WhatHasNoMeaningIsRefused) {
    for (const char* how : {"block", "resync"}) {
        const Outcome outcome =
            rtsg({"mirror", "ipc://" + folder / "none", "--when-slow", how, "--max-lag", "1s", "--wait", "0"});
        EXPECT_EQ(outcome.status, 2) << outcome.err;
        EXPECT_THAT(outcome.err, HasSubstr("--max-lag"));
    }
    const Outcome named = rtsg({"mirror", "ipc://" + folder / "none", "--name", std::string(201, 'x'), "--wait", "0"});
    EXPECT_EQ(named.status, 2) << named.err;
    EXPECT_THAT(named.err, HasSubstr("a name of 201 bytes"));
}

TEST_F(Mirror, KeysLetInOnlyThoseWhoHaveThem) {
    const std::string keys = folder / "keys";
    serve({"--for", "3s", "--linger", "0", "--key", keys}, "tcp://127.0.0.1:*");
    Program with({"mirror", "--json", endpoint, "--key", keys, "--for", "500ms", "--wait", "60s"}, streams());
    Program without({"mirror", "--json", endpoint, "--wait", "1s"}, streams());
    const Outcome a = with.wait(), b = without.wait();
    EXPECT_EQ(a.status, 0) << a.err;
    EXPECT_EQ(b.status, 1) << b.out;
    EXPECT_EQ(json::parse(b.out).at("frames"), 0);
    EXPECT_THAT(b.err, HasSubstr("does not answer without --key"));
    const std::string empty = folder / "empty";
    writeFile(empty, "");
    EXPECT_THAT(rtsg({"mirror", endpoint, "--key", empty}).err,
                HasSubstr("empty: error: a client needs server-public"));
    EXPECT_THAT(rtsg({"serve", file, "--key", empty, "--for", "0s"}).err,
                HasSubstr("empty: error: a server needs server-public and server-secret"));
    // Nor has it those whose key is another's.
    const std::string others = folder / "others";
    EXPECT_EQ(rtsg({"serve", file, "--key", others, "--for", "0s", "--bind", "ipc://" + folder / "alone"}).status, 0);
    const Outcome c = rtsg({"mirror", endpoint, "--key", others, "--wait", "500ms"});
    EXPECT_EQ(c.status, 1);
    EXPECT_THAT(c.err, HasSubstr("whose list lacks the key"));
    EXPECT_EQ(server->wait().status, 0);
}

TEST_F(Mirror, KeyFilesAreMadeForEachSide) {
    const std::string keys = folder / "hall.key", one = folder / "one.key", two = folder / "two.key";
    const Outcome created = rtsg({"keys", keys, "--client", one});
    EXPECT_EQ(created.status, 0) << created.err;
    EXPECT_THAT(created.out, HasSubstr(one + ": for rtsg mirror --key"));
    EXPECT_EQ(rtsg({"keys", keys, "--client", two, "--upstream", "events", "--name", "Kim Doe"}).status, 0);
    EXPECT_THAT(readFile(keys), testing::ContainsRegex("\nclient-public .{40} events Kim Doe\n"));
    EXPECT_THAT(readFile(one), testing::Not(HasSubstr("server-secret")));
    EXPECT_EQ(std::filesystem::status(one).permissions(),
              std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    serve({"--for", "5s", "--linger", "0", "--key", keys}, "tcp://127.0.0.1:*");
    Program first({"mirror", "--json", endpoint, "--key", one, "--for", "300ms", "--wait", "60s"}, streams());
    Program second({"mirror", "--json", endpoint, "--key", two, "--for", "300ms", "--wait", "60s", "--set",
                    "FLAG.set_boolean=TRUE@0"},
                   streams());
    for (Program* mirror : {&first, &second}) {
        const Outcome followed = mirror->wait();
        EXPECT_EQ(followed.status, 0) << followed.err;
    }
    const Outcome without = rtsg({"mirror", endpoint, "--wait", "500ms"});
    EXPECT_EQ(without.status, 1);
    // Nothing is replaced, and what cannot be meant makes no file.
    const std::string before = readFile(keys), own = readFile(one);
    EXPECT_EQ(rtsg({"keys", keys}).status, 1);
    EXPECT_EQ(rtsg({"keys", keys, "--client", one}).status, 1);
    EXPECT_EQ(rtsg({"keys", one, "--client", folder / "three.key"}).status, 1) << "no server's";
    EXPECT_EQ(rtsg({"keys", keys, "--client", folder / "three.key", "--name", "Kim"}).status, 2);
    EXPECT_EQ(rtsg({"keys", keys, "--upstream", "code"}).status, 2);
    EXPECT_EQ(readFile(keys), before);
    EXPECT_EQ(readFile(one), own);
    EXPECT_FALSE(std::filesystem::exists(folder / "three.key"));
}

/// It has what it came for: its server is not to take it for lost, nor keep its place.
TEST_F(Mirror, LeavesWhenItHasSeenEnoughThoughItStillDraws) {
    serve({"--for", "60s", "--peers", "1"}, "ipc://" + folder / "one");
    const std::string drawing = streams();
    Program first({"mirror", endpoint, "--for", "200ms", "--wait", "60s", "--render", folder / "a%d.png", "--fps", "10",
                   "--size", "1920x1080", "--integrator", "path", "--spp", "100000"},
                  drawing);
    while (!std::filesystem::exists(drawing + ".out")) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::this_thread::sleep_for(std::chrono::milliseconds(200));  // it is first, if only most often
    const Outcome second = rtsg({"mirror", "--json", endpoint, "--for", "200ms", "--wait", "20s"});
    EXPECT_EQ(second.status, 0) << second.err;
    EXPECT_EQ(readFile(drawing + ".out"), "") << "the first one still draws";
}

TEST_F(Mirror, ServerRefusesToBeOpenToOthersWithoutKeys) {
    const Outcome outcome = rtsg({"serve", file, "--bind", "tcp://0.0.0.0:*", "--for", "100ms"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("(--key FILE, or --insecure) [keys]"));
    serve({"--for", "60s"}, "ipc://" + folder / "socket");
    const Outcome relayed = rtsg({"relay", endpoint, "--bind", "tcp://0.0.0.0:*", "--for", "20s"});
    EXPECT_EQ(relayed.status, 1);
    EXPECT_THAT(relayed.err, HasSubstr("(--serve-key FILE, or --insecure) [keys]"));
    EXPECT_EQ(relayed.out, "") << "it has relayed nothing";
}

}  // namespace
}  // namespace rtsg::test
