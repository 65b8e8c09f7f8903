// Directions spread evenly over the sphere: a spiral of the golden angle, in bands of equal area.
#pragma once

#include <cmath>

#include <glm/glm.hpp>

namespace rtsg {

/// Direction i of `count`.
inline glm::dvec3 evenDirection(int i, int count) {
    constexpr double kGolden = 2.39996322972865332;
    const double z = 1 - (2.0 * i + 1) / count, r = std::sqrt(1 - z * z);
    return {r * std::cos(i * kGolden), r * std::sin(i * kGolden), z};
}

}  // namespace rtsg
