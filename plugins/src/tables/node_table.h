// The standard's node tables as texts, for tables that inherit from them. A generated file defines them.
#pragma once

#include <span>
#include <string_view>

namespace rtsg::detail {

struct TableText {
    std::string_view name, text;
};
std::span<const TableText> standardTables();

}  // namespace rtsg::detail
