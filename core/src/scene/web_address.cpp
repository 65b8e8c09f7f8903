// Reading http and https addresses, and bringing them into one form.
#include <rtsg/core/web_address.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>
#include <vector>

#include <arpa/inet.h>
#include <fmt/format.h>

#include <rtsg/core/resource.h>

#include "resource_url.h"

namespace rtsg {

namespace {

constexpr std::uint16_t kPlainPort = 80, kSecurePort = 443;
constexpr std::size_t kLongestAddress = 8000, kLongestHost = 253;

bool isLetter(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}
bool isDigit(char c) {
    return c >= '0' && c <= '9';
}
bool isHexDigit(char c) {
    return isDigit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F');
}
char lower(char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

/// Whether a character may stand in a path or query without encoding.
bool mayStand(char c) {
    return isLetter(c) || isDigit(c) || (c != '\0' && std::strchr("-._~!$&'()*+,;=:@/?", c) != nullptr);
}

/// Percent signs that begin no %XX are encoded, too.
std::string encoded(std::string_view text) {
    std::string result;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const bool isEncoded =
            text[i] == '%' && i + 2 < text.size() && isHexDigit(text[i + 1]) && isHexDigit(text[i + 2]);
        if (isEncoded || mayStand(text[i]))
            result += text[i];
        else
            result += fmt::format("%{:02X}", static_cast<unsigned char>(text[i]));
    }
    return result;
}

/// How many dots a segment is, if it is one or two of them and nothing else; a server takes %2e for a dot.
int dotsOf(std::string_view segment) {
    std::string plain = detail::percentDecoded(segment);
    return plain == "." ? 1 : plain == ".." ? 2 : 0;
}

/// The path without dot segments, as RFC 3986, 5.2.4 has it. `path` begins with a slash.
std::string withoutDots(std::string_view path) {
    std::vector<std::string_view> kept;
    bool endsInSlash = false;
    for (std::size_t at = 0; at < path.size();) {
        const std::size_t next = std::min(path.find('/', at + 1), path.size());
        const std::string_view segment = path.substr(at + 1, next - at - 1);
        const int dots = dotsOf(segment);
        if (dots == 0) kept.push_back(segment);
        if (dots == 2 && !kept.empty()) kept.pop_back();
        endsInSlash = dots > 0;
        at = next;
    }
    std::string result;
    for (const std::string_view segment : kept) result.append("/").append(segment);
    if (endsInSlash || result.empty()) result += '/';
    return result;
}

/// `path?query`, encoded, without dots.
std::string pathOf(std::string_view text) {
    const std::size_t question = std::min(text.find('?'), text.size());
    std::string path(text.substr(0, question));
    if (!path.starts_with('/')) path.insert(0, "/");
    return withoutDots(encoded(path)) + encoded(text.substr(question));
}

Result<> readHost(std::string_view text, WebAddress& address) {
    if (text.starts_with('[')) {
        const std::string inner(text.substr(1, text.size() - std::min<std::size_t>(text.size(), 2)));
        in6_addr bytes{};
        if (!text.ends_with(']') || inet_pton(AF_INET6, inner.c_str(), &bytes) != 1)
            return fail(fmt::format("'{}' is no IPv6 address", text));
        char plain[INET6_ADDRSTRLEN];
        address.host = inet_ntop(AF_INET6, &bytes, plain, sizeof plain);
        return {};
    }
    address.host = text;
    std::ranges::transform(address.host, address.host.begin(), lower);
    if (address.host.ends_with('.')) address.host.pop_back();
    const auto good = [](char c) { return isLetter(c) || isDigit(c) || c == '.' || c == '-' || c == '_'; };
    if (address.host.empty() || address.host.size() > kLongestHost || address.host.starts_with('-') ||
        !std::ranges::all_of(address.host, good))
        return fail("its host is no name of letters, digits, dots and hyphens");
    return {};
}

Result<> readPort(std::string_view text, WebAddress& address) {
    address.port = address.isSecure ? kSecurePort : kPlainPort;
    if (text.empty()) return {};
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), address.port);
    if (problem != std::errc() || end != text.data() + text.size() || address.port == 0)
        return fail(fmt::format("'{}' is no port", text));
    return {};
}

Result<WebAddress> parsed(std::string_view text) {
    WebAddress address;
    address.isSecure = lower(text[4]) == 's';
    text = text.substr(text.find(':') + 3);
    const std::size_t end = std::min(text.find_first_of("/?"), text.size());
    std::string_view authority = text.substr(0, end);
    if (authority.contains('@')) return fail("a name or password in an address is not sent");
    const std::size_t bracket = authority.rfind(']');
    const std::size_t colon = authority.find(':', bracket == authority.npos ? 0 : bracket);
    if (auto ok = readHost(authority.substr(0, colon), address); !ok) return std::unexpected(ok.error());
    if (auto ok = readPort(colon == authority.npos ? "" : authority.substr(colon + 1), address); !ok)
        return std::unexpected(ok.error());
    address.path = pathOf(text.substr(end));
    return address;
}

}  // namespace

bool isWebAddress(std::string_view text) {
    const std::string_view known[] = {"http://", "https://"};
    return std::ranges::any_of(known, [&](std::string_view scheme) {
        return text.size() >= scheme.size() &&
               std::ranges::equal(text.substr(0, scheme.size()), scheme, {}, [](char c) { return lower(c); });
    });
}

Result<WebAddress> WebAddress::parse(std::string_view text) {
    text = text.substr(0, text.find('#'));
    if (!isWebAddress(text)) return fail("it begins neither with http:// nor with https://");
    if (text.size() > kLongestAddress) return fail(fmt::format("it has more than {} bytes", kLongestAddress));
    return parsed(text);
}

Result<WebAddress> WebAddress::resolve(std::string_view reference) const {
    reference = reference.substr(0, reference.find('#'));
    if (isWebAddress(reference)) return parse(reference);
    const std::size_t colon = reference.find_first_of(":/?");
    if (colon != reference.npos && colon > 1 && reference[colon] == ':')
        return fail(fmt::format("'{}:' is neither http: nor https:", urlForMessage(reference.substr(0, colon))));
    if (reference.starts_with("//")) return parse((isSecure ? "https:" : "http:") + std::string(reference));
    if (reference.size() > kLongestAddress) return fail(fmt::format("it has more than {} bytes", kLongestAddress));
    WebAddress result = *this;
    const std::string_view own = std::string_view(path).substr(0, path.find('?'));
    if (reference.empty()) return result;
    if (reference.starts_with('/'))
        result.path = pathOf(reference);
    else if (reference.starts_with('?'))
        result.path = pathOf(std::string(own) + std::string(reference));
    else
        result.path = pathOf(std::string(own.substr(0, own.rfind('/') + 1)) + std::string(reference));
    return result;
}

bool WebAddress::isBelow(const WebAddress& prefix) const {
    if (isSecure != prefix.isSecure || host != prefix.host || port != prefix.port) return false;
    if (!path.starts_with(prefix.path)) return false;
    return prefix.path.ends_with('/') || path.size() == prefix.path.size() || path[prefix.path.size()] == '/' ||
           path[prefix.path.size()] == '?';
}

std::string WebAddress::text() const {
    const bool isNumeric = host.contains(':');
    const bool isUsual = port == (isSecure ? kSecurePort : kPlainPort);
    return fmt::format("{}://{}{}{}{}{}", isSecure ? "https" : "http", isNumeric ? "[" : "", host, isNumeric ? "]" : "",
                       isUsual ? "" : fmt::format(":{}", port), path);
}

std::string base64(std::span<const std::byte> bytes) {
    constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const auto at = [&](std::size_t k) {
            return k < bytes.size() ? static_cast<unsigned>(std::to_integer<unsigned char>(bytes[k])) : 0U;
        };
        const unsigned word = at(i) << 16 | at(i + 1) << 8 | at(i + 2);
        out += kDigits[word >> 18];
        out += kDigits[word >> 12 & 63];
        out += i + 1 < bytes.size() ? kDigits[word >> 6 & 63] : '=';
        out += i + 2 < bytes.size() ? kDigits[word & 63] : '=';
    }
    return out;
}

std::optional<std::string> base64Decoded(std::string_view text) {
    const auto digit = [](char c) {
        if (c >= 'A' && c <= 'Z') return c - 'A';
        if (c >= 'a' && c <= 'z') return c - 'a' + 26;
        if (c >= '0' && c <= '9') return c - '0' + 52;
        return c == '+' || c == '-' ? 62 : c == '/' || c == '_' ? 63 : -1;
    };
    std::string result;
    result.reserve(text.size() / 4 * 3 + 3);
    std::uint32_t bits = 0;
    int count = 0;
    for (const char c : text) {
        if (c == '=') break;
        if (std::isspace(static_cast<unsigned char>(c))) continue;
        const int value = digit(c);
        if (value < 0) return std::nullopt;
        bits = bits << 6 | static_cast<std::uint32_t>(value);
        count += 6;
        if (count < 8) continue;
        count -= 8;
        result.push_back(static_cast<char>(bits >> count & 255u));
    }
    return count == 6 ? std::nullopt : std::optional(std::move(result));
}

}  // namespace rtsg
