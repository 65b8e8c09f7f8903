// Lanes8: eight floats, and what the compiler's vector types cannot say of them.
//
// A type of each unit's own, as Lanes16 is. Threading: values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "simd8.h"

namespace rtsg::simd {

namespace {

struct Lanes8 {
    using F = simd::F8;
    using I = simd::I8;
    using F4 = float __attribute__((vector_size(16)));
    using M = I;
    static constexpr int kLanes = 8;

    static F load(const float* p) { return simd::load(p); }
    static void store(float* p, F v) { simd::store(p, v); }
    static void store(std::int32_t* p, I v) { std::memcpy(p, &v, sizeof v); }
    static F root(F v) { return simd::sqrt(v); }
    static std::uint32_t bits(I mask) { return simd::laneBits(mask); }
    static I lanesOf(std::uint32_t mask) {
        const I each{1, 2, 4, 8, 16, 32, 64, 128};
        return (each & static_cast<std::int32_t>(mask)) != 0;
    }
    static M maskOf(std::uint32_t bits) { return lanesOf(bits); }
    static M atLeast(F a, F b) { return a >= b; }
    static M greater(F a, F b) { return a > b; }
    static M both(M a, M b) { return a & b; }
    /// Compares only the lanes in `among`.
    static M greater(M among, F a, F b) { return among & (a > b); }
    static F choose(M mask, F a, F b) { return mask ? a : b; }
    static F minimum(F a, F b) { return simd::min(a, b); }
    static F maximum(F a, F b) { return simd::max(a, b); }
    /// a * b + c, rounded once.
    static F fused(F a, F b, F c) {
#ifdef __FMA__
        __m256 x, y, z;
        std::memcpy(&x, &a, sizeof x), std::memcpy(&y, &b, sizeof y), std::memcpy(&z, &c, sizeof z);
        x = _mm256_fmadd_ps(x, y, z);
        std::memcpy(&a, &x, sizeof a);
#else
        for (int i = 0; i < kLanes; ++i) a[i] = std::fma(a[i], b[i], c[i]);
#endif
        return a;
    }
    static float smallest(F v) {
        v = simd::min(v, __builtin_shufflevector(v, v, 4, 5, 6, 7, 0, 1, 2, 3));
        v = simd::min(v, __builtin_shufflevector(v, v, 2, 3, 0, 1, 6, 7, 4, 5));
        return v[0] < v[1] ? v[0] : v[1];
    }
    static void put(float* to, M mask, F v) { store(to, mask ? v : load(to)); }
    static void put(std::uint32_t* to, M mask, std::uint32_t value) {
        I old;
        std::memcpy(&old, to, sizeof old);
        old = mask ? I{} + static_cast<std::int32_t>(value) : old;
        std::memcpy(to, &old, sizeof old);
    }
    static void put(std::uint32_t* to, M mask, const std::uint32_t* from) {
        I old, now;
        std::memcpy(&old, to, sizeof old), std::memcpy(&now, from, sizeof now);
        old = mask ? now : old;
        std::memcpy(to, &old, sizeof old);
    }
    static F columns() { return F{0, 1, 2, 3, 0, 1, 2, 3}; }
    static F rows(int at) { return at == 0 ? F{0, 0, 0, 0, 1, 1, 1, 1} : F{2, 2, 2, 2, 3, 3, 3, 3}; }

    /// Copies the lanes in `use`; all others become `other`.
    static void copy(std::uint32_t* to, const std::uint32_t* from, I use, std::uint32_t other) {
        I lanes;
        std::memcpy(&lanes, from, sizeof lanes);
        lanes = use ? lanes : I{} + static_cast<std::int32_t>(other);
        std::memcpy(to, &lanes, sizeof lanes);
    }
    /// Four floats each from two places.
    static F quads(const float* const* positions) {
        F4 low, high;
        std::memcpy(&low, positions[0], sizeof low), std::memcpy(&high, positions[1], sizeof high);
        return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    }
    /// Looks up numbers in a table of thirty-two.
    static F lookUp(const float* table, I positions) {
#ifdef __AVX2__
        __m256i at;
        std::memcpy(&at, &positions, sizeof at);
        const __m256 found = _mm256_i32gather_ps(table, at, 4);
        std::memcpy(&positions, &found, sizeof found);
        return simd::fromBits(positions);
#else
        F r{};
        for (int i = 0; i < kLanes; ++i) r[i] = table[positions[i]];
        return r;
#endif
    }
    template <int j>
    static F spread(F v) {
        return __builtin_shufflevector(v, v, j, j, j, j, 4 + j, 4 + j, 4 + j, 4 + j);
    }
    /// Transposes four by four numbers in each half.
    static void transpose(F& a, F& b, F& c, F& d) {
        const F ab = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
        const F abHigh = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
        const F cd = __builtin_shufflevector(c, d, 0, 8, 1, 9, 4, 12, 5, 13);
        const F cdHigh = __builtin_shufflevector(c, d, 2, 10, 3, 11, 6, 14, 7, 15);
        a = __builtin_shufflevector(ab, cd, 0, 1, 8, 9, 4, 5, 12, 13);
        b = __builtin_shufflevector(ab, cd, 2, 3, 10, 11, 6, 7, 14, 15);
        c = __builtin_shufflevector(abHigh, cdHigh, 0, 1, 8, 9, 4, 5, 12, 13);
        d = __builtin_shufflevector(abHigh, cdHigh, 2, 3, 10, 11, 6, 7, 14, 15);
    }
    /// Half q of each goes to row q.
    static void addRows(F a, F b, F c, F d, float* to, std::size_t stride) {
        const auto add = [](float* p, F v) { store(p, load(p) + v); };
        add(to, __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11));
        add(to + 8, __builtin_shufflevector(c, d, 0, 1, 2, 3, 8, 9, 10, 11));
        add(to + stride, __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15));
        add(to + stride + 8, __builtin_shufflevector(c, d, 4, 5, 6, 7, 12, 13, 14, 15));
    }
};

}  // namespace

}  // namespace rtsg::simd
