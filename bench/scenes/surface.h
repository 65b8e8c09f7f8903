// Surface: triangles in the making, and the few shapes that the bench's scenes are modelled from.
//
// Parameters u and v run over [0, 1]. Angles in radians, lengths in metres, y up. Threading: plain data.
#pragma once

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg::bench {

struct Surface {
    std::vector<Vec3f> points;
    std::vector<Vec2f> texCoords;  // one a point
    std::vector<std::int32_t> triangles;

    std::size_t triangleCount() const { return triangles.size() / 3; }
    Surface& add(const Surface& other);
    Surface& transform(const std::function<Vec3f(Vec3f)>& mapping);
    Surface& move(Vec3f by);
    Surface& scale(Vec3f by);
    /// About the y axis, counter-clockwise seen from above.
    Surface& rotate(float angle);
};

using Patch = std::function<Vec3f(float u, float v)>;
using Curve = std::function<Vec3f(float t)>;
using Profile = std::vector<Vec2f>;

/// 2 * nu * nv triangles.
Surface patch(int nu, int nv, const Patch& at);
/// 12 triangles; texture coordinates in metres.
Surface box(Vec3f low, Vec3f high);
Surface boxAt(Vec3f centre, Vec3f size);
/// Around the y axis: (radius, height), joined smoothly; 2 * segments * rings triangles.
Surface lathe(const Profile& profile, int segments, int rings);
/// Around `centre`; `square` below 1 makes it more of a box. 2 * nu * nv triangles.
Surface ellipsoid(Vec3f centre, Vec3f radii, int nu, int nv, float square = 1);
/// 2 * nu * nv triangles, open ended; `radius` may depend on t.
Surface tube(const Curve& spine, const std::function<float(float)>& radius, int nu, int nv);
Surface rod(Vec3f from, Vec3f to, float radius, int segments, int rings = 1);
/// Axis along z.
Surface torus(Vec3f centre, float ring, float thickness, int nu, int nv);
/// Catmull-Rom through the points.
Vec3f along(const std::vector<Vec3f>& points, float t);

/// |x|^power with x's sign.
float signedPower(float x, float power);

/// The same numbers everywhere.
class Dice {
  public:
    explicit Dice(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ull + 1) {}
    float in(float low, float high);
    int below(int n) { return static_cast<int>(in(0, static_cast<float>(n))); }

  private:
    std::uint64_t state_;
};

/// Smooth noise in [-1, 1], about one bump a unit.
float noise(Vec3f at);

}  // namespace rtsg::bench
