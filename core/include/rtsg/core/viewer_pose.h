// ViewerPose: where a viewer is, and where it looks.
//
// Threading: values.
#pragma once

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

/// From where, and which way: along -Z of `orientation`, a unit quaternion, with +Y up.
struct ViewerPose {
    Vec3d position{0};
    glm::dquat orientation{1, 0, 0, 0};
    friend bool operator==(const ViewerPose&, const ViewerPose&) = default;
};

}  // namespace rtsg
