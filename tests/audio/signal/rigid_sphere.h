// Sound on a rigid sphere by the text books' series and the library's special functions.
#pragma once

#include <cmath>
#include <complex>
#include <numbers>

namespace rtsg::test {

/// The pressure on a rigid sphere beside what would be at its middle without it, of a tone from far away; waves go with
/// e^(i w t). `x`: the radius in wave lengths times 2 pi; `angle` between the way to the source and the place. Source:
/// Duda and Martens, JASA 104, 3048 (1998), equation 2 for a source far away.
inline std::complex<double> onRigidSphere(double x, double angle) {
    std::complex<double> sum = 0, phase(0, -1);
    for (unsigned m = 0; m < 8 + 2 * x; ++m) {
        // h' = m / x h_m - h_(m + 1), of h = j - i y.
        const auto hankel = [&](unsigned n) {
            return std::complex<double>(std::sph_bessel(n, x), -std::sph_neumann(n, x));
        };
        const double order = m;
        const std::complex<double> slope = order / x * hankel(m) - hankel(m + 1);
        sum += (2 * order + 1) * phase * std::legendre(m, std::cos(angle)) / slope;
        phase *= std::complex<double>(0, 1);
    }
    return sum / (x * x);
}

/// The pressure at ear 0 (left) or 1, for sound from an azimuth in degrees to the right of ahead.
inline std::complex<double> earOnSphere(double radius, double hertz, double azimuth, int ear, double speed = 343) {
    const double side = std::sin(azimuth * std::numbers::pi / 180);
    return onRigidSphere(2 * std::numbers::pi * hertz * radius / speed, std::acos(ear == 0 ? -side : side));
}

}  // namespace rtsg::test
