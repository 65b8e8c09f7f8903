// FrameTouches: the fields that a frame changed, and the routes that led to them.
//
// Invariant: it tells only what the sets say. A cause is named only if its field changed in the same state, or if a
// node that acts over time was set off in an earlier one.
// Threading: that of the scene.
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
    /// Prepares for the next frame, and keeps what rememberStarts() noted.
    void clear() {
        fields_.clear();
        authors_.clear();
    }
    /// True if something in the frame came from outside the scene.
    bool isFromOutside() const {
        return std::ranges::any_of(fields_, [](const auto& entry) { return entry.second; });
    }
    bool has(NodeId node, FieldIndex field) const { return fields_.contains(key(node, field)); }
    /// The cause if somebody set the field directly.
    static constexpr std::string_view kSetFromOutside = "set from outside";
    struct Cause {
        /// "ROUTE A.x > B.y, B.z > C.w"; or "set from outside" or "from a pointer", then what followed from it. "in
        /// state 7" is added where that state set off something that still goes on. Empty if nothing is known.
        std::string text;
        /// Who asked for the first change (ChangeSet::authors). Empty if the application made it, or nobody did.
        std::string author;
        /// True if the node appeared in this state, or somebody set the field together with that.
        bool appeared = false;
        bool fromOutside = false;
    };
    Cause cause(const Scene& scene, NodeId node, FieldIndex field) const;
    /// Notes which nodes that act over time (TimeSensor, followers) lead to this node and what set them off in this
    /// frame. The causes of later frames need it.
    void rememberStarts(const Scene& scene, NodeId node);
    /// Forgets the noted starts, because node numbers have another meaning from here on.
    void forget() { starts_.clear(); }

  private:
    static std::uint64_t key(NodeId node, FieldIndex field) { return std::uint64_t{node.value} << 32 | field; }
    /// True if the application, or whoever asked it, made the node in this state.
    bool isCreated(NodeId node) const;
    bool anyFromOutside(const Scene& scene, NodeId node) const;
    FieldIndex deviceFor(const Scene& scene, const NodeType& type) const;
    std::string routeInto(const Scene& scene, NodeId& node, FieldIndex& field, bool anyField,
                          std::vector<std::uint64_t>& path) const;

    std::string authorOf(NodeId node, FieldIndex field) const;

    std::unordered_map<std::uint64_t, bool> fields_;  // value: it came from outside; with kNoField: the node was made
    std::vector<Authored> authors_;
    struct Start {
        std::uint64_t state = 0;
        std::string text, author;
    };
    std::unordered_map<std::uint32_t, Start> starts_;  // by node number
};

}  // namespace rtsg
