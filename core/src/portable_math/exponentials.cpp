// The exponential function, by a table of 128 roots of two and a short series, and the hyperbolic functions that are
// made of it.
#include <rtsg/core/portable_math.h>

#include "kernels.h"

namespace rtsg::portable {

namespace {

/// Beyond these exp() is infinite, or less than half of the least number.
constexpr double kLargest = 0x1.62e42fefa39efp+9, kSmallest = -0x1.74910d52d3052p+9;
/// Below it the next term of a series is less than half a unit in the last place.
constexpr double kMinute = 0x1p-54;

/// The fraction times 2^(exponent - common).
Pair besides(const Exponential& e, int common) {
    const double scale = powerOfTwo(e.exponent - common);
    return {e.fraction.high * scale, e.fraction.low * scale};
}

/// Pairs for sinh(x) and cosh(x), halved by 2^exponent, of an x in [0, 40].
struct Hyperbola {
    Pair sine, cosine;
    int exponent;
};

/// sinh(x) - x, of |x| <= 0.3.
double sinhRest(double x) {
    const double z = x * x;
    return x * z *
           (1. / 6 +
            z * (1. / 120 + z * (1. / 5040 + z * (1. / 362880 + z * (1. / 39916800 + z * (1. / 6227020800.))))));
}

Hyperbola hyperbola(double x) {
    const Exponential grown = exponential(x, 0), shrunk = exponential(-x, 0);
    const int common = grown.exponent;
    const Pair more = besides(grown, common), less = besides(shrunk, common);
    const Pair sum = quickSum(more.high, less.high);
    Hyperbola created{{x, 0}, quickSum(sum.high, sum.low + (more.low + less.low)), common - 1};
    if (x <= .3) {
        // In the size of the others.
        const double scale = powerOfTwo(1 - common);
        created.sine = quickSum(x * scale, sinhRest(x) * scale);
    } else {
        const Pair difference = quickSum(more.high, -less.high);
        created.sine = quickSum(difference.high, difference.low + (more.low - less.low));
    }
    return created;
}

}  // namespace

double exp(double x) {
    if (!(std::abs(x) < 0x1p10)) return std::isnan(x) ? x : x > 0 ? kInfinity : 0;
    if (x > kLargest) return kInfinity;
    if (x < kSmallest) return 0;
    const Exponential e = exponential(x, 0);
    return scaled(e.fraction.high + e.fraction.low, e.exponent);
}

double expm1(double x) {
    const double size = std::abs(x);
    if (size < kMinute) return x;
    if (size < .1) {
        const double series =
            1. / 6 +
            x * (1. / 24 +
                 x * (1. / 120 +
                      x * (1. / 720 +
                           x * (1. / 5040 +
                                x * (1. / 40320 + x * (1. / 362880 + x * (1. / 3628800 + x * (1. / 39916800))))))));
        const Pair square = exactProduct(x, x), sum = quickSum(x, .5 * square.high);
        return sum.high + (sum.low + (.5 * square.low + x * square.high * series));
    }
    if (!(x < 45)) return exp(x);
    if (x < -45) return -1;
    const Exponential e = exponential(x, 0);
    const Pair grown = besides(e, 0), sum = exactSum(grown.high, -1);
    return sum.high + (sum.low + grown.low);
}

double sinh(double x) {
    const double size = std::abs(x);
    if (size < kMinute) return x;
    if (size <= .3) return x + sinhRest(x);
    if (!(size < 40)) {
        if (!(size < 711)) return std::isnan(x) ? x : std::copysign(kInfinity, x);
        const Exponential e = exponential(size, 0);
        return std::copysign(scaled(e.fraction.high + e.fraction.low, e.exponent - 1), x);
    }
    const Hyperbola h = hyperbola(size);
    return std::copysign(scaled(h.sine.high + h.sine.low, h.exponent), x);
}

double cosh(double x) {
    const double size = std::abs(x);
    if (!(size < 40)) {
        if (!(size < 711)) return std::isnan(x) ? x : kInfinity;
        const Exponential e = exponential(size, 0);
        return scaled(e.fraction.high + e.fraction.low, e.exponent - 1);
    }
    const Hyperbola h = hyperbola(size);
    return scaled(h.cosine.high + h.cosine.low, h.exponent);
}

double tanh(double x) {
    const double size = std::abs(x);
    if (size < kTiny) return x;
    if (!(size < 22)) return std::isnan(x) ? x : std::copysign(1, x);
    const Hyperbola h = hyperbola(size);
    const Pair tangent = h.sine / h.cosine;
    return std::copysign(tangent.high + tangent.low, x);
}

}  // namespace rtsg::portable
