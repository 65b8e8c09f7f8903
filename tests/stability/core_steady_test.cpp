// No allocation in a steady frame: what animates for hours must not touch the heap once it has warmed up.
#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "support/counting_malloc.h"

namespace rtsg {
namespace {

struct Reader final : Subscriber {
    std::size_t changes = 0;
    Result<> apply(const Scene&, const ChangeSet& set) override {
        changes += set.changes.size();
        return {};
    }
};

/// Clock, path and Transform, `count` times.
std::vector<NodeId> addAnimated(Scene& scene, int count) {
    std::vector<NodeId> transforms;
    for (int i = 0; i < count; ++i) {
        const NodeId clock = scene.createNode(x3d::TimeSensor::type);
        const NodeId path = scene.createNode(x3d::PositionInterpolator::type);
        const NodeId round = scene.createNode(x3d::OrientationInterpolator::type);
        const NodeId transform = scene.createNode(x3d::Transform::type);
        (void)scene.set(clock, x3d::TimeSensor::loop, true);
        (void)scene.set(clock, x3d::TimeSensor::cycleInterval, Time{.5 + .001 * i});
        (void)scene.set(path, x3d::PositionInterpolator::key, Array<float>{0, 1});
        (void)scene.set(path, x3d::PositionInterpolator::keyValue, Array<Vec3f>{Vec3f(0), Vec3f(1, 2, 3)});
        (void)scene.set(round, x3d::OrientationInterpolator::key, Array<float>{0, 1});
        (void)scene.set(round, x3d::OrientationInterpolator::keyValue,
                        Array<Rotation>{Rotation{0, 1, 0, 0}, Rotation{0, 1, 0, 3}});
        for (const NodeId id : {clock, path, round, transform})
            (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, id);
        using P = x3d::PositionInterpolator;
        using O = x3d::OrientationInterpolator;
        (void)scene.addRoute(clock, x3d::TimeSensor::fraction_changed.index, path, P::set_fraction.index);
        (void)scene.addRoute(clock, x3d::TimeSensor::fraction_changed.index, round, O::set_fraction.index);
        (void)scene.addRoute(path, P::value_changed.index, transform, x3d::Transform::translation.index);
        (void)scene.addRoute(round, O::value_changed.index, transform, x3d::Transform::rotation.index);
        transforms.push_back(transform);
    }
    return transforms;
}

TEST(Steady, AThousandAnimatedTransformsAllocateNothing) {
    // Outcome: 0 allocations in 100 frames, with an immediate, a polled and a slowly polled subscriber, and an
    // application that writes and sends events as well.
    if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer owns the heap";
    Scene scene;
    const std::vector<NodeId> transforms = addAnimated(scene, 1000);
    Reader immediate, polled, slow;
    Attachment a = scene.bus().attach(immediate);
    Attachment b = scene.bus().attach(polled, Delivery::polled);
    Attachment c = scene.bus().attach(slow, Delivery::polled);
    const auto frame = [&](int i) {
        for (int k = 0; k < 50; ++k)
            (void)scene.set(transforms[static_cast<std::size_t>(k)], x3d::Transform::scale, Vec3f(float(i % 7 + 1)));
        (void)scene.sendEvent(transforms[60], x3d::Transform::center.index, Vec3f(float(i)));
        scene.newFrame(i / 60.0);
        b.poll();
        if (i % 3 == 0) c.poll();
    };
    int i = 0;
    for (; i < 300; ++i) frame(i);  // every clock has begun a cycle more than once
    // The changes of the first frame are merged for polled subscribers.
    const std::size_t before = immediate.changes, polledBefore = polled.changes;
    const std::size_t allocations = test::allocationsOf([&] {
        for (const int end = i + 100; i < end; ++i) frame(i);
    });
    EXPECT_EQ(allocations, 0u);
    EXPECT_GE(immediate.changes - before, 100u * 2000u);  // it did move
    EXPECT_EQ(polled.changes - polledBefore, immediate.changes - before);
    EXPECT_LT(slow.changes, polled.changes);
}

TEST(Steady, TheCountDoesCount) {
    if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer owns the heap";
    Array<float> one;
    std::unique_ptr<int> two;
    const std::size_t allocations = test::allocationsOf([&] {
        one = {1, 2, 3};
        two = std::make_unique<int>(3);
    });
    EXPECT_EQ(allocations, 2u);
    EXPECT_EQ(one.size() + static_cast<std::size_t>(*two), 6u);
}

}  // namespace
}  // namespace rtsg
