// Acknowledgements that a mirror keeps while there is credit: how many come, who asks for them, who may not keep any.
#include <cstring>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"
#include "sockets/message.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using mirror::Message;
using test::Middleman;

/// A server that pings nobody of its own accord, and what passes between it and one client.
struct AcknowledgingPair {
    Scene scene;
    NodeId box;
    std::unique_ptr<MirrorServer> server;
    std::atomic<int> data{0}, later{0}, acknowledgements{0}, pings{0}, clientPings{0};
    std::unique_ptr<Middleman> between;
    std::atomic<std::uint64_t> reached{0};  // by the replica, with the origin's hash
    std::atomic<bool> stop{false};
    std::thread replica;  // which a scene of its own belongs to

    explicit AcknowledgingPair(std::chrono::milliseconds lag, MirrorWhenSlow whenSlow = MirrorWhenSlow::coalesce,
                               bool oldServer = false) {
        box = scene.createNode(x3d::Transform::type);
        scene.newFrame(0);
        MirrorServerOptions serving;
        serving.heartbeat = 60s;
        serving.blockFor = 10s;
        server = std::move(*MirrorServer::start(scene, test::kAnyPort, serving));
        between = std::make_unique<Middleman>(server->endpoint(), [this, oldServer](bool toClient, auto& parts) {
            note(toClient, parts[0]);
            // One of before acknowledgements could wait says nothing of it.
            constexpr std::size_t kBefore = mirror::kPrologue + 4 * sizeof(std::uint64_t);
            if (oldServer && toClient && parts.size() == 2 && parts[0].size() > kBefore) parts[0].resize(kBefore);
            return true;
        });
        MirrorClientOptions options;
        options.maxLag = lag;
        options.whenSlow = whenSlow;
        replica = std::thread([this, options] { follow(options); });
    }
    ~AcknowledgingPair() {
        stop = true;
        replica.join();
    }
    void follow(const MirrorClientOptions& options) {
        Scene copy;
        const auto client = std::move(*MirrorClient::connect(copy, between->endpoint, options));
        while (!stop) {
            client->poll(5ms);
            if (client->statistics().equal) reached = client->statistics().sequence;
        }
    }
    bool inStep() {
        return test::eventually([this] { return reached == scene.sequence(); });
    }
    void note(bool toClient, const std::string& first) {
        const auto type = static_cast<Message>(first[5]);
        if (toClient && type == Message::data) {
            ++data;
            std::uint64_t flags = 0;
            std::memcpy(&flags, first.data() + mirror::kPrologue + 4 * sizeof(flags), sizeof(flags));
            later += static_cast<int>(flags & 1);
        }
        pings += toClient && type == Message::ping;
        acknowledgements += !toClient && type == Message::ack;
        clientPings += !toClient && type == Message::ping;
    }
    void show(int frames) {
        for (int i = 1; i <= frames; ++i) {
            ASSERT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(float(scene.sequence()), 0, 0)));
            scene.newFrame(scene.now() + .01);
        }
    }
};

TEST(MirrorAcknowledgement, OneDoesForManyFrames) {
    AcknowledgingPair pair(0ms);
    ASSERT_TRUE(pair.inStep());
    // How many may wait is a matter of time, so of how busy the machine is; that those are not sent is not.
    // A machine that is very busy may get all of a try's frames merged into one.
    for (int tries = 0; tries < 20 && (pair.later == 0 || pair.acknowledgements >= pair.data); ++tries) {
        pair.show(1000);
        ASSERT_TRUE(pair.inStep());
    }
    EXPECT_GT(pair.later, 0);
    // One for each that is asked for, by a frame or a ping; one with each ping of the client's own; one for a welcome.
    EXPECT_LE(pair.acknowledgements, pair.data - pair.later + pair.pings + pair.clientPings + 1);
    EXPECT_LT(pair.acknowledgements, pair.data);
}

TEST(MirrorAcknowledgement, WhoWaitsForThoseThatAreKeptAsksForThem) {
    AcknowledgingPair pair(0ms);
    ASSERT_TRUE(pair.inStep());
    // Until the last frame is one whose acknowledgement may wait: the server pings nobody for a minute.
    bool kept = false, drained = true;
    for (int tries = 0; tries < 100 && !kept && drained; ++tries) {
        const int before = pair.pings;
        pair.show(5);
        drained = pair.server->drain(test::kPatience);
        kept = pair.pings > before;
    }
    EXPECT_TRUE(drained);
    EXPECT_TRUE(kept);
    EXPECT_EQ(pair.server->statistics().acknowledged, pair.scene.sequence());
}

TEST(MirrorAcknowledgement, WhoMayHoldUpTheSceneKeepsNone) {
    AcknowledgingPair pair(250ms, MirrorWhenSlow::block);
    ASSERT_TRUE(pair.inStep());
    pair.show(100);
    ASSERT_TRUE(pair.inStep());
    EXPECT_GE(pair.data, 100);
    EXPECT_EQ(pair.later, 0);
}

TEST(MirrorAcknowledgement, WhereNothingIsSaidOfWaitingNoneWaits) {
    AcknowledgingPair pair(0ms, MirrorWhenSlow::coalesce, true);
    ASSERT_TRUE(pair.inStep());
    bool acknowledged = true;
    for (int i = 0; i < 20 && acknowledged; ++i) {
        pair.show(1);
        acknowledged =
            test::eventually([&] { return pair.server->statistics().acknowledged == pair.scene.sequence(); });
    }
    EXPECT_TRUE(acknowledged);
    EXPECT_EQ(pair.pings, 0);
}

}  // namespace
}  // namespace rtsg
