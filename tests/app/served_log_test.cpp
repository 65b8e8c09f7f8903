// Sessions that outlive their server: resumed, played from a log, passed on by a relay, in files that rotate.
#include <algorithm>
#include <chrono>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "mirror_session.h"
#include "support/middleman.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

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
    EXPECT_EQ(report.at("holes"), 0) << "it goes on from its last state: " << report;
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

/// Another server at the same place, without the session of the first: what happened in between is missing, and said to
/// be. Pictures of that time show the last state that was known.
TEST_F(Mirror, AServerThatBeginsAnewLeavesAHoleThatIsNamed) {
    serve({}, "tcp://127.0.0.1:*");
    Program mirror(
        {"mirror", endpoint, "--for", "4s", "--fps", "10", "--render", folder / "p%02d.png", "--size", "16x9",
         "--listen", folder / "p.wav", "--rays", "50", "--wait", "60s", "--record", folder / "p.rlog", "--json"},
        streams());
    // Early: on a busy machine pictures lag behind the states, of which none may be left to come.
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!std::filesystem::exists(folder / "p.rlog") && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    server->signal(SIGKILL);
    server->wait();
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    serve({}, endpoint);
    const Outcome followed = mirror.wait();
    EXPECT_EQ(followed.status, 1) << followed.err;
    EXPECT_THAT(followed.err, HasSubstr("s of the session were missed"));
    const json report = json::parse(followed.out);
    EXPECT_EQ(report.at("holes"), 1) << report;
    EXPECT_GT(report.at("missed_s"), 1.4) << report;
    EXPECT_THAT(report.at("missing").get<std::string>(), HasSubstr("s of the session")) << report;
    const std::vector<std::uint64_t> states = report.at("picture_states");
    std::vector<std::size_t> runs;  // how often each state was, one after the other
    for (std::size_t i = 0; i < states.size(); ++i)
        if (i == 0 || states[i] != states[i - 1])
            runs.push_back(1);
        else
            ++runs.back();
    EXPECT_EQ(std::ranges::count_if(runs, [](std::size_t n) { return n > 5; }), 1) << report;
    const auto held = std::ranges::max_element(runs);
    EXPECT_GE(*held, 12U) << report;
    EXPECT_NE(held, runs.end() - 1) << "pictures go on with the states of the next session: " << report;
    expectEqual(report);
    EXPECT_EQ(report.at("restarts"), 1) << report;
    EXPECT_EQ(report.at("pictures"), 40) << report;
    EXPECT_DOUBLE_EQ(report.at("sound_seconds").get<double>(), 4);
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
    const Outcome created = rtsg({"record", file, "-o", log, "--for", "4s", "--fps", "20", "--json"});
    ASSERT_EQ(created.status, 0) << created.err;
    const std::string end = json::parse(created.out).at("hash");
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
        EXPECT_THAT(useless.err, HasSubstr(option + ": is for a scene"));
    }
    const std::string bytes = readFile(log);
    std::string hurt = bytes;
    hurt[hurt.size() * 3 / 4] = static_cast<char>(hurt[hurt.size() * 3 / 4] ^ 1);
    writeFile(log, hurt);
    const Outcome damaged = played({"--rate", "10", "--loop"});
    EXPECT_EQ(damaged.status, 1);
    EXPECT_THAT(damaged.err, HasSubstr("are damaged: "));
    EXPECT_THAT(damaged.err, HasSubstr("[log]"));
    EXPECT_THAT(damaged.err, testing::Not(HasSubstr("[command-line]")));
    EXPECT_EQ(damaged.err.find("are damaged"), damaged.err.rfind("are damaged")) << "each place once: " << damaged.err;
    // A file that does not begin like a log counts as one by its name.
    writeFile(log, "rubbish" + bytes);
    const Outcome behind = played({"--rate", "10"});
    EXPECT_EQ(behind.status, 1);
    EXPECT_THAT(behind.err, HasSubstr("bytes 0 to 7 are damaged"));
    writeFile(log, "");
    EXPECT_THAT(played({}).err, HasSubstr("not a log"));
}

/// Outputs of a log in a loop continue over its end.
TEST_F(Mirror, PicturesAndSoundGoOnWhereALogBeginsAgain) {
    const std::string log = folder / "again.rlog";
    endpoint = "ipc://" + folder / "again";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "500ms", "--fps", "20"}).status, 0);
    Program player({"serve", log, "--loop", "--for", "3s", "--bind", endpoint, "--linger", "2s"}, streams());
    ASSERT_NE(player.firstLine(), "");
    const Outcome mirrored = rtsg({"mirror", endpoint, "--listen", folder / "again.wav", "--render",
                                   folder / "again%d.png", "--fps", "10", "--size", "16x9", "--rays", "10", "--json"});
    ASSERT_EQ(mirrored.status, 0) << mirrored.err;
    EXPECT_EQ(player.wait().status, 0);
    const json report = json::parse(lastLine(mirrored.out));
    EXPECT_GT(report.at("sound_seconds"), 1) << mirrored.out;
    EXPECT_GE(report.at("pictures"), 10) << mirrored.out;
}

/// A slow machine hears few states; where it comes to one that it has heard, a whole round of the log has gone by.
TEST_F(Mirror, SoundIsWholeWhereTheSameStateOfALogComesAgain) {
    const std::string log = folder / "round.rlog";
    endpoint = "ipc://" + folder / "round";
    ASSERT_EQ(
        rtsg({"record", RTSG_SOURCE_DIR "/examples/demo/hall.x3dv", "-o", log, "--for", "100ms", "--fps", "10"}).status,
        0);
    Program player({"serve", log, "--loop", "--bind", endpoint}, streams());
    ASSERT_NE(player.firstLine(), "");
    for (int round = 0; round < 3; ++round) {
        const Outcome mirrored = rtsg({"mirror", endpoint, "--for", "700ms", "--listen", folder / "round.wav", "--live",
                                       "--rays", "4000", "--base", RTSG_SOURCE_DIR "/examples/demo", "--json"});
        ASSERT_EQ(mirrored.status, 0) << mirrored.err;
        EXPECT_DOUBLE_EQ(json::parse(lastLine(mirrored.out)).at("sound_seconds").get<double>(), .7);
    }
    player.signal(SIGTERM);
    player.wait();
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

/// A server that claims a state which it never sends holds nobody: what there is is followed, and the claim is told.
TEST_F(Mirror, AStateThatNeverComesIsNotWaitedForForLong) {
    serve({"--for", "60s"}, "tcp://127.0.0.1:*");
    const test::Middleman liar(endpoint, [](bool toClient, test::Middleman::Parts& parts) {
        constexpr std::size_t kNewest = 8 + 3 * 8;  // in a welcome, behind session, epoch and heartbeat
        if (toClient && parts[0].size() > kNewest + 8 && parts[0][5] == 16) parts[0][kNewest + 3] = 1;
        return true;
    });
    const auto start = std::chrono::steady_clock::now();
    const Outcome followed = rtsg({"mirror", liar.endpoint, "--for", "1s", "--wait", "1s", "--json"});
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(40));
    EXPECT_EQ(followed.status, 1);
    EXPECT_THAT(followed.err, HasSubstr("the origin was in state 1677"));
    EXPECT_GE(json::parse(followed.out).at("t"), 1) << followed.out;
}

/// A paused log, or one at its end, behaves in the same way.
TEST_F(Mirror, OfASceneThatStandsStillTheClockCounts) {
    const std::string log = folder / "still.rlog";
    endpoint = "ipc://" + folder / "still";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "500ms", "--fps", "20"}).status, 0);
    Program player({"serve", log, "--paused", "--bind", endpoint, "--upstream", "events"}, streams());
    ASSERT_NE(player.firstLine(), "");
    const auto follow = [&](const std::string& option, const std::string& created) {
        return rtsg(
            {"mirror", endpoint, "--for", "200ms", "--wait", "300ms", option, folder / created, "--size", "16x9"});
    };
    const Outcome asked = rtsg({"mirror", endpoint, "--for", "200ms", "--set", "FLAG.set_boolean=TRUE@0"});
    EXPECT_EQ(asked.status, 1);
    EXPECT_THAT(asked.err, HasSubstr("refused: a log is played"));
    const Outcome later = rtsg({"mirror", endpoint, "--for", "200ms", "--set", "FLAG.set_boolean=TRUE@.1"});
    EXPECT_EQ(later.status, 1);
    EXPECT_THAT(later.err, HasSubstr("refused: a log is played")) << "the clock counts for what is asked, too";
    for (const auto& [option, created] : {std::pair("--render", "still.png"), std::pair("--save", "still.x3d")}) {
        const Outcome one =
            rtsg({"mirror", endpoint, "--for", "200ms", "--wait", "1000s", option, folder / created, "--size", "16x9"});
        EXPECT_EQ(one.status, 0) << one.err;
        EXPECT_TRUE(std::filesystem::exists(folder / created));
    }
    for (const auto& [option, created] : {std::pair("--render", "still%d.png"), std::pair("--record", "other.rlog")}) {
        const Outcome many = follow(option, created);
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
    // A scene is no log, and the origin says so.
    const Outcome command = rtsg({"mirror", leaf, "--for", "100ms", "--control", "pause"});
    EXPECT_EQ(command.status, 1);
    EXPECT_THAT(command.err, HasSubstr("refused: no log is played here"));
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

TEST_F(Mirror, CommandsToAPlayerPassThroughRelays) {
    const std::string log = folder / "a.rlog";
    ASSERT_EQ(rtsg(atZero({"record", file, "-o", log, "--for", "3s", "--fps", "20"})).status, 0);
    server = std::make_unique<Program>(
        std::vector<std::string>{"serve", log, "--bind", "ipc://" + folder / "a", "--upstream", "events", "--paused",
                                 "--for", "60s", "--json"},
        streams());
    std::string from = json::parse(server->firstLine()).at("endpoint");
    std::vector<std::unique_ptr<Program>> relays;
    for (const std::string name : {"b", "c"}) {
        relays.push_back(
            std::make_unique<Program>(std::vector<std::string>{"relay", from, "--bind", "ipc://" + folder / name,
                                                               "--upstream", "events", "--for", "60s", "--json"},
                                      folder / name + "-streams"));
        from = json::parse(relays.back()->firstLine()).at("endpoint");
    }
    const Outcome mirror = rtsg({"mirror", from, "--for", "2s", "--control", "seek 2.5", "--control", "status",
                                 "--control", "seek 1", "--control", "rate x", "--json"});
    EXPECT_EQ(mirror.status, 1) << "the last is refused";
    EXPECT_THAT(mirror.err, HasSubstr("\"t\":2.5"));
    EXPECT_THAT(mirror.err, HasSubstr("\"t\":1.0"));
    EXPECT_EQ(mirror.err.find("refused"), mirror.err.rfind("refused")) << mirror.err;
    const json report = json::parse(rtsg({"mirror", from, "--for", "0s", "--json"}).out);
    EXPECT_EQ(report.at("equal"), true) << report;
    EXPECT_EQ(report.at("sequence"), 22) << "loaded, and 21 frames: " << report;
    // Where the origin has gone, so is the answer.
    server->signal(SIGSTOP);
    Program last({"mirror", from, "--for", "60s", "--control", "status"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    server->signal(SIGKILL);
    const Outcome ended = last.wait();
    EXPECT_EQ(ended.status, 1);
    EXPECT_THAT(ended.err, HasSubstr("refused: the"));
}

TEST_F(Mirror, WhoFollowsARelayIsToldThatItsOriginIsNotHeard) {
    serve({"--for", "60s"}, "ipc://" + folder / "a");
    Program relay({"relay", endpoint, "--bind", "ipc://" + folder / "b", "--for", "60s", "--json"}, folder / "relay");
    const std::string leaf = json::parse(relay.firstLine()).at("endpoint");
    Program mirror({"mirror", leaf, "--for", "4s"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    server->signal(SIGSTOP);
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    server->signal(SIGCONT);
    const Outcome followed = mirror.wait();
    EXPECT_EQ(followed.status, 0) << followed.err;
    const std::size_t lost = followed.err.find("is not heard: waiting for it");
    EXPECT_NE(lost, std::string::npos) << followed.err;
    EXPECT_NE(followed.err.find("heard again", lost), std::string::npos) << followed.err;
}

/// This is like a mirror that joins late over a slow link: the output has the scene's length, not that of the wait.
TEST_F(Mirror, AnOriginThatGoesSlowlyIsFollowedToTheLengthInItsTime) {
    const std::string log = folder / "slow.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "5s", "--fps", "20"}).status, 0);
    server = std::make_unique<Program>(
        std::vector<std::string>{"serve", log, "--bind", "ipc://" + folder / "s", "--rate", ".5", "--json"}, streams());
    endpoint = json::parse(server->firstLine()).at("endpoint");
    const Outcome followed = rtsg({"mirror", endpoint, "--for", "1s", "--json"});
    EXPECT_EQ(followed.status, 0) << followed.err;
    EXPECT_GE(json::parse(followed.out).at("t"), 1) << followed.out;
    server->signal(SIGINT);
    server->wait();
}

/// A scene that is served or mirrored has the same status.
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

/// Frames that a server had kept come at once, and do not count for the rate.
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
    EXPECT_EQ(rtsg({"serve", file, "--for", "0", "--record", folder / "bytes.rlog", "--rotate", "5000000B"}).status, 0);
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--record", log, "--keep", "1min"}).status, 2);
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--rotate", "1min"}).status, 2) << "without a log";
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--rate", "2"}).status, 2) << "of a log";
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--peers", "99999999999999999999"}).status, 2);
    EXPECT_EQ(rtsg({"serve", file, "--for", "100ms", "--base", folder / "none"}).status, 2);
    EXPECT_EQ(
        rtsg({"serve", file, "--for", "300ms", "--record", folder / "short.rlog", "--rotate", "20ms", "--keep", "50ms"})
            .status,
        0);
    const Outcome done = rtsg({"serve", file, "--for", "2s", "--fps", "30", "--record", log, "--rotate", "0.5s"});
    ASSERT_EQ(done.status, 0) << done.err;
    // Each is whole, and says that others follow: who asks for all of the session has it with the last one.
    for (const char* piece : {"turning.0001.rlog", "turning.0003.rlog"}) {
        const Outcome verified = rtsg({"replay", folder / piece, "--verify", "--json"});
        EXPECT_EQ(verified.status, 1) << piece;
        EXPECT_THAT(verified.err, HasSubstr("the session goes on in a next piece"));
        EXPECT_EQ(json::parse(verified.out).at("goes_on"), true);
        const Outcome played = rtsg({"replay", folder / piece});
        EXPECT_EQ(played.status, 0) << played.err;
        EXPECT_THAT(played.out, HasSubstr("; the session goes on in a next piece"));
    }
    EXPECT_EQ(rtsg({"replay", log, "--verify"}).status, 0);
    EXPECT_THAT(rtsg({"info", folder / "turning.0001.rlog"}).out, HasSubstr("the session goes on in a next piece"));
    EXPECT_EQ(json::parse(rtsg({"info", folder / "turning.0001.rlog", "--json"}).out).at("goes_on"), true);
    // Opening one of them reports the others; in another order than they were written in they are no log.
    const Outcome last = rtsg({"replay", log});
    EXPECT_THAT(last.err, HasSubstr("turning.0001.rlog to "));
    EXPECT_THAT(last.out, HasSubstr("a piece that begins "));
    EXPECT_GE(json::parse(rtsg({"replay", log, "--json"}).out).at("before_s"), 1.4);
    EXPECT_EQ(json::parse(rtsg({"replay", folder / "turning.0001.rlog", "--json"}).out).at("before_s"), 0);
    EXPECT_THAT(rtsg({"info", log}).err, HasSubstr("to have it as one: " + folder / "turning.0001.rlog" + ","));
    EXPECT_EQ(rtsg({"replay", folder / "turning.0001.rlog"}).err, "");
    const std::string first = readFile(folder / "turning.0001.rlog"), second = readFile(folder / "turning.0002.rlog");
    writeFile(folder / "cut.rlog", first + second);
    std::string all;
    for (int n = 1; std::filesystem::exists(folder / fmt::format("turning.{:04}.rlog", n)); ++n)
        all += readFile(folder / fmt::format("turning.{:04}.rlog", n));
    writeFile(folder / "right.rlog", all + readFile(log));
    writeFile(folder / "wrong.rlog", second + first);
    EXPECT_EQ(rtsg({"replay", folder / "right.rlog", "--verify"}).status, 0);
    EXPECT_EQ(rtsg({"replay", folder / "cut.rlog", "--verify"}).status, 1);
    writeFile(folder / "mixed.rlog", first + readFile(folder / "short.rlog"));
    const Outcome mixed = rtsg({"replay", folder / "mixed.rlog", "--verify"});
    EXPECT_EQ(mixed.status, 1);
    EXPECT_THAT(mixed.err, HasSubstr("the session goes on in a piece that is not in the log"));
    const Outcome wrong = rtsg({"replay", folder / "wrong.rlog", "--verify"});
    EXPECT_EQ(wrong.status, 1);
    EXPECT_THAT(wrong.err, HasSubstr("in another order"));
    EXPECT_THAT(rtsg({"replay", log}).err, HasSubstr("note: the last piece of a log")) << "and how to have all of it";
    EXPECT_EQ(rtsg({"replay", folder / "right.rlog"}).err, "");
    // Changes before the beginning of the last piece cannot be attributed, and the output says so.
    const Outcome blamed = rtsg({"replay", log, "--blame", "BOX.translation"});
    EXPECT_EQ(blamed.status, 0) << blamed.err;
    EXPECT_THAT(blamed.err, HasSubstr("s into its session: what came before is in pieces before it"));
    EXPECT_EQ(rtsg({"replay", folder / "right.rlog", "--blame", "BOX.translation"}).err, "");
    const Outcome ring = rtsg({"replay", folder / "short.rlog", "--blame", "BOX.translation", "--json"});
    EXPECT_EQ(ring.status, 0) << ring.err;
    EXPECT_THAT(ring.err, HasSubstr("let go"));
    EXPECT_GT(json::parse(ring.out).at("let_go_s"), 0);
    // The session's clock goes on, and not that of its last file.
    const Outcome resumed = rtsg({"serve", "--resume", log, "--for", "200ms", "--json"});
    ASSERT_EQ(resumed.status, 0) << resumed.err;
    EXPECT_NE(resumed.err.find("t = 2.000 s"), std::string::npos) << resumed.err;
    const double t = json::parse(lastLine(resumed.out)).at("t").get<double>();
    EXPECT_GT(t, 2.1);
    EXPECT_LT(t, 3.0);
    // Properties that a log has itself cannot be set by options: they are errors, neither obeyed nor ignored.
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"serve", "--resume", log, "--at", "now", "--for", "100ms"},
          {"serve", log, "--at", "2000-01-01", "--for", "100ms"},
          {"serve", log, "--await", "1", "--for", "100ms"}}) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, testing::HasSubstr("a log")) << outcome.err;
    }
}

/// A disk that was full, say, as the last piece began: the one before has the last state.
TEST_F(Mirror, ASessionGoesOnFromThePieceBeforeOneThatWasCut) {
    const std::string log = folder / "short.rlog";
    ASSERT_EQ(rtsg({"serve", file, "--for", "100ms", "--record", log, "--rotate", "20ms"}).status, 0);
    // Where urls start from is not what is served.
    const Outcome named = rtsg({"serve", file, "--resume", log, "--for", "100ms"});
    EXPECT_EQ(named.status, 0) << named.err;
    EXPECT_THAT(named.out, HasSubstr("serving " + log + " at "));
    writeFile(log, readFile(log).substr(0, 100));
    const Outcome before = rtsg({"serve", "--resume", log, "--for", "100ms"});
    EXPECT_EQ(before.status, 0) << before.err;
    EXPECT_THAT(before.err, HasSubstr("was cut before its first state"));
    EXPECT_THAT(rtsg({"replay", log}).out, HasSubstr("a piece that begins "));
}

/// Pieces of an earlier recording would look like the first ones of this.
TEST_F(Mirror, ARotatedLogGrowsOntoNoOther) {
    const std::string log = folder / "turning.rlog", first = folder / "turning.0001.rlog";
    const std::vector<std::string> recording{"serve", file, "--for", "600ms", "--record", log, "--rotate", "100ms"};
    ASSERT_EQ(rtsg(recording).status, 0);
    for (const bool whole : {true, false}) {
        if (!whole) std::filesystem::remove(log);
        const std::string before = readFile(first);
        const Outcome refused = rtsg(recording);
        EXPECT_EQ(refused.status, 1);
        EXPECT_THAT(refused.err, HasSubstr("--force replaces"));
        if (!whole) {
            EXPECT_THAT(refused.err, HasSubstr("turning.0001.rlog: error: a piece of an earlier recording"));
        }
        EXPECT_EQ(readFile(first), before);
        auto forced = recording;
        forced.push_back("--force");
        ASSERT_EQ(rtsg(forced).status, 0);
        std::string all;
        for (int n = 1; std::filesystem::exists(folder / fmt::format("turning.{:04}.rlog", n)); ++n)
            all += readFile(folder / fmt::format("turning.{:04}.rlog", n));
        writeFile(folder / "all.rlog", all + readFile(log));
        EXPECT_EQ(rtsg({"replay", folder / "all.rlog", "--verify"}).status, 0);
        EXPECT_NE(readFile(first), before);
    }
    // One that does not rotate has no pieces before it, whatever lies beside it.
    ASSERT_EQ(rtsg({"serve", file, "--for", "100ms", "--record", log, "--force"}).status, 0);
    EXPECT_EQ(rtsg({"replay", log}).err, "");
}

/// What a service manager starts again and again: the same words, whether there is a log or not.
TEST_F(Mirror, OneCommandBeginsALogAndGoesOnWithItAfterEachCrash) {
    const std::string log = folder / "unit.rlog";
    const std::vector<std::string> words{"serve",  file,       "--bind", "tcp://127.0.0.1:*",
                                         "--json", "--record", log,      "--resume-if-there"};
    const auto summary = [&] { return json::parse(rtsg({"info", log, "--json"}).out, nullptr, false); };
    std::uint64_t last = 0;
    for (int start = 0; start < 3; ++start) {
        Program one(words, streams());
        ASSERT_NE(one.firstLine(), "");
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        for (auto now = summary(); now.is_discarded() || now.at("last_state") < last + 5; now = summary())
            ASSERT_LT(std::chrono::steady_clock::now(), end) << one.said();
        one.signal(SIGKILL);
        (void)one.wait();
        EXPECT_EQ(one.said().find("going on at state") != std::string::npos, start > 0) << one.said();
        last = summary().at("last_state");
    }
    auto ended = words;
    ended.insert(ended.end(), {"--for", "0.2s"});
    EXPECT_EQ(rtsg(ended).status, 0);
    EXPECT_EQ(summary().at("sessions"), 1) << "the same one all the time";
    EXPECT_EQ(summary().at("gaps"), 0);
    EXPECT_GT(summary().at("last_state"), last);
    EXPECT_EQ(rtsg({"replay", log, "--verify"}).status, 0);
    // What was cut before its first state holds nothing; what is no log is left alone.
    writeFile(log, "");
    EXPECT_EQ(rtsg(ended).status, 0);
    EXPECT_GT(summary().at("states"), 1);
    writeFile(log, "my notes");
    EXPECT_EQ(rtsg(ended).status, 1);
    EXPECT_EQ(readFile(log), "my notes");
    for (const std::vector<std::string>& more : std::vector<std::vector<std::string>>{
             {"--force"}, {"--at", "3s"}, {"--reload"}, {"--mode", "lossy"}, {"--resume", log}}) {
        auto wrong = ended;
        wrong.insert(wrong.end(), more.begin(), more.end());
        EXPECT_EQ(rtsg(wrong).status, 2) << more.front();
    }
    EXPECT_EQ(rtsg({"serve", file, "--resume-if-there", "--for", "0.1s"}).status, 2);
    EXPECT_EQ(rtsg({"serve", file, "--record", "nats://127.0.0.1:1/a", "--resume-if-there"}).status, 2);
}

TEST_F(Mirror, ResumingAsksForALogAndWritesNoOther) {
    EXPECT_EQ(rtsg({"serve"}).status, 2);
    EXPECT_EQ(rtsg({"serve", "--resume", folder / "none.rlog"}).status, 1);
    EXPECT_EQ(rtsg({"serve", "--resume", folder / "none.rlog", "--record", folder / "other.rlog"}).status, 2);
    const Outcome await =
        rtsg({"serve", "--resume", folder / "none.rlog", "--await", "3", "--peers", "2", "--for", "100ms"});
    EXPECT_EQ(await.status, 2) << "it would wait for ever";
    EXPECT_NE(await.err.find("--await: waits for 3 mirrors, of which --peers lets in 2"), std::string::npos)
        << await.err;
    EXPECT_EQ(rtsg({"serve", "--resume", folder / "none.rlog", "--mode", "lossy"}).status, 2);
}

}  // namespace
}  // namespace rtsg::test
