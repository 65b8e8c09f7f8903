// LargeRays: hits on the large triangles of a view, if no lines, points or filters are involved.
#include "large_rays.h"

#include "ray_view_impl.h"

namespace rtsg {

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
