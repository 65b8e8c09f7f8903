// ClearPath: finds the surfaces that shadow rays pass before something stops them, in one traversal and not from hit to
// hit.
//
// Invariant: a surface counts once. Surfaces in one place count as one, such as triangles that share the edge which a
// ray goes through, as they do for a ray that leaves each surface that it meets. Threading: one thread's. The view must
// outlive it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <rtsg/renderers/ray_view.h>

#include "embree/passed_hits.h"

namespace rtsg {

class ClearPath {
  public:
    /// `passes(asked, slot)`: whether rays may continue behind a hit on a slot.
    ClearPath(const RayView& view, bvh::PassedHits::Passes passes, const void* asked)
        : view_(view), passed_(passes, asked) {}

    /// To be called once. A bit for each active lane that something stops. `unknown`: for each of which it does not
    /// tell, for filters, lines, points or so many hits that they have no room; these are as if they had not been
    /// traced, but for tMax.
    std::uint32_t find(RayPacket16& rays, bool coherent, RayKind kind, std::uint32_t& unknown) {
        return view_.occludedBut(rays, coherent, kind, passed_, unknown);
    }
    /// Whether a lane that is neither stopped nor unknown passes anything.
    bool passesAny(int lane) const { return passed_.count[lane] > 0; }
    /// Calls visit(hit, others) for all that it passes, in the order in which the ray meets it, as long as that says
    /// true. `others`: the surfaces in the same place, which do not count by themselves.
    template <class Visit>
    void visit(const Ray& ray, int lane, const Visit& visit) {
        sort(lane);
        const bvh::RawHit* const hits = passed_.hits[lane];
        const std::uint32_t count = passed_.count[lane];
        std::vector<Hit> others;
        for (std::uint32_t i = 0; i < count;) {
            const Hit hit = view_.hit(hits[i]);
            others.clear();
            if (++i < count) {
                const Vec3f start = RayView::leave(view_.point(hit), ray.direction);
                for (; i < count; ++i) {
                    const Hit other = view_.hit(hits[i]);
                    if (isAhead(view_.point(other), start, ray.direction)) break;
                    others.push_back(other);
                }
            }
            if (!visit(hit, std::span<const Hit>(others))) return;
        }
    }

  private:
    /// Whether a ray from `start` meets the surface that the point is on.
    static bool isAhead(const HitPoint& point, const Vec3f& start, const Vec3f& direction) {
        const float away = glm::dot(point.position - start, point.normal);
        return glm::dot(direction, point.normal) < 0 ? away < 0 : away > 0;
    }
    /// By distance; surfaces at the same distance are in an order that does not depend on how they were found.
    void sort(int lane);

    const RayView& view_;
    bvh::PassedHits passed_;
};

}  // namespace rtsg
