// The letters of maps: digits, and those of figures' names and units.
#include "map_text.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace rtsg {
namespace {

/// Rows from the top; of each the five lowest bits, the left dot first.
struct MapGlyph {
    char letter;
    std::array<std::uint8_t, 7> rows;
};
constexpr MapGlyph kMapGlyphs[] = {
    {',', {0, 0, 0, 0, 12, 4, 8}},       {'-', {0, 0, 0, 31, 0, 0, 0}},       {'.', {0, 0, 0, 0, 0, 12, 12}},
    {'0', {14, 17, 19, 21, 25, 17, 14}}, {'1', {4, 12, 4, 4, 4, 4, 14}},      {'2', {14, 17, 1, 6, 8, 16, 31}},
    {'3', {30, 1, 1, 14, 1, 1, 30}},     {'4', {2, 6, 10, 18, 31, 2, 2}},     {'5', {31, 16, 30, 1, 1, 17, 14}},
    {'6', {6, 8, 16, 30, 17, 17, 14}},   {'7', {31, 1, 2, 4, 4, 8, 8}},       {'8', {14, 17, 17, 14, 17, 17, 14}},
    {'9', {14, 17, 17, 15, 1, 2, 12}},   {'A', {14, 17, 17, 31, 17, 17, 17}}, {'B', {30, 17, 17, 30, 17, 17, 30}},
    {'C', {14, 17, 16, 16, 16, 17, 14}}, {'D', {30, 17, 17, 17, 17, 17, 30}}, {'E', {31, 16, 16, 30, 16, 16, 31}},
    {'F', {31, 16, 16, 30, 16, 16, 16}}, {'G', {14, 17, 16, 23, 17, 17, 15}}, {'H', {17, 17, 17, 31, 17, 17, 17}},
    {'I', {14, 4, 4, 4, 4, 4, 14}},      {'L', {16, 16, 16, 16, 16, 16, 31}}, {'S', {15, 16, 16, 14, 1, 1, 30}},
    {'T', {31, 4, 4, 4, 4, 4, 4}},       {'a', {0, 0, 14, 1, 15, 17, 15}},    {'d', {1, 1, 15, 17, 17, 17, 15}},
    {'e', {0, 0, 14, 17, 31, 16, 14}},   {'f', {6, 9, 8, 28, 8, 8, 8}},       {'h', {16, 16, 30, 17, 17, 17, 17}},
    {'i', {4, 0, 12, 4, 4, 4, 14}},      {'l', {12, 4, 4, 4, 4, 4, 14}},      {'m', {0, 0, 26, 21, 21, 21, 21}},
    {'n', {0, 0, 30, 17, 17, 17, 17}},   {'o', {0, 0, 14, 17, 17, 17, 14}},   {'r', {0, 0, 22, 25, 16, 16, 16}},
    {'s', {0, 0, 15, 16, 14, 1, 30}},    {'t', {8, 8, 28, 8, 8, 9, 6}},       {'u', {0, 0, 17, 17, 17, 17, 15}},
    {'v', {0, 0, 17, 17, 17, 10, 4}},    {'y', {0, 0, 17, 17, 15, 1, 14}},    {'z', {0, 0, 31, 2, 4, 8, 31}}};

}  // namespace

void drawMapText(Picture& picture, int x, int y, std::string_view text, const Vec4f& color) {
    for (const char letter : text) {
        const auto glyph = std::ranges::find(kMapGlyphs, letter, &MapGlyph::letter);
        if (glyph != std::end(kMapGlyphs))
            for (int i = 0; i < 7 * 5 * kMapDot * kMapDot; ++i) {
                const int column = i % (5 * kMapDot), row = i / (5 * kMapDot);
                const bool dot =
                    (glyph->rows[static_cast<std::size_t>(row / kMapDot)] >> (4 - column / kMapDot) & 1) != 0;
                const int px = x + column, py = y + row;
                if (dot && px >= 0 && py >= 0 && px < picture.width && py < picture.height) picture.at(px, py) = color;
            }
        x += kMapLetter;
    }
}

}  // namespace rtsg
