// Bsdf8: Bsdf of eight surfaces at a time, for paths that go together.
//
// The same formulas in the same units as bsdf.h; powers, sines and cosines are those of lane_math.h, so numbers differ
// from Bsdf's by some roundings (below 1e-4 of them). Preconditions: view.z > 0; directions have length 1. Threading:
// values. Source: as bsdf.h.
#pragma once

#include <numbers>

#include "bsdf.h"
#include "mesh/simd8.h"

namespace rtsg::trace {

class Bsdf8 {
  public:
    using F8 = simd::F8;
    using I8 = simd::I8;
    using V8 = simd::V8;

    /// `physical`: all ones in the lanes of PhysicalMaterials, which have no specular and no exponent; the others are
    /// Phong's and have neither metallic nor roughness. `cosView`: view.z.
    Bsdf8(I8 physical, const V8& base, const V8& specular, F8 exponent, F8 metallic, F8 roughness, F8 cosView)
        : physical_(physical),
          base_(base),
          specular_(specular),
          exponent_(exponent),
          metallic_(metallic),
          alpha_(simd::max(roughness * roughness, simd::all(1e-3f))) {
        using namespace simd;
        anyPhysical_ = any(physical), anyPhong_ = any(~physical);
        const F8 dielectric = 0.04f * (1 - metallic);
        headOn_ = {dielectric + base.x * metallic, dielectric + base.y * metallic, dielectric + base.z * metallic};
        F8 glossy = largest(specular) * (8 / (exponent + 2) * (1 - exp2Of(-0.5f * (exponent + 2))));
        F8 diffuse = largest(base);
        if (anyPhysical_) {
            const V8 fresnel = fresnelOf(cosView);
            const F8 mirrored = largest(fresnel);
            glossy = select(physical, mirrored, glossy);
            diffuse = select(physical, (1 - mirrored) * (1 - metallic) * diffuse, diffuse);
        }
        const F8 sum = diffuse + glossy;
        sends_ = sum > 0.0f;
        diffuseFraction_ = select(sends_, diffuse / sum, all(1));
    }

    /// All ones in the lanes that send on any light.
    I8 sends() const { return sends_; }

    struct Evaluated {
        V8 value;    // as Bsdf::value()
        F8 density;  // as Bsdf::density(), and 0 below the horizon
    };
    Evaluated evaluate(const V8& view, const V8& light) const {
        using namespace simd;
        constexpr float kPi = std::numbers::pi_v<float>;
        const I8 above = light.z > 0.0f;
        const V8 sum = view + light;
        const F8 length = sqrt(dot(sum, sum));
        const V8 half = sum * select(length > 1e-20f, 1 / length, all(0));
        V8 value{};
        F8 glossy{};
        if (anyPhong_) phong(view, light, half, value, glossy);
        if (anyPhysical_) physical(view, light, half, value, glossy);
        const F8 density = diffuseFraction_ * light.z * (1 / kPi) + (1 - diffuseFraction_) * glossy;
        return {select(above, value, V8{}), select(above, density, all(0))};
    }

    /// A direction for each, not always above the horizon. `choice`, `u`, `v` in [0, 1).
    V8 sample(const V8& view, F8 choice, F8 u, F8 v) const {
        using namespace simd;
        F8 sine, cosine;
        sinCosRevolutions(v, sine, cosine);
        const I8 scatters = choice < diffuseFraction_;
        const F8 radius = sqrt(u);
        const V8 diffuse{radius * cosine, radius * sine, sqrt(1 - u)};
        if (!any(~scatters)) return diffuse;
        V8 half{};
        if (anyPhong_) {
            const F8 c = power(1 - u, 1 / (exponent_ + 1)), s = sqrt(max(1 - c * c, all(0)));
            half = {s * cosine, s * sine, c};
        }
        if (anyPhysical_) half = select(physical_, visibleNormal(view, radius * cosine, radius * sine), half);
        const V8 out = unit(half * (2 * dot(view, half)) - view);
        return select(scatters, diffuse, out);
    }

  private:
    static F8 largest(const V8& v) { return simd::max(simd::max(v.x, v.y), v.z); }
    static V8 unit(const V8& v) { return v * (1 / simd::sqrt(simd::max(simd::dot(v, v), simd::all(1e-30f)))); }

    V8 fresnelOf(F8 cosine) const {
        const F8 m = simd::min(simd::max(1 - cosine, simd::all(0)), simd::all(1)), m2 = m * m, m5 = m2 * m2 * m;
        return {headOn_.x + (1 - headOn_.x) * m5, headOn_.y + (1 - headOn_.y) * m5, headOn_.z + (1 - headOn_.z) * m5};
    }

    /// Puts the reflected light into the lanes of `value`, and the probability of the highlight's lobe into `glossy`.
    void phong(const V8& view, const V8& light, const V8& half, V8& value, F8& glossy) const {
        using namespace simd;
        const F8 shine = power(min(max(half.z, all(0)), all(1)), exponent_), along = absolute(dot(view, half));
        value = base_ * light.z + specular_ * shine;
        const F8 spread = along * (8 * std::numbers::pi_v<float>);
        glossy = select(along > 0.0f, (exponent_ + 1) * shine / spread, all(0));
    }
    void physical(const V8& view, const V8& light, const V8& half, V8& value, F8& glossy) const {
        using namespace simd;
        const F8 a2 = alpha_ * alpha_, d = half.z * half.z * (a2 - 1) + 1, facets = a2 / (d * d);
        const F8 masked =
            light.z * sqrt(view.z * view.z * (1 - a2) + a2) + view.z * sqrt(light.z * light.z * (1 - a2) + a2);
        const F8 mirrors = select(masked > 0.0f, 0.5f * facets / masked, all(0)), body = 1 - metallic_;
        const V8 f = fresnelOf(max(dot(light, half), all(0)));
        const V8 shown{((1 - f.x) * body * base_.x + f.x * mirrors) * light.z,
                       ((1 - f.y) * body * base_.y + f.y * mirrors) * light.z,
                       ((1 - f.z) * body * base_.z + f.z * mirrors) * light.z};
        value = select(physical_, shown, value);
        const F8 v2 = view.z * view.z, masking = 2 / (1 + sqrt(1 + a2 * max(1 - v2, all(0)) / v2));
        const F8 likely = masking * facets / (4 * std::numbers::pi_v<float> * view.z);
        const I8 seen = (half.z > 0.0f) & (absolute(dot(view, half)) > 0.0f);
        glossy = select(physical_, select(seen, likely, all(0)), glossy);
    }

    /// `x`, `y`: even points of the disk of radius 1.
    V8 visibleNormal(const V8& view, F8 x, F8 y) const {
        using namespace simd;
        const V8 s = unit({alpha_ * view.x, alpha_ * view.y, view.z});
        const F8 blend = 0.5f * (1 + s.z);
        // Across: z cross s.
        const F8 flat = 1 / sqrt(max(s.x * s.x + s.y * s.y, all(1e-30f)));
        const I8 leans = s.z < 0.9999f;
        const F8 ax = select(leans, -s.y * flat, all(1)), ay = select(leans, s.x * flat, all(0));
        const V8 along{-s.z * ay, s.z * ax, s.x * ay - s.y * ax};
        const F8 up = (1 - blend) * sqrt(max(1 - x * x, all(0))) + blend * y;
        const F8 out = sqrt(max(1 - x * x - up * up, all(0)));
        const V8 h = V8{ax, ay, all(0)} * x + along * up + s * out;
        return unit({alpha_ * h.x, alpha_ * h.y, max(h.z, all(1e-6f))});
    }

    I8 physical_, sends_;
    bool anyPhysical_, anyPhong_;
    V8 base_, specular_, headOn_;
    F8 exponent_, metallic_, alpha_, diffuseFraction_;
};

/// energyLimited() of PhysicalMaterials, bit for bit.
simd::V8 energyLimited(const simd::V8& base, simd::F8 metallic, simd::F8 roughness, simd::F8 cosView);

}  // namespace rtsg::trace
