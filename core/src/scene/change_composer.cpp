// Merging consecutive sets into one with the same effect: the newest value of each field, edits of lists in order.
#include <rtsg/core/change_composer.h>

#include <algorithm>
#include <map>
#include <unordered_map>

#include <rtsg/core/scene.h>

namespace rtsg {

namespace {

/// Open addressing, linear probing, nothing is ever taken out: the table of a merge, which lives for a frame.
class SlotIndex {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    /// kNone when new.
    std::uint32_t& at(std::uint32_t node, std::uint32_t mark) {
        if (2 * (used_ + 1) > entries_.size()) grow();
        const std::uint64_t key = keyOf(node, mark);
        Entry& entry = *findEntry(key);
        if (entry.key == 0) {
            entry = {key, kNone};
            ++used_;
        }
        return entry.value;
    }
    std::uint32_t find(std::uint32_t node, std::uint32_t mark) const {
        if (entries_.empty()) return kNone;
        return const_cast<SlotIndex*>(this)->findEntry(keyOf(node, mark))->value;
    }
    void clear() {
        if (used_ == 0) return;
        if (entries_.size() > 64 * (used_ + 16))
            std::vector<Entry>().swap(entries_);  // one large merge must not make all later ones sweep its table
        else
            std::ranges::fill(entries_, Entry{});
        used_ = 0;
    }

  private:
    struct Entry {
        std::uint64_t key = 0;
        std::uint32_t value = kNone;
    };
    static std::uint64_t keyOf(std::uint32_t node, std::uint32_t mark) {
        return (std::uint64_t{node} << 20 | mark) + 1;
    }
    Entry* findEntry(std::uint64_t key) {
        const std::size_t mask = entries_.size() - 1;
        std::size_t i = (key * 0x9E3779B97F4A7C15ull >> 20) & mask;
        while (entries_[i].key != 0 && entries_[i].key != key) i = (i + 1) & mask;
        return &entries_[i];
    }
    void grow() {
        std::vector<Entry> before(std::max<std::size_t>(64, 2 * entries_.size()));
        before.swap(entries_);
        for (const Entry& entry : before)
            if (entry.key != 0) *findEntry(entry.key) = entry;
    }
    std::vector<Entry> entries_;  // a power of two
    std::size_t used_ = 0;
};

}  // namespace

/// Keeps changes in one vector with tombstones and the newest position of each key.
struct ChangeComposer::State {
    static constexpr std::uint32_t kNone = SlotIndex::kNone;
    struct Slot {
        Change change;
        bool live = true;
        std::uint32_t ofNode = kNone;  // the slot before that is about the same node
    };
    struct KeyHash {
        std::size_t operator()(const std::pair<std::uint32_t, std::uint32_t>& k) const {
            return (std::uint64_t{k.first} << 20 ^ k.second) * 0x9E3779B97F4A7C15ull >> 7;
        }
    };
    using Key = std::pair<std::uint32_t, std::uint32_t>;  // node, field
    // Beside fields: an event is kEvent plus its field.
    static constexpr std::uint32_t kName = 0x10000, kCreate = 0x10001, kNode = 0x10002, kEvent = 0x20000;
    using RouteKey = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t, bool>;

    bool any = false;
    ChangeSet result;  // header and types
    std::vector<Slot> slots;
    SlotIndex newest;           // of setField, setName, createNode, event; under kNode the last slot about a node
    std::size_t dead = 0;       // slots that are no longer live
    std::size_t following = 0;  // the slot after the last one met: frames tend to repeat the order of the last one
    std::unordered_map<Key, std::vector<std::size_t>, KeyHash> childOps;    // not yet under a setField
    std::unordered_map<std::uint32_t, std::vector<std::size_t>> insertsOf;  // of children created in this set
    std::map<RouteKey, std::size_t> addedRoutes;
    // In parts of scenes nodes go and come back. The former state of such a node is not known here: the node stays, and
    // all of its fields are set.
    std::map<std::uint32_t, std::size_t> destroyed;  // of nodes from before this set: the slot
    std::map<std::uint32_t, TypeIndex> reborn;
    std::map<Key, String> authors;  // the last one of each field

    std::uint32_t append(const Change& change) {
        const auto slot = static_cast<std::uint32_t>(slots.size());
        std::uint32_t& last = newest.at(change.node.value, kNode);
        slots.push_back({change, true, last});
        last = slot;
        return slot;
    }
    void kill(Slot& slot) {
        dead += slot.live ? 1 : 0;
        slot.live = false;
    }
    bool isCreated(NodeId node) const { return newest.find(node.value, kCreate) != kNone; }
    /// All that its lists hold is in this set.
    bool beginsHere(NodeId node) const { return isCreated(node) || reborn.contains(node.value); }

    /// The live slot of a key; null if there is none.
    Slot* latest(NodeId node, std::uint32_t mark) {
        const std::uint32_t slot = newest.find(node.value, mark);
        return slot != kNone && slots[slot].live ? &slots[slot] : nullptr;
    }
    void setLatest(std::uint32_t mark, const Change& change) {
        if (following < slots.size()) {
            Slot& slot = slots[following];
            if (slot.live && slot.change.kind == change.kind && slot.change.node == change.node &&
                slot.change.field == change.field) {
                slot.change = change;
                ++following;
                return;
            }
        }
        const std::uint32_t known = newest.find(change.node.value, mark);
        if (known != kNone && slots[known].live) {
            slots[known].change = change;
            following = known + std::size_t{1};
        } else {
            const std::uint32_t slot = append(change);
            newest.at(change.node.value, mark) = slot;
        }
    }
    void editChildren(const Change& change) {
        Slot* whole = latest(change.node, change.field);
        if (!whole && beginsHere(change.node)) {
            Change list = change;
            list.kind = ChangeKind::setField;
            list.other = {};
            list.index = 0;
            list.value = Array<NodeId>();
            const std::uint32_t slot = append(list);
            newest.at(change.node.value, change.field) = slot;
            whole = &slots[slot];
        }
        if (!whole) {
            const std::size_t slot = append(change);
            childOps[{change.node.value, change.field}].push_back(slot);
            if (change.kind == ChangeKind::insertChild && isCreated(change.other))
                insertsOf[change.other.value].push_back(slot);
            return;
        }
        Array<NodeId> children = whole->change.value.as<Array<NodeId>>();
        whole->change.value = Value();  // leaves `children` the sole owner, so that it is edited in place
        if (change.kind == ChangeKind::insertChild)
            children.insert(std::min<std::size_t>(change.index, children.size()), change.other);
        else if (change.index < children.size())
            children.erase(change.index);
        whole->change.value = std::move(children);
        whole->change.external = change.external;
    }
    void add(const Change& change) {
        switch (change.kind) {
            case ChangeKind::defineType:
                append(change);
                break;
            case ChangeKind::createNode: {
                if (const auto gone = destroyed.find(change.node.value); gone != destroyed.end()) {
                    kill(slots[gone->second]);
                    destroyed.erase(gone);
                    reborn.insert_or_assign(change.node.value, TypeIndex{static_cast<std::uint16_t>(change.index)});
                    break;
                }
                const std::uint32_t slot = append(change);
                newest.at(change.node.value, kCreate) = slot;
                break;
            }
            case ChangeKind::setField: {
                if (!childOps.empty()) {
                    const auto ops = childOps.find({change.node.value, change.field});
                    if (ops != childOps.end()) {
                        for (const std::size_t i : ops->second) kill(slots[i]);
                        childOps.erase(ops);
                    }
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
                    kill(slots[found->second]);
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
        kill(slots[slot]);
        for (++op; op != ops->second.end(); ++op) {
            if (!slots[*op].live) continue;
            Change& later = slots[*op].change;
            if (later.kind == ChangeKind::insertChild) {
                if (later.index <= position)
                    ++position;
                else
                    --later.index;
            } else if (later.index == position) {
                kill(slots[*op]);
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
        std::uint32_t& last = newest.at(change.node.value, kNode);
        for (std::uint32_t i = last; i != kNone; i = slots[i].ofNode) {
            const ChangeKind kind = slots[i].change.kind;
            // Its removed routes must still be removed where they are known.
            if (kind != ChangeKind::removeRoute || created) kill(slots[i]);
        }
        last = kNone;
        if (created) newest.at(change.node.value, kCreate) = kNone;
        reborn.erase(change.node.value);
        if (!created) destroyed.insert_or_assign(change.node.value, append(change));
    }
    const NodeType* typeOf(TypeIndex index, const Scene* scene) const {
        for (const DefinedType& defined : result.types)
            if (defined.index == index) return defined.type.get();
        if (scene) return index.value < scene->typeCount() ? &scene->type(index) : nullptr;
        return index.value < builtinTypes().size() ? builtinTypes()[index.value].get() : nullptr;
    }
    /// The fields of nodes that went and came again which nobody has set since, and their names.
    void resetReborn(const Scene* scene) {
        for (const auto& [id, index] : reborn) {
            Change change;
            change.node = NodeId{id};
            const NodeType* type = typeOf(index, scene);
            if (!type) {  // whoever applies this will say that the node is there
                change.kind = ChangeKind::createNode;
                change.index = index.value;
                append(change);
                continue;
            }
            for (FieldIndex f = 0; f < type->fields.size(); ++f) {
                const FieldDef& def = type->fields[f];
                if (!def.readable() || latest(change.node, f)) continue;
                change.field = f;
                change.value = Value::fromStorage(def.type, type->defaults() + def.offset);
                append(change);
            }
            if (latest(change.node, kName)) continue;
            change.kind = ChangeKind::setName;
            change.field = kNoField;
            change.value = String();
            append(change);
        }
        reborn.clear();
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
    s.following = 0;
    for (const Change& change : set.changes) s.add(change);
    if (set.authors)
        for (const Authored& one : *set.authors) s.authors.insert_or_assign({one.node.value, one.field}, one.author);
    // Changes that cancel each other leave dead slots behind. When most slots are dead, the live ones move together. So
    // the memory follows the merged set, and the cost of moving is spread over the changes that made it necessary.
    constexpr std::size_t kFewDead = 1024;
    if (s.dead > kFewDead && s.dead > s.slots.size() / 2) {
        ChangeSet live;
        std::map<std::uint32_t, TypeIndex> reborn = std::move(s.reborn);
        s.reborn.clear();
        take(live);
        s.reborn = std::move(reborn);
        add(live);
    }
}

ChangeSet ChangeComposer::take(const Scene* scene) {
    ChangeSet result;
    take(result, scene);
    return result;
}

void ChangeComposer::take(ChangeSet& into, const Scene* scene) {
    State& s = *state_;
    s.resetReborn(scene);
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
    into.clear();
    into.from = s.result.from;
    into.to = s.result.to;
    into.time = s.result.time;
    into.hash = s.result.hash;
    into.types.swap(s.result.types);
    std::size_t counts[kPhases] = {};
    for (const State::Slot& slot : s.slots)
        if (slot.live) ++counts[phase(slot.change.kind)];
    std::size_t total = 0;
    for (std::size_t& count : counts) total += std::exchange(count, total);
    into.changes.resize(total);
    for (State::Slot& slot : s.slots)
        if (slot.live) into.changes[counts[phase(slot.change.kind)]++] = std::move(slot.change);
    if (!s.authors.empty()) {
        std::vector<Authored> authors;
        for (auto& [key, author] : s.authors)
            authors.push_back({NodeId{key.first}, static_cast<FieldIndex>(key.second), std::move(author)});
        into.authors = std::make_shared<const std::vector<Authored>>(std::move(authors));
        s.authors.clear();
    }
    s.any = false;
    s.slots.clear();
    s.dead = 0;
    s.newest.clear();
    s.following = 0;
    s.childOps.clear();
    s.insertsOf.clear();
    s.addedRoutes.clear();
    s.destroyed.clear();
}

ChangeSet compose(std::span<const std::shared_ptr<const ChangeSet>> sets) {
    ChangeComposer composer;
    for (const auto& set : sets) composer.add(*set);
    return composer.take();
}

}  // namespace rtsg
