// MultiTexture's modes and the generators of texture coordinates, against their formulas.
#include <random>

#include <rtsg/core/x3d.h>

#include "light_scene.h"
#include "texture/generated_coordinates.h"

namespace rtsg {
namespace {

using namespace test;

/// One texel, `r g b a` from 0 to 255.
std::string texel(int r, int g, int b, int a) {
    return fmt::format("PixelTexture {{ image 1 1 4 0x{:02X}{:02X}{:02X}{:02X} }}", r, g, b, a);
}
Vec3f seenTexture(const std::string& multi, const char* material = "UnlitMaterial { emissiveColor .8 .6 .4 }") {
    LightScene s(square(10, fmt::format("material {} texture MultiTexture {{ {} }}", material, multi)));
    s.options.settings.colorSpace = ColorSpace::display;
    return s.center();
}
/// Two textures, the first of which replaces all that was before.
Vec3f second(const char* mode, const std::string& a, const std::string& b, const std::string& more = "") {
    return seenTexture(fmt::format("texture [ {} {} ] mode [ \"REPLACE\" \"{}\" ] {}", b, a, mode, more));
}

TEST(MultiTexture, TexturesMultiplyOneAfterTheOther) {
    expectColor(seenTexture("texture [ " + texel(255, 128, 51, 255) + texel(51, 255, 255, 255) + " ]"),
                {.8 * .2, .6 * 128 / 255, .4 * .2}, 1e-5);
}

// Where no material is behind it, it begins with white: on the sides of a TextureBackground.
TEST(MultiTexture, StandsForOnePictureWhereNoSurfaceIs) {
    const std::string two = texel(255, 128, 51, 255) + texel(51, 255, 255, 255);
    const auto sky = [](const std::string& multi, Integrator integrator) {
        LightScene s("TextureBackground { skyColor 0 0 1 frontTexture MultiTexture { " + multi + " } }");
        s.options.settings.integrator = integrator;
        return s.center();
    };
    const auto shown = [](const Vec3d& display, Integrator integrator) {
        return integrator == Integrator::path ? Vec3d(linearFromSrgb(Vec3f(display))) : display;
    };
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        const auto expect = [&](const std::string& multi, const Vec3d& display) {
            expectColor(sky(multi, integrator), shown(display, integrator), 2e-3);
        };
        expect("texture [ " + two + " ]", {51 / 255., 128 / 255., 51 / 255.});
        expect("mode [ \"REPLACE\" \"ADD\" ] texture [ " + two + " ]", {1, 1, 1});
        expect("color 1 0 .4 mode [ \"REPLACE\" \"MODULATE\" ] source [ \"\" \"FACTOR\" ] texture [ " + two + " ]",
               {51 / 255., 0, .4});
        // Two by one texels over one: the larger size is kept.
        expect("mode [ \"REPLACE\" \"SELECTARG2\" ] texture [ PixelTexture { image 2 1 1 51 51 } " +
                   texel(255, 255, 255, 255) + " ]",
               {.2, .2, .2});
        // An alpha of a fifth, over the sky's blue.
        expectColor(sky("texture [ " + texel(255, 0, 0, 255) + texel(255, 255, 255, 51) + " ]", integrator),
                    {.2, 0, .8}, 1e-5);
    }
}

TEST(MultiTexture, EveryModeIsItsFormula) {
    const Vec3d x(102 / 255., 204 / 255., 51 / 255.), y(153 / 255., 51 / 255., 255 / 255.);
    const std::string a = texel(102, 204, 51, 255), b = texel(153, 51, 255, 255);
    const auto clamped = [](Vec3d v) { return glm::clamp(v, Vec3d(0), Vec3d(1)); };
    expectColor(second("MODULATE", a, b), x * y, 1e-5);
    expectColor(second("REPLACE", a, b), x, 1e-5);
    expectColor(second("SELECTARG1", a, b), x, 1e-5);
    expectColor(second("SELECTARG2", a, b), y, 1e-5);
    expectColor(second("OFF", a, b), y, 1e-5);
    expectColor(second("MODULATE2X", a, b), clamped(2. * x * y), 1e-5);
    expectColor(second("MODULATE4X", a, b), clamped(4. * x * y), 1e-5);
    expectColor(second("ADD", a, b), clamped(x + y), 1e-5);
    expectColor(second("ADDSIGNED", a, b), clamped(x + y - .5), 1e-5);
    expectColor(second("ADDSIGNED2X", a, b), clamped(2. * (x + y - .5)), 1e-5);
    expectColor(second("SUBTRACT", a, b), clamped(x - y), 1e-5);
    expectColor(second("ADDSMOOTH", a, b), x + (1. - x) * y, 1e-5);
    const double dot = glm::dot(2. * x - 1., 2. * y - 1.);
    EXPECT_LT(dot, 0);
    expectColor(second("DOTPRODUCT3", a, a), Vec3d(std::min(1.0, glm::dot(2. * x - 1., 2. * x - 1.))), 1e-5);
}

TEST(MultiTexture, BlendsByTheAlphaThatIsNamed) {
    const Vec3d x(102 / 255., 204 / 255., 51 / 255.), y(153 / 255., 51 / 255., 255 / 255.);
    const std::string a = texel(102, 204, 51, 51), b = texel(153, 51, 255, 255);
    // Each keeps the first texture's alpha, 1, so that nothing shines through.
    const double own = .2;
    expectColor(second("BLENDTEXTUREALPHA, SELECTARG2", a, b), x * own + y * (1 - own), 1e-5);
    expectColor(second("BLENDFACTORALPHA, SELECTARG2", a, b, "alpha .75"), x * .75 + y * .25, 1e-5);
    expectColor(second("BLENDCURRENTALPHA, SELECTARG2", a, b), x, 1e-5);
    expectColor(second("BLENDDIFFUSEALPHA, SELECTARG2", a, b), x, 1e-5);
    expectColor(second("MODULATEALPHA_ADDCOLOR, SELECTARG2", a, b), glm::min(x + own * y, 1.), 1e-5);
    expectColor(second("MODULATEINVALPHA_ADDCOLOR, SELECTARG2", a, b), glm::min(x + (1 - own) * y, 1.), 1e-5);
    expectColor(second("MODULATEINVCOLOR_ADDALPHA, SELECTARG2", a, b), glm::min((1. - x) * y + own, 1.), 1e-5);
}

TEST(MultiTexture, SourcesAndFunctions) {
    const std::string a = texel(102, 204, 51, 255), b = texel(153, 51, 255, 255);
    const Vec3d x(102 / 255., 204 / 255., 51 / 255.);
    const auto with = [&](const char* more) { return second("MODULATE", a, b, more); };
    expectColor(with("source [ \"\" \"FACTOR\" ] color .5 .25 1"), x * Vec3d(.5, .25, 1), 1e-5);
    expectColor(with("source [ \"\" \"DIFFUSE\" ]"), x * Vec3d(.8, .6, .4), 1e-5);
    expectColor(second("REPLACE", a, b, "function [ \"\" \"COMPLEMENT\" ]"), 1. - x, 1e-5);
}

TEST(MultiTexture, IsLitAsTheMaterialIs) {
    LightScene s(
        "DirectionalLight { direction 0 -.6 -.8 } " +
        square(10, "material Material { diffuseColor 1 1 1 ambientIntensity 0 } texture MultiTexture { texture [ " +
                       texel(128, 128, 128, 255) + texel(255, 0, 128, 255) + " ] }"));
    s.options.settings.colorSpace = ColorSpace::display;
    expectColor(s.center(), Vec3d(128 / 255., 0, 128. * 128 / 255 / 255) * .8, 1e-5);
}

TEST(MultiTexture, LetsThroughWhatItsAlphaLeaves) {
    LightScene s(square(10, "material UnlitMaterial { } texture MultiTexture { mode \"REPLACE\" texture " +
                                texel(255, 255, 255, 51) + " }") +
                 "Transform { translation 0 0 -1 children [ " + square(10, unlit("1 0 0")) + " ] }");
    expectColor(s.center(), {1, .2, .2}, 1e-5);
}

/// The share of white over black that is seen is the alpha that the stages made from a material that is half
/// transparent (18.4.3: the first stage begins with the material's colour and alpha).
double alphaCreated(const std::string& multi, const char* transparency) {
    return seenTexture(multi, fmt::format("UnlitMaterial {{ transparency {} }}", transparency).c_str()).x;
}

TEST(MultiTexture, BeginsWithTheMaterialsAlpha) {
    const auto created = [](const char* mode, int a, const char* more = "") {
        return alphaCreated(fmt::format("mode \"SELECTARG2, {}\" texture {} {}", mode, texel(9, 9, 9, a), more), ".2");
    };
    const double alpha = 178 / 255., own = .8;
    EXPECT_NEAR(created("REPLACE", 178), alpha, 1e-5);
    EXPECT_NEAR(created("REPLACE", 255), 1, 1e-5);
    EXPECT_NEAR(created("MODULATE", 178), alpha * own, 1e-5);
    EXPECT_NEAR(created("MODULATE2X", 178), 1, 1e-5);
    EXPECT_NEAR(created("ADDSIGNED", 178), alpha + own - .5, 1e-5);
    EXPECT_NEAR(created("ADDSMOOTH", 178), alpha + (1 - alpha) * own, 1e-5);
    EXPECT_NEAR(created("SELECTARG2", 178), own, 1e-5);
    EXPECT_NEAR(created("BLENDDIFFUSEALPHA", 178), alpha * own + own * (1 - own), 1e-5);
    EXPECT_NEAR(created("BLENDCURRENTALPHA", 178), alpha * own + own * (1 - own), 1e-5);
    EXPECT_NEAR(created("BLENDTEXTUREALPHA", 178), alpha * alpha + own * (1 - alpha), 1e-5);
    EXPECT_NEAR(created("BLENDFACTORALPHA", 178, "alpha .25"), alpha * .25 + own * .75, 1e-5);
    EXPECT_NEAR(
        alphaCreated("mode \"REPLACE, MODULATE\" source \"SPECULAR\" texture " + texel(255, 255, 255, 178), ".2"),
        alpha * own, 1e-5);
    // All of a material that is not there at all.
    EXPECT_NEAR(alphaCreated("mode \"SELECTARG2, REPLACE\" texture " + texel(9, 9, 9, 178), "1"), alpha, 1e-5);
}

TEST(MultiTexture, ShadowsHaveTheAlphaThatItMade) {
    // A lamp above, a sheet between it and a floor: as much light is left as the sheet's alpha leaves.
    const auto floor = [](const char* multi) {
        LightScene s(
            "DirectionalLight { direction 0 -1 0 shadows TRUE } Viewpoint { position 0 2 8 orientation 1 0 0 -.25 } "
            "Transform { rotation 1 0 0 -1.5707963 children " +
            square(100, "material Material { diffuseColor 1 1 1 ambientIntensity 0 }") +
            " } Transform { translation 0 4 0 rotation 1 0 0 1.5707963 children " +
            square(20, std::string("material UnlitMaterial { transparency .5 } ") + multi) + " }");
        s.options.settings.colorSpace = ColorSpace::display;
        return s.center().x;
    };
    const std::string sheet = "texture MultiTexture { mode \"REPLACE\" texture " + texel(0, 0, 0, 204) + " }";
    EXPECT_NEAR(floor(""), .5, 1e-4);
    EXPECT_NEAR(floor(sheet.c_str()), .2, 1e-4);
}

// ---- generators ---------------------------------------------------------------------------------------------------

/// The colour at the middle of a plane of 2 x 2 texels: 0 0 red, 1 0 green, 0 1 blue, 1 1 white.
Vec3f generated(const char* mode, const std::string& normal, const std::string& around = "Transform { children") {
    LightScene s(
        around +
        " Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 1 1 } texture PixelTexture { image "
        "2 2 3 0xFF0000 "
        "0x00FF00 0x0000FF 0xFFFFFF textureProperties TextureProperties { magnificationFilter \"NEAREST_PIXEL\" } } } "
        "geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 3 ] texCoord TextureCoordinateGenerator { mode \"" +
        mode + "\" } normal Normal { vector [ " + normal + ", " + normal + ", " + normal + ", " + normal +
        " ] } coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 0 ] } } } }");
    s.options.settings.colorSpace = ColorSpace::display;
    return s.center();
}

TEST(TextureCoordinateGenerator, SphereFollowsTheNormal) {
    EXPECT_EQ(generated("SPHERE", ".6 .48 .64"), Vec3f(1));
    EXPECT_EQ(generated("SPHERE", "-.6 .48 .64"), Vec3f(0, 0, 1));
    EXPECT_EQ(generated("SPHERE", ".6 -.48 .64"), Vec3f(0, 1, 0));
    EXPECT_EQ(generated("SPHERE", "-.6 -.48 .64"), Vec3f(1, 0, 0));
    // Turned half around, the eye sees the other side of the normal; its own frame does not know.
    const char* turned = "Transform { rotation 0 0 1 3.1415927 children";
    EXPECT_EQ(generated("SPHERE", ".6 .48 .64", turned), Vec3f(1, 0, 0));
    EXPECT_EQ(generated("SPHERE-LOCAL", ".6 .48 .64", turned), Vec3f(1));
}

/// By its formula the alpha of SUBTRACT and DOTPRODUCT3 is less than one even of opaque textures; browsers show them
/// opaque, before whatever is behind.
TEST(MultiTexture, OpaqueTexturesStayOpaqueInEveryMode) {
    for (const char* mode : {"SUBTRACT", "DOTPRODUCT3", "MODULATEINVALPHA_ADDCOLOR", "MODULATE"})
        for (const char* function : {"", "function [ \"\" \"COMPLEMENT\" ]"}) {
            std::vector<Vec3f> seen;
            for (const int sky : {0, 1})
                for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
                    LightScene s(
                        fmt::format("NavigationInfo {{ headlight FALSE }} Background {{ skyColor 1 {} 1 }} ", sky) +
                            square(10, fmt::format("material UnlitMaterial {{ }} texture MultiTexture {{ "
                                                   "texture [ {} {} ] mode [ \"REPLACE\" \"{}\" ] {} }}",
                                                   texel(153, 51, 255, 255), texel(102, 204, 51, 255), mode, function)),
                        9, 9);
                    s.options.settings.integrator = integrator;
                    s.options.settings.colorSpace = ColorSpace::linear;
                    seen.push_back(s.center());
                }
            SCOPED_TRACE(std::string(mode) + " " + function);
            for (const Vec3f& color : seen) expectColor(color, Vec3d(seen[0]), 1e-5);
        }
}

TEST(TextureCoordinateGenerator, EveryModeIsItsFormula) {
    using G = TexCoords::Generator;
    trace::GeneratorInput in;
    in.position = {.3f, -.4f, -2}, in.normal = glm::normalize(Vec3f(.2f, .1f, .9f));
    in.localPosition = {1.5f, 2.25f, -3}, in.localNormal = {0, 1, 0};
    TexCoords c;
    const auto expect = [&](G generator, const Vec3d& expected, std::vector<float> parameter = {}) {
        c.generator = generator, c.parameter = std::move(parameter);
        EXPECT_LT(glm::distance(Vec3d(trace::generatedCoordinates(c, in)), expected), 1e-6)
            << static_cast<int>(generator);
    };
    const Vec3d n = glm::normalize(Vec3d(.2, .1, .9)), p(.3, -.4, -2), d = glm::normalize(p);
    expect(G::sphere, .5 * n + .5);
    expect(G::cameraSpaceNormal, n);
    expect(G::cameraSpacePosition, p);
    expect(G::coordEye, p);
    expect(G::cameraSpaceReflection, d - 2 * glm::dot(d, n) * n);
    expect(G::sphereReflect, d - 2 * glm::dot(d, n) * n);
    expect(G::sphereLocal, {.5, 1, .5});
    // Bent by 1.5: Snell's law.
    const double cosine = -glm::dot(d, n), sine = std::sqrt(1 - cosine * cosine) / 1.5;
    expect(G::sphereReflect, glm::normalize(d / 1.5 + (cosine / 1.5 - std::sqrt(1 - sine * sine)) * n), {1.5f});
    const Vec3d local = glm::normalize(Vec3d(1.5, 2.25 - 4, -3));
    expect(G::sphereReflectLocal, {local.x, -local.y, local.z}, {0, 0, 4, 0});
}

TEST(TextureCoordinateGenerator, NoiseIsSmoothAndZeroAtWholeNumbers) {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> coordinate(-300, 300);
    double sum = 0, squares = 0;
    for (int i = 0; i < 4000; ++i) {
        const Vec3f at(coordinate(random), coordinate(random), coordinate(random));
        EXPECT_EQ(trace::noiseAt(glm::floor(at)), 0);
        const float here = trace::noiseAt(at), near = trace::noiseAt(at + Vec3f(1e-3f, 0, 0));
        EXPECT_LE(std::abs(here), 1.04f);
        EXPECT_LT(std::abs(near - here), 6e-3f);
        sum += here, squares += here * here;
    }
    EXPECT_NEAR(sum / 4000, 0, .03);
    EXPECT_GT(squares / 4000, .03);
}

// ---- FillProperties -----------------------------------------------------------------------------------------------

double litFraction(const char* fill, bool behind = false) {
    LightScene s(
        "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } " +
            square(10,
                   std::string(
                       "material Material { diffuseColor 0 0 0 ambientIntensity 0 } fillProperties FillProperties { ") +
                       fill + " }") +
            (behind ? "Transform { translation 0 0 -1 children [ " + square(10, unlit("0 1 0")) + " ] }" : ""),
        160, 160);
    double sum = 0;
    for (const Vec4f& pixel : s.picture().pixels) sum += behind ? pixel.g : pixel.r;
    return sum / (160 * 160);
}

TEST(FillProperties, HatchesInPixels) {
    for (const int style : {1, 2, 3, 4})
        EXPECT_NEAR(litFraction(fmt::format("hatchStyle {} hatchColor 1 0 0", style).c_str()), 1 / 8.0, .005) << style;
    for (const int style : {5, 6})
        EXPECT_NEAR(litFraction(fmt::format("hatchStyle {} hatchColor 1 0 0", style).c_str()), 1 - 49 / 64.0, .01)
            << style;
    EXPECT_EQ(litFraction("hatched FALSE"), 0);
    EXPECT_NEAR(litFraction("filled FALSE hatchColor 1 0 0", true), 7 / 8.0, .005)
        << "what is behind shows between the lines";
    EXPECT_NEAR(litFraction("filled FALSE hatched FALSE", true), 1, 1e-6);
}

// 12.4.2: nothing is drawn of it, so that it hides nothing that lies in its own place; lines have no inside.
TEST(FillProperties, WhatIsNeitherFilledNorHatchedHidesNothingInItsPlace) {
    const std::string none = "fillProperties FillProperties { filled FALSE hatched FALSE }";
    for (const bool first : {false, true}) {
        const std::string green = square(1, unlit("0 1 0")), hollow = square(1, matte("1 0 0") + none);
        const Picture p =
            LightScene("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } " + (first ? hollow + green : green + hollow), 40,
                       40)
                .picture();
        for (int y = 11; y < 29; ++y)
            for (int x = 11; x < 29; ++x) ASSERT_EQ(Vec3f(p.at(x, y)), Vec3f(0, 1, 0)) << x << ", " << y;
    }
    LightScene line(
        "Shape { appearance Appearance { material Material { emissiveColor 0 1 0 } lineProperties LineProperties { "
        "linewidthScaleFactor 9 } " +
        none + " } geometry LineSet { vertexCount 2 coord Coordinate { point [ -1 0 0, 1 0 0 ] } } }");
    EXPECT_EQ(line.center(), Vec3f(0, 1, 0));
}

// ---- shadows of what is clear -------------------------------------------------------------------------------------

// Rays look for clear things only where these are; what that finds is what looking everywhere finds.
TEST(ClearThings, ShadeAsTheyDoWhereverTheyAre) {
    const auto pictured = [](int clear, bool alphaColored) {
        std::string text =
            "Viewpoint { position 0 4 9 orientation 1 0 0 -.4 } PointLight { location 0 6 0 } DirectionalLight { "
            "direction .3 -1 -.2 intensity .4 } "
            "Transform { rotation 1 0 0 -1.5708 children [ " +
            square(12, matte("1 1 1")) + " ] }";
        std::mt19937 random(4);
        std::uniform_real_distribution<double> coordinate(-4, 4);
        for (int i = 0; i < 30; ++i)
            text += fmt::format(
                "Transform {{ translation {} {} {} rotation .6 .8 0 {} children Shape {{ appearance Appearance {{ "
                "material Material {{ "
                "transparency {} }} }} geometry Box {{ size .8 .1 1 solid FALSE }} }} }}",
                coordinate(random), 2 + .3 * coordinate(random), coordinate(random), coordinate(random),
                i < clear ? ".6" : "0");
        // Colours with alpha anywhere: then it is not known where to look.
        if (alphaColored)
            text +=
                "Transform { translation 0 0 500 children Shape { geometry PointSet { color ColorRGBA { color 1 1 1 1 "
                "} coord Coordinate { point 0 0 0 } } } }";
        LightScene s(text, 96, 64);
        s.options.settings.shadows = Shadows::all;
        return s.picture();
    };
    for (const int clear : {1, 5, 20}) EXPECT_EQ(pictured(clear, false).pixels, pictured(clear, true).pixels) << clear;
}

}  // namespace
}  // namespace rtsg
