// Taking urls apart: scheme, path, fragment, percent encoding, and the content of data: urls.
#include "resource_url.h"

#include <algorithm>
#include <cctype>

#include <rtsg/core/resource.h>
#include <rtsg/core/web_address.h>

namespace rtsg {

namespace detail {

namespace {

int hexDigit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

/// "http", "urn", "file" ...; empty for a plain path. One letter is a drive of Windows, not a scheme.
std::string_view schemeOf(std::string_view url) {
    const std::size_t colon = url.find(':');
    if (colon == std::string_view::npos || colon < 2) return {};
    for (const char c : url.substr(0, colon))
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '+' && c != '-' && c != '.') return {};
    return url.substr(0, colon);
}

bool equalsIgnoringCase(std::string_view a, std::string_view b) {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i)
        if (std::tolower(static_cast<unsigned char>(a[i])) != b[i]) return false;
    return true;
}

}  // namespace

std::string percentDecoded(std::string_view text) {
    std::string result;
    result.reserve(text.size());
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%' && i + 2 < text.size() && hexDigit(text[i + 1]) >= 0 && hexDigit(text[i + 2]) >= 0) {
            result.push_back(static_cast<char>(hexDigit(text[i + 1]) * 16 + hexDigit(text[i + 2])));
            i += 2;
        } else {
            result.push_back(text[i]);
        }
    }
    return result;
}

UrlParts splitUrl(std::string_view url) {
    UrlParts parts;
    const std::string_view scheme = schemeOf(url);
    if (equalsIgnoringCase(scheme, "data")) {
        // A '#' in its content, in a script say, starts no fragment.
        parts.kind = UrlParts::Kind::data;
        parts.encoded = url;
        return parts;
    }
    if (const std::size_t hash = url.find('#'); hash != std::string_view::npos) {
        parts.fragment = percentDecoded(url.substr(hash + 1));
        url = url.substr(0, hash);
    }
    parts.encoded = url;
    parts.hasScheme = !scheme.empty();
    if (isWebAddress(url)) {
        parts.kind = UrlParts::Kind::web;
    } else if (equalsIgnoringCase(scheme, "file")) {
        url.remove_prefix(scheme.size() + 1);
        if (url.starts_with("//")) {
            url.remove_prefix(2);
            const std::string_view host = url.substr(0, url.find('/'));
            if (!host.empty() && !equalsIgnoringCase(host, "localhost")) parts.kind = UrlParts::Kind::other;
            url.remove_prefix(host.size());
        }
    } else if (equalsIgnoringCase(scheme, "package") || equalsIgnoringCase(scheme, "model")) {
        url.remove_prefix(scheme.size() + 1);
        url.remove_prefix(std::min(url.find_first_not_of('/'), url.size()));
        const std::size_t slash = std::min(url.find('/'), url.size());
        parts.kind = UrlParts::Kind::package;
        parts.package = percentDecoded(url.substr(0, slash));
        url.remove_prefix(std::min(slash + 1, url.size()));
    } else if (!scheme.empty()) {
        parts.kind = UrlParts::Kind::other;
    }
    parts.path = percentDecoded(url);
    return parts;
}

std::optional<DataUrl> decodeDataUrl(std::string_view url) {
    const std::size_t comma = url.find(',');
    const std::size_t colon = url.find(':');
    if (comma == std::string_view::npos || colon == std::string_view::npos || colon > comma) return std::nullopt;
    const std::string_view head = url.substr(colon + 1, comma - colon - 1), body = url.substr(comma + 1);
    DataUrl result;
    result.mediaType = head.substr(0, head.find(';'));
    result.bytes = percentDecoded(body);
    if (!head.ends_with(";base64")) return result;
    auto bytes = base64Decoded(result.bytes);
    if (!bytes) return std::nullopt;
    result.bytes = std::move(*bytes);
    return result;
}

}  // namespace detail

std::string urlFragment(std::string_view url) {
    return detail::splitUrl(url).fragment;
}

std::string urlForMessage(std::string_view url) {
    constexpr std::size_t kLongest = 200;
    if (url.size() <= kLongest) return std::string(url);
    return std::string(url.substr(0, kLongest)) + "...";
}

std::string joinUrls(std::string_view outer, std::string_view inner) {
    const detail::UrlParts in = detail::splitUrl(inner), out = detail::splitUrl(outer);
    if (in.kind == detail::UrlParts::Kind::data) return "data:";
    if (out.kind == detail::UrlParts::Kind::web && in.kind == detail::UrlParts::Kind::file && !in.hasScheme)
        if (const auto base = WebAddress::parse(out.encoded))
            if (const auto joined = base->resolve(in.encoded)) return joined->text();
    const bool isRelative = in.kind == detail::UrlParts::Kind::file && !in.path.starts_with('/');
    const std::size_t slash = out.encoded.rfind('/');
    if (!isRelative || slash == std::string_view::npos) return std::string(in.encoded);
    return std::string(out.encoded.substr(0, slash + 1)) + std::string(in.encoded);
}

}  // namespace rtsg
