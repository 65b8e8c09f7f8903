// Rays towards chosen emitters and the sky, and what is left of their light on the way.
#include "path_emitters.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "lamps.h"
#include "sample_points.h"
#include "sky_light.h"
#include "volume_march.h"

namespace rtsg::trace {

namespace {

// A ray reaches a little further than its target, so that rounding does not end it in front of it.
constexpr float kReach = 1.001f;

/// What a bounce meets at a hit that it goes straight on from: all of the light behind the back of a solid, which is
/// not there; 0 at glass, which bends it.
Vec3f passes(const TraceScene& scene, const Hit& hit, const Vec3f& direction) {
    const float index = scene.materials[scene.slots[hit.instance].material].material.refractiveIndex;
    const RayInstance& instance = scene.world->instance(hit.instance);
    if (index > 0) return Vec3f(0);
    if (instance.mesh->solid && glm::dot(direction, hit.normal) > 0) return Vec3f(1);
    return straightTransmittance(scene, hit);
}

/// Where the ray that made a hit goes on.
Vec3f behind(const TraceScene& scene, const Hit& hit, const Ray& ray) {
    return RayView::leave(scene.world->point(hit, ray.origin + hit.t * ray.direction), ray.direction);
}

/// Follows a ray, which has made this hit, to its emitter through what is clear; false: something is in the way.
bool reaches(const TraceScene& scene, const Emitters::Emitter& target, const Vec3f& place, Ray ray, Hit& hit,
             Vec3f& left) {
    const Vec3f direction = glm::normalize(ray.direction);
    left = Vec3f(1);
    for (int step = 0; step < 64; ++step) {
        if (!hit) return false;
        if (hit.instance == target.instance && hit.triangle == target.triangle) return true;
        if (hit.instance >= scene.slots.size()) return false;
        left *= passes(scene, hit, direction);
        if (left == Vec3f(0)) return false;
        ray.origin = behind(scene, hit, ray), ray.tMin = kLeave, ray.tMax = kReach;
        ray.direction = place - ray.origin;
        if (!(glm::dot(ray.direction, direction) > 0)) return false;
        hit = scene.world->intersect(ray);
    }
    return false;
}

/// The same to the sky.
bool escapes(const TraceScene& scene, Ray ray, Hit hit, Vec3f& left) {
    left = Vec3f(1);
    for (int step = 0; step < 64; ++step) {
        if (!hit) return true;
        if (hit.instance >= scene.slots.size()) return false;
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

/// Above both horizons: the true surface's and the shading normal's.
bool isAbove(const SurfacePacket& s, int lane, const Vec3f& direction) {
    const Vec3f facing = s.back >> lane & 1u ? -s.outside(lane) : s.outside(lane);
    return glm::dot(direction, facing) > 0 && glm::dot(direction, s.normal.get(lane)) > 0;
}

}  // namespace

void lookForEmitters(const TraceScene& scene, const SurfacePacket& s, PathTask* tasks, EmitterLight& out,
                     std::uint64_t& shadowRays) {
    out.mask = 0;
    const Emitters& emitters = *scene.emitters;
    RayPacket16 rays;
    Vec3f places[16];
    std::uint32_t chosen[16];
    for (int lane = 0; lane < 16; ++lane) {
        rays.skip(lane);
        if (!isLit(s, lane)) continue;
        PathRandom random(tasks[lane].random);
        const float u = random.next();
        const Vec2f at = random.nextPair();
        tasks[lane].random = random.state();
        const Vec3f normal = s.normal.get(lane);
        const Emitters::Choice choice = emitters.sample(s.position.get(lane), normal, u);
        if (choice.emitter == Emitters::kNone) continue;
        const Emitters::Emitter& e = emitters[choice.emitter];
        const float side = std::sqrt(at.x);
        const Vec3f place = e.corner + (1 - side) * e.ab + (at.y * side) * e.ac;
        const Vec3f start = RayView::leave(s.point(lane), place - s.position.get(lane)), way = place - start;
        const float squared = glm::dot(way, way), distance = std::sqrt(squared);
        if (!(distance > 1e-12f)) continue;
        const Vec3f direction = way / distance;
        if (!isAbove(s, lane, direction)) continue;
        const float cosine = -glm::dot(e.normal, direction);
        if (!(cosine > 0) && !e.bothSides) continue;
        const float density = choice.probability * squared / (e.area * std::abs(cosine));
        if (!(density > 0) || !std::isfinite(density)) continue;
        out.density[lane] = density;
        out.direction.set(lane, direction);
        places[lane] = place, chosen[lane] = choice.emitter;
        rays.set(lane, {start, kLeave, way, kReach});
        out.mask |= 1u << lane;
    }
    if (!out.mask) return;
    shadowRays += static_cast<std::uint64_t>(std::popcount(out.mask));
    out.mask &= scene.world->intersect(rays);
    for (std::uint32_t rest = out.mask; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const Vec3f direction = out.direction.get(lane), from = s.position.get(lane);
        Hit hit = scene.world->hit(rays, lane);
        Vec3f left;
        if (!reaches(scene, emitters[chosen[lane]], places[lane], rays.ray(lane), hit, left)) {
            out.mask &= ~(1u << lane);
            continue;
        }
        const float distance = glm::length(places[lane] - from),
                    run = tasks[lane].travelled + s.distance[lane] + distance;
        left *= volumesLeft(scene, {from, kLeave, places[lane] - from, 1});
        const float cosine = std::max(std::abs(glm::dot(direction, hit.normal)), 0.05f);
        const float footprint = (scene.pixelSpread * run + scene.pixelSize) / std::sqrt(cosine);
        left *= emitted(scene, hit, glm::dot(direction, hit.normal) > 0, footprint);
        if (tasks[lane].absorption != Vec3f(0)) left *= glm::exp(-tasks[lane].absorption * distance);
        if (scene.fogs.any())
            left *= scene.fogs.of(scene.slots[hit.instance].lights)
                        .left(*scene.world->instance(hit.instance).mesh, hit.triangle, hit.u, hit.v, distance);
        out.light.set(lane, left / out.density[lane]);
    }
}

void lookForSky(const TraceScene& scene, const SurfacePacket& s, PathTask* tasks, EmitterLight& out,
                std::uint64_t& shadowRays) {
    out.mask = 0;
    RayPacket16 rays;
    for (int lane = 0; lane < 16; ++lane) {
        rays.skip(lane);
        if (!isLit(s, lane)) continue;
        PathRandom random(tasks[lane].random);
        const Vec2f at = random.nextPair();
        tasks[lane].random = random.state();
        const SkyLight::Choice choice = scene.skyLight->sample(at.x, at.y);
        if (!(choice.density > 0) || !isAbove(s, lane, choice.direction)) continue;
        out.density[lane] = choice.density;
        out.direction.set(lane, choice.direction);
        rays.set(lane, {RayView::leave(s.point(lane), choice.direction), kLeave, choice.direction,
                        std::numeric_limits<float>::infinity()});
        out.mask |= 1u << lane;
    }
    if (!out.mask) return;
    shadowRays += static_cast<std::uint64_t>(std::popcount(out.mask));
    // As bounces go: past backs of solids, and not past what casts no shadow.
    const std::uint32_t hits = scene.world->intersect(rays) & out.mask;
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

void lookForLamps(const TraceScene& scene, const SurfacePacket& s, PathTask* tasks, EmitterLight& out,
                  std::uint64_t& shadowRays) {
    out.mask = 0;
    for (int lane = 0; lane < 16; ++lane) {
        if (!isLit(s, lane)) continue;
        PathRandom random(tasks[lane].random);
        const float u = random.next();
        tasks[lane].random = random.state();
        const Vec3f from = s.position.get(lane);
        const Lamps::Choice choice = scene.lamps->sample(from, s.normal.get(lane), u);
        if (!choice.light) continue;
        const TraceLight& light = *choice.light;
        const float distance = glm::length(light.position - from), local = distance * light.localFromWorld;
        if (!(distance > 1e-12f) || (light.radius >= 0 && local > light.radius)) continue;
        const Vec3f direction = (light.position - from) / distance;
        float factor = attenuationAt(light.attenuation, local);
        if (light.kind == Light::Kind::spot) {
            const float angle = std::acos(std::clamp(-glm::dot(direction, light.direction), -1.0f, 1.0f));
            factor *= spotFactor(angle, light.beamWidth, light.cutOffAngle);
        }
        if (!(factor > 0) || !isAbove(s, lane, direction)) continue;
        Vec3f visible(1);
        if (light.shadows) {
            Ray ray;
            ray.tMin = kLeave, ray.tMax = 1;
            ray.origin = RayView::leave(s.point(lane), direction), ray.direction = light.position - ray.origin;
            ++shadowRays;
            Vec3f left(0);
            if (scene.anyTransmits)
                left = leftOnTheWay(scene, ray);
            else if (!scene.world->occluded(ray))
                left = Vec3f(1);
            left *= volumesLeft(scene, ray);
            visible -= light.shadowIntensity * (Vec3f(1) - left);
        }
        out.direction.set(lane, direction);
        out.density[lane] = std::numeric_limits<float>::infinity();
        // Units: a light of intensity 1 head-on shows a white surface's 1, radiance over a density 1 / pi.
        out.light.set(lane, std::numbers::pi_v<float> * factor / choice.probability * light.color * visible);
        out.mask |= 1u << lane;
    }
}

float emitterDensity(const TraceScene& scene, const SurfacePacket& s, int lane, const PathTask& task) {
    const std::uint32_t emitter = scene.emitters->find(s.hits.instance[lane], s.hits.triangle[lane]);
    if (emitter == Emitters::kNone) return 0;
    const Emitters::Emitter& e = (*scene.emitters)[emitter];
    const float distance = task.line + s.distance[lane], cosine = -glm::dot(e.normal, task.direction);
    if (!(e.area > 0) || !(cosine > 0 || e.bothSides)) return 0;
    const Vec3f from = s.position.get(lane) - distance * task.direction;
    return scene.emitters->density(emitter, from, task.normal) * distance * distance / (e.area * std::abs(cosine));
}

}  // namespace rtsg::trace
