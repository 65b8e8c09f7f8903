// What a frame changed, and which routes led there.
//
// Invariant: nothing but what the sets say: a cause is named only where the field it comes from changed in the same
// state. Threading: that of the scene.
#pragma once

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
    void clear() {
        places_.clear();
        authors_.clear();
    }
    bool has(NodeId node, FieldIndex field) const { return places_.contains(key(node, field)); }
    /// The whole cause of what somebody set by itself.
    static constexpr std::string_view kSetFromOutside = "set from outside";
    struct Cause {
        /// "ROUTE A.x > B.y, B.z > C.w", or "set from outside" with what followed from it; empty if nothing is known.
        std::string text;
        /// Who asked for what began it (ChangeSet::authors); empty if it was the application itself, or nobody.
        std::string author;
        /// The field has its value because its node appeared in this state, or was set together with that.
        bool appeared = false;
    };
    Cause cause(const Scene& scene, NodeId node, FieldIndex field) const;

  private:
    static std::uint64_t key(NodeId node, FieldIndex field) { return std::uint64_t{node.value} << 32 | field; }
    /// By the application or whoever asked it, in this state.
    bool isMade(NodeId node) const;
    bool anyFromOutside(const Scene& scene, NodeId node) const;
    std::string routeInto(const Scene& scene, NodeId& node, FieldIndex& field, bool anyField,
                          std::vector<std::uint64_t>& way) const;

    std::string authorOf(NodeId node, FieldIndex field) const;

    std::unordered_map<std::uint64_t, bool> places_;  // whether it came from outside; kNoField: that the node was made
    std::vector<Authored> authors_;
};

}  // namespace rtsg
