// Sets merged into one: nodes that go and come again under their number, as those of a part of a scene do.
#include <algorithm>

#include <rtsg/core/change.h>

#include <gtest/gtest.h>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

Change editOf(ChangeKind kind, NodeId node, NodeId other = {}, std::uint32_t index = 0, FieldIndex field = kNoField) {
    Change c;
    c.kind = kind;
    c.node = node;
    c.other = other;
    c.index = index;
    c.field = field;
    return c;
}

Change writeOf(NodeId node, FieldIndex field, Value value) {
    Change c;
    c.node = node;
    c.field = field;
    c.value = std::move(value);
    return c;
}

/// A lift with a lamp and a PROTO instance in it, and frames in which it goes and comes again.
class GoesAndComes : public ::testing::Test {
  protected:
    static constexpr const char* kScene = R"(#X3D V4.0 utf8
PROFILE Immersive
PROTO Knob [ inputOutput SFVec3f at 0 0 0 ] { Transform { translation IS at } }
DEF LIFT Transform { translation 1 2 3 scale 2 2 2 children [ DEF LAMP PointLight { intensity .5 } DEF SPOT SpotLight { } ] }
DEF KNOB Knob { at 4 5 6 }
DEF P PositionInterpolator { }
ROUTE P.value_changed TO LIFT.translation
)";
    GoesAndComes() {
        for (Scene* scene : {&stepwise, &merged}) {
            scene->setBehavioursEnabled(false);
            Diagnostics diagnostics;
            EXPECT_TRUE(loadText(*scene, kScene, diagnostics));
            scene->newFrame(0);
        }
        root = stepwise.root();
        lift = stepwise.findName("LIFT");
        lamp = stepwise.findName("LAMP");
        spot = stepwise.findName("SPOT");
        knob = stepwise.findName("KNOB");
        mover = stepwise.findName("P");
        EXPECT_EQ(merged.hash(), stepwise.hash());
    }
    Change route(ChangeKind kind) const {
        return editOf(kind, mover, lift, x3d::Transform::translation.index,
                      x3d::PositionInterpolator::value_changed.index);
    }
    std::vector<Change> goes() const {
        const auto& list = stepwise.node(root).get(x3d::RtsgScene::children);
        const auto at = std::ranges::find(list, lift) - list.begin();
        return {editOf(ChangeKind::removeChild, root, lift, std::uint32_t(at), x3d::RtsgScene::children.index),
                route(ChangeKind::removeRoute), editOf(ChangeKind::destroyNode, lift),
                editOf(ChangeKind::destroyNode, lamp), editOf(ChangeKind::destroyNode, spot)};
    }
    /// As before, apart from the translation and the SpotLight.
    std::vector<Change> comes() const {
        return {editOf(ChangeKind::createNode, lift, {}, x3d::Transform::type.value),
                editOf(ChangeKind::createNode, lamp, {}, x3d::PointLight::type.value),
                writeOf(lift, x3d::Transform::scale.index, Vec3f(3, 3, 3)),
                writeOf(lamp, x3d::PointLight::radius.index, 7.f),
                editOf(ChangeKind::insertChild, lift, lamp, 0, x3d::Transform::children.index),
                editOf(ChangeKind::insertChild, root, lift, 0, x3d::RtsgScene::children.index),
                route(ChangeKind::addRoute)};
    }
    std::vector<Change> goesAgain() const {
        return {editOf(ChangeKind::removeChild, root, lift, 0, x3d::RtsgScene::children.index),
                route(ChangeKind::removeRoute), editOf(ChangeKind::destroyNode, lift),
                editOf(ChangeKind::destroyNode, lamp)};
    }
    void step(std::vector<Change> changes) {
        auto set = std::make_shared<ChangeSet>();
        set->from = stepwise.sequence();
        set->to = set->from + 1;
        set->changes = std::move(changes);
        const auto applied = stepwise.apply(set);
        ASSERT_TRUE(applied) << applied.error().text;
        set->hash = stepwise.hash();
        composer.add(*set);
    }
    void expectSame() {
        const auto set = std::make_shared<ChangeSet>(composer.take(&merged));
        const auto applied = merged.apply(set);
        ASSERT_TRUE(applied) << applied.error().text;
        EXPECT_EQ(merged.dump(), stepwise.dump());
        EXPECT_EQ(merged.hash(), stepwise.hash());
    }
    Scene stepwise, merged;
    NodeId root, lift, lamp, spot, knob, mover;
    ChangeComposer composer;
};

TEST_F(GoesAndComes, HasWhatItCameWithAndNothingOfBefore) {
    step(goes());
    step(comes());
    expectSame();
    EXPECT_TRUE(merged.name(lift).empty());
    EXPECT_EQ(merged.node(lift).get(x3d::Transform::translation), Vec3f(0));
    EXPECT_EQ(merged.node(lamp).get(x3d::PointLight::intensity), 1.f);
    EXPECT_FALSE(merged.find(spot));
    EXPECT_EQ(merged.routeCount(), 1u);
}

TEST_F(GoesAndComes, IsGoneWhenItHasGoneASecondTime) {
    step(goes());
    step(comes());
    step(goesAgain());
    expectSame();
    EXPECT_FALSE(merged.find(lift) || merged.find(lamp) || merged.find(spot));
    EXPECT_EQ(merged.routeCount(), 0u);
}

TEST_F(GoesAndComes, IsThereWhenItHasComeASecondTime) {
    step(goes());
    step(comes());
    step(goesAgain());
    step(comes());
    step({writeOf(lift, x3d::Transform::translation.index, Vec3f(9, 9, 9)),
          editOf(ChangeKind::removeChild, lift, lamp, 0, x3d::Transform::children.index)});
    expectSame();
    EXPECT_TRUE(merged.node(lift).get(x3d::Transform::children).empty());
}

/// Its slots move together when most of what was merged is dead.
TEST_F(GoesAndComes, OverAndOverAgain) {
    step(goes());
    for (int i = 0; i < 300; ++i) {
        step(comes());
        step(goesAgain());
    }
    step(comes());
    expectSame();
}

/// The type of a PROTO instance is the scene's; without it the set says that it cannot be applied.
TEST_F(GoesAndComes, AsAPrototypeInstanceNeedsTheScene) {
    const std::uint32_t type = stepwise.node(knob).typeIndex().value;
    const FieldIndex at = stepwise.node(knob).type().findExact("at");
    std::vector<Change> goesAway;
    const auto& list = stepwise.node(root).get(x3d::RtsgScene::children);
    goesAway.push_back(editOf(ChangeKind::removeChild, root, knob,
                              std::uint32_t(std::ranges::find(list, knob) - list.begin()),
                              x3d::RtsgScene::children.index));
    for (const Route& r : stepwise.routesFrom(knob)) {
        Change c = editOf(ChangeKind::removeRoute, r.fromNode, r.toNode, r.toField, r.fromField);
        c.isConnection = r.isConnection;
        goesAway.push_back(c);
    }
    for (const Route& r : stepwise.routesTo(knob)) {
        Change c = editOf(ChangeKind::removeRoute, r.fromNode, r.toNode, r.toField, r.fromField);
        c.isConnection = r.isConnection;
        goesAway.push_back(c);
    }
    goesAway.push_back(editOf(ChangeKind::destroyNode, knob));
    step(goesAway);
    step({editOf(ChangeKind::createNode, knob, {}, type),
          editOf(ChangeKind::insertChild, root, knob, 0, x3d::RtsgScene::children.index)});
    const ChangeSet both = composer.take(&merged);
    composer.add(both);
    expectSame();
    EXPECT_EQ(merged.node(knob).value(at), Value(Vec3f(0)));
    ChangeComposer without;
    ChangeSet first, second;
    first.from = 1, first.to = second.from = 2, second.to = 3;
    first.changes = {editOf(ChangeKind::destroyNode, knob)};
    second.changes = {editOf(ChangeKind::createNode, knob, {}, type)};
    without.add(first);
    without.add(second);
    const ChangeSet unknown = without.take();
    ASSERT_EQ(unknown.changes.size(), 1u);
    EXPECT_EQ(unknown.changes[0].kind, ChangeKind::createNode);
}

}  // namespace
}  // namespace rtsg
