// Transport, Listener, Connection: how messages of mirrors travel. Server, client, relay and shadow know these alone;
// ZeroMQ, WebSockets and queues within a process are behind them, with their keys, certificates and descriptors.
//
// A message has a first part, and perhaps a second one with bytes of a record. Messages of one connection come whole,
// once and in order, or the connection ends. Nobody waits in send(): what a slow reader has not read yet is bounded by
// the credit that the protocol gives (PROTOCOL.md), and a second part with an owner is not copied but kept alive.
// Readers of strangers' messages read as many as they like, and the rest waits at the sender.
// Threading: a listener or connection belongs to one thread after another; a transport to any.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

#include "clock.h"

struct pollfd;

namespace rtsg {

struct MirrorKeys;

/// A message that has come. The parts are valid until the next one is received.
struct Received {
    std::string from;  // at a listener: the connection, by which to answer
    std::string user;  // the public key with which it was admitted; empty without keys
    std::span<const std::byte> first, second;
    const char* problem = nullptr;  // it is no message of ours; what it is instead
};

using SharedBytes = std::shared_ptr<const void>;

/// Peers connect to it.
class Listener {
  public:
    static constexpr std::size_t kDescriptors = 4;
    using Items = std::span<pollfd, kDescriptors>;
    /// What went wrong since the last call, in numbers of connections.
    struct Failures {
        std::uint64_t refused = 0, garbage = 0, endless = 0;
    };

    virtual ~Listener() = default;
    /// Where others connect to, with the port filled in.
    virtual const std::string& endpoint() const = 0;
    /// Says what to wait at, and for how long at most; 0 if something may have come that no descriptor tells. `busy`:
    /// much is sent these days.
    virtual Clock::duration prepare(Items items, bool busy) = 0;
    /// Call it after the wait. False if no messages have come.
    virtual bool came(Items items) = 0;
    /// False if there is no message left.
    virtual bool receive(Received& message) = 0;
    /// Call it when messages have been received; `drained` says that none was left.
    virtual Failures received(bool drained) = 0;
    /// False if that connection is gone. `second` is not copied if it has an owner; more peers may get the same.
    virtual bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second = {},
                      const SharedBytes& owner = {}) = 0;

    /// The most bytes of a second part to peers that read the same, or 0 if each peer reads by itself. All that follow
    /// read what goes to kFollowers, and all that wait for a state read what goes to kJoiners. The listener speaks for
    /// kFollowers: it acknowledges what has gone out, and answers a goodbye.
    virtual std::size_t broadcasts() const { return 0; }
    static constexpr std::string_view kFollowers{}, kJoiners{"*"};
};

/// Leads to one listener. It connects by itself, and again after each end.
class Connection {
  public:
    enum class Event : std::uint8_t { none, up, down };

    virtual ~Connection() = default;
    virtual bool send(std::span<const std::byte> first, std::span<const std::byte> second = {}) = 0;
    /// False if there is no message; then one may be waited for.
    virtual bool receive(Received& message) = 0;
    /// False if messages may be there that no descriptor tells.
    virtual bool foundEmpty() const = 0;
    /// The first is readable when a message has come since none was found, the second when an event has; -1: none.
    virtual std::array<int, 2> descriptors() const = 0;
    /// The next event. Messages from before an end are still received after it.
    virtual Event nextEvent() = 0;
    /// Ends the connection, if there is one, and makes another; it takes no attempt for lost before `within`.
    virtual void reconnect(std::chrono::milliseconds within) = 0;
    /// Bytes that have come by the newest connection, those of unfinished messages too, where that can be known.
    virtual std::optional<std::uint64_t> bytesCome() const { return std::nullopt; }
};

struct ListenSettings {
    const MirrorKeys* keys = nullptr;  // null: everybody is admitted. The list in it may change
    std::size_t longest = 0;           // bytes of a part that peers may send
    int wake = -1;                     // readable when the listener's thread has more to do than wait
};

struct ConnectSettings {
    const MirrorKeys* keys = nullptr;
    std::chrono::milliseconds within{2000};  // for an attempt to connect
};

class Transport {
  public:
    virtual ~Transport() = default;
    virtual Clock& clock() = 0;
    /// True if only this machine reaches the endpoint. Error: it is none.
    virtual Result<bool> isLocal(const std::string& endpoint) const = 0;
    virtual Result<std::unique_ptr<Listener>> listen(const std::string& endpoint, const ListenSettings& settings) = 0;
    virtual Result<std::unique_ptr<Connection>> connect(const std::string& endpoint,
                                                        const ConnectSettings& settings) = 0;
};

/// tcp:// and ipc:// endpoints, by ZeroMQ and the system's clock.
std::shared_ptr<Transport> zmqTransport();

}  // namespace rtsg
