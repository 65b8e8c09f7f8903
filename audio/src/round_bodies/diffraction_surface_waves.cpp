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
/// From here on waves that creep are few enough, and up to here what is mirrored is all there is: both
/// such that the table, the waves and the asymptotic series agree to 3e-5.
constexpr double kDark = 2, kLight = -3;

/// Airy's functions and their slopes at x from 0 to 10 by their series.
struct Airy {
    explicit Airy(double x) {
        // Ai(0) and -Ai'(0): Abramowitz and Stegun, 10.4.
        constexpr double kAi = 0.355028053887817239, kSlope = 0.258819403792806798;
        double f = 1, g = x, fSlope = 0, gSlope = 1, fTerm = 1, gTerm = x;
        for (int k = 1; k < 80; ++k) {
            fTerm *= x * x * x / ((3.0 * k - 1) * (3.0 * k));
            gTerm *= x * x * x / ((3.0 * k) * (3.0 * k + 1));
            f += fTerm;
            g += gTerm;
            fSlope += fTerm * 3 * k / x;
            gSlope += gTerm * (3.0 * k + 1) / x;
        }
        ai = kAi * f - kSlope * g;
        aiSlope = kAi * fSlope - kSlope * gSlope;
        bi = std::numbers::sqrt3 * (kAi * f + kSlope * g);
        biSlope = std::numbers::sqrt3 * (kAi * fSlope + kSlope * gSlope);
    }
    double ai, aiSlope, bi, biSlope;
};

/// Places and weights of the integral: along the real axis to the right, and from exp(-2 i pi / 3) infinity to 0, where
/// what does not die away has been taken off.
class Quadrature {
  public:
    Quadrature() {
        constexpr double kRight = 6, kLeft = 9;
        const Complex down = std::polar(1.0, -2 * kSurfacePi / 3);
        const GaussRule<kNodes> rule;
        for (std::size_t i = 0; i < kNodes; ++i) {
            const double share = rule.places[i], weight = rule.weights[i];
            const Airy right(kRight * share), left(kLeft * share);
            nodes_[2 * i] = {kRight * share,
                             kRight * weight,
                             right.aiSlope,
                             right.ai,
                             Complex(right.biSlope, -right.aiSlope),
                             Complex(right.bi, -right.ai)};
            // There W2 is of Ai at exp(2 i pi / 3) times the length, and V + W2 / (2 i) is W1 / (2 i).
            const Complex w1 = std::polar(2.0, kSurfacePi / 6) * left.ai / (2.0 * kSurfaceI);
            const Complex w1Slope = std::polar(2.0, kSurfacePi / 6) / down * left.aiSlope / (2.0 * kSurfaceI);
            const Complex w2 = std::polar(1.0, kSurfacePi / 6) * Complex(left.ai, -left.bi);
            const Complex w2Slope = std::polar(1.0, kSurfacePi / 6) * std::polar(1.0, -kSurfacePi * 4 / 3) *
                                    Complex(left.aiSlope, -left.biSlope);
            nodes_[2 * i + 1] = {kLeft * share * down, -down * kLeft * weight, w1Slope, w1, w2Slope, w2};
        }
    }

    static constexpr std::size_t kNodes = 20;  // less than 5e-5 off
    struct Node {
        Complex place, weight, topSlope, top, bottomSlope, bottom;

        /// exp(-i xi t), with the weight.
        Complex turned(double xi) const { return weight * std::exp(-kSurfaceI * xi * place); }
        /// For q = -u / (1 - u).
        Complex ratio(double u) const { return ((1 - u) * topSlope + u * top) / ((1 - u) * bottomSlope + u * bottom); }
    };
    const std::array<Node, 2 * kNodes>& nodes() const { return nodes_; }

  private:
    std::array<Node, 2 * kNodes> nodes_;
};

/// The integral from kLight to kDark: by cubics between places of a table, less than 3e-5 off.
class SurfaceTable {
  public:
    SurfaceTable() {
        const Quadrature quadrature;
        const auto& nodes = quadrature.nodes();
        std::array<std::array<Complex, kAlong + 1>, 2 * Quadrature::kNodes> turned;
        for (std::size_t n = 0; n < nodes.size(); ++n)
            for (std::size_t i = 0; i <= kAlong; ++i) turned[n][i] = nodes[n].turned(kLight + kStep * double(i));
        for (std::size_t k = 0; k <= kAcross; ++k)
            for (std::size_t n = 0; n < nodes.size(); ++n) {
                const Complex ratio = nodes[n].ratio(double(k) / kAcross) / std::sqrt(kSurfacePi);
                for (std::size_t i = 0; i <= kAlong; ++i) places_[i][k] += ratio * turned[n][i];
            }
    }

    Complex at(double xi, double q) const {
        const Four along((xi - kLight) / kStep, kAlong), across(q / (q - 1) * kAcross, kAcross);
        Complex sum = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            Complex row = 0;
            for (std::size_t k = 0; k < 4; ++k) row += across.weights[k] * places_[along.first + i][across.first + k];
            sum += along.weights[i] * row;
        }
        return sum;
    }

  private:
    static constexpr std::size_t kAlong = 140, kAcross = 32;
    static constexpr double kStep = (kDark - kLight) / kAlong;

    /// Lagrange's cubic through four places of a table next to each other.
    struct Four {
        Four(double place, std::size_t last) {
            first = std::min(static_cast<std::size_t>(std::max(0.0, place - 1)), last - 3);
            const double a = place - double(first), b = a - 1, c = a - 2, d = a - 3;
            weights = {-b * c * d / 6, a * c * d / 2, -a * b * d / 2, a * b * c / 6};
        }
        std::size_t first;
        std::array<double, 4> weights;
    };

    std::array<std::array<Complex, kAcross + 1>, kAlong + 1> places_{};  // by xi, and by u of q = -u / (1 - u)
};

/// The sum over waves that creep: where W' = q W, which is followed from q = 0, where it is known, on.
Complex creeping(double xi, double q) {
    /// Zeros of Ai' and Ai there, without their signs: Abramowitz and Stegun, table 10.13.
    constexpr std::array<std::array<double, 2>, 6> kWaves{{{1.0187929716, 0.5356566560},
                                                           {3.2481975822, 0.4190154780},
                                                           {4.8200992112, 0.3804064686},
                                                           {6.1633073556, 0.3579079437},
                                                           {7.3721772551, 0.3423012444},
                                                           {8.4884867340, 0.3304762291}}};
    const int steps = std::clamp(1 + static_cast<int>(16 * std::abs(q)), 1, 8);
    Complex sum = 0;
    for (const auto& [zero, airy] : kWaves) {
        Complex place = zero * std::polar(1.0, -kSurfacePi / 3);
        Complex log = std::log(4 * kSurfacePi * airy * airy) - kSurfaceI * (kSurfacePi / 3);  // of W squared
        const double step = q / steps;
        for (int i = 0; i < steps; ++i) {
            // Heun's rule: a place moves by 1 / (place - q q), and W by q W times that.
            const double from = step * i, to = step * (i + 1);
            const Complex slope = 1.0 / (place - from * from), guess = place + step * slope;
            const Complex next = 1.0 / (guess - to * to);
            place += 0.5 * step * (slope + next);
            log += step * (from * slope + to * next);
        }
        sum += std::exp(-kSurfaceI * xi * place - log) / (place - q * q);
    }
    return 2.0 * kSurfaceI * std::sqrt(kSurfacePi) * sum;
}

}  // namespace

Complex surfaceFunction(double xi, double q) {
    static const SurfaceTable table;
    if (xi > kDark) return creeping(xi, q) + 0.5 / (std::sqrt(kSurfacePi) * xi);
    if (xi > kLight) return table.at(xi, q);
    // The asymptotic series, of which q turns the phase a little.
    const double cube = xi * xi * xi;
    return -0.5 * std::sqrt(-xi) * std::polar(1.0, cube / 12 + kSurfacePi / 4) *
               (1.0 - 2.0 * kSurfaceI / cube - 20 / (cube * cube)) * std::polar(1.0, 2 * std::atan(2 * q / xi)) +
           0.5 / (std::sqrt(kSurfacePi) * xi);
}

}  // namespace rtsg
