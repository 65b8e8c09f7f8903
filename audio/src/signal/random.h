// Random: a small seeded generator (SplitMix64), one per ray batch, so that results do not depend on threads.
#pragma once

#include <cstdint>

namespace rtsg {

class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed) {}

    std::uint64_t next() { return scramble(state_ += 0x9E3779B97F4A7C15ull); }
    /// In [0, 1).
    double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
    /// A seed from two numbers.
    static std::uint64_t mix(std::uint64_t a, std::uint64_t b) {
        return scramble(scramble(a + 0x9E3779B97F4A7C15ull) ^ (b + 0xD1B54A32D192ED03ull));
    }

  private:
    static std::uint64_t scramble(std::uint64_t z) {
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
        return z ^ (z >> 31);
    }
    std::uint64_t state_;
};

}  // namespace rtsg
