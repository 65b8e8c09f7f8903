// Finds faults of a document that no single value shows: nodes beyond its profile, indices beyond their points, keys
// without values, nodes that may not stand at the top, scripts that cannot be parsed.
//
// Threading: one thread a stream. Source: ISO/IEC 19775-1 V4.0, 7.2.5 (head), annexes A to H (profiles), 11.2, 19.2.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>

namespace rtsg::detail {

/// Which nodes a document may use: those of its profile and of the components it names.
class ProfileCheck {
  public:
    /// An empty profile, as VRML97 has none, lets everything pass.
    void profile(std::string_view name, SourceLocation where, Diagnostics& diagnostics);
    void component(std::string_view name, int level, SourceLocation where, Diagnostics& diagnostics);
    /// Each component that is missing is named once.
    void node(const NodeType& type, SourceLocation where, Diagnostics& diagnostics);

  private:
    struct Support {
        std::string component;
        int level;
    };
    std::string profile_;
    bool everything_ = true;
    std::vector<Support> supported_;
    std::vector<std::string> reported_;
};

/// Why a node of this type cannot stand at the top of a document, and where it belongs; empty if it can.
std::string notAtTheTop(const NodeType& type);

}  // namespace rtsg::detail
