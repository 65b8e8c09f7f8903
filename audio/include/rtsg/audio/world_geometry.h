// WorldGeometry: AcousticGeometry over a RayWorld: the same BVH that light is traced in, asked in single precision and
// answered in double.
//
// Invariant: after apply() of the deltas the world was applied, answers are those of one built from scratch (numbers of
// planes apart). The work follows the delta: planes are found once per mesh, in its own frame, and moved with its
// instances. Hits are moved onto their plane in double precision, so that long mirror paths do not drift. Materials are
// handed in by the NodeId of their AcousticProperties (see sound_scene.h). Threading: apply(), setMaterial() and
// update() alone; queries from any number of threads.
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/plane_index.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

class WorldGeometry final : public AcousticGeometry {
  public:
    struct Options {
        /// Of surfaces without AcousticProperties.
        AcousticMaterial defaultMaterial;
        /// With more planes than this, in one mesh or in all, no sources are mirrored: rays do it all.
        std::size_t maxPlanes = 20'000;
    };

    /// `world` must outlive this.
    explicit WorldGeometry(const RayWorld& world);
    WorldGeometry(const RayWorld& world, const Options& options);
    ~WorldGeometry() override;

    void setMaterial(NodeId acoustics, const AcousticMaterial& material);
    /// To be called after RayWorld::apply with the same delta.
    void apply(const InstanceDelta& delta);
    /// Brings planes() up to date; before a source is mirrored. Linear in the planes, nothing when nothing changed.
    void update();
    /// Grows with every change.
    std::uint64_t version() const { return version_; }

    std::span<const ReflectingPlane> planes() const override { return planes_; }
    std::span<const AcousticMaterial> materials() const override { return materials_; }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override {
        return closestBut({}, origin, direction, maxDistance, except, hit);
    }
    /// As closest(), through the instances in `open` (slots).
    bool closestBut(std::span<const std::uint32_t> open, const glm::dvec3& origin, const glm::dvec3& direction,
                    double maxDistance, std::uint32_t except, AcousticHit& hit) const;
    /// Slots of instances whose box holds the point and measures at most `maxSize` metres from corner to corner, as far
    /// as they are in the way of 32 rays from there.
    std::vector<std::uint32_t> instancesAround(const glm::dvec3& point, double maxSize) const;
    double distanceToSurface(const glm::dvec3& point) const override;

  private:
    /// The planes of one mesh, in its frame.
    struct MeshPlanes;
    struct Slot {
        InstanceId id;
        NodeId geometry;
        std::uint32_t material = 0;
        std::shared_ptr<const MeshPlanes> mesh;  // null: no planes are known
        std::vector<std::uint32_t> planes;       // by number in `mesh`
    };
    struct CachedMesh {
        std::weak_ptr<const Mesh> mesh;
        std::weak_ptr<const MeshPlanes> planes;
    };

    void place(std::uint32_t slot);
    void release(Slot& slot);
    double exactDistance(const Hit& hit, const glm::dvec3& origin, const glm::dvec3& direction) const;
    std::uint32_t materialOf(NodeId acoustics);
    std::shared_ptr<const MeshPlanes> planesOf(const std::shared_ptr<const Mesh>& mesh);

    const RayWorld* world_;
    Options options_;
    std::unordered_map<std::uint32_t, std::uint32_t> materialByNode_;
    std::vector<AcousticMaterial> materials_;
    std::vector<Slot> slots_;
    std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> slotsOf_;  // by geometry
    std::unordered_map<const Mesh*, CachedMesh> meshes_;
    PlaneIndex index_;
    std::vector<std::uint32_t> users_;  // by plane
    std::size_t withoutPlanes_ = 0;     // slots with a mesh too fine for planes
    std::vector<ReflectingPlane> planes_;
    std::uint64_t version_ = 0, updated_ = 0;
};

/// A world in which some instances are not there: the body of the thing that sounds does not enclose its own sound.
class OpenedGeometry final : public AcousticGeometry {
  public:
    /// `whole` must outlive this.
    OpenedGeometry(const WorldGeometry& whole, std::vector<std::uint32_t> open)
        : whole_(&whole), open_(std::move(open)) {}

    std::span<const ReflectingPlane> planes() const override { return whole_->planes(); }
    std::span<const AcousticMaterial> materials() const override { return whole_->materials(); }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override {
        return whole_->closestBut(open_, origin, direction, maxDistance, except, hit);
    }
    double distanceToSurface(const glm::dvec3& point) const override { return whole_->distanceToSurface(point); }

  private:
    const WorldGeometry* whole_;
    std::vector<std::uint32_t> open_;
};

}  // namespace rtsg
