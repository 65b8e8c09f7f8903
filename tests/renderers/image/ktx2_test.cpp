// KTX 2.0 files against texels that the specification says, and blocks that are decoded by hand; and damaged ones.
#include "ktx2_file.h"

#include <cmath>
#include <cstring>
#include <fstream>
#include <random>

#include <gmock/gmock.h>
#include <zlib.h>
#include <zstd.h>

#include <rtsg/renderers/space_texture.h>
#include <rtsg/renderers/texture.h>

#include "renderers/light/light_scene.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using namespace test;
using Content = Texture::Content;

Result<Texture> textureOf(const std::string& file, Content content = Content::color,
                          std::uint64_t maximumPixels = 1 << 20) {
    return Texture::fromMemory({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()}, "picture.ktx2",
                               content, maximumPixels);
}
std::string errorOf(const std::string& file) {
    const auto texture = textureOf(file);
    return texture ? "" : texture.error().text;
}
const TextureAccess kExact{.smooth = false, .smoothFar = false, .levels = TextureLevels::finest};

/// A texel, counted from the left and from the top.
Vec4f texelOf(const Texture& texture, int x, int y, ColorSpace space = ColorSpace::display) {
    return texture.sample((static_cast<float>(x) + .5f) / static_cast<float>(texture.width()),
                          1 - (static_cast<float>(y) + .5f) / static_cast<float>(texture.height()), 0, kExact, space);
}
/// The same in 255ths.
Vec4f bytesAt(const Texture& texture, int x, int y) {
    return texelOf(texture, x, y) * 255.0f;
}
void expectBytes(const Vec4f& seen, const Vec4f& expected, const std::string& what) {
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(seen[c], expected[c], .01) << what << ", channel " << c;
}
template <class... T>
std::string bytesOf(T... values) {
    std::string out;
    (out.append(reinterpret_cast<const char*>(&values), sizeof(values)), ...);
    return out;
}
std::string octets(std::initializer_list<int> values) {
    std::string out;
    for (const int value : values) out += static_cast<char>(value);
    return out;
}

TEST(Ktx2, TexelsOfEightBitsAreThoseOfTheFile) {
    struct Case {
        std::uint32_t format;
        std::string texels;  // of two pixels
        Vec4f left, right;
    };
    const Case cases[] = {
        {9, octets({10, 200}), {10, 10, 10, 255}, {200, 200, 200, 255}},
        {15, octets({10, 200}), {10, 10, 10, 255}, {200, 200, 200, 255}},
        {16, octets({10, 20, 200, 100}), {10, 10, 10, 20}, {200, 200, 200, 100}},
        {22, octets({10, 20, 200, 100}), {10, 10, 10, 20}, {200, 200, 200, 100}},
        {23, octets({1, 2, 3, 4, 5, 6}), {1, 2, 3, 255}, {4, 5, 6, 255}},
        {29, octets({1, 2, 3, 4, 5, 6}), {1, 2, 3, 255}, {4, 5, 6, 255}},
        {30, octets({1, 2, 3, 4, 5, 6}), {3, 2, 1, 255}, {6, 5, 4, 255}},
        {36, octets({1, 2, 3, 4, 5, 6}), {3, 2, 1, 255}, {6, 5, 4, 255}},
        {37, octets({1, 2, 3, 40, 5, 6, 7, 80}), {1, 2, 3, 40}, {5, 6, 7, 80}},
        {43, octets({1, 2, 3, 40, 5, 6, 7, 80}), {1, 2, 3, 40}, {5, 6, 7, 80}},
        {44, octets({1, 2, 3, 40, 5, 6, 7, 80}), {3, 2, 1, 40}, {7, 6, 5, 80}},
        {50, octets({1, 2, 3, 40, 5, 6, 7, 80}), {3, 2, 1, 40}, {7, 6, 5, 80}},
    };
    for (const Case& c : cases) {
        const auto texture = textureOf(Ktx2File{.format = c.format, .width = 2, .levels = {{c.texels, 0}}}.bytes());
        ASSERT_TRUE(texture) << c.format << ": " << texture.error().text;
        EXPECT_EQ(texture->bytesPerPixel(), 4u);
        expectBytes(bytesAt(*texture, 0, 0), c.left, fmt::format("left of {}", c.format));
        expectBytes(bytesAt(*texture, 1, 0), c.right, fmt::format("right of {}", c.format));
    }
}

// Numbers of more than 8 bits: half floats are sign, 5 bits of exponent (bias 15), 10 of mantissa.
TEST(Ktx2, WiderTexelsKeepTheirRange) {
    const std::uint16_t whole = 65535, third = 21845, half1 = 0x3C00, half2p5 = 0x4100, halfTiny = 0x0001;
    struct Case {
        std::uint32_t format;
        std::string texel;
        Vec4f expected;  // as stored
    };
    const Case cases[] = {
        {70, bytesOf(third), {1 / 3.f, 1 / 3.f, 1 / 3.f, 1}},
        {77, bytesOf(third, whole), {1 / 3.f, 1 / 3.f, 1 / 3.f, 1}},
        {84, bytesOf(third, whole, std::uint16_t{0}), {1 / 3.f, 1, 0, 1}},
        {91, bytesOf(third, whole, std::uint16_t{0}, third), {1 / 3.f, 1, 0, 1 / 3.f}},
        {76, bytesOf(half2p5), {2.5, 2.5, 2.5, 1}},
        {83, bytesOf(half2p5, half1), {2.5, 2.5, 2.5, 1}},
        {90, bytesOf(half1, half2p5, halfTiny), {1, 2.5, std::ldexp(1.0f, -24), 1}},
        {97, bytesOf(half1, half2p5, halfTiny, std::uint16_t{0x3800}), {1, 2.5, std::ldexp(1.0f, -24), .5}},
        {100, bytesOf(7.25f), {7.25, 7.25, 7.25, 1}},
        {103, bytesOf(7.25f, .25f), {7.25, 7.25, 7.25, .25}},
        {106, bytesOf(7.25f, -1.0f, 1e-20f), {7.25, -1, 1e-20f, 1}},
        {109, bytesOf(7.25f, -1.0f, 1e-20f, .75f), {7.25, -1, 1e-20f, .75}},
        // 9 bits of mantissa without a leading one, exponent of bias 15 in the upper five: m 2^(e - 15 - 9).
        {123, bytesOf(std::uint32_t{256u | 128u << 9 | 511u << 18 | 17u << 27}), {2, 1, 511 / 128.f, 1}},
        // 6, 6 and 5 bits of mantissa: 1, 2.5 and 1.5.
        {122, bytesOf(std::uint32_t{0x3C0u | (16u << 6 | 16u) << 11 | (15u << 5 | 16u) << 22}), {1, 2.5, 1.5, 1}},
        {64, bytesOf(std::uint32_t{341u | 1023u << 10 | 0u << 20 | 1u << 30}), {1 / 3.f, 1, 0, 1 / 3.f}},
    };
    for (const Case& c : cases) {
        const auto texture = textureOf(Ktx2File{.format = c.format, .transfer = 1, .levels = {{c.texel, 0}}}.bytes());
        ASSERT_TRUE(texture) << c.format << ": " << texture.error().text;
        const Vec4f seen = texelOf(*texture, 0, 0, ColorSpace::linear);
        for (int i = 0; i < 4; ++i)
            EXPECT_NEAR(seen[i], c.expected[i], 1e-6f * std::abs(c.expected[i])) << c.format << ", channel " << i;
    }
}

TEST(Ktx2, TheDescriptorSaysWhetherNumbersAreLight) {
    const auto linear = [](std::uint32_t format, int transfer, Content content) {
        const auto texture = textureOf(
            Ktx2File{.format = format, .transfer = transfer, .levels = {{octets({128, 0, 255, 64}), 0}}}.bytes(),
            content);
        EXPECT_TRUE(texture);
        return std::pair(texelOf(*texture, 0, 0, ColorSpace::linear).r, texture->bytesPerPixel());
    };
    const double light = std::pow((128 / 255. + .055) / 1.055, 2.4);
    EXPECT_NEAR(linear(37, 2, Content::color).first, light, 1e-6);
    EXPECT_NEAR(linear(43, 2, Content::color).first, light, 1e-6);
    EXPECT_NEAR(linear(37, 0, Content::color).first, light, 1e-6) << "says nothing: as other pictures";
    EXPECT_NEAR(linear(37, 1, Content::color).first, 128 / 255., 1e-6) << "is light";
    EXPECT_EQ(linear(37, 1, Content::color).second, 16u);
    for (const int transfer : {1, 2}) {
        EXPECT_NEAR(linear(37, transfer, Content::data).first, 128 / 255., 1e-6) << "numbers stay";
        EXPECT_EQ(linear(37, transfer, Content::data).second, 4u) << "in bytes";
    }
    EXPECT_THAT(errorOf(Ktx2File{.transfer = 8, .levels = {{octets({1, 2, 3, 4}), 0}}}.bytes()),
                testing::HasSubstr("transfer function 8"));
}

TEST(Ktx2, OrientationSwizzleAndAlphaCount) {
    const std::string texels = octets({1, 2, 3, 255, 4, 5, 6, 255, 7, 8, 9, 255, 10, 11, 12, 255});
    const auto upperLeft = [&](const char* orientation) {
        Ktx2File file{.width = 2, .height = 2, .levels = {{texels, 0}}};
        if (orientation) file.notes = {{"KTXwriter", "by hand"}, {"KTXorientation", orientation}};
        const auto texture = textureOf(file.bytes());
        EXPECT_TRUE(texture) << orientation;
        return std::lround(bytesAt(*texture, 0, 0).r);
    };
    EXPECT_EQ(upperLeft(nullptr), 1);
    EXPECT_EQ(upperLeft("rd"), 1);
    EXPECT_EQ(upperLeft("ld"), 4);
    EXPECT_EQ(upperLeft("ru"), 7);
    EXPECT_EQ(upperLeft("lu"), 10);
    Ktx2File odd{.width = 2, .height = 2, .notes = {{"KTXorientation", "up"}}, .levels = {{texels, 0}}};
    EXPECT_THAT(errorOf(odd.bytes()), testing::HasSubstr("KTXorientation is \"up\""));

    Ktx2File swizzled{.levels = {{octets({10, 20, 30, 40}), 0}}};
    const auto swizzle = [&](const char* letters, const Vec4f& expected, int channels) {
        swizzled.notes = {{"KTXswizzle", letters}};
        const auto texture = textureOf(swizzled.bytes());
        ASSERT_TRUE(texture) << letters;
        expectBytes(bytesAt(*texture, 0, 0), expected, letters);
        EXPECT_EQ(texture->channels(), channels) << letters;
    };
    swizzle("bgra", {30, 20, 10, 40}, 4);
    swizzle("r0g1", {10, 0, 20, 255}, 3);
    swizzle("ggga", {20, 20, 20, 40}, 2);
    swizzle("bbb1", {30, 30, 30, 255}, 1);
    swizzled = {.format = 9, .levels = {{octets({10}), 0}}};
    swizzle("rgba", {10, 0, 0, 255}, 3);
    swizzled.notes = {{"KTXswizzle", "rgbx"}};
    EXPECT_THAT(errorOf(swizzled.bytes()), testing::HasSubstr("KTXswizzle is \"rgbx\""));

    // Multiplied with an alpha of 51 / 255 = 1/5.
    const auto straight = textureOf(Ktx2File{.flags = 1, .levels = {{octets({20, 40, 51, 51}), 0}}}.bytes());
    ASSERT_TRUE(straight);
    expectBytes(bytesAt(*straight, 0, 0), {100, 200, 255, 51}, "premultiplied");
    const auto grey = textureOf(Ktx2File{.format = 16, .flags = 1, .levels = {{octets({20, 51}), 0}}}.bytes());
    ASSERT_TRUE(grey);
    expectBytes(bytesAt(*grey, 0, 0), {100, 100, 100, 51}, "premultiplied grey");
}

// ---- blocks of 4 x 4, decoded by hand -----------------------------------------------------------------------------

/// Bits from the lowest on.
class BlockBits {
  public:
    BlockBits& put(std::uint32_t value, int count) {
        for (int i = 0; i < count; ++i, ++at_)
            if ((value >> i & 1) != 0)
                bytes_[static_cast<std::size_t>(at_ / 8)] =
                    static_cast<char>(bytes_[static_cast<std::size_t>(at_ / 8)] | 1 << at_ % 8);
        return *this;
    }
    const std::string& bytes() const { return bytes_; }

  private:
    std::string bytes_ = std::string(16, '\0');
    int at_ = 0;
};

/// Red and blue ends; each row counts 0 1 2 3.
std::string colorBlock(std::uint16_t first, std::uint16_t second) {
    return bytesOf(first, second) + octets({0xE4, 0xE4, 0xE4, 0xE4});
}
constexpr std::uint16_t kRed = 0xF800, kBlue = 0x001F;
/// Eight values between 210 and 0: 210, 0, 180, 150 ...; the first row counts 0 1 2 3, the second 4 5 6 7.
std::string valueBlock() {
    BlockBits bits;
    bits.put(210, 8).put(0, 8);
    for (std::uint32_t i = 0; i < 16; ++i) bits.put(i % 8, 3);
    return bits.bytes().substr(0, 8);
}
constexpr float kValues[] = {210, 0, 180, 150, 120, 90, 60, 30};

Result<Texture> blockTexture(std::uint32_t format, const std::string& block, int transfer = 2,
                             Content content = Content::color) {
    return textureOf(
        Ktx2File{.format = format, .width = 4, .height = 4, .transfer = transfer, .levels = {{block, 0}}}.bytes(),
        content);
}

TEST(Ktx2, BlocksOfBc1ToBc3AreDecoded) {
    const Vec4f four[] = {{255, 0, 0, 255}, {0, 0, 255, 255}, {170, 0, 85, 255}, {85, 0, 170, 255}};
    for (const std::uint32_t format : {131, 132, 133, 134}) {
        const auto texture = blockTexture(format, colorBlock(kRed, kBlue));
        ASSERT_TRUE(texture) << format << texture.error().text;
        for (int x = 0; x < 4; ++x) expectBytes(bytesAt(*texture, x, 2), four[x], fmt::format("{} at {}", format, x));
        // Ends the other way round: the fourth is black, and clear where there is alpha.
        const auto clear = blockTexture(format, colorBlock(kBlue, kRed));
        ASSERT_TRUE(clear);
        expectBytes(bytesAt(*clear, 3, 1), {0, 0, 0, format < 133 ? 255 : 0}, fmt::format("black of {}", format));
        EXPECT_EQ(clear->hasAlpha(), format >= 133);
    }
    for (const std::uint32_t format : {135, 136}) {
        std::string alphas;
        for (int row = 0; row < 4; ++row) alphas += octets({0x40, 0xFC});  // 0 4 12 15 of 15
        const auto texture = blockTexture(format, alphas + colorBlock(kRed, kBlue));
        ASSERT_TRUE(texture) << texture.error().text;
        const float alpha[] = {0, 4 * 17, 12 * 17, 255};
        for (int x = 0; x < 4; ++x)
            expectBytes(bytesAt(*texture, x, 3), Vec4f(Vec3f(four[x]), alpha[x]), fmt::format("{} at {}", format, x));
    }
    for (const std::uint32_t format : {137, 138}) {
        const auto texture = blockTexture(format, valueBlock() + colorBlock(kRed, kBlue));
        ASSERT_TRUE(texture) << texture.error().text;
        for (int i = 0; i < 8; ++i)
            expectBytes(bytesAt(*texture, i % 4, i / 4), Vec4f(Vec3f(four[i % 4]), kValues[i]),
                        fmt::format("{} at {}", format, i));
    }
}

TEST(Ktx2, BlocksOfBc4AndBc5AreDecoded) {
    const auto grey = blockTexture(139, valueBlock());
    ASSERT_TRUE(grey) << grey.error().text;
    // The second half runs backwards.
    std::string other = valueBlock();
    std::swap(other[0], other[1]);  // from 0 up to 210: six values, then 0 and 255
    const float up[] = {0, 210, 42, 84, 126, 168, 0, 255};
    const auto both = blockTexture(141, valueBlock() + other);
    ASSERT_TRUE(both) << both.error().text;
    for (int i = 0; i < 16; ++i) {
        const Vec3f value(kValues[i % 8]);
        expectBytes(bytesAt(*grey, i % 4, i / 4), Vec4f(value, 255), fmt::format("BC4 at {}", i));
        expectBytes(bytesAt(*both, i % 4, i / 4), Vec4f(value, up[i % 8]), fmt::format("BC5 at {}", i));
    }
}

TEST(Ktx2, BlocksOfBc6hAndBc7AreDecoded) {
    // Mode 11: two ends of 10 bits a channel; indices of 4 bits (of the first texel 3), here an end each.
    BlockBits wide;
    wide.put(3, 5);
    for (const std::uint32_t end : {512u, 0u, 1023u, 0u, 512u, 512u}) wide.put(end, 10);
    for (int i = 0; i < 16; ++i) wide.put(i % 2 == 0 ? 0 : 15, i == 0 ? 3 : 4);
    // Unpacked to 16 bits, times 31 / 64, as bits of a half float: 512 -> 32800 -> 15887 = 2^0 (1 + 527 / 1024).
    const float middle = 1 + 527 / 1024.f;
    const auto bright = blockTexture(143, wide.bytes(), 1);
    ASSERT_TRUE(bright) << bright.error().text;
    const Vec4f even(middle, 0, 65504, 1), odd(0, middle, middle, 1);
    for (int i = 0; i < 16; ++i)
        EXPECT_EQ(texelOf(*bright, i % 4, i / 4, ColorSpace::linear), i % 2 == 0 ? even : odd) << i;

    // Mode 6: ends of 7 bits a channel and one that they share.
    for (const std::uint32_t format : {145u, 146u}) {
        BlockBits bits;
        bits.put(1u << 6, 7);
        for (const std::uint32_t end : {50u, 10u, 100u, 20u, 25u, 30u, 127u, 40u}) bits.put(end, 7);
        bits.put(0, 1).put(1, 1);
        for (int i = 0; i < 16; ++i) bits.put(i % 2 == 0 ? 0 : 15, i == 0 ? 3 : 4);
        const auto texture = blockTexture(format, bits.bytes());
        ASSERT_TRUE(texture) << texture.error().text;
        for (int i = 0; i < 16; ++i)
            expectBytes(bytesAt(*texture, i % 4, i / 4), i % 2 == 0 ? Vec4f(100, 200, 50, 254) : Vec4f(21, 41, 61, 81),
                        fmt::format("{} at {}", format, i));
    }
}

TEST(Ktx2, PicturesNeedNotEndWithABlock) {
    // 5 x 3 texels are two blocks; the second shows its first column alone.
    Ktx2File file{
        .format = 133, .width = 5, .height = 3, .levels = {{colorBlock(kRed, kBlue) + colorBlock(kBlue, kRed), 0}}};
    const auto texture = textureOf(file.bytes());
    ASSERT_TRUE(texture) << texture.error().text;
    EXPECT_EQ(texture->width(), 5);
    EXPECT_EQ(texture->height(), 3);
    expectBytes(bytesAt(*texture, 3, 2), {85, 0, 170, 255}, "the first block's fourth");
    expectBytes(bytesAt(*texture, 4, 0), {0, 0, 255, 255}, "the second's first");
}

// ---- levels, packing, sides and layers ----------------------------------------------------------------------------

std::string zstdOf(const std::string& bytes) {
    std::string out(ZSTD_compressBound(bytes.size()), '\0');
    out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 3));
    return out;
}
std::string zlibOf(const std::string& bytes) {
    uLongf size = compressBound(bytes.size());
    std::string out(size, '\0');
    EXPECT_EQ(compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                       bytes.size()),
              Z_OK);
    out.resize(size);
    return out;
}

/// 64 x 64 texels whose red is the column and whose green is the row, with all coarser levels white.
Ktx2File chart(std::uint32_t scheme) {
    Ktx2File file{.width = 64, .height = 64, .scheme = scheme};
    for (int side = 64; side >= 1; side /= 2) {
        std::string level;
        for (int i = 0; i < side * side; ++i)
            level += side == 64 ? octets({i % 64, i / 64, 9, 255}) : octets({255, 255, 255, 255});
        file.levels.emplace_back(scheme == 2 ? zstdOf(level) : scheme == 3 ? zlibOf(level) : level, level.size());
    }
    return file;
}

TEST(Ktx2, TheLargestLevelIsUnpacked) {
    for (const std::uint32_t scheme : {0u, 2u, 3u}) {
        const auto texture = textureOf(chart(scheme).bytes());
        ASSERT_TRUE(texture) << scheme << ": " << texture.error().text;
        for (const auto& [x, y] : {std::pair{0, 0}, {63, 0}, {5, 40}, {63, 63}})
            expectBytes(bytesAt(*texture, x, y), {x, y, 9, 255}, fmt::format("scheme {}", scheme));
    }
    // Blocks are packed as texels are.
    const auto block = textureOf(
        Ktx2File{.format = 131, .width = 4, .height = 4, .scheme = 2, .levels = {{zstdOf(colorBlock(kRed, kBlue)), 8}}}
            .bytes());
    ASSERT_TRUE(block) << block.error().text;
    expectBytes(bytesAt(*block, 1, 0), {0, 0, 255, 255}, "a packed block");
}

class Ktx2Scenes : public testing::Test {
  protected:
    void write(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder.path() / name, std::ios::binary) << bytes;
    }
    LightRenderer::Options options() const {
        return LightRenderer::Options(Resources::ofFile(folder.path() / "main.x3dv"));
    }
    const TempFolder folder;
};

// Faces are stored +x -x +y -y +z -z, as seen from inside where +z is the front: X3D's right, left, top, bottom, front
// and back.
TEST_F(Ktx2Scenes, FacesAreSidesOfACube) {
    const CubeSide sides[] = {CubeSide::right,  CubeSide::left,  CubeSide::top,
                              CubeSide::bottom, CubeSide::front, CubeSide::back};
    for (const std::uint32_t format : {37u, 133u}) {
        Ktx2File file{.format = format, .width = 4, .height = 4, .faces = 6};
        std::string level;
        for (int face = 0; face < 6; ++face)
            for (int i = 0; i < 16; ++i)  // the upper half of each is brighter
                if (format == 37)
                    level += octets({40 * face, i < 8 ? 200 : 100, 0, 255});
                else if (i == 0)
                    level +=
                        bytesOf(static_cast<std::uint16_t>((4 * face) << 11), std::uint16_t{0}) + octets({0, 0, 0, 0});
        file.levels = {{level, 0}};
        const auto texture = textureOf(file.bytes());
        ASSERT_TRUE(texture) << texture.error().text;
        const auto cube = SpaceTexture::ofPicture(std::make_shared<const Texture>(std::move(*texture)));
        ASSERT_TRUE(cube) << cube.error().text;
        for (int face = 0; face < 6; ++face)
            for (const float t : {.25f, .75f}) {
                const Vec4f seen =
                    cube->sample(cubeDirection(sides[face], {.5f, t}), 0, kExact, ColorSpace::display) * 255.0f;
                // 5 bits become 8 by repeating the upper ones.
                const int five = 4 * face;
                EXPECT_NEAR(seen.r, format == 37 ? 40 * face : five << 3 | five >> 2, .01) << face;
                EXPECT_NEAR(seen.g, format == 37 ? (t > .5f ? 200 : 100) : 0, .01) << face;
            }
    }
    Ktx2File turned{.width = 4,
                    .height = 4,
                    .faces = 6,
                    .notes = {{"KTXorientation", "ru"}},
                    .levels = {{std::string(6 * 64, 'x'), 0}}};
    EXPECT_THAT(errorOf(turned.bytes()), testing::HasSubstr("\"rd\""));
}

TEST_F(Ktx2Scenes, LayersAreABlockAndNoFlatPicture) {
    Ktx2File file{.width = 2, .height = 2, .depth = 3};
    std::string level;
    for (int z = 0; z < 3; ++z)
        for (int i = 0; i < 4; ++i) level += octets({50 * z, 10 * i, 0, 255});
    file.levels = {{level, 0}};
    for (const bool backwards : {false, true}) {
        if (backwards) file.notes = {{"KTXorientation", "rdo"}};
        const std::string bytes = file.bytes();
        const auto layers =
            Texture::layersFromMemory({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "a.ktx2");
        ASSERT_TRUE(layers) << layers.error().text;
        ASSERT_EQ(layers->size(), 3u);
        for (int z = 0; z < 3; ++z)
            expectBytes(bytesAt((*layers)[static_cast<std::size_t>(z)], 0, 1),
                        {50 * (backwards ? 2 - z : z), 20, 0, 255}, fmt::format("layer {}", z));
    }
    EXPECT_THAT(errorOf(file.bytes()), testing::HasSubstr("three dimensions"));
}

TEST_F(Ktx2Scenes, ScenesShowThem) {
    const auto square = [](const std::string& texture) {
        return "OrthoViewpoint { fieldOfView [ -1 -1 1 1 ] } Shape { appearance Appearance { material UnlitMaterial { "
               "} "
               "texture " +
               texture +
               " } geometry IndexedFaceSet { coordIndex [ 0 1 2 3 ] texCoord TextureCoordinate3D { point [ 0 0 .5, 1 0 "
               ".5, 1 1 .5, 0 1 .5 ] } coord Coordinate { point [ -1 -1 0, 1 -1 0, 1 1 0, -1 1 0 ] } } }";
    };
    const auto center = [&](const std::string& texture, std::size_t complaints = 0) {
        LightScene s(square(texture), 33, 33, options());
        s.options.settings.colorSpace = ColorSpace::display;
        const Vec3f seen = s.center();
        const auto& all = s.light->diagnostics().all();
        EXPECT_EQ(all.size(), complaints);
        return std::pair(seen * 255.0f, all.empty() ? "" : all[0].text);
    };
    write("flat.ktx2", Ktx2File{.levels = {{octets({10, 20, 30, 255}), 0}}}.bytes());
    EXPECT_LT(glm::distance(center("ImageTexture { url \"flat.ktx2\" }").first, Vec3f(10, 20, 30)), .01f);
    write("block.ktx2", Ktx2File{.depth = 2, .levels = {{octets({10, 20, 30, 255, 30, 40, 50, 255}), 0}}}.bytes());
    EXPECT_LT(glm::distance(center("ImageTexture3D { url \"block.ktx2\" }").first, Vec3f(20, 30, 40)), .01f);
    EXPECT_THAT(center("ImageTexture { url \"block.ktx2\" }", 1).second, testing::HasSubstr("three dimensions"));
    // Unsupported features are reported by name, once.
    Ktx2File other{.format = 0, .scheme = 2, .model = 166, .levels = {{zstdOf(std::string(16, 'x')), 16}}};
    write("uastc.ktx2", other.bytes());
    EXPECT_THAT(center("ImageTexture { url \"uastc.ktx2\" }", 1).second,
                testing::AllOf(testing::HasSubstr("uastc.ktx2"), testing::HasSubstr("UASTC"),
                               testing::HasSubstr("no library")));
}

TEST(Ktx2, WhatIsNotReadIsNamed) {
    const auto reported = [](const Ktx2File& file) { return errorOf(file.bytes()); };
    using testing::HasSubstr;
    EXPECT_THAT(reported({.format = 0, .scheme = 1, .model = 163, .levels = {{"x", 0}}}), HasSubstr("ETC1S (BasisLZ)"));
    EXPECT_THAT(reported({.format = 0, .model = 166, .levels = {{"x", 0}}}), HasSubstr("UASTC"));
    EXPECT_THAT(reported({.format = 152, .model = 161, .levels = {{"x", 0}}}), HasSubstr("ETC2"));
    EXPECT_THAT(reported({.format = 158, .model = 162, .levels = {{"x", 0}}}), HasSubstr("ASTC"));
    EXPECT_THAT(reported({.format = 140, .levels = {{"x", 0}}}), HasSubstr("VkFormat 140"));
    EXPECT_THAT(reported({.scheme = 0x10000, .levels = {{"xxxx", 0}}}), HasSubstr("scheme 65536"));
    EXPECT_THAT(reported({.layers = 3, .levels = {{"xxxxxxxxxxxx", 0}}}), HasSubstr("array of 3"));
    EXPECT_THAT(reported({.height = 0, .levels = {{"xxxx", 0}}}), HasSubstr("one dimension"));
}

// ---- damage -------------------------------------------------------------------------------------------------------

TEST(Ktx2, DamageIsToldWithItsPlaceAndTakesNoMemory) {
    using testing::HasSubstr;
    const std::string texel = octets({1, 2, 3, 4});
    // 2^15 x 2^15 pixels in 4 bytes; as much in a few packed ones.
    Ktx2File large{.width = 32768, .height = 32768, .levels = {{texel, 0}}};
    EXPECT_THAT(errorOf(large.bytes()),
                HasSubstr("byte 80: level 0 has 4 bytes, 4 unpacked; its pixels take 4294967296"));
    large.levels[0].second = std::uint64_t{1} << 32;
    for (const std::uint32_t scheme : {2u, 3u}) {
        large.scheme = scheme;
        const std::string bytes = large.bytes();
        const auto texture = textureOf(bytes, Content::color, std::uint64_t{1} << 40);
        ASSERT_FALSE(texture);
        EXPECT_THAT(texture.error().text, HasSubstr("4 bytes cannot hold 4294967296"));
        EXPECT_THAT(errorOf(bytes), HasSubstr("--limit pixels")) << "before that, where fewer are allowed";
    }
    Ktx2File packed{.width = 2, .scheme = 2, .levels = {{zstdOf(texel), 8}}};
    EXPECT_THAT(errorOf(packed.bytes()), HasSubstr("level 0 ends after 4 bytes"));
    packed.levels[0].first = "no Zstandard";
    EXPECT_THAT(errorOf(packed.bytes()), HasSubstr("damaged at its byte 144"));
    packed.scheme = 3;
    EXPECT_THAT(errorOf(packed.bytes()), HasSubstr("zlib"));
    EXPECT_THAT(errorOf(Ktx2File{.faces = 5, .levels = {{texel, 0}}}.bytes()), HasSubstr("byte 36: 5 faces"));
    EXPECT_THAT(errorOf(Ktx2File{.width = 0, .levels = {{texel, 0}}}.bytes()), HasSubstr("byte 20"));
    Ktx2File many{.levels = {{texel, 0}, {texel, 0}}};
    EXPECT_THAT(errorOf(many.bytes()), HasSubstr("byte 40: 2 levels"));
    // Wherever it is cut, it is whole no more.
    const std::string whole = chart(2).bytes();
    for (std::size_t length = 12; length < whole.size(); length += length < 400 ? 1 : 37) {
        const std::string error = errorOf(whole.substr(0, length));
        EXPECT_THAT(error, HasSubstr("damaged at its byte")) << length;
    }
}

// Whatever is in a file, it is a picture of a size that is allowed, or an error.
TEST(Ktx2, RandomDamageNeverDoesMoreThanFail) {
    Ktx2File noted = chart(2);
    noted.notes = {{"KTXorientation", "ru"}, {"KTXswizzle", "bgra"}};
    const Ktx2File blocks{.format = 145, .width = 8, .height = 8, .faces = 6, .levels = {{std::string(384, 'q'), 0}}};
    const std::string seeds[] = {noted.bytes(), chart(3).bytes(), blocks.bytes()};
    std::mt19937 random(7);
    int read = 0, refused = 0;
    for (int round = 0; round < 6000; ++round) {
        std::string file = seeds[round % 3];
        const std::size_t head = std::min<std::size_t>(file.size(), round % 2 == 0 ? 140 : file.size());
        for (int i = 0; i < 1 + round % 4; ++i) {
            const std::size_t at = 12 + random() % (head - 12);
            file[at] = static_cast<char>(random() % 3 == 0 ? random() : file[at] ^ (1 << random() % 8));
        }
        const auto texture = textureOf(file, round % 5 == 0 ? Content::data : Content::color);
        if (texture) {
            EXPECT_LE(texture->width() * texture->height(), 1 << 20);
            ++read;
        } else {
            EXPECT_FALSE(texture.error().text.empty());
            ++refused;
        }
    }
    EXPECT_GT(read, 100);
    EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace rtsg
