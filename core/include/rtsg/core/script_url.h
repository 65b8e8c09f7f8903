// Finds the urls of a Script that hold its program itself and lead to no file.
//
// Threading: pure functions. Source: ISO/IEC 19777-1 V3.3 4.2.1 and ISO/IEC 14772-1 C.2, for the schemes; RFC 3986 3.1:
// schemes are not case-sensitive.
#pragma once

#include <algorithm>
#include <optional>
#include <string_view>

namespace rtsg {

/// The program's text after `ecmascript:`, `javascript:` or `vrmlscript:`; nothing if the url has none of these. White
/// space before the scheme is ignored.
inline std::optional<std::string_view> programInUrl(std::string_view url) {
    url.remove_prefix(std::min(url.find_first_not_of(" \t\r\n"), url.size()));
    const auto isSame = [](char letter, char wanted) { return letter == wanted || letter == wanted - 'a' + 'A'; };
    for (const std::string_view scheme : {"ecmascript:", "javascript:", "vrmlscript:"})
        if (url.size() >= scheme.size() && std::ranges::equal(url.substr(0, scheme.size()), scheme, isSame))
            return url.substr(scheme.size());
    return std::nullopt;
}

/// A hint for the message that a file was not found, if the url seems to be a program without its scheme; else empty.
inline std::string_view hintForProgram(std::string_view url) {
    const bool isProgram = url.find_first_of("{;\n") != url.npos && !url.contains("://") && !url.starts_with("data:");
    return isProgram ? " (a program in an url begins with ecmascript:)" : "";
}

}  // namespace rtsg
