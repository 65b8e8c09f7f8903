// The template behind PrimaryKernels, for registers of eight and of sixteen lanes.
//
// W: as Lanes8 and Lanes16, a type of the unit's own. Nothing here calls functions that are not inlined by force or
// part of a W. Invariant: bit for bit the same at either width. Threading: re-entrant.
#pragma once

#include "mesh/lane_math.h"
#include "primary_hits.h"

namespace rtsg::bvh {

#define RTSG_INLINE __attribute__((always_inline)) static inline

template <class W>
struct PrimaryKernelsOf {
    using F = typename W::F;
    using M = typename W::M;
    static constexpr int kLanes = W::kLanes;
    static constexpr std::uint32_t kAll = (std::uint32_t{1} << kLanes) - 1;

    struct V {
        F x, y, z;
    };
    RTSG_INLINE F all(float x) { return simd::lanes::fill<F>(x); }
    RTSG_INLINE V all(const Vec3f& v) { return {all(v.x), all(v.y), all(v.z)}; }
    RTSG_INLINE F absolute(F x) { return W::maximum(x, -x); }
    RTSG_INLINE F dot(const V& a, const V& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
    RTSG_INLINE F dot(const V& a, const Vec3f& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
    /// The rounding error of a dot product, in units of the last place.
    RTSG_INLINE F sizes(const V& a, const Vec3f& b) {
        return absolute(a.x) * __builtin_fabsf(b.x) + absolute(a.y) * __builtin_fabsf(b.y) +
               absolute(a.z) * __builtin_fabsf(b.z);
    }
    RTSG_INLINE V plus(const V& a, const V& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    RTSG_INLINE V minus(const V& a, const V& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    RTSG_INLINE V cross(const V& a, const V& b) {
        return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    }
    RTSG_INLINE V choose(M mask, const V& a, const V& b) {
        return {W::choose(mask, a.x, b.x), W::choose(mask, a.y, b.y), W::choose(mask, a.z, b.z)};
    }

    // ---- triangles ----------------------------------------------------------------------------------------------

    /// Seen from the eye: a corner, the normals of the planes through the edges opposite the second, third and first
    /// corner, which the neighbour finds with the other sign, and the triangle's own.
    struct Triangles {
        V corner[3], edge[3], normal;
    };
    RTSG_INLINE Triangles around(const V& a, const V& b, const V& c) {
        const V ca = minus(c, a), ab = minus(a, b), bc = minus(b, c);
        Triangles t{{a, b, c}, {cross(ca, plus(c, a)), cross(ab, plus(a, b)), cross(bc, plus(b, c))}, {}};
        // All pairs of edges give it; of a needle the two longest give little but roundings.
        const F x = dot(ca, ca), y = dot(ab, ab), z = dot(bc, bc);
        const M first = W::greater(x, W::maximum(y, z)), second = W::greater(y, W::maximum(x, z));
        t.normal = cross(choose(first, ab, choose(second, bc, ca)), choose(first, bc, choose(second, ca, ab)));
        return t;
    }
    /// Corners of the triangles `numbers` of a mesh, of as many as there are lanes.
    struct Corners {
        const float* corner[3][kLanes];  // every fourth lane's next to each other
        RTSG_INLINE int of(int lane) { return lane % 4 * (kLanes / 4) + lane / 4; }
        __attribute__((always_inline)) void set(int lane, const ClusteredMesh& mesh, std::uint32_t triangle) {
            const std::int32_t* index = mesh.triangles + std::size_t{triangle} * mesh.stride;
            for (int c = 0; c < 3; ++c) corner[c][of(lane)] = &mesh.positions[index[c]].x;
        }
    };
    RTSG_INLINE V gathered(const float* const* positions, const V& eye) {
        constexpr int kNext = kLanes / 4;
        F q[4] = {W::quads(positions), W::quads(positions + kNext), W::quads(positions + 2 * kNext),
                  W::quads(positions + 3 * kNext)};
        W::transpose(q[0], q[1], q[2], q[3]);
        return minus({q[0], q[1], q[2]}, eye);
    }
    RTSG_INLINE Triangles gathered(const Corners& positions, const V& eye) {
        return around(gathered(positions.corner[0], eye), gathered(positions.corner[1], eye),
                      gathered(positions.corner[2], eye));
    }

    // ---- tiles --------------------------------------------------------------------------------------------------

    /// A cluster's triangles over a tile: three edges and the nearness, each as `one + x * across + y * down` at so
    /// many pixels from the tile's middle. Edges are positive inside.
    struct alignas(64) Planes {
        float across[4][16], down[4][16], one[4][16];
        float maximum[4][16];  // `one` and as much more as it may be anywhere in a block around its middle
    };
    /// From the middle to the outermost places of pixels, and some roundings.
    struct Reach {
        float block, tile;
    };
    static constexpr Reach kMiddles{1.5f + 0x1p-14f, 7.5f + 0x1p-14f}, kAnywhere{2 + 0x1p-14f, 8 + 0x1p-14f};
    static constexpr float kRounding = 0x1p-21f;
    static constexpr float kSlack = 0x1p-22f;

    /// In pixels.
    struct Extent {
        F low, high;
        __attribute__((always_inline)) void add(F at) { low = W::minimum(low, at), high = W::maximum(high, at); }
        /// Whether the middle of a pixel of the tile may be in it. `at`: of the tile's middle.
        __attribute__((always_inline)) M holdsMiddle(float at, float margin) const {
            constexpr float kToWhole = 0x1.8p23f;
            const F last = W::minimum(W::maximum(high - (at + .5f - margin), all(-9)), all(7));
            const F near = (last + kToWhole) - kToWhole, floor = near - W::choose(W::greater(near, last), all(1), F{});
            return W::atLeast(floor, W::maximum(low - (at + .5f + margin), all(-8)));
        }
    };
    /// A bit for each triangle that may be over the middle of one of the tile's pixels, by the box around it: of those
    /// that are smaller or narrower than a pixel few are.
    RTSG_INLINE std::uint32_t overMiddles(const TileFrame& f, const Triangles& t) {
        const F nearest = dot(t.corner[0], f.rows.depth), inverse = 1.0f / nearest;
        const F at = dot(t.corner[0], f.rows.x) * inverse, down = dot(t.corner[0], f.rows.y) * inverse;
        Extent x{at, at}, y{down, down}, depth{nearest, nearest};
        for (int k = 1; k < 3; ++k) {
            const F next = dot(t.corner[k], f.rows.depth), one = 1.0f / next;
            x.add(dot(t.corner[k], f.rows.x) * one), y.add(dot(t.corner[k], f.rows.y) * one), depth.add(next);
        }
        const M sound = W::greater(depth.low, depth.high * 1e-4f);
        const M held = W::both(x.holdsMiddle(f.x, f.margin), y.holdsMiddle(f.y, f.margin));
        return ~W::bits(sound) | W::bits(held);
    }

    /// Returns a bit for each triangle that may be seen nearer than `farthest`.
    RTSG_INLINE std::uint32_t setUp(const TileFrame& f, const ClusteredMesh& mesh, std::uint32_t first, float farthest,
                                    bool middles, Planes& p) {
        const Reach& within = middles ? kMiddles : kAnywhere;
        const std::uint32_t there = mesh.count - first < 16 ? mesh.count - first : 16;
        std::uint32_t seen = 0;
        for (int at = 0; at < 16; at += kLanes) {
            Corners positions;
            for (int lane = 0; lane < kLanes; ++lane) {
                const auto i = static_cast<std::uint32_t>(at + lane);
                positions.set(lane, mesh, first + (i < there ? i : there - 1));
            }
            const Triangles t = gathered(positions, all(f.eye));
            const F height = dot(t.corner[0], t.normal);
            const F side = W::choose(W::greater(F{}, height), all(-1), all(1));
            const F inverse = 1.0f / height;
            F across[4], down[4], one[4];
            for (int k = 0; k < 3; ++k) {
                across[k] = dot(t.edge[k], f.toRight) * side;
                down[k] = dot(t.edge[k], f.downwards) * side;
                one[k] = dot(t.edge[k], f.middle) * side;
            }
            across[3] = dot(t.normal, f.toRight) * inverse, down[3] = dot(t.normal, f.downwards) * inverse;
            one[3] = dot(t.normal, f.middle) * inverse;
            // Beyond the edges by the rounding error, so that corners are closed, too.
            M use = W::greater(absolute(height), F{});
            std::uint32_t bits = W::bits(use) & kAll;
            if (middles) bits &= overMiddles(f, t);
            for (int k = 0; k < 4; ++k) {
                if (k < 3) one[k] = one[k] + sizes(t.edge[k], f.middle) * kSlack;
                const F reach = absolute(across[k]) + absolute(down[k]), rounding = absolute(one[k]) * kRounding;
                const F maximum = one[k] + rounding;
                W::store(p.across[k] + at, across[k]), W::store(p.down[k] + at, down[k]);
                W::store(p.one[k] + at, one[k]);
                W::store(p.maximum[k] + at, maximum + reach * within.block);
                bits &= W::bits(W::atLeast(maximum + reach * within.tile, k < 3 ? F{} : all(farthest)));
            }
            seen |= bits << at;
        }
        return seen & ((std::uint32_t{1} << there) - 1);
    }

    /// Places of blocks' middles in the tile, and of pixels' in a tile.
    struct alignas(64) Grid {
        float blockX[16], blockY[16];
        TilePositions pixels;
        constexpr Grid() : blockX(), blockY(), pixels() {
            for (int b = 0; b < 16; ++b) {
                const int blockRow = b / 4;
                blockX[b] = static_cast<float>(b % 4) * 4 - 6, blockY[b] = static_cast<float>(blockRow) * 4 - 6;
                for (int i = 0; i < 16; ++i) {
                    const int row = i / 4;
                    pixels.x[b][i] = blockX[b] + static_cast<float>(i % 4) - 1.5f;
                    pixels.y[b][i] = blockY[b] + static_cast<float>(row) - 1.5f;
                }
            }
        }
    };
    static constexpr Grid kGrid{};

    /// One triangle of them, the same in all lanes.
    struct Plane {
        F across, down, one;
        __attribute__((always_inline)) F at(F x, F y) const { return (one + across * x) + down * y; }
    };

    /// The samples that a tile is asked for.
    struct Samples {
        const TilePositions* positions;
        TileHits* hits;
        std::size_t count;
    };
    RTSG_INLINE void cover(const Planes& p, int i, std::uint32_t number, const float* farthest, std::uint32_t within,
                           std::uint32_t& touched, const Samples& samples) {
        Plane plane[4];
        for (int k = 0; k < 4; ++k) plane[k] = {all(p.across[k][i]), all(p.down[k][i]), all(p.one[k][i])};
        std::uint32_t blocks = 0;
        for (int at = 0; at < 16; at += kLanes) {
            const F x = W::load(kGrid.blockX + at), y = W::load(kGrid.blockY + at);
            F value[4];
            for (int k = 0; k < 4; ++k) value[k] = Plane{plane[k].across, plane[k].down, all(p.maximum[k][i])}.at(x, y);
            const F inside = W::minimum(W::minimum(value[0], value[1]), value[2]);
            const std::uint32_t nearer = W::bits(W::greater(value[3], W::load(farthest + at)));
            blocks |= (W::bits(W::atLeast(inside, F{})) & nearer) << at;
        }
        for (blocks &= within; blocks; blocks &= blocks - 1) {
            const int block = __builtin_ctz(blocks);
            std::uint32_t covered = 0;
            for (std::size_t s = 0; s < samples.count; ++s) {
                const TilePositions& positions = samples.positions[s];
                TileHits& hits = samples.hits[s];
                for (int at = 0; at < 16; at += kLanes) {
                    const F x = W::load(positions.x[block] + at), y = W::load(positions.y[block] + at);
                    const F inside = W::minimum(W::minimum(plane[0].at(x, y), plane[1].at(x, y)), plane[2].at(x, y));
                    const F near = plane[3].at(x, y), old = W::load(hits.nearness[block] + at);
                    const M now = W::both(W::atLeast(inside, F{}), W::greater(near, old));
                    W::put(hits.nearness[block] + at, now, near);
                    W::put(hits.triangle[block] + at, now, number);
                    covered |= W::bits(now);
                }
            }
            touched |= static_cast<std::uint32_t>(covered != 0) << block;
        }
    }

    /// Prefetches the data of the next clusters.
    RTSG_INLINE void prepare(const PrimaryHits::Seen* seen, const PrimaryHits::Seen* end, const Cluster* clusters,
                             const ClusteredMesh* meshes) {
        constexpr int kRecord = 8, kIndices = 4, kCorners = 2;  // so many clusters ahead
        if (end - seen > kRecord) __builtin_prefetch(&clusters[seen[kRecord].cluster]);
        if (end - seen > kIndices) {
            const Cluster& c = clusters[seen[kIndices].cluster];
            const ClusteredMesh& mesh = meshes[c.mesh];
            const std::int32_t* const index = mesh.triangles + std::size_t{c.first} * mesh.stride;
            for (int line = 0; line < 4; ++line) __builtin_prefetch(index + 16 * line);
        }
        if (end - seen > kCorners) {
            const Cluster& c = clusters[seen[kCorners].cluster];
            const ClusteredMesh& mesh = meshes[c.mesh];
            const std::uint32_t last = mesh.count - c.first < 16 ? mesh.count - c.first - 1 : 15;
            for (std::uint32_t part = 0; part < 3; ++part) {
                const std::size_t t = c.first + last * part / 2;
                const std::int32_t* const index = mesh.triangles + t * mesh.stride;
                for (int k = 0; k < 3; ++k) __builtin_prefetch(&mesh.positions[index[k]]);
            }
        }
    }

    static void find(const TileFrame& frame, const PrimaryHits::Seen* seen, const PrimaryHits::Seen* end,
                     const Cluster* clusters, const ClusteredMesh* meshes, const TilePositions* positions,
                     TileHits* hits, std::size_t count) {
        const Samples samples{positions ? positions : &kGrid.pixels, hits, count};
        for (std::size_t s = 0; s < count; ++s)
            for (int block = 0; block < 16; ++block)
                for (int at = 0; at < 16; at += kLanes) {
                    W::store(hits[s].nearness[block] + at, F{});
                    W::put(hits[s].triangle[block] + at, W::maskOf(kAll), TileHits::kNone);
                }
        alignas(64) float farthest[16] = {};  // of the blocks, in whichever of their samples
        float limit = 0;
        Planes planes;
        for (; seen != end && seen->nearness > limit; ++seen) {
            prepare(seen, end, clusters, meshes);
            std::uint32_t within = 0;  // blocks that may see it
            for (int at = 0; at < 16; at += kLanes)
                within |= W::bits(W::greater(all(seen->nearness), W::load(farthest + at))) << at;
            within &= seen->blocks;
            if (!within) continue;
            const Cluster& cluster = clusters[seen->cluster];
            std::uint32_t rest = setUp(frame, meshes[cluster.mesh], cluster.first, limit, !positions, planes);
            std::uint32_t touched = 0;
            for (; rest; rest &= rest - 1) {
                const int i = __builtin_ctz(rest);
                cover(planes, i, seen->cluster * Cluster::kTriangles + static_cast<std::uint32_t>(i), farthest, within,
                      touched, samples);
            }
            if (!touched) continue;
            for (; touched; touched &= touched - 1) {
                const int block = __builtin_ctz(touched);
                F minimum = smallestOf(hits[0].nearness[block]);
                for (std::size_t s = 1; s < count; ++s)
                    minimum = W::minimum(minimum, smallestOf(hits[s].nearness[block]));
                farthest[block] = W::smallest(minimum);
            }
            limit = W::smallest(smallestOf(farthest));
        }
    }
    RTSG_INLINE F smallestOf(const float* of16) {
        F minimum = W::load(of16);
        for (int at = kLanes; at < 16; at += kLanes) minimum = W::minimum(minimum, W::load(of16 + at));
        return minimum;
    }

    // ---- rays ---------------------------------------------------------------------------------------------------

    static bool meet(const TileHits& hits, int block, const std::int32_t* valid, const Cluster* clusters,
                     const ClusteredMesh* meshes, RayPacket16& rays) {
        for (int at = 0; at < 16; at += kLanes) {
            const std::uint32_t* const numbers = hits.triangle[block] + at;
            typename W::I own, isValid;
            __builtin_memcpy(&own, numbers, sizeof own);
            __builtin_memcpy(&isValid, valid + at, sizeof isValid);
            const std::uint32_t met = W::bits((own != -1) & (isValid != 0));
            if (!met) continue;
            const int some = __builtin_ctz(met);
            alignas(64) std::uint32_t triangle[kLanes], mesh[kLanes];
            const V eye{W::load(rays.originX + at), W::load(rays.originY + at), W::load(rays.originZ + at)};
            const V d{W::load(rays.directionX + at), W::load(rays.directionY + at), W::load(rays.directionZ + at)};
            Triangles t;
            const std::uint32_t first = numbers[some];
            if ((W::bits(own == static_cast<std::int32_t>(first)) & met) == met) {  // large ones fill whole blocks
                const Cluster& cluster = clusters[first / Cluster::kTriangles];
                const ClusteredMesh& in = meshes[cluster.mesh];
                const std::uint32_t only = cluster.first + first % Cluster::kTriangles;
                const std::int32_t* const index = in.triangles + std::size_t{only} * in.stride;
                for (int lane = 0; lane < kLanes; ++lane) triangle[lane] = only, mesh[lane] = cluster.mesh;
                t = around(minus(all(in.positions[index[0]]), eye), minus(all(in.positions[index[1]]), eye),
                           minus(all(in.positions[index[2]]), eye));
            } else {
                Corners positions;
                for (int lane = 0; lane < kLanes; ++lane) {
                    const std::uint32_t number = numbers[met >> lane & 1u ? lane : some];
                    const Cluster& cluster = clusters[number / Cluster::kTriangles];
                    triangle[lane] = cluster.first + number % Cluster::kTriangles, mesh[lane] = cluster.mesh;
                    positions.set(lane, meshes[cluster.mesh], triangle[lane]);
                }
                t = gathered(positions, eye);
            }
            const F u = dot(t.edge[0], d), v = dot(t.edge[1], d), whole = (u + v) + dot(t.edge[2], d);
            const F distance = dot(t.corner[0], t.normal) / dot(d, t.normal), inverse = 1.0f / whole;
            const F far = W::load(rays.tMax + at), maximum = all(__FLT_MAX__);
            const M sound = W::both(W::greater(distance, F{}), W::atLeast(maximum, absolute(inverse)));
            if (met & ~W::bits(sound)) return false;
            const M use = W::both(W::maskOf(met), W::atLeast(far, distance));
            W::put(rays.tMax + at, use, distance);
            W::put(rays.normalX_ + at, use, t.normal.x), W::put(rays.normalY_ + at, use, t.normal.y);
            W::put(rays.normalZ_ + at, use, t.normal.z);
            W::put(rays.u_ + at, use, W::minimum(W::maximum(u * inverse, F{}), all(1)));
            W::put(rays.v_ + at, use, W::minimum(W::maximum(v * inverse, F{}), all(1)));
            W::put(rays.prim_ + at, use, triangle), W::put(rays.geom_ + at, use, mesh);
        }
        return true;
    }

    static constexpr PrimaryKernels kTable{&find, &meet};
};

#undef RTSG_INLINE

}  // namespace rtsg::bvh
