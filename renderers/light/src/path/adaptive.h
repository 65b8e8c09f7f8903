// Samples tiles until their pixels are accurate enough.
//
// The samples of a pixel are divided into a few groups, each with a sequence that is scrambled separately. So the means
// of the groups are independent and give the error of their mean, also for points that are better than random ones
// (L'Ecuyer 2018, "Randomized quasi-Monte Carlo", section 3). Stopping when the samples look good would make them dark
// and their errors small, because rare bright light looks bad. So groups form folds of two, and the number of samples
// that a fold shows is decided by all other folds: the result is independent of the decision, and unbiased. A block of
// four by four pixels has enough samples if its error is as small as requested, or up to a tenth above it if the error
// of its tile is small enough. The reported error follows from the results of the folds, and is above the requested one
// where light is rare. Errors are standard errors over (value + kErrorFloor), of the brightest channel. Threading: as
// tiles.
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
    std::array<std::uint32_t, kBlocks> samples{};  // number of samples in the result of a block's pixels
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
