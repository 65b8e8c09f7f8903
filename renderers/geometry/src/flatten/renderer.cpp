// Dispatch of rendering operations over nodes, by type and by abstract type.
#include <rtsg/renderers/renderer.h>

#include <algorithm>

#include <rtsg/core/x3d.h>

#include "flattener_roles.h"

namespace rtsg {

namespace {

/// Calls of renderNode() from within node renderers, each on top of the other; descend() has no such limit.
constexpr unsigned kMaxNested = 500;

}  // namespace

// ---- NodeRenderers ------------------------------------------------------------------------------------------------

void NodeRenderers::set(std::string_view type, NodeRenderer renderer) {
    auto shared = std::make_shared<const NodeRenderer>(std::move(renderer));
    for (auto& [name, entry] : entries_)
        if (name == type) {
            entry = std::move(shared);
            return;
        }
    entries_.emplace_back(type, std::move(shared));
}

const NodeRenderer* NodeRenderers::find(const NodeType& type) const {
    const auto named = [&](std::string_view wanted) -> const NodeRenderer* {
        for (const auto& [name, entry] : entries_)
            if (name == wanted) return entry.get();
        return nullptr;
    };
    if (const NodeRenderer* exact = named(type.name)) return exact;
    // A PROTO instance counts as what its body starts with, but it is not laid out as that.
    if (type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto)
        return named("X3DPrototypeInstance");
    // Nearest first: a base stands before its own bases.
    for (const std::string& abstract : type.implements)
        if (const NodeRenderer* found = named(abstract)) return found;
    return nullptr;
}

NodeRenderers NodeRenderers::standard() {
    NodeRenderers table;
    // One table of roles for all: it depends on the types only, and those of one scene are never changed.
    const auto roles = std::make_shared<flatten::RoleTable>();
    const NodeRenderer passOn{[roles](Renderer& renderer, const Node& node, Operation operation) -> Result<> {
                                  std::vector<NodeId> below;
                                  flatten::desiredChildren(node, roles->of(node), 0, below);
                                  renderer.descend(below, operation);
                                  return {};
                              },
                              {}};
    flatten::forEachGroupType([&](std::string_view type) { table.set(type, passOn); });
    return table;
}

// ---- Renderer -----------------------------------------------------------------------------------------------------

Renderer::Renderer(std::shared_ptr<const NodeRenderers> types)
    : types_(types ? std::move(types) : std::make_shared<const NodeRenderers>(NodeRenderers::standard())) {}

Renderer::~Renderer() = default;

Result<> Renderer::attachToScene(Scene& scene) {
    if (scene_) return fail("the renderer is attached to a scene already");
    scene_ = &scene;
    byType_.clear();
    known_.clear();
    if (!listens()) return {};
    attachment_ = scene.bus().attach(*this);
    if (attachment_.attached()) return {};
    scene_ = nullptr;
    return fail("the renderer could not take over the scene: " + attachment_.failure());
}

void Renderer::detachFromScene() {
    attachment_.detach();
    scene_ = nullptr;
}

void Renderer::registerNodeRenderer(std::string_view type, NodeRenderer renderer) {
    own_.set(type, std::move(renderer));
    byType_.clear();
    known_.clear();
}

const NodeRenderer* Renderer::find(const Node& node) {
    const std::size_t index = node.typeIndex().value;
    if (index >= known_.size()) {
        known_.resize(index + 1);
        byType_.resize(index + 1);
    }
    if (!known_[index]) {
        known_[index] = true;
        byType_[index] = own_.find(node.type());
        if (!byType_[index]) byType_[index] = types_->find(node.type());
    }
    return byType_[index];
}

Result<> Renderer::renderScene(Operation operation) {
    if (!scene_) return fail("the renderer is not attached to a scene");
    const Array<NodeId> roots = scene_->node(scene_->root()).get(x3d::RtsgScene::children);
    return renderNodes(roots.span(), operation);
}

Result<> Renderer::renderNodes(std::span<const NodeId> nodes, Operation operation) {
    for (const NodeId node : nodes)
        if (Result<> result = renderNode(node, operation); !result) return result;
    return {};
}

Result<> Renderer::renderNode(NodeId node, Operation operation) {
    if (!scene_) return fail("the renderer is not attached to a scene");
    if (nested_ >= kMaxNested)
        return fail("node renderers call renderNode() more than " + std::to_string(kMaxNested) +
                    " deep; descend() has no limit");
    ++nested_;
    const std::size_t until = waiting_.size();
    waiting_.push_back({node, operation, false});
    Result<> result;
    try {
        result = run(until);
    } catch (const std::exception& e) {
        result = fail(std::string("a node renderer threw: ") + e.what());
    } catch (...) {
        result = fail("a node renderer threw");
    }
    waiting_.resize(until);  // the remains of an error
    --nested_;
    return result;
}

void Renderer::descend(std::span<const NodeId> nodes, Operation operation) {
    for (std::size_t i = nodes.size(); i > 0; --i)
        if (nodes[i - 1]) waiting_.push_back({nodes[i - 1], operation, false});
}

Result<> Renderer::enter(NodeId id, Operation operation) {
    const Node* node = scene_->find(id);
    const NodeRenderer* renderer = node ? find(*node) : nullptr;
    if (!renderer) return {};
    if (renderer->leave) waiting_.push_back({id, operation, true});
    return renderer->enter ? renderer->enter(*this, *node, operation) : Result<>{};
}

Result<> Renderer::run(std::size_t until) {
    while (waiting_.size() > until) {
        const Waiting next = waiting_.back();
        waiting_.pop_back();
        if (!next.isLeave) {
            if (Result<> result = enter(next.node, next.operation); !result) return result;
        } else if (const Node* node = scene_->find(next.node)) {
            if (const NodeRenderer* renderer = find(*node); renderer && renderer->leave)
                renderer->leave(*this, *node, next.operation);
        }
    }
    return {};
}

}  // namespace rtsg
