// Sample points: evenly spread within a pixel, over squares of pixels, and over seeds; and what that does to noise.
#include "lighting/sample_points.h"

#include <array>
#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "light_scene.h"
#include "lighting/packet_random.h"

namespace rtsg {
namespace {

using namespace test;
using trace::hilbertIndex;
using trace::PathRandom;

TEST(HilbertIndex, IsAWayFromPixelToPixelThroughSquaresOfAllSizes) {
    constexpr std::uint32_t kBits = 4, kSide = 1u << kBits;
    std::vector<std::pair<int, int>> curve(kSide * kSide, {-1, -1});
    for (std::uint32_t y = 0; y < kSide; ++y)
        for (std::uint32_t x = 0; x < kSide; ++x) {
            const std::uint32_t at = hilbertIndex(x, y + 7 * kSide, kBits);  // the lowest bits count
            ASSERT_LT(at, curve.size());
            ASSERT_EQ(curve[at].first, -1) << "each once";
            curve[at] = {static_cast<int>(x), static_cast<int>(y)};
        }
    for (std::size_t i = 1; i < curve.size(); ++i)
        EXPECT_EQ(std::abs(curve[i].first - curve[i - 1].first) + std::abs(curve[i].second - curve[i - 1].second), 1);
    for (const int side : {2, 4, 8})
        for (std::size_t i = 0; i < curve.size(); ++i) {
            const auto& first =
                curve[i / static_cast<std::size_t>(side * side) * static_cast<std::size_t>(side * side)];
            EXPECT_EQ(curve[i].first / side, first.first / side);
            EXPECT_EQ(curve[i].second / side, first.second / side);
        }
}

/// Whether the pairs lie one to each of the elementary intervals of their number, a power of two.
bool isNet(const std::vector<Vec2f>& pairs) {
    const auto count = static_cast<std::uint32_t>(pairs.size());
    for (std::uint32_t across = 1; across <= count; across *= 2) {
        std::set<std::uint32_t> cells;
        for (const Vec2f& p : pairs)
            cells.insert(static_cast<std::uint32_t>(p.x * static_cast<float>(across)) * (count / across) +
                         static_cast<std::uint32_t>(p.y * static_cast<float>(count / across)));
        if (cells.size() != count) return false;
    }
    return true;
}

// Together, one by one where the calls before were others, and past the last call of a sequence.
TEST(PacketRandom, GivesEachLaneWhatItsPathRandomGives) {
    constexpr std::uint32_t kMask = 0xEEF7;
    for (const int before : {0, 3, 4094})
        for (const bool apart : {false, true}) {
            trace::PathTask tasks[16];
            std::vector<PathRandom> alone;
            for (int lane = 0; lane < 16; ++lane) {
                PathRandom random = PathRandom::ofPicture(5, 40 + lane, 17, 3 * lane, 100);
                for (int call = 0; call < before + (apart && lane == 9); ++call) random.next();
                tasks[lane].random = random.state();
                alone.push_back(random);
            }
            trace::PacketRandom packet(tasks, kMask);
            for (int call = 0; call < 5; ++call) {
                alignas(64) float one[16], u[16], v[16];
                packet.next(one), packet.nextPair(u, v);
                for (int lane = 0; lane < 16; ++lane) {
                    if (!(kMask >> lane & 1u)) continue;
                    PathRandom& random = alone[static_cast<std::size_t>(lane)];
                    EXPECT_EQ(one[lane], random.next()) << before << apart << ' ' << lane;
                    EXPECT_EQ(Vec2f(u[lane], v[lane]), random.nextPair()) << before << apart << ' ' << lane;
                    EXPECT_EQ(packet.state(lane), random.state());
                }
            }
        }
}

TEST(PacketRandom, SkipsWhatNobodyWants) {
    for (const bool apart : {false, true}) {
        trace::PathTask tasks[16];
        std::vector<PathRandom> alone;
        for (int lane = 0; lane < 16; ++lane) {
            PathRandom random = PathRandom::ofPicture(5, 40 + lane, 17, lane, 100);
            if (apart && lane == 3) random.next();
            tasks[lane].random = random.state();
            alone.push_back(random);
        }
        trace::PacketRandom packet(tasks, 0xFFFF);
        alignas(64) float one[16];
        packet.skip(), packet.skip(), packet.next(one);
        for (int lane = 0; lane < 16; ++lane) {
            PathRandom& random = alone[static_cast<std::size_t>(lane)];
            random.next(), random.nextPair();
            EXPECT_EQ(one[lane], random.next()) << apart << ' ' << lane;
            EXPECT_EQ(packet.state(lane), random.state()) << apart << ' ' << lane;
        }
    }
}

TEST(PacketRandom, BeginsSixteenPixelsAsPathRandomBeginsEach) {
    for (const int samples : {1, 4, 100, 1 << 20})
        for (const int x0 : {0, 12, 250, 5000})
            for (const int y0 : {0, 40, 254}) {
                int x[16], y[16];
                std::uint64_t states[16];
                PathRandom randoms[16];
                for (int lane = 0; lane < 16; ++lane) {
                    x[lane] = x0 + lane % 4, y[lane] = y0 + lane / 4;
                    randoms[lane] = PathRandom(9, x[lane], y[lane], 0);
                }
                trace::randomOfPicture(9, x, y, samples - 1, samples, states);
                alignas(64) float u[16], v[16];
                trace::PairsOfSamples(randoms).of(samples - 1, u, v);
                for (int lane = 0; lane < 16; ++lane) {
                    EXPECT_EQ(states[lane], PathRandom::ofPicture(9, x[lane], y[lane], samples - 1, samples).state());
                    PathRandom alone(9, x[lane], y[lane], samples - 1);
                    EXPECT_EQ(Vec2f(u[lane], v[lane]), alone.nextPair());
                    PathRandom first(9, x[lane], y[lane], 0);
                    (void)first.nextPair();
                    EXPECT_EQ(randoms[lane].state(), first.state());
                }
            }
}

TEST(PathRandom, SamplesOfAPixelAreANetInEveryCall) {
    for (const bool ofPicture : {false, true})
        for (int pixel = 0; pixel < 20; ++pixel) {
            std::array<std::vector<Vec2f>, 5> calls;
            std::vector<Vec2f> singles;
            for (int sample = 0; sample < 16; ++sample) {
                PathRandom random = ofPicture ? PathRandom::ofPicture(3, 7 * pixel, pixel, sample, 13)
                                              : PathRandom(3, 7 * pixel, pixel, sample);
                for (auto& call : calls) call.push_back(random.nextPair());
                singles.emplace_back(random.next(), static_cast<float>(sample) / 16);
            }
            for (const auto& call : calls) EXPECT_TRUE(isNet(call)) << ofPicture << " " << pixel;
            std::set<int> intervals;
            for (const Vec2f& single : singles) intervals.insert(static_cast<int>(single.x * 16));
            EXPECT_EQ(intervals.size(), 16u);
        }
}

TEST(PathRandom, SamplesOfSquaresOfPixelsAreANetToo) {
    for (const int side : {2, 4, 16})
        for (const int samples : {1, 4}) {
            std::vector<Vec2f> first, third;
            for (int y = 0; y < side; ++y)
                for (int x = 0; x < side; ++x)
                    for (int sample = 0; sample < samples; ++sample) {
                        PathRandom random = PathRandom::ofPicture(11, 48 + x, 256 + y, sample, samples);
                        first.push_back(random.nextPair());
                        random.nextPair();
                        third.push_back(random.nextPair());
                    }
            EXPECT_TRUE(isNet(first)) << side << " " << samples;
            EXPECT_TRUE(isNet(third)) << side << " " << samples;
        }
    // With the largest number of samples the pixels' numbers still fit.
    EXPECT_NE(PathRandom::ofPicture(1, 63, 63, 0, 1 << 20).state(),
              PathRandom::ofPicture(1, 62, 63, 0, 1 << 20).state());
    EXPECT_NE(PathRandom::ofPicture(1, 0, 0, 0, 1).state(), PathRandom::ofPicture(1, 256, 0, 0, 1).state());
}

// Over seeds each number is even, and two of neighbouring pixels' or of two calls have no more to do with each other
// than that they are not in one interval.
TEST(PathRandom, IsEvenOverSeeds) {
    constexpr int kSeeds = 4000;
    double sum = 0, squares = 0, product = 0;
    for (int seed = 0; seed < kSeeds; ++seed) {
        PathRandom random = PathRandom::ofPicture(static_cast<std::uint64_t>(seed), 5, 9, 1, 4);
        const double a = random.next(), b = random.next();
        sum += a, squares += a * a, product += (a - .5) * (b - .5);
    }
    EXPECT_NEAR(sum / kSeeds, .5, 4 * std::sqrt(1 / 12. / kSeeds));
    EXPECT_NEAR(squares / kSeeds, 1 / 3., 4 * std::sqrt(4 / 45. / kSeeds));
    EXPECT_NEAR(product / kSeeds, 0, 4 / 12. / std::sqrt(kSeeds));
}

/// Variance of the means of squares of pixels, over what independent pixels would leave of theirs.
double clumping(const std::vector<double>& errors, int width, int side) {
    double own = 0, ofSquares = 0;
    const int height = static_cast<int>(errors.size()) / width;
    for (const double e : errors) own += e * e / static_cast<double>(errors.size());
    for (int y = 0; y < height; y += side)
        for (int x = 0; x < width; x += side) {
            double mean = 0;
            for (int i = 0; i < side * side; ++i)
                mean += errors[static_cast<std::size_t>((y + i / side) * width + x + i % side)] / (side * side);
            ofSquares += mean * mean * side * side / static_cast<double>(errors.size());
        }
    return ofSquares / (own / (side * side));
}

// An evenly lit wall of two lights' area sources would do as well: here the sky, half of which a wall hides. The noise
// left over squares of pixels is a fraction of that of independent samples.
TEST(PathRandom, ErrorsOfNeighboursCancel) {
    LightScene s("OrthoViewpoint { fieldOfView [ -.01 -.01 .01 .01 ] } Background { skyColor 1 1 1 } " +
                     square(9, matte("1 1 1")) + "Transform { translation 0 5 0 rotation 1 0 0 1.5707963 children " +
                     square(20, matte("0 0 0")) + " } ",
                 64, 64);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.colorSpace = ColorSpace::linear;
    s.options.settings.samplesPerPixel = 4;
    const Picture picture = s.picture();
    std::vector<double> errors;
    double mean = 0;
    for (const Vec4f& pixel : picture.pixels) mean += double{pixel.g} / static_cast<double>(picture.pixels.size());
    for (const Vec4f& pixel : picture.pixels) errors.push_back(double{pixel.g} - mean);
    EXPECT_GT(mean, .2);
    EXPECT_LT(mean, .9);
    EXPECT_LT(clumping(errors, 64, 2), .75);
    EXPECT_LT(clumping(errors, 64, 4), .4);
    EXPECT_LT(clumping(errors, 64, 8), .25);
}

}  // namespace
}  // namespace rtsg
