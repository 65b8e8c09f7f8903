// A viewer of one's own in a scene that is not to be touched.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/window/own_eye.h>

namespace rtsg {
namespace {

using Root = x3d::RtsgScene;

struct Walked {
    Scene scene;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<OwnEye> eye;
    double time = 0;

    explicit Walked(const std::string& navigation = "WALK") {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene,
                             "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { position 0 1.6 6 fieldOfView .6 }\n"
                             "NavigationInfo { type \"" +
                                 navigation +
                                 "\" speed 2 }\n"
                                 "Transform { translation 0 1 0 children Shape { geometry Box { size 20 4 1 } } }\n"
                                 "Transform { translation 0 -.05 0 children Shape { geometry Box { size 90 .1 90 } } }",
                             diagnostics));
        scene.newFrame(0);
        world = std::make_unique<SharedWorld>(scene);
        eye = std::make_unique<OwnEye>(*world);
    }
    void key(const char* name, bool down) { eye->take(Root::key.index, Value(KeyInput::named(name, down)->toValue())); }
    void run(double seconds) {
        for (const double end = time + seconds; time < end; time += 1 / 30.0) eye->advance(time);
    }
};

TEST(OwnEyes, ThereIsNoneUntilItIsMovedAndNoneAfterHome) {
    Walked walked;
    walked.run(.1);
    EXPECT_FALSE(walked.eye->camera(1));
    walked.key("a", true);
    EXPECT_FALSE(walked.eye->camera(1)) << "a key that moves nobody";
    const Hash128 before = walked.scene.hash();
    walked.key("UP", true);
    walked.run(.5);
    const auto camera = walked.eye->camera(1);
    ASSERT_TRUE(camera);
    EXPECT_NEAR(camera->position.z, 5, .3) << "2 m/s for half a second";
    EXPECT_TRUE(walked.eye->isMoving());
    EXPECT_FALSE(walked.scene.hasUnsealedEdits());
    EXPECT_EQ(walked.scene.hash(), before) << "the scene is not touched";
    walked.key("UP", false);
    walked.run(.5);
    EXPECT_FALSE(walked.eye->isMoving());
    walked.key("HOME", true);
    EXPECT_FALSE(walked.eye->camera(1));
}

TEST(OwnEyes, WallsOfTheOtherSceneStopIt) {
    Walked walked;
    walked.key("UP", true);
    walked.run(6);
    const auto camera = walked.eye->camera(1);
    ASSERT_TRUE(camera);
    EXPECT_GT(camera->position.z, .5) << "before the wall";
    EXPECT_LT(camera->position.z, 2);
    EXPECT_NEAR(camera->position.y, 1.6, .1);
}

/// A drawing in parallel projection stays one, and the wheel enlarges it.
TEST(OwnEyes, AParallelProjectionStays) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nNavigationInfo { type \"EXAMINE\" visibilityLimit 70 }\n"
                         "OrthoViewpoint { fieldOfView [ -4 -4 4 4 ] nearDistance .5 } Shape { geometry Box { } }",
                         diagnostics));
    scene.newFrame(0);
    SharedWorld world(scene);
    OwnEye eye(world);
    const auto press = [&](bool down) { eye.take(Root::key.index, Value(KeyInput::named("RIGHT", down)->toValue())); };
    press(true);
    eye.advance(.1), eye.advance(.2);
    press(false);
    eye.advance(.3);
    const auto turned = eye.camera(2);
    ASSERT_TRUE(turned);
    EXPECT_TRUE(turned->orthographic);
    EXPECT_NEAR(turned->top, 4, 1e-6);
    EXPECT_NEAR(turned->rightEdge, 8, 1e-6);
    EXPECT_NEAR(turned->nearDistance, .5, 1e-6);
    EXPECT_NEAR(turned->visibilityLimit, 70, 1e-6);
    const double steps[] = {0, -15};
    eye.take(Root::wheel.index, Value(Array<double>(std::span<const double>(steps))));
    eye.advance(.4);
    const auto near = eye.camera(2);
    EXPECT_NEAR(near->top, 4 * std::pow(.9, 15), 1e-6) << "larger";
    EXPECT_LT(glm::length(near->position - turned->position), 1e-9) << "not into the box";
    EXPECT_EQ(eye.navigated().node(scene.root()).id(), scene.root());
}

/// Somebody who stands in a wall gets out once walls do not count.
TEST(OwnEyes, WallsCanBeSwitchedOff) {
    Walked walked;
    walked.eye->setObstacles({.walls = false, .ground = true});
    walked.key("UP", true);
    walked.run(6);
    const auto camera = walked.eye->camera(1);
    ASSERT_TRUE(camera);
    EXPECT_LT(camera->position.z, -5) << "through the wall";
    EXPECT_NEAR(camera->position.y, 1.6, 2.2) << "on the ground, or on what is there";
}

TEST(OwnEyes, ItSeesAsTheBoundViewpointDoes) {
    Walked walked("FLY");
    walked.key("UP", true);
    walked.run(.1);
    const auto camera = walked.eye->camera(1);
    ASSERT_TRUE(camera);
    EXPECT_NEAR(camera->top, std::tan(.3), 1e-6);
    PointerInput middle;
    middle.kind = PointerInput::Kind::picture;
    middle.x = middle.y = .5;
    const PointerInput ray = walked.eye->throughPicture(middle);
    EXPECT_EQ(ray.kind, PointerInput::Kind::ray);
    EXPECT_NEAR(ray.direction.z, -1, 1e-9);
    EXPECT_NEAR(ray.origin.z, camera->position.z, 1e-9);
    PointerInput gone;
    gone.kind = PointerInput::Kind::absent;
    EXPECT_EQ(walked.eye->throughPicture(gone).kind, PointerInput::Kind::absent);
}

/// The viewpoint and the NavigationInfo that count are the active layer's.
TEST(OwnEyes, OfASceneInLayersItBeginsAtTheActiveOne) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene,
                 "#X3D V4.0 utf8\nPROFILE Immersive\nCOMPONENT Layering:1\nLayerSet { activeLayer 1 order [1] "
                 "layers [ Layer { children [ NavigationInfo { type \"FLY\" speed 3 } Viewpoint { position 0 0 5 "
                 "fieldOfView .6 } ] } ] }",
                 diagnostics));
    scene.newFrame(0);
    SharedWorld world(scene);
    OwnEye eye(world);
    eye.take(Root::key.index, Value(KeyInput::named("UP", true)->toValue()));
    for (double t = 0; t < 1; t += 1 / 30.0) eye.advance(t);
    const auto camera = eye.camera(1);
    ASSERT_TRUE(camera);
    EXPECT_NEAR(camera->position.z, 2, .3) << "3 m/s ahead";
    EXPECT_NEAR(camera->top, std::tan(.3), 1e-6);
}

/// A shape in a layer above it is pointed at through that layer's viewpoint, also while it is dragged away.
TEST(OwnEyes, WhatAnotherLayerShowsIsPointedAtThroughItsViewpoint) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(
        scene,
        "#X3D V4.0 utf8\nPROFILE Immersive\nCOMPONENT Layering:1\nLayerSet { activeLayer 1 order [1 2] layers [ "
        "Layer { children [ NavigationInfo { type \"FLY\" speed 3 } Viewpoint { position 0 0 5 } Shape { geometry Box "
        "{ } } ] } Layer { children [ Viewpoint { position 0 0 1 } Transform { translation .2 0 0 children Shape { "
        "geometry Box { size .2 .2 .01 } } } ] } ] }",
        diagnostics));
    scene.newFrame(0);
    SharedWorld world(scene);
    OwnEye eye(world);
    eye.take(Root::key.index, Value(KeyInput::named("UP", true)->toValue()));
    for (double t = 0; t < .5; t += 1 / 30.0) eye.advance(t);
    // Laid out as in a picture that is seen from there.
    LightRenderer light(world);
    ImageOptions options;
    options.settings.width = options.settings.height = 64;
    const auto state = world.present();
    ASSERT_TRUE(state);
    ASSERT_TRUE(light.nextPicture(**state, options, {eye.camera(1), 0, 0}));
    ASSERT_TRUE(world.update());
    PointerInput pointer;
    pointer.kind = PointerInput::Kind::picture;
    const auto at = [&](double x, std::uint32_t buttons) {
        pointer.x = .5 + .5 * x / std::tan(.7854 / 2), pointer.y = .5, pointer.buttons = buttons;
        return eye.throughPicture(pointer);
    };
    EXPECT_LT(at(-.2, 0).origin.z, 4.5) << "beside it: from the eye of one's own";
    EXPECT_NEAR(at(.2, 0).origin.z, .005 + .995e-3, 1e-4) << "right before what it meets";
    EXPECT_NEAR(at(.2, 1).direction.x / -at(.2, 1).direction.z, .2, 1e-3);
    EXPECT_NEAR(at(-.2, 1).origin.z, 1, 1e-6) << "from that layer's eye: a drag stays in its layer";
    EXPECT_NEAR(at(-.2, 0).origin.z, 1, 1e-6) << "until it is let go";
    EXPECT_LT(at(-.2, 0).origin.z, 4.5);
    EXPECT_LT(at(-.2, 1).origin.z, 4.5);
    EXPECT_LT(at(.2, 1).origin.z, 4.5) << "as one that began beside it does not get into it";
}

TEST(OwnEyes, ItGoesToViewpointsWhereverTheyStand) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene,
                 "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { }\nTransform { translation 5 0 0 rotation 0 1 0 "
                 "1.5708 children Transform { scale 2 2 2 children DEF V Viewpoint { position 0 0 3 fieldOfView "
                 ".5 } } }\nDEF BOX Transform { }",
                 diagnostics));
    scene.newFrame(0);
    SharedWorld world(scene);
    OwnEye eye(world);
    const Hash128 before = scene.hash();
    ASSERT_TRUE(eye.goTo(scene.findName("V")));
    const auto camera = eye.camera(1);
    ASSERT_TRUE(camera);
    EXPECT_NEAR(camera->position.x, 11, 1e-3) << "6 m along what was the z axis";
    EXPECT_NEAR(camera->position.z, 0, 1e-3);
    EXPECT_NEAR(camera->forward.x, -1, 1e-4);
    EXPECT_NEAR(camera->top, std::tan(.25), 1e-6);
    EXPECT_FALSE(eye.goTo(scene.findName("BOX")));
    EXPECT_FALSE(eye.goTo(NodeId{9999}));
    EXPECT_EQ(scene.hash(), before) << "the scene is not touched";
}

}  // namespace
}  // namespace rtsg
