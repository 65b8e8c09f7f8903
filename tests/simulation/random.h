// Random: numbers from a seed that are the same on every machine, unlike those of the standard's distributions.
#pragma once

#include <cstdint>

namespace rtsg::simulation {

class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed) {}
    /// One that has nothing to do with others of the same seed: what one draws does not change what another one does.
    Random(std::uint64_t seed, std::uint64_t purpose, std::uint64_t step = 0)
        : state_(mix(mix(seed + 0x9E37) ^ (purpose << 40) ^ step)) {}
    /// SplitMix64 (Steele, Lea, Flood 2014).
    std::uint64_t next() { return mix(state_ += 0x9E3779B97F4A7C15); }
    /// Less than `n`, which is not 0.
    std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>((next() >> 32) * n >> 32); }
    bool chance(std::uint32_t permille) { return below(1000) < permille; }

    static std::uint64_t mix(std::uint64_t x) {
        x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9;
        x = (x ^ (x >> 27)) * 0x94D049BB133111EB;
        return x ^ (x >> 31);
    }

  private:
    std::uint64_t state_;
};

}  // namespace rtsg::simulation
