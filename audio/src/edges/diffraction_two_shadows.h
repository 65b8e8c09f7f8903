// Half planes in a row at whose shadows' boundaries one is at once: what is left, beside the product of both.
//
// Source: the double Fresnel integral of two screens, Millington, Hewitt and Immirzi, Proc. IEE 109C (1962), 419-429,
// as the integral of two correlated normal variables (Plackett, Biometrika 41 (1954), 351-360) along the diagonal of
// complex numbers. Threading: pure functions.
#pragma once

#include <complex>

namespace rtsg {

/// The pressure beyond two half planes re that in the open. `first`, `second`: how far the straight way is in each
/// one's shadow, such that their ways are longer by the half of the square, in radians, below 0 in the light;
/// `together`: the correlation of places on both, 0 to 1, below 0 of screens from two sides.
std::complex<double> twoShadows(double first, double second, double together);

/// Two in a row: `first`, `second`: m, times wave number half of the square of the above, of each as if the other one
/// bent nothing after it, or before it.
struct ShadowRow {
    bool firstLit = false, secondLit = false;
    double first = 0, second = 0;
    double together = 0;
};
/// What is there, direct sound and all, re the product of what each leaves, less 1: nothing far from either boundary.
std::complex<double> rowExcess(const ShadowRow& row, double waveNumber);

}  // namespace rtsg
