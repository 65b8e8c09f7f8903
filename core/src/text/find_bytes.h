// Finding and counting single bytes in long texts, 64 at a time.
//
// Threading: pure functions.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace rtsg::detail {

/// The first of these bytes in [from, end); `end` if there is none.
template <class... Chars>
inline const char* findAnyOf(const char* from, const char* end, Chars... wanted) {
    const auto isOne = [=](char c) { return ((c == wanted) || ...); };
#if defined(__SSE2__)
    constexpr std::ptrdiff_t each = 64;
    for (; end - from >= each; from += each) {
        __m128i found = _mm_setzero_si128();
        for (int part = 0; part < 4; ++part) {
            const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + 16 * std::ptrdiff_t{part}));
            ((found = _mm_or_si128(found, _mm_cmpeq_epi8(bytes, _mm_set1_epi8(wanted)))), ...);
        }
        if (_mm_movemask_epi8(found) != 0) return std::find_if(from, end, isOne);
    }
#endif
    return std::find_if(from, end, isOne);
}

/// How many bytes of [from, end) are `wanted` where `mask` has bits.
inline std::size_t countMasked(const char* from, const char* end, unsigned char mask, unsigned char wanted) {
    std::size_t count = 0;
#if defined(__SSE2__)
    constexpr std::ptrdiff_t each = 16;
    const __m128i bits = _mm_set1_epi8(static_cast<char>(mask)), same = _mm_set1_epi8(static_cast<char>(wanted));
    while (end - from >= each) {
        // Sixteen counters of a byte, for as long as they hold.
        __m128i counters = _mm_setzero_si128();
        const std::ptrdiff_t rounds = std::min<std::ptrdiff_t>((end - from) / each, 255);
        for (std::ptrdiff_t i = 0; i < rounds; ++i, from += each) {
            const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
            counters = _mm_sub_epi8(counters, _mm_cmpeq_epi8(_mm_and_si128(bytes, bits), same));
        }
        const __m128i sums = _mm_sad_epu8(counters, _mm_setzero_si128());
        count += static_cast<std::size_t>(_mm_cvtsi128_si64(sums)) +
                 static_cast<std::size_t>(_mm_cvtsi128_si64(_mm_unpackhi_epi64(sums, sums)));
    }
#endif
    for (; from != end; ++from) count += (static_cast<unsigned char>(*from) & mask) == wanted;
    return count;
}

}  // namespace rtsg::detail
