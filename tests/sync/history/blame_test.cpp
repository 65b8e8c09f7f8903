// The authors of changes to a field, from logs of both modes.
#include <algorithm>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/world.h>
#include <rtsg/sync/blame.h>
#include <rtsg/sync/log.h>

#include "log/cause.h"
#include "support/simple_space.h"
#include "support/temp_folder.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

constexpr const char* kBlamed = R"(#X3D V4.0 utf8
PROFILE Immersive
DEF FLAG BooleanFilter {}
DEF SWITCH BooleanToggle {}
DEF BOX Transform {}
DEF FOLLOWER Transform {}
ROUTE FLAG.inputTrue TO SWITCH.set_boolean
ROUTE BOX.translation_changed TO FOLLOWER.translation
)";

struct Logged {
    Scene scene;
    std::unique_ptr<LogWriter> writer;
    Attachment attachment;
    std::string file;
    double time = 0;

    Logged(const test::TempFolder& folder, Mode mode, const char* text = kBlamed) : file(folder / "blamed.rlog") {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        scene.setInputRecording(mode == Mode::input);
        scene.newFrame(0);
        LogOptions options;
        options.mode.mode = mode;
        writer = *LogWriter::create(file, builtinTypes(), options);
        attachment = scene.bus().attach(*writer, Delivery::immediate);
    }
    void event(const char* node, const char* field, Value value, const char* author = "") {
        const NodeId id = scene.findName(node);
        EXPECT_TRUE(scene.sendEvent(id, scene.node(id).type().find(field), std::move(value), author));
    }
    void edit(const char* node, const char* field, Value value, const char* author = "") {
        const NodeId id = scene.findName(node);
        const FieldIndex index = scene.node(id).type().find(field);
        EXPECT_TRUE(scene.setField(id, index, std::move(value)));
        if (*author) scene.attribute(author, id, index);
    }
    void frame() { scene.newFrame(time += 1); }
    std::vector<FieldStep> blamed(const char* path) {
        attachment = {};
        EXPECT_TRUE(writer->close());
        auto steps = blame(file, path);
        EXPECT_TRUE(steps) << steps.error().text;
        return steps.value_or(std::vector<FieldStep>());
    }
};

TEST(Blame, NamesAuthorsAndTheRoutesOnTheWay) {
    const test::TempFolder folder;
    Logged log(folder, Mode::state);
    log.event("BOX", "set_translation", Vec3f(1, 0, 0), "ann");
    log.frame();
    log.edit("FOLLOWER", "translation", Vec3f(5, 0, 0), "bob");
    log.frame();
    log.event("BOX", "set_translation", Vec3f(2, 0, 0));
    log.frame();
    log.frame();
    const std::vector<FieldStep> steps = log.blamed("FOLLOWER.translation");
    ASSERT_EQ(steps.size(), 4u);
    EXPECT_EQ(steps[0].value, "0 0 0");
    EXPECT_EQ(steps[0].author, "");
    EXPECT_EQ(steps[1].author, "ann");
    EXPECT_EQ(steps[1].cause, "set from outside, then ROUTE BOX.translation > FOLLOWER.translation");
    EXPECT_EQ(steps[1].time, 1);
    EXPECT_EQ(steps[2].author, "bob");
    EXPECT_EQ(steps[2].cause, "set from outside");
    EXPECT_EQ(steps[2].value, "5 0 0");
    EXPECT_EQ(steps[3].author, "") << "the application's own";
    EXPECT_EQ(steps[3].cause, "set from outside, then ROUTE BOX.translation > FOLLOWER.translation");
}

TEST(Blame, FollowsThroughNodesThatMakeAnotherFieldOfIt) {
    const test::TempFolder folder;
    Logged log(folder, Mode::state);
    log.event("FLAG", "set_boolean", Value(true), "ann");
    log.frame();
    EXPECT_EQ(fieldText(log.scene, "SWITCH.toggle").value_or(""), "TRUE");
    const std::vector<FieldStep> steps = log.blamed("SWITCH.toggle");
    ASSERT_EQ(steps.size(), 2u);
    EXPECT_EQ(steps[1].author, "ann");
    EXPECT_THAT(steps[1].cause, HasSubstr("FLAG.inputTrue > SWITCH.set_boolean"));
}

/// A Transform makes nothing of what comes in: that another of its fields was sent something in the same frame is
/// chance.
TEST(Blame, DoesNotTakeChanceForCause) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kBlamed, diagnostics));
    const NodeId box = scene.findName("BOX"), follower = scene.findName("FOLLOWER");
    ChangeSet set;
    for (const auto& [node, field] : {std::pair{box, x3d::Transform::translation.index},
                                      {follower, x3d::Transform::translation.index},
                                      {follower, x3d::Transform::scale.index}}) {
        Change& change = set.changes.emplace_back();
        change.node = node;
        change.field = field;
        change.external = node == box;
        change.value = Vec3f(2);
    }
    FrameTouches touched;
    touched.add(set);
    EXPECT_THAT(touched.cause(scene, follower, x3d::Transform::translation.index).text, HasSubstr("then ROUTE"));
    EXPECT_EQ(touched.cause(scene, follower, x3d::Transform::scale.index).text, "");
}

TEST(Blame, OfALogOfInputsKnowsWhatCameIn) {
    const test::TempFolder folder;
    Logged log(folder, Mode::input);
    log.event("BOX", "set_translation", Vec3f(1, 0, 0), "ann");
    log.frame();
    log.event("BOX", "set_translation", Vec3f(2, 0, 0));
    log.frame();
    log.edit("BOX", "translation", Vec3f(3, 0, 0), "bob");
    log.frame();
    const std::vector<FieldStep> steps = log.blamed("BOX.translation");
    ASSERT_EQ(steps.size(), 4u);
    for (std::size_t i = 1; i < 4; ++i) EXPECT_EQ(steps[i].cause, "set from outside") << i;
    EXPECT_EQ(steps[1].author, "ann");
    EXPECT_EQ(steps[2].author, "");
    EXPECT_EQ(steps[3].author, "bob");
}

/// From the touch to what a clock moves frames later; a clock that nobody set off is nobody's.
TEST(Blame, LeadsThroughSensorsAndClocksToWhoSetThemOff) {
    const test::TempFolder folder;
    Logged log(folder, Mode::state, R"(#X3D V4.0 utf8
PROFILE Immersive
DEF T Transform { children [ DEF TS TouchSensor { } Shape { geometry Box { } } ] }
DEF LOOP TimeSensor { loop TRUE } DEF TURN OrientationInterpolator { key [0 1] keyValue [0 1 0 0, 0 1 0 1] }
DEF SPIN TimeSensor { cycleInterval 8 startTime -100 } DEF OI OrientationInterpolator { key [0 1] keyValue [0 1 0 0, 0 1 0 1] }
DEF FREE Transform { }
ROUTE TS.touchTime TO SPIN.startTime
ROUTE SPIN.fraction_changed TO OI.set_fraction
ROUTE OI.value_changed TO T.rotation
ROUTE LOOP.fraction_changed TO TURN.set_fraction
ROUTE TURN.value_changed TO FREE.rotation
)");
    test::SimpleSpace space(log.scene);
    log.scene.setSpaceQueries(&space);
    const auto point = [&](bool down) {
        PointerInput input;
        input.origin = {0, 0, 9};
        input.buttons = down ? PointerInput::kPrimary : 0;
        ASSERT_TRUE(log.scene.sendEvent(log.scene.root(), x3d::RtsgScene::pointer.index, input.toValue(), "ann"));
        log.frame();
    };
    point(false);
    point(true);
    point(false);
    const std::uint64_t touched = log.scene.sequence();
    log.frame();
    log.frame();
    const std::vector<FieldStep> steps = log.blamed("T.rotation");
    ASSERT_GE(steps.size(), 3u);
    for (std::size_t i = 1; i < steps.size(); ++i) EXPECT_EQ(steps[i].author, "ann") << steps[i].cause;
    EXPECT_THAT(steps[1].cause, testing::StartsWith("from a pointer, then ROUTE TS.touchTime > SPIN.startTime"));
    EXPECT_THAT(steps.back().cause, HasSubstr(fmt::format("in state {}, then ROUTE SPIN.fraction", touched)));
    const auto over = blame(log.file, "TS.isOver");
    ASSERT_TRUE(over);
    EXPECT_EQ(over->back().author, "ann");
    EXPECT_EQ(over->back().cause, "from a pointer");
    const auto free = blame(log.file, "FREE.rotation");
    ASSERT_TRUE(free);
    EXPECT_EQ(free->back().author, "");
    EXPECT_THAT(free->back().cause, testing::StartsWith("ROUTE LOOP.fraction"));
}

/// Input of a device is a cause for nodes that listen to that device, and for no others.
TEST(Blame, NodesThatHearOfADeviceHaveItAsTheirCause) {
    Scene scene;
    using Root = x3d::RtsgScene;
    const auto causeOf = [&](TypeIndex type, const char* field, FieldIndex device) {
        const NodeId node = scene.createNode(type);
        ChangeSet set;
        for (const auto& [id, index, external] :
             {std::tuple{scene.root(), device, true}, {node, scene.node(node).type().find(field), false}}) {
            Change& change = set.changes.emplace_back();
            change.node = id;
            change.field = index;
            change.external = external;
        }
        FrameTouches touched;
        touched.add(set);
        return touched.cause(scene, node, scene.node(node).type().find(field)).text;
    };
    EXPECT_EQ(causeOf(x3d::EspduTransform::type, "translation", Root::heard.index), "from DIS");
    EXPECT_EQ(causeOf(x3d::KeySensor::type, "isActive", Root::key.index), "from a key");
    EXPECT_EQ(causeOf(x3d::StringSensor::type, "enteredText", Root::text.index), "from a key");
    EXPECT_EQ(causeOf(x3d::GeoTouchSensor::type, "isOver", Root::pointer.index), "from a pointer");
    EXPECT_EQ(causeOf(x3d::ProximitySensor::type, "isActive", Root::navigate.index), "from the viewer");
    EXPECT_EQ(causeOf(x3d::PrimitivePickSensor::type, "isActive", Root::picked.index), "from picking");
    EXPECT_EQ(causeOf(x3d::CollisionSensor::type, "isActive", Root::contact.index), "from a contact");
    EXPECT_EQ(causeOf(x3d::TouchSensor::type, "isOver", Root::key.index), "");
    EXPECT_EQ(causeOf(x3d::Transform::type, "translation", Root::pointer.index), "");
}

/// The origin names who made a node, or brought it back, at the node itself, whatever fields it has.
TEST(Blame, NamesWhoMadeANodeForAllOfItsFields) {
    const test::TempFolder folder;
    Logged log(folder, Mode::state);
    log.frame();
    const NodeId created = log.scene.createNode(x3d::Transform::type);
    ASSERT_TRUE(log.scene.set(created, x3d::Transform::translation, Vec3f(5)));
    ASSERT_TRUE(log.scene.setName(created, "NEW"));
    log.scene.attribute("ann", created);
    // The same frame, another's: of that field alone.
    ASSERT_TRUE(log.scene.set(created, x3d::Transform::center, Vec3f(1)));
    log.scene.attribute("bob", created, x3d::Transform::center.index);
    log.frame();
    log.edit("NEW", "translation", Vec3f(6));
    log.scene.attribute("bob", created);  // a name, say
    log.frame();
    const std::vector<FieldStep> steps = log.blamed("NEW.translation");
    ASSERT_EQ(steps.size(), 2u);
    EXPECT_EQ(steps[0].author, "ann");
    EXPECT_EQ(steps[0].cause, "set from outside");
    EXPECT_EQ(steps[1].author, "") << "who changed the node's name did not move it";
    const auto untouched = blame(log.file, "NEW.scale");
    ASSERT_TRUE(untouched);
    ASSERT_EQ(untouched->size(), 1u);
    EXPECT_EQ(untouched->front().author, "ann") << "left at its default";
    EXPECT_EQ(untouched->front().cause, "set from outside");
    const auto others = blame(log.file, "NEW.center");
    ASSERT_TRUE(others);
    EXPECT_EQ(others->front().author, "bob");
}

TEST(Blame, TellsWhatCameIntoThePartFromWhatWasSet) {
    // A viewpoint walks there and back: FOURTH is one of those that go out of its region and come back.
    const auto steps = blame(RTSG_SOURCE_DIR "/tests/sync/conformance/region.rlog", "FOURTH.translation");
    ASSERT_TRUE(steps) << steps.error().text;
    ASSERT_GT(steps->size(), 2u);
    const auto came = std::ranges::count(*steps, "came into the part", &FieldStep::cause);
    EXPECT_EQ(came, 2);
    EXPECT_GT(std::ranges::count(*steps, "set from outside", &FieldStep::cause), 0) << "while it was in";

    // Where no node shows that the log is of a part, a node that appears has been made.
    const test::TempFolder folder;
    Logged log(folder, Mode::state);
    log.frame();
    ASSERT_TRUE(log.scene.setName(log.scene.createNode(x3d::Transform::type), "NEW"));
    log.frame();
    const std::vector<FieldStep> created = log.blamed("NEW.scale");
    ASSERT_EQ(created.size(), 1u);
    EXPECT_EQ(created[0].cause, "came into the scene");
}

TEST(Blame, WhatThereIsNotIsAnError) {
    const test::TempFolder folder;
    Logged log(folder, Mode::state);
    log.frame();
    log.attachment = {};
    ASSERT_TRUE(log.writer->close());
    EXPECT_THAT(blame(log.file, "BOX.nothing").error().text, HasSubstr("nothing"));
    EXPECT_THAT(blame(log.file, "NOBODY.translation").error().text, HasSubstr("NOBODY"));
    EXPECT_FALSE(blame(folder / "none.rlog", "BOX.translation"));
    std::size_t reported = 0;
    EXPECT_TRUE(blame(log.file, "BOX.translation", [&](std::uint64_t, std::uint64_t) { return ++reported, false; }));
    EXPECT_EQ(reported, 1u) << "whoever asks may end it";
}

}  // namespace
}  // namespace rtsg
