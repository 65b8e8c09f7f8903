// A frame in which things only move asks for no memory, from the change set to what rays see.
#include <atomic>
#include <cstdlib>
#include <new>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

#include "support/own_heap.h"

namespace {

std::atomic<std::size_t> worldAllocations{0};

}  // namespace

#if RTSG_HEAP_IS_OURS
// Counts for the whole test program; what is counted matters between two readings on a quiet program only.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"  // both are replaced below
void* operator new(std::size_t size) {
    worldAllocations.fetch_add(1, std::memory_order_relaxed);
    if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}
#endif

namespace rtsg {
namespace {

/// Hands on what it is given to a flattener and a world, and counts what that allocates.
struct SteadyFollowing final : Subscriber {
    Flattener flattener;
    RayWorld world;
    std::size_t allocated = 0;
    Result<> apply(const Scene& scene, const ChangeSet& changes) override {
        const std::size_t before = worldAllocations.load();
        world.apply(flattener.apply(scene, changes));
        allocated = worldAllocations.load() - before;
        return {};
    }
};

TEST(WorldSteady, AThousandMovingTransformsAllocateNothing) {
    if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer has the heap";
    Scene scene;
    std::vector<NodeId> movers;
    const NodeId shared = scene.createNode(x3d::Box::type);
    for (int i = 0; i < 1000; ++i) {
        const NodeId transform = scene.createNode(x3d::Transform::type);
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, transform));
        // One shape, or three that move as one; a mesh of their own, or a shared one.
        for (int k = 0; k < (i % 2 ? 1 : 3); ++k) {
            const NodeId shape = scene.createNode(x3d::Shape::type);
            ASSERT_TRUE(scene.set(shape, x3d::Shape::geometry, i % 3 ? scene.createNode(x3d::Box::type) : shared));
            ASSERT_TRUE(scene.insertChild(transform, x3d::Transform::children, shape));
        }
        movers.push_back(transform);
    }
    SteadyFollowing following;
    const Attachment attachment = scene.bus().attach(following);
    scene.seal();
    std::size_t maximum = 0;
    for (int frame = 0; frame < 60; ++frame) {
        for (std::size_t i = 0; i < movers.size(); ++i)
            ASSERT_TRUE(scene.set(movers[i], x3d::Transform::translation,
                                  Vec3f(static_cast<float>(i), static_cast<float>(frame) * .01f, 0)));
        scene.seal();
        // In the first frames buffers grow, what was not known to move is taken out, and its old group goes.
        if (frame >= 30) maximum = std::max(maximum, following.allocated);
    }
    EXPECT_EQ(maximum, 0u);
    EXPECT_EQ(following.world.stats().traced, 2000u);
    EXPECT_EQ(following.world.stats().bodies, 500u);
}

}  // namespace
}  // namespace rtsg
