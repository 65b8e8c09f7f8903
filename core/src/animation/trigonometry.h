// Sine, cosine and arc tangent in doubles, to a unit or two in the last place: polynomials in line, which cost a third
// of calls where each node needs several, and give the same bits with every mathematical library.
//
// Source: the polynomials and the parts of pi/2 are those of fdlibm 5.3 (k_sin.c, k_cos.c, s_atan.c, e_rem_pio2.c).
// Threading: free functions without state.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include <rtsg/core/portable_math.h>

namespace rtsg {

using portable::SineCosine;

/// Absolute error at most 3e-16. Beyond 10^5 radians, and for values that are not finite, the same as
/// portable::sineCosine().
inline SineCosine sineCosine(double angle) {
    if (!(std::abs(angle) <= 1e5)) return portable::sineCosine(angle);
    // The first part has 33 bits, so that whole multiples of it are exact.
    constexpr double kQuarter = 1.57079632673412561417e+00, kQuarterRest = 6.07710050650619224932e-11;
    const double quarters = std::nearbyint(angle * (2 / std::numbers::pi));
    const double x = (angle - quarters * kQuarter) - quarters * kQuarterRest, z = x * x, w = z * z;
    // Terms by twos, which a processor adds up side by side.
    const double sineRest = (-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03) +
                            w * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                                 w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10));
    const double sine = x + x * z * sineRest;
    const double cosineRest = (4.16666666666666019037e-02 + z * -1.38888888888741095749e-03) +
                              w * ((2.48015872894767294178e-05 + z * -2.75573143513906633035e-07) +
                                   w * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    const double cosine = 1 - (.5 * z - w * cosineRest);
    const auto quadrant = static_cast<std::int32_t>(quarters);
    const double s = quadrant & 1 ? cosine : sine, c = quadrant & 1 ? sine : cosine;
    return {quadrant & 2 ? -s : s, (quadrant + 1) & 2 ? -c : c};
}

/// atan2(y, x) in the first quadrant, with a relative error of at most 5e-16. Precondition: neither is negative or
/// infinite, nor are both 0.
inline double quadrantAngle(double y, double x) {
    constexpr double kTangent = .41421356237309503;  // of an eighth of half a turn
    // From the nearest of three directions: along x, between the two, along y.
    const bool isLow = y < kTangent * x, isHigh = x < kTangent * y;
    const double above = isLow ? y : isHigh ? -x : y - x, along = isLow ? x : isHigh ? y : y + x;
    const double from = isLow ? 0 : isHigh ? std::numbers::pi / 2 : std::numbers::pi / 4;
    const double t = above / along, z = t * t, w = z * z, v = w * w;
    const double odd = (3.33333333333329318027e-01 + w * 1.42857142725034663711e-01) +
                       v * ((9.09088713343650656196e-02 + w * 6.66107313738753120669e-02) +
                            v * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02));
    const double even =
        (-1.99999999998764832476e-01 + w * -1.11111104054623557880e-01) +
        v * ((-7.69187620504482999495e-02 + w * -5.83357013379057348645e-02) + v * -3.65315727442169155270e-02);
    return from + (t - t * (z * odd + w * even));
}

}  // namespace rtsg
