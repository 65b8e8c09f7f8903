// LogRecorder: a log written on a thread of its own, so that neither a slow disk nor a long keyframe holds up the
// scene.
//
// What the scene's thread pays a frame is a pointer into a queue and a notice. The recorder keeps a replica, checks its
// hash against every frame's and takes keyframes from it, so memory is that of a second scene (arrays are shared). The
// queue is bounded: one that falls more than 256 frames behind gets those merged into one, losing no change, or has the
// scene wait, losing no state either. Invariant: states up to acknowledged() are in the file, as LogWriter has it.
// A failure of its thread (no memory, say) ends the log without an index, not the process; the bus reports it.
// Threading: all calls on the scene's thread but acknowledged() and failure(), which any may make.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <rtsg/core/scene.h>
#include <rtsg/sync/log.h>

namespace rtsg {

class LogRecorder {
  public:
    /// When the disk takes less than the scene makes.
    enum class WhenBehind : std::uint8_t {
        merge,  // frames come merged into one: the scene is never held up
        wait,   // the scene's thread waits, for as long as it takes: every state is in the log
    };
    /// The scene must outlive this, or stop() be called before it goes. Errors: as LogWriter's; Mode::input, which
    /// needs the running scene itself. With `wait` it returns once the first state is in the file.
    static Result<std::unique_ptr<LogRecorder>> start(Scene& scene, const std::filesystem::path& file,
                                                      LogOptions options = {},
                                                      WhenBehind whenBehind = WhenBehind::merge);
    ~LogRecorder();

    /// The last state that is in the file: safe from here on if this process is killed.
    std::uint64_t acknowledged() const;
    /// Calls `heard` with every state that is in the file from then on, and with how often the scene had started over
    /// since the recorder's start: on the recorder's thread, and with the state that is there now at once. When nothing
    /// will be written any more, both are the largest number. It must not call this recorder. Where the scene starts
    /// over it then waits until all before is in the file.
    void onAcknowledged(std::function<void(std::uint64_t start, std::uint64_t state)> heard);
    /// False when that state was not acknowledged in time, or will not be: see failure().
    bool waitFor(std::uint64_t state, std::chrono::milliseconds timeout) const;
    /// Why nothing is written any more; empty while it is.
    std::string failure() const;
    /// Frames that were merged because the recorder was behind.
    std::uint64_t merged() const;
    std::uint64_t bytes() const;
    /// Writes what is left and the index, and closes. The first error there was.
    Result<> stop();

  private:
    struct Impl;
    explicit LogRecorder(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
