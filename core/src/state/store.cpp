// Node storage, parents, names and routes: the data of Scene::State, without the running.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "state.h"

namespace rtsg {

Scene::State::State(Scene& scene)
    : owner(scene), diagnostics("scene"), documents(std::make_shared<const DocumentServices>()) {
    for (const auto& type : builtinTypes()) addTypeEntry(*type);
    for (const BuiltinBehaviour& b : builtinBehaviours()) types[b.type.value].behaviour = b.behaviour;
}

Scene::State::~State() {
    nodeTable.forEach([this](Node& node) { destroyHere(node); });
}

void Scene::State::addTypeEntry(const NodeType& type) {
    TypeEntry entry;
    entry.type = &type;
    entry.nameHash = hashOfText(type.name);
    if (types.size() < builtinTypes().size()) {
        entry.keys = detail::builtinFieldKeys(TypeIndex{static_cast<std::uint16_t>(types.size())});
    } else {
        entry.ownKeys = detail::fieldKeys(type);
        entry.keys = entry.ownKeys.data();
    }
    for (const FieldIndex i : type.sharedFields()) entry.keepsLists |= type.fields[i].hidden;
    // The author of a PROTO or a Script defines its interface: a field of this name has the author's meaning.
    const bool fromTable = type.kind == NodeType::Kind::builtin || type.kind == NodeType::Kind::user;
    const auto listOfNodes = [&](std::string_view name, Access access) {
        const FieldIndex found = fromTable ? type.findExact(name) : kNoField;
        if (found == kNoField || type.fields[found].type != FieldType::MFNode) return kNoField;
        return type.fields[found].access == access ? found : kNoField;
    };
    entry.children = listOfNodes("children", Access::inputOutput);
    if (entry.children != kNoField) {
        entry.addChildren = listOfNodes("addChildren", Access::inputOnly);
        entry.removeChildren = listOfNodes("removeChildren", Access::inputOnly);
    }
    for (std::size_t i = 0; fromTable && i < type.fields.size(); ++i) {
        const FieldDef& def = type.fields[i];
        if (def.access != Access::inputOnly || !def.name.starts_with("set_")) continue;
        const FieldIndex stored = type.findExact(std::string_view(def.name).substr(4));
        if (stored != kNoField && type.fields[stored].access == Access::initializeOnly &&
            haveOneType(type.fields[stored], def))
            entry.inputs.emplace_back(static_cast<FieldIndex>(i), stored);
    }
    if (type.kind == NodeType::Kind::builtin && types.size() < builtinTypes().size() &&
        type.isA("X3DInterpolatorNode")) {
        entry.key = type.findExact("key");
        entry.keyValue = type.findExact("keyValue");
        // The output of a GeoPositionInterpolator that has the numbers of its key values.
        entry.interpolated = type.findExact("geovalue_changed");
        if (entry.interpolated == kNoField) entry.interpolated = type.findExact("value_changed");
        entry.begun = type.findExact("_begun");
    }
    entry.takesInputs = !entry.inputs.empty() || entry.addChildren != kNoField || entry.removeChildren != kNoField;
    // A type of the same name that came first stays: built-in types are never shadowed (4.4.4.2).
    entry.isScript = (type.kind == NodeType::Kind::script || type.name == "Script") && type.isA("X3DScriptNode");
    if (entry.isScript) entry.behaviour = ScriptPrograms::behaviour();
    entry.isInstance = type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
    if (type.kind != NodeType::Kind::script) typeByName.emplace(type.name, static_cast<std::uint16_t>(types.size()));
    static_assert(std::is_nothrow_move_constructible_v<TypeEntry>, "or `keys` would point to what is gone");
    types.push_back(std::move(entry));
    if (const auto known = behavioursByName.find(type.name); known != behavioursByName.end()) {
        types.back().behaviour = known->second;
        noteUse(TypeIndex{static_cast<std::uint16_t>(types.size() - 1)}, known->second);
    }
}

bool Scene::State::isCounted(TypeIndex type) {
    return type == x3d::Collision::type || isPickSensor(type);
}

Node& Scene::State::allocate(NodeId id, TypeIndex typeIndex, NodeId scope) {
    if (types[typeIndex.value].isScript) ++scriptNodes;
    if (typeIndex == x3d::Collision::type) ++collisionNodes;
    if (isPickSensor(typeIndex)) pickSensors.insert(std::ranges::upper_bound(pickSensors, id), id);
    Node& node = makeNode(id, typeIndex, *types[typeIndex.value].type, scope);
    retainDefaults(node);
    return node;
}

Node& Scene::State::makeNode(NodeId id, TypeIndex typeIndex, const NodeType& type, NodeId scope) {
    void* bytes = memory.allocate(sizeof(Node) + type.blockSize());
    Node* node = new (bytes) Node;
    node->id_ = id;
    node->scope_ = scope;
    node->typeIndex_ = typeIndex;
    node->type_ = &type;
    std::memcpy(node->block(), type.defaults(), type.blockSize());
    nodeTable.add(id, *node);
    nextId = std::max(nextId, id.value + 1);
    return *node;
}

void Scene::State::retainDefaults(Node& node) {
    for (const FieldIndex i : node.type_->sharedFields()) {
        detail::ArrayHeader* header = nullptr;
        std::memcpy(&header, node.storage(i), sizeof(header));
        detail::retain(header);
    }
}

void Scene::State::destroyHere(Node& node) {
    for (const FieldIndex i : node.type_->sharedFields())
        destroyStorage(node.type_->fields[i].type, node.block() + node.type_->fields[i].offset);
    dropLinks(node);
    node.~Node();
}

void Scene::State::release(Node& node) {
    const NodeId id = node.id_;
    const std::size_t bytes = bytesOf(node);
    worldTransforms.noteMoved(id);
    ++linkEdits;
    if (types[node.typeIndex_.value].isScript) --scriptNodes;
    if (node.typeIndex_ == x3d::Collision::type) --collisionNodes;
    if (isPickSensor(node.typeIndex_)) std::erase(pickSensors, id);
    destroyHere(node);
    memory.deallocate(&node, bytes);
    nodeTable.remove(id, NodeId{nextId});
}

Node::Links& Scene::State::links(Node& node) {
    if (!node.links_) node.links_.reset(new (linkMemory.allocate(sizeof(Node::Links))) Node::Links);
    return *node.links_;
}

RouteGroup& Scene::State::makeGroup(Node& node, FieldIndex field) {
    if (RouteGroup* group = groupOf(node, field)) return *group;
    node.heardOf_ |= Node::Links::heardBit(field);
    return links(node).out.add(field);
}

void Scene::State::eraseGroup(Node& node, RouteGroup* group) {
    RouteGroups& out = node.links_->out;
    out.erase(group);
    node.heardOf_ = 0;
    for (const RouteGroup& left : out) node.heardOf_ |= Node::Links::heardBit(left.field);
}

void Scene::State::dropLinks(Node& node) {
    if (!node.links_) return;
    Node::Links* const links = node.links_.release();
    links->~Links();
    linkMemory.deallocate(links, sizeof(Node::Links));
}

void Scene::State::trimLinks(Node& node) {
    if (node.links_ && node.links_->empty()) dropLinks(node);
}

void Scene::State::addParent(Node& child, ParentRef parent) {
    worldTransforms.noteMoved(child.id_);
    if (!child.parent_.node)
        child.parent_ = parent;
    else
        links(child).parents.add(parent);
}

void Scene::State::removeParent(Node& child, ParentRef parent) {
    worldTransforms.noteMoved(child.id_);
    if (child.parent_ != parent) {
        if (child.links_) child.links_->parents.remove(parent);
    } else if (child.links_ && !child.links_->parents.empty()) {
        child.parent_ = child.links_->parents.takeAny();
    } else {
        child.parent_ = {};
    }
    trimLinks(child);
    if (woken.empty() || woken.back() != owner.root()) wake(*find(owner.root()));  // the bound node may have left
}

bool Scene::State::isHierarchy(const Node& parent, FieldIndex field) const {
    // A Script may refer to what contains it, a PROTO instance's interface to anything; hidden stacks only point.
    const FieldDef& def = parent.type_->fields[field];
    if (parent.type_->kind == NodeType::Kind::script) return false;
    if (parent.type_->kind != NodeType::Kind::builtin && parent.type_->kind != NodeType::Kind::user) return def.hidden;
    return (!def.hidden || def.aspect == Aspect::structure) && !onlyReports(*parent.type_, field);
}

bool Scene::State::closesCycle(const Node& parent, FieldIndex field, const Node& child) const {
    if (deferCycleCheck || !isHierarchy(parent, field)) return false;
    if (parent.id_ == child.id_) return true;
    // Nothing above the parent, or nothing below the child: the usual cases while a scene is built.
    if (!parent.parent_.node) return false;
    bool childHasNodes = false;
    for (const FieldIndex i : child.type_->nodeFields()) {
        if (!child.type_->fields[i].readable()) continue;
        const FieldType type = child.type_->fields[i].type;
        childHasNodes |= type == FieldType::SFNode ? bool(*static_cast<const NodeId*>(child.storage(i)))
                                                   : !static_cast<const Array<NodeId>*>(child.storage(i))->empty();
    }
    if (!childHasNodes) return false;
    std::vector<NodeId> pending{parent.id_};
    std::unordered_map<std::uint32_t, bool> seen;
    std::vector<ParentRef> above;
    while (!pending.empty()) {
        const NodeId id = pending.back();
        pending.pop_back();
        if (id == child.id_) return true;
        if (!seen.emplace(id.value, true).second) continue;
        const Node& node = *find(id);
        above.clear();
        if (node.parent_.node) above.push_back(node.parent_);
        if (node.links_) node.links_->parents.appendTo(above);
        for (const ParentRef& p : above)
            if (isHierarchy(*find(p.node), p.field)) pending.push_back(p.node);
    }
    return false;
}

Result<> Scene::State::checkAcyclic(std::span<const NodeId> starts) const {
    // Upwards, depth first; each ancestor is visited once however many starts share it.
    enum : std::uint8_t { entered = 1, left = 2 };
    std::unordered_map<std::uint32_t, std::uint8_t> colour;
    std::vector<std::pair<NodeId, bool>> pending;  // node, to be left
    std::vector<ParentRef> above;
    for (const NodeId start : starts) {
        pending.emplace_back(start, false);
        while (!pending.empty()) {
            const auto [id, leaving] = pending.back();
            pending.pop_back();
            std::uint8_t& c = colour[id.value];
            if (leaving) {
                c = left;
                continue;
            }
            if (c == left) continue;
            if (c == entered) return fail(kCycle, "node " + std::to_string(id.value) + " would contain itself");
            c = entered;
            pending.emplace_back(id, true);
            const Node& node = *find(id);
            above.clear();
            if (node.parent_.node) above.push_back(node.parent_);
            if (node.links_) node.links_->parents.appendTo(above);
            for (const ParentRef& p : above)
                if (isHierarchy(*find(p.node), p.field)) {
                    const auto seen = colour.find(p.node.value);
                    if (seen != colour.end() && seen->second == entered)
                        return fail(kCycle, "node " + std::to_string(p.node.value) + " would contain itself");
                    if (seen == colour.end() || seen->second != left) pending.emplace_back(p.node, false);
                }
        }
    }
    return {};
}

void Scene::State::setName(Node& node, std::string_view name) {
    const std::string_view old = node.links_ ? node.links_->name.view() : std::string_view();
    if (old == name) return;
    if (!old.empty()) {
        hash.subtract(detail::nameTerm(node.id_, old));
        const auto found = names.find(NameKey{node.scope_.value, node.links_->name});
        if (found != names.end() && found->second == node.id_) names.erase(found);
    }
    links(node).name = String(name);
    if (!name.empty()) {
        hash.add(detail::nameTerm(node.id_, name));
        names[NameKey{node.scope_.value, node.links_->name}] = node.id_;
    }
    trimLinks(node);
}

Hash128 Scene::State::routeTerm(const Route& route) const {
    return detail::routeTerm(route.fromNode, keyOf(*find(route.fromNode), route.fromField), route.toNode,
                             keyOf(*find(route.toNode), route.toField), route.isConnection);
}

void Scene::State::linkRoute(const Route& route, bool record) {
    Node& from = *find(route.fromNode);
    Node& to = *find(route.toNode);
    ++linkEdits;
    makeGroup(from, route.fromField).targets.add({{route.toNode, route.toField, route.isConnection}});
    links(to).in.add({route.fromNode, route.fromField, route.toField, route.isConnection});
    hash.add(routeTerm(route));
    if (!route.isConnection) ++routeCount;
    if (record) recordRoute(ChangeKind::addRoute, route);
}

void Scene::State::recordRoute(ChangeKind kind, const Route& route) {
    routeOps.push_back({.node = route.fromNode,
                        .field = route.fromField,
                        .kind = kind,
                        .external = writingExternally,
                        .isConnection = route.isConnection,
                        .other = route.toNode,
                        .index = route.toField,
                        .value = {}});
}

Result<> Scene::State::checkIs(const Route& route) const {
    const Node &from = *find(route.fromNode), &to = *find(route.toNode);
    const auto isBodyOf = [](const Node& body, const Node& instance) {
        const NodeType::Kind kind = instance.type().kind;
        return (kind == NodeType::Kind::proto || kind == NodeType::Kind::externProto) && body.scope() == instance.id();
    };
    const bool inwards = isBodyOf(to, from);
    if (!inwards && !isBodyOf(from, to))
        return fail(kWrongAccess, "IS connects a PROTO instance with the nodes of its own body only");
    const Node &instance = inwards ? from : to, &body = inwards ? to : from;
    const FieldDef& a = instance.type().fields[inwards ? route.fromField : route.toField];
    const FieldDef& b = body.type().fields[inwards ? route.toField : route.fromField];
    // An instance's field may do no more than the body's field behind it.
    if (a.access != b.access && b.access != Access::inputOutput)
        return fail(kWrongAccess, fmt::format("IS cannot connect {} with {}: their access differs", b.name, a.name));
    if (inwards ? a.access == Access::outputOnly : !a.sends())
        return fail(kWrongAccess, fmt::format("IS cannot pass events of {} this way", a.name));
    // An event is handed on from instance to body to the instances in it: bodies that contain each other have no end.
    constexpr int kDeepest = 1000;
    int depth = 0;
    for (const Node* outer = &instance; outer; outer = find(outer->scope()))
        if (++depth > kDeepest)
            return fail(kCycle, fmt::format("PROTO instances lie in each other more than {} deep", kDeepest));
    return {};
}

bool Scene::State::unlinkRoute(const Route& route, bool record) {
    Node* from = find(route.fromNode);
    Node* to = find(route.toNode);
    if (!from || !to || !from->links_ || !to->links_) return false;
    ++linkEdits;
    RouteGroup* const group = groupOf(*from, route.fromField);
    if (!group || !group->targets.remove({{route.toNode, route.toField, route.isConnection}})) return false;
    if (group->targets.empty() && group->listeners == 0) eraseGroup(*from, group);
    to->links_->in.remove({route.fromNode, route.fromField, route.toField, route.isConnection});
    hash.subtract(routeTerm(route));
    if (!route.isConnection) --routeCount;
    trimLinks(*from);
    if (to != from) trimLinks(*to);
    if (record) recordRoute(ChangeKind::removeRoute, route);
    return true;
}

}  // namespace rtsg
