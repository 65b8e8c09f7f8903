// Functions of as many floats at a time as the vector type has, in the compiler's own vector types.
//
// F: a vector of float; I: the integers of its masks. Accuracy: below 3e-7 relative (log2Of: absolute) on their
// domains. All are inlined wherever they are used, so a unit that is compiled for wider registers shares no code of
// them with others. Source: series (by pairs of terms, Estrin 1960) and Abramowitz & Stegun 4.4.46 (arc cosine).
// Threading: values.
#pragma once

#include <cstdint>

namespace rtsg::simd::lanes {

#define RTSG_LANES              \
    template <class F, class I> \
    __attribute__((always_inline)) inline

/// The same value in all lanes. (x - 0 is x for every x.)
template <class F>
__attribute__((always_inline)) inline F fill(float x) {
    return x - F{};
}
template <class F>
__attribute__((always_inline)) inline F minimum(F a, F b) {
    return a < b ? a : b;
}
template <class F>
__attribute__((always_inline)) inline F maximum(F a, F b) {
    return a > b ? a : b;
}
template <class To, class From>
__attribute__((always_inline)) inline To reinterpret(From from) {
    static_assert(sizeof(To) == sizeof(From));
    To to;
    __builtin_memcpy(&to, &from, sizeof to);
    return to;
}

/// Positive normal numbers.
RTSG_LANES F log2Of(F x) {
    // m in [sqrt(1/2), sqrt(2)), then 2 atanh((m - 1) / (m + 1)).
    const I offset = reinterpret<I>(x) - 0x3f3504f3;
    const I exponent = offset >> 23;
    const F m = reinterpret<F>((offset & 0x007fffff) + 0x3f3504f3);
    const F s = (m - 1.0f) / (m + 1.0f), q = s * s;
    // Terms by pairs (Estrin): waiting for the previous term would take as long as the rest of a light.
    const F q2 = q * q;
    const F series =
        (2.8853900818f + q * 0.9617966939f) + q2 * ((0.5770780164f + q * 0.4121985831f) + q2 * 0.3205988980f);
    return __builtin_convertvector(exponent, F) + s * series;
}

/// Below -126 gives 0; the argument must not exceed 127.
RTSG_LANES F exp2Of(F y) {
    const F clamped = maximum(y, fill<F>(-126));
    const F half = clamped < 0.0f ? fill<F>(-0.5f) : fill<F>(0.5f);
    const I whole = __builtin_convertvector(clamped + half, I);
    const F f = (clamped - __builtin_convertvector(whole, F)) * 0.69314718056f;
    const F f2 = f * f, f4 = f2 * f2;
    const F high = (1 / 24.0f + f * (1 / 120.0f)) + f2 * (1 / 720.0f + f * (1 / 5040.0f));
    const F e = ((1.0f + f) + f2 * (0.5f + f * (1 / 6.0f))) + f4 * high;
    return y < -126.0f ? F{} : e * reinterpret<F>((whole + 127) << 23);
}

/// x^e for x in [0, 1], e >= 0; 0^0 is 1.
RTSG_LANES F power(F x, F e) {
    const F r = exp2Of<F, I>(e * log2Of<F, I>(maximum(x, fill<F>(1e-30f))));
    return e <= 0.0f ? fill<F>(1) : x > 0.0f ? r : F{};
}

/// Argument in [-1, 1]. `root`: the square root of such a vector.
template <class F, class Root>
__attribute__((always_inline)) inline F acosOf(F x, const Root& root) {
    const F a = minimum(x < 0.0f ? -x : x, fill<F>(1));
    F p = -0.0012624911f + a * 0.0f;
    p = p * a + 0.0066700901f;
    p = p * a - 0.0170881256f;
    p = p * a + 0.0308918810f;
    p = p * a - 0.0501743046f;
    p = p * a + 0.0889789874f;
    p = p * a - 0.2145988016f;
    p = p * a + 1.5707963050f;
    const F r = root(1.0f - a) * p;
    return x < 0.0f ? 3.14159265359f - r : r;
}

/// One representable number further in the direction of `step`, where that is not 0.
RTSG_LANES F beyond(F x, F step) {
    const I i = reinterpret<I>(x);
    // Away from zero counts up, towards zero down; zero itself goes to the least number of the step's sign.
    I moved = i + (((i ^ reinterpret<I>(step)) >> 31) | 1);
    const I smallest =
        (reinterpret<I>(step) & (I{} + std::int32_t(0x80000000))) | 0x00800000;  // not denormal: Embree flushes those
    moved = x == 0.0f ? smallest : moved;
    return step == 0.0f ? x : reinterpret<F>(moved);
}

#undef RTSG_LANES

}  // namespace rtsg::simd::lanes
