// Peers that are slow or want less, clocks, and frames held until their time.
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "client/playout.h"
#include "mirror_support.h"
#include "sockets/clock.h"
#include "sockets/message.h"
#include "support/tcp_proxy.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::pollUntil;
using test::pollUntilAt;

struct MovingOrigin {
    Scene scene;
    std::vector<NodeId> nodes;
    std::unique_ptr<MirrorServer> server;
    int frame = 0;

    explicit MovingOrigin(int count, MirrorServerOptions options = {}) {
        for (int i = 0; i < count; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
        scene.newFrame(0);
        server = *MirrorServer::start(scene, test::kAnyPort, std::move(options));
    }
    void step() {
        ++frame;
        for (const NodeId node : nodes)
            EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(frame), float(node.value), 0)));
        scene.newFrame(frame / 60.0);
    }
};

TEST(MirrorSlowPolicy, ResyncGivesASnapshotInsteadOfWhatWasMissed) {
    MovingOrigin origin(500);
    MirrorClientOptions options;
    options.window = 64 << 10;
    options.whenSlow = MirrorWhenSlow::resync;
    Scene replica;
    auto client = *MirrorClient::connect(replica, origin.server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    for (int i = 0; i < 100; ++i) origin.step();
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    EXPECT_EQ(replica.dump(), origin.scene.dump());
    EXPECT_GE(client->statistics().snapshots, 2u);
    EXPECT_EQ(origin.server->statistics().merged, 0u);
    EXPECT_LT(client->statistics().frames, 60u);
}

/// Another hello makes the answer to the last one void: whoever is impatient never joins.
TEST(MirrorSlow, TheFirstAnswerIsWaitedForOnALongWay) {
    MovingOrigin origin(5);
    const test::TcpProxy proxy(origin.server->endpoint(), 400ms);
    Scene replica;
    auto client = *MirrorClient::connect(replica, proxy.endpoint);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    EXPECT_EQ(client->statistics().snapshots, 1u);
    EXPECT_EQ(origin.server->statistics().snapshots, 1u);
    for (int i = 0; i < 3; ++i) origin.step();
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    EXPECT_EQ(replica.dump(), origin.scene.dump());
}

/// The snapshot is one message, which takes six seconds: the server is heard by the bytes that come.
TEST(MirrorSlow, ASnapshotMayTakeLongerThanAServerMayBeSilent) {
    Scene scene;
    const NodeId text = scene.createNode(x3d::MetadataString::type);
    ASSERT_TRUE(scene.set(text, x3d::MetadataString::value, Array<String>{String(std::string(96 << 10, 'x'))}));
    scene.newFrame(0);
    auto server = *MirrorServer::start(scene, test::kAnyPort);
    const test::TcpProxy proxy(server->endpoint(), 0ms, 16 << 10);
    MirrorClientOptions options;
    options.timeout = 900ms;
    options.maxLag = 0ms;
    Scene replica;
    auto client = *MirrorClient::connect(replica, proxy.endpoint, options);
    bool received = false;
    ASSERT_TRUE(eventually([&] {
        server->service();
        client->poll(20ms);
        if (client->statistics().frames == 0) received |= client->receiving();
        return client->statistics().frames > 0;
    }));
    EXPECT_TRUE(received);
    EXPECT_EQ(replica.hash(), scene.hash());
    EXPECT_TRUE(eventually([&] {
        server->service();
        client->poll(20ms);
        return !client->receiving();
    })) << "pings are no records";
}

TEST(MirrorSlow, OneThatLagsWhenTheServerLeavesKnowsThatItLags) {
    MovingOrigin origin(500);
    MirrorClientOptions options;
    options.window = 64 << 10;
    Scene replica;
    auto client = *MirrorClient::connect(replica, origin.server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    EXPECT_EQ(client->statistics().originSequence, origin.scene.sequence());
    // More than the window has room for, while nobody acknowledges.
    for (int i = 0; i < 100; ++i) origin.step();
    std::thread leaving([&] { origin.server.reset(); });
    // Nothing is acknowledged until it leaves, else the replica might get everything: then there is nothing to see
    // here.
    std::this_thread::sleep_for(300ms);
    ASSERT_TRUE(pollUntil(*client, [&] { return client->serverLeft(); }));
    leaving.join();
    client->poll();
    const MirrorStatistics& statistics = client->statistics();
    EXPECT_EQ(statistics.originSequence, origin.scene.sequence());
    EXPECT_EQ(statistics.sequence == origin.scene.sequence(), replica.hash() == origin.scene.hash());
    EXPECT_EQ(statistics.sequence, replica.sequence());
}

TEST(MirrorSlowPolicy, BlockHoldsTheSceneUpAndNoFrameIsMerged) {
    MirrorServerOptions serverOptions;
    serverOptions.blockFor = 20s;
    MovingOrigin origin(500, serverOptions);
    MirrorClientOptions options;
    options.window = 64 << 10;
    options.whenSlow = MirrorWhenSlow::block;
    std::atomic<bool> ready{false}, good{false};
    std::atomic<std::uint64_t> target{0};
    MirrorStatistics result;
    std::thread follower([&] {
        Scene replica;
        auto client = *MirrorClient::connect(replica, origin.server->endpoint(), options);
        pollUntil(*client, [&] {
            ready = client->statistics().frames > 0;
            return target != 0 && client->statistics().sequence == target;
        });
        result = client->statistics();
        good = true;
    });
    ASSERT_TRUE(eventually([&] { return ready.load(); }));
    const std::uint64_t before = origin.scene.sequence();
    for (int i = 0; i < 300; ++i) origin.step();
    target = origin.scene.sequence();
    follower.join();
    EXPECT_EQ(result.sequence, before + 300);
    EXPECT_EQ(result.snapshots, 1u);
    EXPECT_EQ(result.frames, 301u) << "every one of them";
    EXPECT_EQ(origin.server->statistics().merged, 0u);
}

TEST(MirrorSlowPolicy, APeerMayNotBlockLongerThanAllowed) {
    MirrorServerOptions serverOptions;
    serverOptions.blockFor = 50ms;
    MovingOrigin origin(500, serverOptions);
    MirrorClientOptions options;
    options.window = 64 << 10;
    options.whenSlow = MirrorWhenSlow::block;
    Scene replica;
    auto client = *MirrorClient::connect(replica, origin.server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < 200; ++i) origin.step();  // and nobody polls
    EXPECT_LT(std::chrono::steady_clock::now() - start, 10s);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    EXPECT_EQ(replica.dump(), origin.scene.dump());
}

TEST(MirrorRate, FewerFramesAreAskedForAndTheRestComesMerged) {
    MovingOrigin origin(20);
    MirrorClientOptions options;
    options.framesPerSecond = 20;
    Scene replica;
    auto client = *MirrorClient::connect(replica, origin.server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    const std::uint64_t before = client->statistics().frames;
    const auto start = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() - start < 600ms) {
        origin.step();
        client->poll(2ms);
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    EXPECT_LE(double(client->statistics().frames - before), seconds * 20 + 2);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    EXPECT_EQ(replica.dump(), origin.scene.dump());
    EXPECT_GT(origin.server->statistics().merged, 0u);
    EXPECT_EQ(client->statistics().snapshots, 1u);
}

TEST(MirrorRate, AFrameThatWaitsForItsTurnNeedsNothingElseToCome) {
    // The server hears nothing but the hello, and has nothing to say: only the turn itself can wake it.
    MirrorServerOptions quiet;
    quiet.heartbeat = quiet.peerTimeout = 60s;
    MovingOrigin origin(1, quiet);
    test::Middleman between(origin.server->endpoint(), [](bool toClient, const auto& parts) {
        return toClient || static_cast<mirror::Message>(parts[0][5]) == mirror::Message::hello;
    });
    MirrorClientOptions options;
    options.framesPerSecond = 50;
    options.maxLag = 0ms;
    Scene replica;
    auto client = *MirrorClient::connect(replica, between.endpoint, options);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < 20; ++i) {
        origin.step();
        origin.step();
        ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    }
    // Some .4 s; a server that looks around once a second of its own accord takes twenty.
    EXPECT_LT(std::chrono::steady_clock::now() - start, 10s);
}

TEST(MirrorClient, LooksForNoMoreThanHasCome) {
    MovingOrigin origin(3);
    std::atomic<std::uint64_t> passed{0};
    test::Middleman between(origin.server->endpoint(), [&](bool toClient, const auto&) {
        passed += toClient;
        return true;
    });
    Scene replica;
    auto client = *MirrorClient::connect(replica, between.endpoint);
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    for (int i = 0; i < 20; ++i) {
        origin.step();
        ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    }
    EXPECT_GE(client->statistics().messages, 21u);
    EXPECT_LE(client->statistics().messages, passed) << "none is counted that was not there";
}

TEST(MirrorClockTest, TheShortestRoundTripCountsAndItsOffsetIsRight) {
    constexpr double kAhead = 1234.5;  // seconds
    const auto theirs = [](std::uint64_t ours) { return ours + static_cast<std::uint64_t>(kAhead * 1e9); };
    MirrorClock clock;
    EXPECT_FALSE(clock.known());
    std::uint64_t now = 5'000'000'000;
    const std::uint64_t seed = 3;
    std::uint64_t random = seed;
    for (int i = 0; i < 40; ++i) {
        random = random * 6364136223846793005u + 1442695040888963407u;
        // There takes 2 ms and up to 50 ms more; back takes 2 ms.
        const std::uint64_t there = 2'000'000 + (i == 20 ? 0 : random % 50'000'000), back = 2'000'000;
        clock.sample(now, theirs(now + there), now + there + back);
        now += 100'000'000;
    }
    EXPECT_EQ(clock.samples(), 40u);
    EXPECT_NEAR(clock.delay(), .004, 1e-9);
    EXPECT_NEAR(clock.offset(), kAhead, 1e-9);
    EXPECT_NEAR(double(clock.here(theirs(now))) * 1e-9, double(now) * 1e-9, 1e-6);
    clock.sample(now, theirs(now), now - 1);  // answered before it was asked: no sample
    EXPECT_EQ(clock.samples(), 40u);
}

// Both ends use clocks that nobody sets. One that jumps all the same (a machine that was moved, say) is believed again
// once its last 32 samples are of the new time, however good the ones before were.
TEST(MirrorClockTest, AJumpIsForgottenAfterThirtyTwoSamples) {
    MirrorClock clock;
    std::uint64_t now = 5'000'000'000;
    for (const double ahead : {10.0, 3610.0, -3590.0}) {
        for (int i = 0; i < 32; ++i) {
            const std::uint64_t proxy = ahead == 10.0 ? 1'000'000 : 20'000'000;
            clock.sample(now, now + proxy + static_cast<std::uint64_t>(static_cast<std::int64_t>(ahead * 1e9)),
                         now + 2 * proxy);
            now += 500'000'000;
        }
        EXPECT_NEAR(clock.offset(), ahead, 1e-9);
    }
}

TEST(MirrorClockTest, JitterIsTheMeanChangeOfTransitTimes) {
    MirrorClock clock;
    std::uint64_t published = 1'000'000'000;
    for (int i = 0; i < 400; ++i) {
        published += 10'000'000;
        clock.arrival(published, published + (i % 2 ? 3'000'000 : 1'000'000));  // 2 ms to and fro
    }
    EXPECT_NEAR(clock.jitter(), .002, 1e-6);
}

TEST(MirrorClockTest, OfARealServerIsKnownSoon) {
    MovingOrigin origin(1);
    Scene replica;
    auto client = *MirrorClient::connect(replica, origin.server->endpoint());
    ASSERT_TRUE(pollUntil(*client, [&] { return client->statistics().clockSamples >= 5; }));
    // One machine, one clock.
    EXPECT_LE(std::abs(client->statistics().clockOffset), client->statistics().delay);
    EXPECT_GT(client->statistics().delay, 0);
}

TEST(MirrorLatency, FramesAreHeldAsLongAsAskedAndShownBetween) {
    MovingOrigin origin(3);
    MirrorClientOptions options;
    options.latency = 300ms;
    Scene replica;
    auto client = *MirrorClient::connect(replica, origin.server->endpoint(), options);
    ASSERT_TRUE(pollUntil(*client, [&] { return client->inStep() && client->statistics().clockSamples > 3; }));
    origin.step();
    ASSERT_TRUE(pollUntilAt(*client, origin.scene));
    const auto published = std::chrono::steady_clock::now();
    origin.step();
    const NodeId node = origin.nodes[1];
    const Vec3f before(1, float(node.value), 0), after(2, float(node.value), 0);
    bool between = false;
    ASSERT_TRUE(pollUntil(*client, [&] {
        const Vec3f shown = client->presented(node, x3d::Transform::translation.index).as<Vec3f>();
        EXPECT_GE(shown.x, before.x);
        EXPECT_LE(shown.x, after.x);
        between |= shown.x > before.x && shown.x < after.x;
        const bool applied = client->statistics().sequence == origin.scene.sequence();
        // The replica is in one state or the other.
        EXPECT_EQ(replica.node(node).get(x3d::Transform::translation), applied ? after : before);
        return applied;
    }));
    EXPECT_TRUE(between);
    EXPECT_GE(std::chrono::steady_clock::now() - published, 290ms);
    EXPECT_TRUE(client->statistics().equal);
    EXPECT_EQ(replica.dump(), origin.scene.dump());
}

TEST(MirrorLatency, HeldFramesAreBoundedByTheWindow) {
    MovingOrigin origin(500);
    MirrorClientOptions options;
    options.latency = 3600s;
    options.window = 64 << 10;
    Scene replica;
    auto client = *MirrorClient::connect(replica, origin.server->endpoint(), options);
    ASSERT_TRUE(pollUntil(*client, [&] { return client->statistics().frames > 0; }));
    for (int i = 0; i < 50; ++i) {
        origin.step();
        client->poll(1ms);
    }
    ASSERT_TRUE(pollUntil(*client, [&] { return client->statistics().frames > 20; })) << "an hour is not waited for";
}

TEST(Interpolation, IsLinearAndRotationsGoTheShorterWay) {
    EXPECT_EQ(interpolate(Vec3f(0, 2, 4), Vec3f(1, 4, 0), .5), Value(Vec3f(.5f, 3, 2)));
    EXPECT_EQ(interpolate(2.f, 4.f, .25), Value(2.5f));
    EXPECT_EQ(interpolate(String("a"), String("b"), .9), Value(String("a")));
    EXPECT_EQ(interpolate(Vec3f(1), Vec3f(2), 0), Value(Vec3f(1)));
    EXPECT_EQ(interpolate(Vec3f(1), Vec3f(2), 1.5), Value(Vec3f(2)));
    const float pi = std::acos(-1.f);
    const Value half = interpolate(Rotation{0, 1, 0, .2f}, Rotation{0, 1, 0, .6f}, .5);
    EXPECT_NEAR(half.as<Rotation>().angle * half.as<Rotation>().y, .4f, 1e-6);
    // From 0.9 pi to -0.9 pi about z it is 0.2 pi through pi, not 1.8 pi through 0.
    const Rotation through = interpolate(Rotation{0, 0, 1, .9f * pi}, Rotation{0, 0, -1, .9f * pi}, .5).as<Rotation>();
    EXPECT_NEAR(std::abs(std::sin(through.angle / 2) * through.z), 1, 1e-5);
}

}  // namespace
}  // namespace rtsg
