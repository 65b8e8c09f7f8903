// WorldRenderer: a Renderer that uses a SharedWorld. Light and sound are such renderers, and applications can write
// others.
//
// Invariant: while attached, follow() gets every delta of the world, first a snapshot, after the rays have been
// updated. renderOwnNodes() calls the node renderers that are registered here, for every node of their types in the
// scene; the cost follows the number of these nodes, not the scene. Threading: the scene's thread. A renderer may also
// run renderFrame(state) alone on a thread of its own, with states of SharedWorld::latest(). Source: paper section 4.1;
// the shared world is not in the paper.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <rtsg/renderers/renderer.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

class WorldRenderer : public Renderer {
  public:
    /// `world` must outlive this. `types` is as for Renderer.
    explicit WorldRenderer(SharedWorld& world, std::shared_ptr<const NodeRenderers> types = nullptr);
    ~WorldRenderer() override;

    /// Accepts the world's scene only. When it returns, follow() has had its snapshot; an error of follow() is
    /// returned.
    Result<> attachToScene(Scene& scene) override;
    void detachFromScene() override;
    bool attached() const override;
    std::string failure() const override;
    void registerNodeRenderer(std::string_view type, NodeRenderer renderer) override;

    using Renderer::renderFrame;
    /// Presents a state of this world without the scene, on any thread, one call at a time. The default returns an
    /// error.
    virtual Result<> renderFrame(const WorldState& state);

    /// The number of the scene's state that the last renderFrame() presented; 0 before the first. Pictures and sound
    /// with the same number belong together. May be called on any thread.
    std::uint64_t presented() const;

    SharedWorld& world() const;
    /// The renderer's tables in a state, for renderFrame(state); the same object while nothing in them changes. Null if
    /// the state was made before this was attached, or after it failed. May be called on any thread.
    std::shared_ptr<const void> tables(const WorldState& state) const;

  protected:
    /// The renderer's InstanceSubscriber::freeze(): the tables that begin() returns in renderFrame(state).
    virtual std::shared_ptr<const void> freezeTables() { return nullptr; }
    /// The renderer's InstanceSubscriber::looksFrom().
    virtual std::optional<PictureSight> looksFrom() { return std::nullopt; }
    /// Call it first in renderFrame(state): it returns the result of freezeTables(), and from now on presented() names
    /// the state. Null if the state was made before this was attached, or after it failed.
    std::shared_ptr<const void> begin(const WorldState& state);
    /// Whether node renderers are registered here: renderOwnNodes() needs the scene, and so its thread.
    bool ownsNodes() const;
    /// The renderer's InstanceSubscriber::apply().
    virtual Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) = 0;
    /// Sends the operation to the nodes whose type has a node renderer here, ordered by node number.
    Result<> renderOwnNodes(Operation operation);
    /// Call it first in renderFrame(): brings the world up to date. Error: failure(), or not attached.
    Result<> begin();
    /// Call it after that: makes presented() the world's state.
    void presentsNow();
    bool listens() const override { return false; }  // the world does

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
