// nats:// and tls:// addresses on the command line: publishing what a verb serves, and following it from there.
//
// Threading: one thread.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <rtsg/nats/mirror_origin.h>
#include <rtsg/nats/nats_address.h>
#include <rtsg/nats/nats_log.h>
#include <rtsg/nats/nats_publisher.h>
#include <rtsg/sync/mirror_server.h>

#include "command.h"

namespace rtsg::app {

/// Where a verb follows a scene. Throws UsageError for what is neither an endpoint nor an address of a NATS server, and
/// for a key file with the latter. Tries for `patience` seconds to connect to a NATS server. Error: no connection.
Result<MirrorOrigin> openOrigin(const std::string& typed, const std::string& key, double patience);
/// A log as it is named to users: the address of one that is stored, without secrets.
std::string shownLog(const std::string& typed);
/// Says what has happened to the connection.
void printNews(MirrorOrigin& origin);

/// Publishes what a verb serves, if NATS was asked for.
class Published {
  public:
    /// `address` may be empty. Throws UsageError if it is none.
    static Result<Published> start(const std::string& address, const MirrorServer& server,
                                   const std::optional<MirrorKeys>& keys);
    /// Without secrets; empty if nothing is published.
    std::string address() const { return publisher_ ? publisher_->address() : std::string(); }
    void printNews();
    /// True if something was not published and never will be.
    bool failed() const { return failed_; }
    /// Call it after the server's end, so that mirrors get its goodbye.
    void end() { publisher_.reset(); }

  private:
    std::unique_ptr<NatsPublisher> publisher_;
    bool failed_ = false;
};

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

/// A log that a verb writes, stored at a NATS server while it grows.
class StoredLog {
  public:
    /// If `file` is an address, replaces it by the name of a local file whose content is then stored; otherwise does
    /// nothing. Throws UsageError for an invalid address.
    static Result<StoredLog> start(const std::string& option, std::string& file, NatsLog::Begin begin);
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

/// Throws UsageError if this is no address of a session at a NATS server.
void checkNatsAddress(const std::string& option, const std::string& address);

}  // namespace rtsg::app
