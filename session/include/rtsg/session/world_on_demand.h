// WorldOnDemand: the one flattening and BVH of a scene that runs, made when first needed.
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <optional>

#include <rtsg/core/resource.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/session/notices.h>

namespace rtsg {

/// Options for flattening a scene with these resources: as many instances as their policy allows.
SharedWorld::Options worldOptions(const Resources& resources);

/// The one flattening and BVH of a scene, for its pictures, sound, export and pointer rays. The scene must outlive
/// this.
class WorldOnDemand {
  public:
    WorldOnDemand(Scene& scene, const Resources& resources, const SessionContext& context)
        : scene_(scene), options_(worldOptions(resources)), context_(context) {}
    Scene& scene() { return scene_; }
    SharedWorld& get();
    /// Sets how finely curved geometry is cut. Error: the world exists already and is cut differently.
    Result<> cut(const TessellationError& error);
    /// Null if it was not needed.
    const SharedWorld* built() const { return world_.get(); }
    /// Empty if it was not needed, or has the default error.
    std::optional<Flattener::Cuts> cuts() const;

  private:
    Scene& scene_;
    SharedWorld::Options options_;
    SessionContext context_;
    std::unique_ptr<SharedWorld> world_;
};

}  // namespace rtsg
