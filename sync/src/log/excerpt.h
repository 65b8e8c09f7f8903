// Shortens a long text to the part where it differs from another text.
#pragma once

#include <algorithm>
#include <string>

#include <fmt/format.h>

namespace rtsg {

/// Returns a short text as it is; of a long one, the part around the first difference from `other`.
inline std::string excerpt(const std::string& text, const std::string& other) {
    constexpr std::size_t kLongest = 60, kBefore = 20, kPart = 40;
    if (text.size() <= kLongest) return text;
    const auto at = static_cast<std::size_t>(std::ranges::mismatch(text, other).in1 - text.begin());
    const std::size_t from = at > kBefore ? at - kBefore : 0;
    return fmt::format("{}{}{}", from ? "..." : "", text.substr(from, kPart), from + kPart < text.size() ? "..." : "");
}

}  // namespace rtsg
