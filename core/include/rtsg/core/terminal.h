// Makes text from scenes, peers and files safe for a terminal, and for files that must be UTF-8.
//
// Names, strings, diagnostics and the output of scripts can hold control characters that make a terminal show wrong
// text or run commands. All output to a terminal goes through here. Threading: a pure function.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtsg {

enum class Lines : std::uint8_t { escaped, kept };

/// Replaces C0, DEL, C1, the marks that change the writing direction, and bytes that are not UTF-8 by \xNN or \u{NNNN}.
/// With `lines` = kept, line ends and tabs stay.
std::string terminalText(std::string_view text, Lines lines = Lines::escaped);

/// Replaces each byte that is not UTF-8 by U+FFFD. Peers' names may have such bytes, and readers of JSON and XML refuse
/// a whole file because of one.
std::string asUtf8(std::string_view text);

}  // namespace rtsg
