// Fades from one sound to another. Threading: pure function.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtsg {

/// From 0 to 1 with two continuous derivatives, so that a fading tone has no audible side bands.
inline float fadeIn(double fraction) {
    const double x = std::clamp(fraction, 0.0, 1.0);
    return static_cast<float>(x - std::sin(2 * std::numbers::pi * x) / (2 * std::numbers::pi));
}

}  // namespace rtsg
