// Pictures that are too large to be kept: read by tiles, the same as if they were kept, and bounded.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "support/temp_folder.h"
#include "texture/texture_store.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

constexpr int kWide = 300, kHigh = 200;  // no powers of two

class TiledTextures : public testing::Test {
  protected:
    void SetUp() override {
        if (std::system("maketx --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "needs maketx (openimageio-tools)";
    }
    /// Red grows to the right, green downwards, blue flickers from pixel to pixel.
    static std::string pixels() {
        std::string text = fmt::format("P6\n{} {}\n255\n", kWide, kHigh);
        for (int y = 0; y < kHigh; ++y)
            for (int x = 0; x < kWide; ++x) {
                text += static_cast<char>(x * 255 / kWide);
                text += static_cast<char>(y * 255 / kHigh);
                text += static_cast<char>((x + y) % 2 * 255);
            }
        return text;
    }
    void write(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder / name, std::ios::binary) << bytes;
    }
    /// `picture.ppm` as a file of tiles.
    void tile(const std::string& name, const std::string& options = "") const {
        write("picture.ppm", pixels());
        const std::string command =
            fmt::format("maketx {} {} -o {} > /dev/null 2>&1", options, folder / "picture.ppm", folder / name);
        ASSERT_EQ(std::system(command.c_str()), 0) << command;
    }
    /// As a scene of `url` has it, of whose pictures none may be kept.
    std::shared_ptr<const Texture> textureOf(const std::string& url, std::uint64_t pixels = 400) {
        write("main.x3dv",
              "#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance { texture DEF T ImageTexture { "
              "url \"" +
                  url + "\" } } }\n");
        scene = std::make_unique<Scene>();
        ResourcePolicy policy;
        policy.maximumPixels = pixels;
        const Resources resources = Resources::ofFile(folder / "main.x3dv", policy);
        Diagnostics diagnostics;
        LoadOptions options;
        options.resources = resources;
        EXPECT_TRUE(loadFile(*scene, folder / "main.x3dv", diagnostics, options));
        store = std::make_unique<TextureStore>(resources);
        auto texture = store->ofNode(*scene, scene->node(scene->findName("T")), Texture::Content::color, diagnostics);
        problems.clear();
        for (const Diagnostic& d : diagnostics.all()) problems += d.text + "\n";
        return texture;
    }
    static double furthest(const Vec4f& a, const Vec4f& b) {
        const Vec4f d = glm::abs(a - b);
        return std::max({d.r, d.g, d.b, d.a});
    }

    const test::TempFolder folder;
    std::unique_ptr<Scene> scene;
    std::unique_ptr<TextureStore> store;
    std::string problems;
};

TEST_F(TiledTextures, ShowWhatThePictureShowsWhereverTheyAreLookedUp) {
    tile("tiles.tif");
    const auto tiled = textureOf("tiles.tif");
    ASSERT_TRUE(tiled) << problems;
    EXPECT_TRUE(tiled->inTiles());
    EXPECT_EQ(tiled->width(), kWide);
    EXPECT_EQ(tiled->height(), kHigh);
    EXPECT_EQ(tiled->bytes(), 0u);
    const auto kept = textureOf("picture.ppm", std::uint64_t{1} << 28);
    ASSERT_TRUE(kept) << problems;
    EXPECT_FALSE(kept->inTiles());
    for (const TextureWrap wrap : {TextureWrap::repeat, TextureWrap::mirror, TextureWrap::clamp, TextureWrap::border})
        for (const bool smooth : {true, false})
            for (const ColorSpace space : {ColorSpace::linear, ColorSpace::display})
                for (int i = 0; i < 400; ++i) {
                    TextureAccess access;
                    access.wrapS = access.wrapT = wrap;
                    access.smooth = smooth;
                    const float s = static_cast<float>(std::fmod(i * 0.618034, 1)) * 1.4f - 0.2f;
                    const float t = static_cast<float>(std::fmod(i * 0.754877, 1)) * 1.4f - 0.2f;
                    EXPECT_LT(furthest(tiled->sample(s, t, 0, access, space), kept->sample(s, t, 0, access, space)),
                              1e-5)
                        << s << ' ' << t << " way " << static_cast<int>(wrap) << smooth;
                }
}

TEST_F(TiledTextures, AreSeenFromAfarByTheirCoarserCopies) {
    tile("tiles.tif");
    const auto tiled = textureOf("tiles.tif");
    ASSERT_TRUE(tiled) << problems;
    for (int i = 0; i < 50; ++i) {
        const float s = 0.2f + 0.012f * static_cast<float>(i), t = 0.5f;
        const Vec4f color = tiled->sample(s, t, 0.05f, {}, ColorSpace::display);  // of 12 pixels
        EXPECT_NEAR(color.r, s, 0.02) << s;
        EXPECT_NEAR(color.g, 0.5, 0.02);
        EXPECT_NEAR(color.b, 0.5, 0.02) << "both kinds of pixels";
    }
    const Vec4f all = tiled->sample(0.3f, 0.8f, 1, {}, ColorSpace::display);
    // Halving 75 pixels to 37 weighs the last one otherwise, as its maker chose.
    EXPECT_NEAR(all.r, 0.5, 0.02);
    EXPECT_NEAR(all.g, 0.5, 0.02);
}

TEST_F(TiledTextures, OfHalfNumbersAreLight) {
    tile("tiles.exr", "-d half");
    const auto tiled = textureOf("tiles.exr");
    ASSERT_TRUE(tiled) << problems;
    // A file of half numbers holds light, whatever it was made of: here the bytes over 255.
    EXPECT_NEAR(tiled->sample(0.5f, 0.5f, 0.02f, {}, ColorSpace::linear).r, 0.5, 0.01);
    EXPECT_NEAR(tiled->sample(0.5f, 0.5f, 0.02f, {}, ColorSpace::display).r, 0.735, 0.01);
}

TEST_F(TiledTextures, OfFewPixelsAreKept) {
    tile("tiles.tif");
    const auto kept = textureOf("tiles.tif", std::uint64_t{1} << 28);
    ASSERT_TRUE(kept) << problems;
    EXPECT_FALSE(kept->inTiles());
}

TEST_F(TiledTextures, ThatAreNotStoredSoAreRefusedWithTheWayOut) {
    tile("plain.tif", "--nomipmap");
    EXPECT_FALSE(textureOf("plain.tif"));
    EXPECT_THAT(problems, HasSubstr("300 x 200 pixels are more than 100"));
    EXPECT_THAT(problems, HasSubstr("maketx"));
    write("picture.ppm", pixels());
    EXPECT_FALSE(textureOf("picture.ppm"));
    EXPECT_THAT(problems, HasSubstr("maketx"));
}

TEST_F(TiledTextures, ThatAreDamagedAreBlackThereAndSaySoOnce) {
    tile("tiles.tif", "--compression zip");
    const std::string file = folder / "tiles.tif";
    std::string bytes;
    {
        std::ifstream in(file, std::ios::binary);
        bytes.assign(std::istreambuf_iterator<char>(in), {});
    }
    for (std::size_t i = 2000; i < 3000 && i < bytes.size() / 2; ++i) bytes[i] = 'x';
    write("tiles.tif", bytes);
    const auto tiled = textureOf("tiles.tif");
    if (!tiled) {
        EXPECT_FALSE(problems.empty());
        return;
    }
    // Each place is one or the other, however often and from wherever it is looked at: never what is in the memory.
    const std::string original = pixels();
    const auto stored = [&](int x, int y) {
        const std::size_t at = original.size() - std::size_t{3} * kWide * kHigh;
        return static_cast<unsigned char>(original[at + std::size_t{3} * static_cast<std::size_t>(y * kWide + x)]);
    };
    int black = 0, kept = 0;
    for (int round = 0; round < 3; ++round)
        for (int y = 0; y < 20; ++y)
            for (int x = 0; x < 20; ++x) {
                const int column = x * 15 + 7, row = y * 10 + 5;
                const Vec4f seen = tiled->sample((column + .5f) / kWide, 1 - (row + .5f) / kHigh, 0, {.smooth = false},
                                                 ColorSpace::display);
                const bool isBlack = seen == Vec4f(0, 0, 0, 1);
                (isBlack ? black : kept) += 1;
                if (!isBlack) {
                    EXPECT_NEAR(seen.r * 255, stored(column, row), .01) << column << " " << row;
                }
            }
    EXPECT_GT(black, 3 * 20);
    EXPECT_EQ(black % 3, 0) << "the same each time";
    EXPECT_GT(kept, 3 * 100);
    EXPECT_NE(tiled->damage(), "");
    Diagnostics said;
    store->reportOfDamage(said);
    ASSERT_EQ(said.all().size(), 1u);
    EXPECT_THAT(said.all()[0].text, HasSubstr("tiles.tif: parts of the picture are black"));
    store->reportOfDamage(said);
    EXPECT_EQ(said.all().size(), 1u);
}

TEST_F(TiledTextures, AreReadFromManyThreads) {
    tile("tiles.tif");
    const auto tiled = textureOf("tiles.tif");
    ASSERT_TRUE(tiled) << problems;
    std::vector<std::thread> threads;
    std::atomic<int> wrong = 0;
    for (int n = 0; n < 4; ++n)
        threads.emplace_back([&, n] {
            for (int i = 0; i < 2000; ++i) {
                const float s = static_cast<float>(std::fmod((i + n * 500) * 0.618034, 0.9)) + 0.05f;
                const Vec4f color = tiled->sample(s, 0.5f, 0.01f, {}, ColorSpace::display);
                if (std::abs(color.r - s) > 0.02f) ++wrong;
            }
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0);
}

TEST_F(TiledTextures, WhoseSidesMakeACubeAreRefused) {
    // Six squares of 50 beside each other.
    std::string text = "P5\n300 50\n255\n" + std::string(15000, 'g');
    write("six.pgm", text);
    const std::string command = fmt::format("maketx {} -o {} > /dev/null 2>&1", folder / "six.pgm", folder / "six.tif");
    ASSERT_EQ(std::system(command.c_str()), 0);
    const auto tiled = textureOf("six.tif");
    ASSERT_TRUE(tiled) << problems;
    const auto cube = SpaceTexture::ofPicture(tiled);
    ASSERT_FALSE(cube);
    EXPECT_THAT(cube.error().text, HasSubstr("small enough to be kept"));
}

}  // namespace
}  // namespace rtsg
