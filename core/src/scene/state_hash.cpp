// Computes single terms of the state hash from canonical bytes.
#include "plain_term.h"

#include <rtsg/core/never_destroyed.h>

namespace rtsg::detail {

std::vector<FieldKey> fieldKeys(const NodeType& type) {
    std::vector<FieldKey> keys;
    keys.reserve(type.fields.size());
    for (const FieldDef& field : type.fields) keys.push_back(fieldKey(field));
    return keys;
}

const FieldKey* builtinFieldKeys(TypeIndex type) {
    static const auto& all = neverDestroyed([] {
        std::vector<std::vector<FieldKey>> created;
        for (const auto& builtin : builtinTypes()) created.push_back(fieldKeys(*builtin));
        return created;
    });
    return all[type.value].data();
}

[[gnu::flatten]] Hash128 childTerm(NodeId node, FieldKey field, NodeId before, NodeId after) {
    const std::uint32_t pair[2] = {before.value, after.value};
    return hashOfSize<sizeof(pair)>(pair, hashSeed(node, field, HashTerm::children));
}

Hash128 fieldTerm(NodeId node, FieldKey field, FieldType type, const void* storage) {
    if (type != FieldType::MFNode) return hashOfValue(type, storage, hashSeed(node, field, HashTerm::field));
    StateHash sum;
    NodeId before;
    const ArrayHeader* header = nullptr;
    std::memcpy(&header, storage, sizeof(header));
    const std::uint64_t size = header ? header->size : 0;
    const auto* children = reinterpret_cast<const NodeId*>(header + 1);
    for (std::uint64_t k = 0; k < size; ++k) {
        sum.add(childTerm(node, field, before, children[k]));
        before = children[k];
    }
    if (size) sum.add(childTerm(node, field, before, {}));
    return sum.value();
}

[[gnu::flatten]] Hash128 nodeTerm(NodeId node, std::uint64_t nameHash, NodeId scope) {
    const std::uint64_t parts[2] = {nameHash, scope.value};
    return hashOfSize<sizeof(parts)>(parts, hashSeed(node, 0, HashTerm::node));
}

Hash128 nameTerm(NodeId node, std::string_view name) {
    return hashOfBytes(name.data(), name.size(), hashSeed(node, 0, HashTerm::name));
}

[[gnu::flatten]] Hash128 routeTerm(NodeId from, FieldKey fromField, NodeId to, FieldKey toField, bool isConnection) {
    const std::uint64_t parts[2] = {toField, to.value | (isConnection ? std::uint64_t{1} << 32 : 0)};
    return hashOfSize<sizeof(parts)>(parts, hashSeed(from, fromField, HashTerm::route));
}

}  // namespace rtsg::detail

namespace rtsg {

std::string Hash128::hex() const {
    constexpr char digits[] = "0123456789abcdef";
    std::string text(32, '0');
    for (int i = 0; i < 16; ++i) {
        text[static_cast<std::size_t>(15 - i)] = digits[high >> (4 * i) & 15];
        text[static_cast<std::size_t>(31 - i)] = digits[low >> (4 * i) & 15];
    }
    return text;
}

}  // namespace rtsg
