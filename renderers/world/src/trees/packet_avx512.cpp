// The packet traversal in AVX-512 registers.
#include "packet_avx512.h"

#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
#include <immintrin.h>

namespace rtsg::bvh::avx512 {

namespace {

// Nothing here may become code that the linker shares with other units: intrinsics and builtins only.
#define RTSG_INLINE __attribute__((always_inline)) inline

using Node = TreeView::Node;
using F16 = __m512;

constexpr float kCloser = TreeView::kCloser, kFarther = TreeView::kFarther, kSmall = TreeView::kSmall;
constexpr float kFar = __builtin_huge_valf();

RTSG_INLINE F16 reciprocalOf(F16 d) {
    const F16 small = _mm512_set1_ps(kSmall), minus = _mm512_set1_ps(-kSmall);
    const __mmask16 tiny = _mm512_cmp_ps_mask(d, small, _CMP_LT_OQ) & _mm512_cmp_ps_mask(d, minus, _CMP_GT_OQ);
    const __mmask16 below = _mm512_cmp_ps_mask(d, _mm512_setzero_ps(), _CMP_LT_OQ);
    const F16 safe = _mm512_mask_mov_ps(small, below, minus);
    return _mm512_div_ps(_mm512_set1_ps(1), _mm512_mask_mov_ps(d, tiny, safe));
}
RTSG_INLINE const Node& nodeAt(const Node* const* pages, std::uint32_t i) {
    return pages[i >> TreeView::kPageBits][i & (TreeView::kPerPage - 1)];
}
RTSG_INLINE std::uint32_t bitsOf(float x) {
    std::uint32_t bits;
    __builtin_memcpy(&bits, &x, sizeof bits);
    return bits;
}

/// TreeView::Packet in registers twice as wide.
struct Packet {
    F16 origin[3], reciprocal[3], tMin;
    __mmask16 active;
    bool agrees;
    bool negative[3];
    float originLow[3], originHigh[3], reciprocalLow[3], reciprocalHigh[3], start, end;
};

RTSG_INLINE void shorten(Packet& p, const RayPacket16& rays) {
    p.end = _mm512_reduce_max_ps(_mm512_mask_loadu_ps(_mm512_set1_ps(-kFar), p.active, rays.tMax));
}

RTSG_INLINE void findInterval(Packet& p, const RayPacket16& rays) {
    p.agrees = true;
    const F16 far = _mm512_set1_ps(kFar), minusFar = _mm512_set1_ps(-kFar);
    for (int k = 0; k < 3; ++k) {
        p.originLow[k] = _mm512_reduce_min_ps(_mm512_mask_mov_ps(far, p.active, p.origin[k]));
        p.originHigh[k] = _mm512_reduce_max_ps(_mm512_mask_mov_ps(minusFar, p.active, p.origin[k]));
        p.reciprocalLow[k] = _mm512_reduce_min_ps(_mm512_mask_mov_ps(far, p.active, p.reciprocal[k]));
        p.reciprocalHigh[k] = _mm512_reduce_max_ps(_mm512_mask_mov_ps(minusFar, p.active, p.reciprocal[k]));
        p.negative[k] = p.reciprocalHigh[k] < 0;
        p.agrees = p.agrees && (p.reciprocalLow[k] > 0 || p.negative[k]);
    }
    p.start = _mm512_reduce_min_ps(_mm512_mask_mov_ps(far, p.active, p.tMin));
    shorten(p, rays);
}

RTSG_INLINE std::uint32_t meetAll(const Packet& p, const Node& n, float* nears) {
    __m256 near = _mm256_set1_ps(p.start), far = _mm256_set1_ps(p.end);
    for (int k = 0; k < 3; ++k) {
        const __m256 entry = _mm256_load_ps(n.bounds[p.negative[k]][k]);
        const __m256 exit = _mm256_load_ps(n.bounds[!p.negative[k]][k]);
        const __m256 low = _mm256_set1_ps(p.reciprocalLow[k]), high = _mm256_set1_ps(p.reciprocalHigh[k]);
        const __m256 a = _mm256_sub_ps(entry, _mm256_set1_ps(p.negative[k] ? p.originLow[k] : p.originHigh[k]));
        const __m256 b = _mm256_sub_ps(exit, _mm256_set1_ps(p.negative[k] ? p.originHigh[k] : p.originLow[k]));
        // The sign bit chooses; for a zero either factor gives zero.
        near = _mm256_max_ps(near, _mm256_mul_ps(a, _mm256_blendv_ps(low, high, a)));
        far = _mm256_min_ps(far, _mm256_mul_ps(b, _mm256_blendv_ps(high, low, b)));
    }
    near = _mm256_mul_ps(near, _mm256_set1_ps(kCloser));
    _mm256_store_ps(nears, near);
    return _mm256_cmp_ps_mask(near, _mm256_mul_ps(far, _mm256_set1_ps(kFarther)), _CMP_LE_OQ);
}

RTSG_INLINE float meet(const Packet& p, const Node& n, std::uint32_t i, const float* tMax, __mmask16& lanes) {
    F16 low = p.tMin, high = _mm512_loadu_ps(tMax);
    for (int k = 0; k < 3; ++k) {
        const F16 a = _mm512_mul_ps(_mm512_sub_ps(_mm512_set1_ps(n.bounds[0][k][i]), p.origin[k]), p.reciprocal[k]);
        const F16 b = _mm512_mul_ps(_mm512_sub_ps(_mm512_set1_ps(n.bounds[1][k][i]), p.origin[k]), p.reciprocal[k]);
        low = _mm512_max_ps(low, _mm512_min_ps(a, b));
        high = _mm512_min_ps(high, _mm512_max_ps(a, b));
    }
    low = _mm512_mul_ps(low, _mm512_set1_ps(kCloser));
    lanes = _mm512_mask_cmp_ps_mask(p.active, low, _mm512_mul_ps(high, _mm512_set1_ps(kFarther)), _CMP_LE_OQ);
    return lanes ? _mm512_reduce_min_ps(_mm512_mask_mov_ps(_mm512_set1_ps(kFar), lanes, low)) : kFar;
}

RTSG_INLINE void call(Leaf leaf, void* self, std::uint32_t child, __mmask16 lanes) {
    alignas(64) std::int32_t mask[16];
    _mm512_store_si512(mask, _mm512_movm_epi32(lanes));
    leaf(self, child & ~TreeView::kLeaf, mask);
}

/// For a few objects, all below the root: the packet's interval would cost more than it saves.
void traverseRoot(const Node& root, const Packet& p, const RayPacket16& rays, Leaf leaf, void* self) {
    __mmask16 lanes;
    std::uint64_t order[8];
    std::uint32_t found = 0;
    for (std::uint32_t i = 0; i < 8; ++i) {
        if (root.child[i] == TreeView::kNone) continue;
        const float near = meet(p, root, i, rays.tMax, lanes);
        if (near == kFar) continue;
        const std::uint64_t entry = std::uint64_t{bitsOf(near)} << 32 | i;
        std::uint32_t at = found++;
        for (; at > 0 && order[at - 1] > entry; --at) order[at] = order[at - 1];
        order[at] = entry;
    }
    for (std::uint32_t k = 0; k < found; ++k) {
        const auto i = static_cast<std::uint32_t>(order[k]);
        if (meet(p, root, i, rays.tMax, lanes) < kFar) call(leaf, self, root.child[i], lanes);
    }
}

}  // namespace

bool isBuilt() {
    return true;
}

void traverse(const Node* const* pages, std::size_t count, const RayPacket16& rays, const std::int32_t* active,
              Leaf leaf, void* self) {
    Packet p;
    p.active = _mm512_movepi32_mask(_mm512_loadu_si512(active));
    if (!p.active) return;
    p.origin[0] = _mm512_loadu_ps(rays.originX), p.origin[1] = _mm512_loadu_ps(rays.originY);
    p.origin[2] = _mm512_loadu_ps(rays.originZ), p.tMin = _mm512_loadu_ps(rays.tMin);
    p.reciprocal[0] = reciprocalOf(_mm512_loadu_ps(rays.directionX));
    p.reciprocal[1] = reciprocalOf(_mm512_loadu_ps(rays.directionY));
    p.reciprocal[2] = reciprocalOf(_mm512_loadu_ps(rays.directionZ));
    if (count == 1) return traverseRoot(nodeAt(pages, TreeView::kRoot), p, rays, leaf, self);
    __mmask16 lanes;
    findInterval(p, rays);
    std::uint64_t stack[TreeView::kStack];
    std::size_t top = 0;
    alignas(32) float nears[8];
    std::uint32_t current = TreeView::kRoot;
    for (;;) {
        const Node& n = nodeAt(pages, current);
        std::uint32_t mask = 0;
        if (p.agrees) {
            mask = meetAll(p, n, nears);
        } else {
            for (std::uint32_t i = 0; i < 8; ++i) {
                nears[i] = n.child[i] == TreeView::kNone ? kFar : meet(p, n, i, rays.tMax, lanes);
                mask |= static_cast<std::uint32_t>(nears[i] < kFar) << i;
            }
        }
        std::uint64_t entry = 0;
        if (mask) {
            const std::size_t first = top;
            bool any = false;
            for (; mask; mask &= mask - 1) {
                const auto i = static_cast<std::uint32_t>(__builtin_ctz(mask));
                const std::uint64_t other = std::uint64_t{bitsOf(nears[i])} << 32 | (current << 3 | i);
                if (!any) {
                    entry = other, any = true;
                    continue;
                }
                // Sorted, nearest on top: a packet's visit costs more than the sorting.
                const std::uint64_t farther = entry > other ? entry : other;
                entry = entry < other ? entry : other;
                std::size_t at = top++;
                for (; at > first && stack[at - 1] < farther; --at) stack[at] = stack[at - 1];
                stack[at] = farther;
            }
        } else {
            if (top == 0) return;
            entry = stack[--top];
        }
        for (;; entry = stack[--top]) {
            if (entry >> 32 <= bitsOf(p.end)) {
                const Node& holder = nodeAt(pages, static_cast<std::uint32_t>(entry) >> 3);
                const std::uint32_t lane = entry & 7, child = holder.child[lane];
                if (!(child & TreeView::kLeaf)) {
                    current = child;
                    break;
                }
                if (meet(p, holder, lane, rays.tMax, lanes) < kFar) {
                    call(leaf, self, child, lanes);
                    shorten(p, rays);
                    if (p.end < p.start) return;
                }
            }
            if (top == 0) return;
        }
    }
}

void enter(RayPacket16& rays, const float* m, const float* translation, SavedRays& saved) {
    using V = float __attribute__((vector_size(64)));
    const auto load = [](const float* p) __attribute__((always_inline)) { return static_cast<V>(_mm512_loadu_ps(p)); };
    const auto store = [](float* p, V v) __attribute__((always_inline)) { _mm512_storeu_ps(p, static_cast<F16>(v)); };
    const V x = load(rays.originX), y = load(rays.originY), z = load(rays.originZ);
    const V dx = load(rays.directionX), dy = load(rays.directionY), dz = load(rays.directionZ);
    store(saved.values[0], x), store(saved.values[1], y), store(saved.values[2], z);
    store(saved.values[3], dx), store(saved.values[4], dy), store(saved.values[5], dz);
    const V ox = x - translation[0], oy = y - translation[1], oz = z - translation[2];
    store(rays.originX, m[0] * ox + m[3] * oy + m[6] * oz);
    store(rays.originY, m[1] * ox + m[4] * oy + m[7] * oz);
    store(rays.originZ, m[2] * ox + m[5] * oy + m[8] * oz);
    store(rays.directionX, m[0] * dx + m[3] * dy + m[6] * dz);
    store(rays.directionY, m[1] * dx + m[4] * dy + m[7] * dz);
    store(rays.directionZ, m[2] * dx + m[5] * dy + m[8] * dz);
}

void leave(RayPacket16& rays, const SavedRays& saved) {
    float* const targets[] = {rays.originX,    rays.originY,    rays.originZ,
                              rays.directionX, rays.directionY, rays.directionZ};
    for (int i = 0; i < 6; ++i) _mm512_storeu_ps(targets[i], _mm512_load_ps(saved.values[i]));
}

namespace {

using V = float __attribute__((vector_size(64)));
RTSG_INLINE V loadV(const float* p) {
    return static_cast<V>(_mm512_loadu_ps(p));
}
RTSG_INLINE V larger(V a, V b) {
    return a > b ? a : b;
}
RTSG_INLINE V magnitude(V v) {
    return larger(v, -v);
}
template <class Mask>
RTSG_INLINE std::uint32_t bitsOf16(Mask mask) {
    return _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask));
}

}  // namespace

std::uint32_t findValid(const RayPacket16& rays, const Limits& limits, std::int32_t* valid) {
    const V ox = loadV(rays.originX), oy = loadV(rays.originY), oz = loadV(rays.originZ);
    const V dx = loadV(rays.directionX), dy = loadV(rays.directionY), dz = loadV(rays.directionZ);
    const V near = loadV(rays.tMin), far = loadV(rays.tMax);
    const V reach = larger(larger(magnitude(ox), magnitude(oy)), magnitude(oz));
    const V length = larger(larger(magnitude(dx), magnitude(dy)), magnitude(dz));
    // A larger number may hide a NaN; sums look for them.
    const V sum = (ox - ox) + (oy - oy) + (oz - oz) + (dx - dx) + (dy - dy) + (dz - dz);
    const auto good = (sum == 0.0f) & (reach <= limits.coordinate) & (length >= limits.shortest) &
                      (length <= limits.longest) & (near >= 0.0f) & (near < kFar) & (far >= 0.0f);
    const __mmask16 within = static_cast<__mmask16>(bitsOf16(good));
    const __m512i active = _mm512_loadu_si512(rays.active);
    _mm512_storeu_si512(valid, _mm512_maskz_mov_epi32(within, active));
    return _mm512_test_epi32_mask(active, active) & ~std::uint32_t{within};
}

void complete(RayPacket16& rays, std::uint32_t mask) {
    const __m512i none = _mm512_set1_epi32(-1), zero = _mm512_setzero_si512();
    _mm512_storeu_si512(rays.time_, zero), _mm512_storeu_si512(rays.id_, zero);
    _mm512_storeu_si512(rays.flags_, zero);
    _mm512_storeu_si512(rays.mask_, _mm512_set1_epi32(static_cast<std::int32_t>(mask)));
    _mm512_storeu_si512(rays.geom_, none), _mm512_storeu_si512(rays.inst_, none);
}

bool runTogether(const RayPacket16& rays, const std::int32_t* valid, float parallel, float nearby) {
    const __mmask16 lanes = _mm512_movepi32_mask(_mm512_loadu_si512(valid));
    const auto squareOfRange = [lanes](V v) __attribute__((always_inline)) {
        const F16 all = static_cast<F16>(v);
        const float range = _mm512_mask_reduce_max_ps(lanes, all) - _mm512_mask_reduce_min_ps(lanes, all);
        return range * range;
    };
    const V x = loadV(rays.directionX), y = loadV(rays.directionY), z = loadV(rays.directionZ);
    const V inverse = 1.0f / static_cast<V>(_mm512_sqrt_ps(static_cast<F16>((x * x + y * y) + z * z)));
    const float turned = (squareOfRange(x * inverse) + squareOfRange(y * inverse)) + squareOfRange(z * inverse);
    if (!(turned < parallel)) return false;
    const float apart =
        (squareOfRange(loadV(rays.originX)) + squareOfRange(loadV(rays.originY))) + squareOfRange(loadV(rays.originZ));
    return apart < nearby;
}

std::uint32_t findHits(const RayPacket16& rays) {
    return _mm512_cmpneq_epi32_mask(_mm512_loadu_si512(rays.geom_), _mm512_set1_epi32(-1));
}

void copyHits(const RayPacket16& rays, PacketHits16& hits) {
    const float* const from[] = {rays.normalX_, rays.normalY_, rays.normalZ_, rays.u_, rays.v_};
    float* const to[] = {hits.normalX, hits.normalY, hits.normalZ, hits.u, hits.v};
    for (int i = 0; i < 5; ++i) _mm512_storeu_ps(to[i], _mm512_loadu_ps(from[i]));
    _mm512_storeu_si512(hits.triangle, _mm512_loadu_si512(rays.prim_));
}

void makeUnit(PacketHits16& hits) {
    V x = loadV(hits.normalX), y = loadV(hits.normalY), z = loadV(hits.normalZ);
    const V one = 1.0f - V{};
    const V size = larger(larger(magnitude(x), magnitude(y)), magnitude(z));
    const auto extreme = (size < 1e-15f) | (size > 1e15f);
    if (bitsOf16(extreme)) {  // so that squares neither overflow nor vanish
        const V scale = extreme ? 1.0f / larger(size, 1e-38f - V{}) : one;
        x *= scale, y *= scale, z *= scale;
    }
    const V squared = x * x + y * y + z * z;
    const auto good = squared > 0.0f;
    const V inverse = 1.0f / static_cast<V>(_mm512_sqrt_ps(static_cast<F16>(good ? squared : one)));
    _mm512_storeu_ps(hits.normalX, static_cast<F16>(good ? x * inverse : V{}));
    _mm512_storeu_ps(hits.normalY, static_cast<F16>(good ? y * inverse : V{}));
    _mm512_storeu_ps(hits.normalZ, static_cast<F16>(good ? z * inverse : one));
}

}  // namespace rtsg::bvh::avx512

#else

namespace rtsg::bvh::avx512 {

bool isBuilt() {
    return false;
}
void traverse(const TreeView::Node* const*, std::size_t, const RayPacket16&, const std::int32_t*, Leaf, void*) {}
void enter(RayPacket16&, const float*, const float*, SavedRays&) {}
void leave(RayPacket16&, const SavedRays&) {}
std::uint32_t findValid(const RayPacket16&, const Limits&, std::int32_t*) {
    return 0;
}
void complete(RayPacket16&, std::uint32_t) {}
bool runTogether(const RayPacket16&, const std::int32_t*, float, float) {
    return false;
}
std::uint32_t findHits(const RayPacket16&) {
    return 0;
}
void copyHits(const RayPacket16&, PacketHits16&) {}
void makeUnit(PacketHits16&) {}

}  // namespace rtsg::bvh::avx512

#endif
