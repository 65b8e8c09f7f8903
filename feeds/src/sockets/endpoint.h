// Place: where a feed comes from or goes to: "-", a file, udp://, tcp://, mqtt:// or mqtts://.
//
// Threading: values.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <cstdint>
#include <string>
#include <string_view>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg::feeds {

struct Endpoint {
    enum class Kind : std::uint8_t { standard, file, udp, tcp, mqtt };
    Kind kind = Kind::file;
    std::string text;  // as it was typed
    std::string host, topic;
    std::uint16_t port = 0;
    bool encrypted = false;  // mqtts://

    static Result<Endpoint> parse(std::string_view text);
    /// "9100" on loopback, or "HOST:9100", for connections.
    static Result<Endpoint> ofPort(const std::string& text);
    bool isSocket() const { return kind != Kind::standard && kind != Kind::file; }
};

struct SocketAddress {
    sockaddr_storage storage{};
    socklen_t length = 0;

    const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
    bool isLoopback() const;
    std::uint16_t port() const;
};

/// Looks the host up, which may take its time.
Result<SocketAddress> findAddress(const Endpoint& endpoint);
/// Opens a listening, non-blocking socket. `place.port` becomes the real one. Errors: those of the system; an address
/// that others can reach, unless `insecure`.
Result<Descriptor> listenAt(Endpoint& endpoint, bool insecure);
/// Opens a socket for datagrams to that place.
Result<Descriptor> sendTo(const Endpoint& endpoint);
/// "cannot WHAT PLACE: " and the system's message.
std::string systemError(std::string_view what, const Endpoint& endpoint);

}  // namespace rtsg::feeds
