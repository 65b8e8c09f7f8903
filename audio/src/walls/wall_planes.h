// WallPlanes: the planes in which the walls of a world lie, with the surfaces on each.
//
// Invariant: after settle() planes() is what building from scratch gives, numbers apart. The work follows the walls
// that changed. With more than `maxPlanes` there are none: then walls beyond those that prove it wait, unsearched,
// until enough of these have gone. Threading: changes alone; const members from any number.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "box_tree.h"
#include "plane_index.h"
#include "walls.h"

namespace rtsg {

class WallPlanes {
  public:
    explicit WallPlanes(std::size_t maxPlanes) : maxPlanes_(maxPlanes) {}

    /// The wall in this slot changed. `walls` must be the version that settle() is given.
    void change(std::uint32_t slot, const Wall& wall);
    void materialChanged(std::uint32_t material);
    void settle(const PagedArray<Wall>& walls, std::span<const AcousticMaterial> materials);

    /// Whether there are so few that sources are mirrored in them.
    bool usable() const { return withoutPlanes_ == 0 && index_.count() <= maxPlanes_; }
    std::span<const ReflectingPlane> planes() const {
        return usable() ? std::span<const ReflectingPlane>(planes_) : std::span<const ReflectingPlane>();
    }
    /// The plane of a triangle; kNoPlane for one without area. Only while usable().
    std::uint32_t planeOf(std::uint32_t slot, std::uint32_t triangle) const {
        // A mesh that a transform flattens is traced, but has no planes.
        if (slot >= slots_.size() || !slots_[slot].mesh) return kNoPlane;
        const std::uint32_t local = slots_[slot].mesh->planeOf[triangle];
        return local == kNoPlane ? kNoPlane : slots_[slot].planes[local].plane;
    }
    std::uint64_t work() const { return work_; }

  private:
    /// The planes of one mesh, in its frame.
    struct MeshPlanes {
        std::vector<ReflectingPlane> planes;
        std::vector<std::uint32_t> planeOf;  // by triangle
        bool tooMany = false;
    };
    struct CachedMesh {
        std::weak_ptr<const Mesh> mesh;
        std::weak_ptr<const MeshPlanes> planes;
    };
    struct OnPlane {
        std::uint32_t plane = kNoPlane;
        std::uint32_t index = 0;  // among the surfaces of the plane
    };
    struct Slot {
        std::shared_ptr<const MeshPlanes> mesh;  // null: not searched
        std::vector<OnPlane> planes;             // by number in `mesh`
        std::uint32_t material = 0;
        bool waiting = false, queued = false;
    };
    struct Surface {
        std::uint32_t slot, number;  // of the plane within the slot
    };
    /// The surfaces that lie on one plane.
    struct Surfaces {
        std::vector<Surface> all;
        BoxTree boxes;                                               // in the order of `all`
        std::vector<std::pair<std::uint32_t, std::size_t>> created;  // of which materials, and how many of each
        bool dirty = false;
    };

    void release(std::uint32_t slot);
    void insertWall(std::uint32_t slot, const Wall& wall);
    void put(std::uint32_t slot, std::uint32_t number, std::uint32_t plane, const Wall& wall);
    void measure(std::uint32_t plane, const PagedArray<Wall>& walls, std::span<const AcousticMaterial> materials);
    void markDirty(std::uint32_t plane);
    std::shared_ptr<const MeshPlanes> planesOf(const std::shared_ptr<const Mesh>& mesh);

    std::size_t maxPlanes_;
    std::vector<Slot> slots_;
    std::vector<std::uint32_t> waiting_;
    std::unordered_map<const Mesh*, CachedMesh> meshes_;
    std::size_t meshesAtPurge_ = 0;
    PlaneIndex index_;
    std::vector<Surfaces> surfaces_;  // by plane
    std::vector<std::uint32_t> dirty_;
    std::size_t withoutPlanes_ = 0;  // walls with a mesh of too many planes
    std::vector<ReflectingPlane> planes_;
    std::uint64_t work_ = 0;
};

}  // namespace rtsg
