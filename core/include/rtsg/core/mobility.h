// Mobility: which fields of a scene can change without the application's doing, from routes, IS connections, nodes
// that act (sensors, followers, interpolators), Scripts and what moves the joints of a humanoid.
//
// It errs towards "may change"; an application's own edits are not foreseen. Invariant: after each set the answers are
// those of a fresh analysis of the scene. Cost: a snapshot, O(nodes + routes); a set, O(its changes + the fields whose
// answer changes, times the routes of their nodes), and once O(nodes) when a Script with direct output comes or goes;
// memory, only for fields that events can reach. Threading: the scene's thread (attach it as immediate, or call apply).
// Source: RTSG paper 4.1, 5.1 (which fields may change); ISO/IEC 19775-1 V4.0 4.4.8.2, 29.2.5 (directOutput). A Script
// without direct output may change what its node fields refer to: stricter than the paper asks, as authors forget it.
#pragma once

#include <memory>
#include <span>

#include <rtsg/core/bus.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// A set of aspects, one bit each.
using AspectMask = std::uint16_t;
constexpr AspectMask aspectBit(Aspect aspect) {
    return static_cast<AspectMask>(1u << static_cast<unsigned>(aspect));
}

class Mobility final : public Subscriber {
  public:
    Mobility();
    ~Mobility() override;

    /// For an inputOnly field: whether an event can arrive. Precondition: `node` is of the scene last applied.
    bool mayChange(const Node& node, FieldIndex field) const;
    /// The aspects of all fields of `node` with storage that may change.
    AspectMask mayChange(const Node& node) const;

    /// Nodes whose answers may differ since the set before, in order; also ones destroyed since.
    std::span<const NodeId> changedNodes() const;
    /// Scopes all of whose nodes (and those of Inlines in them) have come under or left the hands of a Script with
    /// direct output; none stands for the document's own.
    std::span<const NodeId> changedScopes() const;

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "mobility"; }

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
