// Pictures: colour curves, tone mapping, and files as an independent reader finds them.
#include <rtsg/renderers/picture.h>
#include <chrono>
#include <fstream>

#include <cmath>
#include <filesystem>
#include <sstream>

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

namespace rtsg {
namespace {

std::filesystem::path temporary(const std::string& name) {
    return std::filesystem::temp_directory_path() / name;
}

TEST(Picture, SrgbCurveAndItsInverse) {
    EXPECT_NEAR(srgbFromLinear(0.5f), 0.735357, 1e-6);
    EXPECT_NEAR(srgbFromLinear(0.001f), 0.01292, 1e-7);
    EXPECT_NEAR(srgbFromLinear(1), 1, 1e-6);
    for (int i = 0; i <= 255; ++i) {
        const float encoded = static_cast<float>(i) / 255;
        EXPECT_NEAR(srgbFromLinear(linearFromSrgb(encoded)), encoded, 1e-6);
    }
}

TEST(Picture, BeyondWhiteBothSpacesCountMultiplesOfIt) {
    for (const float x : {1.0f, 1.5f, 8.0f}) {
        EXPECT_FLOAT_EQ(srgbFromLinear(x), x);
        EXPECT_FLOAT_EQ(linearFromSrgb(x), x);
    }
}

TEST(Picture, DisplayValuesAreWrittenAsTheyAre) {
    Picture picture(2, 1);
    picture.space = ColorSpace::display;
    picture.pixels = {{0.9f, 0.4f, 0.1f, 1}, {0.75f, 0.05f, 1, 0.5f}};  // the second: 1.5 .1 2 at half coverage
    EXPECT_EQ(toSrgb8(picture), (std::vector<std::uint8_t>{230, 102, 26, 255, 255, 26, 255, 128}));
    const Picture light = toLinear(picture);
    EXPECT_EQ(light.space, ColorSpace::linear);
    EXPECT_NEAR(light.at(0, 0).r, 0.787412, 1e-6);
    EXPECT_NEAR(light.at(1, 0).r, 0.5 * 1.5, 1e-6);
    EXPECT_NEAR(light.at(1, 0).g, 0.5 * 0.010023, 1e-6);
    EXPECT_FALSE(compare(picture, light)) << "of two spaces";
    Picture wrong(1, 1, Vec4f(NAN, INFINITY, -1, 1));
    wrong.space = ColorSpace::display;
    EXPECT_EQ(toSrgb8(wrong), (std::vector<std::uint8_t>{0, 0, 0, 255}));
}

TEST(Picture, ToneMapLeavesDisplayableColorsAlone) {
    const ToneMap map;
    EXPECT_EQ(map.apply({0.2f, 1.0f, 0.0f}), Vec3f(0.2f, 1.0f, 0.0f));
    const Vec3f bright = map.apply({4, 2, 0});
    EXPECT_FLOAT_EQ(bright.r, 1);
    EXPECT_GT(bright.r, bright.g);
    EXPECT_GT(bright.g, bright.b);
    EXPECT_EQ(map.apply({NAN, -1, 0.5f}), Vec3f(0, 0, 0.5f));
    EXPECT_EQ((ToneMap{2}.apply({0.25f, 0.1f, 0})), Vec3f(0.5f, 0.2f, 0));
}

TEST(Picture, ExrKeepsTheNumbersBitForBit) {
    Picture picture(3, 2, Vec4f(0, 0, 0, 1));
    picture.at(0, 0) = {1e-7f, 12345.678f, 0.1f, 1};
    picture.at(2, 1) = {100, 0, 3, 0.25f};
    const auto file = temporary("rtsg_picture_exact.exr");
    ASSERT_TRUE(writePicture(picture, file));
    const auto back = readPicture(file);
    std::filesystem::remove(file);
    ASSERT_TRUE(back) << back.error().format();
    EXPECT_EQ(back->pixels, picture.pixels);
}

TEST(Picture, AlphaIsMultipliedInBehindDecoding) {
    Picture picture(2, 1, Vec4f(0, 0, 0, 1));
    picture.at(0, 0) = {.25f, .1f, 0, .5f};
    for (const char* name : {"rtsg_alpha.png", "rtsg_alpha.tif", "rtsg_alpha.exr"}) {
        const auto file = temporary(name);
        ASSERT_TRUE(writePicture(picture, file));
        const auto back = readPicture(file);
        std::filesystem::remove(file);
        ASSERT_TRUE(back) << back.error().format();
        for (int c = 0; c < 4; ++c) EXPECT_NEAR(back->at(0, 0)[c], picture.at(0, 0)[c], .004) << name;
    }
}

TEST(Picture, PngIsSrgbEncodedTopRowFirst) {
    Picture picture(2, 2, Vec4f(0, 0, 0, 1));
    picture.at(1, 0) = {0.5f, 0.2f, 7, 1};
    const auto file = temporary("rtsg_picture.png");
    ASSERT_TRUE(writePicture(picture, file));
    auto input = OIIO::ImageInput::open(file.string());
    ASSERT_TRUE(input);
    std::vector<std::uint8_t> bytes(2 * 2 * 3);
    EXPECT_EQ(input->spec().nchannels, 3) << "opaque: no alpha channel";
    ASSERT_TRUE(input->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, bytes.data()));
    std::filesystem::remove(file);
    EXPECT_EQ(bytes[0], 0);
    EXPECT_EQ(bytes[5], 255) << "brighter than white stays white";
    // Nor where what is missing of an alpha is lost in the file.
    picture.at(0, 1).a = 1 - 1e-6f;
    ASSERT_TRUE(writePicture(picture, file));
    input = OIIO::ImageInput::open(file.string());
    ASSERT_TRUE(input);
    EXPECT_EQ(input->spec().nchannels, 3);
    picture.at(0, 1).a = 1 - 1 / 200.0f;
    ASSERT_TRUE(writePicture(picture, file));
    input = OIIO::ImageInput::open(file.string());
    ASSERT_TRUE(input);
    EXPECT_EQ(input->spec().nchannels, 4);
    std::filesystem::remove(file);
    Picture half(1, 1, Vec4f(0.5f, 0.2f, 0.04f, 1));
    const auto encoded = toSrgb8(half);
    EXPECT_EQ(encoded[0], 188);
    EXPECT_EQ(encoded[1], 124);
    EXPECT_EQ(encoded[2], 56);
    EXPECT_EQ(encoded[3], 255);
}

TEST(Picture, AnimatedGifHoldsAllFrames) {
    std::vector<Picture> frames;
    for (int i = 0; i < 5; ++i) frames.emplace_back(8, 8, Vec4f(i / 4.0f, 0, 0, 1));
    const auto file = temporary("rtsg_picture_animation.gif");
    const auto written = writeAnimation(frames, file, 12.5);
    ASSERT_TRUE(written) << written.error().format();
    auto input = OIIO::ImageInput::open(file.string());
    ASSERT_TRUE(input);
    int count = 0;
    while (input->seek_subimage(count, 0)) ++count;
    std::filesystem::remove(file);
    EXPECT_EQ(count, 5);
    frames.emplace_back(8, 9);
    EXPECT_FALSE(writeAnimation(frames, file, 12.5)) << "all of one size";
    EXPECT_FALSE(writeAnimation({}, file, 12.5));
    EXPECT_FALSE(std::filesystem::exists(file));
}

TEST(Picture, EveryKindThatIsNamedIsWrittenAndReadBack) {
    // Two halves, so that a file upside down shows.
    Picture picture(16, 16, Vec4f(0.1f, 0.2f, 0.3f, 1));
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 16; ++x) picture.at(x, y) = Vec4f(0.9f, 0.8f, 0.7f, 1);
    const auto known = checkPictureName("a.mp3");
    ASSERT_FALSE(known);
    std::istringstream names(known.error().text.substr(known.error().text.find(':') + 1));
    int kinds = 0;
    for (std::string extension; names >> extension; ++kinds) {
        const auto file = temporary("rtsg_kind" + extension);
        const auto written = writePicture(picture, file);
        ASSERT_TRUE(written) << written.error().format();
        const auto back = readPicture(file);
        ASSERT_TRUE(back) << back.error().format();
        const auto difference = compare(picture, *back);
        ASSERT_TRUE(difference) << extension;
        EXPECT_LT(difference->rmse, 0.06) << extension;
        EXPECT_GT(back->at(8, 2).r, back->at(8, 13).r) << extension;
        if (extension == ".pfm") {
            EXPECT_EQ(difference->maximum, 0);
        }
        // Today's year as formats have dates: files of two runs must be equal.
        std::ifstream in(file, std::ios::binary);
        const std::string content{std::istreambuf_iterator<char>(in), {}};
        const std::chrono::year_month_day today{
            std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now())};
        for (const char* between : {":", "-"})
            EXPECT_EQ(content.find(fmt::format("{}{}", static_cast<int>(today.year()), between)), std::string::npos)
                << extension;
        std::filesystem::remove(file);
    }
    EXPECT_GE(kinds, 13);
}

TEST(Picture, AFullDiskIsAnErrorForEveryKind) {
    // A name of that kind for the device that never has room.
    const Picture picture(8, 8, Vec4f(0.25f, 0.5f, 0.75f, 1));
    for (const char* extension : {".png", ".gif", ".exr", ".jpg", ".tif", ".pfm"}) {
        const auto link = temporary(std::string("rtsg_full") + extension);
        std::filesystem::remove(link);
        std::filesystem::create_symlink("/dev/full", link);
        const auto written = writePicture(picture, link);
        std::filesystem::remove(link);
        ASSERT_FALSE(written) << extension;
        EXPECT_NE(written.error().text.find("No space left"), std::string::npos) << written.error().text;
    }
}

TEST(Picture, WhatCannotBeWrittenIsAnError) {
    const Picture picture(2, 2);
    EXPECT_FALSE(writePicture(picture, temporary("rtsg.nosuchformat")));
    EXPECT_FALSE(writePicture(picture, "/nowhere/at/all/picture.png"));
    EXPECT_FALSE(writePicture(Picture(), temporary("rtsg_empty.png")));
    EXPECT_FALSE(readPicture("/nowhere/at/all/picture.png"));
    const std::vector<Picture> unequal{Picture(2, 2), Picture(3, 2)};
    EXPECT_FALSE(writeAnimation(unequal, temporary("rtsg_unequal.gif"), 10));
    EXPECT_FALSE(writeAnimation({}, temporary("rtsg_none.gif"), 10));
}

TEST(Picture, DamagedPngFilesAreNamedWithTheirByteAndNothingElseIsPrinted) {
    const auto whole = temporary("rtsg_whole.png"), damaged = temporary("rtsg_damaged.png");
    Picture picture(64, 64);
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x)
            picture.at(x, y) = {std::abs(std::sin(x * y)), std::abs(std::cos(x + y * y)), 0, 1};
    ASSERT_TRUE(writePicture(picture, whole));
    std::ostringstream read;
    read << std::ifstream(whole, std::ios::binary).rdbuf();
    const std::string bytes = read.str();
    const std::size_t pixels = bytes.find("IDAT") - 4, end = bytes.rfind("IEND") - 4;
    const auto errorOf = [&](const std::string& contents) {
        std::ofstream(damaged, std::ios::binary) << contents;
        testing::internal::CaptureStderr();
        const auto result = readPicture(damaged);
        EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
        return result ? std::string() : result.error().text;
    };
    EXPECT_EQ(errorOf(bytes), "");
    EXPECT_EQ(errorOf(bytes.substr(0, end)), "") << "all pixels are there";
    std::string changed = bytes;
    changed[pixels + 600] ^= 0x55;
    EXPECT_NE(errorOf(changed).find("IDAT chunk from byte " + std::to_string(pixels)), std::string::npos);
    changed = bytes;
    changed[17] ^= 0x01;  // the width
    EXPECT_NE(errorOf(changed).find("IHDR chunk from byte 8"), std::string::npos);
    for (const std::size_t length : {std::size_t{8}, std::size_t{20}, pixels + 3, pixels + 700})
        EXPECT_NE(errorOf(bytes.substr(0, length)).find("at its byte " + std::to_string(length)), std::string::npos)
            << length;
}

TEST(Picture, ComparisonFindsTheWorstPixel) {
    Picture a(4, 3), b(4, 3);
    b.at(2, 1).g = 0.6f;
    b.at(0, 0).r = 0.3f;
    const auto difference = compare(a, b);
    ASSERT_TRUE(difference);
    EXPECT_FLOAT_EQ(static_cast<float>(difference->maximum), 0.6f);
    EXPECT_EQ(difference->worstX, 2);
    EXPECT_EQ(difference->worstY, 1);
    EXPECT_NEAR(difference->rmse, std::sqrt((0.36 + 0.09) / 36), 1e-6);
    EXPECT_FALSE(compare(a, Picture(3, 3)));
    b.at(1, 1).b = NAN;
    EXPECT_EQ(compare(a, b)->worstX, 1) << "NaN is worst";
}

TEST(Picture, FilmsHaveEvenSidesAndNotTooManyPixels) {
    EXPECT_TRUE(checkPictureSize("a.mp4", 16384, 2));
    for (const auto& [width, height] : {std::pair(33, 32), std::pair(32, 33), std::pair(16386, 2), std::pair(0, 2)})
        EXPECT_FALSE(checkPictureSize("a.MP4", width, height)) << width << " x " << height;
}

// Whatever lies in the interval of display values lies in that of their light.
TEST(Picture, IntervalsAreDecodedWithTheirColours) {
    for (const float alpha : {1.0f, .5f}) {
        Picture shown(4, 1);
        shown.space = ColorSpace::display;
        shown.interval.resize(4);
        const float colors[] = {.02f, .5f, .98f, 1.05f}, off[] = {.01f, .1f, .03f, .1f};
        for (std::size_t i = 0; i < 4; ++i)
            shown.pixels[i] = Vec4f(Vec3f(colors[i] * alpha), alpha), shown.interval[i] = Vec3f(off[i] * alpha);
        const Picture light = toLinear(shown);
        ASSERT_EQ(light.interval.size(), 4u);
        for (std::size_t i = 0; i < 4; ++i) {
            double farthest = 0;
            for (int step = -10; step <= 10; ++step) {
                const float value = linearFromSrgb(colors[i] + off[i] * static_cast<float>(step) / 10) * alpha;
                farthest = std::max(farthest, std::abs(double{value} - light.pixels[i].r));
            }
            EXPECT_NEAR(light.interval[i].r, farthest, 1e-6) << i;
        }
    }
}

// libjpeg ends the process where a picture is too large for it; GIFs were written with a width of nothing.
TEST(Picture, LargerThanTheirFormatAreRefused) {
    const std::filesystem::path folder = temporary("rtsg_too_large");
    std::filesystem::create_directories(folder);
    for (const auto& [name, width, height, fits] : {std::tuple{"a.jpg", 65501, 1, false},
                                                    {"a.JPEG", 1, 70000, false},
                                                    {"a.gif", 65536, 1, false},
                                                    {"b.gif", 1, 65536, false},
                                                    {"b.jpg", 65500, 1, true},
                                                    {"c.gif", 65535, 1, true},
                                                    {"a.webp", 16384, 1, false},
                                                    {"b.webp", 16383, 1, true},
                                                    {"a.tga", 1, 65536, false},
                                                    {"a.png", 70000, 1, true}}) {
        EXPECT_EQ(static_cast<bool>(checkPictureSize(folder / name, width, height)), fits) << name;
        const auto written = writePicture(Picture(width, height), folder / name);
        EXPECT_EQ(static_cast<bool>(written), fits) << name << " " << (written ? "" : written.error().format());
        if (!written) {
            EXPECT_NE(written.error().text.find(" a side"), std::string::npos) << written.error().text;
        }
        EXPECT_EQ(std::filesystem::exists(folder / name), fits) << name;
    }
    std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace rtsg
