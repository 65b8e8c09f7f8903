// FileWatch: tells when a file has changed. Nobody is woken while it stays as it is.
//
// It watches the file's folder (inotify), since editors and mounted secrets put new files in the place of old ones.
// Invariant: a change is told once, when its writer has closed the file. On file systems whose changes the kernel does
// not see, as those of other machines, nothing is told. Threading: one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <tuple>

#include <sys/types.h>

namespace rtsg {

class FileWatch {
  public:
    FileWatch() = default;
    ~FileWatch();
    FileWatch(const FileWatch&) = delete;
    FileWatch& operator=(const FileWatch&) = delete;

    void begin(const std::filesystem::path& file);
    /// Readable when something has happened in the folder; -1 if nothing is watched.
    int descriptor() const { return descriptor_; }
    /// True if the file is another one than at the last call, or than when the watch began.
    bool changed();

  private:
    using Mark = std::tuple<dev_t, ino_t, off_t, std::int64_t>;
    std::optional<Mark> markOf() const;

    std::filesystem::path file_;
    std::optional<Mark> mark_;
    int descriptor_ = -1;
};

}  // namespace rtsg
