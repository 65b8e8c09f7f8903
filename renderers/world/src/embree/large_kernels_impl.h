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
    static constexpr std::uint32_t kAll = (std::uint32_t{1} << kLanes) - 1;

    /// The error of a distance, as a share of the numbers that it is computed from; and the difference up to which
    /// shares count as equal.
    static constexpr float kRounding = 0x1p-19f, kAlike = 0x1p-18f;

    struct V {
        F x, y, z;
    };
    RTSG_INLINE F all(float x) { return simd::lanes::fill<F>(x); }
    RTSG_INLINE F absolute(F x) { return W::maximum(x, -x); }
    RTSG_INLINE F dot(const V& a, const V& b) { return W::fused(a.x, b.x, W::fused(a.y, b.y, a.z * b.z)); }
    RTSG_INLINE F dot(const V& a, const float* b) { return dot(a, {all(b[0]), all(b[1]), all(b[2])}); }
    RTSG_INLINE V loadV(const float* const* rows, int at) {
        return {W::load(rows[0] + at), W::load(rows[1] + at), W::load(rows[2] + at)};
    }

    /// A ray for each lane.
    struct Rays {
        V origin, direction;
        F tMin, tMax;
        I front;
        F slack;   // metres, of rounding
        F spread;  // the same along rays
        __attribute__((always_inline)) Rays(const LargeTable& table, const RayRows& rows, int at) {
            origin = loadV(rows.origin, at), direction = loadV(rows.direction, at);
            tMin = all(rows.tMin), tMax = all(rows.tMax);
            if (rows.front)
                __builtin_memcpy(&front, rows.front + at, sizeof front);
            else
                front = I{} - 1;
            slack = (absolute(origin.x) + absolute(origin.y) + absolute(origin.z) + table.size) * kRounding;
            spread = slack * W::root(direction.x * direction.x + direction.y * direction.y + direction.z * direction.z);
        }
    };

    /// How far rays have to a face's plane.
    struct Plane {
        V from;                // the origin from the face's corner
        F height, inverse, t;  // height: of the plane above the origin; inverse: of what a step towards it is
        __attribute__((always_inline)) Plane(const Rays& rays, const LargeTable::Face& face) {
            from = {rays.origin.x - face.corner[0], rays.origin.y - face.corner[1], rays.origin.z - face.corner[2]};
            height = -dot(from, face.normal);
            inverse = 1.0f / dot(rays.direction, face.normal);
            t = height * inverse;
        }
    };
    /// The places where the rays meet the face.
    struct Meeting {
        F x, y;  // as LargeTable::Face has places
        F edge;  // up to where roundings may decide
        __attribute__((always_inline)) Meeting(const Rays& rays, const Plane& p, const LargeTable::Face& face) {
            const V position{W::fused(rays.direction.x, p.t, p.from.x), W::fused(rays.direction.y, p.t, p.from.y),
                             W::fused(rays.direction.z, p.t, p.from.z)};
            x = dot(position, face.x), y = dot(position, face.y);
            edge = rays.spread * face.steepest * absolute(p.inverse);
        }
        /// How far the place is within the face.
        template <bool isPair>
        __attribute__((always_inline)) F depth() const {
            const F minimum = W::minimum(x, y);
            return W::minimum(minimum, isPair ? 1.0f - W::maximum(x, y) : (1.0f - x) - y);
        }
    };

    /// Above 0 if a ray's line may enter the ball around the content of a box. `squared`: the direction's squared
    /// length.
    RTSG_INLINE F inBall(const LargeTable& table, const Rays& rays, F squared, std::uint32_t box) {
        const float* const middle = table.middle[box];
        const V from{rays.origin.x - middle[0], rays.origin.y - middle[1], rays.origin.z - middle[2]};
        const F far = dot(from, from), along = dot(from, rays.direction);
        return (far * 0x1p-20f + table.radiusSquared[box]) * squared - (far * squared - along * along);
    }
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
        const F squared = dot(rays.direction, rays.direction);
        std::uint32_t reached = 0;
        for (std::uint32_t b = 0; b < table.boxCount; ++b) {
            F near = rays.tMin, far = end;
            const auto clip = [&](F origin, F step, float lower, float upper) __attribute__((always_inline)) {
                const F x = (lower - origin) * step, y = (upper - origin) * step;
                near = W::maximum(near, W::minimum(x, y)), far = W::minimum(far, W::maximum(x, y));
            };
            const float *const lower = table.lower[b], *const upper = table.upper[b];
            clip(rays.origin.x, inverse.x, lower[0], upper[0]);
            clip(rays.origin.y, inverse.y, lower[1], upper[1]);
            clip(rays.origin.z, inverse.z, lower[2], upper[2]);
            // A ray that leaves the front of a convex mesh cannot meet this mesh again.
            const std::uint32_t leaves = table.convex[b] == LargeTable::kNone
                                             ? 0
                                             : W::bits(rays.front == static_cast<std::int32_t>(table.convex[b]));
            reached |=
                W::bits(W::greater(W::atLeast(far * margin, near), inBall(table, rays, squared, b), F{})) & ~leaves;
        }
        return reached;
    }

    // ---- what is met first --------------------------------------------------------------------------------------

    struct Nearest {
        F t, x, y, which;  // which: the face's number
        std::uint32_t open = 0, met = 0;
    };
    template <bool isPair>
    RTSG_INLINE void meet(const LargeTable& table, const Rays& rays, std::uint32_t from, std::uint32_t to, F& number,
                          Nearest& best) {
        for (std::uint32_t i = from; i < to; ++i, number += 1.0f) {
            const Plane p(rays, table.faces[i]);
            const Meeting m(rays, p, table.faces[i]);
            const F depth = m.template depth<isPair>(), off = p.t * kAlike;
            const M near = W::both(W::greater(p.t, rays.tMin), W::greater(depth, -m.edge));
            const M clear = W::both(W::greater(near, depth, m.edge), W::greater(absolute(p.height), rays.slack));
            // Last, as it waits for the face before.
            const M mayBe = W::greater(near, best.t, p.t - off), first = W::greater(clear, best.t, p.t + off);
            best.t = W::choose(first, p.t, best.t), best.which = W::choose(first, number, best.which);
            best.x = W::choose(first, m.x, best.x), best.y = W::choose(first, m.y, best.y);
            const std::uint32_t isFirst = W::bits(first);
            best.met |= isFirst, best.open |= W::bits(mayBe) & ~isFirst;
        }
    }

    /// The weights of the second and the third corner of the triangles, from places on faces.
    RTSG_INLINE void weigh(const LargeTable& table, const Nearest& best, int at, RayPacket16& rays,
                           LargeHits& reported) {
        PacketHits16& hits = reported.hits;
        const I which = __builtin_convertvector(best.which, I);
        const M beyond = W::greater(best.x + best.y, all(1));
        const F x = W::choose(beyond, 1.0f - best.x, best.x), y = W::choose(beyond, 1.0f - best.y, best.y);
        const F own = W::maximum((1.0f - x) - y, F{});
        const F corner = W::choose(beyond, W::lookUp(table.corner[1], which), W::lookUp(table.corner[0], which));
        const M first = W::greater(all(.5f), corner), last = W::greater(corner, all(1.5f));
        const F u = W::choose(first, x, W::choose(last, y, own)), v = W::choose(first, y, W::choose(last, own, x));
        W::store(rays.u_ + at, u), W::store(hits.u + at, u);
        W::store(rays.v_ + at, v), W::store(hits.v + at, v);
        W::store(reported.faces.u + at, best.x), W::store(reported.faces.v + at, best.y);
        __builtin_memcpy(reported.faces.triangle + at, &which, sizeof which);
        const F number = W::choose(beyond, W::lookUp(table.number[1], which), W::lookUp(table.number[0], which));
        bitsTo(rays.prim_ + at, number), bitsTo(hits.triangle + at, number);
    }
    template <class To>
    RTSG_INLINE void bitsTo(To* to, F numbers) {
        __builtin_memcpy(to, &numbers, sizeof numbers);
    }

    static std::uint32_t intersect(const LargeTable& table, const RayRows& rows, RayPacket16& rays, LargeHits& reported,
                                   std::uint32_t& open) {
        std::uint32_t met = 0;
        open = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const Rays own(table, rows, at);
            Nearest best{own.tMax, F{}, F{}, F{}};
            F number{};
            meet<true>(table, own, 0, table.pairCount, number, best);
            meet<false>(table, own, table.pairCount, table.faceCount, number, best);
            const std::uint32_t lanes = rows.lanes >> at & kAll;
            const std::uint32_t left = (best.open | reachBoxes(table, own, best.t)) & lanes;
            const std::uint32_t found = best.met & lanes & ~left;
            open |= left << at, met |= found << at;
            W::store(rays.originX + at, own.origin.x), W::store(rays.originY + at, own.origin.y);
            W::store(rays.originZ + at, own.origin.z), W::store(rays.tMin + at, own.tMin);
            W::store(rays.directionX + at, own.direction.x), W::store(rays.directionY + at, own.direction.y);
            W::store(rays.directionZ + at, own.direction.z);
            W::store(rays.tMax + at, W::choose(W::maskOf(found), best.t, own.tMax));
            W::store(rays.active + at, W::lanesOf(lanes));
            weigh(table, best, at, rays, reported);
            const I which = __builtin_convertvector(best.which, I);
            const V normal{W::lookUp(table.normal[0], which), W::lookUp(table.normal[1], which),
                           W::lookUp(table.normal[2], which)};
            const F side = W::lookUp(table.mirrored, which);
            W::store(reported.hits.normalX + at, normal.x), W::store(reported.faces.normalX + at, normal.x),
                W::store(rays.normalX_ + at, normal.x * side);
            W::store(reported.hits.normalY + at, normal.y), W::store(reported.faces.normalY + at, normal.y),
                W::store(rays.normalY_ + at, normal.y * side);
            W::store(reported.hits.normalZ + at, normal.z), W::store(reported.faces.normalZ + at, normal.z),
                W::store(rays.normalZ_ + at, normal.z * side);
            bitsTo(rays.geom_ + at, W::lookUp(table.geometry, which));
            bitsTo(reported.hits.instance + at, W::lookUp(table.instance, which));
            bitsTo(reported.faces.instance + at, W::lookUp(table.instance, which));
            bitsTo(reported.label + at, W::lookUp(table.label, which));
            const I none = I{} - 1;
            __builtin_memcpy(rays.inst_ + at, &none, sizeof none);
        }
        return met;
    }

    // ---- what is on the way -------------------------------------------------------------------------------------

    /// `stopped`, `open`: bits of rays.
    template <bool isPair>
    RTSG_INLINE void stop(const LargeTable& table, const Rays& rays, std::uint32_t from, std::uint32_t to,
                          std::uint32_t& stopped, std::uint32_t& open) {
        for (std::uint32_t i = from; i < to; ++i) {
            const LargeTable::Face& face = table.faces[i];
            const Plane p(rays, face);
            const M between = W::greater(W::greater(p.t, rays.tMin), rays.tMax, p.t);
            if (!W::bits(between)) continue;  // often: rays within a room end before its walls
            const Meeting m(rays, p, face);
            const F depth = m.template depth<isPair>();
            const M near = W::greater(between, depth, -m.edge);
            // A ray that ends on the plane must not be stopped: the test allows for the rounding that is left.
            const M sure =
                W::both(W::greater(near, depth, m.edge), W::greater(W::greater(absolute(p.height), rays.slack),
                                                                    rays.tMax - rays.slack * absolute(p.inverse), p.t));
            const std::uint32_t fromBack = W::bits(W::greater(p.inverse, F{}));
            const std::uint32_t stops = W::bits(sure) & ((face.sides & LargeTriangles::kBack ? fromBack : 0) |
                                                         (face.sides & LargeTriangles::kFront ? ~fromBack : 0));
            stopped |= stops, open |= W::bits(near) & ~stops;
        }
    }

    static std::uint32_t occluded(const LargeTable& table, const RayRows& rows, std::uint32_t& open) {
        std::uint32_t blocked = 0;
        open = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const Rays own(table, rows, at);
            std::uint32_t stopped = 0, left = 0;
            stop<true>(table, own, 0, table.pairCount, stopped, left);
            stop<false>(table, own, table.pairCount, table.faceCount, stopped, left);
            const std::uint32_t lanes = rows.lanes >> at & kAll;
            blocked |= (stopped & lanes) << at;
            open |= ((left | reachBoxes(table, own, own.tMax)) & lanes & ~stopped) << at;
        }
        return blocked;
    }

    static constexpr LargeKernels kTable{&intersect, &occluded};
};

#undef RTSG_INLINE

}  // namespace rtsg::bvh
