// Edits that are shown at once: before the answer, when it is no, and when others write to the same field.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/optimistic_scene.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using Tr = x3d::Transform;

struct Draggable {
    Scene origin, replica;
    NodeId a, b;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;
    std::unique_ptr<OptimisticScene> mine;
    double time = 0;

    Draggable() {
        a = origin.createNode(Tr::type);
        b = origin.createNode(Tr::type);
        EXPECT_TRUE(origin.setField(origin.root(), x3d::RtsgScene::children.index, Array<NodeId>{a, b}));
        origin.newFrame(0);
        MirrorServerOptions options;
        options.upstream = MirrorUpstream::edits;
        server = *MirrorServer::start(origin, test::kAnyPort, options);
        client = *MirrorClient::connect(replica, server->endpoint());
        mine = std::make_unique<OptimisticScene>(*client, replica);
        EXPECT_TRUE(reach([&] { return client->inStep(); }));
    }
    /// Without the origin looking at what was sent.
    bool reach(const std::function<bool()>& condition) {
        return test::eventually([&] {
            mine->poll(1ms);
            return condition();
        });
    }
    bool settled() {
        return reach([&] {
            server->service();
            origin.newFrame(time += .1);
            mine->poll(1ms);
            return client->unanswered() == 0 && client->inStep() && client->statistics().sequence == origin.sequence();
        });
    }
    Vec3f shown(NodeId node) { return mine->scene().node(node).get(Tr::translation); }
    Vec3f there(NodeId node) { return replica.node(node).get(Tr::translation); }
};

TEST(OptimisticScene, ShowsAnEditBeforeTheOriginHasIt) {
    Draggable d;
    EXPECT_EQ(d.mine->scene().hash(), d.replica.hash());
    for (int i = 1; i <= 5; ++i) {  // a drag
        ASSERT_TRUE(d.mine->edit(d.a, Tr::translation.index, Vec3f(static_cast<float>(i), 0, 0)));
        EXPECT_EQ(d.shown(d.a), Vec3f(static_cast<float>(i), 0, 0));
        EXPECT_EQ(d.there(d.a), Vec3f(0));
    }
    EXPECT_EQ(d.mine->waiting(), 1u);
    // Changes by others are visible meanwhile.
    ASSERT_TRUE(d.origin.setField(d.b, Tr::translation.index, Vec3f(9)));
    d.origin.newFrame(d.time += .1);
    ASSERT_TRUE(d.reach([&] { return d.shown(d.b) == Vec3f(9); }));
    EXPECT_EQ(d.shown(d.a), Vec3f(5, 0, 0));
    ASSERT_TRUE(d.settled());
    EXPECT_EQ(d.mine->waiting(), 0u);
    EXPECT_EQ(d.there(d.a), Vec3f(5, 0, 0));
    EXPECT_EQ(d.mine->scene().hash(), d.replica.hash());
    EXPECT_EQ(d.client->statistics().divergences, 0u) << "the replica was never touched";
    EXPECT_EQ(d.mine->takeVerdicts().size(), 5u);
}

TEST(OptimisticScene, NeverJumpsBackWhileItsOwnEditsTravel) {
    Draggable d;
    std::vector<float> seen;
    struct Watch : Subscriber {
        NodeId node;
        std::vector<float>* seen = nullptr;
        Result<> apply(const Scene&, const ChangeSet& set) override {
            for (const Change& c : set.changes)
                if (c.kind == ChangeKind::setField && c.node == node && c.field == Tr::translation.index)
                    seen->push_back(c.value.as<Vec3f>().x);
            return {};
        }
    } watch;
    watch.node = d.a;
    watch.seen = &seen;
    const Attachment attached = d.mine->scene().bus().attach(watch, Delivery::immediate);
    for (int i = 1; i <= 30; ++i) {
        ASSERT_TRUE(d.mine->edit(d.a, Tr::translation.index, Vec3f(static_cast<float>(i), 0, 0)));
        if (i % 3 == 0) d.server->service();
        d.origin.newFrame(d.time += .1);
        d.mine->poll(1ms);
    }
    ASSERT_TRUE(d.settled());
    EXPECT_TRUE(std::ranges::is_sorted(seen)) << "each edit once, in order, none of an older state after it";
    EXPECT_EQ(seen.back(), 30);
}

TEST(OptimisticScene, TakesBackWhatWasRefused) {
    Draggable d;
    Scene other;
    MirrorClientOptions options;
    options.name = "ann";
    const auto ann = *MirrorClient::connect(other, d.server->endpoint(), options);
    ASSERT_TRUE(test::pollUntil(*ann, [&] { return ann->inStep(); }));
    ASSERT_TRUE(ann->lock({d.a}, 60s));
    ASSERT_TRUE(test::pollUntil(*ann, [&] {
        d.server->service();
        return ann->unanswered() == 0;
    }));
    ASSERT_TRUE(d.mine->edit(d.a, Tr::translation.index, Vec3f(1)));
    EXPECT_EQ(d.shown(d.a), Vec3f(1));
    ASSERT_TRUE(d.settled());
    EXPECT_EQ(d.shown(d.a), Vec3f(0));
    const auto verdicts = d.mine->takeVerdicts();
    ASSERT_EQ(verdicts.size(), 1u);
    EXPECT_NE(verdicts[0].refusal.find("locked by ann"), std::string::npos) << verdicts[0].refusal;
    EXPECT_EQ(d.mine->scene().hash(), d.replica.hash());
}

TEST(OptimisticScene, TheOriginsOrderDecidesBetweenTwoWriters) {
    Draggable d;
    ASSERT_TRUE(d.mine->edit(d.a, Tr::translation.index, Vec3f(1)));
    // Theirs is carried out first, and is not shown: ours is on its way.
    ASSERT_TRUE(d.origin.setField(d.a, Tr::translation.index, Vec3f(2)));
    d.origin.newFrame(d.time += .1);
    ASSERT_TRUE(d.reach([&] { return d.there(d.a) == Vec3f(2); }));
    EXPECT_EQ(d.shown(d.a), Vec3f(1));
    ASSERT_TRUE(d.settled());
    EXPECT_EQ(d.shown(d.a), Vec3f(1)) << "the later one won";
    ASSERT_TRUE(d.origin.setField(d.a, Tr::translation.index, Vec3f(3)));
    d.origin.newFrame(d.time += .1);
    ASSERT_TRUE(d.settled());
    EXPECT_EQ(d.shown(d.a), Vec3f(3));
}

TEST(OptimisticScene, OutlivesNodesAndOrigins) {
    Draggable d;
    ASSERT_TRUE(d.mine->edit(d.a, Tr::translation.index, Vec3f(1)));
    ASSERT_TRUE(d.mine->edit(d.b, Tr::translation.index, Vec3f(2)));
    ASSERT_TRUE(d.origin.destroyNode(d.a));
    d.origin.newFrame(d.time += .1);
    ASSERT_TRUE(d.reach([&] { return d.mine->scene().find(d.a) == nullptr; }));
    EXPECT_EQ(d.mine->waiting(), 1u) << "nobody waits for what is gone, or forgets the other";
    EXPECT_EQ(d.shown(d.b), Vec3f(2));
    ASSERT_TRUE(d.settled());
    EXPECT_EQ(d.mine->waiting(), 0u);
    EXPECT_EQ(d.mine->scene().find(d.a), nullptr);
    EXPECT_EQ(d.mine->scene().hash(), d.replica.hash());
    EXPECT_FALSE(d.mine->edit(d.a, Tr::translation.index, Vec3f(1)));
    EXPECT_FALSE(d.mine->edit(d.b, Tr::translation.index, Value(true)));
    EXPECT_FALSE(d.mine->edit(d.b, Tr::children.index, Array<NodeId>{}));
    EXPECT_FALSE(d.mine->edit(d.b, kNoField, Value(true)));
    EXPECT_EQ(d.mine->scene().hash(), d.replica.hash()) << "what was refused at once was not shown";

    // Another run of the origin knows nothing of what was asked.
    ASSERT_TRUE(d.mine->edit(d.b, Tr::translation.index, Vec3f(5)));
    const std::string endpoint = d.server->endpoint();
    d.server.reset();
    Scene next;
    const NodeId b = next.createNode(Tr::type);
    ASSERT_TRUE(next.setField(next.root(), x3d::RtsgScene::children.index, Array<NodeId>{b}));
    next.newFrame(0);
    const auto again = *MirrorServer::start(next, endpoint);
    ASSERT_TRUE(d.reach([&] { return d.client->inStep() && d.replica.hash() == next.hash() && !d.mine->waiting(); }));
    EXPECT_EQ(d.mine->scene().hash(), next.hash());
}

}  // namespace
}  // namespace rtsg
