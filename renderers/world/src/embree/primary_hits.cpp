// Finds the clusters that a picture's tiles may see, by their boxes, ordered from near to far.
#include "primary_hits.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#include <rtsg/renderers/parallel_for.h>

#include "bvh.h"
#include "mesh/lanes8.h"
#include "primary_kernels_impl.h"

namespace rtsg::bvh {

const PrimaryKernels& primaryKernels8() {
    static constexpr const PrimaryKernels& table = PrimaryKernelsOf<simd::Lanes8>::kTable;
    return table;
}

namespace {

const PrimaryKernels& kernels() {
    static const PrimaryKernels& chosen = primaryKernels16() ? *primaryKernels16() : primaryKernels8();
    return chosen;
}

// A cluster costs a picture about as much as a ray saves it; a small share of that may be lost.
constexpr std::size_t kRaysPerCluster = 5;

/// An interval that holds all values of a row over a box.
struct Range {
    float low, high;
    Range(const Vec3f& row, const Vec3f& middle, const Vec3f& half) {
        const Vec3f size = glm::abs(row);
        const float at = glm::dot(row, middle), reach = glm::dot(size, half);
        const float rounding = 0x1p-20f * (glm::dot(size, glm::abs(middle)) + reach);
        low = at - reach - rounding, high = at + reach + rounding;
    }
    /// Divides by a value of another range of positive numbers.
    Range over(const Range& depth) const {
        Range result = *this;
        result.low /= low < 0 ? depth.low : depth.high;
        result.high /= high > 0 ? depth.low : depth.high;
        return result;
    }
};

constexpr int kBlockAside = 4, kBlocksAside = kTilePixelsAside / kBlockAside;  // in pixels; of a tile

/// The blocks of an interval of pixels, the last one not included.
std::pair<int, int> blocksOf(const Range& pixels, int size) {
    constexpr float kMargin = .02f;
    const float middle = static_cast<float>(size) / 2;
    const float first = std::floor((pixels.low - kMargin + middle) / kBlockAside),
                last = std::floor((pixels.high + kMargin + middle) / kBlockAside);
    const int blocks = (size + kBlockAside - 1) / kBlockAside;
    const auto all = static_cast<float>(blocks);
    return {static_cast<int>(std::clamp(first, 0.0f, all)), static_cast<int>(std::clamp(last + 1, 0.0f, all))};
}

/// Those of a tile in a row or a column of blocks: a bit each.
std::uint32_t blocksIn(int tile, int first, int end) {
    const int from = std::max(first - tile * kBlocksAside, 0), to = std::min(end - tile * kBlocksAside, kBlocksAside);
    return (1u << to) - (1u << from);
}

}  // namespace

PictureRows::PictureRows(const PixelGrid& grid) {
    const glm::dmat3 rows =
        glm::transpose(glm::inverse(glm::dmat3(Vec3d(grid.right), Vec3d(grid.up), Vec3d(grid.forward))));
    x = Vec3f((rows[0] - double{grid.middleX} * rows[2]) / double{grid.across});
    y = Vec3f((double{grid.middleY} * rows[2] - rows[1]) / double{grid.down});
    depth = Vec3f(rows[2]);
}

bool PictureRows::isSound() const {
    const Vec3f sum = glm::abs(x) + glm::abs(y) + glm::abs(depth);
    return std::isfinite(sum.x + sum.y + sum.z);
}

TileFrame::TileFrame(const PixelGrid& grid, const PictureRows& toPicture, int tileX, int tileY)
    : eye(grid.eye), toRight(grid.right * grid.across), downwards(-grid.up * grid.down), rows(toPicture) {
    const auto middleOf = [](int tile, int size) {
        constexpr int kHalf = kTilePixelsAside / 2;
        return static_cast<float>(tile * kTilePixelsAside + kHalf) - static_cast<float>(size) / 2;
    };
    x = middleOf(tileX, grid.width), y = middleOf(tileY, grid.height);
    middle = grid.forward + grid.right * (grid.middleX + grid.across * x) + grid.up * (grid.middleY - grid.down * y);
    // A point's coordinates are at most this for its depth.
    const Vec3f reach =
        glm::abs(middle) + static_cast<float>(kTilePixelsAside) * (glm::abs(toRight) + glm::abs(downwards));
    const Vec3f size = glm::abs(rows.x) + glm::abs(rows.y) + (std::abs(x) + std::abs(y)) * glm::abs(rows.depth);
    margin = .01f + 0x1p-20f * glm::dot(size, reach);
}

/// A cluster in the picture: the blocks that it may be in, the last ones not included.
struct PrimaryHits::Found {
    float nearness = 0;
    std::uint32_t cluster = 0;
    std::uint16_t left = 0, right = 0, top = 0, bottom = 0;
    /// Calls `visit` with the column and the row of each tile.
    void forTiles(const auto& visit) const {
        for (int y = top / kBlocksAside; y * kBlocksAside < bottom; ++y)
            for (int x = left / kBlocksAside; x * kBlocksAside < right; ++x) visit(x, y);
    }
    std::size_t tiles() const {
        const auto count = [](int first, int end) { return (end - 1) / kBlocksAside - first / kBlocksAside + 1; };
        return std::size_t{1} * count(left, right) * count(top, bottom);
    }
    /// The bits of a tile's blocks.
    std::uint32_t blocks(int x, int y) const {
        // Sixteen bits by rows of four: each row's bits take the columns'.
        const std::uint32_t columns = blocksIn(x, left, right), rows = blocksIn(y, top, bottom);
        return columns * ((rows & 1) | (rows & 2) << 3 | (rows & 4) << 6 | (rows & 8) << 9);
    }
};

std::vector<PrimaryHits::Found> PrimaryHits::project(const Group& group, std::uint32_t mask) const {
    const std::vector<Cluster>& all = clusters_->all;
    std::vector<std::uint8_t> isMet(clusters_->meshes.size());
    for (std::uint32_t i = 0; i < isMet.size(); ++i) isMet[i] = (group.mask(i) & mask) != 0;
    const PictureRows& to = rows_;
    if (!to.isSound()) return {};
    std::vector<Found> found(all.size());
    constexpr std::size_t kTogether = 4096;
    parallelFor((all.size() + kTogether - 1) / kTogether, [&](std::size_t part) {
        for (std::size_t i = part * kTogether, end = std::min(i + kTogether, all.size()); i < end; ++i) {
            const Cluster& cluster = all[i];
            if (!isMet[cluster.mesh]) continue;
            const Vec3f half = .5f * (cluster.upper - cluster.lower), middle = cluster.lower + half - grid_.eye;
            const Range depth(to.depth, middle, half);
            if (!(depth.high > 0)) continue;
            Found& f = found[i];
            f.cluster = static_cast<std::uint32_t>(i);
            std::pair<int, int> x{0, tilesX() * kBlocksAside}, y{0, tilesY() * kBlocksAside};
            if (depth.low > 1e-6f * depth.high) {
                f.nearness = (1 + 0x1p-20f) / depth.low;
                x = blocksOf(Range(to.x, middle, half).over(depth), grid_.width);
                y = blocksOf(Range(to.y, middle, half).over(depth), grid_.height);
            } else {
                f.nearness = HUGE_VALF;
            }
            f.left = static_cast<std::uint16_t>(x.first), f.right = static_cast<std::uint16_t>(x.second);
            f.top = static_cast<std::uint16_t>(y.first), f.bottom = static_cast<std::uint16_t>(y.second);
        }
    });
    std::erase_if(found, [](const Found& f) { return f.left >= f.right || f.top >= f.bottom; });
    return found;
}

namespace {

/// By falling nearness; of the same in the order in which they come.
template <class Found>
void sortFromNear(std::vector<Found>& found) {
    constexpr int kBits = 11;
    std::vector<Found> other(found.size());
    for (int shift = 0; shift < 33; shift += kBits) {
        std::size_t starts[(1 << kBits) + 1] = {};
        const auto digit = [&](const Found& f) {
            return (~std::bit_cast<std::uint32_t>(f.nearness) >> shift) & ((1u << kBits) - 1);
        };
        for (const Found& f : found) ++starts[digit(f) + 1];
        for (std::size_t i = 1; i < std::size(starts); ++i) starts[i] += starts[i - 1];
        for (const Found& f : found) other[starts[digit(f)]++] = f;
        found.swap(other);
    }
}

}  // namespace

bool PrimaryHits::list(const std::vector<Found>& found) {
    const auto across = static_cast<std::size_t>(tilesX());
    lists_.resize(across * static_cast<std::size_t>(tilesY()));
    std::size_t total = 0;
    for (const Found& f : found) total += f.tiles();
    // If tiles see this many clusters on average, nearly all of the tiles are left to rays.
    if (total > lists_.size() * maximum_) return false;
    const auto listOf = [&](int x, int y) -> List& {
        return lists_[static_cast<std::size_t>(y) * across + static_cast<std::size_t>(x)];
    };
    for (const Found& f : found) f.forTiles([&](int x, int y) { ++listOf(x, y).count; });
    std::size_t taken = 0;
    for (List& list : lists_) {
        list.first = static_cast<std::uint32_t>(taken);
        if (list.count <= maximum_) taken += std::exchange(list.count, 0);
    }
    seen_.resize(taken);
    for (const Found& f : found)
        f.forTiles([&](int x, int y) {
            List& list = listOf(x, y);
            if (list.count <= maximum_) seen_[list.first + list.count++] = {f.cluster, f.nearness, f.blocks(x, y)};
        });
    return true;
}

std::unique_ptr<const PrimaryHits> PrimaryHits::make(const Group& group, std::uint32_t mask, const PixelGrid& grid,
                                                     int samples) {
    const std::size_t rays = static_cast<std::size_t>(samples) * static_cast<std::size_t>(grid.width) *
                             static_cast<std::size_t>(grid.height);
    if (group.triangles() / Cluster::kTriangles * kRaysPerCluster > rays) return nullptr;
    std::unique_ptr<PrimaryHits> hits(new PrimaryHits(group.clusters(), grid, samples));
    if (hits->clusters_->all.size() * kRaysPerCluster > rays) return nullptr;
    std::vector<Found> found = hits->project(group, mask);
    if (found.empty()) return nullptr;
    sortFromNear(found);
    if (!hits->list(found)) return nullptr;
    return hits;
}

bool PrimaryHits::find(int tileX, int tileY, std::span<TileHits> hits, const TilePositions* positions) const {
    const List& list =
        lists_[static_cast<std::size_t>(tileY) * static_cast<std::size_t>(tilesX()) + static_cast<std::size_t>(tileX)];
    if (list.count > maximum_) return false;
    const TileFrame frame(grid_, rows_, tileX, tileY);
    const Seen* const first = seen_.data() + list.first;
    kernels().find(frame, first, first + list.count, clusters_->all.data(), clusters_->meshes.data(), positions,
                   hits.data(), hits.size());
    return true;
}

bool PrimaryHits::meet(const TileHits& hits, int block, const std::int32_t* valid, RayPacket16& rays) const {
    return kernels().meet(hits, block, valid, clusters_->all.data(), clusters_->meshes.data(), rays);
}

}  // namespace rtsg::bvh
