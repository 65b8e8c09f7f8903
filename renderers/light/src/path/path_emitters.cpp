// Rays towards chosen emitters and the sky, and the light that arrives along them.
#include "path_emitters.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "lighting/lamps.h"
#include "lighting/sky_light.h"
#include "packet/volume_march.h"
#include "surface/coincident.h"
#include "surface/lanes.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// The share of light that passes straight through a hit: all of it at the back of a solid, which does not count as
/// there; none at glass, which bends light.
Vec3f passes(const TraceScene& scene, const Hit& hit, const Vec3f& direction) {
    const float index = scene.materials[scene.slots[hit.instance].material].material.refractiveIndex;
    const RayInstance& instance = scene.world->instance(hit.instance);
    if (index > 0) return Vec3f(0);
    if (instance.mesh->solid && glm::dot(direction, hit.normal) > 0) return Vec3f(1);
    return straightTransmittance(scene, hit, direction);
}

/// The place where the ray that made a hit goes on.
Vec3f behind(const TraceScene& scene, const Hit& hit, const Ray& ray) {
    return RayView::leave(scene.world->point(hit, ray), ray.direction);
}

/// Follows a ray, which has made this hit, through transparent surfaces to its emitter; false: something blocks it.
bool reaches(const TraceScene& scene, const Emitters::Emitter& target, const Vec3f& position, Ray ray, Hit& hit,
             Vec3f& left) {
    const Vec3f direction = glm::normalize(ray.direction);
    left = Vec3f(1);
    for (int step = 0; step < kMaxPassed; ++step) {
        if (!hit) return false;
        if (hit.instance >= scene.slots.size()) return false;
        hit = frontOf(scene, *scene.world, ray, hit);
        if (hit.instance == target.instance && hit.triangle == target.triangle) return true;
        left *= passes(scene, hit, direction);
        if (left == Vec3f(0)) return false;
        ray.origin = behind(scene, hit, ray), ray.tMin = kLeave, ray.tMax = kReach;
        ray.direction = position - ray.origin;
        if (!(glm::dot(ray.direction, direction) > 0)) return false;
        hit = scene.world->intersect(ray);
    }
    return false;
}

/// The same to the sky.
bool escapes(const TraceScene& scene, Ray ray, Hit hit, Vec3f& left) {
    left = Vec3f(1);
    for (int step = 0; step < kMaxPassed; ++step) {
        if (!hit) return true;
        if (hit.instance >= scene.slots.size()) return false;
        hit = frontOf(scene, *scene.world, ray, hit);
        left *= passes(scene, hit, ray.direction);
        if (left == Vec3f(0)) return false;
        ray.origin = behind(scene, hit, ray), ray.tMin = kLeave, ray.tMax = HUGE_VALF;
        hit = scene.world->intersect(ray);
    }
    return false;
}

/// Whether looking for light from this lane's surface is worth anything.
bool isLit(const SurfacePacket& s, int lane) {
    return ((s.mask & ~s.unlit) >> lane & 1u) && s.coverage[lane] * s.opacity[lane] > 0;
}

/// The lanes for which isLit() holds.
std::uint32_t litLanes(const SurfacePacket& s) {
    std::uint32_t lanes = 0;
    for (int at = 0; at < 16; at += 8) lanes |= laneBits(load(s.coverage + at) * load(s.opacity + at) > 0.0f) << at;
    return lanes & s.mask & ~s.unlit;
}

/// Above both horizons: the true surface's and the shading normal's.
bool isAbove(const SurfacePacket& s, int lane, const Vec3f& direction) {
    if (!(glm::dot(direction, s.normal.get(lane)) > 0)) return false;
    if (s.thin >> lane & 1u) return true;
    const Vec3f facing = s.back >> lane & 1u ? -s.outside(lane) : s.outside(lane);
    return glm::dot(direction, facing) > 0;
}

}  // namespace

namespace {

/// The emitter that was chosen for each lane.
struct ChosenEmitters {
    Lanes3 corner, ab, ac, normal;
    alignas(64) float area[16], probability[16];  // of the emitter, m^2; of choosing it
    std::uint32_t emitter[16];
    std::uint32_t mask = 0, bothSides = 0, even = 0;
    Lanes3 position;

    void set(int lane, std::uint32_t number, const Emitters::Emitter& e) {
        corner.set(lane, e.corner), ab.set(lane, e.ab), ac.set(lane, e.ac), normal.set(lane, e.normal);
        area[lane] = e.area;
        emitter[lane] = number;
        mask |= 1u << lane;
        bothSides |= static_cast<std::uint32_t>(e.bothSides) << lane;
        even |= static_cast<std::uint32_t>(e.even && !e.contested) << lane;
    }
};

/// Rays to points on the chosen emitters, at `u` and `v`; out.mask tells which are worth tracing.
void aim(const SurfacePacket& s, ChosenEmitters& chosen, const float* u, const float* v, RayPacket16& rays,
         EmitterLight& out) {
    for (int at = 0; at < 16; at += 8) {
        const F8 side = simd::sqrt(load(u + at));
        const V8 position =
            loadV(chosen.corner, at) + loadV(chosen.ab, at) * (1 - side) + loadV(chosen.ac, at) * (load(v + at) * side);
        const V8 start = leave8(s, at, position - loadV(s.position, at)), displacement = position - start;
        const F8 squared = dot(displacement, displacement), distance = simd::sqrt(squared);
        const V8 direction = displacement * (1 / max(distance, all(1e-30f)));
        const F8 cosine = -dot(loadV(chosen.normal, at), direction);
        const F8 density = load(chosen.probability + at) / load(chosen.area + at) * squared / absolute(cosine);
        const I8 good = lanesFrom(chosen.mask, at) & (distance > 1e-12f) & (dot(direction, facing8(s, at)) > 0.0f) &
                        (dot(direction, loadV(s.normal, at)) > 0.0f) &
                        ((cosine > 0.0f) | lanesFrom(chosen.bothSides, at)) & (density > 0.0f) &
                        (density <= std::numeric_limits<float>::max());
        storeV(chosen.position, at, position);
        storeV(out.direction, at, direction);
        store(out.density + at, density);
        store(rays.originX + at, start.x), store(rays.originY + at, start.y), store(rays.originZ + at, start.z);
        store(rays.directionX + at, displacement.x), store(rays.directionY + at, displacement.y),
            store(rays.directionZ + at, displacement.z);
        store(rays.tMin + at, all(kLeave)), store(rays.tMax + at, all(kReach));
        std::memcpy(rays.active + at, &good, sizeof good);
        out.mask |= laneBits(good) << at;
    }
}

/// Ends all rays there, and leaves only those of `lanes`.
void reset(RayPacket16& rays, std::uint32_t lanes, float tMax) {
    for (int at = 0; at < 16; at += 8) {
        const I8 active = lanesFrom(lanes, at);
        std::memcpy(rays.active + at, &active, sizeof active);
        store(rays.tMax + at, all(tMax));
    }
}

/// The lanes of `asked` whose way is completely free, which is quicker to test than the kind of obstacle. Parts that a
/// filter cuts away do not emit, and only a hit tells whether they are cut away.
std::uint32_t findFree(const TraceScene& scene, RayPacket16& rays, std::uint32_t asked, float tMax) {
    if (!asked || scene.filter) return 0;
    reset(rays, asked, tMax);
    return asked & ~scene.world->occluded(rays, false, RayKind::view);
}

/// The light that reaches a lane from its emitter, if any, by the slow way: through clear surfaces, from textures, in
/// haze.
bool arrives(const TraceScene& scene, const SurfacePacket& s, int lane, const PathTask& task,
             const Emitters::Emitter& target, const Vec3f& position, const RayPacket16& rays, const Vec3f& direction,
             Vec3f& light) {
    const Vec3f from = s.position.get(lane);
    Hit hit = scene.world->hit(rays, lane);
    Vec3f left;
    if (!reaches(scene, target, position, rays.ray(lane), hit, left)) return false;
    const float distance = glm::length(position - from), run = task.travelled + s.distance[lane] + distance;
    left *= volumesLeft(scene, {from, kLeave, position - from, 1});
    const float cosine = std::max(std::abs(glm::dot(direction, hit.normal)), 0.05f);
    const float footprint = scene.sampleWidth(run) / std::sqrt(cosine);
    left *= emitted(scene, hit, glm::dot(direction, hit.normal) > 0, footprint);
    if (task.media) left *= glm::exp(-s.media->absorption(task.media) * distance);
    if (scene.fogs.any())
        left *= scene.fogs.of(scene.slots[hit.instance].lights)
                    .left(*scene.world->instance(hit.instance).mesh, hit.triangle, hit.u, hit.v, position, distance);
    light = left;
    return true;
}

}  // namespace

void lookForEmitters(const TraceScene& scene, const SurfacePacket& s, const PathTask* tasks, PacketRandom& random,
                     EmitterLight& out, std::uint64_t& shadowRays) {
    out.mask = 0;
    const Emitters& emitters = *scene.emitters;
    alignas(64) float which[16]{}, u[16]{}, v[16]{};
    random.next(which), random.nextPair(u, v);
    ChosenEmitters chosen{};
    const std::uint32_t lit = litLanes(s);
    for (int at = 0; at < 16; at += 8) {
        const std::uint32_t lanes = lit >> at & 0xFFu;
        if (!lanes) continue;
        const LightTree::Choices choices =
            emitters.sample(loadV(s.position, at), loadV(s.normal, at), load(which + at), lanes);
        store(chosen.probability + at, load(choices.probability));
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            const std::uint32_t emitter = choices.emitter[lane];
            if (emitter != Emitters::kNone) chosen.set(at + lane, emitter, emitters[emitter]);
        }
    }
    if (!chosen.mask) return;
    RayPacket16 rays;
    aim(s, chosen, u, v, rays, out);
    if (!out.mask) return;
    shadowRays += static_cast<std::uint64_t>(std::popcount(out.mask));
    const bool clearAir = scene.volumes.empty() && !scene.fogs.any();
    std::uint32_t even = clearAir ? out.mask & chosen.even : 0;  // emitters that send the same from everywhere
    for (std::uint32_t rest = even; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        if (tasks[lane].media && s.media->absorption(tasks[lane].media) != Vec3f(0)) even &= ~(1u << lane);
    }
    const std::uint32_t free = findFree(scene, rays, even, kBefore);
    std::uint32_t hits = 0;
    PacketHits16 met;
    if (out.mask != free) {
        reset(rays, out.mask & ~free, kReach);
        hits = scene.world->intersect(rays);
        if (hits) scene.world->hits(rays, hits, met);
    }
    out.mask &= free | hits;
    for (std::uint32_t rest = out.mask; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const Emitters::Emitter& e = emitters[chosen.emitter[lane]];
        const Vec3f direction = out.direction.get(lane);
        Vec3f light;
        if ((free >> lane & 1u) ||
            ((even >> lane & 1u) && met.instance[lane] == e.instance && met.triangle[lane] == e.triangle)) {
            light = glm::dot(direction, e.normal) > 0 ? e.behind : e.front;
        } else if (!arrives(scene, s, lane, tasks[lane], e, chosen.position.get(lane), rays, direction, light)) {
            out.mask &= ~(1u << lane);
            continue;
        }
        out.light.set(lane, light);
    }
    for (int at = 0; at < 16; at += 8) {
        const V8 light = loadV(out.light, at);
        const F8 density = load(out.density + at);
        storeV(out.light, at,
               select(lanesFrom(out.mask, at), {light.x / density, light.y / density, light.z / density}, V8{}));
    }
}

void lookForSky(const TraceScene& scene, const SurfacePacket& s, PacketRandom& random, EmitterLight& out,
                std::uint64_t& shadowRays) {
    out.mask = 0;
    alignas(64) float u[16]{}, v[16]{};
    random.nextPair(u, v);
    RayPacket16 rays;
    for (int lane = 0; lane < 16; ++lane) {
        rays.skip(lane);
        if (!isLit(s, lane)) continue;
        const SkyLight::Choice choice = scene.skyLight->sample(u[lane], v[lane]);
        if (!(choice.density > 0) || !isAbove(s, lane, choice.direction)) continue;
        out.density[lane] = choice.density;
        out.direction.set(lane, choice.direction);
        rays.set(lane, {RayView::leave(s.point(lane), choice.direction), kLeave, choice.direction,
                        std::numeric_limits<float>::infinity()});
        out.mask |= 1u << lane;
    }
    if (!out.mask) return;
    shadowRays += static_cast<std::uint64_t>(std::popcount(out.mask));
    // These rays go as bounces do: they pass backs of solids, and do not pass things that cast no shadow.
    constexpr float kFar = std::numeric_limits<float>::infinity();
    std::uint32_t hits = out.mask & ~findFree(scene, rays, out.mask, kFar);
    if (hits) {
        reset(rays, hits, kFar);
        hits &= scene.world->intersect(rays);
    }
    for (std::uint32_t rest = out.mask; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const Vec3f direction = out.direction.get(lane);
        Vec3f left(1);
        if ((hits >> lane & 1u) && !escapes(scene, rays.ray(lane), scene.world->hit(rays, lane), left)) {
            out.mask &= ~(1u << lane);
            continue;
        }
        left *= volumesLeft(scene, {s.position.get(lane), kLeave, direction, std::numeric_limits<float>::infinity()});
        out.light.set(lane, left * Vec3f(scene.fromFar(direction, s.lights[lane], true)) / out.density[lane]);
    }
}

namespace {

/// The lamp that each lane samples, and the light that it would send there on a free way.
struct AskedLamps {
    const TraceLight* lamp[16];
    float sent[16];
    std::uint32_t shadowed = 0;  // lanes whose rays tell whether something is
    RayPacket16 rays;
};

/// The share of a light's intensity that reaches a place at this distance and in this direction from it; 0: none.
float factorOf(const TraceLight& light, float distance, const Vec3f& direction) {
    const float local = distance * light.localFromWorld;
    if (!(distance > 1e-12f) || (light.radius >= 0 && local > light.radius)) return 0;
    const float factor = attenuationAt(light.attenuation, local);
    if (light.kind != Light::Kind::spot) return factor;
    const float angle = std::acos(std::clamp(-glm::dot(direction, light.direction), -1.0f, 1.0f));
    return factor * spotFactor(angle, light.beamWidth, light.cutOffAngle);
}

/// Has a lane ask a lamp that was chosen with a probability.
void askLamp(const TraceScene& scene, const SurfacePacket& s, int lane, const TraceLight& light, float probability,
             AskedLamps& asked, EmitterLight& out) {
    const Vec3f displacement = light.position - s.position.get(lane);
    const float distance = glm::length(displacement);
    const Vec3f direction = displacement / distance;
    const float factor = factorOf(light, distance, direction);
    if (!(factor > 0)) return;
    std::optional<Vec3f> onCurve;
    if (!isAbove(s, lane, direction)) {
        if (glm::dot(direction, s.normal.get(lane)) > 0) onCurve = pointOnCurve(scene, s, lane);
        if (!onCurve) return;
    }
    out.direction.set(lane, direction);
    out.density[lane] = std::numeric_limits<float>::infinity();
    out.mask |= 1u << lane;
    // Units: a light of intensity 1 head-on shows a white surface's 1, radiance over a density 1 / pi.
    asked.lamp[lane] = &light, asked.sent[lane] = std::numbers::pi_v<float> * factor / probability;
    if (!light.shadows) return;
    const Vec3f start = onCurve ? *onCurve : RayView::leave(s.point(lane), direction);
    asked.rays.set(lane, {start, kLeave, light.position - start, 1});
    asked.shadowed |= 1u << lane;
}

}  // namespace

void lookForLamps(const TraceScene& scene, const SurfacePacket& s, PacketRandom& random, EmitterLight& out,
                  std::uint64_t& shadowRays) {
    out.mask = 0;
    alignas(64) float which[16]{};
    random.next(which);
    AskedLamps asked;
    for (int lane = 0; lane < 16; ++lane) asked.rays.skip(lane);
    const std::uint32_t lit = litLanes(s);
    for (int at = 0; at < 16; at += 8) {
        const std::uint32_t lanes = lit >> at & 0xFFu;
        const LightTree::Choices choices =
            scene.lamps->sample(loadV(s.position, at), loadV(s.normal, at), load(which + at), lanes);
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            if (choices.emitter[lane] != LightTree::kNone)
                askLamp(scene, s, at + lane, (*scene.lamps)[choices.emitter[lane]], choices.probability[lane], asked,
                        out);
        }
    }
    if (!out.mask) return;
    shadowRays += static_cast<std::uint64_t>(std::popcount(asked.shadowed));
    std::uint32_t blocked = 0;
    if (asked.shadowed) {
        RayPacket16 rays = asked.rays;
        blocked = scene.world->occluded(rays) & asked.shadowed;
    }
    for (std::uint32_t rest = out.mask; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const TraceLight& light = *asked.lamp[lane];
        Vec3f visible(1);
        if (asked.shadowed >> lane & 1u) {
            const Ray ray = asked.rays.ray(lane);
            Vec3f left(blocked >> lane & 1u ? 0.0f : 1.0f);
            if ((blocked >> lane & 1u) && scene.anyTransmits)
                left = leftAlong(scene, *scene.world, ray, RayKind::shadow,
                                 s.media ? RunsIn{s.media, s.within[lane]} : RunsIn());
            left *= volumesLeft(scene, ray);
            visible -= light.shadowIntensity * (Vec3f(1) - left);
        }
        out.light.set(lane, asked.sent[lane] * light.color * visible);
    }
}

bool reachesEmitter(const TraceScene& scene, const Emitters::Emitter& target, const Vec3f& position, Ray ray, Hit hit,
                    Vec3f& left) {
    return reaches(scene, target, position, ray, hit, left);
}

float emitterDensity(const TraceScene& scene, std::uint32_t instance, std::uint32_t triangle, const Vec3f& from,
                     const Vec3f& direction, float distance, const Vec3f& normal) {
    const std::uint32_t emitter = scene.emitters->find(instance, triangle);
    if (emitter == Emitters::kNone) return 0;
    const Emitters::Emitter& e = (*scene.emitters)[emitter];
    const float cosine = -glm::dot(e.normal, direction);
    if (!(e.area > 0) || !(cosine > 0 || e.bothSides)) return 0;
    return scene.emitters->density(emitter, from, normal) * distance * distance / (e.area * std::abs(cosine));
}

float emitterDensity(const TraceScene& scene, const SurfacePacket& s, int lane, const PathTask& task) {
    const float distance = task.line + s.distance[lane];
    return emitterDensity(scene, s.hits.instance[lane], s.hits.triangle[lane],
                          s.position.get(lane) - distance * task.direction, task.direction, distance, task.normal);
}

}  // namespace rtsg::trace
