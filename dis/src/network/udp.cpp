// Datagrams by the system's sockets: unicast, broadcast and multicast, IPv4 and IPv6.
#include <arpa/inet.h>
#include <fcntl.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/dis/dis_transport.h>

namespace rtsg {

namespace {

struct SocketAddress {
    sockaddr_storage storage{};
    socklen_t length = 0;

    int family() const { return storage.ss_family; }
    const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
    const sockaddr_in& v4() const { return reinterpret_cast<const sockaddr_in&>(storage); }
    const sockaddr_in6& v6() const { return reinterpret_cast<const sockaddr_in6&>(storage); }

    bool isMulticast() const {
        return family() == AF_INET ? IN_MULTICAST(ntohl(v4().sin_addr.s_addr)) : IN6_IS_ADDR_MULTICAST(&v6().sin6_addr);
    }
    bool isSameHost(const SocketAddress& other) const {
        if (family() != other.family()) return false;
        if (family() == AF_INET) return v4().sin_addr.s_addr == other.v4().sin_addr.s_addr;
        return std::memcmp(&v6().sin6_addr, &other.v6().sin6_addr, sizeof(in6_addr)) == 0;
    }
    /// That of all networks, or of one that this machine is in.
    bool isBroadcast() const {
        if (family() != AF_INET) return false;
        if (v4().sin_addr.s_addr == INADDR_BROADCAST) return true;
        ifaddrs* all = nullptr;
        if (getifaddrs(&all) != 0) return false;
        bool found = false;
        for (const ifaddrs* one = all; one; one = one->ifa_next)
            if ((one->ifa_flags & IFF_BROADCAST) && one->ifa_broadaddr && one->ifa_broadaddr->sa_family == AF_INET)
                found = found || reinterpret_cast<const sockaddr_in*>(one->ifa_broadaddr)->sin_addr.s_addr ==
                                     v4().sin_addr.s_addr;
        freeifaddrs(all);
        return found;
    }
    SocketAddress anyHost() const {
        SocketAddress any = *this;
        if (family() == AF_INET)
            reinterpret_cast<sockaddr_in&>(any.storage).sin_addr.s_addr = htonl(INADDR_ANY);
        else
            reinterpret_cast<sockaddr_in6&>(any.storage).sin6_addr = in6addr_any;
        return any;
    }
};

Result<SocketAddress> find(const DisAddress& address) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    const bool isLocal = address.host == "localhost";
    hints.ai_family = isLocal ? AF_INET : AF_UNSPEC;
    const std::string port = std::to_string(address.port);
    const char* host = isLocal ? "127.0.0.1" : address.host.c_str();
    if (const int wrong = getaddrinfo(host, port.c_str(), &hints, &found); wrong != 0)
        return fail(fmt::format("'{}': {}", address.host, gai_strerror(wrong)));
    SocketAddress result;
    std::memcpy(&result.storage, found->ai_addr, found->ai_addrlen);
    result.length = found->ai_addrlen;
    freeaddrinfo(found);
    return result;
}

std::string systemError(std::string_view what, const DisAddress& address) {
    return fmt::format("{} {}:{}: {}", what, address.host, address.port, std::strerror(errno));
}

Descriptor datagramSocket(int family) {
    return Descriptor(socket(family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

void setFlag(const Descriptor& socket, int level, int name, int value = 1) {
    (void)setsockopt(socket.get(), level, name, &value, sizeof(value));
}

bool join(const Descriptor& socket, const SocketAddress& group) {
    if (group.family() == AF_INET) {
        ip_mreqn request{};
        request.imr_multiaddr = group.v4().sin_addr;
        return setsockopt(socket.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof(request)) == 0;
    }
    ipv6_mreq request{};
    request.ipv6mr_multiaddr = group.v6().sin6_addr;
    return setsockopt(socket.get(), IPPROTO_IPV6, IPV6_JOIN_GROUP, &request, sizeof(request)) == 0;
}

class UdpTransport final : public DisTransport {
  public:
    Result<> listen(const DisAddress& address, const DisAddress& relay) override {
        if (listeners_.contains(address)) return {};
        const auto& at = lookUp(address);
        if (!at) return std::unexpected(at.error());
        Listener listener;
        listener.socket = datagramSocket(at->family());
        if (listener.socket.get() < 0) return fail(systemError("no socket for", address));
        setFlag(listener.socket, SOL_SOCKET, SO_RCVBUF, 4 << 20);
        if (at->isMulticast()) {
            setFlag(listener.socket, SOL_SOCKET, SO_REUSEADDR);
            const bool isMember = bindTo(listener.socket, *at) && join(listener.socket, *at);
            if (!isMember) {
                if (relay.host.empty()) return fail(systemError("cannot listen to the group", address));
                listener.socket = datagramSocket(at->family());
                if (!bindTo(listener.socket, at->anyHost())) return fail(systemError("cannot listen at", address));
            }
        } else if (at->isBroadcast()) {
            setFlag(listener.socket, SOL_SOCKET, SO_REUSEADDR);
            setFlag(listener.socket, SOL_SOCKET, SO_BROADCAST);
            if (!bindTo(listener.socket, at->anyHost())) return fail(systemError("cannot listen at", address));
        } else if (!bindTo(listener.socket, *at)) {
            // The address is not one of this machine: then it is the sender's.
            if (errno != EADDRNOTAVAIL || !bindTo(listener.socket, at->anyHost()))
                return fail(systemError("cannot listen at", address));
            listener.only = *at;
        }
        listeners_.emplace(address, std::move(listener));
        return {};
    }

    void stopListening(const DisAddress& address) override { listeners_.erase(address); }

    std::size_t receive(const DisAddress& address, std::size_t maximum,
                        const std::function<void(std::span<const std::uint8_t>)>& take) override {
        const auto found = listeners_.find(address);
        if (found == listeners_.end()) return 0;
        const Listener& listener = found->second;
        buffer_.resize(65536);
        std::size_t count = 0;
        while (count < maximum) {
            SocketAddress from;
            from.length = sizeof(from.storage);
            const ssize_t size = recvfrom(listener.socket.get(), buffer_.data(), buffer_.size(), 0,
                                          reinterpret_cast<sockaddr*>(&from.storage), &from.length);
            if (size < 0 && errno == EINTR) continue;
            if (size < 0) break;
            ++count;
            if (listener.only && !listener.only->isSameHost(from)) continue;
            take(std::span(buffer_).first(static_cast<std::size_t>(size)));
        }
        return count;
    }

    Result<> send(const DisAddress& address, const DisAddress& relay, std::span<const std::uint8_t> bytes) override {
        auto found = senders_.find(address);
        if (found == senders_.end()) {
            const auto& at = lookUp(address);
            if (!at) return std::unexpected(at.error());
            Sender sender{datagramSocket(at->family()), *at};
            if (sender.socket.get() < 0) return fail(systemError("no socket for", address));
            if (at->isBroadcast()) setFlag(sender.socket, SOL_SOCKET, SO_BROADCAST);
            found = senders_.emplace(address, std::move(sender)).first;
        }
        Sender& sender = found->second;
        if (sendTo(sender, bytes)) return {};
        // Nobody listens there (yet); no room: lost, as datagrams may be.
        if (errno == ECONNREFUSED || errno == EAGAIN || errno == ENOBUFS) return {};
        const std::string problem = systemError("cannot send to", address);
        if (!sender.at.isMulticast() || relay.host.empty() || sender.isRelayed) return fail(problem);
        const auto& at = lookUp(relay);
        if (!at) return std::unexpected(at.error());
        sender = {datagramSocket(at->family()), *at, true};
        if (sender.socket.get() < 0 || !sendTo(sender, bytes)) return fail(systemError("cannot send to", relay));
        return {};
    }

  private:
    struct Listener {
        Descriptor socket;
        std::optional<SocketAddress> only;  // whom datagrams must come from
    };
    struct Sender {
        Descriptor socket;
        SocketAddress at;
        bool isRelayed = false;
    };
    /// Names are looked up once, whatever the result, because that may take long.
    const Result<SocketAddress>& lookUp(const DisAddress& address) {
        const auto known = found_.find(address);
        return known != found_.end() ? known->second : found_.emplace(address, find(address)).first->second;
    }
    static bool bindTo(const Descriptor& socket, const SocketAddress& at) {
        return bind(socket.get(), at.get(), at.length) == 0;
    }
    static bool sendTo(const Sender& sender, std::span<const std::uint8_t> bytes) {
        return sendto(sender.socket.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL, sender.at.get(),
                      sender.at.length) >= 0;
    }
    std::map<DisAddress, Result<SocketAddress>> found_;
    std::map<DisAddress, Listener> listeners_;
    std::map<DisAddress, Sender> senders_;
    std::vector<std::uint8_t> buffer_;
};

}  // namespace

std::unique_ptr<DisTransport> udpTransport() {
    return std::make_unique<UdpTransport>();
}

}  // namespace rtsg
