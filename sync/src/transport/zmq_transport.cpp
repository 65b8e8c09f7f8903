// Messages of mirrors over ZeroMQ: a ROUTER that listens, behind its gate, and DEALERs that connect.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "gate.h"
#include "transport.h"
#include "zmq_socket.h"

namespace rtsg {

using namespace std::chrono_literals;

namespace {

constexpr int kIncoming = 64;                        // messages that wait on a connection
constexpr int kBacklog = 4096;                       // connections that wait to be accepted
constexpr int kListenerLinger = 200;                 // ms
constexpr int kConnectionLinger = 100;               // ms, for the goodbye
constexpr int kReconnect = 10;                       // ms between attempts
constexpr std::size_t kCopyBelow = 1024;             // shorter bodies are copied, which is cheaper than to share them
constexpr auto kLookAround = 20ms, kLookSoon = 1ms;  // for connections that send no whole message
constexpr auto kRestsFor = 2000ms;                   // while all are quiet
constexpr int kHandsOver = 1;                        // ms
enum Waited : std::uint8_t { kMessages, kEvents, kKnocks, kBytes };

/// ZeroMQ deletes whatever is at the path of an ipc endpoint. That is right for a socket left by a killed server. This
/// check protects other files and the sockets of running servers.
Result<> checkSocketPath(const std::string& endpoint) {
    constexpr std::string_view kScheme = "ipc://";
    if (!endpoint.starts_with(kScheme)) return {};
    const std::string path = endpoint.substr(kScheme.size());
    struct stat there = {};
    if (path.empty() || path[0] == '@' || path[0] == '*' || ::lstat(path.c_str(), &there) != 0) return {};
    if (!S_ISSOCK(there.st_mode)) return fail(fmt::format("cannot bind {}: there is a file of that name", endpoint));
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path) return {};
    path.copy(address.sun_path, path.size());
    const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (probe < 0) return {};
    // A server whose queue of connections is full runs, too.
    const bool lives =
        ::connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 || errno == EAGAIN;
    ::close(probe);
    if (lives) return fail(fmt::format("cannot bind {}: Address already in use", endpoint));
    return {};
}

/// The parts of a message behind the first one that was received.
class Parts {
  public:
    /// False if the socket has no first part.
    bool receive(ZmqSocket& socket, ZmqMessage& first, Received& message) {
        second_.emplace();
        message.problem = nullptr;
        if (first.more() && !socket.receive(*second_)) message.problem = "a message that ends in its midst";
        if (second_->more()) {
            socket.skipRest(*second_);
            message.problem = "a message of too many parts";
        }
        message.first = first.bytes();
        message.second = second_->bytes();
        return true;
    }

  private:
    std::optional<ZmqMessage> second_;
};

class ZmqListener : public Listener {
  public:
    explicit ZmqListener(const ListenSettings& settings)
        : router_(context_, ZMQ_ROUTER), gate_(context_), settings_(settings) {}
    ~ZmqListener() override { gate_.stopWatching(router_); }

    Result<> start(const std::string& endpoint);
    const std::string& endpoint() const override { return endpoint_; }
    Clock::duration prepare(Items items, bool busy) override;
    bool came(Items items) override;
    bool receive(Received& message) override;
    Failures received(bool drained) override;
    bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner) override;

  private:
    ZmqContext context_;
    ZmqSocket router_;
    MirrorGate gate_;
    const ListenSettings settings_;
    std::string endpoint_;
    bool waited_ = false;  // all sockets had been found empty before the wait
    Failures failures_;
    std::optional<ZmqMessage> head_, body_;  // the first part received; the second part sent last, which peers share
    Parts parts_;
};

Result<> ZmqListener::start(const std::string& endpoint) {
    if (auto ok = checkSocketPath(endpoint); !ok) return ok;
    router_.set(ZMQ_LINGER, kListenerLinger);
    router_.set(ZMQ_ROUTER_MANDATORY, 1);
    router_.set(ZMQ_SNDHWM, 0);  // bounded by every peer's window instead
    router_.set(ZMQ_RCVHWM, kIncoming);
    router_.set(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(settings_.longest));
    router_.set(ZMQ_HANDSHAKE_IVL, 5000);
    router_.set(ZMQ_BACKLOG, kBacklog);
    if (auto ok = gate_.guard(router_, settings_.keys); !ok) return ok;
    if (auto ok = checkPort(endpoint); !ok) return ok;
    router_.set(ZMQ_IPV6, endpoint.starts_with("tcp://[") ? 1 : 0);
    if (zmq_bind(router_.get(), endpoint.c_str()) != 0)
        return std::unexpected(zmqFailure(fmt::format("cannot bind {}", endpoint)));
    char bound[512] = {};
    std::size_t length = sizeof(bound);
    zmq_getsockopt(router_.get(), ZMQ_LAST_ENDPOINT, bound, &length);
    endpoint_ = bound;
    return {};
}

/// Sockets that were not read until empty may hold messages already.
Clock::duration ZmqListener::prepare(Items items, bool busy) {
    ConnectionWatch& connections = gate_.connections();
    items[kMessages] = {router_.descriptor(), POLLIN, 0};
    items[kEvents] = {gate_.monitor().descriptor(), POLLIN, 0};
    items[kKnocks] = {gate_.zap().descriptor(), POLLIN, 0};
    items[kBytes] = {connections.descriptor(), POLLIN, 0};
    waited_ = router_.foundEmpty() && gate_.monitor().foundEmpty() && gate_.zap().foundEmpty();
    if (!waited_) return 0ms;
    if (connections.suspicious()) return kLookSoon;
    return connections.any() && (busy || !connections.rest()) ? kLookAround : kRestsFor;
}

bool ZmqListener::came(Items items) {
    // Bytes arrive a moment before ZeroMQ hands over the message.
    if (items[kBytes].revents && !items[kMessages].revents && waited_) {
        pollfd soon[] = {items[kMessages], items[kEvents], items[kKnocks], {settings_.wake, POLLIN, 0}};
        (void)::poll(soon, std::size(soon), kHandsOver);
        for (std::size_t i = kMessages; i <= kKnocks; ++i) items[i].revents = soon[i].revents;
    }
    const auto any = [&](Waited what, const ZmqSocket& socket) {
        return items[what].revents != 0 || !socket.foundEmpty();
    };
    const bool messages = any(kMessages, router_), events = any(kEvents, gate_.monitor());
    if (any(kKnocks, gate_.zap())) gate_.authenticate();
    if (events) {
        const MirrorGate::Failures failures = gate_.failures();
        failures_.refused += failures.refused;
        failures_.garbage += failures.garbage;
    }
    gate_.connections().look(steadyClock().now());
    return messages;
}

bool ZmqListener::receive(Received& message) {
    ZmqMessage from;
    if (!router_.receive(from)) return false;
    message.from = from.text();
    head_.emplace();
    if (!from.more() || !router_.receive(*head_)) {
        message.problem = "a message without content";
        return true;
    }
    gate_.connections().delivered(*head_);
    message.user = settings_.keys ? userOf(*head_) : std::string();
    return parts_.receive(router_, *head_, message);
}

Listener::Failures ZmqListener::received(bool drained) {
    failures_.endless += gate_.connections().shutEndless(drained);
    return std::exchange(failures_, {});
}

bool ZmqListener::send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
                       const SharedBytes& owner) {
    ZmqMessage address(std::as_bytes(std::span(to.data(), to.size()))), head(first);
    if (!router_.send(address, true) || !router_.send(head, !second.empty())) return false;
    if (second.empty()) return true;
    if (!owner || second.size() < kCopyBelow) {
        ZmqMessage body(second);
        return router_.send(body);
    }
    // The message that is kept keeps its bytes, so no others can be where they are.
    if (!body_ || body_->bytes().data() != second.data() || body_->bytes().size() != second.size())
        body_.emplace(second, owner);
    ZmqMessage body(ZmqMessage::Shared{}, *body_);
    return router_.send(body);
}

class ZmqConnection : public Connection {
  public:
    ZmqConnection() : socket_(context_, ZMQ_DEALER), monitor_(context_, ZMQ_PAIR) {}
    ~ZmqConnection() override { zmq_socket_monitor(socket_.get(), nullptr, 0); }

    Result<> start(const std::string& endpoint, const ConnectSettings& settings);
    bool send(std::span<const std::byte> first, std::span<const std::byte> second) override;
    bool receive(Received& message) override;
    bool foundEmpty() const override { return socket_.foundEmpty(); }
    std::array<int, 2> descriptors() const override { return {socket_.descriptor(), monitor_.descriptor()}; }
    Event nextEvent() override;
    void reconnect(std::chrono::milliseconds within) override;
    std::optional<std::uint64_t> bytesCome() const override { return bytesReceived(descriptor_); }

  private:
    ZmqContext context_;
    ZmqSocket socket_, monitor_;
    std::string endpoint_;
    int descriptor_ = -1;  // of the newest connection
    std::optional<ZmqMessage> head_;
    Parts parts_;
};

Result<> ZmqConnection::start(const std::string& endpoint, const ConnectSettings& settings) {
    endpoint_ = endpoint;
    socket_.set(ZMQ_LINGER, kConnectionLinger);
    socket_.set(ZMQ_RECONNECT_IVL, kReconnect);
    socket_.set(ZMQ_CONNECT_TIMEOUT, static_cast<int>(settings.within.count()));
    // ZMQ_IMMEDIATE is not set. With it libzmq 4.3 drops unread messages when a connection ends, and aborts the process
    // (an assertion in fq.cpp) if that happens between two parts of a message.
    socket_.set(ZMQ_RCVHWM, 0);  // bounded by the window
    socket_.set(ZMQ_MAXMSGSIZE, std::int64_t{16} << 20);
    if (settings.keys) {
        socket_.set(ZMQ_CURVE_SERVERKEY, settings.keys->serverPublic);
        socket_.set(ZMQ_CURVE_PUBLICKEY, settings.keys->clientPublic.front());
        socket_.set(ZMQ_CURVE_SECRETKEY, settings.keys->clientSecret);
    }
    monitor_.set(ZMQ_LINGER, 0);
    constexpr int events = ZMQ_EVENT_CONNECTED | ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED;
    if (zmq_socket_monitor(socket_.get(), "inproc://connection", events) != 0 ||
        zmq_connect(monitor_.get(), "inproc://connection") != 0)
        return std::unexpected(zmqFailure("cannot watch the connection"));
    (void)nextEvent();  // its descriptor wakes only a reader that has read it until empty
    if (auto ok = checkPort(endpoint); !ok) return ok;
    allowIpv6(socket_, endpoint);
    if (zmq_connect(socket_.get(), endpoint.c_str()) != 0)
        return std::unexpected(zmqFailure(fmt::format("cannot connect to {}", endpoint)));
    return {};
}

bool ZmqConnection::send(std::span<const std::byte> first, std::span<const std::byte> second) {
    ZmqMessage head(first);
    if (!socket_.send(head, !second.empty())) return false;
    if (second.empty()) return true;
    ZmqMessage body(second);
    return socket_.send(body);
}

bool ZmqConnection::receive(Received& message) {
    head_.emplace();
    return socket_.receive(*head_) && parts_.receive(socket_, *head_, message);
}

Connection::Event ZmqConnection::nextEvent() {
    while (true) {
        ZmqMessage event;
        if (!monitor_.receive(event)) return Event::none;
        std::uint16_t what = 0;
        std::int32_t descriptor = 0;  // of events about connections
        if (event.bytes().size() >= sizeof(what) + sizeof(descriptor)) {
            std::memcpy(&what, event.bytes().data(), sizeof(what));
            std::memcpy(&descriptor, event.bytes().data() + sizeof(what), sizeof(descriptor));
        }
        monitor_.skipRest(event);
        if (what == ZMQ_EVENT_CONNECTED) descriptor_ = descriptor;
        if (what == ZMQ_EVENT_HANDSHAKE_SUCCEEDED) return Event::up;
        if (what == ZMQ_EVENT_DISCONNECTED && descriptor == descriptor_) return Event::down;
    }
}

void ZmqConnection::reconnect(std::chrono::milliseconds within) {
    socket_.set(ZMQ_CONNECT_TIMEOUT, static_cast<int>(within.count()));
    zmq_disconnect(socket_.get(), endpoint_.c_str());
    zmq_connect(socket_.get(), endpoint_.c_str());
}

class ZmqTransport : public Transport {
  public:
    Clock& clock() override { return steadyClock(); }
    Result<bool> isLocal(const std::string& endpoint) const override { return isLocalEndpoint(endpoint); }
    Result<std::unique_ptr<Listener>> listen(const std::string& endpoint, const ListenSettings& settings) override {
        if (const auto ok = checkReady(); !ok) return std::unexpected(ok.error());
        auto listener = std::make_unique<ZmqListener>(settings);
        if (auto ok = listener->start(endpoint); !ok) return std::unexpected(ok.error());
        return listener;
    }
    Result<std::unique_ptr<Connection>> connect(const std::string& endpoint, const ConnectSettings& settings) override {
        if (const auto ok = checkReady(); !ok) return std::unexpected(ok.error());
        auto connection = std::make_unique<ZmqConnection>();
        if (auto ok = connection->start(endpoint, settings); !ok) return std::unexpected(ok.error());
        return connection;
    }

  private:
    static Result<> checkReady() {
        if (const auto loaded = delayed::zmq.load(); !loaded) return std::unexpected(loaded.error());
        return checkRoomForSocket();
    }
};

}  // namespace

std::shared_ptr<Transport> zmqTransport() {
    return std::make_shared<ZmqTransport>();
}

}  // namespace rtsg
