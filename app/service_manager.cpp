// Sends a datagram to the service manager's socket.
#include "service_manager.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>

namespace rtsg::app {

void tellServiceManager(std::string_view lines) {
    const char* const path = std::getenv("NOTIFY_SOCKET");
    sockaddr_un address{};
    if (!path || (path[0] != '/' && path[0] != '@') || std::strlen(path) >= sizeof(address.sun_path)) return;
    const std::size_t length = std::strlen(path);
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path, length);
    if (path[0] == '@') address.sun_path[0] = '\0';  // a name that is no file
    const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (socket < 0) return;
    (void)::sendto(socket, lines.data(), lines.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address),
                   static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length));
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
    tellServiceManager("WATCHDOG=1");
}

}  // namespace rtsg::app
