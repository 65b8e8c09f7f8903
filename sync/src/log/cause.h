// What a frame changed, and which routes led there.
//
// Invariant: nothing but what the sets say: a cause is named only where the field it comes from changed in the same
// state, or where a node that acts over time was set off in an earlier one. Threading: that of the scene.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

class FrameTouches {
  public:
    void add(const ChangeSet& set);
    /// For the next frame. What was remembered stays.
    void clear() {
        places_.clear();
        authors_.clear();
    }
    /// Something that came from outside the scene is in it.
    bool isFromOutside() const {
        return std::ranges::any_of(places_, [](const auto& place) { return place.second; });
    }
    bool has(NodeId node, FieldIndex field) const { return places_.contains(key(node, field)); }
    /// The whole cause of what somebody set by itself.
    static constexpr std::string_view kSetFromOutside = "set from outside";
    struct Cause {
        /// "ROUTE A.x > B.y, B.z > C.w"; "set from outside" or "from a pointer" with what followed from it, and with
        /// "in state 7" where it set off something that goes on since; empty if nothing is known.
        std::string text;
        /// Who asked for what began it (ChangeSet::authors); empty if it was the application itself, or nobody.
        std::string author;
        /// The field has its value because its node appeared in this state, or was set together with that.
        bool appeared = false;
        bool fromOutside = false;
    };
    Cause cause(const Scene& scene, NodeId node, FieldIndex field) const;
    /// Of nodes on the way to this one that act over time (TimeSensor, followers): what set them off in this frame, for
    /// the causes of later ones.
    void rememberStarts(const Scene& scene, NodeId node);
    /// The numbers of nodes mean others from here on.
    void forget() { starts_.clear(); }

  private:
    static std::uint64_t key(NodeId node, FieldIndex field) { return std::uint64_t{node.value} << 32 | field; }
    /// By the application or whoever asked it, in this state.
    bool isMade(NodeId node) const;
    bool anyFromOutside(const Scene& scene, NodeId node) const;
    FieldIndex deviceFor(const Scene& scene, const NodeType& type) const;
    std::string routeInto(const Scene& scene, NodeId& node, FieldIndex& field, bool anyField,
                          std::vector<std::uint64_t>& way) const;

    std::string authorOf(NodeId node, FieldIndex field) const;

    std::unordered_map<std::uint64_t, bool> places_;  // whether it came from outside; kNoField: that the node was made
    std::vector<Authored> authors_;
    struct Start {
        std::uint64_t state = 0;
        std::string text, author;
    };
    std::unordered_map<std::uint32_t, Start> starts_;  // by node
};

}  // namespace rtsg
