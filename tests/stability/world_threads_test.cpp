// Thousands of edits on one thread while another follows a copy of its own and traces it. Stated outcome: the tracer
// never waits for the editor nor the other way round, sees whole frames only, and ends with the hits of a world built
// from the last state. Run it under the thread sanitizer.
#include <atomic>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/core/replica.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

#include "renderers/ray_support.h"
#include "renderers/scene_edits.h"

namespace rtsg {
namespace {

constexpr std::uint64_t kThreadsSeed = 20260303;

struct Tracer final : Subscriber {
    Flattener flattener;
    RayWorld world{{.restFrames = 4}};
    Result<> apply(const Scene& scene, const ChangeSet& changes) override {
        world.apply(flattener.apply(scene, changes));
        return {};
    }
};

TEST(WorldThreads, TopologyEditsWhileAnotherThreadTraces) {
    SCOPED_TRACE(testing::Message() << "seed " << kThreadsSeed);
    Scene scene;
    Replica replica(scene);
    Tracer tracer;
    std::atomic<bool> stop{false};
    std::size_t polls = 0, hits = 0;
    std::thread follower([&] {
        const Attachment attachment = replica.scene().bus().attach(tracer);
        std::mt19937 random(kThreadsSeed);
        for (bool last = false; !last;) {
            last = stop.load();
            replica.poll();
            ++polls;
            for (int i = 0; i < 200; ++i) hits += bool(tracer.world.intersect(test::randomRay(random, 8)));
        }
    });
    test::Edits edits(scene, kThreadsSeed);
    for (int frame = 0; frame < 5000; ++frame) {
        for (int i = 0; i < 8; ++i) edits.step();
        scene.seal();
    }
    stop = true;
    follower.join();
    EXPECT_GT(polls, 1u);
    tracer.world.finishBackgroundWork();
    EXPECT_EQ(replica.scene().hash(), scene.hash());
    Flattener flattener;
    RayWorld fresh;
    fresh.apply(flattener.apply(scene, scene.snapshot()));
    EXPECT_EQ(tracer.world.stats().traced, fresh.stats().traced);
    std::mt19937 random(kThreadsSeed);
    for (int i = 0; i < 5000; ++i) {
        const Ray ray = test::randomRay(random, 8);
        const Hit a = tracer.world.intersect(ray), b = fresh.intersect(ray);
        ASSERT_EQ(bool(a), bool(b)) << i;
        if (!a) continue;
        ASSERT_NEAR(a.t, b.t, 1e-4 * b.t + 1e-4);
    }
}

}  // namespace
}  // namespace rtsg
