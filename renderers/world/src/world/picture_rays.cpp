// What a picture's rays are asked before the trees: the hits of its pixels, and the few large triangles.
#include "large_rays.h"
#include "primary_rays.h"
#include "ray_view_impl.h"

namespace rtsg {

PrimaryRays::PrimaryRays(const RayView& view, const bvh::PixelGrid& grid, RayKind kind, int samples)
    : view_(view), kind_(kind), hits_(view.tables_->top.primaryHits(grid, view.meant(kind), samples)) {}

LargeRays::LargeRays(const RayView& view, const Visitor& report, RayKind kind) {
    const RayKind meant = view.meant(kind);
    if (view.filter_ || view.seesStrokes(meant)) return;
    triangles_ = view.tables_->top.largeTriangles(meant, [&](std::uint32_t slot) {
        About about = report(slot);
        about.isMirrored = view.instance(slot).sign < 0;
        return about;
    });
}

}  // namespace rtsg
