// SkyLight: directions towards a sky, or all that comes from infinitely far, chosen by how much comes from there.
//
// The directions are cut into cells, a grid on each side of the cube that panoramas are shown on; a cell is chosen by
// its light (luminance times solid angle), a direction within it evenly over its part of the side.
// Invariant: a direction that anything comes from has a density above 0, and density() is the one that sample()
// chooses with. Threading: const once built. Source: Pharr, Jakob & Humphreys 2023, 12.5 (light of images).
#pragma once

#include <functional>
#include <vector>

#include <rtsg/renderers/camera.h>

namespace rtsg::trace {

class SkyLight {
  public:
    /// Cells a side: as many as a picture there has pixels, within limits; fewer where colours only run into each
    /// other.
    explicit SkyLight(const Sky& sky);
    /// `radiance` of a unit direction in world space. The cells are at least `detail` to a side, within limits, along
    /// the axes of a frame of its own.
    SkyLight(const std::function<Vec3f(const Vec3f&)>& radiance, std::size_t detail, const glm::mat3& localFromWorld);

    /// How many times the mean the brightest direction is; 0 for a black sky. Bounces find the light of an even sky as
    /// well as anything does.
    float unevenness() const { return unevenness_; }

    struct Choice {
        Vec3f direction{0, 1, 0};  // unit, world space
        float density = 0;         // per steradian
    };
    /// `u`, `v` in [0, 1).
    Choice sample(float u, float v) const;
    float density(const Vec3f& direction) const;

  private:
    /// `row`: of all sides' rows.
    float densityOn(Vec2f st, std::size_t row, std::size_t cell) const;

    std::size_t cells_ = 0;      // a side's, across and down
    std::vector<float> rows_;    // light of all rows up to this one, of all six sides, as shares
    std::vector<float> within_;  // of each row: light of its cells up to this one
    glm::mat3 localFromWorld_{1.0f};
    float unevenness_ = 0;
};

}  // namespace rtsg::trace
