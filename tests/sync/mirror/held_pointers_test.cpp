// Pointers of peers that leave: what they held is let go of, what others hold is not.
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/mirror_relay.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

/// A TouchSensor beside a Shape, served to peers that may send events.
struct TouchedOrigin {
    Scene scene;
    NodeId group, sensor, shape;
    std::unique_ptr<MirrorServer> server;
    double time = 0;

    explicit TouchedOrigin(MirrorUpstream upstream = MirrorUpstream::events) {
        group = scene.createNode(x3d::Group::type);
        sensor = scene.createNode(x3d::TouchSensor::type);
        shape = scene.createNode(x3d::Shape::type);
        EXPECT_TRUE(scene.setField(group, x3d::Group::children.index, Array<NodeId>{sensor, shape}));
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{group}));
        scene.newFrame(time);
        MirrorServerOptions options;
        options.upstream = upstream;
        options.heartbeat = 20ms;
        options.peerTimeout = 500ms;
        server = *MirrorServer::start(scene, test::kAnyPort, options);
    }
    void poll() {
        server->service();
        scene.newFrame(time += .1);
    }
    bool isActive() const { return scene.node(sensor).get(x3d::TouchSensor::isActive); }
    bool isOver() const { return scene.node(sensor).get(x3d::TouchSensor::isOver); }
    /// No SpaceQueries here: whoever sends the pointer says what it is over.
    Value pointer(std::int32_t device, std::uint32_t buttons) const {
        PointerInput input;
        input.device = device;
        input.buttons = buttons;
        input.hit = PointerHit{{0, 0, 1}, {0, 0, 1}, {0, 0}, {group, shape}};
        return Value(input.toValue());
    }
};

struct PointingPeer {
    Scene scene;
    std::unique_ptr<MirrorClient> client;

    explicit PointingPeer(const std::string& endpoint) : client(*MirrorClient::connect(scene, endpoint)) {
        EXPECT_TRUE(test::pollUntil(*client, [this] { return client->inStep(); }));
    }
    /// Until the origin has answered; `turn` is a frame of the origin, and of what is between.
    void send(const Value& pointer, const std::function<void()>& poll) {
        ASSERT_TRUE(client->submitEvent(scene.root(), x3d::RtsgScene::pointer.index, pointer));
        ASSERT_TRUE(test::pollUntil(*client, [&] {
            poll();
            return client->unanswered() == 0;
        }));
        for (const MirrorVerdict& verdict : client->takeVerdicts()) EXPECT_EQ(verdict.refusal, "");
    }
};

TEST(HeldPointers, OfAPeerThatLeavesLetGo) {
    TouchedOrigin origin;
    const auto poll = [&] { origin.poll(); };
    auto peer = std::make_unique<PointingPeer>(origin.server->endpoint());
    peer->send(origin.pointer(7, 0), poll);
    peer->send(origin.pointer(7, PointerInput::kPrimary), poll);
    ASSERT_TRUE(origin.isActive());
    ASSERT_TRUE(origin.isOver());
    for (int i = 0; i < 20; ++i) poll();
    EXPECT_TRUE(origin.isActive()) << "while the peer is there";
    peer.reset();
    EXPECT_TRUE(test::eventually([&] {
        poll();
        return !origin.isActive() && !origin.isOver();
    }));
}

TEST(HeldPointers, ArePressedByWhatStillWaitsAndThenLetGo) {
    TouchedOrigin origin(MirrorUpstream::edits);
    auto peer = std::make_unique<PointingPeer>(origin.server->endpoint());
    peer->send(origin.pointer(7, 0), [&] { origin.poll(); });
    // An event, an edit that waits for the frame with it, a press that waits for the edit, and the peer is gone.
    const auto point = [&](std::uint32_t buttons) {
        return peer->client->submitEvent(peer->scene.root(), x3d::RtsgScene::pointer.index, origin.pointer(7, buttons));
    };
    ASSERT_TRUE(point(0));
    ASSERT_TRUE(peer->client->submitEdit(origin.group, x3d::Group::bboxDisplay.index, true));
    ASSERT_TRUE(point(PointerInput::kPrimary));
    const auto until = std::chrono::steady_clock::now() + 30ms;
    while (std::chrono::steady_clock::now() < until) peer->client->poll(2ms);
    peer.reset();
    ASSERT_TRUE(test::eventually([&] { return origin.server->statistics().peers == 0; }));
    std::this_thread::sleep_for(100ms);  // the server has noticed, and its scene has not looked
    bool pressed = false;
    EXPECT_TRUE(test::eventually([&] {
        origin.poll();
        pressed |= origin.isActive();
        return pressed && !origin.isActive() && !origin.isOver();
    }));
    EXPECT_TRUE(origin.scene.node(origin.group).get(x3d::Group::bboxDisplay));
}

TEST(HeldPointers, OfAPeerThatLeavesArePointersWithoutAButton) {
    TouchedOrigin origin;
    const auto poll = [&] { origin.poll(); };
    auto peer = std::make_unique<PointingPeer>(origin.server->endpoint());
    peer->send(origin.pointer(7, 0), poll);
    ASSERT_TRUE(origin.isOver());
    peer.reset();
    EXPECT_TRUE(test::eventually([&] {
        poll();
        return !origin.isOver();
    }));
}

TEST(HeldPointers, OfAPeerThatIsSilentForTooLongLetGo) {
    TouchedOrigin origin;
    const auto poll = [&] { origin.poll(); };
    std::atomic<bool> cut{false};
    test::Middleman middle(origin.server->endpoint(), [&](bool, test::Middleman::Parts&) { return !cut; });
    PointingPeer peer(middle.endpoint);
    peer.send(origin.pointer(7, PointerInput::kPrimary), poll);
    ASSERT_TRUE(origin.isOver());
    cut = true;
    EXPECT_TRUE(test::eventually([&] {
        poll();
        return !origin.isOver();
    }));
    EXPECT_GE(origin.server->statistics().lost, 1u) << "on a busy machine it may have been before, too";
}

TEST(HeldPointers, ThatSomebodyElseHasTakenOverStay) {
    TouchedOrigin origin;
    const auto poll = [&] { origin.poll(); };
    auto first = std::make_unique<PointingPeer>(origin.server->endpoint());
    PointingPeer second(origin.server->endpoint());
    first->send(origin.pointer(7, 0), poll);
    first->send(origin.pointer(7, PointerInput::kPrimary), poll);
    second.send(origin.pointer(7, PointerInput::kPrimary), poll);
    first.reset();
    ASSERT_TRUE(test::eventually([&] {
        poll();
        second.client->poll(1ms);
        return origin.server->statistics().peers == 1;
    }));
    for (int i = 0; i < 20; ++i) {
        poll();
        second.client->poll(2ms);
    }
    EXPECT_TRUE(origin.isActive());
}

TEST(HeldPointers, OfALeafOfARelayLetGoAtTheOrigin) {
    TouchedOrigin origin;
    Scene middle;
    MirrorServerOptions relayed;
    relayed.upstream = MirrorUpstream::events;
    const auto relay = *MirrorRelay::connect(middle, origin.server->endpoint(), test::kAnyPort, {}, relayed);
    const auto poll = [&] {
        origin.poll();
        EXPECT_TRUE(relay->poll());
    };
    ASSERT_TRUE(test::eventually([&] { return poll(), relay->server() != nullptr; }));
    {
        PointingPeer leaf(relay->server()->endpoint());
        leaf.send(origin.pointer(7, 0), poll);
        leaf.send(origin.pointer(7, PointerInput::kPrimary), poll);
        ASSERT_TRUE(origin.isActive());
    }
    EXPECT_TRUE(test::eventually([&] { return poll(), !origin.isActive() && !origin.isOver(); }));
}

}  // namespace
}  // namespace rtsg
