// Spherical harmonics of a direction, in the order and the scale of AmbiX.
#include <algorithm>
#include <array>
#include <cmath>

#include "ambisonics.h"

namespace rtsg {

void ambisonicGains(int order, const glm::dvec3& direction, std::span<double> gains) {
    order = std::clamp(order, 0, kMaxAmbisonicOrder);
    const double z = std::clamp(direction.z, -1.0, 1.0), r = std::sqrt(std::max(0.0, 1 - z * z));
    const double azimuth = std::atan2(direction.y, direction.x);
    // Associated Legendre functions without the Condon-Shortley phase, by the standard recursions.
    std::array<std::array<double, kMaxAmbisonicOrder + 1>, kMaxAmbisonicOrder + 1> p{};
    p[0][0] = 1;
    for (std::size_t l = 1; l <= static_cast<std::size_t>(order); ++l) {
        const double n = static_cast<double>(l);
        p[l][l] = (2 * n - 1) * r * p[l - 1][l - 1];
        p[l][l - 1] = (2 * n - 1) * z * p[l - 1][l - 1];
        for (std::size_t m = 0; m + 2 <= l; ++m) {
            const double k = static_cast<double>(m);
            p[l][m] = ((2 * n - 1) * z * p[l - 1][m] - (n + k - 1) * p[l - 2][m]) / (n - k);
        }
    }
    for (int l = 0; l <= order; ++l)
        for (int m = -l; m <= l; ++m) {
            const int k = std::abs(m);
            double norm = m == 0 ? 1 : 2;
            for (int f = l - k + 1; f <= l + k; ++f) norm /= f;
            const double angle = m >= 0 ? std::cos(m * azimuth) : std::sin(k * azimuth);
            const int channel = l * l + l + m;  // ACN
            gains[static_cast<std::size_t>(channel)] =
                std::sqrt(norm) * p[static_cast<std::size_t>(l)][static_cast<std::size_t>(k)] * angle;
        }
}

}  // namespace rtsg
