// Textures by url: where they come from, and how many pixels a scene may have.
#include <algorithm>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

#include "support/temp_folder.h"
#include "texture/texture_store.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

class TextureUrls : public testing::Test {
  protected:
    TextureUrls() { std::filesystem::create_directories(folder / "parts"); }
    /// A grey picture of the simplest format.
    static std::string picture(int width, int height) {
        return fmt::format("P5\n{} {}\n255\n", width, height) +
               std::string(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 'g');
    }
    void write(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder / name, std::ios::binary) << bytes;
    }
    /// The textures of all ImageTextures and MultiTextures of a document in `folder`.
    std::vector<std::shared_ptr<const Texture>> texturesOf(const std::string& text, ResourcePolicy policy = {}) {
        write("main.x3dv", "#X3D V4.0 utf8\nPROFILE Full\n" + text);
        Scene scene;
        const Resources resources = Resources::ofFile(folder / "main.x3dv", std::move(policy));
        Diagnostics loading;
        LoadOptions options;
        options.resources = resources;
        EXPECT_TRUE(loadFile(scene, folder / "main.x3dv", loading, options));
        EXPECT_EQ(loading.errors(), 0u);
        TextureStore store(resources);
        std::vector<std::shared_ptr<const Texture>> result;
        Diagnostics diagnostics;
        scene.forEachNode([&](const Node& node) {
            if (node.is(x3d::ImageTexture::type) || node.is(x3d::MultiTexture::type))
                result.push_back(store.ofNode(scene, node, Texture::Content::color, diagnostics));
        });
        problems.clear();
        for (const Diagnostic& d : diagnostics.all()) problems += d.text + "\n";
        return result;
    }
    static std::string shape(const std::string& url) {
        return "Shape { appearance Appearance { texture ImageTexture { url \"" + url + "\" } } }\n";
    }

    const test::TempFolder own;
    const std::filesystem::path folder = own.path();
    std::string problems;
};

TEST_F(TextureUrls, OfAnInlinedFileStartBesideIt) {
    write("parts/part.x3dv", "#X3D V4.0 utf8\nPROFILE Full\n" + shape("a.pgm"));
    write("parts/a.pgm", picture(2, 3));
    write("a.pgm", picture(5, 5));
    const auto textures = texturesOf("Inline { url \"parts/part.x3dv\" }");
    ASSERT_TRUE(textures.at(0)) << problems;
    EXPECT_EQ(textures[0]->height(), 3);
}

TEST_F(TextureUrls, OutsideAreRefused) {
    EXPECT_FALSE(texturesOf(shape("/etc/passwd")).at(0));
    EXPECT_THAT(problems, HasSubstr("--allow /etc"));
}

TEST_F(TextureUrls, AreReadByTheirContentNotTheirName) {
    write("a.png", picture(2, 3));
    EXPECT_TRUE(texturesOf(shape("a.png")).at(0)) << problems;
    write("b.png", "hunter2");
    EXPECT_FALSE(texturesOf(shape("b.png")).at(0));
    EXPECT_THAT(problems, HasSubstr("b.png is no picture of a format that is read"));
    EXPECT_THAT(problems, testing::Not(HasSubstr("hunter2")));
}

// A missing feature is reported with the line of its node.
TEST(Pictures, NameTheLineOfWhatTheyLack) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene,
                 "#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance {\n  texture ImageTexture { url "
                 "\"data:image/png,none\" }\n fillProperties FillProperties { hatched TRUE hatchStyle 9 } }\n "
                 "geometry IndexedFaceSet { coordIndex [ 0 1 7 ] coord Coordinate { point [ 0 0 0, 1 0 0 ] } } }",
                 diagnostics));
    SharedWorld world(scene);
    LightRenderer light(world);
    scene.newFrame(0);
    ASSERT_TRUE(light.picture(ImageOptions()));
    std::vector<std::uint32_t> lines;
    for (const Diagnostic& d : light.diagnostics().all()) lines.push_back(d.where.line);
    const Diagnostics ofWorld = world.diagnostics();
    for (const Diagnostic& d : ofWorld.all()) lines.push_back(d.where.line);
    EXPECT_EQ(lines, (std::vector<std::uint32_t>{4, 5, 6}));
}

/// A TIFF file of one strip: every pixel the same, `bits` a number; photometric interpretation 2 (light) or 5 (inks).
std::string tiff(int side, int photometric, int bits, const std::vector<int>& pixel) {
    const auto little = [](std::uint64_t value, int bytes) {
        std::string text;
        for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> 8 * i & 0xFF);
        return text;
    };
    std::string data, depths;
    for (int i = 0; i < side * side; ++i)
        for (const int value : pixel) data += little(static_cast<std::uint64_t>(value), bits / 8);
    for (std::size_t i = 0; i < pixel.size(); ++i) depths += little(static_cast<std::uint64_t>(bits), 2);
    const std::size_t tags = 9, behind = 8 + 2 + 12 * tags + 4, begin = behind + depths.size();
    const auto tag = [&](int number, std::size_t count, std::size_t value) {
        return little(static_cast<std::uint64_t>(number), 2) + little(4, 2) + little(count, 4) + little(value, 4);
    };
    std::string file = "II*" + std::string(1, '\0') + little(8, 4) + little(tags, 2);
    const auto wide = static_cast<std::size_t>(side);
    file += tag(256, 1, wide) + tag(257, 1, wide);
    file += little(258, 2) + little(3, 2) + little(pixel.size(), 4) + little(behind, 4);
    file += tag(259, 1, 1) + tag(262, 1, static_cast<std::size_t>(photometric)) + tag(273, 1, begin) +
            tag(277, 1, pixel.size()) + tag(278, 1, wide) + tag(279, 1, data.size());
    return file + little(0, 4) + depths + data;
}

// Inks (cyan 0, magenta 1/2, yellow 1, black 1/4) are the light that paper sends, (1 - ink) (1 - black), and sixteen
// bits are not cut to eight; half a file is none, with a reason, but for a JPEG file's upper half.
TEST_F(TextureUrls, OfInksOfSixteenBitsAndOfHalfAFile) {
    const auto at = [&](const std::string& name) {
        const auto textures = texturesOf(shape(name));
        EXPECT_TRUE(textures.at(0)) << problems;
        EXPECT_EQ(problems, "");
        return textures[0] ? textures[0]->sample(.5f, .5f, 0, TextureAccess{}) : Vec4f(-1);
    };
    write("inks8.tif", tiff(8, 5, 8, {0, 128, 255, 64}));
    write("inks16.tif", tiff(8, 5, 16, {0, 32768, 65535, 16384}));
    for (const char* name : {"inks8.tif", "inks16.tif"}) {
        const Vec4f seen = at(name);
        EXPECT_NEAR(srgbFromLinear(seen.r), .75, .004);
        EXPECT_NEAR(srgbFromLinear(seen.g), .375, .004);
        EXPECT_NEAR(seen.b, 0, 1e-6);
        EXPECT_EQ(seen.a, 1);
    }
    write("half.tif", tiff(64, 2, 8, {1, 2, 3}).substr(0, 60));
    EXPECT_FALSE(texturesOf(shape("half.tif")).at(0));
    EXPECT_THAT(problems, HasSubstr("half.tif: "));
}

TEST_F(TextureUrls, HaveLimitedPixels) {
    ResourcePolicy policy;
    policy.maximumPixels = 400;
    write("small.pgm", picture(10, 10));
    write("large.pgm", picture(101, 1));
    EXPECT_TRUE(texturesOf(shape("small.pgm"), policy).at(0)) << problems;
    EXPECT_FALSE(texturesOf(shape("large.pgm"), policy).at(0));
    EXPECT_THAT(problems, HasSubstr("101 x 1 pixels are more than 100; --limit pixels=N raises this"));
    // A header that promises what the file does not hold takes no memory either.
    write("bomb.pgm", "P5\n30000 30000\n255\n");
    EXPECT_FALSE(texturesOf(shape("bomb.pgm")).at(0));
    EXPECT_THAT(problems, HasSubstr("30000 x 30000 pixels, which a file of 19 bytes cannot hold"));
}

TEST_F(TextureUrls, TogetherHaveLimitedPixels) {
    ResourcePolicy policy;
    policy.maximumPixels = 400;
    std::string text;
    for (int i = 0; i < 5; ++i) {
        write(fmt::format("{}.pgm", i), picture(10, 10));
        text += shape(fmt::format("{}.pgm", i)) + shape(fmt::format("{}.pgm", i));
    }
    const auto textures = texturesOf(text, policy);
    EXPECT_EQ(std::ranges::count(textures, nullptr), 2);
    EXPECT_FALSE(textures.at(8));
    EXPECT_THAT(problems, HasSubstr("the scene's pictures have more than 400 pixels"));
}

/// A combined texture is as wide as one and as high as the other, which may be far more than both together.
TEST_F(TextureUrls, CombinedHaveLimitedPixels) {
    ResourcePolicy policy;
    policy.maximumPixels = 400;
    write("wide.pgm", picture(30, 1));
    write("high.pgm", picture(1, 30));
    write("low.pgm", picture(1, 10));
    const auto reported = [&](const std::string& other) {
        problems.clear();
        texturesOf(
            "TextureBackground { frontTexture MultiTexture { texture [ ImageTexture { url \"wide.pgm\" } "
            "ImageTexture { url \"" +
                other + "\" } ] } }\n",
            policy);
        return problems;
    };
    EXPECT_THAT(reported("high.pgm"), HasSubstr("the scene's pictures have more than 400 pixels"));
    EXPECT_EQ(reported("low.pgm"), "");
}

/// Two renderers of one world, one after the other, and in between the file goes: what is shared needs it no more.
TEST_F(TextureUrls, AreLoadedOnceForAllRenderersOfAWorldThatMayOpenTheSame) {
    write("a.pgm", picture(4, 4));
    write("main.x3dv",
          "#X3D V4.0 utf8\nPROFILE Full\nNavigationInfo { headlight FALSE }\nViewpoint { position 0 0 3 }\nShape { "
          "appearance "
          "Appearance { material UnlitMaterial { emissiveColor 1 1 1 } texture ImageTexture { url \"a.pgm\" } } "
          "geometry Box { } }\n"
          "Shape { appearance Appearance { texture ImageTexture { url \"none.pgm\" } } geometry Box { size .1 .1 .1 } "
          "}\n");
    const Resources resources = Resources::ofFile(folder / "main.x3dv");
    Scene scene;
    Diagnostics loading;
    LoadOptions loadOptions;
    loadOptions.resources = resources;
    ASSERT_TRUE(loadFile(scene, folder / "main.x3dv", loading, loadOptions));
    SharedWorld world(scene);
    ImageOptions image;
    image.settings.width = image.settings.height = 8;
    const auto middle = [&](LightRenderer& light) {
        const auto created = light.picture(image);
        EXPECT_TRUE(created);
        return created ? created->at(4, 4).r : -1;
    };
    const auto said = [](const LightRenderer& light) {
        std::string all;
        for (const Diagnostic& d : light.diagnostics().all()) all += d.text + "\n";
        return all;
    };
    auto first = std::make_unique<LightRenderer>(world, LightRenderer::Options(resources, image));
    const float grey = middle(*first);
    EXPECT_NEAR(grey, 'g' / 255., 1e-3);
    std::filesystem::remove(folder / "a.pgm");
    LightRenderer second(world, LightRenderer::Options(resources, image)),
        stranger(world, LightRenderer::Options(Resources(), image));
    EXPECT_EQ(middle(second), grey);
    EXPECT_EQ(middle(stranger), 1) << "it may open nothing";
    for (const LightRenderer* each : {first.get(), &second}) {
        EXPECT_THAT(said(*each), HasSubstr("none.pgm")) << "each names what it lacks";
        EXPECT_EQ(said(*each).find("a.pgm' is"), std::string::npos) << said(*each);
    }
    EXPECT_THAT(said(stranger), HasSubstr("a.pgm"));
    first.reset();
    EXPECT_EQ(middle(second), grey) << "it stays while somebody has it";
}

}  // namespace
}  // namespace rtsg
