// DisTransport: takes datagrams from somewhere and brings them there.
//
// Invariant: no call waits for a datagram. Threading: one thread. Source: IEEE 1278.2-2015 (UDP, multicast, broadcast);
// ISO/IEC 19775-1 V4.0, clause 28 (address, port, multicastRelayHost).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct DisAddress {
    std::string host;  // a name or number; "localhost" is 127.0.0.1
    std::uint16_t port = 0;
    friend auto operator<=>(const DisAddress&, const DisAddress&) = default;
};

class DisTransport {
  public:
    virtual ~DisTransport() = default;
    /// From now on what comes to the address is kept for receive(). A group that cannot be joined falls back to the
    /// relay, if there is one: then what comes to the address's port of this machine is. Error: the system's.
    virtual Result<> listen(const DisAddress& address, const DisAddress& relay) = 0;
    virtual void stopListening(const DisAddress& address) = 0;
    /// Up to `most` datagrams, in order; what is left over waits. Does not wait itself. Returns how many there were.
    virtual std::size_t receive(const DisAddress& address, std::size_t most,
                                const std::function<void(std::span<const std::uint8_t>)>& take) = 0;
    /// Error: the system's; a datagram that finds no room is lost, as on the way.
    virtual Result<> send(const DisAddress& address, const DisAddress& relay, std::span<const std::uint8_t> bytes) = 0;
};
/// A transport over the system's sockets: unicast, broadcast and multicast, IPv4 and IPv6.
std::unique_ptr<DisTransport> udpTransport();

}  // namespace rtsg
