// The terms whose sum is a state hash. Each term is the XXH3-128 of canonical bytes, with a seed that says what the
// bytes belong to. A Scene keeps its own hash; these functions are for programs that compute the hash of a scene that
// they do not hold.
//
// Invariant: a term depends on names, node numbers and values, never on positions in a table of types, and a field at
// its default has no term. So types may gain fields, and tables may gain types, without changing recorded hashes.
// Source: sync/PROTOCOL.md, "State hash". Threading: free functions without shared state.
#pragma once

#include <string_view>

#include <rtsg/core/change.h>
#include <rtsg/core/node_type.h>

namespace rtsg {

/// What a term stands for; it is part of the seed.
enum class HashTerm : std::uint8_t { node = 1, field = 2, children = 3, name = 4, route = 5 };

/// The name of a field as a number; 0 in terms that belong to no field.
using FieldKey = std::uint64_t;
FieldKey fieldKey(const FieldDef& field);

/// The node's number spread over all 64 bits. XXH3 adds the seed to short inputs, so small numbers in the seed could be
/// cancelled by small numbers in the bytes.
inline std::uint64_t hashSeed(NodeId node, FieldKey field, HashTerm term) {
    return field + static_cast<std::uint64_t>(term) + node.value * 0x9E3779B97F4A7C15ull;
}

std::uint64_t hashOfText(std::string_view text);
Hash128 hashOfBytes(const void* bytes, std::size_t size, std::uint64_t seed);
/// The hash of a value in block representation. MFNode values have terms for pairs of neighbours instead.
Hash128 hashOfValue(FieldType type, const void* storage, std::uint64_t seed);

}  // namespace rtsg
