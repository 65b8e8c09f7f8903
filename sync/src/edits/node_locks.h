// NodeLocks: which nodes are kept for whom, and for how long.
//
// Invariant: a lock ends by itself; who holds it may ask anew. It covers the node's own fields, events to them, its
// name, its routes and its end, not the nodes below it. Threading: the scene's thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>

#include <rtsg/core/scene.h>

namespace rtsg::mirror {

class NodeLocks {
  public:
    using Clock = std::chrono::steady_clock;
    static constexpr std::size_t kMost = 1 << 16;  // of all authors

    /// All of them or none. A lease of 0 lets go. Errors: a node is kept for somebody else; there are too many.
    Result<> lock(const Scene& scene, std::string_view author, std::span<const NodeId> nodes,
                  std::chrono::milliseconds lease, Clock::time_point now);
    /// Why `author` may not touch the node now; empty if they may.
    std::string refusal(const Scene& scene, NodeId node, std::string_view author, Clock::time_point now) const;
    /// The same of all nodes that the change is about: both ends of a route, who loses a name to another node, and what
    /// refers to one that ends.
    std::string refusal(const Scene& scene, const Change& change, std::string_view author, Clock::time_point now) const;
    bool empty() const { return locks_.empty(); }

  private:
    struct Lock {
        std::string author;
        Clock::time_point until;
    };
    std::unordered_map<std::uint32_t, Lock> locks_;
};

}  // namespace rtsg::mirror
