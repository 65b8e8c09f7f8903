// AcousticGeometry: what sound needs to know of the world: materials, reflecting planes, nearest hits.
//
// Coplanar surfaces share one plane whatever triangles, shapes or materials they are made of, so that a box has six
// planes and every mirror image of a source exists once. Surfaces reflect from both sides.
// Invariant: `closest` never reports a surface of the plane it is told to leave out; that, not an offset, is what keeps
// a ray from hitting the wall it starts on. Whether a surface lies before or behind a point is decided in double
// precision. Threading: all queries are const and safe from many threads.
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

/// Fractions of the incident energy. Reflected is 1 - absorption - transmission, of which `scattering` leaves by
/// Lambert's law and the rest like a mirror. Transmitted sound passes straight on.
struct AcousticMaterial {
    Bands absorption = allBands(0.1);
    Bands scattering = allBands(0.1);
    Bands transmission = allBands(0.0);

    double reflected(std::size_t band) const { return 1 - absorption[band] - transmission[band]; }
    double mirrored(std::size_t band) const { return reflected(band) * (1 - scattering[band]); }
    double mostMirrored() const {
        double most = 0;
        for (std::size_t b = 0; b < kBandCount; ++b) most = std::max(most, mirrored(b));
        return most;
    }
    friend bool operator==(const AcousticMaterial&, const AcousticMaterial&) = default;
};

constexpr std::uint32_t kNoPlane = std::numeric_limits<std::uint32_t>::max();

struct ReflectingPlane {
    glm::dvec3 normal{0, 0, 1};  // unit
    double offset = 0;           // dot(normal, p) for p on the plane
    glm::dvec3 center{0};        // bounding sphere of the surfaces on it
    double radius = 0;
    /// The largest share of energy that any surface on it mirrors in any band; an upper bound will do.
    double mirrors = 1;

    double signedDistance(const glm::dvec3& p) const { return glm::dot(normal, p) - offset; }
};

struct AcousticHit {
    double distance = 0;         // in double, on the plane; without a plane off the surface by less than `clear`
    glm::dvec3 normal{0, 0, 1};  // unit, on either side
    std::uint32_t plane = kNoPlane;
    std::uint32_t material = 0;
    /// Metres before the surface from where no ray that leaves it meets it again, for AcousticRays; 0: not known.
    double clear = 0;
};

/// A triangle of a wall, in double precision.
struct WallTriangle {
    glm::dvec3 corners[3];
    glm::dvec3 normal{0, 0, 1};  // of its plane; unit
    double offset = 0;           // dot(normal, p) for p on that
    double margin = 0;           // metres that its edges may be from where its plane and its neighbours' meet
    std::uint32_t plane = kNoPlane, material = 0;
};

/// A closed body of walls, by the box around it that is square in the space of its mesh.
struct WallBody {
    glm::dvec3 middle{0};
    glm::dmat3 half{0.0};          // m, from there to the middles of three sides
    glm::dmat3 boxFromWorld{1.0};  // of p - middle: from -1 to 1 along each axis
    double fill = 1;               // of the box, the share that it takes up
};

/// An edge round which sound bends: where two surfaces meet, or the rim of one.
struct WallEdge {
    glm::dvec3 from{0}, axis{0};  // unit axis
    double length = 0;
    /// Unit, in the surfaces and away from the edge; of a rim both are the same.
    glm::dvec3 faceA{0}, faceB{0};
    std::uint32_t material = 0;
    /// The only body that has this edge; null if that is not closed. The pointer is good until walls change.
    const WallBody* body = nullptr;
};

/// A cylinder, a part of one, or a sphere, that facets stand for whose edges turn a little each. Their corners are on
/// it, and their edges are no WallEdges.
struct RoundBody {
    bool sphere = false;
    glm::dvec3 center{0};
    double radius = 0;
    double facet = 0;  // radians that it turns from a facet to the next, at most
    std::uint32_t material = 0;
    /// For a cylinder: its unit axis, half of its length, and its arc, which is all within `halfArc` radians of
    /// `middle`.
    glm::dvec3 axis{0, 0, 1};
    double halfLength = 0;
    glm::dvec3 middle{1, 0, 0};
    double halfArc = 0;
};

constexpr std::uint32_t kNoSolid = std::numeric_limits<std::uint32_t>::max();

/// A surface beside a place.
struct NearSurface {
    glm::dvec3 normal{0, 0, 1};  // unit, on the side that it faces
    double distance = 0;         // of the place from its plane, on that side
    /// Which closed mesh it is of whose faces have one side (X3D `solid`): the air is there where they face. Else
    /// kNoSolid, and the air may be on both.
    std::uint32_t solid = kNoSolid;
};

/// Up to sixteen rays that are asked about together.
struct AcousticRays {
    static constexpr int kMost = 16;
    /// One vector for each ray, x beside x, so that processors compute several at a time.
    struct Vectors {
        alignas(64) double x[kMost] = {}, y[kMost] = {}, z[kMost] = {};

        glm::dvec3 operator[](int i) const { return {x[i], y[i], z[i]}; }
        void set(int i, const glm::dvec3& v) { x[i] = v.x, y[i] = v.y, z[i] = v.z; }
    };
    int count = 0;
    Vectors origin, direction;  // unit directions
    /// Unit normal of the surface that a ray starts on, on the side to which it goes; 0 if it starts on none.
    Vectors facing;
    double maxDistance[kMost] = {};
    double clear[kMost] = {};  // of the surface that a ray starts on, AcousticHit::clear
    std::uint32_t except[kMost] = {};

    void add(const glm::dvec3& from, const glm::dvec3& side, const glm::dvec3& towards, double most,
             std::uint32_t plane, double clearOf = 0) {
        clear[count] = clearOf;
        origin.set(count, from);
        facing.set(count, side);
        direction.set(count, towards);
        maxDistance[count] = most;
        except[count++] = plane;
    }
};
using AcousticHits = std::array<AcousticHit, AcousticRays::kMost>;

/// Whether a way from one place to another was found, may exist, or cannot exist.
enum class Passage : std::uint8_t { found, unknown, none };

class AcousticGeometry {
  public:
    virtual ~AcousticGeometry() = default;

    /// By AcousticHit::plane; empty when there are too many to mirror sources in (then only rays reflect).
    virtual std::span<const ReflectingPlane> planes() const = 0;
    virtual std::span<const AcousticMaterial> materials() const = 0;
    /// Nearest surface along a unit direction with 0 <= distance < maxDistance that is not on plane `except`.
    virtual bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance,
                         std::uint32_t except, AcousticHit& hit) const = 0;
    /// Whether a surface lies on the way from a place on plane `except`, before it by `facing` (unit), to one that
    /// touches none; what closest() would say.
    virtual bool blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction,
                         double distance, std::uint32_t except) const {
        static_cast<void>(facing);
        AcousticHit hit;
        return closest(origin, direction, distance, except, hit);
    }
    /// closest() and blocked() for several rays at a time; a bit for each that met something.
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
    /// Distance from a point to the nearest surface, metres; infinity in the void.
    virtual double distanceToSurface(const glm::dvec3& point) const = 0;
    using SurfaceVisitor = std::function<void(const NearSurface&)>;
    /// Visits the surfaces that come within `radius` of a point and whose planes do; one may be visited several times.
    virtual void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const = 0;
    /// All triangles that come within `radius` of a point. False: they are not known, or too many to be worth it.
    virtual bool trianglesNear(const glm::dvec3& point, double radius, std::vector<WallTriangle>& found) const {
        static_cast<void>(point), static_cast<void>(radius), static_cast<void>(found);
        return false;
    }
    /// Whether a way leads from one place to the other, however often it is turned by walls. Takes some thousand rays.
    virtual Passage passage(const glm::dvec3& a, const glm::dvec3& b) const {
        static_cast<void>(a), static_cast<void>(b);
        return Passage::unknown;
    }
    /// The same, for questions of whose answers nobody need take note: what they reach may change unseen.
    virtual const AcousticGeometry& unnoted() const { return *this; }
    using EdgeVisitor = std::function<void(const WallEdge&)>;
    virtual void visitEdges(const EdgeVisitor& visit) const { static_cast<void>(visit); }
    using RoundVisitor = std::function<void(const RoundBody&)>;
    virtual void visitRoundBodies(const RoundVisitor& visit) const { static_cast<void>(visit); }
};

}  // namespace rtsg
