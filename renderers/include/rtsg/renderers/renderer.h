// Renderer: the paper's EXTRA interface. Something attached to a scene that presents its state when asked, by sending
// rendering operations to the scene, to nodes, or to lists of nodes.
//
// Dispatch: overriding renderNode() is single dispatch on the renderer; a node renderer in the shared NodeRenderers
// table is single dispatch on the node's type (the paper's Node::render: here nodes have no code); one registered with
// the renderer is dispatch on both, and wins. Types are concrete or abstract; the concrete one is taken, then the
// nearest abstract one. A PROTO instance is an X3DPrototypeInstance, whatever its body holds.
// Traversal happens only where a node renderer passes the operation on.
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

/// Names what a renderer is asked to do with a target. The meaning is the renderer's own: it defines constants such as
/// `static constexpr Operation collect{1};`.
enum class Operation : std::uint32_t {};

/// How one renderer, or any, treats nodes of one type.
struct NodeRenderer {
    /// May call Renderer::descend() to have nodes below rendered after it returns.
    std::function<Result<>(Renderer& renderer, const Node& node, Operation operation)> enter;
    /// Called when everything that `enter` descended to is done; optional.
    std::function<void(Renderer& renderer, const Node& node, Operation operation)> leave;
};

/// For a node renderer of one renderer class: `nodeRendererFor<MyRenderer>([](MyRenderer& r, const Node& n, Operation)
/// {...})`. Precondition: it is registered with renderers of that class only.
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
    /// `type`: the name of a concrete or an abstract type. The last one given for a name wins.
    void set(std::string_view type, NodeRenderer renderer);
    /// Null if there is none for the type or what it implements.
    const NodeRenderer* find(const NodeType& type) const;

    /// Groups and the like pass every operation on to what they show (Switch: the choice; LOD: the first level; a PROTO
    /// instance: the first node of its body); all else does nothing.
    static NodeRenderers standard();

  private:
    std::vector<std::pair<std::string, std::shared_ptr<const NodeRenderer>>> entries_;
};

class Renderer : public Subscriber {
  public:
    /// `types`: what nodes do of themselves, whichever the renderer; none: NodeRenderers::standard().
    explicit Renderer(std::shared_ptr<const NodeRenderers> types = nullptr);
    ~Renderer() override;

    /// Listing 1: once, before the first frame. Attaches to the bus when listens(); overriding ones call this one last.
    /// The scene must outlive the attachment.
    virtual Result<> attachToScene(Scene& scene);
    virtual void detachFromScene();
    /// Listing 1: presents the scene's current state; each frame, after Scene::newFrame.
    virtual Result<> renderFrame() = 0;

    /// Sends the operation to every root node, to each of the nodes, or to one. The first error ends it.
    virtual Result<> renderScene(Operation operation);
    virtual Result<> renderNodes(std::span<const NodeId> nodes, Operation operation);
    /// Finds the node renderer; a node without one is left alone.
    virtual Result<> renderNode(NodeId node, Operation operation);

    /// Double dispatch: how this renderer treats this type.
    virtual void registerNodeRenderer(std::string_view type, NodeRenderer renderer);

    /// For node renderers: these next, in this order, before whatever else is waiting. Unlike calling renderNodes()
    /// from within, it is safe for nesting of any depth.
    void descend(std::span<const NodeId> nodes, Operation operation);
    void descend(NodeId node, Operation operation) { descend({&node, 1}, operation); }

    /// Gets the changes of the scene; for renderers that listen.
    Result<> apply(const Scene&, const ChangeSet&) override { return {}; }
    std::string subscriberName() const override { return "renderer"; }

    /// Null while not attached.
    const Scene* scene() const { return scene_; }
    /// False once the bus has detached it after an error.
    virtual bool attached() const { return scene_ && (!listens() || attachment_.attached()); }
    /// Why it follows no longer; empty while it does, and before it was attached.
    virtual std::string failure() const { return attachment_.failure(); }

  protected:
    /// Whether changes are to be reported to apply(); the full-traversal pipeline does without.
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
    std::vector<const NodeRenderer*> byType_;  // found so far, by TypeIndex
    std::vector<bool> known_;
    std::vector<Waiting> waiting_;
    unsigned nested_ = 0;
};

}  // namespace rtsg
