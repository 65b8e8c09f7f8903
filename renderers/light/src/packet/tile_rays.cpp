// Sample places by scrambled Sobol points, and the primary rays of a tile.
#include "tile_rays.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lighting/packet_random.h"
#include "lighting/sample_points.h"
#include "mesh/simd8.h"
#include "surface/packet_kernels.h"

namespace rtsg::trace {

using namespace simd;

namespace {

constexpr std::uint64_t kPositionsSeed = 0xd1b54a32d192ed03,
                        kLensSeed = 0x8cb92ba72f3d8dd7;  // other numbers than a path's

/// The places of samples in sixteen pixels, four by four; `x`, `y`: of the first.
PairsOfSamples positionsInBlock(std::uint64_t seed, int x, int y) {
    PathRandom randoms[16];
    for (int lane = 0; lane < 16; ++lane)
        randoms[lane] = PathRandom(seed ^ kPositionsSeed, x + (lane & 3), y + (lane >> 2), 0);
    return PairsOfSamples(randoms);
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
void throughLens(const TraceScene& scene, const Camera& camera, std::uint64_t seed, int x0, int y0, int sample,
                 const std::uint16_t* pixels, RayPacket16& rays) {
    const glm::dmat3 axes = camera.axes();  // a lens is round
    const Vec3f right(axes[0]), up(axes[1]), forward(camera.forward);
    const auto focus = static_cast<float>(camera.focus), radius = static_cast<float>(camera.lensRadius);
    for (int lane = 0; lane < 16; ++lane) {
        if (!rays.active[lane]) continue;
        PathRandom random(seed ^ kLensSeed, x0 + pixels[lane] % kTileSide, y0 + pixels[lane] / kTileSide, sample);
        const Vec2f point = radius * onDisk(random.nextPair());
        const Vec3f offset = point.x * right + point.y * up;
        const Vec3f straight(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
        const Vec3f direction = glm::normalize(straight * (focus / glm::dot(straight, forward)) - offset);
        rays.set(lane, {scene.eye + offset, 0, direction, rays.tMax[lane]});
    }
}

/// Directions of a panorama.
V8 aroundAt(const Camera& camera, const RenderSettings& settings, const float* u, const float* v) {
    alignas(32) float x[8], y[8], z[8];
    for (int lane = 0; lane < 8; ++lane) {
        const Vec3d d =
            camera.ray(double{u[lane]} / settings.width + .5, double{v[lane]} / settings.height + .5).direction;
        x[lane] = static_cast<float>(d.x), y[lane] = static_cast<float>(d.y), z[lane] = static_cast<float>(d.z);
    }
    return {load(x), load(y), load(z)};
}

}  // namespace

namespace {

/// The pixels of a block, and a bit for each that is in the picture.
std::uint32_t blockPixels(const RenderSettings& settings, int x, int y, int bx, int by, std::uint16_t* pixels) {
    for (int lane = 0; lane < 16; ++lane)
        pixels[lane] = static_cast<std::uint16_t>((by + (lane >> 2)) * kTileSide + bx + (lane & 3));
    if (x + 4 <= settings.width && y + 4 <= settings.height) return 0xFFFF;
    std::uint32_t active = 0;
    for (int lane = 0; lane < 16; ++lane)
        active |= static_cast<std::uint32_t>(x + (lane & 3) < settings.width && y + (lane >> 2) < settings.height)
                  << lane;
    return active;
}

PixelBlock pixelBlock(const Camera& camera, const RenderSettings& settings, const Vec3f& eye, int x, int y) {
    const double width = settings.width, height = settings.height;
    return {static_cast<float>(x - width / 2),
            static_cast<float>(y - height / 2),
            static_cast<float>((camera.left + camera.rightEdge) / 2),
            static_cast<float>((camera.rightEdge - camera.left) / width),
            static_cast<float>((camera.top + camera.bottom) / 2),
            static_cast<float>((camera.top - camera.bottom) / height),
            eye,
            Vec3f(camera.right),
            Vec3f(camera.up),
            Vec3f(camera.forward),
            static_cast<float>(camera.visibilityLimit)};
}

/// Makes rays through these places of the pixels, for eyes whose rays do not start in one point.
void raysThrough(const Camera& camera, const RenderSettings& settings, const PixelBlock& b, const float* inX,
                 const float* inY, RayPacket16& rays) {
    alignas(32) float u[16], v[16];
    for (int lane = 0; lane < 16; ++lane) {
        u[lane] = inX[lane] + (b.x + static_cast<float>(lane & 3));
        v[lane] = inY[lane] + (b.y + static_cast<float>(lane >> 2));
    }
    for (int at = 0; at < 16; at += 8) {
        const F8 x = b.middleX + b.across * load(u + at), y = b.middleY - b.down * load(v + at);
        V8 d{b.right.x * x + b.up.x * y, b.right.y * x + b.up.y * y, b.right.z * x + b.up.z * y};
        V8 o{all(b.eye.x), all(b.eye.y), all(b.eye.z)};
        if (camera.panorama) {
            d = aroundAt(camera, settings, u + at, v + at);
        } else {
            o = o + d;
            d = {all(b.forward.x), all(b.forward.y), all(b.forward.z)};
        }
        store(rays.originX + at, o.x), store(rays.originY + at, o.y), store(rays.originZ + at, o.z);
        store(rays.directionX + at, d.x), store(rays.directionY + at, d.y), store(rays.directionZ + at, d.z);
        store(rays.tMin + at, all(0));
        store(rays.tMax + at, all(b.tMax));
    }
}

/// Bounds the rays by the eye's planes and the limit of its sight.
void bound(const Camera& camera, RayPacket16& rays) {
    for (int lane = 0; lane < 16; ++lane) {
        if (!rays.active[lane]) continue;
        const Vec3d direction(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
        const auto [from, to] = camera.reach(direction);
        rays.tMin[lane] = static_cast<float>(from), rays.tMax[lane] = static_cast<float>(std::max(from, to));
    }
}

}  // namespace

void findSpatialIndex(std::uint64_t seed, int x0, int y0, std::span<SamplePositions> samples) {
    for (int block = 0; block < kTilePixels / 16; ++block) {
        const PairsOfSamples positions = positionsInBlock(seed, x0 + (block & 3) * 4, y0 + (block >> 2) * 4);
        for (std::size_t s = 0; s < samples.size(); ++s)
            positions.of(static_cast<int>(s), samples[s].u[block], samples[s].v[block]);
    }
}

float endOfSight(const Camera& camera, const PathTask& task) {
    const auto [from, to] = camera.reach(Vec3d(task.direction));
    return std::max(static_cast<float>(to) - task.line, 0.0f);
}

bvh::PixelGrid pixelGrid(const TraceScene& scene, const Camera& camera, const RenderSettings& settings) {
    const PixelBlock b = pixelBlock(camera, settings, scene.world->fromWorld(camera.position), 0, 0);
    return {b.eye, b.right, b.up, b.forward, b.middleX, b.across, b.middleY, b.down, settings.width, settings.height};
}

std::uint32_t primaryRays(const TraceScene& scene, const Camera& camera, const RenderSettings& settings,
                          std::uint64_t seed, int x0, int y0, int block, int sample, RayPacket16& rays,
                          std::uint16_t* pixels, const SamplePositions* positions) {
    const int bx = (block & 3) * 4, by = (block >> 2) * 4;
    const std::uint32_t active = blockPixels(settings, x0 + bx, y0 + by, bx, by, pixels);
    if (!active) return 0;
    const PixelBlock b = pixelBlock(camera, settings, scene.world->fromWorld(camera.position), x0 + bx, y0 + by);
    alignas(64) float ownU[16], ownV[16];
    const float *u = ownU, *v = ownV;
    if (positions)
        u = positions->u[block], v = positions->v[block];
    else if (settings.samplesPerPixel == 1)
        std::fill(ownU, ownU + 16, 0.5f), std::fill(ownV, ownV + 16, 0.5f);
    else
        positionsInBlock(seed, x0 + bx, y0 + by).of(sample, ownU, ownV);
    if (camera.orthographic || camera.panorama) {
        raysThrough(camera, settings, b, u, v, rays);
        for (int lane = 0; lane < 16; ++lane) rays.active[lane] = -static_cast<std::int32_t>(active >> lane & 1u);
    } else {
        packetKernels().makeRays(b, active, u, v, rays);
    }
    if (camera.lensRadius > 0 && settings.samplesPerPixel > 1)
        throughLens(scene, camera, seed, x0, y0, sample, pixels, rays);
    if (camera.isBounded()) bound(camera, rays);
    return active;
}

}  // namespace rtsg::trace
