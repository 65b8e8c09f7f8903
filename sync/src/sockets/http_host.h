// Which host a request of HTTP names, and whether that is this machine: what all servers of ours ask before they
// answer, as a foreign name may lead to loopback, and pages of other sites may send requests there.
//
// Threading: pure functions. Source: RFC 9110, 7.2; RFC 6454, 7; RFC 3986, 3.2.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

#include <arpa/inet.h>
#include <netinet/in.h>

namespace rtsg::detail {

/// The host of "HOST", "HOST:PORT" or "[ADDRESS]:PORT"; nothing of other texts.
inline std::optional<std::string> hostIn(std::string_view text) {
    const bool isBracketed = text.starts_with('[');
    const std::size_t end = isBracketed ? text.find(']') : std::min(text.find(':'), text.size());
    if (end == text.npos) return std::nullopt;
    const std::string_view host = text.substr(isBracketed ? 1 : 0, end - (isBracketed ? 1 : 0));
    std::string_view port = text.substr(end + (isBracketed ? 1 : 0));
    const auto isOf = [](std::string_view all, std::string_view others) {
        return std::ranges::all_of(all, [&](unsigned char c) {
            return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || others.contains(c);
        });
    };
    if (host.empty() || !isOf(host, isBracketed ? ":.%" : "-._~")) return std::nullopt;
    if (port.empty()) return std::string(host);
    if (!port.starts_with(':') || port.size() > 6) return std::nullopt;
    port.remove_prefix(1);
    if (!std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; })) return std::nullopt;
    return std::string(host);
}

/// Whether the host is `localhost` or an address of loopback; a name may begin like an address.
inline bool isThisMachine(const std::string& host) {
    in_addr four{};
    in6_addr six{};
    if (::inet_pton(AF_INET, host.c_str(), &four) == 1) return (ntohl(four.s_addr) >> 24) == 127;
    if (::inet_pton(AF_INET6, host.c_str(), &six) == 1) return IN6_IS_ADDR_LOOPBACK(&six);
    return host == "localhost";
}

/// Whether an Origin field is of a page that this machine serves.
inline bool isOriginOfThisMachine(std::string_view origin) {
    const std::size_t scheme = origin.find("://");
    return scheme != origin.npos && isThisMachine(hostIn(origin.substr(scheme + 3)).value_or(""));
}

}  // namespace rtsg::detail
