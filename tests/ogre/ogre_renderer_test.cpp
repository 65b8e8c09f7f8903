// Pictures by OGRE are those that rays make without shadows and mirrors, and with rays those with them. Skipped where
// there is no display or no OGRE.
#include <rtsg/ogre/ogre_renderer.h>

#include <cmath>
#include <memory>
#include <ostream>
#include <string>
#include <thread>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "display.h"
#include "seen_edits.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using namespace test;
using ::testing::HasSubstr;

/// A scene with both renderers.
struct Both {
    Scene scene;
    Diagnostics diagnostics;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<OgreRenderer> raster;
    std::unique_ptr<LightRenderer> light;
    ImageOptions options;

    explicit Both(int width = 160, int height = 120) {
        options.settings.width = width, options.settings.height = height;
        options.settings.shadows = Shadows::none, options.settings.maxDepth = 0;
    }
    void attach(const Resources& resources = {}) {
        world = std::make_unique<SharedWorld>(scene);
        raster = std::make_unique<OgreRenderer>(*world, LightRenderer::Options(resources));
        light = std::make_unique<LightRenderer>(*world, LightRenderer::Options(resources));
        scene.newFrame(1);
    }
    void load(const std::string& body) {
        ASSERT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Immersive\n" + body, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        attach();
    }
    Picture drawn() {
        auto picture = raster->nextPicture(options);
        if (picture) return std::move(*picture);
        ADD_FAILURE() << picture.error().format();
        return Picture(options.settings.width, options.settings.height);
    }
    Picture hybrid(RenderStats* stats = nullptr) {
        auto picture = raster->hybridPicture(options, stats);
        if (picture) return std::move(*picture);
        ADD_FAILURE() << picture.error().format();
        return Picture(options.settings.width, options.settings.height);
    }
    Picture traced() {
        auto picture = light->picture(options);
        if (picture) return std::move(*picture);
        ADD_FAILURE() << picture.error().format();
        return Picture(options.settings.width, options.settings.height);
    }
};

struct Difference {
    double mean = 0;     // of 255, over all channels
    double overlap = 1;  // of what is not as the upper left corner is: the common part over all of it
};
Difference differenceOf(const Picture& a, const Picture& b) {
    const auto shown = [](const Vec4f& pixel) { return glm::clamp(Vec3f(pixel), Vec3f(0), Vec3f(1)) * 255.0f; };
    const Vec3f background = shown(a.pixels[0]);
    const auto isObject = [&](const Vec3f& c) {
        const Vec3f d = glm::abs(c - background);
        return std::max({d.x, d.y, d.z}) > 4;
    };
    double sum = 0, both = 0, any = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) {
        const Vec3f x = shown(a.pixels[i]), y = shown(b.pixels[i]), d = glm::abs(x - y);
        sum += static_cast<double>(d.x) + d.y + d.z;
        both += isObject(x) && isObject(y), any += isObject(x) || isObject(y);
    }
    return {sum / (3 * static_cast<double>(a.pixels.size())), any > 0 ? both / any : 1};
}

class OgrePictures : public testing::Test {
  protected:
    void SetUp() override {
        if (!haveDisplay()) GTEST_SKIP() << "there is no display, and no Xvfb";
        Both both(8, 8);
        both.attach();
        if (auto picture = both.raster->nextPicture(both.options); !picture) GTEST_SKIP() << picture.error().format();
    }
};

struct Content {
    const char* name;
    std::string body;
};
std::ostream& operator<<(std::ostream& out, const Content& content) {
    return out << content.name;
}

class OgreContent : public OgrePictures, public testing::WithParamInterface<Content> {};

TEST_P(OgreContent, IsSeenAsByRays) {
    Both both;
    both.load(GetParam().body);
    const Picture drawn = both.drawn();
    const Difference difference = differenceOf(both.traced(), drawn);
    EXPECT_LE(difference.mean, 1.5);
    EXPECT_GE(difference.overlap, .98);
    double seen = 0;
    for (const Vec4f& pixel : drawn.pixels) seen += glm::distance(pixel, drawn.pixels[0]);
    EXPECT_GT(seen, 50) << "something is seen";
    for (const Diagnostic& d : both.raster->diagnostics().all()) ADD_FAILURE() << d.format();
}

// The rasteriser's picture stays as it is, except for shadows.
TEST_P(OgreContent, IsSeenInHybridPictures) {
    Both both;
    both.load(GetParam().body);
    both.options.settings.shadows = Shadows::automatic, both.options.settings.maxDepth = 250;
    const Difference difference = differenceOf(both.traced(), both.hybrid());
    EXPECT_LE(difference.mean, 1.5);
    EXPECT_GE(difference.overlap, .98);
    for (const Diagnostic& d : both.raster->diagnostics().all()) ADD_FAILURE() << d.format();
}

std::string shape(const std::string& appearance, const std::string& geometry, const std::string& position = "0 0 0") {
    return "Transform { translation " + position +
           " rotation .70710678 .70710678 0 .6 children Shape { appearance Appearance { " + appearance +
           " } geometry " + geometry + " } }\n";
}
const char* const kChecks =
    "texture PixelTexture { image 4 4 3 0xFF0000 0x00FF00 0x0000FF 0xFFFFFF 0x808080 0xFFFF00 0x00FFFF 0xFF00FF "
    "0x202020 "
    "0xFF8000 0x8000FF 0x00FF80 0x404040 0xC0C0C0 0x600000 0x006000 textureProperties TextureProperties { "
    "magnificationFilter \"AVG_PIXEL\" boundaryModeS \"MIRRORED_REPEAT\" } }";

INSTANTIATE_TEST_SUITE_P(
    Contents, OgreContent,
    testing::Values(
        Content{
            "phong",
            "NavigationInfo { headlight FALSE }\nDirectionalLight { direction -1 -1 -2 ambientIntensity .3 }\n" +
                shape(
                    "material Material { diffuseColor .8 .3 .2 specularColor .9 .9 .9 shininess .4 ambientIntensity .5 "
                    "emissiveColor .05 .05 .1 }",
                    "Sphere { radius 2 }")},
        Content{"physical",
                "NavigationInfo { headlight FALSE }\nDirectionalLight { direction -1 -1 -2 intensity 3 }\n" +
                    shape("material PhysicalMaterial { baseColor .8 .5 .2 metallic .7 roughness .4 }",
                          "Sphere { radius 2 }")},
        Content{"scopes",
                "NavigationInfo { headlight FALSE }\n"
                "Group { children [ PointLight { global FALSE color 1 0 0 location -2 3 4 attenuation 1 .05 .01 } " +
                    shape("material Material { }", "Box { }", "-2 0 0") + "] }\n" +
                    "Group { children [ SpotLight { global FALSE color 0 1 0 location 2 0 5 cutOffAngle .3 beamWidth "
                    ".1 } " +
                    shape("material Material { }", "Box { size 3 3 1 }", "2 0 0") + "] }\n"},
        Content{"texture", shape(std::string(kChecks) + " textureTransform TextureTransform { scale 3 2 rotation .4 "
                                                        "translation .2 .1 }",
                                 "Box { size 4 4 4 }")},
        Content{"vertex colours, both sides",
                "Transform { rotation 0 1 0 2.5 children Shape { appearance Appearance { material Material { } "
                "backMaterial Material { diffuseColor 0 0 1 } } geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 "
                "2 -1 0 "
                "2 3 -1 3 2 4 -1 ] coord Coordinate { point [ -3 -2 0, 3 -2 0, 3 2 0, -3 2 0, 1 4 2 ] } color Color { "
                "color [ 1 "
                "0 0, 0 1 0, 0 0 1, 1 1 0, 0 1 1 ] } } } }\n"},
        Content{"mirrored and sheared",
                "Transform { scale -1 2 .5 scaleOrientation 0 0 1 .7 children " +
                    shape("material Material { diffuseColor .2 .7 .3 }", "Cone { bottomRadius 2 }") + "}\n"},
        Content{"clear",
                "Background { skyColor .2 .3 .4 }\n" +
                    shape("material Material { diffuseColor 1 0 0 }", "Box { size 3 3 1 }", "0 0 -3") +
                    shape("material Material { diffuseColor 0 1 0 transparency .6 }", "Sphere { radius 2 }", "1 0 0")},
        Content{"fog", "Fog { color .7 .7 .8 visibilityRange 25 }\n" +
                           shape("material Material { diffuseColor 1 0 0 }", "Box { size 9 9 1 }", "0 0 -4") +
                           "Group { children [ LocalFog { color 1 1 0 visibilityRange 14 fogType \"EXPONENTIAL\" } " +
                           shape("material Material { }", "Sphere { radius 1.5 }") + "] }\n"},
        Content{"cut", "Group { children [ ClipPlane { plane 1 1 0 .4 } " +
                           shape("material Material { diffuseColor 1 .5 0 }", "Sphere { radius 2.5 }") + "] }\n"},
        Content{"lines and points",
                "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 1 0 } lineProperties "
                "LineProperties "
                "{ linewidthScaleFactor 5 } } geometry LineSet { vertexCount 4 coord Coordinate { point [ -3 -2 0, -1 "
                "2.3 1, 1 "
                "-2.1 0, 3.1 2 -4 ] } } }\n"
                "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 0 1 1 } pointProperties "
                "PointProperties { pointSizeScaleFactor 9 } } geometry PointSet { coord Coordinate { point [ -2 1.03 "
                "0, 0 .51 "
                "1, 2.2 -1.04 0 ] } } }\n"},
        Content{"text",
                "Shape { appearance Appearance { material Material { } } geometry Text { string \"Hall\" fontStyle "
                "FontStyle { size 3 justify \"MIDDLE\" } } }\n"},
        Content{"background",
                "Background { skyColor [ 0 0 .4, .4 .5 1, 1 1 1 ] skyAngle [ 1, 1.5 ] groundColor [ .1 .1 .1, "
                ".5 .4 .2 ] groundAngle 1.5 }\n"},
        Content{
            "background of pictures",
            "Viewpoint { orientation .4364 .8729 .2182 .9 fieldOfView 1.8 }\nTextureBackground { skyColor .2 0 .2 "
            "frontTexture PixelTexture { image 2 2 3 0xFF0000 0x00FF00 0x0000FF 0xFFFFFF } leftTexture PixelTexture { "
            "image "
            "2 2 3 0x800000 0x008000 0x000080 0x808080 } topTexture PixelTexture { image 2 2 4 0xFFFF00FF 0x00FFFF80 "
            "0xFF00FFFF 0x000000FF } backTexture PixelTexture { image 1 2 3 0x404040 0xC08040 } bottomTexture "
            "PixelTexture { "
            "image 2 1 3 0x4080C0 0x80C040 } rightTexture PixelTexture { image 2 2 3 0x102030 0x302010 0x203010 "
            "0xF0F0F0 } "
            "}\n"},
        Content{"hatched",
                "Shape { appearance Appearance { material Material { diffuseColor .2 .2 .8 } fillProperties "
                "FillProperties { hatchStyle 6 hatchColor 1 1 0 } } geometry Box { size 4 4 4 } }\n"
                "Transform { translation -4 0 0 children Shape { appearance Appearance { material Material { } "
                "fillProperties FillProperties { filled FALSE hatchStyle 1 hatchColor 1 0 0 } } geometry Sphere { } } "
                "}\n"},
        Content{
            "dashes and attenuated points",
            "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 1 0 } lineProperties "
            "LineProperties "
            "{ linetype 4 linewidthScaleFactor 7 } } geometry LineSet { vertexCount 3 coord Coordinate { point [ "
            "-3 -2 0, 0 "
            "2.3 0, 3 -2.1 0 ] } color ColorRGBA { color [ 1 0 0 1, 0 1 0 1, 0 0 1 .5 ] } } }\n"
            "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 0 1 1 } pointProperties "
            "PointProperties { pointSizeScaleFactor 60 pointSizeMinValue 2 pointSizeMaxValue 30 attenuation 0 .5 0 } } "
            "geometry PointSet { coord Coordinate { point [ -2.03 1.03 0, 0 .51 3.1, 2.2 -1.04 -20 ] } } }\n"},
        Content{"lit lines",
                "Shape { appearance Appearance { material Material { diffuseColor 1 1 0 } lineProperties "
                "LineProperties { linewidthScaleFactor 9 } } geometry LineSet { vertexCount 3 coord Coordinate { "
                "point [ -3 -2 0, 0 2.3 0, 3 -2.1 0 ] } normal Normal { vector [ 0 0 1, 1 0 0, 0 0 1 ] } } }\n"},
        Content{"alpha of colours and textures",
                "Background { skyColor 0 .3 .6 }\nShape { appearance Appearance { material Material { } } geometry "
                "IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 -1 0 2 3 -1 ] coord Coordinate { point [ -3 -2 1, 0 "
                "-2 1, 0 2 1, "
                "-3 2 1 ] } color ColorRGBA { color [ 1 0 0 1, 0 1 0 .5, 0 0 1 0, 1 1 0 .2 ] } } }\n"
                "Transform { translation 2 0 0 children Shape { appearance Appearance { material Material { } texture "
                "PixelTexture { image 2 2 4 0xFF0000FF 0x00FF0000 0x0000FFFF 0xFFFFFF00 textureProperties "
                "TextureProperties { "
                "magnificationFilter \"NEAREST_PIXEL\" boundaryModeS \"CLAMP_TO_BOUNDARY\" borderColor 1 1 0 1 } } "
                "textureTransform TextureTransform { scale 2 2 center .5 .5 } } geometry Box { size 3 3 .1 } } }\n"},
        Content{
            "textures of a physical material",
            "NavigationInfo { headlight FALSE }\nDirectionalLight { direction -.3 -.5 -1 intensity 4 }\nShape { "
            "appearance "
            "Appearance { material PhysicalMaterial { baseTexture PixelTexture { image 2 2 3 0xC08040 0x40C080 "
            "0x8040C0 "
            "0xFFFFFF } metallicRoughnessTexture PixelTexture { image 2 1 3 0x008000 0x0040FF } normalTexture "
            "PixelTexture { "
            "image 2 2 3 0x8080FF 0xA080E0 0x80A0E0 0x6080E0 } occlusionTexture PixelTexture { image 1 2 1 0x80 0xFF } "
            "emissiveTexture PixelTexture { image 1 1 3 0x202040 } emissiveColor 1 1 1 } } geometry Sphere { radius 3 "
            "} }\n"},
        Content{"depths in fog",
                "Fog { color 1 0 0 visibilityRange 100 }\nShape { appearance Appearance { material Material { } } "
                "geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 0 2 3 -1 ] coord Coordinate { point [ -3 -2 1, 3 "
                "-2 1, 3 2 1, -3 2 1 ] } fogCoord FogCoordinate { depth [ 0, .3, 1, .6 ] } } }\n"},
        Content{"cut by the edges of the picture",
                shape("material Material { diffuseColor 1 0 0 }", "Box { size 1 9 1 }", "5.6 0 0") +
                    shape("material Material { diffuseColor 0 1 0 }", "Box { size 9 1 1 }", "0 4.4 0") +
                    shape("material Material { diffuseColor 0 0 1 }", "Box { size 1 1 9 }", "-5.4 -1 2")},
        Content{"near, far and sight",
                "NavigationInfo { visibilityLimit 14 }\nViewpoint { nearDistance 8 }\n" +
                    shape("material Material { diffuseColor 1 0 0 }", "Box { size 3 3 5 }") +
                    shape("material Material { diffuseColor 0 1 0 }", "Box { size 30 30 1 }", "0 0 -3")},
        Content{"below an uneven scale",
                "Transform { scale 1 .4 2 children [ Viewpoint { position 0 0 6 } " +
                    shape("material Material { diffuseColor .9 .6 .3 specularColor 1 1 1 }", "Sphere { radius 2 }") +
                    "] }\n"},
        Content{"far away", "Viewpoint { position 2000000 0 10 }\nTransform { translation 2000000 0 0 children " +
                                shape("material Material { diffuseColor .3 .8 1 }", "Box { size 3 2 1 }") + "}\n"},
        Content{"parallel", "OrthoViewpoint { position 1 2 9 fieldOfView [ -4 -3 4 3 ] }\n" +
                                shape("material Material { diffuseColor .3 .8 1 }", "Cylinder { }", "1 1 0")},
        Content{"layers", shape("material Material { diffuseColor 1 0 0 }", "Box { size 6 6 1 }") +
                              "LayerSet { activeLayer 0 order [ 0 1 ] layers Layer { viewport Viewport { clipBoundary "
                              "[ .5 1 0 .5 ] } children "
                              "[ Viewpoint { position 0 0 5 } " +
                              shape("material Material { diffuseColor 0 0 1 }", "Sphere { }") + "] } }\n"},
        Content{"switch and level of detail",
                "Viewpoint { }\nSwitch { whichChoice 1 children [ Shape { geometry Sphere { radius 5 } } " +
                    shape("material Material { }", "Box { }", "-2 0 0") + "] }\n" +
                    "Transform { translation 2 0 0 children LOD { range [ 3 ] children [ Shape { geometry Sphere { "
                    "radius 2 } } " +
                    shape("material Material { diffuseColor 0 1 0 }", "Cone { }") + "] } }\n"}),
    [](const auto& content) {
        std::string name;
        for (const char c : std::string_view(content.param.name))
            name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
        return name;
    });

/// A number that only rays know, as metadata.
std::string known(const char* name, const char* value) {
    return std::string("metadata MetadataSet { name \"RTSG\" value MetadataFloat { name \"") + name + "\" value " +
           value + " } }";
}

class HybridContent : public OgrePictures, public testing::WithParamInterface<Content> {};

// Features that a rasteriser lacks are shown by rays, in the places where the rasteriser sees the surface.
TEST_P(HybridContent, IsSeenAsByRays) {
    for (const int samples : {1, 4}) {
        Both both;
        both.load(GetParam().body);
        both.options.settings.samplesPerPixel = samples;
        both.options.settings.shadows = Shadows::automatic, both.options.settings.maxDepth = 250;
        RenderStats stats;
        const Picture hybrid = both.hybrid(&stats);
        const Difference difference = differenceOf(both.traced(), hybrid);
        EXPECT_LE(difference.mean, .9);
        EXPECT_GE(difference.overlap, .97);
        EXPECT_GT(stats.primaryRays, 100u);
        EXPECT_LT(stats.primaryRays, samples * 160u * 120u) << "the background stays";
        EXPECT_GT(differenceOf(both.drawn(), hybrid).mean, .3) << "rays add something";
        if (samples == 1) continue;
        const auto plain = both.raster->hybridPicture(both.options);
        ASSERT_TRUE(plain);
        EXPECT_EQ(plain->pixels, hybrid.pixels) << "the same again";
    }
}

const std::string kFloor = "NavigationInfo { headlight FALSE }\nDirectionalLight { direction -1 -2 -1 }\n" +
                           shape("material Material { diffuseColor .6 .6 .5 }", "Box { size 4 .2 4 }", "0 -1.6 0");

INSTANTIATE_TEST_SUITE_P(
    Contents, HybridContent,
    testing::Values(
        Content{"shadows", kFloor + shape("material Material { diffuseColor .8 .2 .1 }", "Sphere { }")},
        Content{"mirrors",
                kFloor + shape("material Material { diffuseColor .1 .1 .1 " + known("reflectivity", ".8") + " }",
                               "Sphere { }")},
        Content{"glass", kFloor + shape("material Material { diffuseColor 0 0 0 transparency 1 " +
                                            known("refractiveIndex", "1.5") + " }",
                                        "Sphere { radius 1.3 }")},
        Content{"clear surfaces in a row",
                kFloor + shape("material Material { diffuseColor 0 1 0 transparency .6 }", "Sphere { radius 1.2 }") +
                    shape("material Material { diffuseColor 1 0 0 transparency .4 }", "Box { }", "1 0 1.5")},
        Content{"light from all around",
                "NavigationInfo { headlight FALSE }\nEnvironmentLight { specularTexture ComposedCubeMapTexture { "
                "frontTexture DEF P PixelTexture { image 1 2 3 0xFFC080 0x204080 } backTexture USE P leftTexture USE "
                "P rightTexture USE P topTexture USE P bottomTexture USE P } }\n" +
                    shape("material PhysicalMaterial { baseColor .9 .7 .3 metallic 1 roughness .2 }", "Sphere { }")},
        Content{"what rasterisers leave out",
                shape("material Material { } texture MultiTexture { mode \"ADD\" texture [ PixelTexture { image 2 1 3 "
                      "0xC00000 0x0000C0 } PixelTexture { image 1 2 3 0x00C000 0x202020 } ] }",
                      "Box { }") +
                    shape("material Material { } texture ComposedCubeMapTexture { frontTexture DEF P PixelTexture { "
                          "image 1 2 3 0xFFC080 0x204080 } backTexture USE P leftTexture USE P rightTexture USE P "
                          "topTexture USE P bottomTexture USE P }",
                          "Sphere { }", "2.4 0 0")},
        Content{"lines before a mirror",
                kFloor +
                    shape("material Material { " + known("reflectivity", "1") + " }", "Box { size 3 3 .2 }", "0 0 -1") +
                    "Shape { appearance Appearance { material Material { diffuseColor 1 1 0 } lineProperties "
                    "LineProperties { linewidthScaleFactor 9 } } geometry LineSet { vertexCount 3 coord Coordinate { "
                    "point [ -2 -1 1, 0 1.3 1, 2 -1.1 1 ] } normal Normal { vector [ 0 0 1, 1 0 0, 0 0 1 ] } } }\n"},
        Content{
            "mirrors in layers, parallel",
            "OrthoViewpoint { position 0 0 9 fieldOfView [ -4 -3 4 3 ] }\n" + kFloor +
                "LayerSet { activeLayer 0 order [ 0 1 ] layers Layer { viewport Viewport { clipBoundary [ .6 1 0 "
                ".5 ] } children [ Viewpoint { position 0 0 5 nearDistance 1 } " +
                shape("material Material { diffuseColor .1 .1 .4 " + known("reflectivity", ".8") + " }", "Sphere { }") +
                shape("material UnlitMaterial { emissiveColor 1 0 0 }", "Box { }", "1.5 0 0") + "] } }\n"},
        Content{"far away, in fog and cut",
                "Viewpoint { position 2000000 0 10 }\nBackground { skyColor .9 .3 0 }\nFog { color .7 .7 .8 "
                "visibilityRange 40 "
                "}\nTransform { "
                "translation 2000000 0 0 children [ ClipPlane { plane 1 1 0 .8 } " +
                    shape("material Material { diffuseColor .1 .1 .1 " + known("reflectivity", ".8") + " }",
                          "Sphere { radius 2 }") +
                    shape("material Material { diffuseColor 1 .5 0 }", "Box { }", "-2.5 0 1") + "] }\n"}),
    [](const auto& content) {
        std::string name;
        for (const char c : std::string_view(content.param.name))
            name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
        return name;
    });

TEST_F(OgrePictures, ExamplesAreSeenAsByRays) {
    for (const char* name : {"demo/hall.x3dv", "door.x3dv", "room.x3dv", "layout.x3dv"}) {
        SCOPED_TRACE(name);
        const std::string file = std::string(RTSG_SOURCE_DIR "/examples/") + name;
        Both both(320, 180);
        ASSERT_TRUE(loadFile(both.scene, file, both.diagnostics));
        both.attach(Resources::ofFile(file));
        const Picture drawn = both.drawn();
        const Difference difference = differenceOf(both.traced(), drawn);
        EXPECT_LE(difference.mean, 1.5);
        EXPECT_GE(difference.overlap, .98);
        both.options.settings.shadows = Shadows::automatic, both.options.settings.maxDepth = 250;
        EXPECT_LE(differenceOf(both.traced(), both.hybrid()).mean, .5);
    }
}

// Matte surfaces show light from all around as by rays; a warning says that nothing mirrors it.
TEST_F(OgrePictures, MatteSurfacesAreLitFromAllAround) {
    const std::string coefficients =
        "diffuseCoefficients [ 2 1.6 1.2 .9 .3 .1 .2 .2 .6 -.5 .1 .4 .1 .1 .1 .05 .1 0 .2 .1 .05 0 .1 .1 .1 0 .1 ]";
    for (const std::string& light :
         {std::string("intensity .7 color .9 .8 .6"), coefficients,
          coefficients + " rotation 0 1 0 1.2 intensity .5 ambientIntensity .4",
          std::string("specularTexture ComposedCubeMapTexture { frontTexture DEF P PixelTexture { image 1 2 3 0xFFC080 "
                      "0x204080 } backTexture USE P leftTexture USE P rightTexture USE P topTexture PixelTexture { "
                      "image 1 1 3 0x80A0FF } bottomTexture PixelTexture { image 1 1 3 0x302010 } }")}) {
        SCOPED_TRACE(light);
        Both both;
        ASSERT_TRUE(loadText(both.scene,
                             "#X3D V4.1 utf8\nPROFILE Full\nNavigationInfo { headlight FALSE }\nViewpoint { }\n"
                             "EnvironmentLight { " +
                                 light + " }\n" +
                                 shape("material Material { diffuseColor .8 .7 .6 ambientIntensity .5 }",
                                       "Sphere { radius 1.5 }", "-1.7 0 0") +
                                 shape("material Material { diffuseColor .3 .7 .9 }", "Box { }", "1.7 0 0"),
                             both.diagnostics));
        both.attach();
        const Picture drawn = both.drawn();
        EXPECT_LE(differenceOf(both.traced(), drawn).mean, .6);
        EXPECT_GT(glm::length(Vec3f(drawn.at(50, 60))), .2);
        std::string said;
        for (const Diagnostic& d : both.raster->diagnostics().all()) said += d.text;
        EXPECT_THAT(said, HasSubstr("not mirrored"));
    }
}

TEST_F(OgrePictures, SeveralSamplesSmoothEdges) {
    Both both;
    both.load(shape("material UnlitMaterial { emissiveColor 1 1 1 }", "Box { size 4 4 1 }"));
    both.options.settings.samplesPerPixel = 8;
    const Difference difference = differenceOf(both.traced(), both.drawn());
    EXPECT_LE(difference.mean, .7);
    both.options.settings.samplesPerPixel = 1;
    const Picture plain = both.drawn();
    both.options.settings.samplesPerPixel = 8;
    EXPECT_GT(differenceOf(plain, both.drawn()).mean, .2);
}

TEST_F(OgrePictures, EditsGiveThePictureOfTheSceneAnew) {
    Scene scene;
    SeenEdits edits(scene, 7);
    SharedWorld world(scene);
    OgreRenderer followed(world);
    ImageOptions options;
    options.settings.width = 64, options.settings.height = 48;
    for (int set = 0; set < 300; ++set) {
        for (int i = 0; i < 8; ++i) edits.step();
        scene.newFrame(set);
        if (set % 4 != 3) continue;
        const auto drawn = followed.nextPicture(options);
        ASSERT_TRUE(drawn) << drawn.error().format();
        if (set % 20 != 19) continue;
        OgreRenderer anew(world);
        const auto fresh = anew.nextPicture(options);
        ASSERT_TRUE(fresh) << fresh.error().format();
        ASSERT_LE(differenceOf(*fresh, *drawn).mean, .5) << "after " << set << " sets of changes";
    }
}

// The scene goes on while pictures of its states are made elsewhere.
TEST_F(OgrePictures, StatesArePicturedOnAnotherThread) {
    Scene scene;
    SeenEdits edits(scene, 8);
    SharedWorld world(scene);
    OgreRenderer followed(world);
    ImageOptions options;
    options.settings.width = 64, options.settings.height = 48;
    std::shared_ptr<const WorldState> older;
    for (int set = 0; set < 300; ++set) {
        for (int i = 0; i < 8; ++i) edits.step();
        scene.newFrame(set);
        const auto state = world.present();
        ASSERT_TRUE(state) << state.error().format();
        if (set % 4 != 3) continue;
        const bool compares = set % 20 == 19;
        Picture fresh;
        if (compares) {
            OgreRenderer anew(world);
            auto picture = anew.nextPicture(options);
            ASSERT_TRUE(picture) << picture.error().format();
            fresh = std::move(*picture);
        }
        Result<Picture> drawn{Picture()};
        RenderStats stats;
        std::thread worker([&] { drawn = followed.nextPicture(**state, options, {}, stats); });
        edits.step();
        scene.newFrame(set + .5);
        worker.join();
        ASSERT_TRUE(drawn) << drawn.error().format();
        EXPECT_FALSE(stats.cancelled);
        EXPECT_EQ(followed.presented(), (*state)->sequence);
        if (compares) {
            ASSERT_LE(differenceOf(fresh, *drawn).mean, .5) << "after " << set << " sets of changes";
        }
        older = *state;
    }
    const auto last = world.present();
    ASSERT_TRUE(last);
    EXPECT_TRUE(followed.renderFrame(**last));
    EXPECT_FALSE(followed.renderFrame(*older)) << "it goes on, not back";
    EXPECT_TRUE(followed.renderFrame()) << "on the scene's thread, too";
}

TEST_F(OgrePictures, WhatItCannotDoIsAnError) {
    Both both;
    both.load("Shape { geometry Box { } }\n");
    const auto refused = [&](auto change, const char* what) {
        ImageOptions options = both.options;
        change(options);
        const auto picture = both.raster->nextPicture(options);
        ASSERT_FALSE(picture) << what;
        EXPECT_THAT(picture.error().text, HasSubstr(what));
    };
    refused([](ImageOptions& o) { o.settings.shadows = Shadows::all; }, "shadows");
    refused([](ImageOptions& o) { o.panorama = true; }, "panoramas");
    refused([](ImageOptions& o) { o.stereo = Stereo::beside; }, "two eyes");
    refused([](ImageOptions& o) { o.settings.layers = kDepth; }, "layers");
    refused([](ImageOptions& o) { o.viewpoint = "nobody"; }, "nobody");
    refused([](ImageOptions& o) { o.settings.width = 0; }, "0 x 120");
    ImageOptions options = both.options;
    options.settings.integrator = Integrator::path;
    const auto paths = both.raster->hybridPicture(options);
    ASSERT_FALSE(paths);
    EXPECT_THAT(paths.error().text, HasSubstr("not by path"));
    options.settings.integrator = Integrator::whitted, options.settings.caps = true;
    EXPECT_FALSE(both.raster->hybridPicture(options));
    EXPECT_NE(both.raster->driver(), "");
}

}  // namespace
}  // namespace rtsg
