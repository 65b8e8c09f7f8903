// Blends pixels beside the steps of slanted edges.
#include "clean_edges.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include <rtsg/renderers/parallel_for.h>

namespace rtsg {

namespace {

constexpr int kEdgeReach = 16;                           // pixels along an edge, to either end
constexpr int kShortestEdge = 4;                         // steps to both ends together: shorter edges are corners
constexpr int kMinContrast = 16, kContrastFraction = 6;  // of 255, and of the brightest pixel: smaller contrasts are no
                                                         // edges

class EdgeCleaner {
  public:
    EdgeCleaner(const std::vector<std::uint8_t>& from, int width, int height)
        : from_(from), width_(width), height_(height), luma_(from.size() / 4) {
        for (std::size_t i = 0; i < luma_.size(); ++i)
            luma_[i] = (from[4 * i] + 5 * from[4 * i + 1] + 2 * from[4 * i + 2] + 4) / 8;
    }

    /// Precondition: the row is neither the first nor the last.
    void row(int y, std::uint8_t* to) const {
        for (int x = 1; x + 1 < width_; ++x) {
            const int* at = &luma_[indexOf(x, y)];
            const int m = at[0], n = at[-width_], s = at[width_], w = at[-1], e = at[1];
            const int maximum = std::max({m, n, s, w, e}), minimum = std::min({m, n, s, w, e});
            if (maximum - minimum < std::max(kMinContrast, maximum / kContrastFraction)) continue;
            const int nw = at[-width_ - 1], ne = at[-width_ + 1], sw = at[width_ - 1], se = at[width_ + 1];
            const int acrossRows = std::abs(nw + sw - 2 * w) + 2 * std::abs(n + s - 2 * m) + std::abs(ne + se - 2 * e);
            const int acrossColumns =
                std::abs(nw + ne - 2 * n) + 2 * std::abs(w + e - 2 * m) + std::abs(sw + se - 2 * s);
            const bool alongRows = acrossRows >= acrossColumns;
            const int before = alongRows ? n : w, behind = alongRows ? s : e;
            const int side = std::abs(before - m) >= std::abs(behind - m) ? -1 : 1;
            blend(x, y, alongRows, side, to + 4 * static_cast<std::size_t>(x));
        }
    }

  private:
    std::size_t indexOf(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    }
    bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

    /// Twice the mean of both sides of the edge, at a step along it.
    int twiceMean(int x, int y, int acrossX, int acrossY) const {
        return luma_[indexOf(x, y)] + luma_[indexOf(x + acrossX, y + acrossY)];
    }
    void blend(int x, int y, bool alongRows, int side, std::uint8_t* pixel) const {
        const int alongX = alongRows ? 1 : 0, alongY = 1 - alongX;
        const int acrossX = alongRows ? 0 : side, acrossY = alongRows ? side : 0;
        const int here = luma_[indexOf(x, y)], other = luma_[indexOf(x + acrossX, y + acrossY)];
        const int middle = here + other, limit = std::abs(here - other) / 2;
        // The line of an edge is not known for thin things and for textures.
        const auto isFlat = [&](int px, int py, int as) {
            return !inside(px, py) || 3 * std::abs(luma_[indexOf(px, py)] - as) <= std::abs(here - other);
        };
        if (!isFlat(x - acrossX, y - acrossY, here) || !isFlat(x + 2 * acrossX, y + 2 * acrossY, other)) return;
        // Along the edge until its means are no longer those here, in both directions.
        int steps[2] = {kEdgeReach, kEdgeReach}, ends[2] = {0, 0};
        for (int k = 0; k < 2; ++k) {
            const int step = k == 0 ? -1 : 1;
            for (int i = 1; i <= kEdgeReach; ++i) {
                const int px = x + step * i * alongX, py = y + step * i * alongY;
                if (!inside(px, py) || !inside(px + acrossX, py + acrossY)) break;
                ends[k] = twiceMean(px, py, acrossX, acrossY) - middle;
                steps[k] = i;
                if (std::abs(ends[k]) >= limit) break;
                ends[k] = 0;
            }
        }
        const int nearer = steps[0] <= steps[1] ? 0 : 1;
        // The line crosses this pixel only if the edge steps to its side at the nearer end.
        if (ends[nearer] == 0 || (ends[nearer] < 0) == (here < other)) return;
        const float fraction =
            .5f - (static_cast<float>(steps[nearer]) - .5f) / static_cast<float>(steps[0] + steps[1] - 1);
        if (!(fraction > 0) || steps[0] + steps[1] < kShortestEdge) return;
        const std::uint8_t* own = &from_[4 * indexOf(x, y)];
        const std::uint8_t* theirs = &from_[4 * indexOf(x + acrossX, y + acrossY)];
        for (int c = 0; c < 3; ++c)
            pixel[c] = static_cast<std::uint8_t>(
                std::lround(static_cast<float>(own[c]) + fraction * static_cast<float>(theirs[c] - own[c])));
    }

    const std::vector<std::uint8_t>& from_;
    const int width_, height_;
    std::vector<int> luma_;
};

}  // namespace

void cleanEdges(std::vector<std::uint8_t>& pixels, int width, int height) {
    if (width < 3 || height < 3) return;
    const std::vector<std::uint8_t> from = pixels;
    const EdgeCleaner cleaner(from, width, height);
    constexpr int kRows = 16;
    parallelFor(static_cast<std::size_t>((height - 2 + kRows - 1) / kRows), [&](std::size_t group) {
        const int first = 1 + static_cast<int>(group) * kRows, end = std::min(first + kRows, height - 1);
        for (int y = first; y < end; ++y)
            cleaner.row(y, &pixels[4 * static_cast<std::size_t>(y) * static_cast<std::size_t>(width)]);
    });
}

}  // namespace rtsg
