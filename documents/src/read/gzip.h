// Recognises gzip by the first bytes of a file. TextFeed unpacks it.
#pragma once

#include <string_view>

namespace rtsg::detail {

inline bool isGzip(std::string_view bytes) {
    return bytes.size() >= 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b';
}

}  // namespace rtsg::detail
