// Meshes whose coordinates change: tessellated in place and refitted, and equal to what is made from scratch.
#include <gtest/gtest.h>

#include <random>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/tessellator.h>

#include "deform_support.h"
#include "embree/bvh.h"
#include "embree/bvh_watch.h"

namespace rtsg {
namespace {

/// Corner by corner: what is stored where may differ, what it means may not.
::testing::AssertionResult sameMesh(const Mesh& a, const Mesh& b) {
    using ::testing::AssertionFailure;
    if (a.triangleCount != b.triangleCount)
        return AssertionFailure() << a.triangleCount << " triangles, " << b.triangleCount << " from scratch";
    if (a.bounds.min != b.bounds.min || a.bounds.max != b.bounds.max) return AssertionFailure() << "bounds differ";
    if (a.solid != b.solid || a.texCoords.size() != b.texCoords.size()) return AssertionFailure() << "fields differ";
    if (a.normals.present() != b.normals.present()) return AssertionFailure() << "normals come or go";
    for (std::uint32_t t = 0; t < a.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const float u = c == 1, v = c == 2;
            if (a.vertexIndex(t, c) != b.vertexIndex(t, c) || a.vertex(t, c) != b.vertex(t, c))
                return AssertionFailure() << "corner " << c << " of triangle " << t;
            if (a.normals.present() && a.normals.value(t, c) != b.normals.value(t, c))
                return AssertionFailure() << "normal " << c << " of triangle " << t;
            for (std::size_t k = 0; k < a.texCoords.size(); ++k)
                if (a.texCoord(t, u, v, k) != b.texCoord(t, u, v, k))
                    return AssertionFailure() << "texture coordinate " << c << " of triangle " << t;
        }
    return ::testing::AssertionSuccess();
}

/// A grid with bumps; some faces are quads, some triangles, some polygons of six corners.
struct Sheet {
    Scene scene;
    NodeId faces, coordinate;
    Array<Vec3f> points;

    Sheet(int side, int kind, float creaseAngle, bool ccw) {
        for (int y = 0; y <= side; ++y)
            for (int x = 0; x <= side; ++x) points.push_back(Vec3f(x, y, std::sin(x * .7f) * std::cos(y * .9f)));
        Array<std::int32_t> index;
        const auto at = [&](int x, int y) { return y * (side + 1) + x; };
        for (int y = 0; y < side; ++y)
            for (int x = 0; x < side; ++x) {
                const std::int32_t a = at(x, y), b = at(x + 1, y), c = at(x + 1, y + 1), d = at(x, y + 1);
                if (kind == 2 && x + 1 < side && (x + y) % 2 == 0) {
                    for (const std::int32_t v : {a, b, at(x + 2, y), at(x + 2, y + 1), c, d, -1}) index.push_back(v);
                    ++x;
                } else if (kind == 1 || (kind == 2 && x % 3)) {
                    for (const std::int32_t v : {a, b, c, d, -1}) index.push_back(v);
                } else {
                    for (const std::int32_t v : {a, b, c, -1, a, c, d, -1}) index.push_back(v);
                }
            }
        coordinate = scene.createNode(x3d::Coordinate::type), faces = scene.createNode(x3d::IndexedFaceSet::type);
        EXPECT_TRUE(scene.set(coordinate, x3d::Coordinate::point, points));
        EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coord, coordinate));
        EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coordIndex, index));
        EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::creaseAngle, creaseAngle));
        EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::ccw, ccw));
    }
    void move(const Array<Vec3f>& to) { EXPECT_TRUE(scene.set(coordinate, x3d::Coordinate::point, to)); }
};

Array<Vec3f> jittered(const Array<Vec3f>& points, std::mt19937& random, float amount) {
    std::uniform_real_distribution<float> unit(-amount, amount);
    Array<Vec3f> result = points;
    Vec3f* out = result.mutableData();
    for (std::size_t i = 0; i < result.size(); ++i) out[i] += Vec3f(unit(random), unit(random), unit(random));
    return result;
}

TEST(Deform, InPlaceEqualsFromScratch) {
    const unsigned seed = std::random_device{}();
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    int kept = 0, changed = 0;
    for (const int kind : {0, 1, 2})
        for (const float crease : {0.f, .4f, 2.f, 4.f})
            for (const bool ccw : {true, false}) {
                Sheet sheet(9, kind, crease, ccw);
                Tessellator tessellator;
                std::shared_ptr<const Mesh> last = tessellator.mesh(sheet.scene, sheet.faces);
                for (int step = 0; step < 12; ++step) {
                    sheet.move(jittered(sheet.points, random, step % 3 == 2 ? .6f : .05f));
                    const auto mesh = tessellator.mesh(sheet.scene, sheet.faces);
                    const auto fresh = tessellate(sheet.scene, sheet.faces);
                    ASSERT_TRUE(mesh && fresh);
                    ASSERT_EQ(findDefect(*mesh), "");
                    ASSERT_TRUE(sameMesh(*mesh, **fresh))
                        << "kind " << kind << " crease " << crease << " step " << step;
                    (mesh->triangles.sameStorage(last->triangles) ? kept : changed) += 1;
                    last = mesh;
                }
            }
    // Polygons are cut otherwise now and then; triangles never are.
    EXPECT_GT(kept, 95);
    EXPECT_GT(changed, 10);
}

TEST(Deform, TrianglesAndPositionsAreShared) {
    Sheet sheet(6, 0, 2, true);
    Tessellator tessellator;
    (void)tessellator.mesh(sheet.scene, sheet.faces);
    std::mt19937 random(3);
    for (int step = 0; step < 3; ++step) {
        sheet.move(jittered(sheet.points, random, .2f));
        const auto mesh = tessellator.mesh(sheet.scene, sheet.faces);
        EXPECT_TRUE(mesh->positions.sameStorage(sheet.scene.node(sheet.coordinate).get(x3d::Coordinate::point)));
        EXPECT_TRUE(mesh->triangles.sameStorage(sheet.scene.node(sheet.faces).get(x3d::IndexedFaceSet::coordIndex)));
    }
}

TEST(Deform, WhatElseChangesIsSeen) {
    Sheet sheet(4, 1, 2, true);
    Tessellator tessellator;
    std::mt19937 random(3);
    const auto check = [&](const char* what) {
        const auto mesh = tessellator.mesh(sheet.scene, sheet.faces);
        EXPECT_TRUE(sameMesh(*mesh, **tessellate(sheet.scene, sheet.faces))) << what;
    };
    for (int i = 0; i < 3; ++i) sheet.move(jittered(sheet.points, random, .1f)), check("points");
    ASSERT_TRUE(sheet.scene.set(sheet.faces, x3d::IndexedFaceSet::creaseAngle, 0.f));
    check("crease");
    ASSERT_TRUE(sheet.scene.set(sheet.faces, x3d::IndexedFaceSet::solid, false));
    check("solid");
    ASSERT_TRUE(sheet.scene.set(sheet.faces, x3d::IndexedFaceSet::coordIndex, Array<std::int32_t>{0, 1, 2, 7, -1}));
    check("index");
    const NodeId st = sheet.scene.createNode(x3d::TextureCoordinate::type);
    ASSERT_TRUE(sheet.scene.set(st, x3d::TextureCoordinate::point, Array<Vec2f>::ofSize(sheet.points.size())));
    ASSERT_TRUE(sheet.scene.set(sheet.faces, x3d::IndexedFaceSet::texCoord, st));
    check("texture coordinates");
    Array<Vec3f> fewer = sheet.points;
    fewer.resize(fewer.size() - 1);
    sheet.move(fewer);
    check("fewer points");
    Array<Vec3f> broken = sheet.points;
    broken.mutableData()[1] = Vec3f(NAN);
    sheet.move(broken);
    check("a point that is none");
    sheet.move(sheet.points);
    check("and back");
}

/// They come when it is seen, and once more when it begins to move; not in every frame.
TEST(Deform, WarningsAreNotGivenInEveryFrame) {
    Sheet sheet(4, 0, 0, true);
    Array<std::int32_t> index = sheet.scene.node(sheet.faces).get(x3d::IndexedFaceSet::coordIndex);
    for (const std::int32_t v : {0, 1, 9999, -1}) index.push_back(v);
    ASSERT_TRUE(sheet.scene.set(sheet.faces, x3d::IndexedFaceSet::coordIndex, index));
    Tessellator tessellator;
    std::mt19937 random(1);
    for (int i = 0; i < 10; ++i) {
        (void)tessellator.mesh(sheet.scene, sheet.faces);
        sheet.move(jittered(sheet.points, random, .1f));
    }
    std::string all;
    for (const Diagnostic& d : tessellator.diagnostics().all()) all += d.text + '\n';
    EXPECT_EQ(tessellator.diagnostics().all().size(), 2u) << all;
    EXPECT_NE(all.find("9999"), std::string::npos) << all;
}

// ---- the tree -----------------------------------------------------------------------------------------------------

using test::moved, test::sameHits, test::twist;

TEST(Deform, WatchIgnoresPlaceAndScale) {
    const auto mesh = test::makeSphere(4);
    const bvh::Device device(1, true);
    const bvh::BvhWatch watch(device.get(), *mesh);
    EXPECT_GT(watch.builtCost(), 1);
    for (const float scale : {1e-3f, 1.f, 1e6f}) {
        const auto there = moved(*mesh, [&](Vec3f p) { return scale * (p + Vec3f(3, -2, 1)); });
        const auto look = watch.look(there->positions);
        EXPECT_NEAR(look.change, 0, 1e-3);
        EXPECT_NEAR(look.cost, watch.builtCost(), 1e-3 * watch.builtCost());
    }
    EXPECT_EQ(watch.look(moved(*mesh, [](Vec3f) { return Vec3f(1); })->positions).change, 0);
    double before = 0;
    for (const float amount : {.1f, .3f, 1.f, 3.f}) {
        const auto look =
            watch.look(moved(*mesh, [&](Vec3f p) { return twist(p * Vec3f(1, 3, .3f), amount); })->positions);
        EXPECT_GT(look.change, before);
        before = look.change;
    }
}

TEST(Deform, WatchOfAPointWantsATreeOnReturn) {
    const auto mesh = test::makeSphere(3);
    const bvh::Device device(1, true);
    const bvh::BvhWatch watch(device.get(), *moved(*mesh, [](Vec3f) { return Vec3f(2); }));
    EXPECT_TRUE(std::isinf(watch.look(mesh->positions).change));
}

TEST(Deform, RefittedAndRebuiltGiveTheHitsOfFromScratch) {
    const unsigned seed = std::random_device{}();
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    for (const int levels : {2, 5}) {  // one is rebuilt at once, the other in the background
        const auto rest = test::makeSphere(levels);
        test::OneShape follow;
        for (int step = 0; step < 40; ++step) {
            const auto mesh =
                moved(*rest, [&](Vec3f p) { return twist(p * Vec3f(1, 3, .3f), .1f * static_cast<float>(step)); });
            follow.show(mesh);
            if (step % 8 != 7) continue;
            test::OneShape fresh;
            fresh.show(mesh);
            ASSERT_TRUE(sameHits(follow.world, fresh.world, random, 500)) << "step " << step;
        }
        const RayWorld::Stats stats = follow.world.stats();
        EXPECT_GT(stats.meshRefits, 10u);
        EXPECT_GE(stats.meshRebuilds, 1u);
        EXPECT_EQ(stats.meshBuilds, 2u);  // the first, and the first that can be refitted
    }
}

TEST(Deform, TravelNeedsNoRebuild) {
    const auto rest = test::makeSphere(5);
    test::OneShape follow;
    for (int step = 0; step < 200; ++step)
        follow.show(moved(*rest, [&](Vec3f p) { return p + static_cast<float>(step) * Vec3f(1, .5f, .25f); }));
    EXPECT_EQ(follow.world.stats().meshRebuilds, 0u);
    EXPECT_GE(follow.world.stats().meshRefits, 198u);
}

TEST(Deform, TheSameUpdatesGiveTheSameTreesWhenWaitedFor) {
    const auto rest = test::makeSphere(5);
    std::size_t rebuilds[2];
    for (std::size_t& count : rebuilds) {
        test::OneShape follow;
        for (int step = 0; step < 60; ++step)
            follow.show(moved(
                *rest, [&](Vec3f p) { return twist(p * Vec3f(1, 3, .3f), std::sin(.1f * static_cast<float>(step))); }));
        count = follow.world.stats().meshRebuilds;
    }
    EXPECT_EQ(rebuilds[0], rebuilds[1]);
    EXPECT_GT(rebuilds[0], 0u);
}

TEST(Deform, MeshesMayGoWhileTheirRebuildIsUnderWay) {
    const auto rest = test::makeSphere(6);
    for (int round = 0; round < 5; ++round) {
        RayWorld world({.buildThreads = 1});
        InstanceDelta delta;
        Instance instance;
        instance.id = {0, 1}, instance.shape = NodeId{2}, instance.geometry = NodeId{1};
        instance.motion = Motion::moving;
        delta.added.push_back(instance);
        for (int step = 0; step < 4 + round; ++step) {
            delta.geometries.push_back({NodeId{1}, moved(*rest, [&](Vec3f p) {
                                            return twist(p * Vec3f(1, 3, .3f), static_cast<float>(step));
                                        })});
            world.apply(delta);
            delta.clear();
        }
        if (round % 2) {
            delta.removed.push_back({0, 1});
            delta.geometriesRemoved.push_back(NodeId{1});
            world.apply(delta);
            EXPECT_FALSE(world.intersect({.origin = {0, 0, 9}}));
        }
    }
}

}  // namespace
}  // namespace rtsg
