// Notes about a whole log for its viewer, read on a thread of its own: inputs from outside, damage, and who has changed
// a field.
//
// Invariant: no function waits for the reading; the destructor ends it. Threading: the thread that made it.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/worker.h>
#include <rtsg/window/scene_window.h>

namespace rtsg {

class LogNotes {
  public:
    explicit LogNotes(std::string file) : file_(std::move(file)) {}
    ~LogNotes() { stale_ = true; }

    /// Begins to read, unless it has begun. Gives the marks found so far, with a number that grows.
    void marks(SceneWindowTimeline& line);
    /// Begins to read who changed that field ("DOOR.rotation", "#12.rotation"), instead of the field asked for before.
    void ask(const std::string& field);
    void forget();
    /// The changes found so far; while the log is read, a line says so. `start` is that of the log, in seconds.
    std::vector<SceneWindowStatus::Line> history() const;

  private:
    void readMarks();
    void readHistory(const std::string& field);

    const std::string file_;
    std::atomic<bool> stale_{false};
    bool begun_ = false;
    mutable std::mutex mutex_;  // guards what follows
    std::vector<SceneWindowMark> marks_;
    std::uint64_t version_ = 0;
    std::vector<SceneWindowStatus::Line> history_;
    Worker marking_{"rtsg marks"}, asking_{"rtsg history"};  // last: they use the others
};

}  // namespace rtsg
