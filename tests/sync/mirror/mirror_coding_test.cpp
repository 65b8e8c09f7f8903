// Mirrors in every coding: those who follow, join, lag and come back get the same states in fewer bytes, and so do
// those who come to a replica.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/lossy_scene.h>

#include "bench/motion_sync.h"
#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntilAt;

struct CodingKind {
    StreamMode mode;
    const char* name;
};

struct CodedReplica {
    Scene scene;
    std::unique_ptr<MirrorClient> client;
    explicit CodedReplica(const std::string& endpoint, MirrorClientOptions options = {})
        : client(*MirrorClient::connect(scene, endpoint, std::move(options))) {}
};

/// Bodies that tumble, and who follows them.
struct ServedCoding {
    explicit ServedCoding(const StreamMode& mode) {
        for (std::size_t i = 0; i < 60; ++i) {
            nodes.push_back(origin.createNode(x3d::Transform::type));
            EXPECT_TRUE(origin.setName(nodes.back(), "B" + std::to_string(i)));
        }
        origin.newFrame(0);
        if (mode.mode == Mode::lossy) lossy = *LossyScene::follow(origin, mode.maxError);
        MirrorServerOptions options;
        options.mode = mode;
        server = *MirrorServer::start(shown(), test::kAnyPort, options);
    }
    Scene& shown() { return lossy ? lossy->scene() : origin; }
    void step() {
        for (const Change& change : motion.next().changes)
            ASSERT_TRUE(origin.setField(nodes[(change.node.value - bench::Motion::kFirstNode) / 3], change.field,
                                        change.value));
        origin.newFrame(++frame / 60.);
    }
    Scene origin;
    std::vector<NodeId> nodes;
    std::unique_ptr<LossyScene> lossy;
    std::unique_ptr<MirrorServer> server;
    bench::Motion motion{bench::Movement::chaotic, 60, 5};
    int frame = 0;
};

/// The second coding costs the scene's thread twice what the first does: not for nobody.
TEST(MirrorCodingCost, FramesAreCodedASecondTimeOnlyForThoseWhoTakeThem) {
    ServedCoding served({Mode::state, Coding::compact, 0});
    for (int i = 0; i < 20; ++i) served.step();
    EXPECT_EQ(served.server->statistics().coded, 0u);
    {
        MirrorClientOptions options;
        options.framesPerSecond = 1000;  // may come merged, which has no predictions
        CodedReplica paced(served.server->endpoint(), options);
        ASSERT_TRUE(pollUntilAt(*paced.client, served.origin));
        for (int i = 0; i < 20; ++i) served.step();
        ASSERT_TRUE(pollUntilAt(*paced.client, served.origin));
    }
    EXPECT_EQ(served.server->statistics().coded, 0u);
    for (int time = 0; time < 2; ++time) {
        const std::uint64_t before = served.server->statistics().coded;
        CodedReplica replica(served.server->endpoint());
        ASSERT_TRUE(pollUntilAt(*replica.client, served.origin));
        ASSERT_TRUE(test::eventually([&] {
            served.step();
            replica.client->poll();
            return served.server->statistics().coded > before + 50;
        }));
        ASSERT_TRUE(pollUntilAt(*replica.client, served.origin));
        EXPECT_EQ(replica.scene.hash(), served.origin.hash());
        EXPECT_EQ(replica.client->statistics().gaps, 0u);
        EXPECT_EQ(replica.client->statistics().divergences, 0u);
        replica.client.reset();
        ASSERT_TRUE(test::eventually([&] { return served.server->statistics().peers == 0; }));
        const std::uint64_t left = served.server->statistics().coded;
        for (int i = 0; i < 20; ++i) served.step();
        EXPECT_EQ(served.server->statistics().coded, left);
    }
}

class MirrorCoding : public testing::TestWithParam<CodingKind> {};
INSTANTIATE_TEST_SUITE_P(Modes, MirrorCoding,
                         testing::Values(CodingKind{{Mode::state, Coding::compact, 0}, "compact"},
                                         CodingKind{{Mode::state, Coding::smallest, 0}, "smallest"},
                                         CodingKind{{Mode::lossy, Coding::smallest, 1e-3}, "lossy"}),
                         [](const auto& p) { return p.param.name; });

TEST_P(MirrorCoding, WhoFollowsJoinsAndLagsIsInStepWithFewerBytes) {
    ServedCoding served(GetParam().mode);
    CodedReplica first(served.server->endpoint());
    ASSERT_TRUE(pollUntilAt(*first.client, served.shown()));
    MirrorClientOptions narrow;
    narrow.window = 1;  // as small as servers allow
    CodedReplica lagging(served.server->endpoint(), narrow);
    ASSERT_TRUE(pollUntilAt(*lagging.client, served.shown()));
    MirrorClientOptions paced;
    paced.framesPerSecond = 20;
    CodedReplica slow(served.server->endpoint(), paced);
    std::unique_ptr<CodedReplica> late;
    const auto verified = [&](CodedReplica& replica, const char* who) {
        SCOPED_TRACE(who);
        ASSERT_TRUE(pollUntilAt(*replica.client, served.shown()));
        EXPECT_EQ(replica.client->statistics().divergences, 0u);
        EXPECT_EQ(replica.client->statistics().garbage, 0u);
        EXPECT_EQ(replica.client->statistics().gaps, 0u);
        EXPECT_EQ(replica.scene.hash(), served.shown().hash());
    };
    std::uint64_t before = 0;
    for (int i = 0; i < 400; ++i) {
        served.step();
        served.server->service();
        first.client->poll(1ms);
        ASSERT_TRUE(pollUntilAt(*first.client, served.shown())) << i;
        ASSERT_EQ(first.client->statistics().divergences, 0u) << i;
        if (i % 100 == 99) slow.client->poll(1ms);
        if (i == 150) late = std::make_unique<CodedReplica>(served.server->endpoint());
        if (late) late->client->poll(0ms);
        if (i == 300) before = first.client->statistics().bytes;
    }
    verified(*late, "late");
    verified(lagging, "lagging");
    verified(slow, "slow");
    for (int i = 0; i < 60; ++i) {
        served.step();
        served.server->service();
        for (CodedReplica* replica : {&first, &lagging, &slow, late.get()}) replica->client->poll(1ms);
        std::this_thread::sleep_for(5ms);
    }
    for (CodedReplica* replica : {&first, &lagging, &slow, late.get()}) verified(*replica, "at the end");
    // A frame's own head is 64 bytes; raw, its values take 60 times 30.
    const double perFrame = double(first.client->statistics().bytes - before) / 159;
    EXPECT_LT(perFrame, GetParam().mode.mode == Mode::lossy ? 600 : 1000);
}

TEST(MirrorCodingModes, RefuseWhatTheyCannotCarry) {
    Scene scene;
    MirrorServerOptions options;
    options.mode = {Mode::lossy, Coding::smallest, 1e-3};
    options.upstream = MirrorUpstream::events;
    EXPECT_FALSE(MirrorServer::start(scene, test::kAnyPort, options));
}

/// Applies what it gets to a scene of its own.
struct FollowsAReplica : Subscriber {
    Scene scene;
    int sets = 0, snapshots = 0;
    FollowsAReplica() { scene.setBehavioursEnabled(false); }
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        ++sets;
        if (changes.isSnapshot()) ++snapshots;
        return scene.apply(std::make_shared<const ChangeSet>(changes));
    }
};

TEST(MirrorAgain, WhoComesToAReplicaInMotionSeesAllOfItAndWhoGoesLeavesItWhole) {
    Scene origin, replica;
    std::vector<NodeId> nodes;
    for (int i = 0; i < 50; ++i) nodes.push_back(origin.createNode(x3d::Transform::type));
    origin.newFrame(0);
    auto server = MirrorServer::start(origin, test::kAnyPort);
    ASSERT_TRUE(server);
    MirrorClientOptions options;
    options.whenSlow = MirrorWhenSlow::block;  // frame by frame
    auto client = MirrorClient::connect(replica, (*server)->endpoint(), options);
    ASSERT_TRUE(client && pollUntilAt(**client, origin));
    int frame = 0;
    const auto show = [&](int frames) {
        for (int i = 0; i < frames; ++i) {
            ++frame;
            for (std::size_t n = 0; n < nodes.size(); ++n) {
                ASSERT_TRUE(origin.set(nodes[n], x3d::Transform::translation, Vec3f(float(frame), float(n), 0)));
                ASSERT_TRUE(origin.set(nodes[n], x3d::Transform::rotation, Rotation{0, 1, 0, float(frame + int(n))}));
            }
            // Now and then something else as well.
            if (frame % 9 == 0) {
                ASSERT_TRUE(origin.setName(nodes[0], "N" + std::to_string(frame)));
            }
            origin.newFrame(frame / 60.);
            ASSERT_TRUE(pollUntilAt(**client, origin));
            ASSERT_EQ(replica.hash(), origin.hash()) << frame;
        }
    };
    for (int round = 0; round < 4; ++round) {
        show(6);
        FollowsAReplica follower;
        const Attachment attachment = replica.bus().attach(follower);
        show(6);
        EXPECT_TRUE(attachment.attached()) << attachment.failure();
        EXPECT_EQ(follower.sets, 7);
        EXPECT_EQ(follower.snapshots, 1);
        EXPECT_EQ(follower.scene.dump(), origin.dump());
    }
    show(3);
    EXPECT_EQ(replica.dump(), origin.dump());
    const MirrorStatistics& statistics = (*client)->statistics();
    EXPECT_EQ(statistics.frames, static_cast<std::uint64_t>(frame) + 1);
    EXPECT_EQ(statistics.snapshots, 1u);
    EXPECT_EQ(statistics.divergences, 0u);
}

}  // namespace
}  // namespace rtsg
