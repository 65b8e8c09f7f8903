// SceneWindow: a window onto a world, in which people walk, point, type and click.
//
// The application runs its scene on its own thread and calls poll() between frames. poll() shows the newest picture and
// sends user input as device input (rtsg/core/device_input.h), so that sensors and navigation react, and logs and
// mirrors have it. LivePicture makes the pictures. A bar at the top has what people look for first. The window handles
// these keys: Escape closes; ? lists the keys; F1 shows an overlay with statistics, nodes and, for a log, a time line;
// F2 the bar; F6 to F9 choose how one moves; F11 switches to full screen; Ctrl+O opens, Ctrl+Backspace goes back;
// Ctrl+S writes a picture, Ctrl+L a log, Ctrl+F a film; Ctrl+Space pauses; Ctrl+LEFT and Ctrl+RIGHT skip. Threading:
// the scene's thread, which should be the program's main thread.

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
//     for (double t = 0; (*window)->poll(std::chrono::milliseconds(16)); t += 1 / 60.0) scene.newFrame(t);
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

/// A mark on the time line.
struct SceneWindowMark {
    double time = 0;  // seconds
    std::string text;
    bool isDamage = false;
};

/// The time line of a log or another source that can be played.
struct SceneWindowTimeline {
    double time = 0, length = 0, rate = 1;  // seconds, seconds, seconds a second
    std::vector<SceneWindowMark> marks;     // in no order
    std::uint64_t marksVersion = 0;         // changes whenever the marks change
};

/// Data of the application for the overlay.
struct SceneWindowStatus {
    struct Line {
        std::string name, value;
        bool isWrong = false;        // shown in a warning colour
        std::optional<double> time;  // a time on the time line to jump to, in seconds
    };
    std::vector<Line> lines;
    std::optional<SceneWindowTimeline> timeline;  // if there is a time line
    /// The changes of the field that SceneWindowRequest::Kind::history asked for. `showsHistory` says whether such
    /// requests are answered.
    std::vector<Line> history;
    bool showsHistory = false;
};

/// A user's request to the application.
/// What the bar shows as chosen.
struct SceneWindowChoices {
    std::string navigation = "EXAMINE";  // empty: nobody moves here
    bool walls = true, ground = true;
    double speed = 1;              // metres a second
    std::optional<double> volume;  // 0 to 1; none: there is no sound
    bool canGoBack = false, writesLog = false, writesFilm = false;
    friend bool operator==(const SceneWindowChoices&, const SceneWindowChoices&) = default;
};

struct SceneWindowRequest {
    enum class Kind : std::uint8_t {
        pause,       // on: time stops; off: it continues
        skip,        // number: seconds, back if negative
        seek,        // number: a time on the time line, seconds
        step,        // number: states, back if negative
        rate,        // number: seconds a second
        history,     // node, field: who has changed the field; an empty field ends the request
        log,         // a log is to begin, or to end
        film,        // the same for a film
        navigation,  // field: EXAMINE, WALK, FLY, LOOKAT or NONE
        walls,       // on: they stop the viewer
        ground,      // on: the viewer falls to it
        speed,       // number: by which NavigationInfo's speed is multiplied
        viewAll,     // the viewer goes to where all is to be seen
        straighten,  // the viewer stands upright
        volume,      // number: of the sound, 0 to 1
        open,        // field: a file that is to be shown instead
        back,        // to what was shown before
        anchor,      // node: an Anchor that was clicked
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
    /// The size in its settings is the window's first size. The window sets `wake` itself.
    LivePictureOptions picture;
    /// Sends an event to a field of the scene's root; if empty, Scene::sendEvent() is used. Replicas need it, to send
    /// the event to their origin. Each error is shown once.
    std::function<Result<>(FieldIndex, Value)> send;
    /// Moves the view to a viewpoint that was chosen in the overlay; if empty, the viewpoint is bound. Each error is
    /// shown once.
    std::function<Result<>(NodeId viewpoint)> look;
    /// Sets a field of a node, which the overlay's tree does to hide nodes; if empty, Scene::sendEvent() is used.
    /// Errors as above.
    std::function<Result<>(NodeId, FieldIndex, Value)> change;
    bool overlay = false;  // whether it is shown from the start
    bool bar = false;      // the same for the bar at the top
    std::string folder;    // where somebody looks for files first; empty: the working folder
    /// Where Ctrl+S writes pictures: "NAME-%d.png" with numbers from 1.
    std::string screenshots = "rtsg-%d.png";
};

struct SceneWindowStatistics {
    std::uint64_t presented = 0;    // pictures
    std::uint64_t events = 0;       // sent to the scene
    std::vector<double> intervals;  // seconds between pictures while something changed, the last thousand
    std::uint64_t sequence = 0;     // the state that is shown
    bool whole = false;             // the picture has all pixels
    int samples = 0;                // for each pixel
    LivePictureStatistics pictures;
};

class SceneWindow {
  public:
    /// `world` shows the scene, whose present state is shown first; it must outlive this. Errors: the window cannot be
    /// opened; those of LivePicture.
    static Result<std::unique_ptr<SceneWindow>> open(SharedWorld& world, SceneWindowOptions options);
    ~SceneWindow();

    /// Shows the scene's present state, sends the user's input, and waits for more input for at most `atMost`. Returns
    /// false if the window was closed or failed; see failure().
    bool poll(std::chrono::milliseconds atMost);
    std::string failure() const;
    /// Makes poll() return; may be called on any thread.
    void wake();
    /// Whether the user has stopped the scene's time; the application should then run no frames. setPaused() is for
    /// applications that cannot stop time, or have stopped it by other means.
    bool isPaused() const;
    void setPaused(bool on);
    /// The user's requests since the last call, in order.
    std::vector<SceneWindowRequest> takeRequests();
    /// Sets the data of the overlay. Call it when the data have changed, at most ten times a second.
    void setStatus(SceneWindowStatus status);
    void setChoices(SceneWindowChoices choices);
    bool showsOverlay() const;
    bool showsBar() const;
    /// The integrator of its pictures, which the user may have changed.
    Integrator integrator() const;
    /// Adds a line to the messages at the foot of the window. The last five hundred are kept.
    void showMessage(const Diagnostic& message);
    /// The messages that are shown.
    std::vector<Diagnostic> messages() const;
    /// Marks a place of the world in the picture, in front of everything: the hand of a haptic device, in a warm colour
    /// while it touches. Null: no mark.
    void showProbe(const std::optional<Vec3d>& position, bool touches);
    /// The newest picture that is shown; null if there is none yet.
    std::shared_ptr<const LivePictureShown> shown() const;
    /// Width and height, pixels.
    std::pair<int, int> size() const;
    /// Files that were dropped on the window since the last call.
    std::vector<std::string> takeDropped();
    /// Sets an eye that replaces the camera of the bound viewpoint.
    void lookFrom(const std::optional<Camera>& eye);
    void setTitle(const std::string& title);
    /// Writes a full picture of the present state, in the window's size, as `rtsg render` would make it; blocks.
    /// Errors: those of the picture and of its file.
    Result<> writePicture(const std::string& file);
    /// Whether the newest picture has its full quality and is shown.
    bool isSettled() const;
    SceneWindowStatistics statistics() const;
    Diagnostics takeDiagnostics();

  private:
    struct Impl;
    explicit SceneWindow(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
