// Sample places by scrambled Sobol points, and the primary rays of a tile.
#include "tile_rays.h"

#include "mesh/simd8.h"
#include "sample_points.h"

namespace rtsg::trace {

using namespace simd;

namespace {

constexpr std::uint64_t kPlaces = 0xd1b54a32d192ed03;  // other numbers than a path's

/// The place of a sample in its pixel, [0, 1)^2.
Vec2f samplePlace(const RenderSettings& settings, int x, int y, int sample) {
    if (settings.samplesPerPixel == 1) return Vec2f(0.5f);
    return PathRandom(settings.seed ^ kPlaces, x, y, sample).nextPair();
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
