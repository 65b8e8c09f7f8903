// The events of one frame: routes that come too late, edits meanwhile, IS connections in both directions, and forged
// ones.
#include <functional>
#include <map>
#include <tuple>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

/// 4.4.8: a route that is added while an event is on its way does not carry that event.
TEST(Cascade, ARouteAddedWhileItsEventTravelsWaitsForTheNext) {
    Scene scene;
    NodeId node[3];
    for (NodeId& one : node) one = scene.createNode(x3d::Transform::type);
    const FieldIndex field = x3d::Transform::translation.index;
    ASSERT_TRUE(scene.addRoute(node[0], field, node[1], field));
    scene.setEventListener([&](double, const Node& at, FieldIndex, const Value&) {
        if (at.id() != node[1]) return;
        EXPECT_TRUE(scene.addRoute(node[0], field, node[2], field));
    });
    ASSERT_TRUE(scene.sendEvent(node[0], field, Vec3f(1)));
    scene.newFrame(0);
    EXPECT_EQ(scene.node(node[1]).get(x3d::Transform::translation), Vec3f(1));
    EXPECT_EQ(scene.node(node[2]).get(x3d::Transform::translation), Vec3f(0));
    ASSERT_TRUE(scene.sendEvent(node[0], field, Vec3f(2)));
    scene.newFrame(1);
    EXPECT_EQ(scene.node(node[2]).get(x3d::Transform::translation), Vec3f(2));
}

/// 4.4.4.3, 29.2: the author defines the interface of a PROTO or a Script. The names of its fields say nothing of their
/// effect or their types.
TEST(Cascade, AnAuthorsFieldIsNoFieldOfANodeOfThatName) {
    const std::string inputs =
        "inputOnly MFNode addChildren inputOnly SFInt32 removeChildren inputOnly SFBool set_bind ";
    const std::string lists =
        "inputOnly SFString removeChildren inputOnly MFNode addChildren inputOutput MFNode children [] ";
    std::string text = "#X3D V4.0 utf8\nPROTO Both [ " + inputs +
                       "inputOutput SFVec3f children 0 0 0 ] { Group { } }\n" + "PROTO None [ " + inputs +
                       "] { Group { } }\nPROTO Lists [ " + lists + "] { Group { } }\n" +
                       "PROTO Is [ inputOnly MFNode addChildren ] { DEF G Group { addChildren IS addChildren } }\n";
    for (const char* one : {"Both", "None", "Lists", "Is"}) text += fmt::format("DEF {0} {0} {{ }}\n", one);
    text += "DEF S1 Script { " + inputs + "}\nDEF S2 Script { " + lists + "}\nDEF Child Group { }\n";
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, text, diagnostics));
    EXPECT_EQ(diagnostics.errors(), 0u);
    Array<NodeId> child;
    child.push_back(scene.findName("Child"));
    const std::map<FieldType, Value> values = {{FieldType::MFNode, Value(child)},
                                               {FieldType::SFInt32, Value(1 << 30)},
                                               {FieldType::SFBool, Value(true)},
                                               {FieldType::SFString, Value(String("x"))}};
    int sent = 0;
    for (const char* name : {"Both", "None", "Lists", "S1", "S2", "Is"}) {
        const NodeType& type = scene.node(scene.findName(name)).type();
        for (const char* field : {"addChildren", "removeChildren", "set_bind"})
            if (const FieldIndex index = type.findExact(field); index != kNoField)
                sent += bool(scene.sendEvent(scene.findName(name), index, values.at(type.fields[index].type)));
    }
    EXPECT_EQ(sent, 14);
    // A user's own type has what its table says, if that can be it at all.
    const auto type = std::make_shared<NodeType>();
    type->name = "Odd";
    type->kind = NodeType::Kind::user;
    for (const auto& [name, kind, access] : {std::tuple("children", FieldType::MFNode, Access::inputOutput),
                                             {"addChildren", FieldType::SFInt32, Access::inputOnly}}) {
        FieldDef& def = type->fields.emplace_back();
        def.name = name, def.type = kind, def.access = access;
    }
    ASSERT_TRUE(type->finish());
    const auto odd = scene.defineType(type);
    ASSERT_TRUE(odd);
    EXPECT_TRUE(scene.sendEvent(scene.createNode(*odd), type->findExact("addChildren"), Value(1 << 30)));
    scene.newFrame(0);
    for (const char* name : {"Lists", "S2"}) {
        const Node& node = scene.node(scene.findName(name));
        EXPECT_TRUE(node.value(node.type().findExact("children")).as<Array<NodeId>>().empty()) << name;
    }
    const Node* body = scene.effectiveNode(scene.findName("Is"));
    ASSERT_TRUE(body);
    EXPECT_EQ(body->get(x3d::Group::children), child) << "what it is connected to gets it";
}

/// Fields whose numbers are 16 apart are told apart, whichever of their routes came first, and when some are gone.
TEST(Cascade, RoutesOfManyFieldsOfANodeAreTheirOwn) {
    constexpr FieldIndex kFields = 70;
    const auto type = std::make_shared<NodeType>();
    type->name = "Many";
    type->kind = NodeType::Kind::user;
    for (int i = 0; i < kFields; ++i) {
        FieldDef def;
        def.name = "f" + std::to_string(i);
        def.type = FieldType::SFFloat;
        def.defaultValue = Value(0.0f);
        type->fields.push_back(def);
    }
    ASSERT_TRUE(type->finish());
    Scene scene;
    const auto many = scene.defineType(type);
    ASSERT_TRUE(many);
    // Its events are plain ones of its clock, not of incoming events: all fields in each frame.
    scene.registerBehaviour(*many, Behaviour{.onTime = [](Cascade& cascade, const Node& node) {
        for (FieldIndex i = 0; i < kFields; ++i)
            cascade.emit(node, Field<float>{i}, static_cast<float>(cascade.now() * 100 + i));
        return cascade.now();
    }});
    const NodeId from = scene.createNode(*many);
    std::vector<NodeId> to;
    for (int i = 0; i < 3; ++i) to.push_back(scene.createNode(x3d::PointLight::type));
    const FieldIndex sent[] = {35, 3, 19}, in = x3d::PointLight::intensity.index;
    for (std::size_t i = 0; i < 3; ++i) ASSERT_TRUE(scene.addRoute(from, sent[i], to[i], in));
    const auto says = [&](double time) {
        scene.newFrame(time);
        std::vector<float> all;
        for (const NodeId id : to) all.push_back(scene.node(id).get(x3d::PointLight::intensity));
        return all;
    };
    for (const double time : {1., 2., 3.})  // as the frame before from the third on
        EXPECT_THAT(says(time), testing::ElementsAre(time * 100 + 35, time * 100 + 3, time * 100 + 19));
    ASSERT_TRUE(scene.removeRoute(from, 3, to[1], in));
    EXPECT_THAT(says(4), testing::ElementsAre(435, 303, 419));
    EXPECT_TRUE(scene.isHeard(from, 35) && scene.isHeard(from, 19));
    EXPECT_FALSE(scene.isHeard(from, 3) || scene.isHeard(from, 51));
    ASSERT_TRUE(scene.listenTo(from, 51));
    EXPECT_TRUE(scene.isHeard(from, 51));
    const auto set = scene.newFrame(5);
    ASSERT_TRUE(set->heard && set->heard->size() == 1);
    EXPECT_EQ(set->heard->front().value, Value(551.0f));
    scene.stopListening(from, 51);
    ASSERT_TRUE(scene.removeRoute(from, 35, to[0], in) && scene.removeRoute(from, 19, to[2], in));
    EXPECT_THAT(says(6), testing::ElementsAre(535, 303, 519));
    EXPECT_FALSE(scene.isHeard(from, 35) || scene.isHeard(from, 51) || scene.isHeard(NodeId{999}, 0));
}

// ---- edits while an event is on its way ----------------------------------------------------------------------------

/// Transforms in a row; the first has a route to each of the others. `onArrival` runs when an event reaches one.
class Meddled : public testing::Test {
  protected:
    static constexpr int kCount = 5;
    Meddled() {
        onArrival = nullptr;
        scene_.registerBehaviour(x3d::Transform::type,
                                 Behaviour{.onEvent = [](Cascade& cascade, const Node& node, FieldIndex, EventValue) {
                                     if (onArrival) onArrival(cascade, node.id());
                                 }});
        for (NodeId& one : node_) one = scene_.createNode(x3d::Transform::type);
        for (int i = 1; i < kCount; ++i) EXPECT_TRUE(scene_.addRoute(node_[0], kTranslation, node_[i], kTranslation));
        scene_.newFrame(0);
    }
    /// The values of the nodes after an event of the first one; -1 for one that is gone.
    std::vector<float> run() {
        EXPECT_TRUE(scene_.sendEvent(node_[0], kTranslation, Vec3f(1)));
        scene_.newFrame(1);
        std::vector<float> all;
        for (const NodeId id : node_)
            all.push_back(scene_.find(id) ? scene_.node(id).get(x3d::Transform::translation).x : -1);
        return all;
    }

    static constexpr FieldIndex kTranslation = x3d::Transform::translation.index,
                                kCenter = x3d::Transform::center.index, kScale = x3d::Transform::scale.index;
    static inline std::function<void(Cascade&, NodeId)> onArrival;
    Scene scene_;
    NodeId node_[kCount];
};

TEST_F(Meddled, ASenderThatGoesTellsNobodyFurther) {
    onArrival = [this](Cascade&, NodeId at) {
        if (at != node_[2]) return;
        EXPECT_TRUE(scene_.destroyNode(node_[0]));
    };
    EXPECT_THAT(run(), testing::ElementsAre(-1, 1, 1, 0, 0));
}

TEST_F(Meddled, ARouteThatEndsCarriesNothingTheOthersDo) {
    onArrival = [this](Cascade&, NodeId at) {
        if (at != node_[2]) return;
        EXPECT_TRUE(scene_.removeRoute(node_[0], kTranslation, node_[3], kTranslation));
    };
    EXPECT_THAT(run(), testing::ElementsAre(1, 1, 1, 0, 1));
}

TEST_F(Meddled, ANodeThatGoesBeforeItsTurnTellsNothing) {
    ASSERT_TRUE(scene_.addRoute(node_[1], kTranslation, node_[2], kCenter));
    onArrival = [this](Cascade&, NodeId at) {
        if (at != node_[3]) return;
        EXPECT_TRUE(scene_.destroyNode(node_[1]));
    };
    EXPECT_THAT(run(), testing::ElementsAre(1, -1, 1, 1, 1));
    EXPECT_EQ(scene_.node(node_[2]).get(x3d::Transform::center), Vec3f(0));
}

/// The sender's routes move in memory, for those of its other fields and for many more of the same one.
TEST_F(Meddled, RoutesThatComeMeanwhileDisturbNone) {
    onArrival = [this](Cascade&, NodeId at) {
        if (at != node_[2]) return;
        for (const FieldIndex field : {kCenter, kScale}) EXPECT_TRUE(scene_.addRoute(node_[0], field, node_[1], field));
        for (int i = 0; i < 100; ++i)
            EXPECT_TRUE(scene_.addRoute(node_[0], kTranslation, scene_.createNode(x3d::Transform::type), kTranslation));
    };
    EXPECT_THAT(run(), testing::Each(1));
    EXPECT_EQ(scene_.routesFrom(node_[0]).size(), 106);
    scene_.forEachNode([&](const Node& node) {
        if (!node.is(x3d::Transform::type) || node.id() <= node_[kCount - 1]) return;
        EXPECT_EQ(node.get(x3d::Transform::translation), Vec3f(0)) << node.id().value;
    });
}

TEST_F(Meddled, AnEventWhoseRoutesEndBeforeItsTurnGoesNowhere) {
    ASSERT_TRUE(scene_.addRoute(node_[1], kTranslation, node_[2], kCenter));
    onArrival = [this](Cascade&, NodeId at) {
        if (at != node_[3]) return;
        EXPECT_TRUE(scene_.removeRoute(node_[1], kTranslation, node_[2], kCenter));
    };
    EXPECT_THAT(run(), testing::Each(1));
    EXPECT_EQ(scene_.node(node_[2]).get(x3d::Transform::center), Vec3f(0));
}

TEST_F(Meddled, NobodyHearsOfANodeWithoutRoutesThatIsGone) {
    const NodeId alone = scene_.createNode(x3d::Transform::type);
    std::vector<NodeId> heard;
    scene_.setEventListener([&](double, const Node& node, FieldIndex, const Value&) { heard.push_back(node.id()); });
    onArrival = [&](Cascade& cascade, NodeId at) {
        if (at == node_[1]) {
            EXPECT_TRUE(cascade.deliver(alone, kTranslation, Vec3f(7)));
        } else if (at == node_[2]) {
            EXPECT_TRUE(scene_.destroyNode(alone));
        }
    };
    EXPECT_THAT(run(), testing::Each(1));
    EXPECT_THAT(heard, testing::ElementsAreArray(node_));
}

/// The routes of a field whose event waits for its turn: all of them gone, and another one there.
TEST_F(Meddled, AnEventGoesAlongTheRoutesThatAreThereAtItsTurn) {
    ASSERT_TRUE(scene_.addRoute(node_[1], kTranslation, node_[2], kCenter));
    onArrival = [this](Cascade&, NodeId at) {
        if (at != node_[4]) return;
        EXPECT_TRUE(scene_.removeRoute(node_[1], kTranslation, node_[2], kCenter));
        EXPECT_TRUE(scene_.addRoute(node_[1], kTranslation, node_[3], kCenter));
    };
    EXPECT_THAT(run(), testing::Each(1));
    EXPECT_EQ(scene_.node(node_[2]).get(x3d::Transform::center), Vec3f(0));
    EXPECT_EQ(scene_.node(node_[3]).get(x3d::Transform::center), Vec3f(1));
}

int eventsCounted = 0;

/// An inputOutput field and the one in the body that it IS: what one sends, the other takes, and no more.
TEST(Cascade, ATwoWayIsConnectionDoesNotEcho) {
    Scene scene;
    const Behaviour counts{.onEvent = [](Cascade&, const Node&, FieldIndex, EventValue) { ++eventsCounted; }};
    scene.registerBehaviour("Moved", counts);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Immersive
PROTO Moved [ inputOutput SFVec3f place 0 0 0 ] { DEF BODY Transform { translation IS place } }
DEF M Moved { })",
                         diagnostics));
    scene.newFrame(0);
    const NodeId moved = scene.findName("M");
    const NodeId body = scene.effectiveNode(moved)->id();
    eventsCounted = 0;
    ASSERT_TRUE(scene.sendEvent(moved, scene.node(moved).type().find("place"), Vec3f(3)));
    scene.newFrame(1);
    EXPECT_EQ(eventsCounted, 1);
    EXPECT_EQ(scene.node(body).get(x3d::Transform::translation), Vec3f(3));
    ASSERT_TRUE(scene.sendEvent(body, x3d::Transform::translation.index, Vec3f(4)));
    scene.newFrame(2);
    EXPECT_EQ(eventsCounted, 2);
    EXPECT_EQ(scene.node(moved).value(scene.node(moved).type().find("place")).as<Vec3f>(), Vec3f(4));
}

// ---- IS connections that no document can make ----------------------------------------------------------------------

/// Two instances of PROTOs that take an event, and what a peer or a log might say of them.
class ForgedIs : public testing::Test {
  protected:
    ForgedIs() {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene_, R"(#X3D V4.0 utf8
PROFILE Immersive
PROTO Taker [ inputOnly SFBool go  outputOnly SFBool went ] { Group { } }
DEF A Taker { }
DEF B Taker { })",
                             diagnostics));
        scene_.newFrame(0);
        a_ = scene_.findName("A");
        b_ = scene_.findName("B");
        type_ = scene_.node(a_).typeIndex();
        go_ = scene_.type(type_).find("go");
        went_ = scene_.type(type_).find("went");
        set_ = std::make_shared<ChangeSet>();
        set_->from = scene_.sequence();
        set_->to = set_->from + 1;
        set_->time = 1;
    }
    void is(NodeId from, FieldIndex fromField, NodeId to, FieldIndex toField) {
        Change& c = set_->changes.emplace_back();
        c.kind = ChangeKind::addRoute;
        c.node = from;
        c.field = fromField;
        c.other = to;
        c.index = toField;
        c.isConnection = true;
    }
    NodeId create(std::uint32_t id, std::uint32_t scope) {
        Change& c = set_->changes.emplace_back();
        c.kind = ChangeKind::createNode;
        c.node = NodeId{id};
        c.index = type_.value;
        c.other = NodeId{scope};
        return c.node;
    }
    void expectRefused(std::string_view code) {
        const Result<> applied = scene_.apply(set_);
        ASSERT_FALSE(applied);
        EXPECT_EQ(applied.error().code.text(), code);
    }

    Scene scene_;
    NodeId a_, b_;
    TypeIndex type_;
    FieldIndex go_, went_;
    std::shared_ptr<ChangeSet> set_;
};

/// One event would be handed to and fro until the stack is full.
TEST_F(ForgedIs, APairThatHandsAnEventToAndFroIsRefused) {
    is(a_, go_, b_, go_);
    is(b_, go_, a_, go_);
    expectRefused("access");
}

TEST_F(ForgedIs, BodiesThatContainEachOtherAreRefused) {
    const std::uint32_t next = b_.value + 100;
    const NodeId x = create(next, next + 1), y = create(next + 1, next);
    is(x, go_, y, go_);
    is(y, go_, x, go_);
    expectRefused("cycle");
}

TEST_F(ForgedIs, AnOutputIsNoWayIn) {
    const NodeId inner = create(b_.value + 100, a_.value);
    is(a_, went_, inner, went_);
    expectRefused("access");
}

TEST_F(ForgedIs, AnInputIsNoWayOut) {
    const NodeId inner = create(b_.value + 100, a_.value);
    is(inner, go_, a_, go_);
    expectRefused("access");
}

TEST_F(ForgedIs, WhatADocumentCouldSayIsTaken) {
    const NodeId inner = create(b_.value + 100, a_.value);
    is(a_, go_, inner, go_);
    is(inner, went_, a_, went_);
    EXPECT_TRUE(scene_.apply(set_));
}

}  // namespace
}  // namespace rtsg
