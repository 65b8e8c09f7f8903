// LargeRays: tests rays against a view's few large triangles before the trees are used.
//
// Rays that stay open are to be traced by the view. So the results are those of RayView::intersect and occluded, except
// for the last bits of numbers. Whether all this pays is counted from surfaces alone, so pictures are the same in every
// run. Threading: made by one thread, asked by any number. The view must outlive it and stay as it is.
#pragma once

#include <memory>

#include <rtsg/renderers/ray_view.h>

#include "embree/large_triangles.h"

namespace rtsg {

class LargeRays {
  public:
    using About = bvh::LargeTriangles::About;
    using Visitor = bvh::LargeTriangles::Visitor;
    static constexpr std::uint32_t kFront = bvh::LargeTriangles::kFront, kBack = bvh::LargeTriangles::kBack;
    /// `tell`: of an instance, by slot; but for `isMirrored`, which is known here.
    LargeRays(const RayView& view, const Visitor& report, RayKind kind = RayKind::view);

    /// Whether asking them pays at all.
    explicit operator bool() const { return triangles_ != nullptr; }
    // Call the functions of LargeTriangles. Precondition: it pays. Rays are finite and start within the range that a
    // view accepts.
    std::uint32_t intersect(const bvh::RayRows& rows, RayPacket16& rays, bvh::LargeHits& hits,
                            std::uint32_t& open) const {
        return triangles_->intersect(rows, rays, hits, open);
    }
    std::uint32_t occluded(const bvh::RayRows& rows, std::uint32_t& open) const {
        return triangles_->occluded(rows, open);
    }
    /// The table that the kernels read. Precondition: it pays.
    const bvh::LargeTable& table() const { return triangles_->table(); }

  private:
    std::unique_ptr<const bvh::LargeTriangles> triangles_;
};

}  // namespace rtsg
