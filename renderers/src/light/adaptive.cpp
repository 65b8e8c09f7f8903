// Rounds of samples, their means' spread, and when a block has enough.
#include "adaptive.h"

#include <algorithm>
#include <cmath>

#include "sample_points.h"

namespace rtsg::trace {

namespace {

/// Of the block's mean variance in a pixel's.
constexpr double kOthersShare = 0.2;

/// Sums over the rounds of the rounds' means, by pixel.
struct Moments {
    std::array<Vec3d, kTilePixels> sum{}, squares{};
};

/// Standard errors of a pixel's mean after this many rounds.
Vec3d standardError(const Moments& m, int pixel, int rounds) {
    const auto at = static_cast<std::size_t>(pixel);
    Vec3d result;
    for (int c = 0; c < 3; ++c) {
        const double mean = m.sum[at][c] / rounds;
        const double variance = std::max(m.squares[at][c] / rounds - mean * mean, 0.0) * rounds / (rounds - 1);
        result[c] = std::sqrt(variance / rounds);
    }
    return result;
}

double relative(const Moments& m, int pixel, int rounds, const Vec3d& error) {
    const Vec3d mean = m.sum[static_cast<std::size_t>(pixel)] / double(rounds);
    return std::max({error.x, error.y, error.z}) / (std::max({mean.x, mean.y, mean.z, 0.0}) + double{kErrorFloor});
}

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

void addLight(TileResult& tile) {
    for (std::size_t i = 0; i < tile.light.size(); ++i) {
        const Vec3f& share = tile.share[i];
        if (share == Vec3f(0)) continue;
        for (int c = 0; c < 3; ++c)
            if (share[c] > 0) tile.sum[i][c] += share[c] * srgbFromLinear(tile.light[i][c] / share[c]);
    }
}

void adaptiveTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                  AdaptiveTile& tile) {
    Moments moments;
    std::array<int, kBlocks> rounds{};
    const auto inside = [&](int pixel) {
        return x0 + pixel % kTileSide < settings.width && y0 + pixel / kTileSide < settings.height;
    };
    const auto isEnough = [&](int block) {
        const auto b = static_cast<std::size_t>(block);
        if (rounds[b] < kLeastRounds) return false;
        double squares = 0;
        int pixels = 0;
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            if (blockOf(pixel) != block || !inside(pixel)) continue;
            const double e = relative(moments, pixel, rounds[b], standardError(moments, pixel, rounds[b]));
            squares += e * e, ++pixels;
        }
        return squares <= double{settings.error} * double{settings.error} * pixels;
    };
    RenderSettings round = settings;
    const int most = std::max(settings.samplesPerPixel / kRoundSamples, 2);
    round.samplesPerPixel = kRoundSamples;
    std::uint32_t blocks = (1u << kBlocks) - 1;
    for (int number = 0; blocks && number < most; ++number) {
        round.seed = mixBits(settings.seed * 0x9e3779b97f4a7c15ull + static_cast<std::uint64_t>(number));
        TileResult now;
        now.blocks = blocks;
        traceTile(scene, camera, round, x0, y0, now);
        addUp(now, tile.result);
        if (scene.space == ColorSpace::automatic) addLight(now);
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            if (!(blocks >> blockOf(pixel) & 1u)) continue;
            const auto at = static_cast<std::size_t>(pixel);
            Vec3d mean = Vec3d(now.sum[at]) / double{kRoundSamples};
            for (int c = 0; c < 3; ++c) mean[c] = std::isfinite(mean[c]) ? mean[c] : 0.0;
            moments.sum[at] += mean, moments.squares[at] += mean * mean;
        }
        for (int block = 0; block < kBlocks; ++block) {
            if (!(blocks >> block & 1u)) continue;
            ++rounds[static_cast<std::size_t>(block)];
            if (isEnough(block)) blocks &= ~(1u << block);
        }
    }
    tile.ranOut = blocks;
    std::array<Vec3d, kBlocks> squares{};
    std::array<int, kBlocks> pixels{};
    for (int pixel = 0; pixel < kTilePixels; ++pixel) {
        if (!inside(pixel)) continue;
        const auto block = static_cast<std::size_t>(blockOf(pixel));
        const Vec3d error = standardError(moments, pixel, rounds[block]);
        squares[block] += error * error, ++pixels[block];
    }
    for (int pixel = 0; pixel < kTilePixels; ++pixel) {
        const auto at = static_cast<std::size_t>(pixel), block = static_cast<std::size_t>(blockOf(pixel));
        const Vec3d error = standardError(moments, pixel, rounds[block]);
        // What has not met the bright and rare yet is too dark and seems too sure: its neighbours know better.
        const Vec3d others = squares[block] / double(std::max(pixels[block], 1));
        const Vec3d careful = glm::sqrt(glm::mix(error * error, others, kOthersShare));
        tile.interval[at] = Vec3f(careful * studentQuantile(rounds[block] - 1));
        tile.error[at] = static_cast<float>(relative(moments, pixel, rounds[block], error));
        tile.samples[block] = static_cast<std::uint32_t>(rounds[block] * kRoundSamples);
    }
}

}  // namespace rtsg::trace
