// Sends and receives packets.
#include "messages.h"

#include <cerrno>
#include <cstddef>

#include <dlfcn.h>
#include <sys/socket.h>
#include <sys/uio.h>

namespace rtsg::sandbox {

namespace {

constexpr std::size_t kHead = offsetof(Packet, text);

}  // namespace

bool send(int socket, Word word, std::uint64_t number, std::uint64_t size, std::string_view text, bool isLast) {
    struct Head {
        Word word;
        std::uint32_t isLast;
        std::uint64_t number, size;
    } head{word, isLast ? 1U : 0U, number, size};
    static_assert(sizeof(Head) == kHead);
    text = text.substr(0, kMaxSandboxText);
    iovec parts[] = {{&head, sizeof(head)}, {const_cast<char*>(text.data()), text.size()}};
    msghdr message{};
    message.msg_iov = parts, message.msg_iovlen = 2;
    for (;;) {
        const ssize_t sent = ::sendmsg(socket, &message, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        return sent == static_cast<ssize_t>(kHead + text.size());
    }
}

Arrival receive(int socket, Packet& packet) {
    for (;;) {
        const ssize_t got = ::recv(socket, &packet, kHead + sizeof(packet.text), 0);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return Arrival::late;
        if (got < static_cast<ssize_t>(kHead)) return Arrival::gone;
        packet.textSize = static_cast<std::size_t>(got) - kHead;
        return Arrival::packet;
    }
}

const void* libraryOf(const void* function) {
    Dl_info found{};
    return ::dladdr(function, &found) != 0 ? found.dli_fbase : nullptr;
}

}  // namespace rtsg::sandbox
