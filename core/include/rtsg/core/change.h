// Change, ChangeSet and their composition: the one form in which changes of a scene's state are passed on.
//
// Invariant of a sealed set: it has at most one net effect for each (node, field). The order is defineType*,
// createNode*, (setField | insertChild | removeChild)*, setName*, (removeRoute | addRoute)*, destroyNode*, event*. It
// refers only to nodes that exist before the set or are created in it. A snapshot is the set that leads from the empty
// scene (sequence 0) to a state. Sealed sets are immutable: any thread may read them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/core/node_type.h>
#include <rtsg/core/value.h>

namespace rtsg {

/// 128-bit state hash: a sum modulo 2^128 of one term per node, non-default field, name and route.
struct Hash128 {
    std::uint64_t low = 0, high = 0;
    friend bool operator==(const Hash128&, const Hash128&) = default;
    std::string hex() const;
};

/// The kinds of changes. The numbers are part of the wire format.
enum class ChangeKind : std::uint8_t {
    defineType = 0,   // index: TypeIndex; the type is in ChangeSet::types
    createNode = 1,   // node; index: TypeIndex; other: scope (the PROTO instance or Inline it belongs to, or none)
    setField = 2,     // node, field, value
    insertChild = 3,  // node, field (MFNode), other: child, index: position before which it goes
    removeChild = 4,  // node, field (MFNode), other: child, index: its position
    setName = 5,      // node, value: SFString, empty to clear
    addRoute = 6,     // node.field -> other.field2
    removeRoute = 7,  // same
    destroyNode = 8,  // node; every reference to it was removed by the changes before
    event = 9,        // node, field, value: an input event from outside; changes no state by itself
};

struct Change {
    NodeId node;
    FieldIndex field = kNoField;
    ChangeKind kind = ChangeKind::setField;
    /// True when the application caused it, false when the cascade did.
    bool external : 1 = true;
    /// Routes only: an IS connection between a PROTO instance and its body.
    bool isConnection : 1 = false;
    NodeId other;
    std::uint32_t index = 0;
    Value value;

    FieldIndex field2() const { return static_cast<FieldIndex>(index); }
    friend bool operator==(const Change&, const Change&) = default;
};
static_assert(sizeof(Change) == 40);

struct DefinedType {
    TypeIndex index;
    std::shared_ptr<const NodeType> type;
};

/// One event that a field sent.
struct FieldEvent {
    NodeId node;
    FieldIndex field = kNoField;
    Value value;
};

/// Names the author of a change from outside. `field` is that of the change; it is kNoField if the node itself, its
/// name or its routes changed.
struct Authored {
    NodeId node;
    FieldIndex field = kNoField;
    String author;
    friend bool operator==(const Authored&, const Authored&) = default;
};

struct FrameInput;

struct ChangeSet {
    /// The set leads from state `from` to `to`. A frame leads to from + 1, a snapshot starts at 0, and a replica's
    /// repair leads from a state to itself.
    std::uint64_t from = 0, to = 0;
    double time = 0;  // of the last frame in the set, in seconds
    Hash128 hash;     // of the state `to`
    std::vector<Change> changes;
    std::vector<DefinedType> types;
    /// The inputs of the frame, if the scene records them (frame_input.h); a merged set has none.
    std::shared_ptr<const FrameInput> input;
    /// The authors that Scene::attribute() named, at most one for each field; null if the application made all changes
    /// itself. Authors are no part of the state.
    std::shared_ptr<const std::vector<Authored>> authors;
    /// The events that fields named by Scene::listenTo() sent in this frame, in order; null if there were none. Only
    /// subscribers of the scene that ran the frame get them: they are neither merged nor sent to others.
    std::shared_ptr<const std::vector<FieldEvent>> heard;

    bool isSnapshot() const { return from == 0; }
    void clear();
};

/// New values of one field for several nodes, side by side as they lie in memory.
struct PlainColumn {
    FieldIndex field = kNoField;
    FieldType type = FieldType::SFBool;  // of at most 16 bytes, without shared data and not SFNode
    std::size_t count = 0;
    const std::byte* values = nullptr;  // of any alignment
};

}  // namespace rtsg
