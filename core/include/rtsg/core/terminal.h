// Text of scenes, peers and files as it may be shown on a terminal, or written into files that have to be UTF-8.
//
// Names, strings, diagnostics and what scripts print can hold control characters, with which a terminal can be made to
// lie or to act. Whatever goes to a terminal goes through here. Threading: a pure function.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtsg {

enum class Lines : std::uint8_t { escaped, kept };

/// C0, DEL, C1, the marks that turn the direction of writing, and bytes that are no UTF-8, each as \xNN or \u{NNNN}.
/// Line ends and tabs stay if `lines` are kept.
std::string terminalText(std::string_view text, Lines lines = Lines::escaped);

/// Each byte that is no UTF-8 as U+FFFD: peers' names may have such, and readers of JSON and XML refuse all of a file
/// for one.
std::string asUtf8(std::string_view text);

}  // namespace rtsg
