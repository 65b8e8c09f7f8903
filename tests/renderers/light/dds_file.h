// DDS files of uncompressed pixels: the sides of a cube, or layers of a block.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rtsg::test {

inline void put(std::string& out, std::uint32_t word) {
    for (int i = 0; i < 4; ++i) out += static_cast<char>(word >> (8 * i));
}
/// A DDS file of 32-bit pixels; `pixels`: face after face or layer after layer, rows from the top, as 0xAARRGGBB.
inline std::string dds(std::uint32_t side, bool cube, std::uint32_t depth, const std::vector<std::uint32_t>& pixels) {
    std::string out = "DDS ";
    put(out, 124), put(out, 0x1007u | (depth > 1 ? 0x800000u : 0)), put(out, side), put(out, side), put(out, side * 4),
        put(out, depth > 1 ? depth : 0);
    for (int i = 0; i < 12; ++i) put(out, i == 0 ? 1 : 0);
    put(out, 32), put(out, 0x41), put(out, 0), put(out, 32), put(out, 0xFF0000), put(out, 0xFF00), put(out, 0xFF),
        put(out, 0xFF000000);
    put(out, 0x1008), put(out, cube ? 0xFE00u : depth > 1 ? 0x200000u : 0), put(out, 0), put(out, 0), put(out, 0);
    for (const std::uint32_t pixel : pixels) put(out, pixel);
    return out;
}

}  // namespace rtsg::test
