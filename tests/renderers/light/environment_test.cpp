// EnvironmentLights against closed forms: spherical harmonics, half spheres of light, furnaces, a small sun; in whitted
// and path.
#include <array>
#include <cmath>
#include <fstream>
#include <random>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/shading.h>

#include "light_scene.h"
#include "lighting/environment.h"
#include "support/temp_folder.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

using namespace test;
using trace::Environment;
using trace::Harmonics;
using trace::sumOf;

/// A panorama of floats, by a function of the direction.
template <class F>
std::shared_ptr<const SpaceTexture> panoramaOf(int height, const F& light) {
    std::vector<Vec4f> pixels;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < 2 * height; ++x) {
            const double above = ((y + .5) / height - .5) * kPi, around = ((x + .5) / height - 1) * kPi;
            const Vec3d d(std::cos(above) * std::sin(around), std::sin(above), -std::cos(above) * std::cos(around));
            pixels.emplace_back(light(d), 1);
        }
    auto texture = Texture::fromFloats(std::move(pixels), 2 * height, height, 3, Texture::Content::color);
    EXPECT_TRUE(texture);
    auto cube = SpaceTexture::ofPicture(std::make_shared<const Texture>(std::move(*texture)));
    EXPECT_TRUE(cube);
    return std::make_shared<const SpaceTexture>(std::move(*cube));
}
Vec3f dome(const Vec3d& d) {
    return d.y > 0 ? Vec3f(1, .5f, .25f) : Vec3f(0);
}
std::vector<Vec3f> somewhere(int count, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::vector<Vec3f> result;
    while (static_cast<int>(result.size()) < count) {
        const Vec3f v(normal(random), normal(random), normal(random));
        if (glm::length(v) > .1f) result.push_back(glm::normalize(v));
    }
    return result;
}

// A light a + b.d lights a matte surface with a + 2/3 b.n (over pi); whichever of the two a node describes.
TEST(Environment, CoefficientsAreThoseOfIrradiance) {
    const double y00 = std::sqrt(1 / (4 * kPi)), y1 = std::sqrt(3 / (4 * kPi));
    const Vec3d a(.6, .5, .4), bx(.1, 0, .05), by(.2, .3, -.1), bz(-.2, .1, 0);
    Harmonics h{};
    h[0] = Vec3f(a * (kPi / y00));
    h[1] = Vec3f(by * (2 * kPi / 3 / y1)), h[2] = Vec3f(bz * (2 * kPi / 3 / y1)), h[3] = Vec3f(bx * (2 * kPi / 3 / y1));
    const Environment light({nullptr, nullptr, h});
    for (const Vec3f& d : somewhere(40, 1)) {
        const Vec3d slope = bx * double{d.x} + by * double{d.y} + bz * double{d.z};
        expectColor(light.radiance(d), a + slope, 1e-5);
        expectColor(light.matte(d), a + slope * (2. / 3), 1e-5);
    }
}

// The five harmonics of degree 2: a light of Y gives an irradiance of pi/4 Y.
TEST(Environment, HarmonicsOfDegreeTwoAreTheStandardOnes) {
    const double k = std::sqrt(15 / (4 * kPi));
    for (std::size_t i = 4; i < 9; ++i) {
        Harmonics h{};
        h[0] = Vec3f(3.5449077f * 3);  // keeps the sum above 0
        h[i] = Vec3f(1);
        for (const Vec3f& v : somewhere(20, 2)) {
            const Vec3d d(v);
            const double values[] = {k * d.x * d.y, k * d.y * d.z, std::sqrt(5 / (16 * kPi)) * (3 * d.z * d.z - 1),
                                     k * d.x * d.z, k / 2 * (d.x * d.x - d.y * d.y)};
            EXPECT_NEAR(sumOf(h, v).x, 3 + values[i - 4], 1e-5) << i;
            EXPECT_NEAR(Environment({nullptr, nullptr, h}).radiance(v).x, 3 / kPi + 4 / kPi * values[i - 4], 1e-5) << i;
        }
    }
}

// A surface that leans by an angle sees (1 + cos) / 2 of a half sphere of light.
TEST(Environment, MatteSurfacesGatherHalfASphere) {
    const Environment light({panoramaOf(64, dome), nullptr, std::nullopt});
    for (const Vec3f& n : somewhere(60, 3))
        expectColor(light.matte(n), Vec3d(1, .5, .25) * ((1 + double{n.y}) / 2), .006);
}

// A picture of irradiance alone: matte surfaces show it, and the light that stands for it makes the same.
TEST(Environment, APictureOfIrradianceStandsForItsLight) {
    const auto shown = [](const Vec3d& d) { return Vec3f(static_cast<float>(.5 + .3 * d.y + .1 * d.x * d.z)); };
    const Environment light({nullptr, panoramaOf(64, shown), std::nullopt});
    for (const Vec3f& v : somewhere(40, 4)) {
        const Vec3d d(v);
        EXPECT_NEAR(light.matte(v).x, shown(d).x, .003);
        EXPECT_NEAR(light.radiance(v).x, .5 + 1.5 * .3 * d.y + 4 * .1 * d.x * d.z, .01);
    }
}

/// In double, by a grid over the whole sphere: facets of GGX seen along their normal, each by the light's cosine.
Vec3d blurredByHand(const Vec3d& axis, double roughness) {
    const double a2 = std::pow(roughness, 4);
    const Vec3d x = glm::normalize(glm::cross(std::abs(axis.x) < .9 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0), axis)),
                y = glm::cross(axis, x);
    Vec3d sum(0);
    double weights = 0;
    constexpr int kRings = 2000, kRotations = 256;
    for (int i = 0; i < kRings; ++i) {
        const double angle = (i + .5) / kRings * kPi / 2, c = std::cos(angle / 2), d = c * c * (a2 - 1) + 1;
        const double weight = a2 / (d * d) * std::cos(angle) * std::sin(angle);
        for (int j = 0; j < kRotations; ++j) {
            const double rotation = 2 * kPi * (j + .5) / kRotations;
            const Vec3d light =
                std::sin(angle) * (std::cos(rotation) * x + std::sin(rotation) * y) + std::cos(angle) * axis;
            sum += weight * Vec3d(dome(light));
            weights += weight;
        }
    }
    return sum / weights;
}
TEST(Environment, RoughSurfacesBlurByTheirFacets) {
    const Environment light({panoramaOf(128, dome), nullptr, std::nullopt});
    for (const double roughness : {1. / 6, .5, 2. / 3, 1.})
        for (const double lean : {-.5, -.1, 0., .05, .3, 1.2}) {
            const Vec3d axis(std::cos(lean) * .6, std::sin(lean), std::cos(lean) * .8);
            expectColor(light.blurred(Vec3f(axis), static_cast<float>(roughness)), blurredByHand(axis, roughness), .03);
        }
    expectColor(light.blurred({0, 1, 0}, 0), {1, .5, .25}, 1e-3);
    expectColor(light.blurred({0, -1, 0}, .1f), {0, 0, 0}, 1e-3);
}

/// White above, black below: sides of 64 pixels, so that filtering blurs the horizon by a degree.
const std::string kDome = [] {
    std::string text = "ComposedCubeMapTexture {";
    for (const char* side : {"front", "back", "left", "right"}) {
        text += fmt::format(" {}Texture PixelTexture {{ image 1 64 3", side);
        for (int i = 0; i < 64; ++i) text += i < 32 ? " 0" : " 0xFFFFFF";
        text += " }";
    }
    return text +
           " topTexture DEF TOP PixelTexture { image 1 1 3 0xFFFFFF } bottomTexture PixelTexture { image 1 1 3 0 } }";
}();
const std::string kBackground = "Background { skyColor 0 0 1 }\n";

Vec3f centerOf(LightScene& s, Integrator integrator, int samples = 1) {
    s.options.settings.integrator = integrator;
    s.options.settings.colorSpace = ColorSpace::linear;
    s.options.settings.samplesPerPixel = samples;
    return s.center();
}

// White light from everywhere, which is what a node without pictures gives: a matte surface shows its colour, in each
// space, and a mirror of metal the light; the camera sees the Background.
TEST(EnvironmentLight, WithoutPicturesIsWhiteFromEverywhere) {
    for (const auto integrator : {Integrator::whitted, Integrator::path}) {
        LightScene matteOne(kBackground + "EnvironmentLight { color .5 1 1 intensity .8 }" +
                            square(9, "material PhysicalMaterial { baseColor 0 0 0 roughness 1 metallic 1 }"));
        LightScene plain(kBackground + "EnvironmentLight { color .5 1 1 intensity .8 }" + square(9, matte("1 1 1")));
        const bool random = integrator == Integrator::path;
        expectColor(centerOf(plain, integrator, random ? 64 : 1), {.4, .8, .8}, random ? 1e-3 : 1e-5);
        expectColor(centerOf(matteOne, integrator, random ? 4096 : 1), {0, 0, 0},
                    .05);  // black metal: but for its grazing facets
        LightScene nothing(kBackground + "EnvironmentLight { }");
        expectColor(centerOf(nothing, integrator), {0, 0, 1}, 1e-6);
    }
}
TEST(EnvironmentLight, ShowsAMatteColourInItsOwnSpace) {
    LightScene s("EnvironmentLight { intensity .5 }" + square(9, matte(".8 .4 .2")));
    expectColor(s.center(), {.4, .2, .1}, 1e-5);
}

/// pi BRDF times cosine, over pi and the hemisphere, in double by a grid: what a white sky shows of a material.
double furnace(double base, double metallic, double roughness, double cosView) {
    const Vec3f view(static_cast<float>(std::sqrt(1 - cosView * cosView)), 0, static_cast<float>(cosView));
    double sum = 0;
    constexpr int kRings = 3000, kRotations = 400;
    for (int i = 0; i < kRings; ++i) {
        const double c = (i + .5) / kRings, s = std::sqrt(1 - c * c);
        for (int j = 0; j < kRotations; ++j) {
            const double angle = 2 * kPi * (j + .5) / kRotations;
            const Vec3f light(static_cast<float>(s * std::cos(angle)), static_cast<float>(s * std::sin(angle)),
                              static_cast<float>(c));
            const Vec3f half = glm::normalize(light + view);
            sum += c * metallicRoughness(Vec3f(static_cast<float>(base)), static_cast<float>(metallic),
                                         static_cast<float>(roughness), light.z, view.z, half.z, glm::dot(light, half))
                           .x;
        }
    }
    return sum * 2 / (double{kRings} * kRotations);
}
TEST(EnvironmentLight, WhittedShowsWhatAWhiteSkyShowsOfAMaterial) {
    for (const double metallic : {0., 1.})
        for (const double roughness : {.3, .6, 1.})
            for (const double angle : {0., .9}) {
                LightScene s(
                    fmt::format("EnvironmentLight {{ }} Viewpoint {{ position {} 0 {} orientation 0 1 0 {} }}",
                                3 * std::sin(angle), 3 * std::cos(angle), angle) +
                    square(9, fmt::format("material PhysicalMaterial {{ baseColor .7 .7 .7 metallic {} roughness {} }}",
                                          metallic, roughness)));
                EXPECT_NEAR(centerOf(s, Integrator::whitted).x, furnace(.7, metallic, roughness, std::cos(angle)), .012)
                    << metallic << " " << roughness << " " << angle;
            }
}

// A dome of light: squares that lean by angles, in whitted and in path.
TEST(EnvironmentLight, ADomeLightsByTheLeanOfASurface) {
    for (const double lean : {0., .7, 1.4, 2.2})
        for (const auto integrator : {Integrator::whitted, Integrator::path}) {
            LightScene s(kBackground + "EnvironmentLight { rotation 1 0 0 " + std::to_string(lean) +
                         " color 1 .5 1 specularTexture " + kDome + " }" + square(9, matte("1 1 1")));
            // The dome's pole turns from +y towards the square's normal +z.
            const double expected = (1 + std::sin(lean)) / 2;
            expectColor(centerOf(s, integrator, integrator == Integrator::path ? 4096 : 1), Vec3d(1, .5, 1) * expected,
                        .012);
        }
}

const std::string kMirror = square(9,
                                   "material Material { diffuseColor 0 0 0 metadata MetadataFloat { name "
                                   "\"reflectivity\" reference \"RTSG\" value 1 } }");
constexpr Integrator kBoth[] = {Integrator::whitted, Integrator::path};

// In what surfaces mirror it stands in the place of the Background.
TEST(EnvironmentLight, IsWhatMirrorsShow) {
    for (const auto integrator : kBoth) {
        LightScene s(kBackground + "DEF E EnvironmentLight { rotation 1 0 0 1.5707963 color 1 .5 .25 specularTexture " +
                     kDome + " }" + kMirror);
        expectColor(centerOf(s, integrator), {1, .5, .25}, 1e-4);
        ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::on, false));
        s.scene.newFrame(1);
        expectColor(s.center(), {0, 0, 1}, 1e-4);
    }
}

/// By Rodrigues' formula.
Vec3d turnedAbout(const Vec3d& axis, double angle, const Vec3d& v) {
    return std::cos(angle) * v + std::sin(angle) * glm::cross(axis, v) +
           (1 - std::cos(angle)) * glm::dot(axis, v) * axis;
}

// `rotation`, and then the transforms around the light, turn its pictures: each mirrored direction shows the side that
// it meets when turned back.
TEST(EnvironmentLight, ItsRotationTurnsItsPictures) {
    const char* const colors[] = {"0xFF0000", "0x00FF00", "0x0000FF", "0xFFFF00", "0xFF00FF", "0x00FFFF"};
    const char* const names[] = {"left", "right", "bottom", "top", "front", "back"};
    const Vec3f shown[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}};
    std::string sides;
    for (int i = 0; i < 6; ++i)
        sides += fmt::format("{}Texture PixelTexture {{ image 1 1 3 {} }} ", names[i], colors[i]);
    std::array<int, 6> met{};
    unsigned seed = 10;
    for (const double angle : {.4, 1.3, 2.2, -.9, -2.7, 3., -1.6, .9, -2.1, 1.8}) {
        const auto axes = somewhere(2, seed++);
        const Vec3d own(axes[0]), around(axes[1]);
        const double rotation = 2.3 * angle;
        LightScene s(kBackground +
                     fmt::format("Transform {{ rotation {} {} {} {} children EnvironmentLight {{ rotation {} {} {} {} "
                                 "specularTexture ComposedCubeMapTexture {{ {} }} }} }}",
                                 around.x, around.y, around.z, rotation, own.x, own.y, own.z, angle, sides) +
                     kMirror);
        for (const auto integrator : kBoth) {
            (void)centerOf(s, integrator);
            const Picture picture = s.picture();
            for (int y = 0; y < 33; y += 4)
                for (int x = 0; x < 33; x += 4) {
                    Vec3d d = pixelDirection(x, y, 33, 33, .7854);
                    d = turnedAbout(own, -angle, turnedAbout(around, -rotation, Vec3d(d.x, d.y, -d.z)));
                    const Vec3d a = glm::abs(d);
                    const int axis = a.x > a.y && a.x > a.z ? 0 : a.y > a.z ? 1 : 2;
                    if (a[axis] - std::max(a[(axis + 1) % 3], a[(axis + 2) % 3]) < .03) continue;
                    const int side = 2 * axis + (d[axis] > 0);
                    ++met[static_cast<std::size_t>(side)];
                    EXPECT_LT(glm::distance(Vec3f(picture.at(x, y)), shown[side]), 1e-4f)
                        << names[side] << " " << x << " " << y;
                }
        }
    }
    for (std::size_t i = 0; i < 6; ++i) EXPECT_GT(met[i], 10) << names[i];
}

// A light that is not global lights its group, and mirrors of others show the Background.
TEST(EnvironmentLight, ThatIsNotGlobalIsForItsGroup) {
    const auto scene = [](const std::string& inGroup, const std::string& beside, const char* more) {
        return kBackground + more + "Group { children [ EnvironmentLight { global FALSE color 1 0 0 } " + inGroup +
               " ] } " + beside;
    };
    for (const auto integrator : kBoth) {
        const int samples = integrator == Integrator::path ? 256 : 1;
        LightScene own(scene(square(9, matte("1 1 1")), "", ""));
        expectColor(centerOf(own, integrator, samples), {1, 0, 0}, 1e-3);
        LightScene both(scene(square(9, matte("1 1 1")), "", "EnvironmentLight { color 0 .5 0 }"));
        expectColor(centerOf(both, integrator, samples), {1, .5, 0}, 1e-3);
        LightScene mirrorOfBoth(scene(kMirror, "", "EnvironmentLight { color 0 .5 0 }"));
        expectColor(centerOf(mirrorOfBoth, integrator), {1, .5, 0}, 1e-4);
        LightScene beside(scene("", kMirror, ""));
        expectColor(centerOf(beside, integrator), {0, 0, 1}, 1e-4);
        LightScene matteBeside(scene("", square(9, matte("1 1 1")), ""));
        // In `path` the Background lights what no environment does.
        expectColor(centerOf(matteBeside, integrator, samples), {0, 0, integrator == Integrator::path ? 1 : 0}, 1e-3);
    }
}

// Something between a surface and the light: it is dark in path, and whitted has no shadows of environments, as told.
TEST(EnvironmentLight, IsShadowedInPathAlone) {
    const std::string body = "EnvironmentLight { } Viewpoint { position 0 0 1 } " + square(1, matte("1 1 1")) +
                             "Transform { translation 0 0 2 rotation 0 1 0 3.1415926 children " +
                             square(50, matte("0 0 0")) + " } ";
    LightScene s(body);
    expectColor(centerOf(s, Integrator::whitted), {1, 1, 1}, 1e-5);
    // The black square of 50 m leaves the rim below atan(2 / 49).
    const double seen = 4. / (4 + 49 * 49);
    expectColor(centerOf(s, Integrator::path, 4096), {seen, seen, seen}, .01);
}

// One bright pixel of a sky: a sample that looks for it finds it; bounces would come across one in thousands.
TEST(EnvironmentLight, ASmallSunIsFound) {
    std::string pixels;
    constexpr int kSide = 64;
    for (int i = 0; i < kSide * kSide; ++i) pixels += i == kSide * 40 + 22 ? " 0xFFFFFF" : " 0";
    LightScene s(
        "EnvironmentLight { rotation 1 0 0 1.5707963 intensity 1000 specularTexture ComposedCubeMapTexture { "
        "topTexture PixelTexture { image 64 64 3" +
            pixels + " } } }" + square(9, matte("1 1 1")),
        64, 64);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.colorSpace = ColorSpace::linear;
    s.options.settings.samplesPerPixel = 16;
    const Picture picture = s.picture();
    double sum = 0, squares = 0;
    for (const Vec4f& pixel : picture.pixels) sum += pixel.g, squares += double{pixel.g} * pixel.g;
    const double n = static_cast<double>(picture.pixels.size()), mean = sum / n;
    // The pixel's part of the side: st = (22.5, 40.5) / 64, its light spread by bilinear filtering over its neighbours,
    // which keeps the sum. The side's middle is the square's normal.
    const double x = 2 * 22.5 / 64 - 1, y = 2 * 40.5 / 64 - 1, squared = 1 + x * x + y * y;
    const double solid = 4. / (64 * 64) / std::pow(squared, 1.5), cosine = 1 / std::sqrt(squared);
    EXPECT_NEAR(mean, 1000 * solid * cosine / kPi, .02 * mean);
    EXPECT_LT(std::sqrt(squares / n - mean * mean), .5 * mean) << "per pixel of 16 samples";
}

// Whatever changes, the picture is that of a scene that was so from the start.
TEST(EnvironmentLight, FollowsItsFieldsAndPictures) {
    LightScene s("DEF T Transform { children DEF E EnvironmentLight { specularTexture DEF C " + kDome + " } }" +
                 square(9, matte("1 1 1")));
    const auto seen = [&](double time) {
        s.scene.newFrame(time);
        return centerOf(s, Integrator::whitted).x;
    };
    EXPECT_NEAR(seen(1), .5, .01);
    ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::rotation, Rotation{1, 0, 0, 1.5707963f}));
    EXPECT_NEAR(seen(2), 1, .01);
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::rotation, Rotation{1, 0, 0, 3.1415926f}));
    EXPECT_NEAR(seen(3), 0, .01);
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::rotation, Rotation{0, 1, 0, 0}));
    ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::intensity, .5f));
    EXPECT_NEAR(seen(4), .5, .01);
    // The top's picture, and then the cube, and then the coefficients.
    ASSERT_TRUE(s.scene.set(s.node("TOP"), x3d::PixelTexture::image, (Image{{1, 1, 3, 0}})));
    const float withoutTop = seen(5);
    EXPECT_LT(withoutTop, .25);
    EXPECT_GT(withoutTop, .02);
    ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::specularTexture, NodeId()));
    EXPECT_NEAR(seen(6), .5, 1e-5);
    Array<float> coefficients;
    for (int i = 0; i < 27; ++i) coefficients.push_back(i < 3 ? 3.5449077f * 3.1415927f * .25f : 0);
    ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::diffuseCoefficients, coefficients));
    EXPECT_NEAR(seen(7), .125, 1e-5);
    ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::diffuseTexture, s.node("C")));
    ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::rotation, Rotation{1, 0, 0, .7853982f}));
    EXPECT_NEAR(seen(8), .5, 1e-4) << "a picture of irradiance counts before coefficients; shown as it is";
    EXPECT_TRUE(s.light->diagnostics().all().empty());
}

TEST(EnvironmentLight, SaysWhatItLeavesOut) {
    LightScene s(
        "DEF E EnvironmentLight { shadows TRUE diffuseCoefficients [ 1 2 3 ] specularTexture "
        "GeneratedCubeMapTexture { } }" +
        square(9, matte("1 1 1")));
    expectColor(s.center(), {1, 1, 1}, 1e-5);
    std::string all;
    for (const Diagnostic& d : s.light->diagnostics().all()) all += d.text + "\n";
    EXPECT_EQ(all,
              "EnvironmentLight E: a GeneratedCubeMapTexture is no light that is there beforehand, and is left out\n"
              "EnvironmentLight E: diffuseCoefficients are 27 numbers, not 3, and are left out\n"
              "EnvironmentLight E: its shadows are in pictures by path alone\n");
}

// glTF: what a map of occlusion leaves is left of light from all around, and no lamp changes by it.
TEST(EnvironmentLight, IsLeftByOcclusionMaps) {
    LightScene s("EnvironmentLight { }" +
                 square(9,
                        "material PhysicalMaterial { baseColor .8 .8 .8 metallic 0 roughness 1 occlusionTexture "
                        "PixelTexture { image 1 1 3 0x400000 } }"));
    const double diffuseAndSpecular = furnace(.8, 0, 1, 1), specular = furnace(0, 0, 1, 1);
    EXPECT_NEAR(centerOf(s, Integrator::whitted).x, specular + (diffuseAndSpecular - specular) * 64 / 255, .01);
}

// glTF 2.0, 3.9.4: alpha is coverage, of what a PhysicalMaterial mirrors as of the rest. Metal that is half clear has
// half of the light of an opaque one, and half of its alpha.
TEST(EnvironmentLight, ClearPhysicalMaterialsMirrorByTheirOpacity) {
    for (const auto integrator : kBoth)
        for (const double transparency : {0., .5, .75, 1.}) {
            LightScene s(
                "Background { transparency 1 } EnvironmentLight { color .8 .6 .4 }" +
                square(50, fmt::format("material PhysicalMaterial {{ metallic 1 roughness 0 transparency {} }}",
                                       transparency)));
            s.options.settings.width = s.options.settings.height = 5;
            const int samples = integrator == Integrator::path ? 512 : 1;
            const double fraction = 1 - transparency, noise = integrator == Integrator::path ? .06 : 1e-5;
            expectColor(centerOf(s, integrator, samples), Vec3d(.8, .6, .4) * fraction, noise);
            // Where mirrored rays end in light from far away, that covers as the Background does in whitted.
            if (integrator == Integrator::path) {
                EXPECT_NEAR(s.picture().at(2, 2).a, fraction, 1e-4);
            }
        }
}

// A page of numbers that no file should have.
TEST(EnvironmentLight, SurvivesNumbersThatAreNone) {
    const float wild[] = {NAN, INFINITY, -INFINITY, 3e38f, -1};
    LightScene s(
        "DEF E EnvironmentLight { diffuseCoefficients [ 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 "
        "] }" +
        square(9, "material PhysicalMaterial { roughness .2 }"));
    double time = 0;
    for (const auto integrator : kBoth)
        for (const float x : wild) {
            Array<float> coefficients;
            for (int i = 0; i < 27; ++i) coefficients.push_back(i % 2 ? x : 1);
            ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::diffuseCoefficients, coefficients));
            ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::rotation, Rotation{x, 1, x, x}));
            ASSERT_TRUE(s.scene.set(s.node("E"), x3d::EnvironmentLight::intensity, x));
            s.scene.newFrame(++time);
            const Vec3f seen = centerOf(s, integrator);
            for (int c = 0; c < 3; ++c) EXPECT_TRUE(std::isfinite(seen[c])) << x;
        }
}

// 7.2.2: the bound one; what was unbound is shown no more, and nothing comes in its place by itself.
TEST(BoundBackground, AloneIsShown) {
    LightScene s("DEF A Background { skyColor [ 1 0 0 ] } DEF B Background { skyColor [ 0 1 0 ] }");
    const auto bind = [&](const char* name, bool on) {
        ASSERT_TRUE(s.scene.sendEvent(s.node(name), x3d::Background::set_bind.index, Value(on)));
        s.scene.newFrame(s.scene.now() + 1);
    };
    expectColor(s.center(), {1, 0, 0}, 1e-6);
    bind("A", false);
    expectColor(s.center(), {0, 0, 0}, 1e-6);
    bind("B", true);
    expectColor(s.center(), {0, 1, 0}, 1e-6);
    bind("A", true);
    bind("A", false);
    expectColor(s.center(), {0, 1, 0}, 1e-6);
    bind("B", false);
    expectColor(s.center(), {0, 0, 0}, 1e-6);
}

// Before the first frame nothing is bound: the first one that will be is shown, which none in an Inline is.
TEST(BoundBackground, BeforeTheFirstFrameIsTheFirstOutsideOfInlines) {
    const test::TempFolder folder;
    std::ofstream(folder / "inner.x3dv") << "#X3D V4.0 utf8\nPROFILE Full\nBackground { skyColor [ 1 0 0 ] }\n";
    for (const bool outer : {false, true}) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(
            loadText(scene,
                     std::string("#X3D V4.0 utf8\nPROFILE Full\nViewpoint { } Inline { url \"inner.x3dv\" }\n") +
                         (outer ? "Background { skyColor [ 0 1 0 ] }" : ""),
                     diagnostics, folder.path()));
        SharedWorld world(scene);
        LightRenderer light(world);
        ImageOptions options;
        options.settings.width = options.settings.height = 5;
        for (const bool began : {false, true}) {
            if (began) scene.newFrame(1);
            const auto picture = light.picture(options);
            ASSERT_TRUE(picture);
            expectColor(Vec3f(picture->at(2, 2)), {0, outer ? 1.0 : 0.0, 0}, 1e-6);
        }
    }
}

}  // namespace
}  // namespace rtsg
