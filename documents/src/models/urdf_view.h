// Where to look at a robot from: a Viewpoint that has all of it in view.
//
// Meshes are not opened for it: how large they are is guessed by how far apart the joints are. Threading: pure
// functions.
#pragma once

#include <rtsg/documents/document_handler.h>

#include "urdf_model.h"

namespace rtsg::detail {

/// Writes the Viewpoint, from the robot's front and side and from above.
void writeViewpoint(DocumentHandler& out, const UrdfModel& model);

}  // namespace rtsg::detail
