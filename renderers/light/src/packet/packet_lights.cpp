// Lights the lanes of a packet, with shadows: ISO/IEC 19775-1 V4.0 17.2.2.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "surface/coincident.h"
#include "surface/lanes.h"
#include "surface/packet_kernels.h"
#include "surface/surface_packet.h"
#include "tables/left_out.h"
#include "texture/bsdf.h"
#include "volume_march.h"
#include "world/clear_path.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// The position of points before a projector and in its picture.
struct InProjection {
    F8 depth, s, t;
    I8 inside;
};
InProjection project(const TraceLight& light, const V8& position) {
    const V8 from = position - broadcast(light.position);
    InProjection in;
    in.depth = dot(from, broadcast(light.direction));
    const F8 weight = light.kind == Light::Kind::projector ? 1.0f / max(in.depth, all(1e-30f)) : all(1);
    const Vec4f& e = light.extent;
    in.s = (dot(from, broadcast(light.right)) * weight - e.x) / (e.z - e.x);
    in.t = (dot(from, broadcast(light.up)) * weight - e.y) / (e.w - e.y);
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

/// PacketKernels::gather() of a projector.
bool gatherProjected(const TraceLight& light, const SurfacePacket& s, Incoming& in) {
    I8 lit{};
    for (int at = 0; at < 16; at += 8) {
        const V8 position = loadV(s.position, at);
        const InProjection there = project(light, position);
        const F8 factor = select(there.inside, all(1), all(0));
        V8 toLight = broadcast(-light.direction);
        F8 distance = there.depth;
        if (light.kind == Light::Kind::projector) {
            toLight = broadcast(light.position) - position;
            distance = sqrt(dot(toLight, toLight));
            toLight = toLight * (1.0f / max(distance, all(1e-30f)));
        }
        storeV(in.direction, at, toLight);
        store(in.factor + at, factor);
        store(in.cosine + at, max(dot(loadV(s.normal, at), toLight), all(0)));
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
    const std::uint32_t maximum = meetBox(rays, scene.allClear) & tested;
    if (!maximum || scene.clear.empty()) return maximum;
    std::uint32_t met = 0;
    for (const Bounds& box : scene.clear) met |= meetBox(rays, box);
    return met & maximum;
}

/// Smaller shares of light count as 0. The limit is this small because lights may be of any strength.
constexpr float kMin = 1e-9f;

/// Multiplies `left`, for a ray that ends at `tMax`, by `through`, which its hit lets pass, and moves the ray on behind
/// the hit. False: nothing more is in its way, or nothing is left.
bool passOn(const TraceScene& scene, const Hit& hit, const Vec3f& through, float tMax, Ray& ray, Vec3f& left) {
    left *= through;
    if (!(std::max({left.x, left.y, left.z}) > kMin)) {
        left = Vec3f(0);
        return false;
    }
    const Vec3f next = RayView::leave(scene.world->point(hit, ray), ray.direction);
    // For a light at a place, t counts in shares of the way that is left.
    if (std::isfinite(tMax)) {
        ray.direction = ray.origin + ray.direction - next;
        if (!(glm::dot(ray.direction, ray.direction) > 1e-20f)) return false;
    }
    // All things ignored before this hit are behind the new start, so the ray begins at 0 again.
    ray.origin = next, ray.tMin = 0, ray.tMax = tMax;
    return true;
}

/// leftAlong() side by side of those rays of a packet that have met something clear.
void passClear(const TraceScene& scene, const RayView& world, RayPacket16& rays, std::uint32_t met, float tMax,
               RunsIn* in, Vec3f* left) {
    for (int step = 0; met; ++step) {
        std::uint32_t on = 0;
        for (int lane = 0; lane < 16; ++lane) {
            if (met >> lane & 1u) {
                Ray ray = rays.ray(lane);
                const Hit hit = world.hit(rays, lane);
                const Vec3f through = straightTransmittance(scene, hit, ray.direction, in[lane].pass(scene, ray, hit));
                if (passOn(scene, hit, through, tMax, ray, left[lane])) {
                    rays.set(lane, ray);
                    on |= 1u << lane;
                    continue;
                }
            }
            rays.skip(lane);
        }
        if (step + 1 == kMaxPassed)
            for (; on; on &= on - 1) left[std::countr_zero(on)] = Vec3f(0);
        met = on ? world.intersect(rays, false, RayKind::shadow) & on : 0;
    }
}

/// Takes from `left` what `lanes` of a packet, to a light at `tMax`, lose from hit to hit. Returns those that meet
/// anything, and in `clear` those that meet something clear first.
std::uint32_t followClear(const TraceScene& scene, const RayView& world, RayPacket16& rays, std::uint32_t lanes,
                          float tMax, bool coherent, RunsIn* in, std::uint32_t& clear, Vec3f* left) {
    for (int lane = 0; lane < 16; ++lane)
        if (!(lanes >> lane & 1u)) rays.skip(lane);
    const std::uint32_t met = world.intersect(rays, coherent, RayKind::shadow) & lanes;
    clear = 0;
    for (std::uint32_t rest = met; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        if (!letsThrough(scene, world.hit(rays, lane).instance)) continue;
        clear |= 1u << lane;
        left[lane] = Vec3f(1);
    }
    passClear(scene, world, rays, clear, tMax, in, left);
    return met;
}

/// The share of light that is left along a ray that nothing opaque stops.
Vec3f leftBehind(const TraceScene& scene, const Ray& ray, int lane, RunsIn in, ClearPath& clearPath) {
    Vec3f left(1);
    clearPath.visit(ray, lane, [&](const Hit& hit, std::span<const Hit> others) {
        left *= straightTransmittance(scene, hit, ray.direction, in.pass(scene, ray.direction, hit, others));
        const bool isBright = std::max({left.x, left.y, left.z}) > kMin;
        if (!isBright) left = Vec3f(0);
        return isBright;
    });
    return left;
}

/// Returns which rays, to a light at `tMax`, are blocked, and in `clear` which of them by a surface that may let light
/// through: `left` tells how much. `world`: the things that rays may hit; `in`: the media that they start in. A ray
/// that an opaque surface blocks needs no closer look, whatever else the scene contains.
std::uint32_t findBlocked(const TraceScene& scene, const RayView& world, RayPacket16& rays, std::uint32_t tested,
                          float tMax, bool coherent, RunsIn* in, std::uint32_t& clear, Vec3f* left) {
    clear = 0;
    const std::uint32_t near = nearClear(scene, rays, tested);
    if (!near) return world.occluded(rays, coherent) & tested;
    ClearPath clearPath(
        world,
        [](const void* asked, std::uint32_t slot) { return letsThrough(*static_cast<const TraceScene*>(asked), slot); },
        &scene);
    std::uint32_t unknown = 0;
    std::uint32_t blocked = clearPath.find(rays, coherent, RayKind::shadow, unknown) & tested;
    for (std::uint32_t rest = tested & ~blocked & ~unknown; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        if (!clearPath.passesAny(lane)) continue;
        clear |= 1u << lane;
        left[lane] = leftBehind(scene, rays.ray(lane), lane, in[lane], clearPath);
    }
    unknown &= tested;
    if (unknown) {
        for (std::uint32_t rest = unknown; rest; rest &= rest - 1) rays.tMax[std::countr_zero(rest)] = tMax;
        RayPacket16 alone = rays;
        std::uint32_t clearAlone = 0;
        blocked |= followClear(scene, world, alone, unknown, tMax, coherent, in, clearAlone, left);
        clear |= clearAlone;
    }
    return blocked | clear;
}

/// The share of light that passes the surface which a lane shows.
Vec3f throughOwn(const TraceScene& scene, const SurfacePacket& s, int lane) {
    std::optional<float> eta;
    if (s.material[lane]->refractiveIndex > 0) eta = s.eta[lane];
    return straightTransmittance(scene, s.hit(lane), -s.view.get(lane), eta);
}

void castShadows(const TraceScene& scene, const TraceLight& light, SurfacePacket& s, std::uint32_t mask,
                 Incoming& incoming, std::uint64_t& shadowRays) {
    RayPacket16 rays;
    std::uint32_t behind = 0;  // lanes whose own surface lies between them and the light
    findPoints(scene, s);
    const bool directional = light.kind == Light::Kind::directional;
    const std::uint32_t tested = packetKernels().shadowRays(light, s, incoming, mask, rays, behind);
    behind &= ~s.thin;
    if (!tested) return;
    const float tMax = directional ? std::numeric_limits<float>::infinity() : 1;
    Vec3f through[16], leftBehind[16];
    for (std::uint32_t rest = behind; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        through[lane] = scene.anyTransmits ? throughOwn(scene, s, lane) : Vec3f(0);
        if (through[lane] != Vec3f(0)) continue;
        if (const auto start = pointOnCurve(scene, s, lane)) {
            Ray ray = rays.ray(lane);
            if (light.kind == Light::Kind::point || light.kind == Light::Kind::spot ||
                light.kind == Light::Kind::projector)
                ray.direction = light.position - *start;
            ray.origin = *start;
            rays.set(lane, ray);
            behind &= ~(1u << lane);
        } else {
            rays.active[lane] = 0;
        }
    }
    shadowRays += static_cast<std::uint64_t>(std::popcount(tested));
    std::uint32_t clear = 0;
    const ViewOfLight world(scene, light);
    RunsIn in[16];
    if (s.media)
        for (std::uint32_t rest = tested; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            in[lane] = {s.media, behind >> lane & 1u ? s.beyond[lane] : s.within[lane]};
        }
    const std::uint32_t blocked = findBlocked(scene, *world, rays, tested, tMax, s.fromEye, in, clear, leftBehind);
    const std::uint32_t hazy =
        scene.volumes.empty() ? 0 : meetBox(rays, scene.volumeBounds) & tested & ~(blocked & ~clear);
    for (std::uint32_t rest = blocked | behind | hazy; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const bool free = !(blocked >> lane & 1u) && rays.active[lane];
        Vec3f left(free ? 1.0f : 0.0f);
        Ray ray = rays.ray(lane);
        ray.tMax = tMax;
        if (clear >> lane & 1u) left = leftBehind[lane];
        if ((hazy >> lane & 1u) && left != Vec3f(0)) left *= volumesLeft(scene, ray, light.scope);
        if (behind >> lane & 1u) left *= through[lane];
        incoming.visible.set(lane, Vec3f(1) - light.shadowIntensity * (Vec3f(1) - left));
    }
}

V8 turned(const glm::mat3& m, const V8& v) {
    const V8 to{m[0].x * v.x + m[1].x * v.y + m[2].x * v.z, m[0].y * v.x + m[1].y * v.y + m[2].y * v.z,
                m[0].z * v.x + m[1].z * v.y + m[2].z * v.z};
    return to * (1.0f / max(sqrt(dot(to, to)), all(1e-30f)));
}

/// Lights a packet's surfaces as an eye below an uneven scale sees them: by the angles of the eye's own space, so that
/// things below the same scale are lit as if it were not there. The sides of surfaces are the same in that space.
class InEyeSpace {
  public:
    InEyeSpace(const UnevenEye& eye, SurfacePacket& surfaces) : eye_(eye), s_(surfaces) {
        for (int at = 0; at < 16; at += 8) {
            storeV(normal_, at, turned(eye.normalToSquare, loadV(s_.normal, at)));
            storeV(view_, at, turned(eye.toSquare, loadV(s_.view, at)));
        }
    }
    /// Calls `reflect` while the packet and the incoming light are in that colour space.
    template <class Reflect>
    void with(Incoming& in, const Reflect& reflect) {
        std::swap(s_.normal, normal_), std::swap(s_.view, view_);
        for (int at = 0; at < 16; at += 8) {
            const V8 towards = turned(eye_.toSquare, loadV(in.direction, at));
            storeV(in.direction, at, towards);
            store(in.cosine + at, max(dot(loadV(s_.normal, at), towards), all(0)));
        }
        reflect();
        std::swap(s_.normal, normal_), std::swap(s_.view, view_);
    }

  private:
    const UnevenEye& eye_;
    SurfacePacket& s_;
    Lanes3 normal_, view_;
};

}  // namespace

Vec3f leftAlong(const TraceScene& scene, const RayView& world, Ray ray, RayKind kind, RunsIn in) {
    Vec3f left(1);
    const float tMax = ray.tMax;
    for (int step = 0; step < kMaxPassed; ++step) {
        Hit hit = world.intersect(ray, kind);
        if (!hit) return left;
        if (kind == RayKind::eye) hit = frontOf(scene, world, ray, hit, kind);
        const bool isNone = kind == RayKind::eye && isBackOfSolid(scene, hit, ray.direction);
        const Vec3f through =
            isNone ? Vec3f(1) : straightTransmittance(scene, hit, ray.direction, in.pass(scene, ray, hit));
        if (!passOn(scene, hit, through, tMax, ray, left)) return left;
    }
    return Vec3f(0);
}

void addLights(const TraceScene& scene, SurfacePacket& s, std::uint64_t& shadowRays, const RayWeights* weights) {
    const PacketKernels& kernels = packetKernels();
    kernels.addOwn(s);
    const LightGroups& all = scene.lightGroups;
    std::optional<InEyeSpace> uneven;
    if (scene.uneven) uneven.emplace(*scene.uneven, s);
    // Lanes that share their lights go together; nearly always all of them.
    for (std::uint32_t lit = s.mask & ~s.unlit; lit;) {
        const std::uint32_t start = all.start(s.lights[std::countr_zero(lit)]);
        std::uint32_t group = lit;
        if (!s.oneInstance) {
            group = 0;
            for (std::uint32_t rest = lit; rest; rest &= rest - 1) {
                const int lane = std::countr_zero(rest);
                group |= static_cast<std::uint32_t>(all.start(s.lights[lane]) == start) << lane;
            }
        }
        lit &= ~group;
        const std::uint32_t phong = group & ~s.physical, physical = group & s.physical;
        const bool shiny = (phong & s.shiny) != 0;
        for (std::uint32_t at = start; at != LightGroups::kEnd; at = all.next(at))
            for (const TraceLight& light : all.lightsOf(at)) {
                if (!light.shadows && !light.picture && !physical && !uneven) {
                    kernels.shinePhong(light, phong, shiny, s);
                    continue;
                }
                Incoming in;
                if (!(light.picture ? gatherProjected(light, s, in) : kernels.gather(light, s, in))) continue;
                if (light.shadows) {
                    std::uint32_t shadowed = group;
                    if (weights && !light.picture && !uneven)
                        shadowed &= ~(phong & kernels.faint(light, in, weights->of, weights->minimum, shiny, s));
                    if (shadowed) castShadows(scene, light, s, shadowed, in, shadowRays);
                }
                if (light.picture) tint(scene, light, s, in);
                const auto reflect = [&] {
                    if (phong) kernels.addPhong(light, in, phong, shiny, s);
                    if (physical) kernels.addPhysical(light, in, physical, s);
                };
                if (uneven)
                    uneven->with(in, reflect);
                else
                    reflect();
            }
    }
}

}  // namespace rtsg::trace
