// The uploads to a rasteriser follow a scene at the cost of its changes, and equal those for the scene anew.
#include <algorithm>
#include <iterator>
#include <utility>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "renderers/scene_edits.h"
#include "seen_edits.h"
#include "written_raster.h"

namespace rtsg {
namespace {

using namespace test;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A scene with a follower.
struct Reported {
    explicit Reported(const std::string& body) {
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Immersive\n" + body, diagnostics));
        world = std::make_unique<SharedWorld>(scene);
        written = std::make_unique<Written>(*world);
        frame();
    }
    void frame() { scene.newFrame(++time); }
    NodeId node(const char* name) { return scene.findName(name); }
    Scene scene;
    Diagnostics diagnostics;
    double time = 0;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<Written> written;
};

const char* const kTwo =
    "DEF A Transform { children DEF S Shape { appearance DEF Look Appearance { material DEF M Material { } } geometry "
    "DEF "
    "B Box { } } }\n"
    "DEF C Transform { translation 3 0 0 children USE S }\n";

TEST(RasterScene, SharesMeshesAndMaterialsAndMovesThingsAlone) {
    Reported t(kTwo);
    EXPECT_EQ(t.written->content().size(), 2u);
    EXPECT_EQ(t.written->raster.meshes.size(), 1u);
    EXPECT_EQ(t.written->raster.materials.size(), 1u);
    // The first move says that it moves at all, which is more than a move.
    ASSERT_TRUE(t.scene.set(t.node("A"), x3d::Transform::translation, Vec3f(0, 1, 0)));
    t.frame();
    (void)t.written->content();
    const OgreRenderer::Counts before = t.written->scene.counts();
    ASSERT_TRUE(t.scene.set(t.node("A"), x3d::Transform::translation, Vec3f(0, 5, 0)));
    t.frame();
    EXPECT_THAT(t.written->content(), Contains(HasSubstr("(0 5 0)")));
    const OgreRenderer::Counts moved = t.written->scene.counts();
    EXPECT_EQ(moved.moved, before.moved + 1);
    EXPECT_EQ(moved.objects, before.objects);
    EXPECT_EQ(moved.meshes, before.meshes);
    EXPECT_EQ(moved.materials, before.materials);
    EXPECT_EQ(moved.tables, before.tables);
    ASSERT_TRUE(t.scene.set(t.node("M"), x3d::Material::diffuseColor, Color{0, 1, 0}));
    t.frame();
    (void)t.written->content();
    const OgreRenderer::Counts painted = t.written->scene.counts();
    EXPECT_EQ(painted.meshes, moved.meshes);
    EXPECT_EQ(painted.materials, moved.materials + 1);
    EXPECT_EQ(t.written->raster.materials.size(), 1u) << "the old one is given back";
}

TEST(RasterScene, ADeformingMeshKeepsItsNumber) {
    Reported t(
        "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 ] coord DEF P Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] "
        "} "
        "} }\n");
    (void)t.written->content();
    const std::uint32_t number = t.written->raster.meshes.begin()->first;
    ASSERT_TRUE(t.scene.set(t.node("P"), x3d::Coordinate::point, Array<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 7, 0}}));
    t.frame();
    EXPECT_THAT(t.written->content(), Contains(HasSubstr("(0 7 0)")));
    ASSERT_EQ(t.written->raster.meshes.size(), 1u);
    EXPECT_EQ(t.written->raster.meshes.begin()->first, number);
    EXPECT_EQ(t.written->raster.meshes.begin()->second.set, 2);
    // One that has nothing to show any more is not drawn, and comes back.
    ASSERT_TRUE(t.scene.set(t.node("P"), x3d::Coordinate::point, Array<Vec3f>{}));
    t.frame();
    EXPECT_TRUE(t.written->content().empty());
    ASSERT_TRUE(t.scene.set(t.node("P"), x3d::Coordinate::point, Array<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}}));
    t.frame();
    EXPECT_EQ(t.written->content().size(), 1u);
}

TEST(RasterScene, ClearAndTwoSidedSurfacesAreDrawnBacksFirst) {
    Reported t(
        "Shape { appearance Appearance { material Material { transparency .5 } } geometry IndexedFaceSet { solid FALSE "
        "coordIndex [ 0 1 2 ] coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } } }\n"
        "Shape { appearance Appearance { material Material { } backMaterial Material { diffuseColor 1 0 0 } } geometry "
        "IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 ] coord Coordinate { point [ 0 0 5, 1 0 5, 0 1 5 ] } } }\n"
        "Shape { geometry Box { } }\n");
    (void)t.written->content();
    int fronts = 0, backs = 0, first = 0;
    for (const auto& [id, item] : t.written->raster.objects)
        fronts += item.fronts, backs += item.backs, first += item.first;
    EXPECT_EQ(t.written->raster.objects.size(), 5u);
    EXPECT_EQ(fronts, 3);
    EXPECT_EQ(backs, 2) << "the Box has none";
    EXPECT_EQ(first, 2);
}

// After the first upload of a deforming mesh, only its moving data are uploaded.
TEST(RasterScene, OfADeformingMeshOnlyWhatMovesIsHandedOver) {
    const std::string faces =
        "IndexedFaceSet {{ {} coordIndex [ 0 1 2 -1 2 1 3 -1 ] coord DEF P Coordinate {{ point [ 0 0 0, 1 0 0, 0 1 0, "
        "1 1 "
        "1 ] }} {} }}";
    const auto square = [](float z) { return Array<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, z}}; };
    const std::string coordinates = "texCoord TextureCoordinate { point [ 0 0, 1 0, 0 1, 1 1 ] }";
    struct Kind {
        std::string smooth, more;
        std::size_t vertices;
    };
    for (const Kind& kind :
         {Kind{"creaseAngle 4", coordinates, 4}, Kind{"creaseAngle 0", coordinates, 6}, Kind{"creaseAngle 4", "", 4},
          Kind{"creaseAngle 4", "fogCoord FogCoordinate { depth [ 0, .5, .5, 1 ] }", 4},
          Kind{"creaseAngle 4 colorPerVertex FALSE", "color Color { color [ 1 0 0, 0 1 0 ] }", 6}}) {
        SCOPED_TRACE(kind.smooth + kind.more);
        Reported t("Shape { geometry " + fmt::format(fmt::runtime(faces), kind.smooth, kind.more) + " }\n");
        (void)t.written->content();
        const auto& mesh = t.written->raster.meshes.begin()->second;
        for (int i = 1; i < 5; ++i) {
            ASSERT_TRUE(t.scene.set(t.node("P"), x3d::Coordinate::point, square(1.f + float(i) / 4)));
            t.frame();
            const std::vector<std::string> followed = t.written->content();
            Written anew(*t.world);
            EXPECT_EQ(followed, anew.content());
        }
        EXPECT_EQ(mesh.set, 2);
        EXPECT_EQ(mesh.bent, 3);
        EXPECT_EQ(mesh.vertices.size(), kind.vertices);
        EXPECT_EQ(t.written->scene.counts().bent, 3u);
    }
}

// 2,000 km away places are still told to a hair.
TEST(RasterScene, PlacesAreRelativeToAnOriginNearTheEye) {
    Reported t(
        "Viewpoint { position 2000000 0 10 }\n"
        "Transform { translation 2000000 .0625 0 children Shape { geometry Box { } } }\n");
    EXPECT_EQ(t.written->content().size(), 1u);
    EXPECT_EQ(t.written->raster.objects.begin()->second.position, glm::vec3(0, .0625f, -10));
    EXPECT_EQ(t.written->scene.origin(), Vec3d(2000000, 0, 10));
}

TEST(RasterScene, WhatItCannotShowIsNamed) {
    Reported t(
        "EnvironmentLight { }\n"
        "Shape { appearance Appearance { texture MultiTexture { texture PixelTexture { image 1 1 3 0xFF0000 } } } "
        "geometry Box { } }\n");
    (void)t.written->content();
    EXPECT_THAT(t.written->lacks, Contains(HasSubstr("EnvironmentLight")));
    EXPECT_THAT(t.written->lacks, Contains(HasSubstr("MultiTexture")));
}

std::pair<std::vector<std::string>, std::vector<std::string>> differencesOf(const std::vector<std::string>& a,
                                                                            const std::vector<std::string>& b) {
    std::pair<std::vector<std::string>, std::vector<std::string>> only;
    std::ranges::set_difference(a, b, std::back_inserter(only.first));
    std::ranges::set_difference(b, a, std::back_inserter(only.second));
    return only;
}

TEST(RasterScene, RandomEditsGiveWhatTheSceneAnewGives) {
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        SCOPED_TRACE(seed);
        Scene scene;
        SeenEdits edits(scene, seed);
        Edits groups(scene, seed);  // of the hierarchy around, with nodes of its own
        SharedWorld world(scene);
        Written written(world);
        for (int set = 0; set < 300; ++set) {
            for (int i = 0; i < 8; ++i) {
                edits.step();
                if (seed == 3) groups.step();
            }
            scene.newFrame(set);
            if (set % 5 != 4) continue;
            const std::vector<std::string> followed = written.content();
            Written anew(world);
            const auto [onlyFollowed, onlyAnew] = differencesOf(followed, anew.content());
            ASSERT_THAT(onlyFollowed, IsEmpty())
                << testing::PrintToString(onlyAnew) << " after " << set << " sets of changes";
            EXPECT_TRUE(followed.size() > 5 || seed == 3) << "little is seen: this test proves nothing";
        }
        const std::size_t objects = written.raster.objects.size();
        EXPECT_LE(written.raster.meshes.size(), objects) << "what nobody shows is given back";
        EXPECT_LE(written.raster.materials.size(), objects);
        EXPECT_LE(written.raster.textures.size(), objects);
    }
}

}  // namespace
}  // namespace rtsg
