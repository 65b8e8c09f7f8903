// WorldGeometry: AcousticGeometry over walls and rays. It uses the BVH in which light is traced: queries in single
// precision, results in double.
//
//     WorldGeometry geometry;
//     geometry.follow(walls.freeze(), world);              // both of the same state of the scene
//
// Invariant: after follow() its answers equal those of one built anew (except for the numbers of planes). The work
// depends on what changed since the last version: planes are found once per mesh, in its own frame, and moved with its
// instances. Hits are moved onto their plane in double precision, so that long mirror paths do not drift.
// Threading: follow() alone, on the tracing thread; queries from any number of threads.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/room_openings.h>
#include <rtsg/renderers/ray_view.h>

#include "walls/walls.h"

namespace rtsg {

class EdgeTable;
class FewWalls;
class WallPlanes;

class WorldGeometry final : public AcousticGeometry {
  public:
    struct Options {
        /// With more planes than this there are no image sources, only rays, and the search for planes ends.
        std::size_t maxPlanes = 20'000;
        /// Whether to find edges. In meshes with thousands of triangles this takes a while, and is needed for tracing
        /// only.
        bool edges = true;
    };
    /// The changes that follow() found.
    struct Changes {
        /// Boxes around each instance that was added, removed or moved, or whose material changed: at its old and its
        /// new position.
        std::vector<AcousticBox> boxes;
        std::vector<std::uint32_t> slots;  // of each box
        /// A material changed, or there was no earlier version: everything changed.
        bool everything = false;
    };

    WorldGeometry();
    explicit WorldGeometry(const Options& options);
    ~WorldGeometry() override;

    /// `rays` must outlive the later queries.
    const Changes& follow(const WallsVersion& walls, const RayView& rays) {
        static_cast<void>(note(walls, rays));
        settle();
        return changes_;
    }
    /// The first part of follow(), for programs that ask for paths often and trace seldom. Until settle(), changed
    /// walls lie on no plane, and planes() and edges are the old ones. Several notes are settled at once.
    const Changes& note(const WallsVersion& walls, const RayView& rays);
    void settle();
    /// Steps that follow() has taken so far: walls compared, planes measured, boxes read. Counted, not timed.
    std::uint64_t work() const;

    std::span<const ReflectingPlane> planes() const override;
    std::span<const AcousticMaterial> materials() const override { return materials_; }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override {
        return closestBut({}, origin, direction, maxDistance, except, hit);
    }
    /// Like closest(), but rays pass through the instances in `open` (slots).
    bool closestBut(std::span<const std::uint32_t> open, const glm::dvec3& origin, const glm::dvec3& direction,
                    double maxDistance, std::uint32_t except, AcousticHit& hit) const;
    bool blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction, double distance,
                 std::uint32_t except) const override;
    std::uint32_t closestOf(const AcousticRays& rays, AcousticHits& hits) const override {
        return closestOfBut({}, rays, hits);
    }
    std::uint32_t closestOfBut(std::span<const std::uint32_t> open, const AcousticRays& rays, AcousticHits& hits) const;
    std::uint32_t blockedOf(const AcousticRays& rays) const override { return blockedOfBut({}, rays); }
    std::uint32_t blockedOfBut(std::span<const std::uint32_t> open, const AcousticRays& rays) const;
    /// Slots of instances whose box contains the point and has a diagonal of at most `maxSize` metres, as far as 32
    /// rays from the point hit them.
    std::vector<std::uint32_t> instancesAround(const glm::dvec3& point, double maxSize) const;
    /// Adds those instances that a ray from `point` in `direction` (a unit vector) leaves and that are not yet in
    /// `bodies`.
    void addBodies(const glm::dvec3& point, const glm::dvec3& direction, double maxSize,
                   std::vector<std::uint32_t>& bodies) const;
    /// The shapes that keep sound at one point from reaching the other; none if a path was found, or both points are in
    /// the open. Shapes that transmit sound, and those in `open` (slots), do not count. Takes some thousand rays.
    std::optional<Seal> sealBetween(std::span<const std::uint32_t> open, const glm::dvec3& source,
                                    const glm::dvec3& listener) const;
    /// The openings through which escaped rays went (findRoomOpenings()).
    RoomOpenings openings(const glm::dvec3& source, std::span<const EscapedRay> exits, const Bands& escaped) const;
    /// Whether the box of an instance, in its own frame, contains a point.
    bool boxHolds(std::uint32_t slot, const glm::dvec3& point) const;
    double distanceToSurface(const glm::dvec3& point) const override;
    void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const override;
    bool trianglesNear(const glm::dvec3& point, double radius, std::vector<WallTriangle>& found) const override {
        return trianglesNearBut({}, point, radius, found);
    }
    bool trianglesNearBut(std::span<const std::uint32_t> open, const glm::dvec3& point, double radius,
                          std::vector<WallTriangle>& found) const;
    Passage passage(const glm::dvec3& a, const glm::dvec3& b) const override { return passageBut({}, a, b); }
    Passage passageBut(std::span<const std::uint32_t> open, const glm::dvec3& a, const glm::dvec3& b) const;
    void visitEdges(const EdgeVisitor& visit) const override { visitEdgesBut({}, visit); }
    /// The edges of all instances but those in `open` (slots).
    void visitEdgesBut(std::span<const std::uint32_t> open, const EdgeVisitor& visit) const;
    void visitRoundBodies(const RoundVisitor& visit) const override { visitRoundBodiesBut({}, visit); }
    void visitRoundBodiesBut(std::span<const std::uint32_t> open, const RoundVisitor& visit) const;

  private:
    /// The result of checking, in double precision, a hit that was found in single precision.
    enum class Judged : std::uint8_t { hit, beyond, doubtful };
    Judged judge(const Hit& found, double rough, std::span<const std::uint32_t> open, const glm::dvec3& origin,
                 const glm::dvec3& direction, double maxDistance, std::uint32_t except, AcousticHit& hit) const;
    void settleDoubts(std::span<const std::uint32_t> open, const AcousticRays& rays, RayPacket16& packet,
                      std::uint32_t& blocked) const;
    struct Flood;
    Flood floodFrom(std::span<const std::uint32_t> open, const glm::dvec3& from, const glm::dvec3& to) const;
    bool meets(std::span<const std::uint32_t> open, const glm::dvec3& from, const glm::dvec3& direction, double length,
               Hit& hit) const;
    /// An upper bound for the shift of a point by rounding to single precision.
    double roundingAt(const glm::dvec3& point) const {
        const glm::dvec3 away = glm::abs(point - rays_->origin());
        return 0x1p-20 * (0x1p-3 + std::max({away.x, away.y, away.z}));
    }
    /// Whether a distance in double precision agrees with the one found in single precision.
    static bool isNearRough(double distance, double rough) {
        return std::abs(distance - rough) < 1e-3 * (1 + std::abs(rough));
    }
    bool meetsPlane(std::uint32_t instance, std::uint32_t triangle, double rough, const AcousticRays& rays, int lane,
                    AcousticHit& hit) const;
    bool meetsLoose(const PacketHits16& found, double rough, double rounding, const AcousticRays& rays, int lane,
                    AcousticHit& hit) const;
    void followMaterials(const PagedArray<AcousticMaterial>& materials);
    std::uint32_t planeOf(std::uint32_t slot, std::uint32_t triangle) const;
    void makeExact(const Hit& found, const Wall& wall, std::uint32_t plane, const glm::dvec3& origin,
                   const glm::dvec3& direction, AcousticHit& hit) const;

    WallsVersion walls_;
    const RayView* rays_ = nullptr;
    std::vector<AcousticMaterial> materials_;
    std::unique_ptr<WallPlanes> planes_;
    std::unique_ptr<EdgeTable> edges_;
    std::unique_ptr<FewWalls> few_;  // all of them, if they are few
    Changes changes_;
    std::vector<std::uint32_t> unsettled_;  // slots whose walls have changed since settle()
    std::vector<char> isUnsettled_;         // by slot
    bool followed_ = false;
    std::uint64_t compared_ = 0;
};

/// A world without some instances, so that the body of a sound source does not block its own sound.
class OpenedGeometry final : public AcousticGeometry {
  public:
    /// `whole` must outlive this object.
    OpenedGeometry(const WorldGeometry& whole, std::vector<std::uint32_t> open)
        : whole_(&whole), open_(std::move(open)) {}

    /// Returns the list of slots, for programs that open the world in every block. The object cannot be used
    /// afterwards.
    std::vector<std::uint32_t> takeOpen() { return std::move(open_); }

    std::span<const ReflectingPlane> planes() const override { return whole_->planes(); }
    std::span<const AcousticMaterial> materials() const override { return whole_->materials(); }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override {
        return whole_->closestBut(open_, origin, direction, maxDistance, except, hit);
    }
    bool blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction, double distance,
                 std::uint32_t except) const override {
        if (open_.empty()) return whole_->blocked(origin, facing, direction, distance, except);
        return AcousticGeometry::blocked(origin, facing, direction, distance, except);
    }
    std::uint32_t closestOf(const AcousticRays& rays, AcousticHits& hits) const override {
        return whole_->closestOfBut(open_, rays, hits);
    }
    std::uint32_t blockedOf(const AcousticRays& rays) const override { return whole_->blockedOfBut(open_, rays); }
    double distanceToSurface(const glm::dvec3& point) const override { return whole_->distanceToSurface(point); }
    void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const override {
        whole_->surfacesNear(point, radius, visit);
    }
    bool trianglesNear(const glm::dvec3& point, double radius, std::vector<WallTriangle>& found) const override {
        return whole_->trianglesNearBut(open_, point, radius, found);
    }
    Passage passage(const glm::dvec3& a, const glm::dvec3& b) const override { return whole_->passageBut(open_, a, b); }
    void visitEdges(const EdgeVisitor& visit) const override { whole_->visitEdgesBut(open_, visit); }
    void visitRoundBodies(const RoundVisitor& visit) const override { whole_->visitRoundBodiesBut(open_, visit); }
    /// The same as WorldGeometry::sealBetween().
    std::optional<Seal> sealBetween(const glm::dvec3& source, const glm::dvec3& listener) const {
        return whole_->sealBetween(open_, source, listener);
    }
    /// The same as WorldGeometry::openings(), with all shapes present.
    RoomOpenings openings(const glm::dvec3& source, std::span<const EscapedRay> exits, const Bands& escaped) const {
        return whole_->openings(source, exits, escaped);
    }

  private:
    const WorldGeometry* whole_;
    std::vector<std::uint32_t> open_;
};

}  // namespace rtsg
