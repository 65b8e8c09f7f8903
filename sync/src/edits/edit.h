// Edits: makes single changes, and applies them to a scene by its public edits.
// Threading: the scene's thread, between frames.
#pragma once

#include <string_view>
#include <utility>

#include <rtsg/core/scene.h>

namespace rtsg::mirror {

inline Change changeOf(ChangeKind kind, NodeId node, FieldIndex field = kNoField, Value value = {}) {
    Change change;
    change.kind = kind;
    change.node = node;
    change.field = field;
    change.value = std::move(value);
    return change;
}

/// Applies somebody else's change and attributes it to the author (Scene::attribute()). Errors: the scene's; a child
/// that is not there; a new node, an event or a type, which are no edits of existing things.
Result<> edit(Scene& scene, const Change& change, std::string_view author);

}  // namespace rtsg::mirror
