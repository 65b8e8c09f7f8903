// Paths without their pictures: where they go, and what they ask.
#include "path_rays.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "bench.h"

namespace rtsg::bench {

namespace {

constexpr int kTile = 16;      // pixels a side, whose paths go together
constexpr float kOff = 1e-4f;  // metres from a surface

/// With the density of cosines about the normal.
Vec3f scattered(const Vec3f& normal, float u, float v) {
    const float angle = 2 * std::numbers::pi_v<float> * u, height = 2 * v - 1, radius = std::sqrt(1 - height * height);
    const Vec3f around = normal + Vec3f(radius * std::cos(angle), radius * std::sin(angle), height);
    const float length = glm::length(around);
    return length > 1e-4f ? around / length : normal;
}

}  // namespace

PathRays::PathRays(const RayWorld& world, const Eye& eye, const Lamps& lamps, int side, int samples,
                   const PathRayCounts& counts) {
    const double goesOn = counts.bounced / (counts.bounced + counts.fromEye);
    const float width = 2 * std::tan(eye.fieldOfView / 2) / static_cast<float>(side);
    std::uniform_real_distribution<float> unit;
    std::vector<Segment> now, next;
    for (int tile = 0; tile < side / kTile * (side / kTile); ++tile) {
        const int x0 = tile % (side / kTile) * kTile, y0 = tile / (side / kTile) * kTile;
        for (int block = 0; block < kTile; ++block)
            for (int sample = 0; sample < samples; ++sample) {
                RayPacket16 rays;
                for (int lane = 0; lane < 16; ++lane) {
                    const int x = x0 + block % 4 * 4 + lane % 4 - side / 2,
                              y = y0 + block / 4 * 4 + lane / 4 - side / 2;
                    const Vec3f displacement(width * (static_cast<float>(x) + unit(random_)),
                                             width * (static_cast<float>(y) + unit(random_)), -1);
                    rays.set(lane, {eye.position, 0, glm::normalize(displacement)});
                }
                fromEye_.emplace_back(rays);
                follow(world, lamps, rays, goesOn, next);
            }
        while (!next.empty()) {
            now.swap(next);
            next.clear();
            for (std::size_t first = 0; first < now.size(); first += 16) {
                RayPacket16 rays;
                for (std::size_t lane = 0; lane < 16; ++lane) {
                    rays.skip(static_cast<int>(lane));
                    if (first + lane >= now.size()) continue;
                    rays.set(static_cast<int>(lane), {now[first + lane].origin, 0, now[first + lane].direction});
                }
                bounced_.emplace_back(rays);
                follow(world, lamps, rays, goesOn, next);
            }
        }
    }
}

void PathRays::follow(const RayWorld& world, const Lamps& lamps, RayPacket16& rays, double goesOn,
                      std::vector<Segment>& next) {
    const std::uint32_t hits = world.intersect(rays);
    std::uniform_real_distribution<float> unit;
    RayPacket16 asked;
    bool any = false;
    for (int lane = 0; lane < 16; ++lane) {
        asked.skip(lane);
        if (!(hits >> lane & 1u)) continue;
        const auto [position, normal] = MetPosition(world, rays, lane);
        const Vec3f& middle = lamps.middles[random_() % lamps.middles.size()];
        const Vec3f lamp =
            middle + lamps.half * Vec3f(2 * unit(random_) - 1, 0, 2 * unit(random_) - 1) - Vec3f(0, kOff, 0);
        const Vec3f displacement = lamp - position;
        if (glm::dot(displacement, normal) > 0 && displacement.y > 0)
            asked.set(lane, {position, 0, displacement, 1}), any = true;
        if (double{unit(random_)} < goesOn) next.push_back({position, scattered(normal, unit(random_), unit(random_))});
    }
    if (any) toLamps_.emplace_back(asked);
}

double PathRays::minSeconds(const RayWorld& world, const PathRayCounts& counts) const {
    double fromEye = std::numeric_limits<double>::infinity(), bounced = fromEye, toLamps = fromEye;
    for (const bool robust : {false, true}) {
        const FlatScene bare(world, robust);
        fromEye = std::min(fromEye, minPerRay(bare, fromEye_, false));
        bounced = std::min(bounced, minPerRay(bare, bounced_, false));
        toLamps = std::min(toLamps, minPerRay(bare, toLamps_, true));
    }
    return counts.fromEye * fromEye + counts.bounced * bounced + counts.toLamps * toLamps;
}

}  // namespace rtsg::bench
