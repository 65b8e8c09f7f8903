// Finds the light that surfaces mirror, refract and transmit, eight lanes at a time.
#include "surface_branches.h"

#include <bit>

#include "lanes.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// Numbers of the materials of eight lanes.
struct OfMaterials {
    V8 reflectivity;
    F8 index;  // of refraction
};
OfMaterials ofMaterials(const SurfacePacket& s, std::uint32_t lanes, int at) {
    const Material& first = *s.material[at + std::countr_zero(lanes)];
    OfMaterials r{broadcast(first.reflectivity), all(first.refractiveIndex)};
    for (; lanes; lanes &= lanes - 1) {
        const int i = std::countr_zero(lanes);
        const Material& material = *s.material[at + i];
        if (&material == &first) continue;
        r.reflectivity.x[i] = material.reflectivity.x, r.reflectivity.y[i] = material.reflectivity.y;
        r.reflectivity.z[i] = material.reflectivity.z;
        r.index[i] = material.refractiveIndex;
    }
    return r;
}

/// fresnelDielectric().mean().
F8 reflectance(F8 cosine, F8 eta) {
    const F8 sinSquared = (1.0f - cosine * cosine) / (eta * eta);
    const I8 total = sinSquared >= 1.0f;
    const F8 transmitted = sqrt(select(total, all(0), 1.0f - sinSquared));
    const F8 s = (cosine - eta * transmitted) / (cosine + eta * transmitted);
    const F8 p = (eta * cosine - transmitted) / (eta * cosine + transmitted);
    return select(total, all(1), 0.5f * (s * s + p * p));
}

V8 reflected(const V8& direction, const V8& normal) {
    return direction - normal * (2.0f * dot(direction, normal));
}

/// refractDirection(); rubbish where `possible` is not.
V8 refracted(const V8& direction, const V8& normal, F8 eta, I8& possible) {
    const F8 cosine = -dot(direction, normal);
    const F8 sinSquared = (1.0f - cosine * cosine) / (eta * eta);
    possible = sinSquared < 1.0f;
    const F8 along = cosine / eta - sqrt(select(possible, 1.0f - sinSquared, all(0)));
    const V8 out = V8{direction.x / eta, direction.y / eta, direction.z / eta} + normal * along;
    return out * (1.0f / sqrt(dot(out, out)));
}

/// SurfacePacket::gloss(), not above 1.
V8 glossOf(const SurfacePacket& s, int at, F8 cosine) {
    const V8 base = loadV(s.base, at);
    const F8 metallic = load(s.metallic + at), smooth = 1.0f - load(s.roughness + at);
    const F8 m = min(max(1.0f - cosine, all(0)), all(1)), m2 = m * m, m5 = m2 * m2 * m;
    const auto channel = [&](F8 color) {
        const F8 f0 = 0.04f * (1.0f - metallic) + color * metallic;
        return min((f0 + (1.0f - f0) * m5) * (smooth * smooth), all(1));
    };
    return {channel(base.x), channel(base.y), channel(base.z)};
}

}  // namespace

void SurfaceBranches::find(const SurfacePacket& s, std::uint32_t lanes) {
    glass = refracts = 0;
    for (int at = 0; at < 16; at += 8) {
        const std::uint32_t now = lanes >> at & 0xFFu;
        if (!now) continue;
        const OfMaterials own = ofMaterials(s, now, at);
        const I8 isGlass = own.index > 0.0f;
        const bool anyGlass = (laneBits(isGlass) & now) != 0;
        const V8 view = loadV(s.view, at), direction{-view.x, -view.y, -view.z};
        const V8 normal = loadV(s.normal, at), facing = facing8(s, at);
        const F8 cosine = min(max(dot(normal, view), all(0)), all(1)), opacity = load(s.opacity + at);
        const V8 one = broadcast(Vec3f(1)), rest = one - own.reflectivity;
        V8 ofMirror = own.reflectivity, ofBody = rest, hides = rest;
        V8 straight = own.reflectivity * (1.0f - opacity) + V8{opacity, opacity, opacity};
        if (anyGlass) {
            const F8 eta = select(isGlass, load(s.eta + at), all(1));
            const F8 fraction = select(isGlass, reflectance(cosine, eta), all(0));
            ofMirror = ofMirror + rest * fraction;
            ofBody = hides = rest * (1.0f - fraction);
            straight = select(isGlass, one, straight);
            I8 possible, again;
            const V8 out = refracted(direction, normal, eta, possible);
            // A shading normal may bend out of the surface; the true one never does.
            const V8 other = refracted(direction, facing, eta, again);
            const I8 leaves = dot(out, facing) >= 0.0f;
            storeV(bent, at, select(leaves, select(again, other, direction), out));
            glass |= (laneBits(isGlass) & now) << at, refracts |= (laneBits(possible & isGlass) & now) << at;
        }
        if ((s.physical & ~s.thin) >> at & now) {
            // The diffuse part already is what Fresnel leaves, so `body` stays whole. The gloss of a clear surface is
            // as clear as the rest (glTF 2.0, 3.9.4: alpha is coverage).
            const I8 glossy = lanesFrom(s.physical & ~s.thin, at) & ~isGlass;
            const V8 gloss = glossOf(s, at, cosine);
            ofMirror = select(glossy, ofMirror + rest * gloss * opacity, ofMirror);
            hides = select(glossy, rest * (one - gloss), hides);
        }
        storeV(mirror, at, ofMirror), storeV(body, at, ofBody), storeV(passing, at, ofBody);
        storeV(whole, at, straight), storeV(covering, at, hides);
        // The same of mirrors.
        const V8 out = reflected(direction, normal);
        storeV(mirrored, at, select(dot(out, facing) <= 0.0f, reflected(direction, facing), out));
        storeV(before, at, leave8(s, at, facing)), storeV(behind, at, leave8(s, at, V8{} - facing));
    }
}

}  // namespace rtsg::trace
