// Walks the chunks of a PNG file and compares the checksums of those that nothing can be shown without.
#include "png.h"

#include <algorithm>
#include <array>

#include <zlib.h>

namespace rtsg {

namespace {

constexpr std::array<std::uint8_t, 8> kPngSignature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};

std::uint32_t bigEndian32(std::span<const std::uint8_t> bytes) {
    return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 | std::uint32_t{bytes[2]} << 8 | bytes[3];
}

}  // namespace

bool isPng(std::span<const std::uint8_t> bytes) {
    return bytes.size() >= kPngSignature.size() &&
           std::equal(kPngSignature.begin(), kPngSignature.end(), bytes.begin());
}

std::string damageOfPng(std::span<const std::uint8_t> file) {
    bool pixels = false;
    for (std::size_t at = kPngSignature.size();;) {
        const std::span<const std::uint8_t> rest = file.subspan(at);
        // Pixels may be whole though the last chunk is lost, and are shown then.
        if (rest.empty() && pixels) return {};
        if (rest.size() < 8) return "the PNG file ends too early, at its byte " + std::to_string(file.size());
        const std::string type(rest.begin() + 4, rest.begin() + 8);
        if (type == "IEND") return {};
        const std::size_t length = bigEndian32(rest);
        const bool needed = type == "IHDR" || type == "PLTE" || type == "IDAT";
        if (rest.size() < 12 || length > rest.size() - 12) {
            if (pixels && !needed) return {};
            return "the PNG file ends too early, at its byte " + std::to_string(file.size()) +
                   " in a chunk from byte " + std::to_string(at);
        }
        const auto sum = crc32_z(crc32_z(0, nullptr, 0), rest.data() + 4, length + 4);
        if (needed && sum != bigEndian32(rest.subspan(8 + length)))
            return "the PNG file is damaged in its " + type + " chunk from byte " + std::to_string(at) +
                   ", whose checksum is another";
        pixels |= type == "IDAT";
        at += 12 + length;
    }
}

}  // namespace rtsg
