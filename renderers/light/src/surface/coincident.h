// CoincidentFaces: tells which triangles may coincide with others, so that rays that hit the invisible back of a solid
// look for those others.
//
// Invariant: the answer for a triangle depends on the geometry only, not on which rays ask or in which order.
// Threading: any.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include <rtsg/renderers/ray_view.h>

#include "surface_packet.h"

namespace rtsg::trace {

/// The coincident faces of one picture, in which nothing moves.
class CoincidentFaces {
  public:
    /// Whether something that shows itself to a ray which met this back lies in its triangle's plane and overlaps it,
    /// near this place if the triangle is large; also where that cannot be told soon.
    bool mayHide(const RayView& world, const Hit& hit);
    /// The same of any surface of another body that bends light.
    bool mayTouchBodies(const TraceScene& scene, const Hit& hit);

  private:
    static constexpr std::size_t kKept = std::size_t{1} << 12;
    /// The last answers: slot, triangle, part, the answer.
    using Answers = std::array<std::atomic<std::uint64_t>, kKept>;
    /// `counts(instance, slot, cosine)`: whether such a triangle in the same plane does.
    template <class Counts>
    static bool ask(Answers& known, const RayView& world, const Hit& hit, const Counts& counts);

    Answers hiding_{}, touching_{};
};

/// Whether an eye sees through the backs of an instance because it is a solid; those of glass are there, so that light
/// finds its way out.
inline bool hidesBacks(const TraceScene& scene, std::uint32_t instance) {
    return scene.world->instance(instance).mesh->solid &&
           scene.materials[scene.slot(instance).material].material.refractiveIndex == 0;
}
/// Whether the hit is on the back of a solid.
bool isBackOfSolid(const TraceScene& scene, const Hit& hit, const Vec3f& direction);

/// The hit of `ray`, or if that is the back of a solid, another surface in the same place; the back itself if there is
/// none.
Hit frontOf(const TraceScene& scene, const RayView& world, const Ray& ray, const Hit& hit,
            RayKind kind = RayKind::view);

/// Puts fronts of solids in the place of backs that rays met.
void flipToFronts(const TraceScene& scene, const RayPacket16& rays, SurfacePacket& surfaces);

}  // namespace rtsg::trace
