// Mobility: the fields of a scene that can change without edits by the application. They follow from routes, IS
// connections, nodes that act (sensors, followers, interpolators), Scripts and whatever moves the joints of a humanoid.
//
// In doubt a field "may change". Invariant: after each set the answers are those of a fresh analysis of the scene.
// Cost: O(nodes + routes) for a snapshot; for a set O(its changes + the fields whose answer changes, times the routes
// of their nodes), and O(nodes) when a Script with direct output comes or goes; memory only for fields that events can
// reach. Threading: the scene's thread (attach it as immediate, or call apply). Source: RTSG paper 4.1, 5.1 (which
// fields may change); ISO/IEC 19775-1 V4.0 4.4.8.2, 29.2.5 (directOutput). A Script without direct output may change
// what its node fields refer to: this is stricter than the paper, since authors forget directOutput.
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

    /// Whether the field may change; for an inputOnly field, whether an event can arrive. Precondition: `node` is of
    /// the scene that was applied last.
    bool mayChange(const Node& node, FieldIndex field) const;
    /// The aspects of the fields of `node` that may change; inputOnly fields are not counted.
    AspectMask mayChange(const Node& node) const;

    /// The nodes whose answers may differ from those after the set before, in order; nodes destroyed since are
    /// included.
    std::span<const NodeId> changedNodes() const;
    /// The scopes whose nodes (and those of Inlines in them) have come under the control of a Script with direct
    /// output, or left it; no node stands for the document itself.
    std::span<const NodeId> changedScopes() const;

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "mobility"; }

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
