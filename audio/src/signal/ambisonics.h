// Ambisonics: the sound field around the listener as spherical harmonics, which the player rotates and decodes.
//
// AmbiX: channels in ACN order, SN3D normalisation, axes x ahead, y left, z up. Channel 0 is the pressure at the
// listener. Source: Nachbar, Zotter, Deleflie, Sontacchi 2011, "AmbiX - a suggested Ambisonics format". Threading: pure
// functions.
#pragma once

#include <span>

#include <glm/glm.hpp>

namespace rtsg {

constexpr int kMaxAmbisonicOrder = 7;

constexpr int ambisonicChannels(int order) {
    return (order + 1) * (order + 1);
}
/// Degree l of a channel; each degree has 2 l + 1 channels.
constexpr int ambisonicDegree(int channel) {
    int degree = 0;
    while (ambisonicChannels(degree) <= channel) ++degree;
    return degree;
}
/// Fills ambisonicChannels(order) gains for a plane wave from a unit direction (AmbiX axes); 0 <= order <= 7.
void ambisonicGains(int order, const glm::dvec3& direction, std::span<double> gains);
/// Converts from X3D's listener frame (x right, y up, z back).
inline glm::dvec3 ambisonicAxes(const glm::dvec3& listener) {
    return {-listener.z, -listener.x, listener.y};
}

}  // namespace rtsg
