// FewWalls: the walls of a small world, all of which are tested against sixteen rays at a time.
//
// Up to some dozens of triangles this is faster than any hierarchy of boxes, and points on planes have double precision
// as in WorldGeometry. Edges are widened by the possible rounding of a point, so that no ray slips through where walls
// meet. Threading: change() and build() alone; queries on any number of threads.
#pragma once

#include <cstdint>
#include <span>
#include <unordered_set>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/renderers/ray_view.h>

#include "wall_planes.h"
#include "walls.h"

namespace rtsg {

class FewWalls {
  public:
    static constexpr std::size_t kMaxTriangles = 48;

    /// The wall in this slot was one and is another.
    void change(std::uint32_t slot, const Wall& before, const Wall& now);
    /// After all changes and WallPlanes::settle(). Work does not grow with the number of walls.
    void build(const PagedArray<Wall>& walls, const WallPlanes& planes, const RayView& rays);

    /// Whether there are so few, each of them on its plane; else nothing must be asked.
    bool usable() const { return usable_; }
    /// AcousticGeometry::closestOf() and blockedOf().
    std::uint32_t closest(const AcousticRays& rays, AcousticHits& hits) const;
    std::uint32_t blocked(const AcousticRays& rays) const;

    struct Triangle {
        /// A unit vector for each edge, on the plane and towards the inside; dot(inwards, p) >= from for p inside.
        glm::dvec3 inwards[3];
        double from[3];
        std::uint32_t material, plane;  // in planes_
    };
    struct Plane {
        glm::dvec3 normal;
        double offset;
        std::uint32_t number, first, end;  // of triangles
    };

  private:
    bool addTriangle(const glm::dvec3 (&corners)[3], const ReflectingPlane& on, std::uint32_t material);

    std::unordered_set<std::uint32_t> slots_;  // of walls that rays can hit
    std::size_t count_ = 0;                    // of their triangles
    bool usable_ = false;
    std::vector<Plane> planes_;
    std::vector<Triangle> triangles_;  // plane by plane
};

}  // namespace rtsg
