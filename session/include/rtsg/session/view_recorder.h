// Writes a log of the scene and a film of its pictures while a window shows it.
//
// Both get the first free name, and are complete once they have been ended. Threading: the scene's thread; a film is
// encoded on a thread of its own, and only its end waits for that.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <rtsg/renderers/movie_writer.h>
#include <rtsg/session/notices.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/window/scene_window.h>

namespace rtsg {

/// Shows each picture from when it came until the next one, thirty times a second.
class WindowFilm {
  public:
    /// `width`, `height`: of the film, to which pictures are enlarged; made even.
    static Result<std::unique_ptr<WindowFilm>> start(const std::string& file, int width, int height);
    ~WindowFilm();
    /// The newest picture, if it is another one, `seconds` after the start.
    void show(std::shared_ptr<const LivePictureShown> picture, double seconds);
    Result<> finish(double seconds);

  private:
    explicit WindowFilm(MovieWriter writer, int width, int height);
    void run();
    Result<> write(const LivePictureShown& picture, std::uint64_t until);

    MovieWriter writer_;
    const int width_, height_;
    std::shared_ptr<const LivePictureShown> last_;
    std::mutex mutex_;  // guards what follows
    std::condition_variable news_;
    std::shared_ptr<const LivePictureShown> next_;
    double seconds_ = 0;  // since the start, of the next picture
    bool ends_ = false;
    Result<> result_;  // the first error
    // The thread's own.
    std::uint64_t written_ = 0;  // pictures
    std::thread thread_;         // last: it uses the others
};

class ViewRecorder {
  public:
    explicit ViewRecorder(SessionContext context = {}) : context_(context) {}
    ~ViewRecorder();
    /// Begins a log, or ends the one that is being written; says so.
    void toggleLog(Scene& scene);
    void toggleFilm(const SceneWindow& window, double seconds);
    /// At each turn; `seconds` of a clock that goes on.
    void show(const SceneWindow& window, double seconds);
    /// For the title and the overlay; empty: nothing is being written.
    std::string status() const;
    /// Ends both. The first error.
    Result<> finish();

  private:
    const SessionContext context_;
    std::string logFile_, filmFile_;
    std::unique_ptr<LogRecorder> log_;
    std::unique_ptr<WindowFilm> film_;
    double begun_ = 0, now_ = 0;
};

}  // namespace rtsg
