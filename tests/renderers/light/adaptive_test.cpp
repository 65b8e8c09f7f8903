// Sampling until an error is reached: what is told of the error is what the error is.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "path/adaptive.h"
#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using test::LightScene;

// Two boxes in a room with a panel under its ceiling: soft shadows, edges, light between walls.
const char* const kPanelRoom =
    "Viewpoint { position 0 0 1.9 fieldOfView 1 }\n"
    "Shape { appearance Appearance { material Material { diffuseColor .8 .8 .8 } } geometry Box { size 4 3 4 solid "
    "FALSE } }\n"
    "Transform { translation 0 1.49 0 children Shape { appearance Appearance { material UnlitMaterial { emissiveColor "
    "1 "
    "1 1 } } geometry IndexedFaceSet { coordIndex [0 1 2 3 -1] coord Coordinate { point [-.5 0 -.5, .5 0 -.5, .5 0 .5, "
    "-.5 0 .5] } } } }\n"
    "Transform { translation -.6 -1 -.5 children Shape { appearance Appearance { material Material { diffuseColor .8 "
    ".3 "
    ".2 } } geometry Box { size .8 1 .8 } } }\n"
    "Transform { translation .6 -1 -.5 rotation 0 1 0 .5 children Shape { appearance Appearance { material "
    "PhysicalMaterial { baseColor .2 .5 .8 roughness .6 metallic 0 } } geometry Box { size .8 1.4 .8 } } }\n";

// A mirror ball and shiny walls in such a room: rare bright light.
const char* const kMirrorRoom =
    "Viewpoint { position 0 1 3.6 fieldOfView .7 }\n"
    "Shape { appearance DEF WHITE Appearance { material Material { diffuseColor .85 .85 .85 } } geometry "
    "IndexedFaceSet { solid FALSE coord Coordinate { point [-1 0 1, 1 0 1, 1 0 -1, -1 0 -1, -1 2 1, 1 2 1, 1 2 -1, -1 "
    "2 -1] } coordIndex [0 1 2 3 -1 4 5 6 7 -1 3 2 6 7 -1 0 3 7 4 -1 1 2 6 5 -1] } }\n"
    "Transform { translation 0 1.99 0 children Shape { appearance Appearance { material UnlitMaterial { emissiveColor "
    "8 8 8 } } geometry IndexedFaceSet { solid FALSE coord Coordinate { point [-.3 0 .3, .3 0 .3, .3 0 -.3, -.3 0 -.3] "
    "} coordIndex [0 1 2 3 -1] } } }\n"
    "Transform { translation .3 .45 .2 children Shape { appearance Appearance { material Material { diffuseColor .3 .3 "
    ".3 metadata MetadataSet { name \"RTSG\" value MetadataFloat { name \"reflectivity\" value .8 } } } } geometry "
    "Sphere { radius .45 } } }\n";

void byPaths(LightScene& s, float error, int maximum = 1 << 14) {
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = maximum;
    s.options.settings.error = error;
}

TEST(Adaptive, QuantilesAreThoseOfTheTables) {
    const struct {
        int degrees;
        double quantile;
    } table[] = {{5, 2.5706}, {7, 2.3646}, {10, 2.2281}, {20, 2.0860}, {30, 2.0423}, {120, 1.9799}};
    for (const auto& [degrees, quantile] : table)
        EXPECT_NEAR(trace::studentQuantile(degrees), quantile, 0.002 * quantile) << degrees;
}

// A value that is the same in all samples stays exact, however many there are: in single precision a constant of .3 was
// 2 % too dark after 2^20.
TEST(Adaptive, ManySamplesAddUpToTheirMean) {
    LightScene s(test::square(50, test::unlit(".3 .7 .9")), 2, 2);
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        s.options.settings.integrator = integrator;
        s.options.settings.samplesPerPixel = 1;
        const Vec4f one = s.picture().at(0, 0);
        for (const int samples : {1500, 1 << 18}) {
            s.options.settings.samplesPerPixel = samples;
            const Vec4f many = s.picture().at(0, 0);
            EXPECT_EQ(s.stats.samples, samples);
            EXPECT_EQ(s.stats.primaryRays, 4u * static_cast<unsigned>(samples));
            for (int c = 0; c < 4; ++c) EXPECT_NEAR(many[c] / one[c], 1, 2e-5) << c << ' ' << samples;
        }
    }
}

/// The square of a pixel's relative error, as RenderStats::error has it.
double relativeSquare(const Vec4f& seen, const Vec4f& truth, double floor) {
    int brightest = 0;
    for (int c = 1; c < 3; ++c)
        if (truth[c] > truth[brightest]) brightest = c;
    const double off = (double{seen[brightest]} - truth[brightest]) / (truth[brightest] + floor);
    return off * off;
}

// 200 pictures of other seeds: a pixel's true value lies in its 95 % interval at least 93 times in a hundred, and the
// error that is told is not below the one that there is, nor far above: a sequence's parts differ more than the whole.
TEST(Adaptive, IntervalsHoldTheTruthAsOftenAsTheySay) {
    constexpr int kSide = 8, kSeeds = 200;
    LightScene s(kPanelRoom, kSide, kSide);
    byPaths(s, 0, 1 << 15);
    s.options.settings.seed = 1'000'003;
    const Picture truth = s.picture();
    const double floor = kErrorFloor * averageLight(truth);
    for (const float error : {0.1f, 0.03f}) {
        SCOPED_TRACE(error);
        byPaths(s, error);
        double inside = 0, count = 0, squares = 0, reported = 0;
        for (int seed = 1; seed <= kSeeds; ++seed) {
            s.options.settings.seed = static_cast<std::uint64_t>(seed);
            const Picture p = s.picture();
            ASSERT_EQ(p.interval.size(), p.pixels.size());
            EXPECT_EQ(s.stats.unreached, 0);
            EXPECT_LE(s.stats.error, double{error});
            reported += s.stats.error * s.stats.error;
            for (std::size_t i = 0; i < p.pixels.size(); ++i) {
                for (int c = 0; c < 3; ++c) {
                    const double off = std::abs(double(p.pixels[i][c]) - truth.pixels[i][c]);
                    inside += off <= p.interval[i][c], count += 1;
                }
                squares += relativeSquare(p.pixels[i], truth.pixels[i], floor);
            }
        }
        EXPECT_GT(inside / count, 0.93);
        EXPECT_LT(inside / count, 0.995);
        const double real = std::sqrt(squares / (kSeeds * kSide * kSide)), said = std::sqrt(reported / kSeeds);
        EXPECT_LT(real / said, 1.03);
        EXPECT_GT(real / said, 0.6);
    }
}

// To stop when samples look good makes pictures dark and errors small where light is rare. The mean is that of a
// picture of fixed samples, and neither figure of the error is below the one that there is.
TEST(Adaptive, LuckDoesNotEndAPicture) {
    constexpr int kSide = 12, kSeeds = 60;
    LightScene s(kMirrorRoom, kSide, kSide);
    byPaths(s, 0, 1 << 16);
    s.options.settings.seed = 1'000'003;
    const Picture truth = s.picture();
    const double floor = kErrorFloor * averageLight(truth);
    double expected = 0, sum = 0, squares = 0, reported = 0, noise = 0, off = 0;
    const auto add = [](const Vec4f& p) { return (double{p.r} + p.g + p.b) / 3; };
    for (const Vec4f& p : truth.pixels) expected += add(p) / (kSide * kSide);
    std::vector<double> means;
    byPaths(s, .2f);
    for (int seed = 1; seed <= kSeeds; ++seed) {
        s.options.settings.seed = static_cast<std::uint64_t>(seed);
        const Picture p = s.picture();
        double mean = 0;
        for (std::size_t i = 0; i < p.pixels.size(); ++i) {
            mean += add(p.pixels[i]) / (kSide * kSide);
            const Vec4f d = p.pixels[i] - truth.pixels[i];
            off += (double{d.r} * d.r + double{d.g} * d.g + double{d.b} * d.b) / 3;
            squares += relativeSquare(p.pixels[i], truth.pixels[i], floor);
        }
        EXPECT_NEAR(s.stats.mean / mean, 1, 1e-5);
        EXPECT_LE(s.stats.error, .2f);
        EXPECT_EQ(s.stats.unreached, 0);
        means.push_back(mean), sum += mean;
        reported += s.stats.error * s.stats.error, noise += s.stats.noise * s.stats.noise;
    }
    double spread = 0;
    for (const double mean : means) spread += (mean - sum / kSeeds) * (mean - sum / kSeeds);
    const double error = std::sqrt(spread / (kSeeds * (kSeeds - 1)));
    EXPECT_LT(error / expected, .006);
    EXPECT_NEAR(sum / kSeeds, expected, 3 * error) << "of " << expected;
    EXPECT_LT(std::sqrt(squares / (kSide * kSide) / reported), 1.05);
    EXPECT_LT(std::sqrt(off / (kSide * kSide) / noise), 1.08);
}

TEST(Adaptive, SamplesGrowAsTheSquareOfTheError) {
    LightScene even("Background { skyColor .5 .5 .5 }", 32, 32);
    byPaths(even, 0.01f);
    const Picture p = even.picture();
    EXPECT_EQ(even.stats.samples, 2 * trace::kParts);
    EXPECT_EQ(even.stats.error, 0);
    for (const Vec3f& interval : p.interval) EXPECT_EQ(interval, Vec3f(0));

    LightScene room(kPanelRoom, 32, 32);
    byPaths(room, 0.05f);
    const Picture known = room.picture();
    EXPECT_LE(room.stats.error, 0.05);
    const double samples = room.stats.samples;
    byPaths(room, 0.025f);
    const Picture finer = room.picture();
    EXPECT_GT(room.stats.samples / samples, 1.5);  // points of Sobol's gain more than their root
    EXPECT_LT(room.stats.samples / samples, 5.5);
    // The same whatever the threads.
    byPaths(room, 0.05f);
    room.options.settings.threads = 1;
    EXPECT_EQ(room.picture().pixels, known.pixels);
}

TEST(Adaptive, WhatRanOutOfSamplesIsTold) {
    LightScene s(kPanelRoom, 16, 16);
    byPaths(s, 1e-4f, 64);
    const Picture p = s.picture();
    EXPECT_EQ(s.stats.samples, 64);
    EXPECT_GT(s.stats.unreached, 0.9);
    EXPECT_GT(s.stats.error, 1e-3);
    byPaths(s, 0, 64);
    EXPECT_TRUE(s.picture().interval.empty());
    for (const float wrong : {-1.0f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        byPaths(s, wrong);
        EXPECT_FALSE(s.light->picture(s.options)) << wrong;
    }
}

// Edges of what Whitted's method draws, in both spaces.
TEST(Adaptive, EdgesOfWhittedsMethodToo) {
    LightScene s(
        "Shape { appearance Appearance { material PhysicalMaterial { emissiveColor .7 .5 .3 baseColor 0 0 0 } "
        "} geometry Sphere { radius 2 } }",
        32, 32);
    s.options.settings.samplesPerPixel = 1 << 12;
    for (const ColorSpace space : {ColorSpace::linear, ColorSpace::automatic}) {
        s.options.settings.colorSpace = space;
        s.options.settings.error = 0;
        const Picture truth = s.picture();
        s.options.settings.error = 0.02f;
        const Picture p = s.picture();
        EXPECT_LT(s.stats.samples, s.options.settings.samplesPerPixel);
        EXPECT_EQ(s.stats.unreached, 0);
        double squares = 0;
        for (std::size_t i = 0; i < p.pixels.size(); ++i) {
            squares += relativeSquare(p.pixels[i], truth.pixels[i], kErrorFloor * averageLight(truth));
        }
        EXPECT_LT(std::sqrt(squares / double(p.pixels.size())), 0.02);
    }
}

TEST(Adaptive, IntervalsAreALayerOfExr) {
    LightScene s(kPanelRoom, 16, 16);
    for (const bool path : {true, false}) {
        SCOPED_TRACE(path ? "path" : "whitted, of display values");
        byPaths(s, 0.2f);
        if (!path) s.options.settings.integrator = Integrator::whitted;
        const Picture p = s.picture();
        const auto file = std::filesystem::temp_directory_path() / fmt::format("rtsg-interval-{}.exr", ::getpid());
        ASSERT_TRUE(writePicture(p, file));
        const auto back = readPicture(file);
        ASSERT_TRUE(back) << back.error().format();
        for (std::size_t i = 0; i < p.pixels.size(); ++i)
            EXPECT_EQ(Vec3f(back->pixels[i]), Vec3f(toLinear(p).pixels[i]));
        std::ifstream stream(file, std::ios::binary);
        const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
        EXPECT_NE(bytes.find("interval.R"), std::string::npos);
        std::filesystem::remove(file);
    }
}

}  // namespace
}  // namespace rtsg
