// Finds triangles in the plane of another one that face the other side, or are visible from both.
#include "coincident.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "media.h"
#include "mesh/simd8.h"

namespace rtsg::trace {

namespace {

struct FaceInPlane {
    std::array<Vec3d, 3> corner;
    Vec3d normal;  // as hits have it; 0: it has no area
    FaceInPlane(const RayInstance& instance, std::uint32_t triangle) {
        std::array<Vec3d, 3> local;
        for (std::uint32_t i = 0; i < 3; ++i) {
            local[i] = Vec3d(instance.mesh->vertex(triangle, i));
            corner[i] = glm::dmat4x3(instance.rayFromLocal) * glm::dvec4(local[i], 1);
        }
        normal = glm::dmat3(instance.normalFromLocal) * glm::cross(local[1] - local[0], local[2] - local[0]);
        const double length = glm::length(normal);
        normal = length > 0 ? normal / length : Vec3d(0);
    }
    Vec3d at(double u, double v) const { return (1 - u - v) * corner[0] + u * corner[1] + v * corner[2]; }
};

/// A part of a triangle: u and v from these on, `share` of its sides wide.
struct TrianglePart {
    double u = 0, v = 0, fraction = 1;
};

/// Along an axis square to an edge of `a` in its plane: whether `b` lies on the edge's outer side, or on it.
bool isApart(const FaceInPlane& a, const FaceInPlane& b, double margin) {
    for (std::size_t i = 0; i < 3; ++i) {
        const Vec3d edge = a.corner[(i + 1) % 3] - a.corner[i];
        Vec3d inwards = glm::cross(a.normal, edge);
        if (glm::dot(inwards, a.corner[(i + 2) % 3] - a.corner[i]) < 0) inwards = -inwards;
        const double length = glm::length(inwards);
        if (!(length > 0)) continue;
        double maximum = -std::numeric_limits<double>::infinity();
        for (const Vec3d& p : b.corner) maximum = std::max(maximum, glm::dot(inwards, p - a.corner[i]) / length);
        if (maximum <= margin) return true;
    }
    return false;
}

/// `margin`: how far apart roundings may make places that are the same.
bool overlap(const FaceInPlane& a, const FaceInPlane& b, double margin) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Vec3d& p : b.corner) {
        const double above = glm::dot(a.normal, p - a.corner[0]);
        low = std::min(low, above), high = std::max(high, above);
    }
    return low <= margin && high >= -margin && !isApart(a, b, margin) && !isApart(b, a, margin);
}

enum State : std::uint64_t { unknown, alone, inCompany, tooMuch };

/// tooMuch: more than `most` triangles lie around this part.
template <class Counts>
State lookAround(const RayView& world, std::uint32_t slot, std::uint32_t triangle, const TrianglePart& part,
                 int maximum, const Counts& counts) {
    const FaceInPlane face(world.instance(slot), triangle);
    if (face.normal == Vec3d(0)) return inCompany;
    const double half = part.fraction / 2;
    const Vec3d middle = part.fraction < 1 ? face.at(part.u + half, part.v + half) : face.at(1.0 / 3, 1.0 / 3);
    double radius = 0, size = 0;
    for (const Vec3d& p : face.corner) {
        radius = std::max(radius, glm::distance(p, middle));
        size = std::max({size, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    }
    if (part.fraction < 1) {
        const Vec3d across = part.fraction * (face.corner[1] - face.corner[0]),
                    along = part.fraction * (face.corner[2] - face.corner[0]);
        radius = std::max(glm::length(across + along), glm::length(across - along)) / 2;
    }
    const double margin = 0x1p-18 * size + 1e-30;  // some times the rounding of a hit
    const auto reach = static_cast<float>((radius + margin) * 1.001);
    State state = alone;
    world.visitNear(Vec3f(middle), reach, [&](std::uint32_t otherSlot, std::uint32_t otherTriangle) {
        if (state != alone) return 0.0f;
        if (otherSlot == slot && otherTriangle == triangle) return reach;
        if (--maximum < 0) state = tooMuch;
        const RayInstance& instance = world.instance(otherSlot);
        const FaceInPlane other(instance, otherTriangle);
        const double cosine = glm::dot(face.normal, other.normal);
        constexpr double kParallel = .999;
        if (std::abs(cosine) > kParallel && counts(instance, otherSlot, cosine) && overlap(face, other, margin))
            state = inCompany;
        return reach;
    });
    return state;
}

}  // namespace

template <class Counts>
bool CoincidentFaces::ask(Answers& known, const RayView& world, const Hit& hit, const Counts& counts) {
    constexpr std::uint64_t kSlots = std::uint64_t{1} << 21;
    if (hit.instance >= kSlots) return true;
    const auto stateOf = [&](std::uint64_t number, const TrianglePart& part, int maximum) {
        const std::uint64_t key = std::uint64_t{hit.instance} << 43 | std::uint64_t{hit.triangle} << 11 | number << 2;
        std::atomic<std::uint64_t>& slot = known[(key * 0x9E3779B97F4A7C15u) >> 52];
        const std::uint64_t last = slot.load(std::memory_order_relaxed);
        if ((last & ~std::uint64_t{3}) == key && (last & 3u) != unknown) return static_cast<State>(last & 3u);
        const State state = lookAround(world, hit.instance, hit.triangle, part, maximum, counts);
        slot.store(key | state, std::memory_order_relaxed);
        return state;
    };
    constexpr int kFew = 256, kMany = 1 << 14;
    constexpr std::uint64_t kParts = 16;  // along a side
    State state = stateOf(kParts * kParts, {}, kFew);
    if (state == tooMuch) {
        // A large triangle lies beside many others that do not matter at this place, so only a part of it is asked
        // about.
        const auto i = std::min<std::uint64_t>(static_cast<std::uint64_t>(hit.u * kParts), kParts - 1),
                   j = std::min<std::uint64_t>(static_cast<std::uint64_t>(hit.v * kParts), kParts - 1);
        constexpr double kFraction = 1.0 / kParts;
        state = stateOf(i * kParts + j,
                        {static_cast<double>(i) * kFraction, static_cast<double>(j) * kFraction, kFraction}, kMany);
    }
    return state != alone;
}

bool CoincidentFaces::mayHide(const RayView& world, const Hit& hit) {
    return ask(hiding_, world, hit, [](const RayInstance& instance, std::uint32_t, double cosine) {
        return cosine < 0 || !instance.mesh->solid;
    });
}

bool CoincidentFaces::mayTouchBodies(const TraceScene& scene, const Hit& hit) {
    return ask(touching_, *scene.world, hit, [&](const RayInstance&, std::uint32_t slot, double) {
        return slot != hit.instance && Media::isBody(scene, slot);
    });
}

bool isBackOfSolid(const TraceScene& scene, const Hit& hit, const Vec3f& direction) {
    return !hit.isCap() && glm::dot(direction, hit.normal) > 0 && hidesBacks(scene, hit.instance);
}

Hit frontOf(const TraceScene& scene, const RayView& world, const Ray& ray, const Hit& hit, RayKind kind) {
    if (!isBackOfSolid(scene, hit, ray.direction)) return hit;
    if (scene.coincident && !scene.coincident->mayHide(*scene.world, hit)) return hit;
    const Hit front = world.frontOfCoincident(ray, hit, kind);
    return front ? front : hit;
}

void flipToFronts(const TraceScene& scene, const RayPacket16& rays, SurfacePacket& out) {
    using namespace simd;
    if (out.oneInstance && !hidesBacks(scene, out.hits.instance[0])) return;
    std::uint32_t behind = 0;
    for (int at = 0; at < 16; at += 8) {
        const PacketHits16& hits = out.hits;
        const F8 along = load(rays.directionX + at) * load(hits.normalX + at) +
                         load(rays.directionY + at) * load(hits.normalY + at) +
                         load(rays.directionZ + at) * load(hits.normalZ + at);
        behind |= laneBits(along > 0.0f) << at;
    }
    std::uint32_t last = kNoInstance;
    bool hides = false;
    for (std::uint32_t rest = behind & out.mask & ~out.caps; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const std::uint32_t instance = out.hits.instance[lane];
        if (instance != last) last = instance, hides = hidesBacks(scene, instance);
        if (!hides) continue;
        const Hit met = scene.world->hit(rays, lane);
        const Hit front = frontOf(scene, *scene.world, rays.ray(lane), met);
        if (front.instance == met.instance && front.triangle == met.triangle) continue;
        out.oneInstance &= front.instance == met.instance;
        out.hits.instance[lane] = front.instance, out.hits.triangle[lane] = front.triangle;
        out.hits.u[lane] = front.u, out.hits.v[lane] = front.v;
        out.hits.normalX[lane] = front.normal.x, out.hits.normalY[lane] = front.normal.y;
        out.hits.normalZ[lane] = front.normal.z;
    }
}

}  // namespace rtsg::trace
