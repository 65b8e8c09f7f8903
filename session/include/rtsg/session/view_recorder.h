// Writes a log of the scene and a film of its pictures while a window shows it.
//
// Both get the first free name. Threading: the scene's thread; a film is encoded and written on a thread of its own,
// for which only finish() waits.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/worker.h>
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
    /// No more pictures come. What is left is encoded, and the file written, while others go on.
    void end(double seconds);
    bool isWritten() const { return ends_ && worker_.idle(); }
    /// The same, and waits for the file. Errors: those of MovieWriter; it has no picture.
    Result<> finish(double seconds);

  private:
    explicit WindowFilm(MovieWriter writer, int width, int height);
    Result<> take(std::shared_ptr<const LivePictureShown> next, double seconds, bool ends);
    Result<> write(const LivePictureShown& picture, std::uint64_t until);

    MovieWriter writer_;
    const int width_, height_;
    std::shared_ptr<const LivePictureShown> last_;
    double seconds_ = 0;  // since the start, of the last picture
    bool ends_ = false;
    // The thread's own, until it is written.
    std::shared_ptr<const LivePictureShown> before_;
    Result<> result_;             // the first error
    std::uint64_t written_ = 0;   // pictures
    Worker worker_{"rtsg film"};  // last: its jobs use the others
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
    bool writesLog() const { return log_ != nullptr; }
    bool writesFilm() const { return film_ != nullptr; }
    /// Ends both. The first error.
    Result<> finish();

  private:
    struct Ended {
        std::string file;
        std::unique_ptr<WindowFilm> film;
    };
    std::string freeName(std::string_view extension) const;

    const SessionContext context_;
    std::string logFile_, filmFile_;
    std::unique_ptr<LogRecorder> log_;
    std::unique_ptr<WindowFilm> film_;
    std::vector<Ended> ended_;  // and not yet written
    double begun_ = 0, now_ = 0;
};

}  // namespace rtsg
