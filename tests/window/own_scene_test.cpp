// A shape that a ProximitySensor keeps before a viewer is kept before one's own eye, and is clicked there.
#include <gtest/gtest.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/world_queries.h>
#include <rtsg/window/own_eye.h>
#include <rtsg/window/own_scene.h>

namespace rtsg {
namespace {

using Root = x3d::RtsgScene;
using T = x3d::Transform;

/// A scene with a sign that its viewer has before the eye, and a wall; somebody looks on with an eye of their own.
struct Signed {
    Scene theirs;
    std::unique_ptr<OwnScene> own;
    std::unique_ptr<SharedWorld> world, theirWorld;
    std::unique_ptr<OwnEye> eye;
    NodeId hud, sensor;
    double time = 0;

    explicit Signed(const std::string& around = "", const std::string& sensorFields = "size 1000 1000 1000") {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(
            theirs,
            "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { position 0 1.6 6 }\n"
            "NavigationInfo { type \"FLY\" speed 2 }\n"
            "DEF FAR Viewpoint { position 3 2 9 orientation 0 1 0 1 }\n"
            "Transform { " +
                around +
                " children [\n"
                "DEF EYE ProximitySensor { " +
                sensorFields +
                " }\n"
                "DEF HUD Transform { scale 2 2 2 children Transform { translation -.2 -.1 -.5 children DEF SIGN "
                "Shape { geometry Box { size .1 .05 .01 } } } } ] }\n"
                "Transform { translation 0 0 -4 children DEF WALL Shape { geometry Box { size 90 90 1 } } }\n"
                "ROUTE EYE.position_changed TO HUD.translation\nROUTE EYE.orientation_changed TO "
                "HUD.rotation\n",
            diagnostics));
        theirs.setNavigation(true);
        theirs.newFrame(0), theirs.newFrame(.1);
        hud = theirs.findName("HUD"), sensor = theirs.findName("EYE");
        own = std::make_unique<OwnScene>(theirs);
        world = std::make_unique<SharedWorld>(own->scene());
        theirWorld = std::make_unique<SharedWorld>(theirs);
        eye = std::make_unique<OwnEye>(*world, own.get());
    }
    void key(const char* name, bool down) { eye->take(Root::key.index, Value(KeyInput::named(name, down)->toValue())); }
    void run(double seconds) {
        for (const double end = time + seconds; time < end; time += 1 / 30.0) eye->advance(time);
    }
    ~Signed() {
        for (const Diagnostic& d : own->scene().diagnostics().all()) ADD_FAILURE() << d.format();
    }
    Vec3f shownAt() { return own->scene().node(hud).get(T::translation); }
    Vec3f theirsAt() { return theirs.node(hud).get(T::translation); }
    /// Where the sign is in the picture, by its place before the eye, as shares from the left and top.
    static PointerInput onSign(std::uint32_t buttons = 0) {
        PointerInput input;
        input.kind = PointerInput::Kind::picture;
        input.aspect = 1;
        const double half = std::tan(.7854 / 2);
        input.x = .5 - .5 * .4 / half, input.y = .5 + .5 * .2 / half;
        input.buttons = buttons;
        return input;
    }
    std::string met(const PointerInput& ray) {
        EXPECT_EQ(ray.kind, PointerInput::Kind::ray);
        WorldQueries queries(*theirWorld);
        const auto hit = queries.firstHit(ray.origin, ray.direction);
        return hit ? std::string(theirs.name(hit->path.back())) : "";
    }
};

TEST(OwnScenes, WhatIsKeptBeforeAViewerIsKeptBeforeOnesOwnEye) {
    for (const std::string around : {"", "translation 1 2 3 rotation 0 1 0 .7"}) {
        Signed scene(around);
        ASSERT_TRUE(OwnScene::isNeeded(scene.theirs));
        const Hash128 before = scene.theirs.hash();
        const Vec3f there = scene.theirsAt();
        EXPECT_EQ(scene.shownAt(), there) << "nobody has moved";
        scene.key("UP", true), scene.run(1);
        scene.key("UP", false), scene.key("LEFT", true), scene.run(.5);
        scene.key("LEFT", false), scene.run(.5);
        const auto camera = scene.eye->camera(1);
        ASSERT_TRUE(camera);
        // The origin of what is kept is the eye, and it looks along the eye's -z.
        const Scene& shown = scene.own->scene();
        glm::dmat4 worldFromSign = worldAroundNode(shown, shown.findName("SIGN"));
        const Vec3d sign(worldFromSign * glm::dvec4(0, 0, 0, 1)), off = sign - camera->position;
        EXPECT_NEAR(glm::dot(off, camera->forward), 1, 1e-5);
        EXPECT_NEAR(glm::dot(off, camera->right), -.4, 1e-5);
        EXPECT_NEAR(glm::dot(off, camera->up), -.2, 1e-5);
        EXPECT_EQ(scene.theirsAt(), there);
        EXPECT_EQ(scene.theirs.hash(), before) << "it is not touched";
        scene.key("HOME", true), scene.run(.1);
        EXPECT_EQ(scene.shownAt(), there) << "back at their viewer";
    }
}

TEST(OwnScenes, ARayThroughThePictureMeetsItWhereItIsThere) {
    Signed scene("translation 1 2 3 rotation 0 1 0 .7");
    EXPECT_EQ(scene.met(scene.eye->throughPicture(Signed::onSign())), "SIGN");
    scene.key("UP", true), scene.run(1);
    scene.key("UP", false), scene.key("LEFT", true), scene.run(1);
    scene.key("LEFT", false), scene.run(.5);
    EXPECT_EQ(scene.met(scene.eye->throughPicture(Signed::onSign(PointerInput::kPrimary))), "SIGN");
    // Dragged away from it, the ray stays one that is before their eye.
    PointerInput away = Signed::onSign(PointerInput::kPrimary);
    away.x += .3;
    const PointerInput dragged = scene.eye->throughPicture(away);
    EXPECT_LT(glm::length(dragged.origin - Vec3d(0, 1.6, 6)), 1e-3) << "their viewer stands there";
    away.buttons = 0;
    (void)scene.eye->throughPicture(away);
    const PointerInput free = scene.eye->throughPicture(away);
    EXPECT_LT(glm::length(free.origin - scene.eye->camera(1)->position), 1e-5) << "all else is seen from here";
}

TEST(OwnScenes, SensorsThatDoNotSeeTheEyeKeepNothingBeforeIt) {
    for (const std::string fields :
         {"size 1000 1000 1000 enabled FALSE", "center 0 0 6 size 10 10 1.5", "size 0 9 9"}) {
        Signed scene("", fields);
        const Vec3f there = scene.theirsAt();
        scene.key("UP", true), scene.run(2);
        EXPECT_EQ(scene.shownAt(), there) << fields;
    }
    Signed scene;
    const Vec3f there = scene.theirsAt();
    scene.key("UP", true), scene.run(1);
    EXPECT_NE(scene.shownAt(), there);
    // Changes there are followed, except for values that are kept here.
    ASSERT_TRUE(scene.theirs.set(scene.hud, T::scale, Vec3f(3)));
    ASSERT_TRUE(scene.theirs.set(scene.hud, T::translation, Vec3f(7)));
    const Vec3f here = scene.shownAt();
    scene.theirs.newFrame(1);
    EXPECT_EQ(scene.shownAt(), here) << "not for a moment is it elsewhere";
    scene.run(.1);
    EXPECT_EQ(scene.own->scene().node(scene.hud).get(T::scale), Vec3f(3));
    EXPECT_NE(scene.shownAt(), scene.theirsAt());
    // Without its ROUTEs nothing is kept.
    for (const Route& route : scene.theirs.routesFrom(scene.sensor))
        ASSERT_TRUE(scene.theirs.removeRoute(route.fromNode, route.fromField, route.toNode, route.toField));
    scene.theirs.newFrame(2);
    scene.run(.1);
    EXPECT_EQ(scene.shownAt(), scene.theirsAt());
    EXPECT_FALSE(OwnScene::isNeeded(scene.theirs));
}

}  // namespace
}  // namespace rtsg
