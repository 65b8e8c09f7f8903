// Tracing: from the tree over everything into Embree's BVHs.
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>

#include "embree_bvh.h"

namespace rtsg::bvh {

// ---- following ----------------------------------------------------------------------------------------------------

void Top::Object::setTransform(const WorldFromLocal& m) {
    localFromRay = glm::mat3(glm::inverse(glm::dmat3(m[0], m[1], m[2])));
    translation = Vec3f(m[3]);
}

std::uint32_t Top::newObject() {
    if (free_.empty()) {
        objects_.emplace_back();
        return static_cast<std::uint32_t>(objects_.size() - 1);
    }
    const std::uint32_t object = free_.back();
    free_.pop_back();
    objects_[object] = {};
    return object;
}

std::uint32_t Top::addInstance(std::uint32_t slot, RTCScene mesh, const WorldFromLocal& rayFromLocal,
                               const InstanceTree::Box& box, std::uint32_t mask) {
    const std::uint32_t object = newObject();
    objects_[object].setTransform(rayFromLocal);
    objects_[object].scene = mesh;
    objects_[object].slot = slot;
    objects_[object].mask = mask;
    tree_.set(object, box);
    return object;
}

void Top::moveInstance(std::uint32_t object, const WorldFromLocal& rayFromLocal, const InstanceTree::Box& box) {
    objects_[object].setTransform(rayFromLocal);
    tree_.set(object, box);
}

void Top::changeMesh(std::uint32_t object, RTCScene mesh, const InstanceTree::Box& box) {
    objects_[object].scene = mesh;
    tree_.set(object, box);
}

std::uint32_t Top::addGroup(const Group& group) {
    const std::uint32_t object = newObject();
    objects_[object].group = &group;
    updateGroup(object, group);
    return object;
}

void Top::updateGroup(std::uint32_t object, const Group& group) {
    objects_[object].scene = group.scene();
    const InstanceTree::Box& box = group.box();
    if (group.live() > group.hidden() && box.lower.x <= box.upper.x)
        tree_.set(object, box);
    else
        tree_.remove(object);
}

void Top::remove(std::uint32_t object) {
    tree_.remove(object);
    objects_[object] = {};
    free_.push_back(object);
}

void Top::commit() {
    tree_.commit();
    direct_ = tree_.size() == 1 ? objects_[tree_.only()].group : nullptr;
}

// ---- single rays --------------------------------------------------------------------------------------------------

void Top::intersect(const Ray& ray, RTCRayHit& r, RTCIntersectContext& context) const {
    if (direct_) {
        rtcIntersect1(direct_->scene(), &context, &r);
        return;
    }
    tree_.traverse(ray, [&](std::uint32_t index) {
        const Object& object = objects_[index];
        if (object.group) {
            rtcIntersect1(object.scene, &context, &r);
            if (!(r.hit.geomID & kMapped)) {  // neither a miss nor a hit mapped earlier
                r.hit.instID[0] = object.group->slots()[r.hit.geomID];
                r.hit.geomID = kMapped;
            }
            return r.ray.tfar;
        }
        if (!(object.mask & r.ray.mask)) return r.ray.tfar;
        RTCRayHit local = r;
        const Vec3f o = object.localFromRay * (ray.origin - object.translation);
        const Vec3f d = object.localFromRay * ray.direction;
        local.ray.org_x = o.x, local.ray.org_y = o.y, local.ray.org_z = o.z;
        local.ray.dir_x = d.x, local.ray.dir_y = d.y, local.ray.dir_z = d.z;
        local.ray.mask = ~0u;
        local.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(object.scene, &context, &local);
        if (local.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
            r.ray.tfar = local.ray.tfar;
            r.hit = local.hit;
            r.hit.geomID = kMapped;
            r.hit.instID[0] = object.slot;
        }
        return r.ray.tfar;
    });
}

bool Top::occluded(const Ray& ray, RTCRay& r, RTCIntersectContext& context) const {
    if (direct_) {
        rtcOccluded1(direct_->scene(), &context, &r);
        return r.tfar < 0;
    }
    tree_.traverse(ray, [&](std::uint32_t index) {
        const Object& object = objects_[index];
        if (object.group) {
            rtcOccluded1(object.scene, &context, &r);
            return r.tfar;
        }
        if (!(object.mask & r.mask)) return r.tfar;
        RTCRay local = r;
        const Vec3f o = object.localFromRay * (ray.origin - object.translation);
        const Vec3f d = object.localFromRay * ray.direction;
        local.org_x = o.x, local.org_y = o.y, local.org_z = o.z;
        local.dir_x = d.x, local.dir_y = d.y, local.dir_z = d.z;
        local.mask = ~0u;
        rtcOccluded1(object.scene, &context, &local);
        return r.tfar = local.tfar;
    });
    return r.tfar < 0;
}

// ---- packets ------------------------------------------------------------------------------------------------------

namespace {

/// Writes the rays into the object's frame; `local` is one of Embree's packets.
template <class Packet>
void transformPacket(const RayPacket16& rays, const glm::mat3& m, const Vec3f& translation, Packet& local) {
    for (int at = 0; at < 16; at += 8) {
        const simd::F8 ox = simd::load(rays.originX + at) - translation.x;
        const simd::F8 oy = simd::load(rays.originY + at) - translation.y;
        const simd::F8 oz = simd::load(rays.originZ + at) - translation.z;
        const simd::F8 dx = simd::load(rays.directionX + at), dy = simd::load(rays.directionY + at),
                       dz = simd::load(rays.directionZ + at);
        simd::store(local.org_x + at, m[0].x * ox + m[1].x * oy + m[2].x * oz);
        simd::store(local.org_y + at, m[0].y * ox + m[1].y * oy + m[2].y * oz);
        simd::store(local.org_z + at, m[0].z * ox + m[1].z * oy + m[2].z * oz);
        simd::store(local.dir_x + at, m[0].x * dx + m[1].x * dy + m[2].x * dz);
        simd::store(local.dir_y + at, m[0].y * dx + m[1].y * dy + m[2].y * dz);
        simd::store(local.dir_z + at, m[0].z * dx + m[1].z * dy + m[2].z * dz);
        simd::store(local.tnear + at, simd::load(rays.tMin + at));
        simd::store(local.tfar + at, simd::load(rays.tMax + at));
    }
    for (int i = 0; i < 16; ++i) {
        local.time[i] = 0;
        local.mask[i] = ~0u;
        local.id[i] = 0;
        local.flags[i] = 0;
    }
}

}  // namespace

void Top::intersect(RayPacket16& rays, std::int32_t* valid, RTCIntersectContext& context) const {
    auto& packet = reinterpret_cast<RTCRayHit16&>(rays);
    if (direct_) {
        rtcIntersect16(valid, direct_->scene(), &context, &packet);
        return;
    }
    tree_.traverse(rays, valid, [&](std::uint32_t index, const std::int32_t* lanes) {
        const Object& object = objects_[index];
        if (object.group) {
            rtcIntersect16(lanes, object.scene, &context, &packet);
            std::uint32_t fresh = 0;
            for (int i = 0; i < 16; ++i) fresh |= (rays.geom_[i] >> 31 ^ 1u) << i;
            for (; fresh; fresh &= fresh - 1) {
                const int i = std::countr_zero(fresh);
                rays.inst_[i] = object.group->slots()[rays.geom_[i]];
                rays.geom_[i] = kMapped;
            }
            return;
        }
        if (!(object.mask & rays.mask_[0])) return;
        RTCRayHit16 local;
        transformPacket(rays, object.localFromRay, object.translation, local.ray);
        for (int i = 0; i < 16; ++i) local.hit.geomID[i] = local.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect16(lanes, object.scene, &context, &local);
        std::uint32_t fresh = 0;
        for (int i = 0; i < 16; ++i)
            fresh |= static_cast<std::uint32_t>(local.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) << i;
        for (; fresh; fresh &= fresh - 1) {
            const int i = std::countr_zero(fresh);
            rays.tMax[i] = local.ray.tfar[i];
            rays.normalX_[i] = local.hit.Ng_x[i];
            rays.normalY_[i] = local.hit.Ng_y[i];
            rays.normalZ_[i] = local.hit.Ng_z[i];
            rays.u_[i] = local.hit.u[i];
            rays.v_[i] = local.hit.v[i];
            rays.prim_[i] = local.hit.primID[i];
            rays.geom_[i] = kMapped;
            rays.inst_[i] = object.slot;
        }
    });
}

void Top::occluded(RayPacket16& rays, std::int32_t* valid, RTCIntersectContext& context) const {
    auto& packet = reinterpret_cast<RTCRay16&>(rays);
    if (direct_) {
        rtcOccluded16(valid, direct_->scene(), &context, &packet);
        return;
    }
    // A blocked lane's segment ends before it begins, so that it meets no further box.
    tree_.traverse(rays, valid, [&](std::uint32_t index, const std::int32_t* lanes) {
        const Object& object = objects_[index];
        if (object.group) {
            rtcOccluded16(lanes, object.scene, &context, &packet);
            return;
        }
        if (!(object.mask & rays.mask_[0])) return;
        RTCRay16 local;
        transformPacket(rays, object.localFromRay, object.translation, local);
        rtcOccluded16(lanes, object.scene, &context, &local);
        for (int i = 0; i < 16; ++i)
            if (lanes[i] && local.tfar[i] < 0) rays.tMax[i] = -std::numeric_limits<float>::infinity();
    });
}

}  // namespace rtsg::bvh
