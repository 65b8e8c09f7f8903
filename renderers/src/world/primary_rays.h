// PrimaryRays: the rays of a pinhole's picture, which find what they meet together, tile by tile.
//
// What does not rest, lines, points and what filters say follow ray by ray, as for all others; so what is found is what
// RayView::intersect finds, but for the last bits of numbers and of edges. Threading: made by one thread, asked by any
// number. The view must outlive it and stay as it is.
#pragma once

#include <memory>

#include <rtsg/renderers/ray_view.h>

#include "embree/primary_hits.h"

namespace rtsg {

class PrimaryRays {
  public:
    /// `samples`: of a pixel.
    PrimaryRays(const RayView& view, const bvh::PixelGrid& grid, RayKind kind = RayKind::view, int samples = 1);

    /// Whether tiles pay at all.
    explicit operator bool() const { return hits_ != nullptr; }
    /// What the tile's pixels see of what rests. False: ray by ray it is quicker. Precondition: they pay.
    /// `places`: as many as `samples`; null: of one, in the middles of pixels.
    bool find(int tileX, int tileY, std::span<bvh::TileHits> samples, const bvh::TilePlaces* places = nullptr) const {
        return hits_->find(tileX, tileY, samples, places);
    }
    /// As RayView::intersect, of a block's rays.
    std::uint32_t intersect(RayPacket16& rays, const bvh::TileHits& tile, int block) const {
        const bvh::PrimaryBlock known{*hits_, tile, block};
        return view_.intersect(rays, true, kind_, &known);
    }

  private:
    const RayView& view_;
    RayKind kind_;
    std::unique_ptr<const bvh::PrimaryHits> hits_;
};

}  // namespace rtsg
