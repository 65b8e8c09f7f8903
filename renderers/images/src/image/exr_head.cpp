// Walks the attributes of OpenEXR files, whose library takes memory for each as long as it says it is, and for parts of
// the picture before it looks for them.
#include "exr_head.h"

#include <algorithm>

#include <fmt/format.h>

namespace rtsg {

namespace {

constexpr std::size_t kLongestName = 255;
constexpr std::uint64_t kPacked = 4096;  // bytes of pixels that a byte may hold
constexpr std::uint64_t kSmallTile = std::uint64_t{1} << 20;

struct Part {
    std::uint64_t width = 0, height = 0, tileWidth = 0, tileHeight = 0;
    std::uint64_t pixelBytes = 0;
    std::uint64_t packing = 0;
};

/// Rows of a picture that are packed together.
std::uint64_t rowsOfChunk(std::uint64_t packing) {
    constexpr std::uint64_t kRows[] = {1, 1, 1, 16, 32, 16, 32, 32, 32, 256};
    return packing < std::size(kRows) ? kRows[packing] : 256;
}

/// Bytes of all channels of a pixel: names, each with its type and sampling behind it.
std::uint64_t pixelBytesOf(const HeadBytes& file, std::uint64_t at, std::uint64_t end) {
    constexpr std::uint64_t kBehindName = 16, kHalf = 1;
    std::uint64_t bytes = 0;
    while (at < end) {
        const std::string name = file.text(at, kLongestName + 1);
        const std::size_t length = name.find('\0');
        if (length == 0 || length == std::string::npos) break;
        at += length + 1;
        bytes += file.little(at, 4) == kHalf ? 2 : 4;
        at += kBehindName;
    }
    return bytes;
}

std::string whyPartIsNotWithin(const Part& part, std::uint64_t fileSize) {
    if (part.width == 0 || part.height == 0) return {};
    const bool isTiled = part.tileWidth > 0 && part.tileHeight > 0;
    const std::uint64_t maximum = part.packing == 0 ? 1 : kPacked;
    if (std::string why = whyTooLarge({part.width, part.height, 1, 8 * part.pixelBytes, maximum}, fileSize);
        !why.empty())
        return why;
    const auto parts = [](std::uint64_t all, std::uint64_t one) { return (all + one - 1) / one; };
    const std::uint64_t chunks = isTiled ? parts(part.width, part.tileWidth) * parts(part.height, part.tileHeight)
                                         : parts(part.height, rowsOfChunk(part.packing));
    constexpr std::uint64_t kOffset = 8;  // bytes of a chunk's entry in the table
    if (chunks > fileSize / kOffset)
        return fmt::format("the EXR file's {} parts cannot be listed in its {} bytes", chunks, fileSize);
    const long double tile = static_cast<long double>(part.tileWidth) * static_cast<long double>(part.tileHeight) *
                             static_cast<long double>(part.pixelBytes);
    const long double picture = static_cast<long double>(part.width) * static_cast<long double>(part.height) *
                                static_cast<long double>(part.pixelBytes);
    if (tile > static_cast<long double>(kSmallTile) && tile > 4 * picture)
        return fmt::format("the EXR file's tiles of {} x {} pixels are larger than its picture", part.tileWidth,
                           part.tileHeight);
    return {};
}

/// The length of the name at a position; if the name does not end there, more than the longest possible one.
std::size_t nameLength(const HeadBytes& file, std::uint64_t at) {
    return file.text(at, kLongestName + 1).find('\0');
}

/// Sides of a box of whole numbers, which may begin anywhere.
std::uint64_t sideOf(const HeadBytes& file, std::uint64_t minimum, std::uint64_t maximum) {
    const auto at = [&](std::uint64_t position) {
        return std::int64_t{static_cast<std::int32_t>(static_cast<std::uint32_t>(file.little(position, 4)))};
    };
    return static_cast<std::uint64_t>(std::max<std::int64_t>(at(maximum) - at(minimum) + 1, 0));
}

/// Reads one header; leaves `at` behind it. A sentence: it is not within the file.
std::string readHeader(const HeadBytes& file, std::uint64_t& at, Part& part) {
    for (;;) {
        const std::string name = file.text(at, kLongestName + 1);
        const std::size_t length = name.find('\0');
        if (length == std::string::npos) return fmt::format("the EXR file ends in its head, at its byte {}", at);
        at += length + 1;
        if (length == 0) return {};
        const std::size_t typeLength = nameLength(file, at);
        if (typeLength == std::string::npos) return fmt::format("the EXR file ends in its head, at its byte {}", at);
        const std::uint64_t value = at + typeLength + 1 + 4, size = file.little(value - 4, 4);
        if (value > file.size() || size > file.size() - value)
            return fmt::format("the EXR file's attribute at its byte {} says that it has {} bytes, and {} follow", at,
                               size, file.size() - std::min(value, file.size()));
        at = value + size;
        const std::string_view known = std::string_view(name).substr(0, length);
        if (known == "channels") part.pixelBytes += pixelBytesOf(file, value, at);  // of several lists all count
        if (known == "compression") part.packing = file.byte(value);
        if (known == "dataWindow") {
            part.width = sideOf(file, value, value + 8);
            part.height = sideOf(file, value + 4, value + 12);
        }
        if (known == "tiles") {
            part.tileWidth = file.little(value, 4);
            part.tileHeight = file.little(value + 4, 4);
        }
    }
}

}  // namespace

bool isExr(const HeadBytes& file) {
    constexpr std::uint64_t kMagic = 20000630;
    return file.size() >= 8 && file.little(0, 4) == kMagic;
}

std::string whyNotWithinExr(const HeadBytes& file) {
    constexpr std::uint64_t kDeep = 0x800, kSeveral = 0x1000;
    const std::uint64_t flags = file.little(4, 4);
    if ((flags & kDeep) != 0) return "an EXR file of deep pixels is not read";
    std::uint64_t at = 8;
    do {
        Part part;
        if (std::string why = readHeader(file, at, part); !why.empty()) return why;
        if (std::string why = whyPartIsNotWithin(part, file.size()); !why.empty()) return why;
        // An empty header is behind the last of several.
    } while ((flags & kSeveral) != 0 && file.byte(at) != 0);
    return {};
}

}  // namespace rtsg
