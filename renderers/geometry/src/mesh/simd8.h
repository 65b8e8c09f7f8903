// Eight floats at a time, in the compiler's own vector types: no library, and intrinsics only for what it makes no one
// instruction of.
//
// Masks are all-ones or zero per lane. Accuracy of the functions: below 3e-7 relative (log2Of and sines:
// absolute) on their domains. Source: series and Abramowitz & Stegun 4.4.46 (arc cosine).
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#ifdef __AVX__
#include <immintrin.h>
#endif

#include "lane_math.h"

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

namespace rtsg::simd {

using F8 = float __attribute__((vector_size(32)));
using I8 = std::int32_t __attribute__((vector_size(32)));

inline F8 load(const float* p) {
    F8 r;
    std::memcpy(&r, p, sizeof r);
    return r;
}
inline void store(float* p, F8 v) {
    std::memcpy(p, &v, sizeof v);
}
inline F8 all(float x) {
    return F8{x, x, x, x, x, x, x, x};
}
inline F8 select(I8 mask, F8 a, F8 b) {
    return mask ? a : b;
}
// The second where either is NaN, as the comparisons say. The compiler makes comparisons and blends of them next to
// constants, which is two or three instructions for one.
inline F8 min(F8 a, F8 b) {
#ifdef __AVX__
    __m256 x, y;
    std::memcpy(&x, &a, sizeof x), std::memcpy(&y, &b, sizeof y);
    x = _mm256_min_ps(x, y);
    std::memcpy(&a, &x, sizeof a);
    return a;
#else
    return a < b ? a : b;
#endif
}
inline F8 max(F8 a, F8 b) {
#ifdef __AVX__
    __m256 x, y;
    std::memcpy(&x, &a, sizeof x), std::memcpy(&y, &b, sizeof y);
    x = _mm256_max_ps(x, y);
    std::memcpy(&a, &x, sizeof a);
    return a;
#else
    return a > b ? a : b;
#endif
}

inline F8 absolute(F8 x) {
    I8 sizes;
    std::memcpy(&sizes, &x, sizeof sizes);
    sizes &= 0x7fffffff;
    std::memcpy(&x, &sizes, sizeof x);
    return x;
}

inline F8 sqrt(F8 v) {
#ifdef __AVX__
    __m256 r;
    std::memcpy(&r, &v, sizeof r);
    r = _mm256_sqrt_ps(r);
    std::memcpy(&v, &r, sizeof r);
#else
    for (int i = 0; i < 8; ++i) v[i] = std::sqrt(v[i]);
#endif
    return v;
}

inline F8 floorOf(F8 v) {
#ifdef __AVX__
    __m256 r;
    std::memcpy(&r, &v, sizeof r);
    r = _mm256_floor_ps(r);
    std::memcpy(&v, &r, sizeof v);
#else
    for (int i = 0; i < 8; ++i) v[i] = std::floor(v[i]);
#endif
    return v;
}

inline bool any(I8 mask) {
#ifdef __AVX__
    __m256 r;
    std::memcpy(&r, &mask, sizeof r);
    return _mm256_movemask_ps(r) != 0;
#else
    for (int i = 0; i < 8; ++i)
        if (mask[i]) return true;
    return false;
#endif
}

/// A bit a lane.
inline std::uint32_t laneBits(I8 mask) {
#ifdef __AVX__
    __m256 r;
    std::memcpy(&r, &mask, sizeof r);
    return static_cast<std::uint32_t>(_mm256_movemask_ps(r));
#else
    std::uint32_t result = 0;
    for (int i = 0; i < 8; ++i) result |= static_cast<std::uint32_t>(mask[i] < 0) << i;
    return result;
#endif
}

inline I8 bits(F8 v) {
    I8 r;
    std::memcpy(&r, &v, sizeof r);
    return r;
}
inline F8 fromBits(I8 v) {
    F8 r;
    std::memcpy(&r, &v, sizeof r);
    return r;
}

/// Positive normal numbers.
inline F8 log2Of(F8 x) {
    return lanes::log2Of<F8, I8>(x);
}
/// Below -126 gives 0; the argument must not exceed 127.
inline F8 exp2Of(F8 y) {
    return lanes::exp2Of<F8, I8>(y);
}
/// x^e for x in [0, 1], e >= 0; 0^0 is 1.
inline F8 power(F8 x, F8 e) {
    return lanes::power<F8, I8>(x, e);
}
/// Argument in [-1, 1].
inline F8 acosOf(F8 x) {
    return lanes::acosOf(x, [](F8 v) { return sqrt(v); });
}

/// Sine and cosine of so many turns, [0, 1).
inline void sinCosRevolutions(F8 rotations, F8& sine, F8& cosine) {
    // The rest after the nearest quarter turn, at most pi / 4 either way, goes by Taylor's series.
    const I8 quarter = __builtin_convertvector(rotations * 4.0f + 0.5f, I8);
    const F8 x = (rotations - __builtin_convertvector(quarter, F8) * 0.25f) * 6.28318530718f, q = x * x;
    const F8 s = x * (1.0f + q * (-1 / 6.0f + q * (1 / 120.0f + q * (-1 / 5040.0f + q * (1 / 362880.0f)))));
    const F8 c = 1.0f + q * (-0.5f + q * (1 / 24.0f + q * (-1 / 720.0f + q * (1 / 40320.0f + q * (-1 / 3628800.0f)))));
    const I8 odd = (quarter & 1) != 0, sineDown = (quarter & 2) != 0, cosineDown = ((quarter + 1) & 2) != 0;
    sine = select(odd, c, s), cosine = select(odd, s, c);
    sine = select(sineDown, -sine, sine), cosine = select(cosineDown, -cosine, cosine);
}

struct V8 {
    F8 x, y, z;
};
inline V8 select(I8 mask, const V8& a, const V8& b) {
    return {select(mask, a.x, b.x), select(mask, a.y, b.y), select(mask, a.z, b.z)};
}
inline F8 dot(const V8& a, const V8& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline V8 operator+(const V8& a, const V8& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline V8 operator-(const V8& a, const V8& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline V8 operator*(const V8& a, const V8& b) {
    return {a.x * b.x, a.y * b.y, a.z * b.z};
}
inline V8 operator*(const V8& a, F8 s) {
    return {a.x * s, a.y * s, a.z * s};
}

}  // namespace rtsg::simd
