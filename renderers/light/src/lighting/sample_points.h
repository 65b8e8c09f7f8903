// Sample points in [0, 1): Sobol's first two dimensions, Owen-scrambled, as many pairs of them as a path needs.
//
// Invariant: the first 2^k samples of a pixel lie one to each of the 2^k elementary intervals, in every single number
// and in every pair; numbers of different calls are independent of each other. Those of different pixels are so too, or
// (ofPicture) they are the parts of one such sequence that runs through the picture: then so are the samples of the
// aligned squares of 2, 4, 8 ... pixels, their errors cancel, and what is left of noise is fine.
// Threading: values. Source: Burley 2020, Journal of Computer Graphics Techniques 9, 4 (scrambling by hashes, shuffled
// order); Laine & Karras 2011 (the hash); Ahmed & Wonka 2020 (one sequence for a picture; here along Hilbert's curve,
// which prefers no direction).
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <utility>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#include <rtsg/core/value.h>

namespace rtsg::trace {

inline std::uint64_t mixBits(std::uint64_t x) {  // splitmix64's finaliser
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ x >> 27) * 0x94d049bb133111ebull;
    return x ^ x >> 31;
}

// The next three: `Bits` is std::uint32_t, or a vector of such.

template <class Bits>
Bits reverseBits(Bits x) {
    x = x << 16 | x >> 16;
    x = (x & 0x00ff00ffu) << 8 | (x & 0xff00ff00u) >> 8;
    x = (x & 0x0f0f0f0fu) << 4 | (x & 0xf0f0f0f0u) >> 4;
    x = (x & 0x33333333u) << 2 | (x & 0xccccccccu) >> 2;
    return (x & 0x55555555u) << 1 | (x & 0xaaaaaaaau) >> 1;
}

#ifdef __AVX2__
using Bits8 = std::uint32_t __attribute__((vector_size(32)));

/// The same, by tables of half bytes.
inline Bits8 reverseBits(Bits8 x) {
    const auto twice = [](__m128i half) { return _mm256_broadcastsi128_si256(half); };
    const __m256i backwards = twice(_mm_setr_epi8(3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12)),
                  table = twice(_mm_setr_epi8(0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15)),
                  low = _mm256_set1_epi8(0x0f);
    __m256i bytes;
    std::memcpy(&bytes, &x, sizeof bytes);
    bytes = _mm256_shuffle_epi8(bytes, backwards);
    const __m256i upper = _mm256_shuffle_epi8(_mm256_slli_epi16(table, 4), _mm256_and_si256(bytes, low)),
                  lower = _mm256_shuffle_epi8(table, _mm256_and_si256(_mm256_srli_epi16(bytes, 4), low));
    bytes = _mm256_or_si256(upper, lower);
    std::memcpy(&x, &bytes, sizeof x);
    return x;
}
#endif

/// Flips each bit by a hash of the lower ones: Owen's scrambling of numbers whose bits are in reverse order.
/// `Seed`: one, or one for each.
template <class Bits, class Seed>
Bits scrambleUpwards(Bits x, Seed seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ x * 0x53a22864u;
}

/// Sobol's second dimension of an index, its bits in reverse order: Pascal's triangle modulo 2.
template <class Bits>
Bits sobolSecondReversed(Bits index) {
    index ^= (index & 0xaaaaaaaau) >> 1;
    index ^= (index & 0xccccccccu) >> 2;
    index ^= (index & 0xf0f0f0f0u) >> 4;
    index ^= (index & 0xff00ff00u) >> 8;
    return index ^ index >> 16;
}

/// How far along Hilbert's curve through a square of 2^bits pixels a side a pixel is; of x and y the lowest bits count.
inline std::uint32_t hilbertIndex(std::uint32_t x, std::uint32_t y, unsigned bits) {
    std::uint32_t index = 0;
    for (unsigned i = bits; i-- > 0;) {
        const std::uint32_t right = x >> i & 1u, up = y >> i & 1u;
        index = index << 2 | ((3u * right) ^ up);
        if (up) continue;
        if (right) x = ~x, y = ~y;
        std::swap(x, y);
    }
    return index;
}

/// The numbers of one sample of one pixel, in the order in which they are asked for.
class PathRandom {
  public:
    /// Precondition of both: 0 <= sample < 2^20.
    PathRandom(std::uint64_t seed, int x, int y, int sample)
        : PathRandom(hashOf(seed, x, y), static_cast<std::uint32_t>(hashOf(seed, x, y)) << kSampleBits |
                                             static_cast<std::uint32_t>(sample)) {}
    /// `samples`: of the pixel; at most 2^20.
    static PathRandom ofPicture(std::uint64_t seed, int x, int y, int sample, int samples) {
        const unsigned side = sideOf(samples);
        return ofCell(seed, x, y, hilbertIndex(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), side),
                      sample, samples);
    }
    /// The same; `place`: how far along Hilbert's curve through a square of 2^sideOf(samples) pixels the pixel is.
    static PathRandom ofCell(std::uint64_t seed, int x, int y, std::uint32_t cell, int sample, int samples) {
        const unsigned side = sideOf(samples);
        return {hashOf(seed, x >> side, y >> side), cell << bitsOf(samples) | static_cast<std::uint32_t>(sample)};
    }
    static unsigned sideOf(int samples) { return std::min(8u, (32 - bitsOf(samples)) / 2); }
    explicit PathRandom(std::uint64_t state = 0) : state_(state) {}

    float next() {
        const std::uint64_t seed = nextSeed();
        return fraction(scrambleUpwards(shuffled(seed), static_cast<std::uint32_t>(seed >> 32)));
    }
    Vec2f nextPair() {
        const std::uint64_t seed = nextSeed(), other = mixBits(seed);
        const std::uint32_t index = shuffled(seed);
        return {fraction(scrambleUpwards(index, static_cast<std::uint32_t>(seed >> 32))),
                fraction(scrambleUpwards(sobolSecondReversed(index), static_cast<std::uint32_t>(other)))};
    }
    std::uint64_t state() const { return state_; }
    /// The state without index(): bits of the sequence, from bit 12 on, and the number of the next call.
    std::uint32_t sequenceAndCalls() const {
        return static_cast<std::uint32_t>(state_ >> 32 & (kSequence >> 32)) |
               static_cast<std::uint32_t>(state_ & kCalls);
    }
    static PathRandom ofParts(std::uint32_t sequenceAndCalls, std::uint32_t index) {
        constexpr auto kLow = static_cast<std::uint32_t>(kCalls);
        return PathRandom(std::uint64_t{sequenceAndCalls & ~kLow} << 32 | std::uint64_t{index} << kCallBits |
                          (sequenceAndCalls & kLow));
    }

    // For PacketRandom, which makes the same numbers for several samples at a time.
    std::uint32_t index() const { return static_cast<std::uint32_t>(state_ >> kCallBits); }
    /// Whether the other one's next calls are the same ones of the same sequence.
    bool drawsAs(const PathRandom& other) const { return ((state_ ^ other.state_) & (kSequence | kCalls)) == 0; }
    /// The same calls for another sample.
    PathRandom ofIndex(std::uint32_t index) const {
        return PathRandom((state_ & (kSequence | kCalls)) | std::uint64_t{index} << kCallBits);
    }
    /// A seed that depends on the sequence and the number of the call, not on the sample. After the last call another
    /// sequence begins.
    std::uint64_t nextSeed() {
        const std::uint64_t seed = mixBits((state_ & kSequence) | (state_ & kCalls));
        if ((state_ & kCalls) == kCalls)
            state_ = (state_ & ~kSequence & ~kCalls) | (mixBits(state_ & kSequence) & kSequence);
        else
            ++state_;
        return seed;
    }

  private:
    static constexpr unsigned kCallBits = 12, kIndexBits = 32, kSampleBits = 20;
    static constexpr std::uint64_t kSequence = ~std::uint64_t{0} << (kCallBits + kIndexBits),
                                   kCalls = (std::uint64_t{1} << kCallBits) - 1;

    PathRandom(std::uint64_t sequence, std::uint32_t index)
        : state_((sequence & kSequence) | std::uint64_t{index} << kCallBits) {}
    static unsigned bitsOf(int samples) {
        return static_cast<unsigned>(std::bit_width(static_cast<std::uint32_t>(samples - 1)));
    }
    static std::uint64_t hashOf(std::uint64_t seed, int x, int y) {
        return mixBits(seed * 0x9e3779b97f4a7c15ull ^
                       mixBits(static_cast<std::uint64_t>(y) << 32 | static_cast<std::uint32_t>(x)));
    }

    /// The sample's number in an order of its own, in which each block of 2^k samples is one still.
    std::uint32_t shuffled(std::uint64_t seed) const {
        return reverseBits(scrambleUpwards(reverseBits(index()), static_cast<std::uint32_t>(seed)));
    }
    static float fraction(std::uint32_t reversed) { return static_cast<float>(reverseBits(reversed) >> 8) * 0x1p-24f; }
    std::uint64_t state_;
};

}  // namespace rtsg::trace
