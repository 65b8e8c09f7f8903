// OwnEye: a viewer of one's own in a scene that is not to be touched: a replica, or a log that is played.
//
// A small scene beside the other one holds its viewpoint, so that the same keys, wheels and drags move it as they move
// the viewer of a scene that runs here (rtsg/core/navigation.h), with the other scene's walls and ground. Until
// somebody has moved it there is none, and the bound viewpoint counts; HOME goes back to that. Threading: the scene's
// thread. Source: ISO/IEC 19775-1 V4.0 23.4.4.
#pragma once

#include <memory>
#include <optional>

#include <rtsg/core/device_input.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/window/own_scene.h>

namespace rtsg {

class OwnEye {
  public:
    /// `world`: of the other scene, which must outlive this; or of `own`, which keeps before this eye what a
    /// ProximitySensor keeps before the other scene's viewer.
    explicit OwnEye(SharedWorld& world, OwnScene* own = nullptr);
    ~OwnEye();

    /// What a device did, as an event for a field of a scene's root (key, wheel or pointer); others do nothing.
    void take(FieldIndex field, const Value& value);
    /// Goes to a viewpoint of the other scene. Error: it is none, or no longer there.
    Result<> goTo(NodeId viewpoint);
    /// `seconds`: of a clock that goes on. Moves what is in motion.
    void advance(double seconds);
    /// Something moves it.
    bool isMoving() const;
    /// Null until it has been moved. `aspect`: width / height.
    std::optional<Camera> camera(double aspect) const;
    /// A place in the picture as the ray through it, for scenes that do not know this eye; that of another layer's own
    /// viewpoint where such a layer is in front, and one to where a thing is there that is kept before this eye; each
    /// until the buttons that were pressed there are let go.
    PointerInput throughPicture(const PointerInput& input);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
