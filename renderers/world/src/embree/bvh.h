// The door to Embree: its device, and groups of merged triangles (the top above them: top.h; single meshes:
// mesh_bvh.h).
//
// Invariant: what is attached here has been checked by RayWorld; Embree's asserts cannot fire. Nothing outside this
// folder names Embree. A group is one Embree scene of triangles already in ray space. An instance is a mesh's BVH and a
// transform; it is no Embree object: the top, a tree of our own, transforms rays into it. So moving one of N costs log
// N and no commit, and inverses are exact to a float's rounding, whatever the translation. With one group alone there
// is nothing above it. Threading: changes on one thread; tracing from any, in between; frozen TopViews from any at any
// time.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <vector>

#include <rtsg/core/module.h>
#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/ray.h>

#include "clusters.h"
#include "embree.h"
#include "long_triangles.h"
#include "trees/instance_tree.h"

namespace rtsg::delayed {
extern DelayedLibrary embree;
}

namespace rtsg::bvh {

/// Worlds in static storage may end after Embree's own static data have: nothing is left to release then.
template <auto kRelease>
struct Release {
    template <class Handle>
    void operator()(Handle* handle) const {
        if (!delayed::embree.hasEnded()) kRelease(handle);
    }
};
using DeviceHandle = std::unique_ptr<std::remove_pointer_t<RTCDevice>, Release<rtcReleaseDevice>>;
using SceneHandle = std::unique_ptr<std::remove_pointer_t<RTCScene>, Release<rtcReleaseScene>>;
using GeometryHandle = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, Release<rtcReleaseGeometry>>;

/// The device, its memory, and its last error.
class Device {
  public:
    Device(unsigned buildThreads, bool robust);
    ~Device();
    RTCDevice get() const { return handle_.get(); }
    SceneHandle newScene(RTCBuildQuality quality) const;
    /// Builds it, with the threads that the device was made for.
    void commit(RTCScene scene) const;
    std::size_t bytes() const;
    /// Empty if nothing went wrong since the last call.
    std::string takeError();

  private:
    struct Watch;
    std::unique_ptr<Watch> watch_;  // outlives the handle: Embree's callbacks write to it
    DeviceHandle handle_;
    unsigned buildThreads_ = 0;
    bool robust_ = true;
};

/// Positions read in place, or a copy in ray space.
struct Triangles {
    std::shared_ptr<const Mesh> mesh;
    Array<Vec3f> positions;                              // mesh->positions, or the copy
    std::shared_ptr<const LongTriangles> cut = nullptr;  // what Embree reads in place of them, if anything
};
GeometryHandle makeTriangles(const Device& device, const Triangles& triangles, RTCBuildQuality quality);

/// Triangles of several instances in one frame, merged. Once committed, what versions see of it does not change, but
/// for attach() and detach(), which are for groups that nobody sees: a copy can be made.
class Group {
  public:
    explicit Group(const Device& device);
    /// Another with the same members, to be committed.
    std::unique_ptr<Group> copy(const Device& device) const;
    /// Returns the local number. `kinds`: the bits of the RayKinds that meet it.
    std::uint32_t attach(const Device& device, std::uint32_t slot, Triangles triangles, std::uint32_t kinds);
    /// Takes effect without any building, for all but the epochs whose bits are held (versions.h).
    void setKinds(std::uint32_t local, std::uint32_t kinds, std::uint32_t heldBits);
    void detach(std::uint32_t local);
    /// Makes it invisible as setKinds() does; it stays attached.
    void hide(std::uint32_t local, std::uint32_t heldBits);
    /// Brings masks up to date that were held back; returns whether all are.
    bool settle(std::uint32_t heldBits);
    void commit(const Device& device);

    RTCScene scene() const { return scene_.get(); }
    /// The slots of the geometries; a hidden geometry has the slot that it had.
    const std::uint32_t* slots() const { return slots_.data(); }
    /// By geometry; null: none of it is cut.
    const LongTriangles* const* cuts() const { return cuts_.data(); }
    bool hasCuts() const { return cutCount_ > 0; }
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
    /// Calls visit(local, Triangles) for everything attached.
    template <class Visit>
    void forEachAttached(Visit visit) const {
        for (std::uint32_t i = 0; i < entries_.size(); ++i)
            if (entries_[i].geometry) visit(i, entries_[i].triangles);
    }
    /// The mask that Embree has. Any thread may ask.
    std::uint32_t mask(std::uint32_t local) const {
        return std::atomic_ref(entries_[local].mask).load(std::memory_order_relaxed);
    }
    /// The clusters of everything attached, made when they are first asked for. Any thread may ask.
    std::shared_ptr<const Clusters> clusters() const;
    /// The bytes of the clusters, if somebody has asked for these.
    std::size_t clusterBytes() const;

  private:
    struct Entry {
        GeometryHandle geometry;
        Triangles triangles;  // keeps the buffers alive
        std::uint32_t kinds = 0;
        mutable std::uint32_t mask = 0;  // what Embree has; read by other threads
        bool isHidden = false, isUnsettled = false;
    };
    /// Returns whether the mask is what `kinds` say.
    static bool settle(Entry& entry, std::uint32_t heldBits);

    SceneHandle scene_;
    std::vector<Entry> entries_;
    std::vector<std::uint32_t> slots_, free_, unsettled_;
    std::vector<const LongTriangles*> cuts_;  // as the entries have them
    std::vector<Triangles> retired_;          // buffers that Embree may read until the next commit
    std::size_t live_ = 0, hidden_ = 0, triangles_ = 0, hiddenTriangles_ = 0, cutCount_ = 0;
    bool dirty_ = false;
    InstanceTree::Box box_;
    mutable std::mutex clustersMutex_;
    mutable std::shared_ptr<const Clusters> clusters_;
};

}  // namespace rtsg::bvh
