// Groups of samples, the spread of their means, and the decision when a block has enough, which is made by other groups
// than those that are shown.
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

/// The shares that the neighbours of a block and its whole tile have where it is decided whether it is good enough.
constexpr double kAround = 0.4, kOfTile = 0.2;
/// From so many samples of a group on, a block must be good enough twice in a row.
constexpr int kOnceGood = 8;

/// How far a block's error may stay above the requested one if others of its tile make up for it.
constexpr double kWorstBlock = 1.1;

/// Sums over the samples of each group, by pixel. Each fold has two groups.
class Moments {
  public:
    explicit Moments(int folds)
        : folds_(folds), sums_(std::size_t{2} * static_cast<std::size_t>(folds) * kTilePixels, Vec3d(0)) {}
    void add(int group, int pixel, const Vec3d& sum) { sums_[index(group, pixel)] += sum; }
    /// The square of the standard error of the mean of a fold's groups, if each has so many samples.
    Vec3d variance(int fold, int pixel, int samples) const {
        const Vec3d off = sums_[index(fold, pixel)] - sums_[index(fold + folds_, pixel)];
        return off * off / (4.0 * samples * samples);
    }
    Vec3d mean(int fold, int pixel, int samples) const {
        return (sums_[index(fold, pixel)] + sums_[index(fold + folds_, pixel)]) / (2.0 * samples);
    }

    /// The mean of the groups of all folds but one, and the square of its standard error.
    struct Estimate {
        Vec3d mean{0}, variance{0};
    };
    Estimate without(int fold, int pixel, int samples) const {
        Vec3d sum(0), squares(0);
        for (int group = 0; group < 2 * folds_; ++group)
            if (group % folds_ != fold) sum += sums_[index(group, pixel)];
        const double count = 2.0 * (folds_ - 1);
        const Vec3d expected = sum / count;
        for (int group = 0; group < 2 * folds_; ++group) {
            if (group % folds_ == fold) continue;
            const Vec3d off = sums_[index(group, pixel)] - expected;
            squares += off * off;
        }
        return {expected / double(samples), squares / (count * (count - 1) * samples * samples)};
    }

  private:
    static std::size_t index(int group, int pixel) {
        return static_cast<std::size_t>(group) * kTilePixels + static_cast<std::size_t>(pixel);
    }

    int folds_;
    std::vector<Vec3d> sums_;
};

/// The square of the standard error of the brightest channel over that channel's value.
double relativeSquare(const Vec3d& value, const Vec3d& variance) {
    const int c = value.x >= value.y ? (value.x >= value.z ? 0 : 2) : (value.y >= value.z ? 1 : 2);
    const double over = std::max(value[c], 0.0) + double{kErrorFloor};
    return variance[c] / (over * over);
}

/// Adds the results of these blocks, times a weight for each.
void addBlocks(const TileResult& from, std::uint32_t blocks, const float* weights, TileResult& to) {
    for (std::size_t i = 0; i < kTilePixels; ++i) {
        const int block = blockOf(static_cast<int>(i));
        if (!(blocks >> block & 1u)) continue;
        const auto pixel = static_cast<std::uint16_t>(i);
        const float weight = weights[block];
        to.sum[i] += weight * from.sum[i];
        if (!from.light.empty()) to.addLight(pixel, weight * from.light[i], weight * from.share[i]);
        if (!from.missing.empty()) to.addMissing(pixel, weight * from.missing[i]);
    }
}

void addRays(const TileResult& round, TileResult& all) {
    all.primaryRays += round.primaryRays, all.shadowRays += round.shadowRays;
    all.secondaryRays += round.secondaryRays;
}

constexpr std::uint32_t kAllBlocks = (1u << kBlocks) - 1;
constexpr std::array<float, kBlocks> kWhole = [] {
    std::array<float, kBlocks> ones{};
    ones.fill(1);
    return ones;
}();

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
        addBlocks(round, kAllBlocks, kWhole.data(), result);
        addRays(round, result);
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
          most_(std::max(settings.samplesPerPixel, kFewGroups * (scene.shutter ? kLeastOfGroup : 1))),
          groups_(most_ < kGroups * kLeastOfGroup ? kFewGroups : kGroups),
          folds_(groups_ / 2),
          firstStep_(scene.shutter ? kLeastOfGroup : kFirstOfGroup),
          leastStep_(scene.shutter ? kLeastOfGroup : kStepOfGroup),
          decide_(folds_),
          show_(folds_),
          parts_(static_cast<std::size_t>(folds_)),
          tile_(tile) {}

    void run() {
        while (const std::uint32_t blocks = anyWanted()) {
            const int next = after(samples_);
            sample(blocks, samples_, next);
            samples_ = next;
            for (Fold& fold : parts_)
                for (std::size_t block = 0; block < kBlocks; ++block)
                    if (fold.wanted >> block & 1u) fold.shown[block] = samples_;
            for (int fold = 0; fold < folds_; ++fold) judge(fold);
        }
        join();
        tell();
    }

  private:
    bool inside(int pixel) const {
        return x0_ + pixel % kTileSide < settings_.width && y0_ + pixel / kTileSide < settings_.height;
    }
    /// The result of a fold of the groups, about which the other folds decide.
    struct Fold {
        TileResult sums;
        std::uint32_t good = 0, wanted = kAllBlocks;  // blocks that it is to go on with
        std::array<int, kBlocks> shown{};             // samples of each group
        std::array<double, kBlocks> squares{};        // as look() has them
    };
    const Fold& fold(int number) const { return parts_[static_cast<std::size_t>(number)]; }
    std::uint32_t anyWanted() const {
        std::uint32_t blocks = 0;
        for (const Fold& fold : parts_) blocks |= fold.wanted;
        return blocks;
    }
    int shownOf(int number, int pixel) const { return fold(number).shown[static_cast<std::size_t>(blockOf(pixel))]; }

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
        Fold& fold = parts_[static_cast<std::size_t>(group % folds_)];
        const std::uint32_t seen = now.blocks & fold.wanted;
        addBlocks(now, seen, kWhole.data(), fold.sums);
        addRays(now, tile_.result);
        if (scene_.space == ColorSpace::automatic) addLight(now);
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            const int block = blockOf(pixel);
            if (!(now.blocks >> block & 1u)) continue;
            Vec3d sum(now.sum[static_cast<std::size_t>(pixel)]);
            for (int c = 0; c < 3; ++c) sum[c] = std::isfinite(sum[c]) ? sum[c] : 0.0;
            decide_.add(group, pixel, sum);
            if (seen >> block & 1u) show_.add(group, pixel, sum);
        }
    }

    /// How many samples of each group these lead to.
    int after(int samples) const {
        // An eighth more each time: more often costs coherence, more seldom samples that were not needed.
        const auto eighth = static_cast<int>(std::bit_floor(static_cast<unsigned>(samples)) / 8);
        const int limit = most_ / groups_, step = samples == 0 ? firstStep_ : std::max(leastStep_, eighth);
        return limit - (samples + step) < leastStep_ ? limit : samples + step;
    }

    /// Decides by all folds but one which blocks that one is to go on with.
    void judge(int number) {
        Fold& fold = parts_[static_cast<std::size_t>(number)];
        double sum = 0, pixels = 0;
        for (int block = 0; block < kBlocks; ++block) {
            if (fold.wanted >> block & 1u) look(number, block);
            sum += fold.squares[static_cast<std::size_t>(block)], pixels += pixels_[static_cast<std::size_t>(block)];
        }
        const bool last = samples_ >= most_ / groups_;
        const double allowed = sum <= pixels ? kWorstBlock * kWorstBlock : 1;
        for (std::uint32_t rest = fold.wanted; rest; rest &= rest - 1) {
            const int block = std::countr_zero(rest);
            const std::uint32_t bit = 1u << block;
            const bool isGood = smoothed(fold, block, sum / pixels) <= allowed;
            const bool enough = isGood && (samples_ < kOnceGood || (fold.good & bit));
            fold.good = isGood ? fold.good | bit : fold.good & ~bit;
            if (enough || last) fold.wanted &= ~bit;
            if (!isGood && last) tile_.ranOut |= bit;
        }
    }
    /// A block's mean square with some of its neighbours' and of the tile's: few samples that meet no rare bright light
    /// tell less of a block than those beside it.
    double smoothed(const Fold& fold, int block, double ofTile) const {
        double around = 0, pixels = 0;
        for (int y = std::max(block / 4 - 1, 0); y <= std::min(block / 4 + 1, 3); ++y)
            for (int x = std::max(block % 4 - 1, 0); x <= std::min(block % 4 + 1, 3); ++x) {
                const auto at = static_cast<std::size_t>(4 * y + x);
                around += fold.squares[at], pixels += pixels_[at];
            }
        const auto own = static_cast<std::size_t>(block);
        if (!(pixels_[own] > 0)) return 0;
        return (1 - kAround - kOfTile) * fold.squares[own] / pixels_[own] + kAround * around / pixels +
               kOfTile * ofTile;
    }
    /// Adds up, over the pixels of a block, the squares of the errors divided by the error that is asked for: those
    /// that all folds together have if they vary as those without this one do.
    void look(int number, int block) {
        const auto at = static_cast<std::size_t>(block);
        double& squares = parts_[static_cast<std::size_t>(number)].squares[at];
        squares = pixels_[at] = 0;
        const double share = (folds_ - 1.0) / folds_ / (double{settings_.error} * settings_.error);
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            if (blockOf(pixel) != block || !inside(pixel)) continue;
            const Moments::Estimate known = decide_.without(number, pixel, samples_);
            squares += share * relativeSquare(known.mean, known.variance), ++pixels_[at];
        }
    }

    /// Makes the tile's sums of all folds', which count alike however many samples they have.
    void join() {
        std::array<int, kBlocks> all{};
        for (std::size_t block = 0; block < kBlocks; ++block) {
            for (const Fold& fold : parts_) all[block] += fold.shown[block];
            tile_.samples[block] = static_cast<std::uint32_t>(2 * all[block]);
        }
        for (const Fold& fold : parts_) {
            std::array<float, kBlocks> weights;
            for (std::size_t block = 0; block < kBlocks; ++block)
                weights[block] = static_cast<float>(all[block]) / static_cast<float>(folds_ * fold.shown[block]);
            addBlocks(fold.sums, kAllBlocks, weights.data(), tile_.result);
        }
    }

    /// Estimates the variance of the shown value: each fold's own variance, divided by the value of the others. Divided
    /// by its own value it would look small where that is large by chance.
    void estimate(int pixel, Vec3d& variance, double& square) const {
        Vec3d sum(0);
        for (int f = 0; f < folds_; ++f) sum += show_.mean(f, pixel, shownOf(f, pixel));
        variance = Vec3d(0), square = 0;
        for (int f = 0; f < folds_; ++f) {
            const int samples = shownOf(f, pixel);
            const Vec3d own = show_.variance(f, pixel, samples) / (double(folds_) * folds_);
            variance += own;
            square += relativeSquare((sum - show_.mean(f, pixel, samples)) / (folds_ - 1.0), own);
        }
    }
    void tell() const {
        std::array<Vec3d, kTilePixels> variances{};
        std::array<Vec3d, kBlocks> sums{};
        std::array<int, kBlocks> pixels{};
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            if (!inside(pixel)) continue;
            const auto at = static_cast<std::size_t>(pixel), block = static_cast<std::size_t>(blockOf(pixel));
            double square = 0;
            estimate(pixel, variances[at], square);
            sums[block] += variances[at], ++pixels[block];
            tile_.error[at] = static_cast<float>(std::sqrt(square));
            tile_.variance[at] = static_cast<float>((variances[at].x + variances[at].y + variances[at].z) / 3);
        }
        // the neighbours' information counts as one more degree of freedom
        const double quantile = studentQuantile(folds_ + 1);
        for (std::size_t at = 0; at < kTilePixels; ++at) {
            const auto block = static_cast<std::size_t>(blockOf(static_cast<int>(at)));
            // A pixel that has not met rare bright light yet is too dark and seems too certain: its neighbours'
            // variances correct that.
            const Vec3d others = sums[block] / double(std::max(pixels[block], 1));
            tile_.interval[at] = Vec3f(glm::sqrt(glm::mix(variances[at], others, kOthersShare)) * quantile);
        }
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    RenderSettings own_;  // as the integrator gets them
    const int x0_, y0_, most_, groups_, folds_;
    /// Samples of a shutter's instants are spread over all that are asked for at once, and a single one is in the
    /// middle of its pixel: there each step is a sequence of its own, and not too short.
    const int firstStep_, leastStep_;
    Moments decide_, show_;
    int samples_ = 0;  // of each group, of those blocks that go on
    std::vector<Fold> parts_;
    std::array<double, kBlocks> pixels_{};  // inside the picture
    AdaptiveTile& tile_;
};

}  // namespace

void adaptiveTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                  AdaptiveTile& tile) {
    Sampling(scene, camera, settings, x0, y0, tile).run();
}

}  // namespace rtsg::trace
