// Picture, sound, picking and export see the same geometry: skins and deforming meshes included.
#include <gtest/gtest.h>

#include <limits>
#include <set>

#include <fmt/format.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/picking.h>

#include "geometry/world_geometry.h"

namespace rtsg {
namespace {

/// A humanoid whose skin is a square in the plane z = 0, and a square of which only the coordinates change.
const char* const kMoving = R"(#X3D V4.0 utf8
PROFILE Full
NavigationInfo { headlight FALSE }
DEF MAN HAnimHumanoid {
  skinCoord DEF SKIN Coordinate { point [-1 -1 0, 1 -1 0, 1 1 0, -1 1 0] }
  skeleton DEF JOINT HAnimJoint { skinCoordIndex [0 1 2 3] skinCoordWeight [1 1 1 1] }
  joints USE JOINT
  skin Shape { geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] coord USE SKIN } }
}
Shape { geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1]
  coord DEF SHEET Coordinate { point [9 -1 0, 11 -1 0, 11 1 0, 9 1 0] } } }
Sound { source AudioClip { url "nothing.wav" } }
)";

/// How far away the surface is that is seen from (x, 0, 10) along -z.
double distance(const RayWorld& world, float x) {
    const Hit hit = world.intersect(
        Ray{world.fromWorld(Vec3d(double{x}, .1, 10)), 0, {0, 0, -1}, std::numeric_limits<float>::infinity()});
    return hit ? static_cast<double>(hit.t) : -1;
}

struct Moving {
    Scene scene;
    NodeId joint, sheet;
    double time = 0;
    Moving() {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, kMoving, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        joint = scene.findName("JOINT"), sheet = scene.findName("SHEET");
    }
    void move(float z) {
        EXPECT_TRUE(scene.set(joint, x3d::HAnimJoint::translation, Vec3f(0, 0, z)));
        EXPECT_TRUE(scene.set(sheet, x3d::Coordinate::point,
                              Array<Vec3f>{{9, -1, 2 * z}, {11, -1, 2 * z}, {11, 1, 2 * z}, {9, 1, 2 * z}}));
        scene.newFrame(time += .1);
    }
};

ListenOptions quiet() {
    ListenOptions options;
    options.sound = options.metrics = false;
    return options;
}

TEST(OneWorld, PictureSoundAndPickingAgreeOnSkinsAndDeformingMeshes) {
    Moving moving;
    SharedWorld world(moving.scene);
    SoundRenderer sound(world, quiet());
    ASSERT_EQ(sound.failure(), "");
    LightRenderer light(world);
    moving.scene.newFrame(0);
    for (int step = 0; step < 12; ++step) {
        const float z = .25f * static_cast<float>(step);
        moving.move(z);
        SharedWorld fresh(moving.scene);  // as `pick` has it, which comes when all is done
        const Picker picker(fresh.rays(), fresh.flattener());
        const OpenedGeometry room = sound.room({100, 0, 0});
        for (const auto& [x, wanted] : {std::pair{0.f, 10. - double{z}}, std::pair{10.f, 10. - 2. * double{z}}}) {
            EXPECT_NEAR(distance(world.rays(), x), wanted, 1e-5) << "picture, at " << x << ", step " << step;
            const auto pick = picker.ray({double{x}, .1, 10}, {0, 0, -1});
            ASSERT_TRUE(pick && *pick);
            EXPECT_NEAR(pick->distance, wanted, 1e-5) << "pick, at " << x << ", step " << step;
            AcousticHit hit;
            ASSERT_TRUE(room.closest({double{x}, .1, 10}, {0, 0, -1}, 1e6, kNoPlane, hit));
            EXPECT_NEAR(hit.distance, wanted, 1e-5) << "sound, at " << x << ", step " << step;
        }
    }
    // A deforming mesh is refitted, not built again.
    EXPECT_GE(world.rays().stats().meshRefits, 15u);
}

TEST(OneWorld, WhatAnEyeChoosesOfLevelsOfDetailChangesNoSound) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Full
DEF EYE Viewpoint { position 0 0 10 }
LOD { range [6] children [
  Shape { geometry Box { size 4 4 4 } }
  Group { children [ Shape { geometry Box { size 1 1 1 } } Sound { source AudioClip { url "nothing.wav" } } ] } ] }
)",
                         diagnostics));
    SharedWorld world(scene);
    SoundRenderer sound(world, quiet());
    ASSERT_EQ(sound.failure(), "");
    LightRenderer::Options options;
    options.image.settings.width = options.image.settings.height = 8;
    LightRenderer light(world, options);
    const RayWorld& rays = world.rays();
    const auto reach = [&](RayKind kind) {
        const Hit hit = rays.intersect(Ray{{0, .1f, 10}, 0, {0, 0, -1}, std::numeric_limits<float>::infinity()}, kind);
        return hit ? static_cast<double>(hit.t) : -1;
    };
    const auto heard = [&] {
        AcousticHit hit;
        EXPECT_TRUE(sound.room({100, 0, 0}).closest({0, .1, 10}, {0, 0, -1}, 1e6, kNoPlane, hit));
        return hit.distance;
    };
    for (const float z : {10.f, 5.f, 20.f}) {
        ASSERT_TRUE(scene.set(scene.findName("EYE"), x3d::Viewpoint::position, Vec3f(0, 0, z)));
        scene.newFrame(scene.now() + 1);
        ASSERT_TRUE(light.renderFrame());
        const double half = z > 6 ? .5 : 2;
        EXPECT_NEAR(reach(RayKind::view), 10 - half, 1e-5) << z;
        EXPECT_NEAR(reach(RayKind::shadow), 10 - half, 1e-5) << z;
        EXPECT_NEAR(reach(RayKind::sound), 8, 1e-5) << z;
        EXPECT_NEAR(heard(), 8, 1e-5) << z;
        EXPECT_NEAR(sound.room({100, 0, 0}).distanceToSurface({0, 0, 10}), 8, 1e-5) << z;
        EXPECT_EQ(sound.room({100, 0, 0}).planes().size(), 6u) << "the first level's";
        EXPECT_TRUE(sound.renderer().scene().emitters().empty()) << "of another level";
        EXPECT_NEAR(rays.bounds().max.z, half, 1e-5) << "what is seen";
        const auto pick = Picker(rays, world.flattener()).closest({0, 0, 10});
        ASSERT_TRUE(pick && *pick);
        EXPECT_NEAR(pick->distance, 10 - half, 1e-5) << "what is picked is what is seen";
    }
}

TEST(OneWorld, EqualPrimitivesShareOneMesh) {
    std::string text = "#X3D V4.0 utf8\nPROFILE Immersive\n";
    for (int i = 0; i < 5000; ++i)
        text += fmt::format("Transform {{ translation {} {} 0 children Shape {{ geometry Sphere {{ }} }} }}\n",
                            3 * (i % 100), 3 * (i / 100));
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, text, diagnostics));
    SharedWorld world(scene);
    std::set<const Mesh*> meshes;
    for (const RayInstance& instance : world.rays().instances())
        if (instance.info.id) meshes.insert(instance.mesh.get());
    EXPECT_EQ(meshes.size(), 1u);
    const RayWorld::Memory memory = world.rays().memory();
    EXPECT_EQ(memory.instances, 5000u);
    RecordProperty("bytes", static_cast<int>(memory.total()));
    EXPECT_LT(memory.total(), 50'000'000u);
}

TEST(OneWorld, AWarningComesOnceHoweverOftenItsGeometryChanges) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Immersive
Shape {
  appearance Appearance { texture ImageTexture { url "nothing.png" } material DEF PAINT Material { } }
  geometry IndexedFaceSet { coordIndex [0 1 2 77 -1, 0 1 2 -1] coord DEF C Coordinate { point [0 0 0, 1 0 0, 0 1 0] } }
}
)",
                         diagnostics));
    SharedWorld world(scene);
    LightRenderer light(world);
    for (int frame = 0; frame < 20; ++frame) {
        const float x = static_cast<float>(frame);
        ASSERT_TRUE(
            scene.set(scene.findName("C"), x3d::Coordinate::point, Array<Vec3f>{{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}}));
        ASSERT_TRUE(scene.set(scene.findName("PAINT"), x3d::Material::transparency, x / 40));
        scene.newFrame(frame * .1);
    }
    std::multiset<std::string> texts;
    Diagnostics said = world.diagnostics();
    said.append(light.diagnostics());
    for (const Diagnostic& d : said.all()) texts.insert(d.format());
    EXPECT_GE(texts.size(), 2u);
    for (const std::string& text : texts) EXPECT_EQ(texts.count(text), 1u) << text;
    EXPECT_EQ(said.dropped(), 0u);
}

}  // namespace
}  // namespace rtsg
