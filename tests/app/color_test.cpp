// The way of a colour from field to file, through the program: bytes of .ppm, floats of .pfm, by closed forms.
#include "program.h"

#include <array>
#include <cmath>
#include <cstring>

#include <gmock/gmock.h>

namespace rtsg::test {
namespace {

using testing::HasSubstr;
using Bytes = std::array<int, 3>;

double decoded(double v) {
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}
double encoded(double v) {
    return v <= 0.0031308 ? v * 12.92 : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
}
int byteOf(double v) {
    return static_cast<int>(std::floor(std::min(v, 1.0) * 255 + 0.5 + 1e-6));
}
Bytes bytes(double r, double g, double b) {
    return {byteOf(r), byteOf(g), byteOf(b)};
}

const std::string kDark = "NavigationInfo { headlight FALSE } Viewpoint { }\n";
/// Fills the picture from z = `z`; `solid FALSE`.
std::string wall(const std::string& appearance, double z = 0, const std::string& more = "") {
    return "Transform { translation 0 0 " + std::to_string(z) + " children Shape { appearance Appearance { " +
           appearance + " } geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] " + more +
           " coord Coordinate { point [-90 -90 0, 90 -90 0, 90 90 0, -90 90 0] } } } }\n";
}
const std::string kUnlit = "material UnlitMaterial { emissiveColor .9 .4 .1 }";

class Color : public CommandLine {
  protected:
    /// The bytes of the middle pixel, of nine by nine.
    Bytes seen(const std::string& body, std::vector<std::string> more = {}) {
        const std::string all = picture(body, "out.ppm", std::move(more));
        Bytes result{-1, -1, -1};
        if (all.size() >= 9 * 9 * 3)
            for (std::size_t c = 0; c < 3; ++c)
                result[c] = static_cast<unsigned char>(all[all.size() - 9 * 9 * 3 + (4 * 9 + 4) * 3 + c]);
        return result;
    }
    std::array<float, 3> light(const std::string& body, std::vector<std::string> more = {}) {
        const std::string all = picture(body, "out.pfm", std::move(more));
        std::array<float, 3> result{-1, -1, -1};
        if (all.size() >= 9 * 9 * 12) std::memcpy(result.data(), &all[all.size() - 9 * 9 * 12 + (4 * 9 + 4) * 12], 12);
        return result;
    }

  private:
    std::string picture(const std::string& body, const std::string& name, std::vector<std::string> more) {
        writeFile(file, "#X3D V4.0 utf8\nPROFILE Immersive\n" + body);
        std::vector<std::string> arguments{"render", file, "-o", folder / name, "--size", "9x9", "--spp", "1"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return readFile(folder / name);
    }
};

const std::vector<std::string> kLinear{"--color-space", "linear"}, kDisplay{"--color-space", "display"},
    kPath{"--integrator", "path"};

TEST_F(Color, UnlitLooksTheSameInEverySpace) {
    for (const auto& space : {std::vector<std::string>{}, kLinear, kDisplay, kPath}) {
        EXPECT_EQ(seen(kDark + wall(kUnlit), space), (Bytes{230, 102, 26}));
        EXPECT_EQ(seen(kDark + "Background { skyColor .2 .5 .1 }", space), (Bytes{51, 128, 26}));
        EXPECT_EQ(seen(kDark + wall("", 0, "colorPerVertex FALSE color Color { color .9 .4 .1 }"), space),
                  (Bytes{230, 102, 26}));
        EXPECT_EQ(seen(kDark + wall("texture PixelTexture { image 1 1 3 0xE6661A }"), space), (Bytes{230, 102, 26}));
        EXPECT_EQ(seen(kDark + "Fog { color .9 .4 .1 visibilityRange 5 }" + wall("material Material { }"), space),
                  (Bytes{230, 102, 26}));
        EXPECT_EQ(seen(kDark + wall("material Material { diffuseColor 0 0 0 emissiveColor .9 .4 .1 }"), space),
                  (Bytes{230, 102, 26}));
    }
}

TEST_F(Color, FilesOfLightHoldTheDecodedColor) {
    for (const auto& space : {std::vector<std::string>{}, kLinear, kDisplay, kPath}) {
        const auto found = light(kDark + wall(kUnlit), space);
        EXPECT_NEAR(found[0], decoded(.9), 1e-6);
        EXPECT_NEAR(found[1], decoded(.4), 1e-6);
        EXPECT_NEAR(found[2], decoded(.1), 1e-6);
    }
}

// 17.2.2 in the display's space: .8 cos 60 of the diffuse colour. In linear light the decoded colour is lit.
TEST_F(Color, MaterialIsLitAsDisplayValues) {
    const std::string scene = kDark + "DirectionalLight { direction 0 -.8660254 -.5 intensity .8 }" +
                              wall("material Material { diffuseColor .5 .25 1 ambientIntensity 0 }");
    EXPECT_EQ(seen(scene), bytes(.2, .1, .4));
    EXPECT_EQ(seen(scene, kDisplay), bytes(.2, .1, .4));
    const Bytes linear = bytes(encoded(.4 * decoded(.5)), encoded(.4 * decoded(.25)), encoded(.4));
    EXPECT_EQ(seen(scene, kLinear), linear);
    EXPECT_EQ(seen(scene, kPath), linear);
}

TEST_F(Color, WhatIsBeyondWhiteIsCutChannelByChannel) {
    const std::string light = "DirectionalLight { intensity .8 }";
    EXPECT_EQ(seen(kDark + light + light + wall("material Material { diffuseColor 1 .5 .25 ambientIntensity 0 }")),
              bytes(1, .8, .4));
}

// glTF's model head-on at roughness 1: ((1 - .04) base + .04 / 4) / pi of the light's irradiance.
TEST_F(Color, PhysicalMaterialIsLitAsLightAndEncoded) {
    const std::string scene =
        kDark + "DirectionalLight { }" + wall("material PhysicalMaterial { baseColor .5 .2 1 metallic 0 }");
    const double pi = 3.14159265358979, r = (.96 * .5 + .01) / pi, g = (.96 * .2 + .01) / pi, b = (.96 + .01) / pi;
    EXPECT_EQ(seen(scene), bytes(encoded(r), encoded(g), encoded(b)));
    EXPECT_EQ(seen(scene, kLinear), bytes(encoded(r), encoded(g), encoded(b)));
    EXPECT_EQ(seen(scene, kPath), bytes(encoded(r), encoded(g), encoded(b)));
    EXPECT_EQ(seen(scene, kDisplay), bytes(r, g, b));
}

TEST_F(Color, TexturesOfPhysicalMaterialAreDecoded) {
    const std::string scene =
        kDark + wall(
                    "material PhysicalMaterial { baseColor 0 0 0 metallic 1 emissiveColor .5 .5 .5 "
                    "emissiveTexture PixelTexture { image 1 1 3 0xE6661A } }");
    const double r = 0xE6 / 255.0, g = 0x66 / 255.0, b = 0x1A / 255.0;
    const Bytes light = bytes(encoded(.5 * decoded(r)), encoded(.5 * decoded(g)), encoded(.5 * decoded(b)));
    EXPECT_EQ(seen(scene), light);
    EXPECT_EQ(seen(scene, kLinear), light);
    EXPECT_EQ(seen(scene, kDisplay), bytes(.5 * r, .5 * g, .5 * b));
}

// A checkerboard of black and white that is finer than pixels: half of the display's white, or half of the light.
TEST_F(Color, DistantTexturesAverageInTheirSpace) {
    const std::string scene =
        kDark + wall(
                    "material UnlitMaterial { emissiveColor 1 1 1 } texture PixelTexture { image 2 2 "
                    "1 0 255 255 0 } textureTransform TextureTransform { scale 5000 5000 }");
    EXPECT_EQ(seen(scene), bytes(.5, .5, .5));
    const Bytes light = seen(scene, kLinear);
    for (const int c : light) EXPECT_NEAR(c, byteOf(encoded(.5)), 1);
}

TEST_F(Color, TransparencyBlendsInTheSpaceOfThePicture) {
    const std::string scene = kDark + "Background { skyColor 0 0 0 }" +
                              wall("material UnlitMaterial { emissiveColor 1 1 .5 transparency .5 }");
    EXPECT_EQ(seen(scene), bytes(.5, .5, .25));
    EXPECT_EQ(seen(scene, kLinear), bytes(encoded(.5), encoded(.5), encoded(.5 * decoded(.5))));
}

// ---- both kinds in one scene, automatic --------------------------------------------------------------------------

TEST_F(Color, EachSurfaceKeepsItsSpaceInAMixedScene) {
    // The left half is physical, the right one not; the middle pixel sees whichever is put there.
    const std::string physical = "material PhysicalMaterial { baseColor 0 0 0 metallic 1 emissiveColor .5 .2 .1 }",
                      classic = "material Material { diffuseColor 0 0 0 emissiveColor .5 .2 .1 }";
    EXPECT_EQ(seen(kDark + wall(physical) + wall(classic, -1)), bytes(encoded(.5), encoded(.2), encoded(.1)));
    EXPECT_EQ(seen(kDark + wall(physical, -1) + wall(classic)), bytes(.5, .2, .1));
}

TEST_F(Color, SeeThroughPhysicalMaterialIsLaidOverDisplayValues) {
    EXPECT_EQ(
        seen(kDark + "Background { skyColor .2 .4 .6 }" +
             wall("material PhysicalMaterial { baseColor 0 0 0 metallic 1 emissiveColor .5 .2 .1 transparency .75 }")),
        bytes(.25 * encoded(.5) + .75 * .2, .25 * encoded(.2) + .75 * .4, .25 * encoded(.1) + .75 * .6));
}

// A perfect mirror of either kind shows a classic colour as it is; a half mirror halves light or display values.
TEST_F(Color, MirrorsCountInTheirOwnSpace) {
    const std::string behind = wall(kUnlit, 30);
    EXPECT_EQ(seen(kDark + behind + wall("material PhysicalMaterial { metallic 1 roughness 0 }")),
              (Bytes{230, 102, 26}));
    EXPECT_EQ(seen(kDark + behind + wall("material PhysicalMaterial { baseColor .5 .5 .5 metallic 1 roughness 0 }")),
              bytes(encoded(.5 * decoded(.9)), encoded(.5 * decoded(.4)), encoded(.5 * decoded(.1))));
    EXPECT_EQ(
        seen(kDark + behind +
             wall("material Material { diffuseColor 0 0 0 metadata MetadataFloat { name \"reflectivity\" reference "
                  "\"RTSG\" value .5 } }")),
        bytes(.45, .2, .05));
    // A classic half mirror that sees a physical lamp takes half of what that shows.
    EXPECT_EQ(
        seen(kDark + wall("material PhysicalMaterial { baseColor 0 0 0 metallic 1 emissiveColor .5 .2 .1 }", 30) +
             wall("material Material { diffuseColor 0 0 0 metadata MetadataFloat { name \"reflectivity\" reference "
                  "\"RTSG\" value .5 } }")),
        bytes(.5 * encoded(.5), .5 * encoded(.2), .5 * encoded(.1)));
}

// The mirror is emissive as well: its own light and what it mirrors are summed as light and encoded once.
TEST_F(Color, WhatAPhysicalSurfaceSendsIsSummedBeforeItIsEncoded) {
    EXPECT_EQ(
        seen(kDark + wall(kUnlit, 30) +
             wall("material PhysicalMaterial { baseColor .5 .5 .5 metallic 1 roughness 0 emissiveColor .1 .1 .1 }")),
        bytes(encoded(.5 * decoded(.9) + .1), encoded(.5 * decoded(.4) + .1), encoded(.5 * decoded(.1) + .1)));
}

TEST_F(Color, FogIsMixedInTheDisplaysSpace) {
    // Ten metres of twenty: half of each.
    const std::string fog = "Fog { color .8 .6 .4 visibilityRange 20 }";
    EXPECT_EQ(seen(kDark + fog + wall("material Material { diffuseColor 0 0 0 emissiveColor .5 .2 .1 }")),
              bytes(.65, .4, .25));
    EXPECT_EQ(
        seen(kDark + fog + wall("material PhysicalMaterial { baseColor 0 0 0 metallic 1 emissiveColor .5 .2 .1 }")),
        bytes(.4 + .5 * encoded(.5), .3 + .5 * encoded(.2), .2 + .5 * encoded(.1)));
}

TEST_F(Color, ExposureIsAFactorOnLight) {
    EXPECT_EQ(seen(kDark + wall(kUnlit), {"--exposure", "0.5"}),
              bytes(encoded(.5 * decoded(.9)), encoded(.5 * decoded(.4)), encoded(.5 * decoded(.1))));
}

TEST_F(Color, PathsOfDisplayValuesAreRefused) {
    const Outcome outcome =
        rtsg({"render", file, "-o", folder / "a.png", "--integrator", "path", "--color-space", "display"});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, HasSubstr("linear light"));
}

}  // namespace
}  // namespace rtsg::test
