// Boxes around instances, and sixteen rays against one, eight at a time.
#include "ray_boxes.h"

#include <algorithm>
#include <cmath>

#include "mesh/simd8.h"

namespace rtsg {

using namespace simd;

std::uint32_t meetBox(const RayPacket16& rays, const Bounds& box) {
    return meetBox(rays, rays.tMax, box);
}

std::uint32_t meetBox(const RayPacket16& rays, const float* tMax, const Bounds& box) {
    if (box.empty()) return 0;
    std::uint32_t met = 0;
    for (int at = 0; at < 16; at += 8) {
        F8 near = all(0), far = load(tMax + at);
        const float* origins[] = {rays.originX, rays.originY, rays.originZ};
        const float* directions[] = {rays.directionX, rays.directionY, rays.directionZ};
        for (int k = 0; k < 3; ++k) {
            const F8 o = load(origins[k] + at), d = load(directions[k] + at), tiny = all(1e-20f);
            const F8 inverse = 1.0f / select((d < tiny) & (d > -tiny), tiny, d);
            const F8 a = (box.min[k] - o) * inverse, b = (box.max[k] - o) * inverse;
            near = max(near, min(a, b)), far = min(far, max(a, b));
        }
        met |= laneBits(near <= far * 1.00001f) << at;
    }
    return met;
}

bool meetsBox(const Ray& ray, const Bounds& box) {
    if (box.empty()) return false;
    float near = 0, far = ray.tMax;
    for (int k = 0; k < 3; ++k) {
        const float d = std::abs(ray.direction[k]) < 1e-20f ? 1e-20f : ray.direction[k];
        const float a = (box.min[k] - ray.origin[k]) / d, b = (box.max[k] - ray.origin[k]) / d;
        near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
    }
    return near <= far * 1.00001f;
}

bool comeNear(const RayPacket16& rays, const Vec3f& middle, float radiusSquared) {
    constexpr float kSmaller = 1 - 0x1p-18f;  // for the rounding of distant things
    I8 near{};
    for (int at = 0; at < 16; at += 8) {
        const F8 x = middle.x - load(rays.originX + at), y = middle.y - load(rays.originY + at),
                 z = middle.z - load(rays.originZ + at), dx = load(rays.directionX + at),
                 dy = load(rays.directionY + at), dz = load(rays.directionZ + at);
        const F8 ahead = x * dx + y * dy + z * dz;
        const F8 outside = (x * x + y * y + z * z) * kSmaller - radiusSquared;
        const F8 squared = (dx * dx + dy * dy + dz * dz) * kSmaller;
        // Negated, so that values too large to be squared count as near.
        const I8 passes = ahead * ahead < outside * squared, behind = (ahead < 0.0f) & (outside > 0.0f);
        near |= ~(passes | behind);
    }
    return any(near);
}

Bounds boxAround(const RayInstance& instance) {
    const Bounds& local = instance.mesh->bounds;
    const glm::mat4x3& m = instance.rayFromLocal;
    const Vec3f center = m * Vec4f(local.center(), 1), half = .5f * local.size();
    const Vec3f reach = glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z;
    const Vec3f slack = (glm::abs(center) + reach) * 0x1p-18f + instance.errorFloor;
    Bounds box;
    box.extend(center - reach - slack), box.extend(center + reach + slack);
    return box;
}

}  // namespace rtsg
