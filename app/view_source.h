// ViewSource: whatever `rtsg view` shows: a scene that runs here, the replica of one that is served, or a log.
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
    bool mayHaveErrors = true;  // the file: what is left is shown
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
    /// Brings the scene to `t` seconds after the start; `acts`: somebody has done something. False: it has ended.
    virtual bool advance(double t, bool acts) = 0;
    /// Nothing will change by itself before this time, in seconds from the start, as far as is known.
    virtual double restsUntil() const = 0;
    /// An event for a field of the scene's root, as SceneWindowOptions::send.
    virtual Result<> send(FieldIndex field, Value value) = 0;
    /// Where to look from, if it is not the bound viewpoint.
    virtual std::optional<Camera> eye(double aspect) = 0;
    /// Seconds to skip, back or ahead. Error: its time cannot be chosen.
    virtual Result<> seek(double seconds) = 0;
    /// For the title: what is worth knowing.
    virtual std::string status() const { return {}; }
    /// At the end: what went wrong; and says what there is to say.
    virtual Result<> finish() = 0;
};

/// A scene's file, by what the name says; ENDPOINT or LOG else. Errors: it cannot be opened.
Result<std::unique_ptr<ViewSource>> openViewSource(const ViewSourceArguments& arguments);

}  // namespace rtsg::app
