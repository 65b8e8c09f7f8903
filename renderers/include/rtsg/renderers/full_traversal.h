// FullTraversalRenderer: the baseline of the paper's measurements (its inView): no listeners; each frame the whole
// scene is traversed, compared with what the last frame found, and the differences go to a RayWorld of its own.
//
// Invariant: after renderFrame() its RayWorld answers as one that follows a Flattener would.
// It exists to be measured against, and to check the incremental path by one that shares no state with it: for both it
// must not start from a SharedWorld, as all other renderers do.
// Threading: the scene's thread.
// Source: paper sections 2, 4 and 6.1.
#pragma once

#include <cstdint>
#include <memory>

#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>
#include <rtsg/renderers/renderer.h>

namespace rtsg {

class FullTraversalRenderer final : public Renderer {
  public:
    /// Looks at every node and updates what is known of it.
    static constexpr Operation collect{1};

    /// `meshes`: none: tessellate().
    explicit FullTraversalRenderer(const RayWorld::Options& options = {}, MeshSource meshes = {});
    ~FullTraversalRenderer() override;

    Result<> attachToScene(Scene& scene) override;
    Result<> renderFrame() override;
    /// For layouts, ScreenGroups and text in points, as Flattener::setViewer(); from the next frame on. Billboards and
    /// levels of detail know no viewer here.
    void setSights(std::vector<LayerSight> sights);

    const RayWorld& world() const;
    /// The changes that the last frame found; valid until the next frame.
    const InstanceDelta& delta() const;
    struct Stats {
        std::uint64_t nodesVisited = 0;  // by the last frame
        double traverseSeconds = 0;      // to visit and compare, without the RayWorld's update
    };
    Stats stats() const;
    std::string subscriberName() const override { return "full traversal"; }

  protected:
    bool listens() const override { return false; }

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
