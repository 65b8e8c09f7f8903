// Peers get what a log has: frames and verdicts wait for it, over restarts of the scene too, and go on when it ends or
// hangs.
#include <limits>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/log_recorder.h>

#include "mirror_support.h"
#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntil;
using test::pollUntilAt;

constexpr auto kForEver = std::chrono::hours(1);

/// A scene with a server whose peers wait for a log that the test plays.
struct LogFirst {
    Scene scene;
    std::unique_ptr<MirrorServer> server;
    std::function<void(std::uint64_t, std::uint64_t)> logged;
    NodeId box;
    Scene replica;
    std::unique_ptr<MirrorClient> client;

    explicit LogFirst(std::chrono::milliseconds atMost = kForEver) {
        box = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{box}));
        scene.newFrame(0);
        MirrorServerOptions options;
        options.upstream = MirrorUpstream::edits;
        server = *MirrorServer::start(scene, test::kAnyPort, std::move(options));
        logged = server->sendWhatIsLogged(atMost);
        logged(0, scene.sequence());
        client = *MirrorClient::connect(replica, server->endpoint());
        EXPECT_TRUE(pollUntilAt(*client, scene));
    }
    std::uint64_t move(float x) {
        EXPECT_TRUE(scene.setField(box, x3d::Transform::translation.index, Vec3f{x, 0, 0}));
        scene.newFrame(x);
        return scene.sequence();
    }
    std::uint64_t came() const { return client->statistics().sequence; }
    /// A round trip between peer and server after what came before: what could have come has.
    void letCome() {
        const auto until = std::chrono::steady_clock::now() + 100ms;
        while (std::chrono::steady_clock::now() < until) client->poll(5ms);
    }
};

TEST(MirrorLogFirst, FramesWaitUntilTheLogHasThem) {
    LogFirst test;
    const std::uint64_t before = test.scene.sequence(), first = test.move(1), second = test.move(2);
    test.letCome();
    EXPECT_EQ(test.came(), before);
    test.logged(0, first);
    EXPECT_TRUE(pollUntil(*test.client, [&] { return test.came() == first; }));
    test.letCome();
    EXPECT_EQ(test.came(), first);
    test.logged(0, second);
    EXPECT_TRUE(pollUntilAt(*test.client, test.scene));
    EXPECT_EQ(test.replica.hash(), test.scene.hash());
}

TEST(MirrorLogFirst, WhoJoinsMeanwhileGetsNothingNewerEither) {
    LogFirst test;
    const std::uint64_t before = test.scene.sequence();
    test.move(1);
    Scene late;
    const auto client = *MirrorClient::connect(late, test.server->endpoint());
    EXPECT_TRUE(pollUntil(*client, [&] { return client->inStep(); }));
    EXPECT_EQ(client->statistics().sequence, before);
    test.logged(0, test.scene.sequence());
    EXPECT_TRUE(pollUntilAt(*client, test.scene));
}

TEST(MirrorLogFirst, VerdictsWaitWithTheirFrames) {
    LogFirst test;
    MirrorRequest request;
    Change change;
    change.kind = ChangeKind::setField;
    change.node = test.box;
    change.field = x3d::Transform::translation.index;
    change.value = Vec3f{5, 0, 0};
    request.changes.push_back(change);
    ASSERT_TRUE(test.client->submit(request));
    ASSERT_TRUE(pollUntil(*test.client, [&] {
        test.server->service();
        return test.scene.node(test.box).get(x3d::Transform::translation) == Vec3f{5, 0, 0};
    }));
    test.scene.newFrame(1);
    test.letCome();
    EXPECT_TRUE(test.client->takeVerdicts().empty());
    test.logged(0, test.scene.sequence());
    std::vector<MirrorVerdict> verdicts;
    EXPECT_TRUE(pollUntil(*test.client, [&] { return !(verdicts = test.client->takeVerdicts()).empty(); }));
    ASSERT_EQ(verdicts.size(), 1u);
    EXPECT_EQ(verdicts[0].refusal, "");
    EXPECT_GE(test.came(), verdicts[0].state);
}

TEST(MirrorLogFirst, StatesOfAnEarlierStartDoNotCount) {
    Scene origin;
    const NodeId box = origin.createNode(x3d::Transform::type);
    ASSERT_TRUE(origin.setField(origin.root(), x3d::RtsgScene::children.index, Array<NodeId>{box}));
    for (int i = 0; i < 10; ++i) {
        ASSERT_TRUE(origin.setField(box, x3d::Transform::translation.index, Vec3f{1.f * i, 0, 0}));
        origin.newFrame(i);
    }
    LogFirst test;
    const std::uint64_t before = test.scene.sequence();
    test.logged(0, 1'000);
    ASSERT_TRUE(test.scene.reset());
    ASSERT_TRUE(test.scene.apply(std::make_shared<const ChangeSet>(origin.snapshot())));
    test.letCome();
    EXPECT_NE(test.replica.hash(), test.scene.hash());
    EXPECT_EQ(test.came(), before);
    test.logged(1, test.scene.sequence());
    EXPECT_TRUE(pollUntil(*test.client, [&] { return test.replica.hash() == test.scene.hash(); }));
}

TEST(MirrorLogFirst, NothingWaitsForALogThatHasEndedOrForOneThatHangs) {
    constexpr std::uint64_t kAny = std::numeric_limits<std::uint64_t>::max();
    LogFirst ended;
    ended.move(1);
    ended.logged(kAny, kAny);
    EXPECT_TRUE(pollUntilAt(*ended.client, ended.scene));
    ended.move(2);
    EXPECT_TRUE(pollUntilAt(*ended.client, ended.scene));
    LogFirst hangs(50ms);
    hangs.move(1);
    EXPECT_TRUE(pollUntilAt(*hangs.client, hangs.scene));
}

TEST(MirrorLogFirst, AServerThatEndsSendsWhatIsLeft) {
    LogFirst test;
    const std::uint64_t last = test.move(1);
    const Hash128 hash = test.scene.hash();
    std::thread ends([&] { test.server.reset(); });
    EXPECT_TRUE(pollUntil(*test.client, [&] { return test.came() == last; }));
    ends.join();
    EXPECT_EQ(test.replica.hash(), hash);
}

using MirrorOfARecordedScene = test::LogFolder;

TEST_F(MirrorOfARecordedScene, IsNeverAheadOfTheLog) {
    Scene scene;
    const NodeId box = scene.createNode(x3d::Transform::type);
    ASSERT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{box}));
    scene.newFrame(0);
    auto server = *MirrorServer::start(scene, test::kAnyPort);
    auto recorder = *LogRecorder::start(scene, file());
    recorder->onAcknowledged(server->sendWhatIsLogged(kForEver));
    ASSERT_TRUE(recorder->waitFor(scene.sequence(), 60s)) << "what was sent before that";
    Scene replica;
    const auto client = *MirrorClient::connect(replica, server->endpoint());
    ASSERT_TRUE(pollUntilAt(*client, scene));
    for (int frame = 1; frame <= 300; ++frame) {
        ASSERT_TRUE(scene.setField(box, x3d::Transform::translation.index, Vec3f{1.f * frame, 0, 0}));
        scene.newFrame(frame * .1);
        ASSERT_TRUE(pollUntil(*client, [&] {
            const std::uint64_t came = client->statistics().sequence;  // read first: the log may only grow
            EXPECT_LE(came, recorder->acknowledged());
            return came == scene.sequence();
        })) << frame;
    }
    ASSERT_TRUE(recorder->stop());
    scene.newFrame(100);
    ASSERT_TRUE(scene.setField(box, x3d::Transform::translation.index, Vec3f{}));
    scene.newFrame(101);
    EXPECT_TRUE(pollUntilAt(*client, scene)) << "a log that has ended holds nobody up";
}

}  // namespace
}  // namespace rtsg
