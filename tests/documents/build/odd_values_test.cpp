// Values that mean nothing where they stand are named with their line, whatever verb loads the file, and no others.
#include <gmock/gmock.h>

#include "core/scene_check.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

std::string saidOf(const std::string& body) {
    Scene scene;
    Diagnostics diagnostics;
    EXPECT_TRUE(loadText(scene, "#X3D V4.1 utf8\nPROFILE Full\n" + body, diagnostics)) << body;
    return test::allText(diagnostics);
}

const std::string kPixel = "PixelTexture { image 1 1 1 255 }";

TEST(OddValues, AreNamedWithWhatIsDoneInstead) {
    const std::pair<std::string, const char*> cases[] = {
        {"Shape { appearance Appearance { texture MultiTexture { mode \"MODULATED\" texture " + kPixel + " } } }",
         "3:41: warning: MultiTexture.mode: 'MODULATED' is no mode of a MultiTexture: taken as MODULATE"},
        {"Shape { appearance Appearance { texture MultiTexture { mode [ \"ADD\" \"ADD, MIX\" ] } } }",
         "'MIX' is no mode"},
        {"Shape { appearance Appearance { texture MultiTexture { source \"DIFUSE\" } } }",
         "'DIFUSE' is no source of a MultiTexture: taken as the texture before"},
        {"Shape { appearance Appearance { texture MultiTexture { function \"COMPLEMENTED\" } } }",
         "'COMPLEMENTED' is no function of a MultiTexture: taken as none"},
        {"Shape { appearance Appearance { texture GeneratedCubeMapTexture { size 4097 } } }",
         "GeneratedCubeMapTexture.size: 4097 is more than 4096, which is taken"},
        {"Shape { appearance Appearance { texture RenderedTexture { width 4097 } } }",
         "RenderedTexture.width: 4097 is more than 4096"},
        {"Shape { appearance Appearance { texture RenderedTexture { height 5000 } } }",
         "RenderedTexture.height: 5000 is more than 4096"},
        {"Shape { appearance Appearance { texture ComposedCubeMapTexture { } } }", "none of its six sides is given"},
        {"TextureProjector { direction 0 0 0 texture " + kPixel + " }",
         "TextureProjector.direction: 0 0 0 is none: it shines nowhere"},
        {"TextureProjectorParallel { direction 0 0 0 texture " + kPixel + " }", "TextureProjectorParallel.direction"},
        {"\n SpotLight { direction 0 0 0 }", "4:2: warning: SpotLight.direction: 0 0 0 is none"},
        {"DirectionalLight { direction 0 -0 0 }", "DirectionalLight.direction: 0 0 0 is none"},
        {"IsoSurfaceVolumeData { }", "IsoSurfaceVolumeData.surfaceValues: none is given: it shows nothing"},
        {"LayerSet { order [ 0 1 3 ] layers [ Layer { } Layer { } ] }",
         "LayerSet.order: there is no layer 3, the last one is 2: it is left out"},
        {"Group { } LayerSet { order 0 }\nLayerSet { order 1 layers Layer { } }",
         "4:1: warning: LayerSet.layers: there is a LayerSet before it, whose order, viewports and activeLayer count"},
        {"LayerSet { layers Layer { viewport Viewport { clipBoundary [ 0 .5 0 ] } } }",
         "Viewport.clipBoundary: has 3 numbers, not left, right, bottom and top: taken as 0 1 0 1"},
        {"LayerSet { layers Layer { viewport Viewport { clipBoundary [ .5 .5 0 1 ] } } }",
         "Viewport.clipBoundary: left is not less than right, or bottom than top: it shows nothing"},
        {"Viewport { clipBoundary [ 0 1 .6 .4 ] }",
         "Viewport.clipBoundary: left is not less than right, or bottom than top: it shows nothing"},
    };
    for (const auto& [body, text] : cases) {
        EXPECT_THAT(saidOf(body), HasSubstr(text));
        const std::string_view whole = text;
        const std::size_t offset = whole.find("warning: ");
        EXPECT_THAT(saidOf("PROTO P [ ] { Group { children [ " + body + " ] } } P { }"),
                    HasSubstr(std::string(offset == whole.npos ? whole : whole.substr(offset))));
    }
    // A body's is told once, however often it is used.
    const std::string often = saidOf("PROTO P [ ] { SpotLight { direction 0 0 0 } } P { } P { } P { }");
    EXPECT_EQ(often.find("SpotLight.direction"), often.rfind("SpotLight.direction")) << often;
}

TEST(OddValues, WhatMeansSomethingIsNot) {
    EXPECT_EQ(
        saidOf("Shape { appearance Appearance { texture MultiTexture { mode [ \"REPLACE\" \" ADD , SUBTRACT\" \"\" "
               "] source [ "
               "\"FACTOR\" \"\" ] function [ \"\" \"ALPHAREPLICATE\" ] texture [ " +
               kPixel + " " + kPixel +
               " ] } } geometry Box { } } "
               "Shape { appearance Appearance { texture GeneratedCubeMapTexture { size 4096 } } geometry Box { } } "
               "Shape { appearance Appearance { texture ComposedCubeMapTexture { topTexture " +
               kPixel +
               " } } geometry Box { } } SpotLight { direction 0 0 1e-30 } DirectionalLight { } TextureProjector { "
               "texture " +
               kPixel +
               " } LayerSet { order [ 0 1 ] layers Layer { viewport Viewport { } } } IsoSurfaceVolumeData { "
               "surfaceValues .5 }"),
        "");
}

}  // namespace
}  // namespace rtsg
