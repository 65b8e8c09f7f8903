// Textures: orientation, components, filtering, coarser levels, transforms.
#include <rtsg/renderers/texture.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picture.h>

#include "light_scene.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

constexpr auto kData = Texture::Content::data;
constexpr TextureAccess kNearest{TextureWrap::repeat, TextureWrap::repeat, false};
constexpr TextureAccess kSmooth{};

Image makeImage(int width, int height, int components, std::initializer_list<std::int32_t> pixels) {
    Image image;
    image.words = Array<std::int32_t>{width, height, components};
    for (const std::int32_t pixel : pixels) image.words.push_back(pixel);
    return image;
}

// 5.3.6: pixels start at the lower left and go to the right, then up; 18.2.3: (0, 0) is the lower left.
TEST(Texture, FirstPixelOfAnImageIsTheLowerLeft) {
    const auto texture = Texture::fromImage(makeImage(2, 2, 3, {0xFF0000, 0x00FF00, 0x0000FF, 0xFFFFFF}));
    ASSERT_TRUE(texture);
    EXPECT_EQ(texture->sample(0.25f, 0.25f, 0, kNearest), Vec4f(1, 0, 0, 1));
    EXPECT_EQ(texture->sample(0.75f, 0.25f, 0, kNearest), Vec4f(0, 1, 0, 1));
    EXPECT_EQ(texture->sample(0.25f, 0.75f, 0, kNearest), Vec4f(0, 0, 1, 1));
    EXPECT_EQ(texture->sample(0.75f, 0.75f, 0, kNearest), Vec4f(1, 1, 1, 1));
}

TEST(Texture, ComponentsAreGreyAlphaAndColor) {
    const auto grey = Texture::fromImage(makeImage(1, 1, 1, {0x80}), kData);
    const auto greyAlpha = Texture::fromImage(makeImage(1, 1, 2, {0x8040}), kData);
    const auto rgba = Texture::fromImage(makeImage(1, 1, 4, {static_cast<std::int32_t>(0xFF804020u)}), kData);
    ASSERT_TRUE(grey && greyAlpha && rgba);
    const float half = 128 / 255.0f, quarter = 64 / 255.0f, eighth = 32 / 255.0f;
    EXPECT_EQ(grey->sample(0, 0, 0, kNearest), Vec4f(half, half, half, 1));
    EXPECT_EQ(greyAlpha->sample(0, 0, 0, kNearest), Vec4f(half, half, half, quarter));
    EXPECT_EQ(rgba->sample(0, 0, 0, kNearest), Vec4f(1, half, quarter, eighth));
    EXPECT_FALSE(grey->hasAlpha());
    EXPECT_TRUE(greyAlpha->hasPartialAlpha());
}

TEST(Texture, ColorsAreDecodedFromSrgb) {
    const auto texture = Texture::fromImage(makeImage(1, 1, 3, {0xBC8000}));
    ASSERT_TRUE(texture);
    const Vec4f color = texture->sample(0, 0, 0, kNearest);
    const auto decode = [](int byte) {
        const double v = byte / 255.0;
        return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    };
    EXPECT_NEAR(color.r, decode(0xBC), 1e-6);
    EXPECT_NEAR(color.g, decode(0x80), 1e-6);
    EXPECT_EQ(color.b, 0);
}

// Between pixel centres the value is linear; across the border the texture repeats, mirrors or stops.
TEST(Texture, InterpolatesBetweenCentresAndWraps) {
    const auto texture = Texture::fromBytes(std::vector<std::uint8_t>{0, 255, 51, 102}, 4, 1, 1, kData);
    ASSERT_TRUE(texture);
    EXPECT_NEAR(texture->sample(0.125f, 0.5f, 0, kSmooth).r, 0, 1e-6);
    EXPECT_NEAR(texture->sample(0.25f, 0.5f, 0, kSmooth).r, 0.5, 1e-6);
    EXPECT_NEAR(texture->sample(0.5f, 0.5f, 0, kSmooth).r, 0.6, 1e-6);
    EXPECT_NEAR(texture->sample(0.0f, 0.5f, 0, kSmooth).r, 0.2, 1e-6) << "half of the last, half of the first";
    EXPECT_NEAR(texture->sample(1.25f, 0.5f, 0, kSmooth).r, 0.5, 1e-6);
    EXPECT_NEAR(texture->sample(-0.75f, 0.5f, 0, kSmooth).r, 0.5, 1e-6);
    const TextureAccess clamp{TextureWrap::clamp, TextureWrap::clamp, true};
    EXPECT_NEAR(texture->sample(1.7f, 0.5f, 0, clamp).r, 0.4, 1e-6);
    EXPECT_NEAR(texture->sample(-3.0f, 0.5f, 0, clamp).r, 0, 1e-6);
    const TextureAccess mirror{TextureWrap::mirror, TextureWrap::mirror, true};
    EXPECT_NEAR(texture->sample(1.125f, 0.5f, 0, mirror).r, 0.4, 1e-6);
    EXPECT_NEAR(texture->sample(1.875f, 0.5f, 0, mirror).r, 0, 1e-6);
}

TEST(Texture, WildCoordinatesAreHarmless) {
    const auto texture = Texture::fromBytes(std::vector<std::uint8_t>{10, 20, 30, 40}, 2, 2, 1, kData);
    ASSERT_TRUE(texture);
    for (const float s : {NAN, INFINITY, -INFINITY, 1e30f, -1e30f, 1e-40f})
        for (const TextureWrap wrap : {TextureWrap::repeat, TextureWrap::mirror, TextureWrap::clamp})
            for (const float footprint : {0.0f, 0.3f, 1e9f, NAN}) {
                const Vec4f color = texture->sample(s, s, footprint, {wrap, wrap, true});
                EXPECT_TRUE(color.r >= 0 && color.r <= 1) << s;
            }
}

// Coarse levels keep the mean in linear light: a checkerboard of black and white is .5, not the sRGB value 188 / 255.
TEST(Texture, CoarseLevelsKeepTheMean) {
    std::vector<std::uint8_t> bytes;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) bytes.push_back((x + y) % 2 ? 255 : 0);
    const auto texture = Texture::fromBytes(bytes, 64, 64, 1);
    ASSERT_TRUE(texture);
    EXPECT_NEAR(texture->sample(0.3f, 0.7f, 1, kSmooth).r, 0.5, 3e-3);
    EXPECT_NEAR(texture->sample(0.3f, 0.7f, 4 / 64.0f, kSmooth).r, 0.5, 3e-3);
}

// Each pixel of the next level, in both spaces, is the byte nearest to the mean of four, in double; opaque ones and
// those beside something clear, which count by their alpha.
TEST(Texture, EachCoarserPixelIsTheNearestByteToItsMean) {
    constexpr int kSide = 128;
    std::mt19937 random(5);
    std::vector<std::uint8_t> bytes(std::size_t{kSide} * kSide * 4);
    for (std::size_t i = 0; i < bytes.size(); ++i)
        bytes[i] = i % 4 == 3 ? (i / 4 % kSide < kSide / 2 ? 255 : random() % 256) : random() % 256 >> i / 4 % 7;
    const auto texture = Texture::fromBytes(bytes, kSide, kSide, 4);
    ASSERT_TRUE(texture);
    TextureAccess access{TextureWrap::clamp, TextureWrap::clamp, false};
    access.smoothFar = false, access.levels = TextureLevels::nearest;
    const auto decoded = [](double v) { return v <= .04045 ? v / 12.92 : std::pow((v + .055) / 1.055, 2.4); };
    const auto encoded = [](double v) { return v <= .0031308 ? v * 12.92 : 1.055 * std::pow(v, 1 / 2.4) - .055; };
    for (int y = 0; y < kSide / 2; ++y)
        for (int x = 0; x < kSide / 2; ++x)
            for (const ColorSpace space : {ColorSpace::linear, ColorSpace::display}) {
                const bool linear = space == ColorSpace::linear;
                const Vec4f found = texture->sample((float(x) + .5f) / (kSide / 2), (float(y) + .5f) / (kSide / 2),
                                                    2.0f / kSide, access, space);
                for (int c = 0; c < 3; ++c) {
                    double sum = 0, alpha = 0;
                    for (int i = 0; i < 4; ++i) {
                        const auto at = (std::size_t(2 * y + i / 2) * kSide + std::size_t(2 * x + i % 2)) * 4;
                        const double value = bytes[at + std::size_t(c)] / 255., fraction = bytes[at + 3] / 255.;
                        sum += fraction * (linear ? decoded(value) : value), alpha += fraction;
                    }
                    if (!(alpha > 0)) continue;
                    const double mean = linear ? encoded(sum / alpha) : sum / alpha;
                    const double shown = linear ? encoded(double{found[c]}) : double{found[c]};
                    EXPECT_NEAR(255 * shown, 255 * mean, .502) << x << ' ' << y << ' ' << c << ' ' << linear;
                }
            }
}

TEST(Texture, OddSizesKeepTheMeanToo) {
    const std::uint64_t seed = 20260401;
    std::mt19937_64 random(seed);
    for (int round = 0; round < 20; ++round) {
        const int width = 1 + static_cast<int>(random() % 9), height = 1 + static_cast<int>(random() % 9);
        std::vector<Vec4f> pixels(static_cast<std::size_t>(width * height), Vec4f(0, 0, 0, 1));
        for (Vec4f& pixel : pixels) pixel.g = 3.0f;
        const auto texture = Texture::fromFloats(pixels, width, height);
        ASSERT_TRUE(texture);
        EXPECT_NEAR(texture->sample(0.5f, 0.5f, 100, kSmooth).g, 3, 1e-5) << "seed " << seed << " round " << round;
    }
}

TEST(Texture, BadImagesAreErrors) {
    EXPECT_FALSE(Texture::fromImage(makeImage(2, 2, 3, {1, 2, 3})));
    EXPECT_FALSE(Texture::fromImage(makeImage(0, 0, 0, {})));
    EXPECT_FALSE(Texture::fromImage(makeImage(1, 1, 5, {1})));
    EXPECT_FALSE(Texture::fromImage(makeImage(-1, -1, 3, {1})));
    EXPECT_FALSE(Texture::fromImage(makeImage(1 << 30, 1 << 30, 3, {1})));
    EXPECT_FALSE(Texture::fromImage(Image{}));
    EXPECT_FALSE(Texture::fromFile("/nowhere/at/all.png"));
}

TEST(Texture, FilesKeepTheirOrientation) {
    const test::TempFolder own;
    const auto file = own.path() / "orientation.png";
    Picture picture(2, 2, Vec4f(0, 0, 0, 1));
    picture.at(0, 1) = Vec4f(1, 0, 0, 1);  // lower left
    picture.at(1, 0) = Vec4f(0, 0, 1, 1);  // upper right
    ASSERT_TRUE(writePicture(picture, file));
    const auto texture = Texture::fromFile(file);
    ASSERT_TRUE(texture) << texture.error().format();
    EXPECT_EQ(texture->sample(0.25f, 0.25f, 0, kNearest), Vec4f(1, 0, 0, 1));
    EXPECT_EQ(texture->sample(0.75f, 0.75f, 0, kNearest), Vec4f(0, 0, 1, 1));
}

// 18.4.8: Tc' = -C * S * R * C * T * Tc, in double and step by step.
TEST(Texture, TransformFollowsTheStandardsProduct) {
    const Vec2f center(0.3f, -0.2f), scale(2, 0.5f), translation(0.1f, 0.7f);
    const float rotation = 0.6f;
    const TextureMatrix m = TextureMatrix::fromTransform(center, rotation, scale, translation);
    for (const Vec2f st : {Vec2f(0, 0), Vec2f(1, 0), Vec2f(0, 1), Vec2f(-2, 3)}) {
        double s = double{st.x} + translation.x, t = double{st.y} + translation.y;
        s += center.x, t += center.y;
        const double rs = std::cos(0.6) * s - std::sin(0.6) * t, rt = std::sin(0.6) * s + std::cos(0.6) * t;
        s = rs * scale.x - center.x, t = rt * scale.y - center.y;
        EXPECT_NEAR(m.apply(st).x, s, 1e-5);
        EXPECT_NEAR(m.apply(st).y, t, 1e-5);
    }
    EXPECT_NEAR(m.stretch(), 1, 1e-6) << "2 across, 1/2 up";
}

// Colours stand beside their alpha: under one of 0 they are what the file says, and half clear ones are not darker.
// A PNG of (255, 255, 255, 0) and (200, 100, 50, 128); and a picture that is kept multiplied.
TEST(Texture, ColoursOfClearPixelsAreTheirOwn) {
    const std::uint8_t png[] = {137, 80,  78, 71,  13,  10, 26,  10,  0,   0,  0,   13,  73,  72,  68, 82, 0,  0,  0,
                                2,   0,   0,  0,   1,   8,  6,   0,   0,   0,  244, 34,  127, 138, 0,  0,  0,  17, 73,
                                68,  65,  84, 120, 218, 99, 248, 255, 255, 63, 195, 137, 20,  163, 6,  0,  26, 36, 4,
                                220, 192, 24, 251, 37,  0,  0,   0,   0,   73, 69,  78,  68,  174, 66, 96, 130};
    const auto texture = Texture::fromMemory(png, "clear.png");
    ASSERT_TRUE(texture) << texture.error().text;
    const Vec4f clear = texture->sample(.25f, .5f, 0, kNearest, ColorSpace::display),
                half = texture->sample(.75f, .5f, 0, kNearest, ColorSpace::display);
    EXPECT_EQ(clear, Vec4f(1, 1, 1, 0));
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(half[c], (Vec4d(200, 100, 50, 128) / 255.)[c], 1e-6) << c;
    const test::TempFolder own;
    Picture multiplied(1, 1, Vec4f(.25f, .1f, .05f, .5f));
    multiplied.space = ColorSpace::linear;
    ASSERT_TRUE(writePicture(multiplied, own.path() / "half.exr"));
    const auto read = Texture::fromFile(own.path() / "half.exr");
    ASSERT_TRUE(read);
    const Vec4f straight = read->sample(.5f, .5f, 0, kNearest, ColorSpace::linear);
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(straight[c], Vec4d(.5, .2, .1, .5)[c], 2e-3) << c;
}

/// A square in the picture's left half and its right one, of whose texture the left pixel is red, the right one green.
constexpr const char* kTwoPixels =
    "OrthoViewpoint {{ fieldOfView [ -1 -1 1 1 ] }} Shape {{ appearance Appearance {{ material UnlitMaterial {{ }} "
    "texture PixelTexture {{ image 2 1 3 0xff0000 0x00ff00 textureProperties DEF P TextureProperties {{ }} }} }} "
    "geometry IndexedFaceSet {{ coordIndex [ 0 1 2 3 ] coord Coordinate {{ point [ -1 -1 0 1 -1 0 1 1 0 -1 1 0 ] }} "
    "{} }} }}";

// A word that the field does not have counts as the default, whoever sets it.
TEST(Texture, BoundaryModesThatAreNotKnownRepeat) {
    test::LightScene s(fmt::format(kTwoPixels, "texCoord TextureCoordinate { point [ 1 0 2 0 2 1 1 1 ] }"));
    const auto quarters = [&](const char* mode) {
        EXPECT_TRUE(s.scene.set(s.node("P"), x3d::TextureProperties::boundaryModeS, String(mode)));
        s.scene.newFrame(s.scene.now() + 1);
        const Picture p = s.picture();
        return std::pair(Vec3f(p.at(p.width / 4, 16)), Vec3f(p.at(p.width * 3 / 4, 16)));
    };
    const Vec3f red(1, 0, 0), green(0, 1, 0);
    for (const char* repeated : {"REPEAT", "FOO", "", "clamp"}) {
        const auto [left, right] = quarters(repeated);
        EXPECT_GT(left.r, .9) << repeated;
        EXPECT_GT(right.g, .9) << repeated;
    }
    for (const char* clamped : {"CLAMP", "CLAMP_TO_EDGE"}) EXPECT_EQ(quarters(clamped), std::pair(green, green));
    const auto [left, right] = quarters("MIRRORED_REPEAT");
    EXPECT_GT(left.g, .9);
    EXPECT_GT(right.r, .9);
}

TEST(Texture, CoordinateGeneratorsOfNoKnownModeAreSpheres) {
    test::LightScene s(fmt::format(kTwoPixels,
                                   "texCoord DEF G TextureCoordinateGenerator { mode \"COORD\" } normal Normal { "
                                   "vector [ -.6 0 .8 .6 0 .8 .6 0 .8 -.6 0 .8 ] }"));
    const auto seen = [&](const char* mode) {
        EXPECT_TRUE(s.scene.set(s.node("G"), x3d::TextureCoordinateGenerator::mode, String(mode)));
        s.scene.newFrame(s.scene.now() + 1);
        return s.picture().pixels;
    };
    const auto spheres = seen("SPHERE");
    EXPECT_NE(seen("COORD"), spheres);
    EXPECT_EQ(seen("FOO"), spheres);
}

}  // namespace
}  // namespace rtsg
