// Hash terms of plain bytes, with the size folded into the code: what most changes of a frame cost.
#pragma once

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "state_hash.h"

namespace rtsg::detail {

/// Computes hashOfBytes() of at most 16 bytes.
template <std::size_t size>
[[gnu::always_inline]] inline Hash128 hashOfSize(const void* bytes, std::uint64_t seed) {
    static_assert(size <= 16);
    // XXH3_128bits_withSeed for a size known here; called by that name it is not inlined.
    const XXH128_hash_t hash = XXH3_len_0to16_128b(static_cast<const xxh_u8*>(bytes), size, XXH3_kSecret, seed);
    return {hash.low64, hash.high64};
}

/// Computes fieldTerm(), which is zero if `value` is the type's default `fallback`.
template <std::size_t size>
[[gnu::always_inline]] inline Hash128 plainTermOfSize(NodeId node, FieldKey field, const void* value,
                                                      const void* fallback) {
    if (std::memcmp(value, fallback, size) == 0) return {};
    return hashOfSize<size>(value, hashSeed(node, field, HashTerm::field));
}

/// Calls `job.operator()<size>()` for the sizes of plain field types: 1, 4, 8, 12 or 16.
[[gnu::always_inline]] inline auto withPlainSize(std::size_t size, auto job) {
    switch (size) {
        case 1:
            return job.template operator()<1>();
        case 4:
            return job.template operator()<4>();
        case 8:
            return job.template operator()<8>();
        case 12:
            return job.template operator()<12>();
        default:
            return job.template operator()<16>();
    }
}

inline Hash128 plainTerm(NodeId node, FieldKey field, const void* value, const void* fallback, std::size_t size) {
    return withPlainSize(size, [&]<std::size_t n>() { return plainTermOfSize<n>(node, field, value, fallback); });
}

}  // namespace rtsg::detail
