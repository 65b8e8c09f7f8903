// Division: which nodes that events reach have nothing to do with each other, so that their cascades may run at the
// same time.
//
// Nodes that routes connect are one component, but for a node that sends and is reached by nothing: what hangs behind a
// sensor's fan-out is as many components as it is connected by nothing else. Components are dealt out to parts of about
// the same number of routes, in the order of their first routes. Threading: one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg {

class Division {
  public:
    /// The values of partOf() for nodes that are in no part, and for nodes that send to several.
    static constexpr std::uint8_t kNone = 255, kSeveral = 254;
    static constexpr unsigned kMaxParts = 128;
    struct Edge {
        NodeId from, to;
    };

    /// Divides anew. `edges` are all that lead on from the sources, those of the sources in their order. False if most
    /// of the work would be in one part: then nothing can be gained, and no node is in any part.
    bool divide(std::span<const NodeId> sources, std::span<const Edge> edges, unsigned parts);
    std::uint8_t partOf(NodeId id) const { return id.value < parts_.size() ? parts_[id.value] : kNone; }
    void clear() { parts_.clear(); }

  private:
    std::uint32_t& indexOf(NodeId id) { return index_[id.value]; }
    std::uint32_t findRoot(std::uint32_t i);
    void unite(std::span<const Edge> edges);
    /// Gives every component a part; returns the routes in the largest one.
    std::size_t deal(std::span<const Edge> edges, unsigned parts);
    void name(std::span<const NodeId> sources, std::span<const Edge> edges);

    std::vector<std::uint8_t> parts_;  // by NodeId
    // While dividing, by NodeId and by what it says there.
    std::vector<std::uint32_t> index_, root_, weight_;
    std::vector<std::uint8_t> reached_, partOfRoot_;
};

}  // namespace rtsg
