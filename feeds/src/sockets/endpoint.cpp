// Reads the names of places, and opens sockets there.
#include "endpoint.h"

#include <arpa/inet.h>
#include <netdb.h>

#include <cerrno>
#include <charconv>
#include <cstring>

#include <fmt/format.h>

namespace rtsg::feeds {

namespace {

constexpr std::uint16_t kMqttPort = 1883, kMqttsPort = 8883;
constexpr int kReceiveBuffer = 4 << 20;  // bytes of datagrams that wait in the system

Result<std::uint16_t> portFrom(std::string_view text) {
    std::uint16_t port = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), port);
    if (problem != std::errc() || end != text.data() + text.size()) return fail(fmt::format("'{}' is no port", text));
    return port;
}

/// The text without what stands before the last '@' of an address.
std::string withoutAccount(std::string_view text) {
    const std::size_t from = text.find("://") + 3, at = text.rfind('@');
    if (at == text.npos || at < from) return std::string(text);
    return fmt::format("{}***{}", text.substr(0, from), text.substr(at));
}

}  // namespace

Result<Endpoint> Endpoint::parse(std::string_view text) {
    Endpoint endpoint;
    endpoint.text = text;
    if (text == "-") {
        endpoint.kind = Kind::standard;
        return endpoint;
    }
    const std::size_t scheme = text.find("://");
    if (scheme == text.npos) {
        if (text.empty()) return fail("an empty name is no place");
        return endpoint;
    }
    const std::string_view kind = text.substr(0, scheme);
    const std::string shown = withoutAccount(text);  // no password stands in a message
    if (text.find('@') < text.find('/', scheme + 3))
        return fail(fmt::format(
            "{}: a name and password do not stand in an address, which others see; a broker's are MQTT_USER "
            "and MQTT_PASSWORD of the environment",
            shown));
    endpoint.encrypted = kind == "mqtts";
    if (kind != "udp" && kind != "tcp" && kind != "mqtt" && kind != "mqtts")
        return fail(
            fmt::format("{}: expected -, a file, udp://HOST:PORT, tcp://HOST:PORT or mqtt://HOST/TOPIC", shown));
    endpoint.kind = kind == "udp" ? Kind::udp : kind == "tcp" ? Kind::tcp : Kind::mqtt;
    std::string_view rest = text.substr(scheme + 3);
    if (endpoint.kind == Kind::mqtt) {
        const std::size_t slash = rest.find('/');
        if (slash == rest.npos || slash + 1 == rest.size())
            return fail(fmt::format("{}: expected {}://HOST/TOPIC", shown, kind));
        endpoint.topic = rest.substr(slash + 1);
        rest = rest.substr(0, slash);
        endpoint.port = endpoint.encrypted ? kMqttsPort : kMqttPort;
    }
    const std::size_t bracket = rest.rfind(']'), colon = rest.rfind(':');
    const bool ported = colon != rest.npos && (bracket == rest.npos || colon > bracket);
    if (!ported && endpoint.kind != Kind::mqtt) return fail(fmt::format("{}: expected {}://HOST:PORT", shown, kind));
    if (ported) {
        const auto port = portFrom(rest.substr(colon + 1));
        if (!port) return fail(fmt::format("{}: {}", shown, shown == text ? port.error().text : "there is no port"));
        endpoint.port = *port;
        rest = rest.substr(0, colon);
    }
    if (rest.starts_with('[') && rest.ends_with(']')) rest = rest.substr(1, rest.size() - 2);
    endpoint.host = rest == "localhost" ? "127.0.0.1" : rest == "*" ? "0.0.0.0" : rest;
    if (endpoint.host.empty()) return fail(fmt::format("{}: there is no host in it", shown));
    return endpoint;
}

Result<Endpoint> Endpoint::ofPort(const std::string& text) {
    auto endpoint = parse("tcp://" + (text.find(':') == text.npos ? "127.0.0.1:" + text : text));
    if (!endpoint) return fail(fmt::format("{}: expected PORT or HOST:PORT", text));
    return endpoint;
}

bool SocketAddress::isLoopback() const {
    if (storage.ss_family == AF_INET)
        return (ntohl(reinterpret_cast<const sockaddr_in&>(storage).sin_addr.s_addr) >> 24) == 127;
    return storage.ss_family == AF_INET6 &&
           IN6_IS_ADDR_LOOPBACK(&reinterpret_cast<const sockaddr_in6&>(storage).sin6_addr);
}

std::uint16_t SocketAddress::port() const {
    return ntohs(storage.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(storage).sin6_port
                                               : reinterpret_cast<const sockaddr_in&>(storage).sin_port);
}

std::string systemError(std::string_view what, const Endpoint& endpoint) {
    return fmt::format("cannot {} {}: {}", what, endpoint.text, std::strerror(errno));
}

Result<SocketAddress> findAddress(const Endpoint& endpoint) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = endpoint.kind == Endpoint::Kind::udp ? SOCK_DGRAM : SOCK_STREAM;
    hints.ai_family = AF_UNSPEC;
    const int wrong = ::getaddrinfo(endpoint.host.c_str(), std::to_string(endpoint.port).c_str(), &hints, &found);
    if (wrong != 0) return fail(fmt::format("{}: {}", endpoint.text, ::gai_strerror(wrong)));
    SocketAddress result;
    std::memcpy(&result.storage, found->ai_addr, found->ai_addrlen);
    result.length = found->ai_addrlen;
    ::freeaddrinfo(found);
    return result;
}

Result<Descriptor> listenAt(Endpoint& endpoint, bool insecure) {
    const auto address = findAddress(endpoint);
    if (!address) return std::unexpected(address.error());
    if (!insecure && !address->isLoopback())
        return fail(DiagnosticCode("keys"),
                    fmt::format("{} can be reached from other machines, and feeds have no keys", endpoint.text));
    const bool datagrams = endpoint.kind == Endpoint::Kind::udp;
    const int type = datagrams ? SOCK_DGRAM : SOCK_STREAM;
    Descriptor socket(::socket(address->storage.ss_family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (socket.get() < 0) return fail(systemError("open a socket for", endpoint));
    const int yes = 1;
    if (datagrams) {
        (void)::setsockopt(socket.get(), SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof(kReceiveBuffer));
        // With each datagram comes how many the system has left out.
        (void)::setsockopt(socket.get(), SOL_SOCKET, SO_RXQ_OVFL, &yes, sizeof(yes));
    } else {
        (void)::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    }
    if (::bind(socket.get(), address->get(), address->length) != 0 || (!datagrams && ::listen(socket.get(), 64) != 0))
        return fail(systemError("listen at", endpoint));
    SocketAddress real;
    real.length = sizeof(real.storage);
    if (::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&real.storage), &real.length) != 0)
        return fail(systemError("listen at", endpoint));
    endpoint.port = real.port();
    const std::string host = endpoint.host.find(':') == std::string::npos ? endpoint.host : "[" + endpoint.host + "]";
    endpoint.text = fmt::format("{}://{}:{}", datagrams ? "udp" : "tcp", host, endpoint.port);
    return socket;
}

Result<Descriptor> sendTo(const Endpoint& endpoint) {
    const auto address = findAddress(endpoint);
    if (!address) return std::unexpected(address.error());
    Descriptor socket(::socket(address->storage.ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (socket.get() < 0) return fail(systemError("open a socket for", endpoint));
    const int yes = 1;
    (void)::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &yes, sizeof(yes));
    if (::connect(socket.get(), address->get(), address->length) != 0) return fail(systemError("send to", endpoint));
    return socket;
}

}  // namespace rtsg::feeds
