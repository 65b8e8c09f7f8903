// Partial hashes: the terms of the state hash by node and by field, computed from the present values.
//
// Invariant: the sum of hashOfNode() over all nodes of a sealed scene is Scene::hash(). Memory that was changed behind
// the scene's back shows as a difference, since the running hash does not see it. Two scenes that differ are compared
// by the sums of ranges of nodes, so the place is found in a logarithmic number of steps. Threading: the scene's
// thread, or any thread while the scene does not change.
#pragma once

#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

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

NodeHashes hashesOf(const Scene& scene, const Node& node);
/// The sum of the parts.
Hash128 hashOfNode(const Scene& scene, const Node& node);

}  // namespace rtsg
