// Gzip by content: unpacking into memory, with a bound.
//
// Invariant: what could be decoded before an error is kept. Memory is bounded by `limit`, whatever the packed bytes
// claim. Threading: pure functions.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

bool isGzip(std::string_view bytes);

/// Appends the unpacked bytes of all members to `out`. Damage, truncation and reaching the limit are reported; false
/// if nothing at all came out.
bool gunzip(std::string_view packed, std::string& out, Diagnostics& diagnostics, std::size_t limit);

}  // namespace rtsg::detail
