// What somebody who misspelled a name may have meant.
//
// Threading: pure functions. Source: edit distance with transpositions (Damerau 1964), of which a third of the letters
// may differ, two at most for short words.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "reader_types.h"

namespace rtsg::detail {

/// The nearest of `known`; empty if none is near. Case alone counts as nothing.
std::string_view nearest(std::string_view word, const std::vector<std::string_view>& known);

/// " (did you mean Transform?)", or nothing.
std::string didYouMean(std::string_view word, const std::vector<std::string_view>& known);

/// What is said of a type that nobody knows; the readers and the builder say the same.
std::string unknownType(std::string_view type);
/// "Transform has no field 'translaton' (did you mean translation?)".
std::string noField(const NodeShape& shape, std::string_view field);
/// What is said of a field that versions of X3D before had, and that is left out; empty where none had it.
std::string droppedField(const NodeShape& shape, std::string_view field);
std::string noField(const NodeType& type, std::string_view described, std::string_view field);
/// The same where the field was given nodes.
inline std::string noFieldForNodes(const NodeShape& shape, std::string_view field) {
    return noField(shape, field) + "; what is in it is kept under its name";
}

}  // namespace rtsg::detail
