// UTF-8 validation: finding bytes that are no UTF-8, and replacing them.
//
// Threading: pure functions, one of which has others help it. Source: RFC 3629 (no overlong forms, no surrogates,
// nothing above U+10FFFF).
#pragma once

#include <string>
#include <string_view>

#include "splitting.h"

namespace rtsg::detail {

/// Offset of the first byte that does not belong to a valid sequence, or is zero (no text has that); npos if none is.
std::size_t findInvalidUtf8(std::string_view text, std::size_t from = 0);
/// The same of all the text, if it is long by several threads.
std::size_t findInvalidUtf8(std::string_view text, const Splitting& splitting);
/// A copy with U+FFFD for every invalid byte; `count` is their number.
std::string replaceInvalidUtf8(std::string_view text, std::size_t& count);

}  // namespace rtsg::detail
