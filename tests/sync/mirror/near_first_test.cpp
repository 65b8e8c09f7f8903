// Peers on slow links that get first what is near: which values wait, that each set leads to the hash that it says, and
// that in the end nothing is missing.
#include "server/near_first.h"

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntil;
using test::pollUntilAt;

/// Seen from (0, 0, 10) along -z: things before and behind the viewer, below a Transform each, and a sound that moves.
struct Avenue {
    Scene scene;
    NodeId near, far, behind, carrier, sound, view;
    std::vector<ChangeSet> frames;
    int frame = 0;

    Avenue() {
        const auto child = [&](NodeId parent, TypeIndex type, FieldIndex field) {
            const NodeId id = scene.createNode(type);
            EXPECT_TRUE(scene.insertChild(parent, field, id));
            return id;
        };
        const FieldIndex top = x3d::RtsgScene::children.index;
        near = child(scene.root(), x3d::Transform::type, top);
        far = child(scene.root(), x3d::Transform::type, top);
        behind = child(scene.root(), x3d::Transform::type, top);
        carrier = child(scene.root(), x3d::Transform::type, top);
        sound = child(carrier, x3d::Sound::type, x3d::Transform::children.index);
        view = child(scene.root(), x3d::Viewpoint::type, top);
        move(0);
    }
    /// All of them, a little.
    void move(float step) {
        EXPECT_TRUE(scene.set(near, x3d::Transform::translation, Vec3f(step, 0, 0)));
        EXPECT_TRUE(scene.set(far, x3d::Transform::translation, Vec3f(step, 0, -500)));
        EXPECT_TRUE(scene.set(behind, x3d::Transform::translation, Vec3f(step, 0, 210)));
        EXPECT_TRUE(scene.set(carrier, x3d::Transform::translation, Vec3f(step, 0, -9000)));
        EXPECT_TRUE(scene.set(sound, x3d::Sound::location, Vec3f(0, step, 0)));
        EXPECT_TRUE(scene.set(view, x3d::Viewpoint::position, Vec3f(0, step / 100, 10)));
        if (const auto set = scene.newFrame(++frame)) frames.push_back(*set);
    }
    std::vector<ChangeSet> take() { return std::exchange(frames, {}); }
};

/// Like the scene of another machine: it takes sets, and has hashes of its own.
struct Distant {
    Scene scene;
    explicit Distant(const Scene& origin) {
        scene.setBehavioursEnabled(false);
        EXPECT_TRUE(scene.apply(std::make_shared<ChangeSet>(origin.snapshot())));
    }
    /// Whether the scene is then what the set says.
    bool take(const Result<std::shared_ptr<const ChangeSet>>& set) {
        if (!set || !scene.apply(*set)) return false;
        return scene.hash() == (*set)->hash && scene.sequence() == (*set)->to;
    }
    float x(NodeId id) const { return scene.node(id).get(x3d::Transform::translation).x; }
};

TEST(NearFirst, WhatIsFarWaitsAndViewsAndSoundsDoNot) {
    Avenue avenue;
    const auto now = steadyClock().now();
    const auto eased = *NearFirst::of(avenue.scene);
    Distant distant(avenue.scene);
    avenue.take();
    avenue.move(1);
    avenue.move(2);
    // Room for the sound, what carries it, the viewer, and what is near.
    ASSERT_TRUE(distant.take(eased->next(avenue.take(), avenue.scene, 70, false, now)));
    EXPECT_TRUE(eased->waits());
    EXPECT_EQ(distant.scene.sequence(), avenue.scene.sequence() - 1);
    EXPECT_EQ(distant.x(avenue.near), 2);
    EXPECT_EQ(distant.x(avenue.carrier), 2);
    EXPECT_EQ(distant.scene.node(avenue.sound).get(x3d::Sound::location), Vec3f(0, 2, 0));
    EXPECT_EQ(distant.scene.node(avenue.view).get(x3d::Viewpoint::position).y, 0.02f);
    EXPECT_EQ(distant.x(avenue.far), 0);
    EXPECT_EQ(distant.x(avenue.behind), 0) << "200 m behind is farther than 500 m ahead";
    // Waiting values are sent when there is time for them.
    ASSERT_TRUE(distant.take(eased->next({}, avenue.scene, 70, false, now)));
    EXPECT_FALSE(eased->waits());
    EXPECT_EQ(distant.scene.hash(), avenue.scene.hash());
    EXPECT_EQ(distant.scene.dump(), avenue.scene.dump());
    // With room for one more it is what lies ahead.
    avenue.move(3);
    avenue.move(4);
    ASSERT_TRUE(distant.take(eased->next(avenue.take(), avenue.scene, 86, false, now)));
    EXPECT_EQ(distant.x(avenue.far), 4);
    EXPECT_EQ(distant.x(avenue.behind), 2);
}

TEST(NearFirst, WhatWaitsGoesWithWhatFollowsAndAtTheLatestAfterASecond) {
    Avenue avenue;
    auto now = steadyClock().now();
    const auto eased = *NearFirst::of(avenue.scene);
    Distant distant(avenue.scene);
    avenue.take();
    float last = 0;
    int held = 0;
    for (int i = 0; i < 24; ++i) {
        avenue.move(float(2 * i + 1));
        avenue.move(float(2 * i + 2));
        now += 99ms;
        ASSERT_TRUE(distant.take(eased->next(avenue.take(), avenue.scene, 1, false, now)));
        EXPECT_EQ(distant.x(avenue.near), float(2 * i + 2));
        if (eased->waits()) {
            ++held;
            EXPECT_EQ(distant.x(avenue.far), last);
        } else {
            EXPECT_EQ(distant.scene.hash(), avenue.scene.hash());
            last = distant.x(avenue.far);
            EXPECT_EQ(last, distant.x(avenue.near));
        }
    }
    EXPECT_EQ(held, 22);  // 11 of 12 each time
    avenue.move(100);
    ASSERT_TRUE(distant.take(eased->next(avenue.take(), avenue.scene, 1, true, now)));
    EXPECT_FALSE(eased->waits());
    // A single frame has no state before it that could stand for half of it.
    avenue.move(101);
    ASSERT_TRUE(distant.take(eased->next(avenue.take(), avenue.scene, 1, false, now)));
    EXPECT_FALSE(eased->waits());
}

TEST(NearFirst, FramesThatDoNotFollowAreRefused) {
    Avenue avenue;
    const auto eased = *NearFirst::of(avenue.scene);
    avenue.take();
    avenue.move(1);
    avenue.take();
    avenue.move(2);
    EXPECT_FALSE(eased->next(avenue.take(), avenue.scene, 100, false, {}));
    EXPECT_FALSE(eased->next({}, avenue.scene, 100, false, {}));
    // Nor are those that lead to another scene than they say.
    const auto other = *NearFirst::of(avenue.scene);
    avenue.move(3);
    std::vector<ChangeSet> frames = avenue.take();
    frames[0].hash.low ^= 1;
    EXPECT_FALSE(other->next(frames, avenue.scene, 100, false, {}));
}

/// Law: whatever happens at the origin, each set leads to the hash that it says, with all nodes; and then to the
/// origin.
TEST(NearFirst, ThroughRandomEditsNothingIsMissingInTheEnd) {
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        SCOPED_TRACE(seed);
        Scene origin;
        test::RandomEdits edits(origin, seed);
        for (int i = 0; i < 60; ++i) edits.step();
        origin.newFrame(0);
        const auto eased = *NearFirst::of(origin);
        Distant distant(origin);
        std::mt19937_64 random(seed);
        auto now = steadyClock().now();
        int waited = 0;
        for (int round = 1; round <= 60; ++round) {
            std::vector<ChangeSet> frames;
            for (std::uint64_t f = 0, count = 1 + random() % 4; f < count; ++f) {
                for (int i = 0; i < 5; ++i) edits.step();
                if (const auto set = origin.newFrame(round + double(f) / 10)) frames.push_back(*set);
            }
            now += std::chrono::milliseconds(random() % 300);
            if (frames.empty() && !eased->waits()) continue;
            ASSERT_TRUE(distant.take(eased->next(frames, origin, random() % 200, random() % 8 == 0, now)));
            ASSERT_EQ(distant.scene.nodeCount(), origin.nodeCount());
            waited += eased->waits();
            if (!eased->waits()) {
                ASSERT_EQ(distant.scene.hash(), origin.hash());
                ASSERT_EQ(distant.scene.dump(), origin.dump());
            }
        }
        EXPECT_GT(waited, 5);
    }
}

/// Over a link of 40 kB/s, for a scene that changes a multiple of that: the first is before the viewer, the others
/// farther and farther away.
struct SlowLink {
    Scene scene, replica;
    std::vector<NodeId> nodes;
    int frame = 0;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;

    SlowLink() {
        for (int i = 0; i < 600; ++i) {
            nodes.push_back(scene.createNode(x3d::Transform::type));
            EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children.index, nodes.back()));
        }
        step();
        MirrorServerOptions serverOptions;
        serverOptions.upstream = MirrorUpstream::edits;
        server = *MirrorServer::start(scene, test::kAnyPort, serverOptions);
        MirrorClientOptions options;
        options.whenSlow = MirrorWhenSlow::nearFirst;
        options.maxBytesPerSecond = 40'000;
        options.maxLag = 250ms;
        client = *MirrorClient::connect(replica, server->endpoint(), options);
    }
    void step() {
        ++frame;
        for (std::size_t i = 0; i < nodes.size(); ++i)
            EXPECT_TRUE(scene.set(nodes[i], x3d::Transform::translation, Vec3f(float(frame), 0, -100 * float(i))));
        scene.newFrame(frame / 60.0);
        if (server) server->service();
    }
    float x(std::size_t i) const { return replica.node(nodes[i]).get(x3d::Transform::translation).x; }
};

TEST(MirrorNearFirst, OnASlowLinkWhatIsNearIsNewerAndInTheEndAllIsEqual) {
    SlowLink link;
    auto& [scene, replica, nodes, frame, server, client] = link;
    ASSERT_TRUE(pollUntilAt(*client, scene));
    int newer = 0;
    std::uint64_t seen = 0;
    ASSERT_TRUE(pollUntil(*client, [&] {
        link.step();
        if (client->statistics().sequence != std::exchange(seen, client->statistics().sequence)) {
            newer += link.x(0) > link.x(599);
            EXPECT_GE(link.x(0), link.x(599));
        }
        return newer >= 10;
    }));
    ASSERT_TRUE(pollUntilAt(*client, scene));
    ASSERT_TRUE(pollUntil(*client, [&] { return replica.hash() == scene.hash(); }));
    EXPECT_EQ(replica.dump(), scene.dump());
    EXPECT_TRUE(client->statistics().equal);
    EXPECT_EQ(client->statistics().divergences, 0u);
    EXPECT_EQ(client->statistics().snapshots, 1u);
    // And when the server leaves.
    for (int i = 0; i < 30; ++i) {
        link.step();
        client->poll(5ms);
    }
    std::thread leaving([&] { server.reset(); });
    ASSERT_TRUE(pollUntil(*client, [&] { return client->serverLeft(); }));
    leaving.join();
    EXPECT_EQ(replica.hash() == scene.hash(), client->statistics().sequence == scene.sequence());
    EXPECT_EQ(client->statistics().divergences, 0u);
}

/// A peer that is told that its request was carried out has the result.
TEST(MirrorNearFirst, VerdictsComeWithWhatWaits) {
    SlowLink link;
    ASSERT_TRUE(pollUntilAt(*link.client, link.scene));
    for (int round = 1; round <= 2; ++round) {
        const Vec3f center(0, float(round), 0);
        ASSERT_TRUE(link.client->submitEdit(link.nodes[599], x3d::Transform::center.index, center));
        std::vector<MirrorVerdict> verdicts;
        ASSERT_TRUE(pollUntil(*link.client, [&] {
            link.step();
            verdicts = link.client->takeVerdicts();
            return !verdicts.empty();
        }));
        EXPECT_EQ(verdicts[0].refusal, "");
        EXPECT_EQ(link.replica.node(link.nodes[599]).get(x3d::Transform::center), center);
    }
}

}  // namespace
}  // namespace rtsg
