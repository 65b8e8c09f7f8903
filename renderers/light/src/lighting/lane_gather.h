// Four floats each of eight places in memory, lane by lane, and back.
//
// Threading: values.
#pragma once

#include "mesh/simd8.h"

namespace rtsg::simd {

using F4 = float __attribute__((vector_size(16)));

/// Eight times four numbers.
struct Q8 {
    F8 x, y, z, w;
};

/// Transposes four by four numbers in each half.
inline Q8 transposed(const Q8& q) {
    const F8 ab = __builtin_shufflevector(q.x, q.y, 0, 8, 1, 9, 4, 12, 5, 13),
             abHigh = __builtin_shufflevector(q.x, q.y, 2, 10, 3, 11, 6, 14, 7, 15),
             cd = __builtin_shufflevector(q.z, q.w, 0, 8, 1, 9, 4, 12, 5, 13),
             cdHigh = __builtin_shufflevector(q.z, q.w, 2, 10, 3, 11, 6, 14, 7, 15);
    return {__builtin_shufflevector(ab, cd, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(ab, cd, 2, 3, 10, 11, 6, 7, 14, 15),
            __builtin_shufflevector(abHigh, cdHigh, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(abHigh, cdHigh, 2, 3, 10, 11, 6, 7, 14, 15)};
}

/// The four floats at each of eight places.
inline Q8 gather4(const float* const* positions) {
    const auto pair = [&](int i) {
        F4 low, high;
        std::memcpy(&low, positions[i], sizeof low), std::memcpy(&high, positions[i + 4], sizeof high);
        return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    };
    return transposed({pair(0), pair(1), pair(2), pair(3)});
}
/// The first three of them.
inline V8 gather3(const float* const* positions) {
    const Q8 q = gather4(positions);
    return {q.x, q.y, q.z};
}
/// Picks one of eight numbers for each lane.
inline F8 oneEach(const float* eight, I8 which) {
#ifdef __AVX2__
    __m256 from = _mm256_loadu_ps(eight);
    __m256i order;
    std::memcpy(&order, &which, sizeof order);
    from = _mm256_permutevar8x32_ps(from, order);
    F8 r;
    std::memcpy(&r, &from, sizeof r);
    return r;
#else
    F8 r{};
    for (int lane = 0; lane < 8; ++lane) r[lane] = eight[which[lane]];
    return r;
#endif
}

/// Adds four numbers of each lane to those at its place, for the lanes of `lanes` (bits), one after the other.
inline void addTo(float* const* positions, std::uint32_t lanes, const Q8& values) {
    const Q8 rows = transposed(values);
    alignas(32) float each[4][8];
    store(each[0], rows.x), store(each[1], rows.y), store(each[2], rows.z), store(each[3], rows.w);
    for (; lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        F4 sum, own;
        std::memcpy(&sum, positions[lane], sizeof sum);
        std::memcpy(&own, &each[lane & 3][lane & 4], sizeof own);
        sum += own;
        std::memcpy(positions[lane], &sum, sizeof sum);
    }
}

}  // namespace rtsg::simd
