// Tiles of pictures in files: they divide a picture without gaps, and joined have its bytes; what is missing is named.
#include <bit>
#include <cstring>
#include <fstream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/renderers/picture_notes.h>
#include <rtsg/renderers/picture_tiles.h>

#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

std::string fileBytes(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

/// Any values, transparent ones and ones without coverage among them, with all that an .exr holds besides.
Picture randomPicture(int width, int height, bool rich, ColorSpace space, std::mt19937& random) {
    std::uniform_real_distribution<float> value(0, 1.1f);
    Picture picture(width, height);
    picture.space = space;
    for (Vec4f& pixel : picture.pixels) {
        const float alpha = random() % 3 == 0 ? 1.0f : random() % 3 == 0 ? 0.0f : value(random);
        pixel = Vec4f(Vec3f(value(random), value(random), value(random)) * (alpha > 0 ? alpha : 1.0f), alpha);
    }
    if (!rich) return picture;
    picture.interval.resize(picture.pixels.size());
    for (Vec3f& interval : picture.interval) interval = Vec3f(value(random));
    picture.layers.push_back({{"Z"}, false, {}}), picture.layers.push_back({{"node.id"}, true, {}});
    picture.layers.push_back({{"P.X", "P.Y", "P.Z"}, false, {}});
    for (PictureLayer& layer : picture.layers)
        for (std::size_t i = 0; i < picture.pixels.size() * layer.channels.size(); ++i)
            layer.values.push_back(layer.integers ? std::bit_cast<float>(static_cast<std::uint32_t>(random()))
                                                  : value(random) * 100);
    picture.notes = {{"cryptomatte/1234567/name", "CryptoObject"}, {"cryptomatte/1234567/manifest", "{}"}, {"a", ""}};
    return picture;
}

Picture cutFrom(const Picture& whole, const PixelRegion& region) {
    Picture part(region.width, region.height);
    part.space = whole.space, part.notes = whole.notes;
    if (!whole.interval.empty()) part.interval.resize(part.pixels.size());
    for (const PictureLayer& layer : whole.layers)
        part.layers.push_back(
            {layer.channels, layer.integers, std::vector<float>(part.pixels.size() * layer.channels.size())});
    for (int y = 0; y < region.height; ++y)
        for (int x = 0; x < region.width; ++x) {
            const auto from = static_cast<std::size_t>((region.top + y) * whole.width + region.left + x),
                       to = static_cast<std::size_t>(y * region.width + x);
            part.pixels[to] = whole.pixels[from];
            if (!part.interval.empty()) part.interval[to] = whole.interval[from];
            for (std::size_t i = 0; i < part.layers.size(); ++i) {
                const std::size_t n = part.layers[i].channels.size();
                std::memcpy(&part.layers[i].values[to * n], &whole.layers[i].values[from * n], n * sizeof(float));
            }
        }
    return part;
}

TEST(PictureNotes, AreInTheFile) {
    const test::TempFolder folder;
    std::mt19937 random(3);
    for (const char* name : {"a.png", "a.exr"}) {
        Picture picture = randomPicture(40, 20, false, ColorSpace::display, random);
        ASSERT_TRUE(writePicture(picture, folder / "plain.png"));
        picture.notes = {{"rtsg-state", "12 ab"}, {"rtsg-options", "size=\xc3\xa4,b="}, {"none", ""}};
        ASSERT_TRUE(writePicture(picture, folder / name));
        const auto notes = readPictureNotes(folder / name);
        ASSERT_TRUE(notes);
        for (const auto& note : picture.notes) EXPECT_THAT(*notes, testing::Contains(note)) << name;
        const auto again = readWrittenPicture(folder / name);
        ASSERT_TRUE(again) << again.error().format();
        EXPECT_EQ(again->notes, picture.notes);
        ASSERT_TRUE(readPicture(folder / name)) << "other readers take the file";
    }
    const std::string with = fileBytes(folder / "a.png");
    EXPECT_EQ(fileBytes(folder / "plain.png").find("iTXt"), std::string::npos);
    // Damage leads nowhere.
    for (std::size_t length = 0; length < with.size(); ++length) {
        std::ofstream(folder / "cut.png", std::ios::binary) << with.substr(0, length);
        ASSERT_TRUE(readPictureNotes(folder / "cut.png"));
    }
    for (const char* file : {"a.png", "a.exr"})
        for (int round = 0; round < 300; ++round) {
            std::string damaged = fileBytes(folder / file);
            for (int i = 0; i < 4; ++i)
                damaged[random() % std::min<std::size_t>(damaged.size(), 500)] = static_cast<char>(random());
            std::ofstream(folder / (std::string("damaged") + file), std::ios::binary) << damaged;
            ASSERT_TRUE(readPictureNotes(folder / (std::string("damaged") + file)));
        }
    EXPECT_FALSE(readPictureNotes(folder / "none.png"));
    EXPECT_TRUE(readPictureNotes(folder / "none.jpg")->empty());
}

TEST(PictureTiles, DivideAPictureBetweenBlocks) {
    std::mt19937 random(7);
    for (int round = 0; round < 200; ++round) {
        const int width = 1 + static_cast<int>(random() % 400), height = 1 + static_cast<int>(random() % 400);
        const int columns = 1 + static_cast<int>(random() % 9), rows = 1 + static_cast<int>(random() % 9);
        const bool fits = columns <= (width + 15) / 16 && rows <= (height + 15) / 16;
        int area = 0;
        bool any = true;
        for (int y = 0; y < rows; ++y)
            for (int x = 0; x < columns; ++x) {
                const PixelRegion region = PictureTile{x, y, columns, rows}.in(width, height);
                any = any && !region.empty();
                if (region.empty()) continue;
                EXPECT_EQ(region.left % 16, 0);
                EXPECT_EQ(region.top % 16, 0);
                EXPECT_LE(region.left + region.width, width);
                area += region.width * region.height;
                if (x > 0) {
                    const PixelRegion left = PictureTile{x - 1, y, columns, rows}.in(width, height);
                    if (!left.empty()) {
                        EXPECT_EQ(left.left + left.width, region.left);
                    }
                }
            }
        EXPECT_EQ(any, fits) << width << ' ' << height << ' ' << columns << ' ' << rows;
        if (any) {
            EXPECT_EQ(area, width * height);
        }
    }
}

TEST(PictureTiles, JoinedHaveTheBytesOfTheWhole) {
    const test::TempFolder folder;
    std::mt19937 random(11);
    for (const char* extension : {".png", ".exr"})
        for (const bool rich : {false, true})
            for (const ColorSpace space : {ColorSpace::display, ColorSpace::linear}) {
                const Picture picture = randomPicture(70, 53, rich, space, random);
                const std::filesystem::path whole = folder / ("whole" + std::string(extension)),
                                            joined = folder / ("joined" + std::string(extension));
                ASSERT_TRUE(writePicture(picture, whole));
                for (int y = 0; y < 2; ++y)
                    for (int x = 0; x < 3; ++x) {
                        const PictureTile tile{x, y, 3, 2};
                        ASSERT_TRUE(writePicture(cutFrom(picture, tile.in(70, 53)), tile.of(joined)));
                    }
                for (int again = 0; again < 2; ++again) {
                    const auto missing = joinTiles(joined, 3, 2);
                    ASSERT_TRUE(missing) << missing.error().format();
                    EXPECT_TRUE(missing->empty());
                    EXPECT_TRUE(fileBytes(whole) == fileBytes(joined)) << extension << rich << int(space);
                }
            }
}

/// Every colour under every coverage keeps its bytes.
TEST(PictureTiles, BytesOfAPngStay) {
    const test::TempFolder folder;
    Picture picture(256, 256);
    picture.space = ColorSpace::display;
    for (int a = 0; a < 256; ++a)
        for (int v = 0; v < 256; ++v) {
            const float alpha = static_cast<float>(a) / 255, value = static_cast<float>(v) / 255;
            picture.at(v, a) = Vec4f(Vec3f(value, 1 - value, value * value) * (a > 0 ? alpha : 1.0f), alpha);
        }
    ASSERT_TRUE(writePicture(picture, folder / "a.png"));
    const auto read = readWrittenPicture(folder / "a.png");
    ASSERT_TRUE(read) << read.error().format();
    EXPECT_EQ(toSrgb8(*read), toSrgb8(picture));
    ASSERT_TRUE(writePicture(*read, folder / "b.png"));
    EXPECT_TRUE(fileBytes(folder / "a.png") == fileBytes(folder / "b.png"));
}

TEST(PictureTiles, WhatIsMissingOrDoesNotFitIsNamed) {
    const test::TempFolder folder;
    const std::filesystem::path file = folder / "a.png";
    const auto put = [&](int x, int y, int width, int height) {
        EXPECT_TRUE(writePicture(Picture(width, height, Vec4f(1)), PictureTile{x, y, 2, 2}.of(file)));
    };
    put(0, 0, 32, 16), put(1, 1, 32, 16);
    const auto lacks = joinTiles(file, 2, 2);
    ASSERT_TRUE(lacks);
    EXPECT_THAT(*lacks, testing::ElementsAre(PictureTile{1, 0, 2, 2}, PictureTile{0, 1, 2, 2}));
    EXPECT_FALSE(std::filesystem::exists(file));
    put(1, 0, 32, 16), put(0, 1, 48, 16);
    const auto overlaps = joinTiles(file, 2, 2);
    ASSERT_FALSE(overlaps);
    EXPECT_THAT(overlaps.error().format(), HasSubstr("a.tile-0-1-of-2-2.png"));
    EXPECT_THAT(overlaps.error().format(), HasSubstr("gaps or overlaps"));
    EXPECT_FALSE(std::filesystem::exists(file));
    std::ofstream(PictureTile{0, 1, 2, 2}.of(file)) << "no picture";
    EXPECT_FALSE(joinTiles(file, 2, 2));
    put(0, 1, 32, 16);
    EXPECT_TRUE(joinTiles(file, 2, 2));
    EXPECT_FALSE(joinTiles(folder / "a.jpg", 2, 2));
}

/// Every byte of an .exr that is cut or changed leads to an error or a picture, never further.
TEST(PictureTiles, DamagedFilesAreRefused) {
    const test::TempFolder folder;
    std::mt19937 random(3);
    const Picture picture = randomPicture(20, 17, true, ColorSpace::linear, random);
    for (const char* name : {"a.exr", "a.png"}) {
        ASSERT_TRUE(writePicture(picture, folder / name));
        const std::string good = fileBytes(folder / name);
        for (int round = 0; round < 300; ++round) {
            std::string bad = good;
            if (round % 3 == 0)
                bad.resize(random() % bad.size());
            else
                for (unsigned i = 0; i <= random() % 4; ++i) bad[random() % bad.size()] = static_cast<char>(random());
            std::ofstream(folder / name, std::ios::binary) << bad;
            const auto read = readWrittenPicture(folder / name);
            if (round % 3 == 0) {
                EXPECT_FALSE(read) << bad.size() << " of " << good.size();
            }
        }
    }
}

}  // namespace
}  // namespace rtsg
