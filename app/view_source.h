// ViewSource: what `rtsg view` shows: a scene that runs here, a replica of a served scene, or a log.
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

#include "running_scene.h"

namespace rtsg::app {

struct ViewSourceArguments {
    std::string name, key, author, patience = "5s";
    std::vector<std::string> set;
    bool mayHaveErrors = true;  // a file with errors is shown as far as possible
    ResourceArguments resources;
    StartTime start;
    NetworkArguments network;
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
    /// Brings the scene to `t` seconds after the start. `acts` means that the user has done something. Returns false at
    /// the end.
    virtual bool advance(double t, bool acts) = 0;
    /// As far as is known, nothing changes by itself before this time, in seconds from the start.
    virtual double restsUntil() const = 0;
    /// Sends an event to a field of the scene's root: see SceneWindowOptions::send.
    virtual Result<> send(FieldIndex field, Value value) = 0;
    /// The camera, if it is not the bound viewpoint.
    virtual std::optional<Camera> eye(double aspect) = 0;
    /// Skips so many seconds, back or ahead. Error: the source's time cannot be chosen.
    virtual Result<> seek(double seconds) = 0;
    /// Text for the title.
    virtual std::string status() const { return {}; }
    /// Reports at the end. Error: something went wrong.
    virtual Result<> finish() = 0;
};

/// Opens a scene's file if the name says that it is one, else an endpoint or a log. Errors: it cannot be opened.
Result<std::unique_ptr<ViewSource>> openViewSource(const ViewSourceArguments& arguments);

}  // namespace rtsg::app
