// CoincidentFaces: which triangles may have others in their place, so that rays that met the back of a solid, which is
// not there, look for these.
//
// Invariant: what is said of a triangle hangs on the geometry alone, not on which rays ask or in which order.
// Threading: any.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include <rtsg/renderers/ray_view.h>

namespace rtsg::trace {

/// Of one picture, in which nothing moves.
class CoincidentFaces {
  public:
    /// Whether something that shows itself to a ray which met this back lies in its triangle's plane and overlaps it,
    /// near this place if the triangle is large; also where that cannot be told soon.
    bool mayHide(const RayView& world, const Hit& hit);

  private:
    static constexpr std::size_t kKept = std::size_t{1} << 12;
    std::array<std::atomic<std::uint64_t>, kKept> known_{};  // the last answers: slot, triangle, part, the answer
};

}  // namespace rtsg::trace
