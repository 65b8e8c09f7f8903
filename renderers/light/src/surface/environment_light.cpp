// Lights surfaces by EnvironmentLights where no bounces sample them: matte parts by the half of the surroundings before
// them, glossy parts by the surroundings in the mirror direction.
#include <bit>
#include <cmath>

#include "lighting/environment.h"
#include "surface_packet.h"
#include "texture/bsdf.h"

namespace rtsg::trace {

namespace {

/// GGX of about the width of a highlight of 17.2.2 (Walter et al. 2007, section 5.2: alpha^2 = 2 / (e + 2)).
float roughnessOf(float exponent) {
    return std::sqrt(std::sqrt(2 / (exponent + 2)));
}

/// In the lane's own colour space.
Vec3f shown(const TraceEnvironment& light, const SurfacePacket& s, int lane) {
    const bool linear = s.linear >> lane & 1u;
    const auto inSpace = [&](const Vec3f& v) { return light.color * (linear ? v : srgbFromLinear(v)); };
    const Vec3f normal = s.normal.get(lane), view = s.view.get(lane), base = s.base.get(lane);
    const Vec3f matte = s.occlusion[lane] * inSpace(light.from->matte(light.localFromWorld * normal));
    const Vec3f mirrored = light.localFromWorld * reflectDirection(-view, normal);
    const Vec3f ambient = light.ambient * s.ambient.get(lane);
    if (s.physical >> lane & 1u) {
        const float cosine = std::clamp(glm::dot(normal, view), 0.0f, 1.0f), roughness = s.roughness[lane];
        const EvenlyLit even = evenlyLit(base, s.metallic[lane], roughness, cosine);
        // The part that a mirrored ray brings must not be counted here.
        const Vec3f rays = s.thin >> lane & 1u ? Vec3f(0) : s.gloss(lane, cosine);
        const Vec3f spread = glm::max(even.specular - rays, Vec3f(0));
        return ambient + even.diffuse * matte + spread * inSpace(light.from->blurred(mirrored, roughness));
    }
    Vec3f result = ambient + base * matte;
    const Vec3f specular = s.specular.get(lane);
    if (specular != Vec3f(0)) {
        const float exponent = s.exponent[lane];
        result += specular * highlightAlbedo(exponent) * inSpace(light.from->blurred(mirrored, roughnessOf(exponent)));
    }
    return result;
}

}  // namespace

void addEnvironments(const TraceScene& scene, SurfacePacket& s) {
    // Lanes mostly lie in one scope, and that in none of these lights'.
    const auto firstLit = [&](std::uint32_t scope) {
        std::uint32_t at = scene.environments.start(scope);
        while (at != EnvironmentGroups::kEnd && scene.environments.lightsOf(at).empty())
            at = scene.environments.next(at);
        return at;
    };
    std::uint32_t scope = s.lights[std::countr_zero(s.mask)], first = firstLit(scope);
    if (s.oneInstance && first == EnvironmentGroups::kEnd) return;
    for (std::uint32_t lit = s.mask & ~s.unlit; lit; lit &= lit - 1) {
        const int lane = std::countr_zero(lit);
        if (s.lights[lane] != scope) scope = s.lights[lane], first = firstLit(scope);
        for (std::uint32_t at = first; at != EnvironmentGroups::kEnd; at = scene.environments.next(at))
            for (const TraceEnvironment& light : scene.environments.lightsOf(at))
                s.radiance.add(lane, shown(light, s, lane));
    }
}

}  // namespace rtsg::trace
