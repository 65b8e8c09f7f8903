// Servers that leave while a mirror does not look, or looks in the middle of what they have sent: nothing that came is
// lost, and libzmq's own assertions (fq.cpp, `!_more`) are never reached.
#include <array>
#include <filesystem>

#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::pollUntil;
using test::pollUntilAt;

/// A socket that takes one client's first message and answers with messages of two parts, then is gone.
class Leaver {
  public:
    Leaver() : context_(zmq_ctx_new()), socket_(zmq_socket(context_, ZMQ_ROUTER)) {
        const int unbounded = 0, linger = 5000;
        zmq_setsockopt(socket_, ZMQ_SNDHWM, &unbounded, sizeof(unbounded));
        zmq_setsockopt(socket_, ZMQ_LINGER, &linger, sizeof(linger));
        zmq_bind(socket_, test::kAnyPort);
        char bound[256] = {};
        std::size_t length = sizeof(bound);
        zmq_getsockopt(socket_, ZMQ_LAST_ENDPOINT, bound, &length);
        endpoint = bound;
    }
    ~Leaver() { leave(); }
    Leaver(const Leaver&) = delete;
    Leaver& operator=(const Leaver&) = delete;

    /// False if no client has said anything yet.
    bool hear() {
        std::array<char, 256> part{};
        const int length = zmq_recv(socket_, part.data(), part.size(), ZMQ_DONTWAIT);
        if (length < 0) return false;
        client_.assign(part.data(), static_cast<std::size_t>(length));
        int more = 1;
        std::size_t size = sizeof(more);
        while (zmq_getsockopt(socket_, ZMQ_RCVMORE, &more, &size) == 0 && more)
            zmq_recv(socket_, part.data(), part.size(), 0);
        return true;
    }
    void say(int messages) {
        const std::string head("RTSG\x01\x11\0\0", 8);  // data, without what belongs to it
        const std::string body(100, 'x');
        for (int i = 0; i < messages; ++i) {
            zmq_send(socket_, client_.data(), client_.size(), ZMQ_SNDMORE);
            zmq_send(socket_, head.data(), head.size(), ZMQ_SNDMORE);
            zmq_send(socket_, body.data(), body.size(), 0);
        }
    }
    void leave() {
        if (!socket_) return;
        zmq_close(socket_);
        zmq_ctx_term(context_);  // returns when all has been handed to the system
        socket_ = nullptr;
    }
    std::string endpoint;

  private:
    void *context_, *socket_;
    std::string client_;
};

TEST(MirrorLeaving, ConnectionsThatEndAmongPartsOfMessagesAreSurvivedAndAllThatCameIsRead) {
    constexpr int kMessages = 3000;
    for (int round = 0; round < 100; ++round) {
        Leaver server;
        Scene replica;
        auto client = *MirrorClient::connect(replica, server.endpoint);
        ASSERT_TRUE(pollUntil(*client, [&] { return server.hear(); }));
        std::thread leaves([&] {
            server.say(kMessages);
            server.leave();
        });
        // In the rounds' turn: looks all the time, begins in the middle of it, or comes when all is over.
        if (round % 3 == 1) std::this_thread::sleep_for(std::chrono::microseconds(100 * round));
        if (round % 3 == 2) leaves.join();
        const bool all = pollUntil(*client, [&] { return client->statistics().garbage >= kMessages; });
        if (leaves.joinable()) leaves.join();
        ASSERT_TRUE(all) << "round " << round << ": " << client->statistics().garbage;
        EXPECT_LE(client->takeDiagnostics().size(), 24u) << "not a line for each";
    }
}

struct MirroredNode {
    Scene scene, replica;
    NodeId node;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;

    explicit MirroredNode(MirrorClientOptions options = {}, const std::string& endpoint = test::kAnyPort) {
        auto started = MirrorServer::start(scene, endpoint);
        EXPECT_TRUE(started) << started.error().text;
        server = std::move(*started);
        client = *MirrorClient::connect(replica, server->endpoint(), std::move(options));
        node = scene.createNode(x3d::Transform::type);
        scene.newFrame(0);
        EXPECT_TRUE(pollUntilAt(*client, scene));
    }
    void step(int frames) {
        for (int i = 1; i <= frames; ++i) {
            EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(i))));
            scene.newFrame(i);
        }
    }
};

TEST(MirrorLeaving, LastFramesAndTheGoodbyeReachAMirrorThatDidNotLook) {
    MirrorClientOptions options;
    options.timeout = 100ms;  // long over when it looks again: its own silence is not the server's
    const std::string local =
        "ipc://" + (std::filesystem::temp_directory_path() / ("leaving-" + std::to_string(::getpid()))).string();
    for (const std::string& endpoint : {std::string(test::kAnyPort), local}) {
        MirroredNode served(options, endpoint);
        served.step(200);
        ASSERT_TRUE(eventually([&] { return served.server->statistics().sequence == served.scene.sequence(); }));
        served.server.reset();
        std::this_thread::sleep_for(300ms);
        ASSERT_TRUE(pollUntil(*served.client, [&] { return served.client->serverLeft(); })) << endpoint;
        EXPECT_EQ(served.client->statistics().sequence, served.scene.sequence()) << endpoint;
        EXPECT_EQ(served.replica.hash(), served.scene.hash()) << endpoint;
        EXPECT_EQ(served.client->statistics().gaps, 0u) << endpoint;
    }
}

/// Frames wait at the server as long as its peer has not said that it has read those before; leaving, it sends them.
TEST(MirrorLeaving, FramesHeldBackSoAsNotToBeOldOnArrivalAreSentBeforeTheGoodbye) {
    MirroredNode served;
    const NodeId points = served.scene.createNode(x3d::Coordinate::type);
    served.scene.newFrame(0.5);
    ASSERT_TRUE(pollUntilAt(*served.client, served.scene));
    for (int i = 1; i <= 300; ++i) {
        const std::vector<Vec3f> values(1000, Vec3f(float(i)));
        ASSERT_TRUE(served.scene.set(points, x3d::Coordinate::point, Array<Vec3f>(values)));
        served.scene.newFrame(i);
    }
    ASSERT_TRUE(eventually([&] { return served.server->statistics().sequence == served.scene.sequence(); }));
    const std::uint64_t sent = served.server->statistics().bytes;
    served.server.reset();
    ASSERT_TRUE(pollUntil(*served.client, [&] { return served.client->serverLeft(); }));
    EXPECT_LT(sent, 3'000'000u) << "nothing was held back";
    EXPECT_EQ(served.client->statistics().sequence, served.scene.sequence());
    EXPECT_EQ(served.replica.hash(), served.scene.hash());
}

TEST(MirrorLeaving, TheLastFrameOfAServerThatEndsAtOnceIsSent) {
    for (int round = 0; round < 4; ++round) {
        MirroredNode served;
        served.step(3);
        served.server.reset();
        ASSERT_TRUE(pollUntil(*served.client, [&] { return served.client->serverLeft(); })) << round;
        ASSERT_EQ(served.client->statistics().sequence, served.scene.sequence()) << round;
    }
}

TEST(MirrorLeaving, AMirrorThatAskedForFewFramesGetsTheLastOne) {
    MirrorClientOptions options;
    options.framesPerSecond = 0.1;
    MirroredNode served(options);
    served.step(10);
    served.server.reset();
    ASSERT_TRUE(pollUntil(*served.client, [&] { return served.client->serverLeft(); }));
    EXPECT_EQ(served.client->statistics().sequence, served.scene.sequence());
    EXPECT_EQ(served.replica.hash(), served.scene.hash());
}

TEST(MirrorLeaving, NothingSaidToALostServerReachesTheNextOne) {
    MirroredNode served;
    const std::string endpoint = served.server->endpoint();
    for (int i = 0; i < 5; ++i) {
        served.server.reset();
        // Without a server: requests are kept, and nothing is handed to the socket for whoever comes.
        served.client->poll(50ms);
        auto again = MirrorServer::start(served.scene, endpoint);
        ASSERT_TRUE(again) << again.error().text;
        served.server = std::move(*again);
        served.scene.newFrame(100 + i);
        ASSERT_TRUE(pollUntilAt(*served.client, served.scene));
        // One hello, one answer; the server counts it at the end of its turn.
        EXPECT_TRUE(eventually([&] { return served.server->statistics().snapshots == 1; }));
        EXPECT_EQ(served.server->statistics().garbage, 0u);
    }
    EXPECT_EQ(served.client->statistics().restarts, 5u);
}

}  // namespace
}  // namespace rtsg
