// The terms whose sum is a state hash. Each term is the XXH3-128 of canonical bytes, with a seed that says what the
// bytes belong to. A Scene keeps its own hash; these functions are for programs that compute the hash of a scene that
// they do not hold. Partial hashes are the sums of terms by node, computed from a scene's present values.
//
// Invariant: a term depends on names, node numbers and values, never on positions in a table of types, and a field at
// its default has no term. So types may gain fields, and tables may gain types, without changing recorded hashes.
// Source: sync/PROTOCOL.md, "State hash". Threading: free functions without shared state; those that read
// a scene run on its thread, or on any thread while it does not change.
#pragma once

#include <string_view>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/core/node_type.h>
#include <rtsg/core/scene.h>

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

/// Adds modulo 2^128.
inline Hash128 operator+(Hash128 a, Hash128 b) {
    const std::uint64_t low = a.low + b.low;
    return {low, a.high + b.high + (low < a.low ? 1 : 0)};
}

/// The share of one node in the state hash, in parts. A part without a term, such as a field at its default, is 0.
struct NodeHashes {
    Hash128 node, name, routes;   // existence, type and scope; DEF name; routes and IS connections from it
    std::vector<Hash128> fields;  // one each, in the type's order
};

/// From the present values: memory that was changed behind the scene's back shows as a difference, since the running
/// hash does not see it. Two scenes that differ are compared by the sums of ranges of nodes, so the place is found in a
/// logarithmic number of steps.
NodeHashes hashesOf(const Scene& scene, const Node& node);
/// The sum of the parts. The sum over all nodes of a sealed scene is Scene::hash().
Hash128 hashOfNode(const Scene& scene, const Node& node);

}  // namespace rtsg
