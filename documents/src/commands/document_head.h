// Keeps a document's statements about itself in the scene, in hidden fields of the root and of Inlines.
//
// Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 7.2.5.
#pragma once

#include <rtsg/core/scene.h>
#include <rtsg/documents/document_handler.h>

namespace rtsg {

/// Hidden fields that carry document information, found by name in RtsgScene and Inline.
inline FieldIndex hiddenField(const NodeType& type, std::string_view name) {
    const FieldIndex index = type.findExact(name);
    return index != kNoField && type.fields[index].hidden ? index : kNoField;
}

/// Precondition: a field of our own making, which takes the value.
inline void setHidden(Scene& scene, NodeId node, FieldIndex field, Value value) {
    const Result<> set = scene.setField(node, field, std::move(value));
    RTSG_CHECK_EQ(set ? std::string() : set.error().text, std::string());
}

/// The head of all documents that were loaded: the profile of the first one, and everything else from each.
DocumentHead headOf(const Scene& scene);
void appendHead(Scene& scene, const DocumentHead& head);

}  // namespace rtsg
