// Animated PNG files (PNG, third edition, 11.3.6): every picture whole, as long as the others.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <zlib.h>

namespace rtsg::test {

/// Pictures of `width` x `height` pixels of red, green, blue and alpha, a byte each, from the upper left corner on;
/// each is shown for `numerator / denominator` seconds.
inline std::string animatedPng(std::uint32_t width, std::uint32_t height, std::span<const std::string> pictures,
                               std::uint16_t numerator, std::uint16_t denominator) {
    const auto put = [](std::string& to, std::uint32_t value, int bytes) {
        for (int i = bytes; i-- > 0;) to += static_cast<char>(value >> 8 * i & 0xFF);
    };
    std::string file = "\x89PNG\r\n\x1A\n";
    const auto chunk = [&](std::string_view name, const std::string& data) {
        put(file, static_cast<std::uint32_t>(data.size()), 4);
        const std::string body = std::string(name) + data;
        const auto sum = crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
        file += body;
        put(file, static_cast<std::uint32_t>(sum), 4);
    };
    std::string head;
    put(head, width, 4), put(head, height, 4);
    head += std::string("\x08\x06\0\0\0", 5);
    chunk("IHDR", head);
    std::string control;
    put(control, static_cast<std::uint32_t>(pictures.size()), 4), put(control, 0, 4);
    chunk("acTL", control);
    std::uint32_t number = 0;
    for (const std::string& picture : pictures) {
        std::string frame;
        put(frame, number++, 4), put(frame, width, 4), put(frame, height, 4), put(frame, 0, 4), put(frame, 0, 4);
        put(frame, numerator, 2), put(frame, denominator, 2);
        frame += std::string(2, '\0');
        chunk("fcTL", frame);
        std::string rows;
        for (std::uint32_t y = 0; y < height; ++y) rows += '\0' + picture.substr(4 * y * width, 4 * width);
        std::vector<Bytef> packed(compressBound(rows.size()));
        uLongf size = packed.size();
        compress(packed.data(), &size, reinterpret_cast<const Bytef*>(rows.data()), rows.size());
        std::string data(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size));
        if (&picture != pictures.data()) {
            std::string numbered;
            put(numbered, number++, 4);
            data.insert(0, numbered);
        }
        chunk(&picture == pictures.data() ? "IDAT" : "fdAT", data);
    }
    chunk("IEND", {});
    return file;
}

}  // namespace rtsg::test
