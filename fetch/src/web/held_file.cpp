// Files without a name, in memory.
#include "held_file.h"

#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <rtsg/core/machine.h>

namespace rtsg::fetch {

HeldFile::HeldFile() : descriptor_(::memfd_create("rtsg fetched", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {}

HeldFile::~HeldFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    countFileInMemory(-static_cast<std::int64_t>(size_));
}

bool HeldFile::append(std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t done = ::write(descriptor_, bytes.data(), bytes.size());
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return false;
        bytes.remove_prefix(static_cast<std::size_t>(done));
        size_ += static_cast<std::uint64_t>(done);
        countFileInMemory(done);
    }
    return true;
}

bool HeldFile::seal() {
    return ::fcntl(descriptor_, F_ADD_SEALS, F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE) == 0;
}

int HeldFile::opened() const {
    return ::open(fmt::format("/proc/self/fd/{}", descriptor_).c_str(), O_RDONLY | O_CLOEXEC);
}

std::string HeldFile::bytes() const {
    std::string result(size_, '\0');
    std::size_t got = 0;
    while (got < result.size()) {
        const ssize_t more = ::pread(descriptor_, result.data() + got, result.size() - got, static_cast<off_t>(got));
        if (more < 0 && errno == EINTR) continue;
        if (more <= 0) break;
        got += static_cast<std::size_t>(more);
    }
    result.resize(got);
    return result;
}

}  // namespace rtsg::fetch
