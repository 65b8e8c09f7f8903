// Panning: which share of a sound two channels get by the direction that it comes from.
//
// Both channels together carry the same energy whatever the direction, 1 each from ahead, above and behind; the far one
// keeps a twentieth of all, so that nothing is hard left or right. Threading: pure functions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/glm.hpp>

namespace rtsg {

/// Amplitudes of left and right for a unit direction in the listener's frame (x right, y up, z back).
inline std::array<double, 2> stereoGains(const glm::dvec3& direction) {
    const double right = 0.9 * std::clamp(direction.x, -1.0, 1.0);
    return {std::sqrt(1 - right), std::sqrt(1 + right)};
}

}  // namespace rtsg
