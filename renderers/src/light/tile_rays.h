// The rays that every integrator starts a tile with.
#pragma once

#include <cstdint>

#include "trace_scene.h"

namespace rtsg::trace {

/// Sixteen neighbouring pixels' rays (`block` 0 to 15 of the tile, four by four pixels each), and which pixels of the
/// tile they belong to. Returns a bit per ray; lanes outside the picture are inactive.
std::uint32_t primaryRays(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                          int block, int sample, RayPacket16& rays, std::uint16_t* pixels);

/// Random numbers of one path: a counter and a hash, so that they depend on the path alone.
class PathRandom {
  public:
    PathRandom(std::uint64_t seed, int x, int y, int sample)
        : state_(mix(seed * 0x9e3779b97f4a7c15ull ^
                     mix(static_cast<std::uint64_t>(y) << 32 | static_cast<std::uint32_t>(x)) ^
                     mix(static_cast<std::uint64_t>(sample) + 0x632be59bd9b4e019ull))) {}
    explicit PathRandom(std::uint64_t state) : state_(state) {}

    /// In [0, 1).
    float next() {
        state_ += 0x9e3779b97f4a7c15ull;
        return static_cast<float>(mix(state_) >> 40) * 0x1p-24f;
    }
    std::uint64_t state() const { return state_; }

  private:
    static std::uint64_t mix(std::uint64_t x) {  // splitmix64's finaliser
        x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
        x = (x ^ x >> 27) * 0x94d049bb133111ebull;
        return x ^ x >> 31;
    }
    std::uint64_t state_;
};

}  // namespace rtsg::trace
