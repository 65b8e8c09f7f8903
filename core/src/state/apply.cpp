// State in and out as ChangeSets: snapshot, apply, dump. Nothing that arrives here is trusted.
#include <algorithm>
#include <cstring>

#include <fmt/format.h>

#include <rtsg/core/hash_terms.h>

#include "writing.h"

namespace rtsg {

bool Scene::hasUnsealedEdits() const {
    return state_->hasPending();
}

ChangeSet Scene::snapshot() const {
    ChangeSet set;
    if (state_->hasPending()) state_->owner.seal();
    if (state_->cascading || state_->hasPending()) {
        state_->diagnostics.error({}, "a snapshot was taken where the scene is between two states: refused",
                                  State::kFromWithin);
        return set;
    }
    set.from = 0;
    set.to = state_->sequence;
    set.time = state_->now;
    set.hash = hash();
    if (state_->recording) {
        auto input = std::make_shared<FrameInput>();
        input->complete = false;
        input->runState = std::make_shared<const RunState>(runState());
        set.input = std::move(input);
    }
    for (std::size_t i = 0; i < state_->ownTypes.size(); ++i) {
        const TypeIndex index{static_cast<std::uint16_t>(builtinTypes().size() + i)};
        set.types.push_back({index, state_->ownTypes[i]});
        Change& change = set.changes.emplace_back();
        change.kind = ChangeKind::defineType;
        change.index = index.value;
    }
    set.changes.reserve(set.changes.size() + 2 * state_->nodeTable.size());
    forEachNode([&](const Node& node) {
        if (node.id() == root()) return;
        Change& change = set.changes.emplace_back();
        change.kind = ChangeKind::createNode;
        change.node = node.id();
        change.index = node.typeIndex().value;
        change.other = node.scope();
    });
    forEachNode([&](const Node& node) {
        for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
            if (!node.type().fields[i].readable() || node.isDefault(i)) continue;
            Change& change = set.changes.emplace_back();
            change.node = node.id();
            change.field = i;
            change.value = node.value(i);
        }
    });
    forEachNode([&](const Node& node) {
        if (!node.links_ || node.links_->name.empty()) return;
        Change& change = set.changes.emplace_back();
        change.kind = ChangeKind::setName;
        change.node = node.id();
        change.value = node.links_->name;
    });
    forEachNode([&](const Node& node) {
        if (!node.links_) return;
        for (const RouteGroup& group : node.links_->out)
            for (const OutgoingRoute& route : group.targets.items()) {
                const RouteTarget& t = route.to;
                if (!t.node) continue;
                Change& change = set.changes.emplace_back();
                change.kind = ChangeKind::addRoute;
                change.node = node.id();
                change.field = group.field;
                change.other = t.node;
                change.index = t.field;
                change.isConnection = t.isConnection;
            }
    });
    return set;
}

namespace {

auto noNode(NodeId id) {
    return fail(kNoSuchNode, fmt::format("no node {}", id.value));
}

}  // namespace

namespace {

/// Ids come in order, with gaps at will; no number shall be the last.
constexpr std::uint32_t kMaximumLeap = 1u << 30, kLastId = 0xFFFFFFFF;

}  // namespace

Result<> Scene::State::applyCreation(const Change& c, bool pending) {
    if (!c.node || find(c.node)) return fail(fmt::format("node {} exists already", c.node.value));
    if (c.index >= types.size()) return fail(fmt::format("unknown node type {}", c.index));
    if (c.node.value - std::min(c.node.value, nextId) > kMaximumLeap || c.node.value == kLastId)
        return fail(fmt::format("node id {} is out of sequence", c.node.value));
    // A number that comes again belongs to another node, whose values are the defaults.
    if (c.node.value < nextId) forgetTerms();
    Node& created = allocate(c.node, TypeIndex{static_cast<std::uint16_t>(c.index)}, c.other);
    hash.add(detail::nodeTerm(created.id_, types[c.index].nameHash, c.other));
    if (pending) newNodes.push_back({created.id_, c.external});
    wake(created);
    return {};
}

std::size_t Scene::State::applyCreationRun(std::span<const Change> changes) {
    if (changes.empty() || changes.front().index >= types.size()) return 0;
    const TypeIndex index{static_cast<std::uint16_t>(changes.front().index)};
    const TypeEntry& entry = types[index.value];
    if (entry.isScript || isCounted(index)) return 0;
    const bool wakes = behavioursEnabled && entry.behaviour.onTime;
    const std::uint64_t nameHash = entry.nameHash;
    const auto isThere = [&](FieldIndex field) {
        detail::ArrayHeader* header = nullptr;
        std::memcpy(&header, entry.type->defaults() + entry.type->slot(field).offset, sizeof(header));
        return header != nullptr;
    };
    const bool isShared = std::ranges::any_of(entry.type->sharedFields(), isThere);
    detail::TermSum sum;
    std::size_t i = 0;
    for (; i < changes.size(); ++i) {
        const Change& c = changes[i];
        // From the next number on there is none.
        if (c.kind != ChangeKind::createNode || c.index != index.value || c.node.value < nextId ||
            c.node.value - nextId > kMaximumLeap || c.node.value == kLastId)
            break;
        Node& node = makeNode(c.node, index, *entry.type, c.other);
        if (isShared) retainDefaults(node);
        sum.add(detail::nodeTerm(c.node, nameHash, c.other));
        if (wakes) woken.push_back(c.node);
    }
    hash.add(sum.value());
    return i;
}

Result<> Scene::State::applyField(Node& node, const Change& c, bool pending) {
    const NodeType& type = *node.type_;
    if (c.field >= type.fields.size() || !type.fields[c.field].readable())
        return fail(kNoSuchField, fmt::format("{} has no field {}", type.name, c.field));
    if (!type.fields[c.field].holds(c.value))
        return fail(kWrongType, fmt::format("{}.{}: wrong type", type.name, type.fields[c.field].name));
    if (sf(c.value.type()) == FieldType::SFNode)
        if (auto ok = checkNodes(node, c.field, c.value.storage()); !ok) return ok;
    if (!pending && writing::isPlain(c.value.type())) {
        writeSealedRun({&c, 1});
        return {};
    }
    if (pending)
        write(node, c.field, c.value.storage());
    else
        writeSealed(node, c.field, c.value);
    wake(node);
    return {};
}

Result<> Scene::State::applyChildOp(Node& node, const Change& c) {
    const NodeType& type = *node.type_;
    if (c.field >= type.fields.size() || !type.fields[c.field].readable() ||
        type.fields[c.field].type != FieldType::MFNode)
        return noNode(c.node);
    const auto& children = *static_cast<const Array<NodeId>*>(node.storage(c.field));
    if (c.kind == ChangeKind::insertChild) {
        Node* child = find(c.other);
        if (!child) return noNode(c.other);
        if (c.index > children.size()) return fail("insertion beyond the end");
        return insertChild(node, c.field, *child, c.index);
    }
    if (c.index >= children.size() || children[c.index] != c.other) return fail("no such child to remove");
    removeChildAt(node, c.field, c.index);
    return {};
}

Result<> Scene::State::applyRouteOp(const Node& node, const Change& c, bool pending) {
    const Node* to = find(c.other);
    if (!to) return noNode(c.other);
    if (c.field >= node.type_->fields.size() || c.field2() >= to->type_->fields.size() || c.index > 0xFFFF ||
        !haveOneType(node.type_->fields[c.field], to->type_->fields[c.field2()]))
        return fail(kWrongType, "a route between fields that do not fit");
    const Route route{c.node, c.field, c.other, c.field2(), c.isConnection};
    if (c.kind == ChangeKind::removeRoute) {
        if (!unlinkRoute(route, pending)) return fail("no such route to remove");
        return {};
    }
    const FieldDef &a = node.type_->fields[c.field], &b = to->type_->fields[c.field2()];
    if (c.isConnection) {
        if (auto ok = checkIs(route); !ok) return ok;
    } else if (!a.sends() || !b.writable()) {
        return fail(kWrongAccess, "a route against the access rules");
    }
    linkRoute(route, pending);
    return {};
}

Result<> Scene::State::applyChange(const Change& c, bool pending) {
    if (c.kind == ChangeKind::defineType) return {};  // done from ChangeSet::types before anything else
    if (c.kind == ChangeKind::event) return {};
    if (c.kind == ChangeKind::createNode) return applyCreation(c, pending);
    Node* node = find(c.node);
    if (!node) return noNode(c.node);
    switch (c.kind) {
        case ChangeKind::setField:
            return applyField(*node, c, pending);
        case ChangeKind::insertChild:
        case ChangeKind::removeChild:
            return applyChildOp(*node, c);
        case ChangeKind::setName:
            if (!c.value.holds<String>()) return fail(kWrongType, "a name is a string");
            setName(*node, c.value.as<String>());
            if (pending) renamedNodes.push_back({c.node, c.external});
            return {};
        case ChangeKind::addRoute:
        case ChangeKind::removeRoute:
            return applyRouteOp(*node, c, pending);
        case ChangeKind::destroyNode:
            if (c.node == owner.root()) return noNode(c.node);
            if (node->parent_.node || (node->links_ && node->links_->hasRoutes()))
                return fail(fmt::format("node {} is still in use", c.node.value));
            destroy(*node, pending);
            return {};
        case ChangeKind::defineType:
        case ChangeKind::createNode:
        case ChangeKind::event:
            break;
    }
    return fail("unknown kind of change");
}

Result<> Scene::State::releaseDestroyed(std::span<const Change> changes) {
    bool begun = false;
    std::vector<NodeId> seen;
    for (const Change& change : changes) {
        if (change.kind == ChangeKind::destroyNode) {
            begun = true;
            Node* node = find(change.node);
            if (!node || change.node == owner.root())
                return fail(kNoSuchNode, fmt::format("no node {} to destroy", change.node.value));
            releaseChildren(*node);
            seen.push_back(change.node);
        } else if (begun && change.kind != ChangeKind::event) {
            return fail("a destruction before another change");
        }
    }
    std::ranges::sort(seen);
    if (std::ranges::adjacent_find(seen) != seen.end()) return fail("a node destroyed twice");
    return {};
}

Result<> Scene::reset() {
    if (auto ok = state_->checkOutsideFrame(); !ok) return ok;
    bus_->beforeRestart();
    if (state_->scripts) state_->scripts->forgetAll();
    auto fresh = std::make_unique<State>(*this);
    fresh->allocate(root(), state_->find(root())->typeIndex_, {});
    fresh->firstNewId = fresh->nextId;
    fresh->listener = std::move(state_->listener);
    fresh->queries = state_->queries;
    fresh->navigates = state_->navigates;
    fresh->behavioursEnabled = state_->behavioursEnabled;
    fresh->behavioursByName = std::move(state_->behavioursByName);
    fresh->recording = state_->recording;
    for (const BehaviourUse& use : state_->uses)
        if (use.type.value < builtinTypes().size()) fresh->uses.push_back(use);
    for (const auto& [type, behaviour] : state_->dormant)
        if (type < builtinTypes().size()) fresh->dormant.emplace(type, behaviour);
    fresh->documents = state_->documents;
    fresh->scriptLanguage = state_->scriptLanguage;
    fresh->scriptOptions = state_->scriptOptions;
    fresh->resourcesGiven = state_->resourcesGiven;
    for (std::size_t i = 0; i < builtinTypes().size(); ++i) fresh->types[i].behaviour = state_->types[i].behaviour;
    state_ = std::move(fresh);
    bus_->restart();
    return {};
}

Result<> Scene::apply(std::shared_ptr<const ChangeSet> set) {
    State& s = *state_;
    if (auto ok = s.checkOutsideFrame(); !ok) return ok;
    if (s.hasPending()) return fail("the scene has edits of its own that are not sealed");
    if (set->from != s.sequence)
        return fail(fmt::format("a set from {} does not follow state {}", set->from, s.sequence));
    s.firstNewId = UINT32_MAX;  // nothing here is pending
    s.targets.clear();
    if (auto ok = s.applyChanges(set->changes, set->types, false); !ok) return ok;
    s.firstNewId = s.nextId;
    // A set that leads to the state it starts from repairs faults in it; the running hash may be faulty, too.
    if (set->from == set->to && set->from != 0) {
        Hash128 sum;
        forEachNode([&](const Node& node) { sum = sum + hashOfNode(*this, node); });
        s.hash = detail::StateHash(sum);
        s.forgetTerms();
    }
    s.sequence = set->to;
    s.now = set->time;
    s.started = true;
    if (s.behavioursEnabled && set->input && set->input->runState) {
        if (auto ok = s.adoptUses(set->input->runState->behaviours, true); !ok) return ok;
        s.adoptRunState(*set->input->runState);
    }
    // A set with hash 0 comes from a stream with other node types, whose reader does not know the hash of the state
    // here.
    if (set->hash == Hash128{} && hash() != Hash128{}) {
        auto own = std::make_shared<ChangeSet>(*set);
        own->hash = hash();
        set = std::move(own);
    }
    if (s.recording) {
        s.captureInput(false);
        auto own = std::make_shared<ChangeSet>(*set);
        own->input = s.finishInput(true);
        set = std::move(own);
    }
    bus_->publish(std::move(set));
    return {};
}

namespace {

/// Whether so many plain values come first that a loop of their own pays.
bool isRun(std::span<const Change> changes) {
    constexpr std::size_t kPays = 4;
    return changes.size() >= kPays && std::ranges::all_of(changes.first(kPays), [](const Change& change) {
               return change.kind == ChangeKind::setField && writing::isPlain(change.value.type());
           });
}

}  // namespace

std::size_t Scene::State::bytesToCome(std::span<const Change> changes) const {
    std::size_t bytes = 0;
    for (const Change& change : changes) {
        if (change.kind > ChangeKind::createNode) break;
        if (change.kind == ChangeKind::createNode && change.index < types.size())
            bytes += sizeof(Node) + types[change.index].type->blockSize();
    }
    return bytes;
}

Result<> Scene::State::applyChanges(std::span<const Change> changes, std::span<const DefinedType> defined,
                                    bool pending) {
    for (const DefinedType& type : defined) {
        if (!type.type || type.index.value != types.size()) return fail("a node type out of sequence");
        addTypeEntry(*type.type);
        ownTypes.push_back(type.type);
        if (pending) newTypes.push_back(type);
    }
    memory.expect(bytesToCome(changes));
    bool released = false;
    std::vector<NodeId> changedParents;
    deferCycleCheck = true;
    noting = pending;
    touched = UINT32_MAX;
    for (std::size_t i = 0; i < changes.size(); ++i) {
        if (!pending && changes[i].kind == ChangeKind::createNode) i += applyCreationRun(changes.subspan(i));
        if (!pending && isRun(changes.subspan(i))) i += writeSealedRun(changes.subspan(i));
        if (i == changes.size()) break;
        const Change& change = changes[i];
        // Nodes that are destroyed together may refer to each other: all drop their references before any is destroyed.
        if (change.kind == ChangeKind::destroyNode && !released) {
            released = true;
            if (auto ok = releaseDestroyed(changes); !ok) return ok;
        }
        auto ok = applyChange(change, pending);
        if (!ok) return ok;
        if (change.kind == ChangeKind::insertChild ||
            (change.kind == ChangeKind::setField && sf(change.value.type()) == FieldType::SFNode))
            if (changedParents.empty() || changedParents.back() != change.node) changedParents.push_back(change.node);
    }
    deferCycleCheck = false;
    noting = true;
    if (!pending) keepTerms();
    std::erase_if(changedParents, [&](NodeId id) { return !find(id); });
    return checkAcyclic(changedParents);
}

}  // namespace rtsg
