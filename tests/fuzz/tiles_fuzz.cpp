// Bytes of any kind from a program that draws tiles: messages have words, and as many bytes as they say.
#include <cstdint>
#include <cstdlib>

#include <sys/socket.h>
#include <unistd.h>

#include <rtsg/session/tile_link.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) std::abort();
    rtsg::TileLink link(ends[0]);
    constexpr std::size_t kPiece = 1 << 12;
    for (std::size_t at = 0; at < size && link.over().empty(); at += kPiece) {
        (void)::send(ends[1], data + at, std::min(kPiece, size - at), MSG_DONTWAIT | MSG_NOSIGNAL);
        link.read();
        while (const auto message = link.receive()) {
            if (message->words.empty()) std::abort();
            const bool isTile = message->words[0] == "tile";
            if (message->bytes.size() != (isTile ? message->number(message->words.size() - 1) : 0)) std::abort();
        }
    }
    ::close(ends[1]);
    return 0;
}
