// Sets that come from elsewhere: long runs of plain values, and what is wrong in the middle of one.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include <rtsg/core/partial_hash.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg {
namespace {

Change changeTo(NodeId node, FieldIndex field, Value value) {
    Change change;
    change.node = node;
    change.field = field;
    change.value = std::move(value);
    return change;
}

std::shared_ptr<ChangeSet> setAfter(const Scene& scene, std::vector<Change> changes) {
    auto set = std::make_shared<ChangeSet>();
    set->from = scene.sequence();
    set->to = set->from + 1;
    set->changes = std::move(changes);
    return set;
}

/// From the values that are stored.
Hash128 hashAnew(const Scene& scene) {
    Hash128 sum;
    scene.forEachNode([&](const Node& node) { sum = sum + hashOfNode(scene, node); });
    return sum;
}

struct RunsOfValues : testing::Test {
    Scene scene;
    std::vector<NodeId> nodes;
    RunsOfValues() {
        for (int i = 0; i < 50; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
        for (int i = 0; i < 50; ++i) nodes.push_back(scene.createNode(x3d::TimeSensor::type));
        scene.newFrame(0);
    }
    Change someValue(std::mt19937& random) const {
        const std::size_t i = random() % nodes.size();
        const auto number = static_cast<float>(random() % 5);  // 0, the default of some, among them
        const bool first = random() % 2;
        if (i < 50)
            return first ? changeTo(nodes[i], x3d::Transform::translation.index, Vec3f(number, 0, 0))
                         : changeTo(nodes[i], x3d::Transform::rotation.index, Rotation{0, 0, 1, number});
        return first ? changeTo(nodes[i], x3d::TimeSensor::cycleInterval.index, Time{number})
                     : changeTo(nodes[i], x3d::TimeSensor::loop.index, number > 2);
    }
};

TEST_F(RunsOfValues, GiveTheirValuesAndTheHashOfThese) {
    std::mt19937 random(7);
    constexpr int kRounds = 40;
    for (int round = 0; round < kRounds; ++round) {
        const bool oftenEach = round % 8 == 5;  // a field several times, which no scene of ours would send
        std::vector<Change> changes;
        std::map<std::pair<NodeId, FieldIndex>, Value> last;
        for (int i = 0; i < 300; ++i) {
            const Change change = someValue(random);
            const bool isNew = last.insert_or_assign({change.node, change.field}, change.value).second;
            if (isNew || oftenEach)
                changes.push_back(change);
            else
                std::ranges::find_if(changes, [&](const Change& c) {
                    return c.node == change.node && c.field == change.field;
                })->value = change.value;
        }
        ASSERT_TRUE(scene.apply(setAfter(scene, changes)));
        for (const auto& [place, value] : last) EXPECT_EQ(scene.node(place.first).value(place.second), value);
        EXPECT_EQ(scene.hash(), hashAnew(scene)) << round;
    }
}

/// What the set before left as the term of a value is the last one's, in a run of values and alone.
TEST_F(RunsOfValues, OfAFieldThatComesTwiceTheLastValueCountsInTheNextSet) {
    const auto at = [](NodeId node, float x) {
        return changeTo(node, x3d::Transform::translation.index, Vec3f(x, 0, 0));
    };
    const auto turned = [](NodeId node, float angle) {
        return changeTo(node, x3d::Transform::rotation.index, Rotation{0, 0, 1, angle});
    };
    const NodeId a = nodes[0], b = nodes[1], c = nodes[2];
    const std::vector<std::vector<Change>> sets = {
        {at(a, 1), at(b, 1), at(b, 2)},
        {at(a, 2), at(b, 3)},
        {at(a, 1), at(b, 1), turned(b, 1), at(c, 1), at(b, 2), turned(b, 2)},
        {at(a, 2), at(b, 3), turned(b, 3), at(c, 2)},
        {at(b, 5), at(a, 6), at(b, 6), turned(a, 7), at(a, 7), turned(b, 8), turned(a, 1)},
        {at(b, 5), at(a, 6), turned(a, 7), at(a, 7), turned(b, 8), turned(a, 1)},
        {at(a, 1), at(b, 1)},
    };
    for (const auto& changes : sets) {
        ASSERT_TRUE(scene.apply(setAfter(scene, changes)));
        ASSERT_EQ(scene.hash(), hashAnew(scene)) << "state " << scene.sequence();
    }
}

/// Those who watch a part of a world lose nodes and get them again.
TEST_F(RunsOfValues, ANodeThatComesAgainUnderItsNumberHasTheTermsOfItsDefaults) {
    Change destruction, creation;
    destruction.node = creation.node = nodes[0];
    destruction.kind = ChangeKind::destroyNode;
    creation.kind = ChangeKind::createNode;
    creation.index = x3d::Transform::type.value;
    const auto at = [&](float x) { return changeTo(nodes[0], x3d::Transform::translation.index, Vec3f(x, 0, 0)); };
    for (const std::vector<Change>& changes :
         {std::vector{at(1)}, std::vector{destruction}, std::vector{creation, at(2)}, std::vector{at(3), destruction},
          std::vector{creation}, std::vector{at(4)}}) {
        ASSERT_TRUE(scene.apply(setAfter(scene, changes)));
        ASSERT_EQ(scene.hash(), hashAnew(scene)) << "state " << scene.sequence();
    }
}

TEST_F(RunsOfValues, WhatIsWrongInTheMiddleIsRefused) {
    std::mt19937 random(8);
    const std::vector<Change> wrong = {
        changeTo(NodeId{5000}, x3d::Transform::translation.index, Vec3f()),
        changeTo({}, x3d::Transform::translation.index, Vec3f()),
        changeTo(nodes[0], x3d::Transform::translation.index, 1.f),
        changeTo(nodes[0], x3d::Transform::addChildren.index, Vec3f()),
        changeTo(nodes[0], 10000, Vec3f()),
    };
    for (std::size_t i = 0; i < wrong.size(); ++i)
        for (const std::size_t at : {0u, 3u, 20u, 99u}) {
            std::vector<Change> changes;
            for (int k = 0; k < 100; ++k) changes.push_back(someValue(random));
            changes[at] = wrong[i];
            EXPECT_FALSE(scene.apply(setAfter(scene, changes))) << i << " at " << at;
        }
}

TEST_F(RunsOfValues, WakeThoseWhomTheyConcern) {
    scene.newFrame(1);  // all have said that there is nothing to do
    std::vector<Change> changes;
    for (std::size_t i = 50; i < 100; ++i)
        changes.push_back(changeTo(nodes[i], x3d::TimeSensor::startTime.index, Time{1.5}));
    ASSERT_TRUE(scene.apply(setAfter(scene, changes)));
    scene.newFrame(1.75);
    for (std::size_t i = 50; i < 100; ++i) EXPECT_TRUE(scene.node(nodes[i]).get(x3d::TimeSensor::isActive)) << i;
}

}  // namespace
}  // namespace rtsg
