// LogFiles: the bytes of a log, which may lie in several files: the pieces of a session.
//
// Invariant: the files are read as if they stood one after the other. All but the last keep their length. Parts that
// cannot be read, for example because a file was replaced, read as zeros. At most two files are open.
// Threading: one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sys/stat.h>

#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/byte_buffer.h>
#include <rtsg/sync/dictionary.h>

namespace rtsg {

class LogFiles {
  public:
    /// `name` as LogReader::open(). Errors: a file cannot be read, or is no regular one.
    static Result<std::unique_ptr<LogFiles>> open(const std::filesystem::path& name);
    ~LogFiles();
    LogFiles(const LogFiles&) = delete;
    LogFiles& operator=(const LogFiles&) = delete;

    /// Where each file ends, as long as they were at first.
    std::vector<std::uint64_t> ends() const;
    /// The bytes that there are now.
    std::uint64_t size() const;
    /// Replaces `into` by the bytes from there on; there may be fewer.
    void read(std::uint64_t offset, std::size_t length, ByteBuffer& into);
    /// A writer has the last file open.
    bool beingWritten() const;
    /// " (byte 12 of a.0002.rlog)" if there are several files.
    std::string locationAt(std::uint64_t offset) const;

  private:
    struct File {
        std::filesystem::path name;
        std::uint64_t from = 0, size = 0;
        dev_t device = 0;
        ino_t node = 0;
    };
    LogFiles() = default;
    int descriptorOf(std::size_t file);

    std::vector<File> files_;
    std::size_t opened_ = 0;             // the file of which descriptor_ is
    int descriptor_ = -1, newest_ = -1;  // that of the last file stays
};

// ---- Pieces: the files of a rotated log, NAME.0001.rlog and so on beside NAME.rlog
// -----------------------------------

/// Numbers of pieces are below this and have at least four digits.
inline constexpr std::uint64_t kMaxPieces = 1'000'000;

/// All files that have the name of a piece of `file`, ordered by number.
std::vector<std::pair<std::uint64_t, std::filesystem::path>> numberedPieces(const std::filesystem::path& file);

/// The head at the beginning of a log. Nothing if it is not intact.
std::optional<StreamHead> headOf(const std::filesystem::path& file);

/// True if the file ends within the first record of a log.
bool isCutInHead(const std::filesystem::path& file);

/// The piece from which a session goes on, if the newest file `log` has none of its states. Empty if there is none.
std::filesystem::path pieceBefore(const std::filesystem::path& log);

}  // namespace rtsg
