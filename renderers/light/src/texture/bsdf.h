// Bsdf: how a surface reflects light: value, density and samples of one function, so that sampled lights and bounces
// agree.
//
// Frame: z is the shading normal; `view` and `light` are unit vectors away from the surface. Threading: values.
// Units: those of X3D, in which a white Lambertian surface under a light of intensity 1 head-on shows 1: pi times
// those of radiometry. packet_lights.cpp has value() eight lanes wide.
// Source: glTF 2.0 appendix B, as metallicRoughness() has it (physical); ISO/IEC 19775-1 V4.0 17.2.2 (phong: not
// reciprocal, as the highlight is not multiplied by the cosine; see energyLimited()); Heitz 2018, Journal of Computer
// Graphics Techniques 7, 4 (samples).
#pragma once

#include <algorithm>

#include <rtsg/renderers/material.h>

namespace rtsg::trace {

/// The share of a light's intensity that a PhysicalMaterial shows. It follows glTF (KHR_lights_punctual), in which
/// intensity is irradiance: under a light of intensity 1, a white one shows 1/pi of the value that a white Material
/// shows. Browsers do the same.
constexpr float kPhysicalLight = 0.318309886f;

inline float largest(const Vec3f& v) {
    return std::max({v.x, v.y, v.z});
}

struct BsdfSample {
    Vec3f direction{0, 0, 1};
    Vec3f weight{0};  // value / (pi density): what light from there counts; 0 below the horizon
    float density = 0;
};

class Bsdf {
  public:
    static Bsdf phong(const Vec3f& diffuse, const Vec3f& specular, float exponent);
    static Bsdf physical(const Vec3f& base, float metallic, float roughness);

    /// The light that is reflected towards `view` from a light of intensity 1 in direction `light`, its cosine
    /// included; 0 if either is not above the horizon.
    Vec3f value(const Vec3f& view, const Vec3f& light) const;
    /// The density of sample(), per steradian, also below the horizon.
    float density(const Vec3f& view, const Vec3f& light) const;
    /// `choice`, `u`, `v` in [0, 1). Precondition: view.z > 0.
    BsdfSample sample(const Vec3f& view, float choice, float u, float v) const;
    /// Roughly the share of light that is sent on; not 0 unless all of it is lost.
    Vec3f albedo(float cosView) const;

  private:
    /// Nothing but diffuse: most surfaces, at a fraction of the cost.
    bool isMatte() const { return !physical_ && specular_ == Vec3f(0); }
    /// Probability of sampling the diffuse lobe.
    float diffuseFraction(float cosView) const;

    bool physical_ = false;
    Vec3f base_{0}, specular_{0};
    float exponent_ = 0, metallic_ = 0, roughness_ = 1;
};

/// The shares of uniform light from all directions that glTF's model reflects by its facets and by its diffuse part,
/// within 1 %.
struct EvenlyLit {
    Vec3f specular, diffuse;
};
EvenlyLit evenlyLit(const Vec3f& base, float metallic, float roughness, float cosView);
/// The highlight of 17.2.2 under the same light from all directions, seen head-on, for a specularColor of 1.
float highlightAlbedo(float exponent);
/// specularColor made so small that diffuse and highlight together send on no more than they get.
Vec3f energyLimited(const Vec3f& diffuse, const Vec3f& specular, float exponent);
/// Reduces baseColor so that no more light leaves in direction `cosView` than arrives. glTF's model subtracts from the
/// diffuse part the reflection of a facet half way between light and view, which at grazing views is far less than the
/// reflection of the visible facets: a white dielectric would send on up to one and a half times its light. Views
/// within 55 degrees of the normal, and colours below about .6, stay as they are. Accurate to 1 %.
Vec3f energyLimited(const Vec3f& base, float metallic, float roughness, float cosView);

}  // namespace rtsg::trace
