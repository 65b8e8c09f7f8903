// Numbers of nodes with any gaps: found, visited in order, and at a cost that follows the nodes, not the gaps.
#include <map>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "support/resident_bytes.h"

namespace rtsg {
namespace {

using test::residentBytes;

Change creation(std::uint32_t id) {
    Change change;
    change.kind = ChangeKind::createNode;
    change.node = NodeId{id};
    change.field = kNoField;
    change.index = x3d::Group::type.value;
    return change;
}

std::shared_ptr<ChangeSet> following(const Scene& scene) {
    auto set = std::make_shared<ChangeSet>();
    set->from = scene.sequence();
    set->to = set->from + 1;
    return set;
}

TEST(NodeTable, NodesFarApartCostNoMoreThanNodes) {
    constexpr std::uint32_t kNodes = 100000;
    Scene scene;
    const auto set = following(scene);
    for (std::uint32_t i = 1; i <= kNodes; ++i) set->changes.push_back(creation(i * 1024 + 7));
    set->changes.push_back(creation(1u << 30));
    const std::size_t before = residentBytes();
    ASSERT_TRUE(scene.apply(set));
    // A node is some hundred bytes; a page of its own for each would make 800 MB. ThreadSanitizer keeps as much again.
#ifdef __SANITIZE_THREAD__
    constexpr std::size_t kMax = 2000;
#else
    constexpr std::size_t kMax = 1000;
#endif
    EXPECT_LT(residentBytes(), before + kNodes * kMax);
    EXPECT_EQ(scene.nodeCount(), kNodes + 2u);
    for (std::uint32_t i = 1; i <= kNodes; ++i) {
        ASSERT_NE(scene.find(NodeId{i * 1024 + 7}), nullptr) << i;
        ASSERT_EQ(scene.find(NodeId{i * 1024 + 8}), nullptr) << i;
    }
    EXPECT_NE(scene.find(NodeId{1u << 30}), nullptr);
}

/// Law: whatever comes and goes, with whatever gaps, the scene has what a map has, in the same order.
TEST(NodeTable, EqualsAMapUnderRandomEdits) {
    const std::uint64_t seed = 11;
    std::mt19937_64 random(seed);
    for (int round = 0; round < 6; ++round) {
        Scene scene;
        std::map<std::uint32_t, bool> model{{1, true}};
        std::uint32_t next = 2;
        for (int step = 0; step < 60; ++step) {
            const auto set = following(scene);
            const bool gaps = (step / 10 + round) % 2;
            for (std::uint32_t n = 0; n < 200; ++n) {
                next += gaps ? static_cast<std::uint32_t>(random() % 5000) : 1;
                set->changes.push_back(creation(next));
                model[next] = true;
                next += 1;
            }
            std::vector<std::uint32_t> gone;
            for (const auto& [id, there] : model)
                if (id != 1 && random() % 4 == 0 && id < set->changes.front().node.value) gone.push_back(id);
            for (const std::uint32_t id : gone) {
                Change change;
                change.kind = ChangeKind::destroyNode;
                change.node = NodeId{id};
                change.field = kNoField;
                set->changes.push_back(change);
                model.erase(id);
            }
            ASSERT_TRUE(scene.apply(set)) << "seed " << seed << " step " << step;
            ASSERT_EQ(scene.nodeCount(), model.size());
            auto expected = model.begin();
            bool inOrder = true;
            scene.forEachNode([&](const Node& node) {
                inOrder = inOrder && expected != model.end() && node.id().value == expected->first;
                if (expected != model.end()) ++expected;
            });
            ASSERT_TRUE(inOrder && expected == model.end()) << "seed " << seed << " step " << step;
            for (const std::uint32_t id : gone) ASSERT_EQ(scene.find(NodeId{id}), nullptr);
        }
        // Nodes that the scene makes itself get numbers after the highest.
        EXPECT_GE(scene.createNode(x3d::Group::type).value, next - 1);
    }
}

}  // namespace
}  // namespace rtsg
