// Bench "stage", the bus: what somebody who never polls costs the scene's thread, whose backlog another thread keeps
// short, beside merging it there.
#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "bench_stage.h"

namespace rtsg::bench {
namespace {

struct Idle final : Subscriber {
    Result<> apply(const Scene&, const ChangeSet&) override { return {}; }
};
/// Merges every set as it comes.
struct Merging final : Subscriber {
    ChangeComposer composer;
    Result<> apply(const Scene&, const ChangeSet& set) override {
        composer.add(set);
        return {};
    }
};

/// CPU seconds of the scene's thread, of each frame.
std::vector<double> busFrames(int changes, int count, Subscriber* subscriber, Delivery delivery) {
    Scene scene;
    std::vector<NodeId> nodes;
    for (int i = 0; i < changes; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
    scene.newFrame(0);
    Attachment attachment;
    if (subscriber) attachment = scene.bus().attach(*subscriber, delivery);
    std::vector<double> seconds;
    for (int frame = 1; frame <= 500 + count; ++frame) {
        const double start = threadSeconds();
        for (const NodeId node : nodes)
            (void)scene.set(node, x3d::Transform::translation, Vec3f(static_cast<float>(frame)));
        scene.newFrame(frame / 60.0);
        // By the five hundredth what is merged has its size.
        if (frame > 500) seconds.push_back(threadSeconds() - start);
    }
    return seconds;
}

}  // namespace

void stageBus(const Report& report, bool quick) {
    for (const int changes : quick ? std::vector{100} : std::vector{10, 1000}) {
        const int count = quick ? 100 : 3000;
        Idle idle;
        Merging merging;
        const auto behind = busFrames(changes, count, &idle, Delivery::polled);
        const auto merged = busFrames(changes, count, &merging, Delivery::immediate);
        const auto alone = busFrames(changes, count, nullptr, Delivery::immediate);
        const std::string which = fmt::format("{} changes a frame, and one who never polls", changes);
        const auto line = [&](const char* metric, auto of) {
            report({"stage", which, metric, "us", of(behind) * 1e6, "merged on the scene's thread", of(merged) * 1e6,
                    "nobody attached", of(alone) * 1e6});
        };
        line("a frame of the scene's thread, median", [](const std::vector<double>& v) { return median(v); });
        line("a frame of the scene's thread, worst", [](const std::vector<double>& v) { return std::ranges::max(v); });
    }
}

}  // namespace rtsg::bench
