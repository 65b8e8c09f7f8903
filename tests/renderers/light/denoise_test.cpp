// Denoising: noise goes, edges and textures stay, means are kept, and what may not be filtered is refused.
#include <rtsg/renderers/denoise.h>

#include <cmath>
#include <random>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

/// A picture of one surface by functions of the pixel: depth, normal, albedo, and what it shows.
struct Made {
    Picture picture{64, 64};
    template <class Depth, class Normal, class Albedo, class Light>
    Made(const Depth& depth, const Normal& normal, const Albedo& albedo, const Light& light) {
        PictureLayer layer;
        layer.channels = {"Z", "N.X", "N.Y", "N.Z", "albedo.R", "albedo.G", "albedo.B"};
        for (int y = 0; y < 64; ++y)
            for (int x = 0; x < 64; ++x) {
                const Vec3f n = normal(x, y), a = albedo(x, y);
                for (const float v : {static_cast<float>(depth(x, y)), n.x, n.y, n.z, a.r, a.g, a.b})
                    layer.values.push_back(v);
                picture.at(x, y) = Vec4f(a * static_cast<float>(light(x, y)), 1);
            }
        picture.layers.push_back(std::move(layer));
    }
};
constexpr auto kFlat = [](int, int) { return 3.0; };
constexpr auto kFacing = [](int, int) { return Vec3f(0, 0, 1); };
constexpr auto kWhite = [](int, int) { return Vec3f(1); };

/// Mean and standard deviation of green over columns.
std::pair<double, double> meanOf(const Picture& picture, int first, int last) {
    double sum = 0, squares = 0;
    int count = 0;
    for (int y = 8; y < 56; ++y)
        for (int x = first; x < last; ++x) {
            const double v = picture.at(x, y).g;
            sum += v, squares += v * v, ++count;
        }
    return {sum / count, std::sqrt(std::max(squares / count - sum * sum / count / count, 0.0))};
}

TEST(Denoise, NoiseGoesAndTheMeanStays) {
    std::mt19937 random(7);
    std::exponential_distribution<double> noise(2);  // mean .5, as much deviation: that of a few paths
    Made made(kFlat, kFacing, kWhite, [&](int, int) { return noise(random); });
    const auto [before, roughBefore] = meanOf(made.picture, 8, 56);
    ASSERT_TRUE(denoise(made.picture));
    const auto [after, roughAfter] = meanOf(made.picture, 8, 56);
    EXPECT_NEAR(after, before, .05 * before);
    EXPECT_LT(roughAfter, .15 * roughBefore);
}

// Light of two strengths meets at edges that depth, the normal or the colour show: no more than noise of each side is
// mixed into the other.
TEST(Denoise, EdgesStay) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> noise(-.2, .2);
    const auto light = [&](int x, int) { return (x < 32 ? .3 : 1.) + noise(random); };
    const auto step = [](int x, int) { return x < 32 ? 3.0 : 5.0; };
    const auto bend = [](int x, int) { return x < 32 ? Vec3f(0, 0, 1) : Vec3f(1, 0, 0); };
    for (int kind = 0; kind < 2; ++kind) {
        Made made = kind == 0 ? Made(step, kFacing, kWhite, light) : Made(kFlat, bend, kWhite, light);
        ASSERT_TRUE(denoise(made.picture));
        EXPECT_NEAR(meanOf(made.picture, 31, 32).first, .3, .04) << kind;
        EXPECT_NEAR(meanOf(made.picture, 32, 33).first, 1, .04) << kind;
    }
    // A texture: even light on a surface of two colours.
    Made made(
        kFlat, kFacing, [](int x, int y) { return Vec3f((x / 2 + y / 2) % 2 ? .8f : .1f); },
        [&](int, int) { return .5 + noise(random); });
    ASSERT_TRUE(denoise(made.picture));
    for (int y = 20; y < 40; ++y)
        for (int x = 20; x < 40; ++x)
            EXPECT_NEAR(made.picture.at(x, y).g, ((x / 2 + y / 2) % 2 ? .8 : .1) * .5, .03) << x << " " << y;
}

// A plane that runs away from the eye is one surface, and so is what lies in front of the sky; the sky is left alone.
// A lamp in a ceiling: black, and in the ceiling's plane. Its light stays its own; pixels that show both stay as they
// are.
TEST(Denoise, LampsDoNotRunIntoWhatTheyHangIn) {
    std::mt19937 random(5);
    std::exponential_distribution<double> noise(2);
    const auto albedo = [](int x, int) { return Vec3f(x < 40 ? .7f : x == 40 ? .35f : 0.f); };
    Made made(kFlat, kFacing, albedo, [&](int, int) { return noise(random); });
    for (int y = 0; y < 64; ++y)
        for (int x = 40; x < 64; ++x) made.picture.at(x, y) = Vec4f(Vec3f(x == 40 ? 2.7f : 5.f), 1);
    const double before = meanOf(made.picture, 4, 40).first;
    ASSERT_TRUE(denoise(made.picture));
    const auto [after, rough] = meanOf(made.picture, 4, 40);
    EXPECT_NEAR(after, before, .05 * before);
    EXPECT_LT(rough, .2 * before);
    for (int y = 0; y < 64; ++y)
        for (int x = 40; x < 64; ++x) ASSERT_NEAR(made.picture.at(x, y).g, x == 40 ? 2.7f : 5.f, 1e-4) << x << ' ' << y;
}

TEST(Denoise, SlopesAreOneSurfaceAndTheSkyIsNone) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> noise(0, 1);
    Made made([](int x, int y) { return x < 48 ? 2 + .2 * y : INFINITY; }, kFacing, kWhite,
              [&](int x, int) { return x < 48 ? noise(random) : 7 + noise(random); });
    const Picture before = made.picture;
    ASSERT_TRUE(denoise(made.picture));
    EXPECT_LT(meanOf(made.picture, 8, 40).second, .08);
    EXPECT_NEAR(meanOf(made.picture, 40, 48).first, .5, .05);
    for (int y = 0; y < 64; ++y)
        for (int x = 48; x < 64; ++x) EXPECT_EQ(made.picture.at(x, y), before.at(x, y));
}

// One sample a pixel of a room under a sky, against many: nearer by far.
TEST(Denoise, APathTracedPictureComesNearerToTheTruth) {
    LightScene s(
        "Viewpoint { position 0 1.5 6 } Background { skyColor 1 1 1 } Transform { rotation 1 0 0 -1.5707963 "
        "children " +
            square(6, matte(".7 .7 .7")) +
            " } Transform { translation 0 1 0 children Shape { "
            "appearance Appearance { " +
            matte(".8 .3 .2") + " } geometry Sphere { } } }",
        64, 64);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.colorSpace = ColorSpace::linear;
    s.options.settings.samplesPerPixel = 256;
    const Picture truth = s.picture();
    s.options.settings.samplesPerPixel = 1;
    s.options.settings.layers = kLayersOfDenoising;
    Picture picture = s.picture();
    const auto before = compare(picture, truth);
    ASSERT_TRUE(before);
    ASSERT_TRUE(denoise(picture));
    const auto after = compare(picture, truth);
    ASSERT_TRUE(after);
    EXPECT_LT(after->rmse, .6 * before->rmse);
}

TEST(Denoise, RefusesWhatItMayNotTouch) {
    Picture bare(4, 4);
    EXPECT_FALSE(denoise(bare)) << "no layers";
    Made display(kFlat, kFacing, kWhite, kFlat);
    display.picture.space = ColorSpace::display;
    EXPECT_FALSE(denoise(display.picture));
    Made known(kFlat, kFacing, kWhite, kFlat);
    known.picture.interval.resize(known.picture.pixels.size());
    EXPECT_FALSE(denoise(known.picture));
    // Numbers that are none neither spread nor stay.
    Made wild(kFlat, kFacing, kWhite, [](int x, int y) { return x == 30 && y == 30 ? double{NAN} : .5; });
    ASSERT_TRUE(denoise(wild.picture));
    for (const Vec4f& pixel : wild.picture.pixels) EXPECT_TRUE(std::isfinite(pixel.g));
}

}  // namespace
}  // namespace rtsg
