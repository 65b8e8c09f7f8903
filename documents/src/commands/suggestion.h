// Messages of readers and the builder for misspelled names of types and fields. Where `diagnostics` only count on, they
// are empty, since a search for the name that is meant takes longer than all the rest of a node.
//
// Threading: pure functions.
#pragma once

#include <string>
#include <string_view>

#include "reader_types.h"
#include "value/nearest_name.h"

namespace rtsg::detail {

/// The message about an unknown type, which the readers and the builder share.
std::string unknownType(std::string_view type, const Diagnostics& diagnostics);
/// "Transform has no field 'translaton' (did you mean translation?)".
std::string noField(const NodeShape& shape, std::string_view field, const Diagnostics& diagnostics);
/// The message about a field that earlier versions of X3D had, and that is left out; empty if none had it.
std::string droppedField(const NodeShape& shape, std::string_view field);
/// The message of noField() if the field was given nodes.
inline std::string noFieldForNodes(const NodeShape& shape, std::string_view field, const Diagnostics& diagnostics) {
    return noField(shape, field, diagnostics) + "; what is in it is kept under its name";
}
/// Whether an unknown field is likely to be an author's error. It is not if it holds a node of an unknown type, which
/// may belong to an extension; nor if it is `children`, where writers put nodes that fit nowhere.
inline bool isMisspelled(std::string_view field, bool nodeIsKnown) {
    return nodeIsKnown && field != "children";
}
/// The message about a name that is none by the grammar; `fault`: faultOfDef().
inline std::string badDef(std::string_view def, const std::string& fault) {
    return "DEF '" + std::string(def.substr(0, 80)) + "' " + fault +
           ", which no name may have; ROUTE and USE find it so";
}

}  // namespace rtsg::detail
