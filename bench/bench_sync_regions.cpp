// Mirrors that follow what is near: what one costs a frame, both ends, by how much there is and how many there are.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/mirror_server.h>

#include "bench_sync_mirror.h"
#include "followers_sync.h"

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;

constexpr double kRadius = 12, kSpacing = 2;  // metres; so some 113 shapes are near
constexpr int kNear = 113;
constexpr int kRounds = 3;

/// Boxes on a square, of which a tenth moves in every frame, and viewpoints that walk over it.
struct Square {
    Scene scene;
    std::vector<NodeId> positions, eyes;
    double side = 0;
    int frame = 0;

    Square(int shapes, int viewpoints) {
        const int row = std::max(1, static_cast<int>(std::lround(std::sqrt(shapes))));
        side = kSpacing * row;
        Array<NodeId> children;
        const NodeId box = scene.createNode(x3d::Box::type);
        for (int i = 0; i < shapes; ++i) {
            const NodeId transform = scene.createNode(x3d::Transform::type), shape = scene.createNode(x3d::Shape::type);
            (void)scene.set(shape, x3d::Shape::geometry, box);
            (void)scene.set(transform, x3d::Transform::children, Array<NodeId>{shape});
            (void)scene.set(
                transform, x3d::Transform::translation,
                Vec3f(float(kSpacing) * float(i % row), 0, float(kSpacing) * std::floor(float(i) / float(row))));
            positions.push_back(transform);
            children.push_back(transform);
        }
        for (int i = 0; i < viewpoints; ++i) {
            eyes.push_back(scene.createNode(x3d::Viewpoint::type));
            (void)scene.setName(eyes.back(), fmt::format("EYE{}", i));
            children.push_back(eyes.back());
        }
        (void)scene.setField(scene.root(), x3d::RtsgScene::children.index, children);
        step();
    }
    /// A tenth of a metre for each viewpoint, as one goes in a frame.
    void step() {
        ++frame;
        for (std::size_t i = static_cast<std::size_t>(frame % 10); i < positions.size(); i += 10) {
            Vec3f at = scene.node(positions[i]).get(x3d::Transform::translation);
            at.y = .01f * float(frame % 100);
            (void)scene.set(positions[i], x3d::Transform::translation, at);
        }
        for (std::size_t i = 0; i < eyes.size(); ++i) {
            const double along = .1 * frame, other = side * double(i + 1) / double(eyes.size() + 1);
            (void)scene.set(eyes[i], x3d::Viewpoint::position, Vec3f(float(side / 2 + along), 1.6f, float(other)));
        }
        scene.newFrame(frame / 60.0);
    }
};

/// Who follows: the whole scene, or the region of one of the viewpoints, several each.
struct ThreadTeam {
    int wholes = 1, regions = 0, each = 1;
};

/// CPU seconds a frame of all that the process does, the best of some rounds; negative when a replica differed.
double costOf(int shapes, const ThreadTeam& team, int frames) {
    Square square(shapes, std::max(1, team.regions));
    MirrorServerOptions options;
    const int peers = team.wholes + team.regions * team.each;
    options.maximumPeers = static_cast<std::size_t>(peers);
    options.maximumParts = static_cast<std::size_t>(std::max(1, team.regions));
    options.peerTimeout = 60s;
    const auto server = MirrorServer::start(square.scene, kAnyPort, options);
    if (!server) return -1;
    std::vector<std::unique_ptr<Follower>> all;
    for (int i = 0; i < team.wholes; ++i) all.push_back(std::make_unique<Follower>((*server)->endpoint()));
    for (int i = 0; i < team.regions * team.each; ++i) {
        MirrorClientOptions region;
        region.parts = {fmt::format("region:EYE{},{}", i % team.regions, kRadius)};
        all.push_back(std::make_unique<Follower>((*server)->endpoint(), region));
    }
    const auto arrived = [&] {
        const double until = wallSeconds() + 60;
        for (const auto& f : all)
            while (f->reached() < square.scene.sequence()) {
                if (wallSeconds() > until) return false;
                std::this_thread::sleep_for(100us);
            }
        return true;
    };
    const auto show = [&] {
        for (int i = 0; i < frames; ++i) {
            square.step();
            if (!arrived()) return false;
        }
        return true;
    };
    if (!arrived() || !show()) return -1;
    double best = 1e9;
    for (int round = 0; round < kRounds; ++round) {
        const double before = cpuSeconds();
        if (!show()) return -1;
        best = std::min(best, (cpuSeconds() - before) / frames);
    }
    for (const auto& f : all) f->stop();
    for (const auto& f : all)
        if (f->finish().divergences != 0) return -1;
    return best;
}

}  // namespace

bool mirrorRegions(const SyncSizes& sizes, const Report& report) {
    const int frames = std::clamp(sizes.frames / 10, 5, 40), maximum = sizes.transforms * 10;
    // For a region, a scene that holds only the near part would cost the same.
    const double alone = costOf(kNear, {1, 0}, frames), nine = costOf(kNear, {9, 0}, frames);
    if (alone < 0 || nine < 0) return false;
    const double limit = std::max((nine - alone) / 8, 1e-9);
    for (const int shapes : {maximum / 100, maximum / 10, maximum}) {
        const double one = costOf(shapes, {1, 0}, frames), whole = costOf(shapes, {2, 0}, frames);
        const double region = costOf(shapes, {1, 1}, frames), eight = costOf(shapes, {1, 8}, frames),
                     many = costOf(shapes, {1, 8, 4}, frames);
        if (std::min({one, whole, region, eight, many}) < 0) return false;
        const auto row = [&](const std::string& what, double seconds) {
            // The difference of two measurements of nearly the same may be lost in what both have besides.
            report({"sync", fmt::format("{} shapes, a tenth moves", shapes), what, "us", 1e6 * std::max(seconds, 1e-9),
                    "a mirror of the whole scene", 1e6 * std::max(whole - one, 1e-9),
                    "a mirror of a scene with what is near only", 1e6 * limit});
        };
        row("the first region's CPU time a frame, both ends", region - one);
        row("each region more, up to 8", (eight - region) / 7);
        row("each peer more in one of 8 regions", (many - eight) / 24);
    }
    return true;
}

}  // namespace rtsg::bench
