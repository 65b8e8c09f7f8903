// Reading an opened file into memory. It is not mapped: whoever truncated a mapped file would end the process.
#include "read_descriptor.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <sys/stat.h>
#include <unistd.h>

namespace rtsg::detail {

Result<std::string> readDescriptor(int descriptor, std::uint64_t limit) {
    struct stat status{};
    if (fstat(descriptor, &status) != 0) return fail(std::strerror(errno));
    const auto tooLong = [&] { return fail("it has more than " + std::to_string(limit) + " bytes"); };
    constexpr std::size_t kStep = 1 << 20;
    std::size_t expected = kStep, minimum = kStep / 16;  // to be had, and worth a read
    if (S_ISREG(status.st_mode) && status.st_size > 0) {
        if (static_cast<std::uint64_t>(status.st_size) > limit) return tooLong();
        expected = static_cast<std::size_t>(status.st_size) + 1;  // one more, to see that it ends there
        minimum = 1;                                              // a buffer that grew for that one would be copied
    }
    std::string text;
    for (std::size_t size = 0;;) {
        if (text.size() - size < minimum)
            text.resize_and_overwrite(std::max(expected, size + size / 2 + kStep),
                                      [](char*, std::size_t n) { return n; });
        const ssize_t got = ::read(descriptor, text.data() + size, std::min(text.size() - size, std::size_t{1} << 30));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return fail(std::strerror(errno));
        size += static_cast<std::size_t>(got);
        if (size > limit) return tooLong();
        if (got == 0) {
            text.resize(size);
            return text;
        }
    }
}

}  // namespace rtsg::detail
