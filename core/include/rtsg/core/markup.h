// Escapes and encodes text for HTML and XML.
//
// Threading: pure functions. Source: XML 1.0, 2.2 and 2.4; RFC 4648, section 4.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace rtsg {

/// Escapes for content and attributes. Control characters, which XML cannot have, become U+FFFD.
std::string escapeMarkup(std::string_view text);
/// With padding, in one line.
std::string base64(std::span<const std::byte> bytes);

}  // namespace rtsg
