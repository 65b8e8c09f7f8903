// InlineGeometry: what stays of a document that was read for the sake of a geometry.
//
// Threading: the scene's thread. Source: ISO/IEC CD 19775-1 V4.1 9.4 (InlineGeometry); the choice of the first geometry
// in the order of the document, and what `smooth` sets, as X_ITE has them.
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
