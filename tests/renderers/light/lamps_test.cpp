// Many PointLights and SpotLights: one of them asked at each surface gives the light of all.
#include <cmath>
#include <random>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

std::string lamps(int count) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> at(-3, 3), high(.3, 2), fraction(.1, 1);
    std::string body;
    for (int i = 0; i < count; ++i) {
        const std::string position = fmt::format("location {} {} {} color {} .5 1 intensity {}", at(random),
                                                 high(random), at(random), fraction(random), 4.0 / count);
        if (i % 3 == 0)
            body += fmt::format("SpotLight {{ {} direction .3 -1 .2 cutOffAngle {} beamWidth .2 attenuation 0 1 0 }}\n",
                                position, i % 2 ? .7 : 1.570796);
        else
            body += fmt::format("PointLight {{ {} attenuation {} radius {} }}\n", position,
                                i % 3 == 1 ? "1 0 0" : "0 0 1", i % 5 ? 100 : 2);
    }
    return body;
}

// A floor, a clear pane and a black box: no light goes between surfaces, so that whitted, which asks all lights, shows
// what the mean over paths is.
TEST(Lamps, OneOfManyIsAllOfThemInTheMean) {
    const std::string items =
        "Viewpoint { position 0 5 0 orientation 1 0 0 -1.5707963 fieldOfView .9 }\n"
        "Transform { rotation 1 0 0 -1.5707963 children " +
        square(9, "material Material { diffuseColor .7 .7 .7 specularColor .3 .3 .3 ambientIntensity 0 }") +
        "}\nTransform { translation .5 .2 0 children Shape { geometry Box { size .5 .4 1 } appearance Appearance { " +
        matte("0 0 0") + " } } }\nTransform { translation -1.5 .25 0 rotation 1 0 0 -1.5707963 children " +
        square(.5, "material Material { diffuseColor 0 0 0 transparency .5 }") + "}\n";
    for (const char* const more :
         {"", "Group { children [ PointLight { global FALSE location 0 1 0 intensity 3 } ] }"}) {
        LightScene s(items + lamps(120) + more, 24, 24);
        s.options.settings.colorSpace = ColorSpace::linear;
        s.options.settings.samplesPerPixel = 64;
        const Picture all = s.picture();
        s.options.settings.integrator = Integrator::path;
        s.options.settings.samplesPerPixel = 256;
        const Picture one = s.picture();
        double expected = 0, mean = 0, squares = 0;
        for (std::size_t i = 0; i < all.pixels.size(); ++i) {
            expected += double(all.pixels[i].g), mean += double(one.pixels[i].g);
            const double off = double(one.pixels[i].g) - double(all.pixels[i].g);
            squares += off * off;
        }
        const auto n = double(all.pixels.size());
        expected /= n, mean /= n;
        EXPECT_GT(expected, .05);
        EXPECT_NEAR(mean, expected, 4 * std::sqrt(squares) / n + 1e-3 * expected);
        EXPECT_LT(std::sqrt(squares / n), .1 * expected) << "of 256 samples";
        // One shadow ray a surface.
        EXPECT_LT(double(s.stats.shadowRays), 1.01 * double(s.stats.primaryRays + s.stats.secondaryRays));
    }
}

TEST(Lamps, FewAreAllAsked) {
    LightScene s("Transform { translation 0 0 -2 children " + square(9, matte("1 1 1")) + "} " + lamps(12), 16, 16);
    s.options.settings.colorSpace = ColorSpace::linear;
    const Picture all = s.picture();
    s.options.settings.integrator = Integrator::path;
    const Picture paths = s.picture();
    for (std::size_t i = 0; i < all.pixels.size(); ++i) EXPECT_NEAR(all.pixels[i].g, paths.pixels[i].g, 1e-5);
}

}  // namespace
}  // namespace rtsg
