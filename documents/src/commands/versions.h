// The node types of each version of the standard: for files of an earlier version, whose prototypes may have names of
// later types, and for writing an earlier version.
//
// Threading: constant data. Source: the node tables' @since, after ISO/IEC 14772-1:1997 clause 6 (VRML97) and the
// object models of X3D 3.0 to 4.1.
#pragma once

#include <string>
#include <string_view>

namespace rtsg::detail {

constexpr int kNewestVersion = 41;

/// Ten times the version, as NodeType::since has it: 20 for "2.0". The newest where the text is no version.
int versionNumber(std::string_view version);

/// "4.1" for 41.
std::string versionText(int version);

/// Does a built-in type of that name exist in documents of `version` ("2.0" is VRML97)? `node` is one of ours.
bool isInVersion(std::string_view node, std::string_view version);

}  // namespace rtsg::detail
