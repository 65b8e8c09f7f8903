// Applies filters: rays go on behind places that are left out, and caps close the bodies that are cut. Looking for caps
// allocates.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "coincident_faces.h"
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

/// Those that rays of a kind meet.
auto nearOf(const RayView& view, const bvh::TopView& top, RayKind kind) {
    return [&view, &top, kind](const Vec3f& center, float radius, const NearVisitor& visit) {
        top.visitNear(center, radius, [&](std::uint32_t slot, std::uint32_t triangle) {
            const bool counts = kindsOf(view.instance(slot).info) & static_cast<std::uint32_t>(kind);
            return counts ? visit(slot, triangle) : radius;
        });
    };
}

}  // namespace

Hit RayView::intersectFiltered(Ray ray, RayKind kind) const {
    // From each place that is left out on to the next. The start moves along the ray; from the same start a hit at the
    // same place could come back for ever.
    constexpr int kMax = 10'000;
    for (int i = 0; i < kMax; ++i) {
        const Hit hit = intersectAll(ray, kind);
        if (!hit || !filter_->concerns(hit.instance) || !isLeftOut(*filter_, hit, ray)) return hit;
        if (const Hit other = meetCoincident(ray, hit, kind)) return other;
        ray.tMin = std::nextafter(hit.t * (1 + 0x1p-22f), HUGE_VALF);
        if (!(ray.tMin < ray.tMax) || !std::isfinite(ray.tMin)) return {};
    }
    return {};
}

Hit RayView::meetCoincident(const Ray& ray, const Hit& leftOut, RayKind kind) const {
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
    visitCoincident(*this, nearOf(*this, tables_->top, kind), ray, leftOut.t, radius, take);
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

Hit RayView::frontOfCoincident(const Ray& ray, const Hit& back, RayKind kind) const {
    const float radius =
        roundingAt(ray.origin, ray.origin + back.t * ray.direction) + 2 * glm::length(point(back).error);
    Hit best;
    visitCoincident(*this, nearOf(*this, tables_->top, meant(kind)), ray, back.t, radius, [&](const Hit& found) {
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

std::uint32_t RayView::bodyAround(const Vec3f& position, const Vec3f& direction, std::uint32_t plane,
                                  RayKind kind) const {
    // If the place is inside a closed body, a ray from there meets the back of that body first.
    constexpr int kMax = 10'000;
    std::vector<std::uint32_t> outside;
    const auto isBody = [&](const Hit& hit) {
        return filter_->isCapped(hit.instance, plane, position) &&
               std::ranges::find(outside, hit.instance) == outside.end() && instances_[hit.instance].mesh->isClosed();
    };
    Ray ray{position, 0, direction};
    for (int i = 0; i < kMax; ++i) {
        const Hit first = hit(tables_->top.intersect(ray, kind));
        if (!first) return kNoInstance;
        if (isBody(first) && glm::dot(first.normal, direction) > 0) return first.instance;
        // The back of one body may lie on the front of another, and it is chance which of them a ray tells.
        const float radius = roundingAt(position, position + first.t * direction) + 2 * glm::length(point(first).error);
        Hit back;
        std::vector<std::uint32_t> fronts;
        if (isBody(first)) fronts.push_back(first.instance);
        visitCoincident(*this, nearOf(*this, tables_->top, kind), ray, first.t, radius, [&](const Hit& hit) {
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
        const Vec3f position = ray.origin + crossing.t * ray.direction;
        const std::uint32_t slot = bodyAround(position, ray.direction, crossing.plane, kind);
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
