// Finds the encoding of a document from its first bytes.
//
// Threading: pure functions.
#pragma once

#include <string>
#include <string_view>

#include "text/utf8.h"

namespace rtsg::detail {

std::string_view withoutBom(std::string_view text);
/// XML may declare another encoding than UTF-8, which expat then converts.
bool isOtherXmlEncoding(std::string_view head);

}  // namespace rtsg::detail
