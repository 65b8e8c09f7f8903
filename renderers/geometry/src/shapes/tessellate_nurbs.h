// The geometry nodes of the NURBS component as meshes, cut as finely as their error asks for.
#pragma once

#include "tessellate_detail.h"

namespace rtsg {

class Node;

namespace detail {

bool isNurbs(const Node& geometry);

/// NurbsCurve, NurbsPatchSurface, NurbsTrimmedSurface, NurbsSweptSurface, NurbsSwungSurface (27.4). If the tessellation
/// fields are 0, chords leave the surface by at most chordError times half the diagonal of the box around the control
/// points. Diagnostics go into the mesh.
Mesh tessellateNurbs(const Scene& scene, const Node& geometry, const TessellationOptions& options);

}  // namespace detail

}  // namespace rtsg
