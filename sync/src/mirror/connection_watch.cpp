// Reads from the system how many bytes each connection has brought, and shuts those that bring no messages.
#include "connection_watch.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

namespace rtsg {

namespace {

constexpr auto kLookEvery = std::chrono::milliseconds(5), kLookAgain = std::chrono::milliseconds(1);
constexpr auto kLookCosts = std::chrono::microseconds(60);  // a connection: so that looking takes some percent at most

/// Bytes received on a TCP connection, less those that wait in the system; nothing for what is none.
std::optional<std::uint64_t> bytesRead(int descriptor) {
    int waiting = 0;
    const std::optional<std::uint64_t> received = bytesReceived(descriptor);
    if (!received || ::ioctl(descriptor, SIOCINQ, &waiting) != 0) return std::nullopt;
    const auto left = static_cast<std::uint64_t>(waiting);
    return *received > left ? *received - left : 0;
}

bool bytesWait(int descriptor) {
    int waiting = 0;
    return ::ioctl(descriptor, SIOCINQ, &waiting) == 0 && waiting > 0;
}

}  // namespace

std::optional<std::uint64_t> bytesReceived(int descriptor) {
    tcp_info info{};
    socklen_t length = sizeof(info);
    if (::getsockopt(descriptor, IPPROTO_TCP, TCP_INFO, &info, &length) != 0) return std::nullopt;
    if (length < offsetof(tcp_info, tcpi_bytes_received) + sizeof(info.tcpi_bytes_received)) return std::nullopt;
    return info.tcpi_bytes_received;
}

void ConnectionWatch::look(Clock::time_point now) {
    early_.clear();  // what has been opened is known before each look
    const Clock::duration every = suspicious_ ? kLookAgain : kLookEvery;
    if (now - looked_ < std::max(every, Clock::duration(kLookCosts * connections_.size()))) return;
    looked_ = now;
    fresh_ = true;
    suspicious_ = false;
    for (auto& [descriptor, connection] : connections_) {
        if (connection.delivered) continue;  // a message has come: nothing to be found on it this time
        const std::optional<std::uint64_t> received = bytesReceived(descriptor);
        connection.counted = received.has_value();
        // Where little has come it does not matter whether ZeroMQ has read all of it: half the calls, for each peer.
        const bool little = connection.counted && *received <= connection.settled + kMostUnfinished;
        connection.come = little ? *received : bytesRead(descriptor).value_or(0);
        if (!connection.counted && bytesWait(descriptor) && connection.busy++ == 0) connection.busySince = now;
        suspicious_ = suspicious_ || connection.busy > 0;
    }
}

void ConnectionWatch::delivered(const ZmqMessage& message) {
    delivered(zmq_msg_get(message.get(), ZMQ_SRCFD));
}

void ConnectionWatch::delivered(int descriptor) {
    const auto found = connections_.find(descriptor);
    if (found != connections_.end())
        found->second.delivered = true;
    else if (descriptor >= 0)
        early_.insert(descriptor);
}

bool ConnectionWatch::endlessLocal(Connection& connection, bool drained) const {
    if (std::exchange(connection.delivered, false)) connection.busy = 0;
    return connection.busy >= kBusyLooks &&
           looked_ - connection.busySince >= (drained ? kBusyFor : kBusyForWhileOthersWait);
}

bool ConnectionWatch::endless(int descriptor, Connection& connection, bool drained) const {
    if (!connection.counted) return endlessLocal(connection, drained);
    if (std::exchange(connection.delivered, false)) {
        // Since the look more may have come, and all of it may have been delivered: as of now, and not of the look.
        connection.settled = bytesRead(descriptor).value_or(connection.come);
        return false;
    }
    if (connection.come <= connection.settled + (drained ? kMostUnfinished : kMostWaiting)) return false;
    // ZeroMQ closes descriptors itself, and the system gives their numbers away again: look once more.
    return bytesRead(descriptor).value_or(0) >= connection.come;
}

std::size_t ConnectionWatch::shutEndless(bool drained) {
    if (!std::exchange(fresh_, false)) return 0;
    std::size_t shut = 0;
    for (auto& [descriptor, connection] : connections_) {
        if (!endless(descriptor, connection, drained)) continue;
        ::shutdown(descriptor, SHUT_RDWR);
        connection.settled = connection.come;
        connection.busy = 0;
        ++shut;
    }
    return shut;
}

}  // namespace rtsg
