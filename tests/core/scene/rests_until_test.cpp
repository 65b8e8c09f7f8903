// When a scene does something by itself next: what servers sleep by.
#include <limits>

#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/device_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

constexpr double kNow = -kNever;  // in the next frame

void load(Scene& scene, const std::string& body) {
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + body, diagnostics))
        << (diagnostics.all().empty() ? "" : diagnostics.all()[0].format());
}

/// Frames until nothing is under way any more, a few at most.
void settle(Scene& scene, double from) {
    for (int i = 0; i < 5; ++i) scene.newFrame(from + i * .01);
}

TEST(RestsUntil, AStillSceneRestsForGood) {
    Scene scene;
    load(scene, "DEF T Transform { children Shape { geometry Box { } } } Viewpoint { } NavigationInfo { }");
    EXPECT_EQ(scene.restsUntil(), kNow) << "it has not begun";
    settle(scene, 0);
    EXPECT_EQ(scene.restsUntil(), kNever);
}

TEST(RestsUntil, AnEventOrAnEditEndsTheRest) {
    Scene scene;
    load(scene, "DEF T Transform { }");
    const NodeId node = scene.findName("T");
    settle(scene, 0);
    ASSERT_TRUE(scene.sendEvent(node, x3d::Transform::translation.index, Vec3f(1, 0, 0)));
    EXPECT_EQ(scene.restsUntil(), kNow);
    settle(scene, 1);
    EXPECT_EQ(scene.restsUntil(), kNever);
    ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(2, 0, 0)));
    EXPECT_EQ(scene.restsUntil(), kNow);
    settle(scene, 2);
    EXPECT_EQ(scene.restsUntil(), kNever);
}

TEST(RestsUntil, AClockThatWaitsSaysUntilWhen) {
    Scene scene;
    load(scene, "DEF C TimeSensor { startTime 10 cycleInterval 2 }");
    settle(scene, 1);
    EXPECT_EQ(scene.restsUntil(), 10);
    scene.newFrame(10);
    EXPECT_EQ(scene.restsUntil(), kNow) << "it runs";
    settle(scene, 12.5);
    EXPECT_EQ(scene.restsUntil(), kNever) << "it has come to its end";
}

TEST(RestsUntil, WhatRunsNeverRests) {
    for (const char* body : {"TimeSensor { loop TRUE }", "PositionDamper { tau 1 }"}) {
        Scene scene;
        load(scene, body);
        settle(scene, 1);
        const bool runs = std::string_view(body).starts_with("Time");
        EXPECT_EQ(scene.restsUntil(), runs ? kNow : kNever) << body;
    }
    Scene scene;
    load(scene, "DEF D PositionDamper { tau 1 }");
    settle(scene, 1);
    ASSERT_TRUE(scene.sendEvent(scene.findName("D"), x3d::PositionDamper::set_destination.index, Vec3f(1, 0, 0)));
    scene.newFrame(2);
    scene.newFrame(2.1);
    EXPECT_EQ(scene.restsUntil(), kNow) << "it follows its destination";
}

TEST(RestsUntil, AKeyThatIsHeldMovesTheViewer) {
    Scene scene;
    load(scene, "NavigationInfo { type \"FLY\" } Viewpoint { }");
    scene.setNavigation(true);
    settle(scene, 0);
    ASSERT_EQ(scene.restsUntil(), kNever);
    const auto press = [&](bool down) { ASSERT_TRUE(sendKey(scene, *KeyInput::named("UP", down))); };
    press(true);
    EXPECT_EQ(scene.restsUntil(), kNow);
    for (int i = 0; i < 20; ++i) {
        scene.newFrame(1 + i * .05);
        EXPECT_EQ(scene.restsUntil(), kNow) << "it goes on while the key is down";
    }
    press(false);
    settle(scene, 2.1);
    EXPECT_EQ(scene.restsUntil(), kNever);
}

TEST(RestsUntil, AStepOfTheWheelIsOverSoon) {
    Scene scene;
    load(scene, "NavigationInfo { type \"FLY\" } Viewpoint { }");
    scene.setNavigation(true);
    settle(scene, 0);
    ASSERT_TRUE(sendWheel(scene, 0, 1));
    EXPECT_EQ(scene.restsUntil(), kNow);
    scene.newFrame(1);
    EXPECT_EQ(scene.restsUntil(), kNow) << "where it has come to is news";
    settle(scene, 1.1);
    EXPECT_EQ(scene.restsUntil(), kNever);
}

}  // namespace
}  // namespace rtsg
