// Groups of samples, their means' spread, and when a block has enough.
#include "adaptive.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "lighting/sample_points.h"

namespace rtsg::trace {

namespace {

/// The share that the block's mean variance has in a pixel's.
constexpr double kOthersShare = 0.2;

/// How far a block's error may stay above what is asked for, where others of its tile make up for it.
constexpr double kWorstBlock = 1.1;

/// Sums over the samples of each group, by pixel.
class Moments {
  public:
    explicit Moments(int groups) : groups_(groups), sums_(static_cast<std::size_t>(groups) * kTilePixels, Vec3d(0)) {}
    void add(int group, int pixel, const Vec3d& sum) { sums_[index(group, pixel)] += sum; }
    /// The mean of the groups' means, if each group of the pixel has so many samples.
    Vec3d mean(int pixel, int samples) const {
        Vec3d sum(0);
        for (int g = 0; g < groups_; ++g) sum += sums_[index(g, pixel)];
        return sum / (double(groups_) * samples);
    }
    /// The standard error of that.
    Vec3d error(int pixel, int samples) const { return error(pixel, samples, mean(pixel, samples)); }
    double relativeError(int pixel, int samples) const {
        const Vec3d middle = mean(pixel, samples), e = error(pixel, samples, middle);
        return std::max({e.x, e.y, e.z}) / (std::max({middle.x, middle.y, middle.z, 0.0}) + double{kErrorFloor});
    }

  private:
    Vec3d error(int pixel, int samples, const Vec3d& middle) const {
        const Vec3d expected = middle * double(samples);
        Vec3d squares(0);
        for (int g = 0; g < groups_; ++g) {
            const Vec3d off = sums_[index(g, pixel)] - expected;
            squares += off * off;
        }
        return glm::sqrt(squares / (double(groups_) * (groups_ - 1))) / double(samples);
    }
    static std::size_t index(int group, int pixel) {
        return static_cast<std::size_t>(group) * kTilePixels + static_cast<std::size_t>(pixel);
    }

    int groups_;
    std::vector<Vec3d> sums_;
};

void addUp(const TileResult& round, TileResult& all) {
    for (std::size_t i = 0; i < kTilePixels; ++i) all.sum[i] += round.sum[i];
    for (std::size_t i = 0; i < round.light.size(); ++i)
        all.addLight(static_cast<std::uint16_t>(i), round.light[i], round.share[i]);
    for (std::size_t i = 0; i < round.missing.size(); ++i)
        all.addMissing(static_cast<std::uint16_t>(i), round.missing[i]);
    all.primaryRays += round.primaryRays, all.shadowRays += round.shadowRays;
    all.secondaryRays += round.secondaryRays;
}

}  // namespace

double studentQuantile(int degreesOfFreedom) {
    // Hill's expansion (1970) about the normal quantile; within .1 % from five degrees on.
    const double z = 1.959963985, n = degreesOfFreedom, z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
    return z + (z3 + z) / (4 * n) + (5 * z5 + 16 * z3 + 3 * z) / (96 * n * n) +
           (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * n * n * n);
}

void traceRounds(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                 TileResult& result) {
    const int samples = settings.samplesPerPixel;
    if (samples <= kRound) return traceTile(scene, camera, settings, x0, y0, std::span(&result, 1));
    std::vector<glm::dvec4> sums(kTilePixels, glm::dvec4(0));
    for (int first = 0; first < samples; first += kRound) {
        TileResult round;
        round.seed = result.seed;
        round.firstSample = first, round.lastSample = std::min(first + kRound, samples);
        traceTile(scene, camera, settings, x0, y0, std::span(&round, 1));
        for (std::size_t i = 0; i < kTilePixels; ++i) sums[i] += glm::dvec4(round.sum[i]);
        addUp(round, result);
    }
    for (std::size_t i = 0; i < kTilePixels; ++i) result.sum[i] = Vec4f(sums[i]);
}

void addLight(TileResult& tile) {
    for (std::size_t i = 0; i < tile.light.size(); ++i) {
        const Vec3f& share = tile.share[i];
        if (share == Vec3f(0)) continue;
        for (int c = 0; c < 3; ++c)
            if (share[c] > 0) tile.sum[i][c] += share[c] * srgbFromLinear(tile.light[i][c] / share[c]);
    }
}

namespace {

/// One tile's sampling.
class Sampling {
  public:
    Sampling(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
             AdaptiveTile& tile)
        : scene_(scene),
          camera_(camera),
          settings_(settings),
          own_(settings),
          x0_(x0),
          y0_(y0),
          most_(std::max(settings.samplesPerPixel, 2 * kLeastOfGroup)),
          groups_(std::min(kGroups, most_ / kLeastOfGroup)),
          firstStep_(scene.shutter ? kLeastOfGroup : kFirstOfGroup),
          leastStep_(scene.shutter ? kLeastOfGroup : kStepOfGroup),
          moments_(groups_),
          tile_(tile) {}

    void run() {
        for (std::uint32_t blocks = (1u << kBlocks) - 1; blocks; blocks = choose()) {
            // Those that have as many go together.
            for (std::uint32_t rest = blocks; rest;) {
                const int samples = samples_[static_cast<std::size_t>(std::countr_zero(rest))];
                std::uint32_t same = 0;
                for (int block = 0; block < kBlocks; ++block)
                    if (samples_[static_cast<std::size_t>(block)] == samples) same |= 1u << block;
                advance(same & rest, samples);
                rest &= ~same;
            }
        }
        tell();
    }

  private:
    bool inside(int pixel) const {
        return x0_ + pixel % kTileSide < settings_.width && y0_ + pixel / kTileSide < settings_.height;
    }
    int samplesOf(int pixel) const { return samples_[static_cast<std::size_t>(blockOf(pixel))]; }

    /// Some more samples of each group.
    void sample(std::uint32_t blocks, int first, int last) {
        for (; last - first > kRound; first += kRound) round(blocks, first, first + kRound);
        round(blocks, first, last);
    }
    void round(std::uint32_t blocks, int first, int last) {
        std::vector<TileResult> now(static_cast<std::size_t>(groups_));
        for (std::size_t group = 0; group < now.size(); ++group) {
            now[group].seed = mixBits(settings_.seed * 0x9e3779b97f4a7c15ull + group);
            now[group].blocks = blocks;
            now[group].firstSample = first, now[group].lastSample = last;
        }
        if (scene_.shutter) {
            throughShutter(first, last, now);
        } else {
            own_.samplesPerPixel = most_ / groups_;
            traceTile(scene_, camera_, own_, x0_, y0_, now);
        }
        for (std::size_t group = 0; group < now.size(); ++group) take(static_cast<int>(group), now[group]);
    }

    /// One group after the other, as each has instants of its own.
    void throughShutter(int first, int last, std::span<TileResult> groups) {
        own_.samplesPerPixel = last - first;
        for (TileResult& group : groups) {
            group.seed = own_.seed = mixBits(group.seed + static_cast<std::uint64_t>(first));
            group.firstSample = 0, group.lastSample = last - first;
            traceTile(scene_, camera_, own_, x0_, y0_, std::span(&group, 1));
        }
    }

    void take(int group, TileResult& now) {
        addUp(now, tile_.result);
        if (scene_.space == ColorSpace::automatic) addLight(now);
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            if (!(now.blocks >> blockOf(pixel) & 1u)) continue;
            Vec3d sum(now.sum[static_cast<std::size_t>(pixel)]);
            for (int c = 0; c < 3; ++c) sum[c] = std::isfinite(sum[c]) ? sum[c] : 0.0;
            moments_.add(group, pixel, sum);
        }
    }

    /// How many samples of each group these lead to.
    int after(int samples) const {
        // An eighth more each time: more often costs coherence, more seldom samples that were not needed.
        const auto eighth = static_cast<int>(std::bit_floor(static_cast<unsigned>(samples)) / 8);
        const int limit = most_ / groups_, step = samples == 0 ? firstStep_ : std::max(leastStep_, eighth);
        return limit - (samples + step) < leastStep_ ? limit : samples + step;
    }

    void advance(std::uint32_t blocks, int samples) {
        const int next = after(samples);
        sample(blocks, samples, next);
        for (int block = 0; block < kBlocks; ++block)
            if (blocks >> block & 1u) samples_[static_cast<std::size_t>(block)] = next, look(block);
    }

    /// Adds up, over the pixels of a block, the squares of their errors divided by the error that is asked for.
    void look(int block) {
        const auto at = static_cast<std::size_t>(block);
        squares_[at] = pixels_[at] = 0;
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            if (blockOf(pixel) != block || !inside(pixel)) continue;
            const double e = moments_.relativeError(pixel, samples_[at]) / double{settings_.error};
            squares_[at] += e * e, ++pixels_[at];
        }
    }

    /// The blocks that are to go on; none if the tile has enough, or all that it may have.
    std::uint32_t choose() {
        double sum = 0, pixels = 0;
        std::vector<int> worse;  // than what is asked for
        tile_.ranOut = 0;
        for (int block = 0; block < kBlocks; ++block) {
            const auto at = static_cast<std::size_t>(block);
            const bool isWorse = squares_[at] > pixels_[at];
            if (isWorse && samples_[at] == most_ / groups_) {
                tile_.ranOut |= 1u << block;
                continue;
            }
            sum += squares_[at], pixels += pixels_[at];
            if (isWorse) worse.push_back(block);
        }
        const auto perPixel = [&](int block) {
            return squares_[static_cast<std::size_t>(block)] / pixels_[static_cast<std::size_t>(block)];
        };
        std::ranges::sort(worse, [&](int a, int b) { return perPixel(a) > perPixel(b); });
        std::uint32_t chosen = 0;
        for (const int block : worse) {
            if (sum <= pixels && perPixel(block) <= kWorstBlock * kWorstBlock) break;
            const auto at = static_cast<std::size_t>(block);
            chosen |= 1u << block;
            // Expects less error from the block afterwards: variances fall as samples grow.
            sum -= squares_[at] * (1 - double(samples_[at]) / after(samples_[at]));
        }
        return chosen;
    }

    void tell() const {
        std::array<Vec3d, kBlocks> squares{};
        std::array<int, kBlocks> pixels{};
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            if (!inside(pixel)) continue;
            const auto block = static_cast<std::size_t>(blockOf(pixel));
            const Vec3d error = moments_.error(pixel, samplesOf(pixel));
            squares[block] += error * error, ++pixels[block];
        }
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            const auto at = static_cast<std::size_t>(pixel), block = static_cast<std::size_t>(blockOf(pixel));
            const Vec3d error = moments_.error(pixel, samplesOf(pixel));
            // A pixel that has not met rare bright light yet is too dark and seems too certain: its neighbours'
            // variances correct that.
            const Vec3d others = squares[block] / double(std::max(pixels[block], 1));
            const Vec3d careful = glm::sqrt(glm::mix(error * error, others, kOthersShare));
            tile_.interval[at] = Vec3f(careful * studentQuantile(groups_ - 1));
            tile_.error[at] = static_cast<float>(moments_.relativeError(pixel, samplesOf(pixel)));
            tile_.samples[block] = static_cast<std::uint32_t>(samplesOf(pixel) * groups_);
        }
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    RenderSettings own_;  // as the integrator gets them
    const int x0_, y0_, most_, groups_;
    /// Samples of a shutter's instants are spread over all that are asked for at once, and a single one is in the
    /// middle of its pixel: there each step is a sequence of its own, and not too short.
    const int firstStep_, leastStep_;
    Moments moments_;
    std::array<int, kBlocks> samples_{};                // of each group
    std::array<double, kBlocks> squares_{}, pixels_{};  // of relative errors over what is asked for; inside the picture
    AdaptiveTile& tile_;
};

}  // namespace

void adaptiveTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                  AdaptiveTile& tile) {
    Sampling(scene, camera, settings, x0, y0, tile).run();
}

}  // namespace rtsg::trace
