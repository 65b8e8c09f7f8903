// Finds the encoding of a text from its beginning.
#include "reader_utf8.h"

#include <algorithm>
#include <cctype>

namespace rtsg::detail {

std::string_view withoutBom(std::string_view text) {
    constexpr std::string_view bom = "\xEF\xBB\xBF";
    return text.starts_with(bom) ? text.substr(bom.size()) : text;
}

bool isOtherXmlEncoding(std::string_view head) {
    if (head.starts_with("\xFE\xFF") || head.starts_with("\xFF\xFE")) return true;
    head = withoutBom(head);
    if (!head.starts_with("<?xml")) return false;
    std::string declaration(head.substr(0, std::min(head.find("?>"), std::size_t{200})));
    std::ranges::transform(declaration, declaration.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    const std::size_t encoding = declaration.find("encoding");
    return encoding != declaration.npos && declaration.find("utf-8", encoding) == declaration.npos;
}

}  // namespace rtsg::detail
