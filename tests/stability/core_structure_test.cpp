// Structures at their limits: very deep, very wide, very many. Each test states its outcome.
#include <gtest/gtest.h>

#include <sstream>

#include <rtsg/core/mobility.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>

#include "support/shared_set.h"

namespace rtsg {
namespace {

constexpr int kDeep = 10'000, kWide = 100'000;

NodeId add(Scene& scene, NodeId parent, TypeIndex type) {
    const NodeId id = scene.createNode(type);
    const FieldIndex children = scene.node(parent).type().findExact("children");
    EXPECT_TRUE(scene.insertChild(parent, children, id));
    return id;
}

/// A chain of Groups with a Shape at its end.
NodeId addChain(Scene& scene, int depth) {
    NodeId at = scene.root();
    for (int i = 0; i < depth; ++i) at = add(scene, at, x3d::Group::type);
    return add(scene, at, x3d::Shape::type);
}

int depthOf(const Scene& scene) {
    int depth = 0;
    NodeId at = scene.root();
    for (;;) {
        const Node& node = scene.node(at);
        const FieldIndex field = node.type().findExact("children");
        if (field == kNoField) return depth;
        const auto& children = node.get(Field<Array<NodeId>>{field});
        if (children.empty()) return depth;
        at = children[0];
        ++depth;
    }
}

class Encodings : public testing::TestWithParam<Encoding> {};

TEST_P(Encodings, TenThousandDeepIsWrittenAndReadBack) {
    // Outcome: written and read back whole; no recursion anywhere that follows the nesting.
    Scene scene;
    addChain(scene, kDeep);
    std::ostringstream text;
    Diagnostics diagnostics("deep");
    auto writer = makeWriter(GetParam(), streamSink(text), diagnostics);
    ASSERT_TRUE(writer);
    SceneExporter(scene, diagnostics).write(*writer, GetParam());
    Scene back;
    const bool usable = loadText(back, text.str(), diagnostics);
    ASSERT_TRUE(usable);
    EXPECT_EQ(diagnostics.errors(), 0u) << diagnostics.all().front().format();
    EXPECT_EQ(depthOf(back), kDeep + 1);
    EXPECT_EQ(back.nodeCount(), scene.nodeCount());
}
INSTANTIATE_TEST_SUITE_P(All, Encodings,
                         testing::Values(Encoding::classicVrml, Encoding::vrml97, Encoding::xml, Encoding::json));

TEST(Deep, DumpHashSnapshotApplyAndDestroy) {
    // Outcome: all work; from the top or from the bottom, everything goes.
    Scene scene;
    const NodeId leaf = addChain(scene, kDeep);
    scene.newFrame(0);
    EXPECT_NE(scene.dump().find("Shape"), std::string::npos);
    Scene replica;
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    EXPECT_EQ(replica.hash(), scene.hash());
    EXPECT_EQ(replica.dump(), scene.dump());
    Mobility mobility;
    Attachment attached = scene.bus().attach(mobility);
    EXPECT_EQ(mobility.mayChange(scene.node(leaf)), 0);
    // A cycle through all of it is refused.
    EXPECT_FALSE(scene.insertChild(NodeId{leaf.value - 1}, x3d::Group::children, NodeId{2}));
    const auto& top = scene.node(scene.root()).get(x3d::RtsgScene::children);
    ASSERT_EQ(top.size(), 1u);
    ASSERT_TRUE(scene.destroyNode(top[0]));
    EXPECT_EQ(scene.destroyUnreachable(), static_cast<std::size_t>(kDeep));
    EXPECT_EQ(scene.nodeCount(), 1u);
    ASSERT_TRUE(replica.apply(scene.newFrame(1)));
    EXPECT_EQ(replica.nodeCount(), 1u);
    EXPECT_EQ(replica.hash(), scene.hash());
    EXPECT_EQ(scene.hash(), Hash128{});
}

TEST(Deep, AReplicaRefusesACycleOfTenThousand) {
    // Outcome: a set that closes the chain to a ring is refused with an error, not followed for ever.
    Scene scene;
    const NodeId leaf = addChain(scene, kDeep);
    scene.newFrame(0);
    ChangeSet ring;
    ring.from = 1;
    ring.to = 2;
    Change& change = ring.changes.emplace_back();
    change.kind = ChangeKind::insertChild;
    change.node = NodeId{leaf.value - 1};
    change.field = x3d::Group::children.index;
    change.other = NodeId{2};
    const auto ok = scene.apply(test::shared(ring));
    ASSERT_FALSE(ok);
    EXPECT_NE(ok.error().text.find("contain itself"), std::string::npos) << ok.error().text;
}

TEST(Wide, AHundredThousandParentsOfOneNode) {
    // Outcome: adding, removing and destroying cost what they touch; every parent is known, none is left over.
    Scene scene;
    const NodeId shape = add(scene, scene.root(), x3d::Shape::type);
    std::vector<NodeId> groups;
    for (int i = 0; i < kWide; ++i) {
        groups.push_back(add(scene, scene.root(), x3d::Group::type));
        ASSERT_TRUE(scene.insertChild(groups.back(), x3d::Group::children, shape));
    }
    EXPECT_EQ(scene.parents(shape).size(), kWide + 1u);
    scene.newFrame(0);
    Scene replica;
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    ASSERT_TRUE(scene.removeChild(groups[5], x3d::Group::children.index, 0));
    ASSERT_TRUE(scene.destroyNode(groups[70'000]));
    const auto few = scene.newFrame(1);
    EXPECT_EQ(few->changes.size(), 3u);
    ASSERT_TRUE(replica.apply(few));
    EXPECT_EQ(scene.parents(shape).size(), kWide - 1u);
    ASSERT_TRUE(scene.destroyNode(shape));
    const auto all = scene.newFrame(2);
    EXPECT_EQ(all->changes.size(), kWide + 0u);
    ASSERT_TRUE(replica.apply(all));
    EXPECT_EQ(replica.hash(), scene.hash());
    for (const NodeId group : groups)
        if (scene.find(group)) {
            ASSERT_TRUE(scene.node(group).get(x3d::Group::children).empty());
        }
}

TEST(Wide, TheSameChildAHundredThousandTimes) {
    // Outcome: a list may name one node any number of times; each place is a parent, and destroying it clears all.
    Scene scene;
    const NodeId group = add(scene, scene.root(), x3d::Group::type);
    const NodeId shape = scene.createNode(x3d::Shape::type);
    Array<NodeId> list = Array<NodeId>::ofSize(kWide);
    std::fill_n(list.mutableData(), kWide, shape);
    ASSERT_TRUE(scene.set(group, x3d::Group::children, list));
    list = {};
    scene.newFrame(0);
    EXPECT_EQ(scene.parents(shape).size(), kWide + 0u);
    ASSERT_TRUE(scene.destroyNode(shape));
    EXPECT_TRUE(scene.node(group).get(x3d::Group::children).empty());
    scene.newFrame(1);
    Scene replica;
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    EXPECT_EQ(replica.hash(), scene.hash());
}

TEST(Wide, EditsOfAMillionChildren) {
    // Outcome: appending, inserting, removing and re-parenting are one change each, and the hash stays that of a scene
    // made from scratch.
    Scene scene;
    constexpr int kMany = 1'000'000;
    const NodeId big = add(scene, scene.root(), x3d::Group::type), other = add(scene, scene.root(), x3d::Group::type);
    for (int i = 0; i < kMany; ++i) add(scene, big, x3d::Group::type);
    scene.newFrame(0);
    const NodeId extra = add(scene, big, x3d::Shape::type);
    EXPECT_EQ(scene.newFrame(1)->changes.size(), 2u);
    ASSERT_TRUE(scene.removeChild(big, x3d::Group::children.index, kMany / 2));
    EXPECT_EQ(scene.newFrame(2)->changes.size(), 1u);
    ASSERT_TRUE(scene.removeChild(big, x3d::Group::children.index, kMany - 1));
    ASSERT_TRUE(scene.insertChild(other, x3d::Group::children, extra));
    EXPECT_EQ(scene.newFrame(3)->changes.size(), 2u);
    ASSERT_TRUE(scene.insertChild(big, x3d::Group::children, extra, 7));
    EXPECT_EQ(scene.newFrame(4)->changes.size(), 1u);
    EXPECT_EQ(scene.node(big).get(x3d::Group::children)[7], extra);
    Scene replica;
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    EXPECT_EQ(replica.hash(), scene.hash());
}

TEST(Routes, AHundredThousandFromOneField) {
    // Outcome: one event reaches all of them in one frame; removing one route and destroying the source leave the rest
    // and nothing behind.
    Scene scene;
    const NodeId source = add(scene, scene.root(), x3d::Transform::type);
    std::vector<NodeId> targets;
    const FieldIndex field = x3d::Transform::translation.index;
    for (int i = 0; i < kWide; ++i) {
        targets.push_back(scene.createNode(x3d::Transform::type));
        ASSERT_TRUE(scene.addRoute(source, field, targets.back(), field));
    }
    EXPECT_EQ(scene.routeCount(), kWide + 0u);
    ASSERT_TRUE(scene.addRoute(source, field, targets[9], field));  // a duplicate is ignored
    EXPECT_EQ(scene.routeCount(), kWide + 0u);
    scene.newFrame(0);
    ASSERT_TRUE(scene.removeRoute(source, field, targets[50'000], field));
    ASSERT_TRUE(scene.sendEvent(source, field, Vec3f(1, 2, 3)));
    scene.newFrame(1);
    std::size_t moved = 0;
    for (const NodeId id : targets) moved += scene.node(id).get(x3d::Transform::translation) == Vec3f(1, 2, 3);
    EXPECT_EQ(moved, kWide - 1u);
    ASSERT_TRUE(scene.destroyNode(targets[3]));
    EXPECT_EQ(scene.routeCount(), kWide - 2u);
    ASSERT_TRUE(scene.destroyNode(source));
    EXPECT_EQ(scene.routeCount(), 0u);
    scene.newFrame(2);
    Scene replica;
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    EXPECT_EQ(replica.hash(), scene.hash());
}

TEST(Routes, ManyIntoOneFieldAndOutOfManyFields) {
    // Outcome: at most one event per route and timestamp arrives, the last one sent wins; costs stay linear.
    Scene scene;
    const NodeId target = add(scene, scene.root(), x3d::Transform::type);
    const FieldIndex field = x3d::Transform::translation.index;
    std::vector<NodeId> sources;
    for (int i = 0; i < kWide; ++i) {
        sources.push_back(scene.createNode(x3d::Transform::type));
        ASSERT_TRUE(scene.addRoute(sources.back(), field, target, field));
    }
    scene.newFrame(0);
    for (const NodeId id : sources) ASSERT_TRUE(scene.sendEvent(id, field, Vec3f(static_cast<float>(id.value))));
    const auto set = scene.newFrame(1);
    EXPECT_EQ(scene.node(target).get(x3d::Transform::translation).x, static_cast<float>(sources.back().value));
    EXPECT_EQ(set->changes.size(), 2u * kWide + 1u);  // events, sources, the target
    for (const NodeId id : sources) ASSERT_TRUE(scene.destroyNode(id));
    EXPECT_EQ(scene.routeCount(), 0u);
}

TEST(Routes, LoopsAndStormsSettle) {
    // Outcome: a ring of ten thousand routes passes one event once around per timestamp (4.4.8.3), a network in which
    // everything feeds everything sends each field once.
    Scene scene;
    const FieldIndex field = x3d::Transform::translation.index;
    std::vector<NodeId> ring;
    for (int i = 0; i < kDeep; ++i) ring.push_back(scene.createNode(x3d::Transform::type));
    for (std::size_t i = 0; i < ring.size(); ++i)
        ASSERT_TRUE(scene.addRoute(ring[i], field, ring[(i + 1) % ring.size()], field));
    std::vector<NodeId> storm;
    for (int i = 0; i < 100; ++i) storm.push_back(scene.createNode(x3d::Transform::type));
    for (const NodeId a : storm)
        for (const NodeId b : storm)
            if (a != b) {
                ASSERT_TRUE(scene.addRoute(a, field, b, field));
            }
    scene.newFrame(0);
    std::size_t events = 0;
    scene.setEventListener([&](double, const Node&, FieldIndex, const Value&) { ++events; });
    ASSERT_TRUE(scene.sendEvent(ring[17], field, Vec3f(1)));
    ASSERT_TRUE(scene.sendEvent(storm[3], field, Vec3f(2)));
    const auto set = scene.newFrame(1);
    EXPECT_EQ(events, ring.size() + storm.size());
    EXPECT_EQ(set->changes.size(), ring.size() + storm.size() + 2);
    EXPECT_EQ(scene.node(ring[16]).get(x3d::Transform::translation), Vec3f(1));
}

TEST(Arrays, AHundredMillionBytesPassByReference) {
    // Outcome: a huge array is stored, sealed, sent and snapshotted without being copied once.
    Scene scene;
    const NodeId points = add(scene, scene.root(), x3d::Group::type),
                 coordinate = scene.createNode(x3d::Coordinate::type);
    (void)points;
    Array<Vec3f> huge = Array<Vec3f>::ofSize(8'400'000);
    huge.mutableData()[8'000'000] = Vec3f(1, 2, 3);
    ASSERT_TRUE(scene.set(coordinate, x3d::Coordinate::point, huge));
    const auto set = scene.newFrame(0);
    EXPECT_TRUE(scene.node(coordinate).get(x3d::Coordinate::point).sameStorage(huge));
    for (const Change& change : set->changes)
        if (change.value.holds<Array<Vec3f>>()) {
            EXPECT_TRUE(change.value.as<Array<Vec3f>>().sameStorage(huge));
        }
    Scene replica;
    ASSERT_TRUE(replica.apply(test::shared(scene.snapshot())));
    EXPECT_TRUE(replica.node(coordinate).get(x3d::Coordinate::point).sameStorage(huge));
    EXPECT_EQ(replica.hash(), scene.hash());
}

}  // namespace
}  // namespace rtsg
