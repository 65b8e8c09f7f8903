// AcousticGeometry: the view of the world that sound needs: materials, reflecting planes, nearest hits.
//
// Coplanar surfaces share one plane, whatever triangles, shapes or materials they are made of. So a box has six planes,
// and every mirror image of a source exists once. Surfaces reflect on both sides.
// Invariant: `closest` never reports a surface on the plane that it is told to leave out. This, not an offset, keeps a
// ray from hitting the wall that it starts on. Whether a surface lies before or behind a point is decided in double
// precision. Threading: all queries are const and may be called from many threads.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/bands.h>

namespace rtsg {

/// All values are fractions of the incident energy. The reflected fraction is 1 - absorption - transmission. Of this,
/// `scattering` is reflected diffusely by Lambert's law, and the rest specularly. Transmitted sound passes straight on.
struct AcousticMaterial {
    Bands absorption = allBands(0.1);
    Bands scattering = allBands(0.1);
    Bands transmission = allBands(0.0);

    double reflected(std::size_t band) const { return 1 - absorption[band] - transmission[band]; }
    double mirrored(std::size_t band) const { return reflected(band) * (1 - scattering[band]); }
    double maxMirrored() const {
        double maximum = 0;
        for (std::size_t b = 0; b < kBandCount; ++b) maximum = std::max(maximum, mirrored(b));
        return maximum;
    }
    friend bool operator==(const AcousticMaterial&, const AcousticMaterial&) = default;
};

/// The directivity of a source: the energy that it sends in a unit direction of the world, relative to a source that
/// radiates alike in all directions. Empty: 1 everywhere.
using SourcePattern = std::function<double(const glm::dvec3& direction)>;

/// An axis-aligned box in world coordinates: the extent of a path or of a moved shape.
struct AcousticBox {
    glm::dvec3 low{std::numeric_limits<double>::infinity()};
    glm::dvec3 high{-std::numeric_limits<double>::infinity()};

    bool empty() const { return !(low.x <= high.x); }
    void extend(const glm::dvec3& point) {
        low = glm::min(low, point);
        high = glm::max(high, point);
    }
    void extend(const AcousticBox& box) {
        low = glm::min(low, box.low);
        high = glm::max(high, box.high);
    }
    /// Whether the two boxes have a point in common.
    bool meets(const AcousticBox& box) const {
        return low.x <= box.high.x && box.low.x <= high.x && low.y <= box.high.y && box.low.y <= high.y &&
               low.z <= box.high.z && box.low.z <= high.z;
    }
    /// Distance from a point to the nearest point of the box; 0 inside.
    double distance(const glm::dvec3& point) const {
        return glm::length(glm::max(glm::max(low - point, point - high), glm::dvec3(0)));
    }
    /// Whether the segment between two points comes nearer to the box than `margin` along every axis.
    bool meetsSegment(const glm::dvec3& from, const glm::dvec3& to, double margin) const {
        double first = 0, last = 1;
        for (int i = 0; i < 3; ++i) {
            const double distance = to[i] - from[i], below = low[i] - margin - from[i],
                         above = high[i] + margin - from[i];
            if (distance == 0) {
                if (below > 0 || above < 0) return false;
                continue;
            }
            first = std::max(first, std::min(below / distance, above / distance));
            last = std::min(last, std::max(below / distance, above / distance));
        }
        return first <= last;
    }
};

constexpr std::uint32_t kNoPlane = std::numeric_limits<std::uint32_t>::max();

struct ReflectingPlane {
    glm::dvec3 normal{0, 0, 1};  // unit
    double offset = 0;           // dot(normal, p) for p on the plane
    glm::dvec3 center{0};        // bounding sphere of the surfaces on it
    double radius = 0;
    /// The largest share of energy that any surface on the plane reflects specularly in any band; an upper bound will
    /// do.
    double mirrors = 1;

    double signedDistance(const glm::dvec3& p) const { return glm::dot(normal, p) - offset; }
};

struct AcousticHit {
    double distance = 0;         // on the plane, in double precision; without a plane its error is less than `clear`
    glm::dvec3 normal{0, 0, 1};  // unit; may point to either side
    std::uint32_t plane = kNoPlane;
    std::uint32_t material = 0;
    /// A ray that leaves the surface does not hit it again if it starts this many metres before it; for AcousticRays.
    /// 0: not known.
    double clear = 0;
};

/// A triangle of a wall, in double precision.
struct WallTriangle {
    glm::dvec3 corners[3];
    glm::dvec3 normal{0, 0, 1};  // of its plane; unit
    double offset = 0;           // dot(normal, p) for p on that plane
    double margin = 0;           // metres between its edges and the lines where its plane meets those of its
                                 // neighbours, at most
    std::uint32_t plane = kNoPlane, material = 0;
};

/// A closed body of walls, given by its box, which is axis-aligned in the space of its mesh.
struct WallBody {
    glm::dvec3 middle{0};
    glm::dmat3 half{0.0};          // m, from the middle of the box to the middles of three sides
    glm::dmat3 boxFromWorld{1.0};  // maps p - middle to -1 to 1 along each axis
    double fill = 1;               // the share of the box that the body fills
};

/// An edge that diffracts sound: where two surfaces meet, or the rim of one surface.
struct WallEdge {
    glm::dvec3 from{0}, axis{0};  // unit axis
    double length = 0;
    /// Unit vectors in the two surfaces, square to the edge and away from it; both are the same at a rim.
    glm::dvec3 faceA{0}, faceB{0};
    std::uint32_t material = 0;
    /// The only body that has this edge; null if the edge belongs to no closed body. Valid until the walls change.
    const WallBody* body = nullptr;
};

/// A cylinder, a part of one, or a sphere, recognised in a mesh of facets with small angles between them. The corners
/// of the facets lie on it, and their edges are not in WallEdges.
struct RoundBody {
    bool sphere = false;
    glm::dvec3 center{0};
    double radius = 0;
    double facet = 0;  // the largest angle between neighbouring facets, radians
    std::uint32_t material = 0;
    /// For a cylinder: its unit axis, half its length, and its arc, which lies within `halfArc` radians of `middle`.
    glm::dvec3 axis{0, 0, 1};
    double halfLength = 0;
    glm::dvec3 middle{1, 0, 0};
    double halfArc = 0;
};

constexpr std::uint32_t kNoSolid = std::numeric_limits<std::uint32_t>::max();

/// A surface near a point.
struct NearSurface {
    glm::dvec3 normal{0, 0, 1};  // unit, on the side of the point
    double distance = 0;         // of the point from the surface's plane
    /// The closed mesh with one-sided faces (X3D `solid`) that the surface belongs to: the air is on the front side.
    /// Otherwise kNoSolid, and the air may be on both sides.
    std::uint32_t solid = kNoSolid;
};

/// Up to sixteen rays that are traced together.
struct AcousticRays {
    static constexpr int kMax = 16;
    /// One vector for each ray, stored by component for vector instructions.
    struct Vectors {
        alignas(64) double x[kMax] = {}, y[kMax] = {}, z[kMax] = {};

        glm::dvec3 operator[](int i) const { return {x[i], y[i], z[i]}; }
        void set(int i, const glm::dvec3& v) { x[i] = v.x, y[i] = v.y, z[i] = v.z; }
    };
    int count = 0;
    Vectors origin, direction;  // unit directions
    /// Unit normal of the surface that a ray starts on, on the side that the ray goes to; 0 if it starts on none.
    Vectors facing;
    double maxDistance[kMax] = {};
    double clear[kMax] = {};  // AcousticHit::clear of the surface that a ray starts on
    std::uint32_t except[kMax] = {};

    void add(const glm::dvec3& from, const glm::dvec3& side, const glm::dvec3& towards, double maximum,
             std::uint32_t plane, double clearOf = 0) {
        clear[count] = clearOf;
        origin.set(count, from);
        facing.set(count, side);
        direction.set(count, towards);
        maxDistance[count] = maximum;
        except[count++] = plane;
    }
};
using AcousticHits = std::array<AcousticHit, AcousticRays::kMax>;

/// Whether a way from one place to another was found, may exist, or cannot exist.
enum class Passage : std::uint8_t { found, unknown, none };

class AcousticGeometry {
  public:
    virtual ~AcousticGeometry() = default;

    /// Indexed by AcousticHit::plane. Empty if there are too many planes for image sources; then there are only rays.
    virtual std::span<const ReflectingPlane> planes() const = 0;
    virtual std::span<const AcousticMaterial> materials() const = 0;
    /// Nearest surface along a unit direction with 0 <= distance < maxDistance that is not on plane `except`.
    virtual bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance,
                         std::uint32_t except, AcousticHit& hit) const = 0;
    /// Whether a surface blocks the way from a point on plane `except` to a point that touches no surface; gives the
    /// same answer as closest(). `facing`: unit normal of the plane, on the side of the way.
    virtual bool blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction,
                         double distance, std::uint32_t except) const {
        static_cast<void>(facing);
        AcousticHit hit;
        return closest(origin, direction, distance, except, hit);
    }
    /// closest() and blocked() for several rays at a time; the result has a bit for each ray that hit something.
    virtual std::uint32_t closestOf(const AcousticRays& rays, AcousticHits& hits) const {
        std::uint32_t met = 0;
        for (int i = 0; i < rays.count; ++i)
            if (closest(rays.origin[i], rays.direction[i], rays.maxDistance[i], rays.except[i],
                        hits[static_cast<std::size_t>(i)]))
                met |= 1u << i;
        return met;
    }
    virtual std::uint32_t blockedOf(const AcousticRays& rays) const {
        std::uint32_t met = 0;
        for (int i = 0; i < rays.count; ++i)
            if (blocked(rays.origin[i], rays.facing[i], rays.direction[i], rays.maxDistance[i], rays.except[i]))
                met |= 1u << i;
        return met;
    }
    /// Distance from a point to the nearest surface, metres; infinity if there is none.
    virtual double distanceToSurface(const glm::dvec3& point) const = 0;
    using SurfaceVisitor = std::function<void(const NearSurface&)>;
    /// Visits the surfaces within `radius` of a point whose planes are within it too; a surface may be visited several
    /// times.
    virtual void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const = 0;
    /// Finds all triangles within `radius` of a point. False: they are not known, or there are too many.
    virtual bool trianglesNear(const glm::dvec3& point, double radius, std::vector<WallTriangle>& found) const {
        static_cast<void>(point), static_cast<void>(radius), static_cast<void>(found);
        return false;
    }
    /// Whether a path leads from one point to the other, with any number of reflections. Takes some thousand rays.
    virtual Passage passage(const glm::dvec3& a, const glm::dvec3& b) const {
        static_cast<void>(a), static_cast<void>(b);
        return Passage::unknown;
    }
    /// The same geometry, for questions whose answers need not be recorded: a later change there is not reported.
    virtual const AcousticGeometry& unnoted() const { return *this; }
    using EdgeVisitor = std::function<void(const WallEdge&)>;
    virtual void visitEdges(const EdgeVisitor& visit) const { static_cast<void>(visit); }
    using RoundVisitor = std::function<void(const RoundBody&)>;
    virtual void visitRoundBodies(const RoundVisitor& visit) const { static_cast<void>(visit); }
};

}  // namespace rtsg
