// Which fields can change: the closure over routes, prototypes, sensors and scripts, built at once or step by step.
#include <algorithm>

#include <gtest/gtest.h>

#include <rtsg/core/mobility.h>
#include <rtsg/core/x3d.h>

#include "core/scene_check.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using test::Loaded;

struct Analysed : Loaded {
    Mobility mobility;
    Attachment attachment;
    explicit Analysed(std::string_view text) : Loaded(text) {
        EXPECT_TRUE(usable) << problems();
        attachment = scene.bus().attach(mobility);
    }
    bool may(std::string_view def, std::string_view name, NodeId scope = {}) { return may(named(def, scope), name); }
    bool may(NodeId id, std::string_view name) { return mobility.mayChange(scene.node(id), field(id, name)); }
    bool reported(NodeId id) const { return std::ranges::binary_search(mobility.changedNodes(), id); }
};

constexpr std::string_view kClock =
    "DEF C TimeSensor { loop TRUE } DEF P PositionInterpolator { key [0 1] keyValue [0 0 0 1 0 0] }"
    "DEF T Transform { children DEF S Shape { } } DEF U Transform { }";

TEST(Mobility, FollowsRoutesFromWhatActs) {
    Analysed a(std::string(kClock) +
               "ROUTE C.fraction_changed TO P.set_fraction ROUTE P.value_changed TO T.translation");
    EXPECT_TRUE(a.may("T", "translation"));
    EXPECT_FALSE(a.may("T", "scale"));
    EXPECT_FALSE(a.may("U", "translation"));
    EXPECT_FALSE(a.may("S", "geometry"));
    EXPECT_FALSE(a.may("P", "keyValue"));
    EXPECT_EQ(a.mobility.mayChange(a.scene.node(a.named("T"))), aspectBit(Aspect::transform));
    EXPECT_EQ(a.mobility.mayChange(a.scene.node(a.named("S"))), 0);
}

TEST(Mobility, WhatOnlyAnswersDoesNothingByItself) {
    Analysed a(std::string(kClock) + "ROUTE P.value_changed TO T.translation ROUTE T.translation TO U.translation");
    EXPECT_FALSE(a.may("T", "translation"));  // nothing ever drives P
    const NodeId c = a.named("C"), p = a.named("P");
    ASSERT_TRUE(a.scene.addRoute(c, a.field(c, "fraction_changed"), p, a.field(p, "set_fraction")));
    a.scene.newFrame(0);
    EXPECT_TRUE(a.may("T", "translation"));
    EXPECT_TRUE(a.may("U", "translation"));
    EXPECT_TRUE(a.reported(a.named("U")));
    EXPECT_FALSE(a.reported(a.named("S")));
    ASSERT_TRUE(a.scene.destroyNode(c));
    a.scene.newFrame(1);
    EXPECT_FALSE(a.may("U", "translation"));
    EXPECT_TRUE(a.reported(a.named("U")));
}

TEST(Mobility, JointsMoveWhileTheirHumanoidHasMotionsOrPoses) {
    Analysed a(
        "PROTO Bone [] { DEF B HAnimJoint { name \"k\" } } DEF H HAnimHumanoid { skeleton DEF R HAnimJoint { name "
        "\"r\" "
        "children DEF K Bone { } } joints [ USE R USE K ] motions DEF M HAnimMotion { } } DEF N HAnimPose { }");
    const NodeId h = a.named("H"), k = a.scene.effectiveNode(a.named("K"))->id();
    EXPECT_TRUE(a.may("R", "rotation"));
    EXPECT_TRUE(a.may("R", "translation"));
    EXPECT_TRUE(a.may(k, "rotation"));
    EXPECT_FALSE(a.may(h, "translation"));
    EXPECT_TRUE(a.may("M", "frameIndex"));
    ASSERT_TRUE(a.scene.set(h, x3d::HAnimHumanoid::motions, Array<NodeId>{}));
    a.scene.newFrame(1);
    EXPECT_FALSE(a.may("R", "rotation"));
    EXPECT_FALSE(a.may(k, "rotation"));
    EXPECT_TRUE(a.reported(a.named("R")));
    ASSERT_TRUE(a.scene.insertChild(h, x3d::HAnimHumanoid::children, a.named("N")));
    a.scene.newFrame(2);
    EXPECT_TRUE(a.may("R", "rotation"));
    ASSERT_TRUE(a.scene.destroyNode(h));
    a.scene.newFrame(3);
    EXPECT_FALSE(a.may("R", "rotation"));
}

TEST(Mobility, ALoopDoesNotKeepItselfAlive) {
    Analysed a(std::string(kClock) +
               "ROUTE T.translation TO U.translation ROUTE U.translation TO T.translation "
               "ROUTE C.fraction_changed TO P.set_fraction ROUTE P.value_changed TO T.translation");
    EXPECT_TRUE(a.may("U", "translation"));
    const NodeId p = a.named("P"), t = a.named("T");
    ASSERT_TRUE(a.scene.removeRoute(p, a.field(p, "value_changed"), t, a.field(t, "translation")));
    a.scene.newFrame(0);
    EXPECT_FALSE(a.may("T", "translation"));
    EXPECT_FALSE(a.may("U", "translation"));
}

TEST(Mobility, AnEventForTheInputChangesWhatItSets) {
    Analysed a(
        "DEF F IndexedFaceSet { } DEF G Group { } DEF X Script { outputOnly MFInt32 i outputOnly MFNode n }"
        "ROUTE X.i TO F.set_coordIndex ROUTE X.n TO G.removeChildren");
    EXPECT_TRUE(a.may("F", "coordIndex"));
    EXPECT_FALSE(a.may("F", "colorIndex"));
    EXPECT_TRUE(a.may("G", "children"));
}

TEST(Mobility, PassesThroughPrototypes) {
    Analysed a(
        "PROTO Mover [ inputOutput SFVec3f at 0 0 0 outputOnly SFFloat beat ] "
        "{ DEF B Transform { translation IS at } DEF K TimeSensor { loop TRUE fraction_changed IS beat } }"
        "DEF M Mover { } DEF N Mover { } DEF Q ScalarInterpolator { } DEF T Transform { }"
        "DEF V PositionInterpolator { }"
        "ROUTE M.beat TO V.set_fraction ROUTE V.value_changed TO N.at");
    const NodeId m = a.named("M"), n = a.named("N");
    EXPECT_TRUE(a.may(n, "at"));
    EXPECT_TRUE(a.may("B", "translation", n));
    EXPECT_FALSE(a.may(m, "at"));
    EXPECT_FALSE(a.may("B", "translation", m));
    EXPECT_TRUE(a.may(m, "beat"));
}

TEST(Mobility, AScriptChangesWhatItRefersTo) {
    Analysed a(std::string(kClock) +
               "DEF X Script { initializeOnly SFNode it USE T outputOnly SFVec3f out }"
               "DEF W Transform { } ROUTE T.scale TO W.scale");
    EXPECT_TRUE(a.may("T", "translation"));
    EXPECT_TRUE(a.may("T", "children"));
    EXPECT_FALSE(a.may("T", "bboxSize"));  // initializeOnly: no event changes it
    EXPECT_TRUE(a.may("W", "scale"));
    EXPECT_FALSE(a.may("U", "translation"));
    const NodeId x = a.named("X");
    ASSERT_TRUE(a.scene.setField(x, a.field(x, "it"), a.named("U")));
    a.scene.newFrame(0);
    EXPECT_FALSE(a.may("T", "translation"));
    EXPECT_FALSE(a.may("W", "scale"));
    EXPECT_TRUE(a.may("U", "translation"));
    EXPECT_TRUE(a.reported(a.named("T")) && a.reported(a.named("U")) && a.reported(a.named("W")));
}

TEST(Mobility, WithDirectOutputItsWholeNameSpace) {
    Analysed a(
        "PROTO Box2 [ initializeOnly SFFloat f 0 ] { DEF I Transform { } }"
        "PROTO Busy [ ] { DEF I Transform { } Script { directOutput TRUE } }"
        "DEF T Transform { } DEF A Box2 { } DEF B Busy { }");
    EXPECT_FALSE(a.may("T", "translation"));
    EXPECT_FALSE(a.may("I", "translation", a.named("A")));
    EXPECT_TRUE(a.may("I", "translation", a.named("B")));
    EXPECT_TRUE(a.may("I", "children", a.named("B")));
    // One at the top: the document, but no prototype's body.
    Analysed b(
        "PROTO Box2 [ ] { DEF I Transform { } } DEF T Transform { } DEF A Box2 { }"
        "DEF X Script { directOutput TRUE }");
    EXPECT_TRUE(b.may("T", "translation"));
    EXPECT_FALSE(b.may("I", "translation", b.named("A")));
    ASSERT_TRUE(b.scene.destroyNode(b.named("X")));
    b.scene.newFrame(0);
    EXPECT_FALSE(b.may("T", "translation"));
    ASSERT_EQ(b.mobility.changedScopes().size(), 1u);
    EXPECT_EQ(b.mobility.changedScopes()[0], NodeId{});
}

TEST(Mobility, AScriptThatIsHandedNodesMayChangeAnything) {
    Analysed a(
        "DEF T Transform { } DEF S TouchSensor { } DEF X Script { inputOnly MFNode take } "
        "DEF Y Script { outputOnly MFNode give } ROUTE Y.give TO X.take");
    EXPECT_TRUE(a.may("T", "translation"));
}

/// Scripts come from files, so the random edits start from a file with some.
constexpr std::string_view kSeedScene =
    "DEF X Script { initializeOnly SFNode it DEF T Transform { } inputOutput MFNode many [ ] directOutput FALSE"
    "  outputOnly SFVec3f out inputOnly SFFloat in }"
    "DEF Y Script { inputOutput SFVec3f v 0 0 0 directOutput TRUE }"
    "PROTO M [ inputOutput SFVec3f at 0 0 0 ] { DEF B Transform { translation IS at } Script { directOutput TRUE } }"
    "DEF N M { } ROUTE X.out TO N.at ROUTE N.at TO T.scale";

class MobilityLaws : public testing::TestWithParam<std::uint64_t> {};

TEST_P(MobilityLaws, StepByStepEqualsFromScratch) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Analysed a(kSeedScene);
    test::RandomEdits edits(a.scene, GetParam());
    for (const char* def : {"X", "Y", "N", "T"}) edits.adopt(a.named(def));
    Mobility slow;
    Attachment merged = a.scene.bus().attach(slow, Delivery::polled);
    for (int frame = 0; frame < 60; ++frame) {
        for (int i = 0; i < 10; ++i) edits.step();
        a.scene.newFrame(frame * .1);
        Mobility fresh;
        ASSERT_TRUE(fresh.apply(a.scene, a.scene.snapshot()));
        const bool compareSlow = frame % 7 == 3;
        if (compareSlow) merged.poll();
        a.scene.forEachNode([&](const Node& node) {
            for (FieldIndex f = 0; f < node.type().fields.size(); ++f) {
                const std::string what = node.type().name + "." + node.type().fields[f].name;
                ASSERT_EQ(a.mobility.mayChange(node, f), fresh.mayChange(node, f)) << what << ", frame " << frame;
                if (compareSlow) {
                    ASSERT_EQ(slow.mayChange(node, f), fresh.mayChange(node, f)) << what << " merged";
                }
            }
            ASSERT_EQ(a.mobility.mayChange(node), fresh.mayChange(node));
        });
    }
}

TEST_P(MobilityLaws, WhatTheCascadeChangesWasForeseen) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Analysed a(std::string(kClock) +
               "DEF C2 TimeSensor { loop TRUE } "
               "ROUTE C.fraction_changed TO P.set_fraction ROUTE P.value_changed TO T.scale");
    test::RandomEdits edits(a.scene, GetParam() ^ 0xFACE);
    for (const char* def : {"P", "T", "U", "C2"}) edits.adopt(a.named(def));
    std::size_t seen = 0, nodes = 0;
    double t = 0;
    for (int frame = 0; frame < 60; ++frame) {
        for (int i = 0; i < 12; ++i) edits.step();
        a.scene.newFrame(t += .1);  // also what the edits and events from outside set going
        for (int quiet = 0; quiet < 3; ++quiet) {
            std::vector<std::pair<NodeId, FieldIndex>> foreseen;
            a.scene.forEachNode([&](const Node& node) {
                for (FieldIndex f = 0; f < node.type().fields.size(); ++f)
                    if (a.mobility.mayChange(node, f)) foreseen.emplace_back(node.id(), f);
                ++nodes;
            });
            for (const Change& c : a.scene.newFrame(t += .1)->changes) {
                const Node& node = a.scene.node(c.node);
                EXPECT_TRUE(std::ranges::binary_search(foreseen, std::pair(c.node, c.field)))
                    << node.type().name << "." << node.type().fields[c.field].name << ", frame " << frame;
                ++seen;
            }
        }
    }
    EXPECT_GT(seen, 0u);
    EXPECT_GT(nodes, 0u);
}

TEST_P(MobilityLaws, ChangedAnswersAreReported) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Analysed a(kSeedScene);
    test::RandomEdits edits(a.scene, GetParam() ^ 0xBEEF);
    for (const char* def : {"X", "Y", "N", "T"}) edits.adopt(a.named(def));
    std::map<NodeId, AspectMask> before;
    for (int frame = 0; frame < 60; ++frame) {
        for (int i = 0; i < 6; ++i) edits.step();
        a.scene.newFrame(frame * .1);
        std::map<NodeId, AspectMask> now;
        a.scene.forEachNode([&](const Node& node) {
            const AspectMask mask = a.mobility.mayChange(node);
            now[node.id()] = mask;
            const auto old = before.find(node.id());
            if (old == before.end() || old->second == mask) return;
            const bool viaScope = std::ranges::binary_search(a.mobility.changedScopes(), node.scope());
            EXPECT_TRUE(a.reported(node.id()) || viaScope) << node.type().name << ", frame " << frame;
        });
        before = std::move(now);
    }
}

INSTANTIATE_TEST_SUITE_P(Seeds, MobilityLaws, testing::Range<std::uint64_t>(1, 21));

}  // namespace
}  // namespace rtsg
