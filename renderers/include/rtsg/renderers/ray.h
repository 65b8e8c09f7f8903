// Rays, one or sixteen at a time, and what they hit.
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

/// Origin and ends of the ray in ray space; the direction need not be a unit vector, t counts in its lengths.
struct Ray {
    Vec3f origin{0};
    float tMin = 0;
    Vec3f direction{0, 0, -1};
    float tMax = std::numeric_limits<float>::infinity();
};

/// What a ray stands for. Each instance has a mask of the kinds that it stops, so one hierarchy serves eyes and ears.
/// A Shape whose castShadow is FALSE lets shadow rays through, and those only; one that is wholly transparent
/// (Instance::clear) lets rays of eyes and of shadows through. A query for what is there, such as a pointer's, is a
/// view.
enum class RayKind : std::uint32_t { view = 1, shadow = 2, sound = 4, eye = 8 };

/// How wide a pixel is, and seen from where. Lines and points are some pixels wide, so rays meet them only where this
/// is known: at a point p of one it is as wide as its pixels are at p's depth. One seen through a mirror, or whose
/// shadow falls somewhere, is the same thing: as wide as it would be if it were looked at where it is.
struct PixelLens {
    Vec3f eye{0}, forward{0, 0, -1};  // ray space; unit
    float spread = 0;                 // of a perspective: metres at a depth of 1 m
    float size = 0;                   // of a parallel projection: metres everywhere
    /// To the eye's own space, in which its pixels are square and `spread` and `size` count: x to the right of the
    /// picture, y up, -z ahead. None: its edges are not known.
    std::optional<glm::mat3> toSquare = std::nullopt;
    explicit operator bool() const { return spread > 0 || size > 0; }
};

constexpr std::uint32_t kNoInstance = 0xFFFFFFFF;

/// Leaves out parts of instances: a ray that meets such a part goes on from there. Closed bodies may have caps where
/// planes cut them. Threading: const.
class RayFilter {
  public:
    virtual ~RayFilter() = default;
    /// Whether anything of an instance may be left out at all.
    virtual bool concerns(std::uint32_t slot) const = 0;
    /// Whether all of an instance is left out: rays pass it as if it were not there.
    virtual bool hides(std::uint32_t) const { return false; }
    bool hidesAny() const { return hidesAny_; }
    /// Whether a place of an instance, in ray space, is left out. `error` is how far off the place may be, in metres;
    /// places that are so close to the border stay.
    virtual bool leavesOut(std::uint32_t slot, const Vec3f& at, float error) const = 0;
    /// The same for the place at `t` of a ray, whose error follows from the rounding of the ray's start and of the way
    /// to the place.
    bool leavesOutAlong(std::uint32_t slot, const Vec3f& origin, const Vec3f& direction, float t) const {
        const Vec3f way = t * direction, sizes = glm::abs(origin) + glm::abs(way);
        return leavesOut(slot, origin + way, 0x1p-21f * std::max({sizes.x, sizes.y, sizes.z}));
    }
    /// The box in ray space around all that is concerned and not hidden, so that rays elsewhere need not ask; empty if
    /// there is nothing.
    const Bounds& bounds() const { return bounds_; }
    /// Ray space; around all that it may keep, so that elsewhere nobody need look for anything.
    const Bounds& keptBounds() const { return kept_; }

    /// The place where a ray goes through a plane on which bodies have caps.
    struct Crossing {
        float t = 0;
        std::uint32_t plane = 0xFFFFFFFF;  // a number of the filter's own
        Vec3f outwards{0};                 // unit, towards what is left out
    };
    virtual bool makesCaps() const { return false; }
    /// From a crossing of the ray, or its start, on to the next one by t and then by plane; false: there is none before
    /// tMax.
    virtual bool findNext(const Ray&, Crossing&) const { return false; }
    /// Whether a place on a plane belongs to a cap of this instance, if it lies in its body: the plane cuts it, and no
    /// other leaves the place out.
    virtual bool isCapped(std::uint32_t, std::uint32_t /*plane*/, const Vec3f& /*at*/) const { return false; }

  protected:
    static constexpr float kFar = std::numeric_limits<float>::infinity();
    Bounds bounds_{Vec3f(-kFar), Vec3f(kFar)}, kept_ = bounds_;
    bool hidesAny_ = false;
};

/// In place of a triangle, of a hit on a cap: where a plane cuts a closed body. It has no colours or textures of its
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

/// Sixteen rays in structure-of-arrays form, and room for their hits. Fill active, origin, direction, tMin, tMax; the
/// rest is RayWorld's. After intersect(), tMax is the distance of the hit and hit(packet, lane) tells the rest; after
/// occluded(), tMax is -inf in lanes that are blocked.
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
    /// Up to where it goes, or has met something.
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

/// The hits of an intersected packet's lanes. The other numbers of a Hit are tMax and those of the packet.
struct alignas(64) PacketHits16 {
    float normalX[16], normalY[16], normalZ[16];  // as Hit::normal
    float u[16], v[16];
    std::uint32_t instance[16], triangle[16];
};

/// Called for a triangle near a point; returns the radius from then on (RayWorld::visitNear).
using NearVisitor = std::function<float(std::uint32_t slot, std::uint32_t triangle)>;

}  // namespace rtsg
