// The one flattening and the one BVH of a scene that a verb runs, made when first asked for.
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <optional>

#include <rtsg/core/resource.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg::app {

/// How a scene whose urls these are is flattened: with as many instances as their policy lets.
SharedWorld::Options worldOptions(const Resources& resources);

/// The one flattening and the one BVH of a scene, for its pictures, sound, export and the rays of pointers; built when
/// first asked for. The scene must outlive this.
class WorldOnDemand {
  public:
    WorldOnDemand(Scene& scene, const Resources& resources) : scene_(scene), options_(worldOptions(resources)) {}
    Scene& scene() { return scene_; }
    SharedWorld& get();
    /// How finely what is curved is cut. Error: the world is there, cut otherwise.
    Result<> cut(const TessellationError& error);
    /// Null if nobody asked for it.
    const SharedWorld* built() const { return world_.get(); }
    /// Nothing if nobody asked for it, or for another error than usual.
    std::optional<Flattener::Cuts> cuts() const;

  private:
    Scene& scene_;
    SharedWorld::Options options_;
    std::unique_ptr<SharedWorld> world_;
};

}  // namespace rtsg::app
