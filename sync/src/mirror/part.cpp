// Follows a scene and keeps of it what a peer asked for, as a scene of its own.
#include "part.h"

#include <algorithm>
#include <charconv>

namespace rtsg {

namespace {

bool refers(FieldType type) {
    return sf(type) == FieldType::SFNode;
}

bool movesNodes(const Change& c) {
    switch (c.kind) {
        case ChangeKind::createNode:
        case ChangeKind::destroyNode:
        case ChangeKind::insertChild:
        case ChangeKind::removeChild:
        case ChangeKind::setName:
            return true;
        case ChangeKind::setField:
            return refers(c.value.type());
        default:
            return false;
    }
}

Change routeChange(ChangeKind kind, const Route& r) {
    Change c;
    c.kind = kind;
    c.node = r.fromNode;
    c.field = r.fromField;
    c.other = r.toNode;
    c.index = r.toField;
    c.isConnection = r.isConnection;
    return c;
}

template <class Visit>
void forEachReference(const Node& node, FieldIndex field, Visit visit) {
    if (node.type().fields[field].type == FieldType::SFNode) {
        if (const NodeId id = *static_cast<const NodeId*>(node.storage(field))) visit(id);
    } else {
        for (const NodeId id : *static_cast<const Array<NodeId>*>(node.storage(field)))
            if (id) visit(id);
    }
}

}  // namespace

MirrorPart::MirrorPart(mirror::Wishes wishes) : wishes_(std::move(wishes)), scene_(std::make_unique<Scene>()) {
    scene_->setBehavioursEnabled(false);
    members_.insert(scene_->root().value);
}

bool MirrorPart::wanted(const FieldDef& def) const {
    return def.readable() && (wishes_.aspects == 0 || def.aspect == Aspect::structure ||
                              (wishes_.aspects >> static_cast<unsigned>(def.aspect) & 1) != 0);
}

bool MirrorPart::wanted(NodeId node, FieldIndex field, const Scene& whole) const {
    const Node* n = whole.find(node);
    return n && field < n->type().fields.size() && wanted(n->type().fields[field]);
}

MirrorPart::Members MirrorPart::membersOf(const Scene& whole) const {
    Members result{whole.root().value};
    std::vector<NodeId> below, above;
    if (wishes_.parts.empty()) below.push_back(whole.root());
    for (const std::string& part : wishes_.parts) {
        std::uint32_t number = 0;
        if (part.starts_with('#'))
            std::from_chars(part.data() + 1, part.data() + part.size(), number);
        else
            number = whole.findName(part).value;
        if (whole.find(NodeId{number})) below.push_back(NodeId{number});
    }
    above = below;
    Members seen;
    while (!below.empty()) {
        const NodeId id = below.back();
        below.pop_back();
        const Node* node = whole.find(id);
        if (!node || !seen.insert(id.value).second) continue;
        result.insert(id.value);
        for (const FieldIndex f : node->type().nodeFields())
            if (wanted(node->type().fields[f]))
                forEachReference(*node, f, [&](NodeId child) { below.push_back(child); });
    }
    seen.clear();
    while (!above.empty()) {
        const NodeId id = above.back();
        above.pop_back();
        if (!seen.insert(id.value).second) continue;
        result.insert(id.value);
        for (const ParentRef& parent : whole.parents(id))
            if (wanted(parent.node, parent.field, whole)) above.push_back(parent.node);
    }
    return result;
}

Value MirrorPart::valueOf(const Node& node, FieldIndex field) const {
    const FieldType type = node.type().fields[field].type;
    if (type == FieldType::SFNode) {
        const NodeId id = *static_cast<const NodeId*>(node.storage(field));
        return holds(id) ? id : NodeId{};
    }
    if (type != FieldType::MFNode) return node.value(field);
    Array<NodeId> result;
    forEachReference(node, field, [&](NodeId id) {
        if (holds(id)) result.push_back(id);
    });
    return result;
}

/// Frames that move no node: those of their changes that concern the part.
void MirrorPart::copyWanted(const Scene& whole, const ChangeSet& set, ChangeSet& out) const {
    for (const Change& c : set.changes) {
        const bool route = c.kind == ChangeKind::addRoute || c.kind == ChangeKind::removeRoute;
        if (c.kind == ChangeKind::defineType ||
            (holds(c.node) && (route ? holds(c.other) : wanted(c.node, c.field, whole))))
            out.changes.push_back(c);
    }
}

void MirrorPart::compare(const Scene& whole, const ChangeSet* set, ChangeSet& out) {
    Members now = membersOf(whole);
    std::vector<NodeId> all, created, gone;
    for (const std::uint32_t id : now) all.push_back(NodeId{id});
    for (const std::uint32_t id : members_)
        if (!now.contains(id) || !whole.find(NodeId{id})) gone.push_back(NodeId{id});
    std::ranges::sort(all);
    std::ranges::sort(gone);
    members_ = std::move(now);
    const auto add = [&](ChangeKind kind, NodeId node) -> Change& {
        Change& c = out.changes.emplace_back();
        c.kind = kind;
        c.node = node;
        return c;
    };
    for (std::size_t i = scene_->typeCount(); i < whole.typeCount(); ++i)
        add(ChangeKind::defineType, {}).index = std::uint32_t(i);
    for (const NodeId id : all) {
        if (scene_->find(id)) continue;
        created.push_back(id);
        const Node& node = whole.node(id);
        Change& c = add(ChangeKind::createNode, id);
        c.index = node.typeIndex().value;
        c.other = node.scope();
    }
    // Every field that refers to nodes may have changed with the members; others only if the set says so, unless all
    // are to be compared.
    const auto setField = [&](NodeId id, FieldIndex f) {
        Change& c = add(ChangeKind::setField, id);
        c.field = f;
        c.value = valueOf(whole.node(id), f);
    };
    for (const NodeId id : all) {
        const Node& node = whole.node(id);
        const Node* here = scene_->find(id);
        for (FieldIndex f = 0; f < node.type().fields.size(); ++f) {
            const FieldDef& def = node.type().fields[f];
            if (!wanted(def) || (here && set && !refers(def.type))) continue;
            const Value value = valueOf(node, f);
            if (here ? !(here->value(f) == value)
                     : !equalStorage(def.type, value.storage(), node.type().defaults() + def.offset))
                setField(id, f);
        }
    }
    if (set)
        for (const Change& c : set->changes)
            if (c.kind == ChangeKind::setField && !refers(c.value.type()) && holds(c.node) && scene_->find(c.node) &&
                wanted(c.node, c.field, whole))
                out.changes.push_back(c);
    for (const NodeId id : all)
        if (whole.name(id) != (scene_->find(id) ? scene_->name(id) : std::string_view()))
            add(ChangeKind::setName, id).value = String(whole.name(id));
    for (const NodeId id : all) {
        std::vector<Route> here = scene_->find(id) ? scene_->routesFrom(id) : std::vector<Route>();
        for (const Route& r : whole.routesFrom(id)) {
            if (!holds(r.toNode)) continue;
            const auto found = std::ranges::find(here, r);
            if (found == here.end())
                out.changes.push_back(routeChange(ChangeKind::addRoute, r));
            else
                here.erase(found);
        }
        for (const Route& r : here) out.changes.push_back(routeChange(ChangeKind::removeRoute, r));
    }
    for (const NodeId id : gone)
        for (const Route& r : scene_->routesFrom(id)) out.changes.push_back(routeChange(ChangeKind::removeRoute, r));
    for (const NodeId id : gone) {
        members_.erase(id.value);
        add(ChangeKind::destroyNode, id);
    }
    if (set)
        for (const Change& c : set->changes)
            if (c.kind == ChangeKind::event && holds(c.node)) out.changes.push_back(c);
}

Result<std::shared_ptr<const ChangeSet>> MirrorPart::follow(const Scene& whole, const ChangeSet* set) {
    auto out = std::make_shared<ChangeSet>();
    out->from = scene_->sequence();
    out->to = whole.sequence();
    out->time = whole.now();
    if (set && set->from != scene_->sequence()) set = nullptr;
    if (set && std::ranges::none_of(set->changes, movesNodes))
        copyWanted(whole, *set, *out);
    else
        compare(whole, set, *out);
    std::vector<DefinedType> known;
    for (const Change& c : out->changes) {
        if (c.kind != ChangeKind::defineType) continue;
        if (known.empty()) known = set ? set->types : whole.snapshot().types;
        const auto type = std::ranges::find(known, c.index, [](const DefinedType& d) { return d.index.value; });
        if (type == known.end()) return fail("a node type that nobody defined");
        out->types.push_back(*type);
    }
    if (auto ok = scene_->apply(out); !ok) return std::unexpected(ok.error());
    out->hash = scene_->hash();
    return std::shared_ptr<const ChangeSet>(std::move(out));
}

}  // namespace rtsg
