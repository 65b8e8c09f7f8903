// The viewer's moves by applications, what they may not be, and what a frame's length does not change.
#include <rtsg/core/navigation.h>

#include <array>
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

/// Nearness changes nothing in a parallel view, so the wheel enlarges it, about its middle.
TEST(Navigation, AParallelViewIsEnlargedByTheWheel) {
    NavigatedScene s("NavigationInfo { type \"EXAMINE\" } DEF V OrthoViewpoint { fieldOfView [ -4 -2 6 2 ] }");
    const auto extent = [&] { return extentOf(s.scene.node(s.scene.findName("V"))); };
    ASSERT_TRUE(sendWheel(s.scene, 0, -10));
    s.scene.newFrame(1);
    const double zoom = 1 / std::pow(.9, 10);
    s.expect({0, 0, 10}, {0, 0, -1});
    EXPECT_NEAR(viewerPose(s.scene).zoom, zoom, 1e-9);
    EXPECT_NEAR(extent()[0], 1 - 5 / zoom, 1e-9);
    EXPECT_NEAR(extent()[3], 2 / zoom, 1e-9);
    EXPECT_EQ(s.scene.node(s.scene.findName("V")).get(x3d::OrthoViewpoint::fieldOfView)[0], -4) << "the author's stays";
    // A pointer goes through what is shown there.
    const Bearing bearing = bearingThrough(s.scene, 1, .5, 2.5);
    EXPECT_NEAR(bearing.origin.x, 1 + 5 / zoom, 1e-9);
    // A snapshot, and so a mirror and a log, has it too.
    Scene copy;
    ASSERT_TRUE(copy.apply(std::make_shared<const ChangeSet>(s.scene.snapshot())));
    EXPECT_EQ(viewerPose(copy).zoom, viewerPose(s.scene).zoom);
    s.press("HOME", true);
    for (int i = 0; i < 30; ++i) s.scene.newFrame(s.scene.now() + .1);
    EXPECT_EQ(extent(), (std::array<double, 4>{-4, -2, 6, 2})) << "HOME goes back to the author's";
    ASSERT_TRUE(sendWheel(s.scene, 0, -1e6));
    s.scene.newFrame(s.scene.now() + 1);
    EXPECT_TRUE(std::isfinite(extent()[0])) << "zoom ends somewhere";
}

/// The same box fills a perspective view and a parallel one.
TEST(Navigation, AllIsSeenInAParallelView) {
    NavigatedScene s("DEF V OrthoViewpoint { } Shape { geometry Box { size 30 40 1 } }");
    ASSERT_TRUE(viewAll(s.scene, s.space));
    for (int i = 0; i < 30; ++i) s.scene.newFrame(s.scene.now() + .1);
    const auto [left, bottom, right, top] = extentOf(s.scene.node(s.scene.findName("V")));
    EXPECT_NEAR(right - left, std::sqrt(30. * 30 + 40 * 40 + 1), 1e-6);
    EXPECT_NEAR(top, (right - left) / 2, 1e-9);
    EXPECT_NEAR(left + right + bottom, bottom, 1e-9) << "about the middle";
}

TEST(Navigation, AnotherButtonOrAltGoesAlongThePicture) {
    NavigatedScene s("NavigationInfo { type \"EXAMINE\" } Viewpoint { }");
    const auto point = [&](double x, double y, std::uint32_t buttons) {
        PointerInput input;
        input.kind = PointerInput::Kind::picture;
        input.x = x, input.y = y, input.aspect = 1, input.buttons = buttons;
        ASSERT_TRUE(sendPointer(s.scene, input));
        s.scene.newFrame(s.scene.now() + .1);
    };
    const double half = 10 * std::tan(.7854 / 2);  // of what is seen in the plane of the centre
    point(.5, .5, PointerInput::kSecondary);
    point(.75, .5, PointerInput::kSecondary);
    s.expect({-half / 2, 0, 10}, {0, 0, -1}, 1e-5);
    point(.75, .25, PointerInput::kSecondary);
    point(.75, .25, 0);
    point(.1, .1, 0);
    s.expect({-half / 2, -half / 2, 10}, {0, 0, -1}, 1e-4);
    s.press("ALT", true);
    s.scene.newFrame(s.scene.now());
    s.press("RIGHT", true);
    s.scene.newFrame(s.scene.now());
    s.scene.newFrame(s.scene.now() + 1);
    const ViewerPose moved = viewerPose(s.scene);
    EXPECT_NEAR(moved.position.x, 0, 1e-4) << "half of the picture's half a second";
    EXPECT_NEAR(moved.position.z, 10, 1e-9);
}

TEST(Navigation, TypeAndSpeedAreChosenAndTheViewerStandsUpright) {
    for (const char* given : {"", "NavigationInfo { type \"EXAMINE\" speed 2 }"}) {
        NavigatedScene s(std::string(given) + " DEF V Viewpoint { orientation 0 0 1 .5 }");
        const double speed = navigationSpeed(s.scene);
        EXPECT_EQ(speed, *given ? 2 : 1);
        EXPECT_EQ(navigationType(s.scene), NavigationType::examine);
        ASSERT_TRUE(chooseNavigation(s.scene, NavigationType::fly));
        s.scene.newFrame(1);
        s.scene.newFrame(2);
        ASSERT_TRUE(chooseSpeed(s.scene, 3 * speed));
        s.scene.newFrame(3);
        EXPECT_EQ(navigationType(s.scene), NavigationType::fly);
        EXPECT_EQ(nameOf(navigationType(s.scene)), "FLY");
        EXPECT_EQ(navigationSpeed(s.scene), 3 * speed);
        EXPECT_FALSE(chooseSpeed(s.scene, 0));
        ASSERT_TRUE(straightenViewer(s.scene));
        for (int i = 0; i < 30; ++i) s.scene.newFrame(s.scene.now() + .1);
        const Vec3d up = viewerPose(s.scene).orientation * Vec3d(0, 1, 0);
        EXPECT_NEAR(up.y, 1, 1e-6);
        s.expect({0, 0, 10}, {0, 0, -1});
    }
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
