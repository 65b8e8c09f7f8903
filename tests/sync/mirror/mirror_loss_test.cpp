// Messages that are lost on the way though the connection stands: noticed without another frame that would show a gap.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"
#include "sockets/message.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using mirror::Message;
using test::eventually;
using test::Middleman;

/// A mirror of which the records named by number, from 1 on, are lost.
struct LossyPair {
    Scene scene, replica;
    NodeId box;
    std::unique_ptr<MirrorServer> server;
    std::atomic<int> data{0}, loses{0};
    std::unique_ptr<Middleman> between;
    std::unique_ptr<MirrorClient> client;

    explicit LossyPair(int first) : loses(first) {
        box = scene.createNode(x3d::Transform::type);
        scene.newFrame(0);
        MirrorServerOptions options;
        options.heartbeat = 20ms;
        server = std::move(*MirrorServer::start(scene, test::kAnyPort, options));
        between = std::make_unique<Middleman>(server->endpoint(), [this](bool toClient, Middleman::Parts& parts) {
            const bool isData = toClient && parts.size() == 2 && static_cast<Message>(parts[0][5]) == Message::data;
            return !isData || ++data != loses;
        });
        client = std::move(*MirrorClient::connect(replica, between->endpoint));
    }
    void step(int frame) {
        (void)scene.set(box, x3d::Transform::translation, Vec3f(float(frame), 0, 0));
        scene.newFrame(frame);
    }
    bool inStep() {
        return eventually([&] {
            client->poll(1ms);
            return client->inStep() && client->statistics().sequence == scene.sequence();
        });
    }
};

TEST(MirrorLoss, OfTheLastFrameIsNoticedByThePingAfterIt) {
    LossyPair pair(0);
    ASSERT_TRUE(pair.inStep());
    pair.step(1);
    ASSERT_TRUE(pair.inStep());
    pair.loses = pair.data + 1;
    pair.step(2);
    ASSERT_TRUE(pair.inStep());
    EXPECT_EQ(pair.replica.hash(), pair.scene.hash());
    EXPECT_EQ(pair.client->statistics().gaps, 1u);
    EXPECT_EQ(pair.client->statistics().snapshots, 1u) << "it goes on from where it was";
    EXPECT_EQ(pair.client->statistics().divergences, 0u);
}

TEST(MirrorLoss, OfTheFirstStateIsNoticedToo) {
    LossyPair pair(1);
    ASSERT_TRUE(pair.inStep());
    EXPECT_EQ(pair.replica.hash(), pair.scene.hash());
    EXPECT_EQ(pair.client->statistics().gaps, 1u);
}

TEST(MirrorLoss, NothingIsTakenForLostThatIsNot) {
    LossyPair pair(0);
    for (int frame = 1; frame <= 300; ++frame) {
        pair.step(frame);
        pair.client->poll(frame % 7 ? 0ms : 3ms);
    }
    ASSERT_TRUE(pair.inStep());
    EXPECT_EQ(pair.client->statistics().gaps, 0u);
}

}  // namespace
}  // namespace rtsg
