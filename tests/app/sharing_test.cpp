// Mirrors, logs and replays as a script uses them: two processes, and what must be the same in both.
#include "program.h"

#include <algorithm>
#include <sstream>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Mirror : public CommandLine {
  protected:
    void serve(std::vector<std::string> more, const std::string& bind) {
        std::vector<std::string> arguments{"serve", file, "--bind", bind, "--fps", "30", "--json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        server = std::make_unique<Program>(arguments, streams());
        const std::string line = server->firstLine();
        ASSERT_NE(line, "");
        endpoint = json::parse(line).at("endpoint");
    }

    std::unique_ptr<Program> server;
    std::string endpoint;
};

void expectEqual(const json& mirror) {
    EXPECT_EQ(mirror.at("equal"), true) << mirror;
    EXPECT_EQ(mirror.at("hash"), mirror.at("origin_hash")) << mirror;
    EXPECT_EQ(mirror.at("divergences"), 0) << mirror;
    EXPECT_GT(mirror.at("frames"), 1) << mirror;
    EXPECT_GT(mirror.at("bytes"), 0) << mirror;
}

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
    const json told = json::parse(rtsg({"replay", log, "--blame", "BOX.scale", "--json"}).out).at("steps");
    ASSERT_EQ(told.size(), 3u) << told;
    EXPECT_EQ(told[0].at("author"), "");
    EXPECT_EQ(told[1].at("author"), "Ann");
    EXPECT_EQ(told[1].at("value"), "1 2 3");
    EXPECT_EQ(told[2].at("value"), "4 5 6");
    for (const char* wrong : {"BOX.nothing", "NOBODY.scale", "BOX"}) {
        const Outcome none = rtsg({"replay", log, "--blame", wrong});
        EXPECT_EQ(none.status, 1) << none.out;
        EXPECT_NE(none.err, "");
        EXPECT_EQ(none.out, "");
    }
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

/// What went before it is not what it sees: its time begins with the state that the session is in.
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
    // Of those that are followed none goes.
    Program box({"mirror", endpoint, "--part", "BOX", "--for", "20s"}, streams());
    Program clock({"mirror", endpoint, "--part", "CLOCK", "--for", "20s"}, streams());
    std::this_thread::sleep_for(std::chrono::seconds(2));
    const Outcome third = rtsg({"mirror", endpoint, "--part", "PATH", "--for", "0.1s", "--wait", "300ms"});
    EXPECT_EQ(third.status, 1);
    EXPECT_THAT(third.err, HasSubstr("as many parts"));
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
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.9s", "--fps", "10"}).status, 0);  // moves in every frame
    const Outcome replayed =
        rtsg({"replay", log, "--render", folder / "p%02d.png", "--size", "16x9", "--fps", "10", "--listen",
              folder / "r.wav", "--rays", "100", "--export", folder / "r.mcap", "--json"});
    ASSERT_EQ(replayed.status, 0) << replayed.err;
    const json report = json::parse(replayed.out);
    EXPECT_EQ(report.at("flattenings"), 1);
    EXPECT_EQ(report.at("worlds"), 1);
    // Of the states recorded: the one that was loaded, the start of the clock, in which nothing moves, and nine moves.
    EXPECT_EQ(report.at("frames"), 11);
    EXPECT_EQ(report.at("commits"), 10);
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
    // Nor has it those whose key is another's.
    const std::string others = folder / "others";
    EXPECT_EQ(rtsg({"serve", file, "--key", others, "--for", "0s", "--bind", "ipc://" + folder / "alone"}).status, 0);
    const Outcome c = rtsg({"mirror", endpoint, "--key", others, "--wait", "500ms"});
    EXPECT_EQ(c.status, 1);
    EXPECT_THAT(c.err, HasSubstr("whose list lacks the key"));
    EXPECT_EQ(server->wait().status, 0);
}

TEST_F(Mirror, ServerRefusesToBeOpenToOthersWithoutKeys) {
    const Outcome outcome = rtsg({"serve", file, "--bind", "tcp://0.0.0.0:*", "--for", "100ms"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("keys"));
}

/// kill -9, and the mirror that follows has the rest of the session without a second snapshot.
TEST_F(Mirror, AServerThatWasKilledGoesOnFromItsLog) {
    const std::string log = folder / "session.rlog";
    serve({"--record", log}, "tcp://127.0.0.1:*");
    Program mirror({"mirror", endpoint, "--for", "3s", "--wait", "60s", "--json"}, streams());
    const auto recorded = [&] {
        const Outcome info = rtsg({"info", log, "--json"});
        return info.status == 0 ? json::parse(info.out).at("frames").get<int>() : 0;
    };
    for (int tries = 0; tries < 600 && recorded() < 30; ++tries)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    server->signal(SIGKILL);
    EXPECT_EQ(server->wait().status, 128 + SIGKILL);
    const int before = recorded();
    ASSERT_GE(before, 30);
    serve({"--resume", log, "--for", "4s"}, endpoint);
    const Outcome followed = mirror.wait();
    ASSERT_EQ(followed.status, 0) << followed.err;
    const json report = json::parse(followed.out);
    expectEqual(report);
    EXPECT_EQ(report.at("restarts"), 0) << report;
    EXPECT_GT(report.at("sequence"), before) << report;
    const Outcome ended = server->wait();
    EXPECT_EQ(ended.status, 0) << ended.err;
    const json summary = json::parse(lastLine(ended.out));
    // One that was a frame ahead of the log, by chance, takes the snapshot.
    EXPECT_EQ(summary.at("resumed").get<int>() + summary.at("snapshots").get<int>(), 1) << summary;
    EXPECT_EQ(report.at("snapshots").get<int>(), 1 + summary.at("snapshots").get<int>()) << report;
    const Outcome verified = rtsg({"replay", log, "--verify", "--json"});
    EXPECT_EQ(verified.status, 0) << verified.err;
    EXPECT_EQ(json::parse(verified.out).at("hash"), summary.at("hash"));
}

/// Another server at the same place, without the session of the first: pictures and sound go on, in the new states.
TEST_F(Mirror, PicturesGoOnWithTheStatesOfAServerThatBeganAnew) {
    serve({}, "tcp://127.0.0.1:*");
    Program mirror(
        {"mirror", endpoint, "--for", "3s", "--fps", "10", "--render", folder / "p%02d.png", "--size", "16x9",
         "--listen", folder / "p.wav", "--rays", "50", "--wait", "60s", "--record", folder / "p.rlog", "--json"},
        streams());
    // Early: on a busy machine pictures lag behind the states, of which none may be left to come.
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!std::filesystem::exists(folder / "p01.png") && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    server->signal(SIGKILL);
    server->wait();
    serve({}, endpoint);
    const Outcome followed = mirror.wait();
    ASSERT_EQ(followed.status, 0) << followed.err;
    const json report = json::parse(followed.out);
    expectEqual(report);
    EXPECT_EQ(report.at("restarts"), 1) << report;
    EXPECT_EQ(report.at("pictures"), 30) << report;
    EXPECT_DOUBLE_EQ(report.at("sound_seconds").get<double>(), 3);
    EXPECT_EQ(report.at("snapshots"), 2) << report;
    EXPECT_EQ(report.at("picture_states"), report.at("sound_states"));
    server->signal(SIGTERM);
    server->wait();
    // Its log holds both sessions, and cannot know how far the first went on.
    const Outcome whole = rtsg({"replay", folder / "p.rlog", "--verify", "--json"});
    EXPECT_EQ(whole.status, 1) << whole.out;
    EXPECT_THAT(whole.err, HasSubstr("the session was not closed: nothing tells what came after state "));
    const json replayed = json::parse(whole.out);
    EXPECT_EQ(replayed.at("gaps"), 0);
    EXPECT_EQ(replayed.at("unclosed_sessions"), 1);
    EXPECT_EQ(replayed.at("t"), report.at("t"));
    const Outcome shown = rtsg({"replay", folder / "p.rlog"});
    EXPECT_EQ(shown.status, 0) << shown.err;
    EXPECT_THAT(shown.out, HasSubstr("; 1 session within it not closed"));
}

/// A log as a session: played, and played again, by commands of a mirror and of standard input.
TEST_F(Mirror, ALogIsPlayedToMirrorsAndDoesWhatTheySay) {
    const std::string log = folder / "played.rlog";
    const Outcome made = rtsg({"record", file, "-o", log, "--for", "4s", "--fps", "20", "--json"});
    ASSERT_EQ(made.status, 0) << made.err;
    const std::string end = json::parse(made.out).at("hash");
    const auto play = [&](std::vector<std::string> more, const std::string& input = {}) {
        std::vector<std::string> arguments{"serve", log, "--bind", "tcp://127.0.0.1:*", "--json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        server = std::make_unique<Program>(arguments, streams(), input);
        const std::string line = server->firstLine();
        ASSERT_NE(line, "");
        endpoint = json::parse(line).at("endpoint");
    };
    play({"--rate", "4", "--for", "8s", "--upstream", "events"});
    // To its last state, whose hash is the recorded one.
    const Outcome followed = rtsg({"mirror", endpoint, "--control", "seek 3.9", "--control", "status", "--json"});
    ASSERT_EQ(followed.status, 0) << followed.err;
    const json report = json::parse(followed.out);
    expectEqual(report);
    EXPECT_EQ(report.at("hash"), end);
    EXPECT_THAT(followed.err, HasSubstr("\"length\":4.000000"));
    EXPECT_EQ(server->wait().status, 0);

    // Those that may not send, may not play.
    play({"--for", "8s"});
    const Outcome refused = rtsg({"mirror", endpoint, "--control", "pause", "--json"});
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.err, HasSubstr("refused: this server takes no requests"));
    EXPECT_EQ(server->wait().status, 0);

    play({"--for", "1s", "--paused", "--control"}, "step 3\nnonsense\nseek 2s");
    const Outcome ended = server->wait();
    EXPECT_EQ(ended.status, 0) << ended.err;
    EXPECT_THAT(ended.out, HasSubstr("\"t\":0.150000"));
    EXPECT_THAT(ended.out, HasSubstr("refused: not understood"));
    EXPECT_EQ(json::parse(lastLine(ended.out)).at("player").at("t"), 2.0);
}

/// Served as far as it goes, and said; what has no meaning then is wrong usage.
TEST_F(Mirror, ALogThatIsDamagedIsPlayedAsFarAsItGoes) {
    const std::string log = folder / "hurt.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "1s", "--fps", "20"}).status, 0);
    const auto played = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments{"serve", log,     "--bind",   "ipc://" + folder / "hurt",
                                           "--for", "300ms", "--linger", "0"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return rtsg(arguments);
    };
    EXPECT_EQ(played({"--rate", "10"}).status, 0);
    for (const std::string option : {"--fps", "--error", "--keyframe-seconds", "--rotate"}) {
        const Outcome useless = played({option, "30"});
        EXPECT_EQ(useless.status, 2) << option;
        EXPECT_THAT(useless.err, HasSubstr(option + ": is of a scene"));
    }
    const std::string bytes = readFile(log);
    std::string hurt = bytes;
    hurt[hurt.size() * 3 / 4] = static_cast<char>(hurt[hurt.size() * 3 / 4] ^ 1);
    writeFile(log, hurt);
    const Outcome damaged = played({"--rate", "10", "--loop"});
    EXPECT_EQ(damaged.status, 1);
    EXPECT_THAT(damaged.err, HasSubstr("are damaged: "));
    EXPECT_EQ(damaged.err.find("are damaged"), damaged.err.rfind("are damaged")) << "each place once: " << damaged.err;
    // What does not begin as a log does is one by its name.
    writeFile(log, "rubbish" + bytes);
    const Outcome behind = played({"--rate", "10"});
    EXPECT_EQ(behind.status, 1);
    EXPECT_THAT(behind.err, HasSubstr("bytes 0 to 7 are damaged"));
    writeFile(log, "");
    EXPECT_THAT(played({}).err, HasSubstr("not a log"));
}

/// What is made of a log that is played again and again goes on over its end.
TEST_F(Mirror, PicturesAndSoundGoOnWhereALogBeginsAgain) {
    const std::string log = folder / "again.rlog";
    endpoint = "ipc://" + folder / "again";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "500ms", "--fps", "20"}).status, 0);
    Program player({"serve", log, "--loop", "--for", "6s", "--bind", endpoint, "--linger", "2s"}, streams());
    ASSERT_NE(player.firstLine(), "");
    const Outcome mirrored = rtsg({"mirror", endpoint, "--listen", folder / "again.wav", "--render",
                                   folder / "again%d.png", "--fps", "10", "--size", "16x9", "--rays", "10", "--json"});
    ASSERT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_EQ(player.wait().status, 0);
    const json report = json::parse(lastLine(mirrored.out));
    EXPECT_GT(report.at("sound_seconds"), 1) << mirrored.out;
    EXPECT_GE(report.at("pictures"), 10) << mirrored.out;
}

/// --for counts on over its end too, with every state and with --live.
TEST_F(Mirror, ALengthIsReachedWhereALogBeginsAgain) {
    const std::string log = folder / "short.rlog";
    endpoint = "ipc://" + folder / "short";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "500ms", "--fps", "20"}).status, 0);
    Program player({"serve", log, "--loop", "--bind", endpoint}, streams());
    ASSERT_NE(player.firstLine(), "");
    for (const bool live : {false, true}) {
        std::vector<std::string> arguments{"mirror",   endpoint,
                                           "--for",    "1.5s",
                                           "--listen", folder / "short.wav",
                                           "--render", folder / "short%d.png",
                                           "--fps",    "10",
                                           "--size",   "16x9",
                                           "--rays",   "10",
                                           "--json",   "--force"};
        if (live) arguments.push_back("--live");
        const Outcome mirrored = rtsg(arguments);
        ASSERT_EQ(mirrored.status, 0) << mirrored.err;
        const json report = json::parse(lastLine(mirrored.out));
        EXPECT_GE(report.at("t"), 1.5);
        EXPECT_DOUBLE_EQ(report.at("sound_seconds").get<double>(), 1.5) << report;
        EXPECT_EQ(report.at("restarts"), report.at("snapshots").get<int>() - 1) << report;
        EXPECT_GE(report.at("restarts"), 2) << report;
        const int skipped = live ? report.at("live").at("pictures_skipped").get<int>() : 0;
        EXPECT_EQ(report.at("pictures").get<int>() + skipped, 15) << report;
        if (live) {
            EXPECT_LE(report.at("live").at("states"), report.at("frames")) << report;
        }
        const std::vector<double> times = report.at("picture_times");
        EXPECT_GT(times.size(), 3U);
        EXPECT_TRUE(std::ranges::is_sorted(times)) << report;
    }
    player.signal(SIGTERM);
    EXPECT_EQ(player.wait().status, 0);
}

/// As a log that is paused does, or one at its end.
TEST_F(Mirror, OfASceneThatStandsStillTheClockCounts) {
    const std::string log = folder / "still.rlog";
    endpoint = "ipc://" + folder / "still";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "500ms", "--fps", "20"}).status, 0);
    Program player({"serve", log, "--paused", "--bind", endpoint, "--upstream", "events"}, streams());
    ASSERT_NE(player.firstLine(), "");
    const auto follow = [&](const std::string& option, const std::string& made) {
        return rtsg({"mirror", endpoint, "--for", "200ms", "--wait", "300ms", option, folder / made, "--size", "16x9"});
    };
    const Outcome asked = rtsg({"mirror", endpoint, "--for", "200ms", "--set", "FLAG.set_boolean=TRUE@0"});
    EXPECT_EQ(asked.status, 1);
    EXPECT_THAT(asked.err, HasSubstr("refused: a log is played"));
    const Outcome one = follow("--render", "still.png");
    EXPECT_EQ(one.status, 0) << one.err;
    EXPECT_TRUE(std::filesystem::exists(folder / "still.png"));
    for (const auto& [option, made] : {std::pair("--render", "still%d.png"), std::pair("--record", "other.rlog")}) {
        const Outcome many = follow(option, made);
        EXPECT_EQ(many.status, 1);
        EXPECT_THAT(many.err, HasSubstr("stands still after 0 of 0.2 s"));
    }
    player.signal(SIGTERM);
    EXPECT_EQ(player.wait().status, 0);
}

TEST_F(Mirror, ARelayPassesASessionOn) {
    serve({"--for", "20s", "--upstream", "events"}, "tcp://127.0.0.1:*");
    Program relay({"relay", endpoint, "--for", "20s", "--upstream", "events", "--json"}, streams());
    const std::string line = relay.firstLine();
    ASSERT_NE(line, "");
    const std::string leaf = json::parse(line).at("endpoint");
    const Outcome mirror = rtsg({"mirror", leaf, "--for", "2s", "--set", "FLAG.set_boolean=TRUE@0.5", "--json"});
    ASSERT_EQ(mirror.status, 0) << mirror.err;
    const json report = json::parse(mirror.out);
    expectEqual(report);
    EXPECT_EQ(report.at("accepted"), 1);
    // Commands are the player's alone, which may be far behind it.
    const Outcome command = rtsg({"mirror", leaf, "--for", "100ms", "--control", "pause"});
    EXPECT_EQ(command.status, 1);
    EXPECT_THAT(command.err, HasSubstr("a relay passes no commands on"));
    // Having had none, too.
    const Outcome nobody = rtsg({"relay", "ipc://" + folder / "nobody", "--for", "100ms"});
    EXPECT_EQ(nobody.status, 1);
    EXPECT_THAT(nobody.err, HasSubstr("no origin"));
    // Without its origin it ends, and says so.
    server->signal(SIGKILL);
    server->wait();
    const Outcome ended = relay.wait();
    EXPECT_EQ(ended.status, 1);
    EXPECT_THAT(ended.err, HasSubstr("no origin for 5"));
    EXPECT_EQ(json::parse(lastLine(ended.out)).at("requests"), 1);
}

/// As a scene that is served, or mirrored.
TEST_F(Mirror, ALogOrARelayThatIsInterruptedBeforeItsTimeIsStatusOne) {
    const std::string log = folder / "cut.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "500ms"}).status, 0);
    serve({"--for", "60s"}, "ipc://" + folder / "socket");
    for (const std::vector<std::string>& verb : {std::vector<std::string>{"serve", log}, {"relay", endpoint}}) {
        for (const bool limited : {false, true}) {
            std::vector<std::string> arguments = verb;
            if (limited) arguments.insert(arguments.end(), {"--for", "60s"});
            Program program(arguments, streams());
            ASSERT_NE(program.firstLine(), "");
            program.signal(SIGINT);
            const Outcome ended = program.wait();
            EXPECT_EQ(ended.status, limited ? 1 : 0) << verb[0] << ": " << ended.err;
            EXPECT_EQ(ended.err.contains("of 60 s"), limited) << ended.err;
        }
    }
}

/// What a server had kept comes at once, and is no rate.
TEST_F(Mirror, FramesASecondAreThoseSinceItJoined) {
    serve({"--for", "60s"}, "ipc://" + folder / "socket");
    const Outcome first = rtsg({"mirror", endpoint, "--for", "500ms"});
    EXPECT_EQ(first.status, 0) << first.err;
    const json report = json::parse(rtsg({"mirror", endpoint, "--for", "0s", "--json"}).out);
    EXPECT_GT(report.at("frames"), 0);
    EXPECT_EQ(report.at("fps"), 0) << report;
}

TEST_F(Mirror, ALongestRecordIsKept) {
    serve({"--for", "20s"}, "tcp://127.0.0.1:*");
    const Outcome small = rtsg({"mirror", endpoint, "--for", "1s", "--wait", "2s", "--max-record", "100", "--json"});
    EXPECT_EQ(small.status, 1);
    EXPECT_EQ(rtsg({"mirror", endpoint, "--for", "1s", "--max-record", "1MB", "--json"}).status, 0);
}

TEST_F(Mirror, LogsRotateAndAreResumed) {
    const std::string log = folder / "turning.rlog";
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--record", log, "--rotate", "often"}).status, 2);
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--record", log, "--keep", "1min"}).status, 2);
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--rotate", "1min"}).status, 2) << "without a log";
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--rate", "2"}).status, 2) << "of a log";
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--peers", "99999999999999999999"}).status, 2);
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--base", folder / "none"}).status, 2);
    EXPECT_EQ(
        rtsg({"serve", file, "--for", "100ms", "--record", folder / "short.rlog", "--rotate", "20ms", "--keep", "50ms"})
            .status,
        0);
    const Outcome done = rtsg({"serve", file, "--for", "2s", "--fps", "30", "--record", log, "--rotate", "0.5s"});
    ASSERT_EQ(done.status, 0) << done.err;
    for (const char* piece : {"turning.0001.rlog", "turning.0003.rlog", "turning.rlog"})
        EXPECT_EQ(rtsg({"replay", folder / piece, "--verify"}).status, 0) << piece;
    // Who opens one of them is told of the others; in another order than they were written in they are no log.
    const Outcome last = rtsg({"replay", log});
    EXPECT_THAT(last.err, HasSubstr("turning.0001.rlog to "));
    EXPECT_THAT(last.out, HasSubstr("a piece that begins "));
    EXPECT_GE(json::parse(rtsg({"replay", log, "--json"}).out).at("before_s"), 1.4);
    EXPECT_EQ(json::parse(rtsg({"replay", folder / "turning.0001.rlog", "--json"}).out).at("before_s"), 0);
    EXPECT_THAT(rtsg({"info", log}).err, HasSubstr("cat "));
    EXPECT_EQ(rtsg({"replay", folder / "turning.0001.rlog"}).err, "");
    const std::string first = readFile(folder / "turning.0001.rlog"), second = readFile(folder / "turning.0002.rlog");
    writeFile(folder / "right.rlog", first + second);
    writeFile(folder / "wrong.rlog", second + first);
    EXPECT_EQ(rtsg({"replay", folder / "right.rlog", "--verify"}).status, 0);
    const Outcome wrong = rtsg({"replay", folder / "wrong.rlog", "--verify"});
    EXPECT_EQ(wrong.status, 1);
    EXPECT_THAT(wrong.err, HasSubstr("in another order"));
    // The session's clock goes on, and not that of its last file.
    const Outcome resumed = rtsg({"serve", "--resume", log, "--for", "200ms", "--json"});
    ASSERT_EQ(resumed.status, 0) << resumed.err;
    EXPECT_NE(resumed.err.find("t = 2.000 s"), std::string::npos) << resumed.err;
    const double t = json::parse(lastLine(resumed.out)).at("t").get<double>();
    EXPECT_GT(t, 2.1);
    EXPECT_LT(t, 3.0);
    // What a log says itself is not said otherwise: neither obeyed nor ignored.
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"serve", "--resume", log, "--at", "now", "--for", "100ms"},
          {"serve", log, "--at", "2000-01-01", "--for", "100ms"},
          {"serve", log, "--await", "1", "--for", "100ms"}}) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, testing::HasSubstr("a log")) << outcome.err;
    }
}

TEST_F(Mirror, ResumingAsksForALogAndWritesNoOther) {
    EXPECT_EQ(rtsg({"serve"}).status, 2);
    EXPECT_EQ(rtsg({"serve", "--resume", folder / "none.rlog"}).status, 1);
    EXPECT_EQ(rtsg({"serve", "--resume", folder / "none.rlog", "--record", folder / "other.rlog"}).status, 2);
    EXPECT_EQ(rtsg({"serve", "--resume", folder / "none.rlog", "--mode", "lossy"}).status, 2);
}

class Replay : public CommandLine {
  protected:
    void record(const std::string& name, const std::string& text) {
        const std::string source = folder / "source.x3dv";
        writeFile(source, text);
        const Outcome outcome = rtsg({"record", source, "-o", name, "--for", "1s", "--fps", "20", "--json"});
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        recorded = json::parse(outcome.out);
    }
    json recorded;
    const std::string log = folder / "a.rlog";
};

TEST_F(Replay, VerifiesEveryState) {
    record(log, scene());
    const Outcome outcome = rtsg({"replay", "--json", log, "--verify"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json report = json::parse(outcome.out);
    EXPECT_GE(report.at("frames"), 21);
    EXPECT_EQ(report.at("frames"), report.at("verified"));
    EXPECT_TRUE(report.at("first_divergence").is_null());
    EXPECT_EQ(report.at("hash"), recorded.at("hash"));
}

TEST_F(Replay, FindsAFlippedByteWhereverItIs) {
    record(log, scene());
    const std::string bytes = readFile(log);
    const std::size_t keyframe = bytes.find("RTSGrec1", 8);
    ASSERT_NE(keyframe, std::string::npos);
    const std::size_t body = bytes.find("BOX", keyframe);  // the name of a node
    ASSERT_NE(body, std::string::npos);
    const std::size_t rest = bytes.size() - keyframe;
    for (const std::size_t at : {keyframe / 2, keyframe + 70, body, keyframe + rest / 2, keyframe + rest * 3 / 4}) {
        std::string broken = bytes;
        broken[at] = static_cast<char>(broken[at] ^ 0x10);
        writeFile(folder / "broken.rlog", broken);
        const Outcome outcome = rtsg({"replay", "--json", folder / "broken.rlog", "--verify"});
        EXPECT_EQ(outcome.status, 1) << "byte " << at;
        EXPECT_NE(outcome.err, "") << "byte " << at;
        if (at < keyframe) continue;  // without its head it is no log at all
        const json report = json::parse(outcome.out);
        ASSERT_FALSE(report.at("first_divergence").is_null()) << report;
        EXPECT_GT(report.at("first_divergence").at("frame"), 0);
    }
}

TEST_F(Replay, ATruncatedLogKeepsWhatIsWhole) {
    record(log, scene());
    const std::string bytes = readFile(log);
    std::size_t record = 0;  // the ninth
    for (int i = 0; i < 9; ++i) record = bytes.find("RTSGrec1", record + 1);
    ASSERT_LT(record, bytes.size());
    writeFile(folder / "cut.rlog", bytes.substr(0, record - 5));
    const Outcome outcome = rtsg({"replay", "--json", folder / "cut.rlog", "--verify"});
    EXPECT_EQ(outcome.status, 1);
    const json report = json::parse(outcome.out);
    EXPECT_GT(report.at("frames"), 2);
    EXPECT_EQ(report.at("frames"), report.at("verified"));
    EXPECT_FALSE(report.at("first_divergence").is_null());
    writeFile(folder / "garbage.rlog", std::string(5000, 'x'));
    EXPECT_EQ(rtsg({"replay", "--json", folder / "garbage.rlog", "--verify"}).status, 1);
}

TEST_F(Replay, ALogThatWasNotClosedDoesNotVerify) {
    record(log, scene());
    const std::string bytes = readFile(log);
    std::vector<std::size_t> records;
    for (std::size_t at = bytes.find("RTSGrec1"); at != std::string::npos; at = bytes.find("RTSGrec1", at + 1))
        records.push_back(at);
    // Between whole records: nothing is damaged, and nothing but the missing index tells that there was more.
    for (const std::size_t left : {records.size() - 1, records.size() - 4, std::size_t{8}}) {
        writeFile(folder / "cut.rlog", bytes.substr(0, records[left]));
        const Outcome outcome = rtsg({"replay", "--json", folder / "cut.rlog", "--verify"});
        EXPECT_EQ(outcome.status, 1) << left;
        EXPECT_NE(outcome.err.find("the log was not closed"), std::string::npos) << outcome.err;
        const json report = json::parse(outcome.out);
        EXPECT_EQ(report.at("frames"), report.at("verified"));
        EXPECT_EQ(report.at("damaged"), 0);
        EXPECT_EQ(report.at("closed"), false);
        EXPECT_FALSE(report.at("first_divergence").is_null());
        EXPECT_EQ(rtsg({"replay", folder / "cut.rlog"}).status, 0) << "only who asks for all of it misses something";
    }
}

/// Its writer is in the middle of a record: that is no damage, and all that is there is verified.
TEST_F(Replay, ALogThatIsBeingWrittenIsVerifiedAsFarAsItGoes) {
    record(log, scene());
    std::filesystem::resize_file(log, std::filesystem::file_size(log) - 5);
    const int writer = ::open(log.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
    ASSERT_EQ(::flock(writer, LOCK_EX | LOCK_NB), 0);
    const Outcome outcome = rtsg({"replay", "--json", log, "--verify"});
    EXPECT_EQ(outcome.status, 1) << "not all of it is there";
    EXPECT_THAT(outcome.err, HasSubstr("the log is still being written"));
    const json report = json::parse(outcome.out);
    EXPECT_GT(report.at("frames"), 2);
    EXPECT_EQ(report.at("frames"), report.at("verified"));
    EXPECT_EQ(report.at("damaged"), 0);
    EXPECT_EQ(report.at("being_written"), true);
    EXPECT_EQ(rtsg({"replay", log}).status, 0);
    const Outcome described = rtsg({"info", log});
    EXPECT_EQ(described.status, 0) << described.err;
    EXPECT_THAT(described.out, HasSubstr("it is still being written"));
    ::close(writer);
    EXPECT_THAT(rtsg({"replay", log, "--verify"}).err, HasSubstr("truncated"));
    EXPECT_EQ(rtsg({"info", log}).status, 1);
}

TEST_F(Replay, KeyframesComeAsOftenAsAsked) {
    const std::string source = folder / "source.x3dv";
    writeFile(source, scene());
    std::vector<std::size_t> found;
    for (const char* seconds : {"0", "250ms"}) {
        ASSERT_EQ(rtsg({"record", source, "-o", log, "--for", "2s", "--fps", "20", "--force", "--keyframe-seconds",
                        seconds, "--keyframe-bytes", "1MB"})
                      .status,
                  0);
        const Outcome outcome = rtsg({"info", log, "--json"});
        found.push_back(json::parse(outcome.out).at("keyframes"));
    }
    EXPECT_GE(found[1], found[0] + 6);
    EXPECT_EQ(rtsg({"replay", log, "--verify"}).status, 0);
    EXPECT_EQ(rtsg({"record", source, "-o", log, "--keyframe-seconds", "often", "--force"}).status, 2);
}

TEST_F(Replay, ComparesLogsAndNamesTheField) {
    record(log, scene());
    const std::string same = folder / "same.rlog", other = folder / "other.rlog";
    record(same, scene());
    record(other, scene("3"));
    const Outcome equal = rtsg({"replay", "--json", log, "--diff", same});
    EXPECT_EQ(equal.status, 0) << equal.err;
    EXPECT_EQ(json::parse(equal.out).at("equal"), true);
    const Outcome different = rtsg({"replay", "--json", log, "--diff", other});
    EXPECT_EQ(different.status, 1);
    const json found = json::parse(different.out).at("first_divergence");
    EXPECT_EQ(found.at("node"), "PATH") << found;
    EXPECT_EQ(found.at("field"), "keyValue") << found;
    EXPECT_GT(found.at("frame"), 0);
    EXPECT_THAT(different.err, HasSubstr("PATH.keyValue"));
}

TEST_F(Replay, SeeksAndSaves) {
    record(log, scene());
    const std::string saved = folder / "half.x3dv";
    const Outcome outcome = rtsg({"replay", "--json", log, "--seek", "0.5s", "--save", saved, "--render",
                                  folder / "half.png", "--size", "24x16"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_DOUBLE_EQ(json::parse(outcome.out).at("t"), 0.5);
    EXPECT_THAT(readFile(saved), HasSubstr("translation 0.5 0 0"));  // 2 m within 2 s
    EXPECT_EQ(readFile(folder / "half.png").substr(1, 3), "PNG");
    // The same picture as of the scene itself at that time.
    ASSERT_EQ(rtsg({"render", file, "-o", folder / "direct.png", "--time", "0.5", "--size", "24x16"}).status, 0);
    EXPECT_EQ(readFile(folder / "half.png"), readFile(folder / "direct.png"));
}

/// What one use of it would not do is refused, before anything is opened or made.
TEST_F(Replay, OptionsThatGoNotTogetherAreWrongUsage) {
    record(log, scene());
    const std::string made = folder / "made.x3dv", other = folder / "b.rlog";
    const std::vector<std::vector<std::string>> wrong = {
        {"--rerun", file, "--compact", other},
        {"--rerun", file, "--seek", "1s"},
        {"--rerun", file, "--live"},
        {"--compact", other, "--save", made},
        {"--compact", other, "--export", folder / "a.mcap"},
        {"--compact", other, "--verify"},
        {"--compact", other, "--size", "8x8"},
        {"--diff", log, "--save", made},
        {"--diff", log, "--field", "BOX.*"},
        {"--diff", log, "--tolerance", "1"},
        {"--diff", log, "--for", "1s"},
        {"--diff", log, "--blame", "BOX.translation"},
        {"--blame", "BOX.translation", "--render", folder / "a.png"},
        {"--every", "3"},
        {"--interval", "1s", "--verify"},
        {"--export-plain"},
        {"--sound-tolerance", "-20"},
        {"--rerun", file, "--picture-tolerance", ".1"},
        {"--rerun", file, "--name", "one"},
    };
    for (std::vector<std::string> arguments : wrong) {
        arguments.insert(arguments.begin(), {"replay", log});
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, testing::ContainsRegex("goes (not together )?with --"));
    }
    for (const std::string& none : {made, other}) EXPECT_FALSE(std::filesystem::exists(none)) << none;
    EXPECT_EQ(rtsg({"replay", log, "--rerun", file, "--verify", "--save", made}).status, 0);
    EXPECT_TRUE(std::filesystem::exists(made));
}

/// A frame in its middle is gone: every use of the log says so, and makes what can be made.
TEST_F(Replay, WhatALogLacksIsSaidByEveryUseOfIt) {
    record(log, scene());
    const std::string gap = folder / "gap.rlog", shorter = folder / "short.rlog";
    std::string bytes = readFile(log);
    std::vector<std::size_t> records;
    for (std::size_t at = bytes.find("RTSGrec1"); at != std::string::npos; at = bytes.find("RTSGrec1", at + 1))
        records.push_back(at);
    bytes.erase(records[12], records[13] - records[12]);
    writeFile(gap, bytes + readFile(log));  // its own keyframes are those of the same states again
    const Outcome compacted = rtsg({"replay", gap, "--compact", shorter, "--json"});
    EXPECT_EQ(compacted.status, 1) << compacted.err;
    EXPECT_THAT(compacted.err, HasSubstr("is not complete"));
    EXPECT_EQ(json::parse(compacted.out).at("complete"), false);
    EXPECT_TRUE(std::filesystem::exists(shorter));
    const Outcome blamed = rtsg({"replay", gap, "--blame", "BOX.translation", "--json"});
    EXPECT_EQ(blamed.status, 1) << blamed.out;
    EXPECT_EQ(json::parse(blamed.out).at("complete"), false);
    const Outcome compared = rtsg({"diff", log, log, "--json"});
    EXPECT_EQ(compared.status, 0);
    EXPECT_GT(json::parse(compared.out).at("compared"), 10);
    EXPECT_EQ(json::parse(compared.out).at("in_one_alone"), 0);
    const Outcome replayed = rtsg({"replay", log, "--diff", log, "--json"});
    EXPECT_EQ(json::parse(replayed.out).at("compared"), json::parse(compared.out).at("compared"));
}

}  // namespace
}  // namespace rtsg::test
