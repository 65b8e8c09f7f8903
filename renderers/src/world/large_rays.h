// LargeRays: rays that a view's few large triangles are asked about before its trees are.
//
// Of those that are left open the view tells; so what is found is what RayView::intersect and occluded find, but for
// the last bits of numbers. Threading: made by one thread, asked by any number. The view must outlive it and stay as it
// is.
#pragma once

#include <memory>

#include <rtsg/renderers/ray_view.h>

#include "embree/large_triangles.h"

namespace rtsg {

class LargeRays {
  public:
    using Sides = bvh::LargeTriangles::Sides;
    static constexpr std::uint32_t kFront = bvh::LargeTriangles::kFront, kBack = bvh::LargeTriangles::kBack;
    /// `sides`: of an instance, by slot, those that nothing comes through.
    LargeRays(const RayView& view, const Sides& sides, RayKind kind = RayKind::view);

    /// Whether asking them pays at all.
    explicit operator bool() const { return triangles_ != nullptr; }
    /// The active lanes that meet one of them first; those of `open` are to be traced. Precondition: it pays. Rays are
    /// finite and start within what a view takes.
    std::uint32_t intersect(RayPacket16& rays, std::uint32_t& open) const { return triangles_->intersect(rays, open); }
    /// The active lanes that something stands in the way of that nothing comes through; those of `open` are to be
    /// traced.
    std::uint32_t occluded(const RayPacket16& rays, std::uint32_t& open) const {
        return triangles_->occluded(rays, open);
    }

    /// What they are asked by. Precondition: it pays.
    const bvh::LargeTable& table() const { return triangles_->table(); }

  private:
    std::unique_ptr<const bvh::LargeTriangles> triangles_;
};

}  // namespace rtsg
