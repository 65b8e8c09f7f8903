// ReachRecorder: a geometry that records how far the paths traced in it went, to tell which changes of the world cannot
// have affected them.
//
// All queries of a trace are along a segment or near the listener. Anything outside the box around these does not
// change the answers. Threading: queries from any number of threads; reached() after them.
#pragma once

#include <algorithm>

#include <tbb/enumerable_thread_specific.h>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

class ReachRecorder final : public AcousticGeometry {
  public:
    /// Paths are heard if they are shorter than `longest` metres: farther things are not asked for.
    ReachRecorder(const AcousticGeometry& geometry, double longest) : geometry_(&geometry), longest_(longest) {}

    std::span<const ReflectingPlane> planes() const override { return geometry_->planes(); }
    std::span<const AcousticMaterial> materials() const override { return geometry_->materials(); }
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override {
        const bool met = geometry_->closest(origin, direction, maxDistance, except, hit);
        AcousticBox& box = reached_.local();
        box.extend(origin);
        box.extend(origin + direction * std::min(met ? hit.distance : maxDistance, longest_));
        return met;
    }
    bool blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction, double distance,
                 std::uint32_t except) const override {
        AcousticBox& box = reached_.local();
        box.extend(origin);
        box.extend(origin + direction * std::min(distance, longest_));
        return geometry_->blocked(origin, facing, direction, distance, except);
    }
    std::uint32_t closestOf(const AcousticRays& rays, AcousticHits& hits) const override {
        const std::uint32_t met = geometry_->closestOf(rays, hits);
        AcousticBox& box = reached_.local();
        for (int i = 0; i < rays.count; ++i) {
            const double distance = met >> i & 1 ? hits[static_cast<std::size_t>(i)].distance : rays.maxDistance[i];
            box.extend(rays.origin[i]);
            box.extend(rays.origin[i] + rays.direction[i] * std::min(distance, longest_));
        }
        return met;
    }
    std::uint32_t blockedOf(const AcousticRays& rays) const override {
        AcousticBox& box = reached_.local();
        for (int i = 0; i < rays.count; ++i) {
            box.extend(rays.origin[i]);
            box.extend(rays.origin[i] + rays.direction[i] * std::min(rays.maxDistance[i], longest_));
        }
        return geometry_->blockedOf(rays);
    }
    double distanceToSurface(const glm::dvec3& point) const override { return geometry_->distanceToSurface(point); }
    void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const override {
        geometry_->surfacesNear(point, radius, visit);
    }

    Passage passage(const glm::dvec3& a, const glm::dvec3& b) const override { return geometry_->passage(a, b); }
    const AcousticGeometry& unnoted() const override { return geometry_->unnoted(); }
    void visitEdges(const EdgeVisitor& visit) const override { geometry_->visitEdges(visit); }
    void visitRoundBodies(const RoundVisitor& visit) const override { geometry_->visitRoundBodies(visit); }

    AcousticBox reached() const {
        AcousticBox all;
        for (const AcousticBox& box : reached_) all.extend(box);
        return all;
    }

  private:
    const AcousticGeometry* geometry_;
    double longest_;
    mutable tbb::enumerable_thread_specific<AcousticBox> reached_;
};

/// Whether a change within `box` may alter the traced result: the box overlaps the region of paths, and a path through
/// it need not be longer than `longest`.
inline bool mayReach(const AcousticBox& reached, const glm::dvec3& source, const glm::dvec3& listener, double longest,
                     AcousticBox box) {
    const glm::dvec3 size = glm::max(glm::abs(box.low), glm::abs(box.high));
    const double rounding = 1e-3 + 1e-6 * std::max({size.x, size.y, size.z});
    box.low -= rounding;
    box.high += rounding;
    // Written so that a box which is no number reaches everything.
    return !(box.low.x <= box.high.x) ||
           (reached.meets(box) && !(box.distance(source) + box.distance(listener) > longest));
}

}  // namespace rtsg
