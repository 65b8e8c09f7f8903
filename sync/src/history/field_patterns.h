// FieldPatterns: which fields of a scene "DOOR.rotation", "DOOR.*", "*.rotation" and "#12.translation" name.
//
// A * stands for any letters. Nodes inside of Inlines and PROTO instances have the names of these in front: HALL/DOOR.
// Threading: none of its own.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

/// With the names of the scopes around it in front; empty: it, or one of them, has none.
std::string scopedName(const Scene& scene, NodeId id);

class FieldPatterns {
  public:
    /// Errors: a pattern that is no NODE.field.
    static Result<FieldPatterns> make(const std::vector<std::string>& patterns);
    bool empty() const { return patterns_.empty(); }

    /// The patterns that name a node, as numbers one after the other.
    struct Match {
        std::size_t pattern = 0;
        std::string name;  // of the node, as that pattern has it
    };
    std::vector<Match> matches(const Scene& scene, NodeId node) const;
    /// Whether that pattern names a field of this name; notes that it does.
    bool matches(std::size_t pattern, std::string_view field);
    /// The first pattern that has named no field yet; empty: there is none.
    std::string matchedNothing() const;

  private:
    struct Pattern {
        std::string node, field;
        bool matched = false;
    };
    std::vector<Pattern> patterns_;
};

}  // namespace rtsg
