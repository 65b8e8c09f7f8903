// Finds nodes that scripts have made and dropped again, and destroys them between frames.
//
// Only nodes that scripts have made are ever looked at, so the cost follows their number and not the scene's. A node is
// kept if something else refers to it: a field of a node that is kept, a route to or from one, a name outside of the
// bodies of dropped instances, a variable of a script that is kept, or the application (Scene::hold). The engine finds
// the nodes that scripts' variables refer to in a full collection of its garbage, which follows from the program's run
// alone. So the same nodes are destroyed in every run. This happens as edits before the frame, which replicas and logs
// get like any others. The next search waits until as many nodes are new as there were after the last one, and at least
// a thousand, so that it costs a bounded share for each node that is made.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/resource.h>

#include "state/state.h"

namespace rtsg {

namespace {

constexpr std::size_t kFewest = 1000;
/// A node's shortest text: `Q{}`, of a PROTO.
constexpr std::size_t kShortestText = 3;

}  // namespace

Result<> Scene::State::mayScriptsMake(std::size_t textBytes) {
    const std::uint64_t maximum =
        (scriptOptions.resources ? scriptOptions.resources->policy() : ResourcePolicy{}).maximumNodes;
    const std::size_t more = 1 + textBytes / kShortestText;
    if (scriptCreated.size() + more > maximum) std::erase_if(scriptCreated, [&](NodeId id) { return !find(id); });
    if (scriptCreated.size() + more <= maximum) return {};
    return fail(fmt::format("scripts may make {} nodes that are there at a time: {} are, and this may be {} more",
                            maximum, scriptCreated.size(), more));
}

Result<NodeId> ScriptPrograms::createNode(Scene& scene, std::string_view type, NodeId scope) {
    if (auto may = scene.state_->mayScriptsMake(); !may) return std::unexpected(may.error());
    // An instance of a PROTO is made with its body.
    return scene.state_->createdByScript([&] { return scene.createNode(type, scope); });
}

Result<DocumentServices::Piece> ScriptPrograms::createPiece(Scene& scene, std::string_view text, NodeId script) {
    if (auto may = scene.state_->mayScriptsMake(text.size()); !may) return std::unexpected(may.error());
    const Node* node = scene.find(script);
    return scene.state_->createdByScript([&] {
        return scene.documents().makePiece(scene, text, node ? node->scope() : NodeId{},
                                           scene.state_->scriptOptions.resources.get());
    });
}

Result<DocumentServices::Piece> ScriptPrograms::createPieceOfUrls(Scene& scene, const std::vector<std::string>& urls,
                                                                  NodeId script) {
    if (auto may = scene.state_->mayScriptsMake(); !may) return std::unexpected(may.error());
    return scene.state_->createdByScript([&] {
        return scene.documents().makePieceOfUrls(scene, script, urls, scene.state_->scriptOptions.resources.get());
    });
}

void Scene::hold(NodeId id) {
    if (!state_->refuseForeign() && state_->find(id)) ++state_->held[id.value];
}

void Scene::letGo(NodeId id) {
    if (state_->refuseForeign()) return;
    const auto found = state_->held.find(id.value);
    if (found != state_->held.end() && --found->second == 0) state_->held.erase(found);
}

bool Scene::isHeld(NodeId id) const {
    return state_->held.contains(id.value);
}

std::vector<bool> Scene::State::findReferred(const std::vector<NodeId>& candidates) {
    std::vector<bool> reached(candidates.size());
    std::vector<NodeId> pending;
    const auto indexOf = [&](NodeId id) -> std::ptrdiff_t {
        const auto found = std::ranges::lower_bound(candidates, id);
        return found != candidates.end() && *found == id ? found - candidates.begin() : -1;
    };
    const auto reach = [&](NodeId id) {
        const std::ptrdiff_t i = indexOf(id);
        if (i < 0 || reached[static_cast<std::size_t>(i)]) return;
        reached[static_cast<std::size_t>(i)] = true;
        pending.push_back(id);
    };
    // By script: what its variables hold.
    std::map<NodeId, std::vector<NodeId>> variables;
    scripts->findHeld(candidates, [&](NodeId script, NodeId node) { variables[script].push_back(node); });
    for (const auto& [script, nodes] : variables)
        if (indexOf(script) < 0)
            for (const NodeId id : nodes) reach(id);
    for (const NodeId id : candidates) {
        const Node& node = *find(id);
        const Node::Links* links = node.links_.get();
        bool referred = held.contains(id.value) || (links && !links->name.empty() && indexOf(node.scope_) < 0);
        std::vector<ParentRef> above;
        if (node.parent_.node) above.push_back(node.parent_);
        if (links) links->parents.appendTo(above);
        for (const ParentRef& p : above) {
            // The root's stacks only point.
            const FieldDef& def = find(p.node)->type_->fields[p.field];
            referred = referred || (indexOf(p.node) < 0 && !(def.hidden && def.aspect != Aspect::structure));
        }
        if (links) {
            for (const RouteGroup& group : links->out)
                for (const OutgoingRoute& r : group.targets.items())
                    referred = referred || (r.to.node && indexOf(r.to.node) < 0);
            for (const IncomingRoute& r : links->in.items()) referred = referred || (r.from && indexOf(r.from) < 0);
        }
        if (referred) reach(id);
    }
    while (!pending.empty()) {
        const Node& node = *find(pending.back());
        pending.pop_back();
        reach(node.scope_);
        for (const FieldIndex i : node.type_->nodeFields()) {
            if (!node.type_->fields[i].readable()) continue;
            if (node.type_->fields[i].type == FieldType::SFNode)
                reach(*static_cast<const NodeId*>(node.storage(i)));
            else
                for (const NodeId child : *static_cast<const Array<NodeId>*>(node.storage(i))) reach(child);
        }
        if (node.links_) {
            for (const RouteGroup& group : node.links_->out)
                for (const OutgoingRoute& r : group.targets.items()) reach(r.to.node);
            for (const IncomingRoute& r : node.links_->in.items()) reach(r.from);
        }
        if (const auto own = variables.find(node.id_); own != variables.end())
            for (const NodeId id : own->second) reach(id);
    }
    return reached;
}

void Scene::State::destroyDropped() {
    if (!scripts || scriptCreated.size() < scriptCreatedBefore + std::max(kFewest, scriptCreatedBefore)) return;
    std::erase_if(scriptCreated, [&](NodeId id) { return !find(id); });
    const std::vector<bool> referred = findReferred(scriptCreated);
    std::vector<NodeId> kept;
    for (std::size_t i = 0; i < scriptCreated.size(); ++i)
        if (referred[i])
            kept.push_back(scriptCreated[i]);
        else
            (void)owner.destroyNode(scriptCreated[i]);  // one may have gone by another's shutdown()
    scriptCreated.swap(kept);
    scriptCreatedBefore = scriptCreated.size();
}

}  // namespace rtsg
