// The field along a curved surface beside waves that creep along it, and from place to place of its table.
#include <array>
#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include "round_bodies/diffraction_surface_waves.h"

namespace rtsg {
namespace {

using SurfaceValue = std::complex<double>;

/// Residues at the zeros of the slope of W2: zeros of Ai' without their signs,
/// and Ai there (Abramowitz and Stegun, table 10.13).
SurfaceValue creepingAlong(double xi) {
    constexpr std::array<std::array<double, 2>, 10> kWaves{{{1.01879297, .53565666},
                                                            {3.24819758, -.41901548},
                                                            {4.82009921, .38040647},
                                                            {6.16330736, -.35790794},
                                                            {7.37217726, .34230124},
                                                            {8.48848673, -.33047623},
                                                            {9.53544905, .32102229},
                                                            {10.52766040, -.31318539},
                                                            {11.47505663, .30651729},
                                                            {12.38478837, -.30073083}}};
    SurfaceValue sum = 0;
    for (const auto& [zero, airy] : kWaves)
        sum += std::exp(-SurfaceValue(0, 1) * xi * zero * std::polar(1.0, -M_PI / 3)) / (zero * airy * airy);
    return -sum * std::polar(1.0, M_PI / 6) / (2 * std::sqrt(M_PI));
}

TEST(SurfaceWaves, AreThoseThatCreepInTheDark) {
    for (double xi = .8; xi < 3; xi += .0137) {
        const SurfaceValue expected = creepingAlong(xi) + .5 / (std::sqrt(M_PI) * xi);
        const SurfaceValue is = surfaceFunction(xi);
        EXPECT_NEAR(std::abs(is - expected), 0, 1e-4) << xi << ": " << is << ", " << expected;
    }
}

TEST(SurfaceWaves, AreSmoothFromPlaceToPlace) {
    // Where a cubic ends and the next one begins, and where another formula does, a fifth difference would show it.
    constexpr double kStep = .01;
    for (double xi = -2.95; xi < 1.95; xi += kStep) {
        const auto at = [&](int i) { return surfaceFunction(xi + i * kStep); };
        const SurfaceValue off = at(2) - 5.0 * at(1) + 10.0 * at(0) - 10.0 * at(-1) + 5.0 * at(-2) - at(-3);
        EXPECT_LT(std::abs(off), 1e-4) << xi;
    }
}

}  // namespace
}  // namespace rtsg
