// A client's ZeroMQ socket: what it is set to, its messages, and what its monitor says of the connection.
#include "zmq_link.h"

#include <cstring>

#include <fmt/format.h>
#include <poll.h>

namespace rtsg {

ZmqLink::ZmqLink(std::string endpoint, std::optional<MirrorKeys> keys)
    : endpoint_(std::move(endpoint)),
      keys_(std::move(keys)),
      socket_(context_, ZMQ_DEALER),
      monitor_(context_, ZMQ_PAIR) {}

ZmqLink::~ZmqLink() {
    zmq_socket_monitor(socket_.get(), nullptr, 0);
}

Result<> ZmqLink::start() {
    socket_.set(ZMQ_LINGER, static_cast<int>(kLinger.count()));
    socket_.set(ZMQ_RECONNECT_IVL, static_cast<int>(kReconnect.count()));
    socket_.set(ZMQ_CONNECT_TIMEOUT, static_cast<int>(kConnectWithin.count()));
    // Not ZMQ_IMMEDIATE: with it, libzmq 4.3 drops what has not been read when a connection ends, and ends the process
    // (an assertion in fq.cpp) if that happens between two parts of a message.
    socket_.set(ZMQ_RCVHWM, 0);  // bounded by the window
    socket_.set(ZMQ_MAXMSGSIZE, std::int64_t{kLongestMessage});
    if (keys_) {
        socket_.set(ZMQ_CURVE_SERVERKEY, keys_->serverPublic);
        socket_.set(ZMQ_CURVE_PUBLICKEY, keys_->clientPublic.front());
        socket_.set(ZMQ_CURVE_SECRETKEY, keys_->clientSecret);
    }
    monitor_.set(ZMQ_LINGER, 0);
    constexpr int events = ZMQ_EVENT_CONNECTED | ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED;
    if (zmq_socket_monitor(socket_.get(), "inproc://connection", events) != 0 ||
        zmq_connect(monitor_.get(), "inproc://connection") != 0)
        return std::unexpected(zmqFailure("cannot watch the connection"));
    readEvents();  // nobody is woken by it who has not found it empty before
    if (auto ok = checkPort(endpoint_); !ok) return ok;
    if (zmq_connect(socket_.get(), endpoint_.c_str()) != 0)
        return std::unexpected(zmqFailure(fmt::format("cannot connect to {}", endpoint_)));
    return {};
}

bool ZmqLink::send(std::span<const std::byte> first, std::span<const std::byte> second) {
    ZmqMessage head(first);
    if (second.empty()) return socket_.send(head);
    ZmqMessage body(second);
    return socket_.send(head, true) && socket_.send(body);
}

std::optional<MirrorLink::Message> ZmqLink::receive() {
    first_.emplace();
    second_.emplace();
    if (!socket_.receive(*first_)) return std::nullopt;
    Message message{first_->bytes(), {}, 1};
    if (!first_->more()) return message;
    socket_.receive(*second_);
    message.second = second_->bytes();
    message.parts = second_->more() ? 3 : 2;
    socket_.skipRest(*second_);
    return message;
}

/// A ZeroMQ socket's descriptor tells that something has come since the socket was last found empty, and sending may
/// take that note away: so whoever has sent looks into the socket, and whoever has found it empty waits at the
/// descriptor. Asking zmq_poll() would be several system calls more for each frame. The monitor's socket is read until
/// it is empty and nothing is ever sent on it.
bool ZmqLink::wait(std::chrono::milliseconds most) {
    const int longest = socket_.foundEmpty() ? static_cast<int>(most.count()) : 0;
    pollfd items[] = {{socket_.descriptor(), POLLIN, 0}, {monitor_.descriptor(), POLLIN, 0}};
    const bool any = ::poll(items, 2, longest) > 0;
    if (any && items[1].revents) readEvents();
    return any || !socket_.foundEmpty();
}

std::optional<MirrorLink::Event> ZmqLink::nextEvent() {
    if (events_.empty()) return std::nullopt;
    const Event event = events_.front();
    events_.pop_front();
    return event;
}

void ZmqLink::readEvents() {
    while (true) {
        ZmqMessage event;
        if (!monitor_.receive(event)) return;
        std::uint16_t what = 0;
        std::int32_t descriptor = 0;  // of events about connections
        if (event.bytes().size() >= sizeof(what) + sizeof(descriptor)) {
            std::memcpy(&what, event.bytes().data(), sizeof(what));
            std::memcpy(&descriptor, event.bytes().data() + sizeof(what), sizeof(descriptor));
        }
        monitor_.skipRest(event);
        if (what == ZMQ_EVENT_CONNECTED)
            descriptor_ = descriptor;
        else if (what == ZMQ_EVENT_HANDSHAKE_SUCCEEDED)
            events_.push_back(Event::up);
        else if (what == ZMQ_EVENT_DISCONNECTED && descriptor == descriptor_)
            events_.push_back(Event::cut);
    }
}

void ZmqLink::reconnect(std::chrono::milliseconds within) {
    socket_.set(ZMQ_CONNECT_TIMEOUT, static_cast<int>(within.count()));
    zmq_disconnect(socket_.get(), endpoint_.c_str());
    zmq_connect(socket_.get(), endpoint_.c_str());
}

}  // namespace rtsg
