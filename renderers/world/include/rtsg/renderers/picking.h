// Picking and collision: the first surface along a ray, the nearest surface to a point, and how far a ball may travel.
//
// All three query the BVH in which light and sound are traced, so they cost as much as a ray and need no update of
// their own. Answers are exact for the triangles in world space, computed in double precision, whatever the instances'
// transforms (uneven scaling and mirroring included); the BVH only proposes candidates, with a margin. Threading:
// const; any number of threads, while others trace, between two apply() of world and flattener. Source: Ericson,
// Real-Time Collision Detection (2005), 5.1.5 (closest point) and 5.5.6 (moving sphere and triangle); ISO/IEC 19775-1
// V4.0 20.2 (results of picking), 23.4.2 (Collision's proxies, which stop avatars and are not picked).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

/// A point on a surface. It converts to false if nothing was found; its other members then have no meaning.
struct Pick {
    InstanceId instance;
    NodeId shape, geometry;
    std::vector<NodeId> path;    // from a root node to the Shape, both included
    std::uint32_t triangle = 0;  // of the geometry's Mesh
    float u = 0, v = 0;          // weights of the triangle's second and third corner
    Vec3d point{0};              // world space, metres
    /// A unit vector in world space. For a ray it is the surface's normal, on its front. For a nearest point or a sweep
    /// it points from the point towards the query's centre, and is the surface's normal if both coincide.
    Vec3d normal{0};
    Vec4f texCoord{0, 0, 0, 1};  // of channel 0: s, t, r, q
    /// Metres: along the ray, to the query point, or travelled by the ball until it touches (0: it overlaps at once).
    double distance = std::numeric_limits<double>::infinity();
    explicit operator bool() const { return static_cast<bool>(instance); }
};

/// The surfaces that count: those that are seen, or also those that only an avatar feels, such as a Collision's proxy
/// (Instance::felt).
enum class Surfaces : std::uint8_t { seen, felt };

/// Tells which surfaces an eye sees, so that rays of pointers pass through the others.
class SeenSurfaces {
  public:
    virtual ~SeenSurfaces() = default;
    /// The surface that is seen where `ray`, whose direction is a unit vector, has met something; no instance if none
    /// is seen.
    virtual Hit seen(const RayView& view, const Ray& ray, const Hit& met) const = 0;
};

class Picker {
  public:
    /// Both must outlive the picker and have applied the same states.
    Picker(const RayWorld& world, const Flattener& flattener) : world_(&world), flattener_(&flattener) {}
    const RayWorld& world() const { return *world_; }

    /// The first surface within `maximum` metres; the direction need not be a unit vector. Lines and points are as wide
    /// as in a picture seen from `origin` whose pixels are `pixel` radians wide; the other queries do not meet them.
    /// Their `triangle` is the stroke, and `point` lies on its axis. Error: origin or direction not finite, direction
    /// zero, origin farther than RayWorld::kMaxCoordinate.
    Result<Pick> ray(const Vec3d& origin, const Vec3d& direction,
                     double maximum = std::numeric_limits<double>::infinity(), double pixel = kPixel) const;
    /// The first surface that is visible, at any distance.
    Result<Pick> ray(const Vec3d& origin, const Vec3d& direction, const SeenSurfaces& seen) const;
    /// The first surface of one layer of a LayerSet; 0: outside of all layers. `lens` makes lines and points as wide as
    /// in a picture. `cut` leaves out more, and `seen` tells which surfaces are visible; either may be null. Errors: as
    /// above, or the lens' pixels are negative or not finite.
    Result<Pick> ray(const Vec3d& origin, const Vec3d& direction, std::uint16_t layer, double maximum,
                     const PixelLens& lens, const RayFilter* cut = nullptr, const SeenSurfaces* seen = nullptr) const;
    static constexpr double kPixel = .001;
    /// All surfaces within `maximum` metres, from either side, nearest first; 10,000 at most. Two whose distance is
    /// less than a millionth of the way count as one: the triangles beside an edge, but also faces of two shapes that
    /// coincide. Lines and points are not met. Error: as for ray().
    Result<std::vector<Pick>> crossings(const Vec3d& origin, const Vec3d& direction,
                                        double maximum = std::numeric_limits<double>::infinity(),
                                        Surfaces surfaces = Surfaces::seen) const;
    /// The point of any surface nearest to `point` within `maximum` metres. Error: as above.
    Result<Pick> closest(const Vec3d& point, double maximum = std::numeric_limits<double>::infinity()) const;
    /// Every instance that comes within `radius` of `center`, each with its nearest point, nearest first.
    /// Error: as above, or the radius is negative or not finite.
    Result<std::vector<Pick>> overlaps(const Vec3d& center, double radius, Surfaces surfaces = Surfaces::seen) const;
    /// The same for chosen instances: `concerns` is asked once for each. `meets` gets the triangles of an instance
    /// within `radius`, as corners in world space, until it returns true for one; only such instances are returned. The
    /// boxes of volumes count as triangles.
    Result<std::vector<Pick>> overlaps(const Vec3d& center, double radius,
                                       const std::function<bool(const InstanceId&)>& concerns,
                                       const std::function<bool(const std::array<Vec3d, 3>&)>& meets,
                                       Surfaces surfaces = Surfaces::seen) const;
    /// Moves a ball by `displacement` until it first touches a surface. Error: as above, or the displacement is not
    /// finite. A ball of radius 0 is a ray of that length; a displacement of 0 tells whether it overlaps now.
    Result<Pick> sweep(const Vec3d& center, double radius, const Vec3d& displacement) const;

  private:
    struct Candidate;
    Result<Pick> pick(const Vec3d& origin, const Vec3d& direction, double maximum, const PixelLens& lens,
                      const RayFilter* filter, const SeenSurfaces* seen) const;
    Pick finish(const Candidate& candidate) const;
    const RayWorld* world_;
    const Flattener* flattener_;
};

}  // namespace rtsg
