// The lighting equations, eight lanes at a time: ISO/IEC 19775-1 V4.0 17.2.2.
#include <bit>

#include "simd8.h"
#include "surface_packet.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// What one light sends to sixteen points.
struct alignas(64) Incoming {
    Lanes3 direction;              // towards the light, unit
    alignas(64) float factor[16];  // attenuation times spot; 0 where the light does not reach
    alignas(64) float cosine[16];  // to the shading normal, at least 0
    alignas(64) float distance[16];
    Lanes3 visible;  // share that shadows leave
};

V8 loadV(const Lanes3& lanes, int at) {
    return {load(lanes.x + at), load(lanes.y + at), load(lanes.z + at)};
}
void storeV(Lanes3& lanes, int at, const V8& v) {
    store(lanes.x + at, v.x), store(lanes.y + at, v.y), store(lanes.z + at, v.z);
}
V8 broadcast(const Vec3f& v) {
    return {all(v.x), all(v.y), all(v.z)};
}

/// Returns whether any lane is lit at all.
bool gather(const TraceLight& light, const SurfacePacket& s, Incoming& in) {
    I8 lit{};
    for (int at = 0; at < 16; at += 8) {
        V8 toLight;
        F8 factor = all(1), distance = all(0);
        if (light.kind == Light::Kind::directional) {
            toLight = broadcast(-light.direction);
        } else {
            toLight = broadcast(light.position) - loadV(s.position, at);
            distance = sqrt(dot(toLight, toLight));
            toLight = toLight * (1.0f / max(distance, all(1e-30f)));
            const F8 local = distance * light.localFromWorld;
            const F8 falloff = light.attenuation.x + local * (light.attenuation.y + local * light.attenuation.z);
            factor = 1.0f / max(falloff, all(1));
            if (light.radius >= 0) factor = select(local > light.radius, all(0), factor);
            if (light.kind == Light::Kind::spot) {
                const F8 angle = acosOf(max(min(-dot(toLight, broadcast(light.direction)), all(1)), all(-1)));
                const float width = light.beamWidth - light.cutOffAngle;
                F8 spot = width < 0 ? (angle - light.cutOffAngle) / width : all(1);
                spot = select(angle <= light.beamWidth, all(1), spot);
                factor *= select(angle >= light.cutOffAngle, all(0), spot);
            }
        }
        const F8 cosine = max(dot(loadV(s.normal, at), toLight), all(0));
        storeV(in.direction, at, toLight);
        store(in.factor + at, factor);
        store(in.cosine + at, cosine);
        store(in.distance + at, distance);
        storeV(in.visible, at, {all(1), all(1), all(1)});
        lit |= factor > 0.0f;
    }
    return any(lit);
}

/// Follows a shadow ray that is blocked by something through what is clear.
Vec3f look(const TraceScene& scene, Ray ray) {
    Vec3f left(1);
    for (int step = 0; step < 64; ++step) {
        const Hit hit = scene.world->intersect(ray, RayKind::shadow);
        if (!hit) return left;
        left *= straightTransmittance(scene, hit);
        if (!(std::max({left.x, left.y, left.z}) > 1 / 1024.0f)) return Vec3f(0);
        const Vec3f next = RayWorld::leave(scene.world->point(hit), ray.direction);
        // For a light at a place, t counts in shares of the way that is left.
        if (std::isfinite(ray.tMax)) {
            ray.direction = ray.origin + ray.direction - next;
            if (!(glm::dot(ray.direction, ray.direction) > 1e-20f)) return left;
        }
        ray.origin = next;
    }
    return Vec3f(0);
}

void castShadows(const TraceScene& scene, const TraceLight& light, const SurfacePacket& s, std::uint32_t mask,
                 Incoming& in, std::uint64_t& shadowRays) {
    RayPacket16 rays;
    std::uint32_t tested = 0;
    for (int lane = 0; lane < 16; ++lane) rays.skip(lane);
    for (std::uint32_t rest = mask; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        if (!(in.factor[lane] > 0) || !(in.cosine[lane] > 0)) continue;
        Ray ray;
        ray.tMin = kLeave;
        const HitPoint point = scene.world->point(s.hit[lane]);
        const Vec3f towards = in.direction.get(lane);
        ray.origin = RayWorld::leave(point, towards);
        if (light.kind == Light::Kind::directional) {
            ray.direction = towards;
        } else {
            ray.direction = light.position - ray.origin;
            ray.tMax = 1;
            if (!(glm::dot(ray.direction, ray.direction) > 1e-20f)) continue;
        }
        rays.set(lane, ray);
        tested |= 1u << lane;
    }
    if (!tested) return;
    shadowRays += static_cast<std::uint64_t>(std::popcount(tested));
    // Not as coherent rays: Embree 3.13's frustum traversal of shadow rays loops for ever on some nested scenes.
    std::uint32_t blocked = scene.world->occluded(rays, false) & tested;
    for (; blocked; blocked &= blocked - 1) {
        const int lane = std::countr_zero(blocked);
        Vec3f left(0);
        if (scene.anyTransmits) {
            Ray ray;
            ray.tMin = kLeave;
            ray.origin = {rays.originX[lane], rays.originY[lane], rays.originZ[lane]};
            ray.direction = {rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]};
            if (light.kind != Light::Kind::directional) ray.tMax = 1;
            left = look(scene, ray);
        }
        in.visible.set(lane, Vec3f(1) - light.shadowIntensity * (Vec3f(1) - left));
    }
}

void addPhong(const TraceLight& light, SurfacePacket& s, const Incoming& in, const std::int32_t* lanes, bool shiny) {
    const V8 color = broadcast(light.color), ambientLight = broadcast(light.ambient);
    for (int at = 0; at < 16; at += 8) {
        I8 use;
        std::memcpy(&use, lanes + at, sizeof use);
        if (!any(use)) continue;
        const V8 base = loadV(s.base, at), ambient = loadV(s.ambient, at), visible = loadV(in.visible, at);
        const F8 cosine = load(in.cosine + at), factor = select(use, load(in.factor + at), all(0));
        V8 direct = base * cosine;
        if (shiny) {
            const V8 toLight = loadV(in.direction, at);
            const V8 half = toLight + loadV(s.view, at);
            const F8 length = sqrt(dot(half, half));
            const F8 cosHalf = dot(loadV(s.normal, at), half) / max(length, all(1e-20f));
            F8 shine = power(min(max(cosHalf, all(0)), all(1)), load(s.exponent + at));
            shine = select(cosine > 0.0f, shine, all(0));
            direct = direct + loadV(s.specular, at) * shine;
        }
        V8 radiance = loadV(s.radiance, at);
        radiance.x += factor * (color.x * direct.x * visible.x + ambientLight.x * ambient.x);
        radiance.y += factor * (color.y * direct.y * visible.y + ambientLight.y * ambient.y);
        radiance.z += factor * (color.z * direct.z * visible.z + ambientLight.z * ambient.z);
        storeV(s.radiance, at, radiance);
    }
}

void addPhysical(const TraceLight& light, SurfacePacket& s, const Incoming& in, int lane) {
    const float cosine = in.cosine[lane], factor = in.factor[lane];
    if (!(factor > 0)) return;
    const Vec3f base = s.base.get(lane);
    Vec3f sum = light.ambient * s.ambient.get(lane);
    if (cosine > 0) {
        const Vec3f n = s.normal.get(lane), l = in.direction.get(lane), v = s.view.get(lane);
        const Vec3f sumVector = l + v;
        const float length = glm::length(sumVector);
        const Vec3f h = length > 0 ? sumVector / length : n;
        sum += light.color * in.visible.get(lane) * cosine *
               metallicRoughness(base, s.metallic[lane], s.roughness[lane], cosine, std::max(glm::dot(n, v), 1e-4f),
                                 std::max(glm::dot(n, h), 0.0f), std::max(glm::dot(l, h), 0.0f));
    }
    s.radiance.add(lane, factor * sum);
}

}  // namespace

void addLights(const TraceScene& scene, SurfacePacket& s, std::uint64_t& shadowRays) {
    std::uint32_t lit = 0, physical = 0;
    for (std::uint32_t rest = s.mask; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        if (s.model[lane] == ShadingModel::unlit) {
            s.radiance.set(lane, s.base.get(lane));
            continue;
        }
        s.radiance.set(lane, s.emissive.get(lane));
        if (s.coverage[lane] * s.opacity[lane] <= 0 && s.specular.get(lane) == Vec3f(0)) continue;
        lit |= 1u << lane;
        if (s.model[lane] == ShadingModel::physical) physical |= 1u << lane;
    }
    // Lanes that share their lights go together; nearly always all of them.
    while (lit) {
        const std::uint32_t list = s.lights[std::countr_zero(lit)];
        std::uint32_t group = 0;
        alignas(32) std::int32_t phong[16];
        bool shiny = false;
        for (int lane = 0; lane < 16; ++lane) {
            const bool in = (lit >> lane & 1u) && s.lights[lane] == list;
            const bool isPhong = in && !(physical >> lane & 1u);
            phong[lane] = isPhong ? -1 : 0;
            if (in) group |= 1u << lane;
            shiny = shiny || (isPhong && s.specular.get(lane) != Vec3f(0));
        }
        for (const TraceLight& light : scene.lightLists[list]) {
            Incoming in;
            if (!gather(light, s, in)) continue;
            if (light.shadows) castShadows(scene, light, s, group, in, shadowRays);
            if (group & ~physical) addPhong(light, s, in, phong, shiny);
            for (std::uint32_t rest = group & physical; rest; rest &= rest - 1)
                addPhysical(light, s, in, std::countr_zero(rest));
        }
        lit &= ~group;
    }
}

}  // namespace rtsg::trace
