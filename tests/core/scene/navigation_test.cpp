// The viewer's moves by applications, what they may not be, and what a frame's length does not change.
#include <rtsg/core/navigation.h>

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "input/viewer_move.h"
#include "support/simple_space.h"

namespace rtsg {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

struct NavigatedScene {
    Scene scene;
    test::SimpleSpace space{scene};

    explicit NavigatedScene(const std::string& text) {
        Diagnostics diagnostics("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        scene.setSpaceQueries(&space);
        scene.setNavigation(true);
        scene.newFrame(0);
    }
    void press(const char* name, bool down) {
        const auto key = KeyInput::named(name, down);
        ASSERT_TRUE(key);
        ASSERT_TRUE(sendKey(scene, *key));
    }
    std::string problems() {
        std::string text;
        for (const Diagnostic& d : scene.diagnostics().all()) text += d.text + "\n";
        return text;
    }
    /// Checks the viewer's pose.
    void expect(const Vec3d& position, const Vec3d& ahead, double tolerance = 1e-6) {
        const ViewerPose pose = viewerPose(scene);
        const Vec3d given = pose.orientation * Vec3d(0, 0, -1);
        EXPECT_LT(glm::length(pose.position - position), tolerance)
            << pose.position.x << ' ' << pose.position.y << ' ' << pose.position.z;
        EXPECT_LT(glm::length(given - glm::normalize(ahead)), tolerance) << given.x << ' ' << given.y << ' ' << given.z;
    }
};

/// 23.4.2: the wall at -2 is none where it has a proxy, which is a wall at -4; switched off, there is neither.
TEST(Navigation, MeetsTheProxyInPlaceOfTheChildren) {
    NavigatedScene s(
        "NavigationInfo { type \"FLY\" speed 1 avatarSize [ .25 1.6 .75 ] } Viewpoint { position 0 0 0 }\n"
        "DEF C Collision { children Transform { translation 0 0 -3 children Shape { geometry Box { } } }\n"
        "proxy Transform { translation 0 0 -5 children Shape { geometry Box { } } } }");
    const NodeId collision = s.scene.findName("C");
    const auto fly = [&](double seconds) {
        s.press("UP", true);
        for (int i = 0; i < 10 * seconds; ++i) s.scene.newFrame(s.scene.now() + .1);
        s.press("UP", false);
        s.scene.newFrame(s.scene.now());
    };
    fly(9);
    s.expect({0, 0, -3.75}, {0, 0, -1}, 1e-3);
    ASSERT_TRUE(s.scene.set(collision, x3d::Collision::enabled, false));
    fly(6);
    EXPECT_LT(viewerPose(s.scene).position.z, -9);
}

TEST(Navigation, GoesAsFarHoweverTimeIsCut) {
    for (const double rate : {1.0, 7.0, 60.0}) {
        NavigatedScene s("NavigationInfo { type \"FLY\" speed 3 } Viewpoint { }");
        s.press("UP", true);
        s.scene.newFrame(1);
        for (int i = 1; i < 2 * rate; ++i) s.scene.newFrame(1 + i / rate);
        s.press("UP", false);
        s.scene.newFrame(3);
        s.scene.newFrame(9);
        s.expect({0, 0, 4}, {0, 0, -1});
    }
}

TEST(Navigation, CostsNothingWhereNobodyNavigates) {
    NavigatedScene s("NavigationInfo { type \"WALK\" } Viewpoint { } Shape { geometry Box { } }");
    for (int i = 1; i < 5; ++i) EXPECT_TRUE(s.scene.newFrame(i)->changes.empty());
    s.press("UP", true);
    s.scene.newFrame(5);
    s.press("UP", false);
    s.scene.newFrame(6);
    s.scene.newFrame(7);
    for (int i = 8; i < 12; ++i) EXPECT_TRUE(s.scene.newFrame(i)->changes.empty()) << "standing still";
}

TEST(Navigation, IsOffUntilItIsSwitchedOn) {
    NavigatedScene s("Viewpoint { }");
    s.scene.setNavigation(false);
    ASSERT_TRUE(sendWheel(s.scene, 0, -3));
    s.press("PGDN", true);
    s.scene.newFrame(1);
    s.expect({0, 0, 10}, {0, 0, -1});
}

/// Two numbers more in an event of the wheel.
TEST(Navigation, SticksTurnTheViewerOrLeadHimRound) {
    const auto rotation = [](NavigatedScene& s, double right, double up) {
        const auto wheel = x3d::RtsgScene::wheel.index;
        ASSERT_TRUE(s.scene.sendEvent(s.scene.root(), wheel, Array<double>{0, 0, right, up}));
        s.scene.newFrame(s.scene.now() + 1);
    };
    NavigatedScene flies("NavigationInfo { type \"FLY\" } Viewpoint { }");
    flies.scene.newFrame(1);
    rotation(flies, .5, 0);
    flies.expect({0, 0, 10}, {std::sin(.5), 0, -std::cos(.5)});
    rotation(flies, 0, .25);
    flies.expect({0, 0, 10}, {std::sin(.5) * std::cos(.25), std::sin(.25), -std::cos(.5) * std::cos(.25)});
    rotation(flies, NAN, 0);
    flies.expect({0, 0, 10}, {std::sin(.5) * std::cos(.25), std::sin(.25), -std::cos(.5) * std::cos(.25)});
    NavigatedScene goesRound("NavigationInfo { type \"EXAMINE\" } Viewpoint { }");
    goesRound.scene.newFrame(1);
    rotation(goesRound, .5, 0);
    goesRound.expect({-10 * std::sin(.5), 0, 10 * std::cos(.5)}, {std::sin(.5), 0, -std::cos(.5)});  // as by RIGHT
}

TEST(Navigation, ApplicationsMoveTheViewer) {
    NavigatedScene s(
        "DEF N NavigationInfo { transitionTime 2 } Transform { translation 0 0 -10 scale 2 2 2 children "
        "DEF V Viewpoint { orientation 0 1 0 1 } }");
    ASSERT_TRUE(moveViewer(s.scene, {{1, 2, 3}, glm::angleAxis(M_PI / 2, Vec3d(0, 1, 0))}, false));
    s.scene.newFrame(1);
    s.expect({1, 2, 3}, {-1, 0, 0});
    ASSERT_TRUE(moveViewer(s.scene, {{3, 2, 3}, glm::angleAxis(M_PI, Vec3d(0, 1, 0))}));
    s.scene.newFrame(2);
    s.expect({1, 2, 3}, {-1, 0, 0});
    s.scene.newFrame(3);
    s.expect({2, 2, 3}, {-1, 0, 1});
    EXPECT_FALSE(s.scene.node(s.scene.findName("N")).get(x3d::NavigationInfo::transitionComplete));
    s.scene.newFrame(4);
    s.expect({3, 2, 3}, {0, 0, 1});
    EXPECT_TRUE(s.scene.node(s.scene.findName("N")).get(x3d::NavigationInfo::transitionComplete));
    EXPECT_EQ(s.scene.node(s.scene.findName("V")).get(x3d::Viewpoint::position), Vec3f(0, 0, 10));
    EXPECT_FALSE(moveViewer(s.scene, {{NAN, 0, 0}, {1, 0, 0, 0}}));
    EXPECT_FALSE(moveViewer(s.scene, {{0, 0, 0}, {0, 0, 0, 0}}));
    NavigatedScene without("Group { }");
    EXPECT_THAT(moveViewer(without.scene, {}).error().text, HasSubstr("no viewpoint is bound"));
    NavigatedScene flat("Transform { scale 1 0 1 children Viewpoint { } }");
    EXPECT_FALSE(moveViewer(flat.scene, {}));
}

TEST(Navigation, AKeyThatIsLetGoAsAnApplicationMovesTheViewerIsLetGo) {
    NavigatedScene s("NavigationInfo { type \"FLY\" } Viewpoint { }");
    s.press("UP", true);
    s.scene.newFrame(1);
    s.press("UP", false);
    ASSERT_TRUE(moveViewer(s.scene, {{5, 0, 0}, {1, 0, 0, 0}}, false));
    s.scene.newFrame(2);
    s.scene.newFrame(3);
    s.expect({5, 0, 0}, {0, 0, -1});
}

TEST(Navigation, ViewAllShowsTheBoxOfAllShapes) {
    NavigatedScene s(
        "NavigationInfo { transitionType \"TELEPORT\" } Viewpoint { fieldOfView 1.04719755 orientation 0 1 0 "
        "1.57079633 } "
        "Transform { translation 2 1 0 children Shape { geometry Box { size 4 2 4 } } } "
        "Transform { translation -4 0 3 children Shape { geometry Sphere { } } }");
    ASSERT_TRUE(viewAll(s.scene, s.space));
    s.scene.newFrame(1);
    // From -5 -1 -2 to 4 2 4: the middle is -.5 .5 1, half the diagonal sqrt(81 + 9 + 36) / 2.
    s.expect({-.5 + std::sqrt(126.0), .5, 1}, {-1, 0, 0}, 1e-5);
    NavigatedScene empty("Viewpoint { }");
    EXPECT_THAT(viewAll(empty.scene, empty.space).error().text, HasSubstr("nothing"));
}

TEST(Navigation, ViewpointsAreThoseOfTheActiveLayerInOrder) {
    NavigatedScene s(
        "DEF A Viewpoint { } Switch { whichChoice 0 children [ Group { children DEF B OrthoViewpoint { } } ] } "
        "LayerSet { activeLayer 1 layers [ DEF L Layer { children [ DEF C Viewpoint { } DEF D Viewpoint { } ] } ] } "
        "DEF E Viewpoint { }");
    const auto id = [&](const char* name) { return s.scene.findName(name); };
    EXPECT_THAT(viewpoints(s.scene), ElementsAre(id("C"), id("D")));
    ASSERT_TRUE(bindViewpoint(s.scene, ViewpointChoice::next));
    s.scene.newFrame(1);
    EXPECT_TRUE(s.scene.node(id("D")).get(x3d::Viewpoint::isBound));
    ASSERT_TRUE(bindViewpoint(s.scene, ViewpointChoice::next));
    s.scene.newFrame(2);
    EXPECT_TRUE(s.scene.node(id("C")).get(x3d::Viewpoint::isBound));
    NavigatedScene without("Group { }");
    EXPECT_FALSE(bindViewpoint(without.scene, ViewpointChoice::first));
    EXPECT_THAT(viewpoints(without.scene), ElementsAre());
}

TEST(Navigation, TypesAreTheFirstThatIsKnown) {
    const auto typeOf = [](const std::string& types) {
        NavigatedScene s("NavigationInfo { type [ " + types + " ] } Viewpoint { }");
        return navigationType(s.scene);
    };
    EXPECT_EQ(typeOf(R"("WALK" "ANY")"), NavigationType::walk);
    EXPECT_EQ(typeOf(R"("HOVER" "FLY")"), NavigationType::fly);
    EXPECT_EQ(typeOf(R"("ANY" "WALK")"), NavigationType::examine);
    EXPECT_EQ(typeOf(R"("LOOKAT")"), NavigationType::lookAt);
    EXPECT_EQ(typeOf(R"("NONE" "WALK")"), NavigationType::none);
    EXPECT_EQ(typeOf(R"("HOVER")"), NavigationType::examine);
}

TEST(Navigation, MovesThatAreNoneAreRefused) {
    NavigatedScene s("DEF V Viewpoint { }");
    const auto send = [&](Array<double> value) {
        ASSERT_TRUE(s.scene.sendEvent(s.scene.root(), x3d::RtsgScene::navigate.index, value));
        s.scene.newFrame(s.scene.now() + 1);
        s.expect({0, 0, 10}, {0, 0, -1});
    };
    ViewerMove move;
    move.kind = ViewerMove::Kind::jump;
    move.viewpoint = s.scene.findName("V");
    move.offset.position = {1, 0, 0};
    const Array<double> good = move.toValue();
    for (std::size_t i = 0; i < good.size(); ++i)
        for (const double wrong : {double(NAN), double(INFINITY), -1.5, 4e10}) {
            if (i >= 2 && i < 5 && std::isfinite(wrong)) continue;  // a position may be anywhere
            if (i >= 9 && std::isfinite(wrong)) continue;
            Array<double> bad = good;
            bad.mutableData()[i] = wrong;
            send(bad);
        }
    send({});
    send({1, 2, 3});
    send(Array<double>::ofSize(20));
    EXPECT_THAT(s.problems(), HasSubstr("not finite"));
    EXPECT_THAT(s.problems(), HasSubstr("wrong length"));
    EXPECT_THAT(s.problems(), HasSubstr("no rotation"));
    move.viewpoint = NodeId{4'000'000};  // it is about what is bound, whatever its number was where it was recorded
    ASSERT_TRUE(s.scene.sendEvent(s.scene.root(), x3d::RtsgScene::navigate.index, move.toValue()));
    s.scene.newFrame(s.scene.now() + 1);
    s.expect({1, 0, 10}, {0, 0, -1});
}

TEST(Navigation, ValuesComeBack) {
    ViewerMove move{ViewerMove::Kind::look, NodeId{7}, {{1, 2, 3}, glm::angleAxis(.5, Vec3d(0, 1, 0))}, {4, 5, 6}, {}};
    const auto plain = ViewerMove::fromValue(move.toValue());
    ASSERT_TRUE(plain);
    EXPECT_EQ(plain->kind, move.kind);
    EXPECT_EQ(plain->viewpoint, move.viewpoint);
    EXPECT_EQ(plain->offset, move.offset);
    EXPECT_EQ(plain->center, move.center);
    EXPECT_FALSE(plain->state);
    move.state = NavigationState{NodeId{9}, 21, true, true, true, {.25, -.5}, 3};
    const auto whole = ViewerMove::fromValue(move.toValue());
    ASSERT_TRUE(whole && whole->state);
    EXPECT_EQ(*whole->state, *move.state);
    EXPECT_EQ(NavigationState::fromValue(move.state->toValue()), *move.state);
    EXPECT_TRUE(NavigationState().toValue().empty());
    EXPECT_EQ(NavigationState::fromValue(Array<double>{1, 2, NAN}), NavigationState());
}

}  // namespace
}  // namespace rtsg
