// Sine, cosine, tangent and their inverses. An angle is first reduced to one within an eighth of a turn, with more bits
// than a double has.
#include <rtsg/core/portable_math.h>

#include <array>

#include "error_free.h"

namespace rtsg::portable {

namespace {

constexpr Pair kHalfPi{0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54}, kPi{0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53};

// ---- sine, cosine, tangent ------------------------------------------------------------------------------------------

/// An angle less whole quarters of a turn, at most pi/4 in size and with a relative error of 2^-66; the quarters
/// modulo 4.
struct Reduced {
    Pair angle;
    unsigned quadrant;
};

/// The bits of 2/pi, after a word of those before the point.
constexpr std::array<std::uint64_t, 21> kTwoOverPi{0,
                                                   0xa2f9836e4e441529,
                                                   0xfc2757d1f534ddc0,
                                                   0xdb6295993c439041,
                                                   0xfe5163abdebbc561,
                                                   0xb7246e3a424dd2e0,
                                                   0x06492eea09d1921c,
                                                   0xfe1deb1cb129a73e,
                                                   0xe88235f52ebb4484,
                                                   0xe99c7026b45f7e41,
                                                   0x3991d639835339f4,
                                                   0x9c845f8bbdf9283b,
                                                   0x1ff897ffde05980f,
                                                   0xef2f118b5a0a6d1f,
                                                   0x6d367ecf27cb09b7,
                                                   0x4f463f669e5fea2d,
                                                   0x7527bac7ebe5f17b,
                                                   0x3d0739f78a5292ea,
                                                   0x6bfb5fb11f8d5d08,
                                                   0x56033046fc7b6bab,
                                                   0xf0cfbc209af4361d};

/// The upper 64 bits of a product.
std::uint64_t upperWord(std::uint64_t a, std::uint64_t b) {
    const std::uint64_t a1 = a >> 32, a0 = a & 0xffffffff, b1 = b >> 32, b0 = b & 0xffffffff;
    const std::uint64_t middle = a1 * b0 + (a0 * b0 >> 32), other = a0 * b1 + (middle & 0xffffffff);
    return a1 * b1 + (middle >> 32) + (other >> 32);
}

/// Reduces any finite angle beyond pi/4: multiplies its mantissa by the bits of 2/pi that matter (Payne and Hanek).
Reduced reducedByBits(double angle) {
    const auto bits = std::bit_cast<std::uint64_t>(angle);
    const std::uint64_t mantissa = (bits & 0xfffffffffffff) | std::uint64_t{1} << 52;
    const int exponent = static_cast<int>(bits >> 52 & 0x7ff) - 1075;
    // The first of 192 bits stands for two quarters in the product; bits for four quarters and more make no difference.
    const unsigned first = static_cast<unsigned>(exponent - 2 + 64), word = first / 64, shift = first % 64;
    std::array<std::uint64_t, 3> window{};
    for (std::size_t i = 0; i < 3; ++i)
        window[i] = shift == 0 ? kTwoOverPi[word + i]
                               : kTwoOverPi[word + i] << shift | kTwoOverPi[word + i + 1] >> (64 - shift);
    const std::uint64_t low = mantissa * window[2], middle = mantissa * window[1] + upperWord(mantissa, window[2]);
    const std::uint64_t carry = middle < mantissa * window[1] ? 1 : 0;
    const std::uint64_t high = mantissa * window[0] + upperWord(mantissa, window[1]) + carry;
    // To the nearest quarter: the fraction is then signed.
    const std::uint64_t quadrant = (high >> 62) + (high >> 61 & 1);
    std::array<std::uint64_t, 3> fraction{high << 2 | middle >> 62, middle << 2 | low >> 62, low << 2};
    const bool negative = fraction[0] >> 63;
    if (negative) {
        fraction = {~fraction[0], ~fraction[1], ~fraction[2] + 1};
        if (fraction[2] == 0 && ++fraction[1] == 0) ++fraction[0];
    }
    double size = 0x1p-64;
    while (fraction[0] == 0) {
        fraction = {fraction[1], fraction[2], 0};
        size *= 0x1p-64;
    }
    // Parts of 32 bits are exact as doubles.
    const auto part = [](std::uint64_t value) { return static_cast<double>(value); };
    Pair sum = quickSum(part(fraction[0] >> 32) * 0x1p32, part(fraction[0] & 0xffffffff));
    sum = sum + Pair{part(fraction[1] >> 32) * 0x1p-32, part(fraction[1] & 0xffffffff) * 0x1p-64};
    sum = sum + Pair{part(fraction[2] >> 32) * 0x1p-96, 0};
    const Pair reduced = Pair{sum.high * size, sum.low * size} * kHalfPi;
    const bool turned = negative != std::signbit(angle);
    return {turned ? -reduced : reduced, static_cast<unsigned>(std::signbit(angle) ? 0 - quadrant : quadrant)};
}

Reduced reduced(double angle) {
    const double size = std::abs(angle);
    if (size <= 0x1.921fb54442d18p-1) return {{angle, 0}, 0};
    if (size < 0x1p20) {
        // The first two parts of pi/2 have 33 bits, so that whole multiples of them are exact.
        constexpr double kFirst = 0x1.921fb544p+0, kSecond = 0x1.0b4611a6p-34, kThird = 0x1.3198a2e037073p-69;
        const double quarters = nearestWhole(angle * 0x1.45f306dc9c883p-1);
        const Pair rest = exactSum(angle - quarters * kFirst, -(quarters * kSecond));
        const double below = rest.low - quarters * kThird;
        if (std::abs(rest.high) > 0x1p-30)
            return {quickSum(rest.high, below), static_cast<unsigned>(static_cast<int>(quarters))};
    }
    if (!(size < kInfinity)) return {{kNaN, 0}, 0};
    return reducedByBits(angle);
}

/// Polynomials of the least error; both sums are left open, as the tangent needs more bits than a sine has.
Pair sineOf(Pair x) {
    const double z = x.high * x.high, w = z * z;
    const double series = (-0.16666666666666632 + z * 0.008333333333322425) +
                          w * ((-0.0001984126982981709 + z * 2.7557313695254454e-06) +
                               w * (-2.5050758654674153e-08 + z * 1.589682786503836e-10));
    return {x.high, x.high * z * series + x.low * (1 - .5 * z)};
}

Pair cosineOf(Pair x) {
    const Pair square = exactProduct(x.high, x.high);
    const double z = square.high, w = z * z;
    const double series = (0.0416666666666666 + z * -0.001388888888887414) +
                          w * ((2.4801587289492284e-05 + z * -2.755731435535206e-07) +
                               w * (2.087572369697675e-09 + z * -1.1359670413772756e-11));
    const Pair first = quickSum(1, -.5 * z);
    return {first.high, first.low + (w * series - (x.high * x.low + .5 * square.low))};
}

double signedSum(Pair x, unsigned quadrant) {
    const double sum = x.high + x.low;
    return quadrant & 2 ? -sum : sum;
}

}  // namespace

double sin(double angle) {
    if (std::abs(angle) < kTiny) return angle;
    const Reduced r = reduced(angle);
    return signedSum(r.quadrant & 1 ? cosineOf(r.angle) : sineOf(r.angle), r.quadrant);
}

double cos(double angle) {
    const Reduced r = reduced(angle);
    return signedSum(r.quadrant & 1 ? sineOf(r.angle) : cosineOf(r.angle), r.quadrant + (r.quadrant & 1));
}

SineCosine sineCosine(double angle) {
    if (std::abs(angle) < kTiny) return {angle, 1};
    const Reduced r = reduced(angle);
    const Pair s = sineOf(r.angle), c = cosineOf(r.angle);
    return {signedSum(r.quadrant & 1 ? c : s, r.quadrant),
            signedSum(r.quadrant & 1 ? s : c, r.quadrant + (r.quadrant & 1))};
}

double tan(double angle) {
    if (std::abs(angle) < kTiny) return angle;
    const Reduced r = reduced(angle);
    const Pair s = sineOf(r.angle), c = cosineOf(r.angle);
    const Pair sine = quickSum(s.high, s.low), cosine = quickSum(c.high, c.low);
    const Pair tangent = r.quadrant & 1 ? -(cosine / sine) : sine / cosine;
    return tangent.high + tangent.low;
}

// ---- inverses -------------------------------------------------------------------------------------------------------

namespace {

/// atan(i / 16).
consteval std::array<Pair, 17> arcTangents() {
    std::array<Pair, 17> table{};
    for (int i = 1; i <= 16; ++i) {
        // The tangent of the step from the last.
        const Pair step = Pair{16, 0} / Pair{256. + i * (i - 1), 0}, square = step * step;
        Pair sum{0, 0};
        for (int k = 27; k >= 1; k -= 2) sum = Pair{k % 4 == 1 ? 1. : -1., 0} / Pair{double(k), 0} + sum * square;
        table[static_cast<std::size_t>(i)] = table[static_cast<std::size_t>(i - 1)] + sum * step;
    }
    return table;
}
constexpr std::array<Pair, 17> kArcTangents = arcTangents();

/// asin(x) / x - 1, of x^2 = z in [0, 1/4]: a polynomial of the least error.
double arcSineSeries(double z) {
    const double w = z * z, v = w * w;
    const double a =
        (0.16666666666666763 + z * 0.07499999999970268) + w * (0.044642857175116374 + z * 0.030381942683806683);
    const double b =
        (0.022372215655482048 + z * 0.01735160017051314) + w * (0.013980960591397836 + z * 0.011397782421613066);
    const double c =
        (0.01078649599740072 + z * 0.0036831567481388854) + w * (0.0217632416618308 + z * -0.021076955020936594);
    return z * (a + v * (b + v * (c + v * 0.0326766938668196)));
}

/// asin(size) of a size of at most 1/2; beyond that half of acos(size), which has this sine.
Pair arcSineOrHalf(double size) {
    if (size <= .5) return {size, size * arcSineSeries(size * size)};
    const double square = (1 - size) / 2;
    const Pair sine = root({square, 0});
    return {sine.high, sine.low + sine.high * arcSineSeries(square)};
}

/// base + factor * angle.
double turned(Pair base, double factor, Pair angle) {
    const Pair sum = quickSum(base.high, factor * angle.high);
    return sum.high + (sum.low + (base.low + factor * angle.low));
}

/// atan(y / x). Precondition: 0 <= y <= x, x lies in [2^-800, 2^800], and y is 0 or at least 2^-900.
Pair octantAngle(double y, double x) {
    // From the nearest of seventeen directions.
    const int nearest = static_cast<int>(y / x * 16 + .5);  // NOLINT(bugprone-incorrect-roundings): not negative
    const double tangent = nearest * (1. / 16);
    const Pair base = kArcTangents[static_cast<std::size_t>(nearest)];
    const Pair less = exactProduct(tangent, x), more = exactProduct(tangent, y);
    const Pair above = exactSum(y, -less.high), along = quickSum(x, more.high);
    const double inverse = 1 / along.high, t = above.high * inverse;
    const Pair taken = exactProduct(t, along.high);
    const double rest = (above.low - less.low) - t * (along.low + more.low);
    const double low = (((above.high - taken.high) - taken.low) + rest) * inverse;
    const double z = t * t, w = z * z;
    const double series = z * ((-1. / 3 + z * (1. / 5)) + w * ((-1. / 7 + z * (1. / 9)) + w * (-1. / 11)));
    const Pair sum = quickSum(base.high, t);
    return {sum.high, sum.low + (base.low + (low + t * series))};
}

constexpr Pair kNothing{0, 0};

}  // namespace

double asin(double x) {
    const double size = std::abs(x);
    if (size < kTiny) return x;
    if (!(size <= 1)) return kNaN;
    const Pair angle = arcSineOrHalf(size);
    return std::copysign(size <= .5 ? angle.high + angle.low : turned(kHalfPi, -2, angle), x);
}

double acos(double x) {
    const double size = std::abs(x);
    if (!(size <= 1)) return kNaN;
    const bool small = size <= .5;
    const Pair base = small ? kHalfPi : x > 0 ? kNothing : kPi;
    return turned(base, small ? (x > 0 ? -1 : 1) : x > 0 ? 2 : -2, arcSineOrHalf(size));
}

double atan(double x) {
    const double size = std::abs(x);
    if (size < kTiny) return x;
    if (!(size < 0x1p54)) return std::isnan(x) ? kNaN : std::copysign(kHalfPi.high, x);
    const bool steep = size > 1;
    const Pair angle = octantAngle(steep ? 1 : size, steep ? size : 1);
    return std::copysign(turned(steep ? kHalfPi : kNothing, steep ? -1 : 1, angle), x);
}

double atan2(double y, double x) {
    // By whether it lies nearer to the y axis, and whether it points back along the x axis.
    static constexpr std::array<Pair, 4> kBases{kNothing, kPi, kHalfPi, kHalfPi};
    static constexpr std::array<double, 4> kFactors{1, -1, -1, 1};
    const double above = std::abs(y), along = std::abs(x);
    const bool steep = above > along;
    const std::size_t sector = (steep ? 2u : 0u) + (std::signbit(x) ? 1u : 0u);
    const double shorter = steep ? along : above, longer = steep ? above : along;
    Pair angle = kNothing;
    if (longer > 0x1p-500 && longer < 0x1p500 && shorter > longer * 0x1p-64) [[likely]] {
        angle = octantAngle(shorter, longer);
    } else if (!(shorter <= longer)) {
        return kNaN;
    } else if (longer == kInfinity) {
        if (shorter == longer) angle = kArcTangents[16];
    } else if (shorter <= longer * 0x1p-64) {
        // The angle is its tangent; beside a quarter or half a turn it is nothing.
        if (sector == 0 && longer > 0) return std::copysign(shorter / longer, y);
    } else {
        const double scale = longer > 1 ? 0x1p-600 : 0x1p600;
        angle = octantAngle(shorter * scale, longer * scale);
    }
    return std::copysign(turned(kBases[sector], kFactors[sector], angle), y);
}

}  // namespace rtsg::portable
