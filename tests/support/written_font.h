// A font of one letter, an "A" that is a rectangle, whose numbers the tests choose; as the bytes of a TrueType file.
//
// Source: ISO/IEC 14496-22 (Open Font Format): 4.5 (directory), 5.2 and 5.3 (tables).
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace rtsg::test {

struct WrittenFont {
    int unitsPerEm = 1000;
    int left = 100, bottom = 0, right = 600, top = 700;  // of the letter
    int advance = 800, ascent = 900, descent = 300;

    std::string bytes() const {
        const std::vector<std::pair<std::string, std::string>> tables{{"cmap", characters()},
                                                                      {"glyf", glyph() + glyph()},
                                                                      {"head", head()},
                                                                      {"hhea", horizontalHead()},
                                                                      {"hmtx", words({advance, left, advance, left})},
                                                                      {"loca", words({0, size() / 2, size()})},
                                                                      {"maxp", profile()}};
        std::string directory = number(0x00010000, 4) + words({static_cast<int>(tables.size()), 64, 2, 48}), content;
        const std::size_t start = directory.size() + 16 * tables.size();
        for (const auto& [tag, table] : tables) {
            directory += tag + number(0, 4) + number(start + content.size(), 4) + number(table.size(), 4);
            content += table;
            content.resize((content.size() + 3) / 4 * 4);
        }
        return directory + content;
    }

  private:
    static std::string number(std::uint64_t value, int size) {
        std::string result;
        for (int i = size - 1; i >= 0; --i) result += static_cast<char>(value >> 8 * i & 255);
        return result;
    }
    static std::string words(const std::vector<int>& values) {
        std::string result;
        for (const int value : values) result += number(static_cast<std::uint16_t>(value), 2);
        return result;
    }
    int size() const { return static_cast<int>(glyph().size()); }
    /// One contour of four points on the curve: right, up, and so on clockwise, as TrueType fills.
    std::string glyph() const {
        std::string result = words({1, left, bottom, right, top, 3, 0});
        result += std::string(4, '\1');
        result += words({left, 0, right - left, 0}) + words({bottom, top - bottom, 0, bottom - top});
        result.resize((result.size() + 3) / 4 * 4);
        return result;
    }
    /// Format 4: the letter A alone.
    static std::string characters() {
        return words({0, 1, 3, 1}) + number(12, 4) +
               words({4, 32, 0, 4, 4, 1, 0, 65, 0xFFFF, 0, 65, 0xFFFF, 1 - 65, 1, 0, 0});
    }
    std::string head() const {
        return number(0x00010000, 4) + number(0x00010000, 4) + number(0, 4) + number(0x5F0F3CF5, 4) +
               words({0, unitsPerEm}) + number(0, 8) + number(0, 8) + words({left, bottom, right, top, 0, 8, 2, 0, 0});
    }
    std::string horizontalHead() const {
        return number(0x00010000, 4) + words({ascent, -descent, 0, advance, left, 0, right, 1, 0, 0, 0, 0, 0, 0, 0, 2});
    }
    static std::string profile() { return number(0x00010000, 4) + words({2, 4, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0}); }
};

/// The font as a url.
inline std::string fontUrl(const std::string& bytes) {
    constexpr char digits[] = "0123456789ABCDEF";
    std::string url = "data:font/ttf,";
    for (const char c : bytes) {
        const auto byte = static_cast<unsigned char>(c);
        url += '%', url += digits[byte >> 4], url += digits[byte & 15];
    }
    return url;
}

}  // namespace rtsg::test
