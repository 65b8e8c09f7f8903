// What readers and the builder say of misspelled names of types and fields.
//
// Threading: pure functions.
#pragma once

#include <string>
#include <string_view>

#include "reader_types.h"
#include "value/nearest_name.h"

namespace rtsg::detail {

/// What is said of a type that nobody knows; the readers and the builder say the same.
std::string unknownType(std::string_view type);
/// "Transform has no field 'translaton' (did you mean translation?)".
std::string noField(const NodeShape& shape, std::string_view field);
/// What is said of a field that versions of X3D before had, and that is left out; empty where none had it.
std::string droppedField(const NodeShape& shape, std::string_view field);
/// The same where the field was given nodes.
inline std::string noFieldForNodes(const NodeShape& shape, std::string_view field) {
    return noField(shape, field) + "; what is in it is kept under its name";
}

}  // namespace rtsg::detail
