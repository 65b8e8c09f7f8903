// How Appearance, lights and textures are read, and that what is read follows what changes and nothing else.
#include <rtsg/renderers/material.h>

#include <filesystem>
#include <fstream>
#include <set>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "light_scene.h"
#include "support/temp_folder.h"
#include "texture/texture_store.h"

namespace rtsg {
namespace {

struct Read {
    Scene scene;
    Diagnostics load, diagnostics;
    TextureStore textures;
    explicit Read(const std::string& body, std::filesystem::path folder = {}) : textures(std::move(folder)) {
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Immersive\n" + body, load));
        for (const Diagnostic& d : load.all()) ADD_FAILURE() << d.format();
    }
    Material material(const char* name = "A") {
        return readMaterial(scene, scene.findName(name), textures, diagnostics);
    }
};

std::string shape(const std::string& appearance) {
    return "Shape { appearance DEF A Appearance { " + appearance + " } geometry Box { } }";
}

TEST(MaterialReading, PhongInTheStandardsUnits) {
    Read r(
        shape("material Material { diffuseColor 0.1 0.2 0.3 specularColor 0.4 0.5 0.6 emissiveColor 0.7 0.8 0.9 "
              "shininess 0.25 ambientIntensity 0.5 transparency 0.75 }"));
    const Material m = r.material();
    EXPECT_EQ(m.model, ShadingModel::phong);
    EXPECT_EQ(m.base, Vec3f(0.1f, 0.2f, 0.3f));
    EXPECT_EQ(m.exponent, 32);
    EXPECT_EQ(m.opacity, 0.25f);
    EXPECT_TRUE(m.transmits());
    EXPECT_FALSE(m.mirrors());
}

TEST(MaterialReading, NothingIsUnlitWhite) {
    Read r(shape(""));
    const Material m = r.material();
    EXPECT_EQ(m.model, ShadingModel::unlit);
    EXPECT_EQ(m.base, Vec3f(1));
    EXPECT_EQ(readMaterial(r.scene, NodeId{}, r.textures, r.diagnostics).base, Vec3f(1));
    EXPECT_EQ(readMaterial(r.scene, NodeId{12345}, r.textures, r.diagnostics).base, Vec3f(1));
}

TEST(MaterialReading, OpticsComeFromMetadata) {
    const char* entries =
        "MetadataFloat { name \"refractiveIndex\" value 1.5 } MetadataFloat { name \"reflectivity\" value [0.1 0.2 "
        "0.3] } MetadataDouble { name \"absorption\" value 2 }";
    const std::string set = fmt::format("MetadataSet {{ name \"RTSG\" value [ {} ] }}", entries);
    for (const std::string& metadata :
         {set, "MetadataSet { name \"other\" value [ MetadataString { } " + set + " ] }"}) {
        Read r(shape("material Material { metadata " + metadata + " }"));
        const Material m = r.material();
        EXPECT_EQ(m.refractiveIndex, 1.5f);
        EXPECT_EQ(m.reflectivity, Vec3f(0.1f, 0.2f, 0.3f));
        EXPECT_EQ(m.absorption, Vec3f(2));
        EXPECT_TRUE(m.mirrors());
    }
    Read foreign(
        shape("material Material { metadata MetadataSet { name \"someone else\" value [ MetadataFloat { name "
              "\"refractiveIndex\" value 1.5 } ] } }"));
    EXPECT_EQ(foreign.material().refractiveIndex, 0);
    Read bubble(shape(
        "material Material { metadata MetadataSet { name \"RTSG\" value [ MetadataFloat { name \"refractiveIndex\" "
        "value 1 } MetadataFloat { name \"priority\" value 3 } ] } }"));
    EXPECT_EQ(bubble.material().refractiveIndex, 1);
    EXPECT_EQ(bubble.material().priority, 3);
    Read bad(shape(
        "material Material { metadata MetadataFloat { name \"refractiveIndex\" reference \"RTSG\" value [-1] } }"));
    EXPECT_EQ(bad.material().refractiveIndex, 0);
    EXPECT_EQ(bad.diagnostics.warnings(), 1u);
}

TEST(MaterialReading, PrototypesStandForTheirFirstNode) {
    Read r(
        "PROTO P [ initializeOnly SFColor c 1 0 0 ] { Material { diffuseColor IS c } Group { } }"
        "PROTO Q [ ] { P { c 0 0.5 0 } }" +
        shape("material Q { }"));
    EXPECT_EQ(r.material().base, Vec3f(0, 0.5f, 0));
    EXPECT_EQ(r.material().model, ShadingModel::phong);
}

TEST(MaterialReading, TwoSidedMaterialHasABack) {
    Read r(shape("material TwoSidedMaterial { separateBackColor TRUE diffuseColor 1 0 0 backDiffuseColor 0 1 0 }"));
    ASSERT_TRUE(r.material().back);
    EXPECT_EQ(r.material().back->base, Vec3f(0, 1, 0));
    Read one(shape("material TwoSidedMaterial { diffuseColor 1 0 0 }"));
    EXPECT_FALSE(one.material().back);
}

TEST(TextureReading, DataUrls) {
    // One red pixel.
    Read r(
        shape("texture ImageTexture { url \"data:image/png;base64,"
              "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC\" }"));
    const Material m = r.material();
    for (const Diagnostic& d : r.diagnostics.all()) ADD_FAILURE() << d.format();
    ASSERT_TRUE(m.texture(TextureRole::base));
    EXPECT_EQ(m.texture(TextureRole::base).texture->sample(0.5f, 0.5f, 0, {}), Vec4f(1, 0, 0, 1));
}

TEST(TextureReading, FilesAreFoundFromTheDocumentsFolderAndSharedBetweenMaterials) {
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    std::filesystem::create_directories(folder / "deep er");
    ASSERT_TRUE(writePicture(Picture(1, 1, Vec4f(0, 1, 0, 1)), folder / "deep er" / "a.png"));
    Read r(shape("texture ImageTexture { url [\"missing.png\" \"deep%20er/a.png\"] }") +
               "Shape { appearance DEF B Appearance { texture ImageTexture { repeatS FALSE url \"deep er/a.png\" } } "
               "geometry Box { } }",
           folder);
    const Material a = r.material("A"), b = r.material("B");
    ASSERT_TRUE(a.texture(TextureRole::base) && b.texture(TextureRole::base));
    EXPECT_EQ(a.texture(TextureRole::base).texture, b.texture(TextureRole::base).texture);
    EXPECT_EQ(b.texture(TextureRole::base).access.wrapS, TextureWrap::clamp);
    EXPECT_EQ(b.texture(TextureRole::base).access.wrapT, TextureWrap::repeat);
    EXPECT_EQ(r.diagnostics.all().size(), 0u) << "a list with one readable entry is fine";
}

TEST(TextureReading, ATextureOfAnInlineStartsFromTheInline) {
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    std::filesystem::create_directories(folder / "sub" / "pics");
    ASSERT_TRUE(writePicture(Picture(1, 1, Vec4f(0, 0, 1, 1)), folder / "sub" / "pics" / "b.png"));
    std::ofstream(folder / "sub" / "inner.x3dv")
        << "#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearance Appearance { material UnlitMaterial { } texture "
           "ImageTexture { url \"pics/b.png\" } } geometry Box { } }";
    std::ofstream(folder / "outer.x3dv") << "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { } NavigationInfo { "
                                            "headlight FALSE } Inline { url \"sub/inner.x3dv\" }";
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, folder / "outer.x3dv", diagnostics));
    SharedWorld world(scene);
    LightRenderer light(world, LightRenderer::Options(folder));
    scene.newFrame(0);
    ImageOptions image;
    image.settings.width = image.settings.height = 9;
    const auto picture = light.picture(image);
    ASSERT_TRUE(picture);
    EXPECT_EQ(Vec3f(picture->at(4, 4)), Vec3f(0, 0, 1));
    for (const Diagnostic& d : light.tracer().diagnostics().all()) ADD_FAILURE() << d.format();
}

TEST(LightRenderer, ANodeRendererDrawsIntoThePictureOfItsNodes) {
    test::LightScene s("Viewpoint { } DEF MARK PointLight { intensity 0 }", 9, 9);
    ASSERT_TRUE(s.light->renderFrame());
    EXPECT_EQ(s.light->frame().width, 1280) << "the options' own size";
    s.light->registerNodeRenderer(
        "PointLight", nodeRendererFor<LightRenderer>([&](LightRenderer& r, const Node& n, Operation o) -> Result<> {
            EXPECT_EQ(o, LightRenderer::kDraw);
            EXPECT_EQ(n.id(), s.node("MARK"));
            r.frame().at(4, 4) = Vec4f(1, 2, 3, 1);
            return {};
        }));
    EXPECT_EQ(s.center(), Vec3f(1, 2, 3));
    s.light->registerNodeRenderer(
        "PointLight", nodeRendererFor<LightRenderer>(
                          [](LightRenderer&, const Node&, Operation) -> Result<> { return fail("no pencil"); }));
    const auto refused = s.light->picture(s.options);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().text, "no pencil");
}

TEST(TextureReading, UnreadableFilesAreReportedByName) {
    const test::TempFolder own;
    const auto file = own.path() / "not_a_picture.png";
    std::ofstream(file) << "this is no picture";
    Read r(shape("texture ImageTexture { url \"" + file.string() + "\" }"));
    EXPECT_FALSE(r.material().texture(TextureRole::base));
    r.material();
    ASSERT_FALSE(r.diagnostics.all().empty());
    // Each reader is told, as they share what was opened; who shows it to a person says it once.
    for (const Diagnostic& d : r.diagnostics.all())
        EXPECT_NE(d.text.find("not_a_picture.png"), std::string::npos) << d.text;
    LightRenderer::Options options(Resources::ofFile(own.path() / "scene.x3dv"));
    const std::string broken =
        "Shape { appearance Appearance { texture ImageTexture { url \"not_a_picture.png\" } } geometry Box { } }\n";
    test::LightScene s(broken + broken, 9, 9, options);
    s.picture();
    EXPECT_EQ(s.light->diagnostics().all().size(), 1u);
}

TEST(TextureReading, PixelTextureIsRemadeOnlyWhenItsPixelsChange) {
    Read r(shape("material DEF M Material { } texture DEF T PixelTexture { image 1 1 3 0xFF0000 }"));
    const auto first = r.material().texture(TextureRole::base).texture;
    ASSERT_TRUE(r.scene.set(r.scene.findName("M"), x3d::Material::diffuseColor, Color{1, 0, 0}));
    EXPECT_EQ(r.material().texture(TextureRole::base).texture, first);
    Image image;
    image.words = Array<std::int32_t>{1, 1, 3, 0x00FF00};
    ASSERT_TRUE(r.scene.set(r.scene.findName("T"), x3d::PixelTexture::image, image));
    const auto second = r.material().texture(TextureRole::base).texture;
    ASSERT_TRUE(second);
    EXPECT_EQ(second->sample(0, 0, 0, {}), Vec4f(0, 1, 0, 1));
}

TEST(LightReading, PlacesAndScales) {
    Read r("DEF L SpotLight { location 1 0 0 direction 0 0 -1 color 1 0.5 0.25 intensity 0.5 ambientIntensity 0.1 }");
    const NodeId id = r.scene.findName("L");
    WorldFromLocal m(Vec3d(0, 2, 0), Vec3d(-2, 0, 0), Vec3d(0, 0, 2), Vec3d(10, 0, 0));
    const Light light = readLight(r.scene, id, m, {});
    EXPECT_EQ(light.kind, Light::Kind::spot);
    EXPECT_EQ(light.position, Vec3d(10, 2, 0));
    EXPECT_EQ(light.direction, Vec3f(0, 0, -1));
    EXPECT_FLOAT_EQ(light.localFromWorld, 0.5f);
    EXPECT_EQ(light.color, Vec3f(0.5f, 0.25f, 0.125f));
    EXPECT_EQ(light.ambient, Vec3f(0.1f, 0.05f, 0.025f));
    m[2] = Vec3d(0);
    EXPECT_FALSE(readLight(r.scene, id, m, {}).on) << "a direction that a singular transform swallows";
    EXPECT_FALSE(readLight(r.scene, NodeId{}, m, {}).on);
}

// Work follows the change: another light, material or viewpoint is not read again.
TEST(LightTracerTables, OnlyWhatChangedIsReadAgain) {
    std::string body;
    for (int i = 0; i < 50; ++i)
        body += fmt::format(
            "DEF L{0} PointLight {{ }} DEF T{0} Transform {{ children Shape {{ appearance Appearance {{ material DEF "
            "M{0} Material {{ }} }} geometry Box {{ }} }} }}",
            i);
    test::LightScene s(body);
    const auto before = s.light->tracer().counts();
    EXPECT_EQ(before.materials, 50u);
    EXPECT_EQ(before.lights, 50u);
    for (int i = 0; i < 10; ++i) {
        ASSERT_TRUE(s.scene.set(s.node("L7"), x3d::PointLight::location, Vec3f(0, float(i), 0)));
        ASSERT_TRUE(s.scene.set(s.node("M9"), x3d::Material::transparency, 0.05f * float(i)));
        s.scene.newFrame(i + 1);
    }
    const auto after = s.light->tracer().counts();
    EXPECT_LE(after.lightsRead - before.lightsRead, 10u);
    EXPECT_LE(after.materialsRead - before.materialsRead, 10u);
    EXPECT_GE(after.lightsRead - before.lightsRead, 9u);
}

TEST(LightTracerTables, RemovedShapesTakeTheirMaterialsAlong) {
    test::LightScene s(
        "DEF G Group { children [ Shape { appearance DEF A Appearance { } geometry Box { } } Shape { appearance USE A "
        "geometry Sphere { } } ] }");
    EXPECT_EQ(s.light->tracer().counts().materials, 1u);
    ASSERT_TRUE(s.scene.removeChild(s.node("G"), x3d::Group::children.index, 0));
    s.scene.newFrame(1);
    EXPECT_EQ(s.light->tracer().counts().materials, 1u);
    ASSERT_TRUE(s.scene.removeChild(s.node("G"), x3d::Group::children.index, 0));
    s.scene.newFrame(2);
    EXPECT_EQ(s.light->tracer().counts().materials, 0u);
}

TEST(RenderToFile, NamesHoldNumbers) {
    EXPECT_EQ(numberedName("a%04d.png", 7), "a0007.png");
    EXPECT_EQ(numberedName("%d", 12), "12");
    EXPECT_EQ(numberedName("50%%_%2d.png", 3), "50%_ 3.png");
    EXPECT_FALSE(numberedName("plain.png", 1));
    EXPECT_FALSE(numberedName("a%s.png", 1));
    EXPECT_FALSE(numberedName("a%d%d.png", 1));
    EXPECT_FALSE(numberedName("a%", 1));
    EXPECT_FALSE(numberedName("a%n.png", 1));
}

TEST(RenderToFile, AnimationsAndTheirErrors) {
    test::LightScene s(
        "DEF T TimeSensor { loop TRUE cycleInterval 4 } DEF P PositionInterpolator { key [0 1] keyValue [0 0 0, 4 0 0] "
        "} DEF X Transform { children Shape { geometry Box { } } }"
        "ROUTE T.fraction_changed TO P.set_fraction ROUTE P.value_changed TO X.set_translation",
        16, 16);
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    AnimationOptions animation;
    animation.frames = 3;
    animation.framesPerSecond = 1;
    animation.start = 1;
    int pictures = 0;
    animation.stats = [&](const RenderStats& stats) {
        ++pictures;
        EXPECT_EQ(stats.primaryRays, 256u);
    };
    ASSERT_TRUE(renderToFile(*s.light, folder / "f%02d.exr", s.options, animation));
    EXPECT_EQ(pictures, 3);
    double centers[3];
    for (int i = 0; i < 3; ++i) {
        const auto picture = readPicture(folder / fmt::format("f{:02}.exr", i));
        ASSERT_TRUE(picture);
        double sum = 0, weighted = 0;
        for (int y = 0; y < 16; ++y)
            for (int x = 0; x < 16; ++x) sum += picture->at(x, y).r, weighted += picture->at(x, y).r * x;
        centers[i] = weighted / sum;
    }
    EXPECT_LT(centers[0], centers[1]);
    EXPECT_LT(centers[1], centers[2]);
    EXPECT_TRUE(renderToFile(*s.light, folder / "all.gif", s.options, {.frames = 2, .start = 4}));
    EXPECT_FALSE(renderToFile(*s.light, folder / "all.png", s.options, {.frames = 2, .start = 6}));
    EXPECT_FALSE(renderToFile(*s.light, folder / "all.gif", s.options, {.frames = 0}));
}

TEST(RenderToFile, WhatIsEndedEarlyLeavesWholeFiles) {
    test::LightScene s("Shape { geometry Box { } }", 16, 16);
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    AnimationOptions animation;
    animation.frames = 5;
    animation.progress = [](int done) { return done < 2; };
    const auto some = renderToFile(*s.light, folder / "p%d.png", s.options, animation);
    ASSERT_TRUE(some);
    EXPECT_EQ(*some, 2);
    EXPECT_TRUE(readPicture(folder / "p1.png"));
    animation.start = 10;
    const auto none = renderToFile(*s.light, folder / "all.gif", s.options, animation);
    ASSERT_TRUE(none);
    EXPECT_EQ(*none, 0) << "half an animation is none";
    animation = {};
    animation.start = 20;
    s.options.settings.progress = [](double) { return false; };
    const auto cancelled = renderToFile(*s.light, folder / "c.png", s.options, animation);
    ASSERT_TRUE(cancelled);
    EXPECT_EQ(*cancelled, 0);
    std::set<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) files.insert(entry.path().filename());
    EXPECT_EQ(files, (std::set<std::string>{"p0.png", "p1.png"}));
}

}  // namespace
}  // namespace rtsg
