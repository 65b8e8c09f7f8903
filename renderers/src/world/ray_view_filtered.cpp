// Applies filters: rays go on behind places that are left out, and caps close the bodies that are cut. Looking for caps
// allocates.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "mesh/exact_meeting.h"
#include "ray_view_impl.h"

namespace rtsg {

namespace {

/// Stores a hit as if the lane of a packet had met it; its tMax is set elsewhere.
void store(const Hit& hit, RayPacket16& rays, int lane) {
    rays.u_[lane] = hit.u, rays.v_[lane] = hit.v;
    rays.normalX_[lane] = hit.normal.x, rays.normalY_[lane] = hit.normal.y, rays.normalZ_[lane] = hit.normal.z;
    rays.prim_[lane] = hit.triangle, rays.geom_[lane] = hit.instance, rays.inst_[lane] = bvh::StrokeView::kResolved;
}

bool isLeftOut(const RayFilter& filter, const Hit& hit, const Ray& ray) {
    return filter.leavesOutAlong(hit.instance, ray.origin, ray.direction, hit.t);
}

exact::Triangle inRaySpace(const RayInstance& instance, std::uint32_t triangle) {
    const glm::dmat4x3 m(instance.rayFromLocal);
    const auto corner = [&](std::uint32_t i) { return m * glm::dvec4(Vec3d(instance.mesh->vertex(triangle, i)), 1); };
    return {corner(0), corner(1), corner(2)};
}

/// The normal that Hit::normal has.
Vec3f outwards(const RayInstance& instance, std::uint32_t triangle) {
    const Vec3d a(instance.mesh->vertex(triangle, 0)), b(instance.mesh->vertex(triangle, 1)),
        c(instance.mesh->vertex(triangle, 2));
    const Vec3d normal = glm::dmat3(instance.normalFromLocal) * glm::cross(b - a, c - a);
    const double length = glm::length(normal);
    return length > 0 ? Vec3f(normal / length) : Vec3f(0, 0, 1);
}

/// How far from a place rounded numbers may put what is there, of a ray that comes from `from`.
float roundingAt(const Vec3f& from, const Vec3f& at) {
    const Vec3f sizes = glm::max(glm::abs(from), glm::abs(at));
    return 0x1p-20f * std::max({sizes.x, sizes.y, sizes.z}) + 1e-30f;
}

/// Calls `tell(hit)` for all triangles that the ray meets at `t`, give or take `radius` from their planes.
template <class Tell>
void visitPlace(const RayView& view, const bvh::TopView& top, const Ray& ray, float t, float radius, RayKind kind,
                const Tell& tell) {
    const Vec3d from(ray.origin), along(ray.direction);
    const double length = glm::length(along);
    top.visitNear(ray.origin + t * ray.direction, radius, [&](std::uint32_t slot, std::uint32_t triangle) {
        const RayInstance& instance = view.instance(slot);
        if (!(kindsOf(instance.info) & static_cast<std::uint32_t>(kind))) return radius;
        const exact::Triangle corners = inRaySpace(instance, triangle);
        const auto m = exact::meet(corners, from, along / length);
        constexpr double kEdge = 1e-9;  // so that no ray slips between two triangles
        if (!m || !m->isInside(kEdge)) return radius;
        // Planes that lie as close as `radius` are farther apart along a ray that grazes them.
        const Vec3d normal = glm::cross(corners.b - corners.a, corners.c - corners.a);
        const double steep = std::abs(glm::dot(normal, along)) / (glm::length(normal) * length);
        if (std::abs(m->distance - t * length) * std::max(steep, 0x1p-10) > radius) return radius;
        const float u = std::clamp(static_cast<float>(m->where.u), 0.0f, 1.0f);
        const float v = std::clamp(static_cast<float>(m->where.v), 0.0f, 1 - u);
        tell(Hit{static_cast<float>(m->distance / length), slot, triangle, u, v, outwards(instance, triangle)});
        return radius;
    });
}

}  // namespace

Hit RayView::intersectFiltered(Ray ray, RayKind kind) const {
    // From each place that is left out on to the next. The start moves along the ray; from the same start a hit at the
    // same place could come back for ever.
    constexpr int kMost = 10'000;
    for (int i = 0; i < kMost; ++i) {
        const Hit hit = intersectAll(ray, kind);
        if (!hit || !filter_->concerns(hit.instance) || !isLeftOut(*filter_, hit, ray)) return hit;
        if (const Hit other = meetInPlace(ray, hit, kind)) return other;
        ray.tMin = std::nextafter(hit.t * (1 + 0x1p-22f), HUGE_VALF);
        if (!(ray.tMin < ray.tMax) || !std::isfinite(ray.tMin)) return {};
    }
    return {};
}

Hit RayView::meetInPlace(const Ray& ray, const Hit& leftOut, RayKind kind) const {
    // A ray reports one of several surfaces that coincide; which one depends on rounding. A surface that is left out
    // must hide nothing, so all surfaces around its place are met one by one, in double precision.
    const Vec3f at = ray.origin + leftOut.t * ray.direction;
    float radius = roundingAt(ray.origin, at);
    if (!leftOut.isCap()) radius += 2 * glm::length(point(leftOut).error);

    Hit best;
    const Bounds& kept = filter_->keptBounds();
    if (glm::any(glm::lessThan(at + radius, kept.min)) || glm::any(glm::greaterThan(at - radius, kept.max)))
        return best;
    const auto take = [&](const Hit& found) {
        const bool hidden = filter_->concerns(found.instance) && isLeftOut(*filter_, found, ray);
        if (!hidden && found.t >= ray.tMin && found.t <= ray.tMax && found.t < best.t) best = found;
    };
    visitPlace(*this, tables_->top, ray, leftOut.t, radius, kind, take);
    if (seesStrokes(kind)) {
        Ray near = ray;
        const float reach = radius / glm::length(ray.direction);
        near.tMin = std::max(ray.tMin, leftOut.t - reach), near.tMax = std::min(ray.tMax, leftOut.t + reach);
        Hit stroke;
        meetStrokes(near, kind, stroke);
        if (stroke) take(stroke);
    }
    return best;
}

Hit RayView::frontInPlace(const Ray& ray, const Hit& back, RayKind kind) const {
    const float radius =
        roundingAt(ray.origin, ray.origin + back.t * ray.direction) + 2 * glm::length(point(back).error);
    Hit best;
    visitPlace(*this, tables_->top, ray, back.t, radius, meant(kind), [&](const Hit& found) {
        const bool isBack = glm::dot(found.normal, ray.direction) > 0;
        if ((isBack && instances_[found.instance].mesh->solid) || found.t < ray.tMin || !(found.t < best.t)) return;
        if (!filter_ || !filter_->concerns(found.instance) || !isLeftOut(*filter_, found, ray)) best = found;
    });
    return best;
}

std::uint32_t RayView::filterHits(RayPacket16& rays, std::uint32_t hits, std::uint32_t asked, const float* tMax,
                                  RayKind kind) const {
    // Rays that run together meet few instances: each is asked about once, as long as they meet the same.
    std::uint32_t inst = 0, geom = 0;
    bool known = false, concerned = false;
    for (std::uint32_t rest = hits & asked; rest; rest &= rest - 1) {
        const int i = std::countr_zero(rest);
        if (!known || rays.inst_[i] != inst || rays.geom_[i] != geom) {
            inst = rays.inst_[i], geom = rays.geom_[i];
            const bool resolved = bvh::StrokeView::isResolved(inst);
            concerned = filter_->concerns(resolved ? geom : tables_->top.objectOf(inst).slotOf(geom));
            known = true;
        }
        if (!concerned) continue;
        const Hit first = hit(rays, i);
        Ray ray{{rays.originX[i], rays.originY[i], rays.originZ[i]},
                rays.tMin[i],
                {rays.directionX[i], rays.directionY[i], rays.directionZ[i]},
                rays.tMax[i]};
        if (!isLeftOut(*filter_, first, ray)) continue;
        ray.tMax = tMax[i];
        const Hit next = intersectFiltered(ray, kind);
        rays.tMax[i] = next ? next.t : tMax[i];
        if (!next) {
            rays.geom_[i] = kNoInstance;
            hits &= ~(1u << i);
            continue;
        }
        store(next, rays, i);
    }
    return filter_->makesCaps() ? meetCaps(rays, hits, asked, tMax, kind) : hits;
}

std::uint32_t RayView::bodyAround(const Vec3f& place, const Vec3f& direction, std::uint32_t plane, RayKind kind) const {
    // If the place is inside a closed body, a ray from there meets the back of that body first.
    constexpr int kMost = 10'000;
    std::vector<std::uint32_t> outside;
    const auto isBody = [&](const Hit& hit) {
        return filter_->isCapped(hit.instance, plane, place) &&
               std::ranges::find(outside, hit.instance) == outside.end() && instances_[hit.instance].mesh->isClosed();
    };
    Ray ray{place, 0, direction};
    for (int i = 0; i < kMost; ++i) {
        const Hit first = hit(tables_->top.intersect(ray, kind));
        if (!first) return kNoInstance;
        if (isBody(first) && glm::dot(first.normal, direction) > 0) return first.instance;
        // The back of one body may lie on the front of another, and it is chance which of them a ray tells.
        const float radius = roundingAt(place, place + first.t * direction) + 2 * glm::length(point(first).error);
        Hit back;
        std::vector<std::uint32_t> fronts;
        if (isBody(first)) fronts.push_back(first.instance);
        visitPlace(*this, tables_->top, ray, first.t, radius, kind, [&](const Hit& hit) {
            if (hit.t < 0 || !isBody(hit)) return;
            if (glm::dot(hit.normal, direction) <= 0)
                fronts.push_back(hit.instance);
            else if (hit.t < back.t)
                back = hit;
        });
        if (back) return back.instance;
        outside.insert(outside.end(), fronts.begin(), fronts.end());
        ray.tMin = std::nextafter(first.t * (1 + 0x1p-22f), HUGE_VALF);
        if (!std::isfinite(ray.tMin)) return kNoInstance;
    }
    return kNoInstance;
}

Hit RayView::meetCaps(const Ray& ray, const Hit& hit, RayKind kind) const {
    if (!filter_->makesCaps()) return hit;
    Ray before = ray;
    if (hit) before.tMax = std::min(ray.tMax, hit.t);
    RayFilter::Crossing crossing;
    crossing.t = ray.tMin;
    while (filter_->findNext(before, crossing)) {
        const Vec3f place = ray.origin + crossing.t * ray.direction;
        const std::uint32_t slot = bodyAround(place, ray.direction, crossing.plane, kind);
        if (slot != kNoInstance) return {crossing.t, slot, kCap, 0, 0, crossing.outwards};
    }
    return hit;
}

std::uint32_t RayView::meetCaps(RayPacket16& rays, std::uint32_t hits, std::uint32_t asked, const float* tMax,
                                RayKind kind) const {
    for (std::uint32_t rest = asked; rest; rest &= rest - 1) {
        const int i = std::countr_zero(rest);
        const Hit before = hits >> i & 1u ? hit(rays, i) : Hit{};
        Ray ray = rays.ray(i);
        ray.tMax = tMax[i];
        const Hit cap = meetCaps(ray, before, kind);
        if (!cap.isCap()) continue;
        rays.tMax[i] = cap.t;
        store(cap, rays, i);
        hits |= 1u << i;
    }
    return hits;
}

}  // namespace rtsg
