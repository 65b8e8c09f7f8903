// Powers and roots.
#include <rtsg/core/portable_math.h>

#include <algorithm>
#include <array>

#include "kernels.h"

namespace rtsg::portable {

namespace {

bool isComplete(double x) {
    return std::trunc(x) == x;
}

bool isOdd(double x) {
    return std::abs(x) < 0x1p53 && isComplete(x) && std::fmod(x, 2) != 0;
}

/// The power if the base or the exponent is 0, infinite or NaN, by ISO C, F.10.4.4.
double specialPower(double base, double exponent) {
    if (exponent == 0 || base == 1) return 1;
    if (std::isnan(base) || std::isnan(exponent)) return kNaN;
    const double size = std::abs(base);
    if (std::isinf(exponent)) return size == 1 ? 1 : (size > 1) == (exponent > 0) ? kInfinity : 0;
    const double result = (size == 0) == (exponent > 0) ? 0 : kInfinity;
    return std::signbit(base) && isOdd(exponent) ? -result : result;
}

}  // namespace

double pow(double base, double exponent) {
    bool negative = false;
    if (!isOrdinary(base) || !(exponent != 0 && std::abs(exponent) < kInfinity)) [[unlikely]] {
        if (base == 0 || exponent == 0 || !std::isfinite(base) || !std::isfinite(exponent))
            return specialPower(base, exponent);
        if (base < 0 && !isComplete(exponent)) return kNaN;
        negative = base < 0 && isOdd(exponent);
    }
    // With larger exponents, only the power of base 1 is finite and not 0.
    const double power = std::clamp(exponent, -0x1p70, 0x1p70);
    const Pair log = logarithm(std::abs(base)), product = exactProduct(power, log.high);
    double result = product.high > 0 ? kInfinity : 0;
    if (std::abs(product.high) < 746) [[likely]] {
        const Exponential e = exponential(product.high, product.low + power * log.low);
        result = scaled(e.fraction.high + e.fraction.low, e.exponent);
    }
    return negative ? -result : result;
}

double cbrt(double x) {
    if (x == 0 || !std::isfinite(x)) return x;
    const double size = std::abs(x);
    // From one part in thirty, by a third of the exponent, each step takes three times as many digits.
    const bool small = size < 0x1p-1000;
    const double part = small ? size * 0x1p300 : size > 0x1p900 ? size * 0x1p-300 : size;
    const double back = small ? 0x1p-100 : size > 0x1p900 ? 0x1p100 : 1;
    double guess = std::bit_cast<double>(std::bit_cast<std::uint64_t>(part) / 3 + 0x2a9f7893782da1ce);
    for (int i = 0; i < 3; ++i) {
        const double cube = guess * guess * guess;
        guess = guess * ((cube + 2 * part) / (2 * cube + part));
    }
    const Pair cube = Pair{guess, 0} * exactProduct(guess, guess);
    const double left = (part - cube.high) - cube.low;
    return std::copysign((guess + left / (3 * guess * guess)) * back, x);
}

double hypot(std::span<const double> components) {
    double maximum = 0;
    bool isNumber = true;
    for (const double component : components) {
        if (std::isinf(component)) return kInfinity;
        isNumber &= component == component;
        maximum = std::max(maximum, std::abs(component));
    }
    if (!isNumber) return kNaN;
    const double scale = maximum > 0x1p400 ? 0x1p-600 : maximum < 0x1p-400 ? 0x1p600 : 1;
    // Numbers whose square is negligible beside the largest one.
    const double minimum = maximum * scale * 0x1p-60;
    Pair sum{0, 0};
    for (const double component : components)
        if (const double x = component * scale; std::abs(x) > minimum) sum = sum + exactProduct(x, x);
    const Pair length = root(sum);
    return (length.high + length.low) / scale;
}

double hypot(double x, double y) {
    const bool steep = std::abs(y) > std::abs(x);
    const double longer = std::abs(steep ? y : x), shorter = std::abs(steep ? x : y);
    if (!(longer < 0x1p400 && shorter > 0x1p-400)) return hypot(std::array{x, y});
    const Pair square = exactProduct(longer, longer), other = exactProduct(shorter, shorter),
               sum = quickSum(square.high, other.high);
    const Pair length = root({sum.high, sum.low + (square.low + other.low)});
    return length.high + length.low;
}

double hypot(double x, double y, double z) {
    return hypot(std::array{x, y, z});
}

}  // namespace rtsg::portable
