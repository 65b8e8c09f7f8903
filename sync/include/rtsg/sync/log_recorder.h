// LogRecorder: writes a log on a thread of its own, so that neither a slow disk nor a long keyframe holds up the scene.
//
// For each frame the scene's thread only puts a pointer into a queue and notifies the recorder. The recorder keeps a
// replica, checks its hash against every frame's and takes keyframes from it. So it needs the memory of a second scene
// (arrays are shared). When it is 256 frames behind, it either merges those into one, which loses no change, or makes
// the scene wait, which loses no state.
// Invariant: states up to acknowledged() are in the file, as with LogWriter. A failure of its thread (no memory, say)
// ends the log without an index, and not the process; the bus reports it.
// Threading: the scene's thread. acknowledged() and failure() may be called on any.
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
    /// What happens when the disk is slower than the scene.
    enum class WhenBehind : std::uint8_t {
        merge,  // frames are merged into one; the scene never waits
        wait,   // the scene's thread waits as long as needed; the log has every state
    };
    /// The scene must outlive this, or stop() must be called before the scene ends. Errors: as for LogWriter;
    /// Mode::input, which needs the running scene itself. With `wait`, start() returns once the first state is in the
    /// file.
    static Result<std::unique_ptr<LogRecorder>> start(Scene& scene, const std::filesystem::path& file,
                                                      LogOptions options = {},
                                                      WhenBehind whenBehind = WhenBehind::merge);
    ~LogRecorder();

    /// The last state in the file. It survives if this process is killed.
    std::uint64_t acknowledged() const;
    /// Calls `heard` on the recorder's thread with every state that is in the file from now on, and with how often the
    /// scene has started over since the recorder began. The first call comes at once, with the present state. When
    /// nothing more will be written, both numbers are the largest possible. `heard` must not call this recorder. From
    /// now on a scene that starts over waits until all earlier states are in the file.
    void onAcknowledged(std::function<void(std::uint64_t start, std::uint64_t state)> heard);
    /// False if the state was not acknowledged in time, or never will be: see failure().
    bool waitFor(std::uint64_t state, std::chrono::milliseconds timeout) const;
    /// Why nothing more is written; empty while the log works.
    std::string failure() const;
    /// Number of frames that were merged because the recorder was behind.
    std::uint64_t merged() const;
    std::uint64_t bytes() const;
    /// Writes what is left and the index, and closes. Returns the first error that occurred.
    Result<> stop();

  private:
    struct Impl;
    explicit LogRecorder(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
