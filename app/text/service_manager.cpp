// Sends a datagram to the service manager's socket.
#include "service_manager.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstdlib>

namespace rtsg::app {

void notifyServiceManager(std::string_view lines) {
    const char* const given = std::getenv("NOTIFY_SOCKET");
    const std::string_view path = given ? given : "";
    sockaddr_un address{};
    if ((!path.starts_with('/') && !path.starts_with('@')) || path.size() >= sizeof(address.sun_path)) return;
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, path.size());
    if (path.starts_with('@')) address.sun_path[0] = '\0';  // a name that is no file
    const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (socket < 0) return;
    (void)::sendto(socket, lines.data(), lines.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address),
                   static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size()));
    ::close(socket);
}

void feedWatchdog() {
    using Clock = std::chrono::steady_clock;
    static const auto every = [] {
        const char* const time = std::getenv("WATCHDOG_USEC");
        return std::chrono::microseconds(time ? std::strtoll(time, nullptr, 10) / 3 : 0);
    }();
    static Clock::time_point last{};
    if (every.count() <= 0 || Clock::now() - last < every) return;
    last = Clock::now();
    notifyServiceManager("WATCHDOG=1");
}

}  // namespace rtsg::app
