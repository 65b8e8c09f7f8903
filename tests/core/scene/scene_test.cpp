// The promises of the headers of scenes, sets and behaviours, one by one: edits, order within a set, frames, threads.
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <set>
#include <thread>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/change_composer.h>
#include <rtsg/core/device_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>

#include "support/random_edits.h"

namespace rtsg {
namespace {

using test::RandomEdits;

constexpr FieldIndex kTranslation = x3d::Transform::translation.index;

// ---- edits ---------------------------------------------------------------------------------------------------------

TEST(SceneEdits, WhatIsDestroyedLeavesNoReferenceAndItsChildrenStay) {
    Scene scene;
    const NodeId above = scene.createNode(x3d::Group::type), gone = scene.createNode(x3d::Transform::type),
                 child = scene.createNode(x3d::Transform::type);
    ASSERT_TRUE(scene.insertChild(above, x3d::Group::children, gone));
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, gone));
    ASSERT_TRUE(scene.insertChild(gone, x3d::Transform::children, child));
    ASSERT_TRUE(scene.addRoute(child, kTranslation, gone, kTranslation));
    ASSERT_TRUE(scene.addRoute(gone, kTranslation, child, kTranslation));
    ASSERT_TRUE(scene.setName(gone, "GONE"));
    ASSERT_TRUE(scene.destroyNode(gone));
    EXPECT_FALSE(scene.find(gone));
    EXPECT_FALSE(scene.findName("GONE"));
    EXPECT_TRUE(scene.node(above).get(x3d::Group::children).empty());
    EXPECT_TRUE(scene.node(scene.root()).get(x3d::RtsgScene::children).empty());
    ASSERT_TRUE(scene.find(child));
    EXPECT_TRUE(scene.parents(child).empty());
    EXPECT_TRUE(scene.routesFrom(child).empty());
    EXPECT_TRUE(scene.routesTo(child).empty());
    EXPECT_EQ(scene.routeCount(), 0U);
    EXPECT_FALSE(scene.destroyNode(gone));
    EXPECT_FALSE(scene.destroyNode(scene.root()));
    EXPECT_NE(scene.createNode(x3d::Group::type), gone) << "a number is given once";
}

TEST(SceneEdits, WhatRootNamesAndRoutesLeadToIsReachable) {
    Scene scene;
    const auto make = [&] { return scene.createNode(x3d::Transform::type); };
    const NodeId root = make(), named = make(), below = make(), from = make(), to = make(), alone = make(),
                 belowAlone = make();
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, root));
    ASSERT_TRUE(scene.setName(named, "N"));
    ASSERT_TRUE(scene.insertChild(named, x3d::Transform::children, below));
    ASSERT_TRUE(scene.addRoute(from, kTranslation, to, kTranslation));
    ASSERT_TRUE(scene.insertChild(alone, x3d::Transform::children, belowAlone));
    EXPECT_EQ(scene.destroyUnreachable(), 2U);
    for (const NodeId kept : {root, named, below, from, to}) EXPECT_TRUE(scene.find(kept)) << kept.value;
    EXPECT_FALSE(scene.find(alone) || scene.find(belowAlone));
    EXPECT_EQ(scene.destroyUnreachable(), 0U);
}

TEST(SceneEdits, RoutesAreBetweenEqualTypesOnceAndFoundFromBothEnds) {
    Scene scene;
    const NodeId a = scene.createNode(x3d::Transform::type), b = scene.createNode(x3d::Transform::type);
    ASSERT_TRUE(scene.addRoute(a, kTranslation, b, kTranslation));
    ASSERT_TRUE(scene.addRoute(a, kTranslation, b, kTranslation)) << "a second one is ignored";
    const std::vector<Route> only{{a, kTranslation, b, kTranslation}};
    EXPECT_EQ(scene.routesFrom(a), only);
    EXPECT_EQ(scene.routesTo(b), only);
    EXPECT_EQ(scene.routeCount(), 1U);
    EXPECT_EQ(scene.addRoute(a, kTranslation, b, x3d::Transform::rotation.index).error().code,
              DiagnosticCode("wrong-type"));
    EXPECT_EQ(scene.addRoute(a, x3d::Transform::bboxSize.index, b, kTranslation).error().code,
              DiagnosticCode("access"));
    ASSERT_TRUE(scene.removeRoute(a, kTranslation, b, kTranslation));
    EXPECT_FALSE(scene.removeRoute(a, kTranslation, b, kTranslation));
    EXPECT_TRUE(scene.routesTo(b).empty());
}

/// 4.4.2.2: as in a file, and as of events; what could not be loaded is taken on trust.
TEST(SceneEdits, TakeOnlyNodesOfTypesThatTheFieldHolds) {
    Scene scene;
    const NodeId group = scene.createNode(x3d::Group::type), shape = scene.createNode(x3d::Shape::type),
                 box = scene.createNode(x3d::Box::type);
    const Result<> inserted = scene.insertChild(group, x3d::Group::children, box);
    ASSERT_FALSE(inserted);
    EXPECT_EQ(inserted.error().text, "children does not take Box");
    EXPECT_FALSE(scene.set(shape, x3d::Shape::geometry, group));
    EXPECT_FALSE(scene.set(group, x3d::Group::children, Array<NodeId>{shape, box}));
    EXPECT_TRUE(scene.node(group).get(x3d::Group::children).empty()) << "not one of two";
    EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, box));
    EXPECT_TRUE(scene.insertChild(group, x3d::Group::children, shape));
    EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, NodeId{}));
}

TEST(SceneEdits, TakeEffectAtOnceAndSendNoEvents) {
    Scene scene;
    const NodeId a = scene.createNode(x3d::Transform::type), b = scene.createNode(x3d::Transform::type);
    ASSERT_TRUE(scene.addRoute(a, kTranslation, b, kTranslation));
    ASSERT_TRUE(scene.set(a, x3d::Transform::translation, Vec3f(1)));
    EXPECT_EQ(scene.node(a).get(x3d::Transform::translation), Vec3f(1));
    scene.newFrame(0);
    EXPECT_EQ(scene.node(b).get(x3d::Transform::translation), Vec3f(0));
}

TEST(SceneEdits, ASceneWithoutAnyHasNothingToSeal) {
    Scene scene;
    EXPECT_EQ(scene.seal(), nullptr);
    scene.createNode(x3d::Group::type);
    const auto set = scene.seal();
    ASSERT_TRUE(set);
    EXPECT_EQ(set->to, 1U);
    EXPECT_EQ(scene.seal(), nullptr);
    const auto frame = scene.newFrame(0);
    EXPECT_TRUE(frame->changes.empty());
    EXPECT_EQ(frame->to, 2U) << "a frame is a state, whatever it changed";
}

// ---- the order within a set ----------------------------------------------------------------------------------------

/// change.h: the part of a set that a kind of change belongs to.
int partOf(ChangeKind kind) {
    switch (kind) {
        case ChangeKind::defineType:
            return 0;
        case ChangeKind::createNode:
            return 1;
        case ChangeKind::setField:
        case ChangeKind::insertChild:
        case ChangeKind::removeChild:
            return 2;
        case ChangeKind::setName:
            return 3;
        case ChangeKind::removeRoute:
        case ChangeKind::addRoute:
            return 4;
        case ChangeKind::destroyNode:
            return 5;
        case ChangeKind::event:
            return 6;
    }
    return 7;
}

/// Looks at one set after another; knows which nodes there are.
class OrderOfSets {
  public:
    void check(const ChangeSet& set) {
        SCOPED_TRACE("set to " + std::to_string(set.to));
        int part = 0;
        std::set<std::pair<NodeId, FieldIndex>> fields;
        for (const Change& c : set.changes) {
            EXPECT_GE(partOf(c.kind), part) << "kind " << static_cast<int>(c.kind);
            part = std::max(part, partOf(c.kind));
            if (c.kind == ChangeKind::createNode) {
                EXPECT_TRUE(there_.insert(c.node).second) << c.node.value;
            }
            if (c.kind == ChangeKind::defineType) continue;
            EXPECT_TRUE(there_.contains(c.node)) << c.node.value;
            if (c.kind == ChangeKind::setField) {
                EXPECT_TRUE(fields.emplace(c.node, c.field).second) << "set twice";
                checkReferences(c.value);
            }
            if (c.kind == ChangeKind::insertChild || c.kind == ChangeKind::addRoute) {
                EXPECT_TRUE(there_.contains(c.other)) << c.other.value;
            }
            if (c.kind == ChangeKind::destroyNode) gone_.push_back(c.node);
        }
        for (const NodeId id : gone_) there_.erase(id);
        gone_.clear();
    }

  private:
    void checkReferences(const Value& value) {
        if (value.type() == FieldType::SFNode) {
            EXPECT_TRUE(!value.as<NodeId>() || there_.contains(value.as<NodeId>())) << value.as<NodeId>().value;
        } else if (value.type() == FieldType::MFNode) {
            for (const NodeId id : value.as<Array<NodeId>>()) EXPECT_TRUE(there_.contains(id)) << id.value;
        }
    }
    std::set<NodeId> there_{NodeId{1}};
    std::vector<NodeId> gone_;
};

class SetOrder : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SetOrder, IsTheOneStatedInEverySetSnapshotAndMerger) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene scene;
    RandomEdits edits(scene, GetParam());
    OrderOfSets each, merged;
    std::vector<std::shared_ptr<const ChangeSet>> some;
    std::size_t changes = 0;
    for (int frame = 0; frame < 80 && !HasFailure(); ++frame) {
        for (int i = 0; i < 15; ++i) edits.step();
        some.push_back(std::make_shared<const ChangeSet>(*scene.newFrame(frame)));
        changes += some.back()->changes.size();
        each.check(*some.back());
        OrderOfSets().check(scene.snapshot());
        if (some.size() < 7) continue;
        merged.check(compose(some));
        some.clear();
    }
    EXPECT_GT(changes, 500U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SetOrder, testing::Range<std::uint64_t>(1, 9));

// ---- frames and behaviours -----------------------------------------------------------------------------------------

TEST(SceneFrames, WithoutBehavioursEventsStillTravelAlongRoutes) {
    Scene scene;
    const NodeId a = scene.createNode(x3d::Transform::type), b = scene.createNode(x3d::Transform::type),
                 clock = scene.createNode(x3d::TimeSensor::type);
    ASSERT_TRUE(scene.set(clock, x3d::TimeSensor::loop, true));
    ASSERT_TRUE(scene.addRoute(a, kTranslation, b, kTranslation));
    scene.setBehavioursEnabled(false);
    ASSERT_TRUE(scene.sendEvent(a, kTranslation, Vec3f(3)));
    scene.newFrame(1);
    EXPECT_EQ(scene.node(b).get(x3d::Transform::translation), Vec3f(3));
    EXPECT_FALSE(scene.node(clock).get(x3d::TimeSensor::isActive));
    scene.setBehavioursEnabled(true);
    scene.newFrame(2);
    EXPECT_TRUE(scene.node(clock).get(x3d::TimeSensor::isActive));
}

/// The calls of the behaviours below, which are plain functions and find it here.
struct Calls {
    int first = 0, second = 0, asked = 0;
    bool looks = false;
    std::vector<Vec3f> last;
    NodeId watched;
} eventCalls;

TEST(SceneFrames, OfTwoBehavioursOfATypeTheLastOneCounts) {
    eventCalls = {};
    Scene scene;
    scene.registerBehaviour(x3d::Switch::type,
                            {.onEvent = [](Cascade&, const Node&, FieldIndex, EventValue) { ++eventCalls.first; }});
    scene.registerBehaviour("Switch",
                            {.onEvent = [](Cascade&, const Node&, FieldIndex, EventValue) { ++eventCalls.second; }});
    const NodeId node = scene.createNode(x3d::Switch::type);
    ASSERT_TRUE(scene.sendEvent(node, x3d::Switch::whichChoice.index, std::int32_t{0}));
    scene.newFrame(0);
    EXPECT_EQ(eventCalls.first, 0);
    EXPECT_EQ(eventCalls.second, 1);
}

/// kUntilMoved: one that asked where a node stands is called again when that moves; one that asked nothing, when
/// anything has.
TEST(SceneFrames, WhoWaitsUntilSomethingMovesIsCalledThenAndNotBefore) {
    for (const bool looks : {true, false}) {
        SCOPED_TRACE(looks ? "at one node" : "at all");
        eventCalls = {};
        eventCalls.looks = looks;
        Scene scene;
        const NodeId watched = scene.createNode(x3d::Transform::type), other = scene.createNode(x3d::Transform::type),
                     asker = scene.createNode(x3d::Switch::type), shape = scene.createNode(x3d::Shape::type);
        for (const NodeId node : {watched, other, asker})
            ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
        ASSERT_TRUE(scene.insertChild(watched, x3d::Transform::children, shape));
        eventCalls.watched = shape;
        scene.registerBehaviour(x3d::Switch::type, {.onTime = [](Cascade& cascade, const Node& node) -> double {
                                    ++eventCalls.asked;
                                    if (eventCalls.looks)
                                        eventCalls.last.emplace_back(
                                            cascade.worldFromLocal(cascade.scene().node(eventCalls.watched), node)[3]);
                                    return kUntilMoved;
                                }});
        scene.newFrame(0);
        scene.newFrame(.5);  // in the first all of the scene was new
        const int begun = eventCalls.asked;
        EXPECT_GE(begun, 1);
        for (int i = 1; i < 5; ++i) scene.newFrame(i);
        EXPECT_EQ(eventCalls.asked, begun) << "nothing has moved";
        ASSERT_TRUE(scene.set(other, x3d::Transform::translation, Vec3f(9)));
        scene.newFrame(5);
        scene.newFrame(6);
        EXPECT_EQ(eventCalls.asked > begun, !looks) << "something else has moved";
        const int before = eventCalls.asked;
        ASSERT_TRUE(scene.set(watched, x3d::Transform::translation, Vec3f(1, 2, 3)));
        scene.newFrame(7);
        scene.newFrame(8);
        EXPECT_GT(eventCalls.asked, before);
        if (looks) {
            EXPECT_EQ(eventCalls.last.back(), Vec3f(1, 2, 3));
        }
    }
}

/// Behaviour::last: called when all else has come to rest, once a timestamp.
TEST(SceneFrames, WhoComesLastSeesWhatRoutesHaveLeft) {
    eventCalls = {};
    Scene scene;
    const NodeId end = scene.createNode(x3d::Transform::type), asker = scene.createNode(x3d::Switch::type);
    eventCalls.watched = end;
    scene.registerBehaviour(
        x3d::Switch::type,
        {.onTime = [](Cascade& cascade, const Node&) -> double {
             eventCalls.last.push_back(cascade.scene().node(eventCalls.watched).get(x3d::Transform::translation));
             return 0;
         },
         .last = true});
    NodeId from = scene.createNode(x3d::Transform::type);
    const NodeId start = from;
    for (int i = 0; i < 5; ++i) {
        const NodeId next = i == 4 ? end : scene.createNode(x3d::Transform::type);
        ASSERT_TRUE(scene.addRoute(from, kTranslation, next, kTranslation));
        from = next;
    }
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, asker));
    for (int i = 1; i <= 3; ++i) {
        ASSERT_TRUE(scene.sendEvent(start, kTranslation, Vec3f(static_cast<float>(i))));
        scene.newFrame(i);
    }
    EXPECT_EQ(eventCalls.last, (std::vector<Vec3f>{Vec3f(1), Vec3f(2), Vec3f(3)}));
}

TEST(SceneFrames, AWarningOfANodeIsGivenOnce) {
    Scene scene;
    const NodeId one = scene.createNode(x3d::Switch::type);
    scene.createNode(x3d::Switch::type);
    scene.registerBehaviour(x3d::Switch::type, {.onTime = [](Cascade& cascade, const Node& node) -> double {
                                cascade.warn(node, "it complains");
                                return 0;
                            }});
    ASSERT_TRUE(scene.setName(one, "ONE"));
    for (int i = 0; i < 10; ++i) scene.newFrame(i);
    EXPECT_EQ(scene.diagnostics().warnings(), 2U) << "one a node";
    EXPECT_EQ(scene.diagnostics().all()[0].text, "Switch ONE: it complains");
}

TEST(SceneFrames, WhatTheApplicationHasSetOutlivesAReset) {
    eventCalls = {};
    Scene scene;
    int heard = 0;
    scene.setEventListener([&](double, const Node&, FieldIndex, const Value&) { ++heard; });
    scene.registerBehaviour("Switch",
                            {.onEvent = [](Cascade&, const Node&, FieldIndex, EventValue) { ++eventCalls.first; }});
    scene.setInputRecording(true);
    scene.createNode(x3d::Group::type);
    scene.newFrame(4);
    ASSERT_TRUE(scene.reset());
    EXPECT_EQ(scene.nodeCount(), Scene().nodeCount());
    EXPECT_EQ(scene.sequence(), 0U);
    EXPECT_TRUE(scene.inputRecording());
    const NodeId node = scene.createNode(x3d::Switch::type);
    ASSERT_TRUE(scene.sendEvent(node, x3d::Switch::whichChoice.index, std::int32_t{0}));
    EXPECT_TRUE(scene.newFrame(1)->input) << "the clock starts anew, too";
    EXPECT_EQ(scene.now(), 1);
    EXPECT_EQ(eventCalls.first, 1);
    EXPECT_GT(heard, 0);
}

// ---- threads -------------------------------------------------------------------------------------------------------

/// scene.h: a call from another thread is refused with a diagnostic. Those without a Result tell the scene's own.
TEST(SceneThreads, CallsWithoutAResultAreRefusedAndToldToo) {
    Scene scene;
    bool printed = false;
    ScriptOptions options;
    options.print = [&](std::string_view) { printed = true; };
    runScripts(scene, options);
    std::thread([&] {
        scene.setInputRecording(true);
        scene.setScriptOptions({});
        EXPECT_FALSE(scene.createNode(x3d::Group::type));
    }).join();
    EXPECT_FALSE(scene.inputRecording());
    ASSERT_EQ(scene.diagnostics().errors(), 1U);
    EXPECT_EQ(scene.diagnostics().all()[0].code, DiagnosticCode("wrong-thread"));
    EXPECT_NE(scene.diagnostics().all()[0].text.find("3 calls"), std::string::npos)
        << scene.diagnostics().all()[0].text;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\n"
                         "Script { url \"ecmascript: function initialize() { print('here'); }\" }",
                         diagnostics));
    scene.newFrame(0);
    EXPECT_TRUE(printed);
}

// ---- devices -------------------------------------------------------------------------------------------------------

TEST(DeviceValues, APointerIsReadBackAndWhatItCannotBeIsRefused) {
    PointerInput given;
    given.device = 7;
    given.buttons = 5;
    given.origin = {1, 2, 3};
    given.direction = {0, 1, 0};
    given.hit = PointerHit{{1, 5, 3}, {0, -1, 0}, {.25, .75}, {NodeId{4}, NodeId{9}}};
    const auto read = PointerInput::fromValue(given.toValue());
    ASSERT_TRUE(read);
    EXPECT_EQ(read->device, 7);
    EXPECT_EQ(read->buttons, 5U);
    EXPECT_EQ(read->origin, given.origin);
    EXPECT_EQ(read->direction, given.direction);
    EXPECT_EQ(read->hit, given.hit);

    for (const double wrong : {HUGE_VAL, std::nan("")}) {
        PointerInput lost = given;
        lost.direction.x = wrong;
        const auto absent = PointerInput::fromValue(lost.toValue());
        ASSERT_TRUE(absent);
        EXPECT_EQ(absent->kind, PointerInput::Kind::absent);
        EXPECT_EQ(absent->buttons, 5U) << "a button counts wherever its pointer is";
    }
    Array<double> value = given.toValue();
    value.resize(6);
    EXPECT_FALSE(PointerInput::fromValue(value));

    PointerInput placed;
    placed.hit = PointerHit{
        {1, 5, 3}, {0, -1, 0}, {.25, .75}, {NodeId{4}, NodeId{9}}, {{0, glm::dmat4x3(2.0)}, {1, glm::dmat4x3(.5)}}};
    const Array<double> whole = placed.toValue();
    const auto again = PointerInput::fromValue(whole);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->hit, placed.hit);
    for (const std::size_t length : {whole.size() - 1, whole.size() + 1}) {
        value = whole;
        value.resize(length);
        EXPECT_FALSE(PointerInput::fromValue(value)) << length;
    }
    for (const double at : {-1.0, 2.0, .5, std::nan("")}) {
        value = whole;
        value.mutableData()[whole.size() - 26] = at;
        EXPECT_FALSE(PointerInput::fromValue(value)) << at;
    }
    value = whole;
    value.mutableData()[whole.size() - 13] = 0;
    EXPECT_FALSE(PointerInput::fromValue(value)) << "the same node twice";
    Array<double> deep = given.toValue();
    while (deep.size() < 18 + 10'001) deep.push_back(1);
    EXPECT_FALSE(PointerInput::fromValue(deep));
    deep.resize(18 + 10'000);
    EXPECT_TRUE(PointerInput::fromValue(deep));
    value.mutableData()[whole.size() - 1] = HUGE_VAL;
    EXPECT_FALSE(PointerInput::fromValue(value));
    for (const double device : {-1.0, double(PointerInput::kDevices), .5}) {
        value = given.toValue();
        value.mutableData()[0] = device;
        EXPECT_FALSE(PointerInput::fromValue(value)) << device;
    }
}

TEST(DeviceValues, WhatThereCannotBeIsNotSent) {
    Scene scene;
    PointerInput pointer;
    pointer.device = PointerInput::kDevices;
    EXPECT_FALSE(sendPointer(scene, pointer));
    EXPECT_FALSE(sendKey(scene, KeyInput{true, 0xD800}));
    EXPECT_FALSE(sendWheel(scene, std::nan(""), 0));
    EXPECT_FALSE(sendHeadPose(scene, {0, HUGE_VAL, 0}, {}));
    std::thread([&] { EXPECT_EQ(sendPointer(scene, {}).error().code, DiagnosticCode("wrong-thread")); }).join();
    EXPECT_TRUE(sendPointer(scene, {}));
}

/// At most 256 keys wait for frames that take them; what comes beyond is left out, and said.
TEST(DeviceValues, KeysThatWaitAreLimited) {
    Scene scene;
    scene.newFrame(0);
    for (int i = 0; i < 400; ++i) ASSERT_TRUE(sendKey(scene, KeyInput{i % 2 == 0, U'a'}));
    int frames = 0, events = 0;
    for (; frames < 400; ++frames) {
        const auto set = scene.newFrame(1 + frames);
        int now = 0;
        for (const Change& c : set->changes) now += c.kind == ChangeKind::event ? 1 : 0;
        EXPECT_LE(now, 1) << "a frame takes one key";
        events += now;
    }
    EXPECT_EQ(events, 257);
    EXPECT_EQ(scene.diagnostics().warnings(), 1U);
}

// ---- loading -------------------------------------------------------------------------------------------------------

TEST(Loading, ProgressGrowsUpToAllThereIs) {
    std::string text = "#X3D V4.0 utf8\nPROFILE Immersive\n";
    for (int i = 0; i < 200'000; ++i) text += "Transform { translation 1 2 3 }\n";
    Scene scene;
    Diagnostics diagnostics;
    LoadOptions options;
    std::uint64_t last = 0, times = 0;
    options.progress = [&](std::uint64_t done, std::uint64_t total) {
        EXPECT_GE(done, last);
        EXPECT_LE(done, total);
        EXPECT_EQ(total, text.size());
        last = done;
        ++times;
    };
    ASSERT_TRUE(loadText(scene, text, diagnostics, {}, options));
    EXPECT_GT(times, 3U);
    EXPECT_GT(last, text.size() / 2);
}

TEST(Scene, ATimeThatIsNoneLeavesTheClockWhereItIs) {
    Scene scene;
    scene.newFrame(2);
    for (const double none : {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::quiet_NaN()}) {
        scene.newFrame(none);
        EXPECT_EQ(scene.now(), 2);
    }
    EXPECT_EQ(scene.diagnostics().all().size(), 3u);
    scene.newFrame(3);
    EXPECT_EQ(scene.now(), 3);
}

}  // namespace
}  // namespace rtsg
