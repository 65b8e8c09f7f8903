// Near the boundary by a table of the integral, in the dark by the waves that creep along the surface, in the light by
// what mirrors.
#include "diffraction_surface_waves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "edges/gauss_rule.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kSurfacePi = std::numbers::pi;
constexpr Complex kSurfaceI(0, 1);
/// Above kDark a few creeping waves are enough, and below kLight the reflected wave is enough. Both are chosen so that
/// table, waves and asymptotic series agree to 3e-5.
constexpr double kDark = 2, kLight = -3;

/// The slopes of Airy's functions at x from 0 to 10 by their series.
struct AirySlopes {
    explicit AirySlopes(double x) {
        // Ai(0) and -Ai'(0): Abramowitz and Stegun, 10.4.
        constexpr double kAi = 0.355028053887817239, kSlope = 0.258819403792806798;
        double f = 0, g = 1, fTerm = 1, gTerm = x;
        for (int k = 1; k < 80; ++k) {
            fTerm *= x * x * x / ((3.0 * k - 1) * (3.0 * k));
            gTerm *= x * x * x / ((3.0 * k) * (3.0 * k + 1));
            f += fTerm * 3 * k / x;
            g += gTerm * (3.0 * k + 1) / x;
        }
        ai = kAi * f - kSlope * g;
        bi = std::numbers::sqrt3 * (kAi * f + kSlope * g);
    }
    double ai, bi;
};

/// The integral from kLight to kDark: by cubics between places of a table, less than 3e-5 off. Each is a sum over
/// places along the real axis to the right, and from exp(-2 i pi / 3) infinity to 0, where what does not die away has
/// been taken off: there W2 is of Ai at exp(2 i pi / 3) times the length, and V + W2 / (2 i) is W1 / (2 i).
class SurfaceTable {
  public:
    SurfaceTable() {
        constexpr double kRight = 6, kLeft = 9;
        constexpr std::size_t kNodes = 20;  // less than 5e-5 off
        const Complex down = std::polar(1.0, -2 * kSurfacePi / 3);
        const GaussRule<kNodes> rule;
        for (std::size_t n = 0; n < kNodes; ++n) {
            const AirySlopes right(kRight * rule.positions[n]), left(kLeft * rule.positions[n]);
            add(kRight * rule.positions[n], kRight * rule.weights[n] * right.ai / Complex(right.bi, -right.ai));
            const Complex top = std::polar(1.0, kSurfacePi / 6) / (kSurfaceI * down) * left.ai;
            const Complex bottom = std::polar(1.0, kSurfacePi * (1.0 / 6 - 4.0 / 3)) * Complex(left.ai, -left.bi);
            add(kLeft * rule.positions[n] * down, -down * kLeft * rule.weights[n] * top / bottom);
        }
    }

    Complex at(double xi) const {
        // Lagrange's cubic through four places next to each other.
        const double position = (xi - kLight) / kStep;
        const std::size_t first = std::min(static_cast<std::size_t>(std::max(0.0, position - 1)), kSteps - 3);
        const double a = position - double(first), b = a - 1, c = a - 2, d = a - 3;
        return -b * c * d / 6 * terms_[first] + a * c * d / 2 * terms_[first + 1] - a * b * d / 2 * terms_[first + 2] +
               a * b * c / 6 * terms_[first + 3];
    }

  private:
    static constexpr std::size_t kSteps = 140;
    static constexpr double kStep = (kDark - kLight) / kSteps;

    void add(const Complex& position, const Complex& fraction) {
        for (std::size_t i = 0; i <= kSteps; ++i)
            terms_[i] +=
                fraction / std::sqrt(kSurfacePi) * std::exp(-kSurfaceI * (kLight + kStep * double(i)) * position);
    }

    std::array<Complex, kSteps + 1> terms_{};
};

/// The sum over waves that creep: where W' is 0.
Complex creeping(double xi) {
    /// Zeros of Ai' and Ai there, without their signs: Abramowitz and Stegun, table 10.13.
    constexpr std::array<std::array<double, 2>, 6> kWaves{{{1.0187929716, 0.5356566560},
                                                           {3.2481975822, 0.4190154780},
                                                           {4.8200992112, 0.3804064686},
                                                           {6.1633073556, 0.3579079437},
                                                           {7.3721772551, 0.3423012444},
                                                           {8.4884867340, 0.3304762291}}};
    const Complex phase = std::polar(1.0, kSurfacePi / 3);
    Complex sum = 0;
    for (const auto& [zero, airy] : kWaves) {
        const Complex position = zero / phase;
        sum += std::exp(-kSurfaceI * xi * position) * phase / (4 * kSurfacePi * airy * airy * position);
    }
    return 2.0 * kSurfaceI * std::sqrt(kSurfacePi) * sum;
}

}  // namespace

Complex surfaceFunction(double xi) {
    static const SurfaceTable table;
    const double pole = 0.5 / (std::sqrt(kSurfacePi) * xi);
    if (xi > kDark) return creeping(xi) + pole;
    if (xi > kLight) return table.at(xi);
    // The asymptotic series.
    const double cube = xi * xi * xi;
    return -0.5 * std::sqrt(-xi) * std::polar(1.0, cube / 12 + kSurfacePi / 4) *
               (1.0 - 2.0 * kSurfaceI / cube - 20 / (cube * cube)) +
           pole;
}

}  // namespace rtsg
