// What a click at a place of the picture would do: the sensors and Anchors there, and what they say about themselves.
//
// Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 9.4.1, 20.2.1 (the innermost group with sensors counts).
#pragma once

#include <string>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

struct Pointed {
    bool reacts = false;      // something does
    NodeId anchor;            // that a click would follow; none: there is no Anchor
    std::string description;  // of all that react, one a line; may be empty
    friend bool operator==(const Pointed&, const Pointed&) = default;
};
/// `path` leads from a root node to the Shape that is there.
Pointed pointedAt(const Scene& scene, const std::vector<NodeId>& path);

}  // namespace rtsg
