// Guesses what somebody who misspelled a name meant.
//
// Threading: pure functions. Source: edit distance with transpositions (Damerau 1964); a third of the letters may
// differ, two at most in short words.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/node_type.h>

namespace rtsg::detail {

/// The nearest of `known`, or another form of the word, or another word for the same thing; empty if there is none.
/// Case alone counts as nothing.
std::string_view nearest(std::string_view word, const std::vector<std::string_view>& known);

/// " (did you mean Transform?)", or nothing.
std::string didYouMean(std::string_view word, const std::vector<std::string_view>& known);

/// "Transform has no field 'translaton' (did you mean translation?)".
std::string noField(const NodeType& type, std::string_view described, std::string_view field);

}  // namespace rtsg::detail
