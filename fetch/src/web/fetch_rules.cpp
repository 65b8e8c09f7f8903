// Compares addresses with those that the user allows, and tells public servers from others.
#include <rtsg/fetch/fetch_rules.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <optional>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

namespace rtsg {

namespace {

using Bytes = std::array<std::uint8_t, 16>;
constexpr int kIpv4Bits = 96;  // before the four bytes of an IPv4 address

Bytes mapped(const in_addr& address) {
    Bytes bytes{};
    bytes[10] = bytes[11] = 0xff;
    std::memcpy(&bytes[12], &address, 4);
    return bytes;
}

std::optional<Bytes> bytesOf(const sockaddr& server) {
    Bytes bytes{};
    if (server.sa_family == AF_INET) {
        sockaddr_in four{};
        std::memcpy(&four, &server, sizeof four);
        return mapped(four.sin_addr);
    }
    if (server.sa_family != AF_INET6) return std::nullopt;
    sockaddr_in6 six{};
    std::memcpy(&six, &server, sizeof six);
    std::memcpy(bytes.data(), &six.sin6_addr, bytes.size());
    return bytes;
}

std::optional<Bytes> bytesOf(const std::string& number) {
    in_addr four{};
    if (inet_pton(AF_INET, number.c_str(), &four) == 1) return mapped(four);
    Bytes bytes{};
    if (inet_pton(AF_INET6, number.c_str(), bytes.data()) == 1) return bytes;
    return std::nullopt;
}

bool isIn(const Bytes& bytes, std::string_view network) {
    const auto parsed = IpNetwork::parse(network);
    return parsed && parsed->has(bytes);
}

/// The IPv4 address that an IPv6 address of this network carries, from `at` on: through it its server is met.
std::optional<Bytes> carried(const Bytes& bytes) {
    constexpr std::pair<std::string_view, std::size_t> kCarriers[] = {
        {"64:ff9b::/96", 12}, {"64:ff9b:1::/48", 12}, {"2002::/16", 2}, {"::/96", 12}};
    for (const auto& [network, at] : kCarriers) {
        if (!isIn(bytes, network)) continue;
        in_addr four{};
        std::memcpy(&four, &bytes[at], 4);
        return mapped(four);
    }
    return std::nullopt;
}

/// The registries of special addresses; 2000::/3 alone is for everybody in IPv6.
bool isPublic(const Bytes& bytes) {
    constexpr std::string_view kSpecial4[] = {"0.0.0.0/8",      "10.0.0.0/8",     "100.64.0.0/10", "127.0.0.0/8",
                                              "169.254.0.0/16", "172.16.0.0/12",  "192.0.0.0/24",  "192.0.2.0/24",
                                              "192.88.99.0/24", "192.168.0.0/16", "198.18.0.0/15", "198.51.100.0/24",
                                              "203.0.113.0/24", "224.0.0.0/4",    "240.0.0.0/4"};
    constexpr std::string_view kSpecial6[] = {"2001::/23", "2001:db8::/32", "3fff::/20"};
    const auto isAmong = [&](const auto& networks) {
        return std::ranges::any_of(networks, [&](std::string_view one) { return isIn(bytes, one); });
    };
    if (isIn(bytes, "::ffff:0:0/96")) return !isAmong(kSpecial4);
    if (const auto inner = carried(bytes)) return isPublic(*inner);
    return isIn(bytes, "2000::/3") && !isAmong(kSpecial6);
}

}  // namespace

Result<IpNetwork> IpNetwork::parse(std::string_view text) {
    const std::size_t slash = std::min(text.find('/'), text.size());
    const std::string number(text.substr(0, slash));
    const auto bytes = bytesOf(number);
    if (!bytes) return fail(fmt::format("'{}' is no IP address", number));
    IpNetwork network{*bytes, 128};
    if (slash == text.size()) return network;
    const std::string_view digits = text.substr(slash + 1);
    const auto [end, problem] = std::from_chars(digits.data(), digits.data() + digits.size(), network.bits);
    const int maximum = number.contains(':') ? 128 : 128 - kIpv4Bits;
    if (problem != std::errc() || end != digits.data() + digits.size() || network.bits < 0 || network.bits > maximum)
        return fail(fmt::format("'{}' is no number of bits from 0 to {}", digits, maximum));
    network.bits += 128 - maximum;
    return network;
}

bool IpNetwork::has(const std::array<std::uint8_t, 16>& address) const {
    for (int bit = 0; bit < bits; ++bit) {
        const auto at = static_cast<std::size_t>(bit / 8);
        const int mask = 0x80 >> (bit % 8);
        if ((bytes[at] & mask) != (address[at] & mask)) return false;
    }
    return true;
}

bool isPublic(const sockaddr& server) {
    const auto bytes = bytesOf(server);
    return bytes && isPublic(*bytes);
}

Result<> FetchRules::check(const WebAddress& address) const {
    if (std::ranges::any_of(allowed, [&](const WebAddress& one) { return address.isBelow(one); })) return {};
    WebAddress folder = address;
    const std::string path = address.path.substr(0, address.path.find('?'));
    folder.path = path.substr(0, path.rfind('/') + 1);
    return fail(fmt::format("it is below no address that may be fetched; --allow {} lets it", folder.text()));
}

bool FetchRules::mayConnect(const WebAddress& address, const sockaddr& server) const {
    const auto bytes = bytesOf(server);
    if (!bytes) return false;
    if (isPublic(*bytes)) return true;
    if (std::ranges::any_of(networks, [&](const IpNetwork& one) { return one.has(*bytes); })) return true;
    // The address is below one that the user named, so the user named this host.
    if (address.host == "localhost") return isIn(*bytes, "127.0.0.0/8") || isIn(*bytes, "::1");
    return bytesOf(address.host) == bytes;
}

}  // namespace rtsg
