// Bench "export": one of many boxes moves; what writing that as MCAP adds to the frame.
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/session/mcap_export.h>

#include "bench.h"

namespace rtsg::bench {
namespace {

constexpr int kFramesASecond = 60;  // a whole message comes once a second

struct Frames {
    double some = 0, whole = 0;  // CPU seconds of a frame that writes what changed, and of one that writes all shapes
};

/// Rows of boxes, of which another one moves in each frame.
Frames run(std::uint32_t count, int seconds, bool exported) {
    Scene scene;
    std::vector<NodeId> boxes;
    const NodeId shape = scene.createNode(x3d::Shape::type);
    const NodeId box = scene.createNode(x3d::Box::type);
    keep(bool(scene.set(shape, x3d::Shape::geometry, box)));
    for (std::uint32_t i = 0; i < count; ++i) {
        boxes.push_back(scene.createNode(x3d::Transform::type));
        keep(bool(scene.insertChild(boxes.back(), x3d::Transform::children, shape)));
        keep(bool(scene.insertChild(scene.root(), x3d::RtsgScene::children, boxes.back())));
    }
    scene.newFrame(0);
    SharedWorld world(scene);
    std::unique_ptr<McapExport> mcap;
    if (exported) mcap = std::move(*McapExport::attach(world, "/dev/null"));
    std::vector<double> some, whole;
    for (int frame = 1; frame <= seconds * kFramesASecond; ++frame) {
        const auto i = static_cast<std::uint32_t>(frame) * 7919 % count;
        keep(bool(scene.set(boxes[i], x3d::Transform::translation, Vec3f(.1f * float(frame), 0, 0))));
        const double start = threadSeconds();
        scene.newFrame(double(frame) / kFramesASecond);
        (frame % kFramesASecond ? some : whole).push_back(threadSeconds() - start);
    }
    return {median(some), median(whole)};
}

}  // namespace

void exporting(const Report& report, bool quick) {
    for (const std::uint32_t count : quick ? std::vector{1000u} : std::vector{1000u, 10'000u, 100'000u}) {
        const Frames with = run(count, quick ? 2 : 5, true), without = run(count, quick ? 2 : 5, false);
        report({"export", fmt::format("one box of {} moves", count), "a frame's share of MCAP", "us",
                (with.some - without.some) * 1e6, "every shape written", (with.whole - without.whole) * 1e6,
                "the frame without it", without.some * 1e6});
    }
}

}  // namespace rtsg::bench
