// Writes a field, inlined: the path that every event and every edit takes. Rare cases are calls.
//
// The first write of a field in a frame notes its value before, or the term of it if the last frame wrote it too
// (fields.cpp). Shared by the files of this folder that write in loops.
#pragma once

#include "state.h"

namespace rtsg {

inline const Array<NodeId>& childrenAt(const void* storage) {
    return *static_cast<const Array<NodeId>*>(storage);
}

namespace writing {

inline constexpr FieldIndex kHighField = 63;

inline std::uint64_t dirtyBit(FieldIndex field) {
    return std::uint64_t{1} << std::min(field, kHighField);
}

/// Stored as a pointer, or too wide for a WrittenField: not plain bytes of a handful of sizes.
inline bool isShared(FieldType type) {
    return (detail::kOwns >> static_cast<unsigned>(type) & 1u) != 0;
}

/// Plain bytes that name no node: storing them is a copy.
inline bool isPlain(FieldType type) {
    constexpr std::uint64_t kOthers = detail::kOwns | detail::bit(FieldType::SFNode);
    return (kOthers >> static_cast<unsigned>(type) & 1u) == 0;
}

}  // namespace writing

[[gnu::always_inline]] inline WrittenField& Scene::State::newPlainEntry(Lane& lane, Node& node, FieldIndex field,
                                                                        const FieldSlot& slot) {
    if (lane.nextEntry == lane.entryEnd) [[unlikely]]
        moreRoom(lane);
    noteAspect(lane, node.id_, slot);
    WrittenField* known = lane.expected;
    if (known >= lane.expectedEnd || known->node != node.id_ || known->field != field) [[unlikely]]
        known = knownElsewhere(lane, node, field);
    std::uint64_t before[2] = {};
    if (known) {
        before[0] = known->before[0];
        before[1] = known->before[1];
        lane.expected = known + 1;
    } else {
        copyPlain(before, node.block() + slot.offset, slot.size);
    }
    WrittenField& entry = *new (lane.nextEntry++) WrittenField{.node = node.id_,
                                                               .next = node.dirty_ ? node.dirtySlot_ + 1 : 0,
                                                               .field = field,
                                                               .type = slot.type,
                                                               .external = lane.writingExternally,
                                                               .hashed = known != nullptr,
                                                               .before = {before[0], before[1]}};
    node.dirtySlot_ = lane.slotOf(&entry);
    return entry;
}

[[gnu::always_inline]] inline WrittenField& Scene::State::newEntry(Lane& lane, Node& node, FieldIndex field,
                                                                   const FieldSlot& slot) {
    if (!writing::isShared(slot.type)) return newPlainEntry(lane, node, field, slot);
    if (lane.nextEntry == lane.entryEnd) [[unlikely]]
        moreRoom(lane);
    noteAspect(lane, node.id_, slot);
    WrittenField& entry = *new (lane.nextEntry++) WrittenField{.node = node.id_,
                                                               .next = node.dirty_ ? node.dirtySlot_ + 1 : 0,
                                                               .field = field,
                                                               .type = slot.type,
                                                               .external = lane.writingExternally};
    entry.setTerm(termOf(node, field));
    node.dirtySlot_ = lane.slotOf(&entry);
    return entry;
}

[[gnu::always_inline]] inline bool Scene::State::writeAsBefore(Lane& lane, Node& node, FieldIndex field,
                                                               const FieldSlot& slot, const void* value,
                                                               std::size_t size) {
    const WrittenField* const known = lane.expected;
    const std::uint64_t dirty = node.dirty_, bit = writing::dirtyBit(field);
    if (known >= lane.expectedEnd || known->node != node.id_ || known->field != field || (dirty & bit) ||
        lane.nextEntry == lane.entryEnd) [[unlikely]]
        return false;
    const std::uint32_t aspect = aspectBit(slot.aspect);
    if ((aspect & kTransformAspects) && affectsTransforms(slot) && worldTransforms.isWatched(node.id_)) [[unlikely]]
        return false;
    lane.touched |= aspect;
    lane.expected = lane.expected + 1;
    WrittenField& entry = *new (lane.nextEntry++) WrittenField(*known);
    entry.next = dirty ? node.dirtySlot_ + 1 : 0;
    entry.external = lane.writingExternally;
    entry.hashed = true;
    node.dirtySlot_ = lane.slotOf(&entry);
    node.dirty_ = dirty | bit;
    copyPlain(node.block() + slot.offset, value, size);
    return true;
}

template <bool isPlain>
[[gnu::always_inline]] inline void Scene::State::beginWrite(Lane& lane, Node& node, FieldIndex field,
                                                            const FieldSlot& slot) {
    const std::uint64_t bit = writing::dirtyBit(field);
    if (node.dirty_ & bit)
        if (WrittenField* entry = entryOf(node, field)) {
            entry->external = lane.writingExternally;
            if (affectsTransforms(slot)) noteMoved(lane, node.id_);
            return;
        }
    if constexpr (isPlain)
        newPlainEntry(lane, node, field, slot);
    else
        newEntry(lane, node, field, slot);
    node.dirty_ |= bit;
    // Lists of children are not plain.
    if constexpr (!isPlain)
        if (!childOpCounts.empty()) [[unlikely]]
            dropChildOps(node, field);
}

[[gnu::always_inline]] inline void Scene::State::write(Lane& lane, Node& node, FieldIndex field, const void* value) {
    const FieldSlot& slot = node.type_->slot(field);
    if (!writing::isPlain(slot.type)) return writeShared(lane, node, field, value);
    beginWrite<true>(lane, node, field, slot);
    copyPlain(node.block() + slot.offset, value, slot.size);
}

}  // namespace rtsg
