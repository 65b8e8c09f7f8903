// RecordLog: a log of the steps of a scene that follows another one, written on a thread of its own.
//
// The bytes that came are what is written: no frame is encoded again unless it came otherwise, and no second scene is
// kept; the follower's own, or a server's (MirrorServer::recordTo()), gives the keyframes. At most 128 steps and 64 MiB
// of them wait for the disk; then add() waits too, and addInPassing() merges what comes into one frame.
// Invariant: states up to acknowledged() are in the file, as LogWriter has it. A failure of the thread (a full disk, no
// memory) ends the log without an index, not the process.
// Threading: all calls on the scene's thread but acknowledged(), failure() and giveSnapshot(), which any may make.
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
    /// Returns once the scene's present state is in the file, or after ten seconds of a disk that hangs. Errors: as
    /// LogWriter's; Mode::input.
    static Result<std::unique_ptr<RecordLog>> start(const Scene& scene, const std::filesystem::path& file,
                                                    LogOptions options = {});
    ~RecordLog();

    /// `scene` is in the state that the step led to. A snapshot of another state than the one before begins a new
    /// session in the file. Nothing is done once the log has failed.
    void add(const Scene& scene, const RecordStep& step);

    /// The same for who may not wait; `changes` is what the step's record holds. True: the snapshot of this state is
    /// wanted, and nothing more is written until giveSnapshot() has been called for it.
    bool addInPassing(const RecordStep& step, const ChangeSet& changes);
    /// Null: there is none, and the log goes on without.
    void giveSnapshot(std::uint64_t state, std::shared_ptr<const ChangeSet> snapshot);
    /// Calls `heard` with every state that is in the file from then on, and with how often the scene had started over
    /// since the log's start: on the log's thread, and with the state that is there now at once. When nothing will be
    /// written any more, both are the largest number. It must not call this log.
    void onAcknowledged(std::function<void(std::uint64_t start, std::uint64_t state)> heard);
    /// Frames that were merged, as the disk took less than came.
    std::uint64_t merged() const;

    /// The last state that is in the file: safe from here on if this process is killed.
    std::uint64_t acknowledged() const;
    /// Why nothing is written any more; empty while it is.
    std::string failure() const;
    std::uint64_t bytes() const;
    /// Frames that were encoded for the log, not written as they came.
    std::uint64_t encoded() const;
    /// Writes what is left and the index, and closes. The first error there was.
    Result<> stop();

  private:
    struct Impl;
    explicit RecordLog(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
