// The server for live viewers: what a client of its protocol is told, and what becomes of hostile ones.
#include <rtsg/feeds/foxglove_server.h>

#include <thread>

#include <gmock/gmock.h>

#include "support/foxglove_client.h"

namespace rtsg {
namespace {

using test::FoxgloveClient;
using testing::ElementsAre;
using testing::HasSubstr;
using Reach = FoxgloveServer::Reach;

/// A server with one topic of each kind, which is served on a thread of its own while a test waits.
class FoxgloveServing : public testing::Test {
  protected:
    void SetUp() override {
        FoxgloveOptions options;
        options.listen = "0";
        auto started = FoxgloveServer::start(options);
        ASSERT_TRUE(started) << started.error().text;
        server = std::move(*started);
        state = server->addTopic("/state", "test.State", R"({"type":"object"})", true);
        events = server->addTopic("/events", "test.Event", R"({"type":"object"})", false);
    }
    /// Reads what comes to the client while the server works.
    void expect(FoxgloveClient& client, const std::function<bool()>& enough) {
        const auto end = std::chrono::steady_clock::now() + test::kLinePatience;
        while (!client.readUntilQuiet(enough)) {
            server->service();
            ASSERT_LT(std::chrono::steady_clock::now(), end);
        }
    }
    void meet(FoxgloveClient& client) {
        ASSERT_EQ(client.status, 101);
        expect(client, [&] { return !client.advertised.empty(); });
    }
    void serve(const std::function<bool()>& enough) {
        const auto end = std::chrono::steady_clock::now() + test::kLinePatience;
        for (; !enough(); std::this_thread::sleep_for(std::chrono::milliseconds(2))) {
            server->service();
            ASSERT_LT(std::chrono::steady_clock::now(), end);
        }
    }

    std::unique_ptr<FoxgloveServer> server;
    std::uint16_t state = 0, events = 0;
};

TEST_F(FoxgloveServing, AViewerIsToldTopicsAndGetsWhatItSubscribesTo) {
    FoxgloveClient viewer(server->address());
    meet(viewer);
    EXPECT_THAT(viewer.head, HasSubstr("Sec-WebSocket-Protocol: foxglove.websocket.v1"));
    EXPECT_THAT(viewer.serverInfo, HasSubstr(R"("capabilities":["time"])"));
    EXPECT_EQ(viewer.channels, (std::map<std::string, int>{{"/state", 1}, {"/events", 2}}));
    EXPECT_THAT(viewer.advertised.front(), HasSubstr(R"("schemaName":"test.State","schema":"{\"type\":\"object\"}")"));
    EXPECT_FALSE(server->wants(state));
    viewer.subscribe(7, "/state");
    serve([&] { return server->wants(state); });
    EXPECT_FALSE(server->wants(events));
    // Before a whole one it gets no changes.
    EXPECT_TRUE(server->wantsWhole(state));
    EXPECT_TRUE(server->owesWhole());
    server->send(state, .5, "1", Reach::change);
    server->send(state, 1.5, "2", Reach::wholeForNew);
    EXPECT_FALSE(server->wantsWhole(state));
    EXPECT_FALSE(server->owesWhole());
    server->send(state, 2, "3", Reach::wholeForNew);
    server->send(state, 2.5, "4", Reach::change);
    server->sendTime(2.5);
    expect(viewer, [&] { return viewer.time != 0; });
    ASSERT_EQ(viewer.messages.size(), 2u);
    EXPECT_EQ(viewer.messages[0].json, "2");
    EXPECT_EQ(viewer.messages[0].subscription, 7u);
    EXPECT_EQ(viewer.messages[0].nanoseconds, 1'500'000'000u);
    EXPECT_EQ(viewer.messages[1].json, "4");
    EXPECT_EQ(viewer.time, 2'500'000'000u);
    viewer.ask(R"({"op":"unsubscribe","subscriptionIds":[7]})");
    serve([&] { return !server->wants(state); });
    server.reset();
    EXPECT_FALSE(viewer.readUntil([&] { return false; }));
    EXPECT_TRUE(viewer.closed);
}

TEST_F(FoxgloveServing, WhatMakesNoSenseIsAnsweredAndCounted) {
    FoxgloveClient viewer(server->address());
    meet(viewer);
    const std::pair<std::string, std::string> all[] = {
        {"nonsense", "expected '{'"},
        {"{}", "a message has an op"},
        {R"({"op":"subscribe","subscriptions":[{"id":1}]})", "an id and a channelId"},
        {R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})", "-1 is no number"},
        {R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":3}]})", "there is no channel 3"},
        {R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":0}]})", "there is no channel 0"},
        {R"({"op":"unsubscribe","subscriptionIds":[9]})", "there is no subscription 9"},
        {R"({"op":"setParameters","parameters":[]})", "this server does not do that"},
        {R"({"op":"unsubscribe"} {})", "more follows"},
        {"{\"op\":" + std::string(60000, '[') + "}", "expected a string"}};
    std::uint64_t count = 0;
    for (const auto& [message, answer] : all) {
        viewer.ask(message);
        expect(viewer, [&] { return viewer.statuses.size() == count + 1; });
        EXPECT_THAT(viewer.statuses.back(), HasSubstr(answer)) << message.substr(0, 80);
        EXPECT_EQ(server->counts().garbage, ++count) << message.substr(0, 80);
    }
    viewer.sayFrame("\x01 bytes");
    expect(viewer, [&] { return viewer.statuses.size() == count + 1; });
    // One subscription for a channel, and each id once; pretty JSON with more keys is fine.
    viewer.ask(
        "{\n  \"op\": \"subscribe\",\n  \"more\": {},\n  \"subscriptions\": [ { \"id\": 1, \"channelId\": 1 } ]\n}");
    serve([&] { return server->wants(state); });
    viewer.ask(R"({"op":"subscribe","subscriptions":[{"id":2,"channelId":1},{"id":1,"channelId":2}]})");
    expect(viewer, [&] { return viewer.statuses.size() == count + 3; });
    EXPECT_FALSE(server->wants(events));
    // Too long a message ends the connection, and others do not notice.
    FoxgloveClient other(server->address());
    meet(other);
    viewer.ask("{\"op\":\"" + std::string(70000, 'x') + "\"}");
    serve([&] { return server->counts().clients == 1; });
    EXPECT_FALSE(server->wants(state));
    other.subscribe(1, "/events");
    serve([&] { return server->wants(events); });
}

TEST_F(FoxgloveServing, WhoReadsNothingHoldsUpNobodyAndGetsAWholeMessageLater) {
    FoxgloveClient slow(server->address()), quick(server->address());
    meet(slow);
    meet(quick);
    slow.subscribe(1, "/state");
    quick.subscribe(1, "/state");
    serve([&] {
        if (server->wantsWhole(state)) server->send(state, 0, "0", Reach::wholeForNew);
        return server->counts().messages == 2;
    });
    // Only one of them reads.
    const std::string much(std::size_t{1} << 20, 'x');
    std::size_t sent = 0;
    while (server->counts().missed == 0) {
        server->send(state, 1, much, Reach::change);
        ++sent;
        expect(quick, [&] { return quick.messages.size() > sent; });
        ASSERT_LT(sent, 200u);
    }
    // What one misses, the other has, and it gets no change until it has had a whole one.
    EXPECT_EQ(server->counts().missed, 1u);
    server->send(state, 2, "change", Reach::change);
    expect(quick, [&] { return quick.messages.back().json == "change"; });
    const auto end = std::chrono::steady_clock::now() + test::kLinePatience;
    while (!server->wantsWhole(state)) {
        (void)slow.more(std::chrono::milliseconds(1));
        ASSERT_LT(std::chrono::steady_clock::now(), end);
    }
    server->send(state, 3, "whole", Reach::wholeForNew);
    expect(slow, [&] { return !slow.statuses.empty(); });
    EXPECT_EQ(slow.messages.back().json, "whole");
    EXPECT_THAT(slow.statuses.back(), HasSubstr("1 messages were left out"));
    EXPECT_EQ(slow.messages.size(), sent + 1);  // the first, all but one, the whole one
}

TEST_F(FoxgloveServing, OtherSitesOtherNamesAndOtherProtocolsAreRefused) {
    const std::string protocol = "Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n";
    const auto statusOf = [&](const std::string& more) { return FoxgloveClient(server->address(), more).status; };
    for (const char* origin : {"https://app.foxglove.dev", "http://localhost:8080", "http://127.0.0.1", "file://"})
        EXPECT_EQ(statusOf(protocol + "Origin: " + origin + "\r\n"), 101) << origin;
    for (const char* origin : {"http://evil.example", "null", "http://127.0.0.1.evil.example",
                               "https://app.foxglove.dev.evil.example", "http://localhost@evil.example"})
        EXPECT_EQ(statusOf(protocol + "Origin: " + origin + "\r\n"), 403) << origin;
    EXPECT_EQ(statusOf("Sec-WebSocket-Protocol: other\r\n"), 400);
    EXPECT_EQ(statusOf("X-Nothing: 1\r\n"), 400);
    test::SocketLine elsewhere(std::stoi(server->address().substr(server->address().rfind(':') + 1)));
    EXPECT_EQ(elsewhere.open("/", "evil.example", protocol), 403);
    test::Line plain(std::stoi(server->address().substr(server->address().rfind(':') + 1)));
    plain.say("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_TRUE(plain.ended());
    EXPECT_TRUE(plain.heard.starts_with("HTTP/1.1 426 ")) << plain.heard;
    test::Line garbage(std::stoi(server->address().substr(server->address().rfind(':') + 1)));
    garbage.say(std::string(20000, '\xFF'));
    EXPECT_TRUE(garbage.ended());
    serve([&] { return server->counts().refused >= 8; });
    EXPECT_FALSE(server->takeDiagnostics().empty());
}

TEST_F(FoxgloveServing, AsManyConnectAsMayAndThoseWhoSayNothingGo) {
    std::vector<std::unique_ptr<FoxgloveClient>> viewers;
    for (int i = 0; i < 32; ++i) EXPECT_EQ(viewers.emplace_back(new FoxgloveClient(server->address()))->status, 101);
    EXPECT_EQ(FoxgloveClient(server->address()).status, 503);
    viewers.pop_back();
    serve([&] { return server->counts().clients == 31; });
    EXPECT_EQ(FoxgloveClient(server->address()).status, 101);
    // Who connects and says nothing is let go after a while.
    test::Line silent(std::stoi(server->address().substr(server->address().rfind(':') + 1)));
    EXPECT_TRUE(silent.ended());
}

TEST(FoxgloveServer, ListensBeyondThisMachineOnlyWhereThatIsAllowed) {
    FoxgloveOptions options;
    options.listen = "0.0.0.0:0";
    const auto refused = FoxgloveServer::start(options);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, DiagnosticCode("keys"));
    options.listen = "x";
    EXPECT_FALSE(FoxgloveServer::start(options));
    options.listen = "0.0.0.0:0";
    options.insecure = true;
    const auto open = FoxgloveServer::start(options);
    ASSERT_TRUE(open) << open.error().text;
    FoxgloveClient viewer((*open)->address(),
                          "Origin: http://anywhere.example\r\nSec-WebSocket-Protocol: foxglove.websocket.v1\r\n");
    EXPECT_EQ(viewer.status, 101);
}

}  // namespace
}  // namespace rtsg
