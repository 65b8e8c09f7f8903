// Renderer: the paper's EXTRA interface. A renderer is attached to a scene and presents its state when asked, by
// sending rendering operations to the scene, to nodes, or to lists of nodes.
//
// Dispatch: overriding renderNode() is single dispatch on the renderer. A node renderer in the shared NodeRenderers
// table is single dispatch on the node's type (the paper's Node::render; here nodes have no code). A node renderer that
// is registered with the renderer is dispatch on both, and takes precedence. Types are concrete or abstract; the
// concrete one is tried first, then the nearest abstract one. A PROTO instance is an X3DPrototypeInstance, whatever its
// body holds. Traversal happens only where a node renderer passes the operation on.
// Threading: the scene's thread. Nothing throws across the interface.
// Source: paper section 4.1 and Listing 1.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>

namespace rtsg {

class Renderer;

/// Names an operation of a renderer, which defines its meaning and constants such as `static constexpr Operation
/// collect{1};`.
enum class Operation : std::uint32_t {};

/// The functions by which one renderer, or every renderer, handles nodes of one type.
struct NodeRenderer {
    /// May call Renderer::descend() to have nodes below rendered after it has returned.
    std::function<Result<>(Renderer& renderer, const Node& node, Operation operation)> enter;
    /// Called when everything that `enter` descended to is done; optional.
    std::function<void(Renderer& renderer, const Node& node, Operation operation)> leave;
};

/// Makes a node renderer for one class of renderers: `nodeRendererFor<MyRenderer>([](MyRenderer& r, const Node& n,
/// Operation) {...})`. Precondition: it is registered with renderers of that class only.
template <class R, class Enter>
NodeRenderer nodeRendererFor(Enter enter) {
    return {[enter](Renderer& r, const Node& n, Operation o) -> Result<> { return enter(static_cast<R&>(r), n, o); },
            {}};
}
template <class R, class Enter, class Leave>
NodeRenderer nodeRendererFor(Enter enter, Leave leave) {
    NodeRenderer result = nodeRendererFor<R>(enter);
    result.leave = [leave](Renderer& r, const Node& n, Operation o) { leave(static_cast<R&>(r), n, o); };
    return result;
}

/// Node renderers by type.
class NodeRenderers {
  public:
    /// `type` is the name of a concrete or an abstract type. A later call for the same name replaces an earlier one.
    void set(std::string_view type, NodeRenderer renderer);
    /// Null if there is none for the type or for its abstract types.
    const NodeRenderer* find(const NodeType& type) const;

    /// The standard table: groups pass every operation on to their visible children (Switch: the choice; LOD: the first
    /// level; a PROTO instance: the first node of its body); all other nodes do nothing.
    static NodeRenderers standard();

  private:
    std::vector<std::pair<std::string, std::shared_ptr<const NodeRenderer>>> entries_;
};

class Renderer : public Subscriber {
  public:
    /// `types` are the node renderers that all renderers share; null: NodeRenderers::standard().
    explicit Renderer(std::shared_ptr<const NodeRenderers> types = nullptr);
    ~Renderer() override;

    /// Call it once, before the first frame (Listing 1). It attaches to the bus if listens(); an override calls this
    /// one last. The scene must outlive the attachment.
    virtual Result<> attachToScene(Scene& scene);
    virtual void detachFromScene();
    /// Presents the scene's present state; call it each frame after Scene::newFrame (Listing 1).
    virtual Result<> renderFrame() = 0;

    /// Send the operation to every root node, to each of the nodes, or to one node. They stop at the first error.
    virtual Result<> renderScene(Operation operation);
    virtual Result<> renderNodes(std::span<const NodeId> nodes, Operation operation);
    /// Finds the node renderer of a node and calls it; a node without one is ignored.
    virtual Result<> renderNode(NodeId node, Operation operation);

    /// Sets how this renderer handles this type (double dispatch).
    virtual void registerNodeRenderer(std::string_view type, NodeRenderer renderer);

    /// For node renderers: renders these nodes next, in this order, before others that wait. Unlike renderNodes() from
    /// within, it is safe for nesting of any depth.
    void descend(std::span<const NodeId> nodes, Operation operation);
    void descend(NodeId node, Operation operation) { descend({&node, 1}, operation); }

    /// Gets the changes of the scene; for renderers that listen.
    Result<> apply(const Scene&, const ChangeSet&) override { return {}; }
    std::string subscriberName() const override { return "renderer"; }

    /// Null while not attached.
    const Scene* scene() const { return scene_; }
    /// False once the bus has detached it after an error.
    virtual bool attached() const { return scene_ && (!listens() || attachment_.attached()); }
    /// The reason why it no longer follows the scene; empty while it does, and before it was attached.
    virtual std::string failure() const { return attachment_.failure(); }

  protected:
    /// Whether apply() is to receive changes; the full-traversal renderer needs none.
    virtual bool listens() const { return true; }
    /// Whether a node renderer is registered here for nodes of this type.
    bool ownsType(const NodeType& type) const { return own_.find(type) != nullptr; }

  private:
    struct Waiting {
        NodeId node;
        Operation operation{};
        bool isLeave = false;
    };
    const NodeRenderer* find(const Node& node);
    Result<> enter(NodeId id, Operation operation);
    Result<> run(std::size_t until);

    Scene* scene_ = nullptr;
    Attachment attachment_;
    std::shared_ptr<const NodeRenderers> types_;
    NodeRenderers own_;
    std::vector<const NodeRenderer*> byType_;  // cache by TypeIndex
    std::vector<bool> known_;
    std::vector<Waiting> waiting_;
    unsigned nested_ = 0;
};

}  // namespace rtsg
