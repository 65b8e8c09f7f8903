// Skies by importance: densities that are whole, and a small sun that one sample finds.
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/renderers/space_texture.h>

#include "light/bsdf.h"
#include "light/sky_light.h"
#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;
using trace::SkyLight;

/// A dark sky of `size` squared pixels to a side with one bright one on top and a dim one in front.
Sky sunny(int size, float sun) {
    Sky sky;
    sky.skyColors = {Vec3f(0)};
    for (std::size_t side = 0; side < 6; ++side) {
        std::vector<Vec4f> pixels(static_cast<std::size_t>(size) * static_cast<std::size_t>(size),
                                  Vec4f(.1f, .1f, .1f, 1));
        if (side == 4) pixels[static_cast<std::size_t>(size * (size / 3) + size / 4)] = Vec4f(sun, sun, sun, 1);
        if (side == 0) pixels[static_cast<std::size_t>(size * (size - 1))] = Vec4f(3, 0, 0, 1);
        auto texture = Texture::fromFloats(std::move(pixels), size, size, 3, Texture::Content::color);
        EXPECT_TRUE(texture);
        sky.panorama[side] = std::make_shared<const Texture>(std::move(*texture));
    }
    sky.localFromWorld = glm::mat3(0, 0, 1, 1, 0, 0, 0, 1, 0);
    return sky;
}

// Integrals over the sphere in double, by the cube's sides: the density's is 1, and what is chosen is as bright on
// average as importance says: the integral of light, whatever the random numbers.
TEST(SkyLight, DensitiesAreWholeAndThoseOfSamples) {
    const Sky sky = sunny(64, 500);
    const SkyLight light(sky);
    EXPECT_GT(light.unevenness(), 100);
    constexpr int kSteps = 384;
    double whole = 0, radiance = 0;
    for (int side = 0; side < 6; ++side)
        for (int y = 0; y < kSteps; ++y)
            for (int x = 0; x < kSteps; ++x) {
                const double s = (x + .5) / kSteps, t = (y + .5) / kSteps, a = 2 * s - 1, b = 2 * t - 1;
                const double solid = 4 / std::pow(1 + a * a + b * b, 1.5) / kSteps / kSteps;
                const Vec3f d =
                    glm::transpose(sky.localFromWorld) *
                    cubeDirection(static_cast<CubeSide>(side), {static_cast<float>(s), static_cast<float>(t)});
                whole += solid * light.density(d);
                radiance += solid * sky.color(d, ColorSpace::linear).g;
            }
    EXPECT_NEAR(whole, 1, 2e-3);
    std::mt19937 random(4);
    std::uniform_real_distribution<float> unit(0, 1);
    double sum = 0, squares = 0;
    int others = 0;  // on a cell's edge, where rounding chooses
    constexpr int kDraws = 100'000;
    for (int i = 0; i < kDraws; ++i) {
        const auto choice = light.sample(unit(random), unit(random));
        ASSERT_NEAR(glm::length(choice.direction), 1, 1e-5);
        others += std::abs(choice.density - light.density(choice.direction)) > 1e-3f * choice.density;
        const double value = double{sky.color(choice.direction, ColorSpace::linear).g} / choice.density;
        sum += value, squares += value * value;
    }
    EXPECT_LT(others, kDraws / 1000);
    const double mean = sum / kDraws, deviation = std::sqrt(squares / kDraws - mean * mean);
    EXPECT_NEAR(mean, radiance, 5 * deviation / std::sqrt(kDraws) + 2e-3 * radiance);
    EXPECT_LT(deviation / mean, 0.6);
}

TEST(SkyLight, ABlackSkyGivesNothing) {
    const SkyLight light{Sky()};
    EXPECT_EQ(light.unevenness(), 0);
    EXPECT_EQ(light.sample(.3f, .6f).density, 0);
    EXPECT_EQ(light.density({0, 1, 0}), 0);
}

/// A black panorama with one white pixel of 32 squared on top, over a floor of half.
std::string sunnyScene(const std::string& material, const std::string& more = "") {
    std::string image = "image 32 32 1";
    for (int i = 0; i < 32 * 32; ++i) image += i == 32 * 20 + 12 ? " 255" : " 0";
    return "Viewpoint { position 0 1 0 orientation 1 0 0 -1.5707963 fieldOfView .02 }\nTextureBackground { skyColor 0 "
           "0 0 "
           "topTexture PixelTexture { " +
           image + " } }\n" + more + "Transform { rotation 1 0 0 -1.5707963 children " + square(5, material) + "}";
}
/// What a floor shows of the white pixel, whose light is bilinear between its neighbours, in double; `shown` is that
/// of light from a direction above a floor in z, times pi, its cosine included.
template <class Shown>
double ofTheSun(const Shown& shown) {
    constexpr int kSteps = 400;
    double sum = 0;
    for (int y = 0; y < kSteps; ++y)
        for (int x = 0; x < kSteps; ++x) {
            const double dx = 2 * (x + .5) / kSteps - 1, dy = 2 * (y + .5) / kSteps - 1;  // pixels from its middle
            const double a = 2 * (12.5 + dx) / 32 - 1, b = 2 * (20.5 + dy) / 32 - 1;
            const double solid = 4 / std::pow(1 + a * a + b * b, 1.5);
            sum += (1 - std::abs(dx)) * (1 - std::abs(dy)) * solid * shown(glm::normalize(Vec3d(a, b, 1)));
        }
    return sum * 4 / kSteps / kSteps / 32 / 32 / kPi;
}
double sunnyIrradiance() {
    return ofTheSun([](const Vec3d& d) { return d.z; });
}

struct SkyMean {
    double value = 0, deviation = 0;
};
SkyMean skyMean(const std::string& body, int samples) {
    LightScene s(body, 48, 48);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = samples;
    const Picture p = s.picture();
    SkyMean result;
    double squares = 0;
    for (const Vec4f& pixel : p.pixels) result.value += double{pixel.g}, squares += double{pixel.g} * double{pixel.g};
    const auto n = double(p.pixels.size());
    result.value /= n;
    result.deviation = std::sqrt(std::max(squares / n - result.value * result.value, 0.0));
    return result;
}

// By bounces alone the deviation of one sample is fifteen times the mean. Chosen by cells, of which each holds the mean
// of a light that falls off within it, it is 1.04 times the mean.
TEST(PathSky, ASmallSunIsFoundAtOnce) {
    const double srgb = double{srgbFromLinear(0.5f)}, expected = 0.5 * sunnyIrradiance();
    const SkyMean one = skyMean(sunnyScene(fmt::format("material Material {{ diffuseColor {0} {0} {0} }}", srgb)), 1);
    EXPECT_NEAR(one.value, expected, 4 * one.deviation / 48 + 0.003 * expected);
    EXPECT_LT(one.deviation, 1.2 * expected);
}

// Through a clear pane, in its shadow, below glass, on a rough metal.
TEST(PathSky, IsWhatThingsLetThroughAndSendOn) {
    const double expected = sunnyIrradiance();
    const auto white = [](const std::string& more) {
        return sunnyScene("material Material { diffuseColor 1 1 1 }", more);
    };
    const auto pane = [](const std::string& material) {
        return "Transform { translation 0 2 0 rotation 1 0 0 -1.5707963 children " + square(9, material) + "}\n";
    };
    const SkyMean clear = skyMean(white(pane("material Material { diffuseColor 0 0 0 transparency .5 }")), 64);
    EXPECT_NEAR(clear.value, .5 * expected, 4 * clear.deviation / 48 + .01 * expected);
    EXPECT_LT(clear.deviation, expected);
    EXPECT_LT(skyMean(white(pane("material Material { diffuseColor 0 0 0 }")), 16).value, 1e-6);
    // Glass bends what passes: nothing that is looked for comes through, all that bounces find does.
    const double dark = double{srgbFromLinear(0.1f)};
    const SkyMean glassy = skyMean(
        sunnyScene(
            fmt::format("material Material {{ diffuseColor {0} {0} {0} }}", dark),
            "Transform { translation 0 2 0 children Shape { geometry Box { size 9 .1 9 } appearance Appearance { " +
                glass(1.5) + " } } }\n"),
        256);
    EXPECT_NEAR(glassy.value, .1 * .923 * expected, 4 * glassy.deviation / 48 + .003 * expected);
    // A rough metal sends it on as its function says, found in either way.
    const trace::Bsdf metal = trace::Bsdf::physical(Vec3f(1), 1, .7f);
    const double shown = ofTheSun([&](const Vec3d& d) { return double{metal.value(Vec3f(0, 0, 1), Vec3f(d)).g}; });
    const SkyMean rough = skyMean(sunnyScene("material PhysicalMaterial { metallic 1 roughness .7 }"), 64);
    EXPECT_NEAR(rough.value, shown, 4 * rough.deviation / 48 + .01 * shown);
    EXPECT_LT(rough.deviation, shown);
}

}  // namespace
}  // namespace rtsg
