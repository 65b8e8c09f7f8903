// SkyBands: samples directions towards the colours of a Background, between its angles, by their contribution.
//
// The colours depend only on the angle from the zenith, between angles that the node gives. So rings between those
// angles, divided further, cover the sky, however small one is. A ring is chosen by its light (integral of luminance
// over solid angle), and a direction within it evenly. Angles are measured from the nearer pole by the square of the
// sine of their half, so that a ring of a millionth of a radian keeps its digits.
// Invariant: density() is the one that sample() uses. Threading: const once built.
// Source: ISO/IEC 19775-1 V4.0 24.2.1 (Background); Gauss-Legendre quadrature.
#pragma once

#include <span>
#include <vector>

#include <rtsg/renderers/sky.h>

namespace rtsg::trace {

class SkyBands {
  public:
    SkyBands() = default;
    /// Counts the colours of a Background where its pictures leave them visible.
    explicit SkyBands(const Sky& sky);

    double light() const { return light_; }  // luminance, integrated over all directions
    float peak() const { return peak_; }     // of luminance

    struct Choice {
        Vec3f direction{0, 1, 0};  // unit, in the sky's frame
        float density = 0;         // per steradian
    };
    /// `u`, `v` in [0, 1).
    Choice sample(float u, float v) const;
    float density(const Vec3f& direction) const;

  private:
    /// From the nearer pole, by the square of the sine of half the angle, up to 1/2.
    struct Ring {
        float from = 0, to = 0, density = 0;
    };
    std::vector<Ring> rings_;  // around the zenith, then those around the nadir, outwards each
    std::vector<float> ends_;  // their `to`
    std::vector<float> sums_;  // light of all up to this one, as shares
    std::size_t above_ = 0;    // rings around the zenith
    double light_ = 0;
    float peak_ = 0;
};

/// The first entry that is above `u`; one that has a share.
std::size_t pickFraction(std::span<const float> sums, float u);
/// The place of `u` between two sums, in [0, 1).
float insideFraction(std::span<const float> sums, std::size_t at, float u);
/// Finite, and not below 0.
float skyLuminance(const Vec3f& color);

}  // namespace rtsg::trace
