// InlineGeometry: the part of a document that is kept when it was read for its geometry.
//
// Threading: the scene's thread. Source: ISO/IEC CD 19775-1 V4.1 9.4 (InlineGeometry). The choice of the first geometry
// in document order, and the effect of `smooth`, are those of X_ITE.
#pragma once

#include <span>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

/// The nodes at and below `roots` that belong to the document which `holder` has loaded: not those that it merely
/// refers to (a node handed to a PROTO from outside). Linear.
std::vector<NodeId> ownContent(const Scene& scene, NodeId holder, std::span<const NodeId> roots);

/// Keeps only the first geometry, with everything below it, of the document that was loaded into the InlineGeometry
/// `holder`, and destroys the rest. Returns false, with everything destroyed, if there is no geometry.
bool keepGeometry(Scene& scene, NodeId holder, std::string_view url, Diagnostics& diagnostics, SourceLocation where);

/// Gives `solid` and `smooth` on to the geometry that was loaded. Whether that changed anything.
bool applyGeometryHints(Scene& scene, const Node& holder);

}  // namespace rtsg
