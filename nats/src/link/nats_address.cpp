// Reads addresses of sessions at NATS servers, and opens connections to them.
#include <rtsg/nats/nats_address.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/module.h>

#include "open_nats.h"

namespace rtsg {

namespace {

constexpr std::size_t kLongestName = 64;
constexpr std::size_t kMinPayload = 16 << 10;  // bytes; a part of a request must fit
constexpr std::chrono::milliseconds kTryAgain{100};

bool isNameCharacter(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
}

Result<> checkHost(std::string_view host) {
    const std::size_t colon = host.rfind(':');
    const bool bare = colon == std::string_view::npos || host.ends_with(']');
    if (host.empty() || colon == 0) return fail("an address of a NATS server names no host");
    if (bare) return {};
    const std::string_view port = host.substr(colon + 1);
    std::uint16_t number = 0;
    const auto [end, problem] = std::from_chars(port.data(), port.data() + port.size(), number);
    if (problem != std::errc() || end != port.data() + port.size() || number == 0)
        return fail(fmt::format("'{}' is no port", port));
    return {};
}

Result<OpenNats> loadNats() {
#ifdef RTSG_NO_NATS
    return fail("nothing goes over NATS: this build leaves it out (libnats-dev was not there, or RTSG_NATS was OFF)");
#else
    const auto symbol = loadModule("rtsg_nats_module", RTSG_NATS_SYMBOL, "NATS needs");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<OpenNats (*)()>(*symbol)();
#endif
}

/// What authenticates us where the address does not: the variables of NATS's own command line.
void readEnvironment(NatsSettings& settings, const NatsAddress& address) {
    const auto read = [](const char* name) {
        const char* const value = std::getenv(name);
        return std::string(value ? value : "");
    };
    settings.authorities = read("NATS_CA");
    settings.certificate = read("NATS_CERT"), settings.key = read("NATS_KEY");
    if (!address.secret.empty()) return;
    settings.credentials = read("NATS_CREDS");
    if (!settings.credentials.empty()) return;
    settings.user = read("NATS_USER"), settings.password = read("NATS_PASSWORD");
}

/// True if another attempt may end otherwise.
bool mayPass(const std::string& problem) {
    return problem.find("uthorization") == std::string::npos && problem.find("uthentication") == std::string::npos &&
           problem.find("SSL") == std::string::npos && problem.find("ecure") == std::string::npos;
}

}  // namespace

bool isNatsAddress(std::string_view text) {
    return text.starts_with("nats://") || text.starts_with("tls://");
}

Result<NatsAddress> NatsAddress::parse(std::string_view text) {
    if (!isNatsAddress(text)) return fail("an address of a NATS server begins with nats:// or tls://");
    const std::size_t begin = text.find("://") + 3;
    const std::string scheme(text.substr(0, begin));
    std::string_view rest = text.substr(begin);
    NatsAddress address;
    // A password may contain a slash, so what authenticates us is taken off first.
    if (const std::size_t at = rest.rfind('@'); at != std::string_view::npos) {
        address.secret = rest.substr(0, at);
        rest = rest.substr(at + 1);
    }
    const std::size_t slash = rest.find('/');
    address.name = slash == std::string_view::npos ? "" : rest.substr(slash + 1);
    if (address.name.empty() || address.name.size() > kLongestName ||
        !std::ranges::all_of(address.name, isNameCharacter))
        return fail(
            fmt::format("an address of a NATS server ends with /NAME, the session: at most {} letters, digits, "
                        "'-' and '_'",
                        kLongestName));
    address.shown = fmt::format("{}{}", scheme, rest);
    std::string_view hosts = rest.substr(0, slash);
    while (true) {
        const std::size_t comma = hosts.find(',');
        const std::string_view host = hosts.substr(0, comma);
        if (auto ok = checkHost(host); !ok) return std::unexpected(ok.error());
        address.servers.push_back(
            fmt::format("{}{}{}{}", scheme, address.secret, address.secret.empty() ? "" : "@", host));
        if (comma == std::string_view::npos) return address;
        hosts = hosts.substr(comma + 1);
    }
}

std::string withoutSecrets(std::string text, const NatsAddress& address) {
    if (address.secret.empty()) return text;
    const std::size_t colon = address.secret.find(':');
    const std::string password = colon == std::string::npos ? address.secret : address.secret.substr(colon + 1);
    for (const std::string& secret : {address.secret, password})
        for (std::size_t at = 0; !secret.empty() && (at = text.find(secret, at)) != std::string::npos;)
            text.replace(at, secret.size(), "***"), at += 3;
    return text;
}

std::vector<std::string> NatsEvent::take(NatsLink& link, const NatsAddress& address) {
    std::vector<std::string> news = link.takeNews();
    for (std::string& text : news) text = withoutSecrets(std::move(text), address);
    if (const bool now = link.connected(); std::exchange(connected_, now) != now)
        news.emplace_back(now ? "the NATS server is there again" : "the connection to the NATS server is lost");
    return news;
}

Result<std::unique_ptr<NatsLink>> openNatsLink(const NatsAddress& address, const std::string& client,
                                               std::chrono::milliseconds patience) {
    const auto open = loadNats();
    if (!open) return std::unexpected(open.error());
    NatsSettings settings;
    settings.servers = address.servers;
    settings.client = client;
    readEnvironment(settings, address);
    const auto end = std::chrono::steady_clock::now() + patience;
    while (true) {
        std::string problem;
        if (std::unique_ptr<NatsLink> link = (*open)(settings, problem)) {
            if (link->maxPayload() >= kMinPayload) return link;
            return fail(fmt::format("the NATS server takes messages of {} bytes, and {} are needed", link->maxPayload(),
                                    kMinPayload),
                        {}, address.shown);
        }
        if (!mayPass(problem) || std::chrono::steady_clock::now() >= end)
            return fail("no connection to the NATS server: " + withoutSecrets(problem, address), {}, address.shown);
        std::this_thread::sleep_for(kTryAgain);
    }
}

}  // namespace rtsg
