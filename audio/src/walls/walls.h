// Walls: the surfaces that sound may hit: the meshes of a scene, with their positions and materials.
//
//     Walls walls(world, {});
//     walls.apply(delta);                            // after world.apply(delta)
//     const WallsVersion version = walls.freeze();   // for a reader on another thread
//
// Invariant: after apply() of the world's deltas it equals Walls that read the world anew. The work depends on the
// delta, and a version costs next to nothing. Materials are identified by the NodeId of the node that defines them (see
// sound_scene.h). Threading: on the scene's thread; versions may be read on any thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <unordered_map>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/renderers/paged_array.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

/// One instance.
struct Wall {
    std::shared_ptr<const Mesh> mesh;  // null: nothing that sound can hit
    WorldFromLocal worldFromLocal{1.0};
    std::uint32_t material = 0;  // WallsVersion::materials
    std::uint64_t stamp = 0;     // changes with each change; 0: never used
    /// The sum of the largest x, y and z of the mesh's points, rotated and scaled but not translated, metres.
    double reach = 0;
};

struct WallsVersion {
    PagedArray<Wall> walls;  // by slot of the instance
    PagedArray<AcousticMaterial> materials;
};

class Walls {
  public:
    /// `world` must outlive this object. `defaults`: for surfaces without AcousticProperties.
    explicit Walls(const RayWorld& world, const AcousticMaterial& defaults = {});

    void setMaterial(NodeId node, const AcousticMaterial& material);
    /// The node that defines the material of an instance; otherwise its AcousticProperties do.
    using MaterialNode = std::function<NodeId(const Instance&)>;
    /// Call after RayWorld::apply with the same delta.
    void apply(const InstanceDelta& delta, const MaterialNode& materialNode = {});
    /// The node that defines a material; none for the default material.
    NodeId nodeOf(std::uint32_t material) const;
    WallsVersion freeze();
    /// Grows with every change.
    std::uint64_t version() const { return stamp_; }

  private:
    struct Slot {
        InstanceId id;
        NodeId geometry;
        std::uint32_t userIndex = 0;  // index in slotsOf_ of the geometry
    };
    void write(std::uint32_t slot);
    void attach(const Instance& instance, NodeId material);
    void detach(std::uint32_t slot);
    std::uint32_t materialOf(NodeId node);

    const RayWorld* world_;
    AcousticMaterial defaults_;
    PagedArrayWriter<Wall> walls_;
    PagedArrayWriter<AcousticMaterial> materials_;
    std::unordered_map<std::uint32_t, std::uint32_t> materialByNode_;
    std::vector<Slot> slots_;
    std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> slotsOf_;  // by geometry
    std::uint64_t stamp_ = 0;
};

}  // namespace rtsg
