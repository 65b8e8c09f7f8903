// Prepares a version of light's tables for integrators: lights by scope, fogs, sky, and what lets light through.
#include "picture_scene.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <tuple>

#include <rtsg/renderers/parallel_for.h>

#include "lighting/environment.h"
#include "packet/volume_march.h"
#include "surface/coincident.h"
#include "surface/media.h"
#include "tables/active.h"
#include "tables/left_out.h"
#include "world/ray_boxes.h"

namespace rtsg::trace {

namespace {

/// `toTrace`: a Light as rays see it, if it is one of these. The whole scene's group is filled last.
template <class L, class ToTrace>
GroupsOf<L> groupLights(const LightState& state, std::uint16_t layer, const ToTrace& toTrace) {
    GroupsOf<L> result;
    const std::size_t count = std::max<std::size_t>(state.scopes.size(), 1);
    result.groups.resize(count);
    for (std::size_t i = count; i-- > 0 && i < state.scopes.size();) {
        typename GroupsOf<L>::Group& group = result.groups[i];
        group.first = static_cast<std::uint32_t>(result.lights.size());
        eachLight(state, static_cast<std::uint32_t>(i), layer, [&](const Light& from) {
            if (std::optional<L> light = toTrace(from)) result.lights.push_back(std::move(*light));
        });
        group.count = static_cast<std::uint32_t>(result.lights.size()) - group.first;
    }
    // Each looks outwards until it meets one that knows.
    std::vector<bool> known(count);
    std::vector<std::uint32_t> path;
    known[0] = true;
    for (std::uint32_t i = 1; i < count; ++i) {
        std::uint32_t at = i;
        for (; !known[at]; at = state.scopes[at].around) {
            known[at] = true;
            path.push_back(at);
        }
        for (; !path.empty(); path.pop_back()) {
            typename GroupsOf<L>::Group& group = result.groups[path.back()];
            const std::uint32_t outwards = result.groups[state.scopes[path.back()].around].start;
            group.start = group.count > 0 ? path.back() : outwards;
            group.around = outwards;
        }
    }
    return result;
}

bool anyLightWantsShadows(const LightState& state) {
    for (std::size_t i = 0; i < state.scopes.size(); ++i)
        if (const auto& lights = state.scopes[i].lights)
            for (const std::uint32_t slot : *lights) {
                const auto& light = std::get<Light>(state.placed[slot]->what);
                if (light.shadows && light.kind != Light::Kind::environment) return true;
            }
    return false;
}

/// Finds the boxes in which light is let through, if few boxes can say that.
void boxClear(const LightState& state, const RayView& world, TraceScene& scene) {
    constexpr std::size_t kFew = 8;  // boxes that cost a shadow ray little beside its own way
    if (!state.clearSlots) return;
    scene.clearAnywhere = false;
    for (const std::uint32_t slot : *state.clearSlots) {
        if (slot >= world.instances().size() || !world.instance(slot).mesh) continue;
        const RayInstance& instance = world.instance(slot);
        if (instance.mesh->strokeCount > 0) scene.clearAnywhere = true;  // wider than their bounds
        const Bounds box = boxAround(instance);
        scene.clear.push_back(box);
        scene.allClear.extend(box.min), scene.allClear.extend(box.max);
    }
    if (scene.clear.size() > kFew) scene.clear.clear();
}

/// The fogs that reach places of some scopes alone. If a scope has several, the last in the document counts.
void findLocalFogs(const LightState& state, Fogs& fogs) {
    std::vector<std::tuple<std::uint32_t, NodeId, const Fog*>> found;
    for (std::size_t i = 0; i < state.placed.size(); ++i)
        if (const PlacedEntry* entry = state.placed[i].get())
            if (const auto* local = std::get_if<LocalFogEntry>(&entry->what))
                found.emplace_back(local->scope, entry->placed.node, &local->fog);
    if (found.empty()) return;
    std::ranges::sort(found);
    std::vector<std::uint32_t> around(state.scopes.size());
    for (std::size_t i = 0; i < around.size(); ++i) around[i] = state.scopes[i].around;
    std::vector<std::pair<std::uint32_t, Fog>> local;
    for (const auto& [scope, node, fog] : found) local.emplace_back(scope, *fog);
    fogs.setLocal(local, around);
}

std::optional<TraceEnvironment> traceEnvironment(const Light& light) {
    if (light.kind != Light::Kind::environment) return std::nullopt;
    return TraceEnvironment{light.environment.get(), light.color, light.ambient, light.localFromWorldRotation};
}

/// How a Light looks to the rays of a picture.
auto traceLights(const LightState& state, const RayView& world, const RenderSettings& settings) {
    const bool anySays = settings.shadows == Shadows::automatic && anyLightWantsShadows(state);
    return [&, anySays](const Light& light) -> std::optional<TraceLight> {
        if (light.kind == Light::Kind::environment) return std::nullopt;
        TraceLight result;
        result.kind = light.kind;
        switch (settings.shadows) {
            case Shadows::all:
                result.shadows = true;
                break;
            case Shadows::none:
                break;
            case Shadows::authored:
                result.shadows = light.shadows;
                break;
            case Shadows::automatic:
                result.shadows = light.shadows || !anySays;
                break;
        }
        result.shadows = result.shadows && light.shadowIntensity > 0;
        result.shadowIntensity = light.shadowIntensity;
        result.color = light.color;
        if (settings.integrator != Integrator::path) result.ambient = light.ambient;
        result.position = world.fromWorld(light.position);
        result.direction = Vec3f(light.direction);
        result.attenuation = light.attenuation;
        result.radius = light.radius, result.localFromWorld = light.localFromWorld;
        result.beamWidth = light.beamWidth, result.cutOffAngle = light.cutOffAngle;
        result.right = light.right, result.up = light.up, result.extent = light.extent;
        result.nearDistance = light.nearDistance, result.farDistance = light.farDistance;
        result.picture = light.picture.get();
        return result;
    };
}

/// "Behind illuminated X3DShapeNode geometry" (17.3.1) are shadows: shapes outside a light's scope cast none.
void limitShadows(const LightState& state, const RayView& world, const RenderSettings& settings, TraceScene& scene) {
    LightGroups& groups = scene.lightGroups;
    std::vector<std::uint32_t> scopes;
    const auto lightsOf = [&](std::uint32_t scope) {
        return std::span(groups.lights).subspan(groups.groups[scope].first, groups.groups[scope].count);
    };
    for (std::uint32_t scope = 1; scope < groups.groups.size(); ++scope)
        if (std::ranges::any_of(lightsOf(scope), &TraceLight::shadows)) scopes.push_back(scope);
    scene.scopeFilters = scopeFilters(scopes, scene.filter, state, world, settings);
    for (std::size_t i = 0; i < scopes.size(); ++i)
        for (TraceLight& light : lightsOf(scopes[i])) light.scope = scene.scopeFilters[i].get();
}

glm::dmat3 toSquare(const Camera& camera) {
    const glm::dmat3 axes = camera.axes();
    return glm::dmat3(axes[0], axes[1], -axes[2]) * camera.steps();
}

}  // namespace

Fogs fogsOf(const LightState& state, std::uint16_t layer) {
    Fogs fogs;
    if (const PlacedEntry* fog = active<FogEntry>(state, layer)) fogs.setGlobal(std::get<FogEntry>(fog->what).fog);
    findLocalFogs(state, fogs);
    return fogs;
}

TraceScene makeTraceScene(const LightState& state, const RayView& world, const Camera& camera,
                          const RenderSettings& settings, Part part) {
    static const Sky black, clear = [] {
        Sky sky;
        sky.alpha = 0;
        return sky;
    }();
    const std::uint16_t layer = camera.layer;
    TraceScene scene;
    scene.coincident = std::make_shared<CoincidentFaces>();
    scene.pixelOf(world, camera, settings.height);
    if (settings.integrator == Integrator::whitted && !camera.isEven()) {
        const glm::dmat3 square = toSquare(camera);
        scene.uneven = UnevenEye{glm::mat3(square), glm::mat3(glm::transpose(glm::inverse(square)))};
    }
    constexpr int kMaxSharing = 64;  // more samples than these see no more of a texture: an eighth of a pixel is all
    const int samples = part.sight ? part.sight->samples : settings.samplesPerPixel;
    scene.sampleFraction = 1 / std::sqrt(static_cast<float>(std::clamp(samples, 1, kMaxSharing)));
    scene.filter = clipFilter(state, world, settings, part.windows ? &camera : nullptr);
    if (state.volumeSlots) {
        findVolumes(state, world, part.hidden, scene.filter, scene);
        for (const TraceVolume& volume : scene.volumes) {
            const Bounds box = boxAround(world.instance(volume.slot));
            scene.volumeBounds.extend(box.min), scene.volumeBounds.extend(box.max);
        }
    }
    if (!part.hidden.empty()) scene.filter = hidingFilter(std::move(part.hidden), scene.filter, world, settings);
    scene.lensed = std::make_shared<const LensedView>(world, lensOf(world, camera, settings.height), scene.filter.get(),
                                                      RayKind::eye);
    scene.world = scene.lensed.get();
    scene.materials = MaterialList(state.materials);
    scene.slots = SlotPages(state.slots);
    const Sky* sky = skyOf(state, layer);
    scene.sky = sky ? sky : part.over ? &clear : &black;
    scene.evenSky = scene.sky->uniform();
    if (scene.evenSky) {
        scene.skyLinear = scene.sky->color({0, 1, 0}, ColorSpace::linear);
        scene.skyDisplay = scene.sky->color({0, 1, 0}, ColorSpace::display);
    }
    scene.fogs = fogsOf(state, layer);
    scene.energyLimited = settings.integrator == Integrator::path;
    scene.space = settings.integrator == Integrator::path ? ColorSpace::linear : settings.colorSpace;

    TraceLight headlight;  // 23.4.4: intensity 1, colour 1 1 1, ambientIntensity 0, along the view
    headlight.color = Vec3f(1);
    headlight.direction = Vec3f(part.headlight);
    scene.lightGroups = groupLights<TraceLight>(state, layer, traceLights(state, world, settings));
    limitShadows(state, world, settings, scene);
    scene.environments = groupLights<TraceEnvironment>(state, layer, traceEnvironment);
    if (settings.integrator == Integrator::whitted && !scene.environments.lights.empty())
        withThreads(settings.threads, [&] {
            for (const TraceEnvironment& light : scene.environments.lights)
                light.from->prepare(scene.materials.glossy());
        });
    if (hasHeadlight(state, layer) && part.headlight != Vec3d(0)) {
        // The headlight belongs to the whole scene, and so to the group that was filled last.
        scene.lightGroups.lights.push_back(headlight);
        ++scene.lightGroups.groups[0].count;
    }
    scene.emitterTable = state.emitterTable.get(), scene.skyTable = state.skyTable.get();
    scene.anyTransmits = state.anyTransmits;
    if (state.anyTransmits) boxClear(state, world, scene);
    if (state.anyTransmits && scene.materials.bends() && !camera.orthographic)
        scene.aroundEye = bodiesAround(scene, scene.eye);
    return scene;
}

}  // namespace rtsg::trace
