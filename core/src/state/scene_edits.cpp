// Edits of a scene: nodes, fields, children, names, routes and events.
#include <rtsg/core/scene.h>

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/document_services.h>
#include <rtsg/core/x3d.h>

#include "writing.h"

namespace rtsg {

// ---- editing ---------------------------------------------------------------------------------------------------

Result<TypeIndex> Scene::defineType(std::shared_ptr<const NodeType> type) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return std::unexpected(ok.error());
    if (s.types.size() >= 0xFFFF) return fail("too many node types");
    const TypeIndex index{static_cast<std::uint16_t>(s.types.size())};
    s.addTypeEntry(*type);
    s.ownTypes.push_back(type);
    s.newTypes.push_back({index, std::move(type)});
    return index;
}

NodeId Scene::createNode(TypeIndex type, NodeId scope) {
    State& s = *state_;
    if (s.refuseForeign() || !s.checkEdit() || type.value >= s.types.size() || s.nextId == UINT32_MAX) return {};
    Node& node = s.allocate(NodeId{s.nextId}, type, scope);
    s.hash.add(detail::nodeTerm(node.id_, s.types[type.value].nameHash, scope));
    s.newNodes.push_back({node.id_, s.writingExternally});
    s.wake(node);
    return node.id_;
}

Result<NodeId> Scene::createNode(std::string_view type, NodeId scope) {
    const auto index = findType(type);
    if (!index) return fail(fmt::format("unknown node type {}", type));
    const NodeType::Kind kind = state_->types[index->value].type->kind;
    if (kind == NodeType::Kind::proto || kind == NodeType::Kind::externProto) {
        if (auto ok = state_->checkEdit(); !ok) return std::unexpected(std::move(ok.error()));
        return documents().makePrototypeInstance(*this, *index, scope, state_->scriptOptions.resources.get());
    }
    const NodeId id = createNode(*index, scope);
    if (!id) return fail("no node could be created here");
    return id;
}

Result<> Scene::destroyNode(NodeId id) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* node = s.find(id);
    if (!node || id == root()) return fail(kNoSuchNode, fmt::format("no node {} to destroy", id.value));
    s.detachEverything(*node);
    s.releaseChildren(*node);
    s.destroy(*node, true);
    return {};
}

std::size_t Scene::destroyUnreachable() {
    State& s = *state_;
    if (s.refuseForeign()) return 0;
    std::vector<bool> reached(s.nextId);
    std::vector<NodeId> pending;
    const auto reach = [&](NodeId id) {
        if (!id || reached[id.value]) return;
        reached[id.value] = true;
        pending.push_back(id);
    };
    reach(root());
    forEachNode([&](const Node& node) {
        if (node.links_ && (!node.links_->name.empty() || node.links_->hasRoutes())) reach(node.id_);
    });
    while (!pending.empty()) {
        const Node& node = *s.find(pending.back());
        pending.pop_back();
        reach(node.scope_);
        for (const FieldIndex i : node.type_->nodeFields()) {
            if (!node.type_->fields[i].readable()) continue;
            if (node.type_->fields[i].type == FieldType::SFNode)
                reach(*static_cast<const NodeId*>(node.storage(i)));
            else
                for (const NodeId child : *static_cast<const Array<NodeId>*>(node.storage(i))) reach(child);
        }
    }
    std::vector<NodeId> gone;
    forEachNode([&](const Node& node) {
        if (!reached[node.id_.value]) gone.push_back(node.id_);
    });
    std::size_t count = 0;
    for (const NodeId id : gone) count += destroyNode(id).has_value() ? 1 : 0;
    return count;
}

Result<> Scene::setField(NodeId id, FieldIndex field, Value value) {
    if (setPlain(id, field, value.type(), value.storage())) return {};
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* node = s.find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    if (field >= node->type_->fields.size())
        return fail(kNoSuchField, fmt::format("{} has no field {}", node->type_->name, field));
    const FieldDef& def = node->type_->fields[field];
    if (!def.holds(value))
        return fail(kWrongType,
                    fmt::format("{}.{} is {}, not {}", node->type_->name, def.name, def.typeName(), typeNameOf(value)));
    if (!def.hidden && (def.access == Access::inputOnly || def.access == Access::outputOnly))
        return fail(kWrongAccess, fmt::format("{}.{} cannot be given a value", node->type_->name, def.name));
    if (sf(def.type) == FieldType::SFNode) {
        auto ok = s.checkNodes(*node, field, value.storage());
        if (ok) ok = s.checkAccepted(*node, field, value.storage());
        if (!ok) return ok;
    }
    s.write(*node, field, value.storage());
    if (s.types[node->typeIndex_.value].begun != kNoField) s.showFirst(s, *node, field);
    s.wake(*node);
    return s.passToBody(id, field);
}

Result<> Scene::State::passToBody(NodeId id, FieldIndex field) {
    const Node* node = find(id);
    const NodeType::Kind kind = node->type_->kind;
    if ((kind != NodeType::Kind::proto && kind != NodeType::Kind::externProto) || !node->links_) return {};
    for (const Route& route : owner.routesFrom(id)) {
        // An instance in a body is connected outwards as well.
        if (!route.isConnection || route.fromField != field || find(route.toNode)->scope_ != id) continue;
        const Access access = find(route.toNode)->type_->fields[route.toField].access;
        if (access != Access::initializeOnly && access != Access::inputOutput) continue;
        if (auto ok = owner.setField(route.toNode, route.toField, node->value(field)); !ok) return ok;
    }
    return {};
}

Result<> Scene::insertChild(NodeId parent, FieldIndex field, NodeId child, std::size_t index) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node *p = s.find(parent), *c = s.find(child);
    if (!p || !c) return fail(kNoSuchNode, "insertChild: no such node");
    if (field >= p->type_->fields.size() || p->type_->fields[field].type != FieldType::MFNode ||
        !p->type_->fields[field].readable())
        return fail(kNoSuchField, fmt::format("{} has no such MFNode field", p->type_->name));
    if (auto ok = s.checkAccepted(*p->type_, field, child); !ok) return ok;
    if (auto ok = s.insertChild(*p, field, *c, index); !ok) return ok;
    return s.passToBody(parent, field);
}

Result<> Scene::removeChild(NodeId parent, FieldIndex field, std::size_t index) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* p = s.find(parent);
    if (!p) return fail(kNoSuchNode, "removeChild: no such node");
    if (field >= p->type_->fields.size() || p->type_->fields[field].type != FieldType::MFNode ||
        !p->type_->fields[field].readable())
        return fail(kNoSuchField, fmt::format("{} has no such MFNode field", p->type_->name));
    if (index >= static_cast<const Array<NodeId>*>(p->storage(field))->size())
        return fail(fmt::format("{}.{} has no child {}", p->type_->name, p->type_->fields[field].name, index));
    s.removeChildAt(*p, field, index);
    return s.passToBody(parent, field);
}

Result<std::size_t> Scene::removeFromParents(NodeId id) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return std::unexpected(std::move(ok.error()));
    if (!find(id)) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    std::size_t count = 0;
    for (const ParentRef& p : parents(id)) {
        const Node& parent = node(p.node);
        const FieldDef& def = parent.type().fields[p.field];
        const bool authors = def.access == Access::initializeOnly || def.access == Access::inputOutput;
        if (def.hidden || !authors || parent.type().kind == NodeType::Kind::script) continue;
        Result<> ok;
        if (def.type == FieldType::SFNode) {
            if (parent.get(Field<NodeId>{p.field}) != id) continue;  // a PROTO instance may have refused it
            ok = setField(p.node, p.field, Value(NodeId{}));
        } else {
            const auto& children = parent.get(Field<Array<NodeId>>{p.field});
            std::size_t end = children.size();
            while (end > 0 && children[end - 1] != id) --end;
            if (end == 0) continue;
            ok = removeChild(p.node, p.field, end - 1);
        }
        if (!ok) return std::unexpected(std::move(ok.error()));
        ++count;
    }
    return count;
}

Result<> Scene::setName(NodeId id, std::string_view name) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    Node* node = s.find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    // A name belongs to the node that got it last, as USE sees it.
    if (!name.empty())
        if (const NodeId holder = findName(name, node->scope_); holder && holder != id) {
            s.setName(*s.find(holder), {});
            s.renamedNodes.push_back({holder, s.writingExternally});
        }
    s.setName(*node, name);
    s.renamedNodes.push_back({id, s.writingExternally});
    return {};
}

namespace {

Result<> checkRoute(const Node* from, FieldIndex fromField, const Node* to, FieldIndex toField) {
    if (!from || !to) return fail(kNoSuchNode, "a route needs two nodes");
    if (fromField >= from->type().fields.size() || toField >= to->type().fields.size())
        return fail(kNoSuchField, "a route needs two fields");
    return {};
}

}  // namespace

Result<> Scene::addRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    const Node *from = find(fromNode), *to = find(toNode);
    if (auto ok = checkRoute(from, fromField, to, toField); !ok) return ok;
    const FieldDef &a = from->type().fields[fromField], &b = to->type().fields[toField];
    if (!a.sends()) return fail(kWrongAccess, fmt::format("{}.{} sends no events", from->type().name, a.name));
    if (!b.writable()) return fail(kWrongAccess, fmt::format("{}.{} takes no events", to->type().name, b.name));
    if (!haveOneType(a, b))
        return fail(kWrongType, fmt::format("route from {} {} to {} {}", a.typeName(), a.name, b.typeName(), b.name));
    if (from->links_)
        for (const RouteGroup& group : from->links_->out)
            if (group.field == fromField && group.targets.contains({{toNode, toField, false}})) return {};
    s.linkRoute({fromNode, fromField, toNode, toField, false}, true);
    return {};
}

Result<> Scene::removeRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    if (!s.unlinkRoute({fromNode, fromField, toNode, toField, false}, true)) return fail("no such route");
    return {};
}

Result<> Scene::addIsConnection(NodeId instance, FieldIndex instanceField, NodeId bodyNode, FieldIndex bodyField) {
    State& s = *state_;
    if (auto ok = s.checkEdit(); !ok) return ok;
    const Node *from = find(instance), *to = find(bodyNode);
    if (auto ok = checkRoute(from, instanceField, to, bodyField); !ok) return ok;
    const FieldDef &a = from->type().fields[instanceField], &b = to->type().fields[bodyField];
    if (!haveOneType(a, b))
        return fail(kWrongType, fmt::format("IS between {} {} and {} {}", b.typeName(), b.name, a.typeName(), a.name));
    const Route inwards{instance, instanceField, bodyNode, bodyField, true};
    const Route outwards{bodyNode, bodyField, instance, instanceField, true};
    if (auto ok = s.checkIs(a.access == Access::outputOnly ? outwards : inwards); !ok) return ok;
    if (a.access != Access::outputOnly) s.linkRoute(inwards, true);
    if (a.sends()) s.linkRoute(outwards, true);
    return {};
}

Result<> Scene::sendEvent(NodeId id, FieldIndex field, Value value, std::string_view author) {
    State& s = *state_;
    if (auto ok = s.checkThread(); !ok) return ok;
    const Node* node = find(id);
    if (!node) return fail(kNoSuchNode, fmt::format("no node {}", id.value));
    if (field >= node->type().fields.size())
        return fail(kNoSuchField, fmt::format("{} has no field {}", node->type().name, field));
    const FieldDef& def = node->type().fields[field];
    if (!def.writable()) return fail(kWrongAccess, fmt::format("{}.{} takes no events", node->type().name, def.name));
    if (!def.holds(value))
        return fail(kWrongType,
                    fmt::format("{}.{} is {}, not {}", node->type().name, def.name, def.typeName(), typeNameOf(value)));
    s.inputQueue.push_back({id, field, std::move(value), String(author)});
    return {};
}

void Scene::attribute(std::string_view author, NodeId id, FieldIndex field) {
    if (!state_->refuseForeign()) state_->authors.push_back({id, field, String(author)});
}

}  // namespace rtsg
