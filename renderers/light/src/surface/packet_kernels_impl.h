// The template behind packet_kernels.h.
//
// W: F and I, vectors of kLanes floats and integers, and what the compiler's vector types cannot say by themselves. It
// must be a type of the unit's own, so that no other unit's instances are taken for this one's. Nothing here calls
// functions that are not inlined by force or part of a W. Threading: re-entrant.
#pragma once

#include "mesh/lane_math.h"
#include "packet_kernels.h"
#include "surface_lanes.h"
#include "texture/bsdf.h"

namespace rtsg::trace {

#define RTSG_INLINE __attribute__((always_inline)) static inline

template <class W>
struct KernelsOf {
    using F = typename W::F;
    using I = typename W::I;
    static constexpr int kLanes = W::kLanes;
    static constexpr std::uint32_t kAll = (std::uint32_t{1} << kLanes) - 1;

    struct V {
        F x, y, z;
    };

    // ---- arithmetic ---------------------------------------------------------------------------------------------

    RTSG_INLINE F all(float x) { return simd::lanes::fill<F>(x); }
    RTSG_INLINE V all(const Vec3f& v) { return {all(v.x), all(v.y), all(v.z)}; }
    RTSG_INLINE F less(F a, F b) { return simd::lanes::minimum(a, b); }
    RTSG_INLINE F more(F a, F b) { return simd::lanes::maximum(a, b); }
    RTSG_INLINE F absolute(F x) { return more(x, -x); }
    RTSG_INLINE F dot(const V& a, const V& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
    RTSG_INLINE V times(const V& a, F s) { return {a.x * s, a.y * s, a.z * s}; }
    RTSG_INLINE V plus(const V& a, const V& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    RTSG_INLINE V minus(const V& a, const V& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    RTSG_INLINE V loadV(const Lanes3& v, int at) { return {W::load(v.x + at), W::load(v.y + at), W::load(v.z + at)}; }
    RTSG_INLINE void storeV(Lanes3& to, int at, const V& v) {
        W::store(to.x + at, v.x), W::store(to.y + at, v.y), W::store(to.z + at, v.z);
    }
    RTSG_INLINE void fillV(Lanes3& to, const Vec3f& v) {
        for (int at = 0; at < 16; at += kLanes) storeV(to, at, all(v));
    }
    RTSG_INLINE void fillOne(float* to, float x) {
        for (int at = 0; at < 16; at += kLanes) W::store(to + at, all(x));
    }
    /// Whether a large triangle fills all lanes.
    RTSG_INLINE bool isOne(const std::uint32_t* triangles) {
        I lanes;
        __builtin_memcpy(&lanes, triangles, sizeof lanes);
        return W::bits(lanes == static_cast<std::int32_t>(triangles[0])) == kAll;
    }
    RTSG_INLINE I lanesFrom(std::uint32_t mask, int at) { return W::lanesOf(mask >> at & kAll); }
    RTSG_INLINE V outside(const SurfacePacket& s, int at) {
        return {W::load(s.hits.normalX + at), W::load(s.hits.normalY + at), W::load(s.hits.normalZ + at)};
    }

    // ---- rays ---------------------------------------------------------------------------------------------------

    static void makeRays(const PixelBlock& b, std::uint32_t active, const float* u, const float* v, RayPacket16& rays) {
        for (int at = 0; at < 16; at += kLanes) {
            const F x = b.middleX + b.across * (b.x + W::columns() + W::load(u + at)),
                    y = b.middleY - b.down * (b.y + W::rows(at) + W::load(v + at));
            V d{b.right.x * x + b.up.x * y, b.right.y * x + b.up.y * y, b.right.z * x + b.up.z * y};
            d = plus(d, all(b.forward));
            d = times(d, 1.0f / W::root(dot(d, d)));
            W::store(rays.originX + at, all(b.eye.x)), W::store(rays.originY + at, all(b.eye.y));
            W::store(rays.originZ + at, all(b.eye.z));
            W::store(rays.directionX + at, d.x), W::store(rays.directionY + at, d.y);
            W::store(rays.directionZ + at, d.z);
            W::store(rays.tMin + at, F{}), W::store(rays.tMax + at, all(b.tMax));
            W::store(rays.active + at, lanesFrom(active, at));
        }
    }

    // ---- surfaces -----------------------------------------------------------------------------------------------

    static void useOutside(SurfacePacket& s) {
        for (int at = 0; at < 16; at += kLanes) storeV(s.normal, at, outside(s, at));
    }

    RTSG_INLINE const float* cornerOf(const NormalSource& source, std::uint32_t triangle, std::uint32_t corner) {
        const std::size_t k = std::size_t{triangle} * source.triangleStep + corner * source.cornerStep;
        return source.values + 3 * (source.index ? std::size_t{static_cast<std::uint32_t>(source.index[k])} : k);
    }
    /// Loads x, y, z and a meaningless number for every fourth lane from `j` on. `triangles` are those of all lanes.
    template <int j>
    RTSG_INLINE F smooth(const NormalSource& source, const std::uint32_t* triangles, F u, F v, F w) {
        const float* corner[3][kLanes / 4];
        for (int q = 0; q < kLanes / 4; ++q)
            for (std::uint32_t c = 0; c < 3; ++c) corner[c][q] = cornerOf(source, triangles[4 * q + j], c);
        return W::quads(corner[0]) * W::template spread<j>(w) + W::quads(corner[1]) * W::template spread<j>(u) +
               W::quads(corner[2]) * W::template spread<j>(v);
    }

    /// Interpolates the normals of one triangle, by axis.
    RTSG_INLINE void smooth(const NormalSource& source, std::uint32_t triangle, F u, F v, F w, F* n) {
        const float *const a = cornerOf(source, triangle, 0), *const b = cornerOf(source, triangle, 1),
                           *const c = cornerOf(source, triangle, 2);
        for (int k = 0; k < 3; ++k) n[k] = a[k] * w + b[k] * u + c[k] * v;
    }

    static void fetchNormals(const NormalSource& source, std::uint32_t lanes, SurfacePacket& s) {
        for (int at = 0; at < 16; at += kLanes) {
            const std::uint32_t now = lanes >> at & kAll;
            if (!now) continue;
            alignas(64) std::uint32_t triangles[kLanes];
            W::copy(triangles, s.hits.triangle + at, W::lanesOf(now), s.hits.triangle[at + __builtin_ctz(now)]);
            F u = W::load(s.hits.u + at), v = W::load(s.hits.v + at), w = 1.0f - u - v;
            if (source.cornerStep == 0) u = v = F{}, w = all(1);
            F n[4];
            if (isOne(triangles)) {
                smooth(source, triangles[0], u, v, w, n);
            } else {
                n[0] = smooth<0>(source, triangles, u, v, w), n[1] = smooth<1>(source, triangles, u, v, w);
                n[2] = smooth<2>(source, triangles, u, v, w), n[3] = smooth<3>(source, triangles, u, v, w);
                W::transpose(n[0], n[1], n[2], n[3]);
            }
            const glm::mat3& m = source.normalFromLocal;
            const auto row = [&](int r) __attribute__((always_inline)) {
                const float* e = &m[0].x;
                return e[r] * n[0] + e[3 + r] * n[1] + e[6 + r] * n[2];
            };
            const V normal{row(0), row(1), row(2)};
            if (lanes == s.mask) {
                storeV(s.normal, at, normal);
                continue;
            }
            const I use = W::lanesOf(now);
            const V old = loadV(s.normal, at);
            storeV(s.normal, at, {use ? normal.x : old.x, use ? normal.y : old.y, use ? normal.z : old.z});
        }
    }

    static void finishGeometry(const RayPacket16& rays, SurfacePacket& s) {
        std::uint32_t behind = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const V d{W::load(rays.directionX + at), W::load(rays.directionY + at), W::load(rays.directionZ + at)};
            const V o{W::load(rays.originX + at), W::load(rays.originY + at), W::load(rays.originZ + at)};
            const V out = outside(s, at);
            const F distance = W::load(rays.tMax + at);
            storeV(s.position, at, plus(o, times(d, distance)));
            storeV(s.view, at, {-d.x, -d.y, -d.z});
            W::store(s.distance + at, distance);
            V n = loadV(s.normal, at);
            const F squared = dot(n, n);
            // Negated comparisons would also catch NaN; these are false for it.
            const I good = (squared > 1e-24f) & (squared < 1e30f);
            const I back = dot(d, out) > 0.0f;
            const F scale = 1.0f / W::root(good ? squared : all(1));
            n = {good ? n.x * scale : out.x, good ? n.y * scale : out.y, good ? n.z * scale : out.z};
            storeV(s.normal, at, {back ? -n.x : n.x, back ? -n.y : n.y, back ? -n.z : n.z});
            behind |= W::bits(back) << at;
        }
        s.back = behind & s.mask;
    }

    static void fillAll(const Material& material, const Material::Linear& colors, float coverage, float opacity,
                        SurfacePacket& s) {
        const float ambient = material.ambient;
        fillV(s.base, colors.base), fillV(s.specular, colors.specular), fillV(s.emissive, colors.emissive);
        for (int at = 0; at < 16; at += kLanes)
            storeV(s.ambient, at,
                   {all(colors.base.x * ambient), all(colors.base.y * ambient), all(colors.base.z * ambient)});
        fillOne(s.exponent, material.exponent);
        fillOne(s.metallic, material.metallic), fillOne(s.roughness, material.roughness);
        fillOne(s.coverage, coverage), fillOne(s.opacity, opacity), fillOne(s.occlusion, 1);
        for (const Material*& m : s.material) m = &material;
    }

    static void findPoints(const RayInstance& instance, const Vec3f* positions, const std::int32_t* triangles,
                           std::uint32_t stride, std::uint32_t lanes, SurfacePacket& s) {
        constexpr float eps = 0x1p-24f, gamma = 12 * eps / (1 - 12 * eps);
        const float* m = &instance.rayFromLocal[0].x;
        for (int at = 0; at < 16; at += kLanes) {
            const std::uint32_t now = lanes >> at & kAll;
            if (!now) continue;
            alignas(64) std::uint32_t hit[kLanes];
            W::copy(hit, s.hits.triangle + at, W::lanesOf(now), s.hits.triangle[at + __builtin_ctz(now)]);
            const F u = W::load(s.hits.u + at), v = W::load(s.hits.v + at), w = 1.0f - u - v;
            V corners[3];
            if (isOne(hit)) {
                const std::int32_t* triangle = triangles + std::size_t{hit[0]} * stride;
                for (int c = 0; c < 3; ++c) corners[c] = all(positions[triangle[c]]);
            } else {
                const float* corner[3][kLanes];  // every fourth lane's next to each other
                for (int lane = 0; lane < kLanes; ++lane) {
                    const std::int32_t* triangle = triangles + std::size_t{hit[lane]} * stride;
                    const int slot = lane % 4 * (kLanes / 4) + lane / 4;
                    for (int c = 0; c < 3; ++c) corner[c][slot] = &positions[triangle[c]].x;
                }
                for (int c = 0; c < 3; ++c) corners[c] = gathered(corner[c]);
            }
            const V a = times(corners[0], w), b = times(corners[1], u), c = times(corners[2], v);
            const V local = plus(plus(a, b), c);
            const V size{absolute(a.x) + absolute(b.x) + absolute(c.x), absolute(a.y) + absolute(b.y) + absolute(c.y),
                         absolute(a.z) + absolute(b.z) + absolute(c.z)};
            const auto row = [&](int r) __attribute__((always_inline)) {
                return local.x * m[r] + local.y * m[3 + r] + local.z * m[6 + r] + m[9 + r];
            };
            const auto bound = [&](int r) __attribute__((always_inline)) {
                return ((size.x * __builtin_fabsf(m[r]) + size.y * __builtin_fabsf(m[3 + r]) +
                         size.z * __builtin_fabsf(m[6 + r])) *
                            instance.errorScale +
                        __builtin_fabsf(m[9 + r])) *
                           gamma +
                       (&instance.errorFloor.x)[r];
            };
            const I use = W::lanesOf(now);
            const V point{row(0), row(1), row(2)}, error{bound(0), bound(1), bound(2)};
            const V oldPoint = loadV(s.exact, at), oldError = loadV(s.error, at);
            storeV(s.exact, at, {use ? point.x : oldPoint.x, use ? point.y : oldPoint.y, use ? point.z : oldPoint.z});
            storeV(s.error, at, {use ? error.x : oldError.x, use ? error.y : oldError.y, use ? error.z : oldError.z});
        }
    }

    /// The three numbers at each of these places.
    RTSG_INLINE V gathered(const float* const* positions) {
        constexpr int kNext = kLanes / 4;
        F q[4] = {W::quads(positions), W::quads(positions + kNext), W::quads(positions + 2 * kNext),
                  W::quads(positions + 3 * kNext)};
        W::transpose(q[0], q[1], q[2], q[3]);
        return {q[0], q[1], q[2]};
    }

    // ---- light --------------------------------------------------------------------------------------------------

    static void addOwn(SurfacePacket& s) {
        for (int at = 0; at < 16; at += kLanes) {
            const I plain = lanesFrom(s.unlit, at);
            const V base = loadV(s.base, at), own = loadV(s.emissive, at);
            storeV(s.radiance, at, {plain ? base.x : own.x, plain ? base.y : own.y, plain ? base.z : own.z});
        }
    }

    /// Towards the light, how far, and how much of it comes.
    struct Reached {
        V towards;
        F distance, factor;
    };
    RTSG_INLINE Reached reach(const TraceLight& light, const V& position) {
        Reached r{{}, F{}, all(1)};
        if (light.kind == Light::Kind::directional) {
            r.towards = {all(-light.direction.x), all(-light.direction.y), all(-light.direction.z)};
            return r;
        }
        r.towards = minus(all(light.position), position);
        r.distance = W::root(dot(r.towards, r.towards));
        r.towards = times(r.towards, 1.0f / more(r.distance, all(1e-30f)));
        const F local = r.distance * light.localFromWorld;
        const bool fades = light.attenuation.x > 1 || light.attenuation.y != 0 || light.attenuation.z != 0;
        if (fades) {
            const F falloff = light.attenuation.x + local * (light.attenuation.y + local * light.attenuation.z);
            r.factor = 1.0f / more(falloff, all(1));
        }
        if (light.radius >= 0) r.factor = local > light.radius ? F{} : r.factor;
        if (light.kind == Light::Kind::spot) {
            const F angle = simd::lanes::acosOf(more(less(-dot(r.towards, all(light.direction)), all(1)), all(-1)),
                                                [](F x) __attribute__((always_inline)) { return W::root(x); });
            const float width = light.beamWidth - light.cutOffAngle;
            F spot = width < 0 ? (angle - light.cutOffAngle) / width : all(1);
            spot = angle <= light.beamWidth ? all(1) : spot;
            r.factor *= angle >= light.cutOffAngle ? F{} : spot;
        }
        return r;
    }

    static bool gather(const TraceLight& light, const SurfacePacket& s, Incoming& in) {
        std::uint32_t lit = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const Reached r = reach(light, loadV(s.position, at));
            storeV(in.direction, at, r.towards);
            W::store(in.factor + at, r.factor);
            W::store(in.cosine + at, more(dot(loadV(s.normal, at), r.towards), F{}));
            W::store(in.distance + at, r.distance);
            storeV(in.visible, at, {all(1), all(1), all(1)});
            lit |= W::bits(r.factor > 0.0f);
        }
        return lit != 0;
    }

    RTSG_INLINE F beyond(F x, F step) { return simd::lanes::beyond<F, I>(x, step); }
    /// Does what RayView::leave does. Precondition: findPoints().
    RTSG_INLINE V leave(const SurfacePacket& s, int at, const V& towards) {
        const V n = outside(s, at), e = loadV(s.error, at);
        const F far = absolute(n.x) * e.x + absolute(n.y) * e.y + absolute(n.z) * e.z;
        const V offset = times(n, dot(towards, n) < 0.0f ? -far : far);
        const V start = plus(loadV(s.exact, at), offset);
        return {beyond(start.x, offset.x), beyond(start.y, offset.y), beyond(start.z, offset.z)};
    }

    static std::uint32_t shadowRays(const TraceLight& light, const SurfacePacket& s, const Incoming& in,
                                    std::uint32_t mask, RayPacket16& rays, std::uint32_t& behind) {
        const bool directional = light.kind == Light::Kind::directional;
        std::uint32_t tested = 0;
        behind = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const V towards = loadV(in.direction, at), start = leave(s, at, towards);
            V d = towards;
            if (light.kind == Light::Kind::projectorParallel)
                d = times(towards, W::load(in.distance + at));
            else if (!directional)
                d = minus(all(light.position), start);
            W::store(rays.originX + at, start.x), W::store(rays.originY + at, start.y);
            W::store(rays.originZ + at, start.z);
            W::store(rays.directionX + at, d.x), W::store(rays.directionY + at, d.y);
            W::store(rays.directionZ + at, d.z);
            W::store(rays.tMin + at, all(kLeave));
            W::store(rays.tMax + at, all(directional ? __builtin_huge_valf() : 1.0f));
            const I lit = lanesFrom(mask, at) & (W::load(in.factor + at) > 0.0f) & (W::load(in.cosine + at) > 0.0f) &
                          (dot(d, d) > 1e-20f);
            // A shading normal may face a light that is behind the true surface.
            const V n = outside(s, at);
            const F side = dot(n, towards) * dot(n, loadV(s.view, at));
            const std::uint32_t use = W::bits(lit);
            W::store(rays.active + at, lit);
            tested |= use << at;
            behind |= (use & ~W::bits(side > 0.0f)) << at;
        }
        return tested;
    }

    /// The light that a surface reflects if nothing shades it.
    RTSG_INLINE V reflected(const V& towards, F cosine, bool shiny, int at, const SurfacePacket& s) {
        const V direct = times(loadV(s.base, at), cosine);
        if (!shiny) return direct;
        const V half = plus(towards, loadV(s.view, at));
        // Works with the square of the cosine, so that no root is needed.
        const F along = more(dot(loadV(s.normal, at), half), F{});
        const F square = along * along / more(dot(half, half), all(1e-30f));
        F shine = simd::lanes::power<F, I>(less(square, all(1)), 0.5f * W::load(s.exponent + at));
        shine = cosine > 0.0f ? shine : F{};
        return plus(direct, times(loadV(s.specular, at), shine));
    }

    static std::uint32_t faint(const TraceLight& light, const Incoming& in, const float* weights, float minimum,
                               bool shiny, const SurfacePacket& s) {
        std::uint32_t found = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const V direct = reflected(loadV(in.direction, at), W::load(in.cosine + at), shiny, at, s);
            const F red = absolute(light.color.x * direct.x), green = absolute(light.color.y * direct.y),
                    blue = absolute(light.color.z * direct.z);
            const F maximum = W::load(in.factor + at) * more(more(red, green), blue) * W::load(weights + at);
            found |= W::bits(maximum < minimum) << at;
        }
        return found;
    }

    /// Adds a surface's reflection of a light, before its shadow.
    RTSG_INLINE void reflect(const TraceLight& light, const V& towards, F cosine, F factor, const V& visible,
                             bool shiny, int at, SurfacePacket& s) {
        const V ambient = loadV(s.ambient, at), direct = reflected(towards, cosine, shiny, at, s);
        V radiance = loadV(s.radiance, at);
        radiance.x += factor * (light.color.x * direct.x * visible.x + light.ambient.x * ambient.x);
        radiance.y += factor * (light.color.y * direct.y * visible.y + light.ambient.y * ambient.y);
        radiance.z += factor * (light.color.z * direct.z * visible.z + light.ambient.z * ambient.z);
        storeV(s.radiance, at, radiance);
    }

    static void addPhong(const TraceLight& light, const Incoming& in, std::uint32_t mask, bool shiny,
                         SurfacePacket& s) {
        for (int at = 0; at < 16; at += kLanes) {
            if (!(mask >> at & kAll)) continue;
            const F factor = lanesFrom(mask, at) ? W::load(in.factor + at) : F{};
            reflect(light, loadV(in.direction, at), W::load(in.cosine + at), factor, loadV(in.visible, at), shiny, at,
                    s);
        }
    }

    static void shinePhong(const TraceLight& light, std::uint32_t mask, bool shiny, SurfacePacket& s) {
        for (int at = 0; at < 16; at += kLanes) {
            if (!(mask >> at & kAll)) continue;
            const Reached r = reach(light, loadV(s.position, at));
            const F factor = lanesFrom(mask, at) ? r.factor : F{};
            if (!W::bits(factor > 0.0f)) continue;
            const F cosine = more(dot(loadV(s.normal, at), r.towards), F{});
            reflect(light, r.towards, cosine, factor, {all(1), all(1), all(1)}, shiny, at, s);
        }
    }

    /// One channel of metallicRoughness() of shading.h.
    struct Gloss {
        F m5, specular, metallic;
        RTSG_INLINE F of(const Gloss& g, F color) {
            const F f0 = 0.04f + (color - 0.04f) * g.metallic;
            const F fresnel = f0 + (1.0f - f0) * g.m5;
            return (1.0f - fresnel) * (1.0f - g.metallic) * color + fresnel * g.specular;
        }
    };
    RTSG_INLINE Gloss gloss(F metallic, F roughness, F cosLight, F cosView, F cosHalf, F cosLightHalf) {
        const F m = more(1.0f - cosLightHalf, F{}), m2 = m * m;
        const F alpha = more(roughness * roughness, all(1e-3f)), a2 = alpha * alpha;
        const F d = cosHalf * cosHalf * (a2 - 1.0f) + 1.0f;
        const F masking = cosLight * W::root(cosView * cosView * (1.0f - a2) + a2) +
                          cosView * W::root(cosLight * cosLight * (1.0f - a2) + a2);
        return {m2 * m2 * m, masking > 0.0f ? 0.5f * (a2 / (d * d)) / masking : F{}, metallic};
    }

    static void addPhysical(const TraceLight& light, const Incoming& in, std::uint32_t mask, SurfacePacket& s) {
        const V color{all(light.color.x * kPhysicalLight), all(light.color.y * kPhysicalLight),
                      all(light.color.z * kPhysicalLight)};
        for (int at = 0; at < 16; at += kLanes) {
            if (!(mask >> at & kAll)) continue;
            const V base = loadV(s.base, at), ambient = loadV(s.ambient, at), visible = loadV(in.visible, at);
            const F cosine = W::load(in.cosine + at), factor = lanesFrom(mask, at) ? W::load(in.factor + at) : F{};
            const V n = loadV(s.normal, at), l = loadV(in.direction, at), v = loadV(s.view, at);
            const V sum = plus(l, v);
            const V h = times(sum, 1.0f / more(W::root(dot(sum, sum)), all(1e-20f)));
            const Gloss g = gloss(W::load(s.metallic + at), W::load(s.roughness + at), cosine,
                                  more(dot(n, v), all(1e-4f)), more(dot(n, h), F{}), more(dot(l, h), F{}));
            V radiance = loadV(s.radiance, at);
            radiance.x += factor * (color.x * visible.x * cosine * Gloss::of(g, base.x) + light.ambient.x * ambient.x);
            radiance.y += factor * (color.y * visible.y * cosine * Gloss::of(g, base.y) + light.ambient.y * ambient.y);
            radiance.z += factor * (color.z * visible.z * cosine * Gloss::of(g, base.z) + light.ambient.z * ambient.z);
            storeV(s.radiance, at, radiance);
        }
    }

    // ---- pixels -------------------------------------------------------------------------------------------------

    static void addToPixels(const SurfacePacket& s, std::uint32_t mask, float* pixels) {
        for (int at = 0; at < 16; at += kLanes) {
            const I use = lanesFrom(mask, at);
            const V radiance = loadV(s.radiance, at);
            F r = use ? radiance.x : F{}, g = use ? radiance.y : F{}, b = use ? radiance.z : F{},
              a = use ? all(1) : F{};
            W::transpose(r, g, b, a);  // now each four lanes apart
            W::addRows(r, g, b, a, pixels + at / 4 * kTileSide * 4, kTileSide * 4);
        }
    }

    static constexpr PacketKernels kTable{&makeRays,   &useOutside,  &fetchNormals, &finishGeometry, &fillAll,
                                          &findPoints, &addOwn,      &gather,       &faint,          &shadowRays,
                                          &addPhong,   &addPhysical, &shinePhong,   &addToPixels};
};

#undef RTSG_INLINE

}  // namespace rtsg::trace
