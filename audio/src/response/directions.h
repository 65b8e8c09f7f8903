// Random directions of rays: uniform over the sphere, and by Lambert's law.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "signal/random.h"

namespace rtsg::trace {

/// Even on the sphere; `u`, `v`: in [0, 1).
inline glm::dvec3 directionFrom(double u, double v) {
    const double z = 1 - 2 * u, r = std::sqrt(std::max(0.0, 1 - z * z)), phi = 2 * std::numbers::pi * v;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

/// Lambert-distributed about a unit normal: an even place on the unit disc, raised to the sphere.
inline glm::dvec3 cosineDirection(const glm::dvec3& normal, Random& random) {
    double x = 0, y = 0, r2 = 1;
    do {
        x = 2 * random.uniform() - 1;
        y = 2 * random.uniform() - 1;
        r2 = x * x + y * y;
    } while (r2 >= 1);
    // Axes beside the normal without a root; Duff et al., JCGT 6 (1), 2017.
    const double sign = std::copysign(1.0, normal.z), a = -1 / (sign + normal.z), b = normal.x * normal.y * a;
    const glm::dvec3 tangent(1 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    const glm::dvec3 bitangent(b, sign + normal.y * normal.y * a, -normal.y);
    return x * tangent + y * bitangent + std::sqrt(1 - r2) * normal;
}

/// The same as cosineDirection() for sixteen rays side by side. `across` and `round` are two numbers in [0, 1) for
/// each.
inline void cosineDirections(const AcousticRays::Vectors& normal, const double (&across)[AcousticRays::kMax],
                             const double (&round)[AcousticRays::kMax], AcousticRays::Vectors& direction) {
    for (int i = 0; i < AcousticRays::kMax; ++i) {
        // Sine of half the angle by its series, to 1e-13 up to a right angle. Sine and cosine of the whole angle are
        // computed from it, so that they always belong to one angle, which is accurate to 1e-6.
        constexpr double kPi = std::numbers::pi;
        const double half = kPi * (round[i] - 0.5), h2 = half * half;
        constexpr double k3 = 1.0 / 6, k5 = k3 / 20, k7 = k5 / 42, k9 = k7 / 72, k11 = k9 / 110, k13 = k11 / 156,
                         k15 = k13 / 210, k17 = k15 / 272;
        const double h4 = h2 * h2, h8 = h4 * h4;
        const double sine = half * (((1 - h2 * k3) + h4 * (k5 - h2 * k7)) +
                                    h8 * (((k9 - h2 * k11) + h4 * (k13 - h2 * k15)) + h8 * k17));
        const double rest = 1 - sine * sine, cosine = std::sqrt(rest > 0 ? rest : 0);
        const double r = std::sqrt(across[i]);
        const double x = r * (1 - 2 * sine * sine), y = r * 2 * sine * cosine, up = std::sqrt(1 - across[i]);
        const double nx = normal.x[i], ny = normal.y[i], nz = normal.z[i];
        const double sign = nz < 0 ? -1.0 : 1.0, a = -1 / (sign + nz), b = nx * ny * a;
        direction.x[i] = x * (1 + sign * nx * nx * a) + y * b + up * nx;
        direction.y[i] = x * (sign * b) + y * (sign + ny * ny * a) + up * ny;
        direction.z[i] = x * (-sign * nx) - y * ny + up * nz;
    }
}

}  // namespace rtsg::trace
