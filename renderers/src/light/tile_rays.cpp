// Sample places by scrambled Sobol points, and the primary rays of a tile.
#include "tile_rays.h"

#include <cmath>
#include <numbers>

#include "mesh/simd8.h"
#include "sample_points.h"

namespace rtsg::trace {

using namespace simd;

namespace {

constexpr std::uint64_t kPlaces = 0xd1b54a32d192ed03, kLens = 0x8cb92ba72f3d8dd7;  // other numbers than a path's

/// The place of a sample in its pixel, [0, 1)^2.
Vec2f samplePlace(const RenderSettings& settings, int x, int y, int sample) {
    if (settings.samplesPerPixel == 1) return Vec2f(0.5f);
    return PathRandom(settings.seed ^ kPlaces, x, y, sample).nextPair();
}

/// Even points of the square to even points of the disk of radius 1 (Shirley & Chiu 1997): neighbours stay together.
Vec2f onDisk(Vec2f square) {
    const Vec2f p = 2.0f * square - 1.0f;
    if (p.x == 0 && p.y == 0) return p;
    constexpr float kQuarter = std::numbers::pi_v<float> / 4;
    const bool wide = std::abs(p.x) > std::abs(p.y);
    const float radius = wide ? p.x : p.y,
                angle = wide ? kQuarter * (p.y / p.x) : 2 * kQuarter - kQuarter * (p.x / p.y);
    return radius * Vec2f(std::cos(angle), std::sin(angle));
}

/// Through other places of the lens than its middle; in a picture of one sample a pixel all go through that.
void throughLens(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                 int sample, const std::uint16_t* pixels, RayPacket16& rays) {
    const glm::dmat3 axes = camera.axes();  // a lens is round
    const Vec3f right(axes[0]), up(axes[1]), forward(camera.forward);
    const auto focus = static_cast<float>(camera.focus), radius = static_cast<float>(camera.lensRadius);
    for (int lane = 0; lane < 16; ++lane) {
        if (!rays.active[lane]) continue;
        PathRandom random(settings.seed ^ kLens, x0 + pixels[lane] % kTileSide, y0 + pixels[lane] / kTileSide, sample);
        const Vec2f place = radius * onDisk(random.nextPair());
        const Vec3f offset = place.x * right + place.y * up;
        const Vec3f straight(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
        const Vec3f direction = glm::normalize(straight * (focus / glm::dot(straight, forward)) - offset);
        rays.set(lane, {scene.eye + offset, 0, direction, rays.tMax[lane]});
    }
}

/// Directions of a panorama.
V8 aroundAt(const Camera& camera, const float* u, const float* v) {
    alignas(32) float x[8], y[8], z[8];
    for (int lane = 0; lane < 8; ++lane) {
        const Vec3d d = camera.ray(double{u[lane]}, double{v[lane]}).direction;
        x[lane] = static_cast<float>(d.x), y[lane] = static_cast<float>(d.y), z[lane] = static_cast<float>(d.z);
    }
    return {load(x), load(y), load(z)};
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
        } else if (camera.panorama) {
            d = aroundAt(camera, u + at, v + at);
        } else {
            d = d + V8{all(forward.x), all(forward.y), all(forward.z)};
            d = d * (1.0f / sqrt(dot(d, d)));
        }
        store(rays.originX + at, o.x), store(rays.originY + at, o.y), store(rays.originZ + at, o.z);
        store(rays.directionX + at, d.x), store(rays.directionY + at, d.y), store(rays.directionZ + at, d.z);
        store(rays.tMin + at, all(0));
        store(rays.tMax + at, all(static_cast<float>(camera.visibilityLimit)));
    }
    if (camera.lensRadius > 0 && settings.samplesPerPixel > 1)
        throughLens(scene, camera, settings, x0, y0, sample, pixels, rays);
    return active;
}

}  // namespace rtsg::trace
