// Of many equal warnings the first eight are told, and then each that doubles their number: what comes from others may
// come a thousand times a second for ever.
// Threading: none of its own.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <string>

#include <fmt/format.h>

namespace rtsg::mirror {

/// What is told of the warning that is number `by` of its kind, counted from 1. Nothing for most of them.
inline std::optional<std::string> reportedOf(std::uint64_t by, std::string text) {
    constexpr std::uint64_t kAllReported = 8;
    if (by > kAllReported && !std::has_single_bit(by)) return std::nullopt;
    if (by > kAllReported) text += fmt::format("; {} such things by now", by);
    return text;
}

}  // namespace rtsg::mirror
