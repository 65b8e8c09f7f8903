// Textures and vertex colours in pictures: where they lie, what they are multiplied with, what is reported.
#include <rtsg/renderers/light_tracer.h>

#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "light_scene.h"

namespace rtsg {
namespace {

using namespace test;

TEST(LightTracer, TextureLiesTheRightWayUp) {
    LightScene s(
        "Viewpoint { position 0 0 10 fieldOfView 0.199337 }" +
            square(
                1,
                "material UnlitMaterial { } texture PixelTexture { image 2 2 3 0xFF0000 0x00FF00 0x0000FF 0xFFFFFF }"),
        64, 64);
    const Picture p = s.picture();
    // Half a pixel off the texels' centres: 1/64 of the neighbours' colours.
    expectColor(Vec3f(p.at(16, 48)), {1, 0, 0}, 0.032);  // lower left: s = t = 0
    expectColor(Vec3f(p.at(48, 48)), {0, 1, 0}, 0.032);
    expectColor(Vec3f(p.at(16, 16)), {0, 0, 1}, 0.032);
    expectColor(Vec3f(p.at(48, 16)), {1, 1, 1}, 0.032);
}

TEST(LightTracer, TextureModulatesTheMaterialAndIsTransformed) {
    // Shifted by half a texture: what was on the right is on the left.
    LightScene s("Viewpoint { position 0 0 10 fieldOfView 0.199337 } DirectionalLight { }" +
                     square(1,
                            "material Material { diffuseColor 0.5 0.5 0.5 } textureTransform TextureTransform { "
                            "translation 0.5 0 } texture PixelTexture { image 2 1 3 0xFF0000 0x00FF00 }"),
                 64, 64);
    const Picture p = s.picture();
    expectColor(Vec3f(p.at(16, 32)), {0, 0.5, 0}, 0.01);
    expectColor(Vec3f(p.at(48, 32)), {0.5, 0, 0}, 0.01);
}

TEST(LightTracer, TextureAlphaIsCoverage) {
    LightScene s(square(5, "material UnlitMaterial { } texture PixelTexture { image 1 1 4 0xFF000080 }") +
                 "Transform { translation 0 0 -1 children " + square(100, unlit("0 0 1")) + "}");
    expectColor(s.center(), {128 / 255.0, 0, 127 / 255.0}, 1e-5);
    LightScene mask(square(5,
                           "alphaMode \"MASK\" alphaCutoff 0.6 material UnlitMaterial { } texture PixelTexture { image "
                           "1 1 4 0xFF000080 }") +
                    "Transform { translation 0 0 -1 children " + square(100, unlit("0 0 1")) + "}");
    expectColor(mask.center(), {0, 0, 1}, 1e-5);
    LightScene opaque(
        square(5, "alphaMode \"OPAQUE\" material UnlitMaterial { } texture PixelTexture { image 1 1 4 0xFF000080 }"));
    expectColor(opaque.center(), {1, 0, 0}, 1e-5);
}

TEST(LightTracer, MaskCutsByTheAlphaOfColours) {
    // 11.2.2: the alpha of a ColorRGBA stands in for the transparency, and 12.2.3 cuts by it.
    const auto seen = [](const char* material, const char* alpha) {
        LightScene s(
            fmt::format("Shape {{ appearance Appearance {{ alphaMode \"MASK\" alphaCutoff .5 material {} }} geometry "
                        "IndexedFaceSet {{ "
                        "coord Coordinate {{ point [ -5 -5 0, 5 -5 0, 5 5 0, -5 5 0 ] }} coordIndex [ 0 1 2 3 ] color "
                        "ColorRGBA {{ color "
                        "[ 1 0 0 {} ] }} colorIndex [ 0 0 0 0 ] }} }} Transform {{ translation 0 0 -1 children {} }}",
                        material, alpha, square(100, unlit("0 0 1"))));
        return s.center();
    };
    expectColor(seen("UnlitMaterial { transparency .8 }", ".9"), {1, 0, 0}, 1e-5);
    expectColor(seen("UnlitMaterial { }", ".2"), {0, 0, 1}, 1e-5);
    expectColor(seen("UnlitMaterial { }", ".5"), {1, 0, 0}, 1e-5);
}

TEST(LightTracer, MaskCutsLinesByTheirAlpha) {
    const auto seen = [](const char* alpha) {
        LightScene s(
            fmt::format("Viewpoint {{ position 0 0 1 }} Shape {{ appearance Appearance {{ alphaMode \"MASK\" "
                        "alphaCutoff .5 material "
                        "UnlitMaterial {{ }} lineProperties LineProperties {{ applied TRUE linewidthScaleFactor 20 }} "
                        "}} geometry LineSet {{ "
                        "vertexCount 2 coord Coordinate {{ point [ -1 0 0, 1 0 0 ] }} color ColorRGBA {{ color [ 1 0 0 "
                        "{0}, 1 0 0 {0} ] }} }} }} "
                        "Transform {{ translation 0 0 -1 children {1} }}",
                        alpha, square(100, unlit("0 0 1"))));
        return s.center();
    };
    expectColor(seen(".9"), {1, 0, 0}, 1e-5);
    expectColor(seen(".2"), {0, 0, 1}, 1e-5);
}

TEST(LightTracer, MissingTextureIsReportedAndLeftOut) {
    LightScene s(square(5,
                        "material UnlitMaterial { emissiveColor 0 0.5 0 } texture ImageTexture { url "
                        "[\"no/such/picture.png\" \"http://example.org/a.png\"] }"));
    EXPECT_EQ(s.center(), Vec3f(0, 0.5f, 0));
    s.center();
    ASSERT_EQ(s.light->tracer().diagnostics().all().size(), 1u) << "once";
    const std::string text = s.light->tracer().diagnostics().all()[0].text;
    EXPECT_NE(text.find("no/such/picture.png"), std::string::npos) << text;
    EXPECT_NE(text.find("http://example.org/a.png"), std::string::npos) << text;
}

TEST(LightTracer, VertexColorsStandInForTheMaterials) {
    const std::string colored =
        "Shape { appearance Appearance { material Material { diffuseColor 1 1 1 transparency 0 } } geometry "
        "IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] colorPerVertex FALSE "
        "color %s coord Coordinate { point [-5 -5 0, 5 -5 0, 5 5 0, -5 5 0] } } }";
    std::string rgb = colored, rgba = colored;
    rgb.replace(rgb.find("%s"), 2, "Color { color [0.2 0.4 0.6] }");
    rgba.replace(rgba.find("%s"), 2, "ColorRGBA { color [0.2 0.4 0.6 0.5] }");
    LightScene s("DirectionalLight { }" + rgb);
    expectColor(s.center(), {0.2, 0.4, 0.6}, 1e-6);
    LightScene t("DirectionalLight { } Background { skyColor 1 1 1 }" + rgba);
    expectColor(t.center(), {0.6, 0.7, 0.8}, 1e-6);
}

// 18.4.6 leaves open what interpolates: a PixelTexture of a few pixels shows them, unless its TextureProperties say
// otherwise, and one of 16 or more a side is smooth. At s = .3 of two pixels: the first one, or .2 of the second with
// it.
TEST(LightTextures, PixelTexturesOfAFewPixelsShowThem) {
    const auto seen = [](const std::string& image, const char* properties) {
        LightScene s(
            "Viewpoint { position -.4 0 5 } Shape { appearance Appearance { material UnlitMaterial { "
            "emissiveColor 1 1 1 } texture PixelTexture { repeatS FALSE image " +
            image + " " + properties + " } } geometry Rectangle2D { size 2 2 } }");
        return s.center().r;
    };
    EXPECT_NEAR(seen("2 1 1 255 0", ""), 1, 1e-3);
    EXPECT_NEAR(seen("2 1 1 255 0", "textureProperties TextureProperties { magnificationFilter \"NEAREST_PIXEL\" }"), 1,
                1e-3);
    EXPECT_NEAR(seen("2 1 1 255 0", "textureProperties TextureProperties { magnificationFilter \"AVG_PIXEL\" }"), .9,
                .01);
    std::string wide = "16 1 1";
    for (int i = 0; i < 16; ++i) wide += i < 5 ? " 255" : " 0";
    EXPECT_NEAR(seen(wide, ""), .7, .02) << "s = .3 is 4.8 pixels: .3 past the middle of the last white one";
}

// Stripes as wide as the pixels that they fill, each of four texels. Read a whole pixel wide by each of its 16 samples
// a pixel would get a quarter of its light from its neighbours; read a quarter wide, a sixteenth.
TEST(LightTextures, SamplesOfAPixelShareItsWidth) {
    std::string stripes = "128 1 1";
    for (int i = 0; i < 128; ++i) stripes += (i / 4) % 2 ? " 255" : " 0";
    LightScene s("Viewpoint { position 0 0 10 fieldOfView 0.199337 }" +
                     square(1, "material UnlitMaterial { } texture PixelTexture { image " + stripes + " }"),
                 32, 32);
    s.options.settings.samplesPerPixel = 16;
    const Picture p = s.picture();
    EXPECT_NEAR(p.at(10, 16).r, 0, .09);
    EXPECT_NEAR(p.at(11, 16).r, 1, .09);
}

/// Four texels of which one is seen: upper left red, right green, lower left blue, right yellow. A quarter turn takes
/// (u, v) to (v, -u), as KHR_texture_transform's own test model wants it.
TEST(LightTextures, GltfLooksUpASecondSetAndTurnsIt) {
    const auto shows = [](const char* how) {
        Scene scene;
        Diagnostics diagnostics;
        const std::string text =
            std::string(R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":120,"uri":"data:;base64,)") +
            "AAAgwgAAIMIAAKDAAAAgQgAAIMIAAKDAAAAAAAAAcEIAAKDAAABAPwAAQD8AAEA/AABAPwAAQD8AAEA/"
            "AACAPgAAgD4AAIA+AACAPgAAgD4AAIA+AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA" +
            R"("}],"bufferViews":[{"buffer":0,"byteLength":120}],"accessors":[
{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC2"},
{"bufferView":0,"byteOffset":60,"componentType":5126,"count":3,"type":"VEC2"}],"images":[{"uri":"data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAIAAAD91JpzAAAAFElEQVR42mP4z8DAAMIM////ZwAAHu8E/HMcU8wAAAAASUVORK5CYII="}],
"textures":[{"source":0}],"materials":[{"doubleSided":true,"extensions":{"KHR_materials_unlit":{}},"pbrMetallicRoughness":{"baseColorTexture":{"index":0)" +
            how +
            R"(}}}],"meshes":[{"primitives":[{"material":0,"attributes":{"POSITION":0,"TEXCOORD_0":1,"TEXCOORD_1":2}}]}],
"nodes":[{"mesh":0}],"cameras":[{"type":"perspective","perspective":{"yfov":1,"znear":0.1}}]})";
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        SharedWorld world(scene);
        LightRenderer light(world);
        scene.newFrame(0);
        ImageOptions options;
        options.settings.width = options.settings.height = 9;
        const auto picture = light.picture(options);
        EXPECT_TRUE(picture);
        return picture ? Vec3f(picture->at(4, 4)) : Vec3f(-1);
    };
    expectColor(shows(""), {1, 1, 0}, 1e-5);
    expectColor(shows(",\"texCoord\":1"), {1, 0, 0}, 1e-5);
    expectColor(shows(R"(,"texCoord":1,"extensions":{"KHR_texture_transform":{"rotation":1.5707964,"offset":[0,1]}})"),
                {0, 0, 1}, 1e-5);
    expectColor(shows(R"(,"extensions":{"KHR_texture_transform":{"texCoord":1,"scale":[3,1]}})"), {0, 1, 0}, 1e-5);
}

}  // namespace
}  // namespace rtsg
