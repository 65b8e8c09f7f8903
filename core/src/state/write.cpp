// Children, destruction, and sealing the edits into a ChangeSet.
#include <algorithm>
#include <array>
#include <tuple>

#include "writing.h"

namespace rtsg {

namespace {

/// Searches backwards, because the nodes added last tend to be removed first; in blocks, which compilers turn into many
/// comparisons at once. Precondition: the node is there.
std::size_t lastPosition(const Array<NodeId>& children, NodeId id) {
    constexpr std::size_t kBlock = 64;
    std::size_t end = children.size();
    const NodeId* ids = children.data();
    for (; end >= kBlock; end -= kBlock) {
        std::uint32_t found = 0;
        for (std::size_t i = end - kBlock; i < end; ++i) found |= ids[i] == id ? 1u : 0u;
        if (found) break;
    }
    while (ids[end - 1] != id) --end;
    return end - 1;
}

}  // namespace

Result<> Scene::State::checkNodes(const Node& node, FieldIndex field, const void* value) const {
    const FieldType type = node.type_->fields[field].type;
    const auto isFine = [&](NodeId id) {
        const Node* const child = find(id);
        return child && (deferCycleCheck || !closesCycle(node, field, *child));
    };
    const auto refuse = [&](NodeId id) {
        const std::string named = "node " + std::to_string(id.value);
        return find(id) ? fail(kCycle, named + " cannot contain itself") : fail(kNoSuchNode, "no " + named);
    };
    if (type == FieldType::SFNode) {
        const NodeId id = *static_cast<const NodeId*>(value);
        if (id && !isFine(id)) return refuse(id);
    } else if (type == FieldType::MFNode) {
        for (const NodeId id : childrenAt(value))
            if (!isFine(id)) return refuse(id);
    }
    return {};
}

Result<> Scene::State::insertChild(Node& parent, FieldIndex field, Node& child, std::size_t index) {
    if (closesCycle(parent, field, child))
        return fail(kCycle, "node " + std::to_string(child.id_.value) + " cannot contain itself");
    auto& children = *reinterpret_cast<Array<NodeId>*>(parent.block() + parent.type_->fields[field].offset);
    index = std::min(index, children.size());
    touched |= aspectBit(Aspect::structure);
    wake(parent);
    if (isNew(parent.id_)) beginWrite(parent, field);
    if (!isDirty(parent, field)) {
        const FieldKey key = keyOf(parent, field);
        const NodeId before = index > 0 ? children[index - 1] : NodeId{};
        const NodeId after = index < children.size() ? children[index] : NodeId{};
        if (!children.empty()) hash.subtract(detail::childTerm(parent.id_, key, before, after));
        hash.add(detail::childTerm(parent.id_, key, before, child.id_));
        hash.add(detail::childTerm(parent.id_, key, child.id_, after));
        Change change;
        change.kind = ChangeKind::insertChild;
        change.node = parent.id_;
        change.field = field;
        change.other = child.id_;
        change.index = static_cast<std::uint32_t>(index);
        change.external = writingExternally;
        if (noting) {
            childOps.push_back(change);
            ++childOpCounts[{parent.id_, field}];
        }
    }
    children.insert(index, child.id_);
    addParent(child, {parent.id_, field});
    wake(child);  // it may be in the scene now, where the bound node is found
    return {};
}

void Scene::State::removeChildAt(Node& parent, FieldIndex field, std::size_t index) {
    auto& children = *reinterpret_cast<Array<NodeId>*>(parent.block() + parent.type_->fields[field].offset);
    const NodeId child = children[index];
    touched |= aspectBit(Aspect::structure);
    wake(parent);
    if (isNew(parent.id_)) beginWrite(parent, field);
    if (!isDirty(parent, field)) {
        const FieldKey key = keyOf(parent, field);
        const NodeId before = index > 0 ? children[index - 1] : NodeId{};
        const NodeId after = index + 1 < children.size() ? children[index + 1] : NodeId{};
        hash.subtract(detail::childTerm(parent.id_, key, before, child));
        hash.subtract(detail::childTerm(parent.id_, key, child, after));
        if (children.size() > 1) hash.add(detail::childTerm(parent.id_, key, before, after));
        Change change;
        change.kind = ChangeKind::removeChild;
        change.node = parent.id_;
        change.field = field;
        change.other = child;
        change.index = static_cast<std::uint32_t>(index);
        change.external = writingExternally;
        if (noting) {
            childOps.push_back(change);
            ++childOpCounts[{parent.id_, field}];
        }
    }
    children.erase(index);
    removeParent(*find(child), {parent.id_, field});
}

void Scene::State::detachEverything(Node& node) {
    // Insertions of a node that nobody outside will ever hear of: its parents' lists are sent whole instead.
    if (isNew(node.id_) && !childOps.empty()) {
        std::vector<ParentRef> lists;
        for (const Change& op : childOps)
            if (op.other == node.id_) lists.push_back({op.node, op.field});
        for (const ParentRef& p : lists) beginWrite(*find(p.node), p.field);
    }
    std::vector<ParentRef> above;
    if (node.parent_.node) above.push_back(node.parent_);
    if (node.links_) node.links_->parents.appendTo(above);
    for (const ParentRef& p : above) {
        Node& parent = *find(p.node);
        const FieldDef& def = parent.type_->fields[p.field];
        if (def.type == FieldType::SFNode) {
            const std::array<NodeId, 4> none{};  // with room for any plain value: compilers see all sizes being copied
            write(parent, p.field, none.data());
        } else {
            removeChildAt(parent, p.field, lastPosition(childrenAt(parent.storage(p.field)), node.id_));
        }
        wake(parent);
        if (def.hidden && def.type == FieldType::MFNode)  // a binding stack: the node that has come to its top must be
                                                          // told
            if (const Array<NodeId>& left = childrenAt(parent.storage(p.field)); !left.empty()) wake(*find(left[0]));
    }
    if (!node.links_) return;
    const Node::Links& l = *node.links_;
    std::vector<Route> routes;
    for (const RouteGroup& group : l.out)
        for (const OutgoingRoute& r : group.targets.items())
            if (r.to.node) routes.push_back({node.id_, group.field, r.to.node, r.to.field, r.to.isConnection});
    for (const IncomingRoute& r : l.in.items())
        if (r.from) routes.push_back({r.from, r.fromField, node.id_, r.toField, r.isConnection});
    for (const Route& route : routes) unlinkRoute(route, true);
}

void Scene::State::releaseChildren(Node& node) {
    for (const FieldIndex i : node.type_->nodeFields()) {
        const FieldDef& def = node.type_->fields[i];
        if (!def.readable()) continue;
        if (def.type == FieldType::SFNode) {
            const NodeId child = *static_cast<const NodeId*>(node.storage(i));
            if (child) removeParent(*find(child), {node.id_, i});
        } else {
            const auto& children = childrenAt(node.storage(i));
            for (const NodeId child : children) removeParent(*find(child), {node.id_, i});
            // The binding stacks of a layer go with it: nodes that were bound there are told, if they still exist
            // (7.2.2).
            if (def.hidden && !children.empty()) wake(*find(children[0]));
        }
    }
}

void Scene::State::destroy(Node& node, bool record) {
    if (scripts) scripts->forget(node.id_);
    for (FieldIndex i = 0; i < node.type_->fields.size(); ++i) {
        if (!node.type_->fields[i].readable()) continue;
        if (WrittenField* entry = entryOf(node, i)) {
            hash.subtract(termBefore(node, *entry));
            entry->node = {};
        } else {
            hash.subtract(termOf(node, i));
        }
    }
    setName(node, {});
    hash.subtract(detail::nodeTerm(node.id_, types[node.typeIndex_.value].nameHash, node.scope_));
    if (!childOpCounts.empty()) {
        std::erase_if(childOps, [&](const Change& c) { return c.node == node.id_; });
        std::erase_if(childOpCounts, [&](const auto& e) { return e.first.first == node.id_; });
    }
    if (record && !isNew(node.id_)) destroyedNodes.push_back({node.id_, writingExternally});
    release(node);
}

bool Scene::State::hasPending() const {
    return written->size() > 0 || nextEntry != pieceBegin || !newTypes.empty() || !newNodes.empty() ||
           !destroyedNodes.empty() || !renamedNodes.empty() || !childOps.empty() || !routeOps.empty() ||
           !events.empty();
}

void Scene::State::appendDefinitions(std::vector<Change>& out, std::span<const DefinedType> defined) const {
    for (const DefinedType& type : defined) {
        Change& change = out.emplace_back();
        change.kind = ChangeKind::defineType;
        change.index = type.index.value;
    }
}

void Scene::State::appendCreations(std::vector<Change>& out) const {
    for (const auto& [id, external] : newNodes) {
        const Node* node = find(id);
        if (!node) continue;
        Change& change = out.emplace_back();
        change.kind = ChangeKind::createNode;
        change.node = id;
        change.external = external;
        change.index = node->typeIndex_.value;
        change.other = node->scope_;
    }
}

void Scene::State::appendOtherEdits(std::vector<Change>& out) {
    out.insert(out.end(), childOps.begin(), childOps.end());
    // If a node was renamed several times, the last entry counts.
    std::ranges::reverse(renamedNodes);
    std::ranges::stable_sort(renamedNodes, {}, &NodeEdit::node);
    renamedNodes.erase(std::ranges::unique(renamedNodes, {}, &NodeEdit::node).begin(), renamedNodes.end());
    for (const auto& [id, external] : renamedNodes) {
        const Node* node = find(id);
        if (!node) continue;
        Change& change = out.emplace_back();
        change.kind = ChangeKind::setName;
        change.node = id;
        change.external = external;
        change.value = node->links_ ? node->links_->name : String();
    }
    // An addition undone within the frame leaves no trace. ChangeKind::event marks the void ones.
    std::map<std::tuple<NodeId, FieldIndex, NodeId, std::uint32_t, bool>, Change*> added;
    for (Change& op : routeOps) {
        const std::tuple key(op.node, op.field, op.other, op.index, bool(op.isConnection));
        if (op.kind == ChangeKind::addRoute) {
            added[key] = &op;
        } else if (const auto found = added.find(key); found != added.end()) {
            found->second->kind = op.kind = ChangeKind::event;
            added.erase(found);
        }
    }
    for (const Change& change : routeOps)
        if (change.kind != ChangeKind::event) out.push_back(change);
    for (const auto& [id, external] : destroyedNodes) {
        Change& change = out.emplace_back();
        change.kind = ChangeKind::destroyNode;
        change.node = id;
        change.external = external;
    }
}

std::shared_ptr<ChangeSet> Scene::State::freshSet() {
    for (auto& pooled : pool)
        if (pooled.use_count() == 1) {
            // Copying the pointer synchronises with the thread that dropped it last; reading its count alone would not.
            std::shared_ptr<ChangeSet> set = pooled;
            // Its changes stay until they are written over, which saves making them anew.
            std::vector<Change> changes;
            changes.swap(set->changes);
            set->clear();
            if (changes.capacity() <= kEntriesKept || changes.size() >= changes.capacity() / 8)
                set->changes.swap(changes);
            return set;
        }
    constexpr std::size_t kPooled = 16;
    auto set = std::make_shared<ChangeSet>();
    if (pool.size() < kPooled) pool.push_back(set);
    return set;
}

/// Takes the authors since the last seal; the last one of a field counts.
std::shared_ptr<const std::vector<Authored>> Scene::State::takeAuthors() {
    std::vector<Authored> all = std::exchange(authors, {});
    const auto keyOf = [](const Authored& one) { return std::pair(one.node.value, one.field); };
    std::ranges::reverse(all);
    std::ranges::stable_sort(all, {}, keyOf);
    all.erase(std::ranges::unique(all, {}, keyOf).begin(), all.end());
    return std::make_shared<const std::vector<Authored>>(std::move(all));
}

std::shared_ptr<const ChangeSet> Scene::State::seal() {
    if (recording && !input) captureInput(false);
    auto set = freshSet();
    set->types.swap(newTypes);
    std::vector<Change> first;
    appendDefinitions(first, set->types);
    appendCreations(first);
    const std::size_t behind = first.size();
    if (behind > 0) set->changes.swap(first);
    appendFieldChanges(*set, behind);
    if (team) team->dismiss();
    appendOtherEdits(set->changes);
    if (recording) input->events = events;
    for (Change& change : events) set->changes.push_back(std::move(change));
    newNodes.clear();
    childOps.clear();
    childOpCounts.clear();
    renamedNodes.clear();
    routeOps.clear();
    destroyedNodes.clear();
    events.clear();
    firstNewId = nextId;

    touchedBefore |= std::exchange(touched, 0u);
    set->from = sequence;
    set->to = ++sequence;
    set->time = now;
    set->hash = hash.value();
    if (recording) set->input = finishInput(false);
    if (!heard.empty()) set->heard = std::make_shared<const std::vector<FieldEvent>>(std::exchange(heard, {}));
    if (!authors.empty()) set->authors = takeAuthors();
    owner.bus_->publish(set);
    return set;
}

}  // namespace rtsg
