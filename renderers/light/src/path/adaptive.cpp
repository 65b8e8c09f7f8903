// Even samples in growing rounds, the error after each, and the decision whether it is small enough.
#include "adaptive.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <mutex>

#include <rtsg/renderers/parallel_for.h>

#include "lighting/sample_points.h"

namespace rtsg::trace {

namespace {

/// The share that the mean variance of a block of four by four pixels has in a pixel's.
constexpr double kOthersFraction = 0.2;

void addRays(const TileResult& round, TileResult& all) {
    all.primaryRays += round.primaryRays, all.shadowRays += round.shadowRays;
    all.secondaryRays += round.secondaryRays, all.chanceFinds += round.chanceFinds;
}
void addSums(const TileResult& from, TileResult& to) {
    for (std::size_t i = 0; i < kTilePixels; ++i) to.sum[i] += from.sum[i];
    for (std::size_t i = 0; i < from.light.size(); ++i)
        to.addLight(static_cast<std::uint16_t>(i), from.light[i], from.weight[i]);
    for (std::size_t i = 0; i < from.missing.size(); ++i) to.addMissing(static_cast<std::uint16_t>(i), from.missing[i]);
    addRays(from, to);
}

int blockOf(std::size_t pixel) {
    return static_cast<int>(pixel) / (kTileSide * 4) * 4 + static_cast<int>(pixel) % kTileSide / 4;
}

int brightest(const Vec3d& v) {
    return v.x >= v.y ? (v.x >= v.z ? 0 : 2) : (v.y >= v.z ? 1 : 2);
}

/// What the parts of a pixel's samples tell, each the mean of as many samples.
struct PixelParts {
    std::array<Vec3d, kMaxParts> means{};
    std::size_t count = 0;

    Vec3d sum() const {
        Vec3d all(0);
        for (std::size_t part = 0; part < count; ++part) all += means[part];
        return all;
    }
    /// The square of the standard error of the mean of all.
    Vec3d variance() const {
        const auto n = static_cast<double>(count);
        const Vec3d mean = sum() / n;
        Vec3d squares(0);
        for (std::size_t part = 0; part < count; ++part) squares += (means[part] - mean) * (means[part] - mean);
        return squares / (n * (n - 1));
    }
    /// The square of the relative error: of each pair of parts the variance, over the value of all others.
    double relativeSquare(double floor) const {
        const Vec3d all = sum();
        const int c = brightest(all);
        const auto n = static_cast<double>(count);
        double squares = 0;
        for (std::size_t part = 0; part + 1 < count; part += 2) {
            const double one = means[part][c], two = means[part + 1][c];
            const double over = std::max(all[c] - one - two, 0.0) / (n - 2) + floor;
            if (one != two) squares += (one - two) * (one - two) / (2 * n) / (over * over);
        }
        return squares / static_cast<double>(count / 2);
    }
};

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
        addSums(round, result);
    }
    for (std::size_t i = 0; i < kTilePixels; ++i) result.sum[i] = Vec4f(sums[i]);
}

void addLight(TileResult& tile) {
    for (std::size_t i = 0; i < tile.light.size(); ++i) {
        const Vec3f& weight = tile.weight[i];
        if (weight == Vec3f(0)) continue;
        for (int c = 0; c < 3; ++c)
            if (weight[c] > 0) tile.sum[i][c] += weight[c] * srgbFromLinear(tile.light[i][c] / weight[c]);
    }
}

/// The parts of a tile's samples.
struct AdaptivePicture::Tile {
    int x0 = 0, y0 = 0, right = 0, below = 0;  // pixels inside the picture
    std::vector<TileResult> parts;
    double squares = 0, fourths = 0;  // sums over the pixels, of the relative errors

    int pixels() const { return right * below; }
    bool inside(std::size_t pixel) const {
        return static_cast<int>(pixel) % kTileSide < right && static_cast<int>(pixel) / kTileSide < below;
    }
    std::uint64_t pathsOn() const {
        std::uint64_t sum = 0;
        for (const TileResult& part : parts) sum += part.secondaryRays;
        return sum;
    }

    /// Adds parts of `size` samples each, after so many samples.
    void add(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int samples, int size,
             int count) {
        std::vector<TileResult> added(static_cast<std::size_t>(count));
        for (int done = 0; done < size; done += kRound) {
            std::vector<TileResult> now(added.size());
            for (int part = 0; part < count; ++part) {
                TileResult& to = now[static_cast<std::size_t>(part)];
                to.seed = settings.seed;
                to.firstSample = samples + part * size + done;
                to.lastSample = std::min(to.firstSample + kRound, samples + (part + 1) * size);
            }
            if (scene.shutter)
                throughShutter(scene, camera, settings, now);
            else
                traceTile(scene, camera, settings, x0, y0, now);
            for (std::size_t part = 0; part < now.size(); ++part) addSums(now[part], added[part]);
        }
        for (TileResult& part : added) parts.push_back(std::move(part));
        if (parts.size() <= kMaxParts) return;
        for (std::size_t part = 0; part < kParts; ++part) {
            if (part > 0) parts[part] = std::move(parts[2 * part]);
            addSums(parts[2 * part + 1], parts[part]);
        }
        parts.resize(kParts);
    }
    /// Samples of a shutter's instants are spread over all that are asked for at once: here each round of a part is a
    /// sequence of its own.
    void throughShutter(const TraceScene& scene, const Camera& camera, RenderSettings own,
                        std::span<TileResult> rounds) const {
        for (TileResult& round : rounds) {
            round.seed = own.seed = mixBits(own.seed + static_cast<std::uint64_t>(round.firstSample));
            own.samplesPerPixel = round.lastSample - round.firstSample;
            round.firstSample = 0, round.lastSample = own.samplesPerPixel;
            traceTile(scene, camera, own, x0, y0, std::span(&round, 1));
        }
    }

    /// As the picture shows them, after so many samples of all parts.
    std::vector<PixelParts> pixelParts(const TraceScene& scene, int samples) const {
        std::vector<PixelParts> result(kTilePixels);
        const double each = static_cast<double>(parts.size()) / samples;
        for (PixelParts& pixel : result) pixel.count = parts.size();
        for (std::size_t part = 0; part < parts.size(); ++part) {
            TileResult encoded;
            const TileResult* shown = &parts[part];
            if (scene.space == ColorSpace::automatic && !shown->light.empty())
                addLight(encoded = *shown), shown = &encoded;
            for (std::size_t i = 0; i < kTilePixels; ++i)
                for (int c = 0; c < 3; ++c) {
                    const double sum = shown->sum[i][c];
                    result[i].means[part][c] = std::isfinite(sum) ? sum * each : 0;
                }
        }
        return result;
    }
    /// The mean over the pixels of the brightest channel.
    double light(const std::vector<PixelParts>& all) const {
        double sum = 0;
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (!inside(i)) continue;
            const Vec3d value = all[i].sum() / static_cast<double>(all[i].count);
            sum += std::max(value[brightest(value)], 0.0);
        }
        return sum / pixels();
    }
};

AdaptivePicture::AdaptivePicture(const TraceScene& scene, const Camera& camera, const RenderSettings& settings,
                                 const PixelRegion& drawn, const HiddenLight& hidden)
    : scene_(scene),
      camera_(camera),
      settings_(settings),
      drawn_(drawn),
      hidden_(hidden),
      size_(scene.shutter                           ? 3
            : settings.samplesPerPixel < kParts * 2 ? 1
                                                    : 2),
      maximum_(greatestOf(settings.samplesPerPixel, size_)) {
    if (!(settings.error > 0)) return;
    for (int y = 0; y < drawn.height; y += kTileSide)
        for (int x = 0; x < drawn.width; x += kTileSide) {
            Tile& tile = tiles_.emplace_back();
            tile.x0 = drawn.left + x, tile.y0 = drawn.top + y;
            tile.right = std::min(settings.width - tile.x0, kTileSide);
            tile.below = std::min(settings.height - tile.y0, kTileSide);
        }
}
AdaptivePicture::~AdaptivePicture() = default;

/// The most samples up to this number, or the fewest: four to seven times `size`, doubled as often.
int AdaptivePicture::greatestOf(int samples, int size) {
    while (2 * kParts * size <= samples) size *= 2;
    return std::max(samples / size, kParts) * size;
}

bool AdaptivePicture::run(const std::function<bool(double)>& goesOn) {
    while (!reached_ && samples_ < maximum_) {
        if (!sample(goesOn)) return false;
        judge();
    }
    return true;
}

bool AdaptivePicture::sample(const std::function<bool(double)>& goesOn) {
    if (samples_ == 2 * kParts * size_) size_ *= 2;
    const int count = samples_ == 0 ? kParts : 1, next = samples_ + count * size_;
    RenderSettings own = settings_;
    own.samplesPerPixel = maximum_;
    std::atomic<bool> cancelled = false;
    std::atomic<int> finished = 0;
    std::mutex mutex;
    // So many samples are needed if the error goes on to fall as their root.
    const double beyond = samples_ > 0 ? error_ / double{settings_.error} : 2;
    const double expected = std::clamp(samples_ * beyond * beyond, double{1} * next, double{1} * maximum_);
    withThreads(settings_.threads, [&] {
        parallelFor(tiles_.size(), [&](std::size_t i) {
            if (cancelled.load(std::memory_order_relaxed)) return;
            tiles_[i].add(scene_, camera_, own, samples_, size_, count);
            const double weight = ++finished / static_cast<double>(tiles_.size());
            if (!goesOn || !mutex.try_lock()) return;
            const std::lock_guard lock(mutex, std::adopt_lock);
            done_ = std::max(done_, std::lerp(double{1} * samples_, double{1} * next, weight) / expected);
            if (!goesOn(std::min(done_, 1.0))) cancelled = true;
        });
    });
    samples_ = next;
    return !cancelled;
}

void AdaptivePicture::judge() {
    std::vector<double> light(tiles_.size());
    const auto each = [&](const auto& what) {
        withThreads(settings_.threads, [&] { parallelFor(tiles_.size(), what); });
    };
    each([&](std::size_t i) { light[i] = tiles_[i].light(tiles_[i].pixelParts(scene_, samples_)); });
    LogAverage picture;
    for (std::size_t i = 0; i < tiles_.size(); ++i) picture.add(light[i], tiles_[i].pixels());
    const double own = picture.value();
    floor_ = double{kErrorFloor} * own;
    each([&](std::size_t i) {
        Tile& tile = tiles_[i];
        const std::vector<PixelParts> parts = tile.pixelParts(scene_, samples_);
        tile.squares = tile.fourths = 0;
        for (std::size_t pixel = 0; pixel < parts.size(); ++pixel) {
            const double square = tile.inside(pixel) ? parts[pixel].relativeSquare(floor_) : 0;
            tile.squares += square, tile.fourths += square * square;
        }
    });
    const double pixels = double{1} * drawn_.width * drawn_.height;
    double squares = 0, fourths = 0;
    std::uint64_t finds = 0;
    int dark = 0;  // tiles that no light has come to, though it might
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
        const Tile& tile = tiles_[i];
        squares += tile.squares, fourths += tile.fourths;
        for (const TileResult& part : tile.parts) finds += part.chanceFinds;
        const bool mayBeLit = settings_.integrator == Integrator::path && hidden_.any && tile.pathsOn() > 0;
        dark += mayBeLit && !(light[i] > 0);
    }
    const double mean = squares / pixels, spread = std::sqrt(std::max(fourths / pixels - mean * mean, 0.0) / pixels);
    // The rule of three, for as much light as the picture has, and for what only bounces find.
    const double three = 3 / (pixels * samples_ * samples_), floor = double{kErrorFloor};
    double unseen = dark * three / (floor * floor);
    if (hidden_.maximum > 0 && finds < kEnoughFinds && own > 0) {
        const double times = double{hidden_.maximum} / (own + floor_);
        unseen += three * times * times;
    }
    error_ = own > 0 ? std::sqrt(mean + spread + unseen) : dark > 0 ? 1 : 0;
    reached_ = error_ <= double{settings_.error} && (own > 0 || dark == 0);
}

void AdaptivePicture::finish(int number, AdaptiveTile& to) const {
    const Tile& tile = tiles_[static_cast<std::size_t>(number)];
    for (const TileResult& part : tile.parts) addSums(part, to.result);
    to.samples = samples_;
    const double asked = double{settings_.error};
    to.reached = reached_ || (error_ > asked && tile.squares <= asked * asked * tile.pixels());
    const std::vector<PixelParts> parts = tile.pixelParts(scene_, samples_);
    std::array<Vec3d, kTilePixels> variances{};
    std::array<Vec3d, kTilePixels / 16> sums{};
    std::array<int, kTilePixels / 16> pixels{};
    for (std::size_t i = 0; i < parts.size(); ++i) {
        if (!tile.inside(i)) continue;
        const auto block = static_cast<std::size_t>(blockOf(i));
        variances[i] = parts[i].variance();
        sums[block] += variances[i], ++pixels[block];
        to.variance[i] = static_cast<float>((variances[i].x + variances[i].y + variances[i].z) / 3);
    }
    // A pixel that has not met rare bright light yet is too dark and seems too certain: its neighbours' variances
    // correct that, and count as two more degrees of freedom.
    const double quantile = studentQuantile(static_cast<int>(tile.parts.size()) + 1);
    for (std::size_t i = 0; i < parts.size(); ++i) {
        const auto block = static_cast<std::size_t>(blockOf(i));
        const Vec3d others = sums[block] / double(std::max(pixels[block], 1));
        to.interval[i] = Vec3f(glm::sqrt(glm::mix(variances[i], others, kOthersFraction)) * quantile);
    }
}

}  // namespace rtsg::trace
