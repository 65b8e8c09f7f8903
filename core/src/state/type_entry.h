// TypeEntry: what a scene keeps of a node type, so that no name is looked up while it runs.
//
// Threading: the scene's thread.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <rtsg/core/behaviour.h>

#include "scene/state_hash.h"

namespace rtsg {

struct TypeEntry {
    const NodeType* type = nullptr;
    Behaviour behaviour;
    std::uint64_t nameHash = 0;
    const FieldKey* keys = nullptr;  // of its fields; in `ownKeys` for a type of the scene's own
    std::vector<FieldKey> ownKeys;
    FieldIndex children = kNoField, addChildren = kNoField, removeChildren = kNoField;
    /// Inputs that stand for an initializeOnly field (set_coordIndex for coordIndex), and that field.
    std::vector<std::pair<FieldIndex, FieldIndex>> inputs;
    bool takesInputs = false;  // of these, or addChildren or removeChildren
    bool isScript = false;
    bool isInstance = false;  // of a PROTO
    /// The fields of an interpolator, for showFirst().
    FieldIndex key = kNoField, keyValue = kNoField, interpolated = kNoField, begun = kNoField;
    bool keepsLists = false;  // what its behaviour remembers is in arrays
};

}  // namespace rtsg
