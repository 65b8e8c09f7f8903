// Markup: escapes and encodes text for HTML and XML.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace rtsg {

/// Escapes for content and attributes. Control characters, which XML cannot have, become U+FFFD.
std::string escapeMarkup(std::string_view text);
std::string base64(std::span<const std::byte> bytes);

}  // namespace rtsg
