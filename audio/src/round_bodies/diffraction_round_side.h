// One side of a round body between two points: the path by it, where the path touches it, and the pressure of that
// path.
//
// Threading: const once made.
#pragma once

#include <array>
#include <complex>
#include <cstddef>

#include <glm/glm.hpp>

#include "diffraction_detour.h"
#include "diffraction_placed_body.h"

namespace rtsg {

class RoundSide {
  public:
    /// The side of less than half a turn, or the far one.
    RoundSide(const PlacedBody& placed, bool far);

    const PlacedBody& placed() const { return placed_; }
    const Detour& path() const { return detour_; }
    bool far() const { return far_; }
    bool lit() const { return detour_.lit(); }
    /// The places where it comes to the body and where it leaves.
    const glm::dvec3& first() const { return first_; }
    const glm::dvec3& last() const { return last_; }
    /// The unit direction from which it comes at a place; next to the surface that lies along it.
    glm::dvec3 arriving(const glm::dvec3& last, const glm::dvec3& listener) const;

    /// Whether the surface is there where it touches.
    bool touches() const { return placed_.has(first_) && placed_.has(last_); }
    /// Whether it leads past an end of a cylinder, the lower one or the upper one.
    std::array<bool, 2> past() const;
    /// Whether the body is between both places, on this side.
    bool hides() const;

    /// Relative to the phase of its length: in the shadow the whole field of this side; in the light the part beside
    /// direct sound, of which the surface reflects the share `mirrors`. `beside`: there is direct sound, too, whatever
    /// the light.
    std::complex<double> pressure(bool beside, double waveNumber, double mirrors) const;
    /// The pressure that an end of a cylinder takes away, or leaves past the end, relative to the phase of the way by
    /// it.
    std::complex<double> byEnd(std::size_t end, double waveNumber) const;
    /// The length of the way by an end.
    double lengthByEnd(std::size_t end) const;

  private:
    PlacedBody placed_;
    bool far_;
    Detour detour_;
    glm::dvec3 first_, last_;
};

}  // namespace rtsg
