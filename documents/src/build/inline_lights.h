// Preserves the scope of lights in Inlines when the Inlines become Groups.
//
// Invariant: after keepInlineLights() each light illuminates the same shapes as before, or a warning names the Inline.
// Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 9.4.2 (`global` of an Inline), 17.2.1 (of a light).
#pragma once

#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>

namespace rtsg::detail {

/// For a document whose Inlines are about to become Groups. A light whose reach ends at its Inline becomes local
/// (`global` FALSE) if the group that it is in holds all that is lit in the Inline, and stays as it is if there is
/// nothing lit elsewhere. `places`: of the document's own Inlines, in their order.
void keepInlineLights(Scene& scene, const std::vector<SourceLocation>& locations, Diagnostics& diagnostics);

}  // namespace rtsg::detail
