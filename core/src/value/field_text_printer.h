// What printing values shares with the writers.
//
// Threading: none of its own.
#pragma once

#include <string>

#include <rtsg/core/field_text.h>

namespace rtsg::detail {

/// Appends one element of an MF value (nothing else), as appendFieldText would.
void appendArrayElement(std::string& out, const Value& array, std::size_t index, TextSyntax syntax);

}  // namespace rtsg::detail
