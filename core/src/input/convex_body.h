// Whether a triangle meets a closed convex body: box, ball, cylinder, cone, or the hull of points.
//
// Bodies are solid and lie as the X3D primitives do: about the origin, the axis along y, a cone's apex above. Answers
// are those of double precision for a body that is larger by a billionth, so that a triangle that touches meets it; a
// triangle may have no area. A triangle meets a convex body if one of its edges does, or if it contains any one point
// of the body's section with its plane: for solids of revolution and boxes both are closed forms. For hulls the
// distance is computed. Threading: const. Source: Gilbert, Johnson, Keerthi, IEEE J. Robotics and Automation 4(2), 1988
// (hulls).
#pragma once

#include <array>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg {

class ConvexBody {
  public:
    using Triangle = std::array<Vec3d, 3>;

    static ConvexBody box(const Vec3d& half);
    static ConvexBody sphere(double radius);
    static ConvexBody cylinder(double radius, double halfHeight);
    static ConvexBody cone(double bottomRadius, double halfHeight);
    /// Precondition: at least one point.
    static ConvexBody hull(std::vector<Vec3d> points);

    /// Whether a triangle in the body's coordinates meets it; one that is not finite never does.
    bool meets(const Triangle& triangle) const;
    /// The number of points that are looked at for each triangle; 1 for a body that is no hull.
    std::size_t pointCount() const { return kind_ == Kind::hull ? points_.size() : 1; }

  private:
    enum class Kind : std::uint8_t { box, sphere, cylinder, cone, hull };
    ConvexBody(Kind kind, const Vec3d& half) : kind_(kind), half_(half) {}
    Vec3d support(const Vec3d& direction) const;
    bool segmentMeets(const Vec3d& from, const Vec3d& to) const;
    bool sectionMeets(const Triangle& triangle) const;
    bool hullMeets(const Triangle& triangle) const;

    Kind kind_;
    Vec3d center_{0};  // of a hull; what follows is about it
    Vec3d half_{0};    // of the box around
    std::vector<Vec3d> points_;
};

}  // namespace rtsg
