// A picture's rays without the picture: where they go, and what they ask.
#include "frame_rays.h"

#include <algorithm>
#include <limits>

#include <rtsg/core/x3d.h>

namespace rtsg::bench {

namespace {

constexpr int kTileSide = 16, kBlockSide = 4;  // pixels

}  // namespace

std::vector<FrameLamp> lampsOf(const Scene& scene) {
    std::vector<FrameLamp> lamps;
    scene.forEachNode([&](const Node& node) {
        if (node.is(x3d::DirectionalLight::type) && node.get(x3d::DirectionalLight::on))
            lamps.push_back({-node.get(x3d::DirectionalLight::direction), true});
        if (node.is(x3d::PointLight::type) && node.get(x3d::PointLight::on))
            lamps.push_back({node.get(x3d::PointLight::location), false});
        if (node.is(x3d::SpotLight::type) && node.get(x3d::SpotLight::on))
            lamps.push_back({node.get(x3d::SpotLight::location), false});
    });
    return lamps;
}

FrameRays::FrameRays(const RayWorld& world, const Camera& camera, int width, int height,
                     const std::vector<FrameLamp>& lamps) {
    const Vec3f eye = world.fromWorld(camera.position);
    const int across = width / kTileSide, tiles = across * (height / kTileSide);
    for (int tile = 0; tile < tiles; ++tile)
        for (int block = 0; block < kTileSide; ++block) {
            const int x0 = tile % across * kTileSide + block % kBlockSide * kBlockSide,
                      y0 = tile / across * kTileSide + block / kBlockSide * kBlockSide;
            RayPacket16 rays;
            for (int lane = 0; lane < 16; ++lane) {
                const double x = x0 + lane % kBlockSide + .5, y = y0 + lane / kBlockSide + .5;
                rays.set(lane, {.origin = eye, .direction = Vec3f(camera.ray(x / width, y / height).direction)});
            }
            fromEye_.emplace_back(rays);
            follow(world, lamps, rays);
        }
}

void FrameRays::follow(const RayWorld& world, const std::vector<FrameLamp>& lamps, RayPacket16& rays) {
    const std::uint32_t hits = world.intersect(rays, true);
    if (!hits) return;
    RayPacket16 mirrored;
    std::vector<RayPacket16> asked(lamps.size());
    std::vector<bool> any(lamps.size());
    for (int lane = 0; lane < 16; ++lane) {
        mirrored.skip(lane);
        for (RayPacket16& packet : asked) packet.skip(lane);
        if (!(hits >> lane & 1u)) continue;
        const auto [position, normal] = MetPosition(world, rays, lane);
        mirrored.set(lane, {.origin = position, .direction = glm::reflect(rays.ray(lane).direction, normal)});
        for (std::size_t i = 0; i < lamps.size(); ++i) {
            const Vec3f displacement =
                lamps[i].far ? lamps[i].position : world.fromWorld(Vec3d(lamps[i].position)) - position;
            if (!(glm::dot(displacement, normal) > 0)) continue;
            asked[i].set(lane, {position, 0, displacement, lamps[i].far ? std::numeric_limits<float>::infinity() : 1});
            any[i] = true;
        }
    }
    mirrored_.emplace_back(mirrored);
    for (std::size_t i = 0; i < lamps.size(); ++i)
        if (any[i]) toLamps_.emplace_back(asked[i]);
}

double FrameRays::minSeconds(const RayWorld& world, const RenderStats& counts) const {
    double fromEye = std::numeric_limits<double>::infinity(), mirrored = fromEye, toLamps = fromEye;
    for (const bool robust : {false, true}) {
        const FlatScene bare(world, robust);
        fromEye = std::min(fromEye, minPerRay(bare, fromEye_, false));
        mirrored = std::min(mirrored, minPerRay(bare, mirrored_, false));
        toLamps = std::min(toLamps, minPerRay(bare, toLamps_, true));
    }
    return static_cast<double>(counts.primaryRays) * fromEye + static_cast<double>(counts.secondaryRays) * mirrored +
           static_cast<double>(counts.shadowRays) * toLamps;
}

}  // namespace rtsg::bench
