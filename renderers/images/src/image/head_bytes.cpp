// Reads numbers of a file's head, and compares the stated size with that of the file.
#include "head_bytes.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

namespace rtsg {

namespace {

/// Pictures of at most this many bytes are read whatever the file's size: that does no harm, and readers describe
/// faults more precisely.
constexpr std::uint64_t kAlwaysRead = std::uint64_t{1} << 22;

}  // namespace

std::array<unsigned char, 8> HeadBytes::read(std::uint64_t at, std::size_t bytes) const {
    std::array<unsigned char, 8> result{};
    if (at < size()) source_->read(at, result.data(), std::min(bytes, result.size()));
    return result;
}

std::string HeadBytes::text(std::uint64_t at, std::size_t length) const {
    if (at >= size()) return {};
    std::string result(static_cast<std::size_t>(std::min<std::uint64_t>(length, size() - at)), '\0');
    result.resize(source_->read(at, result.data(), result.size()));
    return result;
}

std::uint64_t HeadBytes::little(std::uint64_t at, std::size_t bytes) const {
    const auto all = read(at, bytes);
    std::uint64_t result = 0;
    for (std::size_t i = bytes; i-- > 0;) result = result << 8 | all[i];
    return result;
}

std::uint64_t HeadBytes::big(std::uint64_t at, std::size_t bytes) const {
    const auto all = read(at, bytes);
    std::uint64_t result = 0;
    for (std::size_t i = 0; i < bytes; ++i) result = result << 8 | all[i];
    return result;
}

std::string whyTooLarge(const HeadSize& size, std::uint64_t fileSize) {
    // Each factor has some 32 bits at most, and their product is not a number of bytes that there could be.
    const long double pixels = static_cast<long double>(size.width) * static_cast<long double>(size.height) *
                               static_cast<long double>(size.layers);
    const long double bytes = pixels * static_cast<long double>(size.bits) / 8;
    const long double maximum = static_cast<long double>(fileSize) * static_cast<long double>(size.bytesOfByte);
    if (bytes <= static_cast<long double>(kAlwaysRead) || bytes <= maximum) return {};
    return fmt::format("its head says {} x {}{} pixels, which a file of {} bytes cannot hold", size.width, size.height,
                       size.layers > 1 ? fmt::format(" x {}", size.layers) : "", fileSize);
}

std::vector<std::uint64_t> numbersIn(std::string_view text, std::size_t count) {
    std::vector<std::uint64_t> result;
    for (std::size_t at = 0; at < text.size() && result.size() < count; ++at) {
        if (text[at] == '#') at = std::min(text.find('\n', at), text.size() - 1);
        std::uint64_t number = 0;
        const char* const from = text.data() + at;
        const auto [end, error] = std::from_chars(from, text.data() + text.size(), number);
        if (end == from) continue;
        result.push_back(error == std::errc() ? number : UINT64_MAX);
        at += static_cast<std::size_t>(end - from);
    }
    return result;
}

}  // namespace rtsg
