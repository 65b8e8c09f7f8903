// SDF files of Gazebo as robots: the links, joints and shapes of their models, in the terms of UrdfModel.
//
// In SDF every pose is in the frame that it names, or in the model's; here each link's frame is that of the joint that
// ends in it, as in URDF. What hangs on no joint is fixed to a link of the world's, or the model's, name.
// Threading: one thread a file. Source: the SDFormat specification 1.11 (sdformat.org), "Pose frame semantics".
#pragma once

#include <string_view>

#include "urdf_model.h"

namespace rtsg::detail {

/// False, and reported, if there is no model in it.
bool readSdf(std::string_view text, UrdfModel& model, Diagnostics& diagnostics);

}  // namespace rtsg::detail
