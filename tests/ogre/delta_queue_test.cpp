// Deltas that wait for another thread give what following at once gives, however many there are and whenever they are
// taken.
#include "raster/delta_queue.h"

#include <random>

#include <gtest/gtest.h>

#include "renderers/scene_edits.h"
#include "seen_edits.h"
#include "support/long_form.h"
#include "written_raster.h"

namespace rtsg {
namespace {

using namespace test;

/// Follows a world by a queue.
class Behind final : public InstanceSubscriber {
  public:
    explicit Behind(SharedWorld& w) : world(w) {
        scene.open(&raster);
        world.add(*this);
    }
    ~Behind() override { world.remove(*this); }
    Result<> apply(const Scene& from, const ChangeSet& changes, const InstanceDelta& delta) override {
        queue.add(delta);
        return tables.apply(from, changes, delta);
    }
    void take() {
        const auto news = queue.take(queue.newest());
        ASSERT_TRUE(news);
        for (const InstanceDelta& delta : *news) scene.follow(delta);
    }
    std::vector<std::string> content() {
        take();
        const SurfaceState state = tables.latest();
        const BoxOfLayer boxes = [this](std::uint16_t layer) { return scene.box(layer); };
        scene.bring(state, state.layers(boxes, *state.camera(boxes, 1), 64, 64), state.camera(boxes, 1)->position);
        EXPECT_EQ(raster.wrong, 0);
        return raster.content(scene.origin());
    }

    SharedWorld& world;
    DeltaQueue queue;
    SurfaceTables tables;
    WrittenRaster raster;  // outlives what is handed to it
    RasterScene scene{[](const char*) {}};
};

TEST(DeltaQueues, TakenWheneverTheyGiveWhatTheSceneAnewGives) {
    const std::uint64_t seeds = fewOrMany<std::uint64_t>(3, 30);
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        SCOPED_TRACE(seed);
        Scene scene;
        SeenEdits edits(scene, seed);
        Edits groups(scene, seed);
        std::mt19937_64 random(seed);
        SharedWorld world(scene);
        Behind behind(world);
        for (int set = 0; set < 800; ++set) {
            for (int i = 0; i < 4; ++i) {
                edits.step();
                if (seed % 3 == 0) groups.step();
            }
            scene.newFrame(set);
            // At first soon, then not until so many wait that most are merged.
            if (set >= 200 || random() % 7 != 0) continue;
            const std::vector<std::string> content = behind.content();
            Written anew(world);
            ASSERT_EQ(content, anew.content()) << "after " << set << " sets of changes";
        }
        Written anew(world);
        ASSERT_EQ(behind.content(), anew.content());
    }
}

TEST(DeltaQueues, WhatIsTakenOrMergedIsNotTakenAgain) {
    DeltaQueue queue;
    InstanceDelta delta;
    queue.add(delta);
    EXPECT_EQ(queue.newest(), 0u) << "nothing of it has to do with instances";
    delta.appearanceChanged = {NodeId{1}};
    for (int i = 0; i < 10; ++i) queue.add(delta);
    EXPECT_EQ(queue.newest(), 10u);
    EXPECT_EQ(queue.take(4)->size(), 4u);
    EXPECT_FALSE(queue.take(3)) << "it is behind";
    EXPECT_EQ(queue.take(4)->size(), 0u);
    for (std::size_t i = 0; i < DeltaQueue::kMax; ++i) queue.add(delta);
    EXPECT_FALSE(queue.take(20)) << "merged with what came later";
    const auto rest = queue.take(queue.newest());
    ASSERT_TRUE(rest);
    EXPECT_LE(rest->size(), DeltaQueue::kMax);
    EXPECT_TRUE(queue.take(queue.newest())->empty());
}

}  // namespace
}  // namespace rtsg
