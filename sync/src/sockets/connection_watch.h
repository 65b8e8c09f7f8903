// Ends connections on which bytes come but no message does.
//
// ZeroMQ hands a message of several parts over when its last part has come, keeps the parts until then, and limits the
// size of each but not their number. So the watch compares what the system has received on a connection with what has
// been handed over from it, and shuts a connection that is more than a message of ours behind.
// Of local (ipc) connections the system tells only whether bytes wait. Bytes that came belong to a message that is soon
// complete, so one on which they wait again and again while no message comes is shut as well.
// While nothing comes it need not look: rest() has the system tell when something does.
// Invariant: what waits in an unfinished message is at most kMostUnfinished and what comes between two looks; of a
// local connection what comes in kBusyFor, if it comes fast, and some megabytes at most, if slowly, as it is seldom
// caught at it. Threading: one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <set>
#include <unordered_map>

#include "zmq_socket.h"

namespace rtsg {

/// What has come on a TCP connection, whether it has been read or not, bytes; nothing for what is none.
std::optional<std::uint64_t> bytesReceived(int descriptor);

class ConnectionWatch {
  public:
    using Clock = std::chrono::steady_clock;
    /// The longest honest message, what ZeroMQ reads at once, and as much again.
    static constexpr std::uint64_t kMostUnfinished = 64 << 10;
    /// As above while messages wait to be taken: all that ZeroMQ lets wait of one connection.
    static constexpr std::uint64_t kMostWaiting = 2 << 20;
    /// Looks at which bytes wait on a local connection without a message since the first, and the time they span.
    static constexpr unsigned kBusyLooks = 4;
    static constexpr std::chrono::milliseconds kBusyFor{50};
    static constexpr std::chrono::milliseconds kBusyForWhileOthersWait{2000};

    ConnectionWatch();
    ~ConnectionWatch();
    ConnectionWatch(const ConnectionWatch&) = delete;
    ConnectionWatch& operator=(const ConnectionWatch&) = delete;

    void opened(int descriptor) { connections_[descriptor] = {.delivered = early_.erase(descriptor) > 0}; }
    void closed(int descriptor) { connections_.erase(descriptor); }
    bool any() const { return !connections_.empty(); }
    /// One may be sending a message without end: look again soon.
    bool suspicious() const { return suspicious_; }
    /// Before messages are taken: how much has come on each. Not more often than it is worth.
    void look(Clock::time_point now);
    /// A message has been taken from its connection, of which it may not be known yet that it is open.
    void delivered(const ZmqMessage& message);
    void delivered(int descriptor);
    /// False while bytes come that belong to no message yet: look again in a while. Else descriptor() is readable once
    /// any come.
    bool rest();
    int descriptor() const { return events_; }
    /// After look(); `drained`: no message was left. Returns how many connections were shut.
    std::size_t shutEndless(bool drained);

  private:
    struct Connection {
        std::uint64_t come = 0;     // bytes that ZeroMQ has read of it, when looked at last
        std::uint64_t settled = 0;  // of these, after the last time that messages were delivered
        bool delivered = false;     // since then
        bool counted = true;        // the system tells how much has come
        bool stirs = true;          // bytes have come that no message has brought
        bool armed = false;         // `events_` tells when something comes
        unsigned busy = 0;          // else: looks at which bytes waited, since a message was delivered
        Clock::time_point busySince{};
    };
    void takeEvents();
    bool endless(int descriptor, Connection& connection, bool drained) const;
    bool endlessLocal(Connection& connection, bool drained) const;

    std::unordered_map<int, Connection> connections_;
    std::set<int> early_;  // connections that messages came from before it was known that they are open
    Clock::time_point looked_{};
    bool fresh_ = false;  // a look that shutEndless has not followed yet
    bool suspicious_ = false;
    int events_ = -1;  // epoll
};

}  // namespace rtsg
