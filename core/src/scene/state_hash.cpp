// Computes single terms of the state hash from canonical bytes.
#include "plain_term.h"

namespace rtsg::detail {

namespace {

Hash128 hashBytes(const void* bytes, std::size_t size, std::uint64_t seedValue) {
    const XXH128_hash_t hash = XXH3_128bits_withSeed(bytes, size, seedValue);
    return {hash.low64, hash.high64};
}

const ArrayHeader* headerAt(const void* storage) {
    const ArrayHeader* header = nullptr;
    std::memcpy(&header, storage, sizeof(header));
    return header;
}

}  // namespace

Hash128 childTerm(NodeId node, FieldIndex field, NodeId before, NodeId after) {
    const std::uint32_t pair[2] = {before.value, after.value};
    return hashBytes(pair, sizeof(pair), termSeed(node, field, HashTerm::children));
}

Hash128 fieldTerm(NodeId node, FieldIndex field, FieldType type, const void* storage) {
    const std::uint64_t s = termSeed(node, field, HashTerm::field);
    const FieldTypeInfo& i = info(type);
    if (!i.shared) return hashBytes(storage, i.size, s);
    const ArrayHeader* header = headerAt(storage);
    const std::uint64_t size = header ? header->size : 0;
    if (type == FieldType::MFNode) {
        StateHash sum;
        NodeId before;
        const auto* children = reinterpret_cast<const NodeId*>(header + 1);
        for (std::uint64_t k = 0; k < size; ++k) {
            sum.add(childTerm(node, field, before, children[k]));
            before = children[k];
        }
        if (size) sum.add(childTerm(node, field, before, {}));
        return sum.value();
    }
    if (type == FieldType::MFString || type == FieldType::MFImage) {
        // Elements are pointers: hash each element's length and bytes in turn.
        XXH3_state_t state;
        XXH3_INITSTATE(&state);
        XXH3_128bits_reset_withSeed(&state, s);
        const auto* elements = reinterpret_cast<const ArrayHeader* const*>(header + 1);
        for (std::uint64_t k = 0; k < size; ++k) {
            const std::uint64_t bytes = elements[k] ? elements[k]->size * elements[k]->elementSize : 0;
            XXH3_128bits_update(&state, &bytes, sizeof(bytes));
            if (bytes) XXH3_128bits_update(&state, elements[k] + 1, bytes);
        }
        const XXH128_hash_t hash = XXH3_128bits_digest(&state);
        return {hash.low64, hash.high64};
    }
    return hashBytes(header + 1, header ? size * header->elementSize : 0, s);
}

Hash128 nodeTerm(NodeId node, std::uint64_t nameHash, NodeId scope) {
    const std::uint64_t parts[2] = {nameHash, scope.value};
    return hashBytes(parts, sizeof(parts), termSeed(node, kNoField, HashTerm::node));
}

Hash128 nameTerm(NodeId node, std::string_view name) {
    return hashBytes(name.data(), name.size(), termSeed(node, kNoField, HashTerm::name));
}

Hash128 routeTerm(NodeId from, FieldIndex fromField, NodeId to, FieldIndex toField, bool isConnection) {
    const std::uint32_t parts[2] = {to.value, std::uint32_t{toField} | (isConnection ? 0x10000u : 0u)};
    return hashBytes(parts, sizeof(parts), termSeed(from, fromField, HashTerm::route));
}

std::uint64_t typeNameHash(std::string_view name) {
    return XXH3_64bits(name.data(), name.size());
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
