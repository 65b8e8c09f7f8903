// The door to Embree: groups of resting triangles, and the top above them and the meshes' own BVHs (mesh_bvh.h).
//
// Invariant: what is attached here has been checked by RayWorld; Embree's asserts cannot fire.
// A group is one Embree scene of triangles already in ray space. An instance is a mesh's BVH and a transform; it is no
// Embree object: the top, a tree of our own, transforms rays into it. So moving one of N costs log N and no commit, and
// inverses are exact to a float's rounding, whatever the translation. With one group alone there is nothing above it.
// Threading: changes on one thread; tracing from any, in between.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include <embree3/rtcore.h>

#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/ray.h>

#include "instance_tree.h"

namespace rtsg::bvh {

struct ReleaseDevice {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
struct ReleaseGeometry {
    void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
using DeviceHandle = std::unique_ptr<std::remove_pointer_t<RTCDevice>, ReleaseDevice>;
using SceneHandle = std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene>;
using GeometryHandle = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, ReleaseGeometry>;

/// The device, what it uses, and what went wrong in it.
class Device {
  public:
    Device(unsigned buildThreads, bool robust);
    ~Device();
    RTCDevice get() const { return handle_.get(); }
    SceneHandle newScene(RTCBuildQuality quality) const;
    std::size_t bytes() const;
    /// Empty if nothing went wrong since the last call.
    std::string takeError();

  private:
    struct Watch;
    std::unique_ptr<Watch> watch_;  // outlives the handle: Embree's callbacks write to it
    DeviceHandle handle_;
    bool robust_ = true;
};

/// Positions read in place, or a copy in ray space.
struct Triangles {
    std::shared_ptr<const Mesh> mesh;
    Array<Vec3f> positions;  // mesh->positions, or the copy
};
GeometryHandle makeTriangles(const Device& device, const Triangles& triangles, RTCBuildQuality quality);

/// Triangles of several instances in one frame, merged.
class Group {
  public:
    explicit Group(const Device& device);
    /// Returns the local number.
    std::uint32_t attach(const Device& device, std::uint32_t slot, Triangles triangles, std::uint32_t mask);
    void setMask(std::uint32_t local, std::uint32_t mask);
    void detach(std::uint32_t local);
    /// Makes it invisible at once, without any building; it stays attached.
    void hide(std::uint32_t local);
    void commit();

    RTCScene scene() const { return scene_.get(); }
    const std::uint32_t* slots() const { return slots_.data(); }
    std::size_t live() const { return live_; }
    std::size_t hidden() const { return hidden_; }
    /// Attached ones, hidden ones included.
    std::size_t triangles() const { return triangles_; }
    std::size_t hiddenTriangles() const { return hiddenTriangles_; }
    bool dirty() const { return dirty_; }
    const InstanceTree::Box& box() const { return box_; }
    /// Calls visit(slot) for everything attached and not hidden.
    template <class Visit>
    void forEach(Visit visit) const {
        for (std::size_t i = 0; i < entries_.size(); ++i)
            if (entries_[i].geometry && !entries_[i].isHidden) visit(slots_[i]);
    }

    /// Calls visit(Triangles) for everything attached.
    template <class Visit>
    void forEachArray(Visit visit) const {
        for (const Entry& entry : entries_)
            if (entry.geometry) visit(entry.triangles);
    }
    const Triangles& triangles(std::uint32_t local) const { return entries_[local].triangles; }

  private:
    struct Entry {
        GeometryHandle geometry;
        Triangles triangles;  // keeps the buffers alive
        bool isHidden = false;
    };

    SceneHandle scene_;
    std::vector<Entry> entries_;
    std::vector<std::uint32_t> slots_, free_;
    std::vector<Triangles> retired_;  // buffers that Embree may read until the next commit
    std::size_t live_ = 0, hidden_ = 0, triangles_ = 0, hiddenTriangles_ = 0;
    bool dirty_ = false;
    InstanceTree::Box box_;
};

/// Everything there is to trace; what queries see. Rays have been checked.
///
/// The largest resting group, the main one, is traced first and without a look at its box: nearly every ray meets it,
/// and what it hits shortens the search among everything else, which is in the tree.
class Top {
  public:
    /// Returns the object's number. `rayFromLocal` has an inverse; the box is that of the result, in ray space.
    std::uint32_t addInstance(std::uint32_t slot, RTCScene mesh, const WorldFromLocal& rayFromLocal,
                              const InstanceTree::Box& box, std::uint32_t mask);
    /// A group that rests: its triangles are in ray space.
    std::uint32_t addGroup(const Group& group);
    /// A group that moves as one, after its commit; the box is that of the result. Groups may be shared.
    std::uint32_t addBody(const Group& group, const std::uint32_t* slots, const WorldFromLocal& rayFromGroup,
                          const InstanceTree::Box& box);
    /// An instance or a body.
    void move(std::uint32_t object, const WorldFromLocal& rayFromLocal, const InstanceTree::Box& box);
    /// The mesh's BVH is another one or has other bounds.
    void changeMesh(std::uint32_t object, RTCScene mesh, const InstanceTree::Box& box);
    void setMask(std::uint32_t object, std::uint32_t mask) { objects_[object].mask = mask; }
    /// After the commit of a group that rests.
    void updateGroup(std::uint32_t object);
    void remove(std::uint32_t object);
    void commit();

    void intersect(const Ray& ray, RTCRayHit& r, RTCIntersectContext& context) const;
    bool occluded(const Ray& ray, RTCRay& r, RTCIntersectContext& context) const;
    void intersect(RayPacket16& rays, std::int32_t* valid, RTCIntersectContext& context) const;
    /// Blocked lanes end with tMax -inf.
    void occluded(RayPacket16& rays, std::int32_t* valid, RTCIntersectContext& context) const;

    /// As RayWorld's.
    void visitNear(const Vec3f& center, float radius, const NearVisitor& visit) const;

    /// Whose hit it is. Precondition: the ray hit something.
    std::uint32_t slotOf(std::uint32_t geometryId, std::uint32_t instanceId) const {
        const Object& object = instanceId == RTC_INVALID_GEOMETRY_ID ? *main_ : objects_[instanceId];
        return object.slots ? object.slots[geometryId] : object.slot;
    }
    bool empty() const { return !main_ && tree_.empty(); }
    std::size_t bytes() const { return tree_.bytes() + objects_.capacity() * sizeof(Object); }
    std::size_t builds() const { return tree_.builds(); }

  private:
    struct Object {
        glm::mat3 localFromRay{1.0f};  // of points relative to `translation`
        Vec3f translation{0};
        std::uint32_t mask = ~0u, slot = kNoInstance;
        RTCScene scene = nullptr;
        const std::uint32_t* slots = nullptr;  // of a group's geometries; null: an instance
        const Group* resting = nullptr;        // a group that rests
        void setTransform(const WorldFromLocal& rayFromLocal);
    };
    static void enter(const Object& object, const Ray& ray, RTCRay& r);
    static void leave(const Ray& ray, RTCRay& r);
    std::uint32_t newObject();
    void chooseMain();

    std::vector<Object> objects_;
    std::vector<std::uint32_t> free_, resting_;
    InstanceTree tree_;
    const Object* main_ = nullptr;
    std::uint32_t mainObject_ = InstanceTree::kNone;
};

}  // namespace rtsg::bvh
