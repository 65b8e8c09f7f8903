// The lighting equations, eight lanes at a time: ISO/IEC 19775-1 V4.0 17.2.2.
#include <bit>
#include <cstring>

#include "bsdf.h"
#include "lanes.h"
#include "surface_packet.h"
#include "volume_march.h"

namespace rtsg::trace {

using namespace simd;

namespace {

// Not as coherent rays: Embree 3.13's frustum traversal of shadow rays has been seen to loop for ever.
constexpr bool kCoherentShadows = false;

/// What one light sends to sixteen points.
struct alignas(64) Incoming {
    Lanes3 direction;              // towards the light, unit
    alignas(64) float factor[16];  // attenuation times spot; 0 where the light does not reach
    alignas(64) float cosine[16];  // to the shading normal, at least 0
    alignas(64) float distance[16];
    Lanes3 visible;  // share that shadows leave
};

/// Where points lie before a projector, and where in its picture.
struct InProjection {
    F8 depth, s, t;
    I8 inside;
};
InProjection project(const TraceLight& light, const V8& position) {
    const V8 from = position - broadcast(light.position);
    InProjection in;
    in.depth = dot(from, broadcast(light.direction));
    const F8 share = light.kind == Light::Kind::projector ? 1.0f / max(in.depth, all(1e-30f)) : all(1);
    const Vec4f& e = light.extent;
    in.s = (dot(from, broadcast(light.right)) * share - e.x) / (e.z - e.x);
    in.t = (dot(from, broadcast(light.up)) * share - e.y) / (e.w - e.y);
    in.inside = (in.depth > 0.0f) & (in.depth >= light.nearDistance) & (in.depth <= light.farDistance) &
                (in.s >= 0.0f) & (in.s <= 1.0f) & (in.t >= 0.0f) & (in.t <= 1.0f);
    return in;
}

/// Makes the light on each lane that of the picture there.
void tint(const TraceScene& scene, const TraceLight& light, const SurfacePacket& s, Incoming& in) {
    TextureAccess access;
    access.wrapS = access.wrapT = TextureWrap::clamp;
    for (int at = 0; at < 16; at += 8) {
        const InProjection there = project(light, loadV(s.position, at));
        const F8 factor = load(in.factor + at);
        for (int lane = 0; lane < 8; ++lane) {
            if (!(factor[lane] > 0)) continue;
            const Vec4f color = light.picture->sample(there.s[lane], there.t[lane], 0, access, scene.space);
            in.visible.set(at + lane, in.visible.get(at + lane) * Vec3f(color) * color.a);
        }
    }
}

/// Returns whether any lane is lit at all.
bool gather(const TraceLight& light, const SurfacePacket& s, Incoming& in) {
    I8 lit{};
    for (int at = 0; at < 16; at += 8) {
        V8 toLight;
        F8 factor = all(1), distance = all(0);
        if (light.kind == Light::Kind::directional) {
            toLight = broadcast(-light.direction);
        } else if (light.picture) {
            const V8 position = loadV(s.position, at);
            const InProjection there = project(light, position);
            factor = select(there.inside, all(1), all(0));
            toLight = broadcast(-light.direction), distance = there.depth;
            if (light.kind == Light::Kind::projector) {
                toLight = broadcast(light.position) - position;
                distance = sqrt(dot(toLight, toLight));
                toLight = toLight * (1.0f / max(distance, all(1e-30f)));
            }
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

/// The rays of `tested` that may meet something clear.
std::uint32_t nearClear(const TraceScene& scene, const RayPacket16& rays, std::uint32_t tested) {
    if (!scene.anyTransmits) return 0;
    if (scene.clearAnywhere) return tested;
    const std::uint32_t most = meetBox(rays, scene.allClear) & tested;
    if (!most || scene.clear.empty()) return most;
    std::uint32_t met = 0;
    for (const Bounds& box : scene.clear) met |= meetBox(rays, box);
    return met & most;
}

/// Which rays are blocked, and in `clear` which of them by something that may let light through. What an opaque thing
/// blocks needs no closer look, whatever else the scene holds.
std::uint32_t findBlocked(const TraceScene& scene, RayPacket16& rays, std::uint32_t tested, std::uint32_t& clear) {
    clear = 0;
    const std::uint32_t near = nearClear(scene, rays, tested);
    if (!near) return scene.world->occluded(rays, kCoherentShadows) & tested;
    std::uint32_t blocked = 0;
    RayPacket16 closer = rays;
    std::int32_t active[16];
    std::memcpy(active, rays.active, sizeof active);
    for (int lane = 0; lane < 16; ++lane) {
        const bool isNear = near >> lane & 1u;
        if (!isNear) closer.skip(lane);
        if (isNear) rays.skip(lane);
    }
    if (tested & ~near) blocked = scene.world->occluded(rays, kCoherentShadows) & tested & ~near;
    const std::uint32_t met = scene.world->intersect(closer, kCoherentShadows, RayKind::shadow) & near;
    for (std::uint32_t rest = met; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        if (letsThrough(scene, scene.world->hit(closer, lane).instance)) clear |= 1u << lane;
    }
    std::memcpy(rays.active, active, sizeof active);  // who asked looks at them
    return blocked | met;
}

void castShadows(const TraceScene& scene, const TraceLight& light, SurfacePacket& s, std::uint32_t mask, Incoming& in,
                 std::uint64_t& shadowRays) {
    RayPacket16 rays;
    std::uint32_t tested = 0;
    std::uint32_t behind = 0;  // lanes whose own surface lies between them and the light
    findPoints(scene, s);
    const bool directional = light.kind == Light::Kind::directional;
    for (int at = 0; at < 16; at += 8) {
        const V8 towards = loadV(in.direction, at), start = leave8(s, at, towards);
        V8 d = towards;
        if (light.kind == Light::Kind::projectorParallel)
            d = towards * load(in.distance + at);
        else if (!directional)
            d = broadcast(light.position) - start;
        store(rays.originX + at, start.x), store(rays.originY + at, start.y), store(rays.originZ + at, start.z);
        store(rays.directionX + at, d.x), store(rays.directionY + at, d.y), store(rays.directionZ + at, d.z);
        store(rays.tMin + at, all(kLeave));
        store(rays.tMax + at, all(directional ? std::numeric_limits<float>::infinity() : 1.0f));
        const I8 lit = (load(in.factor + at) > 0.0f) & (load(in.cosine + at) > 0.0f) & (dot(d, d) > 1e-20f);
        // A shading normal may face a light that is behind the true surface.
        const V8 n{load(s.hits.normalX + at), load(s.hits.normalY + at), load(s.hits.normalZ + at)};
        const F8 side = dot(n, towards) * dot(n, loadV(s.view, at));
        for (int lane = 0; lane < 8; ++lane) {
            const bool use = (mask >> (at + lane) & 1u) && lit[lane], faces = side[lane] > 0;
            rays.active[at + lane] = use ? -1 : 0;
            tested |= static_cast<std::uint32_t>(use) << (at + lane);
            behind |= static_cast<std::uint32_t>(use && !faces) << (at + lane);
        }
    }
    if (!tested) return;
    Vec3f through[16];
    for (std::uint32_t rest = behind; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        through[lane] = scene.anyTransmits ? straightTransmittance(scene, s.hit(lane)) : Vec3f(0);
        if (through[lane] == Vec3f(0)) rays.active[lane] = 0;
    }
    shadowRays += static_cast<std::uint64_t>(std::popcount(tested));
    std::uint32_t clear = 0;
    const std::uint32_t blocked = findBlocked(scene, rays, tested, clear);
    const std::uint32_t hazy =
        scene.volumes.empty() ? 0 : meetBox(rays, scene.volumeBounds) & tested & ~(blocked & ~clear);
    for (std::uint32_t rest = blocked | behind | hazy; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const bool free = !(blocked >> lane & 1u) && rays.active[lane];
        Vec3f left(free ? 1.0f : 0.0f);
        Ray ray = rays.ray(lane);
        ray.tMax = directional ? std::numeric_limits<float>::infinity() : 1;
        if (clear >> lane & 1u) left = leftOnTheWay(scene, ray);
        if ((hazy >> lane & 1u) && left != Vec3f(0)) left *= volumesLeft(scene, ray);
        if (behind >> lane & 1u) left *= through[lane];
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

/// metallicRoughness() of shading.h.
V8 metallicRoughness8(const V8& base, F8 metallic, F8 roughness, F8 cosLight, F8 cosView, F8 cosHalf, F8 cosLightHalf) {
    const F8 m = max(1.0f - cosLightHalf, all(0)), m2 = m * m, m5 = m2 * m2 * m;
    const F8 alpha = max(roughness * roughness, all(1e-3f)), a2 = alpha * alpha;
    const F8 d = cosHalf * cosHalf * (a2 - 1.0f) + 1.0f;
    const F8 masking =
        cosLight * sqrt(cosView * cosView * (1.0f - a2) + a2) + cosView * sqrt(cosLight * cosLight * (1.0f - a2) + a2);
    const F8 specular = select(masking > 0.0f, 0.5f * (a2 / (d * d)) / masking, all(0));
    const auto channel = [&](F8 color) {
        const F8 f0 = 0.04f + (color - 0.04f) * metallic;
        const F8 fresnel = f0 + (1.0f - f0) * m5;
        return (1.0f - fresnel) * (1.0f - metallic) * color + fresnel * specular;
    };
    return {channel(base.x), channel(base.y), channel(base.z)};
}

void addPhysical(const TraceLight& light, SurfacePacket& s, const Incoming& in, const std::int32_t* lanes) {
    const V8 color = broadcast(light.color * kPhysicalLight), ambientLight = broadcast(light.ambient);
    for (int at = 0; at < 16; at += 8) {
        I8 use;
        std::memcpy(&use, lanes + at, sizeof use);
        if (!any(use)) continue;
        const V8 base = loadV(s.base, at), ambient = loadV(s.ambient, at), visible = loadV(in.visible, at);
        const F8 cosine = load(in.cosine + at), factor = select(use, load(in.factor + at), all(0));
        const V8 n = loadV(s.normal, at), l = loadV(in.direction, at), v = loadV(s.view, at);
        const V8 sum = l + v;
        const V8 h = sum * (1.0f / max(sqrt(dot(sum, sum)), all(1e-20f)));
        const V8 brdf = metallicRoughness8(base, load(s.metallic + at), load(s.roughness + at), cosine,
                                           max(dot(n, v), all(1e-4f)), max(dot(n, h), all(0)), max(dot(l, h), all(0)));
        V8 radiance = loadV(s.radiance, at);
        radiance.x += factor * (color.x * visible.x * cosine * brdf.x + ambientLight.x * ambient.x);
        radiance.y += factor * (color.y * visible.y * cosine * brdf.y + ambientLight.y * ambient.y);
        radiance.z += factor * (color.z * visible.z * cosine * brdf.z + ambientLight.z * ambient.z);
        storeV(s.radiance, at, radiance);
    }
}

/// -1 in the lanes of `mask`.
void spread(std::uint32_t mask, std::int32_t* lanes) {
    for (int lane = 0; lane < 16; ++lane) lanes[lane] = -static_cast<std::int32_t>(mask >> lane & 1u);
}

}  // namespace

Vec3f leftOnTheWay(const TraceScene& scene, Ray ray) {
    Vec3f left(1);
    for (int step = 0; step < 64; ++step) {
        const Hit hit = scene.world->intersect(ray, RayKind::shadow);
        if (!hit) return left;
        left *= straightTransmittance(scene, hit);
        if (!(std::max({left.x, left.y, left.z}) > 1 / 1024.0f)) return Vec3f(0);
        const Vec3f next = RayView::leave(scene.world->point(hit, ray.origin + hit.t * ray.direction), ray.direction);
        // For a light at a place, t counts in shares of the way that is left.
        if (std::isfinite(ray.tMax)) {
            ray.direction = ray.origin + ray.direction - next;
            if (!(glm::dot(ray.direction, ray.direction) > 1e-20f)) return left;
        }
        ray.origin = next;
    }
    return Vec3f(0);
}

void addLights(const TraceScene& scene, SurfacePacket& s, std::uint64_t& shadowRays) {
    alignas(32) std::int32_t unlit[16];
    spread(s.unlit, unlit);
    for (int at = 0; at < 16; at += 8) {
        I8 plain;
        std::memcpy(&plain, unlit + at, sizeof plain);
        const V8 base = loadV(s.base, at), own = loadV(s.emissive, at);
        storeV(s.radiance, at,
               {select(plain, base.x, own.x), select(plain, base.y, own.y), select(plain, base.z, own.z)});
    }
    const LightGroups& all = scene.lightGroups;
    // Lanes that share their lights go together; nearly always all of them.
    for (std::uint32_t lit = s.mask & ~s.unlit; lit;) {
        const std::uint32_t start = all.start(s.lights[std::countr_zero(lit)]);
        std::uint32_t group = 0;
        for (std::uint32_t rest = lit; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            group |= static_cast<std::uint32_t>(all.start(s.lights[lane]) == start) << lane;
        }
        lit &= ~group;
        const std::uint32_t phong = group & ~s.physical, physical = group & s.physical;
        alignas(32) std::int32_t phongLanes[16], physicalLanes[16];
        spread(phong, phongLanes);
        spread(physical, physicalLanes);
        for (std::uint32_t at = start; at != LightGroups::kEnd; at = all.next(at))
            for (const TraceLight& light : all.lightsOf(at)) {
                Incoming in;
                if (!gather(light, s, in)) continue;
                if (light.shadows) castShadows(scene, light, s, group, in, shadowRays);
                if (light.picture) tint(scene, light, s, in);
                if (phong) addPhong(light, s, in, phongLanes, (phong & s.shiny) != 0);
                if (physical) addPhysical(light, s, in, physicalLanes);
            }
    }
}

}  // namespace rtsg::trace
