// DisTransport: sends and receives datagrams.
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
    /// From now on, datagrams to the address are kept for receive(). If a multicast group cannot be joined and there is
    /// a relay, datagrams to the address's port on this machine are kept instead. Error: the system's.
    virtual Result<> listen(const DisAddress& address, const DisAddress& relay) = 0;
    virtual void stopListening(const DisAddress& address) = 0;
    /// Passes up to `most` datagrams to `take`, in order, without waiting; others stay in the queue. Returns their
    /// number.
    virtual std::size_t receive(const DisAddress& address, std::size_t maximum,
                                const std::function<void(std::span<const std::uint8_t>)>& take) = 0;
    /// Error: the system's. A datagram that finds no room is lost, as it could be on its way.
    virtual Result<> send(const DisAddress& address, const DisAddress& relay, std::span<const std::uint8_t> bytes) = 0;
};
/// A transport over the system's sockets: unicast, broadcast and multicast, IPv4 and IPv6.
std::unique_ptr<DisTransport> udpTransport();

}  // namespace rtsg
