// Tests rays against every triangle of a small world, in loops that compilers vectorise.
#include "few_walls.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <rtsg/core/machine.h>

namespace rtsg {
namespace {

constexpr int kFewLanes = AcousticRays::kMax;
/// Walls that reach farther from the middle of rays, or off their plane, are left to the BVH; metres.
constexpr double kFarthestFew = 1e4, kMaxOffPlane = 1e-7;

/// The nearest triangle along each of sixteen rays, and its distance.
struct Nearest {
    alignas(64) double distance[kFewLanes];
    alignas(64) std::int64_t triangle[kFewLanes];
};

#if defined(__x86_64__) && defined(__GNUC__)
#define RTSG_INTO_EACH __attribute__((always_inline))
#else
#define RTSG_INTO_EACH
#endif

RTSG_INTO_EACH inline void findNearest(std::span<const FewWalls::Plane> planes,
                                       std::span<const FewWalls::Triangle> triangles, const AcousticRays& rays,
                                       Nearest& nearest) {
    const AcousticRays::Vectors &o = rays.origin, &d = rays.direction;
    alignas(64) std::int64_t except[kFewLanes];
    for (int i = 0; i < kFewLanes; ++i) {
        except[i] = rays.except[i];
        nearest.distance[i] = i < rays.count ? rays.maxDistance[i] : 0;
        nearest.triangle[i] = -1;
    }
    for (const FewWalls::Plane& plane : planes) {
        alignas(64) double t[kFewLanes], x[kFewLanes], y[kFewLanes], z[kFewLanes];
        const double nx = plane.normal.x, ny = plane.normal.y, nz = plane.normal.z, offset = plane.offset;
        const std::int64_t number = plane.number;
        for (int i = 0; i < kFewLanes; ++i) {
            const double along = d.x[i] * nx + d.y[i] * ny + d.z[i] * nz;
            const double distance = -(nx * o.x[i] + ny * o.y[i] + nz * o.z[i] - offset) / along;
            // A distance that is no number does not count.
            const bool counts = (distance >= 0) & (distance < nearest.distance[i]) & (except[i] != number);
            t[i] = counts ? distance : -1;
            x[i] = o.x[i] + d.x[i] * distance;
            y[i] = o.y[i] + d.y[i] * distance;
            z[i] = o.z[i] + d.z[i] * distance;
        }
        for (std::uint32_t k = plane.first; k < plane.end; ++k) {
            const FewWalls::Triangle& w = triangles[k];
            const auto inside = [&](int edge, int i) {
                const glm::dvec3& n = w.inwards[edge];
                return n.x * x[i] + n.y * y[i] + n.z * z[i] >= w.from[edge];
            };
            for (int i = 0; i < kFewLanes; ++i) {
                const bool ahead = t[i] >= 0, first = inside(0, i), second = inside(1, i), third = inside(2, i);
                const bool met = ahead & first & second & third;
                nearest.distance[i] = met ? t[i] : nearest.distance[i];
                nearest.triangle[i] = met ? std::int64_t{k} : nearest.triangle[i];
            }
        }
    }
}

using FindNearest = void (*)(std::span<const FewWalls::Plane>, std::span<const FewWalls::Triangle>, const AcousticRays&,
                             Nearest&);

void findNearestAnywhere(std::span<const FewWalls::Plane> planes, std::span<const FewWalls::Triangle> triangles,
                         const AcousticRays& rays, Nearest& nearest) {
    findNearest(planes, triangles, rays, nearest);
}

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)  // whose attribute has no widths
// The same, number for number, with wider vectors.
__attribute__((target("avx512f,avx512dq,avx512vl,prefer-vector-width=512"))) void findNearestAvx512(
    std::span<const FewWalls::Plane> planes, std::span<const FewWalls::Triangle> triangles, const AcousticRays& rays,
    Nearest& nearest) {
    findNearest(planes, triangles, rays, nearest);
}
const FindNearest kFindNearest = simd::hasAvx512() ? findNearestAvx512 : findNearestAnywhere;
#else
const FindNearest kFindNearest = findNearestAnywhere;
#endif

}  // namespace

void FewWalls::change(std::uint32_t slot, const Wall& before, const Wall& now) {
    if (before.mesh) count_ -= before.mesh->triangleCount;
    if (now.mesh) {
        count_ += now.mesh->triangleCount;
        slots_.insert(slot);
    } else {
        slots_.erase(slot);
    }
}

/// Whether it lies on its plane.
bool FewWalls::addTriangle(const glm::dvec3 (&corners)[3], const ReflectingPlane& on, std::uint32_t material) {
    Triangle triangle;
    triangle.material = material;
    triangle.plane = static_cast<std::uint32_t>(planes_.size() - 1);
    const glm::dvec3 middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    double size = 0;
    for (const glm::dvec3& corner : corners) {
        if (!(std::abs(on.signedDistance(corner)) < kMaxOffPlane)) return false;
        size = std::max(size, glm::length(corner));
    }
    const double wider = 2 * kMaxOffPlane + 0x1p-30 * size;
    for (int e = 0; e < 3; ++e) {
        const glm::dvec3 edge = corners[(e + 1) % 3] - corners[e];
        glm::dvec3 inwards = glm::cross(on.normal, edge);
        const double length = glm::length(inwards);
        if (!(length > 1e-6)) return false;  // a sliver
        inwards /= glm::dot(inwards, middle - corners[e]) < 0 ? -length : length;
        triangle.inwards[e] = inwards;
        triangle.from[e] = std::min(glm::dot(inwards, corners[e]), glm::dot(inwards, corners[(e + 1) % 3])) - wider;
    }
    triangles_.push_back(triangle);
    return true;
}

void FewWalls::build(const PagedArray<Wall>& walls, const WallPlanes& planes, const RayView& rays) {
    usable_ = false;
    planes_.clear();
    triangles_.clear();
    if (count_ > kMaxTriangles || slots_.size() > kMaxTriangles || !planes.usable()) return;
    std::vector<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>> order;  // plane, slot, triangle
    for (const std::uint32_t slot : slots_) {
        const Instance& info = rays.instance(slot).info;
        if (info.volume || info.boundingBox) return;  // what rays do not meet as walls
        for (std::uint32_t t = 0; t < walls[slot].mesh->triangleCount; ++t) {
            const std::uint32_t plane = planes.planeOf(slot, t);
            if (plane == kNoPlane) return;
            order.emplace_back(plane, slot, t);
        }
    }
    std::sort(order.begin(), order.end());
    for (const auto& [number, slot, t] : order) {
        const Wall& wall = walls[slot];
        const ReflectingPlane& on = planes.planes()[number];
        glm::dvec3 corners[3];
        for (std::uint32_t c = 0; c < 3; ++c) {
            corners[c] = wall.worldFromLocal * glm::dvec4(wall.mesh->vertex(t, c), 1.0);
            if (!(glm::length(corners[c] - rays.origin()) < kFarthestFew)) return;
        }
        if (planes_.empty() || planes_.back().number != number) {
            const auto first = static_cast<std::uint32_t>(triangles_.size());
            planes_.push_back({on.normal, on.offset, number, first, first});
        }
        if (!addTriangle(corners, on, wall.material)) return;
        ++planes_.back().end;
    }
    usable_ = true;
}

std::uint32_t FewWalls::closest(const AcousticRays& rays, AcousticHits& hits) const {
    Nearest nearest;
    kFindNearest(planes_, triangles_, rays, nearest);
    std::uint32_t met = 0;
    for (int i = 0; i < rays.count; ++i) {
        if (nearest.triangle[i] < 0) continue;
        met |= 1u << i;
        const Triangle& triangle = triangles_[static_cast<std::size_t>(nearest.triangle[i])];
        const Plane& plane = planes_[triangle.plane];
        hits[static_cast<std::size_t>(i)] = {nearest.distance[i], plane.normal, plane.number, triangle.material, 0};
    }
    return met;
}

std::uint32_t FewWalls::blocked(const AcousticRays& rays) const {
    Nearest nearest;
    kFindNearest(planes_, triangles_, rays, nearest);
    std::uint32_t met = 0;
    for (int i = 0; i < rays.count; ++i) met |= std::uint32_t{nearest.triangle[i] >= 0} << i;
    return met;
}

}  // namespace rtsg
