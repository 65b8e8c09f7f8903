// ConnectionWatch: shuts connections on which bytes arrive but no messages.
//
// ZeroMQ hands over a message when its last part has come. Until then it keeps the parts, and limits their size but not
// their number. So the watch compares what the system has received on a connection with what was handed over, and shuts
// a connection that is more than one message of ours behind. For local (ipc) connections the system only tells whether
// bytes wait. Bytes belong to a message that is soon complete, so a connection is shut, too, if bytes wait on it again
// and again and no message comes. While nothing comes there is no need to look: after rest() the system tells when
// something does.
// Invariant: an unfinished message has at most kMaxUnfinished bytes and what comes between two looks. A local
// connection may bring what comes in kBusyFor, or some megabytes if it is so slow that it is rarely seen with bytes.
// Threading: one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <set>
#include <unordered_map>

#include "zmq_socket.h"

namespace rtsg {

/// Bytes that have come on a TCP connection, read or not. Nothing if the descriptor is none.
std::optional<std::uint64_t> bytesReceived(int descriptor);

class ConnectionWatch {
  public:
    using Clock = std::chrono::steady_clock;
    /// Twice the longest honest message and what ZeroMQ reads at once.
    static constexpr std::uint64_t kMaxUnfinished = 64 << 10;
    /// The same while messages wait to be taken: all that ZeroMQ lets wait on one connection.
    static constexpr std::uint64_t kMaxWaiting = 2 << 20;
    /// The number of looks at which bytes wait on a local connection without a message, and the time from the first to
    /// the last.
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
    /// True if some connection may be sending an endless message. Look again soon.
    bool suspicious() const { return suspicious_; }
    /// Notes how much has come on each connection; call it before messages are taken. It skips looks that are too
    /// frequent.
    void look(Clock::time_point now);
    /// Notes that a message was taken. Its connection may not be known as open yet.
    void delivered(const ZmqMessage& message);
    void delivered(int descriptor);
    /// Returns false while bytes come that belong to no message yet; then look again in a while. Otherwise descriptor()
    /// becomes readable when bytes come.
    bool rest();
    int descriptor() const { return events_; }
    /// Call it after look(). `drained` says that no message was left. Returns how many connections were shut.
    std::size_t shutEndless(bool drained);

  private:
    struct Connection {
        std::uint64_t come = 0;     // bytes that ZeroMQ had read at the last look
        std::uint64_t settled = 0;  // the same, when messages were last delivered
        bool delivered = false;     // a message has come since then
        bool counted = true;        // the system tells how many bytes have come
        bool stirs = true;          // bytes have come without a message
        bool armed = false;         // `events_` tells when bytes come
        unsigned busy = 0;          // otherwise: looks at which bytes waited since the last message
        Clock::time_point busySince{};
    };
    void takeEvents();
    bool endless(int descriptor, Connection& connection, bool drained) const;
    bool endlessLocal(Connection& connection, bool drained) const;

    std::unordered_map<int, Connection> connections_;
    std::set<int> early_;  // connections that brought messages before they were known as open
    Clock::time_point looked_{};
    bool fresh_ = false;  // there was a look, and shutEndless() has not followed yet
    bool suspicious_ = false;
    int events_ = -1;  // epoll
};

}  // namespace rtsg
