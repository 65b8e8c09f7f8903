// Sets that give anew what the last one gave, applied without being made: the same state as by apply(), or nothing
// done.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include <rtsg/core/hash_terms.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg {
namespace {

/// The changes of a set, column by column: those of one field and type that follow one another.
struct Columns {
    std::vector<std::vector<std::byte>> bytes;
    std::vector<PlainColumn> columns;
    explicit Columns(const std::vector<Change>& changes) {
        for (const Change& change : changes) {
            const bool goesOn =
                !columns.empty() && columns.back().field == change.field && columns.back().type == change.value.type();
            if (!goesOn) {
                columns.push_back({change.field, change.value.type(), 0, nullptr});
                bytes.emplace_back();
            }
            ++columns.back().count;
            const auto* const value = static_cast<const std::byte*>(change.value.storage());
            bytes.back().insert(bytes.back().end(), value, value + info(change.value.type()).size);
        }
        for (std::size_t i = 0; i < columns.size(); ++i) columns[i].values = bytes[i].data();
    }
};

/// A scene with nodes of several types, and a replica of it that nobody follows.
struct ApplyAgain : testing::Test {
    Scene origin, replica;
    std::vector<NodeId> transforms, sensors, materials;
    std::mt19937 random{11};

    /// From the values that are stored.
    static Hash128 hashAnew(const Scene& scene) {
        Hash128 sum;
        scene.forEachNode([&](const Node& node) { sum = sum + hashOfNode(scene, node); });
        return sum;
    }
    static Change changeTo(NodeId node, FieldIndex field, Value value) {
        Change change;
        change.node = node;
        change.field = field;
        change.value = std::move(value);
        return change;
    }

    ApplyAgain() {
        for (int i = 0; i < 90; ++i) transforms.push_back(origin.createNode(x3d::Transform::type));
        for (int i = 0; i < 40; ++i) sensors.push_back(origin.createNode(x3d::TimeSensor::type));
        for (int i = 0; i < 40; ++i) materials.push_back(origin.createNode(x3d::Material::type));
        origin.newFrame(0);
        replica.setBehavioursEnabled(false);
        EXPECT_TRUE(replica.apply(std::make_shared<ChangeSet>(origin.snapshot())));
    }
    float number() {
        const std::uint32_t one = random() % 9;
        return one == 8 ? std::nanf("") : one == 7 ? -0.f : static_cast<float>(one);  // 0 and 1, defaults, among them
    }
    std::vector<Change> values() {
        std::vector<Change> changes;
        for (const NodeId id : sensors) changes.push_back(changeTo(id, x3d::TimeSensor::loop.index, random() % 2 == 0));
        for (const NodeId id : sensors)
            changes.push_back(changeTo(id, x3d::TimeSensor::cycleInterval.index, Time{double(number())}));
        for (const NodeId id : materials) changes.push_back(changeTo(id, x3d::Material::transparency.index, number()));
        for (const NodeId id : transforms)
            changes.push_back(changeTo(id, x3d::Transform::translation.index, Vec3f(number(), number(), 0)));
        for (const NodeId id : transforms)
            changes.push_back(changeTo(id, x3d::Transform::rotation.index, Rotation{0, 0, 1, number()}));
        return changes;
    }
    /// By the origin, and as a set.
    std::shared_ptr<ChangeSet> setOf(std::vector<Change> changes) {
        auto set = std::make_shared<ChangeSet>();
        set->from = origin.sequence();
        set->to = set->from + 1;
        set->time = origin.now() + 1;
        set->changes = std::move(changes);
        EXPECT_TRUE(origin.apply(set));
        return set;
    }
    bool again(const ChangeSet& set) { return replica.applyAgain(set.to, set.time, Columns(set.changes).columns); }
    void expectEqual() const {
        EXPECT_EQ(replica.sequence(), origin.sequence());
        EXPECT_EQ(replica.now(), origin.now());
        EXPECT_EQ(replica.hash(), origin.hash());
        EXPECT_EQ(replica.hash(), hashAnew(replica));
        EXPECT_EQ(replica.dump(), origin.dump());
    }
    /// Refused, with nothing done.
    void expectRefused(const std::vector<Change>& changes, const char* why) {
        const std::string before = replica.dump();
        const Hash128 hash = replica.hash();
        const std::uint64_t sequence = replica.sequence();
        EXPECT_FALSE(replica.applyAgain(sequence + 1, replica.now(), Columns(changes).columns)) << why;
        EXPECT_EQ(replica.dump(), before) << why;
        EXPECT_EQ(replica.hash(), hash) << why;
        EXPECT_EQ(replica.sequence(), sequence) << why;
    }
};

TEST_F(ApplyAgain, LeadsToTheStateThatTheSetLeadsTo) {
    for (int round = 0; round < 6; ++round) {
        ASSERT_TRUE(replica.apply(setOf(values())));
        for (int i = 0; i < 5; ++i) {
            ASSERT_TRUE(again(*setOf(values()))) << round << ", " << i;
            expectEqual();
        }
        // Other fields, some of them the same, and then the first ones again.
        std::vector<Change> other;
        for (std::size_t i = 0; i < transforms.size(); i += 2)
            other.push_back(changeTo(transforms[i], x3d::Transform::translation.index, Vec3f(number(), 2, 3)));
        other.push_back(changeTo(origin.root(), x3d::RtsgScene::children.index,
                                 Array<NodeId>{transforms[static_cast<std::size_t>(round)]}));
        ASSERT_TRUE(replica.apply(setOf(other)));
        expectEqual();
    }
}

TEST_F(ApplyAgain, EditsOfItsOwnAndNodesThatGoAreSeen) {
    for (int round = 0; round < 3; ++round) {
        ASSERT_TRUE(replica.apply(setOf(values())));
        ASSERT_TRUE(again(*setOf(values())));
        // Fields that were just written, of a node that stays and of one that goes.
        for (Scene* scene : {&origin, &replica}) {
            ASSERT_TRUE(scene->set(transforms[3], x3d::Transform::translation, Vec3f(7, 8, float(round))));
            ASSERT_TRUE(scene->destroyNode(sensors.back()));
        }
        expectRefused(values(), "edits that are not sealed");
        for (Scene* scene : {&origin, &replica}) scene->seal();
        expectEqual();
        expectRefused(values(), "a set of its own in between");
        sensors.pop_back();
    }
}

TEST_F(ApplyAgain, OtherColumnsThanTheLastSetsAreRefused) {
    ASSERT_TRUE(replica.apply(setOf(values())));
    for (int pass = 0; pass < 2; ++pass) {  // by the entries of the last set, and by what was found then
        std::vector<Change> fewer = values(), more = values(), moved = values(), typed = values();
        fewer.pop_back();
        more.push_back(more.back());
        std::swap(moved.front(), moved.back());
        typed.back().value = Vec4f(0, 0, 1, 2);
        expectRefused(fewer, "a value less");
        expectRefused(more, "a value more");
        expectRefused(moved, "columns of other lengths");
        expectRefused(typed, "another type");
        expectRefused({}, "nothing");
        ASSERT_TRUE(again(*setOf(values())));
        expectEqual();
    }
    const std::vector<Change> all = values();
    EXPECT_FALSE(replica.applyAgain(replica.sequence(), 9, Columns(all).columns)) << "to the state it is in";
    EXPECT_EQ(replica.now(), origin.now());
}

TEST_F(ApplyAgain, NamingAFieldTwiceOrRepairingIsNothingToGoOnFrom) {
    std::vector<Change> twice = values();
    twice[1] = twice[0];
    ASSERT_TRUE(replica.apply(setOf(twice)));
    expectRefused(twice, "a field that is named twice");
    ASSERT_TRUE(replica.apply(setOf(values())));
    const auto repair = std::make_shared<ChangeSet>();
    repair->from = repair->to = replica.sequence();
    repair->time = replica.now();
    repair->changes = values();
    ASSERT_TRUE(replica.apply(repair));
    expectRefused(values(), "a repair");
    ASSERT_TRUE(replica.apply(setOf(values())));
    ASSERT_TRUE(again(*setOf(values())));
    expectEqual();
}

TEST_F(ApplyAgain, WhoFollowsGetsASet) {
    struct Counter : Subscriber {
        std::size_t changes = 0;
        Result<> apply(const Scene&, const ChangeSet& set) override {
            changes = set.changes.size();
            return {};
        }
    } counter;
    ASSERT_TRUE(replica.apply(setOf(values())));
    ASSERT_TRUE(again(*setOf(values())));
    Attachment attachment = replica.bus().attach(counter);
    expectRefused(values(), "a subscriber");
    const auto next = setOf(values());
    ASSERT_TRUE(replica.apply(next));
    EXPECT_EQ(counter.changes, next->changes.size());
    expectRefused(values(), "a subscriber");
    attachment.detach();
    ASSERT_TRUE(again(*setOf(values())));
    expectEqual();
}

TEST_F(ApplyAgain, WhereNodesActOrInputsAreRecordedSetsAreMade) {
    ASSERT_TRUE(replica.apply(setOf(values())));
    replica.setBehavioursEnabled(true);
    expectRefused(values(), "behaviours");
    replica.setBehavioursEnabled(false);
    replica.setInputRecording(true);
    expectRefused(values(), "recording");
    replica.setInputRecording(false);
    ASSERT_TRUE(again(*setOf(values())));
    ASSERT_TRUE(replica.reset());
    expectRefused(values(), "a scene that started over");
    ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(origin.snapshot())));
    expectEqual();
}

}  // namespace
}  // namespace rtsg
