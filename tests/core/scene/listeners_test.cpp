// Listeners: every event of a field in order, one call for an edit, nodes that come and go, and calls that meddle.
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/listeners.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

class ListenersTest : public testing::Test {
  protected:
    void load(const std::string& text) {
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene_, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    }
    NodeId named(const std::string& name) const { return scene_.findName(name); }
    FieldIndex field(NodeId node, const std::string& name) const { return scene_.node(node).type().find(name); }
    /// Notes "name value" of what is heard.
    template <class T>
    ListenerId listen(Listeners& listeners, const std::string& node, Field<T> handle) {
        const auto id = listeners.onField(named(node), handle, [this, node](const T& value, double time) {
            heard_.push_back(node + ' ' + std::to_string(static_cast<double>(value)) + " at " + std::to_string(time));
        });
        EXPECT_TRUE(id) << id.error().text;
        return id.value_or(ListenerId{});
    }
    ListenerId watch(Listeners& listeners, const std::string& name) {
        const auto id = listeners.onNode(named(name), [this, name](const NodeEvent& event) {
            constexpr const char* kKinds[] = {"changed", "entered", "left", "destroyed"};
            std::string text = name + ' ' + kKinds[static_cast<int>(event.kind)];
            if (event.field != kNoField) text += ' ' + scene_.node(event.node).type().fields[event.field].name;
            heard_.push_back(text);
        });
        EXPECT_TRUE(id) << id.error().text;
        return id.value_or(ListenerId{});
    }
    std::vector<std::string> heard() { return std::exchange(heard_, {}); }

    Scene scene_;
    std::vector<std::string> heard_;
};

using Lines = std::vector<std::string>;

TEST_F(ListenersTest, EventsWithTheValueBeforeAreHeardAsWell) {
    load("DEF B BooleanTrigger { }");
    Listeners listeners(scene_);
    listen(listeners, "B", x3d::BooleanTrigger::triggerTrue);
    for (const double t : {1.0, 2.0}) {
        ASSERT_TRUE(scene_.sendEvent(named("B"), x3d::BooleanTrigger::set_triggerTime.index, Time{t}));
        scene_.newFrame(t);
    }
    scene_.newFrame(3);
    EXPECT_EQ(heard(), (Lines{"B 1.000000 at 1.000000", "B 1.000000 at 2.000000"}));
}

TEST_F(ListenersTest, EventsComeInTheOrderOfTheCascadeAndOneAFieldAndFrame) {
    load(R"(DEF A IntegerSequencer { key 0 keyValue 7 } DEF C ScalarInterpolator { key [ 0 1 ] keyValue [ 0 2 ] }
            DEF T TimeSensor { loop TRUE cycleInterval 4 }
            ROUTE T.fraction_changed TO C.set_fraction ROUTE T.fraction_changed TO A.set_fraction)");
    Listeners listeners(scene_);
    listen(listeners, "A", x3d::IntegerSequencer::value_changed);
    listen(listeners, "C", x3d::ScalarInterpolator::value_changed);
    listen(listeners, "T", x3d::TimeSensor::fraction_changed);
    scene_.newFrame(1);
    EXPECT_EQ(heard(), (Lines{"T 0.250000 at 1.000000", "C 0.500000 at 1.000000", "A 7.000000 at 1.000000"}));
}

TEST_F(ListenersTest, AnEditIsHeardOnceASetWithWhatItCameTo) {
    load("DEF L PointLight { }");
    Listeners listeners(scene_);
    const ListenerId id = listen(listeners, "L", x3d::PointLight::intensity);
    ASSERT_TRUE(scene_.set(named("L"), x3d::PointLight::intensity, .25F));
    ASSERT_TRUE(scene_.set(named("L"), x3d::PointLight::intensity, .5F));
    EXPECT_TRUE(heard().empty());
    scene_.newFrame(1);
    EXPECT_EQ(heard(), (Lines{"L 0.500000 at 1.000000"}));
    // An event in the same frame tells the value that the field ends with.
    ASSERT_TRUE(scene_.set(named("L"), x3d::PointLight::intensity, .25F));
    ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, .75F));
    scene_.newFrame(2);
    EXPECT_EQ(heard(), (Lines{"L 0.750000 at 2.000000"}));
    listeners.end(id);
    listeners.end(id);
    EXPECT_EQ(listeners.count(), 0U);
    ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, 1.F));
    scene_.newFrame(3);
    EXPECT_TRUE(heard().empty());
}

TEST_F(ListenersTest, SeveralListenersOfOneFieldEndOneByOne) {
    load("DEF L PointLight { }");
    Listeners first(scene_);
    auto second = std::make_unique<Listeners>(scene_);
    const ListenerId one = listen(first, "L", x3d::PointLight::intensity);
    listen(first, "L", x3d::PointLight::intensity);
    listen(*second, "L", x3d::PointLight::intensity);
    const auto brighten = [&](float to, double t) {
        ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, to));
        scene_.newFrame(t);
    };
    brighten(.1F, 1);
    EXPECT_EQ(heard().size(), 3U);
    first.end(one);
    brighten(.2F, 2);
    EXPECT_EQ(heard().size(), 2U);
    second.reset();
    brighten(.3F, 3);
    EXPECT_EQ(heard().size(), 1U);
}

/// Its first set starts at state 0, as snapshots do.
TEST_F(ListenersTest, ASceneThatWasEmptyIsListenedToFromItsFirstFrame) {
    Listeners listeners(scene_);
    int worlds = 0, silent = 0;
    listeners.onWorld([&] { ++worlds; });
    const NodeId trigger = scene_.createNode(x3d::BooleanTrigger::type);
    ASSERT_TRUE(scene_.setName(trigger, "B"));
    const NodeId light = scene_.createNode(x3d::PointLight::type);
    ASSERT_TRUE(listeners.onField(light, x3d::PointLight::intensity, [&](float, double) { ++silent; }));
    const ListenerId id = listen(listeners, "B", x3d::BooleanTrigger::triggerTrue);
    ASSERT_TRUE(scene_.sendEvent(trigger, x3d::BooleanTrigger::set_triggerTime.index, Time{1}));
    EXPECT_TRUE(scene_.newFrame(1)->isSnapshot());
    EXPECT_EQ(heard(), (Lines{"B 1.000000 at 1.000000"}));
    EXPECT_EQ(silent, 0);
    EXPECT_EQ(worlds, 0);
    listeners.end(id);
    ASSERT_TRUE(scene_.sendEvent(trigger, x3d::BooleanTrigger::set_triggerTime.index, Time{2}));
    EXPECT_EQ(scene_.newFrame(2)->heard, nullptr) << "nobody listens any more";
}

TEST_F(ListenersTest, WhatNobodyListensToComesBeforeWhatSomebodyDoes) {
    load("DEF A PointLight { } DEF B PointLight { }");
    Listeners first(scene_), second(scene_);
    listen(first, "A", x3d::PointLight::intensity);
    listen(second, "B", x3d::PointLight::intensity);
    for (const char* name : {"A", "B"}) {
        ASSERT_TRUE(scene_.set(named(name), x3d::PointLight::radius, 5.F));
        ASSERT_TRUE(scene_.sendEvent(named(name), x3d::PointLight::intensity.index, .5F));
    }
    scene_.newFrame(1);
    EXPECT_EQ(heard(), (Lines{"A 0.500000 at 1.000000", "B 0.500000 at 1.000000"}));
    for (const char* name : {"A", "B"}) {
        ASSERT_TRUE(scene_.sendEvent(named(name), x3d::PointLight::intensity.index, .5F));
    }
    scene_.newFrame(2);
    EXPECT_EQ(heard(), (Lines{"A 0.500000 at 2.000000", "B 0.500000 at 2.000000"}));
    for (const char* name : {"A", "B"}) {
        ASSERT_TRUE(scene_.set(named(name), x3d::PointLight::intensity, .25F));
    }
    scene_.newFrame(3);
    EXPECT_EQ(heard(), (Lines{"A 0.250000 at 3.000000", "B 0.250000 at 3.000000"}));
}

TEST_F(ListenersTest, ARouteGoesOnWhenAListenerEnds) {
    load(R"(DEF S ScalarInterpolator { key [ 0 1 ] keyValue [ 0 1 ] } DEF L PointLight { }
            ROUTE S.value_changed TO L.intensity)");
    Listeners listeners(scene_);
    listeners.end(listen(listeners, "S", x3d::ScalarInterpolator::value_changed));
    EXPECT_EQ(scene_.routesFrom(named("S")).size(), 1U);
    ASSERT_TRUE(scene_.sendEvent(named("S"), x3d::ScalarInterpolator::set_fraction.index, .5F));
    scene_.newFrame(1);
    EXPECT_EQ(scene_.node(named("L")).get(x3d::PointLight::intensity), .5F);
}

TEST_F(ListenersTest, ListeningKeepsNothingAliveAndHearsOfTheEnd) {
    load("DEF G Group { children DEF L PointLight { } }");
    Listeners listeners(scene_);
    listen(listeners, "L", x3d::PointLight::intensity);
    watch(listeners, "L");
    ASSERT_TRUE(scene_.setName(named("L"), ""));
    ASSERT_TRUE(scene_.destroyNode(named("G")));
    EXPECT_EQ(scene_.destroyUnreachable(), 1U);
    scene_.newFrame(1);
    EXPECT_EQ(heard(), (Lines{"L left", "L destroyed"}));
    EXPECT_EQ(listeners.count(), 0U);
}

TEST_F(ListenersTest, NodesEnterAndLeaveWithWhatIsAboveThem) {
    load("DEF OUTER Group { children DEF INNER Group { children DEF L PointLight { } } } DEF OTHER Group { }");
    Listeners listeners(scene_);
    watch(listeners, "L");
    scene_.newFrame(0);
    EXPECT_TRUE(heard().empty());
    const NodeId outer = named("OUTER"), inner = named("INNER"), other = named("OTHER");
    EXPECT_EQ(scene_.removeFromParents(outer).value_or(9), 1U);
    scene_.newFrame(1);
    EXPECT_EQ(heard(), (Lines{"L left"}));
    // In two places, then in one: it has not left.
    ASSERT_TRUE(scene_.insertChild(other, x3d::Group::children, inner));
    ASSERT_TRUE(scene_.insertChild(scene_.root(), x3d::RtsgScene::children, outer));
    scene_.newFrame(2);
    EXPECT_EQ(heard(), (Lines{"L entered"}));
    EXPECT_EQ(scene_.areInWorld(std::vector<NodeId>{inner, outer, NodeId{999}}),
              (std::vector<bool>{true, true, false}));
    ASSERT_TRUE(scene_.removeFromParents(outer));
    scene_.newFrame(3);
    EXPECT_TRUE(heard().empty());
    // Out and in again within a frame is nothing.
    ASSERT_TRUE(scene_.removeFromParents(other));
    ASSERT_TRUE(scene_.insertChild(scene_.root(), x3d::RtsgScene::children, other));
    scene_.newFrame(4);
    EXPECT_TRUE(heard().empty());
}

TEST_F(ListenersTest, AScriptsReferenceIsNoWayIntoTheWorld) {
    load("DEF S Script { initializeOnly SFNode to DEF L PointLight { } } DEF M PointLight { }");
    EXPECT_EQ(scene_.areInWorld(std::vector<NodeId>{named("L"), named("M"), named("S")}),
              (std::vector<bool>{false, true, true}));
}

TEST_F(ListenersTest, ANodeTellsItsFieldsOnceASet) {
    load("DEF T Transform { }");
    Listeners listeners(scene_);
    watch(listeners, "T");
    const NodeId node = named("T"), child = scene_.createNode(x3d::Group::type);
    ASSERT_TRUE(scene_.set(node, x3d::Transform::translation, Vec3f(1, 0, 0)));
    ASSERT_TRUE(scene_.set(node, x3d::Transform::translation, Vec3f(2, 0, 0)));
    for (int i = 0; i < 2; ++i) ASSERT_TRUE(scene_.insertChild(node, x3d::Transform::children, child));
    scene_.newFrame(1);
    EXPECT_EQ(heard(), (Lines{"T changed translation", "T changed children"}));
}

TEST_F(ListenersTest, WhatACallEditsComesWithTheNextFrame) {
    load("DEF L PointLight { } DEF M PointLight { }");
    Listeners listeners(scene_);
    std::vector<ListenerId> ids;
    const auto id = listeners.onField(named("L"), x3d::PointLight::intensity, [&](float value, double) {
        EXPECT_TRUE(scene_.sendEvent(named("M"), x3d::PointLight::intensity.index, value));
        listeners.end(ids[0]);  // itself
        listeners.end(ids[1]);  // one that waits to be called
    });
    ASSERT_TRUE(id);
    ids = {*id, listen(listeners, "L", x3d::PointLight::intensity)};
    listen(listeners, "M", x3d::PointLight::intensity);
    ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, .5F));
    scene_.newFrame(1);
    EXPECT_TRUE(heard().empty());
    scene_.newFrame(2);
    EXPECT_EQ(heard(), (Lines{"M 0.500000 at 2.000000"}));
}

TEST_F(ListenersTest, OneThatThrowsIsReportedAndHearsNoMoreTheOthersDo) {
    load("DEF L PointLight { }");
    Listeners listeners(scene_);
    int calls = 0;
    ASSERT_TRUE(listeners.onField(named("L"), x3d::PointLight::intensity, [&](float, double) {
        ++calls;
        throw std::runtime_error("out of paper");
    }));
    listen(listeners, "L", x3d::PointLight::intensity);
    for (const double t : {1.0, 2.0}) {
        ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, .5F));
        scene_.newFrame(t);
    }
    EXPECT_EQ(calls, 1);
    EXPECT_EQ(heard().size(), 2U);
    ASSERT_EQ(scene_.diagnostics().errors(), 1U);
    EXPECT_NE(scene_.diagnostics().all()[0].text.find("out of paper"), std::string::npos);
}

TEST_F(ListenersTest, OnlyFieldsThatSendCanBeListenedTo) {
    load("DEF B Box { } DEF T TimeTrigger { }");
    Listeners listeners(scene_);
    const auto refused = [&](NodeId node, FieldIndex index) {
        const auto id = listeners.onField(node, index, [](const FieldEvent&, double) {});
        return id ? std::string("taken") : std::string(id.error().code.text());
    };
    EXPECT_EQ(refused(named("B"), x3d::Box::size.index), "access");
    EXPECT_EQ(refused(named("T"), x3d::TimeTrigger::set_boolean.index), "access");
    EXPECT_EQ(refused(named("B"), 500), "no-such-field");
    EXPECT_EQ(refused(NodeId{999}, 0), "no-such-node");
    EXPECT_FALSE(listeners.onNode(NodeId{999}, [](const NodeEvent&) {}));
    EXPECT_EQ(listeners.count(), 0U);
}

TEST_F(ListenersTest, ListeningIsNoPartOfTheState) {
    load("DEF L PointLight { } DEF S ScalarInterpolator { key [ 0 1 ] keyValue [ 0 1 ] }");
    scene_.newFrame(0);
    const std::string before = scene_.dump();
    const Hash128 hash = scene_.hash();
    {
        Listeners listeners(scene_);
        listen(listeners, "S", x3d::ScalarInterpolator::value_changed);
        EXPECT_EQ(scene_.dump(), before);
        EXPECT_EQ(scene_.hash(), hash);
        EXPECT_EQ(scene_.routeCount(), 0U);
        EXPECT_TRUE(scene_.routesFrom(named("S")).empty());
        // A route beside a listener, and gone again.
        const FieldIndex from = x3d::ScalarInterpolator::value_changed.index, to = x3d::PointLight::intensity.index;
        ASSERT_TRUE(scene_.addRoute(named("S"), from, named("L"), to));
        ASSERT_TRUE(scene_.removeRoute(named("S"), from, named("L"), to));
        ASSERT_TRUE(scene_.sendEvent(named("S"), x3d::ScalarInterpolator::set_fraction.index, .5F));
        scene_.newFrame(1);
        EXPECT_EQ(heard(), (Lines{"S 0.500000 at 1.000000"}));
    }
    ASSERT_TRUE(scene_.sendEvent(named("S"), x3d::ScalarInterpolator::set_fraction.index, 1.F));
    const auto set = scene_.newFrame(2);
    EXPECT_EQ(set->heard, nullptr);
}

/// A scene of the `state` kind gets sets and runs nothing. Of two events to one field at one timestamp, the second
/// arrives after the first has been passed on.
TEST_F(ListenersTest, OfTwoEventsToAFieldWithoutRoutesBothAreHeardAndTheLastOneStays) {
    load(
        "DEF FAST IntegerTrigger { integerKey 11 } DEF SLOW IntegerTrigger { integerKey 12 } DEF F BooleanFilter { } "
        "DEF G BooleanFilter { } DEF W Switch { } ROUTE FAST.triggerValue TO W.whichChoice "
        "ROUTE F.inputTrue TO G.set_boolean ROUTE G.inputTrue TO SLOW.set_boolean ROUTE SLOW.triggerValue TO "
        "W.whichChoice");
    Listeners listeners(scene_);
    listen(listeners, "W", x3d::Switch::whichChoice);
    ASSERT_TRUE(scene_.sendEvent(named("FAST"), x3d::IntegerTrigger::set_boolean.index, true));
    ASSERT_TRUE(scene_.sendEvent(named("F"), x3d::BooleanFilter::set_boolean.index, true));
    scene_.newFrame(1);
    EXPECT_EQ(heard(), (Lines{"W 11.000000 at 1.000000", "W 12.000000 at 1.000000"}));
    // The value is the same as without a listener.
    EXPECT_EQ(scene_.node(named("W")).get(x3d::Switch::whichChoice), 12);
}

TEST_F(ListenersTest, AReplicaHearsOfValuesThatChanged) {
    load("DEF L PointLight { } DEF G Group { children DEF N Group { } }");
    scene_.newFrame(0);
    Scene replica;
    replica.setBehavioursEnabled(false);
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(scene_.snapshot())));
    Listeners listeners(replica);
    std::vector<float> values;
    int worlds = 0;
    ASSERT_TRUE(listeners.onField(replica.findName("L"), x3d::PointLight::intensity,
                                  [&](float value, double) { values.push_back(value); }));
    std::vector<NodeEvent::Kind> moves;
    ASSERT_TRUE(listeners.onNode(replica.findName("N"), [&](const NodeEvent& event) { moves.push_back(event.kind); }));
    listeners.onWorld([&] { ++worlds; });
    ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, .5F));
    ASSERT_TRUE(replica.apply(scene_.newFrame(1)));
    EXPECT_EQ(values, (std::vector<float>{.5F}));
    // Destroyed there, destroyed here, although it is listened to.
    ASSERT_TRUE(scene_.destroyNode(named("N")));
    ASSERT_TRUE(replica.apply(scene_.newFrame(2)));
    EXPECT_EQ(moves, (std::vector{NodeEvent::Kind::left, NodeEvent::Kind::destroyed}));
    // Joined anew: what it says may be another value, and it goes on hearing.
    ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, .75F));
    scene_.newFrame(3);
    ASSERT_TRUE(replica.reset());
    ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(scene_.snapshot())));
    EXPECT_EQ(values, (std::vector<float>{.5F, .75F}));
    EXPECT_EQ(worlds, 1);
    ASSERT_TRUE(scene_.sendEvent(named("L"), x3d::PointLight::intensity.index, 1.F));
    ASSERT_TRUE(replica.apply(scene_.newFrame(4)));
    EXPECT_EQ(values, (std::vector<float>{.5F, .75F, 1.F}));
    EXPECT_EQ(replica.hash(), scene_.hash());
}

TEST_F(ListenersTest, RemovingTakesANodeOutOfEveryField) {
    load(R"(PROTO P [ inputOutput MFNode inside [ ] ] { Group { children IS inside } }
            DEF S Shape { appearance DEF A Appearance { } }
            DEF G Group { children [ DEF L PointLight { } USE L ] }
            DEF I P { inside USE L } DEF H Group { children USE L }
            DEF C Script { initializeOnly SFNode light USE L initializeOnly MFNode lights USE L })");
    EXPECT_EQ(scene_.removeFromParents(named("A")).value_or(9), 1U);
    EXPECT_FALSE(scene_.node(named("S")).get(x3d::Shape::appearance));
    const NodeId light = named("L");
    ASSERT_TRUE(scene_.removeFromParents(light));
    EXPECT_FALSE(scene_.areInWorld(std::vector<NodeId>{light})[0]);
    EXPECT_TRUE(scene_.node(named("G")).get(x3d::Group::children).empty());
    EXPECT_TRUE(scene_.node(named("H")).get(x3d::Group::children).empty());
    const Node& instance = scene_.node(named("I"));
    EXPECT_TRUE(instance.get(Field<Array<NodeId>>{field(named("I"), "inside")}).empty());
    EXPECT_TRUE(scene_.effectiveNode(named("I"))->get(x3d::Group::children).empty());
    const Node& script = scene_.node(named("C"));
    EXPECT_EQ(script.get(Field<NodeId>{field(named("C"), "light")}), light);
    EXPECT_EQ(scene_.findName("L"), light);
    EXPECT_EQ(scene_.removeFromParents(light).value_or(9), 0U);
    EXPECT_EQ(scene_.removeFromParents(NodeId{999}).error().code.text(), "no-such-node");
}

/// A listener to all events may edit: then the node that an event was for may be gone, and the sender, too.
TEST(EventListener, MayDestroyWhoHearsAndWhoHasSent) {
    using Children = Array<NodeId>;
    for (const bool sender : {false, true}) {
        Scene scene;
        const NodeId from = scene.createNode(x3d::Group::type), to = scene.createNode(x3d::Group::type),
                     shape = scene.createNode(x3d::Shape::type);
        for (const NodeId group : {from, to})
            ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, group));
        const FieldIndex add = scene.node(to).type().find("addChildren");
        ASSERT_TRUE(scene.addRoute(from, x3d::Group::children.index, to, add));
        int calls = 0;
        scene.setEventListener([&](double, const Node& node, FieldIndex field, const Value& value) {
            if (node.id() != to || field != add) return;
            ++calls;
            EXPECT_EQ(value.as<Children>().size(), 1u);
            EXPECT_TRUE(scene.destroyNode(sender ? from : to));
        });
        scene.newFrame(0);
        ASSERT_TRUE(scene.sendEvent(from, x3d::Group::children.index, Children{shape}));
        scene.newFrame(1);
        EXPECT_EQ(calls, 1);
        EXPECT_EQ(scene.find(from) != nullptr, !sender);
        ASSERT_EQ(scene.find(to) != nullptr, sender);
        if (sender) {
            EXPECT_EQ(scene.node(to).get(x3d::Group::children), Children{shape});
        }
        scene.newFrame(2);
    }
}

}  // namespace
}  // namespace rtsg
