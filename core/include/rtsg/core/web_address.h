// WebAddress: an http or https address in one form, so that equal addresses are equal texts and prefixes can be
// compared.
//
// Scheme and host are in lower case, the port is left out where it is the scheme's own, dot segments are resolved (also
// those written as %2e), and each byte that may not stand there is percent-encoded. Names and passwords before the host
// are refused, as are hosts that are no letters, digits, dots and hyphens. Threading: values. Source: RFC
// 3986, 5.2, 6.2.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct WebAddress {
    bool isSecure = true;    // https
    std::string host;        // an IPv6 address without its brackets
    std::uint16_t port = 0;  // as it is used, never 0
    std::string path;        // from its "/" on, with the query

    /// Without what follows `#`. Errors: why it is none.
    static Result<WebAddress> parse(std::string_view text);
    /// What `reference`, which may be relative, names in a document at this address.
    Result<WebAddress> resolve(std::string_view reference) const;
    /// Whether scheme, host and port are those of `prefix`, and the path is its path or continues it at a `/`.
    bool isBelow(const WebAddress& prefix) const;
    std::string text() const;

    friend bool operator==(const WebAddress&, const WebAddress&) = default;
};

/// Whether it begins with http:// or https://, in any case.
bool isWebAddress(std::string_view text);

}  // namespace rtsg
