#include <rtsg/core/change.h>

#include <algorithm>
#include <map>
#include <unordered_map>

namespace rtsg {

void ChangeSet::clear() {
    from = to = 0;
    time = 0;
    hash = {};
    changes.clear();
    types.clear();
    input.reset();
}

/// Keeps changes in one vector with tombstones and the newest position of each key.
struct ChangeComposer::State {
    struct Slot {
        Change change;
        bool live = true;
    };
    struct KeyHash {
        std::size_t operator()(const std::pair<std::uint32_t, std::uint32_t>& k) const {
            return (std::uint64_t{k.first} << 20 ^ k.second) * 0x9E3779B97F4A7C15ull >> 7;
        }
    };
    using Key = std::pair<std::uint32_t, std::uint32_t>;  // node, field (or one of the marks below)
    static constexpr std::uint32_t kName = 0x10000, kCreate = 0x10001, kEvent = 0x20000;
    using RouteKey = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t, bool>;

    bool any = false;
    ChangeSet result;  // header and types
    std::vector<Slot> slots;
    std::unordered_map<Key, std::size_t, KeyHash> newest;                   // setField, setName, createNode, event
    std::unordered_map<Key, std::vector<std::size_t>, KeyHash> childOps;    // not yet under a setField
    std::unordered_map<std::uint32_t, std::vector<std::size_t>> ofNode;     // every slot about a node
    std::unordered_map<std::uint32_t, std::vector<std::size_t>> insertsOf;  // of children created in this set
    std::map<RouteKey, std::size_t> addedRoutes;

    std::size_t append(const Change& change) {
        slots.push_back({change});
        ofNode[change.node.value].push_back(slots.size() - 1);
        return slots.size() - 1;
    }
    bool isCreated(NodeId node) const { return newest.contains({node.value, kCreate}); }

    void setLatest(std::uint32_t mark, const Change& change) {
        const Key key{change.node.value, mark};
        const auto found = newest.find(key);
        if (found != newest.end() && slots[found->second].live)
            slots[found->second].change = change;
        else
            newest[key] = append(change);
    }
    void editChildren(const Change& change) {
        const Key key{change.node.value, change.field};
        auto found = newest.find(key);
        if ((found == newest.end() || !slots[found->second].live) && isCreated(change.node)) {
            Change whole = change;
            whole.kind = ChangeKind::setField;
            whole.other = {};
            whole.index = 0;
            whole.value = Array<NodeId>();
            newest[key] = append(whole);
            found = newest.find(key);
        }
        if (found == newest.end() || !slots[found->second].live) {
            const std::size_t slot = append(change);
            childOps[key].push_back(slot);
            if (change.kind == ChangeKind::insertChild && isCreated(change.other))
                insertsOf[change.other.value].push_back(slot);
            return;
        }
        Change& whole = slots[found->second].change;
        Array<NodeId> children = whole.value.as<Array<NodeId>>();
        whole.value = Value();  // leaves `children` the sole owner, so that it is edited in place
        if (change.kind == ChangeKind::insertChild)
            children.insert(std::min<std::size_t>(change.index, children.size()), change.other);
        else if (change.index < children.size())
            children.erase(change.index);
        whole.value = std::move(children);
        whole.external = change.external;
    }
    void add(const Change& change) {
        switch (change.kind) {
            case ChangeKind::defineType:
                append(change);
                break;
            case ChangeKind::createNode:
                newest[{change.node.value, kCreate}] = append(change);
                break;
            case ChangeKind::setField: {
                const auto ops = childOps.find({change.node.value, change.field});
                if (ops != childOps.end()) {
                    for (const std::size_t i : ops->second) slots[i].live = false;
                    childOps.erase(ops);
                }
                setLatest(change.field, change);
                break;
            }
            case ChangeKind::insertChild:
            case ChangeKind::removeChild:
                editChildren(change);
                break;
            case ChangeKind::setName:
                setLatest(kName, change);
                break;
            case ChangeKind::addRoute:
                addedRoutes[routeKey(change)] = append(change);
                break;
            case ChangeKind::removeRoute: {
                const auto found = addedRoutes.find(routeKey(change));
                if (found != addedRoutes.end()) {
                    slots[found->second].live = false;
                    addedRoutes.erase(found);
                } else {
                    append(change);
                }
                break;
            }
            case ChangeKind::destroyNode:
                destroy(change);
                break;
            case ChangeKind::event:
                setLatest(kEvent | change.field, change);
                break;
        }
    }
    static RouteKey routeKey(const Change& c) {
        return {c.node.value, c.field, c.other.value, c.index, bool(c.isConnection)};
    }
    /// Takes an insertion and the removal that follows it out of a list of edits, as if neither had been.
    void cancelInsertion(std::size_t slot) {
        const auto ops = childOps.find({slots[slot].change.node.value, slots[slot].change.field});
        if (ops == childOps.end() || !slots[slot].live) return;
        std::uint32_t position = slots[slot].change.index;
        auto op = std::ranges::find(ops->second, slot);
        slots[slot].live = false;
        for (++op; op != ops->second.end(); ++op) {
            if (!slots[*op].live) continue;
            Change& later = slots[*op].change;
            if (later.kind == ChangeKind::insertChild) {
                if (later.index <= position)
                    ++position;
                else
                    --later.index;
            } else if (later.index == position) {
                slots[*op].live = false;
                return;
            } else if (later.index < position) {
                --position;
            } else {
                --later.index;
            }
        }
    }
    void destroy(const Change& change) {
        const bool created = isCreated(change.node);
        if (const auto inserts = insertsOf.find(change.node.value); inserts != insertsOf.end()) {
            for (const std::size_t slot : inserts->second) cancelInsertion(slot);
            insertsOf.erase(inserts);
        }
        for (const std::size_t i : ofNode[change.node.value]) {
            const ChangeKind kind = slots[i].change.kind;
            // Its removed routes must still be removed where they are known.
            if (kind != ChangeKind::removeRoute || created) slots[i].live = false;
        }
        ofNode.erase(change.node.value);
        newest.erase({change.node.value, kCreate});
        if (!created) append(change);
    }
};

ChangeComposer::ChangeComposer() : state_(std::make_unique<State>()) {}
ChangeComposer::~ChangeComposer() = default;

bool ChangeComposer::empty() const {
    return !state_->any;
}

void ChangeComposer::add(const ChangeSet& set) {
    State& s = *state_;
    if (!s.any) s.result.from = set.from;
    s.any = true;
    s.result.to = set.to;
    s.result.time = set.time;
    s.result.hash = set.hash;
    s.result.types.insert(s.result.types.end(), set.types.begin(), set.types.end());
    for (const Change& change : set.changes) s.add(change);
}

ChangeSet ChangeComposer::take() {
    State& s = *state_;
    ChangeSet result = std::move(s.result);
    static constexpr int kPhases = 7;
    const auto phase = [](ChangeKind kind) {
        switch (kind) {
            case ChangeKind::defineType:
                return 0;
            case ChangeKind::createNode:
                return 1;
            case ChangeKind::setField:
            case ChangeKind::insertChild:
            case ChangeKind::removeChild:
                return 2;
            case ChangeKind::setName:
                return 3;
            case ChangeKind::addRoute:
            case ChangeKind::removeRoute:
                return 4;
            case ChangeKind::destroyNode:
                return 5;
            case ChangeKind::event:
                return 6;
        }
        return 6;
    };
    for (int p = 0; p < kPhases; ++p)
        for (State::Slot& slot : s.slots)
            if (slot.live && phase(slot.change.kind) == p) result.changes.push_back(std::move(slot.change));
    *state_ = State();
    return result;
}

ChangeSet compose(std::span<const std::shared_ptr<const ChangeSet>> sets) {
    ChangeComposer composer;
    for (const auto& set : sets) composer.add(*set);
    return composer.take();
}

}  // namespace rtsg
