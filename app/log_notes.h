// What somebody who goes through a log wants to know of all of it, read on a thread of its own: where something came
// from outside, where it is damaged, and who has changed a field.
//
// Invariant: nobody waits for it; the destructor ends what is being read. Threading: the thread that made it.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <rtsg/window/scene_window.h>

namespace rtsg::app {

class LogNotes {
  public:
    explicit LogNotes(std::string file) : file_(std::move(file)) {}
    ~LogNotes();
    LogNotes(const LogNotes&) = delete;
    LogNotes& operator=(const LogNotes&) = delete;

    /// Begins to read, if it has not; what has been found so far comes with a number that grows.
    void marks(SceneWindowTimeline& line);
    /// Begins to read who changed that field ("DOOR.rotation", "#12.rotation"), in place of what was asked before.
    void ask(const std::string& field);
    void forget();
    /// What is known of it; a line that says so while it is being read. `start`: of the log, seconds.
    std::vector<SceneWindowStatus::Line> history() const;

  private:
    void readMarks();
    void readHistory(const std::string& field);

    const std::string file_;
    std::atomic<bool> ends_{false}, stale_{false};
    mutable std::mutex mutex_;  // guards what follows
    std::vector<SceneWindowMark> marks_;
    std::uint64_t version_ = 0;
    std::vector<SceneWindowStatus::Line> history_;
    std::thread marking_, asking_;
};

}  // namespace rtsg::app
