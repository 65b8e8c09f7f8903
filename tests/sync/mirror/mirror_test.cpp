// A server and its mirrors over loopback: joining, faults, slow peers, trees of mirrors, leaving.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/record.h>
#include <rtsg/sync/replay.h>

#include "mirror_support.h"
#include "support/random_edits.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::Middleman;
using test::pollUntil;
using test::pollUntilAt;

/// A scene that changes, and its server.
struct Origin {
    Scene scene;
    test::RandomEdits edits;
    std::unique_ptr<MirrorServer> server;
    int frame = 0;

    explicit Origin(std::uint64_t seed, MirrorServerOptions options = {}, const std::string& endpoint = test::kAnyPort)
        : edits(scene, seed) {
        serve(options, endpoint);
    }
    void serve(MirrorServerOptions options = {}, const std::string& endpoint = test::kAnyPort) {
        auto started = MirrorServer::start(scene, endpoint, std::move(options));
        EXPECT_TRUE(started) << started.error().text;
        if (started) server = std::move(*started);
    }
    void step(int frames = 1) {
        for (; frames > 0; --frames) {
            for (int i = 0; i < 8; ++i) edits.step();
            scene.newFrame(++frame * .1);
        }
    }
};

struct Replica {
    Scene scene;
    std::unique_ptr<MirrorClient> client;

    explicit Replica(const std::string& endpoint, MirrorClientOptions options = {}) {
        auto connected = MirrorClient::connect(scene, endpoint, std::move(options));
        EXPECT_TRUE(connected) << connected.error().text;
        if (connected) client = std::move(*connected);
    }
    const MirrorStatistics& statistics() const { return client->statistics(); }
};

void expectEqual(const Origin& origin, const Replica& replica) {
    EXPECT_EQ(replica.scene.hash(), origin.scene.hash());
    EXPECT_EQ(replica.scene.dump(), origin.scene.dump());
    EXPECT_TRUE(replica.statistics().equal);
    EXPECT_EQ(replica.statistics().hash, replica.statistics().originHash);
    EXPECT_EQ(replica.statistics().sequence, origin.scene.sequence());
}

class Mirror : public testing::TestWithParam<std::uint64_t> {};

TEST_P(Mirror, ReplicaEqualsTheOriginAfterEveryFrame) {
    Origin origin(GetParam());
    Replica replica(origin.server->endpoint());
    for (int frame = 0; frame < 60; ++frame) {
        origin.step();
        ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene)) << "frame " << frame;
        expectEqual(origin, replica);
        if (HasFailure()) return;
    }
    EXPECT_EQ(replica.statistics().snapshots, 1u);
    EXPECT_EQ(replica.statistics().gaps, 0u);
    EXPECT_EQ(replica.statistics().divergences, 0u);
    EXPECT_EQ(replica.statistics().garbage, 0u);
    EXPECT_GE(replica.statistics().frames, 60u);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Mirror, testing::Range<std::uint64_t>(1, 7));

TEST(MirrorThreads, PollsOfAnotherThreadDoNothingAndSaySo) {
    Origin origin(31);
    origin.step(5);
    Replica replica(origin.server->endpoint());
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    const std::uint64_t before = replica.statistics().sequence;
    origin.step(5);
    std::size_t applied = 0;
    std::vector<Diagnostic> said;
    std::thread([&] {
        for (int i = 0; i < 50; ++i) applied += replica.client->poll(1ms);
        said = replica.client->takeDiagnostics();
    }).join();
    EXPECT_EQ(applied, 0u);
    ASSERT_EQ(said.size(), 1u) << "once for all";
    EXPECT_EQ(said[0].severity, Severity::error);
    EXPECT_NE(said[0].text.find("another thread"), std::string::npos) << said[0].text;
    EXPECT_NE(said[0].text.find("50 calls"), std::string::npos) << said[0].text;
    EXPECT_EQ(replica.statistics().sequence, before);
    // On its own thread it goes on as if nothing had been: no hello more, no keyframe more.
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    expectEqual(origin, replica);
    EXPECT_TRUE(replica.client->takeDiagnostics().empty());
    EXPECT_EQ(origin.server->statistics().snapshots, 1u);
    EXPECT_EQ(origin.server->statistics().resumed, 0u);
}

TEST(MirrorThreads, AReplicaOfAnotherThreadIsNotConnected) {
    Scene replica;
    EXPECT_TRUE(replica.isOwnThread());
    std::thread([&] {
        EXPECT_FALSE(replica.isOwnThread());
        const auto client = MirrorClient::connect(replica, "tcp://127.0.0.1:1");
        ASSERT_FALSE(client);
        EXPECT_NE(client.error().text.find("another thread"), std::string::npos) << client.error().text;
    }).join();
}

TEST(MirrorJoin, LateJoinersGetOneSnapshotAndFollow) {
    Origin origin(11);
    Replica first(origin.server->endpoint());
    origin.step(50);
    ASSERT_TRUE(pollUntilAt(*first.client, origin.scene));
    Replica second(origin.server->endpoint());
    ASSERT_TRUE(pollUntil(*second.client, [&] {
        origin.server->service();
        return second.client->inStep() && second.statistics().sequence == origin.scene.sequence();
    }));
    expectEqual(origin, second);
    for (int frame = 0; frame < 20; ++frame) {
        origin.step();
        for (Replica* replica : {&first, &second}) {
            ASSERT_TRUE(pollUntilAt(*replica->client, origin.scene));
            expectEqual(origin, *replica);
        }
    }
    EXPECT_EQ(second.statistics().snapshots, 1u);
    EXPECT_TRUE(eventually([&] { return origin.server->statistics().peers == 2; }));
}

TEST(MirrorJoin, WhoComesLateGetsTheStateOfNowAndNotWhatLedToIt) {
    Scene scene;
    const NodeId box = scene.createNode(x3d::Transform::type);
    scene.newFrame(0);
    const auto server = std::move(*MirrorServer::start(scene, test::kAnyPort));
    Replica first(server->endpoint());
    ASSERT_TRUE(pollUntilAt(*first.client, scene));
    for (int frame = 1; frame <= 3000; ++frame) {
        ASSERT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(float(frame), 0, 0)));
        scene.newFrame(frame * .01);
    }
    // A machine so busy that no keyframe comes within .2 s gives the one there is.
    std::uint64_t minimum = UINT64_MAX, bytes = 0, known = 0;
    for (int tries = 0; tries < 10 && minimum > 200; ++tries) {
        Replica late(server->endpoint());
        ASSERT_TRUE(pollUntil(*late.client, [&] { return late.statistics().frames > 0; }));
        known = late.statistics().originSequence;
        ASSERT_TRUE(pollUntilAt(*late.client, scene));
        minimum = std::min(minimum, late.statistics().frames);
        bytes = late.statistics().bytes;
    }
    EXPECT_EQ(known, scene.sequence()) << "the welcome says how far there is to go";
    EXPECT_LE(minimum, 200u);
    EXPECT_LE(bytes, 32u << 10);
}

TEST(MirrorJoin, TheClientMayBeThereFirst) {
    Scene scene;
    std::string endpoint;
    {
        Origin placeholder(1);
        endpoint = placeholder.server->endpoint();
    }
    Replica replica(endpoint);
    EXPECT_EQ(replica.client->poll(20ms), 0u);
    EXPECT_FALSE(replica.client->inStep());
    Origin origin(2, {}, endpoint);
    origin.step(3);
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    expectEqual(origin, replica);
}

TEST(MirrorJoin, ALargeSnapshotComesInPartsWithinTheWindow) {
    Origin origin(12);
    Array<Vec3f> points = Array<Vec3f>::ofSize(400000);  // 4.8 MB
    for (std::size_t i = 0; i < points.size(); ++i) points.mutableData()[i] = Vec3f(float(i));
    const NodeId node = origin.scene.createNode(x3d::Coordinate::type);
    ASSERT_TRUE(origin.scene.set(node, x3d::Coordinate::point, points));
    origin.step();
    MirrorClientOptions options;
    options.window = 64 << 10;
    Replica replica(origin.server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    expectEqual(origin, replica);
    EXPECT_GT(replica.statistics().bytes, 4800000u);
}

TEST(MirrorFault, ADroppedMessageIsNoticedAndTheFramesResumed) {
    Origin origin(21);
    std::atomic<int> data{0};
    Middleman middle(origin.server->endpoint(), [&](bool toClient, Middleman::Parts& parts) {
        const bool isData = toClient && parts.size() == 2 && parts[0][5] == 17;
        return !(isData && ++data == 10);
    });
    Replica replica(middle.endpoint);
    for (int frame = 0; frame < 40; ++frame) {
        origin.step();
        // The frame after the lost one shows the gap.
        if (frame != 8) {
            ASSERT_TRUE(pollUntil(*replica.client, [&] {
                if (replica.statistics().gaps == 0 && data >= 10) origin.step();
                return replica.client->inStep() && replica.statistics().sequence == origin.scene.sequence();
            })) << frame;
        }
    }
    expectEqual(origin, replica);
    EXPECT_EQ(replica.statistics().gaps, 1u);
    EXPECT_EQ(replica.statistics().snapshots, 1u);
    EXPECT_TRUE(eventually([&] { return origin.server->statistics().resumed == 1; }));
}

TEST(MirrorFault, ABentRecordIsRefusedByItsChecksum) {
    Origin origin(22);
    std::atomic<int> data{0};
    Middleman middle(origin.server->endpoint(), [&](bool toClient, Middleman::Parts& parts) {
        if (toClient && parts.size() == 2 && parts[0][5] == 17 && ++data == 6) parts[1].back() ^= 0x10;
        return true;
    });
    Replica replica(middle.endpoint);
    for (int frame = 0; frame < 20; ++frame) {
        origin.step();
        ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene)) << frame;
        expectEqual(origin, replica);
    }
    EXPECT_EQ(replica.statistics().garbage, 1u);
    EXPECT_EQ(replica.statistics().divergences, 0u);
    EXPECT_EQ(replica.statistics().snapshots, 1u);
}

TEST(MirrorFault, ALogOfAReplicaSurvivesTheRestartOfItsOrigin) {
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("rtsg-mirror-" + std::to_string(::getpid()) + ".rlog");
    auto first = std::make_unique<Origin>(61);
    const std::string endpoint = first->server->endpoint();
    Replica replica(endpoint);
    std::vector<Hash128> states;
    {
        auto log = *LogWriter::create(file, builtinTypes());
        Attachment attachment = replica.scene.bus().attach(*log);
        for (int frame = 0; frame < 20; ++frame) {
            first->step();
            ASSERT_TRUE(pollUntilAt(*replica.client, first->scene));
            states.push_back(first->scene.hash());
        }
        first.reset();
        Origin second(62, {}, endpoint);
        for (int frame = 0; frame < 10; ++frame) {
            second.step();
            ASSERT_TRUE(pollUntilAt(*replica.client, second.scene));
            states.push_back(second.scene.hash());
        }
        EXPECT_EQ(attachment.failure(), "");
    }
    auto replayer = *Replayer::open(file);
    std::vector<Hash128> replayed;
    while (*replayer->step())
        if (replayer->scene().sequence() > 0) replayed.push_back(replayer->scene().hash());
    std::filesystem::remove(file);
    EXPECT_EQ(replayed, states);
    EXPECT_EQ(replayer->gaps(), 0u);
    EXPECT_EQ(replayer->frames(), replayer->verified());
}

struct Resets : Subscriber {
    int snapshots = 0;
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        snapshots += changes.isSnapshot();
        return {};
    }
};

TEST(MirrorFault, ARestartedServerIsNoticedAndTheReplicaStartsOver) {
    auto first = std::make_unique<Origin>(31);
    first->step(10);
    const std::string endpoint = first->server->endpoint();
    Replica replica(endpoint);
    ASSERT_TRUE(pollUntilAt(*replica.client, first->scene));
    Resets resets;
    Attachment attachment = replica.scene.bus().attach(resets);
    EXPECT_EQ(resets.snapshots, 1);
    first.reset();
    EXPECT_TRUE(pollUntil(*replica.client, [&] { return !replica.client->inStep(); }));
    Origin second(32, {}, endpoint);
    second.step(4);  // fewer frames: the same numbers mean other states
    ASSERT_TRUE(pollUntilAt(*replica.client, second.scene));
    expectEqual(second, replica);
    EXPECT_EQ(replica.statistics().restarts, 1u);
    EXPECT_EQ(replica.statistics().holes, 1u);
    EXPECT_GT(replica.statistics().missed, 0);
    EXPECT_EQ(resets.snapshots, 2);
    second.step(5);
    ASSERT_TRUE(pollUntilAt(*replica.client, second.scene));
    expectEqual(second, replica);
    EXPECT_EQ(resets.snapshots, 2);
}

TEST(MirrorFault, AForgottenClientResumesFromTheHistory) {
    MirrorServerOptions options;
    options.heartbeat = 20ms;
    options.peerTimeout = 100ms;
    Origin origin(33, options);
    Replica replica(origin.server->endpoint());
    origin.step();
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    // The replica's thread has other things to do for a while.
    ASSERT_TRUE(eventually([&] { return origin.server->statistics().lost == 1; }));
    origin.step(20);
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    expectEqual(origin, replica);
    EXPECT_EQ(replica.statistics().snapshots, 1u);
    EXPECT_TRUE(eventually([&] { return origin.server->statistics().resumed == 1; }));
}

/// Pictures of each state, say: many that have come at once take longer than the server waits for a sign of life.
TEST(MirrorFault, AClientThatIsBusyWithWhatCameIsStillThere) {
    struct Slow : Subscriber {
        Result<> apply(const Scene&, const ChangeSet&) override {
            std::this_thread::sleep_for(80ms);
            return {};
        }
    } slow;
    MirrorServerOptions options;
    options.peerTimeout = 2s;
    Origin origin(35, options);
    Replica replica(origin.server->endpoint());
    origin.step();
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    Attachment attachment = replica.scene.bus().attach(slow);
    for (int i = 0; i < 45; ++i) {
        origin.step();
        std::this_thread::sleep_for(2ms);  // so that they come one by one
    }
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    expectEqual(origin, replica);
    EXPECT_EQ(origin.server->statistics().lost, 0u);
}

TEST(MirrorFault, BeyondTheHistoryAForgottenClientGetsASnapshot) {
    MirrorServerOptions options;
    options.heartbeat = 20ms;
    options.peerTimeout = 100ms;
    options.history = 2000;
    Origin origin(34, options);
    Replica replica(origin.server->endpoint());
    origin.step();
    ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene));
    ASSERT_TRUE(eventually([&] { return origin.server->statistics().lost == 1; }));
    origin.step(100);
    ASSERT_TRUE(pollUntil(*replica.client, [&] {
        origin.server->service();
        return replica.client->inStep() && replica.statistics().sequence == origin.scene.sequence();
    }));
    expectEqual(origin, replica);
    EXPECT_EQ(replica.statistics().snapshots, 2u);
    EXPECT_EQ(origin.server->statistics().resumed, 0u);
}

TEST(MirrorSlow, ASlowPeerGetsMergedSetsAndTheOthersEveryFrame) {
    Scene scene;
    auto server = *MirrorServer::start(scene, test::kAnyPort);
    MirrorClientOptions narrow;
    narrow.window = 64 << 10;
    Replica slow(server->endpoint(), narrow), fast(server->endpoint());
    std::vector<NodeId> nodes;
    for (int i = 0; i < 500; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
    scene.newFrame(0);
    for (Replica* replica : {&slow, &fast}) ASSERT_TRUE(pollUntilAt(*replica->client, scene));
    const std::uint64_t before = fast.statistics().frames;
    for (int frame = 1; frame <= 100; ++frame) {
        for (const NodeId node : nodes) ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(frame))));
        scene.newFrame(frame);
        ASSERT_TRUE(pollUntilAt(*fast.client, scene));
        ASSERT_EQ(fast.statistics().hash, scene.hash());
    }
    EXPECT_EQ(fast.statistics().frames - before, 100u);
    ASSERT_TRUE(pollUntilAt(*slow.client, scene));
    EXPECT_EQ(slow.scene.dump(), scene.dump());
    EXPECT_TRUE(slow.statistics().equal);
    EXPECT_LT(slow.statistics().frames, 60u);
    EXPECT_TRUE(eventually([&] { return server->statistics().merged > 40; }));
    EXPECT_EQ(slow.statistics().gaps, 0u);
}

TEST(MirrorTree, AReplicaServesFurtherReplicasThroughARestartOfTheOrigin) {
    auto origin = std::make_unique<Origin>(41);
    const std::string endpoint = origin->server->endpoint();
    Replica relay(endpoint);
    auto relayServer = *MirrorServer::start(relay.scene, test::kAnyPort);
    Replica leaf(relayServer->endpoint());
    const auto settle = [&] {
        return pollUntil(*leaf.client, [&] {
            relay.client->poll();
            return relay.client->inStep() && leaf.client->inStep() &&
                   leaf.statistics().sequence == origin->scene.sequence() && leaf.scene.hash() == origin->scene.hash();
        });
    };
    for (int frame = 0; frame < 20; ++frame) {
        origin->step();
        ASSERT_TRUE(settle()) << frame;
        EXPECT_EQ(leaf.scene.dump(), origin->scene.dump());
    }
    origin.reset();
    origin = std::make_unique<Origin>(42, MirrorServerOptions{}, endpoint);
    for (int frame = 0; frame < 20; ++frame) {
        origin->step();
        ASSERT_TRUE(settle()) << frame;
        EXPECT_EQ(leaf.scene.dump(), origin->scene.dump());
    }
    EXPECT_EQ(leaf.statistics().divergences, 0u);
}

// ZeroMQ deletes whatever is at the path of an ipc endpoint.
TEST(MirrorBind, ASocketsPathIsTakenFromNobodyWhoLives) {
    const test::TempFolder folder;
    const std::string path = folder / "socket", endpoint = "ipc://" + path;
    Scene second;
    {
        Origin origin(61, {}, endpoint);
        const auto other = MirrorServer::start(second, endpoint);
        ASSERT_FALSE(other);
        EXPECT_NE(other.error().text.find("Address already in use"), std::string::npos) << other.error().text;
        Replica replica(endpoint);
        origin.step();
        ASSERT_TRUE(pollUntilAt(*replica.client, origin.scene)) << "the one that was there is there still";
        expectEqual(origin, replica);
    }
    // The remains of a killed server are in nobody's way.
    ::unlink(path.c_str());
    const int left = ::socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, path.size());
    ASSERT_EQ(::bind(left, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ::close(left);
    EXPECT_TRUE(MirrorServer::start(second, endpoint));

    const std::string scene = folder / "scene.x3d";
    std::ofstream(scene) << "somebody's work";
    const auto wrong = MirrorServer::start(second, "ipc://" + scene);
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().text.find("there is a file of that name"), std::string::npos) << wrong.error().text;
    EXPECT_TRUE(std::filesystem::exists(scene));
}

TEST(MirrorShutdown, NobodyHangsWhenTheOtherSideIsGone) {
    const auto start = std::chrono::steady_clock::now();
    {
        auto origin = std::make_unique<Origin>(51);
        origin->step();
        Replica replica(origin->server->endpoint());
        replica.client->poll(50ms);
        origin->step(200);
        origin.reset();  // with frames still under way
    }
    {
        Replica alone("tcp://127.0.0.1:1");
    }
    EXPECT_LT(std::chrono::steady_clock::now() - start, 10s);
}

}  // namespace
}  // namespace rtsg
