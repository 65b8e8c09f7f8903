// The logarithm, by a table of 128 short reciprocals and a series, and what is made of it: other bases, and inverse
// hyperbolic functions.
#include <rtsg/core/portable_math.h>

#include "kernels.h"

namespace rtsg::portable {

namespace {

constexpr Pair kOverLogOfTwo{0x1.71547652b82fep+0, 0x1.777d0ffda0d24p-56},
    kOverLogOfTen{0x1.bcb7b1526e50ep-2, 0x1.95355baaafad3p-57};

double rounded(Pair x) {
    return x.high + x.low;
}

/// Handles 0, infinity and negative numbers of log(x) as ISO C says; returns false for all others.
bool isOutside(double x, double& result) {
    if (x > 0 && x < kInfinity) return false;
    result = x == 0 ? -kInfinity : x > 0 ? x : kNaN;
    return true;
}

}  // namespace

double log(double x) {
    if (!isOrdinary(x)) [[unlikely]] {
        double result = 0;
        return isOutside(x, result) ? result : rounded(logarithm(x));
    }
    const Divided d = divided(x, 0);
    const double r = d.rest.high, z = r * r;
    const double series = (1. / 3 - r * (1. / 4)) + z * ((1. / 5 - r * (1. / 6)) + z * (1. / 7 - r * (1. / 8)));
    const Pair sum = quickSum(d.exponent * kLogOfTwo.high + d.entry.log, r);
    const double rest = (d.exponent * kLogOfTwo.low + d.entry.logRest) + d.rest.low;
    return sum.high + (sum.low + (rest + (r * z * series - .5 * z)));
}

double log1p(double x) {
    if (std::abs(x) < 0x1p-54) return x;
    if (!(x > -1 && x < kInfinity)) return x == -1 ? -kInfinity : x > 0 ? x : kNaN;
    return rounded(logarithmOfOneAnd({x, 0}));
}

double log2(double x) {
    double result = 0;
    return isOutside(x, result) ? result : rounded(logarithm(x) * kOverLogOfTwo);
}

double log10(double x) {
    double result = 0;
    return isOutside(x, result) ? result : rounded(logarithm(x) * kOverLogOfTen);
}

double asinh(double x) {
    const double size = std::abs(x);
    if (size < kTiny || !(size < kInfinity)) return x;
    Pair result;
    if (size > 0x1p60) {
        result = logarithm(size) + kLogOfTwo;
    } else {
        const Pair square = exactProduct(size, size), hypotenuse = root(Pair{1, 0} + square);
        result = logarithmOfOneAnd(Pair{size, 0} + square / (Pair{1, 0} + hypotenuse));
    }
    return std::copysign(rounded(result), x);
}

double acosh(double x) {
    if (!(x >= 1)) return kNaN;
    if (x > 0x1p60) return x == kInfinity ? x : rounded(logarithm(x) + kLogOfTwo);
    const Pair above = exactSum(x, -1);
    return rounded(logarithmOfOneAnd(above + root(above * (above + Pair{2, 0}))));
}

double atanh(double x) {
    const double size = std::abs(x);
    if (size < kTiny) return x;
    if (!(size < 1)) return size == 1 ? std::copysign(kInfinity, x) : kNaN;
    const Pair twice = logarithmOfOneAnd({size, 0}) + -logarithmOfOneAnd({-size, 0});
    return std::copysign(.5 * rounded(twice), x);
}

}  // namespace rtsg::portable
