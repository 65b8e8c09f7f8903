// Gives each name once, and makes equal ones different.
#include "imported_names.h"

#include <algorithm>

#include "text/utf8.h"

namespace rtsg::detail {

std::string UniqueNames::take(std::string_view wanted, std::string_view kind) {
    if (wanted.empty()) return {};
    std::size_t replaced = 0;
    std::string name = replaceInvalidUtf8(wanted, replaced);
    // XML cannot hold control characters, not even escaped.
    std::ranges::replace_if(name, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }, '_');
    if (taken_.try_emplace(name, 1).second) return name;
    if (!kind.empty()) {
        name.append("_").append(kind);
        if (taken_.try_emplace(name, 1).second) return name;
    }
    // The number goes on from the last one, so that a thousand equal names do not take a million looks.
    std::size_t& last = taken_[name];
    for (;;) {
        std::string numbered = name + "_" + std::to_string(++last);
        if (!taken_.contains(numbered)) {
            taken_.emplace(numbered, 1);
            return numbered;
        }
    }
}

}  // namespace rtsg::detail
