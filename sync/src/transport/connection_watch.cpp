// Asks the system how many bytes have come on each connection, and shuts those that bring no messages.
#include "connection_watch.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

namespace rtsg {

namespace {

constexpr auto kLookEvery = std::chrono::milliseconds(5), kLookAgain = std::chrono::milliseconds(1);
constexpr auto kLookCosts =
    std::chrono::microseconds(60);  // for each connection, so that looking takes some per cent of the time

/// Bytes that ZeroMQ has read from a TCP connection. Nothing if the descriptor is none.
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

ConnectionWatch::ConnectionWatch() : events_(::epoll_create1(EPOLL_CLOEXEC)) {}
ConnectionWatch::~ConnectionWatch() {
    if (events_ >= 0) ::close(events_);
}

bool ConnectionWatch::rest() {
    const auto stirs = [](const auto& c) { return c.second.stirs && !c.second.delivered; };
    if (suspicious_ || events_ < 0 || std::ranges::any_of(connections_, stirs)) return false;
    for (auto& [descriptor, connection] : connections_) {
        if (std::exchange(connection.armed, true)) continue;
        epoll_event event{};
        event.events = EPOLLIN | EPOLLET | EPOLLONESHOT;
        event.data.fd = descriptor;
        if (::epoll_ctl(events_, EPOLL_CTL_MOD, descriptor, &event) == 0) continue;
        connection.armed = ::epoll_ctl(events_, EPOLL_CTL_ADD, descriptor, &event) == 0;
        if (!connection.armed) return false;
    }
    return true;
}

/// Connections that woke us are looked at while bytes without messages come on them.
void ConnectionWatch::takeEvents() {
    epoll_event events[64];
    const int count = events_ < 0 ? 0 : ::epoll_wait(events_, events, std::size(events), 0);
    for (int i = 0; i < count; ++i)
        if (const auto found = connections_.find(events[i].data.fd); found != connections_.end()) {
            found->second.armed = false;
            found->second.stirs = true;
        }
}

void ConnectionWatch::look(Clock::time_point now) {
    takeEvents();
    early_.clear();  // before a look it is known which connections are open
    const Clock::duration every = suspicious_ ? kLookAgain : kLookEvery;
    if (now - looked_ < std::max(every, Clock::duration(kLookCosts * connections_.size()))) return;
    looked_ = now;
    fresh_ = true;
    suspicious_ = false;
    for (auto& [descriptor, connection] : connections_) {
        const std::uint64_t before = connection.come;
        if (connection.delivered) continue;  // a message has come, so nothing is wrong this time
        const std::optional<std::uint64_t> received = bytesReceived(descriptor);
        connection.counted = received.has_value();
        // If only little has come, it does not matter whether ZeroMQ has read all of it. This saves half of the calls
        // for each peer.
        const bool little = connection.counted && *received <= connection.settled + kMaxUnfinished;
        connection.come = little ? *received : bytesRead(descriptor).value_or(0);
        if (!connection.counted && bytesWait(descriptor) && connection.busy++ == 0) connection.busySince = now;
        suspicious_ = suspicious_ || connection.busy > 0;
        connection.stirs = connection.come != before;
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
    if (std::exchange(connection.delivered, false)) {
        connection.busy = 0;
        connection.stirs = false;
    }
    return connection.busy >= kBusyLooks &&
           looked_ - connection.busySince >= (drained ? kBusyFor : kBusyForWhileOthersWait);
}

bool ConnectionWatch::endless(int descriptor, Connection& connection, bool drained) const {
    if (!connection.counted) return endlessLocal(connection, drained);
    if (std::exchange(connection.delivered, false)) {
        // More may have come, and been delivered, since the look. So the bytes of now count.
        connection.come = connection.settled = bytesRead(descriptor).value_or(connection.come);
        connection.stirs = false;
        return false;
    }
    if (connection.come <= connection.settled + (drained ? kMaxUnfinished : kMaxWaiting)) return false;
    // ZeroMQ closes descriptors itself, and the system may reuse their numbers. So it looks once more.
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
