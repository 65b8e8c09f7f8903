// LargeRays: what of a view is large, where no lines, points or filters have a say.
#include "large_rays.h"

#include "ray_view_impl.h"

namespace rtsg {

LargeRays::LargeRays(const RayView& view, const Sides& sides, RayKind kind) {
    const RayKind meant = view.meant(kind);
    if (view.filter_ || view.seesStrokes(meant)) return;
    // Merged triangles were turned inside out by a mirroring.
    const auto asMerged = [&](std::uint32_t slot) {
        const std::uint32_t own = sides(slot);
        return view.instance(slot).sign < 0 && (own == kFront || own == kBack) ? own ^ (kFront | kBack) : own;
    };
    triangles_ = view.tables_->top.largeTriangles(meant, asMerged);
}

}  // namespace rtsg
