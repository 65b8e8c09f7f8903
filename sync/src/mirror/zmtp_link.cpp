// ZMTP as a client needs it: connecting, greeting, frames in and out, all without a thread of its own.
#include "zmtp_link.h"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string_view>
#include <utility>

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/un.h>
#include <unistd.h>

#include "link_keeper.h"
#include "zmq_link.h"

namespace rtsg {

namespace {

using namespace std::chrono_literals;

constexpr std::size_t kGreeting = 64, kMechanismAt = 12, kMechanism = 20;
constexpr unsigned kMore = 1, kLong = 2, kCommand = 4;     // a frame's flags
constexpr auto kHandshakeWithin = 30s;                     // as ZeroMQ's
constexpr std::size_t kLeastRead = std::size_t{64} << 10;  // bytes at a time
constexpr std::size_t kMostToSend = std::size_t{1} << 20;  // that wait for the system
constexpr auto kAwayFor = 50ms;                            // until another thread reads
constexpr std::size_t kMostKept = std::size_t{64} << 20;   // bytes that it reads: the largest window
constexpr std::size_t kMostIdle = std::size_t{4} << 20;    // of memory that nothing is in
constexpr std::string_view kNull = "NULL";                 // the mechanism without keys

/// Of a client at its connection, for as long as this is there.
class Presence {
  public:
    explicit Presence(std::atomic<std::int64_t>& away) : away_(away) { away_ = 0; }
    ~Presence() {
        away_ = std::chrono::duration_cast<std::chrono::nanoseconds>(ZmtpLink::Clock::now().time_since_epoch()).count();
    }
    Presence(const Presence&) = delete;
    Presence& operator=(const Presence&) = delete;

  private:
    std::atomic<std::int64_t>& away_;
};

std::string_view asText(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::span<const std::byte> asOctets(std::string_view text) {
    return std::as_bytes(std::span(text));
}

std::uint64_t bigEndian(const std::byte* at) {
    std::uint64_t result = 0;
    for (int i = 0; i < 8; ++i) result = result << 8 | std::to_integer<std::uint64_t>(at[i]);
    return result;
}

std::optional<ZmtpLink::Address> localAddress(const std::string& path) {
    sockaddr_un local{};
    local.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof(local.sun_path)) return std::nullopt;
    path.copy(local.sun_path, path.size());
    const bool abstract = path[0] == '@';
    if (abstract) local.sun_path[0] = '\0';
    ZmtpLink::Address result;
    std::memcpy(&result.storage, &local, sizeof(local));
    result.size = abstract ? static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size()) : sizeof(local);
    return result;
}

}  // namespace

std::optional<ZmtpLink::Address> ZmtpLink::addressOf(const std::string& endpoint) {
    constexpr std::string_view kTcp = "tcp://", kIpc = "ipc://";
    if (endpoint.starts_with(kIpc)) return localAddress(endpoint.substr(kIpc.size()));
    const std::size_t colon = endpoint.rfind(':');
    if (!endpoint.starts_with(kTcp) || colon < kTcp.size()) return std::nullopt;
    const std::string host = endpoint.substr(kTcp.size(), colon - kTcp.size()), port = endpoint.substr(colon + 1);
    const bool number = !port.empty() && std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; });
    if (!number || port.size() > 5 || std::stoi(port) == 0 || std::stoi(port) > 0xFFFF) return std::nullopt;
    addrinfo wanted{}, *found = nullptr;
    wanted.ai_family = AF_INET;
    wanted.ai_socktype = SOCK_STREAM;
    wanted.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    if (::getaddrinfo(host.c_str(), port.c_str(), &wanted, &found) != 0 || !found) return std::nullopt;
    Address result;
    result.size = found->ai_addrlen;
    std::memcpy(&result.storage, found->ai_addr, result.size);
    ::freeaddrinfo(found);
    return result;
}

std::unique_ptr<MirrorLink> makeLink(const std::string& endpoint, const std::optional<MirrorKeys>& keys) {
    if (!keys)
        if (const auto address = ZmtpLink::addressOf(endpoint)) return std::make_unique<ZmtpLink>(*address);
    return std::make_unique<ZmqLink>(endpoint, keys);
}

ZmtpLink::ZmtpLink(const Address& address) : address_(address) {
    LinkKeeper::ofProgram().add(*this);
}

/// What has been said last goes out, if the system takes it soon.
ZmtpLink::~ZmtpLink() {
    LinkKeeper::ofProgram().remove(*this);
    const Clock::time_point end = Clock::now() + kLinger;
    while (state_ == State::up && sent_ < output_.size() && Clock::now() < end) {
        pollfd item{socket_, POLLOUT, 0};
        if (::poll(&item, 1, 10) < 0) break;
        flush();
    }
    hangUp();
}

// ---- connecting ---------------------------------------------------------------------------------------------------

Result<> ZmtpLink::start() {
    connect(Clock::now());
    return {};
}

void ZmtpLink::reconnect(std::chrono::milliseconds within) {
    within_ = within;
    hangUp();
    events_.clear();
    connect(Clock::now());
}

void ZmtpLink::connect(Clock::time_point now) {
    {
        const std::scoped_lock lock(mutex_);
        socket_ = ::socket(address_.storage.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    }
    if (socket_ < 0) return fail();
    const int on = 1;
    if (address_.storage.ss_family == AF_INET) ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    state_ = State::connecting;
    due_ = now + within_;
    if (::connect(socket_, reinterpret_cast<const sockaddr*>(&address_.storage), address_.size) == 0) return greet();
    if (errno != EINPROGRESS) fail();
}

void ZmtpLink::hangUp() {
    const std::scoped_lock lock(mutex_);
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
    waiting_.clear();
    kept_ = false;
    state_ = State::apart;
    input_.clear();
    output_.clear();
    start_ = next_ = sent_ = parts_ = missing_ = 0;
    complete_ = handedOver_ = readable_ = false;
}

/// This attempt has come to nothing, or the connection is cut.
void ZmtpLink::fail() {
    if (state_ == State::up) events_.push_back(Event::cut);
    hangUp();
    due_ = Clock::now() + kReconnect;
}

/// Connected: both sides say what they speak, then what they are.
void ZmtpLink::greet() {
    std::array<std::byte, kGreeting> greeting{};
    greeting[0] = std::byte{0xFF};
    greeting[9] = std::byte{0x7F};
    greeting[10] = std::byte{3};
    std::memcpy(greeting.data() + kMechanismAt, kNull.data(), kNull.size());
    output_.append(greeting);
    state_ = State::greeting;
    due_ = Clock::now() + kHandshakeWithin;
    flush();
}

/// False when not all of it has come, or it is none.
bool ZmtpLink::readGreeting() {
    if (input_.size() < kGreeting) return false;
    const std::byte* const greeting = input_.data();
    const bool sameMechanism = std::memcmp(greeting + kMechanismAt, kNull.data(), kNull.size()) == 0 &&
                               std::all_of(greeting + kMechanismAt + kNull.size(), greeting + kMechanismAt + kMechanism,
                                           [](std::byte b) { return b == std::byte{0}; });
    if (greeting[0] != std::byte{0xFF} || (greeting[9] & std::byte{1}) == std::byte{0} || greeting[10] < std::byte{3} ||
        !sameMechanism) {
        fail();
        return false;
    }
    start_ = next_ = kGreeting;
    state_ = State::shaking;
    constexpr std::string_view kProperties("\x0BSocket-Type\0\0\0\6DEALER\x08Identity\0\0\0\0", 35);
    putCommand("READY", asOctets(kProperties));
    flush();
    return state_ == State::shaking;
}

/// ERROR, or what is not known, ends the attempt.
void ZmtpLink::shakeHands(std::span<const std::byte> command) {
    constexpr std::string_view kReady = "\5READY";
    if (!asText(command).starts_with(kReady)) return fail();
    state_ = State::up;
    events_.push_back(Event::up);
}

/// Of commands later on only a ping asks for something: its context back.
void ZmtpLink::obey(std::span<const std::byte> command) {
    if (state_ == State::shaking) return shakeHands(command);
    constexpr std::string_view kPing = "\4PING";
    constexpr std::size_t kTimeToLive = 2;
    constexpr std::size_t kLongestContext = 16;
    if (!asText(command).starts_with(kPing) || command.size() < kPing.size() + kTimeToLive) return;
    const auto context = command.subspan(kPing.size() + kTimeToLive);
    putCommand("PONG", context.first(std::min(context.size(), kLongestContext)));
    flush();
}

std::optional<MirrorLink::Event> ZmtpLink::nextEvent() {
    if (events_.empty()) return std::nullopt;
    const Event event = events_.front();
    events_.pop_front();
    return event;
}

// ---- messages -----------------------------------------------------------------------------------------------------

/// What comes is read at once: of a message that the system brings in pieces only the last wakes the client.
bool ZmtpLink::wait(std::chrono::milliseconds most) {
    const Clock::time_point end = Clock::now() + most;
    const Presence here(away_);
    {
        const std::scoped_lock lock(mutex_);  // keep() has ended, or will find us here
        readable_ = readable_ || kept_;
    }
    for (bool looked = false; true; looked = true) {
        if (readMessage() || !events_.empty()) return true;
        const Clock::time_point now = Clock::now();
        if (looked && now >= end) return false;
        if (state_ == State::apart && now >= due_)
            connect(now);
        else if (state_ != State::apart && state_ != State::up && now >= due_)
            fail();
        const Clock::time_point until = state_ == State::up ? end : std::min(end, due_);
        const auto left = std::max(0ms, std::chrono::ceil<std::chrono::milliseconds>(until - now));
        const bool writes = state_ == State::connecting || sent_ < output_.size();
        pollfd item{socket_, static_cast<short>(POLLIN | (writes ? POLLOUT : 0)), 0};
        if (::poll(&item, 1, static_cast<int>(left.count())) > 0) look(item.revents);
    }
}

void ZmtpLink::keep(Clock::time_point now) {
    const auto isAway = [&] {
        const std::int64_t away = away_;
        return away != 0 && now.time_since_epoch() - std::chrono::nanoseconds(away) >= kAwayFor;
    };
    if (!isAway()) return;
    const std::scoped_lock lock(mutex_);
    while (isAway() && socket_ >= 0 && waiting_.size() < kMostKept) {
        std::byte* const to = waiting_.room(kLeastRead);
        const ssize_t count = ::recv(socket_, to, waiting_.capacity() - waiting_.size(), 0);
        if (count <= 0) return;  // an end shows again to whoever reads it
        waiting_.advance(static_cast<std::size_t>(count));
        kept_ = true;
    }
}

void ZmtpLink::look(short revents) {
    if (state_ == State::connecting) {
        int problem = 0;
        socklen_t size = sizeof(problem);
        if (::getsockopt(socket_, SOL_SOCKET, SO_ERROR, &problem, &size) != 0 || problem != 0) return fail();
        if (revents & POLLOUT) greet();
        return;
    }
    if (revents & POLLOUT) flush();
    readable_ = readable_ || (revents & ~POLLOUT) != 0;
}

std::optional<MirrorLink::Message> ZmtpLink::receive() {
    if (!readMessage()) return std::nullopt;
    handedOver_ = true;
    Message message{{}, {}, parts_};
    message.first = input_.bytes().subspan(firstParts_[0].at, firstParts_[0].size);
    if (parts_ > 1) message.second = input_.bytes().subspan(firstParts_[1].at, firstParts_[1].size);
    return message;
}

void ZmtpLink::dropHandedOver() {
    if (!std::exchange(handedOver_, false)) return;
    complete_ = false;
    parts_ = 0;
    start_ = next_;
}

/// True when there is a whole message, at start_. Reads what the system has where it may have something.
bool ZmtpLink::readMessage() {
    dropHandedOver();
    while (!complete_) {
        if (state_ == State::greeting) (void)readGreeting();
        const bool frames = state_ == State::shaking || state_ == State::up;
        if (frames && readFrame()) continue;
        if (!readable_ || socket_ < 0) return false;
        read();
    }
    return true;
}

/// One frame more, if all of it is here.
bool ZmtpLink::readFrame() {
    const std::size_t left = input_.size() - next_;
    const std::byte* const at = input_.data() + next_;
    missing_ = 0;
    if (left < 2) return false;
    const auto flags = std::to_integer<unsigned>(at[0]);
    const std::size_t head = flags & kLong ? 9 : 2;
    if (left < head) return false;
    const std::uint64_t size = flags & kLong ? bigEndian(at + 1) : std::to_integer<std::uint64_t>(at[1]);
    if (flags > (kMore | kLong | kCommand) || size > kLongestMessage || next_ - start_ + size > 2 * kLongestMessage) {
        fail();
        return false;
    }
    const std::size_t frame = head + size;
    if (left < frame) {
        missing_ = frame - left;
        return false;
    }
    const Part part{next_ + head, size};
    next_ += frame;
    if (flags & kCommand) {
        if (parts_ == 0) start_ = next_;
        obey(input_.bytes().subspan(part.at, part.size));
        return state_ != State::apart;
    }
    if (state_ != State::up) {  // no message comes before the hands are shaken
        fail();
        return false;
    }
    if (parts_ < firstParts_.size()) firstParts_[parts_] = part;
    ++parts_;
    complete_ = !(flags & kMore);
    return true;
}

void ZmtpLink::read() {
    makeRoom();
    std::unique_lock lock(mutex_);
    if (kept_) {
        input_.append(waiting_.bytes());
        waiting_ = ByteBuffer();
        kept_ = false;
        return;
    }
    std::byte* const to = input_.room(std::max(kLeastRead, missing_));
    const std::size_t room = input_.capacity() - input_.size();
    const ssize_t count = ::recv(socket_, to, room, 0);
    const bool failed = count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR);
    readable_ = count == static_cast<ssize_t>(room) || (count < 0 && errno == EINTR);
    if (count > 0) input_.advance(static_cast<std::size_t>(count));
    lock.unlock();
    if (failed) fail();
}

/// Behind what is being read, as soon as that is moved to the front.
void ZmtpLink::makeRoom() {
    const std::size_t left = input_.size() - start_;
    if (left == 0 && input_.capacity() > kMostIdle) input_ = ByteBuffer();
    if (start_ == 0 || (left > 0 && input_.capacity() - input_.size() >= std::max(kLeastRead, missing_))) return;
    if (left > 0) std::memmove(input_.data(), input_.data() + start_, left);
    input_.setEnd(input_.data() + left);
    for (Part& part : firstParts_) part.at -= std::min(part.at, start_);
    next_ -= start_;
    start_ = 0;
}

bool ZmtpLink::send(std::span<const std::byte> first, std::span<const std::byte> second) {
    if (state_ != State::up || output_.size() - sent_ > kMostToSend) return false;
    put(second.empty() ? 0 : kMore, first);
    if (!second.empty()) put(0, second);
    flush();
    return true;
}

void ZmtpLink::put(unsigned flags, std::span<const std::byte> bytes) {
    const bool isLong = bytes.size() > 0xFF;
    output_.put(static_cast<std::uint8_t>(flags | (isLong ? kLong : 0)));
    if (isLong)
        for (int shift = 56; shift >= 0; shift -= 8) output_.put(static_cast<std::uint8_t>(bytes.size() >> shift));
    else
        output_.put(static_cast<std::uint8_t>(bytes.size()));
    output_.append(bytes);
}

void ZmtpLink::putCommand(std::string_view name, std::span<const std::byte> bytes) {
    ByteBuffer command;
    command.put(static_cast<std::uint8_t>(name.size()));
    command.append(asOctets(name));
    command.append(bytes);
    put(kCommand, command.bytes());
}

/// What the system takes. That the connection is cut shows where it is read, behind what came by it.
void ZmtpLink::flush() {
    while (sent_ < output_.size()) {
        const ssize_t count = ::send(socket_, output_.data() + sent_, output_.size() - sent_, MSG_NOSIGNAL);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0 && errno != EAGAIN) {
            readable_ = true;
            break;
        }
        if (count < 0) return;
        sent_ += static_cast<std::size_t>(count);
    }
    output_.clear();
    sent_ = 0;
}

}  // namespace rtsg
