// Log stores: what verbs can do with a log in a file, in several files, in a folder, in a pipe or in JetStream.
//
// One table says it, and every verb that writes a log asks it before it begins. What the table allows is whole in the
// end: no store takes a part of what it was given. Threading: the main thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include <rtsg/nats/nats_log.h>

#include "files.h"

namespace rtsg::app {

enum class LogUse : std::uint8_t {
    write,   // a new log in one piece
    rotate,  // a new log in several pieces
    goOn,    // continue a log
    goOnRotating,
    recordAgain,  // replace a log, once it has been read, by what a test records
};

/// Throws UsageError, which names `option`, if the store in which a log of this name lies cannot do that.
void checkLogUse(const std::string& option, const std::string& log, LogUse use);

/// A folder of the system's for temporary files, which goes with this.
class PassingFolder {
  public:
    static Result<PassingFolder> make();
    PassingFolder() = default;
    PassingFolder(PassingFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}
    PassingFolder& operator=(PassingFolder&& other) noexcept {
        std::swap(path_, other.path_);
        return *this;
    }
    ~PassingFolder();
    const std::filesystem::path& path() const { return path_; }
    /// Lets the folder stay.
    void keep() { path_.clear(); }

  private:
    std::filesystem::path path_;
};

/// A log that a verb writes, stored at a NATS server while it grows if its name is an address.
class StoredLog {
  public:
    /// Calls checkLogUse(). Replaces an address in `file` by the name of a local file whose content is then stored;
    /// changes no other name. Throws UsageError for an invalid address.
    static Result<StoredLog> start(const std::string& option, std::string& file, LogUse use, bool force);
    /// Waits until all is stored, and says what is. Returns the status with which the verb ends, if it would end with
    /// `status`.
    int finish(int status);

  private:
    PassingFolder folder_;
    std::string file_;
    std::unique_ptr<NatsLog> log_;
};

/// A log that a verb reads. If `file` is an address, it becomes that of a local copy of what is stored there, which
/// goes with the result.
Result<PassingFolder> fetchLog(const std::string& option, std::string& file);

/// The name that users know of a log: an address without secrets, or the file's name.
std::string shownLog(const std::string& typed);

}  // namespace rtsg::app
