// Upstream: what replicas send is ordered at the origin, judged, carried out once, and comes back.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::Middleman;
using test::pollUntil;

struct EditedOrigin {
    Scene scene;
    std::unique_ptr<MirrorServer> server;
    NodeId box, toggle, group;
    int frame = 0;

    explicit EditedOrigin(MirrorUpstream upstream, const std::string& endpoint = test::kAnyPort) {
        box = scene.createNode(x3d::Transform::type);
        toggle = scene.createNode(x3d::BooleanToggle::type);
        group = scene.createNode(x3d::Group::type);
        EXPECT_TRUE(scene.setName(box, "BOX"));
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{box, toggle, group}));
        scene.newFrame(0);
        MirrorServerOptions options;
        options.upstream = upstream;
        server = *MirrorServer::start(scene, endpoint, options);
    }
    /// Like an application: takes the requests that have arrived, then runs a frame.
    void poll() {
        server->service();
        scene.newFrame(++frame * .1);
    }
};

struct EditingReplica {
    Scene scene;
    std::unique_ptr<MirrorClient> client;
    std::vector<MirrorVerdict> verdicts;

    explicit EditingReplica(const std::string& endpoint) { client = *MirrorClient::connect(scene, endpoint); }
    bool settle(EditedOrigin& origin, std::size_t answers) {
        return pollUntil(*client, [&] {
            origin.poll();
            client->poll(2ms);
            for (MirrorVerdict& v : client->takeVerdicts()) {
                // The effect is there when the verdict is.
                if (v.refusal.empty()) {
                    EXPECT_GE(client->statistics().sequence, v.state);
                }
                verdicts.push_back(std::move(v));
            }
            return verdicts.size() >= answers;
        });
    }
};

Change change(ChangeKind kind, NodeId node, FieldIndex field = kNoField, Value value = {}) {
    Change c;
    c.kind = kind;
    c.node = node;
    c.field = field;
    c.value = std::move(value);
    return c;
}

TEST(MirrorUpstream, AnEditComesBackToEveryReplica) {
    EditedOrigin origin(MirrorUpstream::edits);
    EditingReplica first(origin.server->endpoint()), second(origin.server->endpoint());
    const auto request = first.client->submitEdit(origin.box, x3d::Transform::translation.index, Vec3f(1, 2, 3));
    ASSERT_TRUE(request);
    EXPECT_EQ(first.client->unanswered(), 1u);
    ASSERT_TRUE(first.settle(origin, 1));
    EXPECT_EQ(first.verdicts[0].request, *request);
    EXPECT_EQ(first.verdicts[0].refusal, "");
    EXPECT_EQ(first.client->unanswered(), 0u);
    EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::translation), Vec3f(1, 2, 3));
    EXPECT_EQ(first.scene.node(origin.box).get(x3d::Transform::translation), Vec3f(1, 2, 3));
    ASSERT_TRUE(test::pollUntilAt(*second.client, origin.scene));
    EXPECT_EQ(second.scene.dump(), origin.scene.dump());
    EXPECT_EQ(first.client->statistics().divergences, 0u);
}

TEST(MirrorUpstream, WhatIsAskedAfterAnEventTakesEffectAfterIt) {
    EditedOrigin origin(MirrorUpstream::edits);
    EditingReplica replica(origin.server->endpoint());
    ASSERT_TRUE(test::pollUntilAt(*replica.client, origin.scene));
    const auto settleTwo = [&](bool first, bool second) {
        EXPECT_TRUE(first && second);
        const auto until = std::chrono::steady_clock::now() + 30ms;  // both are there when the server looks
        while (std::chrono::steady_clock::now() < until) replica.client->poll(2ms);
        replica.verdicts.clear();
        EXPECT_TRUE(replica.settle(origin, 2));
        for (const MirrorVerdict& verdict : replica.verdicts) EXPECT_EQ(verdict.refusal, "");
    };
    const FieldIndex translation = x3d::Transform::translation.index;
    for (int i = 0; i < 5; ++i) {
        const float x = static_cast<float>(i);
        const auto event = replica.client->submitEvent(origin.box, translation, Vec3f(x, 4, 0));
        const auto edit = replica.client->submitEdit(origin.box, translation, Vec3f(x, 5, 0));
        settleTwo(event.has_value(), edit.has_value());
        EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::translation), Vec3f(x, 5, 0)) << "the later one";
        ASSERT_EQ(replica.verdicts.size(), 2u);
        EXPECT_LT(replica.verdicts[0].state, replica.verdicts[1].state);
    }
    // An event is heard by a node that is destroyed right after it.
    ASSERT_TRUE(origin.scene.addRoute(origin.toggle, x3d::BooleanToggle::toggle.index, origin.group,
                                      x3d::Group::visible.index));
    ASSERT_TRUE(origin.scene.setField(origin.group, x3d::Group::visible.index, false));
    origin.scene.newFrame(++origin.frame * .1);
    const auto event = replica.client->submitEvent(origin.toggle, x3d::BooleanToggle::set_boolean.index, true);
    const auto end = replica.client->submit({change(ChangeKind::destroyNode, origin.toggle)});
    settleTwo(event.has_value(), end.has_value());
    EXPECT_FALSE(origin.scene.find(origin.toggle));
    EXPECT_TRUE(origin.scene.node(origin.group).get(x3d::Group::visible));
}

TEST(MirrorUpstream, AnEventsVerdictNamesTheStateThatItLedTo) {
    EditedOrigin origin(MirrorUpstream::edits);
    EditingReplica replica(origin.server->endpoint());
    ASSERT_TRUE(test::pollUntilAt(*replica.client, origin.scene));
    ASSERT_TRUE(replica.client->submitEvent(origin.toggle, x3d::BooleanToggle::set_boolean.index, true));
    const auto until = std::chrono::steady_clock::now() + 30ms;
    while (std::chrono::steady_clock::now() < until) replica.client->poll(2ms);
    origin.server->service();
    // The application's edits before the frame are published first, as a state of their own.
    ASSERT_TRUE(origin.scene.setField(origin.box, x3d::Transform::scale.index, Vec3f(2, 2, 2)));
    origin.scene.seal();
    const std::uint64_t before = origin.scene.sequence();
    ASSERT_TRUE(replica.settle(origin, 1));
    EXPECT_TRUE(replica.scene.node(origin.toggle).get(x3d::BooleanToggle::toggle));
    ASSERT_EQ(replica.verdicts.size(), 1u);
    EXPECT_EQ(replica.verdicts[0].refusal, "");
    EXPECT_EQ(replica.verdicts[0].state, before + 1);
}

TEST(MirrorUpstream, TextsThatAreNotUtf8AreRefused) {
    EditedOrigin origin(MirrorUpstream::edits);
    EditingReplica replica(origin.server->endpoint());
    ASSERT_TRUE(test::pollUntilAt(*replica.client, origin.scene));
    const NodeId info = origin.scene.createNode(x3d::WorldInfo::type);
    ASSERT_TRUE(origin.scene.insertChild(origin.scene.root(), x3d::RtsgScene::children.index, info));
    origin.scene.newFrame(++origin.frame);
    ASSERT_TRUE(test::pollUntilAt(*replica.client, origin.scene));
    const String cut = "K\xC3", whole = "K\xC3\xB6ln";
    std::size_t answers = 0;
    const auto refusal = [&](ChangeKind kind, FieldIndex field, Value value) {
        EXPECT_TRUE(replica.client->submit({change(kind, info, field, std::move(value))}));
        EXPECT_TRUE(replica.settle(origin, ++answers));
        return replica.verdicts.back().refusal;
    };
    for (const auto& [text, expected] : {std::pair(cut, "a text that is not UTF-8"), std::pair(whole, "")}) {
        EXPECT_EQ(refusal(ChangeKind::setName, kNoField, text), expected);
        EXPECT_EQ(refusal(ChangeKind::setField, x3d::WorldInfo::title.index, text), expected);
        EXPECT_EQ(refusal(ChangeKind::setField, x3d::WorldInfo::info.index, Array<String>{String("ok"), text}),
                  expected);
    }
}

/// Commands to a player of a log: passed on if there is one and the peer has permission, and answered in any case.
TEST(MirrorControl, IsAnsweredOnceInOrderAndNeverCut) {
    {
        Scene scene;
        auto alone = *MirrorClient::connect(scene, "tcp://127.0.0.1:9");
        EXPECT_FALSE(alone->control("pause")) << "there is no connection";
    }
    for (const MirrorUpstream upstream : {MirrorUpstream::none, MirrorUpstream::events}) {
        EditedOrigin origin(upstream);
        EditingReplica replica(origin.server->endpoint());
        ASSERT_TRUE(test::pollUntilAt(*replica.client, origin.scene));
        std::vector<std::string> asked, replies;
        const auto answered = [&](std::size_t count) {
            return pollUntil(*replica.client, [&] {
                origin.poll();
                for (std::string& reply : replica.client->takeReplies()) replies.push_back(std::move(reply));
                return replies.size() >= count;
            });
        };
        ASSERT_TRUE(replica.client->control("pause"));
        ASSERT_TRUE(answered(1));
        EXPECT_EQ(replies[0], upstream == MirrorUpstream::none ? "refused: this server takes no requests"
                                                               : "refused: no log is played here");
        origin.server->onControl([&](std::string_view text) {
            asked.emplace_back(text);
            return "done: " + asked.back();
        });
        ASSERT_TRUE(replica.client->control(std::string(201, '1')));
        ASSERT_TRUE(answered(2));
        EXPECT_EQ(replies[1], "refused: a command has at most 200 bytes");
        if (upstream == MirrorUpstream::none) continue;
        const std::string longest = "seek " + std::string(195, '1');
        ASSERT_TRUE(replica.client->control(longest));
        ASSERT_TRUE(replica.client->control("play"));
        ASSERT_TRUE(answered(4));
        EXPECT_EQ(asked, (std::vector<std::string>{longest, "play"}));
        EXPECT_EQ(replies[3], "done: play");
        EXPECT_EQ(replies.size(), 4U);
        // The events in the log stay as they were, and the answer says so.
        ASSERT_TRUE(replica.client->submitEvent(origin.toggle, x3d::BooleanToggle::set_boolean.index, true));
        ASSERT_TRUE(replica.settle(origin, 1));
        EXPECT_TRUE(replica.verdicts[0].refusal.contains("a log is played")) << replica.verdicts[0].refusal;
        EXPECT_FALSE(origin.scene.node(origin.toggle).get(x3d::BooleanToggle::toggle));
    }
}

TEST(MirrorUpstream, EventsRunTheOriginsCascadeAndMayBeAllThatIsAllowed) {
    EditedOrigin origin(MirrorUpstream::events);
    EditingReplica replica(origin.server->endpoint());
    ASSERT_TRUE(replica.client->submitEvent(origin.toggle, x3d::BooleanToggle::set_boolean.index, true));
    ASSERT_TRUE(replica.client->submitEdit(origin.box, x3d::Transform::scale.index, Vec3f(2, 2, 2)));
    ASSERT_TRUE(replica.settle(origin, 2));
    EXPECT_EQ(replica.verdicts[0].refusal, "");
    EXPECT_TRUE(replica.scene.node(origin.toggle).get(x3d::BooleanToggle::toggle));
    EXPECT_NE(replica.verdicts[1].refusal.find("BOX.scale"), std::string::npos) << replica.verdicts[1].refusal;
    EXPECT_NE(replica.verdicts[1].refusal.find("may send events, not edit"), std::string::npos);
    EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::scale), Vec3f(1, 1, 1));
}

TEST(MirrorUpstream, WithoutPermissionNothingIsCarriedOutAndTheReasonNamed) {
    EditedOrigin origin(MirrorUpstream::none);
    EditingReplica replica(origin.server->endpoint());
    ASSERT_TRUE(replica.client->submitEvent(origin.toggle, x3d::BooleanToggle::set_boolean.index, true));
    ASSERT_TRUE(replica.settle(origin, 1));
    EXPECT_NE(replica.verdicts[0].refusal.find("may only follow"), std::string::npos);
    EXPECT_FALSE(origin.scene.node(origin.toggle).get(x3d::BooleanToggle::toggle));
}

TEST(MirrorUpstream, NodesGetTheirNumbersFromTheOrigin) {
    EditedOrigin origin(MirrorUpstream::edits);
    EditingReplica replica(origin.server->endpoint());
    const NodeId shape = replica.client->newNode(), geometry = replica.client->newNode();
    Change createShape = change(ChangeKind::createNode, shape), createBox = change(ChangeKind::createNode, geometry);
    createShape.index = x3d::Shape::type.value;
    createBox.index = x3d::Box::type.value;
    Change insert = change(ChangeKind::insertChild, origin.group, x3d::Group::children.index);
    insert.other = shape;
    ASSERT_TRUE(replica.client->submit({createShape, createBox,
                                        change(ChangeKind::setField, shape, x3d::Shape::geometry.index, geometry),
                                        change(ChangeKind::setField, geometry, x3d::Box::size.index, Vec3f(3, 4, 5)),
                                        change(ChangeKind::setName, shape, kNoField, String("NEW")), insert}));
    ASSERT_TRUE(replica.settle(origin, 1));
    ASSERT_EQ(replica.verdicts[0].refusal, "");
    ASSERT_EQ(replica.verdicts[0].created.size(), 2u);
    EXPECT_EQ(replica.verdicts[0].created[0].first, shape);
    const NodeId created = replica.scene.findName("NEW");
    EXPECT_EQ(created, replica.verdicts[0].created[0].second);
    const NodeId box = replica.scene.node(created).get(x3d::Shape::geometry);
    EXPECT_EQ(box, replica.verdicts[0].created[1].second);
    EXPECT_EQ(replica.scene.node(box).get(x3d::Box::size), Vec3f(3, 4, 5));
    EXPECT_EQ(replica.scene.node(origin.group).get(x3d::Group::children).size(), 1u);
}

TEST(MirrorUpstream, ARequestIsCheckedWhollyBeforeAnythingIsDone) {
    EditedOrigin origin(MirrorUpstream::edits);
    EditingReplica replica(origin.server->endpoint());
    const auto good = change(ChangeKind::setField, origin.box, x3d::Transform::translation.index, Vec3f(9, 9, 9));
    const std::vector<std::pair<Change, std::string>> bad = {
        {change(ChangeKind::setField, NodeId{99999}, 0, Vec3f()), "no node 99999"},
        {change(ChangeKind::setField, origin.box, x3d::Transform::scale.index, 1.f), "is of type SFVec3f"},
        {change(ChangeKind::event, origin.toggle, 60000, true), "no field"},
        {change(ChangeKind::setField, origin.group, x3d::Group::children.index, Array<NodeId>{NodeId{88888}}),
         "no node 88888"},
        {change(ChangeKind::createNode, NodeId{500}), "gives nodes their numbers"},
    };
    for (const auto& [c, reason] : bad) {
        ASSERT_TRUE(replica.client->submit({good, c}));
        replica.verdicts.clear();
        ASSERT_TRUE(replica.settle(origin, 1));
        EXPECT_NE(replica.verdicts[0].refusal.find(reason), std::string::npos) << replica.verdicts[0].refusal;
        EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::translation), Vec3f(0, 0, 0));
    }
    // Faults that only show when it is carried out.
    ASSERT_TRUE(replica.client->submit(
        {change(ChangeKind::setField, origin.group, x3d::Group::children.index, Array<NodeId>{origin.group})}));
    replica.verdicts.clear();
    ASSERT_TRUE(replica.settle(origin, 1));
    EXPECT_NE(replica.verdicts[0].refusal.find("cannot contain itself"), std::string::npos);
}

TEST(MirrorUpstream, TooLongARequestIsRefusedHere) {
    EditedOrigin origin(MirrorUpstream::edits);
    EditingReplica replica(origin.server->endpoint());
    const auto tooLong =
        replica.client->submitEdit(origin.box, x3d::Transform::translation.index, Array<Vec3f>::ofSize(200000));
    ASSERT_FALSE(tooLong);
    EXPECT_NE(tooLong.error().text.find("the most is"), std::string::npos);
    // One in many parts is carried out.
    const NodeId points = replica.client->newNode();
    Change create = change(ChangeKind::createNode, points);
    create.index = x3d::Coordinate::type.value;
    ASSERT_TRUE(replica.client->submit(
        {create, change(ChangeKind::setField, points, x3d::Coordinate::point.index, Array<Vec3f>::ofSize(50000))}));
    ASSERT_TRUE(replica.settle(origin, 1));
    ASSERT_EQ(replica.verdicts[0].refusal, "");
    EXPECT_EQ(replica.scene.node(replica.verdicts[0].created[0].second).get(x3d::Coordinate::point).size(), 50000u);
}

/// Each request adds a child. Whatever is cut and repeated: each is there once.
TEST(MirrorUpstream, NothingIsLostOrDoubledWhenMessagesAreDropped) {
    EditedOrigin origin(MirrorUpstream::edits);
    std::atomic<int> passed{0};
    Middleman middle(origin.server->endpoint(), [&](bool toClient, Middleman::Parts& parts) {
        const int type = parts[0].size() > 5 ? parts[0][5] : 0;
        if (!toClient && type == 9) return ++passed % 3 != 0;  // submissions
        if (toClient && type == 22) return ++passed % 4 != 0;  // verdicts
        return true;
    });
    EditingReplica replica(middle.endpoint);
    constexpr int kRequests = 12;
    for (int i = 0; i < kRequests; ++i) {
        const NodeId node = replica.client->newNode();
        Change create = change(ChangeKind::createNode, node);
        create.index = x3d::Transform::type.value;
        Change insert = change(ChangeKind::insertChild, origin.group, x3d::Group::children.index);
        insert.other = node;
        ASSERT_TRUE(replica.client->submit({create, insert}));
    }
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (replica.client->unanswered() > 0 && std::chrono::steady_clock::now() < end) {
        origin.poll();
        replica.client->poll(5ms);
    }
    EXPECT_EQ(replica.client->unanswered(), 0u);
    EXPECT_EQ(origin.scene.node(origin.group).get(x3d::Group::children).size(), std::size_t{kRequests});
    ASSERT_TRUE(test::pollUntilAt(*replica.client, origin.scene));
    EXPECT_EQ(replica.scene.dump(), origin.scene.dump());
}

TEST(MirrorUpstream, AnotherRunOfTheServerSaysThatRequestsAreLost) {
    auto origin = std::make_unique<EditedOrigin>(MirrorUpstream::edits);
    const std::string endpoint = origin->server->endpoint();
    EditingReplica replica(endpoint);
    ASSERT_TRUE(test::pollUntilAt(*replica.client, origin->scene));
    origin.reset();
    pollUntil(*replica.client, [&] { return !replica.client->inStep(); });
    ASSERT_TRUE(replica.client->submitEdit(NodeId{2}, x3d::Transform::translation.index, Vec3f(1, 1, 1)));
    EditedOrigin second(MirrorUpstream::edits, endpoint);
    ASSERT_TRUE(replica.settle(second, 1));
    EXPECT_NE(replica.verdicts[0].refusal.find("started over"), std::string::npos);
    EXPECT_EQ(second.scene.node(second.box).get(x3d::Transform::translation), Vec3f(0, 0, 0));
}

}  // namespace
}  // namespace rtsg
