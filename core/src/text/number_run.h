// Scanning runs of plain numbers: decimals of at most sixteen characters with white space or commas between them, found
// 64 bytes at a time.
//
// Invariant: the numbers are those that scanReal and scanInteger would read, bit for bit. A run ends before anything
// else (a comment, a bracket, something that is no number, the last bytes of the text), which is left to these. The
// ends of numbers are found before the numbers are read, so that none has to wait for the one before it. Threading:
// pure functions.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#if defined(__SSE4_1__)
#include <smmintrin.h>
#endif

#include "number_text.h"

namespace rtsg::detail {

/// So many bytes have to follow for a run to look at them.
constexpr std::ptrdiff_t kRunLook = 64 + 16;
/// A run takes no more than this with one look, and ends where there is room for less.
constexpr std::size_t kRunMax = 32;

#if defined(__SSE4_1__)

/// Marks by a bit each of 64 bytes that is white space or a comma.
inline std::uint64_t spacesOf64(const char* p) {
    // The five differ in their lower four bits, which look each of them up; what else stands there has other ones.
    const __m128i known = _mm_setr_epi8(' ', 0, 0, 0, 0, 0, 0, 0, 0, '\t', '\n', 0, ',', '\r', 0, 0);
    std::uint64_t mask = 0;
    for (int part = 0; part < 4; ++part) {
        const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p + 16 * std::ptrdiff_t{part}));
        const __m128i equal = _mm_cmpeq_epi8(_mm_shuffle_epi8(known, bytes), bytes);
        mask |= std::uint64_t{static_cast<std::uint32_t>(_mm_movemask_epi8(equal))} << (16 * part);
    }
    return mask;
}

/// A word of at most sixteen characters without its sign, as right-aligned digits, and the value of these.
struct PlainDigits {
    std::uint64_t value;
    unsigned fraction;  // digits behind the point
    bool valid;
};

/// `size` characters at `s`, of which at least 16 can be read.
template <bool point>
inline PlainDigits plainDigits(const char* s, unsigned size) {
    const __m128i text = _mm_loadu_si128(reinterpret_cast<const __m128i*>(s));
    const __m128i digits = _mm_sub_epi8(text, _mm_set1_epi8('0'));
    const unsigned word = (1u << size) - 1;
    const auto isDigit =
        static_cast<unsigned>(_mm_movemask_epi8(_mm_cmpeq_epi8(_mm_min_epu8(digits, _mm_set1_epi8(9)), digits)));
    // From the place in a number of sixteen digits to the place in the text; negative ones become zeros.
    __m128i from = _mm_add_epi8(_mm_setr_epi8(-16, -15, -14, -13, -12, -11, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1),
                                _mm_set1_epi8(static_cast<char>(size)));
    unsigned rest = ~isDigit & word, fraction = 0;
    bool valid = (isDigit & word) != 0;
    if constexpr (point) {
        const unsigned at = static_cast<unsigned>(std::countr_zero(rest | 1u << size));
        // The digits before the point move up by the one place that it takes.
        const unsigned gap = rest != 0;
        const __m128i before = _mm_cmpgt_epi8(_mm_set1_epi8(static_cast<char>(at + gap)), from);
        from = _mm_add_epi8(from, _mm_and_si128(before, _mm_set1_epi8(static_cast<char>(-static_cast<int>(gap)))));
        valid &= (rest & (rest - 1)) == 0 && (rest == 0 || s[at] == '.');
        fraction = size - at - gap;
    } else {
        valid &= rest == 0;
    }
    const __m128i ordered = _mm_shuffle_epi8(digits, from);
    const __m128i twos = _mm_maddubs_epi16(ordered, _mm_set1_epi16(1 << 8 | 10));
    const __m128i fours = _mm_madd_epi16(twos, _mm_set1_epi32(1 << 16 | 100));
    const __m128i packed = _mm_packus_epi32(fours, fours);
    const __m128i eights = _mm_madd_epi16(packed, _mm_set1_epi32(1 << 16 | 10000));
    const auto both = static_cast<std::uint64_t>(_mm_cvtsi128_si64(eights));
    return {(both & 0xFFFFFFFFu) * 100000000 + (both >> 32), fraction, valid};
}

/// The number between `s` and `stop`; false if it is none of the plain ones.
inline bool scanPlain(const char* s, const char* stop, std::int32_t& out) {
    const bool negative = *s == '-';
    s += negative;
    const auto size = static_cast<unsigned>(stop - s);
    if (size > 16) return false;
    const PlainDigits digits = plainDigits<false>(s, size);
    if (!digits.valid || digits.value > 0x7FFFFFFFu) return false;
    const auto value = static_cast<std::int32_t>(digits.value);
    out = negative ? -value : value;
    return true;
}
template <class S>
inline bool scanPlain(const char* s, const char* stop, S& out) {
    const bool negative = *s == '-';
    s += negative;
    const auto size = static_cast<unsigned>(stop - s);
    if (size > 16) return false;
    const PlainDigits digits = plainDigits<true>(s, size);
    if (!digits.valid || digits.value > (std::uint64_t{1} << 53)) return false;
    const double value = static_cast<double>(digits.value) / kPowersOfTen[digits.fraction];
    if constexpr (std::is_same_v<S, float>)
        if (isBetweenFloats(value)) return false;
    const std::uint64_t sign = std::uint64_t{negative} << 63;
    out = static_cast<S>(std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) | sign));
    return true;
}

/// Reads numbers into `out`, at most `most` of them, and returns how many. `p` is where a number or what separates them
/// may begin, and afterwards there again.
template <class S>
std::size_t scanRun(const char*& p, const char* end, S* out, std::size_t maximum) {
    std::size_t count = 0;
    while (end - p >= kRunLook && maximum - count >= kRunMax) {
        const std::uint64_t spaces = spacesOf64(p);
        const std::uint64_t before = spaces << 1 | 1;
        std::uint64_t starts = ~spaces & before, ends = spaces & ~before;
        const char* const look = p;
        // A number that ends behind these 64 bytes is read again.
        const int open = std::popcount(starts) - std::popcount(ends);
        p = look + (open ? 63 - std::countl_zero(starts) : 64);
        bool plain = true;  // numbers with exponents seldom come alone
        for (; ends; ends &= ends - 1, starts &= starts - 1) {
            const char* const first = look + std::countr_zero(starts);
            const char* const stop = look + std::countr_zero(ends);
            plain = plain && scanPlain(first, stop, out[count]);
            if (!plain) {
                const char* s = first;
                if (scanNumber(s, stop, out[count]) != NumberStatus::ok || s != stop) {
                    p = first;
                    return count;
                }
            }
            ++count;
        }
        if (p == look) break;
    }
    return count;
}

#else

template <class S>
std::size_t scanRun(const char*&, const char*, S*, std::size_t) {
    return 0;
}

#endif

}  // namespace rtsg::detail
