// Input mode over bytes: equal hashes, damage noticed and repaired, nothing trusted, few bytes.
#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/replay.h>

#include "input_wire.h"
#include "sync/input_support.h"

namespace rtsg {
namespace {

using namespace test;

class InputWireLaw : public testing::TestWithParam<std::uint64_t> {};

TEST_P(InputWireLaw, SameHashEveryFrame) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    for (const bool meddling : {false, true}) {
        Scene origin, copy;
        origin.setInputRecording(true);
        copy.registerBehaviour(x3d::Material::type, steady());
        InputWire wire(copy);
        std::string problem;
        live(origin, GetParam(), 80, true, meddling, [&](const ChangeSet& set) {
            if (problem.empty()) problem = wire.take(set);
        });
        EXPECT_EQ(problem, "");
        EXPECT_EQ(copy.dump(), origin.dump());
        EXPECT_GT(wire.inputFrames, 40u);
        EXPECT_EQ(wire.replica.statistics().run, wire.inputFrames);
    }
}

TEST_P(InputWireLaw, ADivergenceIsNoticedInItsFrameAndASnapshotRepairsIt) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene origin, copy;
    origin.setInputRecording(true);
    copy.registerBehaviour(x3d::Material::type, steady());
    InputWire wire(copy);
    std::mt19937_64 random(GetParam() ^ 0xD1FF);
    std::size_t spoilt = 0, repaired = 0;
    live(origin, GetParam(), 80, true, false, [&](const ChangeSet& set) {
        if (!wire.replica.exact() && wire.stateFrames) {
            EXPECT_NE(wire.take(set), "");  // no input is taken any more
            EXPECT_EQ(wire.take(origin.snapshot()), "");
            EXPECT_TRUE(wire.replica.exact());
            ++repaired;
        } else if (random() % 10 == 0 && wire.stateFrames) {
            // Somebody writes to the replica behind the stream's back.
            (void)copy.set(copy.createNode(x3d::Group::type), x3d::Group::visible, false);
            copy.seal();
            EXPECT_NE(wire.take(set), "");
            EXPECT_FALSE(wire.replica.exact());
            ++spoilt;
            return;
        } else {
            EXPECT_EQ(wire.take(set), "");
        }
        EXPECT_EQ(copy.hash(), origin.hash());
    });
    EXPECT_GE(spoilt, 1u);
    EXPECT_GE(repaired + 1, spoilt);
}

/// Bytes from anywhere: an error or another hash, never a crash.
TEST_P(InputWireLaw, ForgedRecordsAreRefusedOrNoticed) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene origin, copy;
    origin.setInputRecording(true);
    copy.registerBehaviour(x3d::Material::type, steady());
    InputWire wire(copy);
    std::mt19937_64 random(GetParam() ^ 0xF02);
    std::size_t noticed = 0;
    live(origin, GetParam(), 60, true, true, [&](const ChangeSet& set) {
        if (needsState(set) || random() % 3) {
            if (!wire.take(needsState(set) && !set.isSnapshot() ? origin.snapshot() : set).empty())
                (void)wire.take(origin.snapshot());
            return;
        }
        wire.inputs.encode(set, wire.record);
        ByteBuffer forged;
        forged.append(wire.record.bytes());
        const std::size_t payload = forged.size() - kRecordHeaderSize;
        if (payload > 0)
            for (std::size_t i = 1 + random() % 3; i > 0; --i)
                forged.data()[kRecordHeaderSize + random() % payload] = static_cast<std::byte>(random());
        const RecordHeader header = *parseRecordHeader(wire.record.bytes());
        sealRecord(forged, header);
        wire.record.swap(forged);
        if (!wire.deliver().empty()) {
            ++noticed;
            EXPECT_EQ(wire.take(origin.snapshot()), "");
        }
        EXPECT_EQ(copy.hash(), origin.hash());
    });
}

INSTANTIATE_TEST_SUITE_P(Seeds, InputWireLaw, testing::Range<std::uint64_t>(1, 31));

TEST(InputWire, ReplicasNeedTheSameDeterministicBehaviours) {
    Scene origin, bare, extra;
    origin.setInputRecording(true);
    origin.registerBehaviour(x3d::Material::type, steady());
    origin.createNode(x3d::Material::type);
    const auto first = origin.newFrame(0);
    InputWire wire(bare);
    EXPECT_NE(wire.take(*first).find("Material is not registered here"), std::string::npos);
    extra.registerBehaviour(x3d::Material::type, steady());
    extra.registerBehaviour(x3d::Box::type, steady());
    InputWire second(extra);
    EXPECT_EQ(second.take(*first), "");  // what the origin has not does nothing here
    const NodeId box = origin.createNode(x3d::Box::type);
    ASSERT_TRUE(origin.sendEvent(box, x3d::Box::metadata.index, Value(NodeId{})));
    EXPECT_EQ(second.take(*origin.newFrame(1)), "");
    origin.registerBehaviour(x3d::Box::type, steady());
    EXPECT_EQ(second.take(*origin.newFrame(2)), "");
}

TEST(InputWire, ForgedCallsDoNotNestWithoutEnd) {
    Scene scene;
    const NodeId light = scene.createNode(x3d::PointLight::type);
    scene.newFrame(0);
    FrameInput input;
    input.ran = true;
    input.behaviours.push_back({.type = x3d::PointLight::type, .onEvent = true});
    Change event;
    event.kind = ChangeKind::event;
    event.node = light;
    event.field = x3d::PointLight::intensity.index;
    event.value = Value(2.0f);
    input.events.push_back(event);
    BehaviourCall call;  // each delivers the event that is answered by the next
    call.node = light;
    call.field = event.field;
    call.effects.push_back({BehaviourEffect::Kind::deliver, light, event.field, event.value});
    input.calls.assign(200'000, call);
    const auto done = scene.runInput(input, 1);
    ASSERT_TRUE(done) << done.error().text;
    ASSERT_FALSE(scene.diagnostics().all().empty());
    EXPECT_NE(scene.diagnostics().all().back().text.find("too deeply"), std::string::npos);
}

TEST(InputWire, BehavioursOfOwnTypesAreFoundByName) {
    const auto type = [] {
        auto created = std::make_shared<NodeType>();
        created->name = "Doubler";
        created->kind = NodeType::Kind::user;
        FieldDef in, out;
        in.name = "number";
        in.type = out.type = FieldType::SFFloat;
        in.access = Access::inputOutput;
        out.name = "doubled";
        out.access = Access::outputOnly;
        in.defaultValue = out.defaultValue = Value(0.0f);
        created->fields = {in, out};
        EXPECT_TRUE(created->finish());
        return created;
    };
    const Behaviour doubling{
        .onEvent = [](Cascade& cascade, const Node& node, FieldIndex,
                      EventValue) { cascade.emit(node, Field<float>{1}, node.get(Field<float>{0}) * 2); },
        .deterministic = true};
    Scene origin, copy;
    origin.setInputRecording(true);
    InputWire wire(copy);
    EXPECT_EQ(wire.take(*origin.newFrame(0)), "");
    origin.registerBehaviour("Doubler", doubling);
    copy.registerBehaviour("Doubler", doubling);
    const NodeId node = origin.createNode(*origin.defineType(type()));
    EXPECT_EQ(wire.take(*origin.newFrame(1)), "");
    ASSERT_TRUE(origin.sendEvent(node, 0, Value(21.0f)));
    EXPECT_EQ(wire.take(*origin.newFrame(2)), "");
    EXPECT_EQ(copy.node(node).get(Field<float>{1}), 42.0f);
}

/// Figures whose joints follow interpolators: all of it derives from the clock.
std::string troop(int figures, int joints) {
    std::string text;
    for (int f = 0; f < figures; ++f) {
        text += "DEF T" + std::to_string(f) + " TimeSensor { loop TRUE cycleInterval " + std::to_string(1 + f * .01) +
                " }\n";
        for (int j = 0; j < joints; ++j) {
            const std::string id = std::to_string(f) + "_" + std::to_string(j);
            text +=
                "DEF I" + id + " OrientationInterpolator { key [ 0 .5 1 ] keyValue [ 1 0 0 0, 1 0 0 1, 1 0 0 0 ] }\n";
            text += "DEF J" + id + " Transform { }\n";
            text += "ROUTE T" + std::to_string(f) + ".fraction_changed TO I" + id + ".set_fraction\n";
            text += "ROUTE I" + id + ".value_changed TO J" + id + ".rotation\n";
        }
    }
    return text;
}

/// Like a collection of rigid bodies beside a script: the last one is also last when its calls are played back, though
/// its number is lower.
TEST(InputWire, WhoComesLastDoesSoWhereItsCallsArePlayedBack) {
    Scene origin, copy;
    origin.setInputRecording(true);
    const auto mover = [](bool last) {
        Behaviour behaviour;
        behaviour.deterministic = false;
        behaviour.last = last;
        behaviour.onTime = [](Cascade& cascade, const Node& node) {
            cascade.store(node, Field<float>{node.type().findExact("cycle")}, static_cast<float>(cascade.now()));
            return cascade.now();
        };
        return behaviour;
    };
    std::vector<TypeIndex> types;
    for (const bool last : {true, false}) {
        auto type = std::make_shared<NodeType>();
        type->name = last ? "Last" : "First";
        type->kind = NodeType::Kind::user;
        FieldDef def;
        def.name = "cycle";
        def.type = FieldType::SFFloat;
        def.defaultValue = Value(0.0f);
        type->fields.push_back(def);
        ASSERT_TRUE(type->finish());
        const auto index = origin.defineType(type);
        ASSERT_TRUE(index);
        origin.registerBehaviour(*index, mover(last));
        types.push_back(*index);
    }
    for (const TypeIndex type : types) ASSERT_TRUE(origin.createNode(type));
    InputWire wire(copy);
    for (int frame = 0; frame < 4; ++frame) {
        ASSERT_EQ(wire.take(*origin.newFrame(frame)), "");
        ASSERT_EQ(copy.hash(), origin.hash()) << frame;
    }
    for (const Diagnostic& one : copy.diagnostics().all()) ADD_FAILURE() << one.text;
}

TEST(InputWire, WhatDerivesFromTheClockCostsATenthOfAByte) {
    Scene origin, copy;
    origin.setInputRecording(true);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(origin, "#X3D V4.0 utf8\n" + troop(48, 16), diagnostics));
    InputWire wire(copy);
    ASSERT_EQ(wire.take(*origin.newFrame(0)), "");
    ASSERT_EQ(wire.take(*origin.newFrame(.016)), "");
    const std::size_t before = wire.bytes;
    std::size_t transforms = 0;
    for (int frame = 2; frame < 62; ++frame) {
        const auto set = origin.newFrame(frame * .016);
        for (const Change& change : set->changes)
            transforms += change.kind == ChangeKind::setField && change.field == x3d::Transform::rotation.index &&
                          origin.node(change.node).is(x3d::Transform::type);
        ASSERT_EQ(wire.take(*set), "");
    }
    EXPECT_EQ(transforms, 60u * 48 * 16);
    EXPECT_LE(static_cast<double>(wire.bytes - before) / static_cast<double>(transforms), .1);
}

}  // namespace
}  // namespace rtsg
