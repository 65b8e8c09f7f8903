// NodeLocks: which nodes are reserved for whom, and for how long.
//
// Invariant: a lock ends by itself unless its holder renews it. It covers the node's own fields, events to them, its
// name, its routes and its destruction, but not the nodes below it.
// Threading: the scene's thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>

#include <rtsg/core/scene.h>

#include "transport/clock.h"

namespace rtsg::mirror {

class NodeLocks {
  public:
    static constexpr std::size_t kMax = 1 << 16;  // for all authors together

    explicit NodeLocks(const Clock& clock = steadyClock()) : clock_(&clock) {}
    Clock::time_point now() const { return clock_->now(); }
    /// Locks all the nodes or none. A lease of 0 releases them. Errors: a node is locked by somebody else; too many
    /// locks.
    Result<> lock(const Scene& scene, std::string_view author, std::span<const NodeId> nodes,
                  std::chrono::milliseconds lease, Clock::time_point now);
    /// Why `author` may not touch the node now. Empty if they may.
    std::string refusal(const Scene& scene, NodeId node, std::string_view author, Clock::time_point now) const;
    /// The same for all nodes that the change concerns: both ends of a route, a node that loses its name to another,
    /// and nodes that refer to a destroyed one.
    std::string refusal(const Scene& scene, const Change& change, std::string_view author, Clock::time_point now) const;
    bool empty() const { return locks_.empty(); }

  private:
    struct Lock {
        std::string author;
        Clock::time_point until;
    };
    const Clock* clock_;
    std::unordered_map<std::uint32_t, Lock> locks_;
};

}  // namespace rtsg::mirror
