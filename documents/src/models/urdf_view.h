// Makes a Viewpoint that has all of a robot in view.
//
// It does not open meshes; their size is estimated from the distances of the joints. Threading: pure functions.
#pragma once

#include <rtsg/documents/document_handler.h>

#include "urdf_model.h"

namespace rtsg::detail {

/// Writes the Viewpoint, from the robot's front and side and from above.
void writeViewpoint(DocumentHandler& out, const UrdfModel& model);

}  // namespace rtsg::detail
