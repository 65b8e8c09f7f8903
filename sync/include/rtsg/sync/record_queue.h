// RecordQueue: every step of a scene, one by one, for a reader on another thread that may be far behind.
//
// Where a polled subscriber gets merged what it missed, a reader of this gets each frame: what makes files of a live
// session needs them all, and may take longer than the session. Records are shared with whoever else has them; what
// exceeds the limit of memory waits in a file without a name that goes with the process.
// Invariant: what take() hands out is what was put in, in order, nothing merged. The memory that waiting records hold,
// by capacity, exceeds the limit by one record at most. A full disk ends the queue: add() says so, take() says it once
// what came before has been taken.
// Threading: add() and close() on one thread; take() on one other; the numbers on any.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/sync/encoded_record.h>

namespace rtsg {

struct RecordQueueOptions {
    /// Bytes of records that may wait in memory.
    std::size_t memoryBytes = std::size_t{64} << 20;
    /// Where the file is made, when it is first needed; none: the system's folder for temporary files.
    std::filesystem::path folder;
};

class RecordQueue {
  public:
    explicit RecordQueue(RecordQueueOptions options = {});
    ~RecordQueue();

    /// Puts one step in: its record as it is, or its set, encoded. Error: it cannot be kept (no room on the disk);
    /// nothing is put in from then on.
    Result<> add(const RecordStep& step);
    Result<> add(const ChangeSet& set);
    /// No more will come: take() ends once it has handed out what waits.
    void close();

    enum class Taken : std::uint8_t { set, nothingYet, ended };
    /// The next set; waits for one at most `timeout`. Its memory is used again. Error: sets were lost, see add().
    Result<Taken> take(ChangeSet& into, std::chrono::milliseconds timeout);

    std::uint64_t waiting() const;  // steps
    /// Scene time between the newest step put in and the last one taken, seconds.
    double secondsBehind() const;
    /// Bytes that wait in memory, and the most that ever waited in the file.
    std::uint64_t inMemory() const;
    std::uint64_t mostOnDisk() const;
    /// Frames that came without a record.
    std::uint64_t encoded() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
