// RecordQueue: hands every step of a scene to a reader on another thread, which may be far behind.
//
// A polled subscriber gets the frames that it missed merged into one; this reader gets each of them. Programs that
// write files from a live session need that, and may take longer than the session. Records are shared with all their
// other holders. Records beyond the memory limit wait in a file without a name, which vanishes with the process.
// Invariant: take() hands out what add() put in, in order and unmerged. Waiting records hold at most one record more
// memory (counted by capacity) than the limit. A full disk ends the queue: add() reports it at once, take() after the
// last intact set. Threading: add() and close() on one thread, take() on another, the other functions on any.
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
    /// The folder for the file, which is made when it is first needed. Empty: the system's folder for temporary files.
    std::filesystem::path folder;
};

class RecordQueue {
  public:
    explicit RecordQueue(RecordQueueOptions options = {});
    ~RecordQueue();

    /// Puts a step in: its record as it is, or else its set, encoded. Error: it cannot be kept because the disk is
    /// full; later calls add nothing.
    Result<> add(const RecordStep& step);
    Result<> add(const ChangeSet& set);
    /// Says that no more will come. take() ends once it has handed out what waits.
    void close();

    enum class Taken : std::uint8_t { set, nothingYet, ended };
    /// Takes the next set, reusing the memory of `into`; waits for it at most `timeout`. Error: sets were lost, see
    /// add().
    Result<Taken> take(ChangeSet& into, std::chrono::milliseconds timeout);

    std::uint64_t waiting() const;  // steps
    /// Scene time between the newest step put in and the last one taken, seconds.
    double secondsBehind() const;
    /// Bytes of the records that wait in memory, and the most bytes that ever waited in the file.
    std::uint64_t inMemory() const;
    std::uint64_t maxOnDisk() const;
    /// Number of frames that came without a record.
    std::uint64_t encoded() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
