// The template behind LargeKernels, for registers of eight and of sixteen lanes.
//
// W: as Lanes8 and Lanes16, a type of the unit's own. Nothing here calls functions that are not inlined by force or
// part of a W. Invariant: bit for bit the same at either width. Threading: re-entrant.
#pragma once

#include "large_triangles.h"
#include "mesh/lane_math.h"

namespace rtsg::bvh {

#define RTSG_INLINE __attribute__((always_inline)) static inline

template <class W>
struct LargeKernelsOf {
    using F = typename W::F;
    using I = typename W::I;
    using M = typename W::M;
    static constexpr int kLanes = W::kLanes;

    /// Of the sizes that a distance is computed from, what it may be off by; and shares that count as the same.
    static constexpr float kRounding = 0x1p-19f, kAlike = 0x1p-18f;

    struct V {
        F x, y, z;
    };
    RTSG_INLINE F all(float x) { return simd::lanes::fill<F>(x); }
    RTSG_INLINE F absolute(F x) { return W::most(x, -x); }
    RTSG_INLINE F dot(const V& a, const float* b) { return a.x * b[0] + a.y * b[1] + a.z * b[2]; }
    RTSG_INLINE V loadV(const float* x, const float* y, const float* z) { return {W::load(x), W::load(y), W::load(z)}; }

    /// As many rays as there are lanes.
    struct Rays {
        V origin, direction;
        F tMin, tMax;
        F slack;  // metres, of rounding
        F length;
        __attribute__((always_inline)) Rays(const LargeTable& table, const RayPacket16& rays, int at) {
            origin = loadV(rays.originX + at, rays.originY + at, rays.originZ + at);
            direction = loadV(rays.directionX + at, rays.directionY + at, rays.directionZ + at);
            tMin = W::load(rays.tMin + at), tMax = W::load(rays.tMax + at);
            slack = (absolute(origin.x) + absolute(origin.y) + absolute(origin.z) + table.size) * kRounding;
            length = W::root(direction.x * direction.x + direction.y * direction.y + direction.z * direction.z);
        }
    };

    /// Where rays meet a plane: how far along them, and from its corner.
    struct Meeting {
        F height, inverse, t;  // height: of the plane above the origin; inverse: of what a step towards it is
        V place;
        F unsure;  // metres that the place may be off by, on the plane
        __attribute__((always_inline)) Meeting(const Rays& rays, const LargeTable::Plane& plane) {
            const V from{rays.origin.x - plane.corner[0], rays.origin.y - plane.corner[1],
                         rays.origin.z - plane.corner[2]};
            height = -dot(from, plane.normal);
            inverse = 1.0f / dot(rays.direction, plane.normal);
            t = height * inverse;
            place = {from.x + rays.direction.x * t, from.y + rays.direction.y * t, from.z + rays.direction.z * t};
            unsure = rays.slack * rays.length * absolute(inverse);
        }
    };
    /// The weights of a triangle's corners at a place on its plane.
    struct Weights {
        F second, third, least, edge;  // edge: up to where roundings may decide
        __attribute__((always_inline)) Weights(const Meeting& m, const LargeTable::Triangle& triangle) {
            second = dot(m.place, triangle.second) + triangle.second[3];
            third = dot(m.place, triangle.third) + triangle.third[3];
            least = W::least(W::least(second, third), (1.0f - second) - third);
            edge = m.unsure * triangle.steepest;
        }
    };

    /// A bit for each ray that may come to a box before `end`.
    RTSG_INLINE std::uint32_t reachBoxes(const LargeTable& table, const Rays& rays, F end) {
        if (table.boxCount == 0) return 0;
        const auto inverseOf = [](F d) __attribute__((always_inline)) {
            constexpr float kSmall = TreeView::kSmall;
            const F safe = W::choose(W::greater(F{}, d), all(-kSmall), all(kSmall));
            return 1.0f / W::choose(W::greater(absolute(d), all(kSmall)), d, safe);
        };
        const V inverse{inverseOf(rays.direction.x), inverseOf(rays.direction.y), inverseOf(rays.direction.z)};
        const F margin = all(TreeView::kFarther) * TreeView::kFarther;
        std::uint32_t reached = 0;
        for (std::uint32_t b = 0; b < table.boxCount; ++b) {
            F near = rays.tMin, far = end;
            const auto clip = [&](F origin, F step, float lower, float upper) __attribute__((always_inline)) {
                const F x = (lower - origin) * step, y = (upper - origin) * step;
                near = W::most(near, W::least(x, y)), far = W::least(far, W::most(x, y));
            };
            const float *const lower = table.lower[b], *const upper = table.upper[b];
            clip(rays.origin.x, inverse.x, lower[0], upper[0]);
            clip(rays.origin.y, inverse.y, lower[1], upper[1]);
            clip(rays.origin.z, inverse.z, lower[2], upper[2]);
            reached |= W::bits(W::atLeast(far * margin, near));
        }
        return reached;
    }

    RTSG_INLINE std::uint32_t activeLanes(const RayPacket16& rays, int at) {
        I active;
        __builtin_memcpy(&active, rays.active + at, sizeof active);
        return W::bits(active);
    }

    // ---- what is met first --------------------------------------------------------------------------------------

    struct Nearest {
        F t, second, third, which;  // which: the triangle's number
        std::uint32_t open = 0, met = 0;
    };
    RTSG_INLINE Nearest nearestOf(const LargeTable& table, const Rays& rays) {
        Nearest best{rays.tMax, F{}, F{}, F{}};
        for (std::uint32_t p = 0, i = 0; p < table.planeCount; ++p) {
            const LargeTable::Plane& plane = table.planes[p];
            const Meeting m(rays, plane);
            const M ahead = W::greater(m.t, rays.tMin), sure = W::greater(absolute(m.height), rays.slack);
            const F closer = m.t + m.t * kAlike, farther = m.t - m.t * kAlike;
            for (; i < plane.end; ++i) {
                const Weights w(m, table.triangles[i]);
                const M near = W::both(W::both(ahead, W::greater(w.least, -w.edge)), W::greater(best.t, farther));
                const M inside =
                    W::both(W::both(near, sure), W::both(W::greater(w.least, w.edge), W::greater(best.t, closer)));
                best.t = W::choose(inside, m.t, best.t), best.which = W::choose(inside, all(float(i)), best.which);
                best.second = W::choose(inside, w.second, best.second);
                best.third = W::choose(inside, w.third, best.third);
                const std::uint32_t clear = W::bits(inside);
                best.met |= clear, best.open |= W::bits(near) & ~clear;
            }
        }
        return best;
    }

    static std::uint32_t intersect(const LargeTable& table, RayPacket16& rays, std::uint32_t& open) {
        std::uint32_t met = 0;
        open = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const std::uint32_t active = activeLanes(rays, at);
            if (!active) continue;
            const Rays own(table, rays, at);
            const Nearest best = nearestOf(table, own);
            const std::uint32_t left = (best.open | reachBoxes(table, own, best.t)) & active;
            open |= left << at, met |= (best.met & active & ~left) << at;
            const I which = __builtin_convertvector(best.which, I);
            W::store(rays.tMax + at, W::choose(W::maskOf(best.met & ~left), best.t, own.tMax));
            W::store(rays.u_ + at, best.second), W::store(rays.v_ + at, best.third);
            W::store(rays.normalX_ + at, W::lookUp(table.normal[0], which));
            W::store(rays.normalY_ + at, W::lookUp(table.normal[1], which));
            W::store(rays.normalZ_ + at, W::lookUp(table.normal[2], which));
            const auto bitsTo = [](std::uint32_t* to, F numbers) __attribute__((always_inline)) {
                __builtin_memcpy(to, &numbers, sizeof numbers);
            };
            bitsTo(rays.prim_ + at, W::lookUp(table.number, which));
            bitsTo(rays.geom_ + at, W::lookUp(table.geometry, which));
            const I none = I{} - 1;
            __builtin_memcpy(rays.inst_ + at, &none, sizeof none);
        }
        return met;
    }

    // ---- what is on the way -------------------------------------------------------------------------------------

    static std::uint32_t occluded(const LargeTable& table, const RayPacket16& rays, std::uint32_t& open) {
        std::uint32_t blocked = 0;
        open = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const std::uint32_t active = activeLanes(rays, at);
            if (!active) continue;
            const Rays own(table, rays, at);
            std::uint32_t stopped = 0, left = 0;
            for (std::uint32_t p = 0, i = 0; p < table.planeCount; ++p) {
                const LargeTable::Plane& plane = table.planes[p];
                const Meeting m(own, plane);
                const M between = W::both(W::greater(m.t, own.tMin), W::greater(own.tMax, m.t));
                if (!W::bits(between)) {
                    i = plane.end;
                    continue;
                }
                // Nor may the end be on the plane: what rounding leaves of that is what is looked at.
                const F height = absolute(m.height);
                const M sure = W::both(W::greater(height, own.slack),
                                       W::greater(own.tMax - own.slack * absolute(m.inverse), m.t));
                const std::uint32_t fromBack = W::bits(W::greater(m.inverse, F{}));
                for (; i < plane.end; ++i) {
                    const LargeTable::Triangle& triangle = table.triangles[i];
                    const Weights w(m, triangle);
                    const std::uint32_t near = W::bits(W::both(between, W::greater(w.least, -w.edge)));
                    std::uint32_t stops = W::bits(W::both(sure, W::greater(w.least, w.edge))) & near;
                    stops &= (triangle.sides & LargeTriangles::kBack ? fromBack : 0) |
                             (triangle.sides & LargeTriangles::kFront ? ~fromBack : 0);
                    stopped |= stops, left |= near & ~stops;
                }
            }
            blocked |= (stopped & active) << at;
            open |= ((left | reachBoxes(table, own, own.tMax)) & active & ~stopped) << at;
        }
        return blocked;
    }

    static constexpr LargeKernels kTable{&intersect, &occluded};
};

#undef RTSG_INLINE

}  // namespace rtsg::bvh
