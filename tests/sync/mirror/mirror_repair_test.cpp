// Replicas that differ from their origin: noticed, named node by node and field by field, and put right.
#include <algorithm>
#include <cstring>

#include <gtest/gtest.h>

#include <rtsg/core/hash_terms.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/record.h>

#include "mirror_support.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::Middleman;
using test::pollUntil;

Hash128 sumOfNodes(const Scene& scene) {
    Hash128 sum;
    scene.forEachNode([&](const Node& node) { sum = sum + hashOfNode(scene, node); });
    return sum;
}

TEST(PartialHash, OfAllNodesAddUpToTheStateHash) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        Scene scene;
        test::RandomEdits edits(scene, seed);
        for (int frame = 1; frame <= 30; ++frame) {
            for (int i = 0; i < 20; ++i) edits.step();
            scene.newFrame(frame);
            ASSERT_EQ(sumOfNodes(scene), scene.hash()) << "seed " << seed << " frame " << frame;
        }
        scene.forEachNode([&](const Node& node) {
            const NodeHashes parts = hashesOf(scene, node);
            Hash128 sum = parts.node + parts.name + parts.routes;
            for (const Hash128 field : parts.fields) sum = sum + field;
            EXPECT_EQ(sum, hashOfNode(scene, node));
        });
    }
}

/// An origin of many nodes, a replica that follows, and what was said of it.
struct Pair {
    Scene origin, replica;
    std::vector<NodeId> nodes;
    std::vector<Divergence> found;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;
    int frame = 0;

    explicit Pair(int count, std::chrono::milliseconds scrub = 0ms) {
        Array<NodeId> children;
        for (int i = 0; i < count; ++i) {
            nodes.push_back(origin.createNode(x3d::Transform::type));
            children.push_back(nodes.back());
        }
        EXPECT_TRUE(origin.setName(nodes.front(), "FIRST"));
        EXPECT_TRUE(origin.setField(origin.root(), x3d::RtsgScene::children.index, children));
        origin.newFrame(0);
        server = *MirrorServer::start(origin, test::kAnyPort);
        MirrorClientOptions options;
        options.scrub = scrub;
        options.onDivergence = [this](const Divergence& d) { found.push_back(d); };
        client = *MirrorClient::connect(replica, server->endpoint(), options);
        EXPECT_TRUE(settle());
    }
    void step(std::size_t node) {
        ++frame;
        EXPECT_TRUE(origin.set(nodes[node], x3d::Transform::translation, Vec3f(float(frame), float(node), 0)));
        origin.newFrame(frame);
    }
    bool settle() {
        return pollUntil(*client, [&] {
            server->service();
            return client->inStep() && client->statistics().sequence == origin.sequence() && client->statistics().equal;
        });
    }
    /// Like a stray pointer.
    template <class T>
    void corrupt(std::size_t node, Field<T> field, const T& value) {
        std::memcpy(const_cast<void*>(replica.node(nodes[node]).storage(field.index)), &value, sizeof(T));
    }
    void expectHealed() {
        EXPECT_EQ(replica.hash(), origin.hash());
        EXPECT_EQ(sumOfNodes(replica), origin.hash());
        EXPECT_EQ(replica.dump(), origin.dump());
        EXPECT_EQ(client->statistics().snapshots, 1u) << "only what differs is sent again";
        EXPECT_EQ(client->statistics().divergences, 1u);
        EXPECT_EQ(client->statistics().repairs, 1u);
        EXPECT_EQ(client->statistics().garbage, 0u);
    }
};

TEST(MirrorRepair, AFieldChangedBehindTheReplicasBackIsNamedByBisection) {
    Pair pair(20000);
    pair.corrupt(7777, x3d::Transform::scale, Vec3f(3, 1, 1));
    // The frame that writes the node next shows it; here that of another field, so that the damage is still there.
    EXPECT_TRUE(pair.origin.set(pair.nodes[7777], x3d::Transform::scale, Vec3f(1, 2, 3)));
    pair.corrupt(4321, x3d::Transform::center, Vec3f(9, 9, 9));
    pair.origin.newFrame(++pair.frame);
    const std::uint64_t before = pair.client->statistics().frames;
    ASSERT_TRUE(pair.settle());
    pair.expectHealed();
    EXPECT_EQ(pair.client->statistics().frames, before + 1) << "noticed by the very frame";
    ASSERT_EQ(pair.found.size(), 1u);
    EXPECT_EQ(pair.found[0].node, "#" + std::to_string(pair.nodes[4321].value));
    EXPECT_EQ(pair.found[0].field, "center");
    EXPECT_EQ(pair.found[0].frame, pair.origin.sequence());
    // Whole scene, 256 parts of 128, one of these; then fields; then the repair.
    EXPECT_LE(pair.client->statistics().questions, 4u);
    EXPECT_LT(pair.server->statistics().repairs, 2u);
    for (int i = 0; i < 20; ++i) {
        pair.step(static_cast<std::size_t>(i) * 7);
        ASSERT_TRUE(pair.settle());
    }
    pair.expectHealed();
}

TEST(MirrorRepair, AValueThatAFrameHasOverwrittenMeanwhileIsStillNoticed) {
    Pair pair(100);
    pair.corrupt(5, x3d::Transform::translation, Vec3f(8, 8, 8));
    pair.step(5);
    ASSERT_TRUE(pair.settle());
    pair.expectHealed();
    ASSERT_EQ(pair.found.size(), 1u);
    EXPECT_NE(pair.found[0].text.find("behind the replica's back"), std::string::npos);
}

TEST(MirrorRepair, MemoryThatNoFrameTouchesIsFoundByTheScrub) {
    Pair pair(10000, 20ms);
    pair.corrupt(9000, x3d::Transform::rotation, Rotation{1, 0, 0, 1});
    ASSERT_TRUE(pollUntil(*pair.client, [&] { return pair.client->statistics().repairs == 1; }));
    ASSERT_TRUE(pair.settle());
    pair.expectHealed();
    ASSERT_EQ(pair.found.size(), 1u);
    EXPECT_EQ(pair.found[0].field, "rotation");
}

TEST(MirrorRepair, SeveralFieldsOfSeveralNodesWhileFramesGoOn) {
    Pair pair(3000);
    for (const std::size_t i : {10u, 800u, 801u, 2999u}) pair.corrupt(i, x3d::Transform::center, Vec3f(1, 0, float(i)));
    pair.corrupt(800, x3d::Transform::scale, Vec3f(5, 5, 5));
    EXPECT_TRUE(pair.origin.set(pair.nodes[10], x3d::Transform::center, Vec3f(4, 4, 4)));
    pair.origin.newFrame(++pair.frame);
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (pair.client->statistics().repairs == 0 && std::chrono::steady_clock::now() < end) {
        pair.step(static_cast<std::size_t>(pair.frame) % 100 + 100);
        pair.client->poll(1ms);
    }
    ASSERT_TRUE(pair.settle());
    pair.expectHealed();
    ASSERT_EQ(pair.found.size(), 4u);
    EXPECT_EQ(pair.found[0].field, "center");  // fields in the order of the type
    EXPECT_EQ(pair.found[1].field, "scale");
}

TEST(MirrorRepair, MoreThanAFewMakeItASnapshot) {
    Pair pair(3000);
    for (std::size_t i = 0; i < 3000; i += 3) pair.corrupt(i, x3d::Transform::center, Vec3f(1, 0, float(i)));
    EXPECT_TRUE(pair.origin.set(pair.nodes[0], x3d::Transform::center, Vec3f(4, 4, 4)));
    pair.origin.newFrame(++pair.frame);
    ASSERT_TRUE(pair.settle());
    EXPECT_EQ(pair.replica.dump(), pair.origin.dump());
    EXPECT_EQ(pair.client->statistics().snapshots, 2u);
    EXPECT_EQ(pair.client->statistics().repairs, 0u);
}

TEST(MirrorRepair, EditsByTheReplicasOwnerAreNamedAndUndone) {
    for (const bool sealed : {false, true}) {
        Pair pair(50);
        EXPECT_TRUE(pair.replica.set(pair.nodes[0], x3d::Transform::scale, Vec3f(7, 7, 7)));
        if (sealed) pair.replica.newFrame(1);
        pair.step(3);
        ASSERT_TRUE(pair.settle());
        EXPECT_EQ(pair.replica.dump(), pair.origin.dump());
        EXPECT_EQ(pair.client->statistics().divergences, 1u);
        if (sealed) continue;
        ASSERT_EQ(pair.found.size(), 1u);
        EXPECT_EQ(pair.found[0].node, "FIRST");
        EXPECT_EQ(pair.found[0].field, "scale");
    }
}

/// Bends the first value of one frame on its way, with a checksum that fits: only the state hash can tell.
TEST(MirrorRepair, AValueBentOnTheWayIsNoticedByItsFrameAndRepaired) {
    Scene scene;
    auto server = *MirrorServer::start(scene, test::kAnyPort);
    std::atomic<bool> bend{false};
    Middleman middle(server->endpoint(), [&](bool toClient, Middleman::Parts& parts) {
        if (!toClient || parts.size() != 2 || parts[0][5] != 17 || !bend.exchange(false)) return true;
        ByteBuffer record;
        record.append(parts[1].data(), parts[1].size());
        const RecordHeader header = *parseRecordHeader(record.bytes());
        record.data()[record.size() - 1] ^= std::byte{0x20};
        sealRecord(record, header);
        parts[1].assign(reinterpret_cast<const char*>(record.data()), record.size());
        return true;
    });
    Scene replica;
    auto client = *MirrorClient::connect(replica, middle.endpoint);
    const NodeId node = scene.createNode(x3d::Transform::type);
    for (int frame = 1; frame <= 12; ++frame) {
        if (frame == 6) bend = true;
        ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(1, 2, float(frame))));
        scene.newFrame(frame);
        ASSERT_TRUE(pollUntil(*client, [&] {
            return client->inStep() && client->statistics().sequence == scene.sequence() && client->statistics().equal;
        })) << frame;
        EXPECT_EQ(client->statistics().divergences, frame < 6 ? 0u : 1u);
        EXPECT_EQ(replica.dump(), scene.dump());
    }
    EXPECT_EQ(client->statistics().snapshots, 1u);
    EXPECT_EQ(client->statistics().repairs, 1u);
    bool named = false;
    for (const Diagnostic& d : client->takeDiagnostics())
        named |= d.severity == Severity::error && d.text.starts_with("state 6: #") &&
                 d.text.find(".translation") != d.text.npos;
    EXPECT_TRUE(named);
}

/// Structure as well: frames whose blocks were lost on the way leave nodes, names and routes that are wrong.
TEST(MirrorRepair, NodesNamesAndRoutesThatAreMissingOrTooManyAreRepaired) {
    Pair pair(600);
    const NodeId clock = pair.origin.createNode(x3d::TimeSensor::type);
    const NodeId path = pair.origin.createNode(x3d::PositionInterpolator::type);
    ASSERT_TRUE(pair.origin.setName(pair.nodes[3], "THREE"));
    ASSERT_TRUE(pair.origin.addRoute(clock, x3d::TimeSensor::fraction_changed.index, path,
                                     x3d::PositionInterpolator::set_fraction.index));
    pair.origin.newFrame(++pair.frame);
    ASSERT_TRUE(pair.settle());
    // The replica loses a route, a name and a node, and gains another, without its client's knowledge: applied as if
    // from the origin, so that only hashes tell.
    const auto set = std::make_shared<ChangeSet>();
    set->from = set->to = pair.replica.sequence();
    set->time = pair.replica.now();
    const auto add = [&](ChangeKind kind, NodeId node) -> Change& {
        Change& change = set->changes.emplace_back();
        change.kind = kind;
        change.node = node;
        return change;
    };
    const NodeId extra{static_cast<std::uint32_t>(100000)};
    add(ChangeKind::createNode, extra).index = x3d::Group::type.value;
    add(ChangeKind::setName, pair.nodes[3]).value = String("FOUR");
    Change& route = add(ChangeKind::removeRoute, clock);
    route.field = x3d::TimeSensor::fraction_changed.index;
    route.other = path;
    route.index = x3d::PositionInterpolator::set_fraction.index;
    add(ChangeKind::destroyNode, path);
    ASSERT_TRUE(pair.replica.apply(set));
    pair.step(1);
    ASSERT_TRUE(pair.settle());
    pair.expectHealed();
    std::vector<std::string> fields;
    for (const Divergence& d : pair.found) fields.push_back(d.field);
    std::ranges::sort(fields);
    EXPECT_EQ(fields, (std::vector<std::string>{"existence", "existence", "name", "routes"}));
}

TEST(MirrorRepair, ARelaysSubscribersAndReplicasAreRepairedWithIt) {
    Pair pair(200);
    auto relay = *MirrorServer::start(pair.replica, test::kAnyPort);
    Scene leafScene;
    auto leaf = *MirrorClient::connect(leafScene, relay->endpoint());
    const auto settle = [&] {
        return pollUntil(*leaf, [&] {
            pair.client->poll();
            relay->service();
            return pair.client->inStep() && leaf->inStep() && leafScene.hash() == pair.origin.hash() &&
                   pair.client->statistics().equal;
        });
    };
    ASSERT_TRUE(settle());
    pair.corrupt(50, x3d::Transform::scale, Vec3f(3, 3, 3));
    pair.step(2);
    ASSERT_TRUE(pair.origin.set(pair.nodes[50], x3d::Transform::scale, Vec3f(2, 2, 2)));
    pair.corrupt(60, x3d::Transform::scale, Vec3f(3, 3, 3));
    pair.origin.newFrame(++pair.frame);
    ASSERT_TRUE(settle());
    for (int i = 0; i < 10; ++i) {
        pair.step(static_cast<std::size_t>(i));
        ASSERT_TRUE(settle()) << i;
    }
    EXPECT_EQ(leafScene.dump(), pair.origin.dump());
    EXPECT_EQ(pair.replica.dump(), pair.origin.dump());
    // A replica that joins now gets the right values.
    Scene late;
    auto latecomer = *MirrorClient::connect(late, relay->endpoint());
    ASSERT_TRUE(pollUntil(*latecomer, [&] { return latecomer->inStep() && late.hash() == pair.origin.hash(); }));
    EXPECT_EQ(late.dump(), pair.origin.dump());
}

}  // namespace
}  // namespace rtsg
