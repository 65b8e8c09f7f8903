// What readers and the builder say of misspelled names of types and fields.
//
// Threading: pure functions.
#pragma once

#include <string>
#include <string_view>

#include "reader_types.h"
#include "value/nearest_name.h"

namespace rtsg::detail {

/// The message about an unknown type, which the readers and the builder share.
std::string unknownType(std::string_view type);
/// "Transform has no field 'translaton' (did you mean translation?)".
std::string noField(const NodeShape& shape, std::string_view field);
/// The message about a field that earlier versions of X3D had, and that is left out; empty if none had it.
std::string droppedField(const NodeShape& shape, std::string_view field);
/// The same where the field was given nodes.
inline std::string noFieldForNodes(const NodeShape& shape, std::string_view field) {
    return noField(shape, field) + "; what is in it is kept under its name";
}

}  // namespace rtsg::detail
