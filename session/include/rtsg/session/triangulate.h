// Triangulate: a filter of documents that turns geometry into triangles: boxes, spheres, faces, grids, extrusions,
// NURBS, text.
//
// Each geometry node becomes an IndexedTriangleSet with normals, texture coordinates and colours. Left as they are:
// nodes that a ROUTE moves, that are connected with a PROTO's interface, or whose coordinates others use; and lines and
// points. The document is in memory until it ends.
// Threading: one thread a stream.
#pragma once

#include <memory>

#include <rtsg/documents/filter.h>
#include <rtsg/renderers/tessellate.h>

namespace rtsg {

/// Both references must outlive the filter.
Result<std::unique_ptr<DocumentHandler>> makeTriangulate(DocumentHandler& next, Diagnostics& diagnostics,
                                                         const TessellationOptions& options = {});

}  // namespace rtsg
