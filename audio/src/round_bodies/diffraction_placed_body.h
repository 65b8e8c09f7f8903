// A round body between a source and a listener: their positions relative to it, and points on its surface.
//
// Threading: const once made.
#pragma once

#include <array>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "diffraction_detour.h"

namespace rtsg {

class PlacedBody {
  public:
    PlacedBody(const RoundBody& body, const glm::dvec3& source, const glm::dvec3& listener);

    const RoundBody& body() const { return body_; }
    /// On the side of less than half a turn, or on the far one.
    const RoundPath& path() const { return path_; }
    RoundPath pathBy(bool far) const;
    /// One of both is in the body, as in a round room.
    bool within() const { return within_; }
    /// How far facets are within the circle at most, m.
    double depth() const;
    /// How much longer than the straight way it is round the body, square to the axis; below 0 behind it.
    double detour() const;
    /// How deep the straight way goes into it, m.
    double covered() const;

    /// A place on its surface, or `off` times as far from its middle; by an angle from the source, and `along` the axis
    /// from there on.
    glm::dvec3 at(double angle, bool far, double along, double off = 1) const;
    glm::dvec3 axis() const { return axis_; }
    /// Along the axis, from the source on, to both ends.
    std::array<double, 2> ends() const { return {-body_.halfLength - fromAlong_, body_.halfLength - fromAlong_}; }
    /// Whether the surface is there, of a part of a cylinder.
    bool has(const glm::dvec3& position) const;

  private:
    double straight() const;  // between both, square to the axis

    RoundBody body_;
    glm::dvec3 axis_{0}, toSource_{0};
    RoundPath path_;
    double fromAlong_ = 0;  // of the source
    bool within_ = false;
};

}  // namespace rtsg
