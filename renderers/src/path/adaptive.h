// Tiles sampled until their pixels are known well enough.
//
// A pixel's samples are of a few groups, each a sequence of its own that is scrambled on its own: the groups' means are
// independent of each other and tell the error of their mean, of points that are better than random ones too (L'Ecuyer
// 2018, "Randomized quasi-Monte Carlo", section 3). To stop when the samples look good makes them dark and their errors
// small, since rare bright light looks bad. So the groups are in folds of two, and how many samples a fold shows is
// decided by all the others: what is shown is independent of what decided about it, and unbiased. A block of four by
// four pixels has enough if its error is as small as asked for, or a tenth above it while that of its tile is as small.
// What is told of the error follows from what each fold shows, and lies above what was asked for where light is rare.
// Units: errors are standard errors over (value + kErrorFloor), of the brightest channel. Threading: as tiles.
#pragma once

#include "lighting/trace_scene.h"

namespace rtsg::trace {

constexpr int kBlocks = 16;       // of a tile, four by four pixels each
constexpr int kGroups = 8;        // of a pixel's samples; where fewer than kGroups * kLeastOfGroup are allowed,
constexpr int kFewGroups = 4;     // so many
constexpr int kFirstOfGroup = 1;  // samples, after which a block is looked at for the first time
constexpr int kLeastOfGroup = 3;  // samples that each of so many groups must be allowed
constexpr int kStepOfGroup = 1;   // so many more at least

/// 97.5 % quantile of Student's distribution.
double studentQuantile(int degreesOfFreedom);

struct AdaptiveTile {
    TileResult result;                             // sums, as of any tile
    std::array<std::uint32_t, kBlocks> samples{};  // that a block's pixels show
    std::uint32_t ranOut = 0;                      // blocks that ended before they were good enough
    /// By pixel and channel: half the width of the 95 % interval around the mean.
    std::array<Vec3f, kTilePixels> interval{};
    std::array<float, kTilePixels> error{};     // relative standard errors
    std::array<float, kTilePixels> variance{};  // squares of standard errors, the mean of the channels
};

/// `settings.error` is what to reach, with at most `settings.samplesPerPixel` samples a pixel. Deterministic.
void adaptiveTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                  AdaptiveTile& tile);

/// So many samples at most are added up as floats before they join a sum of doubles: what rounding takes from more of
/// them shows (a constant was 2 % too dark after 2^20).
constexpr int kRound = 1024;

/// traceTile() of all samples, of one group, in rounds of so many.
void traceRounds(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                 TileResult& result);

/// Which block of its tile a pixel of the tile is in.
inline int blockOf(int pixel) {
    return pixel / (kTileSide * 4) * 4 + pixel % kTileSide / 4;
}

/// Encodes what PhysicalMaterials have added (ColorSpace::automatic) and puts it to the rest.
void addLight(TileResult& tile);

}  // namespace rtsg::trace
