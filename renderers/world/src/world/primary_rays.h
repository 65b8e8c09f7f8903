// PrimaryRays: the rays of a pinhole picture, whose hits are found together, tile by tile.
//
// Moving things, lines, points and filters are then treated ray by ray, as for all other rays. So the results are those
// of RayView::intersect, except for the last bits of numbers and of edges. Tiles that see too many clusters go ray by
// ray altogether, by counts alone, so that pictures are the same in every run. Threading: made by one thread, asked by
// any number. The view must outlive it and stay as it is.
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
    /// Finds the resting surfaces that a tile's pixels see. False: single rays are quicker. Precondition: tiles pay.
    /// `places` has one entry for each of `samples`; null: there is one sample, in the middles of pixels.
    bool find(int tileX, int tileY, std::span<bvh::TileHits> samples,
              const bvh::TilePositions* positions = nullptr) const {
        return hits_->find(tileX, tileY, samples, positions);
    }
    /// Does what RayView::intersect does, for the rays of a block.
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
