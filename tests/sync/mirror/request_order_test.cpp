// Which requests wait for which event: the later of two requests for one node counts, others are not held up, none
// waits long.
#include "edits/request_order.h"

#include <thread>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "edits/request.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using mirror::Submission;
using mirror::Verdict;

/// A scene with two boxes, whose time goes on by 1 a frame.
struct RequestOrder : testing::Test {
    Scene scene;
    mirror::Writers writers;
    mirror::RequestOrder order{scene, writers};
    NodeId a = scene.createNode(x3d::Transform::type), b = scene.createNode(x3d::Transform::type);
    ChangeEncoder encoder;
    std::uint64_t requests = 0;
    double time = 0;

    RequestOrder() { scene.newFrame(0); }

    Submission submission(std::uint64_t client, MirrorRequest request) {
        Submission result;
        result.client = client;
        result.request = ++requests;
        result.permission = MirrorUpstream::edits;
        result.author = "peer" + std::to_string(client);
        ByteBuffer record;
        mirror::writeRequest(encoder, std::move(request), 1, record);
        result.record.assign(record.bytes().begin(), record.bytes().end());
        return result;
    }
    Submission change(std::uint64_t client, ChangeKind kind, NodeId node, float x) {
        MirrorRequest request;
        Change& change = request.changes.emplace_back();
        change.kind = kind;
        change.node = node;
        change.field = x3d::Transform::translation.index;
        change.value = Vec3f(x, 0, 0);
        return submission(client, std::move(request));
    }
    Submission event(std::uint64_t client, NodeId node, float x) { return change(client, ChangeKind::event, node, x); }
    Submission edit(std::uint64_t client, NodeId node, float x) {
        return change(client, ChangeKind::setField, node, x);
    }
    void add(std::vector<Submission> submissions) { order.add(std::move(submissions)); }
    /// Requests that were answered in a turn of the server, then those of its frame.
    std::vector<std::uint64_t> poll() {
        std::vector<std::uint64_t> answered;
        const auto note = [&](const std::vector<Verdict>& verdicts) {
            for (const Verdict& v : verdicts) {
                EXPECT_EQ(v.refusal, "");
                answered.push_back(v.request);
            }
        };
        note(order.carryOut());
        note(order.happened(*scene.newFrame(++time)));
        return answered;
    }
    float position(NodeId node) { return scene.node(node).get(x3d::Transform::translation).x; }
};

using Requests = std::vector<std::uint64_t>;

TEST_F(RequestOrder, AnEditOfWhereAnEventGoesWaitsForIt) {
    add({event(1, a, 4), edit(2, a, 5)});
    EXPECT_EQ(poll(), Requests{1});
    EXPECT_EQ(position(a), 4);
    EXPECT_TRUE(order.holds(2));
    EXPECT_FALSE(order.holds(1));
    EXPECT_GT(order.bytes(), 0u);
    EXPECT_EQ(poll(), Requests{2});
    EXPECT_EQ(position(a), 5);
    EXPECT_FALSE(order.holds(2));
    EXPECT_EQ(order.bytes(), 0u);
}

TEST_F(RequestOrder, OthersAreNotHeldUp) {
    add({event(1, a, 4), edit(2, b, 5), edit(1, b, 6), edit(3, b, 7)});
    // The third waits for an event of its own peer, and the fourth for the third, which came before it.
    EXPECT_EQ(poll(), (Requests{2, 1}));
    EXPECT_EQ(position(b), 5);
    EXPECT_EQ(poll(), (Requests{3, 4}));
    EXPECT_EQ(position(b), 7);
}

TEST_F(RequestOrder, EventsDoNotWaitForEvents) {
    add({event(1, a, 1), event(1, b, 2), event(2, a, 3)});
    EXPECT_EQ(poll(), (Requests{1, 2, 3}));
    EXPECT_EQ(position(a), 3);
    EXPECT_EQ(position(b), 2);
}

TEST_F(RequestOrder, AnEventBehindAnEditThatWaitsWaitsToo) {
    add({event(1, a, 1), edit(2, a, 2), event(3, a, 3), event(2, b, 9)});
    EXPECT_EQ(poll(), Requests{1});
    EXPECT_EQ(position(b), 0) << "it is behind the edit of its own peer";
    EXPECT_EQ(poll(), (Requests{2, 3, 4}));
    EXPECT_EQ(position(a), 3);
    EXPECT_EQ(position(b), 9);
}

TEST_F(RequestOrder, ThreeWhoDragAndEditWaitOneFrameEach) {
    const NodeId c = scene.createNode(x3d::Transform::type);
    scene.newFrame(++time);
    const NodeId nodes[] = {a, b, c};
    for (int frame = 0; frame < 50; ++frame) {
        const float x = static_cast<float>(frame);
        for (std::uint64_t client = 1; client <= 3; ++client)
            add({event(client, nodes[client - 1], 100 + x), edit(client, nodes[client - 1], x)});
        poll();
        // Each one's edit of this frame alone waits.
        EXPECT_LE(order.bytes(), 3 * edit(1, a, x).record.size()) << frame;
    }
    poll();
    for (const NodeId node : nodes) EXPECT_EQ(position(node), 49);
}

TEST_F(RequestOrder, UndoAndLocksAreBehindEventsOfTheirPeer) {
    add({edit(1, a, 1)});
    EXPECT_EQ(poll(), Requests{1});
    MirrorRequest undo, lock;
    undo.kind = MirrorRequest::Kind::undo;
    lock.kind = MirrorRequest::Kind::lock;
    lock.nodes = {b};
    lock.lease = 1s;
    add({event(1, b, 2), submission(1, undo), submission(3, lock)});
    EXPECT_EQ(poll(), Requests{2});
    EXPECT_EQ(position(a), 1);
    EXPECT_EQ(poll(), (Requests{3, 4}));
    EXPECT_EQ(position(a), 0);
    EXPECT_EQ(position(b), 2);
}

TEST_F(RequestOrder, NobodyWaitsForLongWhereTheSceneStandsStill) {
    add({event(1, a, 4), edit(1, a, 5)});
    EXPECT_TRUE(order.carryOut().empty());
    EXPECT_TRUE(order.holds(1));
    std::vector<Verdict> verdicts;
    const auto start = std::chrono::steady_clock::now();
    while (verdicts.empty() && std::chrono::steady_clock::now() - start < 60s) {
        std::this_thread::sleep_for(5ms);
        verdicts = order.carryOut();
    }
    ASSERT_EQ(verdicts.size(), 1u);
    EXPECT_EQ(verdicts[0].request, 2u);
    EXPECT_GE(std::chrono::steady_clock::now() - start, 200ms);
    EXPECT_FALSE(order.holds(1));
}

TEST_F(RequestOrder, WhatIsMalformedIsRefusedAtOnce) {
    add({event(1, a, 4)});
    Submission broken = edit(2, a, 5);
    broken.record.resize(broken.record.size() / 2);
    add({broken});
    const std::vector<Verdict> verdicts = order.carryOut();
    ASSERT_EQ(verdicts.size(), 1u);
    EXPECT_NE(verdicts[0].refusal, "");
}

}  // namespace
}  // namespace rtsg
