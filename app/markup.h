// Text for HTML and XML.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace rtsg::app {

/// Escaped for content and attributes; control characters, which XML cannot hold, become U+FFFD.
std::string escapeMarkup(std::string_view text);
std::string base64(std::span<const std::byte> bytes);

}  // namespace rtsg::app
