// RecordLog: logs the steps of a scene that follows another one, on a thread of its own.
//
// It writes records in the bytes in which they came. It encodes only frames that came without a record, and keeps no
// second scene: the follower's own scene, or the server's replica (MirrorServer::recordTo()), gives the keyframes. At
// most 128 steps and 64 MiB wait for the disk; then add() waits too, and addInPassing() merges frames into one.
// Invariant: states up to acknowledged() are in the file, as with LogWriter. A failure of the thread (full disk, no
// memory) ends the log without an index, and not the process.
// Threading: the scene's thread. acknowledged(), failure() and giveSnapshot() may be called on any.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <rtsg/core/scene.h>
#include <rtsg/sync/encoded_record.h>
#include <rtsg/sync/log.h>

namespace rtsg {

class RecordLog {
  public:
    /// Returns once the scene's present state is in the file, or after ten seconds if the disk hangs. Errors: as
    /// LogWriter's; Mode::input.
    static Result<std::unique_ptr<RecordLog>> start(const Scene& scene, const std::filesystem::path& file,
                                                    LogOptions options = {});
    ~RecordLog();

    /// Logs a step; `scene` must be in the state that it led to. A snapshot of another state than the last one begins a
    /// new session in the file. Does nothing once the log has failed.
    void add(const Scene& scene, const RecordStep& step);

    /// The same for callers that may not wait. `changes` is the content of the step's record. True if the snapshot of
    /// this state is needed: nothing more is written until giveSnapshot() is called for it.
    bool addInPassing(const RecordStep& step, const ChangeSet& changes);
    /// `snapshot` may be null if there is none; the log then goes on without it.
    void giveSnapshot(std::uint64_t state, std::shared_ptr<const ChangeSet> snapshot);
    /// Calls `heard` on the log's thread with every state that is in the file from now on, and with how often the scene
    /// has started over since the log began. The first call comes at once, with the present state. When nothing more
    /// will be written, both numbers are the largest possible. `heard` must not call this log.
    void onAcknowledged(std::function<void(std::uint64_t start, std::uint64_t state)> heard);
    /// Number of frames that were merged because the disk was too slow.
    std::uint64_t merged() const;

    /// The last state in the file. It survives if this process is killed.
    std::uint64_t acknowledged() const;
    /// Why nothing more is written; empty while the log works.
    std::string failure() const;
    std::uint64_t bytes() const;
    /// Number of frames that were encoded for the log rather than written as they came.
    std::uint64_t encoded() const;
    /// Writes what is left and the index, and closes. Returns the first error that occurred.
    Result<> stop();

  private:
    struct Impl;
    explicit RecordLog(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
