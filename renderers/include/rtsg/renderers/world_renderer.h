// WorldRenderer: a Renderer that starts from a SharedWorld. Light and sound are such; so is one of your own.
//
// Invariant: while attached, follow() gets every delta of the world, first a snapshot, after the rays have taken it.
// Node renderers that are registered with it are called for every node of their types that the scene holds, wherever it
// hangs, when renderOwnNodes() is called; the work follows their number, never the scene.
// Threading: the scene's thread; or all but renderFrame(state) there, and that one on a thread of the renderer's own,
// with states of SharedWorld::latest(). Source: paper section 4.1; the world in between is ours.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <rtsg/renderers/renderer.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

class WorldRenderer : public Renderer {
  public:
    /// `world` must outlive this. `types`: as for Renderer.
    explicit WorldRenderer(SharedWorld& world, std::shared_ptr<const NodeRenderers> types = nullptr);
    ~WorldRenderer() override;

    /// Accepts the world's scene only. When it returns, follow() has had its snapshot; if follow() failed, this fails
    /// too.
    Result<> attachToScene(Scene& scene) override;
    void detachFromScene() override;
    bool attached() const override;
    std::string failure() const override;
    void registerNodeRenderer(std::string_view type, NodeRenderer renderer) override;

    using Renderer::renderFrame;
    /// Presents this state, of this world, without the scene: on any thread, one call at a time. The default refuses.
    virtual Result<> renderFrame(const WorldState& state);

    /// The state that the last renderFrame() presented, as the scene numbers them; 0 before the first. Pictures and
    /// sound that name the same state belong together. May be called on any thread.
    std::uint64_t presented() const;

    SharedWorld& world() const;
    /// The tables of a state that renderFrame(state) works from, besides its rays; the same object while nothing in
    /// them changes. Null: the state was made before this was attached, or after it failed. May be called on any
    /// thread.
    std::shared_ptr<const void> tables(const WorldState& state) const;

  protected:
    /// The renderer's InstanceSubscriber::freeze(): the tables that renderFrame(state) gets from begin().
    virtual std::shared_ptr<const void> freezeTables() { return nullptr; }
    /// The renderer's InstanceSubscriber::looksFrom().
    virtual std::optional<PictureSight> looksFrom() { return std::nullopt; }
    /// To be called first in renderFrame(state): returns what freezeTables() gave, and from now on presented() names
    /// the state. Null: it was made before this was attached, or after it failed.
    std::shared_ptr<const void> begin(const WorldState& state);
    /// Whether node renderers are registered here: renderOwnNodes() needs the scene, hence its thread.
    bool ownsNodes() const;
    /// The renderer's InstanceSubscriber::apply().
    virtual Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) = 0;
    /// Sends the operation to the nodes that have a node renderer of their own here, in the order of their numbers.
    Result<> renderOwnNodes(Operation operation);
    /// Error: failure(), or that it is not attached. First of all in a renderFrame(): brings the world up to date.
    Result<> begin();
    /// After that: presented() is the world's state.
    void presentsNow();
    bool listens() const override { return false; }  // the world does

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
