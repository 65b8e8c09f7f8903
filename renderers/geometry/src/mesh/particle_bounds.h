// The walls of BoundedPhysicsModels: a particle that meets one is reflected, without loss.
//
// Invariant: a path is followed from wall to wall; between two it is a parabola, whose meeting with a triangle is found
// exactly, so the result does not depend on any step. Threading: const members re-entrant.
// Source: ISO/IEC 19775-1 V4.0 40.4.1.
#pragma once

#include <vector>

#include <rtsg/renderers/mesh.h>

namespace rtsg::detail {

class ParticleWalls {
  public:
    void add(const Mesh& mesh);
    std::size_t size() const { return walls_.size(); }

    /// Moves on for `seconds` under a constant acceleration. A particle that is reflected over and over in one spot (a
    /// corner, say) is left there: false, and its velocity is 0.
    bool move(Vec3d& position, Vec3d& velocity, const Vec3d& acceleration, double seconds) const;

  private:
    struct Wall {
        Vec3d corner, normal;  // of unit length
        Vec3d u, v;            // of a point p of its plane: (p - corner) . u and . v are its coordinates
        Vec3d low, high;
    };
    /// The first time in (0, seconds] at which the wall is met; infinity: it is not.
    static double meeting(const Wall& wall, const Vec3d& p, const Vec3d& v, const Vec3d& a, double seconds);

    std::vector<Wall> walls_;
};

}  // namespace rtsg::detail
