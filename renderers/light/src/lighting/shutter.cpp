// Instants while the shutter is open, and the samples of a tile at each.
#include "shutter.h"

#include <algorithm>

#include <rtsg/renderers/parallel_for.h>

#include "sample_points.h"

namespace rtsg::trace {

namespace {

/// So many instants at most: what moves is seen that often, one beside the other, so its edges are smooth to 8 bits.
constexpr std::size_t kMaxInstants = 256, kMinInstants = 32;
/// Each instant has a tree of its own over all objects; of scenes of many, there are fewer.
constexpr std::size_t kMaxLeaves = std::size_t{1} << 18;
/// More of them than a pixel has samples, so that neighbouring tiles' are not the same.
constexpr std::size_t kPerSample = 16;
constexpr std::uint64_t kInstants = 0x6a09e667f3bcc909;  // other numbers than a path's

bool areSame(const Camera& a, const Camera& b) {
    return a.position == b.position && a.right == b.right && a.up == b.up && a.forward == b.forward &&
           a.left == b.left && a.rightEdge == b.rightEdge && a.bottom == b.bottom && a.top == b.top;
}

}  // namespace

std::size_t Shutter::countFor(const Motions& motions, const RenderSettings& settings) {
    const std::size_t maximum = std::min(kMaxInstants, kPerSample * static_cast<std::size_t>(settings.samplesPerPixel));
    return std::clamp(kMaxLeaves / std::max<std::size_t>(motions.size(), 1), kMinInstants, maximum);
}

Shutter::Shutter(const RayView& world, const Camera& camera, const RenderSettings& settings, const TraceScene& scene)
    : motions_(*settings.before->world, world) {
    const Camera& before = settings.before->camera;
    if (motions_.empty() && areSame(camera.since(before, 0), camera)) return;
    instants_.resize(countFor(motions_, settings));
    const auto count = static_cast<double>(instants_.size());
    withThreads(settings.threads, [&] {
        parallelFor(instants_.size(), [&](std::size_t i) {
            Instant& instant = instants_[i];
            const double t = 1 - double{settings.shutter} * (1 - (static_cast<double>(i) + .5) / count);
            instant.camera = camera.since(before, t);
            if (!motions_.empty()) instant.moved = std::make_unique<const MovedView>(world, motions_, t);
            const RayView& then = instant.moved ? *instant.moved : world;
            instant.world = std::make_shared<const LensedView>(then, lensOf(then, instant.camera, settings.height),
                                                               scene.filter.get(), RayKind::eye);
        });
    });
}

void Shutter::openFor(TraceScene& scene) const {
    if (instants_.empty()) return;
    scene.shutter = this;
    if (!motions_.empty()) scene.clearAnywhere = true;  // what lets light through may be in no box that is known
}

void Shutter::Instant::showTo(TraceScene& scene, int height) const {
    scene.lensed = world;
    scene.world = world.get();
    scene.large = nullptr;  // of another instant
    scene.pixelOf(*world, camera, height);
}

void Shutter::trace(const TraceScene& scene, const RenderSettings& settings, int x0, int y0,
                    std::span<TileResult> groups) const {
    const auto start =
        static_cast<double>(mixBits(settings.seed ^ kInstants ^
                                    mixBits(static_cast<std::uint64_t>(y0) << 32 | static_cast<std::uint32_t>(x0))) >>
                            11) *
        0x1p-53;
    const auto count = static_cast<double>(instants_.size());
    TraceScene now = scene;
    now.shutter = nullptr;
    now.coincident = nullptr;
    const int end = std::min(groups[0].lastSample, settings.samplesPerPixel);
    for (int sample = groups[0].firstSample; sample < end; ++sample) {
        const double fraction = (sample + start) / settings.samplesPerPixel;
        const Instant& instant = instants_[std::min(static_cast<std::size_t>(fraction * count), instants_.size() - 1)];
        instant.showTo(now, settings.height);
        for (TileResult& group : groups) group.firstSample = sample, group.lastSample = sample + 1;
        (settings.integrator == Integrator::path ? pathTile : whittedTile)(now, instant.camera, settings, x0, y0,
                                                                           groups);
    }
}

void traceTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
               std::span<TileResult> groups) {
    if (scene.shutter) return scene.shutter->trace(scene, settings, x0, y0, groups);
    (settings.integrator == Integrator::path ? pathTile : whittedTile)(scene, camera, settings, x0, y0, groups);
}

}  // namespace rtsg::trace
