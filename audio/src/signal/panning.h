// Panning: how a sound is divided between two channels according to its direction.
//
// The energy of both channels together is the same for every direction; sound from ahead, above or behind has 1 in
// each. The far channel keeps a twentieth of the energy, so that nothing is hard left or right. Inside an audio graph
// the panning of the Web Audio API is used. Threading: pure functions. Source: W3C Web Audio API 1.1, PannerNode.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <glm/glm.hpp>

namespace rtsg {

/// Amplitudes of left and right for a unit direction in the listener's frame (x right, y up, z back).
inline std::array<double, 2> stereoGains(const glm::dvec3& direction) {
    const double right = 0.9 * std::clamp(direction.x, -1.0, 1.0);
    return {std::sqrt(1 - right), std::sqrt(1 + right)};
}

/// Amplitudes of left and right (rows) for each channel of a sound (columns; mono uses the first) by the "equalpower"
/// panning of the Web Audio API. The direction is in the listener's frame and may have any length.
inline std::array<std::array<double, 2>, 2> equalPowerGains(const glm::dvec3& direction, bool stereo) {
    constexpr double kQuarter = std::numbers::pi / 2;
    // The angle to the right in the plane of the ears; sound from behind is treated like sound from ahead.
    double azimuth = std::atan2(direction.x, -direction.z);
    if (azimuth > kQuarter) azimuth = 2 * kQuarter - azimuth;
    if (azimuth < -kQuarter) azimuth = -2 * kQuarter - azimuth;
    if (!stereo) {
        const double x = (azimuth + kQuarter) / 2;
        return {{{std::cos(x), 0}, {std::sin(x), 0}}};
    }
    if (azimuth <= 0) return {{{1, std::cos(azimuth + kQuarter)}, {0, std::sin(azimuth + kQuarter)}}};
    return {{{std::cos(azimuth), 0}, {std::sin(azimuth), 1}}};
}

}  // namespace rtsg
