// Reads the files of a log as one.
#include "log_files.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <rtsg/sync/log.h>

namespace rtsg {

Result<std::unique_ptr<LogFiles>> LogFiles::open(const std::filesystem::path& name) {
    const auto names = filesOfLog(name);
    if (!names) return std::unexpected(names.error());
    std::unique_ptr<LogFiles> all(new LogFiles);
    std::uint64_t from = 0;
    for (const std::filesystem::path& file : *names) {
        const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
        if (descriptor < 0) return fail(fmt::format("cannot read: {}", std::strerror(errno)), {}, file.string());
        struct stat status{};
        const bool regular = ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
        if (&file == &names->back())
            all->newest_ = descriptor;
        else
            ::close(descriptor);
        if (!regular) return fail("not a regular file", {}, file.string());
        const auto size = static_cast<std::uint64_t>(status.st_size);
        all->files_.push_back({file, from, size, status.st_dev, status.st_ino});
        from += size;
    }
    return all;
}

LogFiles::~LogFiles() {
    for (const int descriptor : {descriptor_, newest_})
        if (descriptor >= 0) ::close(descriptor);
}

std::vector<std::uint64_t> LogFiles::ends() const {
    std::vector<std::uint64_t> ends;
    for (const File& file : files_) ends.push_back(file.from + file.size);
    return ends;
}

std::uint64_t LogFiles::size() const {
    struct stat status{};
    const File& last = files_.back();
    return last.from + (::fstat(newest_, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : last.size);
}

/// -1 if the file is not the one that it was.
int LogFiles::descriptorOf(std::size_t file) {
    if (file + 1 == files_.size()) return newest_;
    if (descriptor_ >= 0 && opened_ == file) return descriptor_;
    if (descriptor_ >= 0) ::close(descriptor_);
    opened_ = file;
    const File& wanted = files_[file];
    descriptor_ = ::open(wanted.name.c_str(), O_RDONLY | O_CLOEXEC);
    struct stat status{};
    const bool same = descriptor_ >= 0 && ::fstat(descriptor_, &status) == 0 && status.st_dev == wanted.device &&
                      status.st_ino == wanted.node;
    if (!same && descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
    return descriptor_;
}

void LogFiles::read(std::uint64_t offset, std::size_t length, ByteBuffer& into) {
    into.clear();
    std::byte* at = into.room(length);
    const auto after = [](std::uint64_t position, const File& one) { return position < one.from; };
    while (length > 0) {
        const auto next = std::upper_bound(files_.begin() + 1, files_.end(), offset, after);
        const auto file = static_cast<std::size_t>(next - files_.begin()) - 1;
        const bool isLast = next == files_.end();
        const std::uint64_t left = isLast ? length : next->from - offset;
        const ssize_t got = ::pread(descriptorOf(file), at, std::min<std::uint64_t>(length, left),
                                    static_cast<off_t>(offset - files_[file].from));
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0 && isLast) break;  // the file has shrunk or cannot be read
        // Later files keep their offsets.
        const auto size = got > 0 ? static_cast<std::size_t>(got) : std::min<std::uint64_t>(length, left);
        if (got <= 0) std::memset(at, 0, size);
        at += size;
        into.advance(size);
        offset += size;
        length -= size;
    }
}

namespace {

/// Writers hold an exclusive lock, so a shared lock cannot be taken.
bool isLocked(int descriptor) {
    if (::flock(descriptor, LOCK_SH | LOCK_NB) != 0) return errno == EWOULDBLOCK;
    ::flock(descriptor, LOCK_UN);
    return false;
}

}  // namespace

bool LogFiles::beingWritten() const {
    return isLocked(newest_);
}

std::string LogFiles::locationAt(std::uint64_t offset) const {
    if (files_.size() == 1) return {};
    const auto next = std::ranges::find_if(files_, [&](const File& one) { return offset < one.from; });
    const File& file = *(next - 1);
    return fmt::format(" (byte {} of {})", offset - file.from, file.name.filename().string());
}

bool isBeingWritten(const std::filesystem::path& file) {
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor < 0) return false;
    const bool locked = isLocked(descriptor);
    ::close(descriptor);
    return locked;
}

}  // namespace rtsg
