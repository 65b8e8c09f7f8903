// The preview of pictures by path: never worse than the plain mean where mirrors are sharp, better where light is even.
#include <rtsg/renderers/path_preview.h>

#include <cmath>
#include <random>

#include <rtsg/renderers/denoise.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

constexpr int kPreviewSide = 64;

const std::string kLitFromAbove =
    "NavigationInfo { headlight FALSE } Viewpoint { position 0 1.5 6 } Background { skyColor [ 1 1 1, "
    ".1 .1 .2 ] skyAngle 1.2 } ";
std::string thing(const std::string& place, const std::string& material, const std::string& geometry) {
    return "Transform { " + place + " children Shape { appearance Appearance { material " + material + " } geometry " +
           geometry + " } } ";
}
/// A mirror with narrow stripes before it, and a matte floor.
std::string mirrors() {
    std::string all = kLitFromAbove +
                      thing("translation 0 1.5 -1",
                            "Material { diffuseColor 0 0 0 metadata MetadataFloat { name \"reflectivity\" reference "
                            "\"RTSG\" value 1 } }",
                            "Box { size 6 4 .1 }") +
                      thing("translation 0 -.55 0", "Material { diffuseColor .7 .7 .7 }", "Box { size 12 .1 12 }");
    for (int i = -6; i <= 6; ++i)
        all += thing(fmt::format("translation {} 1.5 7.5", .5 * i),
                     i % 2 ? "Material { diffuseColor .9 .8 .2 }" : "Material { diffuseColor .1 .2 .6 }",
                     "Box { size .25 3 .1 }");
    return all;
}
std::string matteRoom() {
    return kLitFromAbove +
           thing("translation 0 -.55 0", "Material { diffuseColor .7 .7 .7 }", "Box { size 12 .1 12 }") +
           thing("translation 0 .5 0", "Material { diffuseColor .8 .3 .2 }", "Sphere { }");
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
