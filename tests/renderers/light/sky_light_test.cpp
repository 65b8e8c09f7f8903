// Skies by importance: densities that are whole, small suns and caps that one sample finds.
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/irradiance.h>
#include <rtsg/renderers/space_texture.h>

#include "lighting/sky_light.h"
#include "renderers/light/light_scene.h"
#include "texture/bsdf.h"

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

/// White within an angle of the zenith, or of the nadir, and black beyond.
std::string capped(double angle, bool below) {
    return fmt::format("Background {{ {0}Color [1 1 1, 1 1 1, 0 0 0] {0}Angle [{1} {1}] }}\n", below ? "ground" : "sky",
                       angle);
}

// E = pi sin^2 of a white cap's half angle, from that of a tent to a fifth of a sun's; so the mean of a picture.
TEST(SkyBands, ASmallCapGivesAllItsLight) {
    for (const double angle : {.1, .02, .01, .0047, .002, .001})
        for (const bool below : {false, true}) {
            SCOPED_TRACE(fmt::format("{} {}", angle, below));
            const double expected = kPi * std::pow(std::sin(angle), 2);
            LightScene s(capped(angle, below));
            LightTracer tracer;
            s.world->add(tracer);
            const auto found = measureIrradiance(*tracer.latest(), s.world->rays(), {0, 0, 0}, {0, below ? -1 : 1, 0});
            ASSERT_TRUE(found);
            EXPECT_NEAR(found->luminous, expected, 1e-4 * expected);
            EXPECT_LE(found->luminousInterval, 1e-3 * expected);
        }
    const std::string floor =
        "Viewpoint { position 0 1 0 orientation 1 0 0 -1.5707963 fieldOfView .02 }\n"
        "Transform { rotation 1 0 0 -1.5707963 children " +
        square(5, "material Material { diffuseColor 1 1 1 }") + "}";
    for (const double error : {0., .01}) {
        LightScene s(capped(.0047, false) + floor, 16, 16);
        s.options.settings.integrator = Integrator::path;
        s.options.settings.samplesPerPixel = 16, s.options.settings.error = error;
        for (const Vec4f& pixel : s.picture().pixels) ASSERT_NEAR(pixel.g / 2.20898e-5, 1, 1e-3);
    }
}

// Colours that run into each other, through all bands, by Simpson's rule in double; a density that is whole, and that
// of what is chosen. One pixel's picture hides a part.
TEST(SkyBands, DensitiesAreWholeAndThoseOfSamples) {
    Sky sky;
    sky.skyColors = {{1, .9f, .8f}, {.2f, .3f, .9f}, {.6f, .7f, .8f}, {0, 0, 0}};
    sky.skyAngles = {.01f, .8f, 1.7f};
    sky.groundColors = {{9, 9, 9}, {.1f, 0, 0}, {0, .2f, 0}};
    sky.groundAngles = {.003f, 1.2f};
    sky.localFromWorld = glm::mat3(0, 0, 1, 1, 0, 0, 0, 1, 0);
    for (const bool hidden : {false, true}) {
        if (hidden) {
            auto grey = Texture::fromFloats({Vec4f(.5f, .5f, .5f, 1)}, 1, 1, 3, Texture::Content::color);
            ASSERT_TRUE(grey);
            sky.panorama[2] = std::make_shared<const Texture>(std::move(*grey));
        }
        const SkyLight light(sky);
        double whole = 0, radiance = 0;
        const auto at = [&](double angle, double rotation) {
            const Vec3f d =
                glm::transpose(sky.localFromWorld) * Vec3f(Vec3d(std::sin(angle) * std::cos(rotation), std::cos(angle),
                                                                 std::sin(angle) * std::sin(rotation)));
            return std::pair{double{light.density(d)}, double{sky.color(d, ColorSpace::linear).g}};
        };
        constexpr int kSteps = 3000, kRotations = 96;
        const double ends[] = {0, .01, .8, 1.7, kPi - 1.2, kPi - .003, kPi};
        for (std::size_t band = 0; band + 1 < std::size(ends); ++band)
            for (int i = 0; i < kSteps; ++i)
                for (int j = 0; j < kRotations; ++j) {
                    const double step = (ends[band + 1] - ends[band]) / kSteps, angle = ends[band] + (i + .5) * step;
                    const auto [density, color] = at(angle, 2 * kPi * (j + .5) / kRotations);
                    const double solid = std::sin(angle) * step * 2 * kPi / kRotations;
                    whole += density * solid, radiance += color * solid;
                }
        EXPECT_NEAR(whole, 1, hidden ? 5e-3 : 1e-4);
        std::mt19937 random(4);
        std::uniform_real_distribution<float> unit(0, 1);
        double sum = 0, squares = 0;
        int others = 0;  // on a ring's edge, where rounding chooses
        constexpr int kDraws = 100'000;
        for (int i = 0; i < kDraws; ++i) {
            const auto choice = light.sample(unit(random), unit(random));
            ASSERT_NEAR(glm::length(choice.direction), 1, 1e-5);
            others += std::abs(choice.density - light.density(choice.direction)) > 1e-3f * choice.density;
            const double value = double{sky.color(choice.direction, ColorSpace::linear).g} / double{choice.density};
            sum += value, squares += value * value;
        }
        EXPECT_LT(others, kDraws / 1000);
        const double mean = sum / kDraws, deviation = std::sqrt(squares / kDraws - mean * mean);
        EXPECT_NEAR(mean, radiance, 5 * deviation / std::sqrt(kDraws) + 2e-3 * radiance);
        EXPECT_LT(deviation / mean, hidden ? .7 : .5);
    }
}

/// The light of one white pixel of a picture with `width` x `height`, bilinear between its neighbours, about its middle
/// and how much of a picture each part there stands for.
template <class Spread>
double ofOnePixel(int width, int height, int x, int y, const Spread& spread) {
    constexpr int kSteps = 200;
    double sum = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
        const double dx = 2 * (i % kSteps + .5) / kSteps - 1, dy = 2 * (i / kSteps + .5) / kSteps - 1;
        const double up = y == height - 1 && dy > 0 ? 1 : 1 - std::abs(dy);  // beyond the last row there is that row
        if ((y + .5 + dy) / height < 1)
            sum += (1 - std::abs(dx)) * up * spread((x + .5 + dx) / width, (y + .5 + dy) / height);
    }
    return sum * 4 / kSteps / kSteps / width / height;
}

/// The estimate from `sky`'s own samples, and the deviation of one.
struct Chosen {
    double mean = 0, deviation = 0;
    template <class F>
    Chosen(const SkyLight& light, const F& green) {
        std::mt19937 random(7);
        std::uniform_real_distribution<float> unit(0, 1);
        double squares = 0;
        constexpr int kDraws = 200'000;
        for (int i = 0; i < kDraws; ++i) {
            const auto choice = light.sample(unit(random), unit(random));
            const double value = double{green(choice.direction)} / double{choice.density};
            mean += value / kDraws, squares += value * value / kDraws;
        }
        deviation = std::sqrt(squares - mean * mean) / std::sqrt(double{kDraws});
    }
};

// In pictures with more pixels than there are cells, and in panoramas beside the pole, where all are slivers.
TEST(SkyLight, NoPixelIsTooSmall) {
    constexpr int kWide = 8192, kHigh = 4;
    std::vector<Vec4f> pixels(std::size_t{kWide} * kHigh, Vec4f(0, 0, 0, 1));
    pixels[kWide + 5003] = Vec4f(1);
    auto top = Texture::fromFloats(std::move(pixels), kWide, kHigh, 3, Texture::Content::color);
    ASSERT_TRUE(top);
    Sky sky;
    sky.panorama[4] = std::make_shared<const Texture>(std::move(*top));
    const Chosen cube(SkyLight(sky), [&](const Vec3f& d) { return sky.color(d, ColorSpace::linear).g; });
    const double expected = ofOnePixel(kWide, kHigh, 5003, 1, [](double s, double t) {
        return 4 / std::pow(1 + std::pow(2 * s - 1, 2) + std::pow(2 * t - 1, 2), 1.5);
    });
    EXPECT_NEAR(cube.mean, expected, 5 * cube.deviation + .002 * expected);
    EXPECT_LT(cube.deviation, .02 * expected);

    constexpr int kAround = 4096, kDown = kAround / 2;
    for (const int row : {kDown - 1, kDown - 2, kDown - 5, kDown / 2}) {
        SCOPED_TRACE(row);
        std::vector<std::uint8_t> grey(std::size_t{kAround} * kDown);
        grey[std::size_t(row) * kAround + 1303] = 255;
        auto created = Texture::fromBytes(grey, kAround, kDown, 1);
        ASSERT_TRUE(created);
        const auto picture = SpaceTexture::ofPicture(std::make_shared<const Texture>(std::move(*created)));
        ASSERT_TRUE(picture);
        const auto radiance = [&](const Vec3f& d, float footprint) {
            // A texture's footprint is a share of the mean of its sides.
            return Vec3f(picture->sample(d, footprint / std::numbers::sqrt2_v<float>, {}, ColorSpace::linear));
        };
        const SkyLight light(nullptr, {{trace::FarLight::Shape::panorama, kDown, glm::mat3(1), radiance}});
        const Chosen round(light, [&](const Vec3f& d) { return radiance(d, 0).g; });
        const double whole =
            ofOnePixel(kAround, kDown, 1303, row, [](double, double t) { return 2 * kPi * kPi * std::sin(kPi * t); });
        EXPECT_NEAR(round.mean, whole, 5 * round.deviation + .002 * whole);
        EXPECT_LT(round.deviation, .02 * whole);
    }
}

// Where a light tells what is at a place of its picture, nobody asks it for directions, which give the same but for
// their rounding: in panoramas and cubes of bytes and of floats.
TEST(SkyLight, PlacesOfPicturesGiveWhatTheirDirectionsGive) {
    const auto pictureOf = [](int wide, int high, bool floats, unsigned seed) {
        std::mt19937 random(seed);
        const std::size_t count = std::size_t(wide) * std::size_t(high);
        if (!floats) {
            std::vector<std::uint8_t> bytes(3 * count);
            for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
            return std::make_shared<const Texture>(*Texture::fromBytes(bytes, wide, high, 3));
        }
        std::vector<Vec4f> pixels(count);
        for (Vec4f& pixel : pixels) pixel = {random() % 100, random() % 100, random() % 100, 100};
        return std::make_shared<const Texture>(
            *Texture::fromFloats(std::move(pixels), wide, high, 3, Texture::Content::color));
    };
    for (const bool round : {true, false})
        for (const bool floats : {true, false}) {
            SCOPED_TRACE(fmt::format("round {} floats {}", round, floats));
            std::array<std::shared_ptr<const Texture>, 6> sides;
            for (unsigned side = 0; side < 6; ++side) sides[side] = pictureOf(64, 64, floats, side);
            const auto picture = round ? SpaceTexture::ofPicture(pictureOf(128, 64, floats, 9))
                                       : Result<SpaceTexture>(SpaceTexture::cube(sides));
            ASSERT_TRUE(picture);
            trace::FarLight byDirection, byPosition;
            byDirection.shape = byPosition.shape =
                round ? trace::FarLight::Shape::panorama : trace::FarLight::Shape::cube;
            byDirection.detail = byPosition.detail = 64;
            byDirection.radiance = [&](const Vec3f& d, float footprint) {
                return Vec3f(picture->sample(d, footprint, {}, ColorSpace::linear));
            };
            byPosition.inPicture = [&](std::size_t side, Vec2f point, float footprint) {
                return Vec3f(picture->sampleSide(side, point, footprint, {}, ColorSpace::linear));
            };
            const SkyLight one(nullptr, {byDirection}), other(nullptr, {byPosition});
            EXPECT_NEAR(other.unevenness(), one.unevenness(), 1e-4 * one.unevenness());
            std::mt19937 random(3);
            std::normal_distribution<float> normal;
            for (int i = 0; i < 1000; ++i) {
                const Vec3f d = glm::normalize(Vec3f(normal(random), normal(random), normal(random)));
                EXPECT_NEAR(other.density(d), one.density(d), 1e-3 * one.density(d) + 1e-5);
            }
        }
}

// A table gives the last picture's sky as long as nothing of it is other.
TEST(SkyTable, KeepsASkyUntilItChanges) {
    trace::SkyTable table;
    Sky sky = sunny(4, 9);
    const auto of = [&](const Sky* background, std::vector<trace::FarLight> more) {
        return trace::SkyTable::of(&table, background, std::move(more));
    };
    const auto first = of(&sky, {});
    EXPECT_EQ(of(&sky, {}), first);
    const Sky copy = sky;
    EXPECT_EQ(of(&copy, {}), first);
    EXPECT_NE(trace::SkyTable::of(nullptr, &sky, {}), first);
    std::vector<Sky> others(5, sky);
    others[0].skyColors[0] = Vec3f(.1f);
    others[1].localFromWorld = glm::mat3(1);
    others[2].panorama[3] = others[2].panorama[2];
    others[3].alpha = .5f;
    others[4].skyColors.emplace_back(1), others[4].skyAngles.push_back(1);
    for (const Sky& other : others) {
        const auto last = of(&sky, {}), now = of(&other, {});
        EXPECT_NE(now, last);
        EXPECT_EQ(of(&other, {}), now);
    }
    trace::FarLight far;
    far.radiance = [](const Vec3f&, float) { return Vec3f(1); };
    far.source.irradiance.emplace();
    const auto lit = of(nullptr, {far});
    EXPECT_EQ(of(nullptr, {far}), lit);
    EXPECT_NE(of(&sky, {far}), lit);
    const auto again = of(nullptr, {far});
    far.color = Vec3f(.5f);
    EXPECT_NE(of(nullptr, {far}), again);
    EXPECT_NE(of(nullptr, {far, far}), of(nullptr, {far}));
}

// Through pictures: a spot that moves and dims is where, and as bright as, it is.
TEST(SkyTable, PicturesFollowTheBackground) {
    LightScene s(
        "DEF SKY Background { skyColor [1 1 1, 1 1 1, 0 0 0] skyAngle [.01 .01] }\n"
        "Viewpoint { position 0 1 0 orientation 1 0 0 -1.5707963 fieldOfView .02 }\n"
        "Transform { rotation 1 0 0 -1.5707963 children " +
            square(5, "material Material { diffuseColor 1 1 1 }") + "}",
        16, 16);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = 16;
    const auto shows = [&](double angle) {
        EXPECT_NEAR(s.picture().pixels[100].g / std::pow(std::sin(angle), 2), 1, 2e-3);
    };
    shows(.01);
    shows(.01);
    ASSERT_TRUE(s.scene.set(s.node("SKY"), x3d::Background::skyAngle, Array<float>{.02f, .02f}));
    s.scene.newFrame(1);
    shows(.02);
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
/// The light on a floor from the white pixel, which is bilinear between its neighbours, in double precision; `shown` is
/// that of light from a direction above a floor in z, times pi, its cosine included.
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
