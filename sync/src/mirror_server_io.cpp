#include "mirror_server_io.h"

#include <algorithm>
#include <random>

#include <fmt/format.h>
#include <unistd.h>

namespace rtsg {

using namespace std::chrono_literals;
using mirror::Message;

namespace {

constexpr std::size_t kChunk = std::size_t{256} << 10;
constexpr std::size_t kCopyBelow = 1024;  // smaller bodies are copied: cheaper than counting references
constexpr std::uint64_t kSmallestWindow = 64 << 10, kLargestWindow = std::uint64_t{64} << 20;
constexpr std::uint64_t kLargestDebt = 2 * kLargestWindow;
constexpr std::uint64_t kAnswerCost = 1024;      // of an answer that waits to be read, beside its bytes
constexpr std::int64_t kLongestIncoming = 4096;  // bytes; a hello with the longest name is far below
constexpr int kLinger = 200;                     // ms
constexpr auto kFarewell = 1000ms;               // for peers to answer a goodbye
constexpr auto kPatience = 200ms;                // with a scene's thread that does not deliver a snapshot
constexpr const char* kMonitorEndpoint = "inproc://connections";

std::string textOf(const ZmqMessage& message) {
    return {reinterpret_cast<const char*>(message.bytes().data()), message.bytes().size()};
}

}  // namespace

MirrorServer::Io::Io(std::shared_ptr<Shared> shared)
    : shared_(std::move(shared)),
      router_(context_, ZMQ_ROUTER),
      monitor_(context_, ZMQ_PAIR),
      zap_(context_, ZMQ_REP),
      history_(shared_->options.history) {}

MirrorServer::Io::~Io() {
    shared_->stop = true;
    const std::uint64_t one = 1;
    (void)!::write(shared_->wake, &one, sizeof(one));
    if (thread_.joinable()) thread_.join();
}

Result<> MirrorServer::Io::start(const std::string& endpoint) {
    router_.set(ZMQ_LINGER, kLinger);
    router_.set(ZMQ_ROUTER_MANDATORY, 1);
    router_.set(ZMQ_SNDHWM, 0);  // bounded by every peer's window instead
    router_.set(ZMQ_RCVHWM, 1000);
    router_.set(ZMQ_MAXMSGSIZE, kLongestIncoming);
    router_.set(ZMQ_HANDSHAKE_IVL, 5000);
    zap_.set(ZMQ_LINGER, 0);
    if (shared_->options.keys) {
        if (zmq_bind(zap_.get(), "inproc://zeromq.zap.01") != 0)
            return std::unexpected(zmqFailure("cannot check who connects"));
        router_.set(ZMQ_ZAP_DOMAIN, std::string("rtsg"));  // an empty one would let everybody in
        router_.set(ZMQ_CURVE_SERVER, 1);
        router_.set(ZMQ_CURVE_SECRETKEY, shared_->options.keys->serverSecret);
    }
    monitor_.set(ZMQ_LINGER, 0);
    constexpr int events =
        ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH;
    if (zmq_socket_monitor(router_.get(), kMonitorEndpoint, events) != 0 ||
        zmq_connect(monitor_.get(), kMonitorEndpoint) != 0)
        return std::unexpected(zmqFailure("cannot watch connections"));
    if (zmq_bind(router_.get(), endpoint.c_str()) != 0)
        return std::unexpected(zmqFailure(fmt::format("cannot bind {}", endpoint)));
    char bound[512] = {};
    std::size_t length = sizeof(bound);
    zmq_getsockopt(router_.get(), ZMQ_LAST_ENDPOINT, bound, &length);
    shared_->endpoint = bound;
    restart();
    thread_ = std::thread([this] { run(); });
    return {};
}

/// Sequence numbers start to mean something else: whoever followed begins anew.
void MirrorServer::Io::restart() {
    if (!history_.empty()) {
        std::random_device device;
        shared_->epoch = std::uint64_t{device()} << 32 | device();
    }
    history_.clear();
    encodeHead(shared_->epoch, shared_->options.creator, builtinTypes(), {}, head_);
    mirror::begin(message_, Message::unknown);
    for (const auto& [identity, peer] : peers_) sendTo(identity, message_);
    peers_.clear();
}

void MirrorServer::Io::run() {
    while (!shared_->stop) {
        zmq_pollitem_t items[] = {{router_.get(), 0, ZMQ_POLLIN, 0},
                                  {nullptr, shared_->wake, ZMQ_POLLIN, 0},
                                  {monitor_.get(), 0, ZMQ_POLLIN, 0},
                                  {zap_.get(), 0, ZMQ_POLLIN, 0}};
        const bool waiting = std::ranges::any_of(peers_, [](const auto& p) { return !p.second.placed; });
        const long patience = waiting ? 20 : std::max<long>(1, shared_->options.heartbeat.count() / 2);
        if (zmq_poll(items, 4, patience) < 0 && zmq_errno() != EINTR) break;
        if (items[1].revents) {
            std::uint64_t count = 0;
            (void)!::read(shared_->wake, &count, sizeof(count));
        }
        takeInbox();
        if (items[3].revents) authenticate();
        if (items[2].revents) watchConnections();
        if (items[0].revents) receive();
        tick(Clock::now());
        for (auto peer = peers_.begin(); peer != peers_.end();) peer = pump(peer->second) ? ++peer : peers_.erase(peer);
        publishStatistics();
    }
    sayGoodbye();
    zmq_socket_monitor(router_.get(), nullptr, 0);
}

/// A peer whose connection ends loses what it has not read yet (ZMQ_IMMEDIATE): it answers first.
void MirrorServer::Io::sayGoodbye() {
    mirror::begin(message_, Message::bye);
    std::erase_if(peers_, [this](const auto& peer) { return !sendTo(peer.first, message_); });
    const Clock::time_point end = Clock::now() + kFarewell;
    while (!peers_.empty() && Clock::now() < end) {
        zmq_pollitem_t items[] = {{router_.get(), 0, ZMQ_POLLIN, 0}};
        zmq_poll(items, 1, 20);
        receive();
    }
}

void MirrorServer::Io::takeInbox() {
    std::vector<Shared::Item> items;
    {
        const std::scoped_lock lock(shared_->mutex);
        items.swap(shared_->inbox);
    }
    for (Shared::Item& item : items) {
        if (item.restart) restart();
        if (!item.requested) ++statistics_.frames;
        if (!history_.add(std::move(item.record)) && !item.requested)
            shared_->report(Severity::error, "a change set that does not follow the one before was not sent");
    }
}

void MirrorServer::Io::receive() {
    // Bounded, so that a peer that floods us leaves time for the others.
    for (int i = 0; i < 1000; ++i) {
        ZmqMessage identity, body;
        if (!router_.receive(identity)) return;
        if (!identity.more() || !router_.receive(body)) {
            garbage("a message without content");
            continue;
        }
        if (body.more()) {
            router_.skipRest(body);
            garbage("a message of too many parts");
            continue;
        }
        handle(textOf(identity), body.bytes());
    }
}

void MirrorServer::Io::handle(const std::string& identity, std::span<const std::byte> bytes) {
    wire::Reader in(bytes);
    const std::optional<Message> type = mirror::readPrologue(in);
    if (!type) return garbage(fmt::format("a message of {} bytes that is none of this protocol", bytes.size()));
    if (*type == Message::hello) {
        mirror::Hello greeting;
        if (!greeting.read(in)) return garbage("a malformed hello");
        return hello(identity, greeting);
    }
    const auto found = peers_.find(identity);
    if (found == peers_.end()) {
        if (*type != Message::ack && *type != Message::ping && *type != Message::pong && *type != Message::bye)
            return garbage(fmt::format("a message of unknown type {}", static_cast<unsigned>(*type)));
        if (*type == Message::bye) return;
        mirror::begin(message_, Message::unknown);
        sendTo(identity, message_);
        return;
    }
    Peer& peer = found->second;
    if (*type == Message::ack) {
        std::uint64_t numbers[3];  // session, sequence, bytes
        if (!mirror::read(in, numbers)) return garbage("a malformed acknowledgement");
        if (numbers[0] != peer.session) return;  // of before its last hello
        if (numbers[2] > peer.sentBytes || numbers[2] < peer.ackedBytes)
            return garbage("an acknowledgement of what was never sent");
        peer.debt = 0;  // messages arrive in order: it has read everything before
        peer.ackedBytes = numbers[2];
        peer.ackedState = numbers[1];
    } else if (*type == Message::ping) {
        std::uint64_t token[1];
        if (!mirror::read(in, token)) return garbage("a malformed ping");
        mirror::write(message_, Message::pong, token);
        sendTo(identity, message_);
    } else if (*type == Message::bye) {
        peers_.erase(found);
        return;
    } else if (*type != Message::pong) {
        return garbage(fmt::format("a message of unknown type {}", static_cast<unsigned>(*type)));
    }
    peer.heard = Clock::now();
}

void MirrorServer::Io::hello(const std::string& identity, const mirror::Hello& hello) {
    auto found = peers_.find(identity);
    if (found == peers_.end()) {
        if (peers_.size() >= shared_->options.maximumPeers) {
            ++statistics_.refused;
            shared_->report(Severity::warning, fmt::format("refused a peer: {} are here already", peers_.size()));
            mirror::begin(message_, Message::refused);
            wire::putText(message_, "the server has as many peers as it takes");
            sendTo(identity, message_);
            return;
        }
        found = peers_.emplace(identity, Peer{}).first;
    }
    Peer& peer = found->second;
    const std::uint64_t debt = peer.debt + (peer.sentBytes - peer.ackedBytes) + head_.size() + kAnswerCost;
    if (debt > kLargestDebt) return garbage("a hello from a peer that reads no answers");
    peer = Peer{};
    peer.debt = debt;
    peer.identity = identity;
    peer.name = hello.name;
    peer.session = hello.session;
    peer.window = std::clamp(hello.window, kSmallestWindow, kLargestWindow);
    peer.heard = peer.spoken = Clock::now();
    if (hello.epoch == shared_->epoch && history_.continues(hello.sequence)) {
        peer.placed = true;
        peer.state = peer.ackedState = hello.sequence;
        ++statistics_.resumed;
    }
    const std::uint64_t numbers[] = {hello.session, shared_->epoch,
                                     static_cast<std::uint64_t>(shared_->options.heartbeat.count())};
    mirror::write(message_, Message::welcome, numbers);
    ZmqMessage body(head_.bytes());
    if (!sendTo(identity, message_, &body)) peers_.erase(found);
}

/// ZAP (ZeroMQ RFC 27): one request a connection, answered from the allow-list.
void MirrorServer::Io::authenticate() {
    while (true) {
        std::vector<std::string> parts;
        ZmqMessage first;
        if (!zap_.receive(first)) return;
        parts.push_back(textOf(first));
        bool more = first.more();
        while (more) {
            ZmqMessage part;
            if (!zap_.receive(part)) return;
            parts.push_back(textOf(part));
            more = part.more();
        }
        bool allowed = false;
        if (parts.size() == 7 && parts[5] == "CURVE" && parts[6].size() == 32) {
            char key[41];
            zmq_z85_encode(key, reinterpret_cast<const std::uint8_t*>(parts[6].data()), 32);
            allowed = std::ranges::find(shared_->options.keys->clientPublic, key) !=
                      shared_->options.keys->clientPublic.end();
        }
        const std::string reply[] = {
            "1.0", parts.size() > 1 ? parts[1] : "", allowed ? "200" : "400", allowed ? "OK" : "not on the list", "",
            ""};
        for (std::size_t i = 0; i < std::size(reply); ++i) {
            ZmqMessage part(std::as_bytes(std::span(reply[i].data(), reply[i].size())));
            zap_.send(part, i + 1 < std::size(reply));
        }
    }
}

void MirrorServer::Io::watchConnections() {
    while (true) {
        ZmqMessage event;
        if (!monitor_.receive(event)) return;
        std::uint16_t what = 0;
        if (event.bytes().size() >= 2) std::memcpy(&what, event.bytes().data(), 2);
        monitor_.skipRest(event);
        if (what == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH) {
            ++statistics_.refused;
            shared_->report(Severity::warning, "refused a connection: its key is not on the list");
        } else {
            garbage("a connection that did not speak the protocol");
        }
    }
}

void MirrorServer::Io::tick(Clock::time_point now) {
    for (auto p = peers_.begin(); p != peers_.end();) {
        Peer& peer = p->second;
        bool gone = now - peer.heard > shared_->options.peerTimeout;
        if (gone) {
            ++statistics_.lost;
            shared_->report(Severity::note, fmt::format("peer '{}' was silent for too long", peer.name));
        } else if (now - peer.spoken > shared_->options.heartbeat) {
            const std::uint64_t token[] = {peer.state};
            mirror::write(message_, Message::ping, token);
            gone = !sendTo(peer.identity, message_);
            peer.spoken = now;
        }
        p = gone ? peers_.erase(p) : ++p;
    }
}

/// For a peer that has no state of ours: the last keyframe if frames lead on from it and are few, else a fresh one.
SharedRecord MirrorServer::Io::keyframeFor(Peer& peer) {
    const SharedRecord& keyframe = history_.keyframe();
    const bool usable = keyframe && history_.continues(keyframe->header.to);
    const bool enough = usable && history_.bytesFrom(keyframe->header.to) <= 2 * keyframe->bytes.size() + kChunk;
    const Clock::time_point now = Clock::now();
    if (peer.waitingSince == Clock::time_point{}) peer.waitingSince = now;
    if (!enough) {
        shared_->wantSnapshot = true;
        if (!usable || now - peer.waitingSince < kPatience) return nullptr;
    }
    peer.waitingSince = {};
    ++statistics_.snapshots;
    return keyframe;
}

SharedRecord MirrorServer::Io::nextFor(Peer& peer) {
    if (history_.empty()) return nullptr;
    if (peer.placed && !history_.continues(peer.state)) peer.placed = false;
    SharedRecord next;
    if (!peer.placed) {
        next = keyframeFor(peer);
    } else if (peer.state != history_.newest()) {
        // More than a whole window behind: it would only fall further back, one frame after the other.
        if (history_.bytesFrom(peer.state) > peer.window)
            next = history_.mergedFrom(peer.state, *shared_->pool, statistics_.merged);
        if (!next) next = history_.frameFrom(peer.state);
    }
    if (next) {
        peer.placed = true;
        peer.state = next->header.to;
    }
    return next;
}

bool MirrorServer::Io::sendChunk(Peer& peer) {
    const std::span<const std::byte> whole = peer.sending->bytes.bytes();
    const std::span<const std::byte> part = whole.subspan(peer.sent, std::min(kChunk, whole.size() - peer.sent));
    const std::uint64_t numbers[] = {peer.session, whole.size(), peer.sent};
    mirror::write(message_, Message::data, numbers);
    bool ok = false;
    if (part.size() < kCopyBelow) {
        ZmqMessage body(part);
        ok = sendTo(peer.identity, message_, &body);
    } else {
        ZmqMessage body(part, peer.sending);
        ok = sendTo(peer.identity, message_, &body);
    }
    if (!ok) return false;
    peer.spoken = Clock::now();
    peer.sent += part.size();
    peer.sentBytes += part.size();
    statistics_.bytes += part.size();
    if (peer.sent == whole.size()) peer.sending.reset();
    return true;
}

bool MirrorServer::Io::pump(Peer& peer) {
    while (peer.sentBytes - peer.ackedBytes < peer.window) {
        if (!peer.sending) {
            peer.sending = nextFor(peer);
            peer.sent = 0;
        }
        if (!peer.sending) return true;
        if (!sendChunk(peer)) return false;
    }
    return true;
}

bool MirrorServer::Io::sendTo(const std::string& identity, const ByteBuffer& head, ZmqMessage* body) {
    ZmqMessage to(std::as_bytes(std::span(identity.data(), identity.size()))), first(head.bytes());
    return router_.send(to, true) && router_.send(first, body != nullptr) && (!body || router_.send(*body));
}

void MirrorServer::Io::garbage(std::string text) {
    ++statistics_.garbage;
    shared_->report(Severity::warning, "ignored " + std::move(text));
}

void MirrorServer::Io::publishStatistics() {
    statistics_.peers = peers_.size();
    statistics_.sequence = history_.newest();
    statistics_.acknowledged = history_.newest();
    for (const auto& [identity, peer] : peers_)
        statistics_.acknowledged = std::min(statistics_.acknowledged, peer.ackedState);
    const std::scoped_lock lock(shared_->mutex);
    shared_->statistics = statistics_;
}

}  // namespace rtsg
