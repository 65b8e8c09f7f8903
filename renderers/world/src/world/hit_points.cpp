// Computes the point of a hit, with bounds on its error, and the start of a ray that leaves it.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "ray_view_impl.h"

namespace rtsg {

HitPoint RayView::point(const Hit& hit) const {
    HitPoint result;
    result.normal = hit.normal;
    if (!hit) return result;
    const RayInstance& instance = instances_[hit.instance];
    const Mesh& mesh = *instance.mesh;
    const float w = 1 - hit.u - hit.v;
    const Vec3f a = w * mesh.vertex(hit.triangle, 0), b = hit.u * mesh.vertex(hit.triangle, 1),
                c = hit.v * mesh.vertex(hit.triangle, 2);
    const Vec3f local = a + b + c, size = glm::abs(a) + glm::abs(b) + glm::abs(c);
    const glm::mat4x3& m = instance.rayFromLocal;
    result.position = m * Vec4f(local, 1);
    // gamma(n) = n eps / (1 - n eps) bounds n roundings (Higham; pbrt-v4, section 6.8.1): four for the barycentric sum,
    // four for the transform here, and as many again for how the ray met the triangle: rounded into ray space, or
    // through a transformed ray, whose errors the condition of the matrix magnifies on their way back.
    constexpr float eps = 0x1p-24f, gamma = 12 * eps / (1 - 12 * eps);
    const Vec3f linear = glm::abs(m[0]) * size.x + glm::abs(m[1]) * size.y + glm::abs(m[2]) * size.z;
    result.error = (linear * instance.errorScale + glm::abs(m[3])) * gamma + instance.errorFloor;
    return result;
}

HitPoint RayView::point(const Hit& hit, const Ray& ray) const {
    const bool stroke = hit && !hit.isCap() && instances_[hit.instance].mesh->strokeCount > 0;
    if (hit && !hit.isCap() && !stroke) return point(hit);
    const Vec3f displacement = hit.t * ray.direction, position = ray.origin + displacement;
    // Far enough towards the axis not to hit it again, and not as far as the surface that it lies in.
    if (stroke)
        return {position, glm::abs(hit.normal) * (bvh::kTie * (glm::length(ray.origin) + glm::length(position))),
                hit.normal};
    // The place is as exact as the ray's start and the way from there are; a cap's plane is not known better.
    constexpr float eps = 0x1p-24f;
    const Vec3f sizes = glm::abs(ray.origin) + glm::abs(displacement);
    return {position, Vec3f(16 * eps * std::max({sizes.x, sizes.y, sizes.z})), hit.normal};
}

namespace {

/// Half, in pixels, at a place so far from the eye.
float halfWidthOf(const StrokeStyle& style, bool isPoint, float distance) {
    if (!isPoint) return .5f * style.lineWidth;
    if (!style.attenuated()) return .5f * style.pointSize;
    const Vec3f& a = style.attenuation;
    const float fall = a.x + distance * (a.y + distance * a.z);
    return .5f * std::min(std::max(style.pointSize / std::max(fall, 1e-6f), style.minimum), style.maximum);
}

}  // namespace

HitPoint RayView::strokePoint(const Hit& hit, const Vec3f& normal) const {
    const RayInstance& instance = instances_[hit.instance];
    HitPoint result = point(hit);
    result.normal = normal;
    Vec3f from = result.position - lens_.eye, ahead = lens_.forward;
    float stretch = 1;  // how far a step of 1 in the eye's space leads along the normal in this one
    if (lens_.toSquare) {
        from = *lens_.toSquare * from, ahead = Vec3f(0, 0, -1);
        stretch = glm::length(glm::transpose(glm::inverse(*lens_.toSquare)) * normal);
    }
    const float far = glm::length(from), depth = glm::dot(from, ahead);
    const float pixel = lens_.spread * std::max(std::abs(depth), .5f * far) + lens_.size;
    static const StrokeStyle plain;
    const bool isPoint = instance.mesh->strokes == Mesh::Strokes::points;
    const float half = halfWidthOf(instance.info.strokes ? *instance.info.strokes : plain, isPoint, far);
    constexpr float kBeyond = 1.05f;
    result.error += glm::abs(normal) * (kBeyond * half * pixel * stretch);
    return result;
}

namespace {

/// Does what std::nextafter() does towards one of the infinities, without a call.
float nextFloat(float x, bool up) {
    if (x == 0) return up ? std::numeric_limits<float>::denorm_min() : -std::numeric_limits<float>::denorm_min();
    if (!(std::abs(x) <= std::numeric_limits<float>::max())) return x;
    return std::bit_cast<float>(std::bit_cast<std::int32_t>(x) + ((x > 0) == up ? 1 : -1));
}

}  // namespace

Vec3f RayView::leave(const HitPoint& from, const Vec3f& direction) {
    // pbrt-v4, section 6.8.6: far enough along the normal to clear the box of the error, then one float further.
    const float distance = glm::dot(glm::abs(from.normal), from.error);
    const Vec3f away = glm::dot(direction, from.normal) < 0 ? -from.normal : from.normal;
    Vec3f start = from.position + distance * away;
    for (int i = 0; i < 3; ++i) {
        if (away[i] == 0) continue;
        start[i] = nextFloat(start[i], away[i] > 0);
        // On a plane through 0 nothing is rounded and the next float is one that the processor may take for 0.
        constexpr float minimum = 1e-30f;
        if (std::abs(start[i]) < minimum) start[i] = std::copysign(minimum, away[i]);
    }
    return start;
}

}  // namespace rtsg
