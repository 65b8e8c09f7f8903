// The headers of WAVE and MP4 files, as far as they say how long there is something to hear or see.
#include "media_length.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace rtsg {

namespace {

std::uint64_t littleEndian(std::string_view bytes, std::size_t at, std::size_t size) {
    std::uint64_t number = 0;
    for (std::size_t i = size; i-- > 0;) number = number << 8 | static_cast<unsigned char>(bytes[at + i]);
    return number;
}
std::uint64_t bigEndian(std::string_view bytes, std::size_t at, std::size_t size) {
    std::uint64_t number = 0;
    for (std::size_t i = 0; i < size; ++i) number = number << 8 | static_cast<unsigned char>(bytes[at + i]);
    return number;
}

std::optional<double> ratio(double part, double whole) {
    if (!(whole > 0) || !(part >= 0)) return std::nullopt;
    return part / whole;
}

std::optional<double> waveSeconds(std::string_view bytes) {
    std::uint64_t format = 0, rate = 0, block = 0, samples = 0;
    for (std::size_t at = 12; at + 8 <= bytes.size();) {
        const std::string_view name = bytes.substr(at, 4);
        const std::uint64_t size = littleEndian(bytes, at + 4, 4);
        const std::size_t begin = at + 8, there = bytes.size() - begin;
        if (name == "fmt " && there >= 16 && size >= 16) {
            format = littleEndian(bytes, begin, 2);
            rate = littleEndian(bytes, begin + 4, 4);
            block = littleEndian(bytes, begin + 12, 2);
        } else if (name == "fact" && there >= 4 && size >= 4) {
            samples = littleEndian(bytes, begin, 4);
        } else if (name == "data") {
            // Of packed formats the header says how many samples there are; of all others their bytes do.
            constexpr std::uint64_t kPcm = 1, kFloat = 3, kExtensible = 0xFFFE;
            const bool plain = format == kPcm || format == kFloat || format == kExtensible;
            if (!plain && samples > 0) return ratio(double(samples), double(rate));
            const auto length = static_cast<double>(std::min<std::uint64_t>(size, there));
            return block > 0 ? ratio(std::floor(length / double(block)), double(rate)) : std::nullopt;
        }
        if (size > there) break;
        at = begin + static_cast<std::size_t>(size + size % 2);
    }
    return std::nullopt;
}

/// The content of the first box of this name; empty if there is none.
std::string_view findBox(std::string_view bytes, std::string_view name) {
    for (std::size_t at = 0; at + 8 <= bytes.size();) {
        std::uint64_t size = bigEndian(bytes, at, 4);
        std::size_t header = 8;
        if (size == 1 && at + 16 <= bytes.size()) size = bigEndian(bytes, at + 8, 8), header = 16;
        if (size == 0) size = bytes.size() - at;  // to the end of the file
        if (size < header || size > bytes.size() - at) break;
        if (bytes.substr(at + 4, 4) == name) return bytes.substr(at + header, static_cast<std::size_t>(size) - header);
        at += static_cast<std::size_t>(size);
    }
    return {};
}

std::optional<double> movieSeconds(std::string_view bytes) {
    const std::string_view header = findBox(findBox(bytes, "moov"), "mvhd");
    if (header.size() < 20) return std::nullopt;
    if (header[0] == 0) {
        if (bigEndian(header, 16, 4) == 0xFFFFFFFF) return std::nullopt;  // not known
        return ratio(double(bigEndian(header, 16, 4)), double(bigEndian(header, 12, 4)));
    }
    if (header.size() < 32 || bigEndian(header, 24, 8) == UINT64_MAX) return std::nullopt;
    return ratio(double(bigEndian(header, 24, 8)), double(bigEndian(header, 20, 4)));
}

}  // namespace

std::optional<double> mediaSeconds(std::string_view bytes) {
    if (bytes.size() < 12) return std::nullopt;
    if (bytes.starts_with("RIFF") && bytes.substr(8, 4) == "WAVE") return waveSeconds(bytes);
    return movieSeconds(bytes);
}

}  // namespace rtsg
