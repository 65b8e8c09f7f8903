// Writing the plain values that a sealed set brings: the path that every change of a mirror and of a replay takes.
//
// The data that changes of one field of one type share are looked up once, and nodes are fetched ahead. A change costs
// two terms of the hash, of which the older one is known if the set before had it. A set that writes what the set
// before wrote reads and writes half as much memory, which matters where many replicas take turns.
#include <algorithm>
#include <array>

#include "scene/plain_term.h"
#include "writing.h"

namespace rtsg {

/// The data that all changes of one field of nodes of one type share.
struct Scene::State::KnownField {
    const NodeType* nodeType = nullptr;
    WrittenField entry;  // without the parts that depend on node and value
    std::uint32_t offset = 0;
    std::uint32_t size = 0;
    FieldKey key{};
    const std::byte* fallback = nullptr;
    bool isTransform = false;  // of nodes whose place somebody may have asked for
    bool wakes = false;        // the node's behaviour
};

bool Scene::State::lookUp(KnownField& known, const Node& node, FieldIndex field) {
    const NodeType& type = *node.type_;
    if (field >= type.fieldCount()) return false;
    const FieldSlot slot = type.slot(field);
    if (!writing::isPlain(slot.type) || slot.offset == FieldDef::kNoOffset) return false;
    const TypeEntry& entry = types[node.typeIndex_.value];
    known = {.nodeType = &type,
             .entry = {.node = {},
                       .next = 0,
                       .field = field,
                       .type = slot.type,
                       .external = writingExternally,
                       .hashed = true,
                       .nodeType = node.typeIndex_,
                       .before = {}},
             .offset = slot.offset,
             .size = slot.size,
             .key = entry.keys[field],
             .fallback = type.defaults() + slot.offset,
             .isTransform = affectsTransforms(slot) && worldTransforms.watchesAny(),
             .wakes = behavioursEnabled && entry.behaviour.onTime};
    touched |= aspectBit(slot.aspect);
    return true;
}

namespace {

/// A plain value's bytes, without the question whether they lie elsewhere.
[[gnu::always_inline]] inline const void* plainBytes(const Value& value) {
    if (detail::kBoxed >> static_cast<unsigned>(value.type()) & 1u) __builtin_unreachable();
    return value.storage();
}

}  // namespace

/// Nodes of changes, looked up and fetched one block before their turn.
class Scene::State::NodesAhead {
  public:
    NodesAhead(NodeTable::View table, std::span<const Change> changes) : table_(table), changes_(changes) {
        lookUp(kBlock);
    }
    /// The node of change `i`, or null. Precondition: called for each in turn, as often as one likes.
    [[gnu::always_inline]] Node* operator[](std::size_t i) {
        if (i % kBlock == 0) lookUp(i + 2 * kBlock);
        return nodes_[i % (2 * kBlock)];
    }
    /// Says at which offset in their blocks the next nodes are likely to be written.
    void expect(std::size_t offset) { target_ = sizeof(Node) + offset; }

  private:
    static constexpr std::size_t kBlock = 16;
    [[gnu::always_inline]] void lookUp(std::size_t end) {
        end = std::min(end, changes_.size());
        for (; next_ < end; ++next_) {
            Node* const node = table_.find(changes_[next_].node);
            nodes_[next_ % (2 * kBlock)] = node;
            __builtin_prefetch(node, 1);  // of null: nothing
            __builtin_prefetch(reinterpret_cast<const std::byte*>(node) + target_, 1);
        }
    }
    NodeTable::View table_;
    std::span<const Change> changes_;
    std::size_t target_ = sizeof(Node);
    std::array<Node*, 2 * kBlock> nodes_;
    std::size_t next_ = 0;
};

/// An applied set marks no field as written: entries of one node form a list, in which this looks for the field. Also
/// true if the list is so long that going through it for every field would take too long.
bool Scene::State::isNamedBefore(FieldIndex field, std::uint32_t newest) const {
    constexpr int kMax = 64;
    int steps = 0;
    for (std::uint32_t i = newest; i != 0; i = written->at(i - 1).next)
        if (written->at(i - 1).field == field || ++steps == kMax) return true;
    return false;
}

/// The last set's entry of the field, where it is not the next one in order; null if there is none. `next`: slot + 1 of
/// the node's newest entry in this set.
[[gnu::noinline]] const WrittenField* Scene::State::findSealed(const Node& node, FieldIndex field, std::uint32_t next) {
    if (next != 0 && !namesTwice && isNamedBefore(field, next)) {
        namesTwice = true;
        forgetTerms();
    }
    const bool isNext = expected < expectedEnd && expected->node == node.id_ && expected->field == field;
    return isNext ? expected : knownElsewhere(*this, node, field);
}

/// Notes and writes one value of `size` bytes, and adds to the sum by how much the hash grows.
template <std::size_t size>
[[gnu::always_inline]] inline void Scene::State::writeSealedPlain(Node& node, const KnownField& known,
                                                                  const void* value, detail::TermSum& sum) {
    std::byte* const target = node.block() + known.offset;
    const NodeId id = node.id_;
    if (nextEntry == entryEnd) [[unlikely]]
        moreRoom(*this);
    if (known.isTransform) noteMoved(*this, id);
    WrittenField* const entry = nextEntry++;
    const std::uint32_t slot = slotOf(entry), latest = node.dirtySlot_;  // the node's last, in this set or an older one
    const std::uint32_t next = latest < slot && written->at(latest).node == id ? latest + 1 : 0;
    const WrittenField* was = expected;
    if (next != 0 || was >= expectedEnd || was->node != id || was->field != known.entry.field) [[unlikely]]
        was = findSealed(node, known.entry.field, next);
    if (was) [[likely]] {
        sum.subtract(was->term());
        expected = const_cast<WrittenField*>(was) + 1;
    } else {
        sum.subtract(detail::plainTermOfSize<size>(id, known.key, target, known.fallback));
    }
    // The term of the incoming bytes: a processor would have to wait for those just stored.
    const Hash128 after = detail::plainTermOfSize<size>(id, known.key, value, known.fallback);
    sum.add(after);
    *entry = known.entry;
    entry->node = id;
    entry->next = next;
    entry->before[0] = after.low;
    entry->before[1] = after.high;
    node.dirtySlot_ = slot;
    std::memcpy(target, value, size);
}

/// Writes the changes from `begin` on that are all of this field of nodes of this type. Returns where they end.
template <std::size_t size>
[[gnu::flatten]] std::size_t Scene::State::writeAlike(std::span<const Change> changes, std::size_t begin,
                                                      NodesAhead& nodes, const KnownField& known) {
    const KnownField alike = known;  // in locals: the bytes written below might be anything, for all a compiler knows
    const FieldType type = alike.entry.type;
    nodes.expect(alike.offset);
    detail::TermSum sum;
    std::size_t i = begin;
    for (; i < changes.size(); ++i) {
        const Change& change = changes[i];
        if (change.field != alike.entry.field || change.kind != ChangeKind::setField || change.value.type() != type)
            break;
        Node* const node = nodes[i];
        if (!node || node->type_ != alike.nodeType) break;
        writeSealedPlain<size>(*node, alike, plainBytes(change.value), sum);
        if (alike.wakes) woken.push_back(node->id_);
    }
    hash.add(sum.value());
    return i;
}

/// Whether it is worth trying: if a set leaves the order of the last one, the terms before that place are not kept for
/// the next set.
bool Scene::State::mayRepeat(std::span<const Change> changes) const {
    if (sealed->size() != changes.size() || written->size() > 0 || nextEntry != pieceBegin) return false;
    const auto isLike = [](const Change& change, const WrittenField& entry) {
        return change.node == entry.node && change.field == entry.field && entry.nodeType != TypeIndex{};
    };
    std::size_t at = 0;
    return std::ranges::all_of(sealed->pieces(), [&](const WrittenFields::Piece& one) {
        const Change *const first = &changes[at], *const last = first + one.count - 1;
        at += one.count;
        return isLike(*first, one.begin[0]) && isLike(*last, one.begin[one.count - 1]);
    });
}

/// Writes the changes from the first on that are all of this field of nodes of this type.
template <std::size_t size>
[[gnu::flatten]] std::size_t Scene::State::rewriteAlike(std::span<const Change> changes,
                                                        std::span<WrittenField> entries, const KnownField& known) {
    constexpr std::size_t kAhead = 16;
    const KnownField alike = known;
    const FieldIndex field = alike.entry.field;
    const FieldType type = alike.entry.type;
    const TypeIndex nodeType = alike.entry.nodeType;
    const std::size_t count = entries.size();
    const NodeTable::View table = nodeTable.view();
    Node* ahead[kAhead];
    const auto lookUp = [&](std::size_t i) {
        Node* const node = table.find(changes[i].node);
        ahead[i % kAhead] = node;
        // Fetches the field alone, as the rest of the node is not needed; for null this does nothing.
        __builtin_prefetch(reinterpret_cast<const std::byte*>(node) + sizeof(Node) + alike.offset, 1);
    };
    for (std::size_t i = 0; i < std::min(kAhead, count); ++i) lookUp(i);
    detail::TermSum sum;
    std::size_t i = 0;
    for (; i < count; ++i) {
        const Change& change = changes[i];
        WrittenField& entry = entries[i];
        Node* const node = ahead[i % kAhead];
        if (change.node != entry.node || change.field != field || entry.field != field || entry.nodeType != nodeType ||
            change.kind != ChangeKind::setField || change.value.type() != type || !node)
            break;
        if (i + kAhead < count) lookUp(i + kAhead);
        const void* const value = plainBytes(change.value);
        sum.subtract(entry.term());
        const Hash128 after = detail::plainTermOfSize<size>(change.node, alike.key, value, alike.fallback);
        sum.add(after);
        entry.before[0] = after.low;
        entry.before[1] = after.high;
        std::memcpy(node->block() + alike.offset, value, size);
        if (alike.isTransform) noteMoved(*this, change.node);
        if (alike.wakes) woken.push_back(change.node);
    }
    hash.add(sum.value());
    return i;
}

std::size_t Scene::State::rewriteSealed(std::span<const Change> changes) {
    std::size_t done = 0;
    KnownField known;
    for (const WrittenFields::Piece& one : sealed->pieces()) {
        std::span<WrittenField> entries(one.begin, one.count);
        while (!entries.empty()) {
            const WrittenField& entry = entries.front();
            const Change& change = changes[done];
            const Node* const node = find(change.node);
            if (!node || entry.nodeType != node->typeIndex_ || change.node != entry.node) break;
            if (known.nodeType != node->type_ || known.entry.field != change.field)
                if (!lookUp(known, *node, change.field)) break;
            const std::size_t alike = detail::withPlainSize(known.size, [&]<std::size_t size>() {
                return rewriteAlike<size>(changes.subspan(done, entries.size()), entries, known);
            });
            if (alike == 0) break;
            entries = entries.subspan(alike);
            done += alike;
        }
        if (entries.empty()) continue;
        expected = entries.data();
        expectedEnd = expected + entries.size();
        break;
    }
    return done;
}

std::size_t Scene::State::writeSealedRun(std::span<const Change> changes) {
    if (mayRepeat(changes)) return rewriteSealed(changes);
    NodesAhead nodes(nodeTable.view(), changes);
    std::array<KnownField, 4> latest;  // nodes of one kind often change in two or three fields each
    std::size_t done = 0;
    while (done < changes.size()) {
        const Change& change = changes[done];
        const Node* const node = nodes[done];
        if (!node || change.kind != ChangeKind::setField) break;
        KnownField& known = latest[change.field % latest.size()];
        if (known.nodeType != node->type_ || known.entry.field != change.field)
            if (!lookUp(known, *node, change.field)) break;
        if (known.entry.type != change.value.type()) break;
        done = detail::withPlainSize(known.size,
                                     [&]<std::size_t size>() { return writeAlike<size>(changes, done, nodes, known); });
    }
    return done;
}

}  // namespace rtsg
