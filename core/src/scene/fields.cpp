// Writing fields, and what it does to the state hash: the path that every change takes, so it is kept short.
//
// The first write of a field in a frame notes its value before, or the term of it if the last frame wrote it too; the
// seal hashes the value that is there in the end. So a field costs one or two terms a frame, however often it is
// written, and terms of one frame are computed one after the other, which a processor overlaps.
#include <algorithm>

#include "plain_term.h"
#include "writing.h"

namespace rtsg {

using writing::dirtyBit;
using writing::isShared;
using writing::kHighField;

namespace {

const Array<NodeId>& childrenAt(const void* storage) {
    return *static_cast<const Array<NodeId>*>(storage);
}

}  // namespace

bool Node::isDefault(FieldIndex field) const {
    const FieldDef& def = type_->fields[field];
    return equalStorage(def.type, block() + def.offset, type_->defaults() + def.offset);
}

bool Scene::State::isDirty(const Node& node, FieldIndex field) const {
    if (!(node.dirty_ & dirtyBit(field))) return false;
    if (field < kHighField) return true;
    for (std::uint32_t i = node.dirtySlot_ + 1; i != 0; i = written[i - 1].next)
        if (written[i - 1].field == field) return true;
    return false;
}

Hash128 Scene::State::termOf(const Node& node, FieldIndex field) const {
    if (node.isDefault(field)) return {};
    return detail::fieldTerm(node.id_, keyOf(node, field), node.type_->fields[field].type, node.storage(field));
}

Hash128 Scene::State::termBefore(const Node& node, const WrittenField& entry) const {
    if (entry.hashed) return entry.term();
    const FieldSlot& slot = node.type_->slot(entry.field);
    return detail::plainTerm(node.id_, keyOf(node, entry.field), entry.before, node.type_->defaults() + slot.offset,
                             slot.size);
}

Scene::State::WrittenField* Scene::State::entryOf(const Node& node, FieldIndex field) {
    if (!node.dirty_) return nullptr;
    for (std::uint32_t i = node.dirtySlot_ + 1; i != 0; i = written[i - 1].next)
        if (written[i - 1].field == field) return &written[i - 1];
    return nullptr;
}

Scene::State::WrittenField* Scene::State::knownElsewhere(const Node& node, FieldIndex field) const {
    if (node.dirty_) return nullptr;
    // Not in the order of the last frame: where the node itself says it was.
    for (std::size_t i = node.dirtySlot_; i < sealed.size() && sealed[i].node == node.id_;
         i = sealed[i].next - std::size_t{1})
        if (sealed[i].field == field) return sealedEnd - (sealed.size() - i);
    return nullptr;
}

void Scene::State::beginWrite(Node& node, FieldIndex field) {
    beginWrite(node, field, node.type_->slot(field));
}

void Scene::State::dropChildOps(const Node& node, FieldIndex field) {
    const auto ops = childOpCounts.find({node.id_, field});
    if (ops == childOpCounts.end()) return;
    std::erase_if(childOps, [&](const Change& c) { return c.node == node.id_ && c.field == field; });
    childOpCounts.erase(ops);
}

void Scene::State::store(Node& node, FieldIndex field, const void* value) {
    const FieldSlot& slot = node.type_->slot(field);
    std::byte* target = node.block() + slot.offset;
    if (sf(slot.type) == FieldType::SFNode) {
        const ParentRef parent{node.id_, field};
        if (slot.type == FieldType::SFNode) {
            const NodeId before = *reinterpret_cast<const NodeId*>(target);
            const NodeId after = *static_cast<const NodeId*>(value);
            if (after) addParent(*find(after), parent);
            if (before) removeParent(*find(before), parent);
        } else {
            const Array<NodeId> before = childrenAt(target), after = childrenAt(value);
            for (const NodeId id : after) addParent(*find(id), parent);
            for (const NodeId id : before) removeParent(*find(id), parent);
        }
    } else if (!isShared(slot.type)) {
        copyPlain(target, value, slot.size);
        return;
    }
    copyStorage(slot.type, target, value);
}

void Scene::State::writeShared(Node& node, FieldIndex field, const void* value) {
    beginWrite(node, field);
    store(node, field, value);
}

void Scene::State::writeSealed(Node& node, FieldIndex field, const Value& value) {
    const FieldSlot& slot = node.type_->slot(field);
    WrittenField& entry = newEntry(node, field, slot);
    // A set that names a field twice is none of ours; its second term must not be the first one's.
    if (entry.hashed && !isShared(entry.type)) expected[-1].node = {};
    hash.subtract(termBefore(node, entry));
    store(node, field, value.storage());
    entry.setTerm(isShared(entry.type) ? termOf(node, field)
                                       : detail::plainTerm(node.id_, keyOf(node, field), node.block() + slot.offset,
                                                           node.type_->defaults() + slot.offset, slot.size));
    hash.add(entry.term());
    if (isShared(entry.type)) entry.node = {};  // lists change in place: their terms do not last
}

void Scene::State::keepTerms() {
    if (written.empty()) return;
    written.swap(sealed);
    // What one large frame took (loading, say) is not kept for the small ones that follow.
    if (written.capacity() > kEntriesKept && written.size() < written.capacity() / 8)
        std::vector<WrittenField>().swap(written);
    written.clear();
    expected = sealed.data();
    sealedEnd = expected + sealed.size();
}

/// Of a value that is shared, or wide. Returns by how much the hash grows.
Hash128 Scene::State::sealShared(const Node& node, WrittenField& entry, Change& change) const {
    change.value = node.value(entry.field);
    detail::StateHash grown(termOf(node, entry.field));
    grown.subtract(entry.term());
    entry.node = {};  // lists change in place: their terms do not last
    return grown.value();
}

// All that it calls is made part of it, but for what is marked otherwise: calls are most of what a term costs.
[[gnu::flatten]] void Scene::State::appendFieldChanges(ChangeSet& set) {
    if (written.empty()) return;
    // All in locals: the bytes written below might be anything, for all a compiler knows.
    const std::size_t count = written.size();
    WrittenField* const entries = written.data();
    // Of the type of the last node: most are followed by more of their kind.
    TypeIndex keyedType;
    const FieldKey* keys = nullptr;
    const NodeTable::View table = nodeTable.view();
    set.changes.reserve(set.changes.size() + count);
    detail::StateHash sum = hash;
    // Nodes are looked up so far ahead that a trip to memory is over when their turn comes.
    constexpr std::size_t kAhead = 16;
    Node* ahead[kAhead];
    const auto lookUp = [&](std::size_t i) {
        Node* node = table.find(entries[i].node);
        ahead[i % kAhead] = node;
        if (!node) return;
        __builtin_prefetch(node, 1);
        __builtin_prefetch(reinterpret_cast<const std::byte*>(node) + 64);
    };
    for (std::size_t i = 0; i < std::min(kAhead, count); ++i) lookUp(i);
    for (std::size_t i = 0; i < count; ++i) {
        Node* const node = ahead[i % kAhead];
        if (i + kAhead < count) lookUp(i + kAhead);
        if (!node) continue;
        WrittenField& entry = entries[i];
        const FieldIndex field = entry.field;
        const NodeType& type = *node->type_;
        const FieldSlot slot = type.slot(field);
        node->dirty_ = 0;
        Change* const change = &set.changes.emplace_back();
        change->node = entry.node;
        change->field = field;
        change->external = entry.external;
        if (isShared(slot.type)) {
            sum.add(sealShared(*node, entry, *change));
            continue;
        }
        const std::byte* value = node->block() + slot.offset;
        const std::byte* fallback = type.defaults() + slot.offset;
        if (node->typeIndex_ != keyedType) {
            keyedType = node->typeIndex_;
            keys = types[keyedType.value].keys;
        }
        const FieldKey key = keys[field];
        detail::withPlainSize(slot.size, [&]<std::size_t size>() {
            change->value.setPlain(slot.type, value, size);
            const auto termOfBytes = [&](const void* bytes) {
                return detail::plainTermOfSize<size>(change->node, key, bytes, fallback);
            };
            const Hash128 before = entry.hashed ? entry.term() : termOfBytes(entry.before);
            const Hash128 after = termOfBytes(value);
            sum.subtract(before);
            sum.add(after);
            entry.setTerm(after);
        });
    }
    hash = sum;
    keepTerms();
}

inline bool Scene::State::setPlain(Node* node, FieldIndex field, FieldType type, const void* value) {
    if (!node || field >= node->type_->fieldCount()) return false;
    const FieldSlot& slot = node->type_->slot(field);
    if (!slot.plain || slot.type != type) return false;
    beginWrite(*node, field, slot);
    copyPlain(node->block() + slot.offset, value, slot.size);
    wake(*node);
    return true;
}

bool Scene::setPlain(NodeId id, FieldIndex field, FieldType type, const void* value) {
    State& s = *state_;
    if (!s.onOwnThread()) return false;
    s.editedWithin |= s.cascading;
    return s.setPlain(s.find(id), field, type, value);
}

std::size_t Scene::setPlainEach(std::span<const NodeId> ids, FieldIndex field, FieldType type, const void* values) {
    State& s = *state_;
    if (!s.onOwnThread()) return 0;
    s.editedWithin |= s.cascading;
    const std::size_t size = info(type).size;
    // Two trips to memory a node, its number's and its own; both begin long before they are needed.
    constexpr std::size_t kAhead = 16;
    Node* nodes[kAhead] = {};
    for (std::size_t i = 0; i < ids.size() + kAhead; ++i) {
        if (i >= kAhead) {
            const std::size_t k = i - kAhead;
            if (!s.setPlain(nodes[i % kAhead], field, type, static_cast<const std::byte*>(values) + k * size)) return k;
        }
        if (i + kAhead < ids.size()) s.prefetchPlace(ids[i + kAhead]);
        if (i >= ids.size()) continue;
        Node* node = s.find(ids[i]);
        nodes[i % kAhead] = node;
        if (!node) continue;
        __builtin_prefetch(node, 1);
        __builtin_prefetch(reinterpret_cast<const std::byte*>(node) + 64, 1);
        __builtin_prefetch(reinterpret_cast<const std::byte*>(node) + 128, 1);
    }
    return ids.size();
}

}  // namespace rtsg
