// A reader of pictures that does what a library would that a file has taken over: the file says what.
#include <cerrno>
#include <csignal>
#include <string_view>

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "image/image_files.h"

namespace {

/// Whether none of this is let.
bool hasNoRights() {
    const auto isRefused = [](long result) { return result < 0 && errno == EPERM; };
    return isRefused(::open("/etc/passwd", O_RDONLY)) && isRefused(::socket(AF_INET, SOCK_STREAM, 0)) &&
           isRefused(::open("/tmp", O_TMPFILE | O_WRONLY, 0600)) && isRefused(::kill(::getppid(), 0)) &&
           isRefused(::access("/", R_OK));
}

void crash() {
    volatile int* volatile nowhere = nullptr;
    *nowhere = 1;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) bool RTSG_READ_PLAIN_SYMBOL(std::span<const std::uint8_t> bytes,
                                                                              const rtsg::ReadRequest&,
                                                                              rtsg::FilePixels& out, std::string&) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (text.contains("crash")) crash();
    if (!text.contains("look")) return false;
    // Green where nothing is let, else red.
    out = {};
    out.width = out.height = 1, out.channels = 3, out.encoded = true;
    out.bytes = {0, 0, 0};
    out.bytes[hasNoRights() ? 1 : 0] = 255;
    // More than there is.
    if (text.contains("lie")) out.width = 1000;
    return true;
}
