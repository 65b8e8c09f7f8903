// Bounding boxes that bboxDisplay shows: where they are, to closed forms, and what a frame reports of them.
#include <algorithm>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/world_queries.h>

#include "flatten/bounding_boxes.h"
#include "flattener_oracle.h"

namespace rtsg {
namespace {

using namespace test;

struct ShownBoxes {
    Scene scene;
    Diagnostics diagnostics;
    std::unique_ptr<SharedWorld> world;
    Watcher watcher;

    explicit ShownBoxes(const std::string& body) {
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Immersive\n" + body, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        world = std::make_unique<SharedWorld>(scene);
        world->add(watcher);
        seal();
    }
    NodeId node(const char* name) const { return scene.findName(name); }
    const InstanceDelta& seal() {
        watcher.last.clear();
        scene.seal();
        EXPECT_EQ(world->failure(), "");
        expectSame(scene, world->flattener(), watcher.follower);
        return watcher.last;
    }
    /// Their places, by x.
    std::vector<WorldFromLocal> boxes() const {
        std::vector<WorldFromLocal> all;
        for (const auto& [slot, instance] : watcher.follower.instances)
            if (instance.boundingBox) all.push_back(instance.worldFromLocal);
        std::ranges::sort(all, {}, [](const WorldFromLocal& m) { return m[3].x; });
        return all;
    }
    std::size_t movedBoxes() const {
        return static_cast<std::size_t>(std::ranges::count_if(
            watcher.last.moved, [&](const auto& m) { return watcher.follower.instances.at(m.id.slot).boundingBox; }));
    }
};

void expectPosition(const WorldFromLocal& m, const Vec3d& center, const Vec3d& size, double tolerance = 1e-7) {
    for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(m[3][k], center[k], tolerance) << k;
        EXPECT_NEAR(m[k][k], size[k], tolerance) << k;
    }
}

TEST(BoundingBoxes, LieAlongTheWorldsAxesHoweverTheContentIsTurned) {
    ShownBoxes s(
        "Transform { rotation 0 0 1 .6 translation 5 0 0 bboxDisplay TRUE children Shape { geometry Box { } } }");
    ASSERT_EQ(s.boxes().size(), 1u);
    const double side = 2 * (std::cos(.6) + std::sin(.6));
    expectPosition(s.boxes()[0], {5, 0, 0}, {side, side, 2});
}

// A ball is as wide however it is turned; a box around its turned box would be 2 (cos + sin) = 2.7 wide.
TEST(BoundingBoxes, GoAroundTheTrianglesThemselves) {
    ShownBoxes s("Transform { rotation .36 .48 .8 .6 bboxDisplay TRUE children Shape { geometry Sphere { } } }");
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(s.boxes().at(0)[k][k], 2, .02);
    // The box of a cone that lies on its side is exactly as long as the cone is high.
    ShownBoxes cone(
        "Transform { rotation 0 0 1 -1.57079632679 bboxDisplay TRUE children Shape { geometry Cone { height 3 } } }");
    EXPECT_NEAR(cone.boxes().at(0)[0].x, 3, 1e-6);
    EXPECT_NEAR(cone.boxes()[0][1].y, 2, .02);
}

TEST(BoundingBoxes, AnAuthorsBoxIsTurnedWithTheContent) {
    ShownBoxes s(
        "Transform { rotation 0 1 0 .5 translation 0 7 0 bboxSize 4 1 2 bboxCenter 1 0 0 bboxDisplay TRUE children "
        "Shape { geometry Box { } } }");
    const double c = std::cos(.5), n = std::sin(.5);
    expectPosition(s.boxes().at(0), {c, 7, -n}, {4 * c + 2 * n, 1, 4 * n + 2 * c});
}

TEST(BoundingBoxes, ShowWhatIsHiddenAndNothingWhereNothingIs) {
    ShownBoxes s(
        "Transform { visible FALSE bboxDisplay TRUE children Shape { geometry Box { size 1 2 3 } } }"
        "Transform { translation 9 0 0 children Group { bboxDisplay TRUE children [ Shape { geometry Box { } }, "
        "Shape { visible FALSE geometry Box { size 8 1 1 } } ] } }"
        "Group { bboxDisplay TRUE } Switch { bboxDisplay TRUE children Shape { geometry Box { } } }");
    ASSERT_EQ(s.boxes().size(), 2u);
    expectPosition(s.boxes()[0], {}, {1, 2, 3});
    expectPosition(s.boxes()[1], {9, 0, 0}, {8, 2, 2});
}

TEST(BoundingBoxes, HaveOneMeshForAllPlacesOfAllNodes) {
    ShownBoxes s(
        "DEF G Group { bboxDisplay TRUE children DEF S Shape { bboxDisplay TRUE geometry Box { } } }"
        "Transform { translation 20 0 0 scale 2 1 1 children USE G }");
    ASSERT_EQ(s.boxes().size(), 4u);
    for (int k : {0, 1}) expectPosition(s.boxes()[static_cast<std::size_t>(k)], {}, {2, 2, 2});
    for (int k : {2, 3}) expectPosition(s.boxes()[static_cast<std::size_t>(k)], {20, 0, 0}, {4, 2, 2});
    EXPECT_EQ(s.watcher.follower.meshes.size(), 2u);
}

TEST(BoundingBoxes, AreAsExactFarOut) {
    ShownBoxes s(
        "Transform { translation 100000000 0 0 rotation 0 0 1 .6 bboxDisplay TRUE children Shape { geometry Box { } } "
        "}");
    const double side = 2 * (std::cos(.6) + std::sin(.6));
    expectPosition(s.boxes().at(0), {1e8, 0, 0}, {side, side, 2}, 1e-7);
}

TEST(BoundingBoxes, FlatOnesAreAMillionthThick) {
    ShownBoxes s("Shape { bboxDisplay TRUE geometry Rectangle2D { size 4 2 } }");
    expectPosition(s.boxes().at(0), {}, {4, 2, 0x1p-18}, 1e-12);
    ShownBoxes point("Shape { bboxDisplay TRUE geometry PointSet { coord Coordinate { point 1 2 3 } } }");
    EXPECT_TRUE(point.boxes().empty());
}

TEST(BoundingBoxes, AreShownAndHiddenAtRunTime) {
    ShownBoxes s("DEF T Transform { children DEF S Shape { geometry Box { } } }");
    EXPECT_TRUE(s.boxes().empty());
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::bboxDisplay, true));
    const InstanceDelta& shown = s.seal();
    EXPECT_EQ(shown.added.size(), 1u);
    ASSERT_EQ(shown.geometries.size(), 1u) << "its edges";
    EXPECT_EQ(shown.geometries[0].mesh->strokeCount, 12u);
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::bboxDisplay, false));
    const InstanceDelta& hidden = s.seal();
    EXPECT_EQ(hidden.removed.size(), 1u);
    EXPECT_EQ(hidden.geometriesRemoved.size(), 1u);
    EXPECT_TRUE(s.boxes().empty());
}

// If a thing gets a box of its own in the frame in which it shrinks, the box around shrinks too.
TEST(BoundingBoxes, ThatAppearAsTheirContentGoesTakeItFromTheOneAround) {
    ShownBoxes s(
        "Transform { bboxDisplay TRUE children [ DEF A Shape { geometry DEF S Sphere { radius 3 } } "
        "Shape { geometry Box { } } ] }");
    expectPosition(s.boxes().at(0), {0, 0, 0}, {6, 6, 6}, .05);
    ASSERT_TRUE(s.scene.set(s.node("A"), x3d::Shape::bboxDisplay, true));
    ASSERT_TRUE(s.scene.destroyNode(s.node("S")));
    s.seal();
    ASSERT_EQ(s.boxes().size(), 1u);
    expectPosition(s.boxes()[0], {0, 0, 0}, {2, 2, 2});
}

TEST(BoundingBoxes, FollowContentThatMovesChangesComesAndGoes) {
    ShownBoxes s(
        "DEF G Group { bboxDisplay TRUE children [ Shape { geometry DEF B Box { size 2 2 2 } } DEF T Transform { "
        "translation 4 0 0 children Shape { geometry Box { } } } ] } DEF O Transform { children Shape { geometry Box { "
        "} } }");
    expectPosition(s.boxes().at(0), {2, 0, 0}, {6, 2, 2});
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(9, 0, 0)));
    s.seal();
    expectPosition(s.boxes().at(0), {4.5, 0, 0}, {11, 2, 2});
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(0, -3, 0)));
    s.seal();
    expectPosition(s.boxes().at(0), {0, -1.5, 0}, {2, 5, 2});
    EXPECT_EQ(s.movedBoxes(), 1u);
    ASSERT_TRUE(s.scene.set(s.node("O"), x3d::Transform::translation, Vec3f(1, 0, 0)));
    s.seal();
    EXPECT_EQ(s.movedBoxes(), 0u) << "what is beside it is none of its business";
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::scale, Vec3f(.25f)));
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(0)));
    s.seal();
    expectPosition(s.boxes().at(0), {}, {2, 2, 2});
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(.25f, 0, 0)));
    s.seal();
    EXPECT_EQ(s.movedBoxes(), 0u) << "it moves inside";
    ASSERT_TRUE(s.scene.setField(s.node("B"), x3d::Box::size.index, Vec3f(3, 1, 1)));
    s.seal();
    expectPosition(s.boxes().at(0), {}, {3, 1, 1});
    ASSERT_TRUE(s.scene.set(s.node("G"), x3d::Group::children, Array<NodeId>{s.node("T")}));
    s.seal();
    expectPosition(s.boxes().at(0), {.25, 0, 0}, {.5, .5, .5});
    ASSERT_TRUE(s.scene.set(s.node("G"), x3d::Group::children, Array<NodeId>{}));
    EXPECT_EQ(s.seal().removed.size(), 2u);
    EXPECT_TRUE(s.boxes().empty());
}

// The eye chooses it.
TEST(BoundingBoxes, GoAroundTheLevelThatIsSeen) {
    ShownBoxes s(
        "LOD { range 10 bboxDisplay TRUE children [ Shape { geometry Box { size 4 4 4 } } Shape { geometry Box { } } ] "
        "}");
    expectPosition(s.boxes().at(0), {}, {4, 4, 4});
    const auto seen = [&](double z) {
        ASSERT_TRUE(s.world->setViewer(Vec3d(0, 0, z)));
        expectSame(s.scene, s.world->flattener(), s.watcher.follower, Vec3d(0, 0, z));
    };
    seen(30);
    expectPosition(s.boxes().at(0), {}, {2, 2, 2});
    seen(3);
    expectPosition(s.boxes().at(0), {}, {4, 4, 4});
}

// Volumes and particles are their own geometry, and have a box like any shape.
TEST(BoundingBoxes, OfAVolume) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nVolumeData { bboxDisplay TRUE dimensions 1 2 3 }", diagnostics));
    Flattener flattener;
    Follower follower;
    follower.apply(flattener.apply(scene, scene.snapshot()));
    ASSERT_EQ(follower.instances.size(), 2u);
    for (const auto& [slot, instance] : follower.instances) {
        EXPECT_TRUE(instance.boundingBox || instance.volume);
        if (instance.boundingBox) expectPosition(instance.worldFromLocal, {}, {1, 2, 3});
    }
}

TEST(BoundingBoxes, AreSeenAndNothingElse) {
    ShownBoxes s("Transform { visible FALSE bboxDisplay TRUE children Shape { geometry Box { } } }");
    const RayWorld& rays = s.world->rays();
    const Ray along{.origin = {1, 0, 5}, .direction = {0, 0, -1}};  // to the middle of an upright edge
    const LensedView view(rays, {{1, 0, 5}, {0, 0, -1}, .01f, 0});
    const Hit hit = view.intersect(along, RayKind::eye);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit.t, 4, .05);
    EXPECT_FALSE(view.intersect(along, RayKind::view));
    EXPECT_FALSE(view.occluded(along, RayKind::shadow));
    EXPECT_FALSE(view.occluded(along, RayKind::sound));
    const auto pick = Picker(rays, s.world->flattener()).ray({1, 0, 5}, {0, 0, -1}, 100, .01);
    ASSERT_TRUE(pick);
    EXPECT_FALSE(pick->instance);
    EXPECT_TRUE(WorldQueries(*s.world).boxes().empty());
}

}  // namespace
}  // namespace rtsg
