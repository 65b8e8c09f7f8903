// SceneWindow: a window onto a world. Whoever looks into it walks, points, types and clicks in the scene.
//
// The application runs its scene on its own thread, as ever, and calls turn() in between: it shows the newest picture,
// and sends what people do as device input (rtsg/core/device_input.h), so that sensors and navigation answer it, and
// logs and mirrors have it. Pictures are made beside it (LivePicture). Keys of its own: Escape closes, F1 shows
// figures, nodes and, of a log, a time line over the picture, F11 fills the screen, Ctrl+S writes a picture, Ctrl+L a
// log, Ctrl+F a film, Ctrl+Space pauses, Ctrl+LEFT and Ctrl+RIGHT skip. Threading: the scene's thread, which should be
// the program's first.

// Example:
//     #include <rtsg/documents/loader.h>
//     #include <rtsg/window/scene_window.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics;
//     rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     scene.setNavigation(true);
//     rtsg::SharedWorld world(scene);
//     scene.newFrame(0);
//     const auto window = rtsg::SceneWindow::open(world, {});
//     if (!window) return;
//     for (double t = 0; (*window)->turn(std::chrono::milliseconds(16)); t += 1 / 60.0) scene.newFrame(t);
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/window/live_picture.h>

namespace rtsg {

/// A place on the time line that is worth a look.
struct SceneWindowMark {
    double time = 0;  // seconds
    std::string text;
    bool isDamage = false;
};

/// What can be gone through in time.
struct SceneWindowTimeline {
    double time = 0, length = 0, rate = 1;  // seconds, seconds, seconds a second
    std::vector<SceneWindowMark> marks;     // in no order
    std::uint64_t marksVersion = 0;         // another one: other marks
};

/// What the application knows beside the scene, for the overlay.
struct SceneWindowStatus {
    struct Line {
        std::string name, value;
        bool isWrong = false;        // it is told in a warning colour
        std::optional<double> time;  // a place on the time line to go to, seconds
    };
    std::vector<Line> lines;
    std::optional<SceneWindowTimeline> timeline;  // of what can be gone through; else none
    /// Who changed the field that SceneWindowRequest::Kind::history asked for; `tellsHistory`: such requests are
    /// answered.
    std::vector<Line> history;
    bool tellsHistory = false;
};

/// What somebody has asked of the application.
struct SceneWindowRequest {
    enum class Kind : std::uint8_t {
        pause,    // on: time stops, or goes on
        skip,     // number: seconds, back if negative
        seek,     // number: to that place on the time line, seconds
        step,     // number: states, back if negative
        rate,     // number: seconds a second
        history,  // node, field: who has changed it; no field: it is asked no longer
        log,      // a log is to be begun, or to end
        film,     // the same of a film
    };
    Kind kind = Kind::pause;
    double number = 0;
    bool on = false;
    NodeId node;
    std::string field;
};

struct SceneWindowOptions {
    std::string title = "rtsg";
    bool fullscreen = false;
    /// Its settings' size is the window's at first. `wake` is the window's own.
    LivePictureOptions picture;
    /// Sends an event to a field of the scene's root; none: Scene::sendEvent(). For replicas, whose origin is to have
    /// it. Errors are told once each.
    std::function<Result<>(FieldIndex, Value)> send;
    /// Looks from a viewpoint that was chosen in the overlay; none: binds it. Errors are told once each.
    std::function<Result<>(NodeId viewpoint)> look;
    /// Sets a field of a node, as the overlay's tree does to hide one; none: Scene::sendEvent(). Errors as above.
    std::function<Result<>(NodeId, FieldIndex, Value)> change;
    bool overlay = false;  // it is shown from the start
    /// Where Ctrl+S writes pictures: "NAME-%d.png" with numbers from 1.
    std::string screenshots = "rtsg-%d.png";
};

struct SceneWindowStatistics {
    std::uint64_t presented = 0;    // pictures
    std::uint64_t events = 0;       // sent to the scene
    std::vector<double> intervals;  // seconds between pictures while something changed, the last thousand
    std::uint64_t sequence = 0;     // the state that is seen
    bool whole = false;             // with all pixels
    int samples = 0;                // a pixel
    LivePictureStatistics pictures;
};

class SceneWindow {
  public:
    /// `world`: of the scene, whose present state is shown first; must outlive this. Errors: no window can be had, and
    /// why; those of LivePicture.
    static Result<std::unique_ptr<SceneWindow>> open(SharedWorld& world, SceneWindowOptions options);
    ~SceneWindow();

    /// Shows the scene's present state, sends what people have done since, and waits for at most so long for more.
    /// False: the window has been closed, or failure() says what went wrong.
    bool turn(std::chrono::milliseconds atMost);
    std::string failure() const;
    /// From any thread: turn() returns.
    void wake();
    /// Whether the scene's time is stopped; the application should run no frame then. setPaused() is for one whose time
    /// cannot be stopped, or has been by other means.
    bool isPaused() const;
    void setPaused(bool on);
    /// What people have asked for since the last call, in order.
    std::vector<SceneWindowRequest> takeRequests();
    /// For the overlay: to be called when something of it has changed, at most ten times a second.
    void setStatus(SceneWindowStatus status);
    bool showsOverlay() const;
    /// Marks a place of the world in the picture, in front of all else: the hand of a touch, which is warm where it
    /// touches. Null: none.
    void showProbe(const std::optional<Vec3d>& place, bool touches);
    /// The newest picture that is shown; null: there is none yet.
    std::shared_ptr<const LivePictureShown> shown() const;
    /// Width and height, pixels.
    std::pair<int, int> size() const;
    /// Files that were dropped on the window since the last call.
    std::vector<std::string> takeDropped();
    /// Seen from there, not from the bound viewpoint.
    void lookFrom(const std::optional<Camera>& eye);
    void setTitle(const std::string& title);
    /// The whole picture of the present state, in the window's size, as `rtsg render` makes it; blocks. Errors: those
    /// of the picture, and of its file.
    Result<> writePicture(const std::string& file);
    /// The newest picture is as good as it will be, and is shown.
    bool isSettled() const;
    SceneWindowStatistics statistics() const;
    Diagnostics takeDiagnostics();

  private:
    struct Impl;
    explicit SceneWindow(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
