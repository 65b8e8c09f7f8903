// WorldGeometry: AcousticGeometry over a RayWorld: the same BVH that light is traced in, asked in single precision and
// answered in double.
//
// Invariant: between update() and the next change of the world, answers are those of the world's triangles. Hits are
// moved onto their plane in double precision, so that long mirror paths do not drift. Follows instances, not scenes:
// materials are handed in by the NodeId of their AcousticProperties (see sound_scene.h). Threading: update() and
// setMaterial() alone; queries from any number of threads.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

class WorldGeometry final : public AcousticGeometry {
  public:
    struct Options {
        /// Of surfaces without AcousticProperties.
        AcousticMaterial defaultMaterial;
        /// With more triangles than this no planes are merged and no sources mirrored: rays do it all.
        std::size_t maxPlaneTriangles = 4'000'000;
    };

    /// `world` must outlive this.
    explicit WorldGeometry(const RayWorld& world);
    WorldGeometry(const RayWorld& world, const Options& options);

    /// Takes effect with the next update().
    void setMaterial(NodeId acoustics, const AcousticMaterial& material);
    void removeMaterial(NodeId acoustics);
    /// To be called after every RayWorld::apply before anything is traced; cheap when nothing changed. True if
    /// something did.
    bool update();
    /// Grows with every update() that returned true.
    std::uint64_t version() const { return version_; }

    std::span<const ReflectingPlane> planes() const override { return planes_; }
    std::span<const AcousticMaterial> materials() const override { return materials_; }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override;
    double distanceToSurface(const glm::dvec3& point) const override;

  private:
    struct Slot {
        std::size_t firstPlane = 0;  // in planeOf_
        std::uint32_t material = 0;
    };
    void place(const RayInstance& instance, std::uint32_t triangle, glm::dvec3 (&corners)[3]) const;

    const RayWorld* world_;
    Options options_;
    std::unordered_map<std::uint32_t, AcousticMaterial> byNode_;
    std::vector<AcousticMaterial> materials_;
    std::vector<ReflectingPlane> planes_;
    std::vector<Slot> slots_;             // by instance slot
    std::vector<std::uint32_t> planeOf_;  // by instance and triangle; empty when planes are not merged
    std::uint64_t version_ = 0, worldVersion_ = 0;
    bool materialsChanged_ = true;
};

}  // namespace rtsg
