// The world as mirrored in one of its walls: the real walls on the listener's side, and their mirror images beyond the
// mirror. A mirror image of the source is a source there, and bodies that hide it diffract its sound.
//
// Nothing passes where the mirror's plane has no surface. Edges and bodies in this plane do not count; a body that
// stands on it is joined with its image. Threading: const; edges point to copies that live as long as this object.
#pragma once

#include <map>
#include <mutex>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

class MirrorWorld final : public AcousticGeometry {
  public:
    /// `plane`: of the geometry's.
    MirrorWorld(const AcousticGeometry& geometry, std::uint32_t plane, const glm::dvec3& listener);

    /// Metres on the listener's side of the mirror.
    double height(const glm::dvec3& position) const { return glm::dot(normal_, position) - offset_; }
    const glm::dvec3& normal() const { return normal_; }
    glm::dvec3 mirrored(const glm::dvec3& position) const { return position - normal_ * (2 * height(position)); }

    std::span<const ReflectingPlane> planes() const override { return geometry_.planes(); }
    std::span<const AcousticMaterial> materials() const override { return geometry_.materials(); }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override;
    bool blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction, double distance,
                 std::uint32_t except) const override;
    double distanceToSurface(const glm::dvec3& point) const override;
    void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const override;
    void visitEdges(const EdgeVisitor& visit) const override;
    void visitRoundBodies(const RoundVisitor& visit) const override;

  private:
    bool isBeyond(const glm::dvec3& position) const { return height(position) < 0; }
    glm::dvec3 turned(const glm::dvec3& displacement) const {
        return displacement - normal_ * (2 * glm::dot(normal_, displacement));
    }
    /// Metres that a place may be off the mirror by rounding.
    double rounding(const glm::dvec3& position) const;
    /// Mirrors an edge, without its body.
    WallEdge mirrored(const WallEdge& edge) const;
    RoundBody mirrored(const RoundBody& body) const;
    const WallBody* mirrored(const WallBody* body) const;

    const AcousticGeometry& geometry_;
    std::uint32_t plane_;
    glm::dvec3 normal_;  // to the listener's side
    double offset_;
    mutable std::mutex mutex_;
    mutable std::map<const WallBody*, WallBody> bodies_;
};

}  // namespace rtsg
