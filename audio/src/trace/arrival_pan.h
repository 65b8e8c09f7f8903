// How much of an arrival each channel of a response has, and how much later. Threading: pure function.
#pragma once

#include <rtsg/audio/impulse_response.h>

namespace rtsg {

struct ArrivalPan {
    double gain = 1;
    double delay = 0;  // s
};

/// `direction`: unit, world frame, from the listener.
ArrivalPan panOf(const glm::dvec3& direction, int channel, const ImpulseResponseOptions& options);

}  // namespace rtsg
