// Sample places by scrambled Sobol points, and the primary rays of a tile.
#include "tile_rays.h"

#include "mesh/simd8.h"

namespace rtsg::trace {

using namespace simd;

namespace {

std::uint32_t scramble(std::uint64_t x) {
    x ^= x >> 33, x *= 0xff51afd7ed558ccdull, x ^= x >> 33, x *= 0xc4ceb9fe1a85ec53ull, x ^= x >> 33;
    return static_cast<std::uint32_t>(x);
}

std::uint32_t reverseBits(std::uint32_t x) {
    x = x << 16 | x >> 16;
    x = (x & 0x00ff00ffu) << 8 | (x & 0xff00ff00u) >> 8;
    x = (x & 0x0f0f0f0fu) << 4 | (x & 0xf0f0f0f0u) >> 4;
    x = (x & 0x33333333u) << 2 | (x & 0xccccccccu) >> 2;
    return (x & 0x55555555u) << 1 | (x & 0xaaaaaaaau) >> 1;
}

std::uint32_t sobol2(std::uint32_t index) {
    std::uint32_t result = 0;
    for (std::uint32_t v = 1u << 31; index; index >>= 1, v ^= v >> 1)
        if (index & 1u) result ^= v;
    return result;
}

/// The place of a sample in its pixel, [0, 1)^2.
Vec2f samplePlace(const RenderSettings& settings, int x, int y, int sample) {
    if (settings.samplesPerPixel == 1) return Vec2f(0.5f);
    const std::uint64_t pixel = static_cast<std::uint64_t>(y) << 32 | static_cast<std::uint32_t>(x);
    const auto index = static_cast<std::uint32_t>(sample);
    const std::uint32_t u = reverseBits(index) ^ scramble(pixel * 2 + settings.seed * 0x9e3779b97f4a7c15ull);
    const std::uint32_t v = sobol2(index) ^ scramble((pixel * 2 + 1) ^ settings.seed * 0xd1b54a32d192ed03ull);
    return {static_cast<float>(u >> 8) * 0x1p-24f, static_cast<float>(v >> 8) * 0x1p-24f};
}

}  // namespace

std::uint32_t primaryRays(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                          int block, int sample, RayPacket16& rays, std::uint16_t* pixels) {
    alignas(32) float u[16], v[16];
    const int bx = (block & 3) * 4, by = (block >> 2) * 4;
    std::uint32_t active = 0;
    for (int lane = 0; lane < 16; ++lane) {
        const int px = bx + (lane & 3), py = by + (lane >> 2), x = x0 + px, y = y0 + py;
        pixels[lane] = static_cast<std::uint16_t>(py * kTileSide + px);
        const bool in = x < settings.width && y < settings.height;
        rays.active[lane] = in ? -1 : 0;
        active |= static_cast<std::uint32_t>(in) << lane;
        const Vec2f place = samplePlace(settings, x, y, sample);
        u[lane] = (static_cast<float>(x) + place.x) / static_cast<float>(settings.width);
        v[lane] = (static_cast<float>(y) + place.y) / static_cast<float>(settings.height);
    }
    if (!active) return 0;
    const Vec3f eye = scene.world->fromWorld(camera.position);
    const Vec3f right(camera.right), up(camera.up), forward(camera.forward);
    const auto left = static_cast<float>(camera.left), width = static_cast<float>(camera.rightEdge - camera.left);
    const auto top = static_cast<float>(camera.top), height = static_cast<float>(camera.top - camera.bottom);
    for (int at = 0; at < 16; at += 8) {
        const F8 x = left + width * load(u + at), y = top - height * load(v + at);
        V8 d{right.x * x + up.x * y, right.y * x + up.y * y, right.z * x + up.z * y};
        V8 o{all(eye.x), all(eye.y), all(eye.z)};
        if (camera.orthographic) {
            o = o + d;
            d = {all(forward.x), all(forward.y), all(forward.z)};
        } else {
            d = d + V8{all(forward.x), all(forward.y), all(forward.z)};
            d = d * (1.0f / sqrt(dot(d, d)));
        }
        store(rays.originX + at, o.x), store(rays.originY + at, o.y), store(rays.originZ + at, o.z);
        store(rays.directionX + at, d.x), store(rays.directionY + at, d.y), store(rays.directionZ + at, d.z);
        store(rays.tMin + at, all(0));
        store(rays.tMax + at, all(static_cast<float>(camera.visibilityLimit)));
    }
    return active;
}

}  // namespace rtsg::trace
