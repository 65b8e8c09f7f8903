// The only door to Embree: meshes' BVHs, groups of instances, and the root above the groups.
//
// Invariant: what is attached here has been checked by RayWorld; Embree's asserts cannot fire.
// A group is one Embree scene of instances or of triangles already in ray space. The root holds one user-geometry
// primitive per group, so that committing one moved instance of N costs what its group and the list of groups cost,
// not N; with one group the root is that group and costs nothing.
// Threading: changes on one thread; tracing from any, in between.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include <embree3/rtcore.h>

#include <rtsg/renderers/ray_world.h>

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

/// One mesh's own BVH, shared by all its instances.
class MeshBvh {
  public:
    MeshBvh(const Device& device, std::shared_ptr<const Mesh> mesh);
    /// Builds what is not built yet. Deforming meshes are built so that they can be refitted.
    void commit();
    /// Takes other positions for the same triangles and refits, or another mesh altogether and rebuilds.
    void update(const Device& device, std::shared_ptr<const Mesh> mesh);
    RTCScene scene() const { return scene_.get(); }
    bool refitted() const { return refitted_; }

  private:
    std::shared_ptr<const Mesh> mesh_;
    Array<std::int32_t> indexInUse_;
    SceneHandle scene_;
    GeometryHandle geometry_;
    bool built_ = false, deforming_ = false, refitted_ = false;
    unsigned refitsSinceBuild_ = 0;
};

class Group {
  public:
    /// `resting`: for triangles that are not expected to move; else for instances, which are.
    Group(const Device& device, bool resting);
    /// Returns the local number.
    std::uint32_t attachInstance(const Device& device, std::uint32_t slot, const MeshBvh& mesh,
                                 const glm::mat4x3& rayFromLocal, std::uint32_t mask);
    std::uint32_t attachTriangles(const Device& device, std::uint32_t slot, Triangles triangles, std::uint32_t mask);
    void move(std::uint32_t local, const glm::mat4x3& rayFromLocal);
    /// Must follow a change of the mesh's BVH.
    void touch(std::uint32_t local, const MeshBvh& mesh);
    void setMask(std::uint32_t local, std::uint32_t mask);
    void detach(std::uint32_t local);
    /// Makes it invisible at once, without any building; it stays attached.
    void hide(std::uint32_t local);
    /// Lets go of everything; what is needed on must have been detached before.
    void drop();
    void commit();

    RTCScene scene() const { return scene_.get(); }
    const std::uint32_t* slots() const { return slots_.data(); }
    std::size_t live() const { return live_; }
    std::size_t hidden() const { return hidden_; }
    bool resting() const { return resting_; }
    /// Attached ones, hidden ones included; instances count nothing.
    std::size_t triangles() const { return triangles_; }
    bool dirty() const { return dirty_; }
    const RTCBounds& bounds() const { return bounds_; }
    /// Calls visit(slot) for everything attached and not hidden.
    template <class Visit>
    void forEach(Visit visit) const {
        for (std::size_t i = 0; i < entries_.size(); ++i)
            if (entries_[i].geometry && !entries_[i].isHidden) visit(slots_[i]);
    }

  private:
    struct Entry {
        GeometryHandle geometry;
        Triangles triangles;  // keeps the buffers alive
        bool isHidden = false;
    };
    std::uint32_t place(std::uint32_t slot, Entry entry);

    SceneHandle scene_;
    std::vector<Entry> entries_;
    std::vector<std::uint32_t> slots_, free_;
    std::vector<Triangles> retired_;  // buffers that Embree may read until the next commit
    std::size_t live_ = 0, hidden_ = 0, triangles_ = 0;
    bool resting_ = false, dirty_ = false;
    RTCBounds bounds_{};
};

/// Traces through all groups; what queries see.
class Root {
  public:
    explicit Root(const Device& device);
    /// Commits after the groups were. `groups`: every group, in any order; empty ones are passed over.
    void commit(const Device& device, const std::vector<std::unique_ptr<Group>>& groups);
    RTCScene scene() const { return scene_; }
    std::uint32_t slotOf(std::uint32_t geometryId, std::uint32_t instanceId) const {
        if (geometryId & kMapped) return instanceId;
        return direct_->slots()[instanceId != RTC_INVALID_GEOMETRY_ID ? instanceId : geometryId];
    }
    const RTCBounds& bounds() const { return bounds_; }

    /// Set in a hit's geomID when its instID already is a slot.
    static constexpr std::uint32_t kMapped = 0x80000000;

  private:
    SceneHandle over_;
    GeometryHandle geometry_;
    std::vector<const Group*> groups_;  // the user geometry's primitives
    RTCScene scene_ = nullptr;
    const Group* direct_ = nullptr;
    RTCBounds bounds_{};
};

}  // namespace rtsg::bvh
