// Edges of coarse pictures become straight, and all else stays as it is.
#include "picture/clean_edges.h"

#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

constexpr int kSide = 48;
using Bytes = std::vector<std::uint8_t>;
/// Whether a place of the picture lies in the bright part.
using Inside = std::function<bool(double x, double y)>;

Bytes pictureOf(const Inside& inside) {
    Bytes pixels(4 * kSide * kSide, 255);
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x)
            for (int c = 0; c < 3; ++c)
                pixels[std::size_t(4 * (y * kSide + x) + c)] = inside(x + .5, y + .5) ? std::uint8_t(200 + c) : 40;
    return pixels;
}
/// Root mean square, beside what each pixel would show by its area.
double errorOf(const Bytes& pixels, const Inside& inside) {
    double sum = 0;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            double fraction = 0;
            for (int i = 0; i < 256; ++i) fraction += inside(x + (i % 16 + .5) / 16, y + (i / 16 + .5) / 16) / 256.;
            const double off = pixels[std::size_t(4 * (y * kSide + x))] - (40 + 160 * fraction);
            sum += off * off;
        }
    return std::sqrt(sum / (kSide * kSide));
}

TEST(CleanEdges, SlantedEdgesAreStraight) {
    for (const double slope : {.07, .15, .25, .33, -.1, -.3})
        for (const bool isSteep : {false, true})
            for (const bool isDark : {false, true}) {
                SCOPED_TRACE(testing::Message() << slope << isSteep << isDark);
                const Inside inside = [&](double x, double y) {
                    return ((isSteep ? x < 20.3 + slope * y : y < 20.3 + slope * x)) != isDark;
                };
                Bytes pixels = pictureOf(inside);
                const double before = errorOf(pixels, inside);
                cleanEdges(pixels, kSide, kSide);
                EXPECT_LT(errorOf(pixels, inside), before / 1.8);
            }
}

TEST(CleanEdges, WhatIsNoSlantedEdgeStays) {
    for (const Inside& inside : {Inside([](double x, double) { return x < 20; }),  // columns
                                 Inside([](double, double y) { return y < 20; }),  // rows
                                 Inside([](double x, double y) { return int(x) == 7 && int(y) == 7; }),
                                 Inside([](double x, double y) { return int(x / 4 + y) % 2 == 0; })}) {  // a texture
        const Bytes pixels = pictureOf(inside);
        Bytes cleaned = pixels;
        cleanEdges(cleaned, kSide, kSide);
        EXPECT_EQ(cleaned, pixels);
    }
    // Small differences are no edges: a gradient of colours.
    Bytes slope(4 * kSide * kSide);
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = std::uint8_t(i / 4 % kSide + i / 4 / kSide);
    const Bytes before = slope;
    cleanEdges(slope, kSide, kSide);
    EXPECT_EQ(slope, before);
}

TEST(CleanEdges, AnythingOfAnySizeIsTaken) {
    std::mt19937 random(5);
    for (const auto& [width, height] : {std::pair{1, 1}, {2, 9}, {9, 2}, {3, 3}, {4, 61}, {61, 4}}) {
        Bytes pixels(std::size_t(4 * width * height));
        for (std::uint8_t& one : pixels) one = random() % 2 ? 255 : 0;
        const Bytes before = pixels;
        cleanEdges(pixels, width, height);
        for (std::size_t i = 3; i < pixels.size(); i += 4) EXPECT_EQ(pixels[i], before[i]);
    }
}

}  // namespace
}  // namespace rtsg
