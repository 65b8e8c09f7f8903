// The arrival times of sound at the ears of a sphere. Threading: pure functions.
#pragma once

#include <algorithm>
#include <cmath>

namespace rtsg {

/// The delay of an ear (0: left) relative to the middle of the head, seconds, for a direction so far to the right (its
/// sine): the near ear is earlier by r sin a, the far one later by r a. Source: Woodworth, Experimental Psychology
/// (1938).
inline double sphereEarDelay(double right, int ear, double radius, double speedOfSound) {
    const double towards = ear == 0 ? -right : right, angle = std::asin(std::clamp(towards, -1.0, 1.0));
    return -(towards > 0 ? towards : angle) * radius / speedOfSound;
}

}  // namespace rtsg
