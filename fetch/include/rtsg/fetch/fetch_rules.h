// FetchRules: which addresses may be fetched, and which servers may be connected to.
//
// An address is allowed if it is below one that the user named. A server's address is public, or in a network that the
// user named, or the user named the server by this very number or as localhost; others are refused, whatever name leads
// to them: private, loopback, link-local, multicast, reserved, and IPv6 addresses that stand for such ones of IPv4.
// Threading: values. Source: RFC 6890 with its registries, RFC 4291, RFC 6052, RFC 3056.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <sys/socket.h>

#include <rtsg/core/web_address.h>

namespace rtsg {

/// Addresses whose first `bits` bits are these; of IPv4 as ::ffff:a.b.c.d.
struct IpNetwork {
    std::array<std::uint8_t, 16> bytes{};
    int bits = 128;

    /// "10.1.2.3", "10.0.0.0/8", "fd00::/8". Error: it is none.
    static Result<IpNetwork> parse(std::string_view text);
    bool has(const std::array<std::uint8_t, 16>& address) const;
};

struct FetchRules {
    std::vector<WebAddress> allowed;
    std::vector<IpNetwork> networks;  // beside the public ones

    /// Error: it is below none of them; the text names the option that helps.
    Result<> check(const WebAddress& address) const;
    /// Whether the server of an address that is allowed may be at `server`.
    bool mayConnect(const WebAddress& address, const sockaddr& server) const;
};

/// Whether anybody on the internet may have it.
bool isPublic(const sockaddr& server);

}  // namespace rtsg
