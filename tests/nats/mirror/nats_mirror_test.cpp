// Mirrors over NATS: the same records, hashes, repairs and permissions as over ZeroMQ.
#include <algorithm>
#include <cstring>

#include "link/open_nats.h"
#include "mirror/packet.h"
#include "nats/nats_support.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::NatsFollower;
using test::NatsServer;
using test::PublishedScene;

class NatsMirror : public test::WithNats {};

TEST_F(NatsMirror, BringsTheBytesThatZeroMqBrings) {
    NatsServer nats;
    PublishedScene from(nats.address());
    test::RandomEdits edits(from.scene, 7);
    NatsFollower follower(nats.address());
    Scene scene;
    const auto direct = MirrorClient::connect(scene, from.server->endpoint());
    std::vector<std::uint64_t> records;
    (*direct)->onStep(
        [&](const RecordStep& step) { records.push_back(step.record ? step.record->header.checksum : 0); });
    ASSERT_TRUE(follower.settle(from));
    ASSERT_TRUE(test::pollUntilAt(**direct, from.scene));
    for (int i = 0; i < 60; ++i) {
        for (int k = 0; k < 5; ++k) edits.step();
        from.poll();
        ASSERT_TRUE(follower.settle(from));
        ASSERT_TRUE(test::pollUntilAt(**direct, from.scene));
    }
    EXPECT_EQ(follower.records, records);
    EXPECT_GE(records.size(), 61u);
    EXPECT_EQ(follower.scene.dump(), from.scene.dump());
    EXPECT_EQ(follower.client->statistics().snapshots, 1u);
    EXPECT_EQ(follower.client->statistics().garbage, 0u);
}

/// The server waits for the publisher's answer to its goodbye, so nothing is on its way when the publisher ends.
TEST_F(NatsMirror, WhatTheServerSaysLastIsPublished) {
    NatsServer nats;
    for (int round = 0; round < 8; ++round) {
        PublishedScene from(nats.address());
        NatsFollower follower(nats.address());
        ASSERT_TRUE(follower.settle(from));
        for (int i = 0; i < 20; ++i) from.poll();
        const std::uint64_t last = from.scene.sequence();
        // The publisher is busy with much when it is to end.
        EXPECT_TRUE(from.server->drain(10s));
        from.fill(100'000);
        from.poll();
        from.server.reset();
        from.publisher.reset();
        EXPECT_TRUE(test::pollUntil(*follower.client, [&] { return follower.client->serverLeft(); }))
            << "round " << round;
        EXPECT_GE(follower.client->statistics().sequence, last) << "round " << round;
    }
}

TEST_F(NatsMirror, RecordsLongerThanAMessageComeInPieces) {
    NatsServer nats("max_payload: 65536");
    PublishedScene from(nats.address(), MirrorUpstream::none, 100'000);
    NatsFollower early(nats.address());
    ASSERT_TRUE(early.settle(from));
    for (int i = 0; i < 3; ++i) {
        from.fill(50'000);
        from.poll();
    }
    ASSERT_TRUE(early.settle(from));
    NatsFollower late(nats.address());
    ASSERT_TRUE(late.settle(from));
    EXPECT_EQ(early.client->statistics().snapshots, 1u);
    EXPECT_GE(from.publisher->statistics().messages, 1'200'000u / 65536 + 3 * 600'000u / 65536);
}

TEST_F(NatsMirror, WhoeverJoinsWithinAMomentCostsOnePublication) {
    NatsServer nats;
    PublishedScene from(nats.address(), MirrorUpstream::none, 20'000);
    NatsFollower first(nats.address());
    ASSERT_TRUE(first.settle(from));
    const std::uint64_t before = from.publisher->statistics().states;
    std::vector<std::unique_ptr<NatsFollower>> crowd;
    for (int i = 0; i < 16; ++i) crowd.push_back(std::make_unique<NatsFollower>(nats.address()));
    for (const auto& follower : crowd) (void)follower->client->poll(0ms);
    for (int i = 0; i < 20; ++i) {
        from.poll();
        for (const auto& follower : crowd) (void)follower->client->poll(1ms);
    }
    for (const auto& follower : crowd) ASSERT_TRUE(follower->settle(from));
    EXPECT_LT(from.publisher->statistics().states - before, 16u);
    EXPECT_EQ(from.server->statistics().maxPeers, 1u) << "a keyframe of the server's own was near enough";
}

TEST_F(NatsMirror, WhatDiffersIsFoundAndRepaired) {
    NatsServer nats;
    PublishedScene from(nats.address());
    std::vector<Divergence> found;
    MirrorClientOptions options;
    options.onDivergence = [&](const Divergence& d) { found.push_back(d); };
    NatsFollower follower(nats.address(), options), other(nats.address());
    ASSERT_TRUE(follower.settle(from));
    ASSERT_TRUE(other.settle(from));
    const Vec3f wrong(9, 9, 9);
    std::memcpy(const_cast<void*>(follower.scene.node(from.box).storage(x3d::Transform::center.index)), &wrong,
                sizeof(wrong));
    // The frame that writes a damaged field shows the damage.
    const Vec3f moved(8, 0, 0);
    std::memcpy(const_cast<void*>(follower.scene.node(from.box).storage(x3d::Transform::translation.index)), &moved,
                sizeof(moved));
    from.poll();
    ASSERT_TRUE(follower.settle(from));
    ASSERT_TRUE(other.settle(from));
    EXPECT_EQ(follower.client->statistics().divergences, 1u);
    EXPECT_EQ(follower.client->statistics().repairs, 1u);
    EXPECT_EQ(follower.client->statistics().snapshots, 1u) << "only what differs is sent again";
    EXPECT_EQ(follower.scene.dump(), from.scene.dump());
    EXPECT_EQ(other.client->statistics().repairs, 0u);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].node, "BOX");
    from.poll();
    EXPECT_TRUE(follower.settle(from)) << "it goes on with the next frame";
}

/// The verdict on an edit, and on an event, sent by way of NATS.
std::pair<std::string, std::string> verdictsWith(MirrorUpstream upstream) {
    NatsServer nats;
    PublishedScene from(nats.address(), upstream);
    NatsFollower follower(nats.address());
    EXPECT_TRUE(follower.settle(from));
    std::map<std::uint64_t, MirrorVerdict> verdicts;
    const auto edit = follower.client->submitEdit(from.box, x3d::Transform::scale.index, Vec3f(1, 2, 3));
    const auto sent = follower.client->submitEvent(from.box, x3d::Transform::rotation.index, Rotation(0, 1, 0, 1));
    EXPECT_TRUE(test::pollUntil(*follower.client, [&] {
        from.poll();
        for (MirrorVerdict& v : follower.client->takeVerdicts()) {
            EXPECT_TRUE(!v.refusal.empty() || follower.client->statistics().sequence >= v.state)
                << "the effect is there when the verdict is";
            verdicts[v.request] = std::move(v);
        }
        return verdicts.size() == 2;
    }));
    EXPECT_EQ(from.scene.node(from.box).get(x3d::Transform::scale) == Vec3f(1, 2, 3), verdicts[*edit].refusal.empty());
    EXPECT_TRUE(follower.settle(from));
    return {verdicts[*edit].refusal, verdicts[*sent].refusal};
}

TEST_F(NatsMirror, RequestsAreJudgedByTheServersPermission) {
    const auto none = verdictsWith(MirrorUpstream::none);
    EXPECT_FALSE(none.first.empty());
    EXPECT_FALSE(none.second.empty());
    const auto events = verdictsWith(MirrorUpstream::events);
    EXPECT_FALSE(events.first.empty());
    EXPECT_EQ(events.second, "");
    const auto edits = verdictsWith(MirrorUpstream::edits);
    EXPECT_EQ(edits.first, "");
    EXPECT_EQ(edits.second, "");
}

TEST_F(NatsMirror, ALongRequestGoesThroughAndNodesGetNumbers) {
    NatsServer nats;
    PublishedScene from(nats.address(), MirrorUpstream::edits);
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(from));
    Change change;
    change.node = from.cloud;
    change.field = x3d::Coordinate::point.index;
    change.value = Array<Vec3f>(std::vector<Vec3f>(60'000, Vec3f(1, 2, 3)));  // 720 kB, in parts of 8 KiB
    Change created;
    created.kind = ChangeKind::createNode;
    created.node = follower.client->newNode();
    created.index = x3d::Group::type.value;
    ASSERT_TRUE(follower.client->submit({created, change}));
    std::vector<MirrorVerdict> verdicts;
    ASSERT_TRUE(test::pollUntil(*follower.client, [&] {
        from.poll();
        verdicts = follower.client->takeVerdicts();
        return !verdicts.empty();
    }));
    EXPECT_EQ(verdicts[0].refusal, "");
    EXPECT_EQ(verdicts[0].created.size(), 1u);
    ASSERT_TRUE(follower.settle(from));
    EXPECT_EQ(from.scene.node(from.cloud).get(x3d::Coordinate::point).size(), 60'000u);
}

TEST_F(NatsMirror, WhatIsNotPublishedIsRefused) {
    NatsServer nats;
    PublishedScene from(nats.address());
    MirrorClientOptions part, rate, inputs, blocking;
    blocking.whenSlow = MirrorWhenSlow::block;
    part.parts = {"BOX"};
    rate.maxBytesPerSecond = 1000;
    inputs.inputs = true;
    for (const MirrorClientOptions& options : {part, rate, inputs, blocking}) {
        NatsFollower follower(nats.address(), options);
        EXPECT_TRUE(test::pollUntil(*follower.client, [&] { return !follower.client->refusal().empty(); }));
        EXPECT_NE(follower.client->refusal().find("need ZeroMQ"), std::string::npos);
        EXPECT_FALSE(follower.client->turnedAway()) << "asking again is of no use";
    }
}

TEST_F(NatsMirror, AServerWithKeysIsPublishedAsItsFirstClient) {
    NatsServer nats;
    test::TempFolder folder;
    ASSERT_TRUE(MirrorKeys::generate(folder / "hall.key"));
    const MirrorKeys keys = *MirrorKeys::load(folder / "hall.key");
    Scene scene;
    scene.newFrame(0);
    MirrorServerOptions options;
    options.keys = keys;
    const auto server = MirrorServer::start(scene, test::kAnyPort, options);
    ASSERT_TRUE(server);
    NatsPublisherOptions to;
    to.address = nats.address();
    MirrorKeys none;
    to.keys = none;
    EXPECT_FALSE(NatsPublisher::start(**server, to));
    to.keys = keys;
    const auto publisher = NatsPublisher::start(**server, to);
    ASSERT_TRUE(publisher);
    NatsFollower follower(nats.address());
    EXPECT_TRUE(test::pollUntilAt(*follower.client, scene));
    EXPECT_EQ(follower.scene.hash(), scene.hash());
}

TEST_F(NatsMirror, AnAskerCannotMakeItSendWithoutEnd) {
    NatsServer nats;
    PublishedScene from(nats.address(), MirrorUpstream::none, 1'000'000);  // a keyframe of 12 MB
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(from));
    const auto link = openNatsLink(*NatsAddress::parse(nats.address()), "stranger");
    ASSERT_TRUE(link);
    mirror::Hello hello;
    ByteBuffer message, packet;
    hello.write(message);
    nats::pack(packet, message.bytes());
    const std::uint64_t before = from.publisher->statistics().bytes;
    for (int i = 0; i < 100; ++i) {
        EXPECT_EQ((*link)->publish(NatsSubjects("hall").ask, "_INBOX.nobody", packet.bytes()), "");
        (void)follower.client->poll(20ms);
    }
    EXPECT_LT(from.publisher->statistics().bytes - before, 400'000'000u);
    from.poll();
    EXPECT_TRUE(follower.settle(from));
}

/// The server has no new frame to send, and knows all the same that all have its state.
TEST_F(NatsMirror, ASceneThatStartsOverIsFollowedAndDrained) {
    NatsServer nats;
    PublishedScene from(nats.address());
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(from));
    for (int i = 0; i < 20; ++i) from.poll();
    ASSERT_TRUE(follower.settle(from));
    EXPECT_TRUE(from.server->drain(10s));
    Scene other;
    for (int i = 0; i < 5; ++i) other.createNode(x3d::Group::type);
    other.newFrame(9);
    ASSERT_TRUE(from.scene.reset());
    ASSERT_TRUE(from.scene.apply(std::make_shared<const ChangeSet>(other.snapshot())));
    EXPECT_TRUE(follower.settle(from));
    EXPECT_EQ(follower.scene.dump(), other.dump());
    EXPECT_TRUE(from.server->drain(10s));
    NatsFollower late(nats.address());
    EXPECT_TRUE(late.settle(from));
    EXPECT_TRUE(from.server->drain(10s)) << "what it joined with is older than what the others have";
    EXPECT_EQ(from.server->statistics().peers, 1u);
    EXPECT_EQ(from.server->statistics().garbage, 0u);
}

TEST_F(NatsMirror, WithoutAPublisherTheServerGoesOn) {
    NatsServer nats;
    PublishedScene from(nats.address());
    Scene scene;
    const auto direct = MirrorClient::connect(scene, from.server->endpoint());
    {
        NatsFollower follower(nats.address());
        ASSERT_TRUE(follower.settle(from));
    }
    from.publisher.reset();
    for (int i = 0; i < 5; ++i) from.poll();
    EXPECT_TRUE(test::pollUntilAt(**direct, from.scene));
    EXPECT_TRUE(test::eventually([&] { return from.server->statistics().peers == 1; })) << "the one by ZeroMQ";
    NatsPublisherOptions to;
    to.address = nats.address();
    auto again = NatsPublisher::start(*from.server, to);
    ASSERT_TRUE(again);
    NatsFollower late(nats.address());
    EXPECT_TRUE(late.settle(from));
}

TEST_F(NatsMirror, TheServersGoodbyeArrives) {
    NatsServer nats;
    PublishedScene from(nats.address());
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(from));
    from.poll();
    from.server.reset();
    EXPECT_TRUE(test::pollUntil(*follower.client, [&] { return follower.client->serverLeft(); }));
    EXPECT_EQ(follower.client->statistics().sequence, from.scene.sequence());
    EXPECT_EQ(follower.scene.hash(), from.scene.hash());
}

}  // namespace
}  // namespace rtsg
