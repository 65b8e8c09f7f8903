// Which node types a version of the standard has: for names that a file of an earlier version may give to its own
// prototypes, and for what an earlier version cannot hold. Versions between 3.0 and 3.3 are not told apart.
//
// Threading: constant data. Source: ISO/IEC 14772-1:1997 clause 6 (VRML97); ISO/IEC 19775-1 V3.3 and V4.0 annex Z.
#pragma once

#include <string_view>

namespace rtsg::detail {

/// Does a built-in type of that name exist in documents of `version` ("2.0" is VRML97)? `node` is one of ours.
bool isInVersion(std::string_view node, std::string_view version);

}  // namespace rtsg::detail
