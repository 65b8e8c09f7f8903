// The result of a pick sensor in a frame, as the value of an event of the scene's root, so that it is recorded and
// mirrored like events of devices.
//
// Source: ISO/IEC 19775-1 V4.0, clause 38.
#pragma once

#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// A place where a pick sensor meets a surface. A PointPickSensor fills in the point alone; sensors of primitives and
/// volumes have none.
struct PickedSurface {
    Vec3f point{0}, normal{0}, texCoord{0};  // in the sensor's coordinates
};

struct PickReport {
    NodeId sensor;
    std::vector<NodeId> geometry;         // none: nothing is picked
    std::vector<PickedSurface> surfaces;  // of the first of `geometry`, then of the next

    /// The sensor's number, how many nodes and their numbers, nine numbers for each surface.
    Array<double> toValue() const;
    /// Error: not what toValue() makes; a number that is not finite.
    static Result<PickReport> fromValue(const Array<double>& value);
};

}  // namespace rtsg
