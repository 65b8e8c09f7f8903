// Peers of another version of the protocol are refused with both numbers, by every link; and links by IPv6.
#include <atomic>

#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"
#include "sockets/message.h"
#include "web_line.h"

namespace rtsg {
namespace {

using mirror::Message;
using test::eventually;
using test::pollUntil;
using test::pollUntilAt;
using testing::HasSubstr;

/// A socket of bare messages.
class Bare {
  public:
    explicit Bare(int type) : context_(zmq_ctx_new()), socket_(zmq_socket(context_, type)) {
        const int none = 0;
        zmq_setsockopt(socket_, ZMQ_LINGER, &none, sizeof(none));
    }
    ~Bare() {
        zmq_close(socket_);
        zmq_ctx_term(context_);
    }
    void connect(const std::string& endpoint) { EXPECT_EQ(zmq_connect(socket_, endpoint.c_str()), 0); }
    std::string bind() {
        EXPECT_EQ(zmq_bind(socket_, test::kAnyPort), 0);
        char bound[200] = {};
        std::size_t length = sizeof(bound);
        zmq_getsockopt(socket_, ZMQ_LAST_ENDPOINT, bound, &length);
        return bound;
    }
    void say(const std::string& part, bool more = false) {
        zmq_send(socket_, part.data(), part.size(), more ? ZMQ_SNDMORE : 0);
    }
    /// The next part; empty if there is none.
    std::string next() {
        char bytes[4096];
        const int length = zmq_recv(socket_, bytes, sizeof(bytes), ZMQ_DONTWAIT);
        return length < 0 ? std::string() : std::string(bytes, static_cast<std::size_t>(length));
    }

  private:
    void *context_, *socket_;
};

std::string prologue(int version, Message type) {
    return std::string("RTSG") + static_cast<char>(version) + static_cast<char>(type) + std::string(2, '\0');
}

std::string helloOfVersion(int version) {
    std::string hello = test::helloOf(77);
    hello[4] = static_cast<char>(version);
    return hello;
}

/// The text of a refusal in this version; empty if it is none.
std::string refusalIn(const std::string& message, int version) {
    if (!message.starts_with(prologue(version, Message::refused))) return {};
    wire::Reader in(std::as_bytes(std::span(message)).subspan(mirror::kPrologue));
    const std::string text(in.text());
    EXPECT_EQ(in.number<std::uint8_t>(), 1) << "asking again is of no use";
    return text;
}

TEST(ProtocolVersions, AClientOfAnotherIsRefusedInItsOwn) {
    Scene scene;
    const auto server = *MirrorServer::start(scene, test::kAnyPort);
    for (const int version : {0, 2, 255}) {
        Bare client(ZMQ_DEALER);
        client.connect(server->endpoint());
        client.say(helloOfVersion(version));
        std::string answer;
        ASSERT_TRUE(eventually([&] { return !(answer = client.next()).empty(); })) << version;
        EXPECT_THAT(refusalIn(answer, version),
                    HasSubstr("speaks version 1 of the protocol, and this client version " + std::to_string(version)));
        // Only a hello is answered.
        client.say(prologue(version, Message::ping) + std::string(8, '\0'));
        client.say(test::helloOf(5));
        ASSERT_TRUE(eventually([&] { return !(answer = client.next()).empty(); }));
        EXPECT_TRUE(answer.starts_with(prologue(1, Message::welcome))) << answer.substr(4, 2);
    }
    EXPECT_EQ(server->statistics().refused, 3u);
    EXPECT_EQ(server->statistics().garbage, 3u);
    EXPECT_THAT(server->takeDiagnostics().front().text, HasSubstr("speaks version 0 of the protocol"));
}

TEST(ProtocolVersions, ABrowserOfAnotherIsRefusedInItsOwn) {
    test::ServedPage served;
    test::WebSocketLine line(served.port);
    ASSERT_EQ(served.open(line), 101);
    line.sayMessage(helloOfVersion(2));
    const auto frame = line.nextFrame();
    ASSERT_TRUE(frame);
    EXPECT_THAT(refusalIn(frame->payload.substr(4), 2),
                HasSubstr("version 1 of the protocol, and this client version 2"));
}

TEST(ProtocolVersions, AServerOfAnotherIsReported) {
    for (const bool says : {true, false}) {
        Bare server(ZMQ_ROUTER);
        Scene replica;
        auto client = *MirrorClient::connect(replica, server.bind());
        const auto answer = [&] {
            const std::string identity = server.next();
            if (identity.empty()) return;
            (void)server.next();
            std::string message = prologue(3, says ? Message::refused : Message::unknown);
            if (says) message += std::string("\x09", 1) + "only v. 3" + '\x01';
            server.say(identity, true);
            server.say(message);
        };
        ASSERT_TRUE(pollUntil(*client, [&] { return answer(), !client->refusal().empty(); }));
        EXPECT_EQ(client->refusal(),
                  says ? "only v. 3" : "this server speaks version 3 of the protocol, and this client version 1");
        EXPECT_FALSE(client->turnedAway());
    }
}

/// Whoever has been welcomed believes no stranger.
TEST(ProtocolVersions, MessagesOfAnotherAreRubbishToWhoIsWelcome) {
    Scene scene, replica;
    const auto server = *MirrorServer::start(scene, test::kAnyPort);
    std::atomic<bool> bends{false};
    const test::Middleman between(server->endpoint(), [&](bool toClient, std::vector<std::string>& parts) {
        if (toClient && bends && parts[0].size() > 5) parts[0][4] = '\x02';
        return true;
    });
    auto client = *MirrorClient::connect(replica, between.endpoint);
    scene.createNode(x3d::Transform::type);
    scene.newFrame(1);
    ASSERT_TRUE(pollUntilAt(*client, scene));
    bends = true;
    scene.newFrame(2);
    ASSERT_TRUE(pollUntil(*client, [&] { return client->statistics().garbage > 0; }));
    EXPECT_EQ(client->refusal(), "");
}

TEST(Ipv6, ServersAndMirrorsTakeItsAddresses) {
    Scene scene, replica;
    auto server = MirrorServer::start(scene, "tcp://[::1]:*");
    if (!server && server.error().text.find("bind") != std::string::npos && ::access("/proc/net/if_inet6", R_OK) != 0)
        GTEST_SKIP() << "this machine has no IPv6";
    ASSERT_TRUE(server) << server.error().text;
    EXPECT_THAT((*server)->endpoint(), testing::StartsWith("tcp://[::1]:"));
    auto client = *MirrorClient::connect(replica, (*server)->endpoint());
    scene.createNode(x3d::Transform::type);
    scene.newFrame(1);
    ASSERT_TRUE(pollUntilAt(*client, scene));
    EXPECT_FALSE(*isLocalEndpoint("tcp://[::]:5570"));
    EXPECT_FALSE(*isLocalEndpoint("tcp://[2001:db8::1]:5570"));
    // A name with addresses of both kinds leads to a server on either.
    Scene four, other;
    auto byName = *MirrorServer::start(four, test::kAnyPort);
    const std::string port = byName->endpoint().substr(byName->endpoint().rfind(':'));
    auto named = *MirrorClient::connect(other, "tcp://localhost" + port);
    four.newFrame(1);
    ASSERT_TRUE(pollUntilAt(*named, four));
}

}  // namespace
}  // namespace rtsg
