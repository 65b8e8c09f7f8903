// Rounds of paths from one place, until their mean is known well enough.
#include <rtsg/renderers/irradiance.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <rtsg/renderers/parallel_for.h>

#include "draw.h"
#include "lighting/emitters.h"
#include "lighting/probe.h"
#include "path/hidden_light.h"
#include "path/path_emitters.h"

namespace rtsg {

using namespace trace;

namespace {

constexpr int kGroupSamples = 16;  // of each of a tile's pixels, which are independent of each other
constexpr std::uint64_t kTileSamples = std::uint64_t{kTilePixels} * kGroupSamples;

const Vec3d kLuminance(0.2126, 0.7152, 0.0722);

/// The solid angle of a triangle whose corners are told from where one looks, above 0.
double solidAngle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double volume = std::abs(glm::dot(a, glm::cross(b, c)));
    const double under = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
    return 2 * std::atan2(volume, under);
}

/// Estimates how much more light true disks, balls and the like might give a place than their triangles. Chords that
/// are an e-th of the radius away lose 4/3 e of a disk's light, or twice that on a ball, which has chords in both
/// directions. This holds for the whole lamp seen head-on; if the place's horizon cuts the lamp, its rim may be all
/// there is. So the estimate uses the light of the lamp without horizon, cosine and obstacles, if the place sees any of
/// it, and all light that arrives, for light by way of other surfaces.
class CurvedLamps {
  public:
    CurvedLamps(const TraceScene& scene, const Probe& probe, double chordError) {
        if (!(chordError > 0) || !anyShines(scene)) return;
        constexpr double kOfChord = 8.0 / 3;
        fraction_ = kOfChord * chordError;
        for (const Emitters::Source& source : Emitters::sourcesIn(scene))
            if (source.mesh->curveSize > 0 && sees(scene, source, probe)) direct_ += directly(source, probe);
    }
    /// Red, green, blue and luminance, for such an irradiance.
    glm::dvec4 lack(const glm::dvec4& irradiance) const {
        constexpr double kRounding = 0x1p-21;  // of single floats that are added
        // Behind walls no part of a lamp is missed.
        if (irradiance == glm::dvec4(0)) return irradiance;
        return fraction_ * (glm::dvec4(direct_, glm::dot(direct_, kLuminance)) + irradiance) + kRounding * irradiance;
    }

  private:
    static bool anyShines(const TraceScene& scene) {
        const RayInstances& instances = scene.world->instances();
        const auto shines = [](const Material& material) {
            const Vec3f& glow = material.linear.emissive;
            return material.model == ShadingModel::unlit || std::max({glow.r, glow.g, glow.b}) > 0;
        };
        for (std::uint32_t slot = 0; slot < instances.size() && slot < scene.slots.size(); ++slot) {
            if (!instances[slot].mesh || !(instances[slot].mesh->curveSize > 0)) continue;
            const Material& front = scene.materials[scene.slots[slot].material].material;
            if (shines(front) || (front.back && shines(*front.back))) return true;
        }
        return false;
    }
    /// Whether any light comes from a lamp to a place directly: rays to places all over it tell, at least one to each
    /// triangle of all but the finest.
    static bool sees(const TraceScene& scene, const Emitters::Source& source, const Probe& probe) {
        constexpr std::uint64_t kMin = 1 << 12, kMax = 1 << 16;
        const std::uint64_t triangles = source.mesh->triangleCount, rays = std::clamp(4 * triangles, kMin, kMax);
        Emitters::Emitter target;
        target.instance = source.slot;
        for (std::uint64_t i = 0; i < rays; ++i) {
            // Places on the triangle as Roberts 2018 spreads them, its halves folded onto each other.
            double u = std::fmod(.7548776662466927 * static_cast<double>(i), 1);
            double v = std::fmod(.5698402909980532 * static_cast<double>(i), 1);
            if (u + v > 1) u = 1 - u, v = 1 - v;
            target.triangle = static_cast<std::uint32_t>(i * triangles / rays);
            Vec3f at[3];
            for (std::uint32_t corner = 0; corner < 3; ++corner)
                at[corner] = source.rayFromLocal * Vec4f(source.mesh->vertex(target.triangle, corner), 1);
            const Vec3f position =
                at[0] + static_cast<float>(u) * (at[1] - at[0]) + static_cast<float>(v) * (at[2] - at[0]);
            const Vec3f start = RayView::leave(probe.point(), position - probe.position);
            const Ray ray{start, kLeave, position - start, kReach};
            Vec3f left;
            if (glm::dot(position - probe.position, probe.normal) > 0 &&
                reachesEmitter(scene, target, position, ray, scene.world->intersect(ray), left))
                return true;
        }
        return triangles == 0;
    }
    static Vec3d directly(const Emitters::Source& source, const Probe& probe) {
        const Mesh& mesh = *source.mesh;
        Vec3d sum(0);
        for (std::uint32_t triangle = 0; triangle < mesh.triangleCount; ++triangle) {
            Vec3d at[3];
            for (std::uint32_t corner = 0; corner < 3; ++corner)
                at[corner] =
                    Vec3d(source.rayFromLocal * Vec4f(mesh.vertex(triangle, corner), 1)) - Vec3d(probe.position);
            if (std::ranges::none_of(at, [&](const Vec3d& p) { return glm::dot(p, Vec3d(probe.normal)) > 0; }))
                continue;
            const bool front = source.sign * glm::dot(glm::cross(at[1] - at[0], at[2] - at[0]), at[0]) < 0;
            if (!front && mesh.solid) continue;
            const Vec3d glow(source.even ? front ? source.front : source.behind : Vec3f(source.glow));
            sum += glow * solidAngle(at[0], at[1], at[2]);
        }
        return sum;
    }

    double fraction_ = 0;
    Vec3d direct_{0};
};

/// Sums over groups of samples: of red, green, blue and luminance.
struct Sums {
    glm::dvec4 sum{0}, squares{0};
    std::uint64_t groups = 0;
    double missing = 0;  // weights of samples
    std::uint64_t chanceFinds = 0, secondaryRays = 0;

    void add(const TileResult& tile) {
        chanceFinds += tile.chanceFinds, secondaryRays += tile.secondaryRays;
        for (const Vec4f& pixel : tile.sum) {
            Vec3d shown = Vec3d(pixel) / double{kGroupSamples};
            for (int c = 0; c < 3; ++c) shown[c] = std::isfinite(shown[c]) ? shown[c] : 0;
            const glm::dvec4 all(shown, glm::dot(shown, kLuminance));
            sum += all, squares += all * all;
            ++groups;
        }
        for (const float weight : tile.missing) missing += double{weight};
    }
    void add(const Sums& other) {
        sum += other.sum, squares += other.squares, groups += other.groups, missing += other.missing;
        chanceFinds += other.chanceFinds, secondaryRays += other.secondaryRays;
    }
    std::uint64_t samples() const { return groups * kGroupSamples; }
    /// Whether all that faces the place is black and sends no path on, or no light is anywhere.
    bool isDark(const HiddenLight& hidden) const { return !hidden.any || secondaryRays <= samples(); }
    /// The most light that may come without a sample having met it, by the rule of three: what none of n has met has a
    /// probability of at most 3/n, at 95 %.
    double unseen(const HiddenLight& hidden) const {
        float maximum = chanceFinds < kEnoughFinds ? hidden.maximum : 0;
        if (sum == glm::dvec4(0) && !isDark(hidden)) maximum = hidden.brightest;
        return 3 * std::numbers::pi * double{maximum} / static_cast<double>(samples());
    }
    Irradiance irradiance(const CurvedLamps& curved, const HiddenLight& hidden) const {
        constexpr double kQuantile = 1.959963985, kPi = std::numbers::pi;
        const auto n = static_cast<double>(groups);
        const glm::dvec4 mean = sum / n, variance = glm::max(squares / n - mean * mean, glm::dvec4(0)) / (n - 1);
        const glm::dvec4 half = kPi * kQuantile * glm::sqrt(variance);
        const glm::dvec4 value = kPi * mean, cut = curved.lack(value), whole = half + cut + unseen(hidden);
        Irradiance result{Vec3d(value), Vec3d(whole), value.w, whole.w, cut.w, samples()};
        result.missing = missing / static_cast<double>(samples()), result.hiddenLight = hidden.fraction;
        result.lostLight = hidden.lost;
        return result;
    }
};

/// All that a probe's rays meet.
struct ProbeScene {
    TraceScene scene;
    Sources sources;
    HiddenLight hidden;
    ProbeScene(const LightState& state, const RayView& world, const RenderSettings& settings) {
        const Camera camera;
        Part part;
        part.headlight = Vec3d(0);
        scene = makeTraceScene(state, world, camera, settings, part);
        drawCubes(state, world, camera, settings, {}, scene);
        lookForLight(scene, sources);
        hidden = findHiddenLight(scene);
        scene.countsFrom = hidden.countsFrom();
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

Result<Irradiance> measureIrradiance(const LightState& state, const RayView& world, const Vec3d& position,
                                     const Vec3d& normal, const IrradianceSettings& settings) {
    const double length = glm::length(normal);
    if (!(length > 0) || !std::isfinite(length)) return fail("a place to measure at needs a normal with a length");
    if (!std::isfinite(position.x + position.y + position.z)) return fail("a place to measure at must be finite");
    if (!(settings.error > 0)) return fail("the error to reach must be above 0");
    RenderSettings rendering;
    rendering.integrator = Integrator::path, rendering.colorSpace = ColorSpace::linear;
    rendering.samplesPerPixel = kGroupSamples, rendering.seed = settings.seed;
    rendering.shadows = settings.shadows;
    const ProbeScene probed(state, world, rendering);
    const Probe probe{world.fromWorld(position), Vec3f(normal / length)};
    const CurvedLamps curved(probed.scene, probe, settings.chordError);
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
        result = sums.irradiance(curved, probed.hidden);
        const double allowed = settings.error * result.luminous;
        result.reached = result.luminous > 0 ? result.luminousInterval <= allowed : sums.isDark(probed.hidden);
        // More samples help nobody where the cut alone is too much.
        constexpr double kAside = .25;
        const bool cutTooMuch =
            result.luminousCut > allowed && result.luminousInterval <= (1 + kAside) * result.luminousCut;
        if (result.reached || cutTooMuch || 2 * tiles * kTileSamples > settings.samples) return result;
        if (settings.progress && !settings.progress(result.samples)) return result;
    }
}

}  // namespace rtsg
