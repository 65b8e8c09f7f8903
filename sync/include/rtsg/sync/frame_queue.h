// FrameQueue: every change set of a scene, one by one, for a reader on another thread that may be far behind.
//
// Where a polled subscriber gets merged what it missed, a reader of this gets each frame: what makes files of a live
// session needs them all, and may take longer than the session. What waits is kept coded (as on the wire), in memory up
// to a limit, then in a file without a name that goes with the process.
// Invariant: what take() hands out is what was put in, in order, nothing merged. A full disk ends the queue: the bus
// reports it, take() says it once what came before has been taken.
// Threading: apply() and close() on the scene's thread; take() on one other; the numbers on any.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include <rtsg/core/bus.h>
#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct FrameQueueOptions {
    /// Coded bytes that may wait in memory.
    std::size_t memoryBytes = std::size_t{64} << 20;
    /// Where the file is made, when it is first needed; none: the system's folder for temporary files.
    std::filesystem::path folder;
};

class FrameQueue final : public Subscriber {
  public:
    explicit FrameQueue(FrameQueueOptions options = {});
    ~FrameQueue() override;

    /// Puts one set in. Error: it cannot be kept (no room on the disk); nothing is put in from then on.
    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "frame queue"; }
    /// No more will come: take() ends once it has handed out what waits.
    void close();

    enum class Taken : std::uint8_t { set, nothingYet, ended };
    /// The next set; waits for one at most `timeout`. Its memory is used again. Error: sets were lost, see apply().
    Result<Taken> take(ChangeSet& into, std::chrono::milliseconds timeout);

    std::uint64_t waiting() const;  // sets
    /// Scene time between the newest set put in and the last one taken, seconds.
    double secondsBehind() const;
    /// The most that ever waited in the file, bytes.
    std::uint64_t mostOnDisk() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
