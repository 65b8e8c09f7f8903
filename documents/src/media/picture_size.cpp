// Reads the size of PNG, JPEG and GIF files from their headers.
#include "picture_size.h"

#include <string_view>

namespace rtsg {

namespace {

std::uint32_t pictureByte(std::string_view bytes, std::size_t at) {
    return static_cast<unsigned char>(bytes[at]);
}
std::uint32_t bigPair(std::string_view bytes, std::size_t at) {
    return pictureByte(bytes, at) << 8 | pictureByte(bytes, at + 1);
}
std::uint32_t bigQuad(std::string_view bytes, std::size_t at) {
    return bigPair(bytes, at) << 16 | bigPair(bytes, at + 2);
}
std::uint32_t littlePair(std::string_view bytes, std::size_t at) {
    return pictureByte(bytes, at + 1) << 8 | pictureByte(bytes, at);
}

std::optional<PictureSize> withPixels(PictureSize size) {
    if (size.width == 0 || size.height == 0) return std::nullopt;
    return size;
}

/// Segments follow each other, each with its length; the one that begins a frame says its size.
std::optional<PictureSize> jpegSize(const MediaBytes& file) {
    constexpr int kMaxSegments = 1000;
    std::uint64_t at = 2;
    for (int segment = 0; segment < kMaxSegments; ++segment) {
        const std::string head = file.read(at, 9);
        if (head.size() < 9 || pictureByte(head, 0) != 0xFF) return std::nullopt;
        const std::uint32_t marker = pictureByte(head, 1);
        if (marker == 0xFF) {  // a fill byte
            ++at;
            continue;
        }
        // SOF0 to SOF15, without DHT (C4), JPG (C8) and DAC (CC), which lie among them.
        if (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC)
            return withPixels({bigPair(head, 7), bigPair(head, 5)});
        if (marker == 0xD9 || marker == 0xDA) return std::nullopt;  // the end, or the pixels
        const bool isAlone = marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8);
        at += isAlone ? 2 : 2 + bigPair(head, 2);
    }
    return std::nullopt;
}

}  // namespace

std::optional<PictureSize> pictureSize(const MediaBytes& file) {
    const std::string head = file.read(0, 24);
    if (head.size() >= 24 && head.starts_with("\x89PNG\r\n\x1A\n") && std::string_view(head).substr(12, 4) == "IHDR")
        return withPixels({bigQuad(head, 16), bigQuad(head, 20)});
    if (head.size() >= 10 && (head.starts_with("GIF87a") || head.starts_with("GIF89a")))
        return withPixels({littlePair(head, 6), littlePair(head, 8)});
    if (head.starts_with("\xFF\xD8\xFF")) return jpegSize(file);
    return std::nullopt;
}

}  // namespace rtsg
