// The preview of pictures by path: never worse than the plain mean where mirrors are sharp, better where light is even.
#include <rtsg/renderers/path_preview.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <tuple>

#include <rtsg/renderers/denoise.h>

#include "light_scene.h"
#include "picture/denoise_filter.h"

namespace rtsg {
namespace {

using namespace test;

constexpr int kPreviewSide = 64;

const std::string kLitFromAbove =
    "NavigationInfo { headlight FALSE } Viewpoint { position 0 1.5 6 } Background { skyColor [ 1 1 1, "
    ".1 .1 .2 ] skyAngle 1.2 } ";
std::string item(const std::string& position, const std::string& material, const std::string& geometry) {
    return "Transform { " + position + " children Shape { appearance Appearance { material " + material +
           " } geometry " + geometry + " } } ";
}
/// A mirror with narrow stripes before it, and a matte floor.
std::string mirrors() {
    std::string all = kLitFromAbove +
                      item("translation 0 1.5 -1",
                           "Material { diffuseColor 0 0 0 metadata MetadataFloat { name \"reflectivity\" reference "
                           "\"RTSG\" value 1 } }",
                           "Box { size 6 4 .1 }") +
                      item("translation 0 -.55 0", "Material { diffuseColor .7 .7 .7 }", "Box { size 12 .1 12 }");
    for (int i = -6; i <= 6; ++i)
        all += item(fmt::format("translation {} 1.5 7.5", .5 * i),
                    i % 2 ? "Material { diffuseColor .9 .8 .2 }" : "Material { diffuseColor .1 .2 .6 }",
                    "Box { size .25 3 .1 }");
    return all;
}
std::string matteRoom() {
    return kLitFromAbove + item("translation 0 -.55 0", "Material { diffuseColor .7 .7 .7 }", "Box { size 12 .1 12 }") +
           item("translation 0 .5 0", "Material { diffuseColor .8 .3 .2 }", "Sphere { }");
}

struct Traced : LightScene {
    explicit Traced(const std::string& body) : LightScene(body, kPreviewSide, kPreviewSide) {
        options.settings.integrator = Integrator::path;
        options.keep = false;
    }
    Picture of(int samples, std::uint64_t seed, bool layers = true) {
        options.settings.samplesPerPixel = samples;
        options.settings.seed = seed;
        options.settings.layers = layers ? kLayersOfDenoising : 0;
        return picture();
    }
};

double error(const Picture& picture, const Picture& truth) {
    Picture bare = picture;
    return compare(bare, truth)->rmse;
}

/// The preview of two halves of `samples` together.
PathPreview previewOf(Traced& scene, int samples) {
    PathPreview preview;
    for (std::uint64_t half = 0; half < 2; ++half)
        EXPECT_TRUE(preview.add(scene.of(samples / 2, 10 + half), samples / 2));
    return preview;
}

TEST(PathPreviews, MirrorsAreNeverWorseThanThePlainPicture) {
    Traced scene(mirrors());
    const Picture truth = scene.of(1024, 99, false);
    for (const int samples : {2, 4, 8, 16, 64}) {
        PathPreview preview = previewOf(scene, samples);
        const Picture mean = preview.mean();
        const double plain = error(mean, truth), shown = error(preview.best(), truth);
        EXPECT_LE(shown, plain) << samples;
        EXPECT_NEAR(
            preview.noise(),
            plain * kPreviewSide * kPreviewSide * 3 /
                [&] {
                    double sum = 0;
                    for (const Vec4f& p : truth.pixels) sum += double{p.r} + p.g + p.b;
                    return sum;
                }(),
            .35 * preview.noise())
            << samples;
        // The filter of one picture alone blurs what is mirrored.
        Picture alone = mean;
        alone.layers = scene.of(2, 3).layers;
        ASSERT_TRUE(denoise(alone));
        if (samples >= 16) {
            EXPECT_GT(error(alone, truth), plain) << "else this scene shows nothing";
        }
    }
}

TEST(PathPreviews, EvenLightIsFarBetter) {
    Traced scene(matteRoom());
    const Picture truth = scene.of(1024, 99, false);
    for (const int samples : {2, 8}) {
        PathPreview preview = previewOf(scene, samples);
        const double plain = error(preview.mean(), truth);
        EXPECT_LT(error(preview.best(), truth), .75 * plain) << samples;
        EXPECT_GT(preview.denoised(), .3);
    }
}

TEST(PathPreviews, WithEverMoreSamplesTheyAreTheMean) {
    Traced scene(matteRoom());
    PathPreview preview = previewOf(scene, 2);
    (void)preview.best();
    ASSERT_GT(preview.denoised(), .3);
    // Without a filter of its own this mean is better than what was filtered before.
    ASSERT_TRUE(preview.add(scene.of(400, 5, false), 400));
    EXPECT_EQ(preview.samples(), 402);
    const Picture best = preview.best(), mean = preview.mean();
    EXPECT_EQ(preview.denoised(), 0);
    EXPECT_EQ(best.pixels, mean.pixels);
    // The mean is by the numbers of samples.
    Picture one(2, 1, Vec4f(1)), three(2, 1, Vec4f(5));
    PathPreview plain;
    ASSERT_TRUE(plain.add(one, 1));
    ASSERT_TRUE(plain.add(three, 3));
    EXPECT_EQ(plain.mean().at(1, 0), Vec4f(4));
    EXPECT_EQ(plain.best().at(1, 0), Vec4f(4)) << "it has no layers";
}

struct Stripes {
    int width, height;
    int fromX, toX, fromY, toY;  // where the stripes are
};
/// A flat surface of even light, which the filter finds, with stripes, which it blurs.
Picture stripedHalf(const Stripes& of, unsigned seed) {
    const int width = of.width, height = of.height;
    std::mt19937 random(seed);
    std::normal_distribution<float> noise(0, .15f);
    Picture picture(width, height);
    PictureLayer layer;
    layer.channels = {"Z", "N.X", "N.Y", "N.Z", "albedo.R", "albedo.G", "albedo.B"};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            for (const float v : {3.f, 0.f, 0.f, 1.f, 1.f, 1.f, 1.f}) layer.values.push_back(v);
            const bool striped = x >= of.fromX && x < of.toX && y >= of.fromY && y < of.toY;
            const float light = (striped ? (x % 2 ? .9f : .3f) : .6f) + noise(random) * (striped ? .25f : 1);
            picture.at(x, y) = Vec4f(light, light + .1f * noise(random), light, 1);
        }
    picture.layers.push_back(std::move(layer));
    return picture;
}

/// Which share of each pixel a preview of two halves shows denoised, by tiles in double precision.
class ShownTiles {
  public:
    /// `since`: which share of all samples there was when the filter ran.
    ShownTiles(const Picture& a, const Picture& b, const Picture& cleanA, const Picture& cleanB, double since)
        : across_((a.width + 15) / 16), down_((a.height + 15) / 16) {
        const auto apart = [](const Vec4f& one, const Vec4f& two) {
            double sum = 0;
            for (int c = 0; c < 3; ++c)
                sum += std::pow(std::clamp(double{one[c]}, 0., 1.) - std::clamp(double{two[c]}, 0., 1.), 2);
            return sum;
        };
        std::map<std::pair<int, int>, Vec2d> own;  // squared errors of a tile: plain, denoised
        for (int y = 0; y < a.height; ++y)
            for (int x = 0; x < a.width; ++x) {
                const double noise = apart(a.at(x, y), b.at(x, y));
                const double off = apart(cleanA.at(x, y), b.at(x, y)) + apart(cleanB.at(x, y), a.at(x, y));
                own[{x / 16, y / 16}] += Vec2d(noise / 4, (off - noise) / 2);
            }
        for (int y = 0; y <= down_; ++y)
            for (int x = 0; x <= across_; ++x) {
                Vec2d sum(0);
                for (const auto& [tile, errors] : own) {
                    const int near =
                        std::max(0, 2 - std::abs(tile.first - x)) * std::max(0, 2 - std::abs(tile.second - y));
                    sum += static_cast<double>(near) * errors;
                }
                choice_[{x, y}] = std::max(sum.y, sum.x / 16) < since * sum.x;
            }
    }
    double ofTile(int x, int y) const {
        return choice_.at({std::clamp(x, 0, across_ - 1), std::clamp(y, 0, down_ - 1)});
    }
    /// Whether one more row of tiles, or column, would be judged otherwise than the last one.
    std::pair<bool, bool> edgesCount() const {
        std::pair<bool, bool> count;
        for (int x = 0; x < across_; ++x) count.first |= choice_.at({x, down_}) != ofTile(x, down_);
        for (int y = 0; y < down_; ++y) count.second |= choice_.at({across_, y}) != ofTile(across_, y);
        return count;
    }
    bool anyPlain() const {
        return std::ranges::any_of(choice_, [](const auto& tile) { return tile.second == 0; });
    }
    /// Between the middles of tiles.
    double ofPixel(int x, int y) const {
        const double u = (x + .5) / 16 - .5, v = (y + .5) / 16 - .5;
        const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
        return std::lerp(std::lerp(ofTile(i, j), ofTile(i + 1, j), u - i),
                         std::lerp(ofTile(i, j + 1), ofTile(i + 1, j + 1), u - i), v - j);
    }

  private:
    const int across_, down_;
    std::map<std::pair<int, int>, double> choice_;
};

TEST(PathPreviews, TilesAreJudgedAsTheFormulasSay) {
    // Tiles that are cut, of one row and column of pixels, and whole.
    std::pair<bool, bool> edgesCount;
    for (const Stripes& of : {Stripes{71, 37, 20, 71, 0, 29}, Stripes{65, 33, 0, 45, 0, 29},
                              Stripes{64, 32, 44, 64, 0, 32}, Stripes{32, 64, 0, 32, 44, 64}}) {
        const Picture a = stripedHalf(of, 1), b = stripedHalf(of, 2);
        PathPreview preview;
        ASSERT_TRUE(preview.add(a, 4));
        ASSERT_TRUE(preview.add(b, 4));
        Picture cleanA = a, cleanB = b;
        ASSERT_TRUE(denoiseHalves(a, cleanA, cleanB, {}).value_or(false));
        for (const double samples : {8, 11}) {
            const Picture best = preview.best(), mean = preview.mean();
            const ShownTiles tiles(a, b, cleanA, cleanB, 8 / samples);
            double maximum = 0, sum = 0;
            for (int y = 0; y < of.height; ++y)
                for (int x = 0; x < of.width; ++x) {
                    const double fraction = tiles.ofPixel(x, y);
                    sum += fraction;
                    for (int c = 0; c < 3; ++c) {
                        const double clean = (double{cleanA.at(x, y)[c]} + double{cleanB.at(x, y)[c]}) / 2;
                        const double expected = std::lerp(double{mean.at(x, y)[c]}, clean, fraction);
                        maximum = std::max(maximum, std::abs(expected - double{best.at(x, y)[c]}));
                    }
                }
            EXPECT_LT(maximum, 1e-5) << of.width << " " << samples;
            EXPECT_NEAR(preview.denoised(), sum / of.width / of.height, 1e-6);
            EXPECT_TRUE(tiles.anyPlain()) << "else this picture shows nothing";
            if (of.width % 16 == 0)
                edgesCount.first |= tiles.edgesCount().first, edgesCount.second |= tiles.edgesCount().second;
            // With more samples, but too few for the filter to run again, what it found counts less.
            ASSERT_TRUE(preview.add(stripedHalf(of, 3), 2));
            ASSERT_TRUE(preview.add(stripedHalf(of, 4), 1));
        }
    }
    EXPECT_TRUE(edgesCount.first && edgesCount.second)
        << "else one row of tiles too many, or column, would show nothing";
}

TEST(PathPreviews, HalvesGrowSideBySide) {
    PathPreview preview;
    std::vector<int> asked;
    for (int i = 0; i < 10; ++i) {
        asked.push_back(preview.wanted(8));
        ASSERT_TRUE(preview.add(Picture(2, 2, Vec4f(.5f)), asked.back()));
    }
    EXPECT_EQ(asked, (std::vector<int>{1, 1, 2, 2, 6, 6, 8, 8, 8, 8}));
    EXPECT_EQ(preview.wanted(1), 1);
    preview.clear();
    EXPECT_EQ(preview.samples(), 0);
    EXPECT_EQ(preview.wanted(4), 1);
}

TEST(PathPreviews, NoiseIsWhatTheHalvesTell) {
    std::mt19937 random(3);
    std::normal_distribution<float> noise(.5f, .1f);
    PathPreview preview;
    EXPECT_EQ(preview.noise(), 0);
    for (const int samples : {1, 3}) {  // of one sample each would have twice the deviation
        Picture picture(64, 64);
        for (Vec4f& pixel : picture.pixels)
            for (int c = 0; c < 3; ++c) pixel[c] = .5f + (noise(random) - .5f) / std::sqrt(static_cast<float>(samples));
        ASSERT_TRUE(preview.add(picture, samples));
    }
    EXPECT_NEAR(preview.noise(), .1 / 2 / .5, .005);
}

TEST(PathPreviews, WhatGivesUpIsPlainAndWhatFitsBadlyIsRefused) {
    Traced scene(matteRoom());
    PathPreview preview = previewOf(scene, 2);
    int asked = 0;
    const Picture given = preview.best([&] { return ++asked < 2; });
    EXPECT_EQ(asked, 2);
    EXPECT_EQ(preview.denoised(), 0);
    EXPECT_EQ(given.pixels, preview.mean().pixels);
    (void)preview.best();
    EXPECT_GT(preview.denoised(), 0) << "the next one tries again";
    EXPECT_FALSE(preview.add(Picture(4, 4), 1));
    Picture display(kPreviewSide, kPreviewSide);
    display.space = ColorSpace::display;
    EXPECT_FALSE(preview.add(display, 1));
    EXPECT_EQ(preview.samples(), 2) << "what is refused is not counted";
}

}  // namespace
}  // namespace rtsg
