// Films without any packing, byte by byte: what their pictures and their sound are is known exactly.
#pragma once

#include <cstdint>
#include <string>

namespace rtsg::test {

inline std::string littleEndian32(std::uint32_t value) {
    std::string bytes;
    for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> 8 * i & 0xFF);
    return bytes;
}
inline std::string riffChunk(const std::string& name, const std::string& content) {
    return name + littleEndian32(static_cast<std::uint32_t>(content.size())) + content +
           std::string(content.size() % 2, '\0');
}

/// An uncompressed AVI (Multimedia Programming Interface 1.0; BITMAPINFOHEADER of 24 bits): the lower left pixel of
/// frame i is (10 i, 20, 30), the upper right one (200, 10 i, 0), all others are black. With a rate of sound its sample
/// k is k / 32768 on the left and -k / 32768 on the right.
inline std::string plainFilm(int frames, int rate, int width = 4, int height = 2, int soundRate = 0) {
    const auto le = littleEndian32;
    const auto w = static_cast<std::uint32_t>(width), h = static_cast<std::uint32_t>(height);
    const auto count = static_cast<std::uint32_t>(frames), sound = static_cast<std::uint32_t>(soundRate);
    const std::size_t row = (std::size_t{3} * w + 3) / 4 * 4;
    std::string movie = "movi", index;
    const auto add = [&](const std::string& name, const std::string& content) {
        index += name + le(0x10) + le(static_cast<std::uint32_t>(movie.size())) +
                 le(static_cast<std::uint32_t>(content.size()));
        movie += riffChunk(name, content);
    };
    int sample = 0;
    for (int i = 0; i < frames; ++i) {
        std::string pixels(row * h, '\0');  // blue, green, red, from the bottom row on
        pixels[0] = 30, pixels[1] = 20, pixels[2] = static_cast<char>(10 * i);
        const std::size_t last = row * (h - 1) + std::size_t{3} * (w - 1);
        pixels[last + 1] = static_cast<char>(10 * i), pixels[last + 2] = static_cast<char>(200);
        add("00db", pixels);
        std::string samples;
        for (int k = 0; k < soundRate / rate; ++k, ++sample)
            samples += le(static_cast<std::uint32_t>((sample & 0xFFFF) | (-sample & 0xFFFF) << 16));
        if (soundRate > 0) add("01wb", samples);
    }
    const std::string pictureFormat = le(40) + le(w) + le(h) + std::string("\1\0\x18\0", 4) + le(0) +
                                      le(static_cast<std::uint32_t>(row * h)) + std::string(16, '\0');
    const std::string pictures = "vidsDIB " + le(0) + le(0) + le(0) + le(1) + le(static_cast<std::uint32_t>(rate)) +
                                 le(0) + le(count) + le(4096) + le(0xFFFFFFFF) + le(0) + std::string(8, '\0');
    const std::string soundFormat =
        std::string("\1\0\2\0", 4) + le(sound) + le(4 * sound) + std::string("\4\0\x10\0", 4);
    const std::string sounds = "auds" + le(0) + le(0) + le(0) + le(0) + le(1) + le(sound) + le(0) +
                               le(static_cast<std::uint32_t>(sample)) + le(4096) + le(0xFFFFFFFF) + le(4) +
                               std::string(8, '\0');
    std::string streams = riffChunk("LIST", "strl" + riffChunk("strh", pictures) + riffChunk("strf", pictureFormat));
    if (soundRate > 0)
        streams += riffChunk("LIST", "strl" + riffChunk("strh", sounds) + riffChunk("strf", soundFormat));
    const std::string head = le(static_cast<std::uint32_t>(1'000'000 / rate)) + le(0) + le(0) + le(0x10) + le(count) +
                             le(0) + le(soundRate > 0 ? 2 : 1) + le(4096) + le(w) + le(h) + std::string(16, '\0');
    return riffChunk("RIFF", "AVI " + riffChunk("LIST", "hdrl" + riffChunk("avih", head) + streams) +
                                 riffChunk("LIST", movie) + riffChunk("idx1", index));
}

/// RFC 2397 and 4648.
inline std::string dataUrl(const std::string& mediaType, const std::string& bytes) {
    static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text = "data:" + mediaType + ";base64,";
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t word = 0;
        for (std::size_t k = 0; k < 3; ++k)
            word = word << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k) text += k <= bytes.size() - i ? kDigits[word >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

}  // namespace rtsg::test
