// Lanes16: sixteen floats in an AVX-512 register, and what the compiler's vector types cannot say of them.
//
// For units that are compiled for x86-64-v4 alone: a type of each unit's own, of intrinsics and builtins only, so that
// the linker takes no code of it for other units'. Threading: values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include <immintrin.h>

namespace rtsg::simd {

namespace {

#define RTSG_INLINE __attribute__((always_inline)) static inline

struct Lanes16 {
    using F = float __attribute__((vector_size(64)));
    using I = std::int32_t __attribute__((vector_size(64)));
    using M = __mmask16;
    static constexpr int kLanes = 16;

    RTSG_INLINE F load(const float* p) { return static_cast<F>(_mm512_loadu_ps(p)); }
    RTSG_INLINE void store(float* p, F v) { _mm512_storeu_ps(p, static_cast<__m512>(v)); }
    RTSG_INLINE void store(std::int32_t* p, I v) { _mm512_storeu_si512(p, reinterpret_cast<__m512i>(v)); }
    RTSG_INLINE F root(F v) { return static_cast<F>(_mm512_sqrt_ps(static_cast<__m512>(v))); }
    RTSG_INLINE std::uint32_t bits(I mask) { return _mm512_movepi32_mask(reinterpret_cast<__m512i>(mask)); }
    RTSG_INLINE I lanesOf(std::uint32_t mask) {
        return reinterpret_cast<I>(_mm512_movm_epi32(static_cast<__mmask16>(mask)));
    }
    RTSG_INLINE std::uint32_t bits(M mask) { return mask; }
    RTSG_INLINE M maskOf(std::uint32_t bits) { return static_cast<M>(bits); }
    RTSG_INLINE M atLeast(F a, F b) {
        return _mm512_cmp_ps_mask(static_cast<__m512>(a), static_cast<__m512>(b), _CMP_GE_OQ);
    }
    RTSG_INLINE M greater(F a, F b) {
        return _mm512_cmp_ps_mask(static_cast<__m512>(a), static_cast<__m512>(b), _CMP_GT_OQ);
    }
    RTSG_INLINE M both(M a, M b) { return _kand_mask16(a, b); }
    /// Compares only the lanes in `among`.
    RTSG_INLINE M greater(M among, F a, F b) {
        return _mm512_mask_cmp_ps_mask(among, static_cast<__m512>(a), static_cast<__m512>(b), _CMP_GT_OQ);
    }
    RTSG_INLINE F choose(M mask, F a, F b) {
        return static_cast<F>(_mm512_mask_blend_ps(mask, static_cast<__m512>(b), static_cast<__m512>(a)));
    }
    RTSG_INLINE F minimum(F a, F b) {
        return static_cast<F>(_mm512_min_ps(static_cast<__m512>(a), static_cast<__m512>(b)));
    }
    RTSG_INLINE F maximum(F a, F b) {
        return static_cast<F>(_mm512_max_ps(static_cast<__m512>(a), static_cast<__m512>(b)));
    }
    /// a * b + c, rounded once.
    RTSG_INLINE F fused(F a, F b, F c) {
        return static_cast<F>(_mm512_fmadd_ps(static_cast<__m512>(a), static_cast<__m512>(b), static_cast<__m512>(c)));
    }
    RTSG_INLINE float smallest(F v) { return _mm512_reduce_min_ps(static_cast<__m512>(v)); }
    RTSG_INLINE void put(float* to, M mask, F v) { _mm512_mask_storeu_ps(to, mask, static_cast<__m512>(v)); }
    RTSG_INLINE void put(std::uint32_t* to, M mask, std::uint32_t value) {
        _mm512_mask_storeu_epi32(to, mask, _mm512_set1_epi32(static_cast<std::int32_t>(value)));
    }
    RTSG_INLINE void put(std::uint32_t* to, M mask, const std::uint32_t* from) {
        _mm512_mask_storeu_epi32(to, mask, _mm512_loadu_si512(from));
    }
    RTSG_INLINE F columns() { return F{0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3}; }
    RTSG_INLINE F rows(int) { return F{0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3}; }

    /// Copies the lanes in `use`; all others become `other`.
    RTSG_INLINE void copy(std::uint32_t* to, const std::uint32_t* from, I use, std::uint32_t other) {
        const __m512i all = _mm512_set1_epi32(static_cast<std::int32_t>(other));
        const __mmask16 mask = _mm512_movepi32_mask(reinterpret_cast<__m512i>(use));
        _mm512_storeu_si512(to, _mm512_mask_loadu_epi32(all, mask, from));
    }
    /// Four floats each from four places.
    RTSG_INLINE F quads(const float* const* positions) {
        const __m256 low =
            _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(positions[0])), _mm_loadu_ps(positions[1]), 1);
        const __m256 high =
            _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(positions[2])), _mm_loadu_ps(positions[3]), 1);
        return static_cast<F>(_mm512_insertf32x8(_mm512_castps256_ps512(low), high, 1));
    }
    /// Looks up numbers in a table of thirty-two.
    RTSG_INLINE F lookUp(const float* table, I positions) {
        return static_cast<F>(_mm512_permutex2var_ps(_mm512_loadu_ps(table), reinterpret_cast<__m512i>(positions),
                                                     _mm512_loadu_ps(table + 16)));
    }
    template <int j>
    RTSG_INLINE F spread(F v) {
        return static_cast<F>(_mm512_permute_ps(static_cast<__m512>(v), j * 0x55));
    }
    /// Transposes four by four numbers in each quarter.
    RTSG_INLINE void transpose(F& a, F& b, F& c, F& d) {
        const __m512 ab = _mm512_unpacklo_ps(static_cast<__m512>(a), static_cast<__m512>(b));
        const __m512 abHigh = _mm512_unpackhi_ps(static_cast<__m512>(a), static_cast<__m512>(b));
        const __m512 cd = _mm512_unpacklo_ps(static_cast<__m512>(c), static_cast<__m512>(d));
        const __m512 cdHigh = _mm512_unpackhi_ps(static_cast<__m512>(c), static_cast<__m512>(d));
        a = static_cast<F>(_mm512_shuffle_ps(ab, cd, 0x44)), b = static_cast<F>(_mm512_shuffle_ps(ab, cd, 0xee));
        c = static_cast<F>(_mm512_shuffle_ps(abHigh, cdHigh, 0x44));
        d = static_cast<F>(_mm512_shuffle_ps(abHigh, cdHigh, 0xee));
    }
    /// Quarter q of each goes to row q.
    RTSG_INLINE void addRows(F a, F b, F c, F d, float* to, std::size_t stride) {
        const auto blocks = [](F x, F y, auto which) __attribute__((always_inline)) {
            return static_cast<F>(
                _mm512_shuffle_f32x4(static_cast<__m512>(x), static_cast<__m512>(y), decltype(which)::value));
        };
        const std::integral_constant<int, 0x44> low;
        const std::integral_constant<int, 0xee> high;
        const std::integral_constant<int, 0x88> even;
        const std::integral_constant<int, 0xdd> odd;
        const F abLow = blocks(a, b, low), abHigh = blocks(a, b, high);
        const F cdLow = blocks(c, d, low), cdHigh = blocks(c, d, high);
        store(to, load(to) + blocks(abLow, cdLow, even)), to += stride;
        store(to, load(to) + blocks(abLow, cdLow, odd)), to += stride;
        store(to, load(to) + blocks(abHigh, cdHigh, even)), to += stride;
        store(to, load(to) + blocks(abHigh, cdHigh, odd));
    }
};

#undef RTSG_INLINE

}  // namespace

}  // namespace rtsg::simd
