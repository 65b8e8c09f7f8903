// Tracing: from the tree over everything into Embree's BVHs.
#include <cstring>
#include <utility>

#include "bvh.h"
#include "packet_avx512.h"

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

void Top::move(std::uint32_t object, const WorldFromLocal& rayFromLocal, const InstanceTree::Box& box) {
    objects_[object].setTransform(rayFromLocal);
    tree_.set(object, box);
}

void Top::changeMesh(std::uint32_t object, RTCScene mesh, const InstanceTree::Box& box) {
    objects_[object].scene = mesh;
    tree_.set(object, box);
}

std::uint32_t Top::addGroup(const Group& group) {
    const std::uint32_t object = newObject();
    objects_[object].resting = &group;
    resting_.push_back(object);
    updateGroup(object);
    return object;
}

std::uint32_t Top::addBody(const Group& group, const std::uint32_t* slots, const WorldFromLocal& rayFromGroup,
                           const InstanceTree::Box& box) {
    const std::uint32_t object = newObject();
    objects_[object].setTransform(rayFromGroup);
    objects_[object].scene = group.scene();
    objects_[object].slots = slots;
    tree_.set(object, box);
    return object;
}

namespace {

bool isVisible(const Group& group) {
    return group.live() > group.hidden() && group.box().lower.x <= group.box().upper.x;
}

}  // namespace

void Top::updateGroup(std::uint32_t object) {
    const Group& group = *objects_[object].resting;
    objects_[object].scene = group.scene();
    objects_[object].slots = group.slots();
    if (object == mainObject_) return;
    if (isVisible(group))
        tree_.set(object, group.box());
    else
        tree_.remove(object);
}

void Top::remove(std::uint32_t object) {
    if (objects_[object].resting) std::erase(resting_, object);
    if (object == mainObject_) mainObject_ = InstanceTree::kNone;
    tree_.remove(object);
    objects_[object] = {};
    free_.push_back(object);
}

void Top::chooseMain() {
    std::uint32_t best = InstanceTree::kNone;
    std::size_t most = 0;
    for (const std::uint32_t object : resting_) {
        const Group& group = *objects_[object].resting;
        const std::size_t triangles = group.triangles() - group.hiddenTriangles();
        // One that is main already stays so until another is much larger.
        const std::size_t weight = object == mainObject_ ? 2 * triangles : triangles;
        if (isVisible(group) && weight > most) most = weight, best = object;
    }
    if (best == mainObject_) return;
    const std::uint32_t before = std::exchange(mainObject_, best);
    if (before != InstanceTree::kNone) updateGroup(before);
    if (best != InstanceTree::kNone) tree_.remove(best);
}

void Top::commit() {
    chooseMain();
    main_ = mainObject_ == InstanceTree::kNone ? nullptr : &objects_[mainObject_];
    tree_.commit();
}

// ---- single rays --------------------------------------------------------------------------------------------------

// Rays are traced where they are: put into the object's frame, and back from what they were made of.

void Top::enter(const Object& object, const Ray& ray, RTCRay& r) {
    const Vec3f o = object.localFromRay * (ray.origin - object.translation);
    const Vec3f d = object.localFromRay * ray.direction;
    r.org_x = o.x, r.org_y = o.y, r.org_z = o.z;
    r.dir_x = d.x, r.dir_y = d.y, r.dir_z = d.z;
}

void Top::leave(const Ray& ray, RTCRay& r) {
    r.org_x = ray.origin.x, r.org_y = ray.origin.y, r.org_z = ray.origin.z;
    r.dir_x = ray.direction.x, r.dir_y = ray.direction.y, r.dir_z = ray.direction.z;
}

void Top::intersect(const Ray& ray, RTCRayHit& r, RTCIntersectContext& context) const {
    if (main_) {
        rtcIntersect1(main_->scene, &context, &r);
        if (tree_.empty()) return;
    }
    Ray rest = ray;
    rest.tMax = r.ray.tfar;
    tree_.traverse(rest, [&](std::uint32_t index) {
        const Object& object = objects_[index];
        context.instID[0] = index;  // what Embree notes in the hits it finds
        if (object.resting) {
            rtcIntersect1(object.scene, &context, &r);
        } else {
            if (!(object.mask & r.ray.mask)) return r.ray.tfar;
            enter(object, ray, r.ray);
            rtcIntersect1(object.scene, &context, &r);
            leave(ray, r.ray);
        }
        return r.ray.tfar;
    });
}

bool Top::occluded(const Ray& ray, RTCRay& r, RTCIntersectContext& context) const {
    if (main_) {
        rtcOccluded1(main_->scene, &context, &r);
        if (r.tfar < 0 || tree_.empty()) return r.tfar < 0;
    }
    tree_.traverse(ray, [&](std::uint32_t index) {
        const Object& object = objects_[index];
        if (object.resting) {
            rtcOccluded1(object.scene, &context, &r);
            return r.tfar;
        }
        if (!(object.mask & r.mask)) return r.tfar;
        enter(object, ray, r);
        rtcOccluded1(object.scene, &context, &r);
        leave(ray, r);
        return r.tfar;
    });
    return r.tfar < 0;
}

// ---- packets ------------------------------------------------------------------------------------------------------

namespace {

/// AVX-512 where the machine has it.
const bool kWide = avx512::isSupported();

/// The rays of a packet in an object's frame; in their own again when this ends.
class Entered {
  public:
    Entered(RayPacket16& rays, const glm::mat3& m, const Vec3f& translation) : rays_(rays) {
        if (kWide) {
            avx512::enter(rays, &m[0].x, &translation.x, saved_);
            return;
        }
        for (int at = 0; at < 16; at += 8) {
            const auto take = [&](int k, const float* from) {
                const simd::F8 v = simd::load(from + at);
                simd::store(saved_.values[k] + at, v);
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
        if (kWide) {
            avx512::leave(rays_, saved_);
            return;
        }
        float* const targets[] = {rays_.originX,    rays_.originY,    rays_.originZ,
                                  rays_.directionX, rays_.directionY, rays_.directionZ};
        for (int k = 0; k < 6; ++k) std::memcpy(targets[k], saved_.values[k], sizeof saved_.values[k]);
    }
    Entered(const Entered&) = delete;
    Entered& operator=(const Entered&) = delete;

  private:
    RayPacket16& rays_;
    avx512::SavedRays saved_;
};

template <class Leaf>
void traverse(const InstanceTree& tree, const RayPacket16& rays, const std::int32_t* valid, Leaf leaf) {
    if (!kWide) return tree.traverse(rays, valid, leaf);
    avx512::traverse(
        tree.nodes(), tree.nodeCount(), rays, valid,
        [](void* self, std::uint32_t object, const std::int32_t* lanes) { (*static_cast<Leaf*>(self))(object, lanes); },
        &leaf);
}

}  // namespace

void Top::intersect(RayPacket16& rays, std::int32_t* valid, RTCIntersectContext& context) const {
    auto& packet = reinterpret_cast<RTCRayHit16&>(rays);
    if (main_) {
        rtcIntersect16(valid, main_->scene, &context, &packet);
    }
    if (tree_.empty()) return;
    traverse(tree_, rays, valid, [&](std::uint32_t index, const std::int32_t* lanes) {
        const Object& object = objects_[index];
        context.instID[0] = index;  // what Embree notes in the hits it finds
        if (object.resting) {
            rtcIntersect16(lanes, object.scene, &context, &packet);
        } else {
            if (!(object.mask & rays.mask_[0])) return;
            const Entered entered(rays, object.localFromRay, object.translation);
            rtcIntersect16(lanes, object.scene, &context, &packet);
        }
    });
}

void Top::occluded(RayPacket16& rays, std::int32_t* valid, RTCIntersectContext& context) const {
    auto& packet = reinterpret_cast<RTCRay16&>(rays);
    if (main_) {
        rtcOccluded16(valid, main_->scene, &context, &packet);
    }
    if (tree_.empty()) return;
    // A blocked lane's segment ends before it begins, so that it meets no further box.
    traverse(tree_, rays, valid, [&](std::uint32_t index, const std::int32_t* lanes) {
        const Object& object = objects_[index];
        if (object.resting) {
            rtcOccluded16(lanes, object.scene, &context, &packet);
            return;
        }
        if (!(object.mask & rays.mask_[0])) return;
        const Entered entered(rays, object.localFromRay, object.translation);
        rtcOccluded16(lanes, object.scene, &context, &packet);
    });
}

}  // namespace rtsg::bvh
