// Mirrors and glass through the whole path, against closed forms.
#include <cmath>

#include <fmt/format.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

// ---- mirrors and glass -------------------------------------------------------------------------------------------

TEST(LightTracer, MirrorShowsAKnownPoint) {
    // A mirror turned by 45 degrees shows what lies to the right, and it shows it the wrong way round.
    LightScene s("Transform { rotation 0 1 0 0.785398163 children " + square(2, mirror("0.8")) +
                     "} Transform { translation 20 0 0 rotation 0 1 0 -1.5707963 children [" +
                     "Transform { translation -5 0 0 children " + square(5, unlit("1 0 0")) +
                     "} Transform { translation 5 0 0 children " + square(5, unlit("0 0 1")) + "} ] }",
                 64, 64);
    const Picture p = s.picture();
    // The screen faces -x with its own right at -z... the ray through a pixel right of the centre hits the mirror
    // further back, and comes out further back on the screen.
    const Vec3d d = pixelDirection(36, 32, 64, 64, 0.7854);
    const Vec3d n = glm::normalize(Vec3d(1, 0, 1));
    const double t = -glm::dot(Vec3d(0, 0, 10), n) / glm::dot(d, n);
    const Vec3d at = Vec3d(0, 0, 10) + t * d, r = d - 2 * glm::dot(d, n) * n;
    const double z = at.z + r.z * (20 - at.x) / r.x;
    // A point at local x of the screen lies at z = sin(-pi/2) * -x = x.
    expectColor(Vec3f(p.at(36, 32)), z < 0 ? Vec3d(0.8, 0, 0) : Vec3d(0, 0, 0.8), 1e-6);
    expectColor(Vec3f(p.at(27, 32)), z < 0 ? Vec3d(0, 0, 0.8) : Vec3d(0.8, 0, 0), 1e-6);
}

TEST(LightTracer, FacingMirrorsEndAndFadeGeometrically) {
    // Between two mirrors of .5 with a grey of emission .25 each: L = .25 + .5 L' for as many mirrorings as allowed.
    const std::string wall =
        "material Material { diffuseColor 0 0 0 emissiveColor 0.25 0.25 0.25 metadata MetadataFloat { name "
        "\"reflectivity\" reference \"RTSG\" value 0.5 } }";
    LightScene s("Viewpoint { position 0 0 1 }" + square(100, wall) + "Transform { translation 0 0 2 children " +
                     square(100, wall) + "}",
                 9, 9);
    s.options.settings.cutoff = 0;
    for (const int depth : {0, 1, 5, 8}) {
        s.options.settings.maxDepth = depth;
        double expected = 0;  // each wall shows half of its own emission
        for (int i = 0; i <= depth; ++i) expected += 0.125 * std::pow(0.5, i);
        EXPECT_NEAR(s.center().r, expected, 1e-6) << depth;
    }
}

// Rays end where their weight is less than a pixel can show, not after so many mirrorings: a corridor of mirrors that
// keep .9 is as bright as its walls' emission. A limit that was asked for, and what it takes away, is named.
TEST(LightTracer, MirrorCorridorIsFollowedUntilNothingIsLeft) {
    const auto corridor = [](const char* mirror) {
        const std::string wall = fmt::format(
            "material Material {{ diffuseColor 0 0 0 emissiveColor 0.5 0.5 0.5 metadata "
            "MetadataFloat {{ name \"reflectivity\" reference \"RTSG\" value {} }} }}",
            mirror);
        return "Viewpoint { position 0 0 1 }" + square(100, wall) + "Transform { translation 0 0 2 children " +
               square(100, wall) + "}";
    };
    LightScene s(corridor("0.9"), 9, 9);
    EXPECT_NEAR(s.center().r, 0.5, 0.5 / 512);
    EXPECT_EQ(s.stats.missing, 0);
    EXPECT_TRUE(s.light->diagnostics().all().empty());
    s.options.settings.maxDepth = 8;
    EXPECT_NEAR(s.center().r, 0.5 * (1 - std::pow(0.9, 9)), 1e-5);
    EXPECT_NEAR(s.stats.missing, std::pow(0.9, 9), 1e-5);
    EXPECT_NEAR(s.stats.missingMaximum, std::pow(0.9, 9), 1e-5);
    s.center();
    ASSERT_EQ(s.light->diagnostics().all().size(), 1u) << "once";
    EXPECT_NE(s.light->diagnostics().all()[0].text.find("39 % of a pixel's light is missing"), std::string::npos)
        << s.light->diagnostics().all()[0].text;
    LightScene perfect("Viewpoint { position 0.13 0.07 0.5 } Shape { appearance Appearance { " + mirror("1") +
                           " } geometry Box { solid FALSE } }",
                       3, 3);
    EXPECT_EQ(perfect.center(), Vec3f(0));
    EXPECT_NEAR(perfect.stats.missing, 1, 1e-6);
}

// A part that is cut off is dark, not transparent: a mirror's own light stays, with the mirror's full alpha.
TEST(LightTracer, WhatIsCutOffHidesWhatIsBehindIt) {
    const std::string shiny = "material PhysicalMaterial { emissiveColor .25 .5 1 roughness 0 baseColor 1 1 1 }";
    for (const std::string& appearance : {shiny, mirror(".5"), glass(1.5)}) {
        LightScene s("NavigationInfo { headlight FALSE } " + square(100, appearance), 3, 3);
        const Picture whole = s.picture();
        s.options.settings.maxDepth = 0;
        const Picture cut = s.picture();
        EXPECT_NEAR(cut.at(1, 1).a, 1, 1e-4) << appearance;
        EXPECT_GT(s.stats.missing, .01) << appearance;
        EXPECT_NEAR(whole.at(1, 1).a, 1, 1e-4) << appearance;
    }
    LightScene s("NavigationInfo { headlight FALSE } " + square(100, shiny), 3, 3);
    s.options.settings.maxDepth = 0;
    s.options.settings.colorSpace = ColorSpace::linear;
    EXPECT_NEAR(s.center().g, .5, 1e-3);
}

// (1 - R) / (1 + R) of a plate in front of white, with all the mirrorings inside.
TEST(LightTracer, PlateTransmitsWhatTwoSurfacesLetThrough) {
    LightScene s("Transform { translation 0 0 2 children Shape { appearance Appearance { " + glass(1.5) +
                     " } geometry Box { size 8 8 1 } } }" + square(100, unlit("1 1 1")),
                 9, 9);
    s.options.settings.cutoff = 1e-7f;
    EXPECT_NEAR(s.center().r, 0.923077, 2e-5);
}

TEST(LightTracer, GlassAbsorbsByBeersLaw) {
    LightScene s("Transform { translation 0 0 2 children Shape { appearance Appearance { " +
                     glass(1.0001, "MetadataFloat { name \"absorption\" value [0.5 1 2] }") +
                     " } geometry Box { size 8 8 1.5 } } }" + square(100, unlit("1 1 1")),
                 9, 9);
    expectColor(s.center(), {std::exp(-0.75), std::exp(-1.5), std::exp(-3.0)}, 1e-4);
}

// Absorbed light leaves a dark picture, not a transparent one: its alpha is 1.
TEST(LightTracer, WhatIsAbsorbedIsNotClear) {
    LightScene s("Transform { translation 0 0 2 children Shape { appearance Appearance { " +
                     glass(1.0001, "MetadataFloat { name \"absorption\" value [0.5 1 2] }") +
                     " } geometry Box { size 8 8 1.5 } } }" + square(100, unlit("1 1 1")),
                 9, 9);
    const Picture p = s.picture();
    EXPECT_NEAR(p.at(4, 4).a, 1, 1e-4);
}

// Without a refractive index a surface is a sheet, which takes the same of all light that passes.
TEST(LightTracer, ASheetIsTintedByItsAbsorption) {
    const std::string pane =
        "Transform { translation 0 0 2 children " +
        square(4,
               "material Material { diffuseColor 0 0 0 transparency 1 metadata MetadataSet { name \"RTSG\" value "
               "MetadataFloat { name \"absorption\" value [0.5 1 2] } } }") +
        " }";
    const Vec3d left(std::exp(-0.5), std::exp(-1.0), std::exp(-2.0));
    for (const auto integrator : {Integrator::whitted, Integrator::path}) {
        LightScene s(pane + square(100, unlit("1 1 1")), 9, 9);
        s.options.settings.integrator = integrator;
        s.options.settings.colorSpace = ColorSpace::linear;
        const Picture p = s.picture();
        expectColor(Vec3f(p.at(4, 4)), left, 1e-3);
        EXPECT_NEAR(p.at(4, 4).a, 1, 1e-4);
    }
    // The light of a lamp behind it, too.
    LightScene s(
        "DirectionalLight { direction 0 0 -1 } Viewpoint { position 0 0 1 } " + pane + square(100, matte("1 1 1")), 9,
        9);
    expectColor(s.center(), left, 1e-3);
}

// A slab at 45 degrees shifts the edge behind it by .329142 (n = 1.5, thickness 1).
TEST(LightTracer, SlabDisplacesTheEdgeBehindIt) {
    const std::string slab =
        "Transform { rotation 0 1 0 0.785398163 translation 0 0 5 children Shape { appearance Appearance { " +
        glass(1.5) + " } geometry Box { size 9 9 1 } } }";
    const std::string halfPlane = "Transform { translation 50 0 0 children " + square(50, unlit("1 1 1")) + "}";
    const int width = 2000;
    const auto edge = [&](const std::string& body) {
        LightScene s("OrthoViewpoint { position 0 0 20 fieldOfView [-1 -0.001 1 0.001] }" + body, width, 2);
        const Picture p = s.picture();
        int x = 0;
        while (x < width && p.at(x, 0).r < 0.45f) ++x;
        return -1 + 2.0 * x / width;
    };
    EXPECT_NEAR(edge(halfPlane), 0, 0.0011);
    EXPECT_NEAR(std::abs(edge(halfPlane + slab)), 0.329142, 0.0011);
}

// Rays near the axis of a ball of n = 1.5, R = 1 meet 1.5 from its centre.
TEST(LightTracer, BallLensFocusesAtItsFocalLength) {
    // A screen with a fine stripe texture would need care; instead: a small white spot at the focus fills the lens.
    const std::string ball = "Shape { appearance Appearance { " + glass(1.5) +
                             " } geometry IndexedFaceSet { solid TRUE ccw TRUE creaseAngle 3.2 coordIndex [";
    std::string index, points;
    const int slices = 256, stacks = 128;
    for (int i = 0; i <= stacks; ++i)
        for (int j = 0; j < slices; ++j) {
            const double theta = kPi * i / stacks, phi = 2 * kPi * j / slices;
            points += fmt::format("{} {} {},", std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                  std::cos(theta));
        }
    for (int i = 0; i < stacks; ++i)
        for (int j = 0; j < slices; ++j) {
            const int a = i * slices + j, b = i * slices + (j + 1) % slices, c = a + slices, d = b + slices;
            if (i > 0) index += fmt::format("{} {} {} -1 ", a, c, b);
            if (i + 1 < stacks) index += fmt::format("{} {} {} -1 ", b, c, d);
        }
    const auto spotAt = [&](double z) {
        LightScene s("OrthoViewpoint { position 0 0 20 fieldOfView [-0.2 -0.2 0.2 0.2] }" + ball + index +
                         "] coord Coordinate { point [" + points + "] } } }" +
                         fmt::format("Transform {{ translation 0 0 {} children ", -z) + square(0.02, unlit("1 1 1")) +
                         "}",
                     41, 41);
        const Picture p = s.picture();
        int bright = 0;
        for (const Vec4f& pixel : p.pixels) bright += pixel.r > 0.5f;
        return bright;
    };
    EXPECT_GT(spotAt(1.5), 41 * 41 * 0.97) << "the whole aperture sees the spot at the focus";
    EXPECT_LT(spotAt(1.1), 41 * 41 * 0.5);
    EXPECT_LT(spotAt(2.2), 41 * 41 * 0.5);
}

TEST(LightTracer, PolishedMetalMirrorsBySchlick) {
    LightScene s("Viewpoint { position 0 0 5 }" +
                 square(10, "material PhysicalMaterial { baseColor 0.9 0.6 0.3 metallic 1 roughness 0 }") +
                 "Transform { translation 0 0 8 children " + square(100, unlit("0.735357 0.735357 0.735357")) + "}");
    s.options.settings.colorSpace = ColorSpace::linear;
    expectColor(s.center(), Vec3d(0.45, 0.3, 0.15), 1e-5);
}

TEST(LightTracer, WhatMirrorsIsCoveredOnce) {
    // A picture of display values is decoded by its alpha (.exr, GeneratedCubeMapTexture, RenderedTexture): with more
    // than one of it, colours would be others.
    for (const char* material :
         {"PhysicalMaterial { metallic 1 roughness 0 }",
          "PhysicalMaterial { metallic 1 roughness .4 baseColor .9 .5 .2 }",
          "PhysicalMaterial { metallic 0 roughness .5 baseColor .6 .6 .6 }",
          "PhysicalMaterial { metallic 1 roughness .3 transparency .5 }",
          "Material { metadata MetadataFloat { name \"reflectivity\" reference \"RTSG\" value .5 } }"}) {
        LightScene s(std::string("Background { skyColor .5 .2 .8 } ") +
                     square(10, std::string("material ") + material));
        const Picture p = s.picture();
        EXPECT_NEAR(p.at(p.width / 2, p.height / 2).a, 1, 1e-5) << material;
    }
    LightScene s("Background { skyColor .5 .2 .8 } " +
                 square(10, "material PhysicalMaterial { metallic 1 roughness 0 }"));
    const Picture p = toLinear(s.picture());
    expectColor(Vec3f(p.at(p.width / 2, p.height / 2)), {.214041, .033105, .603827}, 1e-5);
}

// ---- transparency ------------------------------------------------------------------------------------------------

TEST(LightTracer, TransparencyBlendsStraightThrough) {
    LightScene s("Transform { translation 0 0 2 children " +
                 square(5, "material UnlitMaterial { emissiveColor 1 0 0 transparency 0.25 }") +
                 "} Transform { translation 0 0 1 children " +
                 square(5, "material UnlitMaterial { emissiveColor 0 1 0 transparency 0.5 }") + "}" +
                 square(100, unlit("0 0 1")));
    expectColor(s.center(), {0.75, 0.125, 0.125}, 1e-6);
}

TEST(LightTracer, ManyClearLayersAreFollowedToTheEnd) {
    std::string layers;
    for (int i = 1; i <= 100; ++i) layers += fmt::format("Transform {{ translation 0 0 {} children USE L }}", i * 0.01);
    LightScene s("Group { children DEF L " +
                 square(5, "material UnlitMaterial { emissiveColor 1 1 1 transparency 1 }") +
                 "} Transform { translation 0 0 -1 children " + square(100, unlit("0.3 0.3 0.3")) + "}" + layers);
    expectColor(s.center(), Vec3d(0.3), 1e-6);
}

// Clear layers are no mirrorings: of 300 that each take a thousandth, .999^300 is left, in both integrators.
TEST(LightTracer, ManyFaintLayersAreNoDepth) {
    std::string layers;
    for (int i = 1; i <= 300; ++i) layers += fmt::format("Transform {{ translation 0 0 {} children USE L }}", i * 0.01);
    LightScene s("Background { skyColor 1 1 1 } Group { children DEF L " +
                     square(5, "material UnlitMaterial { emissiveColor 0 0 0 transparency 0.999 }") + "}" + layers,
                 3, 3);
    s.options.settings.colorSpace = ColorSpace::linear;
    EXPECT_NEAR(s.center().r, std::pow(.999, 301), 1e-4);
    EXPECT_EQ(s.stats.missing, 0);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = 4096;
    EXPECT_NEAR(s.center().r, std::pow(.999, 301), .02);
}

}  // namespace
}  // namespace rtsg
