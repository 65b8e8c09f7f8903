// Watches a folder by inotify, and compares what the system says of one file in it.
#include "file_watch.h"

#include <utility>

#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

namespace rtsg {

FileWatch::~FileWatch() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

void FileWatch::begin(const std::filesystem::path& file) {
    file_ = file;
    mark_ = markOf();
    const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    descriptor_ = ::inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    if (descriptor_ >= 0 && ::inotify_add_watch(descriptor_, folder.c_str(), IN_CLOSE_WRITE | IN_MOVED_TO) < 0)
        ::close(std::exchange(descriptor_, -1));
}

bool FileWatch::changed() {
    if (descriptor_ < 0) return false;
    alignas(inotify_event) char events[4096];
    bool any = false;
    while (::read(descriptor_, events, sizeof(events)) > 0) any = true;
    if (!any) return false;
    const std::optional<Mark> now = markOf();
    return now && now != std::exchange(mark_, now);
}

std::optional<FileWatch::Mark> FileWatch::markOf() const {
    constexpr std::int64_t kNanoseconds = 1'000'000'000;
    struct stat status{};
    if (::stat(file_.c_str(), &status) != 0) return std::nullopt;
    return Mark{status.st_dev, status.st_ino, status.st_size,
                status.st_mtim.tv_sec * kNanoseconds + status.st_mtim.tv_nsec};
}

}  // namespace rtsg
