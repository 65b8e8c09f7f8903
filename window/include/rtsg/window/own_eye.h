// OwnEye: the viewer's own eye in a scene that must not be changed: a replica, or a log that is played.
//
// A small separate scene holds its viewpoint, so that keys, wheels and drags move it in the same way as in a scene that
// runs here (rtsg/core/navigation.h), with the other scene's walls and ground. Until somebody has moved it, there is no
// own eye, and the bound viewpoint is used; HOME returns to that. Threading: the scene's thread. Source: ISO/IEC
// 19775-1 V4.0 23.4.4.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include <rtsg/core/device_input.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/window/own_scene.h>

namespace rtsg {

class OwnEye {
  public:
    /// `world` shows the other scene, which must outlive this; or it shows `own`, which moves HUDs (see own_scene.h) to
    /// this eye.
    explicit OwnEye(SharedWorld& world, OwnScene* own = nullptr);
    ~OwnEye();

    /// Takes an input of a device, as an event for a field of a scene's root (key, wheel or pointer); it ignores
    /// others.
    void take(FieldIndex field, const Value& value);
    /// Goes to a viewpoint of the other scene. Error: the node is no viewpoint, or no longer exists.
    Result<> goTo(NodeId viewpoint);
    /// Moves the eye if it is in motion. `seconds` is the time of a running clock.
    void advance(double seconds);
    /// Whether it is in motion.
    bool isMoving() const;
    /// Null until it has been moved. It has the projection of the viewpoint where it began. `aspect` is width / height.
    std::optional<Camera> camera(double aspect) const;
    /// Lets `choice` send events to the scene that holds this eye, with the walls around it (rtsg/core/navigation.h).
    /// From then on there is an own eye. Errors: those of `choice`.
    Result<> choose(const std::function<Result<>(Scene&, SpaceQueries&)>& choice);
    void setObstacles(const ObstacleRules& rules);
    /// The scene by whose NavigationInfo this eye moves.
    const Scene& navigated() const;
    /// Replaces a place in the picture by the ray through it, for scenes that do not know this eye. Where another layer
    /// is in front, it is the ray of that layer's viewpoint; where a HUD is in front, it is a ray that meets the HUD in
    /// the other scene. The choice stays until the buttons that were pressed there are released.
    PointerInput throughPicture(const PointerInput& input);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
