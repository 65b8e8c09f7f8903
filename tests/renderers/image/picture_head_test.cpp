// Files whose heads promise more pixels than their bytes can hold: each is refused within a few megabytes, before any
// library takes memory for them; and heads of true files are believed.
#include <algorithm>
#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <zlib.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/resource.h>
#include <rtsg/renderers/texture.h>

#include "image/picture_head.h"
#include "support/taken_memory.h"

namespace rtsg {
namespace {

using test::kMegabyte;
using testing::HasSubstr;

/// Numbers into a file, of either byte order.
struct Written {
    std::string bytes;
    Written& text(std::string_view more) {
        bytes += more;
        return *this;
    }
    Written& little(std::uint64_t number, int count) {
        for (int i = 0; i < count; ++i) bytes += static_cast<char>(number >> (8 * i) & 255);
        return *this;
    }
    Written& big(std::uint64_t number, int count) {
        for (int i = count - 1; i >= 0; --i) bytes += static_cast<char>(number >> (8 * i) & 255);
        return *this;
    }
    Written& zeros(std::size_t count) {
        bytes.append(count, '\0');
        return *this;
    }
};

std::span<const std::uint8_t> viewOf(const std::string& bytes) {
    return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
}

// ---- heads -----------------------------------------------------------------------------------------------------

std::string pngChunk(const std::string& type, const std::string& data) {
    const std::string both = type + data;
    const auto sum = crc32(crc32(0, nullptr, 0), reinterpret_cast<const Bytef*>(both.data()), uInt(both.size()));
    return Written().big(data.size(), 4).text(both).big(sum, 4).bytes;
}
std::string zipped(const std::string& text) {
    std::string result(compressBound(uLong(text.size())), '\0');
    uLongf size = result.size();
    compress2(reinterpret_cast<Bytef*>(result.data()), &size, reinterpret_cast<const Bytef*>(text.data()),
              uLong(text.size()), 9);
    result.resize(size);
    return result;
}
std::string png(std::uint32_t width, std::uint32_t height, const std::string& pixels, const std::string& more = {}) {
    return "\x89PNG\r\n\x1a\n" +
           pngChunk("IHDR", Written().big(width, 4).big(height, 4).text(std::string("\x08\x06\0\0\0", 5)).bytes) +
           more + pngChunk("IDAT", pixels) + pngChunk("IEND", {});
}

std::string jpeg(std::uint16_t width, std::uint16_t height, int scans = 1, unsigned char frame = 0xC2) {
    Written created;
    created.text("\xFF\xD8\xFF\xDB").big(67, 2).text(std::string(1, '\0')).text(std::string(64, '\1'));
    created.text("\xFF").big(frame, 1).big(11, 2).big(8, 1).big(height, 2).big(width, 2).big(1, 1).big(0x011100, 3);
    created.text("\xFF\xC4").big(20, 2).text(std::string(1, '\0')).big(1, 1).zeros(15).zeros(1);
    for (int i = 0; i < scans; ++i)
        created.text("\xFF\xDA").big(8, 2).big(1, 1).big(0x0100, 2).big(0, 1).big(0, 1).big(0, 1).zeros(4);
    return created.text("\xFF\xD9").bytes;
}

std::string gif(std::uint16_t width, std::uint16_t height) {
    return Written()
        .text("GIF89a")
        .little(width, 2)
        .little(height, 2)
        .little(0x80, 3)
        .zeros(3)
        .text("\xFF\xFF\xFF,")
        .zeros(4)
        .little(1, 2)
        .little(1, 2)
        .zeros(1)
        .text(std::string("\x02\x02\x44\x01\0;", 6))
        .bytes;
}

std::string bmp(std::uint32_t width, std::uint32_t height, std::uint32_t packing, std::uint16_t bits) {
    return Written()
        .text("BM")
        .little(2000, 4)
        .zeros(4)
        .little(54 + 1024, 4)
        .little(40, 4)
        .little(width, 4)
        .little(height, 4)
        .little(1, 2)
        .little(bits, 2)
        .little(packing, 4)
        .zeros(12)
        .little(256, 4)
        .zeros(4 + 1024)
        .text(std::string(20, '\1'))
        .bytes;
}

std::string tiffHead(std::uint32_t width, std::uint32_t height, std::uint32_t tile, std::uint16_t packing) {
    std::vector<std::array<std::uint32_t, 2>> tags{{256, width}, {257, height}, {258, 8}, {259, packing},
                                                   {262, 2},     {277, 4},      {284, 1}};
    const auto parts = tile > 0
                           ? std::vector<std::array<std::uint32_t, 2>>{{322, tile}, {323, tile}, {324, 400}, {325, 100}}
                           : std::vector<std::array<std::uint32_t, 2>>{{273, 400}, {278, height}, {279, 100}};
    tags.insert(tags.end(), parts.begin(), parts.end());
    std::ranges::sort(tags);
    Written created;
    created.text(std::string("II*\0", 4)).little(8, 4).little(tags.size(), 2);
    for (const auto& [tag, value] : tags) created.little(tag, 2).little(4, 2).little(1, 4).little(value, 4);
    created.bytes.resize(600);
    return created.bytes;
}

std::string exrAttribute(const std::string& name, const std::string& type, const std::string& value) {
    return Written().text(name).zeros(1).text(type).zeros(1).little(value.size(), 4).text(value).bytes;
}
std::string exr(std::uint32_t width, std::uint32_t height, char compression, std::uint32_t tile = 0,
                const std::string& more = {}) {
    Written channels;
    for (const char* name : {"B", "G", "R"})
        channels.text(name).zeros(1).little(1, 4).zeros(4).little(1, 4).little(1, 4);
    channels.zeros(1);
    const std::string window = Written().zeros(8).little(width - 1, 4).little(height - 1, 4).bytes;
    const std::string one("\0\0\x80\x3F", 4);
    return Written()
        .little(20000630, 4)
        .little(tile > 0 ? 0x202 : 2, 4)
        .text(exrAttribute("channels", "chlist", channels.bytes))
        .text(exrAttribute("compression", "compression", std::string(1, compression)))
        .text(exrAttribute("dataWindow", "box2i", window))
        .text(exrAttribute("displayWindow", "box2i", window))
        .text(exrAttribute("lineOrder", "lineOrder", std::string(1, '\0')))
        .text(exrAttribute("pixelAspectRatio", "float", one))
        .text(exrAttribute("screenWindowCenter", "v2f", std::string(8, '\0')))
        .text(exrAttribute("screenWindowWidth", "float", one))
        .text(tile > 0 ? exrAttribute("tiles", "tiledesc", Written().little(tile, 4).little(tile, 4).zeros(1).bytes)
                       : "")
        .text(more)
        .zeros(1 + 4000)
        .bytes;
}
/// An attribute of 2 GB in 29 bytes.
std::string exrOfOneAttribute() {
    return Written().little(20000630, 4).little(2, 4).text(std::string("a\0string\0", 9)).little(0x7FFFF000, 4).bytes +
           "xxxxxxxx";
}

std::string webp(const std::string& kind, const std::string& data) {
    return Written()
        .text("RIFF")
        .little(12 + data.size(), 4)
        .text("WEBP")
        .text(kind)
        .little(data.size(), 4)
        .text(data)
        .bytes;
}

std::string ddsHead(std::uint32_t width, std::uint32_t height) {
    return Written()
        .text("DDS ")
        .little(124, 4)
        .little(0x1007, 4)
        .little(height, 4)
        .little(width, 4)
        .zeros(12 + 44)
        .little(32, 4)
        .little(4, 4)
        .text("DXT1")
        .zeros(20)
        .little(0x1000, 4)
        .zeros(116)
        .bytes;
}

std::string tga(std::uint16_t width, std::uint16_t height) {
    return Written()
        .zeros(2)
        .little(2, 1)
        .zeros(9)
        .little(width, 2)
        .little(height, 2)
        .little(32, 1)
        .little(8, 1)
        .zeros(48)
        .text("TRUEVISION-XFILE.")
        .zeros(1)
        .bytes;
}

struct Lie {
    const char* name;
    std::string file;
};

/// Each says that it has 64 megapixels or more, or memory besides.
std::vector<Lie> lies() {
    return {
        {"exr, attribute", exrOfOneAttribute()},
        {"exr, window", exr(8000, 8000, 0)},
        {"exr, window, packed", exr(8000, 8000, 3)},
        {"exr, tile", exr(64, 64, 0, 20000)},
        {"exr, many parts", exr(1, 2'000'000, 3)},
        {"png", png(8000, 8000, zipped(std::string(100, '\0')))},
        {"png, texts", png(1, 1, zipped(std::string(5, '\0')),
                           [] {
                               const std::string text =
                                   pngChunk("zTXt", std::string("a\0\0", 3) + zipped(std::string(7'900'000, 'x')));
                               std::string all;
                               for (int i = 0; i < 20; ++i) all += text;
                               return all;
                           }())},
        {"jpeg", jpeg(8000, 8000)},
        {"jpeg, scans", jpeg(64, 64, 200)},
        {"gif", gif(8000, 8000)},
        {"gif, larger", gif(32000, 32000)},
        {"bmp", bmp(8000, 8000, 0, 24)},
        {"bmp, runs", bmp(32000, 32000, 1, 8)},
        {"tiff", tiffHead(8000, 8000, 0, 1)},
        {"tiff, deflate", tiffHead(8000, 8000, 0, 8)},
        {"tiff, tile", tiffHead(64, 64, 60000, 1)},
        {"hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8000 +X 8000\n" + std::string(20, '\0')},
        {"pnm", "P6 # a comment\n8000 8000 255\n" + std::string(20, '\0')},
        {"tga", tga(8000, 8000)},
        {"dds", ddsHead(8000, 8000)},
        {"webp", webp("VP8L", Written().text("\x2F").little(7999 | 7999u << 14, 4).text("\x88\x88\x08").bytes)},
        {"webp, animated", webp("VP8X", Written().little(2, 4).little(16000, 3).little(16000, 3).bytes)},
    };
}

TEST(PictureHeads, ThatPromiseWhatIsNotThereAreRefusedWithinMegabytes) {
    if (!test::kMemoryIsOurs) GTEST_SKIP() << "sanitizers have memory of their own";
    for (const Lie& lie : lies()) {
        const std::size_t taken = test::takenBy([&] {
            const auto texture = Texture::fromMemory(viewOf(lie.file), lie.name);
            EXPECT_FALSE(texture) << lie.name;
            return !texture;
        });
        EXPECT_LT(taken, 4 * kMegabyte) << lie.name << ", of " << lie.file.size() << " bytes";
    }
}

TEST(PictureHeads, SayWhatIsWrong) {
    const auto why = [](const std::string& file) { return whyNotWithin(viewOf(file)); };
    EXPECT_EQ(why(exrOfOneAttribute()),
              "the EXR file's attribute at its byte 10 says that it has 2147479552 bytes, and 8 follow");
    EXPECT_THAT(why(png(8000, 8000, "")), HasSubstr("8000 x 8000 pixels, which a file of "));
    EXPECT_THAT(why(tiffHead(64, 64, 60000, 1)), HasSubstr("60000 x 60000 pixels"));
    EXPECT_THAT(why(exr(64, 64, 0, 20000)), HasSubstr("tiles of 20000 x 20000 pixels are larger than its picture"));
    EXPECT_THAT(why(jpeg(64, 64, 200)), HasSubstr("more than 100 times"));
    const std::string whole = exr(8, 8, 0);
    for (std::size_t size = 9; size < 300; size += 7)
        EXPECT_THAT(why(whole.substr(0, size)), HasSubstr("the EXR file")) << size;
}

// A byte holds as much as its format's packing can say with it; small pictures are left to their readers.
TEST(PictureHeads, ThatMayBeTrueAreBelieved) {
    const auto why = [](const std::string& file) { return whyNotWithin(viewOf(file)); };
    std::string rows;  // of one colour
    for (int y = 0; y < 4000; ++y) rows += std::string(1 + 4 * 4000, '\0');
    EXPECT_EQ(why(png(4000, 4000, zipped(rows))), "");
    for (const std::string& file : {png(500, 500, ""), jpeg(1000, 1000), gif(1000, 1000), bmp(1000, 1000, 0, 24),
                                    tiffHead(1000, 1000, 0, 1), ddsHead(1000, 1000), tga(1000, 1000), exr(500, 500, 0),
                                    jpeg(64, 64, 90), std::string("no picture at all, whatever it is"), std::string()})
        EXPECT_EQ(why(file), "");
    EXPECT_EQ(why(bmp(2000, 2000, 0, 24) + std::string(12'000'000, 'x')), "");
    EXPECT_EQ(why("P5 4000 4000 255\n" + std::string(16'000'000, 'x')), "");
    EXPECT_EQ(why(jpeg(8000, 8000) + std::string(8000 * 8000 / 512, 'x')), "");
    EXPECT_EQ(why(exr(2000, 2000, 0) + std::string(24'000'000, 'x')), "");
}

// The memory limit of the process is checked before memory is taken.
TEST(PictureHeads, PicturesBeyondTheMemoryOfTheProcessAreRefused) {
    if (!test::kMemoryIsOurs) GTEST_SKIP() << "sanitizers have memory of their own";
    std::string rows;
    for (int y = 0; y < 2000; ++y) rows += std::string(1 + 4 * 2000, '\0');
    const std::string file = png(2000, 2000, zipped(rows));
    const std::size_t taken = test::takenBy([&] {
        ::malloc_trim(0);  // what earlier tests have given back
        setMemoryLimit(heldMemory() + 16 * kMegabyte);
        const auto texture = Texture::fromMemory(viewOf(file), "large.png");
        EXPECT_FALSE(texture);
        return !texture && texture.error().text.contains("--limit memory=N");
    });
    EXPECT_LT(taken, 16 * kMegabyte);
}

}  // namespace
}  // namespace rtsg
