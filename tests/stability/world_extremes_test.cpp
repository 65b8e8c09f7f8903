// Scenes that are legal but that an author should avoid: each with its stated outcome.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>
#include <rtsg/renderers/shared_world.h>

#include "renderers/ray_support.h"

namespace rtsg {
namespace {

constexpr std::uint32_t kExtremesSeed = 20260302;

struct ExtremeStage {
    Scene scene;
    SharedWorld shared;
    const RayWorld& world;

    explicit ExtremeStage(const RayWorld::Options& options = {})
        : shared(scene, {.flattening = {}, .rays = options}), world(shared.rays()) {}
    NodeId add(TypeIndex type, NodeId parent) {
        const NodeId node = scene.createNode(type);
        EXPECT_TRUE(scene.insertChild(parent, scene.node(parent).type().findExact("children"), node));
        return node;
    }
    NodeId box(NodeId parent) {
        const NodeId shape = add(x3d::Shape::type, parent);
        EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, scene.createNode(x3d::Box::type)));
        return shape;
    }
    /// Straight down onto (x, z).
    Hit below(float x, float z) { return world.intersect({{x, 50, z}, 0, {0, -1, 0}}); }
};

// Moving or resting: zero, negative, tiny, huge and not finite come and go in any order, and rays never notice more
// than that the thing is flat, mirrored or not there.
TEST(WorldExtremes, ScalesThatComeAndGo) {
    ExtremeStage stage;
    const NodeId still = stage.add(x3d::Transform::type, stage.scene.root());
    ASSERT_TRUE(stage.scene.set(still, x3d::Transform::translation, Vec3f(20, 0, 0)));
    stage.box(still);
    const NodeId mover = stage.add(x3d::Transform::type, stage.scene.root());
    for (int i = 0; i < 3; ++i) {
        const NodeId part = stage.add(x3d::Transform::type, mover);
        ASSERT_TRUE(stage.scene.set(part, x3d::Transform::translation, Vec3f(0, 0, 4.0f * static_cast<float>(i))));
        stage.box(part);
    }
    stage.scene.seal();
    constexpr float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
    std::mt19937 random(kExtremesSeed);
    const auto rotation = [&](const Rotation& r) { EXPECT_TRUE(stage.scene.set(mover, x3d::Transform::rotation, r)); };
    const float values[] = {1, -1, 0, 1e-20f, 1e20f, inf, -inf, nan, 2, 1e-6f, .5f, 1};
    for (int step = 0; step < 600; ++step) {
        SCOPED_TRACE(testing::Message() << "seed " << kExtremesSeed << " step " << step);
        Vec3f scale(1);
        if (step % 3 != 2)
            for (int k = 0; k < 3; ++k) scale[k] = values[random() % std::size(values)];
        ASSERT_TRUE(stage.scene.set(mover, x3d::Transform::scale, scale));
        if (step % 7 == 0) rotation({nan, 0, 1, step % 2 ? inf : 1.0f});
        if (step % 7 == 1) rotation({0, 0, 1, 0});
        stage.scene.seal();
        for (int i = 0; i < 50; ++i) stage.world.intersect(test::randomRay(random, 6));
        EXPECT_TRUE(stage.below(20, 0)) << "its neighbour does not suffer";
        if (step % 7 == 2 && scale == Vec3f(1)) {
            for (const float z : {0.0f, 4.0f, 8.0f}) EXPECT_TRUE(stage.below(.25f, z + .25f)) << "it is back";
        }
    }
    EXPECT_LE(stage.world.stats().groups, 3u) << "no group is left behind for each time it was flat";
}

TEST(WorldExtremes, TenThousandDeepMovesFromTheTop) {
    ExtremeStage stage;
    NodeId parent = stage.scene.root(), top;
    for (int i = 0; i < 10'000; ++i) {
        parent = stage.add(x3d::Transform::type, parent);
        if (i == 0) top = parent;
        if (i % 1000 == 999) stage.box(parent);
    }
    stage.scene.seal();
    EXPECT_EQ(stage.world.stats().traced, 10u);
    for (int i = 1; i <= 20; ++i) {
        ASSERT_TRUE(stage.scene.set(top, x3d::Transform::translation, Vec3f(3.0f * static_cast<float>(i), 0, 0)));
        stage.scene.seal();
        EXPECT_TRUE(stage.below(3.0f * static_cast<float>(i), .25f));
        EXPECT_FALSE(stage.below(3.0f * static_cast<float>(i - 1), .25f));
    }
    EXPECT_EQ(stage.world.stats().bodies, 1u) << "all of it hangs below one mover";
}

TEST(WorldExtremes, AHundredThousandParentsOfOneShape) {
    ExtremeStage stage;
    const NodeId shape = stage.box(stage.scene.root());
    std::vector<NodeId> parents;
    for (int i = 0; i < 100'000; ++i) {
        const NodeId transform = stage.scene.createNode(x3d::Transform::type);
        ASSERT_TRUE(
            stage.scene.set(transform, x3d::Transform::translation,
                            Vec3f(4.0f * static_cast<float>(1 + i % 400), 0, 4.0f * static_cast<float>(i / 400))));
        ASSERT_TRUE(stage.scene.insertChild(transform, x3d::Transform::children, shape));
        ASSERT_TRUE(stage.scene.insertChild(stage.scene.root(), x3d::RtsgScene::children, transform));
        parents.push_back(transform);
    }
    stage.scene.seal();
    EXPECT_EQ(stage.world.stats().traced, 100'001u);
    EXPECT_TRUE(stage.below(4.1f * 1, .1f));
    // One parent lets go, one moves, the shape itself is hidden and shown.
    ASSERT_TRUE(stage.scene.removeChild(parents[0], x3d::Transform::children.index, 0));
    stage.scene.seal();
    EXPECT_FALSE(stage.below(4.1f, .1f));
    ASSERT_TRUE(stage.scene.set(parents[1], x3d::Transform::translation, Vec3f(4, 0, 0)));
    stage.scene.seal();
    EXPECT_TRUE(stage.below(4.1f, .1f));
    ASSERT_TRUE(stage.scene.set(shape, x3d::Shape::visible, false));
    stage.scene.seal();
    EXPECT_EQ(stage.world.stats().traced, 0u);
    ASSERT_TRUE(stage.scene.set(shape, x3d::Shape::visible, true));
    stage.scene.seal();
    EXPECT_EQ(stage.world.stats().traced, 100'000u);
}

// Whole subgraphs hang now here, now there; the hits are those of a world that was never edited.
TEST(WorldExtremes, ReparentStormEndsAsIfBuiltAnew) {
    ExtremeStage stage({.restFrames = 8});
    std::mt19937 random(kExtremesSeed);
    std::vector<NodeId> groups{stage.scene.root()};
    for (int i = 0; i < 60; ++i) {
        const NodeId group = stage.add(x3d::Transform::type, groups[random() % groups.size()]);
        ASSERT_TRUE(stage.scene.set(group, x3d::Transform::translation,
                                    Vec3f(static_cast<float>(random() % 9) - 4, static_cast<float>(random() % 9) - 4,
                                          static_cast<float>(random() % 9) - 4)));
        if (i % 2) stage.box(group);
        groups.push_back(group);
    }
    stage.scene.seal();
    for (int step = 0; step < 2000; ++step) {
        const NodeId child = groups[1 + random() % (groups.size() - 1)], parent = groups[random() % groups.size()];
        const std::vector<ParentRef> parents = stage.scene.parents(child);
        // One that would close a cycle is refused, and stays where it is. Some hang twice.
        if (stage.scene.insertChild(parent, stage.scene.node(parent).type().findExact("children"), child) &&
            (parents.size() > 1 || random() % 50)) {
            const ParentRef& before = parents[random() % parents.size()];
            const auto& list = *static_cast<const Array<NodeId>*>(stage.scene.node(before.node).storage(before.field));
            const auto at = std::find(list.begin(), list.end(), child) - list.begin();
            ASSERT_TRUE(stage.scene.removeChild(before.node, before.field, static_cast<std::size_t>(at)));
        }
        if (random() % 3 == 0) stage.scene.seal();
        if (random() % 500 == 0) stage.shared.finishBackgroundWork();
    }
    stage.scene.seal();
    stage.shared.finishBackgroundWork();
    ExtremeStage fresh;
    ASSERT_TRUE(fresh.scene.apply(std::make_shared<const ChangeSet>(stage.scene.snapshot())));
    EXPECT_EQ(stage.world.stats().traced, fresh.world.stats().traced);
    EXPECT_EQ(stage.world.stats().instancedTriangles, fresh.world.stats().instancedTriangles);
    int hits = 0;
    for (int i = 0; i < 20'000; ++i) {
        const Ray ray = test::randomRay(random, 20);
        const Hit a = stage.world.intersect(ray), b = fresh.world.intersect(ray);
        hits += bool(a);
        ASSERT_EQ(bool(a), bool(b)) << "seed " << kExtremesSeed << " ray " << i;
        if (!a) continue;
        ASSERT_NEAR(a.t, b.t, 1e-4 * b.t + 1e-4);
    }
    EXPECT_GT(hits, 500);
}

// Ten thousand kilometres from zero: ray space moves there, and a closed surface lets nothing through, at rest and
// moving, alone and as part of a body.
TEST(WorldExtremes, ClosedSurfacesAtTenMillionMetres) {
    using namespace test;
    for (const bool moving : {false, true}) {
        RayWorld world;
        const auto sphere = makeSphere(4);
        InstanceDelta delta;
        std::vector<WorldFromLocal> parts;
        for (std::uint32_t i = 0; i < 2; ++i) {
            delta.geometries.push_back({NodeId{i + 1}, i ? makeSphere(4) : sphere});
            parts.push_back(translation({1e7 + 5.0 * i, -1e7, 1e7}));
            delta.added.push_back(makeInstance(i, NodeId{i + 1}, parts.back()));
            delta.added.back().motion = moving ? Motion::moving : Motion::unknown;
            delta.added.back().rigid = 1;
        }
        world.apply(delta);
        EXPECT_EQ(world.stats().bodies, moving ? 1u : 0u);
        std::mt19937 random(kExtremesSeed);
        for (int frame = 0; frame < 3; ++frame) {
            int leaks = 0;
            for (std::uint32_t t = 0; t < sphere->triangleCount; ++t)
                for (const double s : {.25, .5, .75}) {
                    const Vec3d edge = Vec3d(sphere->vertex(t, 0)) * (1 - s) + Vec3d(sphere->vertex(t, 1)) * s;
                    Ray ray;
                    ray.origin =
                        world.fromWorld(parts[0][3] + .1 * Vec3d(random() % 5, random() % 5, random() % 5) / 5.);
                    ray.direction = world.fromWorld(parts[0][3] + edge) - ray.origin;
                    const Hit hit = world.intersect(ray);
                    leaks += !hit || hit.instance != 0;
                }
            EXPECT_EQ(leaks, 0) << "moving " << moving << " frame " << frame << " seed " << kExtremesSeed;
            delta = {};
            const WorldFromLocal shift = translation({.125, .25, 7.5});
            for (std::uint32_t i = 0; i < 2; ++i) {
                parts[i] = compose(shift, parts[i]);
                delta.moved.push_back({{i, 0}, parts[i]});
            }
            world.apply(delta);
        }
        EXPECT_EQ(world.stats().bodiesBuilt, 1u) << "they are seen to move as one";
    }
}

}  // namespace
}  // namespace rtsg
