// Writing a field, inlined: the path that every event and every edit takes. What is rare is called.
//
// The first write of a field in a frame notes its value before, or the term of it if the last frame wrote it too
// (fields.cpp). Shared by the files of this folder that write in loops.
#pragma once

#include "state.h"

namespace rtsg {

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

[[gnu::always_inline]] inline Scene::State::WrittenField& Scene::State::newEntry(Node& node, FieldIndex field,
                                                                                 const FieldSlot& slot) {
    WrittenField& entry = written.emplace_back();
    entry.node = node.id_;
    entry.field = field;
    entry.type = slot.type;
    entry.external = writingExternally;
    touched |= aspectBit(slot.aspect);
    if (isAboutPlaces(slot)) places.noteMoved(node.id_);
    if (writing::isShared(slot.type)) {
        entry.setTerm(termOf(node, field));
    } else {
        WrittenField* known = expected;
        if (known >= sealedEnd || known->node != node.id_ || known->field != field) [[unlikely]]
            known = knownElsewhere(node, field);
        if (known) {
            entry.setTerm(known->term());
            expected = known + 1;
        } else {
            copyPlain(entry.before, node.block() + slot.offset, slot.size);
        }
    }
    entry.next = node.dirty_ ? node.dirtySlot_ + 1 : 0;
    node.dirtySlot_ = static_cast<std::uint32_t>(&entry - written.data());
    return entry;
}

[[gnu::always_inline]] inline void Scene::State::beginWrite(Node& node, FieldIndex field, const FieldSlot& slot) {
    const std::uint64_t bit = writing::dirtyBit(field);
    if (node.dirty_ & bit)
        if (WrittenField* entry = entryOf(node, field)) {
            entry->external = writingExternally;
            if (isAboutPlaces(slot)) places.noteMoved(node.id_);
            return;
        }
    newEntry(node, field, slot);
    node.dirty_ |= bit;
    if (!childOpCounts.empty()) [[unlikely]]
        dropChildOps(node, field);
}

[[gnu::always_inline]] inline void Scene::State::write(Node& node, FieldIndex field, const void* value) {
    const FieldSlot& slot = node.type_->slot(field);
    if (!writing::isPlain(slot.type)) return writeShared(node, field, value);
    beginWrite(node, field, slot);
    copyPlain(node.block() + slot.offset, value, slot.size);
}

}  // namespace rtsg
