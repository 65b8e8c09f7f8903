// PacketRandom: the random numbers of sixteen paths, drawn together, eight at a time.
//
// Invariant: each lane gets, bit for bit, the numbers of its PathRandom. All lanes take part in every call, whether
// they need the number or not, so that they stay together. Lanes with other sequences, or with other calls before, have
// seeds of their own.
// Threading: one of a tile.
#pragma once

#include <bit>

#include "mesh/simd8.h"
#include "sample_points.h"
#include "trace_scene.h"

namespace rtsg::trace {

/// PathRandom::ofPicture() of sixteen pixels: their states.
inline void randomOfPicture(std::uint64_t seed, const int* x, const int* y, int sample, int samples,
                            std::uint64_t* states) {
    using U8 = std::uint32_t __attribute__((vector_size(32)));
    const unsigned side = PathRandom::sideOf(samples);
    for (int at = 0; at < 16; at += 8) {
        U8 right, up, index{};
        std::memcpy(&right, x + at, sizeof right), std::memcpy(&up, y + at, sizeof up);
        // Goes down the squares as hilbertIndex() does.
        for (unsigned i = side; i-- > 0;) {
            const U8 isRight = 0u - (right >> i & 1u), isUp = 0u - (up >> i & 1u);
            index = index << 2 | ((isRight & 3u) ^ (isUp & 1u));
            const U8 turned = isRight & ~isUp, a = right ^ turned, b = up ^ turned, swapped = (a ^ b) & ~isUp;
            right = a ^ swapped, up = b ^ swapped;
        }
        for (int i = 0; i < 8; ++i)
            states[at + i] = PathRandom::ofCell(seed, x[at + i], y[at + i], index[i], sample, samples).state();
    }
}

/// The pairs that PathRandoms of sixteen sequences give next, for any of their samples.
class PairsOfSamples {
  public:
    /// `randoms`: sixteen, of sample 0.
    explicit PairsOfSamples(PathRandom* randoms) {
        for (int lane = 0; lane < 16; ++lane) {
            const int half = lane / 8, i = lane % 8;
            index_[half][i] = randoms[lane].index();
            const std::uint64_t one = randoms[lane].nextSeed(), other = mixBits(one);
            order_[half][i] = static_cast<std::uint32_t>(one), first_[half][i] = static_cast<std::uint32_t>(one >> 32);
            second_[half][i] = static_cast<std::uint32_t>(other);
        }
    }
    /// `u`, `v`: sixteen numbers each.
    void of(int sample, float* u, float* v) const {
        for (int half = 0; half < 2; ++half) {
            const U8 index = reverseBits(
                scrambleUpwards(reverseBits(index_[half] | static_cast<std::uint32_t>(sample)), order_[half]));
            simd::store(u + 8 * half, fraction(scrambleUpwards(index, first_[half])));
            simd::store(v + 8 * half, fraction(scrambleUpwards(sobolSecondReversed(index), second_[half])));
        }
    }

  private:
    using U8 = std::uint32_t __attribute__((vector_size(32)));
    static simd::F8 fraction(U8 reversed) {
        const U8 bits = reverseBits(reversed) >> 8;
        simd::I8 whole;
        std::memcpy(&whole, &bits, sizeof whole);
        return __builtin_convertvector(whole, simd::F8) * 0x1p-24f;
    }
    U8 index_[2], order_[2], first_[2], second_[2];
};

class PacketRandom {
  public:
    /// Goes on where the tasks of the lanes in `mask` are.
    PacketRandom(const PathTask* tasks, std::uint32_t mask) : mask_(mask) {
        for (std::uint32_t rest = mask; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            states_[lane] = tasks[lane].random;
            const PathRandom one(states_[lane]);
            if (rest == mask) common_ = one;
            together_ &= common_.drawsAs(one);
            reversed_[lane] = one.index();
        }
        for (int at = 0; at < 16; at += 8) store(at, reversed_, reverseBits(load(at, reversed_)));
    }

    /// `numbers`: sixteen.
    void next(float* numbers) {
        if (!together_) return nextOfEach(numbers);
        const std::uint64_t seed = common_.nextSeed();
        for (int at = 0; at < 16; at += 8)
            simd::store(numbers + at, fraction(scrambleUpwards(shuffled(at, low(seed)), high(seed))));
    }
    void nextPair(float* u, float* v) {
        if (!together_) return nextPairOfEach(u, v);
        const std::uint64_t seed = common_.nextSeed(), other = mixBits(seed);
        for (int at = 0; at < 16; at += 8) {
            const U8 index = shuffled(at, low(seed));
            simd::store(u + at, fraction(scrambleUpwards(index, high(seed))));
            simd::store(v + at, fraction(scrambleUpwards(sobolSecondReversed(index), low(other))));
        }
    }
    /// Does what next() or nextPair() does if nobody wants the numbers.
    void skip() {
        if (together_)
            common_.nextSeed();
        else
            each([](int, std::uint64_t) {});
    }
    /// The state from which a lane goes on.
    std::uint64_t state(int lane) const {
        return together_ ? common_.ofIndex(PathRandom(states_[lane]).index()).state() : states_[lane];
    }

  private:
    using U8 = std::uint32_t __attribute__((vector_size(32)));

    static U8 load(int at, const std::uint32_t* from) {
        U8 r;
        std::memcpy(&r, from + at, sizeof r);
        return r;
    }
    static void store(int at, std::uint32_t* to, U8 v) { std::memcpy(to + at, &v, sizeof v); }
    static std::uint32_t low(std::uint64_t x) { return static_cast<std::uint32_t>(x); }
    static std::uint32_t high(std::uint64_t x) { return static_cast<std::uint32_t>(x >> 32); }
    static simd::F8 fraction(U8 reversed) {
        const U8 bits = reverseBits(reversed) >> 8;
        simd::I8 whole;
        std::memcpy(&whole, &bits, sizeof whole);
        return __builtin_convertvector(whole, simd::F8) * 0x1p-24f;
    }
    template <class Seed>
    U8 shuffled(int at, Seed seed) const {
        return reverseBits(scrambleUpwards(load(at, reversed_), seed));
    }

    // If lanes belong to different sequences, each has a seed of its own.

    /// Calls take(lane, seed) with the next one's of each.
    template <class Take>
    void each(const Take& take) {
        for (std::uint32_t rest = mask_; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            PathRandom random(states_[lane]);
            take(lane, random.nextSeed());
            states_[lane] = random.state();
        }
    }
    void nextOfEach(float* numbers) {
        alignas(64) std::uint32_t order[16]{}, first[16]{};
        each([&](int lane, std::uint64_t seed) { order[lane] = low(seed), first[lane] = high(seed); });
        for (int at = 0; at < 16; at += 8)
            simd::store(numbers + at, fraction(scrambleUpwards(shuffled(at, load(at, order)), load(at, first))));
    }
    void nextPairOfEach(float* u, float* v) {
        alignas(64) std::uint32_t order[16]{}, first[16]{}, second[16]{};
        each([&](int lane, std::uint64_t seed) {
            order[lane] = low(seed), first[lane] = high(seed), second[lane] = low(mixBits(seed));
        });
        for (int at = 0; at < 16; at += 8) {
            const U8 index = shuffled(at, load(at, order));
            simd::store(u + at, fraction(scrambleUpwards(index, load(at, first))));
            simd::store(v + at, fraction(scrambleUpwards(sobolSecondReversed(index), load(at, second))));
        }
    }

    std::uint32_t mask_;
    bool together_ = true;
    PathRandom common_{0};
    std::uint64_t states_[16]{};
    alignas(64) std::uint32_t reversed_[16]{};  // the samples' numbers, bits in reverse order
};

}  // namespace rtsg::trace
