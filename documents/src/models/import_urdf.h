// URDF files, which describe robots, as X3D.
//
// Links are Transforms of their names, and joints are Transforms or instances of small prototypes of theirs, each in
// the link where it begins. A robot's z axis points up: a Transform of the robot's name turns it to X3D's y axis.
// Threading: pure functions. Source: the URDF XML specification of ROS (wiki.ros.org/urdf/XML).
#pragma once

#include "import/import.h"

namespace rtsg::detail {

/// Gives a whole document; false if there is no robot in the file.
bool importUrdf(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics);
/// The same of an SDF file (sdf_model.h).
bool importSdf(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics);

}  // namespace rtsg::detail
