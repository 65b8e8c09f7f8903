// Sets that come from elsewhere: long runs of plain values and of new nodes, and what is wrong in the middle of one.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include <rtsg/core/hash_terms.h>
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
        for (const auto& [field, value] : last) EXPECT_EQ(scene.node(field.first).value(field.second), value);
        EXPECT_EQ(scene.hash(), hashAnew(scene)) << round;
    }
}

/// The hash term that the last set left for a value is that of its last value, in a run of values and alone.
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

/// Moving scenes mostly change the same fields: these sets name the same fields in the same order, with others between
/// them that are almost the same, or the same up to the middle.
struct RunsThatComeAgain : testing::Test {
    static constexpr std::size_t kNodes = 800;  // two fields each: more than a chunk of what is noted
    using NodeField = std::pair<NodeId, FieldIndex>;
    Scene scene;
    std::vector<NodeId> nodes;
    std::map<NodeField, Value> values;
    std::mt19937 random{11};
    RunsThatComeAgain() {
        for (std::size_t i = 0; i < kNodes; ++i)
            nodes.push_back(scene.createNode(i % 5 == 4 ? x3d::TimeSensor::type : x3d::Transform::type));
        scene.newFrame(0);
    }
    NodeId any() { return nodes[random() % nodes.size()]; }
    Change valueOf(NodeField field) {
        const auto number = static_cast<float>(random() % 4);
        switch (scene.node(field.first).type().fields[field.second].type) {
            case FieldType::SFVec3f:
                return changeTo(field.first, field.second, Vec3f(number, 1, 0));
            case FieldType::SFRotation:
                return changeTo(field.first, field.second, Rotation{0, 0, 1, number});
            case FieldType::SFTime:
                return changeTo(field.first, field.second, Time{number});
            default:
                return changeTo(field.first, field.second, number > 1);
        }
    }
    /// A column of a field of some of the nodes, then one of another field.
    std::vector<NodeField> someOrder() {
        std::vector<NodeField> order;
        const std::size_t keep = 2 + random() % 9;
        for (const bool first : {true, false})
            for (const NodeId node : nodes)
                if (random() % 10 < keep) {
                    const bool isTransform = scene.node(node).is(x3d::Transform::type);
                    order.emplace_back(
                        node, isTransform ? first ? x3d::Transform::translation.index : x3d::Transform::rotation.index
                              : first     ? x3d::TimeSensor::cycleInterval.index
                                          : x3d::TimeSensor::loop.index);
                }
        if (random() % 4 == 0) std::ranges::shuffle(order, random);
        return order;
    }
    /// One that differs a little.
    void disturb(std::vector<Change>& changes) {
        const auto at = changes.begin() + static_cast<std::ptrdiff_t>(random() % changes.size());
        switch (random() % 6) {
            case 0:
                std::iter_swap(at, changes.begin() + static_cast<std::ptrdiff_t>(changes.size() / 2));
                break;
            case 1:
                *at = valueOf({nodes[0], x3d::Transform::scale.index});
                break;
            case 2:  // in the place of one of the field's own a second time
                *at = valueOf({changes.front().node, changes.front().field});
                break;
            case 3:
                *at = changeTo(nodes[1], x3d::Transform::metadata.index, NodeId{});
                break;
            case 4:
                *at = changeTo(nodes[4], x3d::TimeSensor::description.index, String("what is shared"));
                break;
            default:
                changes.pop_back();
        }
    }
    void apply(std::vector<Change> changes) {
        for (const Change& change : changes) values.insert_or_assign({change.node, change.field}, change.value);
        ASSERT_TRUE(scene.apply(setAfter(scene, std::move(changes))));
        ASSERT_EQ(scene.hash(), hashAnew(scene)) << "state " << scene.sequence();
    }
};

TEST_F(RunsThatComeAgain, GiveTheirValuesAndTheHashOfThese) {
    for (int round = 0; round < 30; ++round) {
        const std::vector<NodeField> order = someOrder();
        for (int again = 0; again < 5; ++again) {
            std::vector<Change> changes;
            for (const NodeField& field : order) changes.push_back(valueOf(field));
            if (again > 1 && random() % 2) disturb(changes);
            ASSERT_NO_FATAL_FAILURE(apply(std::move(changes)));
        }
        for (const auto& [field, value] : values) ASSERT_EQ(scene.node(field.first).value(field.second), value);
        // Edits of a scene's own, and the cascade's, come in between.
        if (round % 3 == 0) {
            const NodeId node = nodes[10 * (random() % 80)];
            ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(round), 2, 3)));
            values[{node, x3d::Transform::translation.index}] = Vec3f(float(round), 2, 3);
            scene.newFrame(scene.now() + 1e-3);
            ASSERT_EQ(scene.hash(), hashAnew(scene));
        }
    }
}

TEST_F(RunsThatComeAgain, OfANodeThatIsGoneAreRefused) {
    std::vector<Change> changes;
    for (const NodeId node : nodes)
        if (scene.node(node).is(x3d::Transform::type)) changes.push_back(valueOf({node, x3d::Transform::scale.index}));
    apply(changes);
    apply(changes);
    Change destruction;
    destruction.node = nodes[10];
    destruction.kind = ChangeKind::destroyNode;
    ASSERT_TRUE(scene.apply(setAfter(scene, {destruction})));
    EXPECT_FALSE(scene.apply(setAfter(scene, changes)));
}

TEST_F(RunsThatComeAgain, OfValuesOfAnotherTypeAreRefused) {
    std::vector<Change> changes;
    for (std::size_t i = 0; i < 4; ++i) changes.push_back(valueOf({nodes[i], x3d::Transform::scale.index}));
    apply(changes);
    changes[2].value = 1.f;
    EXPECT_FALSE(scene.apply(setAfter(scene, changes)));
}

TEST_F(RunsThatComeAgain, WakeThoseWhomTheyConcern) {
    const auto beginAt = [&](double time) {
        std::vector<Change> changes;
        for (std::size_t i = 4; i < kNodes; i += 5)
            changes.push_back(changeTo(nodes[i], x3d::TimeSensor::startTime.index, Time{time}));
        ASSERT_TRUE(scene.apply(setAfter(scene, std::move(changes))));
    };
    scene.newFrame(2);  // what began with the scene is over
    beginAt(1000);
    scene.newFrame(3);  // all have said that there is nothing to do, and nothing was written
    beginAt(3.5);
    scene.newFrame(3.75);
    for (std::size_t i = 4; i < kNodes; i += 5) ASSERT_TRUE(scene.node(nodes[i]).get(x3d::TimeSensor::isActive)) << i;
}

TEST(RunsThatMovePlaces, AreHeardOfWhenTheyComeAgain) {
    Scene scene;
    std::vector<NodeId> moving;
    for (int i = 0; i < 8; ++i) moving.push_back(scene.createNode(x3d::Transform::type));
    const NodeId sensor = scene.createNode(x3d::ProximitySensor::type);
    ASSERT_TRUE(scene.set(sensor, x3d::ProximitySensor::size, Vec3f(2, 2, 2)));
    ASSERT_TRUE(scene.set(moving[3], x3d::Transform::children, Array<NodeId>{sensor}));
    ASSERT_TRUE(scene.set(moving[3], x3d::Transform::translation, Vec3f(0, 0, 500)));
    ASSERT_TRUE(
        scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>(std::span<const NodeId>(moving))));
    scene.newFrame(0);
    const auto allTo = [&](Vec3f position) {
        std::vector<Change> changes;
        for (const NodeId node : moving) changes.push_back(changeTo(node, x3d::Transform::translation.index, position));
        ASSERT_TRUE(scene.apply(setAfter(scene, std::move(changes))));
    };
    allTo({0, 0, 700});
    scene.newFrame(1);
    ASSERT_FALSE(scene.node(sensor).get(x3d::ProximitySensor::isActive));
    allTo({0, 0, 10});  // where the viewer is
    scene.newFrame(2);
    EXPECT_TRUE(scene.node(sensor).get(x3d::ProximitySensor::isActive));
}

Change creationOf(std::uint32_t number, TypeIndex type, NodeId scope = {}) {
    Change change;
    change.kind = ChangeKind::createNode;
    change.node = NodeId{number};
    change.index = type.value;
    change.other = scope;
    return change;
}

TEST(RunsOfCreations, AreTheNodesThatWereMadeOneByOne) {
    Scene origin, replica;
    const TypeIndex types[] = {x3d::Transform::type, x3d::Collision::type,      x3d::IndexedFaceSet::type,
                               x3d::Transform::type, x3d::LinePickSensor::type, x3d::NavigationInfo::type};
    NodeId scope;
    for (const TypeIndex type : types) {
        for (int i = 0; i < 7; ++i) (void)origin.createNode(type, scope);
        scope = origin.createNode(x3d::Group::type);
    }
    origin.newFrame(0);
    ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(origin.snapshot())));
    EXPECT_EQ(replica.dump(), origin.dump());
    EXPECT_EQ(replica.hash(), origin.hash());
    EXPECT_EQ(replica.hash(), hashAnew(replica));
    // Values that all nodes of a type share are not taken down with one of them.
    EXPECT_GT(replica.destroyUnreachable(), 40u);
    EXPECT_EQ(replica.createNode(x3d::NavigationInfo::type), origin.createNode(x3d::NavigationInfo::type));
}

TEST(RunsOfCreations, NumbersOfBeforeOrTwiceOrTypesThatAreNoneEndThem) {
    const TypeIndex group = x3d::Group::type;
    const TypeIndex none{0xFFFF};
    const auto applied = [&](std::vector<Change> changes) {
        Scene scene;
        for (int i = 0; i < 3; ++i) (void)scene.createNode(group);  // 2, 3, 4
        scene.newFrame(0);
        const std::size_t before = scene.nodeCount();
        const bool good = scene.apply(setAfter(scene, changes)).has_value();
        if (good) {
            EXPECT_EQ(scene.nodeCount(), before + changes.size());
            EXPECT_EQ(scene.hash(), hashAnew(scene));
        }
        return good;
    };
    EXPECT_TRUE(applied({creationOf(5, group), creationOf(6, group), creationOf(9, group)}));
    EXPECT_TRUE(applied({creationOf(9, group), creationOf(7, group), creationOf(10, group)})) << "out of order";
    EXPECT_FALSE(applied({creationOf(5, group), creationOf(6, group), creationOf(6, group)})) << "twice";
    EXPECT_FALSE(applied({creationOf(5, group), creationOf(3, group), creationOf(6, group)})) << "it is there";
    EXPECT_FALSE(applied({creationOf(5, group), creationOf(0, group)})) << "no number";
    EXPECT_FALSE(applied({creationOf(5, group), creationOf(6, none)})) << "no type";
    EXPECT_FALSE(applied({creationOf(5, group), creationOf(0xFFFFFFFF, group)})) << "too far ahead";
}

}  // namespace
}  // namespace rtsg
