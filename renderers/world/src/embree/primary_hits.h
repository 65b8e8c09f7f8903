// PrimaryHits: the first hits of a pinhole picture's rays in a group, tile by tile of the picture.
//
// All rays start in one point, so the planes through it and a triangle's edges are the same for all of them, and a ray
// only has to tell on which side of three planes it runs; how near the triangle is (one over the depth) is one more
// plane. So a tile goes through the clusters that it may see from near to far, sets up sixteen triangles at once and
// asks of each which blocks of pixels it may be in and which pixels it is in, until nothing farther can be seen.
// Invariant: the answer of a tile does not depend on others, on threads or on the processor. Triangles that share an
// edge find the same number there with the other sign, and both take the pixels on it: nothing shows between them. The
// hit, its place and its distance are computed again from the triangle's corners, as for Embree's watertight rays.
// Threading: immutable once made; made by any thread, asked by any number. Source: Olano, Greer 1997 (homogeneous edge
// functions); Greene 1996 (coverage by tiles); Woop, Benthin, Wald 2013 (watertightness).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/renderers/ray.h>

#include "clusters.h"

namespace rtsg::bvh {

/// The rays of a picture: through the place (x, y), in pixels from its middle, rightwards and downwards, runs
/// `forward + right * (middleX + across * x) + up * (middleY - down * y)`.
struct PixelGrid {
    Vec3f eye, right, up, forward;
    float middleX, across, middleY, down;
    int width, height;
};

constexpr int kTilePixelsAside = 16;  // of sixteen blocks of four by four pixels, row by row, as their pixels

/// The places of one sample of a tile's pixels, in pixels from the tile's middle, by block and by pixel in the block.
struct alignas(64) TilePositions {
    float x[16][16], y[16][16];
};

/// The hits of one sample of a tile's pixels, by block and by pixel in the block.
struct alignas(64) TileHits {
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;
    float nearness[16][16];          // one over the depth; 0: nothing
    std::uint32_t triangle[16][16];  // cluster * Cluster::kTriangles + place in it
};

/// From points of the group, less the eye, to the depth, and to places in pixels from the picture's middle, rightwards
/// and downwards, times the depth. No numbers where the grid's axes span no space.
struct PictureRows {
    Vec3f x, y, depth;
    explicit PictureRows(const PixelGrid& grid);
    bool isSound() const;
};

/// A tile's rays: through the middle of the tile, and from a pixel to the next; and where its middle is, in pixels from
/// the picture's, and how far from where they are `rows` may take points that are in the tile.
struct TileFrame {
    Vec3f eye, middle, toRight, downwards;
    PictureRows rows;
    float x, y, margin;
    TileFrame(const PixelGrid& grid, const PictureRows& rows, int tileX, int tileY);
};

class PrimaryHits {
  public:
    /// Null: rays are quicker, as there are many triangles for so few pixels. `mask`: of the rays; `samples`: of a
    /// pixel, at least 1.
    static std::unique_ptr<const PrimaryHits> make(const Group& group, std::uint32_t mask, const PixelGrid& grid,
                                                   int samples = 1);

    /// False: so many clusters may be seen there that rays are quicker. `places`: as many as `hits`, within the pixels;
    /// null: of one sample, in the pixels' middles.
    bool find(int tileX, int tileY, std::span<TileHits> hits, const TilePositions* positions = nullptr) const;
    /// Sets the hits of a block's `valid` rays. Returns false if they cannot be found reliably: for rays that run
    /// within a triangle's plane to the last bit. Precondition: the rays are those of the grid; tMax of none is below
    /// the distance of surfaces that are cut off.
    bool meet(const TileHits& hits, int block, const std::int32_t* valid, RayPacket16& rays) const;

    /// A cluster that a tile may see, how near it is at most, and a bit for each block that it may be in.
    struct Seen {
        std::uint32_t cluster;
        float nearness;
        std::uint32_t blocks;
    };

  private:
    PrimaryHits(std::shared_ptr<const Clusters> clusters, const PixelGrid& grid, int samples)
        : clusters_(std::move(clusters)),
          grid_(grid),
          rows_(grid),
          maximum_(kMax * static_cast<std::uint32_t>(std::min(samples, 4))) {}
    struct Found;
    std::vector<Found> project(const Group& group, std::uint32_t mask) const;
    bool list(const std::vector<Found>& found);
    int tilesX() const { return (grid_.width + kTilePixelsAside - 1) / kTilePixelsAside; }
    int tilesY() const { return (grid_.height + kTilePixelsAside - 1) / kTilePixelsAside; }

    std::shared_ptr<const Clusters> clusters_;
    PixelGrid grid_;
    PictureRows rows_;
    struct List {
        std::uint32_t first = 0, count = 0;  // of `seen_`; more than kMax: left to rays
    };
    static constexpr std::uint32_t kMax = 256;  // for one sample
    std::uint32_t maximum_;
    std::vector<List> lists_;  // by tile
    std::vector<Seen> seen_;
};

/// A block of a tile that is known.
struct PrimaryBlock {
    const PrimaryHits& picture;
    const TileHits& tile;
    int block;
    bool meet(const std::int32_t* valid, RayPacket16& rays) const { return picture.meet(tile, block, valid, rays); }
};

/// The kernels for the machine's width of registers.
struct PrimaryKernels {
    void (*find)(const TileFrame& frame, const PrimaryHits::Seen* seen, const PrimaryHits::Seen* end,
                 const Cluster* clusters, const ClusteredMesh* meshes, const TilePositions* positions, TileHits* hits,
                 std::size_t samples);
    bool (*meet)(const TileHits& hits, int block, const std::int32_t* valid, const Cluster* clusters,
                 const ClusteredMesh* meshes, RayPacket16& rays);
};
const PrimaryKernels& primaryKernels8();
/// Null where this build or machine has none.
const PrimaryKernels* primaryKernels16();

}  // namespace rtsg::bvh
