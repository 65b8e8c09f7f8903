// PrimaryRays: the resting part of the hits of a view's rays.
#include "primary_rays.h"

#include "ray_view_impl.h"

namespace rtsg {

PrimaryRays::PrimaryRays(const RayView& view, const bvh::PixelGrid& grid, RayKind kind, int samples)
    : view_(view), kind_(kind), hits_(view.tables_->top.primaryHits(grid, view.meant(kind), samples)) {}

}  // namespace rtsg
