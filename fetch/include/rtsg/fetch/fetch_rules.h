// FetchRules: the addresses that may be fetched, and the servers that may be connected to.
//
// An address is allowed if it is below one that the user named. A server is allowed if its IP address is public, or in
// a network that the user named, or named by the user as this number or as localhost. Others are refused, whatever name
// leads to them: private, loopback, link-local, multicast and reserved addresses, and IPv6 addresses that stand for
// such addresses of IPv4. Threading: values. Source: RFC 6890 with its registries, RFC 4291, RFC 6052, RFC 3056.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <sys/socket.h>

#include <rtsg/core/web_address.h>

namespace rtsg {

/// The IP addresses that begin with the first `bits` bits of `bytes`; IPv4 addresses as ::ffff:a.b.c.d.
struct IpNetwork {
    std::array<std::uint8_t, 16> bytes{};
    int bits = 128;

    /// Reads "10.1.2.3", "10.0.0.0/8" or "fd00::/8". Error: it is no network.
    static Result<IpNetwork> parse(std::string_view text);
    bool has(const std::array<std::uint8_t, 16>& address) const;
};

struct FetchRules {
    std::vector<WebAddress> allowed;
    std::vector<IpNetwork> networks;  // in addition to the public ones

    /// Checks that the address is below an allowed one. The error names the option that allows it.
    Result<> check(const WebAddress& address) const;
    /// Whether the server of an allowed address may be at `server`.
    bool mayConnect(const WebAddress& address, const sockaddr& server) const;
};

/// Whether it is an address of the public internet.
bool isPublic(const sockaddr& server);

}  // namespace rtsg
