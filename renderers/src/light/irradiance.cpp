// Rounds of paths from one place, until their mean is known well enough.
#include <rtsg/renderers/irradiance.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <rtsg/renderers/parallel_for.h>

#include "draw.h"
#include "probe.h"

namespace rtsg {

using namespace trace;

namespace {

constexpr int kGroupSamples = 16;  // of each of a tile's pixels, which are independent of each other
constexpr std::uint64_t kTileSamples = std::uint64_t{kTilePixels} * kGroupSamples;

/// Sums over groups of samples: of red, green, blue and what an eye makes of them.
struct Sums {
    glm::dvec4 sum{0}, squares{0};
    std::uint64_t groups = 0;
    double missing = 0;  // weights of samples

    void add(const TileResult& tile) {
        for (const Vec4f& pixel : tile.sum) {
            Vec3d shown = Vec3d(pixel) / double{kGroupSamples};
            for (int c = 0; c < 3; ++c) shown[c] = std::isfinite(shown[c]) ? shown[c] : 0;
            const glm::dvec4 all(shown, glm::dot(shown, Vec3d(0.2126, 0.7152, 0.0722)));
            sum += all, squares += all * all;
            ++groups;
        }
        for (const float weight : tile.missing) missing += double{weight};
    }
    void add(const Sums& other) {
        sum += other.sum, squares += other.squares, groups += other.groups, missing += other.missing;
    }
    Irradiance irradiance() const {
        constexpr double kQuantile = 1.959963985, kPi = std::numbers::pi;
        const auto n = static_cast<double>(groups);
        const glm::dvec4 mean = sum / n, variance = glm::max(squares / n - mean * mean, glm::dvec4(0)) / (n - 1);
        const glm::dvec4 half = kPi * kQuantile * glm::sqrt(variance);
        const std::uint64_t samples = groups * kGroupSamples;
        return {kPi * Vec3d(mean), Vec3d(half), kPi * mean.w, half.w, samples, missing / static_cast<double>(samples)};
    }
};

/// All that a probe's rays meet.
struct ProbeScene {
    TraceScene scene;
    Sources sources;
    ProbeScene(const LightState& state, const RayView& world, const RenderSettings& settings) {
        const Camera camera;
        Part part;
        part.headlight = Vec3d(0);
        scene = makeTraceScene(state, world, camera, settings, part);
        drawCubes(state, world, camera, settings, {}, scene);
        lookForLight(scene, sources);
    }
};

}  // namespace

std::vector<NodeId> lightsLeftOut(const LightState& state) {
    std::vector<NodeId> result;
    for (std::size_t slot = 0; slot < state.placed.size(); ++slot) {
        const PlacedEntry* entry = state.placed[slot].get();
        const Light* light = entry ? std::get_if<Light>(&entry->what) : nullptr;
        if (light && light->on && (light->scope != ScopeId() || entry->placed.layer != 0))
            result.push_back(entry->placed.node);
    }
    std::ranges::sort(result, {}, &NodeId::value);
    result.erase(std::ranges::unique(result).begin(), result.end());
    return result;
}

Result<Irradiance> measureIrradiance(const LightState& state, const RayView& world, const Vec3d& place,
                                     const Vec3d& normal, const IrradianceSettings& settings) {
    const double length = glm::length(normal);
    if (!(length > 0) || !std::isfinite(length)) return fail("a place to measure at needs a normal with a length");
    if (!std::isfinite(place.x + place.y + place.z)) return fail("a place to measure at must be finite");
    if (!(settings.error > 0)) return fail("the error to reach must be above 0");
    RenderSettings rendering;
    rendering.integrator = Integrator::path, rendering.colorSpace = ColorSpace::linear;
    rendering.samplesPerPixel = kGroupSamples, rendering.seed = settings.seed;
    rendering.shadows = settings.shadows;
    const ProbeScene probed(state, world, rendering);
    const Probe probe{world.fromWorld(place), Vec3f(normal / length)};
    Sums sums;
    Irradiance result;
    for (std::uint64_t tiles = 2, done = 0;; tiles *= 2) {
        std::vector<Sums> parts(tiles - done);
        withThreads(settings.threads, [&] {
            parallelFor(parts.size(), [&](std::size_t i) {
                TileResult tile;
                pathProbe(probed.scene, probe, rendering, static_cast<int>(done + i), tile);
                parts[i].add(tile);
            });
        });
        for (const Sums& part : parts) sums.add(part);
        done = tiles;
        result = sums.irradiance();
        result.reached = result.luminousInterval <= settings.error * result.luminous;
        if (result.reached || 2 * tiles * kTileSamples > settings.samples) return result;
        if (settings.progress && !settings.progress(result.samples)) return result;
    }
}

}  // namespace rtsg
