// OpeningFinder: follows a ray that escaped to the opening, and finds the rim of the opening with other rays.
//
// Threading: one thread an object.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/room_openings.h>
#include <rtsg/renderers/ray_view.h>

#include "outline.h"

namespace rtsg::opening {

/// An opening as rays felt it.
struct Felt {
    Outline outline;
    std::map<std::uint32_t, double> beside;  // slots, and metres of the rim
    std::size_t boundaryEdges = 0;
};

class OpeningFinder {
  public:
    /// `rays` must outlive it.
    OpeningFinder(const RayView& rays, const glm::dvec3& source);
    bool outdoors() const { return !(radius_ > 0) || sky_ >= kOutdoors; }
    double volume() const { return volume_; }

    /// None if it went through none that has a rim all around.
    std::optional<Felt> feel(const EscapedRay& ray);

  private:
    static constexpr int kDirections = 96;
    /// The source is outdoors if this share of its view is sky.
    static constexpr double kOutdoors = 0.3;

    void look(const glm::dvec3& source);
    bool seesSky(const glm::dvec3& at, double fraction) const;
    Hit meet(const glm::dvec3& from, const glm::dvec3& direction) const;
    bool goesOn(const glm::dvec3& from, const glm::dvec3& direction, double wall, double sky, Hit& met) const;
    std::optional<glm::dvec3> positionBefore(const EscapedRay& ray) const;
    std::optional<Outline> firstLook(const glm::dvec3& before, const glm::dvec3& direction) const;
    bool open(const Outline& outline, const glm::dvec2& at, Hit& met) const;
    struct Rim;
    bool feelRim(const Outline& about, int directions, int halvings, Rim& rim) const;
    static void tilt(Outline& outline, Rim& rim);
    void takeBoundary(Felt& felt);

    const RayView& rays_;
    std::array<Vec3f, kDirections> directions_;
    glm::dvec3 middle_{0};
    double radius_ = 0, sky_ = 1, volume_ = 0;
    std::map<const Mesh*, std::vector<std::vector<Vec3f>>> loops_;  // of meshes that were asked about
};

}  // namespace rtsg::opening
