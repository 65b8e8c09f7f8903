// Sends and reads messages over TCP for tiles of live pictures.
#include <rtsg/session/tile_link.h>

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>
#include <utility>

#include <fmt/format.h>

namespace rtsg {

namespace {

constexpr std::size_t kLongestLine = 4096, kMaxBytes = std::size_t{1} << 28;

struct FreeAddress {
    void operator()(addrinfo* found) const { ::freeaddrinfo(found); }
};
using FoundAddress = std::unique_ptr<addrinfo, FreeAddress>;

Result<FoundAddress> addressOf(const std::string& text) {
    constexpr std::string_view kScheme = "tcp://";
    const std::size_t colon = text.rfind(':');
    if (!text.starts_with(kScheme) || colon <= kScheme.size()) return fail("expected tcp://HOST:PORT", {}, text);
    std::string host = text.substr(kScheme.size(), colon - kScheme.size());
    if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM, hints.ai_family = AF_UNSPEC;
    const int wrong = ::getaddrinfo(host.c_str(), text.c_str() + colon + 1, &hints, &found);
    if (wrong != 0) return fail(::gai_strerror(wrong), {}, text);
    return FoundAddress(found);
}

Result<> systemFailure(const char* what, const std::string& address) {
    return fail(fmt::format("cannot {}: {}", what, std::strerror(errno)), {}, address);
}

bool isLoopback(const addrinfo& address) {
    if (address.ai_family == AF_INET) {
        sockaddr_in four{};
        std::memcpy(&four, address.ai_addr, sizeof(four));
        return ntohl(four.sin_addr.s_addr) >> 24 == 127;
    }
    sockaddr_in6 six{};
    if (address.ai_family == AF_INET6) std::memcpy(&six, address.ai_addr, sizeof(six));
    return IN6_IS_ADDR_LOOPBACK(&six.sin6_addr);
}

std::uint16_t portOf(int socket) {
    sockaddr_storage real{};
    socklen_t length = sizeof(real);
    if (::getsockname(socket, reinterpret_cast<sockaddr*>(&real), &length) != 0) return 0;
    sockaddr_in four{};
    std::memcpy(&four, &real, sizeof(four));  // the port is at the same place in both families
    return ntohs(four.sin_port);
}

}  // namespace

TileLink::TileLink(int descriptor) : descriptor_(descriptor) {
    const int yes = 1;
    (void)::setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
}

Result<TileLink> TileLink::connect(const std::string& address) {
    const auto found = addressOf(address);
    if (!found) return std::unexpected(found.error());
    TileLink link(::socket((*found)->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (!link.descriptor_ || ::connect(link.descriptor_.get(), (*found)->ai_addr, (*found)->ai_addrlen) != 0)
        return std::unexpected(systemFailure("connect", address).error());
    return link;
}

std::uint64_t TileLink::Message::number(std::size_t word) const {
    std::uint64_t value = 0;
    if (word < words.size()) std::from_chars(words[word].data(), words[word].data() + words[word].size(), value);
    return value;
}

void TileLink::send(std::string_view line, std::string_view bytes) {
    if (!over_.empty()) return;
    out_.erase(0, std::exchange(sent_, 0));
    out_.append(line).append("\n").append(bytes);
    flush();
}

void TileLink::flush() {
    while (over_.empty() && waitsToSend()) {
        const ssize_t sent =
            ::send(descriptor_.get(), out_.data() + sent_, out_.size() - sent_, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
        if (sent < 0)
            over_ = std::strerror(errno);
        else
            sent_ += static_cast<std::size_t>(sent);
    }
}

void TileLink::read() {
    in_.erase(0, std::exchange(taken_, 0));
    char buffer[1 << 16];
    while (over_.empty() && in_.size() <= kMaxBytes) {
        const ssize_t came = ::recv(descriptor_.get(), buffer, sizeof(buffer), MSG_DONTWAIT);
        if (came < 0 && errno == EINTR) continue;
        if (came < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
        if (came <= 0)
            over_ = came == 0 ? "it has gone" : std::strerror(errno);
        else
            in_.append(buffer, static_cast<std::size_t>(came));
    }
}

std::optional<TileLink::Message> TileLink::receive() {
    const std::string_view all = std::string_view(in_).substr(taken_);
    const std::size_t end = all.find('\n');
    if (end == all.npos || end > kLongestLine) {
        if (all.size() > kLongestLine && end > kLongestLine) over_ = "it sent what is no message";
        return std::nullopt;
    }
    Message message;
    for (std::size_t at = 0; at < end;) {
        const std::size_t next = std::min(all.find(' ', at), end);
        if (next > at) message.words.emplace_back(all.substr(at, next - at));
        at = next + 1;
    }
    const std::uint64_t length =
        !message.words.empty() && message.words[0] == "tile" ? message.number(message.words.size() - 1) : 0;
    if (message.words.empty() || length > kMaxBytes) {
        over_ = "it sent what is no message";
        return std::nullopt;
    }
    if (all.size() - end - 1 < length) return std::nullopt;
    message.bytes = all.substr(end + 1, length);
    taken_ += end + 1 + length;
    return message;
}

Result<TileDoor> TileDoor::open(const std::string& address, bool insecure) {
    const auto found = addressOf(address);
    if (!found) return std::unexpected(found.error());
    if (!insecure && !isLoopback(**found))
        return fail("other machines can reach this, and tiles have no keys (--insecure)", {}, address);
    TileDoor door(::socket((*found)->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0), address);
    const int yes = 1;
    (void)::setsockopt(door.descriptor_.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    if (!door.descriptor_ || ::bind(door.descriptor_.get(), (*found)->ai_addr, (*found)->ai_addrlen) != 0 ||
        ::listen(door.descriptor_.get(), 1024) != 0)
        return std::unexpected(systemFailure("listen", address).error());
    door.address_ = address.substr(0, address.rfind(':') + 1) + std::to_string(portOf(door.descriptor_.get()));
    return door;
}

std::optional<TileLink> TileDoor::accept() {
    const int descriptor = ::accept4(descriptor_.get(), nullptr, nullptr, SOCK_CLOEXEC);
    if (descriptor < 0) return std::nullopt;
    return TileLink(descriptor);
}

}  // namespace rtsg
