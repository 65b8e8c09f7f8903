// Follows a scene, and keeps the part of it that a peer asked for as a scene of its own.
#include "part.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <set>

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
    if (isPartByRegion(wishes_))
        if (auto wish = RegionWish::parse(wishes_.parts.front())) region_ = std::make_unique<Region>(std::move(*wish));
}

std::optional<std::string> MirrorPart::refusalOf(const mirror::Wishes& wishes) {
    for (const std::string& part : wishes.parts) {
        if (!RegionWish::isOne(part)) continue;
        if (wishes.parts.size() > 1) return "a region is no part beside others";
        if (const auto wish = RegionWish::parse(part); !wish) return wish.error().text;
    }
    return std::nullopt;
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
    std::vector<NodeId> result;
    forEachReference(node, field, [&](NodeId id) {
        if (holds(id)) result.push_back(id);
    });
    if (region_ && field == SpatialIndex::listOf(node.type())) std::ranges::sort(result);
    return Array<NodeId>(std::move(result));
}

/// For frames that move no node in or out: copies those changes that concern the part.
void MirrorPart::copyWanted(const Scene& whole, const ChangeSet& set, ChangeSet& out) const {
    for (const Change& c : set.changes) {
        const bool route = c.kind == ChangeKind::addRoute || c.kind == ChangeKind::removeRoute;
        if (c.kind == ChangeKind::defineType ||
            (holds(c.node) && (route ? holds(c.other) : wanted(c.node, c.field, whole))))
            out.changes.push_back(c);
    }
}

void MirrorPart::compare(const Scene& whole, Members now, const ChangeSet* set, ChangeSet& out) {
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
    // A field that refers to nodes may have changed with the members. Other fields have changed only if the set says
    // so, unless all are compared.
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

/// Corrects the lists of groups and all other references.
class MirrorPart::Links {
  public:
    Links(const MirrorPart& part, const Scene& whole, const SpatialIndex& index, const Region::Step& step,
          ChangeSet& out)
        : part_(part), whole_(whole), index_(index), step_(step), out_(out) {}

    /// `set` is the step of the whole scene.
    void run(const ChangeSet& set) {
        for (const NodeId id : step_.left) takeOut(id);
        for (const SpatialIndex::Edge& edge : index_.edges())
            if (edge.now < edge.before && inLists(edge)) remove(edge.group, edge.child, edge.before - edge.now);
        for (const SpatialIndex::Edge& edge : index_.edges())
            if (edge.now > edge.before && inLists(edge)) insert(edge.group, edge.child, edge.now - edge.before);
        for (const NodeId id : step_.entered) putIn(id);
        for (const Change& c : set.changes)
            if ((c.kind == ChangeKind::insertChild || c.kind == ChangeKind::removeChild ||
                 (c.kind == ChangeKind::setField && refers(c.value.type()))) &&
                stays(c.node) && !isList(c.node, c.field))
                others_.emplace(c.node, c.field);
        for (const auto& [node, field] : others_)
            if (part_.wanted(node, field, whole_)) setField(node, field);
    }

  private:
    bool entered(NodeId id) const { return std::ranges::binary_search(step_.entered, id); }
    bool stays(NodeId id) const { return part_.holds(id) && !entered(id); }
    bool isList(NodeId node, FieldIndex field) const { return index_.isListed(node, field); }
    bool inLists(const SpatialIndex::Edge& edge) const {
        return stays(edge.group) && stays(edge.child) && index_.isListed(edge.group, listOf(edge.group));
    }
    FieldIndex listOf(NodeId group) const {
        const Node* node = whole_.find(group);
        return node && !node->type().below.empty() ? node->type().below.front() : kNoField;
    }
    void setField(NodeId node, FieldIndex field) {
        Change& c = out_.changes.emplace_back();
        c.node = node;
        c.field = field;
        c.value = part_.valueOf(whole_.node(node), field);
    }
    std::vector<NodeId>& list(NodeId group) {
        const auto [found, fresh] = lists_.try_emplace(group);
        if (fresh)
            forEachReference(part_.scene_->node(group), listOf(group),
                             [&](NodeId child) { found->second.push_back(child); });
        return found->second;
    }
    void change(ChangeKind kind, NodeId group, NodeId child, std::size_t index) {
        Change& c = out_.changes.emplace_back();
        c.kind = kind;
        c.node = group;
        c.field = listOf(group);
        c.other = child;
        c.index = static_cast<std::uint32_t>(index);
    }
    void remove(NodeId group, NodeId child, std::size_t times) {
        std::vector<NodeId>& children = list(group);
        for (std::size_t i = children.size(); i-- > 0 && times > 0;) {
            if (children[i] != child) continue;
            change(ChangeKind::removeChild, group, child, i);
            children.erase(children.begin() + static_cast<std::ptrdiff_t>(i));
            --times;
        }
    }
    void insert(NodeId group, NodeId child, std::size_t times) {
        std::vector<NodeId>& children = list(group);
        for (; times > 0; --times) {
            const auto position = std::ranges::upper_bound(children, child);
            change(ChangeKind::insertChild, group, child, static_cast<std::size_t>(position - children.begin()));
            children.insert(position, child);
        }
    }
    /// Removes the references to a node that leaves from nodes that stay.
    void takeOut(NodeId id) {
        if (!part_.scene_->find(id)) return;
        for (const ParentRef& parent : part_.scene_->parents(id)) {
            if (!stays(parent.node)) continue;
            if (isList(parent.node, parent.field))
                remove(parent.node, id, std::numeric_limits<std::size_t>::max());
            else
                others_.emplace(parent.node, parent.field);
        }
    }
    /// Adds the references to a node that enters to nodes that stay.
    void putIn(NodeId id) {
        std::vector<NodeId> groups;
        for (const ParentRef& parent : whole_.parents(id)) {
            if (!stays(parent.node)) continue;
            if (isList(parent.node, parent.field))
                groups.push_back(parent.node);
            else
                others_.emplace(parent.node, parent.field);
        }
        std::ranges::sort(groups);
        const auto [last, end] = std::ranges::unique(groups);
        groups.erase(last, end);
        for (const NodeId group : groups) insert(group, id, index_.count(group, id));
    }

    const MirrorPart& part_;
    const Scene& whole_;
    const SpatialIndex& index_;
    const Region::Step& step_;
    ChangeSet& out_;
    std::map<NodeId, std::vector<NodeId>> lists_;  // as they are after the changes so far
    std::set<std::pair<NodeId, FieldIndex>> others_;
};

/// Copies the routes of nodes that enter or leave, and those that the scene's step changed between nodes that stay.
void MirrorPart::copyRoutes(const Scene& whole, const ChangeSet& set, const Region::Step& step, ChangeSet& out) const {
    const auto entered = [&](NodeId id) { return std::ranges::binary_search(step.entered, id); };
    const auto leaves = [&](NodeId id) { return std::ranges::binary_search(step.left, id); };
    for (const NodeId id : step.left) {
        if (!scene_->find(id)) continue;
        for (const Route& r : scene_->routesFrom(id)) out.changes.push_back(routeChange(ChangeKind::removeRoute, r));
        for (const Route& r : scene_->routesTo(id))
            if (!leaves(r.fromNode)) out.changes.push_back(routeChange(ChangeKind::removeRoute, r));
    }
    for (const Change& c : set.changes)
        if ((c.kind == ChangeKind::addRoute || c.kind == ChangeKind::removeRoute) && holds(c.node) && holds(c.other) &&
            !entered(c.node) && !entered(c.other))
            out.changes.push_back(c);
    for (const NodeId id : step.entered) {
        for (const Route& r : whole.routesFrom(id))
            if (holds(r.toNode)) out.changes.push_back(routeChange(ChangeKind::addRoute, r));
        for (const Route& r : whole.routesTo(id))
            if (holds(r.fromNode) && !entered(r.fromNode)) out.changes.push_back(routeChange(ChangeKind::addRoute, r));
    }
}

void MirrorPart::copyRegion(const Scene& whole, const ChangeSet& set, const SpatialIndex& index,
                            const Region::Step& step, ChangeSet& out) const {
    const auto entered = [&](NodeId id) { return std::ranges::binary_search(step.entered, id); };
    for (const Change& c : set.changes)
        if (c.kind == ChangeKind::defineType) out.changes.push_back(c);
    for (const NodeId id : step.entered) {
        const Node& node = whole.node(id);
        Change& c = out.changes.emplace_back();
        c.kind = ChangeKind::createNode;
        c.node = id;
        c.index = node.typeIndex().value;
        c.other = node.scope();
    }
    for (const NodeId id : step.entered) {
        const Node& node = whole.node(id);
        for (FieldIndex f = 0; f < node.type().fields.size(); ++f) {
            const FieldDef& def = node.type().fields[f];
            if (!wanted(def)) continue;
            Value value = valueOf(node, f);
            if (equalStorage(def.type, value.storage(), node.type().defaults() + def.offset)) continue;
            Change& c = out.changes.emplace_back();
            c.node = id;
            c.field = f;
            c.value = std::move(value);
        }
    }
    Links(*this, whole, index, step, out).run(set);
    const auto stays = [&](NodeId id) { return holds(id) && !entered(id); };
    for (const Change& c : set.changes)
        if (c.kind == ChangeKind::setField && !refers(c.value.type()) && stays(c.node) &&
            wanted(c.node, c.field, whole))
            out.changes.push_back(c);
    for (const NodeId id : step.entered) {
        if (whole.name(id).empty()) continue;
        Change& c = out.changes.emplace_back();
        c.kind = ChangeKind::setName;
        c.node = id;
        c.value = String(whole.name(id));
    }
    for (const Change& c : set.changes)
        if (c.kind == ChangeKind::setName && stays(c.node)) out.changes.push_back(c);
    copyRoutes(whole, set, step, out);
    for (const NodeId id : step.left) {
        Change& c = out.changes.emplace_back();
        c.kind = ChangeKind::destroyNode;
        c.node = id;
    }
    for (const Change& c : set.changes)
        if (c.kind == ChangeKind::event && holds(c.node)) out.changes.push_back(c);
}

void MirrorPart::followRegion(const Scene& whole, const ChangeSet* set, const SpatialIndex& index, ChangeSet& out) {
    const Region::Step step = region_->follow(whole, index, set == nullptr);
    if (step.anew) {
        Members now = members_;
        for (const NodeId id : step.entered) now.insert(id.value);
        for (const NodeId id : step.left) now.erase(id.value);
        return compare(whole, std::move(now), nullptr, out);
    }
    for (const NodeId id : step.entered) members_.insert(id.value);
    for (const NodeId id : step.left) members_.erase(id.value);
    if (step.entered.empty() && step.left.empty() && std::ranges::none_of(set->changes, movesNodes))
        copyWanted(whole, *set, out);
    else
        copyRegion(whole, *set, index, step, out);
}

Result<std::shared_ptr<const ChangeSet>> MirrorPart::follow(const Scene& whole, const ChangeSet* set,
                                                            const SpatialIndex* index) {
    auto out = std::make_shared<ChangeSet>();
    out->from = scene_->sequence();
    out->to = whole.sequence();
    out->time = whole.now();
    if (set && set->from != scene_->sequence()) set = nullptr;
    if (region_ && !index) return fail("a region without places");
    if (region_)
        followRegion(whole, set, *index, *out);
    else if (set && std::ranges::none_of(set->changes, movesNodes))
        copyWanted(whole, *set, *out);
    else
        compare(whole, membersOf(whole), set, *out);
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
