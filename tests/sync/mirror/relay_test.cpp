// Relays: a session passed on, requests and verdicts too, and the loss of the origin told to whoever follows.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/mirror_relay.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntil;

/// An origin, a relay that follows it, and a leaf that follows the relay.
struct Chain {
    Scene origin, middle, end;
    NodeId box, toggle;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorRelay> relay;
    std::unique_ptr<MirrorClient> leaf;
    std::vector<MirrorVerdict> verdicts;
    double time = 0;

    explicit Chain(MirrorUpstream atOrigin = MirrorUpstream::edits, MirrorUpstream atRelay = MirrorUpstream::edits) {
        box = origin.createNode(x3d::Transform::type);
        toggle = origin.createNode(x3d::BooleanToggle::type);
        EXPECT_TRUE(origin.setField(origin.root(), x3d::RtsgScene::children.index, Array<NodeId>{box, toggle}));
        origin.newFrame(time);
        MirrorServerOptions options, relayed;
        options.upstream = atOrigin;
        relayed.upstream = atRelay;
        server = *MirrorServer::start(origin, test::kAnyPort, options);
        relay = *MirrorRelay::connect(middle, server->endpoint(), test::kAnyPort, {}, relayed);
        EXPECT_TRUE(test::eventually([&] {
            EXPECT_TRUE(relay->poll());
            return relay->server() != nullptr;
        }));
        leaf = *MirrorClient::connect(end, relay->server()->endpoint());
        EXPECT_TRUE(settle());
    }
    /// Until all three are in one state.
    bool settle() {
        return pollUntil(*leaf, [&] {
            poll();
            return leaf->inStep() && end.hash() == origin.hash() && middle.hash() == origin.hash();
        });
    }
    void poll() {
        if (server) server->service();
        EXPECT_TRUE(relay->poll());
        for (MirrorVerdict& v : leaf->takeVerdicts()) verdicts.push_back(std::move(v));
    }
    bool answered(std::size_t count) {
        return pollUntil(*leaf, [&] {
            origin.newFrame(time += .1);
            poll();
            return verdicts.size() >= count;
        });
    }
};

TEST(MirrorRelay, EditsOfALeafAreTheOriginsAndItsVerdictComesBack) {
    Chain chain;
    ASSERT_TRUE(chain.leaf->submitEdit(chain.box, x3d::Transform::translation.index, Vec3f(1, 2, 3)));
    ASSERT_TRUE(chain.leaf->submitEvent(chain.toggle, x3d::BooleanToggle::set_boolean.index, true));
    ASSERT_TRUE(chain.answered(2));
    for (const MirrorVerdict& verdict : chain.verdicts) {
        EXPECT_EQ(verdict.refusal, "");
        EXPECT_GE(chain.leaf->statistics().sequence, verdict.state) << "the effect is there when the verdict is";
    }
    ASSERT_TRUE(chain.settle());
    for (const Scene* scene : {&chain.origin, &chain.middle, &chain.end})
        EXPECT_EQ(scene->node(chain.box).get(x3d::Transform::translation), Vec3f(1, 2, 3));
    EXPECT_TRUE(chain.origin.node(chain.toggle).get(x3d::BooleanToggle::toggle));
    // Nothing was done to the relay's replica and undone again.
    EXPECT_EQ(chain.relay->client().statistics().divergences, 0u);
    EXPECT_EQ(chain.relay->client().statistics().snapshots, 1u);
}

TEST(MirrorRelay, NodesOfALeafGetTheOriginsNumbers) {
    Chain chain;
    const NodeId own = chain.leaf->newNode();
    Change create, name, insert;
    create.kind = ChangeKind::createNode;
    create.node = own;
    create.index = x3d::Group::type.value;
    name.kind = ChangeKind::setName;
    name.node = own;
    name.value = String("LEAFS");
    insert.kind = ChangeKind::insertChild;
    insert.node = chain.box;
    insert.field = x3d::Transform::children.index;
    insert.other = own;
    ASSERT_TRUE(chain.leaf->submit({create, name, insert}));
    ASSERT_TRUE(chain.answered(1));
    ASSERT_EQ(chain.verdicts[0].refusal, "");
    ASSERT_EQ(chain.verdicts[0].created.size(), 1u);
    ASSERT_TRUE(chain.settle());
    EXPECT_EQ(chain.verdicts[0].created[0], std::pair(own, chain.origin.findName("LEAFS")));
    EXPECT_EQ(chain.end.findName("LEAFS"), chain.origin.findName("LEAFS"));
}

TEST(MirrorRelay, WhatALeafMayIsJudgedHereAndThere) {
    for (const bool there : {false, true}) {
        SCOPED_TRACE(there ? "refused by the origin" : "refused by the relay");
        Chain chain(there ? MirrorUpstream::events : MirrorUpstream::edits,
                    there ? MirrorUpstream::edits : MirrorUpstream::events);
        ASSERT_TRUE(chain.leaf->submitEdit(chain.box, x3d::Transform::translation.index, Vec3f(1, 2, 3)));
        ASSERT_TRUE(chain.answered(1));
        EXPECT_NE(chain.verdicts[0].refusal.find("may send events, not edit"), std::string::npos)
            << chain.verdicts[0].refusal;
        EXPECT_EQ(chain.server->statistics().requests, there ? 1u : 0u);
        EXPECT_EQ(chain.origin.node(chain.box).get(x3d::Transform::translation), Vec3f(0, 0, 0));
    }
}

TEST(MirrorRelay, LeavesAreToldThatTheOriginIsLostAndThatItIsBack) {
    Chain chain;
    EXPECT_FALSE(chain.leaf->originLost());
    const std::string endpoint = chain.server->endpoint();
    chain.server.reset();
    ASSERT_TRUE(pollUntil(*chain.leaf, [&] {
        chain.poll();
        return chain.leaf->originLost();
    }));
    EXPECT_FALSE(chain.leaf->inStep()) << "it cannot know";
    EXPECT_EQ(chain.end.hash(), chain.origin.hash());
    chain.server = *MirrorServer::start(chain.origin, endpoint);
    ASSERT_TRUE(pollUntil(*chain.leaf, [&] {
        chain.poll();
        return !chain.leaf->originLost();
    }));
    chain.origin.newFrame(chain.time += 1);
    EXPECT_TRUE(chain.settle());
    EXPECT_EQ(chain.relay->client().statistics().holes, 1u);
    EXPECT_EQ(chain.leaf->statistics().holes, 1u);
    EXPECT_GT(chain.leaf->statistics().missed, 0);
}

TEST(MirrorRelay, AnOriginThatStartsOverWithinReachLeavesNoHole) {
    Chain chain;
    ASSERT_TRUE(chain.origin.reset());
    chain.origin.newFrame(chain.time += 1);
    ASSERT_TRUE(pollUntil(*chain.leaf, [&] {
        chain.poll();
        return chain.leaf->statistics().restarts == 1 && chain.leaf->inStep();
    }));
    EXPECT_EQ(chain.end.hash(), chain.origin.hash());
    EXPECT_EQ(chain.leaf->statistics().holes, 0u);
}

}  // namespace
}  // namespace rtsg
