// Formulas of light: X3D's lights and fog, Fresnel's equations, refraction. There are only pure functions.
//
// Lengths in metres, angles in radians, all directions unit vectors. Threading: re-entrant.
// Source: ISO/IEC 19775-1 V4.0 17.2.2 (lighting equations), 24.4.2 (fog); Fresnel's equations as in Born & Wolf,
// Principles of Optics, 1.5.2; glTF 2.0, appendix B, for metallic-roughness, but for what metallicRoughness() says.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <rtsg/core/value.h>

namespace rtsg {

/// 1 / max(a1 + a2 r + a3 r^2, 1).
inline float attenuationAt(const Vec3f& attenuation, float distance) {
    return 1 / std::max(attenuation.x + distance * (attenuation.y + distance * attenuation.z), 1.0f);
}

/// 1 up to beamWidth, then linear in the angle down to 0 at cutOffAngle. beamWidth > cutOffAngle: all of the cone is 1.
inline float spotFactor(float angle, float beamWidth, float cutOffAngle) {
    if (angle >= cutOffAngle) return 0;
    if (angle <= beamWidth) return 1;
    return (angle - cutOffAngle) / (beamWidth - cutOffAngle);
}

enum class FogType : std::uint8_t { none, linear, exponential };

/// The share of the surface's own colour that is left at `distance`; the rest is the fog's. Before the fog, all of it.
inline float fogFactor(FogType type, float visibilityRange, float distance) {
    if (type == FogType::none || !(visibilityRange > 0) || distance <= 0) return 1;
    if (distance >= visibilityRange) return 0;
    if (type == FogType::linear) return (visibilityRange - distance) / visibilityRange;
    return std::exp(-distance / (visibilityRange - distance));
}

/// Power reflectances of a smooth boundary between dielectrics.
struct Reflectance {
    float s = 1, p = 1;  // polarised across, and in, the plane of incidence
    float mean() const { return 0.5f * (s + p); }
};

/// `cosIncident` in [0, 1]; `eta` = index on the far side / index on the near side. Total reflection gives 1, 1.
inline Reflectance fresnelDielectric(float cosIncident, float eta) {
    const float sinSquared = (1 - cosIncident * cosIncident) / (eta * eta);
    if (sinSquared >= 1) return {};
    const float cosTransmitted = std::sqrt(1 - sinSquared);
    const float s = (cosIncident - eta * cosTransmitted) / (cosIncident + eta * cosTransmitted);
    const float p = (eta * cosIncident - cosTransmitted) / (eta * cosIncident + cosTransmitted);
    return {s * s, p * p};
}

/// Schlick's approximation; `normalIncidence` is the reflectance seen head-on.
inline Vec3f fresnelSchlick(const Vec3f& normalIncidence, float cosIncident) {
    const float m = std::clamp(1 - cosIncident, 0.0f, 1.0f), m2 = m * m;
    return normalIncidence + (Vec3f(1) - normalIncidence) * (m2 * m2 * m);
}

/// Mirror direction of `direction`, which travels towards the surface; `normal` on either side.
inline Vec3f reflectDirection(const Vec3f& direction, const Vec3f& normal) {
    return direction - 2 * glm::dot(direction, normal) * normal;
}

/// Snell's law. `normal` on the side `direction` comes from. Empty when all is reflected.
inline std::optional<Vec3f> refractDirection(const Vec3f& direction, const Vec3f& normal, float eta) {
    const float cosIncident = -glm::dot(direction, normal);
    const float sinSquared = (1 - cosIncident * cosIncident) / (eta * eta);
    if (sinSquared >= 1) return std::nullopt;
    return glm::normalize(direction / eta + (cosIncident / eta - std::sqrt(1 - sinSquared)) * normal);
}

/// pi * GGX's distribution of the facets' normals; `alphaSquared` is the fourth power of glTF's roughness.
inline float ggx(float cosHalf, float alphaSquared) {
    const float d = cosHalf * cosHalf * (alphaSquared - 1) + 1;
    return alphaSquared / (d * d);
}

/// pi * BRDF of glTF's metallic-roughness model, so that a white Lambertian surface gives 1 as X3D's diffuse term does.
/// It differs from glTF 2.0, appendix B, in two terms. Masking and shadowing are correlated by height (Heitz 2014),
/// which the appendix calls more accurate than its own independent form, and which Khronos' viewer has. The diffuse
/// part is reduced by Fresnel's term of the mixed f0, not of .04 for the dielectric share: this is equal at a metallic
/// of 0 and 1, and darker between. The caller clamps the cosines to the horizon.
inline Vec3f metallicRoughness(const Vec3f& baseColor, float metallic, float roughness, float cosLight, float cosView,
                               float cosHalf, float cosLightHalf) {
    const Vec3f f0 = glm::mix(Vec3f(0.04f), baseColor, metallic);
    const Vec3f fresnel = fresnelSchlick(f0, cosLightHalf);
    const float alpha = std::max(roughness * roughness, 1e-3f), a2 = alpha * alpha;
    const float distribution = ggx(cosHalf, a2);
    const float masking = cosLight * std::sqrt(cosView * cosView * (1 - a2) + a2) +
                          cosView * std::sqrt(cosLight * cosLight * (1 - a2) + a2);
    const float specular = masking > 0 ? 0.5f * distribution / masking : 0;
    return (Vec3f(1) - fresnel) * (1 - metallic) * baseColor + fresnel * specular;
}

}  // namespace rtsg
