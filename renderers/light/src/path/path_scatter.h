// Scatters light at eight surfaces of paths: weighs sampled light against light that bounces find, and chooses the
// directions in which paths continue.
//
// Conventions: `facing` is the true surface's normal on the viewer's side. Threading: values. Source: Veach 1997,
// section 9.2.
#pragma once

#include <limits>
#include <numbers>

#include "mesh/simd8.h"
#include "texture/bsdf8.h"

namespace rtsg::simd {

inline F8 largest(const V8& v) {
    return max(max(v.x, v.y), v.z);
}

}  // namespace rtsg::simd

namespace rtsg::trace {

/// Below minus this the other side's vectors are taken: not at 0, or those of a wall along an axis would be one or the
/// other by what its normal is rounded by.
constexpr float kUpright = 0x1p-10f;
/// Two unit vectors square to a unit vector and each other (Duff et al. 2017).
inline void basis(const simd::V8& n, simd::V8& s, simd::V8& t) {
    using namespace simd;
    const F8 sign = select(n.z < -kUpright, all(-1), all(1)), a = -1 / (sign + n.z), b = n.x * n.y * a;
    s = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    t = {b, sign + n.y * n.y * a, -n.y};
}

/// The directions around eight shading normals, and the views in them.
struct Frame8 {
    simd::V8 x, y, z, facing, view;
    /// `back`: unit, towards the viewer.
    Frame8(const simd::V8& normal, const simd::V8& facesUs, const simd::V8& back) : z(normal), facing(facesUs) {
        using namespace simd;
        basis(z, x, y);
        const F8 cosine = min(max(dot(z, back), all(1e-4f)), all(1));
        const V8 seen{dot(back, x), dot(back, y), cosine};
        view = seen * (1 / simd::sqrt(dot(seen, seen)));
    }
    simd::V8 local(const simd::V8& v) const { return {dot(v, x), dot(v, y), dot(v, z)}; }
    /// A smooth normal's half space reaches below the true surface, where nothing comes from. Directions below it are
    /// taken from the same angle above.
    simd::V8 mirrored(const simd::V8& v) const { return v - facing * (2 * dot(v, facing)); }
};

/// The light that a white matte surface reflects of a radiance of 1 from a direction. `density` is that of looking
/// there, per steradian; it is infinite if no bounce can come from there.
inline simd::F8 shownMatte(const simd::V8& direction, simd::F8 density, const simd::V8& normal,
                           const simd::V8& facing) {
    using namespace simd;
    constexpr float kPerPi = 1 / std::numbers::pi_v<float>;
    const F8 straight = dot(direction, normal);
    const F8 mirrored = straight - 2 * dot(direction, facing) * dot(facing, normal);
    const auto weight = [&](F8 cosine) {
        const F8 shows = max(cosine, all(0)) * kPerPi, ratio = shows / density;
        return shows / (1 + ratio * ratio);
    };
    const F8 sum = weight(straight);
    // Nothing comes from below a flat surface, and most are.
    const I8 fromBelow = (density < std::numeric_limits<float>::infinity()) & (mirrored > 0.0f);
    return any(fromBelow) ? sum + select(fromBelow, weight(mirrored), all(0)) : sum;
}

/// The same of any surface's own colours.
inline simd::V8 shownGlossy(const simd::V8& direction, simd::F8 density, const Bsdf8& own, const Frame8& frame) {
    using namespace simd;
    const auto weight = [&](const V8& distance) {
        const auto [value, likely] = own.evaluate(frame.view, frame.local(distance));
        const F8 ratio = likely / density;
        return value * (1 / (std::numbers::pi_v<float> * (1 + ratio * ratio)));
    };
    const I8 findable = density < std::numeric_limits<float>::infinity();
    return weight(direction) + select(findable, weight(frame.mirrored(direction)), V8{});
}

/// A way on.
struct Scattered8 {
    simd::V8 out, weight;  // the direction, not always above the true surface; of the light from there
    simd::F8 density;      // per steradian
};

/// Scatters at matte surfaces; `u` and `v` are in [0, 1).
inline Scattered8 scatterMatte(const simd::V8& base, const simd::V8& normal, simd::F8 u, simd::F8 v) {
    using namespace simd;
    const F8 radius = simd::sqrt(u), height = simd::sqrt(1 - u);
    F8 sine, cosine;
    sinCosRevolutions(v, sine, cosine);
    V8 x, y;
    basis(normal, x, y);
    return {x * (radius * cosine) + y * (radius * sine) + normal * height, base,
            height * (1 / std::numbers::pi_v<float>)};
}

/// Scatters at any surfaces; `lobe` is in [0, 1).
inline Scattered8 scatterGlossy(const Bsdf8& own, const Frame8& frame, simd::F8 lobe, simd::F8 u, simd::F8 v) {
    using namespace simd;
    const V8 local = own.sample(frame.view, lobe, u, v);
    const auto [value, density] = own.evaluate(frame.view, local);
    const I8 sent = own.sends() & (density > 0.0f);
    const F8 scale = 1 / (select(sent, density, all(1)) * std::numbers::pi_v<float>);
    return {frame.x * local.x + frame.y * local.y + frame.z * local.z, select(sent, value * scale, V8{}), density};
}

/// Up again where it leads into the true surface.
inline simd::V8 aboveSurface(const simd::V8& out, const simd::V8& facing) {
    using namespace simd;
    const F8 above = dot(out, facing);
    return out - facing * select(above < 0.0f, 2 * above, all(0));
}

/// Russian roulette of eight paths; each number decides for the whole of its path.
struct Roulette8 {
    /// The odds of a path below which its random number has too few bits left to decide by.
    static constexpr float kRedraw = 0x1p-10f;
    simd::F8 first, odds, fate;  // as PathTask has them
    /// Roulette for paths that would continue with the weight `after`: survivors get a larger weight, which includes
    /// the share of those that end. `drawn`: new numbers, for those that need them. Returns all ones in the lanes that
    /// continue.
    simd::I8 survive(simd::V8& after, simd::F8 drawn) {
        using namespace simd;
        const F8 maximum = max(max(after.x, after.y), after.z), survival = min(maximum / first, all(1));
        const I8 draw = odds <= kRedraw;
        odds = select(draw, all(1), odds) * survival;
        fate = select(draw, drawn, fate);
        after = after * (1 / survival);
        return (maximum > 0.0f) & (fate < odds);
    }
};

}  // namespace rtsg::trace
