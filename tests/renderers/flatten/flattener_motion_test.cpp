// Which instances are said to move, and which to move together: routes, prototypes and scripts, come and gone.
#include <gtest/gtest.h>

#include <map>
#include <set>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/mesh.h>

#include "core/scene_check.h"
#include "renderers/scene_edits.h"

namespace rtsg {
namespace {

std::shared_ptr<const Mesh> noMesh(const Scene&, NodeId) {
    return std::make_shared<Mesh>();
}

constexpr std::string_view kClock =
    "DEF C TimeSensor { loop TRUE } DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 0 0 ] }"
    "ROUTE C.fraction_changed TO P.set_fraction ";

struct Moved : test::Loaded {
    Flattener flattener{{.meshes = noMesh}};
    struct Follow final : Subscriber {
        Flattener* flattener = nullptr;
        InstanceDelta last;
        Result<> apply(const Scene& s, const ChangeSet& changes) override {
            last = flattener->apply(s, changes);
            return {};
        }
    } follow;
    Attachment attachment;

    explicit Moved(std::string_view text) : Loaded(text) {
        EXPECT_TRUE(usable) << problems();
        follow.flattener = &flattener;
        attachment = scene.bus().attach(follow);
    }
    const Instance& of(const char* shape) {
        const NodeId id = scene.findName(shape);
        for (const Instance& i : flattener.instances())
            if (i.id && i.shape == id) return i;
        ADD_FAILURE() << "no instance of " << shape;
        static const Instance none;
        return none;
    }
    bool moves(const char* shape) { return of(shape).motion == Motion::moving; }
    void route(const char* from, const char* field, const char* to, const char* toField, bool add = true) {
        const NodeId a = scene.findName(from), b = scene.findName(to);
        const FieldIndex f = scene.node(a).type().find(field), g = scene.node(b).type().find(toField);
        EXPECT_TRUE(add ? scene.addRoute(a, f, b, g) : scene.removeRoute(a, f, b, g));
        scene.seal();
    }
};

TEST(FlattenerMotion, FollowsRoutesThatComeAndGo) {
    Moved m(std::string(kClock) +
            "DEF T Transform { children [ DEF A Shape { } Group { children DEF B Shape { } } ] } DEF D Shape { } ");
    EXPECT_FALSE(m.moves("A"));
    m.route("P", "value_changed", "T", "translation");
    EXPECT_TRUE(m.moves("A") && m.moves("B"));
    EXPECT_FALSE(m.moves("D"));
    EXPECT_NE(m.of("A").rigid, 0u);
    EXPECT_EQ(m.of("A").rigid, m.of("B").rigid);
    EXPECT_EQ(m.of("D").rigid, 0u);
    EXPECT_EQ(m.follow.last.rebound.size(), 2u);
    EXPECT_TRUE(m.follow.last.moved.empty() && m.follow.last.added.empty() && m.follow.last.removed.empty());
    m.route("C", "fraction_changed", "P", "set_fraction", false);  // what drives it is gone
    EXPECT_FALSE(m.moves("A") || m.moves("B"));
    m.route("C", "fraction_changed", "P", "set_fraction");
    m.route("P", "value_changed", "T", "translation", false);
    EXPECT_FALSE(m.moves("A") || m.moves("B"));
}

TEST(FlattenerMotion, WheelsAreABodyEachInTheirCar) {
    Moved m(
        std::string(kClock) +
        "DEF Car Transform { children [ DEF A Shape { } DEF B Shape { }"
        "  DEF W Transform { children [ DEF X Shape { } DEF Y Shape { } ] } Transform { children DEF Z Shape { } } ] } "
        "ROUTE P.value_changed TO Car.translation ROUTE P.value_changed TO W.translation");
    EXPECT_EQ(m.of("A").rigid, m.of("B").rigid);
    EXPECT_EQ(m.of("A").rigid, m.of("Z").rigid);
    EXPECT_EQ(m.of("X").rigid, m.of("Y").rigid);
    EXPECT_NE(m.of("A").rigid, m.of("X").rigid);
    EXPECT_TRUE(m.moves("A") && m.moves("X") && m.moves("Z"));
}

TEST(FlattenerMotion, PassesThroughPrototypes) {
    Moved m("PROTO Cart [ inputOutput SFVec3f at 0 0 0 ] { Transform { translation IS at children DEF S Shape { } } }" +
            std::string(kClock) + "DEF N Cart { } DEF M Cart { } ROUTE P.value_changed TO N.at");
    std::map<NodeId, bool> moves;
    for (const Instance& i : m.flattener.instances())
        if (i.id) moves[m.flattener.path(i.id).front()] = i.motion == Motion::moving;
    EXPECT_EQ(moves.size(), 2u);
    EXPECT_TRUE(moves[m.scene.findName("N")]);
    EXPECT_FALSE(moves[m.scene.findName("M")]);
}

TEST(FlattenerMotion, AScriptMovesWhatItRefersToOrAllThereIs) {
    Moved m(
        "DEF T Transform { children DEF A Shape { } } DEF U Transform { children DEF B Shape { } }"
        "DEF X Script { initializeOnly SFNode it USE T outputOnly SFVec3f out }");
    EXPECT_TRUE(m.moves("A"));
    EXPECT_FALSE(m.moves("B"));
    const NodeId x = m.scene.findName("X");
    ASSERT_TRUE(m.scene.setField(x, m.scene.node(x).type().find("it"), m.scene.findName("U")));
    m.scene.seal();
    EXPECT_FALSE(m.moves("A"));
    EXPECT_TRUE(m.moves("B"));
    ASSERT_TRUE(m.scene.setField(x, m.scene.node(x).type().find("directOutput"), true));
    m.scene.seal();
    EXPECT_TRUE(m.moves("A") && m.moves("B"));
    ASSERT_TRUE(m.scene.destroyNode(x));
    m.scene.seal();
    EXPECT_FALSE(m.moves("A") || m.moves("B"));
}

// The pivot is what stays where it is when the innermost thing that moves turns: its `center`, seen from the shape.
TEST(FlattenerMotion, PivotsAreWhatStaysWhenTheThingTurns) {
    Moved m(
        "DEF U Transform { translation 5 0 0 rotation 1 0 0 .5 children DEF T Transform { center 1 2 3 translation 0 0 "
        "4 "
        "children [ DEF A Shape { } Transform { translation 7 0 0 rotation 0 0 1 1.1 scale 2 2 2 children DEF B Shape "
        "{ } } ] } } DEF F Shape { }");
    const auto seen = [&](const char* shape) {
        const Instance& i = m.of(shape);
        return i.worldFromLocal * Vec4d(i.pivot, 1);
    };
    for (int step = 0; step < 3; ++step) {
        const Vec3d before[] = {seen("A"), seen("B")};
        ASSERT_TRUE(
            m.scene.set(m.scene.findName("T"), x3d::Transform::rotation, Rotation{0, 1, 0, .6f * float(step + 1)}));
        m.scene.seal();
        if (step > 0) {  // from the first time on it is known to move
            EXPECT_NEAR(glm::length(seen("A") - before[0]), 0, 1e-5);
            EXPECT_NEAR(glm::length(seen("B") - before[1]), 0, 1e-5);
        }
        EXPECT_NEAR(glm::length(seen("A") - seen("B")), 0, 1e-5) << "of what moves together it is one place";
        EXPECT_EQ(m.of("A").pivot, Vec3f(1, 2, 3));
    }
    EXPECT_EQ(m.of("F").pivot, Vec3f(0));
}

TEST(FlattenerMotion, WhatDeformsIsNoPartOfABody) {
    Moved m(std::string(kClock) +
            "DEF I CoordinateInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 0 0 ] }"
            "DEF T Transform { children [ DEF A Shape { geometry DEF G IndexedFaceSet { coord DEF K Coordinate { } } }"
            "  DEF B Shape { geometry Box { } } ] } ROUTE P.value_changed TO T.translation ");
    EXPECT_TRUE(m.moves("A"));
    EXPECT_EQ(m.of("A").rigid, m.of("B").rigid);
    m.route("C", "fraction_changed", "I", "set_fraction");
    m.route("I", "value_changed", "K", "point");
    EXPECT_EQ(m.of("A").rigid, 0u);
    EXPECT_NE(m.of("B").rigid, 0u);
    m.route("P", "value_changed", "T", "translation", false);
    EXPECT_TRUE(m.moves("A"));
    EXPECT_FALSE(m.moves("B"));
    m.route("I", "value_changed", "K", "point", false);
    EXPECT_FALSE(m.moves("A"));
}

TEST(FlattenerMotion, WhatIsSeenToMoveMovesTogetherFromThenOn) {
    Moved m("DEF T Transform { children [ DEF A Shape { } DEF B Shape { } ] } DEF D Shape { }");
    EXPECT_EQ(m.of("A").rigid, 0u);
    ASSERT_TRUE(m.scene.set(m.scene.findName("T"), x3d::Transform::translation, Vec3f(1, 2, 3)));
    m.scene.seal();
    EXPECT_NE(m.of("A").rigid, 0u);
    EXPECT_EQ(m.of("A").rigid, m.of("B").rigid);
    EXPECT_EQ(m.of("D").rigid, 0u);
    EXPECT_FALSE(m.moves("A")) << "nothing says that it will again";
    EXPECT_EQ(m.follow.last.moved.size(), 2u);
    EXPECT_EQ(m.follow.last.rebound.size(), 2u);
    ASSERT_TRUE(m.scene.set(m.scene.findName("T"), x3d::Transform::translation, Vec3f(4, 2, 3)));
    m.scene.seal();
    EXPECT_EQ(m.follow.last.moved.size(), 2u);
    EXPECT_TRUE(m.follow.last.rebound.empty());
}

/// By path: whether each instance and each placed thing is said to move.
std::multimap<std::vector<NodeId>, Motion> motions(const Flattener& flattener) {
    std::multimap<std::vector<NodeId>, Motion> all;
    for (const Instance& i : flattener.instances())
        if (i.id) all.emplace(flattener.path(i.id), i.motion);
    for (const Placed& p : flattener.placed())
        if (p.id) all.emplace(flattener.placedPath(p.id), p.motion);
    return all;
}

class FlattenerMotionLaw : public testing::TestWithParam<std::uint64_t> {};

TEST_P(FlattenerMotionLaw, StepByStepEqualsFromScratch) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Moved m(std::string(kClock) + "DEF X Script { inputOutput SFNode it NULL directOutput FALSE }");
    const NodeId interpolator = m.scene.findName("P"), script = m.scene.findName("X");
    test::Edits edits(m.scene, GetParam());
    std::mt19937_64 random(GetParam() ^ 0xF00D);
    const auto any = [&] { return edits.nodes()[random() % edits.nodes().size()]; };
    std::size_t moving = 0;
    for (int frame = 0; frame < 400; ++frame) {
        for (int i = 0; i < 12; ++i) edits.step();
        for (int i = 0; i < 6; ++i) {
            const NodeId node = any();
            const FieldIndex field = m.scene.node(node).type().findExact("translation");
            if (field == kNoField) continue;
            const FieldIndex value = x3d::PositionInterpolator::value_changed.index;
            (void)(random() % 3 ? m.scene.addRoute(interpolator, value, node, field)
                                : m.scene.removeRoute(interpolator, value, node, field));
        }
        if (frame % 9 == 0) {
            ASSERT_TRUE(m.scene.setField(script, m.scene.node(script).type().find("it"), any()));
        }
        if (frame % 31 == 30) {
            ASSERT_TRUE(m.scene.setField(script, m.scene.node(script).type().find("directOutput"), frame % 2 == 0));
        }
        m.scene.seal();
        Flattener fresh({.meshes = noMesh});
        fresh.apply(m.scene, m.scene.snapshot());
        ASSERT_EQ(motions(m.flattener), motions(fresh)) << "frame " << frame;
        for (const auto& [path, motion] : motions(fresh)) moving += motion == Motion::moving;
    }
    EXPECT_GT(moving, 200u) << "or nothing was tested";
}

INSTANTIATE_TEST_SUITE_P(Seeds, FlattenerMotionLaw, testing::Values(1, 2, 3));

}  // namespace
}  // namespace rtsg
