// The way of a mirror's client to its server: one connection, made again and again until it stands, and the messages
// that go by it.
//
// Two kinds. ZmtpLink speaks ZeroMQ's protocol itself, on the client's thread: a ZeroMQ socket reads on a thread of its
// own and wakes its owner, which was half of what a replica cost for each frame. ZmqLink is such a socket, for what the
// other leaves to it: keys (CURVE), names of hosts, other transports.
// Invariant: events come in their place among the messages; what came before a connection was cut is handed over first.
// Threading: the replica's thread.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/mirror_keys.h>

namespace rtsg {

class MirrorLink {
  public:
    enum class Event { up, cut };
    /// Of one part or two; `parts`: how many came, of which only the first two are here.
    struct Message {
        std::span<const std::byte> first, second;
        std::size_t parts = 0;
    };
    static constexpr std::chrono::milliseconds kLinger{100};          // for the goodbye
    static constexpr std::chrono::milliseconds kReconnect{10};        // between attempts
    static constexpr std::chrono::milliseconds kConnectWithin{2000};  // what an attempt may take, at first
    static constexpr std::size_t kLongestMessage = std::size_t{16} << 20;

    MirrorLink() = default;
    MirrorLink(const MirrorLink&) = delete;
    MirrorLink& operator=(const MirrorLink&) = delete;
    virtual ~MirrorLink() = default;
    /// The first attempt to connect begins. Errors: an endpoint or keys that cannot be.
    virtual Result<> start() = 0;
    /// False when nothing can be sent for now. Nothing is kept for the next connection.
    virtual bool send(std::span<const std::byte> first, std::span<const std::byte> second = {}) = 0;
    /// The next of those that have come; its bytes are there until the link is used again for anything but sending.
    virtual std::optional<Message> receive() = 0;
    /// At most so long for a message or an event, and not at all while there is one; false if there is none.
    virtual bool wait(std::chrono::milliseconds most) = 0;
    virtual std::optional<Event> nextEvent() = 0;
    /// Ends the connection, without an event, and makes another, each attempt at which may take so long.
    virtual void reconnect(std::chrono::milliseconds within) = 0;
    /// Of the newest connection.
    virtual int descriptor() const = 0;
};

std::unique_ptr<MirrorLink> makeLink(const std::string& endpoint, const std::optional<MirrorKeys>& keys);

}  // namespace rtsg
