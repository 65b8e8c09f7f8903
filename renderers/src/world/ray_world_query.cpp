// Queries: what every ray of light, sound and picking goes through. Nothing here allocates or locks.
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "mesh/simd8.h"
#include "ray_world_impl.h"

namespace rtsg {

namespace {

constexpr float kShortest = 1e-12f, kLongest = 1e9f;

/// False for NaN and infinity anywhere but in tMax, which may be infinite.
inline bool acceptable(float ox, float oy, float oz, float tMin, float dx, float dy, float dz, float tMax) {
    const float reach = std::max(std::max(std::abs(ox), std::abs(oy)), std::abs(oz));
    const float length = std::max(std::max(std::abs(dx), std::abs(dy)), std::abs(dz));
    // std::max drops a NaN in its second argument, so sums look for them.
    const float sum = (ox - ox) + (oy - oy) + (oz - oz) + (dx - dx) + (dy - dy) + (dz - dz);
    return (sum == 0) & (reach <= RayWorld::kMaxCoordinate) & (length >= kShortest) & (length <= kLongest) &
           (tMin >= 0) & (tMin < HUGE_VALF) & (tMax >= 0);
}

// RayPacket16 is laid out as Embree's packets, so that rays are traced where they are.
static_assert(offsetof(RayPacket16, tMax) == offsetof(RTCRayHit16, ray.tfar));
static_assert(offsetof(RayPacket16, mask_) == offsetof(RTCRayHit16, ray.mask));
static_assert(offsetof(RayPacket16, directionX) == offsetof(RTCRayHit16, ray.dir_x));
static_assert(offsetof(RayPacket16, normalX_) == offsetof(RTCRayHit16, hit.Ng_x));
static_assert(offsetof(RayPacket16, prim_) == offsetof(RTCRayHit16, hit.primID));
static_assert(offsetof(RayPacket16, inst_) == offsetof(RTCRayHit16, hit.instID));
static_assert(sizeof(RTCRayHit16) == offsetof(RayPacket16, active));

/// Completes the packet; lanes that must not be traced are inactive in `valid`. Returns the number of bad rays.
inline int prepare(RayPacket16& rays, std::int32_t* valid, RayKind kind) {
    int bad = 0;
    for (int i = 0; i < 16; ++i) {
        const bool ok = acceptable(rays.originX[i], rays.originY[i], rays.originZ[i], rays.tMin[i], rays.directionX[i],
                                   rays.directionY[i], rays.directionZ[i], rays.tMax[i]);
        valid[i] = ok ? rays.active[i] : 0;
        bad += !ok & (rays.active[i] != 0);
        rays.time_[i] = 0;
        rays.mask_[i] = static_cast<std::uint32_t>(kind);
        rays.id_[i] = 0;
        rays.flags_[i] = 0;
        rays.geom_[i] = RTC_INVALID_GEOMETRY_ID;
        rays.inst_[i] = RTC_INVALID_GEOMETRY_ID;
    }
    return bad;
}

inline RTCIntersectContext makeContext(bool coherent) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    return context;
}

inline void fill(RTCRay& target, const Ray& ray, RayKind kind) {
    target.org_x = ray.origin.x, target.org_y = ray.origin.y, target.org_z = ray.origin.z;
    target.dir_x = ray.direction.x, target.dir_y = ray.direction.y, target.dir_z = ray.direction.z;
    target.tnear = ray.tMin, target.tfar = ray.tMax;
    target.time = 0, target.mask = static_cast<std::uint32_t>(kind), target.id = 0, target.flags = 0;
}

inline bool acceptable(const Ray& ray) {
    return acceptable(ray.origin.x, ray.origin.y, ray.origin.z, ray.tMin, ray.direction.x, ray.direction.y,
                      ray.direction.z, ray.tMax);
}

}  // namespace

Hit RayWorld::Impl::resolve(float t, float u, float v, Vec3f normal, std::uint32_t triangle, std::uint32_t geometryId,
                            std::uint32_t instanceId) const {
    Hit hit;
    if (geometryId == RTC_INVALID_GEOMETRY_ID) return hit;
    hit.t = t, hit.u = u, hit.v = v, hit.triangle = triangle;
    hit.instance = top.slotOf(geometryId, instanceId);
    const RayInstance& instance = world->instances_[hit.instance];
    // Instances report the normal in their own frame; merged triangles were turned inside out by a mirroring.
    const Place& place = places[hit.instance];
    if (place.kind == Kind::instanced) {
        normal = instance.normalFromLocal * normal;
    } else {
        if (place.kind == Kind::body) normal = place.cluster->normalFromBody * normal;
        if (instance.sign < 0) normal = -normal;
    }
    const float size = std::max(std::max(std::abs(normal.x), std::abs(normal.y)), std::abs(normal.z));
    if (size > 0) normal /= size;  // so that squares neither overflow nor vanish
    const float length = std::sqrt(glm::dot(normal, normal));
    hit.normal = length > 0 ? normal / length : Vec3f(0, 0, 1);
    return hit;
}

Hit RayWorld::intersect(const Ray& ray, RayKind kind) const {
    if (!acceptable(ray)) [[unlikely]] {
        impl_->badRays.fetch_add(1, std::memory_order_relaxed);
        return {};
    }
    RTCRayHit r;
    fill(r.ray, ray, kind);
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context = makeContext(false);
    impl_->top.intersect(ray, r, context);
    return impl_->resolve(r.ray.tfar, r.hit.u, r.hit.v, {r.hit.Ng_x, r.hit.Ng_y, r.hit.Ng_z}, r.hit.primID,
                          r.hit.geomID, r.hit.instID[0]);
}

bool RayWorld::occluded(const Ray& ray, RayKind kind) const {
    if (!acceptable(ray)) [[unlikely]] {
        impl_->badRays.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    RTCRay r;
    fill(r, ray, kind);
    RTCIntersectContext context = makeContext(false);
    return impl_->top.occluded(ray, r, context);
}

std::uint32_t RayWorld::intersect(RayPacket16& rays, bool coherent, RayKind kind) const {
    alignas(64) std::int32_t valid[16];
    if (const int bad = prepare(rays, valid, kind); bad > 0) [[unlikely]]
        impl_->badRays.fetch_add(static_cast<std::uint64_t>(bad), std::memory_order_relaxed);
    RTCIntersectContext context = makeContext(coherent);
    impl_->top.intersect(rays, valid, context);
    std::uint32_t hits = 0;
    for (int i = 0; i < 16; ++i) hits |= static_cast<std::uint32_t>(rays.geom_[i] != RTC_INVALID_GEOMETRY_ID) << i;
    return hits;
}

std::uint32_t RayWorld::occluded(RayPacket16& rays, bool coherent, RayKind kind) const {
    alignas(64) std::int32_t valid[16];
    if (const int bad = prepare(rays, valid, kind); bad > 0) [[unlikely]]
        impl_->badRays.fetch_add(static_cast<std::uint64_t>(bad), std::memory_order_relaxed);
    RTCIntersectContext context = makeContext(coherent);
    impl_->top.occluded(rays, valid, context);
    std::uint32_t blocked = 0;
    for (int i = 0; i < 16; ++i) blocked |= static_cast<std::uint32_t>((valid[i] != 0) & (rays.tMax[i] < 0)) << i;
    return blocked;
}

Hit RayWorld::hit(const RayPacket16& rays, int lane) const {
    return impl_->resolve(rays.tMax[lane], rays.u_[lane], rays.v_[lane],
                          {rays.normalX_[lane], rays.normalY_[lane], rays.normalZ_[lane]}, rays.prim_[lane],
                          rays.geom_[lane], rays.inst_[lane]);
}

void RayWorld::hits(const RayPacket16& rays, std::uint32_t mask, PacketHits16& out) const {
    std::memcpy(out.normalX, rays.normalX_, 3 * sizeof out.normalX);  // three arrays in a row, in both
    std::memcpy(out.u, rays.u_, 2 * sizeof out.u);
    std::memcpy(out.triangle, rays.prim_, sizeof out.triangle);
    for (; mask; mask &= mask - 1) {
        const int i = std::countr_zero(mask);
        const std::uint32_t slot = impl_->top.slotOf(rays.geom_[i], rays.inst_[i]);
        out.instance[i] = slot;
        const RayInstance& instance = instances_[slot];
        const Impl::Place& place = impl_->places[slot];
        if (place.kind != Impl::Kind::resting) {
            Vec3f n(out.normalX[i], out.normalY[i], out.normalZ[i]);
            n = place.kind == Impl::Kind::instanced
                    ? instance.normalFromLocal * n
                    : place.cluster->normalFromBody * n * static_cast<float>(instance.sign);
            out.normalX[i] = n.x, out.normalY[i] = n.y, out.normalZ[i] = n.z;
        } else if (instance.sign < 0) {
            out.normalX[i] = -out.normalX[i], out.normalY[i] = -out.normalY[i], out.normalZ[i] = -out.normalZ[i];
        }
    }
    for (int at = 0; at < 16; at += 8) {
        using namespace simd;
        F8 x = load(out.normalX + at), y = load(out.normalY + at), z = load(out.normalZ + at);
        const F8 size = max(max(max(x, -x), max(y, -y)), max(z, -z));
        const F8 scale = 1.0f / max(size, all(1e-38f));  // so that squares neither overflow nor vanish
        x *= scale, y *= scale, z *= scale;
        const F8 squared = x * x + y * y + z * z;
        const I8 good = squared > 0.0f;
        const F8 inverse = 1.0f / sqrt(select(good, squared, all(1)));
        store(out.normalX + at, select(good, x * inverse, all(0)));
        store(out.normalY + at, select(good, y * inverse, all(0)));
        store(out.normalZ + at, select(good, z * inverse, all(1)));
    }
}

void RayWorld::visitNear(const Vec3f& center, float radius, const NearVisitor& visit) const {
    impl_->top.visitNear(center, radius, visit);
}

HitPoint RayWorld::point(const Hit& hit) const {
    HitPoint result;
    result.normal = hit.normal;
    if (!hit) return result;
    const RayInstance& instance = instances_[hit.instance];
    const Mesh& mesh = *instance.mesh;
    const float w = 1 - hit.u - hit.v;
    const Vec3f a = w * mesh.vertex(hit.triangle, 0), b = hit.u * mesh.vertex(hit.triangle, 1),
                c = hit.v * mesh.vertex(hit.triangle, 2);
    const Vec3f local = a + b + c, size = glm::abs(a) + glm::abs(b) + glm::abs(c);
    const glm::mat4x3& m = instance.rayFromLocal;
    result.position = m * Vec4f(local, 1);
    // gamma(n) = n eps / (1 - n eps) bounds n roundings (Higham; pbrt-v4, section 6.8.1): four for the barycentric sum,
    // four for the transform here, and as many again for how the ray met the triangle: rounded into ray space, or
    // through a transformed ray, whose errors the condition of the matrix magnifies on their way back.
    constexpr float eps = 0x1p-24f, gamma = 12 * eps / (1 - 12 * eps);
    const Vec3f linear = glm::abs(m[0]) * size.x + glm::abs(m[1]) * size.y + glm::abs(m[2]) * size.z;
    result.error = (linear * instance.errorScale + glm::abs(m[3])) * gamma + instance.errorFloor;
    return result;
}

Vec3f RayWorld::leave(const HitPoint& from, const Vec3f& direction) {
    // pbrt-v4, section 6.8.6: far enough along the normal to clear the box of the error, then one float further.
    const float distance = glm::dot(glm::abs(from.normal), from.error);
    const Vec3f away = glm::dot(direction, from.normal) < 0 ? -from.normal : from.normal;
    Vec3f start = from.position + distance * away;
    for (int i = 0; i < 3; ++i) {
        if (away[i] == 0) continue;
        start[i] = std::nextafter(start[i], std::copysign(HUGE_VALF, away[i]));
        // On a plane through 0 nothing is rounded and the next float is one that the processor may take for 0.
        constexpr float least = 1e-30f;
        if (std::abs(start[i]) < least) start[i] = std::copysign(least, away[i]);
    }
    return start;
}

}  // namespace rtsg
