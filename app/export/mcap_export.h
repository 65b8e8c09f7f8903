// McapExport: writes a scene that something else runs as an MCAP file, for Foxglove and other viewers:
//
//   /tf            foxglove.FrameTransforms: where each shape, light, viewpoint and sound is, as a frame below "world"
//   /scene         foxglove.SceneUpdate: each shape in its frame, as a cube, sphere, cylinder or triangles, in its
//                  colour
//   /rtsg/changes  rtsg.Changes: every frame with its hash and every change in it
//
// A frame costs what changed in it. Only a complete message once a second of scene time, for more than some hundred
// shapes, grows with the scene.
// Invariant: time stamps are scene time. Scale and shear are in /scene, because frames only turn and move. Viewers that
// jump get the last message of each topic, so an incomplete message is followed by a complete one within seconds.
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <string>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/sync/mcap.h>

namespace rtsg::app {

class McapExport {
  public:
    /// Follows the world, which must outlive this and be in its first state.
    static Result<std::unique_ptr<McapExport>> attach(SharedWorld& world, const std::string& file,
                                                      McapOptions options = {});
    ~McapExport();

    /// Why it no longer follows; empty if it does.
    std::string failure() const;
    Result<> finish();

  private:
    struct Impl;
    explicit McapExport(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg::app
