// WebAddress: an http or https address in a normal form, so that equal addresses have equal texts and prefixes can be
// compared.
//
// Scheme and host are in lower case, the scheme's default port is left out, dot segments are resolved (also those
// written as %2e), and each byte that is not allowed is percent-encoded. Errors: a name or password before the host; a
// host with other characters than letters, digits, dots and hyphens. Threading: values. Source: RFC 3986, 5.2, 6.2.
#pragma once

#include <cstdint>
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

}  // namespace rtsg
