// A colour scale from low to high values whose lightness grows throughout, so that it works in grey prints, too.
//
// Threading: pure functions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include <fmt/format.h>

namespace rtsg {

/// Red, green, blue from 0 to 255, as displays have them.
using HeatColor = std::array<double, 3>;

/// `share`: from 0, dark blue, to 1, yellow.
inline HeatColor heatColor(double fraction) {
    constexpr HeatColor kStops[] = {{24, 22, 74}, {44, 75, 142}, {33, 132, 148}, {86, 183, 116}, {250, 226, 72}};
    const double at = 4 * std::clamp(fraction, 0.0, 1.0);
    const auto i = static_cast<std::size_t>(std::min(3.0, at));
    const double w = at - static_cast<double>(i);
    HeatColor color;
    for (std::size_t c = 0; c < 3; ++c) color[c] = kStops[i][c] * (1 - w) + kStops[i + 1][c] * w;
    return color;
}

inline std::string cssColor(const HeatColor& color) {
    return fmt::format("#{:02x}{:02x}{:02x}", static_cast<int>(std::lround(color[0])),
                       static_cast<int>(std::lround(color[1])), static_cast<int>(std::lround(color[2])));
}

/// A step of 1, 2 or 5 times a power of ten of which `length` has about `count`.
inline double niceStep(double length, double count) {
    const double rough = length / count, power = std::pow(10.0, std::floor(std::log10(rough))), lead = rough / power;
    return power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
}

}  // namespace rtsg
