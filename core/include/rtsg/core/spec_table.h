// The static form of node tables, which spec_compiler writes, and functions that make NodeTypes of them.
//
// Invariant: everything here points to constant data of the program; fields are shared between nodes.
// Threading: free functions, no state.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include <rtsg/core/node_type.h>

namespace rtsg {

struct SpecField {
    std::string_view name;
    /// Numbers and TRUE/FALSE separated by one space; strings each followed by a newline; empty for nodes.
    std::string_view defaultText;
    std::string_view allowed;  // strings, each followed by a newline
    std::string_view accepts;  // type names separated by '|'
    double min, max;
    FieldType type;
    Access access;
    Aspect aspect;
    bool exclusiveMin, exclusiveMax, hidden;
    Unit unit;
    std::uint8_t since;       // as NodeType::since; 0: that of the node
    std::string_view custom;  // for SFCustom and MFCustom: "Quantity float64 2"; else empty
};

/// The tags of a node type, which NodeType has under the same names.
struct SpecTags {
    Acts acts;
    bool writesInputs;
    std::string_view role;
    std::string_view below;  // names of fields, separated by '|'
};

struct SpecNode {
    std::string_view name, component, containerField;
    std::string_view implements;           // separated by '|'
    std::uint16_t firstField, fieldCount;  // into SpecTable::fieldLists
    std::uint8_t level;
    bool internal;       // not creatable from files
    std::uint8_t since;  // as NodeType::since
    SpecTags tags;
};

struct SpecAbstract {
    std::string_view name;
    SpecTags tags;  // its own and its ancestors'
};

struct SpecTable {
    std::span<const SpecField> fields;
    std::span<const std::uint16_t> fieldLists;
    std::span<const SpecNode> nodes;
    std::span<const SpecAbstract> abstracts;   // sorted by name
    std::span<const std::string_view> groups;  // types, abstract or not, whose own tag has `below`
};

/// The standard's nodes and our own internal ones; generated.
const SpecTable& builtinSpecTable();

/// Null if there is none of that name.
const SpecAbstract* findAbstract(std::string_view name);

/// Registers the type that SpecField::custom describes. Errors: another type has its name.
Result<std::shared_ptr<const CustomType>> fieldTypeOf(std::string_view custom);

/// Makes one finished NodeType for each node of the table, in its order, and registers the field types of the table.
/// Throws std::logic_error if two have the same name.
std::vector<std::unique_ptr<NodeType>> makeNodeTypes(const SpecTable& table, NodeType::Kind kind);

}  // namespace rtsg
