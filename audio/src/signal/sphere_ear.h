// When the ears of a sphere hear. Threading: pure functions.
#pragma once

#include <algorithm>
#include <cmath>

namespace rtsg {

/// Of an ear (0: left), for a direction so far to the right (its sine): how much later than the middle of the head it
/// hears what comes from there, seconds. The near ear earlier by r sin a, the far one later by r a. Source: Woodworth,
/// Experimental Psychology (1938).
inline double sphereEarDelay(double right, int ear, double radius, double speedOfSound) {
    const double towards = ear == 0 ? -right : right, angle = std::asin(std::clamp(towards, -1.0, 1.0));
    return -(towards > 0 ? towards : angle) * radius / speedOfSound;
}

}  // namespace rtsg
