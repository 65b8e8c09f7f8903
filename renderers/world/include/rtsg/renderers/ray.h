// Rays, one or sixteen at a time, and their hits.
//
// Ray space is world space minus RayWorld::origin(), in float. Threading: values.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>

#include <rtsg/core/value.h>
#include <rtsg/renderers/mesh.h>

namespace rtsg {

/// A ray in ray space; the direction need not be a unit vector, and t counts in its lengths.
struct Ray {
    Vec3f origin{0};
    float tMin = 0;
    Vec3f direction{0, 0, -1};
    float tMax = std::numeric_limits<float>::infinity();
};

/// The purpose of a ray. Each instance has a mask of the kinds that it stops, so one hierarchy serves pictures and
/// sound. A Shape with castShadow FALSE lets only shadow rays through; one that is wholly transparent (Instance::clear)
/// lets rays of eyes and of shadows through. Queries for what is there, such as a pointer's, are of kind `view`.
enum class RayKind : std::uint32_t { view = 1, shadow = 2, sound = 4, eye = 8 };

/// The width of a pixel, and the eye from which it is seen. Lines and points have widths in pixels, so rays meet them
/// only if this is known: at a point p of a line, its width is that of its pixels at p's depth. Seen in a mirror, or as
/// a shadow, a line has the same width as if it were looked at directly.
struct PixelLens {
    Vec3f eye{0}, forward{0, 0, -1};  // ray space; unit
    float spread = 0;                 // of a perspective: metres at a depth of 1 m
    float size = 0;                   // of a parallel projection: metres everywhere
    /// The matrix to the eye's own space, in which its pixels are square and `spread` and `size` are measured: x to the
    /// right of the picture, y up, -z ahead. None: the directions of its edges are not known.
    std::optional<glm::mat3> toSquare = std::nullopt;
    explicit operator bool() const { return spread > 0 || size > 0; }
};

constexpr std::uint32_t kNoInstance = 0xFFFFFFFF;

/// Leaves out parts of instances: a ray that meets such a part continues behind it. Closed bodies may have caps where
/// planes cut them. Threading: const.
class RayFilter {
  public:
    virtual ~RayFilter() = default;
    /// Whether any part of an instance may be left out.
    virtual bool concerns(std::uint32_t slot) const = 0;
    /// Whether an instance is left out as a whole: rays pass it as if it were not there.
    virtual bool hides(std::uint32_t) const { return false; }
    bool hidesAny() const { return hidesAny_; }
    /// Whether a place of an instance, in ray space, is left out. `error` is the possible error of the place in metres;
    /// places that are so close to the border are kept.
    virtual bool leavesOut(std::uint32_t slot, const Vec3f& at, float error) const = 0;
    /// The same for the place at `t` on a ray, whose error follows from the rounding of the ray's start and of the
    /// distance.
    bool leavesOutAlong(std::uint32_t slot, const Vec3f& origin, const Vec3f& direction, float t) const {
        const Vec3f displacement = t * direction, sizes = glm::abs(origin) + glm::abs(displacement);
        return leavesOut(slot, origin + displacement, 0x1p-21f * std::max({sizes.x, sizes.y, sizes.z}));
    }
    /// The box in ray space around all parts that may be left out but are not hidden as a whole, so that rays elsewhere
    /// need not ask; empty if there are none.
    const Bounds& bounds() const { return bounds_; }
    /// A box in ray space around all that may be kept; outside of it there is nothing to find.
    const Bounds& keptBounds() const { return kept_; }

    /// The place where a ray crosses a plane on which bodies have caps.
    struct Crossing {
        float t = 0;
        std::uint32_t plane = 0xFFFFFFFF;  // a number that the filter chooses
        Vec3f outwards{0};                 // unit, towards the side that is left out
    };
    virtual bool makesCaps() const { return false; }
    /// Goes from a crossing of the ray, or its start, to the next one by t and then by plane; false if there is none
    /// before tMax.
    virtual bool findNext(const Ray&, Crossing&) const { return false; }
    /// Whether a place on a plane, if it lies in this instance's body, belongs to a cap: the plane cuts the body, and
    /// no other plane leaves the place out.
    virtual bool isCapped(std::uint32_t, std::uint32_t /*plane*/, const Vec3f& /*at*/) const { return false; }

  protected:
    static constexpr float kFar = std::numeric_limits<float>::infinity();
    Bounds bounds_{Vec3f(-kFar), Vec3f(kFar)}, kept_ = bounds_;
    bool hidesAny_ = false;
};

/// Stands for the triangle of a hit on a cap, where a plane cuts a closed body. A cap has no colours or textures of its
/// own.
constexpr std::uint32_t kCap = 0xFFFFFFFF;

struct Hit {
    float t = std::numeric_limits<float>::infinity();
    std::uint32_t instance = kNoInstance;  // InstanceId::slot, for RayWorld::instance()
    std::uint32_t triangle = 0;            // index into Mesh's triangles, or its strokes; or kCap
    float u = 0, v = 0;                    // weights of the triangle's second and third corner
    /// A unit vector in world space, on the side from which the corners run counter-clockwise in the local frame, so
    /// that a mirrored instance keeps its outside. For a line or point it points back along the ray.
    Vec3f normal{0};
    explicit operator bool() const { return instance != kNoInstance; }
    bool isCap() const { return triangle == kCap; }
};

/// Sixteen rays in structure-of-arrays form, with room for their hits. Fill in active, origin, direction, tMin and
/// tMax; RayWorld uses the rest. After intersect(), tMax is the distance of the hit, and hit(packet, lane) returns the
/// hit; after occluded(), tMax is -inf in lanes that are blocked.
struct alignas(64) RayPacket16 {
    float originX[16], originY[16], originZ[16], tMin[16];
    float directionX[16], directionY[16], directionZ[16], time_[16];
    float tMax[16];
    std::uint32_t mask_[16], id_[16], flags_[16];
    float normalX_[16], normalY_[16], normalZ_[16];
    float u_[16], v_[16];
    std::uint32_t prim_[16], geom_[16], inst_[16], part_[16];
    std::int32_t active[16];  // -1 trace this lane, 0 do not

    void set(int lane, const Ray& ray) {
        originX[lane] = ray.origin.x, originY[lane] = ray.origin.y, originZ[lane] = ray.origin.z;
        directionX[lane] = ray.direction.x, directionY[lane] = ray.direction.y, directionZ[lane] = ray.direction.z;
        tMin[lane] = ray.tMin, tMax[lane] = ray.tMax, active[lane] = -1;
    }
    void skip(int lane) { active[lane] = 0; }
    /// The ray of a lane; after intersect() it ends at the hit.
    Ray ray(int lane) const {
        return {{originX[lane], originY[lane], originZ[lane]},
                tMin[lane],
                {directionX[lane], directionY[lane], directionZ[lane]},
                tMax[lane]};
    }
    Vec3f at(int lane, float t) const {
        return Vec3f(originX[lane], originY[lane], originZ[lane]) +
               t * Vec3f(directionX[lane], directionY[lane], directionZ[lane]);
    }
    bool hasHit(int lane) const { return geom_[lane] != kNoInstance; }
};

/// The hits of an intersected packet's lanes; their distances stay in the packet's tMax.
struct alignas(64) PacketHits16 {
    float normalX[16], normalY[16], normalZ[16];  // as Hit::normal
    float u[16], v[16];
    std::uint32_t instance[16], triangle[16];
};

/// Called for a triangle near a point; returns the radius from then on (RayWorld::visitNear).
using NearVisitor = std::function<float(std::uint32_t slot, std::uint32_t triangle)>;

}  // namespace rtsg
