// Says what of a scene is not in a mesh file of it.
//
// Threading: the scene's thread.
#pragma once

#include "shown_shapes.h"

namespace rtsg::mesh_files {

/// One warning names what no mesh file has, or, if `isGlb`, what a GLB has not.
void reportLeftOut(const Scene& scene, const Shapes& shapes, bool isGlb, Diagnostics& diagnostics);

}  // namespace rtsg::mesh_files
