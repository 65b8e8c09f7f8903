// PlaneIndex and PlaneMerger: find the surfaces that lie in one plane, by hashing, in constant time each.
//
// Two planes are the same if their normals (of either sign) and the surfaces on them agree within tolerances. Numbers
// of erased planes are reused, so that the numbers stay dense.
// Threading: one thread writes; const members from any number.
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>

namespace rtsg {

struct PlaneTolerance {
    double angle = 1e-3;     // radians
    double distance = 1e-4;  // metres, of surface points from the plane
};

class PlaneIndex {
  public:
    explicit PlaneIndex(const PlaneTolerance& tolerance = {}) : tolerance_(tolerance) {}

    /// The plane with this unit normal that contains all `points`; kNoPlane if there is none yet.
    std::uint32_t find(const glm::dvec3& normal, std::span<const glm::dvec3> points) const;
    std::uint32_t insert(const ReflectingPlane& plane);
    void erase(std::uint32_t plane);
    /// The equation may be made more precise within the tolerance; bounds and other members belong to the caller.
    ReflectingPlane& operator[](std::uint32_t plane) { return entries_[plane].plane; }
    const ReflectingPlane& operator[](std::uint32_t plane) const { return entries_[plane].plane; }
    /// Numbers in use are below this.
    std::size_t size() const { return entries_.size(); }
    std::size_t count() const { return entries_.size() - free_.size(); }

  private:
    struct Entry {
        ReflectingPlane plane;
        std::uint64_t key = 0;
        std::uint32_t next = kNoPlane;  // in the same hash bucket
    };
    std::uint32_t findOneSided(const glm::dvec3& normal, std::span<const glm::dvec3> points) const;

    PlaneTolerance tolerance_;
    std::vector<Entry> entries_;
    std::vector<std::uint32_t> free_;
    std::unordered_map<std::uint64_t, std::uint32_t> buckets_;
};

/// Finds the planes of a set of triangles.
class PlaneMerger {
  public:
    explicit PlaneMerger(const PlaneTolerance& tolerance = {}) : index_(tolerance) {}

    /// The number of the triangle's plane; kNoPlane for a triangle with no area or with non-finite coordinates.
    std::uint32_t add(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c);
    std::size_t count() const { return parts_.size(); }
    /// The planes, with their bounding spheres. Leaves the merger empty.
    std::vector<ReflectingPlane> finish();

  private:
    struct Part {
        double area = 0;  // of the largest triangle, the one that defines the plane
        glm::dvec3 low{0}, high{0};
    };
    PlaneIndex index_;
    std::vector<Part> parts_;
};

}  // namespace rtsg
