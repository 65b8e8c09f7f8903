// The questions of acoustic tracing for sixteen rays at a time.
#include <algorithm>
#include <bit>
#include <cmath>

#include "walls/few_walls.h"
#include "walls/loose_triangles.h"
#include "walls/plane_index.h"
#include "walls/wall_planes.h"
#include "world_geometry.h"

namespace rtsg {
namespace {

constexpr int kLanes = AcousticRays::kMax;
constexpr double kFar = 1e9;  // metres that a ray goes at most

/// WorldGeometry::roundingAt() of where each ray starts. Steps that compilers make vectors of, here and below.
void findRounding(const AcousticRays& rays, const glm::dvec3& center, double (&rounding)[kLanes]) {
    const AcousticRays::Vectors& o = rays.origin;
    for (int i = 0; i < kLanes; ++i) {
        const double x = std::abs(o.x[i] - center.x), y = std::abs(o.y[i] - center.y), z = std::abs(o.z[i] - center.z);
        const double xy = x < y ? y : x;
        rounding[i] = 0x1p-20 * (0x1p-3 + (xy < z ? z : xy));
    }
}

void setDirections(const AcousticRays& rays, RayPacket16& packet) {
    for (int i = 0; i < kLanes; ++i) {
        packet.directionX[i] = static_cast<float>(rays.direction.x[i]);
        packet.directionY[i] = static_cast<float>(rays.direction.y[i]);
        packet.directionZ[i] = static_cast<float>(rays.direction.z[i]);
        packet.tMin[i] = 0;
    }
}

/// Moves lanes along one axis before they become rays in single precision.
void setOrigins(const double (&from)[kLanes], const double (&along)[kLanes], const double (&by)[kLanes], double center,
                float (&to)[kLanes]) {
    for (int i = 0; i < kLanes; ++i) to[i] = static_cast<float>(from[i] + along[i] * by[i] - center);
}

/// Rays that start on a surface begin a little before it; others a little before their origin (`early`).
void startRays(const AcousticRays& rays, const glm::dvec3& center, RayPacket16& packet, double (&early)[kLanes],
               double (&rounding)[kLanes]) {
    alignas(64) double x[kLanes], y[kLanes], z[kLanes];
    findRounding(rays, center, rounding);
    setDirections(rays, packet);
    const AcousticRays::Vectors &d = rays.direction, &f = rays.facing;
    for (int i = 0; i < kLanes; ++i) {
        const bool free = f.x[i] * f.x[i] + f.y[i] * f.y[i] + f.z[i] * f.z[i] == 0;
        early[i] = free ? rounding[i] : 0;
        x[i] = free ? -d.x[i] : f.x[i];
        y[i] = free ? -d.y[i] : f.y[i];
        z[i] = free ? -d.z[i] : f.z[i];
        const double maximum = rays.maxDistance[i] * (1 + 0x1p-20) + 2 * rounding[i];
        packet.tMax[i] = static_cast<float>(kFar < maximum ? kFar : maximum);
        packet.active[i] = -static_cast<std::int32_t>((i < rays.count) & (rays.maxDistance[i] > 0));
    }
    setOrigins(rays.origin.x, x, rounding, center.x, packet.originX);
    setOrigins(rays.origin.y, y, rounding, center.y, packet.originY);
    setOrigins(rays.origin.z, z, rounding, center.z, packet.originZ);
}

/// Starts rays at their surfaces, far enough before them not to hit them, and ends them just before their targets.
void startLooks(const AcousticRays& rays, const glm::dvec3& center, RayPacket16& packet) {
    alignas(64) double rounding[kLanes], off[kLanes];
    findRounding(rays, center, rounding);
    setDirections(rays, packet);
    for (int i = 0; i < kLanes; ++i) {
        off[i] = rays.clear[i] < rounding[i] ? rounding[i] : rays.clear[i];
        const double length = rays.maxDistance[i] - 2 * rounding[i];
        packet.tMax[i] = static_cast<float>(kFar < length ? kFar : length);
        packet.active[i] = -static_cast<std::int32_t>((i < rays.count) & (length > 0));
    }
    setOrigins(rays.origin.x, rays.facing.x, off, center.x, packet.originX);
    setOrigins(rays.origin.y, rays.facing.y, off, center.y, packet.originY);
    setOrigins(rays.origin.z, rays.facing.z, off, center.z, packet.originZ);
}

}  // namespace

/// judge() for a hit on a plane near the rough position, as nearly all hits are if there are planes.
inline bool WorldGeometry::meetsPlane(std::uint32_t instance, std::uint32_t triangle, double rough,
                                      const AcousticRays& rays, int lane, AcousticHit& hit) const {
    const std::uint32_t plane = planes_->planeOf(instance, triangle);
    if (plane == kNoPlane || plane == rays.except[lane]) return false;
    const ReflectingPlane& on = planes_->planes()[plane];
    const double distance = -on.signedDistance(rays.origin[lane]) / glm::dot(rays.direction[lane], on.normal);
    if (!(isNearRough(distance, rough) && distance >= 0 && distance < rays.maxDistance[lane])) return false;
    hit = {distance, on.normal, plane, walls_.walls[instance].material, 0};
    return true;
}

/// The same for a hit on no plane, if there are none.
inline bool WorldGeometry::meetsLoose(const PacketHits16& found, double rough, double rounding,
                                      const AcousticRays& rays, int lane, AcousticHit& hit) const {
    const std::uint32_t instance = found.instance[lane], own = looseNumber(instance, found.triangle[lane]);
    if (own == rays.except[lane] || !(rough >= 0 && rough < rays.maxDistance[lane])) return false;
    const Wall& wall = walls_.walls[instance];
    hit = {rough, looseNormal({found.normalX[lane], found.normalY[lane], found.normalZ[lane]}), own, wall.material,
           looseClearance(wall, rays_->instance(instance), rays_->origin()) + rounding};
    return true;
}

std::uint32_t WorldGeometry::closestOfBut(std::span<const std::uint32_t> open, const AcousticRays& rays,
                                          AcousticHits& hits) const {
    if (few_->usable() && unsettled_.empty() && open.empty()) return few_->closest(rays, hits);
    RayPacket16 packet;
    PacketHits16 found;
    alignas(64) double early[kLanes], rounding[kLanes];  // early: metres that a ray starts before its origin
    // Off the surface that it starts on, nearly always the first thing in the way is the answer; else closestBut() is
    // asked, which searches from behind that surface on.
    startRays(rays, rays_->origin(), packet, early, rounding);
    for (int i = 0; i < rays.count; ++i) {
        if (early[i] == 0 || rays.except[i] >= planes_->planes().size()) continue;
        // The surface that it starts on is met after `early`, and a little later or earlier.
        const double cosine = std::abs(glm::dot(planes_->planes()[rays.except[i]].normal, rays.direction[i]));
        packet.tMin[i] = std::min(static_cast<float>(early[i] * (1 + 0.5 / cosine)), packet.tMax[i]);
    }
    const std::uint32_t mask = rays_->intersect(packet, false, RayKind::sound);
    rays_->hits(packet, mask, found);
    const bool all = open.empty() && unsettled_.empty();
    const bool onPlanes = all && planes_->usable(), onNone = all && !planes_->usable();
    std::uint32_t met = 0;
    for (int i = 0; i < rays.count; ++i) {
        AcousticHit& hit = hits[static_cast<std::size_t>(i)];
        Judged judged = Judged::doubtful;
        if (mask >> i & 1) {
            const double rough = static_cast<double>(packet.tMax[i]) - early[i];
            if ((onPlanes && meetsPlane(found.instance[i], found.triangle[i], rough, rays, i, hit)) ||
                (onNone && meetsLoose(found, rough, rounding[i], rays, i, hit))) {
                met |= 1u << i;
                continue;
            }
            const Hit one{packet.tMax[i], found.instance[i], found.triangle[i],
                          found.u[i],     found.v[i],        {found.normalX[i], found.normalY[i], found.normalZ[i]}};
            judged =
                judge(one, rough, open, rays.origin[i], rays.direction[i], rays.maxDistance[i], rays.except[i], hit);
        } else if (early[i] != 0 && packet.tMin[i] == 0) {
            judged = Judged::beyond;
        }
        if (judged == Judged::doubtful &&
            closestBut(open, rays.origin[i], rays.direction[i], rays.maxDistance[i], rays.except[i], hit))
            judged = Judged::hit;
        met |= static_cast<std::uint32_t>(judged == Judged::hit) << i;
    }
    return met;
}

std::uint32_t WorldGeometry::blockedOfBut(std::span<const std::uint32_t> open, const AcousticRays& rays) const {
    if (few_->usable() && unsettled_.empty() && open.empty()) return few_->blocked(rays);
    RayPacket16 packet;
    startLooks(rays, rays_->origin(), packet);
    std::uint32_t blocked = rays_->occluded(packet, false, RayKind::sound);
    if (blocked != 0) settleDoubts(open, rays, packet, blocked);
    return blocked;
}

/// Looks again at rays that seem to be blocked. They may have met the surface on which they start, where that is off
/// its plane, or something that is not to be there.
void WorldGeometry::settleDoubts(std::span<const std::uint32_t> open, const AcousticRays& rays, RayPacket16& packet,
                                 std::uint32_t& blocked) const {
    std::uint32_t doubtful = blocked;
    if (open.empty())
        for (int i = 0; i < kLanes; ++i)
            if (rays.clear[i] > 0) doubtful &= ~(1u << i);  // as one expression GCC 12 gets it wrong under UBSan
    if (doubtful == 0) return;
    for (int i = 0; i < kLanes; ++i) {
        if (!(doubtful >> i & 1)) {
            packet.skip(i);
            continue;
        }
        // From there on the hit cannot be that surface.
        const double off = 2 * PlaneTolerance().distance / glm::dot(rays.facing[i], rays.direction[i]);
        packet.tMin[i] = static_cast<float>(std::min(off, 1e9));
        packet.tMax[i] = static_cast<float>(rays.maxDistance[i] - 2 * roundingAt(rays.origin[i]));
        if (!(packet.tMin[i] < packet.tMax[i])) packet.skip(i);
    }
    if (open.empty()) doubtful &= ~rays_->occluded(packet, false, RayKind::sound);
    for (; doubtful != 0; doubtful &= doubtful - 1) {
        const int i = std::countr_zero(doubtful);
        AcousticHit hit;
        if (!closestBut(open, rays.origin[i], rays.direction[i], rays.maxDistance[i], rays.except[i], hit))
            blocked &= ~(1u << i);
    }
}

}  // namespace rtsg
