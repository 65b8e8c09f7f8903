// PNG, JPEG and WebP files by their own libraries: the very pixels that the reader of all formats gives, or nothing at
// all; the very bytes that the writer of all formats writes.
#include <algorithm>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "image/image_files.h"

namespace rtsg {
namespace {

using Bytes = std::vector<std::uint8_t>;

void put32(Bytes& to, std::uint32_t number) {
    for (int shift = 24; shift >= 0; shift -= 8) to.push_back(static_cast<std::uint8_t>(number >> shift));
}
std::uint32_t crcOf(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = ~0u;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0);
    }
    return ~crc;
}
void putChunk(Bytes& to, const char* type, const Bytes& data) {
    put32(to, static_cast<std::uint32_t>(data.size()));
    const std::size_t first = to.size();
    to.insert(to.end(), type, type + 4);
    to.insert(to.end(), data.begin(), data.end());
    put32(to, crcOf(std::span(to).subspan(first)));
}
/// A zlib stream that does not compress.
Bytes stored(const Bytes& data) {
    Bytes result{0x78, 0x01, 0x01};
    const auto size = static_cast<std::uint16_t>(data.size());
    for (const unsigned number : {unsigned{size}, unsigned{static_cast<std::uint16_t>(~size)}})
        result.push_back(static_cast<std::uint8_t>(number)), result.push_back(static_cast<std::uint8_t>(number >> 8));
    result.insert(result.end(), data.begin(), data.end());
    std::uint32_t a = 1, b = 0;
    for (const std::uint8_t byte : data) a = (a + byte) % 65521, b = (b + a) % 65521;
    put32(result, b << 16 | a);
    return result;
}

struct PngKind {
    std::uint8_t type;  // as in IHDR: 0 grey, 2 colours, 3 palette, 4 grey and alpha, 6 colours and alpha
    std::uint8_t depth;
    bool transparent = false;  // a tRNS chunk
    bool interlaced = false;   // in the seven passes of Adam7
    int channels() const { return type == 2 ? 3 : type == 4 ? 2 : type == 6 ? 4 : 1; }
};
/// Random pixels; filters of all rows are 0.
Bytes pngOf(const PngKind& kind, int width, int height, std::mt19937& random, const char* more = nullptr) {
    Bytes file{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'}, header;
    put32(header, static_cast<std::uint32_t>(width)), put32(header, static_cast<std::uint32_t>(height));
    for (const std::uint8_t byte :
         {kind.depth, kind.type, std::uint8_t{0}, std::uint8_t{0}, static_cast<std::uint8_t>(kind.interlaced)})
        header.push_back(byte);
    putChunk(file, "IHDR", header);
    if (more) putChunk(file, more, {0, 0, 0xB1, 0x8F});
    if (kind.type == 3) {
        Bytes palette(std::size_t{3} << kind.depth);
        for (std::uint8_t& byte : palette) byte = static_cast<std::uint8_t>(random());
        putChunk(file, "PLTE", palette);
    }
    if (kind.transparent) putChunk(file, "tRNS", kind.type == 3 ? Bytes{0, 128} : kind.type == 2 ? Bytes(6) : Bytes(2));
    Bytes rows;
    const auto put = [&](int columns, int lines) {
        for (int y = 0; y < lines && columns > 0; ++y) {
            rows.push_back(0);
            for (int i = 0; i < (columns * kind.channels() * kind.depth + 7) / 8; ++i)
                rows.push_back(static_cast<std::uint8_t>(random() % 3 ? random() : 0));
        }
    };
    constexpr int kPasses[7][4] = {{0, 8, 0, 8}, {4, 8, 0, 8}, {0, 4, 4, 8}, {2, 4, 0, 4},
                                   {0, 2, 2, 4}, {1, 2, 0, 2}, {0, 1, 1, 2}};  // first column, step, first line, step
    if (!kind.interlaced) put(width, height);
    for (const auto& [x, dx, y, dy] : kPasses)
        if (kind.interlaced) put((width - x + dx - 1) / dx, (height - y + dy - 1) / dy);
    putChunk(file, "IDAT", stored(rows));
    putChunk(file, "IEND", {});
    return file;
}

Bytes jpegOf(int width, int height, std::mt19937& random) {
    Bytes pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 4);
    for (std::uint8_t& byte : pixels) byte = static_cast<std::uint8_t>(random());
    const Sheet sheet{.width = width, .height = height, .bytes = pixels.data(), .values = nullptr, .opaque = true};
    Bytes file;
    EXPECT_EQ((*imageFiles())->encode("x.jpg", sheet, file), "");
    return file;
}

/// Makes the checksums of a PNG file's chunks right, as far as there are whole chunks.
void repair(Bytes& png) {
    for (std::size_t at = 8; at + 12 <= png.size();) {
        std::size_t length = 0;
        for (std::size_t i = 0; i < 4; ++i) length = length << 8 | png[at + i];
        if (length > png.size() - at - 12) return;
        Bytes sum;
        put32(sum, crcOf(std::span(png).subspan(at + 4, length + 4)));
        at += 12 + length;
        std::ranges::copy(sum, png.begin() + static_cast<std::ptrdiff_t>(at) - 4);
    }
}

ReadRequest textureRequest(bool bottomRowFirst) {
    ReadRequest request;
    request.straight = true, request.bottomRowFirst = bottomRowFirst;
    return request;
}

bool readPlain(const Bytes& file, const ReadRequest& request, FilePixels& out, std::string& refused) {
    return (*plainReader(file))(file, request, out, refused);
}

/// Whether it was read, and whole; if it was read, then as by the reader of all formats.
bool readsAlike(const Bytes& file, const char* name, const std::string& what) {
    FilePixels plain, all;
    std::string refused;
    bool read = false;
    for (const bool bottomRowFirst : {false, true}) {
        const ReadRequest request = textureRequest(bottomRowFirst);
        read = readPlain(file, request, plain, refused);
        EXPECT_EQ(refused, "");
        if (!read) continue;
        EXPECT_EQ((*imageFiles())->readMemory(file, name, request, all), "") << what;
        EXPECT_EQ(plain.width, all.width);
        EXPECT_EQ(plain.height, all.height);
        EXPECT_EQ(plain.channels, all.channels) << what;
        EXPECT_EQ(plain.layers, all.layers);
        EXPECT_EQ(plain.encoded, all.encoded);
        EXPECT_EQ(plain.values, all.values) << what;
        EXPECT_EQ(plain.bytes, all.bytes) << what;
    }
    return read && plain.damage.empty();
}

class PlainImages : public testing::Test {
  protected:
    void SetUp() override {
        if (!imageFiles()) GTEST_SKIP() << imageFiles().error().text;
        ASSERT_TRUE(plainReader({}));
    }
    std::mt19937 random{42};
};

TEST_F(PlainImages, PngsAreWhatTheyAreToTheOthers) {
    const PngKind kinds[] = {{0, 1}, {0, 2},  {0, 4},        {0, 8},  {0, 8, true},  {2, 8},       {2, 8, true},
                             {3, 1}, {3, 2},  {3, 4},        {3, 8},  {3, 8, true},  {3, 2, true}, {4, 8},
                             {6, 8}, {0, 16}, {0, 16, true}, {2, 16}, {2, 16, true}, {4, 16},      {6, 16}};
    for (PngKind kind : kinds)
        for (const auto& [width, height] : {std::pair(1, 1), std::pair(13, 7), std::pair(64, 33)})
            for (const bool interlaced : {false, true}) {
                kind.interlaced = interlaced;
                const std::string what = fmt::format("type {} depth {} {} {} {} x {}", kind.type, kind.depth,
                                                     kind.transparent, interlaced, width, height);
                EXPECT_TRUE(readsAlike(pngOf(kind, width, height, random), "x.png", what)) << what;
                EXPECT_TRUE(readsAlike(pngOf(kind, width, height, random, "gAMA"), "x.png", what)) << what;
            }
}

// 16 bits a channel stay 16 bits.
TEST_F(PlainImages, SixteenBitsAreAllKept) {
    for (const PngKind& kind : {PngKind{0, 16}, PngKind{2, 16}, PngKind{4, 16}, PngKind{6, 16}}) {
        std::mt19937 again = random;
        FilePixels out;
        std::string refused;
        ASSERT_TRUE(readPlain(pngOf(kind, 9, 5, random), textureRequest(false), out, refused));
        EXPECT_EQ(out.channels, kind.channels());
        EXPECT_TRUE(out.encoded);
        EXPECT_TRUE(out.bytes.empty());
        ASSERT_EQ(out.values.size(), static_cast<std::size_t>(9 * 5 * kind.channels()));
        const auto byte = [&] { return again() % 3 ? again() & 0xFF : 0; };
        for (std::size_t i = 0; i < out.values.size(); ++i) {
            const auto high = byte(), low = byte();
            EXPECT_NEAR(double{out.values[i]}, static_cast<double>(high << 8 | low) / 65535, 1e-7) << i;
        }
    }
}

// A JPEG file of printing inks, cyan 0, magenta 1/2, yellow 1, black 1/4 (Adobe's way: 255 is none), is light that
// paper sends: (1 - ink) (1 - black).
TEST_F(PlainImages, InksBecomeColours) {
    const std::string hex =
        "ffd8ffee000e41646f626500640000000000ffdb004300010101010101010101010101010101010101010101010101010101010101"
        "01010101010101010101010101010101010101010101010101010101010101010101ffc000140800080008044311004d11005911004b11"
        "00ffc40017000003010000000000000000000000000004090a0bffc40014100100000000000000000000000000000000ffda000e0443"
        "004d0059004b00003f00bf80ecff00cfe1ffd9";
    Bytes file;
    for (std::size_t i = 0; i < hex.size(); i += 2)
        file.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
    EXPECT_TRUE(readsAlike(file, "x.jpg", "inks"));
    for (int i = 0; i < 200; ++i) {
        Bytes other = file;
        other[file.size() - 2 - random() % 13] ^= static_cast<std::uint8_t>(1u << random() % 8);
        (void)readsAlike(other, "x.jpg", fmt::format("other inks {}", i));
    }
    FilePixels out;
    std::string refused;
    ASSERT_TRUE(readPlain(file, textureRequest(true), out, refused));
    EXPECT_EQ(out.damage, "");
    ASSERT_EQ(out.channels, 3);
    ASSERT_EQ(out.bytes.size(), 8u * 8 * 3);
    for (std::size_t i = 0; i < out.bytes.size(); i += 3) {
        EXPECT_NEAR(out.bytes[i], .75 * 255, 1.5);
        EXPECT_NEAR(out.bytes[i + 1], .5 * .75 * 255, 1.5);
        EXPECT_NEAR(out.bytes[i + 2], 0, 1.5);
    }
    file.resize(file.size() - 6);
    ASSERT_TRUE(readPlain(file, textureRequest(true), out, refused));
    EXPECT_EQ(out.damage, "Premature end of JPEG file");
}

TEST_F(PlainImages, JpegsAreWhatTheyAreToTheOthers) {
    for (const auto& [width, height] : {std::pair(1, 1), std::pair(17, 9), std::pair(200, 133)}) {
        const std::string what = fmt::format("{} x {}", width, height);
        EXPECT_TRUE(readsAlike(jpegOf(width, height, random), "x.jpg", what)) << what;
    }
}

TEST_F(PlainImages, WhatIsNotInOrderIsForTheOthers) {
    for (const Bytes& whole :
         {pngOf({2, 8}, 20, 20, random), pngOf({3, 4, true}, 20, 20, random), jpegOf(40, 40, random)}) {
        const char* name = whole[0] == 0x89 ? "x.png" : "x.jpg";
        for (std::size_t length = 0; length + 2 < whole.size(); length += 1 + length / 40)
            EXPECT_FALSE(readsAlike(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)), name,
                                    fmt::format("{} bytes", length)));
        int read = 0;
        for (int i = 0; i < 300; ++i) {
            Bytes damaged = whole;
            damaged[random() % damaged.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
            read += readsAlike(damaged, name, fmt::format("damage {}", i));
        }
        if (whole[0] == 0x89) {
            EXPECT_LT(read, 30) << "checksums tell";
        }
    }
}

// Libraries write what they find to the terminal, if they are let: it is the program's to say, with the file and node.
TEST_F(PlainImages, WhatIsDamagedIsToldByTheirCallersAlone) {
    const Bytes whole[] = {pngOf({2, 8}, 20, 20, random), pngOf({2, 16}, 20, 20, random),
                           pngOf({3, 4, true}, 20, 20, random), jpegOf(40, 40, random)};
    ReadRequest request = textureRequest(true);
    request.check = [](int width, int height, int, bool) {
        return std::int64_t{width} * height > 1'000'000 ? "too large" : "";
    };
    testing::internal::CaptureStderr();
    int damaged = 0;
    for (const Bytes& file : whole)
        for (int i = 0; i < 400; ++i) {
            Bytes bytes = file;
            for (int flips = 0; flips < 3; ++flips)
                bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
            if (i % 4 == 0) bytes.resize(bytes.size() - 1 - random() % 100);
            const bool png = file[0] == 0x89;
            if (png) repair(bytes);  // or nobody would look at what is inside
            FilePixels out;
            std::string refused;
            if (readPlain(bytes, request, out, refused) || !refused.empty()) continue;
            damaged += !(*imageFiles())->readMemory(bytes, png ? "x.png" : "x.jpg", request, out).empty();
        }
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    EXPECT_GT(damaged, 300);
}

TEST_F(PlainImages, AJpegThatEndsEarlySaysSo) {
    Bytes file = jpegOf(200, 133, random);
    FilePixels out;
    std::string refused;
    ASSERT_TRUE(readPlain(file, textureRequest(true), out, refused));
    EXPECT_EQ(out.damage, "");
    file.resize(file.size() / 2);
    ASSERT_TRUE(readPlain(file, textureRequest(true), out, refused));
    EXPECT_EQ(out.damage, "Premature end of JPEG file");
}

TEST_F(PlainImages, WhatIsRefusedTakesNoMemory) {
    for (const Bytes& file : {pngOf({2, 8}, 20, 20, random), jpegOf(20, 20, random)}) {
        ReadRequest request = textureRequest(true);
        request.check = [](int width, int height, int layers, bool eightBits) {
            return fmt::format("{} {} {} {}", width, height, layers, eightBits);
        };
        FilePixels out;
        std::string refused;
        EXPECT_FALSE(readPlain(file, request, out, refused));
        EXPECT_EQ(refused, "20 20 1 true");
        EXPECT_TRUE(out.bytes.empty());
    }
    ReadRequest floats = textureRequest(true);
    floats.asFloats = true;
    FilePixels out;
    std::string refused;
    EXPECT_FALSE(readPlain(pngOf({2, 8}, 2, 2, random), floats, out, refused));
    ReadRequest multiplied;
    EXPECT_FALSE(readPlain(pngOf({6, 8}, 2, 2, random), multiplied, out, refused)) << "alpha is to be multiplied";
    EXPECT_TRUE(readPlain(pngOf({2, 8}, 2, 2, random), multiplied, out, refused));
}

/// Empty: this build has no way of its own.
std::string encode(const char* extension, const Sheet& sheet, Bytes& file) {
    const auto encoder = plainEncoder(extension);
    EXPECT_TRUE(encoder) << encoder.error().text;
    if (!encoder || !*encoder) return "none";
    const char* error = (*encoder)(sheet, file);
    return error ? error : "";
}

TEST_F(PlainImages, FilesAreThoseThatTheOthersWrite) {
    for (const char* extension : {".jpg", ".jpeg", ".webp"})
        for (const auto& [width, height] : {std::pair(1, 1), std::pair(17, 9), std::pair(201, 83)})
            for (const bool opaque : {false, true}) {
                if (!opaque && extension == std::string(".webp")) continue;  // below
                Bytes pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 4);
                for (std::uint8_t& byte : pixels) byte = static_cast<std::uint8_t>(random());
                const Sheet sheet{
                    .width = width, .height = height, .bytes = pixels.data(), .values = nullptr, .opaque = opaque};
                Bytes own, others;
                const std::string outcome = encode(extension, sheet, own);
                if (outcome == "none") continue;
                ASSERT_EQ(outcome, "");
                ASSERT_EQ((*imageFiles())->encode(std::string("x") + extension, sheet, others), "");
                EXPECT_TRUE(own == others) << extension << " " << width << " x " << height << " " << opaque << ": "
                                           << own.size() << " and " << others.size() << " bytes";
            }
}

// OpenImageIO divides colours by an alpha that they were not multiplied with.
TEST_F(PlainImages, ClearWebpsKeepTheirColours) {
    Bytes pixels;
    for (int i = 0; i < 32 * 32; ++i)
        for (const std::uint8_t byte : {128, 64, 32, 128}) pixels.push_back(byte);
    const Sheet sheet{.width = 32, .height = 32, .bytes = pixels.data(), .values = nullptr, .opaque = false};
    Bytes file;
    EXPECT_NE((*imageFiles())->encode("x.webp", sheet, file), "");
    const std::string outcome = encode(".webp", sheet, file);
    if (outcome == "none") GTEST_SKIP() << "built without libwebp's headers";
    ASSERT_EQ(outcome, "");
    FilePixels out;
    std::string refused;
    ASSERT_TRUE(readPlain(file, textureRequest(false), out, refused));
    ASSERT_EQ(out.channels, 4);
    ASSERT_EQ(out.bytes.size(), pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_NEAR(out.bytes[i], pixels[i], 1) << i;
    ASSERT_EQ((*imageFiles())->readMemory(file, "x.webp", textureRequest(false), out), "");
    ASSERT_EQ(out.bytes.size(), pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_NEAR(out.bytes[i], pixels[i], 2) << i;
    const ReadRequest multiplied;
    EXPECT_FALSE(readPlain(file, multiplied, out, refused)) << "alpha is to be multiplied";
}

TEST_F(PlainImages, WebpsAreWhatTheyAreToTheOthers) {
    for (const auto& [width, height] : {std::pair(1, 1), std::pair(17, 9), std::pair(120, 83)}) {
        Bytes pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 4), file;
        for (std::uint8_t& byte : pixels) byte = static_cast<std::uint8_t>(random());
        const Sheet sheet{.width = width, .height = height, .bytes = pixels.data(), .values = nullptr, .opaque = true};
        ASSERT_EQ((*imageFiles())->encode("x.webp", sheet, file), "");
        const bool own = readsAlike(file, "x.webp", fmt::format("{} x {}", width, height));
        Bytes ignored;
        EXPECT_EQ(own, encode(".webp", sheet, ignored) == "");
        for (std::size_t length = 0; length + 2 < file.size(); length += 1 + length / 20)
            EXPECT_FALSE(
                readsAlike(Bytes(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(length)), "x.webp", "cut"));
    }
}

// Their libraries would end the process, or write nothing.
TEST_F(PlainImages, WhatTheirFormatsCannotHoldIsToldByThoseThatWrite) {
    const Bytes pixels(std::size_t{4} * 70'000);
    Bytes file;
    const Sheet sheet{.width = 70'000, .height = 1, .bytes = pixels.data(), .values = nullptr, .opaque = true};
    EXPECT_NE(encode(".jpg", sheet, file).find("65500 pixels"), std::string::npos) << encode(".jpg", sheet, file);
    const std::string webp = encode(".webp", sheet, file);
    EXPECT_TRUE(webp == "none" || webp.find("16383 pixels") != std::string::npos) << webp;
}

}  // namespace
}  // namespace rtsg
