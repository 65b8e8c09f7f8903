// Messages for misspelled names of node types and fields in documents.
#include "suggestion.h"

#include <array>

#include <fmt/format.h>

namespace rtsg::detail {

std::string unknownType(std::string_view type, const Diagnostics& diagnostics) {
    if (diagnostics.dropped()) return {};
    std::vector<std::string_view> known;
    for (const auto& one : builtinTypes())
        if (!one->internal) known.push_back(one->name);
    return "unknown node type " + std::string(type.substr(0, 80)) + didYouMean(type, known) +
           "; it is kept, and does nothing";
}

std::string noField(const NodeShape& shape, std::string_view field, const Diagnostics& diagnostics) {
    if (diagnostics.dropped()) return {};
    std::vector<std::string_view> known;
    if (shape.type)
        for (const FieldDef& one : shape.type->fields)
            if (!one.hidden) known.push_back(one.name);
    if (shape.own)
        for (const FieldDeclaration& one : shape.own->all()) known.push_back(one.name);
    if (shape.proto)
        for (const FieldDeclaration& one : shape.proto->fields.all()) known.push_back(one.name);
    return std::string(shape.name()) + " has no field '" + std::string(field.substr(0, 80)) + "'" +
           didYouMean(field, known);
}

std::string droppedField(const NodeShape& shape, std::string_view field) {
    struct Dropped {
        std::string_view node, field, last;
    };
    constexpr std::array<Dropped, 3> kDropped = {{
        {"GeoViewpoint", "headlight", "3.2"},
        {"GeoViewpoint", "navType", "3.2"},
        {"SurfaceEmitter", "coordIndex", "3.3"},
    }};
    for (const Dropped& one : kDropped)
        if (shape.type && shape.type->name == one.node && field == one.field)
            return fmt::format("{}.{} is a field up to X3D {} only: it is left out", one.node, one.field, one.last);
    return {};
}

}  // namespace rtsg::detail
