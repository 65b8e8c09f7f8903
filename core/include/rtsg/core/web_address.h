// WebAddress: an http or https address in a normal form, so that equal addresses have equal texts and prefixes can be
// compared. Also finds the urls of a Script that hold its program itself.
//
// Scheme and host are in lower case, the scheme's default port is left out, dot segments are resolved (also those
// written as %2e), and each byte that is not allowed is percent-encoded. Errors: a name or password before the host; a
// host with other characters than letters, digits, dots and hyphens. Threading: values. Source: RFC
// 3986, 3.1, 5.2, 6.2; ISO/IEC 19777-1 V3.3 4.2.1 and ISO/IEC 14772-1 C.2 for the schemes of programs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct WebAddress {
    bool isSecure = true;    // https
    std::string host;        // an IPv6 address without its brackets
    std::uint16_t port = 0;  // the port that is used, never 0
    std::string path;        // from the first "/" on, with the query

    /// Reads an address without its fragment. Errors: the reason why it is not valid.
    static Result<WebAddress> parse(std::string_view text);
    /// The address of `reference`, which may be relative, in a document at this address.
    Result<WebAddress> resolve(std::string_view reference) const;
    /// Whether scheme, host and port equal those of `prefix`, and the path is its path or continues it at a `/`.
    bool isBelow(const WebAddress& prefix) const;
    std::string text() const;

    friend bool operator==(const WebAddress&, const WebAddress&) = default;
};

/// Whether the text begins with http:// or https://, in any case.
bool isWebAddress(std::string_view text);

/// The program's text, which leads to no file, after `ecmascript:`, `javascript:` or `vrmlscript:`; nothing if the url
/// has none of these. White space before the scheme is ignored.
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

/// The base64 text of bytes, as data: urls have it (RFC 4648, section 4), with padding, in one line.
std::string base64(std::span<const std::byte> bytes);
/// The bytes of such a text, also with the two digits of URLs, and with white space anywhere; nothing if it is none.
std::optional<std::string> base64Decoded(std::string_view text);

}  // namespace rtsg
