// Writing fields, and what it does to the state hash: the path that every change takes, so it is kept short.
//
// The first write of a field in a frame notes its value before, or the term of it if the last frame wrote it too; the
// seal hashes the value that is there in the end. So a field costs one or two terms a frame, however often it is
// written, and terms of one frame are computed one after the other, which a processor overlaps.
#include <algorithm>

#include "scene/plain_term.h"
#include "writing.h"

namespace rtsg {

using writing::dirtyBit;
using writing::isShared;
using writing::kHighField;

bool Node::isDefault(FieldIndex field) const {
    const FieldDef& def = type_->fields[field];
    return equalStorage(def.type, block() + def.offset, type_->defaults() + def.offset);
}

bool Scene::State::isDirty(const Node& node, FieldIndex field) const {
    if (!(node.dirty_ & dirtyBit(field))) return false;
    if (field < kHighField) return true;
    for (std::uint32_t i = node.dirtySlot_ + 1; i != 0; i = written->at(i - 1).next)
        if (written->at(i - 1).field == field) return true;
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

WrittenField* Scene::State::entryOf(const Node& node, FieldIndex field) {
    if (!node.dirty_) return nullptr;
    for (std::uint32_t i = node.dirtySlot_ + 1; i != 0; i = written->at(i - 1).next)
        if (WrittenField& entry = written->at(i - 1); entry.field == field) return &entry;
    return nullptr;
}

WrittenField* Scene::State::knownElsewhere(Lane& lane, const Node& node, FieldIndex field) const {
    if (node.dirty_) return nullptr;
    // Not in the order of the last frame, or in another chunk: where the node itself says it was.
    for (std::uint32_t i = node.dirtySlot_ + 1; i != 0;) {
        WrittenField* const end = sealed->endFor(i - 1);
        if (!end) return nullptr;
        WrittenField& entry = sealed->at(i - 1);
        if (entry.node != node.id_) return nullptr;
        if (entry.field == field) {
            lane.expectedEnd = end;
            return &entry;
        }
        i = entry.next;
    }
    return nullptr;
}

void Scene::State::endPiece(Lane& lane) {
    const WrittenFields::Piece done{lane.pieceBegin, static_cast<std::uint32_t>(lane.nextEntry - lane.pieceBegin),
                                    lane.laneNumber};
    if (done.count == 0) return;
    const std::uint32_t slot = lane.slotOf(lane.pieceBegin);
    if (lane.isBeside)
        lane.pieces.push_back({done, slot});
    else
        written->append(done, slot);
    lane.pieceBegin = lane.nextEntry;
}

void Scene::State::moreRoom(Lane& lane) {
    endPiece(lane);
    lane.entryRoom = written->takeChunk(lane.laneNumber);
    lane.nextEntry = lane.pieceBegin = lane.entryRoom.entries;
    lane.entryEnd = lane.nextEntry + WrittenFields::kChunk;
}

std::size_t Scene::State::countWritten() {
    endPiece(*this);
    return written->size();
}

void Scene::State::beginWrite(Node& node, FieldIndex field) {
    beginWrite(*this, node, field, node.type_->slot(field));
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
            constexpr std::size_t kAhead = 16;  // a trip to memory a node, that begins long before it is needed
            for (std::size_t i = 0; i < after.size(); ++i) {
                if (i + kAhead < after.size()) __builtin_prefetch(find(after[i + kAhead]), 1);
                addParent(*find(after[i]), parent);
            }
            for (const NodeId id : before) removeParent(*find(id), parent);
        }
    } else if (!isShared(slot.type)) {
        copyPlain(target, value, slot.size);
        return;
    }
    copyStorage(slot.type, target, value);
}

void Scene::State::writeShared(Lane& lane, Node& node, FieldIndex field, const void* value) {
    constexpr std::size_t kBytesPerEvent = 256;
    const FieldSlot& slot = node.type_->slot(field);
    beginWrite(lane, node, field, slot);
    store(node, field, value);
    if (slot.size != sizeof(void*)) return;
    const detail::ArrayHeader* header = nullptr;
    std::memcpy(&header, node.block() + slot.offset, sizeof(header));
    if (header) lane.work += header->size * header->elementSize / kBytesPerEvent;
}

void Scene::State::writeSealed(Node& node, FieldIndex field, const Value& value) {
    const std::uint32_t slot = node.dirtySlot_;
    WrittenField& entry = newEntry(*this, node, field, node.type_->slot(field));
    hash.subtract(termBefore(node, entry));
    store(node, field, value.storage());
    hash.add(termOf(node, field));
    entry.node = {};  // lists change in place, so their terms do not last; other types are rare here
    node.dirtySlot_ = slot;
}

void Scene::State::keepTerms() {
    if (countWritten() == 0) return;
    std::swap(written, sealed);
    written->clear();
    if (std::exchange(namesTwice, false)) sealed->clear();
    const auto forget = [](Lane& lane) {
        lane.entryRoom = {};
        lane.nextEntry = lane.entryEnd = lane.pieceBegin = lane.expected = lane.expectedEnd = nullptr;
    };
    forget(*this);
    for (const auto& lane : lanes) forget(*lane);
}

void Scene::State::forgetTerms() {
    if (sealed->size() == 0) return;
    sealed->clear();
    expected = expectedEnd = nullptr;
}

/// Seals a value that is shared or wide. Returns by how much the hash grows.
Hash128 Scene::State::sealShared(const Node& node, WrittenField& entry, Change& change) const {
    change.value = node.value(entry.field);
    detail::StateHash grown(termOf(node, entry.field));
    grown.subtract(entry.term());
    entry.node = {};  // lists change in place: their terms do not last
    return grown.value();
}

// Everything that it calls is inlined, unless marked otherwise, since calls would be most of a term's cost.
[[gnu::flatten]] Scene::State::SealedPart Scene::State::sealPiece(WrittenFields::Piece one, Change* changes) {
    // All in locals: the bytes written below might be anything, for all a compiler knows.
    const std::size_t count = one.count;
    WrittenField* const entries = one.begin;
    std::size_t voids = 0;
    // Keys of the last node's type, since most nodes are followed by others of their type.
    TypeIndex keyedType;
    const FieldKey* keys = nullptr;
    const NodeTable::View table = nodeTable.view();
    detail::TermSum sum;
    // Nodes are looked up so far ahead that a trip to memory is over when their turn comes; those of several fields in
    // a row once.
    constexpr std::size_t kAhead = 16;
    Node* ahead[kAhead];
    NodeId latest;
    Node* found = nullptr;
    const auto lookUp = [&](std::size_t i) {
        const NodeId id = entries[i].node;
        if (id != latest) {
            latest = id;
            found = table.find(id);
            if (found) {
                __builtin_prefetch(found, 1);
                __builtin_prefetch(reinterpret_cast<const std::byte*>(found) + 64);
            }
        }
        ahead[i % kAhead] = found;
    };
    for (std::size_t i = 0; i < std::min(kAhead, count); ++i) lookUp(i);
    for (std::size_t i = 0; i < count; ++i) {
        Node* const node = ahead[i % kAhead];
        if (i + kAhead < count) lookUp(i + kAhead);
        Change* const change = changes + i;
        if (!node) [[unlikely]] {
            change->kind = ChangeKind::setField;
            change->field = kNoField;
            ++voids;
            continue;
        }
        WrittenField& entry = entries[i];
        const FieldIndex field = entry.field;
        const NodeType& type = *node->type_;
        const FieldSlot slot = type.slot(field);
        // Another thread may have its other fields.
        std::atomic_ref(node->dirty_).store(0, std::memory_order_relaxed);
        change->node = entry.node;
        change->field = field;
        change->kind = ChangeKind::setField;
        change->external = entry.external;
        change->isConnection = false;
        change->other = {};
        change->index = 0;
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
        const NodeId id = entry.node;
        detail::withPlainSize(slot.size, [&]<std::size_t size>() {
            change->value.setPlain(slot.type, value, size);
            sum.subtract(entry.hashed ? entry.term() : detail::plainTermOfSize<size>(id, key, entry.before, fallback));
            const Hash128 after = detail::plainTermOfSize<size>(id, key, value, fallback);
            sum.add(after);
            entry.setTerm(after);
        });
    }
    return {.grown = sum.value(), .voids = voids};
}

/// Each part gets the fields that were written in the lane of its number, unless that is much more than others get: the
/// thread that ran the lane has these nodes at hand. The rest, and the fields that the scene's thread wrote, go to the
/// parts with the least.
void Scene::State::dealSeal(std::size_t count, unsigned parts) {
    const std::size_t even = (count + parts - 1) / parts, maximum = even + even / 4;
    sealParts.resize(parts);
    for (SealPart& sealPart : sealParts) {
        sealPart.cuts.clear();
        sealPart.count = 0;
    }
    std::vector<SealCut> rest;
    std::size_t at = 0;
    for (const WrittenFields::Piece& one : written->pieces()) {
        SealPart* own = one.lane > 0 && one.lane <= parts ? &sealParts[one.lane - 1] : nullptr;
        if (own && own->count + one.count <= maximum) {
            own->cuts.push_back({one, at});
            own->count += one.count;
        } else {
            rest.push_back({one, at});
        }
        at += one.count;
    }
    auto part = sealParts.begin();
    for (SealCut one : rest)
        while (one.piece.count > 0) {
            while (part + 1 != sealParts.end() && part->count >= even) ++part;
            std::uint32_t taken = one.piece.count;
            if (part + 1 != sealParts.end())
                taken = static_cast<std::uint32_t>(std::min<std::size_t>(taken, even - part->count));
            part->cuts.push_back({{one.piece.begin, taken}, one.at});
            part->count += taken;
            one.piece.begin += taken;
            one.piece.count -= taken;
            one.at += taken;
        }
}

Scene::State::SealedPart Scene::State::sealPart(const SealPart& sealPart, Change* changes) {
    SealedPart all;
    detail::StateHash sum;
    for (const SealCut& one : sealPart.cuts) {
        const SealedPart part = sealPiece(one.piece, changes + one.at);
        sum.add(part.grown);
        all.voids += part.voids;
    }
    all.grown = sum.value();
    return all;
}

void Scene::State::appendFieldChanges(ChangeSet& set, std::size_t behind) {
    const std::size_t count = countWritten();
    set.changes.resize(behind + count);
    if (count == 0) return;
    Change* changes = set.changes.data() + behind;
    std::size_t voids = 0;
    const auto add = [&](const SealedPart& part) {
        hash.add(part.grown);
        voids += part.voids;
    };
    constexpr std::size_t kEntriesPerEvent = 4;  // sealing one entry takes a quarter of the time of an event
    const std::uint64_t workOfThis = work - std::exchange(workSealed, work);
    if (ThreadTeam* some = teamFor(std::max<std::uint64_t>(count / kEntriesPerEvent, workOfThis))) {
        dealSeal(count, some->parts());
        some->run([&](unsigned part) { sealParts[part].result = sealPart(sealParts[part], changes); });
        for (const SealPart& sealPart : sealParts) add(sealPart.result);
    } else {
        for (const WrittenFields::Piece& one : written->pieces()) {
            add(sealPiece(one, changes));
            changes += one.count;
        }
    }
    const auto isVoid = [](const Change& c) { return c.kind == ChangeKind::setField && c.field == kNoField; };
    if (voids > 0) std::erase_if(set.changes, isVoid);
    keepTerms();
}

inline bool Scene::State::setPlain(Node* node, FieldIndex field, FieldType type, const void* value) {
    if (!node || field >= node->type_->fieldCount()) return false;
    const FieldSlot& slot = node->type_->slot(field);
    if (!slot.plain || slot.type != type) return false;
    beginWrite<true>(*this, *node, field, slot);
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
        if (i + kAhead < ids.size()) s.prefetchSlot(ids[i + kAhead]);
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
