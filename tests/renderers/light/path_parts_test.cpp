// The parts that make paths fast change no mean, and their benefit.
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lighting/path_parts.h"
#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using test::LightScene;
using trace::PathParts;

/// Parts as they were, once the test is done.
struct PartsKept {
    PathParts before = trace::pathParts();
    ~PartsKept() { trace::pathParts() = before; }
};

/// Means of pictures of 8 x 8 pixels by so many seeds: their mean, and how much they vary.
struct Spread {
    double mean = 0, variance = 0;
    double error = 0;  // standard error of the mean
};
Spread spreadOf(LightScene& s, const PathParts& parts, int samples) {
    constexpr int kSeeds = 192;
    trace::pathParts() = parts;
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = samples;
    Spread result;
    std::vector<double> means;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        s.options.settings.seed = static_cast<std::uint64_t>(seed);
        const Picture picture = s.picture();
        double sum = 0;
        for (const Vec4f& pixel : picture.pixels) sum += double{pixel.g};
        means.push_back(sum / static_cast<double>(picture.pixels.size()));
        result.mean += means.back() / kSeeds;
    }
    for (const double mean : means) result.variance += std::pow(mean - result.mean, 2) / (kSeeds - 1);
    result.error = std::sqrt(result.variance / kSeeds);
    return result;
}

PathParts without(const std::function<void(PathParts&)>& change) {
    PathParts parts;
    change(parts);
    return parts;
}

// Walls of .5 around an eye that sees no lamp: one near, and forty of as much light, which are far away.
std::string roomOfLamps() {
    std::string text =
        "Viewpoint { position 0 0 .9 fieldOfView .6 }\n"
        "Shape { appearance Appearance { material Material { diffuseColor .73 .73 .73 } } geometry Box { size 2 2 20 "
        "solid FALSE } }\n"
        "Shape { appearance Appearance { material Material { diffuseColor .5 .5 .5 } } geometry Box { size .5 .5 .1 } "
        "}\n";
    const auto lamp = [](double z) {
        return "Transform { translation 0 .99 " + std::to_string(z) +
               " children Shape { appearance Appearance { material Material { diffuseColor 0 0 0 emissiveColor 1 1 1 } "
               "} geometry Box { size .15 .01 .15 } } }\n";
    };
    text += lamp(.6);
    for (int i = 0; i < 40; ++i) text += lamp(-9.5 + .2 * i);
    return text;
}

TEST(PathParts, OfShiningTrianglesLeaveTheMeanAsItIs) {
    const PartsKept kept;
    LightScene s(roomOfLamps(), 8, 8);
    const Spread all = spreadOf(s, {}, 16);
    ASSERT_GT(all.mean, .001);
    const Spread bounces = spreadOf(s, without([](PathParts& p) { p.emitters = false; }), 16);
    const Spread evenly = spreadOf(s, without([](PathParts& p) { p.lightTree = false; }), 16);
    const Spread late = spreadOf(s, without([](PathParts& p) { p.roulette = 0x1p-8f; }), 16);
    for (const auto& [name, one] : {std::pair{"bounces", bounces}, {"evenly", evenly}, {"late", late}})
        EXPECT_NEAR(one.mean, all.mean, 4 * std::hypot(one.error, all.error)) << name;
    // Each is what it says: less is known without. (Bounces alone vary 1.7 times as much, by as many pictures.)
    EXPECT_GT(bounces.variance, 1.4 * all.variance);
    EXPECT_GT(evenly.variance, all.variance);
}

TEST(PathParts, RouletteThatBeginsLateMakesLongerPaths) {
    const PartsKept kept;
    LightScene s(roomOfLamps(), 8, 8);
    (void)spreadOf(s, {}, 4);
    const auto early = s.stats.secondaryRays;
    (void)spreadOf(s, without([](PathParts& p) { p.roulette = 0x1p-8f; }), 4);
    EXPECT_GT(s.stats.secondaryRays, 2 * early);
}

// Walls of .73 in light that comes from everywhere: where chance begins at once, the lengths of the few paths that a
// picture takes are most of its noise.
TEST(PathParts, RouletteAfterSomeBouncesMakesPicturesOfFewerRays) {
    const PartsKept kept;
    LightScene s(
        "Viewpoint { position 0 0 .9 } Shape { appearance Appearance { material Material { diffuseColor .87 .87 .87 } "
        "} "
        "geometry Box { size 2 2 2 solid FALSE } } Transform { translation 0 .99 0 children Shape { appearance "
        "Appearance { material Material { diffuseColor 0 0 0 emissiveColor 1 1 1 } } geometry IndexedFaceSet { "
        "coordIndex [0 1 2 3 -1] coord Coordinate { point [-.3 0 -.3, .3 0 -.3, .3 0 .3, -.3 0 .3] } } } }",
        32, 32);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = 1 << 12;
    const auto raysFor = [&](float error, const PathParts& parts) {
        trace::pathParts() = parts;
        s.options.settings.error = error;
        (void)s.picture();
        return static_cast<double>(s.stats.primaryRays + s.stats.secondaryRays + s.stats.shadowRays);
    };
    const PathParts early = without([](PathParts& p) { p.roulette = 1; });
    EXPECT_LT(raysFor(.03f, {}), .9 * raysFor(.03f, early));
}

TEST(PathParts, OfTheSkyLeaveTheMeanAsItIs) {
    const PartsKept kept;
    LightScene s(
        "Viewpoint { position 0 3 3 orientation 1 0 0 -.785 }\n"
        "Background { skyColor [1 1 1, 1 1 1, .1 .1 .2, .1 .1 .2] skyAngle [.15, .16, 3.1] }\n"
        "Shape { appearance Appearance { material Material { diffuseColor .8 .8 .8 } } geometry Box { size 20 .1 20 } "
        "}\n"
        "Transform { translation 0 .6 0 children Shape { appearance Appearance { material Material { diffuseColor .8 "
        ".5 .5 } } geometry Sphere { radius .5 } } }",
        8, 8);
    const Spread all = spreadOf(s, {}, 16);
    EXPECT_GT(s.stats.shadowRays, 0u);
    const Spread bounces = spreadOf(s, without([](PathParts& p) { p.skyLight = false; }), 16);
    EXPECT_EQ(s.stats.shadowRays, 0u);
    EXPECT_NEAR(bounces.mean, all.mean, 4 * std::hypot(bounces.error, all.error));
}

}  // namespace
}  // namespace rtsg
