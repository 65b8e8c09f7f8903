// FullTraversalRenderer: the baseline of the paper's measurements (its inView). It has no listeners: each frame it
// traverses the whole scene, compares it with the last frame, and sends the differences to its own RayWorld.
//
// Invariant: after renderFrame() its RayWorld gives the same answers as one that follows a Flattener. It exists for
// measurements, and to check the incremental code by code that shares no state with it. Therefore, unlike all other
// renderers, it must not start from a SharedWorld. Threading: the scene's thread. Source: paper sections 2, 4 and 6.1.
#pragma once

#include <cstdint>
#include <memory>

#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>
#include <rtsg/renderers/renderer.h>

namespace rtsg {

class FullTraversalRenderer final : public Renderer {
  public:
    /// Visits every node and updates the renderer's record of it.
    static constexpr Operation collect{1};

    /// Without `meshes` it uses tessellate().
    explicit FullTraversalRenderer(const RayWorld::Options& options = {}, MeshSource meshes = {});
    ~FullTraversalRenderer() override;

    Result<> attachToScene(Scene& scene) override;
    Result<> renderFrame() override;
    /// Sets the sights for layouts, ScreenGroups and text in points, as Flattener::setViewer() does, from the next
    /// frame on. Billboards and levels of detail have no viewer here.
    void setSights(std::vector<LayerSight> sights);

    const RayWorld& world() const;
    /// The changes that the last frame found; valid until the next frame.
    const InstanceDelta& delta() const;
    struct Stats {
        std::uint64_t nodesVisited = 0;  // by the last frame
        double traverseSeconds = 0;      // for the traversal and the comparison, without the update of the RayWorld
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
