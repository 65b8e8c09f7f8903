// Integrates over the correlation, by Gauss's rule.
#include "diffraction_two_shadows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "diffraction_wedge.h"

#include "gauss_rule.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kShadowPi = std::numbers::pi;

constexpr std::size_t kNodes = 24;

/// Beyond one half plane.
Complex oneShadow(double u) {
    const Complex beyond = 0.5 * std::polar(1.0, -0.5 * u * u) * fresnelBeyond(0.5 * u * u);
    return u < 0 ? 1.0 - beyond : beyond;
}

}  // namespace

Complex twoShadows(double first, double second, double together) {
    static const GaussRule<kNodes> rule;
    const double angle = std::asin(std::clamp(together, -1.0, 1.0));
    Complex sum = 0;
    for (std::size_t i = 0; i < kNodes; ++i) {
        const double sine = std::sin(angle * rule.places[i]);
        const double phase =
            0.5 * (first * first + second * second - 2 * first * second * sine) / std::max(1e-9, 1 - sine * sine);
        sum += rule.weights[i] * std::polar(1.0, -phase);
    }
    return oneShadow(first) * oneShadow(second) + angle / (2 * kShadowPi) * sum;
}

Complex rowExcess(const ShadowRow& row, double waveNumber) {
    // Beyond, the product is as good.
    constexpr double kNear = 12, kFar = 24;
    const double x = waveNumber * row.first, y = waveNumber * row.second, r = row.together;
    const double most = std::max(x, y), part = std::clamp((kFar - most) / (kFar - kNear), 0.0, 1.0);
    if (!(part > 0) || r == 0) return 0;
    const double a = std::sqrt(2 * x), b = std::sqrt(2 * y), rest = 1 - r * r;
    Complex both, product;
    if (!row.firstLit && !row.secondLit) {
        const double squares = x * x + y * y, share = squares > 0 ? x * x / squares : 0.5;
        both = twoShadows(a + r * b, b + r * a, r);
        product = 0.25 * std::polar(1.0, -(x + r * a * b + y)) *
                  ((1 - share) * fresnelBeyond(x * rest) * fresnelBeyond(y) +
                   share * fresnelBeyond(x) * fresnelBeyond(y * rest));
    } else if (row.firstLit && row.secondLit) {
        both = twoShadows(-a, -b, r);
        product = oneShadow(-a) * oneShadow(-b);
    } else {
        // The one in the dark, and the one beside the way to it, or from it.
        const double dark = row.firstLit ? b : a, lit = row.firstLit ? a : b;
        both = twoShadows(r * dark - std::sqrt(rest) * lit, dark, r);
        product = oneShadow(-lit) * oneShadow(dark);
    }
    return part * (both / product - 1.0);
}

}  // namespace rtsg
