// Tracing: from the tree over everything into Embree's BVHs. Nothing here allocates or locks.
#include <bit>
#include <cstddef>
#include <cstring>
#include <utility>

#include "passed_hits.h"
#include "top.h"
#include "trees/rays_together.h"

namespace rtsg::bvh {

namespace {

static_assert(kNoInstance == RTC_INVALID_GEOMETRY_ID);

// ---- single rays --------------------------------------------------------------------------------------------------

inline void fill(RTCRay& target, const Ray& ray, std::uint32_t mask) {
    target.org_x = ray.origin.x, target.org_y = ray.origin.y, target.org_z = ray.origin.z;
    target.dir_x = ray.direction.x, target.dir_y = ray.direction.y, target.dir_z = ray.direction.z;
    target.tnear = ray.tMin, target.tfar = ray.tMax;
    target.time = 0, target.mask = mask, target.id = 0, target.flags = 0;
}

// Rays are traced where they are: put into the object's frame, and back from what they were made of.

void enter(const TopObject& object, const Ray& ray, RTCRay& r) {
    const Vec3f o = object.localFromRay * (ray.origin - object.translation);
    const Vec3f d = object.localFromRay * ray.direction;
    r.org_x = o.x, r.org_y = o.y, r.org_z = o.z;
    r.dir_x = d.x, r.dir_y = d.y, r.dir_z = d.z;
}

void leave(const Ray& ray, RTCRay& r) {
    r.org_x = ray.origin.x, r.org_y = ray.origin.y, r.org_z = ray.origin.z;
    r.dir_x = ray.direction.x, r.dir_y = ray.direction.y, r.dir_z = ray.direction.z;
}

/// Goes with rays that pass some hits: hits on hidden things, and hits that are noted.
struct Passing {
    const TopView& top;
    const RayFilter* hider;
    PassedHits* passed;  // null: none are
};

void note(const RTCFilterFunctionNArguments& asked, unsigned i, std::uint32_t geometry, std::uint32_t object,
          PassedHits& passed) {
    const unsigned size = asked.N, lane = RTCRayN_id(asked.ray, size, i);
    if (passed.count[lane] == PassedHits::kMax) {
        passed.many |= 1u << lane;
        return;
    }
    passed.hits[lane][passed.count[lane]++] = {
        RTCRayN_tfar(asked.ray, size, i),
        RTCHitN_u(asked.hit, size, i),
        RTCHitN_v(asked.hit, size, i),
        {RTCHitN_Ng_x(asked.hit, size, i), RTCHitN_Ng_y(asked.hit, size, i), RTCHitN_Ng_z(asked.hit, size, i)},
        RTCHitN_primID(asked.hit, size, i),
        geometry,
        object};
    asked.valid[i] = 0;
}

/// Embree asks whether hits count.
void passHits(const RTCFilterFunctionNArguments* asked) {
    const auto& [top, hider, passed] = *static_cast<const Passing*>(RayCast::contextOf(*asked));
    const unsigned size = asked->N;
    for (unsigned i = 0; i < size; ++i) {
        if (asked->valid[i] == 0) continue;
        const std::uint32_t object = RTCHitN_instID(asked->hit, size, i, 0);
        const std::uint32_t geometry = RTCHitN_geomID(asked->hit, size, i);
        const std::uint32_t slot = top.objectOf(object).slotOf(geometry);
        if (hider && hider->hides(slot))
            asked->valid[i] = 0;
        else if (passed && passed->passes(passed->asked, slot))
            note(*asked, i, geometry, object, *passed);
    }
}

inline RawHit rawHit(const RTCRayHit& r) {
    return {r.ray.tfar,   r.hit.u,      r.hit.v,        {r.hit.Ng_x, r.hit.Ng_y, r.hit.Ng_z},
            r.hit.primID, r.hit.geomID, r.hit.instID[0]};
}

}  // namespace

void TopView::restore(RawHit& hit) const {
    if (!hit) return;
    const TopObject& o = objectOf(hit.objectId);
    const LongTriangles* cut = o.cuts ? o.cuts[hit.geometryId] : nullptr;
    if (cut) cut->restore(hit.triangle, hit.u, hit.v, hit.normal.x, hit.normal.y, hit.normal.z);
}

void TopView::restore(RayPacket16& rays, std::uint32_t hits) const {
    for (; hits; hits &= hits - 1) {
        const int i = std::countr_zero(hits);
        const TopObject& o = objectOf(rays.inst_[i]);
        const LongTriangles* cut = o.cuts ? o.cuts[rays.geom_[i]] : nullptr;
        if (cut)
            cut->restore(rays.prim_[i], rays.u_[i], rays.v_[i], rays.normalX_[i], rays.normalY_[i], rays.normalZ_[i]);
    }
}

void TopView::restore(PassedHits& passed) const {
    for (int lane = 0; lane < 16; ++lane)
        for (std::uint32_t i = 0; i < passed.count[lane]; ++i) restore(passed.hits[lane][i]);
}

RawHit TopView::intersect(const Ray& ray, RayKind kind, const RayFilter* hider) const {
    const auto found = [this](const RTCRayHit& r) {
        RawHit hit = rawHit(r);
        if (hasCuts_) restore(hit);
        return hit;
    };
    RTCRayHit r;
    fill(r.ray, ray, maskOf(kind));
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    RayCast cast(false);
    Passing passing{*this, hider, nullptr};
    if (hider) cast.ask(passHits, &passing);
    if (main_) {
        cast.intersect(main_->scene, r);
        if (tree_.empty()) return found(r);
    }
    Ray rest = ray;
    rest.tMax = r.ray.tfar;
    tree_.traverse(rest, [&](std::uint32_t index) {
        const TopObject& o = object(index);
        cast.setInstance(index);
        if (o.resting) {
            cast.intersect(o.scene, r);
        } else {
            if (!(o.mask & r.ray.mask)) return r.ray.tfar;
            enter(o, ray, r.ray);
            cast.intersect(o.scene, r);
            leave(ray, r.ray);
        }
        return r.ray.tfar;
    });
    return found(r);
}

bool TopView::occluded(const Ray& ray, RayKind kind, const RayFilter* hider) const {
    RTCRay r;
    fill(r, ray, maskOf(kind));
    RayCast cast(false);
    Passing passing{*this, hider, nullptr};
    if (hider) cast.ask(passHits, &passing);
    if (main_) {
        cast.occluded(main_->scene, r);
        if (r.tfar < 0 || tree_.empty()) return r.tfar < 0;
    }
    tree_.traverse(ray, [&](std::uint32_t index) {
        const TopObject& o = object(index);
        cast.setInstance(index);
        if (o.resting) {
            cast.occluded(o.scene, r);
            return r.tfar;
        }
        if (!(o.mask & r.mask)) return r.tfar;
        enter(o, ray, r);
        cast.occluded(o.scene, r);
        leave(ray, r);
        return r.tfar;
    });
    return r.tfar < 0;
}

// ---- packets ------------------------------------------------------------------------------------------------------

namespace {

// RayPacket16 is laid out as Embree's packets, so that rays are traced where they are.
static_assert(offsetof(RayPacket16, tMax) == offsetof(RTCRayHit16, ray.tfar));
static_assert(offsetof(RayPacket16, mask_) == offsetof(RTCRayHit16, ray.mask));
static_assert(offsetof(RayPacket16, directionX) == offsetof(RTCRayHit16, ray.dir_x));
static_assert(offsetof(RayPacket16, normalX_) == offsetof(RTCRayHit16, hit.Ng_x));
static_assert(offsetof(RayPacket16, prim_) == offsetof(RTCRayHit16, hit.primID));
static_assert(offsetof(RayPacket16, inst_) == offsetof(RTCRayHit16, hit.instID));
static_assert(sizeof(RTCRayHit16) <= offsetof(RayPacket16, active));

/// The rays of a packet in an object's frame; in their own again when this ends.
class Entered {
  public:
    Entered(RayPacket16& rays, const glm::mat3& m, const Vec3f& translation) : rays_(rays) {
        for (int at = 0; at < 16; at += 8) {
            const auto take = [&](int k, const float* from) {
                const simd::F8 v = simd::load(from + at);
                simd::store(saved_[k] + at, v);
                return v;
            };
            const simd::F8 x = take(0, rays.originX), y = take(1, rays.originY), z = take(2, rays.originZ);
            const simd::F8 dx = take(3, rays.directionX), dy = take(4, rays.directionY), dz = take(5, rays.directionZ);
            const simd::F8 ox = x - translation.x, oy = y - translation.y, oz = z - translation.z;
            simd::store(rays.originX + at, m[0].x * ox + m[1].x * oy + m[2].x * oz);
            simd::store(rays.originY + at, m[0].y * ox + m[1].y * oy + m[2].y * oz);
            simd::store(rays.originZ + at, m[0].z * ox + m[1].z * oy + m[2].z * oz);
            simd::store(rays.directionX + at, m[0].x * dx + m[1].x * dy + m[2].x * dz);
            simd::store(rays.directionY + at, m[0].y * dx + m[1].y * dy + m[2].y * dz);
            simd::store(rays.directionZ + at, m[0].z * dx + m[1].z * dy + m[2].z * dz);
        }
    }
    ~Entered() {
        float* const targets[] = {rays_.originX,    rays_.originY,    rays_.originZ,
                                  rays_.directionX, rays_.directionY, rays_.directionZ};
        for (int k = 0; k < 6; ++k) std::memcpy(targets[k], saved_[k], sizeof saved_[k]);
    }
    Entered(const Entered&) = delete;
    Entered& operator=(const Entered&) = delete;

  private:
    RayPacket16& rays_;
    alignas(64) float saved_[6][16];
};

/// Fills in the members of a packet that the caller leaves to us.
inline void complete(RayPacket16& rays, std::uint32_t mask) {
    for (int i = 0; i < 16; ++i) {
        rays.time_[i] = 0;
        rays.mask_[i] = mask;
        rays.id_[i] = 0;
        rays.flags_[i] = 0;
        rays.geom_[i] = RTC_INVALID_GEOMETRY_ID;
        rays.inst_[i] = RTC_INVALID_GEOMETRY_ID;
    }
}

// Sums of squares: of unit directions' ranges, and of origins' as shares of the world's diagonal. Far apart, rays make
// a frustum that meets more boxes than each by itself; measured with mirrors, lamps and the scenes of `bench frames`.
constexpr float kParallel = .4f, kNearby = 1e-4f;

/// Those of sound come from all over a room.
bool mayRunTogether(RayKind kind) {
    return kind != RayKind::sound;
}

}  // namespace

bool TopView::runTogether(const RayPacket16& rays, const std::int32_t* valid) const {
    return bvh::runTogether(rays, valid, kParallel, nearby_);
}

void TopView::setSize(const InstanceTree::Box& box) {
    const Vec3f diagonal = box.upper - box.lower;
    nearby_ = kNearby * glm::dot(diagonal, diagonal);
}

std::uint32_t TopView::intersect(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind,
                                 const PrimaryBlock* known, const RayFilter* hider) const {
    complete(rays, maskOf(kind));
    auto& packet = reinterpret_cast<RTCRayHit16&>(rays);
    const bool isMet = main_ && known && known->meet(valid, rays);
    if (isMet && tree_.empty()) return metBy(rays);
    RayCast cast(coherent || (mayRunTogether(kind) && runTogether(rays, valid)));
    Passing passing{*this, hider, nullptr};
    if (hider) cast.ask(passHits, &passing);
    if (main_ && !isMet) cast.intersect(valid, main_->scene, packet);
    if (!tree_.empty()) {
        tree_.traverse(rays, valid, [&](std::uint32_t index, const std::int32_t* lanes) {
            const TopObject& o = object(index);
            cast.setInstance(index);
            if (o.resting) {
                cast.intersect(lanes, o.scene, packet);
            } else {
                if (!(o.mask & rays.mask_[0])) return;
                const Entered entered(rays, o.localFromRay, o.translation);
                cast.intersect(lanes, o.scene, packet);
            }
        });
    }
    return metBy(rays);
}

std::uint32_t TopView::metBy(RayPacket16& rays) const {
    std::uint32_t hits = 0;
    for (int i = 0; i < 16; ++i) hits |= static_cast<std::uint32_t>(rays.geom_[i] != RTC_INVALID_GEOMETRY_ID) << i;
    if (hasCuts_) restore(rays, hits);
    return hits;
}

std::uint32_t TopView::occluded(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind,
                                PassedHits* passed, const RayFilter* hider) const {
    complete(rays, maskOf(kind));
    RayCast cast(kOccludesCoherently && (coherent || (mayRunTogether(kind) && runTogether(rays, valid))));
    Passing passing{*this, hider, passed};
    if (passed)
        for (std::uint32_t lane = 0; lane < 16; ++lane) rays.id_[lane] = lane;
    if (passed || hider) cast.ask(passHits, &passing);
    auto& packet = reinterpret_cast<RTCRay16&>(rays);
    if (main_) cast.occluded(valid, main_->scene, packet);
    if (!tree_.empty()) {
        // A blocked lane's segment ends before it begins, so that it meets no further box.
        tree_.traverse(rays, valid, [&](std::uint32_t index, const std::int32_t* lanes) {
            const TopObject& o = object(index);
            cast.setInstance(index);
            if (o.resting) {
                cast.occluded(lanes, o.scene, packet);
                return;
            }
            if (!(o.mask & rays.mask_[0])) return;
            const Entered entered(rays, o.localFromRay, o.translation);
            cast.occluded(lanes, o.scene, packet);
        });
    }
    std::uint32_t blocked = 0;
    for (int i = 0; i < 16; ++i) blocked |= static_cast<std::uint32_t>((valid[i] != 0) & (rays.tMax[i] < 0)) << i;
    if (passed && hasCuts_) restore(*passed);
    return blocked;
}

}  // namespace rtsg::bvh
