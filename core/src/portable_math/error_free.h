// Sums and products of doubles together with what rounding takes from them, and numbers of twice the precision made of
// these.
//
// Invariant: with a fused multiply-add or without one, all results have the same bits, since the errors found are
// exact. Operands of products stay between 2^-900 and 2^900 (or are 0), so that these errors neither overflow nor
// underflow. Threading: functions without state. Source: T. J. Dekker, A floating-point technique for extending the
// available precision, Numer. Math. 18 (1971).
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace rtsg::portable {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity(),
                        kNaN = std::numeric_limits<double>::quiet_NaN();
/// Below it x^3 is less than half a unit in the last place of x.
inline constexpr double kTiny = 0x1p-28;

/// The number high + low, where low is small beside high.
struct Pair {
    double high, low;
};

/// a + b. Precondition: |a| >= |b|, or a is 0.
constexpr Pair quickSum(double a, double b) {
    const double sum = a + b;
    return {sum, b - (sum - a)};
}

/// a + b of any sizes.
constexpr Pair exactSum(double a, double b) {
    const double sum = a + b, part = sum - a;
    return {sum, (a - (sum - part)) + (b - part)};
}

/// a without its lower 27 bits, which leaves 26.
constexpr double upperHalf(double a) {
    return std::bit_cast<double>(std::bit_cast<std::uint64_t>(a) & ~((std::uint64_t{1} << 27) - 1));
}

/// a * b.
constexpr Pair exactProduct(double a, double b) {
    const double product = a * b;
#ifdef __FP_FAST_FMA
    if (!std::is_constant_evaluated()) return {product, __builtin_fma(a, b, -product)};
#endif
    // Halves are rounded to nearest: of 26 bits with a sign, so that products of halves are exact.
    constexpr double kSplit = 0x1p27 + 1;
    const double a1 = a * kSplit, a2 = a1 - (a1 - a), a3 = a - a2;
    const double b1 = b * kSplit, b2 = b1 - (b1 - b), b3 = b - b2;
    return {product, ((a2 * b2 - product) + a2 * b3 + a3 * b2) + a3 * b3};
}

constexpr Pair operator+(Pair a, Pair b) {
    const Pair sum = exactSum(a.high, b.high);
    return quickSum(sum.high, sum.low + (a.low + b.low));
}

constexpr Pair operator-(Pair a) {
    return {-a.high, -a.low};
}

constexpr Pair operator*(Pair a, Pair b) {
    const Pair product = exactProduct(a.high, b.high);
    return quickSum(product.high, product.low + (a.high * b.low + a.low * b.high));
}

/// Relative error 2^-100 or so.
constexpr Pair operator/(Pair a, Pair b) {
    const double quotient = a.high / b.high;
    const Pair taken = exactProduct(quotient, b.high);
    return quickSum(quotient, (((a.high - taken.high) - taken.low) + (a.low - quotient * b.low)) / b.high);
}

/// The root of a number that is not negative.
inline Pair root(Pair a) {
    const double estimate = std::sqrt(a.high);
    if (!(estimate > 0)) return {estimate, 0};
    const Pair square = exactProduct(estimate, estimate);
    return quickSum(estimate, (((a.high - square.high) - square.low) + a.low) / (2 * estimate));
}

/// 2^exponent, of one in [-1022, 1023].
constexpr double powerOfTwo(int exponent) {
    return std::bit_cast<double>(static_cast<std::uint64_t>(exponent + 1023) << 52);
}

/// x 2^exponent, rounded once. Precondition: x lies in [0.5, 4), and the exponent in [-1100, 1100].
constexpr double scaled(double x, int exponent) {
    if (exponent > 1000) return x * powerOfTwo(exponent - 100) * 0x1p100;
    if (exponent < -1000) return x * powerOfTwo(exponent + 100) * 0x1p-100;
    return x * powerOfTwo(exponent);
}

/// The nearest whole number to one below 2^51 in size, by an addition that leaves no room for fractions.
constexpr double nearestWhole(double x) {
    constexpr double kShift = 0x1.8p52;
    return (x + kShift) - kShift;
}

}  // namespace rtsg::portable
