// The gain and delay of an arrival in each channel of a response. Threading: pure functions.
#pragma once

#include <rtsg/audio/impulse_response.h>

namespace rtsg {

struct ArrivalPan {
    double gain = 1;
    double delay = 0;  // s
};

/// The delay and the gain of an ear (0: left) of a sphere, relative to the middle of the head, for sound from a
/// direction so far to the right (its sine).
ArrivalPan panOfEar(double right, int ear, double radius, double speedOfSound);

/// x right, y up, z back, as a head has it; of a direction in the world frame.
inline glm::dvec3 inListenersFrame(const glm::dvec3& direction, const ImpulseResponseOptions& options) {
    return {glm::dot(direction, options.listenerRight), glm::dot(direction, options.listenerUp),
            glm::dot(direction, options.listenerBack)};
}

/// `direction`: unit, world frame, from the listener.
ArrivalPan panOf(const glm::dvec3& direction, int channel, const ImpulseResponseOptions& options);

}  // namespace rtsg
