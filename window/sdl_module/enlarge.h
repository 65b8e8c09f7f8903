// Enlarges a picture into a window's rows, with interpolation between the middles of pixels.
//
// Each row of the picture is stretched once; rows of the window are mixtures of two of these, in bytes side by side,
// which compilers turn into vector instructions. Threading: a pure function.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace rtsg {

struct Pixels {
    const std::uint8_t* bytes = nullptr;  // four a pixel, row by row
    int width = 0, height = 0;
};

namespace enlarging {

/// The two neighbours of a position, and the weight of the second, of 256.
struct Between {
    int first = 0, second = 0;
    std::uint16_t weight = 0;
};
inline Between between(int at, int of, int from) {
    constexpr double kOne = 256;
    const double position = std::clamp((at + .5) * from / of - .5, 0., from - 1.);
    const int first = static_cast<int>(position);
    return {first, std::min(first + 1, from - 1), static_cast<std::uint16_t>((position - first) * kOne)};
}

inline std::uint8_t mixed(std::uint8_t a, std::uint8_t b, std::uint16_t weight) {
    return static_cast<std::uint8_t>((a * (256 - weight) + b * weight + 128) >> 8);
}

inline void stretch(const Pixels& from, int row, const std::vector<Between>& columns, std::uint8_t* to) {
    const std::uint8_t* const line = from.bytes + 4 * static_cast<std::ptrdiff_t>(row) * from.width;
    for (const Between& column : columns) {
        const std::uint8_t* const a = line + 4 * static_cast<std::ptrdiff_t>(column.first);
        const std::uint8_t* const b = line + 4 * static_cast<std::ptrdiff_t>(column.second);
        for (int i = 0; i < 4; ++i) to[i] = mixed(a[i], b[i], column.weight);
        to += 4;
    }
}

}  // namespace enlarging

/// `stride`: bytes from a row of `to` to the next.
inline void enlarge(const Pixels& from, std::uint8_t* to, int width, int height, std::ptrdiff_t stride) {
    using namespace enlarging;
    std::vector<Between> columns(static_cast<std::size_t>(width));
    for (int x = 0; x < width; ++x) columns[static_cast<std::size_t>(x)] = between(x, width, from.width);
    const std::size_t bytes = 4 * static_cast<std::size_t>(width);
    std::vector<std::uint8_t> above(bytes), below(bytes);
    int aboveIs = -1, belowIs = -1;
    for (int y = 0; y < height; ++y) {
        const Between row = between(y, height, from.height);
        if (aboveIs != row.first) {
            if (belowIs == row.first)
                above.swap(below), std::swap(aboveIs, belowIs);
            else
                stretch(from, row.first, columns, above.data());
            aboveIs = row.first;
        }
        if (belowIs != row.second) {
            stretch(from, row.second, columns, below.data());
            belowIs = row.second;
        }
        const std::uint8_t *const a = above.data(), *const b = below.data();
        std::uint8_t* const line = to + y * stride;
        for (std::size_t i = 0; i < bytes; ++i) line[i] = mixed(a[i], b[i], row.weight);
    }
}

}  // namespace rtsg
