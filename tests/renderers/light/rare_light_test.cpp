// Pictures to an error where light is rare or hidden, and in any unit of light, length and time: no picture is called
// exact before it is.
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <rtsg/renderers/irradiance.h>

#include "path/hidden_light.h"
#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

std::string boxAt(const char* position, const char* size, const std::string& appearance) {
    return fmt::format(
        "Transform {{ translation {} children Shape {{ appearance Appearance {{ {} }} geometry Box {{ size {} }} }} "
        "}}\n",
        position, appearance, size);
}
std::string ballAt(const char* position, double radius, const std::string& appearance) {
    return fmt::format(
        "Transform {{ translation {} children Shape {{ appearance Appearance {{ {} }} geometry Sphere {{ radius {} }} "
        "}} }}\n",
        position, appearance, radius);
}
std::string shining(double radiance) {
    return unlit(fmt::format("{0} {0} {0}", srgbFromLinear(static_cast<float>(radiance))).c_str());
}
const std::string kMatte = matte(".8 .8 .8");

/// A room of two metres, closed on five sides; the eye looks in through the sixth.
std::string fiveWalls() {
    return "Viewpoint { position 0 1 3.4 fieldOfView .7 }\n" + boxAt("0 -.01 0", "2 .02 2", kMatte) +
           boxAt("0 2.01 0", "2 .02 2", kMatte) + boxAt("-1.01 1 0", ".02 2 2", kMatte) +
           boxAt("1.01 1 0", ".02 2 2", kMatte) + boxAt("0 1 -1.01", "2 2 .02", kMatte);
}
std::string shiningPanel(double half, double height, const std::string& appearance) {
    return fmt::format("Transform {{ translation 0 {} 0 rotation 1 0 0 1.5707963 children {} }}\n", height,
                       square(half, appearance));
}

std::string bulb() {
    return fiveWalls() + ballAt("0 1.4 0", .12, glass(1.5)) + ballAt("0 1.4 0", .115, glass(1)) +
           ballAt("0 1.4 0", .01, shining(125));
}
/// A lamp of 2 cm over a floor under a slab.
std::string slab() {
    return "Viewpoint { position 0 2 4 orientation 1 0 0 -.46 fieldOfView .8 }\n" +
           boxAt("0 -.05 0", "3.8 .1 3.8", kMatte) + boxAt("0 .3 0", "3.9 .2 3.9", glass(1.5)) +
           ballAt("1 3 0", .02, shining(2000));
}
std::string pool() {
    return "Viewpoint { position 0 1.2 2.2 orientation 1 0 0 -.45 fieldOfView .8 }\n" +
           boxAt("0 -.51 0", "2 .02 2", kMatte) + boxAt("0 -.25 -1.01", "2 .6 .02", kMatte) +
           boxAt("0 -.25 0", "1.99 .48 1.99", glass(1.33)) + shiningPanel(.25, 2.5, shining(20));
}
/// A lamp behind a wall with a hole of 6 cm.
std::string keyhole() {
    return "Viewpoint { position -.2 1 .9 orientation 0 1 0 .5 fieldOfView 1.2 }\n" + fiveWalls() +
           boxAt("0 1 1.01", "2 2 .02", kMatte) + boxAt(".3 .485 0", ".02 .97 2", kMatte) +
           boxAt(".3 1.515 0", ".02 .97 2", kMatte) + boxAt(".3 1 .515", ".02 .06 .97", kMatte) +
           boxAt(".3 1 -.515", ".02 .06 .97", kMatte) + boxAt(".9 1.5 .5", ".1 .1 .1", shining(8));
}
std::string mirrorBall() {
    return fiveWalls() + shiningPanel(.3, 1.99, shining(8)) + ballAt("0 .5 .2", .45, mirror(".8"));
}
/// A lamp with a picture that has one bright pixel of 256.
std::string brightTexel() {
    std::string pixels;
    for (int i = 0; i < 256; ++i) pixels += i == 119 ? " 0xFFFFFF" : " 0x000000";
    return fiveWalls() +
           shiningPanel(.5, 1.98, unlit("300 300 300") + " texture PixelTexture { image 16 16 3" + pixels + " }");
}
std::string plainRoom() {
    return fiveWalls() + shiningPanel(.5, 1.98, shining(4)) + boxAt("-.3 .5 0", ".5 1 .5", kMatte);
}

void toError(LightScene& s, float error, int maximum = 1 << 14) {
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = maximum, s.options.settings.error = error;
}

const struct {
    const char* name;
    std::string (*scene)();
    bool rare;  // few of the first samples meet its light
} kCases[] = {{"bulb", bulb, true},
              {"slab", slab, true},
              {"pool", pool, true},
              {"keyhole", keyhole, true},
              {"bright texel", brightTexel, true},
              {"mirror ball", mirrorBall, false},
              {"plain room", plainRoom, false}};

// A picture to an error is the one that a picture of as many samples is: it never costs more samples than that, in none
// of these scenes.
TEST(RareLight, SamplesToAnErrorAreThoseOfAnEvenPicture) {
    for (const auto& [name, scene, rare] : kCases) {
        SCOPED_TRACE(name);
        LightScene s(scene(), 16, 12);
        for (const float error : {.5f, 1e-6f}) {
            toError(s, error, 96);
            const Picture known = s.picture();
            const double samples = s.stats.samples;
            ASSERT_LE(samples, 96);
            // Where samples lie depends on how many there may be.
            toError(s, 1e-6f, static_cast<int>(samples));
            const Picture all = s.picture();
            ASSERT_EQ(s.stats.samples, samples);
            toError(s, 0, static_cast<int>(samples));
            const Picture even = s.picture();
            for (std::size_t i = 0; i < all.pixels.size(); ++i)
                for (int c = 0; c < 4; ++c)
                    ASSERT_NEAR(all.pixels[i][c], even.pixels[i][c], 1e-4 * (1 + even.pixels[i][c]));
        }
    }
}

TEST(RareLight, IsNotCalledExactBeforeItIsFound) {
    for (const auto& [name, scene, rare] : kCases) {
        if (!rare) continue;
        for (const float error : {.05f, .5f})
            for (std::uint64_t seed = 1; seed <= 12; ++seed) {
                SCOPED_TRACE(fmt::format("{}, error {}, seed {}", name, error, seed));
                LightScene s(scene(), 32, 18);
                toError(s, error, 16), s.options.settings.seed = seed;
                (void)s.picture();
                EXPECT_GT(s.stats.error, double{error});
                EXPECT_GT(s.stats.unreached, 0);
            }
    }
}

// What is told is at most what was asked, or it is told that it is not; and it is what there is, beside pictures of
// many samples.
TEST(RareLight, AnErrorThatIsReachedIsTheTrueOne) {
    constexpr int kSeeds = 4;
    for (const auto& [scene, error] : {std::pair{&mirrorBall, .3f}, {&pool, 1.f}}) {
        LightScene s(scene(), 12, 8);
        toError(s, 0, 1 << 14);
        s.options.settings.seed = 1'000'003;
        const Picture truth = s.picture();
        const double floor = kErrorFloor * averageLight(truth);
        double squares = 0, reported = 0;
        toError(s, error);
        for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
            s.options.settings.seed = seed;
            const Picture p = s.picture();
            EXPECT_EQ(s.stats.error > double{error}, s.stats.unreached > 0) << seed;
            reported += s.stats.error * s.stats.error / kSeeds;
            for (std::size_t i = 0; i < p.pixels.size(); ++i)
                squares += std::pow((p.pixels[i].g - truth.pixels[i].g) / (truth.pixels[i].g + floor), 2) /
                           (kSeeds * double(p.pixels.size()));
        }
        EXPECT_LT(std::sqrt(squares / reported), 1.1);
    }
}

// ---- what light meets first -----------------------------------------------------------------------------------------

TEST(RareLight, BehindGlassAndMirrorsIsTold) {
    const auto fractionIn = [](const std::string& scene) {
        LightScene s(scene, 16, 16);
        toError(s, 1000, 8);
        (void)s.picture();
        return s.stats.hiddenLight;
    };
    EXPECT_EQ(fractionIn(bulb()), 1);
    EXPECT_EQ(fractionIn(plainRoom()), 0);
    // A disk that its axis meets takes sin^2 of half its angle from a small lamp that shines to all sides.
    const std::string lamp = "Viewpoint { position 0 3 9 } " + ballAt("0 2 0", .01, shining(100));
    const auto disk = [](const std::string& appearance) {
        return "Transform { rotation 1 0 0 -1.5707963 translation 0 1 0 children Shape { appearance Appearance { " +
               appearance + " } geometry Disk2D { outerRadius 1 solid FALSE } } }";
    };
    const double expected = std::pow(std::sin(std::numbers::pi / 8), 2);
    for (const std::string& appearance : {glass(1.5), mirror(".9")})
        EXPECT_NEAR(fractionIn(lamp + disk(appearance)), expected, 4 * std::sqrt(expected / 4096));
    EXPECT_EQ(fractionIn(lamp + disk(kMatte)), 0);
}
TEST(RareLight, WhatPointLightsThrowByGlassAndMirrorsIsReportedAsLost) {
    const auto lostIn = [](const std::string& scene) {
        LightScene s(scene, 16, 16);
        toError(s, 1000, 8);
        (void)s.picture();
        return s.stats.lostLight;
    };
    const std::string eye = "Viewpoint { position 0 3 9 } ", point = "PointLight { location 0 2 0 radius 100 }";
    const std::string aside = "PointLight { location 0 2 40 intensity .5 radius 100 }";  // sees little of it
    const auto disk = [](const std::string& appearance) {
        return "Transform { rotation 1 0 0 -1.5707963 translation 0 1 0 children Shape { appearance Appearance { " +
               appearance + " } geometry Disk2D { outerRadius 1 solid FALSE } } }";
    };
    const double expected = std::pow(std::sin(std::numbers::pi / 8), 2);
    for (const std::string& appearance : {glass(1.5), mirror(".9")}) {
        EXPECT_NEAR(lostIn(eye + point + disk(appearance)), expected, 4 * std::sqrt(expected / 4096));
        EXPECT_NEAR(lostIn(eye + point + aside + disk(appearance)), expected * 2 / 3, 4 * std::sqrt(expected / 4096));
    }
    EXPECT_EQ(lostIn(eye + point + disk(kMatte)), 0);
    // A cone of 30 degrees that the disk of 45 takes whole, and one of 60 of which it takes (1 - cos 45) / (1 - cos
    // 60).
    const auto spot = [](double angle) {
        return fmt::format("SpotLight {{ location 0 2 0 direction 0 -1 0 cutOffAngle {} beamWidth {} radius 100 }}",
                           angle, angle);
    };
    EXPECT_EQ(lostIn(eye + spot(std::numbers::pi / 6) + disk(mirror(".9"))), 1);
    const double part = (1 - std::sqrt(.5)) / .5;
    EXPECT_NEAR(lostIn(eye + spot(std::numbers::pi / 3) + disk(mirror(".9"))), part, 4 * std::sqrt(part / 4096));
    EXPECT_EQ(lostIn(eye + "DirectionalLight { direction 0 -1 0 }" + disk(mirror(".9"))), 0);
}

// A place that sees a lamp through a slab alone: by most seeds no sample of the first ones meets it.
TEST(RareLight, IrradianceOfNothingIsNotReached) {
    LightScene s(slab(), 16, 16);
    LightTracer tracer;
    s.world->add(tracer);
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        IrradianceSettings settings;
        settings.error = .1, settings.samples = 1 << 16, settings.seed = seed;
        const auto found = measureIrradiance(*tracer.latest(), s.world->rays(), {0, .01, 0}, {0, 1, 0}, settings);
        ASSERT_TRUE(found);
        EXPECT_FALSE(found->reached) << seed;
        EXPECT_GT(found->luminousInterval, .1 * found->luminous) << seed;
        EXPECT_GT(found->hiddenLight, 0);
    }
    // In a closed box, with the lamp outside: 0, with an interval, and not reached.
    LightScene closed(boxAt("0 0 0", "1 1 1 solid FALSE", kMatte) + ballAt("0 3 0", .2, shining(10)), 16, 16);
    LightTracer within;
    closed.world->add(within);
    IrradianceSettings few;
    few.samples = 1 << 15;
    const auto dark = measureIrradiance(*within.latest(), closed.world->rays(), {0, .4, 0}, {0, -1, 0}, few);
    ASSERT_TRUE(dark);
    EXPECT_EQ(dark->luminous, 0);
    EXPECT_NEAR(dark->luminousInterval, 3 * kPi * 10 / double(dark->samples), .02 * dark->luminousInterval);
    EXPECT_FALSE(dark->reached);
}

TEST(RareLight, BlackWithoutLightIsExact) {
    LightScene s("Viewpoint { } " + square(3, kMatte), 16, 16);
    toError(s, .1f);
    (void)s.picture();
    EXPECT_EQ(s.stats.error, 0);
    EXPECT_EQ(s.stats.unreached, 0);
    EXPECT_EQ(s.stats.samples, 8);
}

// ---- units ----------------------------------------------------------------------------------------------------------

/// A room of random things, in any unit of light and of length.
class RandomRoom {
  public:
    explicit RandomRoom(std::uint64_t seed) : random_(seed) {
        for (int i = 0; i < 3; ++i) {
            balls_.push_back({at(-.7, .7), at(.2, 1), at(-.7, .7), at(.1, .3)});
            lamps_.push_back({at(-.9, .9), at(1.2, 1.8), at(-.9, .9), at(.02, .3)});
        }
        shiny_ = random_() % 3 == 0;
    }
    std::string text(double light, double length, bool backwards = false) const {
        const auto l = [&](double x, double y, double z) {
            return fmt::format("{} {} {}", x * length, y * length, z * length);
        };
        std::string text = fmt::format("Viewpoint {{ position {} fieldOfView .7 }}\n", l(0, 1, 3.4));
        const auto box = [&](const std::string& position, const std::string& size) {
            text += boxAt(position.c_str(), size.c_str(), kMatte);
        };
        box(l(0, -.01, 0), l(2, .02, 2)), box(l(0, 2.01, 0), l(2, .02, 2)), box(l(0, 1, -1.01), l(2, 2, .02));
        box(l(-1.01, 1, 0), l(.02, 2, 2)), box(l(1.01, 1, 0), l(.02, 2, 2));
        for (const Placed& b : balls_)
            text += ballAt(l(b.x, b.y, b.z).c_str(), b.size * length, shiny_ ? mirror(".7") : kMatte);
        text += shiningPanel(.4 * length, 1.98 * length, shining(8 * light));
        for (std::size_t i = 0; i < lamps_.size(); ++i) {
            const Placed& lamp = lamps_[backwards ? lamps_.size() - 1 - i : i];
            text += fmt::format("PointLight {{ location {} intensity {} attenuation 0 0 {} radius {} }}\n",
                                l(lamp.x, lamp.y, lamp.z), lamp.size * light, 1 / (length * length), 50 * length);
        }
        return text;
    }

  private:
    struct Placed {
        double x, y, z, size;
    };
    double at(double from, double to) { return std::uniform_real_distribution(from, to)(random_); }

    std::mt19937_64 random_;
    std::vector<Placed> balls_, lamps_;
    bool shiny_ = false;
};

struct Sampled {
    Picture picture;
    RenderStats stats;
    Sampled(const std::string& body, std::uint64_t seed, double now = 0) {
        LightScene s(body, 24, 16);
        s.scene.newFrame(now);
        toError(s, .1f), s.options.settings.seed = seed;
        picture = s.picture(), stats = s.stats;
    }
    void expectLike(const Sampled& other, double light, double slack) const {
        EXPECT_EQ(stats.samples, other.stats.samples);
        EXPECT_NEAR(stats.error / other.stats.error, 1, slack);
        EXPECT_EQ(stats.unreached, other.stats.unreached);
        double off = 0, sum = 0;
        for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
            off += std::abs(picture.pixels[i].g / light - other.picture.pixels[i].g);
            sum += double{other.picture.pixels[i].g};
        }
        EXPECT_LT(off / sum, slack);
    }
};

// The same room with lamps a million times weaker or brighter, a thousand times smaller or larger, later, or with its
// lamps in another order, takes the same samples and has the same relative error. Powers of two scale floats exactly;
// colours are encoded, so those of lamps do not.
TEST(RareLight, ErrorsDependOnNoUnit) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        SCOPED_TRACE(fmt::format("seed {}", seed));
        const RandomRoom units(seed);
        const Sampled as(units.text(1, 1), seed);
        EXPECT_LE(as.stats.error, .1f);
        for (const double light : {1e-6, 1e-3, 1e6}) {
            SCOPED_TRACE(fmt::format("light times {}", light));
            Sampled(units.text(light, 1), seed).expectLike(as, light, 5e-3);
        }
        for (const double length : {0x1p-10, 0x1p10}) {
            SCOPED_TRACE(fmt::format("length times {}", length));
            Sampled(units.text(1, length), seed).expectLike(as, 1, 5e-3);
        }
        Sampled(units.text(1, 1), seed, 1e6).expectLike(as, 1, 1e-6);
        Sampled(units.text(1, 1, true), seed).expectLike(as, 1, 1e-3);
    }
}

}  // namespace
}  // namespace rtsg
