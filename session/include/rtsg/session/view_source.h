// ViewSource: whatever people look at in a window: a scene that runs here, the replica of one that is served, or a log.
//
// Threading: the scene's thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/session/running_scene.h>
#include <rtsg/window/scene_window.h>

namespace rtsg {

struct ViewSourceOptions {
    enum class Kind : std::uint8_t { scene, served, log } kind = Kind::scene;
    std::string name;              // a file, an ENDPOINT or a log
    std::string key, author;       // of a served scene: the file with the keys, and who acts there
    double patience = 5;           // seconds to wait for a server at the beginning
    bool endsWithServer = false;   // it ends when the server has left, or been silent for `patience`; else it goes on
                                   // looking for one
    std::vector<std::string> set;  // events with their times, for a scene's file
    bool reload = false;           // the file: its edits are followed
    bool onlyWhole = false;        // a file with errors is not opened
    Resources resources;           // what urls may open
    SceneStart start;
    std::vector<std::string> addresses;  // that DIS nodes may use
    SessionContext context;
};

class ViewSource {
  public:
    virtual ~ViewSource() = default;
    ViewSource() = default;
    ViewSource(const ViewSource&) = delete;
    ViewSource& operator=(const ViewSource&) = delete;

    virtual Scene& scene() = 0;
    virtual SharedWorld& world() = 0;
    virtual const Resources& resources() const = 0;
    /// Whether events for its nodes are taken up, since it runs here. In a scene that does not they would pile up.
    virtual bool takesEvents() const { return false; }
    /// Brings the scene to `t` seconds after the start; `acts`: somebody has done something. False: it has ended.
    virtual bool advance(double t, bool acts) = 0;
    /// Nothing will change by itself before this time, in seconds from the start, as far as is known; or `wake` is
    /// called.
    virtual double restsUntil() const = 0;
    /// From now on `wake` is called, on any thread, when something has arrived. An empty function ends this: the old
    /// one is not called any more.
    virtual void wakeBy(const std::function<void()>& wake) { (void)wake; }
    /// An event for a field of the scene's root, as SceneWindowOptions::send.
    virtual Result<> send(FieldIndex field, Value value) = 0;
    /// See SceneWindowOptions::look and change.
    virtual Result<> look(NodeId viewpoint) = 0;
    virtual Result<> change(NodeId node, FieldIndex field, Value value) = 0;
    /// The camera, if it is not the bound viewpoint.
    virtual std::optional<Camera> eye(double aspect) = 0;
    /// Its time stops or goes on. Error: it has no time of its own.
    virtual Result<> pause(bool on) = 0;
    /// Handles a request of the time line: skip, seek, step, rate, history; and those about how one moves: navigation,
    /// walls, ground, speed, viewAll, straighten. Errors: there is no time line; those of rtsg/core/navigation.h.
    virtual Result<> answer(const SceneWindowRequest& request) {
        (void)request;
        return fail("a scene that runs has one time: a log of it has all");
    }
    /// A short status for the title.
    virtual std::string status() const { return {}; }
    /// For the bar.
    virtual void describe(SceneWindowChoices& choices) = 0;
    /// For the overlay.
    virtual void describe(SceneWindowStatus& status) { (void)status; }
    /// At the end: reports the last messages; returns an error if something went wrong.
    virtual Result<> finish() = 0;
};

/// Errors: it cannot be opened; kUsageCode: a moment in `set` that is none.
Result<std::unique_ptr<ViewSource>> openViewSource(const ViewSourceOptions& options);

}  // namespace rtsg
