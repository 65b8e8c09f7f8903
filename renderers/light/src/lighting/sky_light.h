// SkyLight: samples directions towards the sky and other light from infinitely far away, by their contribution.
//
// The colours of a Background are rings (SkyBands). The directions of pictures are divided into cells (SkyCells), in
// grids along the pictures' pixels. One of these is chosen in proportion to its light.
// Invariant: a direction with any light has a density above 0, and density() is the one that sample() uses. Threading:
// const once built. Source: Pharr, Jakob & Humphreys 2023, 12.5 (light of images); Veach 1997, 9.2 (one sample of
// several techniques).
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include <rtsg/renderers/sky.h>

#include "environment.h"
#include "sky_bands.h"

namespace rtsg::trace {

/// Light from infinitely far, in a frame of its own.
struct FarLight {
    enum class Shape : std::uint8_t { cube, panorama };
    Shape shape = Shape::cube;  // of its pictures
    std::size_t detail = 0;     // pixels of a side of the cube, or of the panorama's height
    glm::mat3 localFromWorld{1.0f};
    /// From a unit direction, averaged over `footprint` of a side of the cube, or of the panorama's height, about it.
    std::function<Vec3f(const Vec3f& direction, float footprint)> radiance;
    Environment::Source source{};  // which tells it, and in which colour
    Vec3f color{1};
    /// The same from a place in its picture, whose corners are (0, 0) and (1, 1); where there is one.
    std::function<Vec3f(std::size_t side, Vec2f point, float footprint)> inPicture{};
};

/// A cell is chosen by its light (luminance times solid angle), a direction within it evenly over its part of the
/// picture. There are as many as the picture has pixels, within limits.
class SkyCells {
  public:
    explicit SkyCells(const FarLight& of);
    double light() const { return light_; }  // luminance, integrated over all directions
    float peak() const { return peak_; }     // of luminance

    /// In its own frame.
    SkyBands::Choice sample(float u, float v) const;
    float density(const Vec3f& direction) const;

  private:
    /// Luminance times spreadAt() at the corners, edges and middles of all cells, line by line; finds the peak.
    std::vector<float> lookAround(const FarLight& of);
    Vec3f directionAt(std::size_t row, Vec2f st) const;
    float spreadAt(Vec2f st) const;
    /// `row`: of all sides' rows.
    float densityOn(Vec2f st, std::size_t row, std::size_t cell) const;

    FarLight::Shape shape_;
    std::size_t down_ = 0, across_ = 0;  // cells of a side, or of the panorama
    std::vector<float> rows_;            // light of all rows up to this one, of all sides, as shares
    std::vector<float> within_;          // of each row: light of its cells up to this one
    double light_ = 0;
    float peak_ = 0;
};

class SkyLight {
  public:
    explicit SkyLight(const Sky& sky) : SkyLight(&sky, {}) {}
    /// The light of a sky (null: none) and more.
    SkyLight(const Sky* sky, const std::vector<FarLight>& more);

    /// How many times the mean the brightest direction is, or a little more; 0 for a black sky. Bounces find the light
    /// of an even sky as well as anything does.
    float unevenness() const { return unevenness_; }

    using Choice = SkyBands::Choice;  // world space
    /// `u`, `v` in [0, 1).
    Choice sample(float u, float v) const;
    float density(const Vec3f& direction) const;

  private:
    struct Part {
        SkyCells cells;
        glm::mat3 localFromWorld{1.0f};
        float fraction = 0;  // of the choices
    };
    SkyBands bands_;
    glm::mat3 bandsFromWorld_{1.0f};
    float bandsFraction_ = 0;
    std::vector<Part> parts_;  // that give light
    float unevenness_ = 0;
};

/// The sky of the last picture, for as long as it is the same. Threading: any.
class SkyTable {
  public:
    /// The light of a sky (null: none) and of more sources, from a table if there is one. Precondition: everything in
    /// `more` has a source, or there is no table.
    static std::shared_ptr<const SkyLight> of(SkyTable* table, const Sky* sky, std::vector<FarLight> more);

  private:
    bool holds(const Sky* sky, const std::vector<FarLight>& more) const;

    std::mutex mutex_;
    std::optional<Sky> sky_;      // of `last_`
    std::vector<FarLight> more_;  // the same, without their functions
    std::shared_ptr<const SkyLight> last_;
};

}  // namespace rtsg::trace
