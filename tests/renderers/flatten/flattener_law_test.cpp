// Law 2 for the Flattener: whatever the edits, its deltas lead to what flattening anew gives.
#include <random>

#include "flattener_oracle.h"
#include "renderers/scene_edits.h"
#include "support/long_form.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace test;

constexpr std::uint64_t kSeed = 20090616;

// Law 2: incremental equals from scratch.
TEST(Flattener, FollowsRandomEditsAsIfFlattenedAnew) {
    std::size_t boxes = 0;
    const std::uint64_t seeds = test::fewOrMany(10, 1000);
    for (std::uint64_t seed = kSeed; seed < kSeed + seeds; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        Edits edits(scene, seed);
        if (seed % 2) edits.showBoxes();
        Meshes meshes;
        SharedWorld flat(scene, {.flattening = {.meshes = meshes.triangles()}, .rays = {}});
        Watcher watcher;
        flat.add(watcher);
        std::mt19937_64 random(seed);
        std::size_t compared = 0;
        for (int frame = 0; frame < 400; ++frame) {
            SCOPED_TRACE(frame);
            for (std::size_t n = frame ? 1 + random() % (frame % 20 ? 6 : 40) : 500; n > 0; --n) edits.step();
            scene.seal();
            ASSERT_EQ(flat.failure(), "");
            expectSame(scene, flat.flattener(), watcher.follower);
            if (testing::Test::HasFailure()) return;
            compared += watcher.follower.instances.size();
            for (const auto& [slot, instance] : watcher.follower.instances) boxes += instance.boundingBox;
            if (frame % 50 ==
                49) {  // a late one, from a snapshot of the scene, and one from a snapshot of the instances
                Flattener late;
                Follower lateFollower;
                lateFollower.apply(late.apply(scene, scene.snapshot()));
                expectSame(scene, late, lateFollower);
                Follower joined;
                joined.apply(flat.flattener().snapshot());
                expectSame(scene, flat.flattener(), joined);
            }
        }
        EXPECT_GT(compared, 500u);
    }
    EXPECT_GT(boxes, 3000u);
}

// The same with an eye that comes and goes, and LODs that have ranges.
TEST(Flattener, FollowsRandomEditsAndAnEyeAsIfFlattenedAnew) {
    std::size_t seenOnly = 0, heardOnly = 0;
    for (std::uint64_t seed = kSeed; seed < kSeed + 10; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        Edits edits(scene, seed);
        if (seed % 2) edits.showBoxes();
        Meshes meshes;
        SharedWorld flat(scene, {.flattening = {.meshes = meshes.triangles()}, .rays = {}});
        Watcher watcher;
        flat.add(watcher);
        std::mt19937_64 random(seed);
        std::optional<Vec3d> viewer;
        for (int frame = 0; frame < 300; ++frame) {
            SCOPED_TRACE(frame);
            for (std::size_t n = frame ? 1 + random() % 6 : 500; n > 0; --n) edits.step();
            scene.forEachNode([&](const Node& node) {
                if (node.is(x3d::LOD::type) && (frame == 0 || random() % 16 == 0)) {
                    EXPECT_TRUE(
                        scene.set(node.id(), x3d::LOD::range, Array<float>{static_cast<float>(random() % 4), 4, 8}));
                }
            });
            if (random() % 3 == 0) {
                viewer.reset();
                if (random() % 5 != 0)
                    viewer = Vec3d(static_cast<double>(random() % 20), static_cast<double>(random() % 5), 0);
                ASSERT_TRUE(flat.setViewer(viewer));
            }
            scene.seal();
            ASSERT_EQ(flat.failure(), "");
            expectSame(scene, flat.flattener(), watcher.follower, viewer);
            if (testing::Test::HasFailure()) return;
            for (const auto& [slot, instance] : watcher.follower.instances) {
                EXPECT_TRUE(instance.seen || instance.heard);
                seenOnly += !instance.heard && !instance.boundingBox, heardOnly += !instance.seen;
            }
            if (frame % 50 == 49) {
                Flattener late;
                late.setViewer(viewer);
                Follower lateFollower;
                lateFollower.apply(late.apply(scene, scene.snapshot()));
                expectSame(scene, late, lateFollower, viewer);
            }
        }
    }
    EXPECT_GT(seenOnly, 200u);
    EXPECT_GT(heardOnly, 200u);
}

TEST(Flattener, MergedChangeSetsLeadToTheSame) {
    for (std::uint64_t seed = kSeed; seed < kSeed + 6; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        Edits edits(scene, seed);
        if (seed % 2) edits.showBoxes();
        SharedWorld flat(scene, {.flattening = {}, .rays = {}, .delivery = Delivery::polled});
        Watcher watcher;
        flat.add(watcher);
        for (int frame = 0; frame < 120; ++frame) {
            for (int n = frame ? 5 : 600; n > 0; --n) edits.step();
            scene.seal();
            if (frame % 7 != 6) continue;
            ASSERT_TRUE(flat.update());
            expectSame(scene, flat.flattener(), watcher.follower);
            if (testing::Test::HasFailure()) return;
        }
    }
}

// Edits that also replace lists as wholes and destroy what is deep in the scene, several seals in one set.
TEST(Flattener, MergedSetsOfAllKindsOfEditsLeadToTheSame) {
    for (std::uint64_t seed = kSeed; seed < kSeed + 20; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        const NodeId top = scene.createNode(x3d::Group::type);
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, top));
        test::RandomEdits edits(scene, seed, top);
        SharedWorld flat(scene, {.flattening = {}, .rays = {}, .delivery = Delivery::polled});
        Watcher watcher;
        flat.add(watcher);
        for (int frame = 0; frame < 200; ++frame) {
            for (int n = 0; n < 6; ++n) edits.step();
            scene.seal();
            if (frame % 37 != 36) continue;
            ASSERT_TRUE(flat.update());
            ASSERT_EQ(flat.failure(), "");
            expectSame(scene, flat.flattener(), watcher.follower);
            if (testing::Test::HasFailure()) return;
        }
    }
}

}  // namespace
}  // namespace rtsg
