// Samples a whole picture evenly until its error is small enough.
//
// All pixels get the same samples, those that a picture of so many has without `error`: so it is as good as that one by
// construction. A pixel's samples are one sequence, cut into four to seven parts that are nets of their own; their
// differences give the variance, and rather too large a one, as parts of one sequence are off to opposite sides (Owen
// 1997). The variance of two parts is divided by the value of the other two: by its own value, rare bright light would
// look certain. So the expected quotient is not below the true one (Jensen's inequality). The error of the picture is
// the root mean square over its pixels plus one standard error of that mean square. It includes a bound for what no
// sample has met: none of n samples has met it, so it has a probability of at most 3/n, at 95 % (the rule of three).
// Every length and light is measured by the picture's own. Threading: one picture uses several threads.
#pragma once

#include <functional>
#include <vector>

#include "hidden_light.h"
#include "lighting/trace_scene.h"

namespace rtsg::trace {

constexpr std::size_t kMaxParts = 7;  // of a pixel's samples, of one size; one more, and pairs are joined:
constexpr int kParts = 4;             // so many at first

/// 97.5 % quantile of Student's distribution.
double studentQuantile(int degreesOfFreedom);

/// So many samples at most are added up as floats before they join a sum of doubles: what rounding takes from more of
/// them shows (a constant was 2 % too dark after 2^20).
constexpr int kRound = 1024;

/// traceTile() of all samples, of one group, in rounds of so many.
void traceRounds(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                 TileResult& result);

/// Encodes what PhysicalMaterials have added (ColorSpace::automatic) and puts it to the rest.
void addLight(TileResult& tile);

/// A tile with its sums, and what is known of their errors where `settings.error` asks for it.
struct AdaptiveTile {
    TileResult result;  // sums of so many samples
    int samples = 0;
    bool reached = true;
    /// By pixel and channel: half the width of the 95 % interval around the mean.
    std::array<Vec3f, kTilePixels> interval{};
    std::array<float, kTilePixels> variance{};  // squares of standard errors, the mean of the channels
};

/// One picture's sampling, up to `settings.error` or `settings.samplesPerPixel`. Deterministic.
class AdaptivePicture {
  public:
    /// `drawn`: begins with a tile.
    AdaptivePicture(const TraceScene& scene, const Camera& camera, const RenderSettings& settings,
                    const PixelRegion& drawn, const HiddenLight& hidden);
    ~AdaptivePicture();
    AdaptivePicture(const AdaptivePicture&) = delete;
    AdaptivePicture& operator=(const AdaptivePicture&) = delete;

    /// `goesOn`: as RenderSettings::progress, from any thread; false if it was.
    bool run(const std::function<bool(double)>& goesOn);
    /// The relative error that is certain, and whether it is as small as asked.
    double error() const { return error_; }
    bool reached() const { return reached_; }
    void finish(int tile, AdaptiveTile& to) const;

  private:
    struct Tile;
    static int greatestOf(int samples, int size);
    bool sample(const std::function<bool(double)>& goesOn);
    void judge();

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    const PixelRegion drawn_;
    const HiddenLight hidden_;
    int size_;  // of a part, in samples
    const int maximum_;
    std::vector<Tile> tiles_;
    int samples_ = 0;
    double error_ = 0, floor_ = 0, done_ = 0;
    bool reached_ = false;
};

}  // namespace rtsg::trace
