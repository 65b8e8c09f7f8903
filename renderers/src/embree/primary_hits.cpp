// Which clusters a picture's tiles may see, by their boxes, and from near to far.
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

/// Points of the group to places in the picture, times the depth, and to the depth.
struct Projection {
    Vec3f x, y, depth;

    /// Pixels from the picture's middle. No numbers where the axes span no space.
    explicit Projection(const PixelGrid& grid) {
        const glm::dmat3 rows =
            glm::transpose(glm::inverse(glm::dmat3(Vec3d(grid.right), Vec3d(grid.up), Vec3d(grid.forward))));
        x = Vec3f((rows[0] - double{grid.middleX} * rows[2]) / double{grid.across});
        y = Vec3f((double{grid.middleY} * rows[2] - rows[1]) / double{grid.down});
        depth = Vec3f(rows[2]);
    }
    bool isSound() const {
        const Vec3f sum = glm::abs(x) + glm::abs(y) + glm::abs(depth);
        return std::isfinite(sum.x + sum.y + sum.z);
    }
};

/// An interval that holds all values of a row over a box.
struct Range {
    float low, high;
    Range(const Vec3f& row, const Vec3f& middle, const Vec3f& half) {
        const Vec3f size = glm::abs(row);
        const float at = glm::dot(row, middle), reach = glm::dot(size, half);
        const float rounding = 0x1p-20f * (glm::dot(size, glm::abs(middle)) + reach);
        low = at - reach - rounding, high = at + reach + rounding;
    }
    /// Divided by what lies in another one, of positive numbers.
    Range over(const Range& depth) const {
        Range result = *this;
        result.low /= low < 0 ? depth.low : depth.high;
        result.high /= high > 0 ? depth.low : depth.high;
        return result;
    }
};

/// The tiles of an interval of pixels, the last one not included.
std::pair<int, int> tilesOf(const Range& pixels, int size) {
    constexpr float kMargin = .02f;
    const float middle = static_cast<float>(size) / 2, side = kTilePixelsAside;
    const float first = std::floor((pixels.low - kMargin + middle) / side),
                last = std::floor((pixels.high + kMargin + middle) / side);
    const int tiles = (size + kTilePixelsAside - 1) / kTilePixelsAside;
    return {static_cast<int>(std::clamp(first, 0.0f, static_cast<float>(tiles))),
            static_cast<int>(std::clamp(last + 1, 0.0f, static_cast<float>(tiles)))};
}

}  // namespace

/// A cluster in the picture: the tiles that it may be in, the last ones not included.
struct PrimaryHits::Found {
    float nearness = 0;
    std::uint32_t cluster = 0;
    std::uint16_t left = 0, right = 0, top = 0, bottom = 0;
    std::size_t tiles() const { return std::size_t{1} * (right - left) * (bottom - top); }
};

std::vector<PrimaryHits::Found> PrimaryHits::project(const Group& group, std::uint32_t mask) const {
    const std::vector<Cluster>& all = clusters_->all;
    std::vector<std::uint8_t> isMet(clusters_->meshes.size());
    for (std::uint32_t i = 0; i < isMet.size(); ++i) isMet[i] = (group.mask(i) & mask) != 0;
    const Projection to(grid_);
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
            std::pair<int, int> x{0, tilesX()}, y{0, tilesY()};
            if (depth.low > 1e-6f * depth.high) {
                f.nearness = (1 + 0x1p-20f) / depth.low;
                x = tilesOf(Range(to.x, middle, half).over(depth), grid_.width);
                y = tilesOf(Range(to.y, middle, half).over(depth), grid_.height);
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
    // Where tiles see this many clusters on the average, nearly all of them are left to rays.
    if (total > lists_.size() * most_) return false;
    const auto forTiles = [&](const Found& f, const auto& visit) {
        for (std::size_t y = f.top; y < f.bottom; ++y)
            for (std::size_t x = f.left; x < f.right; ++x) visit(lists_[y * across + x]);
    };
    for (const Found& f : found) forTiles(f, [](List& list) { ++list.count; });
    std::size_t taken = 0;
    for (List& list : lists_) {
        list.first = static_cast<std::uint32_t>(taken);
        if (list.count <= most_) taken += std::exchange(list.count, 0);
    }
    seen_.resize(taken);
    for (const Found& f : found)
        forTiles(f, [&](List& list) {
            if (list.count <= most_) seen_[list.first + list.count++] = {f.cluster, f.nearness};
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

bool PrimaryHits::find(int tileX, int tileY, std::span<TileHits> hits, const TilePlaces* places) const {
    const List& list =
        lists_[static_cast<std::size_t>(tileY) * static_cast<std::size_t>(tilesX()) + static_cast<std::size_t>(tileX)];
    if (list.count > most_) return false;
    const PixelGrid& g = grid_;
    const auto middle = [](int tile, int size) {
        return static_cast<float>(tile * kTilePixelsAside + kTilePixelsAside / 2) - static_cast<float>(size) / 2;
    };
    const float x = g.middleX + g.across * middle(tileX, g.width), y = g.middleY - g.down * middle(tileY, g.height);
    const TileFrame frame{g.eye, g.forward + g.right * x + g.up * y, g.right * g.across, -g.up * g.down};
    const Seen* const first = seen_.data() + list.first;
    kernels().find(frame, first, first + list.count, clusters_->all.data(), clusters_->meshes.data(), places,
                   hits.data(), hits.size());
    return true;
}

bool PrimaryHits::meet(const TileHits& hits, int block, const std::int32_t* valid, RayPacket16& rays) const {
    return kernels().meet(hits, block, valid, clusters_->all.data(), clusters_->meshes.data(), rays);
}

}  // namespace rtsg::bvh
