// Reads the length of WAVE and MP4 files from their headers.
#include "media_length.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace rtsg {

namespace {

constexpr int kMaxChunks = 10'000;

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

std::optional<double> waveSeconds(const MediaBytes& file) {
    std::uint64_t format = 0, rate = 0, block = 0, samples = 0;
    std::uint64_t at = 12;
    for (int chunk = 0; chunk < kMaxChunks && at + 8 <= file.size; ++chunk) {
        const std::string bytes = file.read(at, 8 + 16);
        if (bytes.size() < 8) break;
        const std::string_view name = std::string_view(bytes).substr(0, 4);
        const std::uint64_t size = littleEndian(bytes, 4, 4), begin = at + 8, there = file.size - begin;
        const std::size_t held = bytes.size() - 8;
        if (name == "fmt " && held >= 16 && size >= 16) {
            format = littleEndian(bytes, 8, 2);
            rate = littleEndian(bytes, 8 + 4, 4);
            block = littleEndian(bytes, 8 + 12, 2);
        } else if (name == "fact" && held >= 4 && size >= 4) {
            samples = littleEndian(bytes, 8, 4);
        } else if (name == "data") {
            // The header states the number of samples of packed formats; that of all others follows from their bytes.
            constexpr std::uint64_t kPcm = 1, kFloat = 3, kExtensible = 0xFFFE;
            const bool plain = format == kPcm || format == kFloat || format == kExtensible;
            if (!plain && samples > 0) return ratio(double(samples), double(rate));
            const auto length = static_cast<double>(std::min(size, there));
            return block > 0 ? ratio(std::floor(length / double(block)), double(rate)) : std::nullopt;
        }
        if (size > there) break;
        at = begin + size + size % 2;
    }
    return std::nullopt;
}

/// From where to where the content of a box lies.
struct Span {
    std::uint64_t begin = 0, end = 0;
};

/// The content of the first box of this name; empty if there is none.
Span findBox(const MediaBytes& file, Span within, std::string_view name) {
    std::uint64_t at = within.begin;
    for (int box = 0; box < kMaxChunks && within.end - at >= 8; ++box) {
        const std::string head = file.read(at, 16);
        if (head.size() < 8) break;
        std::uint64_t size = bigEndian(head, 0, 4), header = 8;
        if (size == 1 && head.size() == 16) size = bigEndian(head, 8, 8), header = 16;
        if (size == 0) size = within.end - at;  // to the end of the file
        if (size < header || size > within.end - at) break;
        if (std::string_view(head).substr(4, 4) == name) return {at + header, at + size};
        at += size;
    }
    return {};
}

std::optional<double> movieSeconds(const MediaBytes& file) {
    const Span found = findBox(file, findBox(file, {0, file.size}, "moov"), "mvhd");
    const std::string header =
        file.read(found.begin, static_cast<std::size_t>(std::min<std::uint64_t>(32, found.end - found.begin)));
    if (header.size() < 20) return std::nullopt;
    if (header[0] == 0) {
        if (bigEndian(header, 16, 4) == 0xFFFFFFFF) return std::nullopt;  // not known
        return ratio(double(bigEndian(header, 16, 4)), double(bigEndian(header, 12, 4)));
    }
    if (header.size() < 32 || bigEndian(header, 24, 8) == UINT64_MAX) return std::nullopt;
    return ratio(double(bigEndian(header, 24, 8)), double(bigEndian(header, 20, 4)));
}

}  // namespace

std::optional<double> mediaSeconds(const MediaBytes& file) {
    if (file.size < 12) return std::nullopt;
    const std::string head = file.read(0, 12);
    if (head.starts_with("RIFF") && head.substr(8) == "WAVE") return waveSeconds(file);
    return movieSeconds(file);
}

}  // namespace rtsg
