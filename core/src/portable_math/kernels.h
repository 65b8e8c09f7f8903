// The exponential function and the logarithm with some 65 bits, of which the others are made. In line, as a power needs
// both.
#pragma once

#include <array>

#include "error_free.h"

namespace rtsg::portable {

// ---- exp ------------------------------------------------------------------------------------------------------------

/// The first part has 42 bits, so that whole multiples of it are exact, and sums of these with the logarithms of the
/// table below, too.
inline constexpr Pair kLogOfTwo{0x1.62e42fefa38p-1, 0x1.ef35793c7673p-45};

/// 2^(i / 128).
consteval std::array<Pair, 128> rootsOfTwo() {
    const Pair step{kLogOfTwo.high / 128, kLogOfTwo.low / 128};
    Pair root{1, 0};
    for (int k = 14; k >= 1; --k) root = Pair{1, 0} + root * (step / Pair{double(k), 0});
    std::array<Pair, 128> table{};
    table[0] = {1, 0};
    for (std::size_t i = 1; i < table.size(); ++i) table[i] = table[i - 1] * root;
    return table;
}
inline constexpr std::array<Pair, 128> kRootsOfTwo = rootsOfTwo();

/// fraction 2^exponent, the fraction from 1 to 2 or so.
struct Exponential {
    Pair fraction;
    int exponent;
};

/// exp(x + low) with a relative error of 2^-60. Precondition: |x| <= 800, and |low| is small beside 2^-10.
inline Exponential exponential(double x, double low) {
    // The first part of log(2) / 128 has 35 bits, so that whole multiples of it are exact.
    constexpr double kFirst = 0x1.62e42fef8p-8, kSecond = 0x1.1cf79abc9e3b4p-43;
    const double steps = nearestWhole(x * 0x1.71547652b82fep+7);
    const auto count = static_cast<std::int32_t>(steps);
    const double r = (x - steps * kFirst) - (steps * kSecond - low), square = r * r;
    const double series = r + square * ((.5 + r * (1. / 6)) + square * (1. / 24 + r * (1. / 120)));
    const Pair root = kRootsOfTwo[static_cast<std::size_t>(count & 127)];
    return {{root.high, root.low + root.high * series}, count >> 7};
}

// ---- log ------------------------------------------------------------------------------------------------------------

/// A reciprocal of 10 bits, with which products are exact, and the logarithm of its inverse; the first part is a
/// multiple of 2^-42.
struct Entry {
    double reciprocal, log, logRest;
};

/// The table for the 128 intervals between 0.6875 and 1.375: 80 of length 1/256 up to 1, then 48 of 1/128.
consteval std::array<Entry, 128> entries() {
    std::array<Entry, 128> table{};
    for (int i = 0; i < 128; ++i) {
        const double middle = i < 80 ? .6875 + (i + .5) / 256 : 1 + (i - 80 + .5) / 128;
        // Beside 1 the logarithm keeps its bits only where the table adds none.
        // NOLINTNEXTLINE(bugprone-incorrect-roundings): std::lround is no constant expression
        const double reciprocal = i == 79 || i == 80 ? 1 : static_cast<int>(512 / middle + .5) / 512.;
        const Pair ratio = Pair{1 - reciprocal, 0} / Pair{1 + reciprocal, 0}, square = ratio * ratio;
        Pair sum{0, 0};
        for (int k = 45; k >= 1; k -= 2) sum = Pair{2, 0} / Pair{double(k), 0} + sum * square;
        const Pair log = sum * ratio;
        constexpr double kShift = 0x1.8p10;
        const double high = (log.high + kShift) - kShift;
        table[static_cast<std::size_t>(i)] = {reciprocal, high, (log.high - high) + log.low};
    }
    return table;
}
inline constexpr std::array<Entry, 128> kEntries = entries();

/// x = 2^exponent (1 + rest) / reciprocal of the entry. Precondition: x is finite and positive.
struct Divided {
    const Entry& entry;
    Pair rest;
    int exponent;
};

/// Whether x is positive, finite and not subnormal.
constexpr bool isOrdinary(double x) {
    constexpr std::uint64_t kMin = std::uint64_t{1} << 52, kEnd = std::uint64_t{0x7ff} << 52;
    return std::bit_cast<std::uint64_t>(x) - kMin < kEnd - kMin;
}

/// Precondition: x is ordinary.
inline Divided divided(double x, double low) {
    constexpr std::uint64_t kMin = std::bit_cast<std::uint64_t>(.6875), kExponent = std::uint64_t{0xfff} << 52;
    const std::uint64_t bits = std::bit_cast<std::uint64_t>(x), above = bits - kMin;
    const auto exponent = static_cast<int>(static_cast<std::int64_t>(above) >> 52);
    const double fraction = std::bit_cast<double>(bits - (above & kExponent)), upper = upperHalf(fraction);
    const Entry& entry = kEntries[above >> 45 & 127];
    Pair rest = quickSum(upper * entry.reciprocal - 1, (fraction - upper) * entry.reciprocal);
    if (low != 0) {
        // Its scale may be too small for a double; then it is negligible beside x.
        const double scale = exponent > 1000 || exponent < -1000 ? 0 : powerOfTwo(-exponent);
        rest = exactSum(rest.high, rest.low + low * scale * entry.reciprocal);
    }
    return {entry, rest, exponent};
}

inline Pair logarithm(const Divided& x) {
    const double r = x.rest.high, upper = upperHalf(r), lower = (r - upper) + x.rest.low;
    // r^2 / 2, of which the first part is exact.
    const double square = .5 * upper * upper, squareRest = .5 * lower * (r + upper);
    const double z = r * r;
    const double series =
        (1. / 3 - r * (1. / 4)) + z * ((1. / 5 - r * (1. / 6)) + z * ((1. / 7 - r * (1. / 8)) + z * (1. / 9)));
    const Pair first = quickSum(x.exponent * kLogOfTwo.high + x.entry.log, r), second = quickSum(first.high, -square);
    const double low = (first.low + second.low) +
                       ((x.rest.low - squareRest) + (r * z * series + (x.exponent * kLogOfTwo.low + x.entry.logRest)));
    return quickSum(second.high, low);
}

/// log(x) with a relative error of 2^-66. Precondition: x is finite and positive.
inline Pair logarithm(double x) {
    if (isOrdinary(x)) [[likely]]
        return logarithm(divided(x, 0));
    Divided d = divided(x * 0x1p54, 0);
    d.exponent -= 54;
    return logarithm(d);
}

/// log(1 + x) likewise. Precondition: x > -1, finite.
inline Pair logarithmOfOneAnd(Pair x) {
    const Pair sum = exactSum(1, x.high), whole = quickSum(sum.high, sum.low + x.low);
    if (std::abs(x.high) < 0x1p-8) return logarithm(Divided{kEntries[80], x, 0});
    return logarithm(divided(whole.high, whole.low));
}

}  // namespace rtsg::portable
