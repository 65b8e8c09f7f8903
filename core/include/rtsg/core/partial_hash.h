// Partial hashes: the terms of the state hash by node and by field, computed from what is stored now.
//
// Invariant: the sum of hashOfNode() over all nodes of a sealed scene is Scene::hash(), unless memory was changed
// behind the scene's back: then this sees it, as the running hash cannot. Two scenes that differ are compared by the
// sums of ranges of nodes, so that the place is found in a logarithmic number of steps. Threading: the scene's thread,
// or any while it stands still.
#pragma once

#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

/// Modulo 2^128.
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
/// The sum of all of these.
Hash128 hashOfNode(const Scene& scene, const Node& node);

}  // namespace rtsg
