// Versions of the standard as numbers, and the nodes of each, by the node tables.
#include "versions.h"

#include <rtsg/core/node_type.h>

namespace rtsg::detail {

int versionNumber(std::string_view version) {
    const auto digit = [&](std::size_t i) { return i < version.size() && version[i] >= '0' && version[i] <= '9'; };
    if (!digit(0)) return kNewestVersion;
    return (version[0] - '0') * 10 + (version.size() > 2 && version[1] == '.' && digit(2) ? version[2] - '0' : 0);
}

std::string versionText(int version) {
    return std::to_string(version / 10) + '.' + std::to_string(version % 10);
}

bool isInVersion(std::string_view node, std::string_view version) {
    const NodeType* type = findBuiltinType(node);
    return !type || type->since <= versionNumber(version);
}

}  // namespace rtsg::detail
