// Environment: the light from all around, infinitely far away, that an EnvironmentLight's pictures or coefficients
// describe.
//
// The node describes one light twice: as mirrors show it (specularTexture), and as matte surfaces show it
// (diffuseTexture, else diffuseCoefficients). If one description is missing it is made from the other: matte surfaces
// show the convolution with the cosine; and a light of spherical harmonics up to degree 2 that makes surfaces look as
// described stands for pictures of mirrors. With neither, the light is 1 from everywhere. Directions are unit vectors
// in the light's own frame; everything is linear light. Threading: immutable; what whitted alone needs is made when it
// is first asked for. Source: ISO/IEC CD 19775-1 V4.1 17.4.2; glTF's EXT_lights_image_based (coefficients are those of
// irradiance); Ramamoorthi & Hanrahan 2001; Karis 2013 (blurred copies by roughness).
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include <rtsg/renderers/space_texture.h>

namespace rtsg::trace {

/// Nine coefficients of real spherical harmonics, by (degree, order): (0,0), (1,-1), (1,0), (1,1), (2,-2) ... (2,2).
using Harmonics = std::array<Vec3f, 9>;
/// Their sum towards a unit direction.
Vec3f sumOf(const Harmonics& coefficients, const Vec3f& direction);

class Environment {
  public:
    struct Source {
        std::shared_ptr<const SpaceTexture> specular, diffuse;
        std::optional<Harmonics> irradiance;  // not yet over pi
        friend bool operator==(const Source&, const Source&) = default;
    };
    explicit Environment(Source source);
    const Source& source() const { return source_; }

    /// The radiance from a direction, averaged over `width` radians.
    Vec3f radiance(const Vec3f& direction, float width = 0) const;
    /// The same from a place of its picture, on a side of the cube or round all. Precondition: it has one.
    Vec3f radianceInPicture(std::size_t side, Vec2f point, float width) const;
    /// The light that a white matte surface reflects: its irradiance over pi.
    Vec3f matte(const Vec3f& normal) const;
    /// The radiance around a direction, blurred as facets of this roughness (0 to 1) do for a view along their normal.
    Vec3f blurred(const Vec3f& direction, float roughness) const;
    /// Does the work of the first matte(), and if `glossy` of the first blurred(), on all cores; else it is done when
    /// it is wanted, while others wait.
    void prepare(bool glossy) const;
    /// Pixels of a quarter turn of its picture; 0: it has none.
    std::size_t detail() const;
    /// Whether that is one round all, rather than the six sides of a cube.
    bool isPanorama() const { return source_.specular && source_.specular->layers().size() != 6; }
    /// The same from all directions.
    bool isEven() const { return !source_.specular && !low_; }

  private:
    /// Values at places of a cube's sides, edges and corners included, so that sides meet without a seam.
    class Grid {
      public:
        template <class F>
        Grid(std::size_t side, const F& valueAt);
        Vec3f at(const Vec3f& direction) const;

      private:
        std::size_t side_;
        std::vector<Vec3f> values_;
    };
    static constexpr int kLevels = 6;  // of roughness, beside the sharp one

    void findMatte() const;
    void findBlurred() const;
    Grid convolved() const;
    /// A facet of GGX seen along the surface's normal: its own normal, and the weight of its reflected light.
    struct Facet {
        float across, along, outwards;
        float weight, width;
    };
    static std::vector<Facet> facetsOf(float roughness);
    Vec3f spread(const Vec3f& direction, const std::vector<Facet>& facets) const;

    Source source_;
    std::optional<Harmonics> low_;  // the light, where no picture of mirrors tells it
    mutable std::once_flag matteOnce_, blurredOnce_;
    mutable std::optional<Grid> matte_;
    mutable std::vector<Grid> blurred_;
};

}  // namespace rtsg::trace
