// Scenes and logs at a NATS server, by the command line: published, followed, stored, gone on with.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/nats_server.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class NatsOption : public CommandLine {
  protected:
    void SetUp() override {
        CommandLine::SetUp();
        if (NatsServer::program().empty()) GTEST_SKIP() << NatsServer::kMissing;
        if (rtsg({"mirror", "nats://127.0.0.1:1/none", "--wait", "0.1s"}).err.find("leaves it out") !=
            std::string::npos)
            GTEST_SKIP() << "built without libnats";
    }
};

TEST_F(NatsOption, AServedSceneIsFollowedWithItsPasswordUnsaid) {
    NatsServer nats("authorization { user: anna, password: sesame }");
    const std::string address = nats.address("hall", "anna:sesame@");
    Program server({"serve", file, "--nats", address, "--upstream", "edits", "--json", "--for", "60s"}, streams());
    EXPECT_EQ(json::parse(server.firstLine()).at("nats"), nats.address());
    const Outcome mirror = rtsg({"mirror", address, "--for", "1s", "--json", "--name", "kim", "--edit",
                                 "BOX.scale=2 2 2@0.2", "--save", folder / "replica.x3dv"});
    EXPECT_EQ(mirror.status, 0) << mirror.err;
    const json report = json::parse(lastLine(mirror.out));
    EXPECT_TRUE(report.at("equal"));
    EXPECT_EQ(report.at("accepted"), 1);
    EXPECT_THAT(readFile(folder / "replica.x3dv"), HasSubstr("scale 2 2 2"));
    server.signal(SIGINT);
    const Outcome served = server.wait();
    for (const std::string* text : {&mirror.out, &mirror.err, &served.out, &served.err})
        EXPECT_THAT(*text, Not(HasSubstr("sesame")));
}

/// Who joins through NATS could not decode what refers to earlier frames.
TEST_F(NatsOption, WithACodingMirrorsByNatsGetRawFrames) {
    NatsServer nats;
    Program server({"serve", file, "--nats", nats.address(), "--coding", "smallest", "--json", "--for", "60s"},
                   streams());
    const std::string direct = json::parse(server.firstLine()).at("endpoint");
    for (const std::string& address : {direct, nats.address(), nats.address()}) {
        const Outcome mirror = rtsg({"mirror", address, "--for", "1s", "--json"});
        EXPECT_EQ(mirror.status, 0) << mirror.err;
        EXPECT_TRUE(json::parse(lastLine(mirror.out)).at("equal"));
    }
}

/// The window opens the address in the same way as mirrors do.
TEST_F(NatsOption, AWindowFollowsToo) {
    NatsServer nats;
    Program server({"serve", file, "--nats", nats.address(), "--json", "--for", "60s"}, streams());
    (void)server.firstLine();
    ::setenv("SDL_VIDEODRIVER", "offscreen", 1);
    const auto view = [&](const std::string& address) {
        return rtsg({"view", address, "--for", "3s", "--wait", "1s", "--mute", "--json", "--size", "160x90"});
    };
    const Outcome shown = view(nats.address());
    EXPECT_EQ(shown.status, 0) << shown.err;
    EXPECT_GT(json::parse(shown.out).at("sequence"), 3) << shown.out;
    const Outcome nobody = view(nats.address("nobody")), none = view("nats://127.0.0.1:1/hall"),
                  wrong = view("nats://127.0.0.1:4222");
    ::unsetenv("SDL_VIDEODRIVER");
    EXPECT_EQ(nobody.status, 1);
    EXPECT_THAT(nobody.err, HasSubstr("no server for 1 s"));
    EXPECT_EQ(none.status, 1);
    EXPECT_THAT(none.err, HasSubstr("no connection to the NATS server"));
    EXPECT_EQ(wrong.status, 1);
    EXPECT_THAT(wrong.err, HasSubstr("ends with /NAME"));
}

TEST_F(NatsOption, AStoredLogIsDescribedAndServed) {
    NatsServer nats;
    ASSERT_EQ(rtsg({"record", file, "-o", nats.address(), "--for", "1s"}).status, 0);
    const Outcome info = rtsg({"info", nats.address(), "--json"});
    EXPECT_EQ(info.status, 0) << info.err;
    EXPECT_EQ(json::parse(info.out).at("frames"), 61);
    EXPECT_THAT(rtsg({"info", nats.address()}).out, HasSubstr(nats.address() + "\n"));
    EXPECT_THAT(rtsg({"serve", nats.address(), "--for", "0.1s"}).out, HasSubstr("playing " + nats.address() + " at"));
    Program server({"serve", nats.address(), "--json", "--loop", "--for", "60s"}, streams());
    const Outcome mirror = rtsg({"mirror", json::parse(server.firstLine()).at("endpoint"), "--for", "0.5s", "--json"});
    EXPECT_EQ(mirror.status, 0) << mirror.err;
    EXPECT_TRUE(json::parse(lastLine(mirror.out)).at("equal"));
    EXPECT_EQ(rtsg({"info", nats.address("nothing")}).status, 1);
}

TEST_F(NatsOption, WhatCannotBeIsRefused) {
    NatsServer nats;
    const auto said = [&](int status, const char* text, const std::vector<std::string>& arguments) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, status) << outcome.err;
        EXPECT_THAT(outcome.err, HasSubstr(text));
    };
    said(2, "ends with /NAME", {"mirror", "nats://127.0.0.1:4222"});
    said(2, "ends with /NAME", {"serve", file, "--nats", "nats://127.0.0.1:4222/a.b"});
    said(2, "--key", {"mirror", nats.address(), "--key", file});
    said(1, "no connection to the NATS server", {"serve", file, "--nats", "nats://127.0.0.1:1/hall", "--for", "1s"});
    said(1, "need ZeroMQ", {"mirror", nats.address(), "--part", "BOX"});
    said(1, "no session is stored there", {"replay", nats.address("nothing")});
}

TEST_F(NatsOption, ARecordingIsStoredAndPlayedBack) {
    NatsServer nats;
    const std::string log = folder / "a.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "2s"}).status, 0);
    const Outcome stored = rtsg({"record", file, "-o", nats.address(), "--for", "2s"});
    EXPECT_EQ(stored.status, 0) << stored.err;
    EXPECT_THAT(stored.err, HasSubstr("at " + nats.address()));
    const Outcome verified = rtsg({"replay", nats.address(), "--verify", "--json"});
    EXPECT_EQ(verified.status, 0) << verified.err;
    EXPECT_EQ(json::parse(lastLine(verified.out)).at("verified"), 122);
    EXPECT_EQ(rtsg({"replay", nats.address(), "--diff", log}).status, 0);
    EXPECT_EQ(rtsg({"record", file, "-o", nats.address(), "--for", "1s"}).status, 1) << "it is there already";
    EXPECT_EQ(rtsg({"record", file, "-o", nats.address(), "--for", "1s", "--force"}).status, 0);
    EXPECT_EQ(json::parse(lastLine(rtsg({"replay", nats.address(), "--verify", "--json"}).out)).at("verified"), 62);
}

TEST_F(NatsOption, AServerThatIsKilledGoesOnFromWhatIsStoredWithItsMirrors) {
    NatsServer nats;
    const std::string scene = nats.address("live"), log = nats.address("log");
    auto server = std::make_unique<Program>(
        std::vector<std::string>{"serve", file, "--nats", scene, "--record", log, "--json", "--for", "60s"}, streams());
    server->firstLine();
    Program mirror({"mirror", scene, "--for", "4s", "--wait", "30s", "--json"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    server->signal(SIGKILL);
    server->wait();
    Program again({"serve", "--resume", log, "--nats", scene, "--json", "--for", "4s"}, streams());
    const Outcome followed = mirror.wait();
    const json report = json::parse(lastLine(followed.out));
    EXPECT_TRUE(report.at("equal")) << followed.err;
    EXPECT_EQ(report.at("divergences"), 0);
    again.signal(SIGINT);
    const Outcome ended = again.wait();
    EXPECT_THAT(ended.err, HasSubstr("going on at state"));
    // Each state is there once: none is missing, and none twice.
    const Outcome verified = rtsg({"replay", log, "--json"});
    EXPECT_EQ(verified.status, 0) << verified.err;
    const json states = json::parse(lastLine(verified.out));
    EXPECT_EQ(states.at("gaps"), 0);
    EXPECT_EQ(states.at("damaged"), 0);
    EXPECT_GT(states.at("frames"), 100);
}

TEST_F(NatsOption, AMirrorSaysThatItsServerIsGone) {
    NatsServer nats;
    Program server({"serve", file, "--nats", nats.address(), "--json", "--for", "60s"}, streams());
    server.firstLine();
    Program mirror({"mirror", nats.address(), "--wait", "2s"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(1000));
    server.signal(SIGKILL);
    server.wait();
    const Outcome outcome = mirror.wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("has been silent for"));
}

/// The time in which a mirror does not run is no silence of its server.
TEST_F(NatsOption, AMirrorThatWasStoppedGoesOn) {
    NatsServer nats;
    Program server({"serve", file, "--nats", nats.address(), "--json", "--for", "60s"}, streams());
    const std::string endpoint = json::parse(server.firstLine()).at("endpoint");
    Program byNats({"mirror", nats.address(), "--for", "8s", "--wait", "2s", "--json"}, streams()),
        direct({"mirror", endpoint, "--for", "8s", "--wait", "2s", "--json"}, streams());
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    for (Program* mirror : {&byNats, &direct}) mirror->signal(SIGSTOP);
    std::this_thread::sleep_for(std::chrono::seconds(5));
    for (Program* mirror : {&byNats, &direct}) mirror->signal(SIGCONT);
    for (Program* mirror : {&byNats, &direct}) {
        const Outcome outcome = mirror->wait();
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_TRUE(json::parse(lastLine(outcome.out)).at("equal"));
    }
}

/// What a limit or a purge leaves is read as a file that was cut.
TEST_F(NatsOption, AStreamThatWasPurgedIsReadFromItsFirstKeyframeOn) {
    NatsServer nats;
    ASSERT_EQ(rtsg({"record", file, "-o", nats.address(), "--for", "4s", "--keyframe-seconds", "1"}).status, 0);
    const json whole = json::parse(rtsg({"info", nats.address(), "--json"}).out);
    const auto purge = [&](int before) {
        const std::string request = fmt::format("{{\"seq\":{}}}", before);
        const int line = NatsServer::connected(nats.port(), false);
        const std::string text = fmt::format(
            "CONNECT {{\"verbose\":false}}\r\nPUB $JS.API.STREAM.PURGE.RTSG_hall _INBOX.a {}\r\n{}\r\nPING\r\n",
            request.size(), request);
        ASSERT_EQ(::send(line, text.data(), text.size(), 0), static_cast<ssize_t>(text.size()));
        std::string heard;
        char bytes[4096];
        while (heard.find("PONG") == std::string::npos) {
            const ssize_t count = ::recv(line, bytes, sizeof(bytes), 0);
            ASSERT_GT(count, 0);
            heard.append(bytes, static_cast<std::size_t>(count));
        }
        ::close(line);
    };
    purge(100);
    const std::string said = "the store has let go of messages 1 to 99";
    const Outcome info = rtsg({"info", nats.address(), "--json"});
    EXPECT_EQ(info.status, 1);
    EXPECT_THAT(info.err, HasSubstr(said));
    const json left = json::parse(info.out);
    EXPECT_EQ(left.at("last_state"), whole.at("last_state"));
    EXPECT_GT(left.at("first_state"), 30);
    EXPECT_LE(left.at("first_state"), 130) << "a keyframe is there every second";
    EXPECT_TRUE(left.at("closed"));
    const Outcome replayed = rtsg({"replay", nats.address(), "--verify", "--json"});
    EXPECT_EQ(replayed.status, 1);
    EXPECT_THAT(replayed.err, HasSubstr(said));
    const json states = json::parse(lastLine(replayed.out));
    EXPECT_EQ(states.at("frames"), states.at("verified"));
    EXPECT_EQ(rtsg({"replay", nats.address(), "--seek", "1s", "--save", folder / "a.x3d"}).status, 1);
    EXPECT_TRUE(std::filesystem::exists(folder / "a.x3d"));
    EXPECT_EQ(rtsg({"serve", nats.address(), "--for", "0.5s"}).status, 1);
    // Going on, the session gets no other numbers.
    const Outcome resumed = rtsg({"serve", "--resume", nats.address(), "--for", "1s", "--linger", "0s", "--json"});
    EXPECT_EQ(resumed.status, 1);
    EXPECT_THAT(resumed.err, HasSubstr(said));
    EXPECT_GT(json::parse(lastLine(resumed.out)).at("sequence"), whole.at("last_state"));
    const json more = json::parse(rtsg({"info", nats.address(), "--json"}).out);
    EXPECT_EQ(more.at("last_state"), json::parse(lastLine(resumed.out)).at("sequence"));
    EXPECT_EQ(more.at("first_state"), left.at("first_state"));
    purge(1'000'000);
    const Outcome nothing = rtsg({"replay", nats.address()});
    EXPECT_EQ(nothing.status, 1);
    EXPECT_THAT(nothing.err, HasSubstr("has let go of all messages"));
}

/// Rubbish at the NATS server is told, and counted for monitors.
TEST_F(NatsOption, RubbishIsCountedAndTold) {
    NatsServer nats;
    Program server({"serve", file, "--nats", nats.address(), "--json", "--for", "60s", "--metrics-port", "0"},
                   streams());
    const json begun = json::parse(server.firstLine());
    const int line = NatsServer::connected(nats.port(), false);
    std::string text = "CONNECT {\"verbose\":false}\r\n";
    for (int i = 0; i < 100; ++i) text += "PUB rtsg.hall.ask _INBOX.a 5\r\nhello\r\n";
    ASSERT_EQ(::send(line, text.data(), text.size(), 0), static_cast<ssize_t>(text.size()));
    const auto figures = [&] {
        const std::string address = begun.at("metrics");
        const int to = NatsServer::connected(std::stoi(address.substr(address.rfind(':') + 1)), false);
        const std::string ask = "GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n";
        (void)!::send(to, ask.data(), ask.size(), 0);
        std::string heard;
        char bytes[4096];
        for (ssize_t count = 0; (count = ::recv(to, bytes, sizeof(bytes), 0)) > 0;)
            heard.append(bytes, static_cast<std::size_t>(count));
        ::close(to);
        return heard;
    };
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (figures().find("\nrtsg_garbage_total 100") == std::string::npos && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_THAT(figures(), HasSubstr("\nrtsg_garbage_total 100\n"));
    ::close(line);
    server.signal(SIGINT);
    const Outcome served = server.wait();
    EXPECT_THAT(served.err, HasSubstr("ignored an invalid message; 64 such things by now"));
    EXPECT_EQ(json::parse(lastLine(served.out)).at("garbage"), 100);
}

TEST_F(NatsOption, AStoreThatIsFullLeavesTheWholeLogHere) {
    NatsServer nats({}, "max_file_store: 20000");
    const Outcome outcome = rtsg({"record", file, "-o", nats.address(), "--for", "10s"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("only the first"));
    const std::size_t end = outcome.err.find(" holds the whole log");
    ASSERT_NE(end, std::string::npos) << outcome.err;
    const std::size_t begin = outcome.err.rfind(' ', end - 1) + 1;
    const std::string kept = outcome.err.substr(begin, end - begin);
    EXPECT_EQ(rtsg({"replay", kept, "--verify"}).status, 0);
    std::filesystem::remove_all(std::filesystem::path(kept).parent_path());
}

}  // namespace
}  // namespace rtsg::test
