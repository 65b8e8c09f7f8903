// SceneWindow: a window onto a world. Whoever looks into it walks, points, types and clicks in the scene.
//
// The application runs its scene on its own thread, as ever, and calls turn() in between: it shows the newest picture,
// and sends what people do as device input (rtsg/core/device_input.h), so that sensors and navigation answer it, and
// logs and mirrors have it. Pictures are made beside it (LivePicture). Keys of its own: Escape closes, F11 fills the
// screen, Ctrl+S writes a picture, Ctrl+Space pauses, Ctrl+LEFT and Ctrl+RIGHT skip.
// Threading: the scene's thread, which should be the program's first.

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
#include <vector>

#include <rtsg/window/live_picture.h>

namespace rtsg {

struct SceneWindowOptions {
    std::string title = "rtsg";
    bool fullscreen = false;
    /// Its settings' size is the window's at first. `wake` is the window's own.
    LivePictureOptions picture;
    /// Sends an event to a field of the scene's root; none: Scene::sendEvent(). For replicas, whose origin is to have
    /// it. Errors are told once each.
    std::function<Result<>(FieldIndex, Value)> send;
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
    /// Whether Ctrl+Space has stopped the scene's time; the application should run no frame then.
    bool isPaused() const;
    /// Seconds of the scene's time to skip, as Ctrl+LEFT and Ctrl+RIGHT asked for since the last call.
    double takeSkip();
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
